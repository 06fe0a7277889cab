//! The measurement of the univariate growth model (Gordon, Salmond and Smith, IEE Proceedings F 140(2), 1993).

use super::{diagonal, log_constant};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// z = x^2 / 20 + v: the sign of the state is hidden. Values are `[z]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    sd: f64,
}

/// A measurement of [`Growth`], digested.
#[derive(Clone, Copy, Debug)]
pub struct GrowthGiven {
    z: f64,
    per_sd: f64,
    constant: f64,
}

impl Growth {
    /// Noise of variance `variance`; 1 in the source.
    ///
    /// # Errors
    /// `variance` not positive and finite.
    pub fn new(variance: f64) -> Result<Self> {
        Ok(Growth { sd: Error::positive("variance of the measurement", variance)?.sqrt() })
    }
}

impl<const N: usize> Measurement<N> for Growth {
    type Value = [f64; 1];
    type Given<'z> = GrowthGiven;

    fn given(&self, &[z]: &[f64; 1], _: Time) -> Result<GrowthGiven> {
        let z = Error::finite("measured value", z)?;
        Ok(GrowthGiven { z, per_sd: 1.0 / self.sd, constant: log_constant(&[self.sd]) })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &GrowthGiven, x: [R; N]) -> R {
        let e = (x[0] * x[0] * 0.05 - given.z) * given.per_sd;
        e * e * -0.5 + given.constant
    }
}

impl<const N: usize> GaussianMeasurement<N, 1> for Growth {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; 1] {
        [x[0] * x[0] * 0.05]
    }

    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }

    fn covariance(&self) -> [[f64; 1]; 1] {
        diagonal([self.sd])
    }
}
