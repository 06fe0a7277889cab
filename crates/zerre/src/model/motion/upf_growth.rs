//! The benchmark of R. van der Merwe, A. Doucet, N. de Freitas and E. Wan, *The unscented particle filter*,
//! NIPS 2000.

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{Motion, Noise};
use crate::time::Time;

/// x_k = 1 + sin(0.04 pi k) + x_{k-1} / 2 + u with gamma noise u, where k is the time of the new state in seconds.
/// One step is one application, however long it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpfGrowth {
    noise: Noise,
    scale: f64,
}

/// One step of [`UpfGrowth`].
#[derive(Clone, Copy, Debug)]
pub struct UpfGrowthStep {
    drive: f64,
    scale: f64,
}

impl UpfGrowth {
    /// Gamma noise of mean `shape` / `rate` and variance `shape` / `rate`^2.
    ///
    /// The source has shape 3 and rate 2 (mean 3/2): its "Gamma(3, 2)", like its demonstration code, means a rate.
    /// Papers that draw it with a tool that takes a scale have rate 1/2 (mean 6).
    ///
    /// # Errors
    /// `shape` or `rate` not positive and finite.
    pub fn new(shape: f64, rate: f64) -> Result<Self> {
        Ok(UpfGrowth {
            noise: Noise::Gamma { shape: Error::positive("shape of the gamma noise", shape)? },
            scale: 1.0 / Error::positive("rate of the gamma noise", rate)?,
        })
    }

    /// Normal noise of mean zero: what a filter assumes that does not know of the gamma law.
    ///
    /// # Errors
    /// `variance` not positive and finite.
    pub fn normal(variance: f64) -> Result<Self> {
        let scale = Error::positive("variance of the noise", variance)?.sqrt();
        Ok(UpfGrowth { noise: Noise::StandardNormal, scale })
    }
}

impl Motion<1, 1> for UpfGrowth {
    type Step = UpfGrowthStep;

    fn over(&self, from: Time, to: Time) -> Result<UpfGrowthStep> {
        elapsed(from, to)?;
        let phase = 0.04 * std::f64::consts::PI * to.secs();
        Ok(UpfGrowthStep { drive: 1.0 + Real::sin_cos(phase).0, scale: self.scale })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &UpfGrowthStep, [x]: [R; 1], [w]: [R; 1]) -> [R; 1] {
        [add_scaled(x * 0.5, step.scale, w) + step.drive]
    }

    fn noise(&self) -> Noise {
        self.noise
    }
}
