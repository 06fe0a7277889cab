//! What the reproduction of the fusion of colour and depth assumes beside the settings of its filters, which
//! are `ThesisSettings`, and `TrackerSettings` with what is learnt from the calibration clips below.

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

/// Particles of the filters in pictures.
pub const PICTURED_PARTICLES: [usize; 5] = [10, 50, 150, 500, 5000];

/// A recording of a real camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedClip {
    /// Its folder.
    pub name: &'static str,
    /// Its name in rows.
    pub condition: &'static str,
    /// First and last number of the frames that the empty room is the median of.
    pub empty: [u32; 2],
    /// The number of the first frame that is followed, and where the point is in it, pixels.
    pub first: (u32, [f64; 2]),
    /// What is followed.
    pub follows: &'static str,
    /// What a person sees there.
    pub seen: &'static str,
}

/// The recordings of the table `recorded`. First places were read off the pictures by eye, with a grid of 100
/// pixels over them, in the first frame in which the point can be told; nothing was tried beside them.
pub const RECORDED: [RecordedClip; 3] = [
    RecordedClip {
        name: "um",
        condition: "recorded-um",
        // There is no empty frame; a person who walks hides no place for long.
        empty: [1, 38],
        first: (3, [201.0, 416.0]),
        follows: "the right hand of the man who walks",
        seen: "In a run of seed 1: the man turns his back, walks off and comes back; his hand is some 15 \
               pixels wide and moves by up to 60 from one frame to the next. The sound filter loses it \
               within a few frames and flags about half of the rest; in some frames it stands on his \
               trousers and, on the way back, on his head, and does not say so. The thesis's particles stay \
               about where they began, and nothing tells that they are wrong.",
    },
    RecordedClip {
        name: "filinha",
        condition: "recorded-filinha",
        empty: [9, 26],
        first: (29, [285.0, 421.0]),
        follows: "the right hand of the first who walks",
        seen: "In a run of seed 1: five people cross, and hands, faces and arms come and go by the dozen. \
               The sound filter loses the first man's hand within a few frames; its particles then lie on \
               several people, its ellipse takes up most of the picture, and it is flagged as lost in most \
               frames. The thesis's particles go from one passer-by to the next: whatever moves in their \
               window is the hand to them.",
    },
    RecordedClip {
        name: "corridor",
        condition: "recorded-corridor",
        // A chair stands elsewhere in the other empty frames.
        empty: [25, 25],
        first: (1, [440.0, 194.0]),
        follows: "the head, since hands are before the body, unseen, in most frames",
        seen: "In a run of seed 1: the sound filter stays about the head, with a wide ellipse, while the \
               man walks away, until it is as dark as the doorway behind it; from there on it is flagged as \
               lost and not found again on the way back, when the face is seen and no longer the hair. The \
               thesis's particles hang about the door frame.",
    },
];
/// Frames per second that recordings without times are taken to have: judged from how far a walking person
/// comes from one to the next.
pub const RECORDED_RATE_HZ: f64 = 3.0;
/// Frames of a recording in pictures.
pub const RECORDED_FRAMES: usize = 12;
/// Sources whose silence is counted in recordings.
pub const CUES: [&str; 4] = ["color", "depth", "thesis-color", "thesis-depth"];
