//! Random walk: dx = sqrt(q) dB (Bar-Shalom, section 4.3.1).

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// Brownian motion of each of `D` components; for slow parameters and for targets of which nothing is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RandomWalk<const D: usize> {
    sqrt_density: f64,
}

/// One step of a [`RandomWalk`].
#[derive(Clone, Copy, Debug)]
pub struct RandomWalkStep {
    sd: f64,
}

impl<const D: usize> RandomWalk<D> {
    /// The variance of each component grows by `density` per second (m^2/s for positions).
    ///
    /// # Errors
    /// `density` negative or not finite.
    pub fn new(density: f64) -> Result<Self> {
        Ok(RandomWalk { sqrt_density: Error::not_negative("density of the random walk", density)?.sqrt() })
    }
}

impl<const D: usize> Motion<D, D> for RandomWalk<D> {
    type Step = RandomWalkStep;

    fn over(&self, from: Time, to: Time) -> Result<RandomWalkStep> {
        Ok(RandomWalkStep { sd: self.sqrt_density * elapsed(from, to)?.sqrt() })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &RandomWalkStep, mut x: [R; D], w: [R; D]) -> [R; D] {
        for i in 0..D {
            x[i] = add_scaled(x[i], step.sd, w[i]);
        }
        x
    }
}
