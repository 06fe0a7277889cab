//! What the reproduction of the multi-ball example assumes beside the readings, which are
//! `zerre_vision::balls::thesis::READINGS`.

/// The text of this file, so that a report can say by which settings, to the letter, it was made.
pub const SOURCE: &str = include_str!("settings.rs");

/// Runs of each cell.
pub const RUNS: usize = 20;
/// Draws of the linear model for each run: they are cheap, and ratios so near to 1 need many.
pub const FLOOR_RUNS: usize = 5;
/// Sizes of the short version: the smallest of the printed table and those that goals are set for.
pub const QUICK_PARTICLES: [usize; 3] = [5, 250, 1000];

/// The clip of the table.
pub const SCENE: &str = "balls-free";
/// Its mean speed, px per frame, and how fast it changes, px per frame squared. The thesis gives neither. A cloud of
/// particles lags behind the faster, and its nearest particle is the farther off: these were chosen so that reading a
/// comes near the printed column of the green ball, on the seeds 0 to 9 and on true places; reports use others.
pub const SPEED: f64 = 4.5;
/// See [`SPEED`].
pub const ACCELERATION: f64 = 0.3;
/// Balls of the printed table, the largest first.
pub const BALLS: [&str; 3] = ["green", "orange", "magenta"];

/// The linear model: standard deviation of a measured coordinate, px.
pub const MEASUREMENT_SD: f64 = 3.0;
/// Process noise after a frame of places, px.
pub const WALK_SD: f64 = 2.0;
/// Process noise after a frame of velocities, px per frame.
pub const VELOCITY_SD: f64 = 1.0;
/// What is known at first: places, px, and velocities, px per frame.
pub const START_SD: [f64; 2] = [10.0, 3.0];
/// Frames of a run.
pub const FRAMES: usize = 200;
/// Frames at its start that are left out of its error.
pub const BURN_IN: usize = 20;

/// Scenes in which identities are at stake.
pub const MEETINGS: [&str; 3] = ["balls-touch", "balls-cross", "balls-cross-grey"];
/// Particles there.
pub const MEETING_PARTICLES: usize = 1000;

/// A printed error counts as reproduced where ours differs from it by at most this share of it ...
pub const TOLERANCE: f64 = 0.25;
/// ... for at least so many particles: with fewer it is luck of the start.
pub const LEAST_COMPARED: usize = 50;

/// Sizes whose trajectories are pictured, as in the thesis.
pub const PICTURED_PARTICLES: [usize; 3] = [50, 250, 1000];
/// Frames whose particles are pictured, from 1.
pub const PICTURED_FRAMES: [usize; 4] = [1, 3, 10, 100];
