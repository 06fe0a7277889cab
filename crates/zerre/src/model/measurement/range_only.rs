//! Range without bearing: a ranging beacon, the time of flight of a signal.

use super::{diagonal, finite, from_sensor, length, log_constant};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// Distance of the position, in `D` dimensions, from a sensor. Values are `[range_m]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeOnly<const D: usize> {
    sensor: [f64; D],
    sd: f64,
}

/// A range, digested.
#[derive(Clone, Copy, Debug)]
pub struct RangeOnlyGiven<const D: usize> {
    sensor: [f64; D],
    range: f64,
    per_sd: f64,
    constant: f64,
}

impl<const D: usize> RangeOnly<D> {
    /// A sensor at `sensor_m` (metres) with noise of standard deviation `sd_m` (metres).
    ///
    /// # Errors
    /// A position that is not finite, a standard deviation that is not positive and finite.
    pub fn new(sensor_m: [f64; D], sd_m: f64) -> Result<Self> {
        Ok(RangeOnly {
            sensor: *finite("position of the sensor", &sensor_m)?,
            sd: Error::positive("standard deviation of the range", sd_m)?,
        })
    }
}

impl<const N: usize, const D: usize> Measurement<N> for RangeOnly<D> {
    type Value = [f64; 1];
    type Given<'z> = RangeOnlyGiven<D>;

    fn given(&self, &[range]: &[f64; 1], _: Time) -> Result<RangeOnlyGiven<D>> {
        Ok(RangeOnlyGiven {
            sensor: self.sensor,
            range: Error::not_negative("measured range", range)?,
            per_sd: 1.0 / self.sd,
            constant: log_constant(&[self.sd]),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &RangeOnlyGiven<D>, x: [R; N]) -> R {
        let e = (length(from_sensor(&x, &given.sensor)) - given.range) * given.per_sd;
        e * e * -0.5 + given.constant
    }
}

impl<const N: usize, const D: usize> GaussianMeasurement<N, 1> for RangeOnly<D> {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; 1] {
        [length(from_sensor(&x, &self.sensor))]
    }

    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }

    fn covariance(&self) -> [[f64; 1]; 1] {
        diagonal([self.sd])
    }
}
