//! The measurement of the benchmark of van der Merwe, Doucet, de Freitas and Wan, *The unscented particle filter*,
//! NIPS 2000.

use super::{diagonal, log_constant};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// z = x^2 / 5 + v up to 30 seconds, z = x / 2 - 2 + v after. Values are `[z]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpfGrowth {
    sd: f64,
}

/// A measurement of [`UpfGrowth`], digested.
#[derive(Clone, Copy, Debug)]
pub struct UpfGrowthGiven {
    z: f64,
    at: Time,
    per_sd: f64,
    constant: f64,
}

impl UpfGrowth {
    /// Noise of variance `variance`; 1e-5 in the source.
    ///
    /// # Errors
    /// `variance` not positive and finite.
    pub fn new(variance: f64) -> Result<Self> {
        Ok(UpfGrowth { sd: Error::positive("variance of the measurement", variance)?.sqrt() })
    }
}

#[inline(always)]
fn seen<R: Real>(at: Time, x: R) -> R {
    const LAST_SQUARE: Time = Time::from_nanos(30_000_000_000);
    if at <= LAST_SQUARE { x * x * 0.2 } else { x * 0.5 - 2.0 }
}

impl<const N: usize> Measurement<N> for UpfGrowth {
    type Value = [f64; 1];
    type Given<'z> = UpfGrowthGiven;

    fn given(&self, &[z]: &[f64; 1], at: Time) -> Result<UpfGrowthGiven> {
        let z = Error::finite("measured value", z)?;
        Ok(UpfGrowthGiven { z, at, per_sd: 1.0 / self.sd, constant: log_constant(&[self.sd]) })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &UpfGrowthGiven, x: [R; N]) -> R {
        let e = (seen(given.at, x[0]) - given.z) * given.per_sd;
        e * e * -0.5 + given.constant
    }
}

impl<const N: usize> GaussianMeasurement<N, 1> for UpfGrowth {
    #[inline(always)]
    fn predict<R: Real>(&self, at: Time, x: [R; N]) -> [R; 1] {
        [seen(at, x[0])]
    }

    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }

    fn covariance(&self) -> [[f64; 1]; 1] {
        diagonal([self.sd])
    }
}
