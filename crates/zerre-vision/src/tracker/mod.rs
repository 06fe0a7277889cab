//! Trackers: they start on a box in a frame and say in every further frame where the object is, and how sure they are.

mod appearance;
mod correlation;
mod list;
mod still;

pub use appearance::{
    AppearanceSettings, AppearanceTracker, CentreWeight, Deviation, Equalisation, FlowUse, Similarity,
    TemplateUpdate,
};
pub use correlation::{CorrelationSettings, CorrelationTracker, Signs};
pub use list::{Kind, TRACKERS, find};
pub use still::Still;

use crate::{Frame, Rect, Result};
use serde::{Deserialize, Serialize};

/// What a tracker knows after a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The box.
    pub bounds: Rect,
    /// Covariance of the box's centre, square pixels.
    pub covariance: [[f64; 2]; 2],
    /// How well the box resembles the object, as the tracker measures it.
    pub score: f64,
    /// Probability that the box is not on the object.
    pub p_lost: f64,
}

impl Estimate {
    /// Whether the object is more likely lost than not.
    pub fn is_lost(&self) -> bool {
        self.p_lost > 0.5
    }
}

/// A particle as pictures show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particle {
    /// Centre of its box.
    pub centre: [f64; 2],
    /// Its weight; all of them sum to one.
    pub weight: f64,
}

/// A tracker on its way.
pub trait Tracker: Send {
    /// Looks at the next frame.
    ///
    /// # Errors
    /// A frame of another size than the first; what the tracker's filter refuses.
    fn step(&mut self, frame: &Frame) -> Result<Estimate>;

    /// Its particles after the last frame; none before the second one.
    fn particles(&self) -> Vec<Particle>;
}
