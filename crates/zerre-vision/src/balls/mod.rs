//! Several balls on plain ground: found as what differs from it, told apart by area or by where they were going, and
//! followed by a particle filter each.
//!
//! The example of section 3.4 of a Turkish thesis on particle filters for sensor fusion: [`thesis`] is it as far as
//! it says what it does, [`tracker`] what we make of it. [`scene`] draws clips with exact truth.

pub mod belief;
pub mod detector;
pub mod disc;
pub mod ground;
pub mod scene;
pub mod thesis;
pub mod tracker;

pub use belief::{BallBelief, BallModel, BallMotion, Known, Spot};
pub use detector::{Blob, Detector, DetectorSettings, Seen};
pub use ground::{Ground, GroundFrom};
pub use scene::{SCENES, Scene, SceneSettings, TrueBall};
pub use tracker::{Ball, BallRow, Counted, Tracker, TrackerSettings};
