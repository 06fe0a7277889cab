//! What the reproduction of the fusion of colour and depth assumes beside the settings of its filters, which are
//! `ThesisSettings`, and `TrackerSettings` with what is learnt from the calibration clips below.

use zerre_vision::rgbd::scene::Condition;

/// The text of this file, so that a report can say by which settings, to the letter, it was made.
pub const SOURCE: &str = include_str!("settings.rs");

/// Clips of each condition, each of another person, room and movement.
pub const CLIPS: usize = 5;
/// Clips of the short version.
pub const QUICK_CLIPS: usize = 2;
/// Runs of the sound filter on each clip.
pub const RUNS: usize = 2;
/// Numbers of particles that the thesis goes through.
pub const SWEEP: [usize; 9] = [10, 25, 50, 100, 250, 500, 1000, 2500, 5000];
/// Number of particles that the thesis chose.
pub const CHOSEN: usize = 150;
/// Runs of the thesis's filter for each number, as in the thesis.
pub const SWEEP_RUNS: usize = 20;
/// Clips that sources are learnt from; they share no value with the clips above.
pub const CALIBRATION_CLIPS: u64 = 12;
/// Times that the calibration clips are gone through.
pub const CALIBRATION_ROUNDS: usize = 2;
/// Of a curve's range, what it may leave its level by when it has settled.
pub const SETTLED: f64 = 0.05;
/// Frames on both sides over which a curve is smoothed before.
pub const SMOOTH: usize = 5;
/// Frames whose time is taken.
pub const TIMED_FRAMES: usize = 111;

/// A condition: a scene, and the source that is taken away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Under {
    /// Its name in rows.
    pub name: &'static str,
    /// The clips.
    pub scene: Condition,
    /// `device`, `color` or `depth`.
    pub without: Option<&'static str>,
}

/// All conditions, in the order of the rows.
pub const CONDITIONS: [Under; 8] = [
    Under { name: "light", scene: Condition::Light, without: None },
    Under { name: "clutter", scene: Condition::Clutter, without: None },
    Under { name: "flicker", scene: Condition::Flicker, without: None },
    Under { name: "behind-back", scene: Condition::BehindBack, without: None },
    Under { name: "device-drop-out", scene: Condition::DeviceDropOut, without: None },
    Under { name: "without-color", scene: Condition::Light, without: Some("color") },
    Under { name: "without-depth", scene: Condition::Light, without: Some("depth") },
    Under { name: "without-device", scene: Condition::Light, without: Some("device") },
];
