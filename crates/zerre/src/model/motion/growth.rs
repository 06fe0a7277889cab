//! The univariate growth model of N. J. Gordon, D. J. Salmond and A. F. M. Smith, *Novel approach to
//! nonlinear/non-Gaussian Bayesian state estimation*, IEE Proceedings F 140(2), 1993.

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// x_k = x_{k-1} / 2 + 25 x_{k-1} / (1 + x_{k-1}^2) + 8 cos(1.2 k) + w, where k is the time of the new state in
/// seconds. One step is one application, however long it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    sd: f64,
}

/// One step of [`Growth`].
#[derive(Clone, Copy, Debug)]
pub struct GrowthStep {
    drive: f64,
    sd: f64,
}

impl Growth {
    /// Noise of variance `variance`; 10 in the source.
    ///
    /// # Errors
    /// `variance` negative or not finite.
    pub fn new(variance: f64) -> Result<Self> {
        Ok(Growth { sd: Error::not_negative("variance of the growth noise", variance)?.sqrt() })
    }
}

impl Motion<1, 1> for Growth {
    type Step = GrowthStep;

    fn over(&self, from: Time, to: Time) -> Result<GrowthStep> {
        elapsed(from, to)?;
        Ok(GrowthStep { drive: 8.0 * Real::sin_cos(1.2 * to.secs()).1, sd: self.sd })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &GrowthStep, [x]: [R; 1], [w]: [R; 1]) -> [R; 1] {
        let pull = x * 25.0 / (x * x + 1.0);
        [add_scaled(add_scaled(pull, 0.5, x), step.sd, w) + step.drive]
    }
}
