//! The tracker that does not track.

use super::{Estimate, Particle, Tracker};
use crate::{Error, Frame, Rect, Result};

/// A box that never moves. What another tracker gains over it is due to tracking and not to an object at
/// rest.
#[derive(Clone, Copy, Debug)]
pub struct Still {
    bounds: Rect,
    size: (usize, usize),
}

impl Still {
    /// A box on frames of this size.
    pub fn new(frame: &Frame, bounds: Rect) -> Still {
        Still { bounds, size: frame.size() }
    }
}

impl Tracker for Still {
    /// It looks at nothing and so knows nothing: the centre may be anywhere on the frame, with equal right,
    /// and the object there or not.
    fn step(&mut self, frame: &Frame) -> Result<Estimate> {
        if frame.size() != self.size {
            return Err(Error::Size { found: frame.size(), expected: self.size });
        }
        let variance = |side: usize| (side * side) as f64 / 12.0;
        let covariance = [[variance(self.size.0), 0.0], [0.0, variance(self.size.1)]];
        Ok(Estimate { bounds: self.bounds, covariance, score: 0.0, p_lost: 0.5 })
    }

    fn particles(&self) -> Vec<Particle> {
        Vec::new()
    }
}
