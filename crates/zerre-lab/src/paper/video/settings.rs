//! What the reproduction of the structural trackers assumes beside the trackers' own settings, which are the
//! presets of `AppearanceSettings`.

/// The text of this file, so that a report can say by which settings, to the letter, it was made.
pub const SOURCE: &str = include_str!("settings.rs");

/// Runs of each tracker on each sequence, as in the paper.
pub const RUNS: usize = 10;
/// Runs of the short version: the fewest whose intervals say something.
pub const QUICK_RUNS: usize = 3;
/// Frames by which a tracker's speed is measured.
pub const TIMED_FRAMES: usize = 200;
/// A printed error counts as reproduced where ours differs from it by at most this share of it.
pub const TOLERANCE: f64 = 0.45;

/// The run that is pictured, ...
pub const PICTURED_RUN: usize = 0;
/// ... the trackers, ...
pub const PICTURED_TRACKERS: [&str; 2] = ["rt", "massimahe"];
/// ... and the frames of sequences, from 1.
pub const PICTURED: [(&str, &[usize]); 2] = [("FaceOcc1", &[100, 300, 550]), ("Suv", &[150, 540, 700])];
/// Width of the pictures, pixels.
pub const PICTURED_WIDTH: u16 = 480;
