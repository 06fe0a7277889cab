//! Range rate: what a Doppler radar or a train of pulses tells of the velocity.

use super::{diagonal, finite, from_sensor, length, log_constant};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// Speed at which the target recedes from a sensor, in `D` dimensions: the relative velocity along the line of
/// sight. Values are `[range_rate_m_s]`, negative when it comes closer. The state begins with `D` positions and `D`
/// velocities; at the sensor itself the rate is taken as zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeRate<const D: usize> {
    sensor: [f64; D],
    velocity: [f64; D],
    sd: f64,
}

/// A range rate, digested.
#[derive(Clone, Copy, Debug)]
pub struct RangeRateGiven<const D: usize> {
    sensor: [f64; D],
    velocity: [f64; D],
    rate: f64,
    per_sd: f64,
    constant: f64,
}

impl<const D: usize> RangeRate<D> {
    /// A sensor at `sensor_m` (metres) that moves with `velocity_m_s` (metres per second), with noise of standard
    /// deviation `sd_m_s` (metres per second).
    ///
    /// # Errors
    /// A position or velocity that is not finite, a standard deviation that is not positive and finite.
    pub fn new(sensor_m: [f64; D], velocity_m_s: [f64; D], sd_m_s: f64) -> Result<Self> {
        Ok(RangeRate {
            sensor: *finite("position of the sensor", &sensor_m)?,
            velocity: *finite("velocity of the sensor", &velocity_m_s)?,
            sd: Error::positive("standard deviation of the range rate", sd_m_s)?,
        })
    }
}

#[inline(always)]
fn range_rate<R: Real, const D: usize, const N: usize>(
    x: &[R; N],
    sensor: &[f64; D],
    velocity: &[f64; D],
) -> R {
    const { assert!(N >= 2 * D, "the state has no velocity") };
    let to_target = from_sensor(x, sensor);
    let mut along = x[0].constant(0.0);
    for i in 0..D {
        along = to_target[i].mul_add(x[D + i] - velocity[i], along);
    }
    along / length(to_target)
}

impl<const N: usize, const D: usize> Measurement<N> for RangeRate<D> {
    type Value = [f64; 1];
    type Given<'z> = RangeRateGiven<D>;

    fn given(&self, &[rate]: &[f64; 1], _: Time) -> Result<RangeRateGiven<D>> {
        Ok(RangeRateGiven {
            sensor: self.sensor,
            velocity: self.velocity,
            rate: Error::finite("measured range rate", rate)?,
            per_sd: 1.0 / self.sd,
            constant: log_constant(&[self.sd]),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &RangeRateGiven<D>, x: [R; N]) -> R {
        let e = (range_rate(&x, &given.sensor, &given.velocity) - given.rate) * given.per_sd;
        e * e * -0.5 + given.constant
    }
}

impl<const N: usize, const D: usize> GaussianMeasurement<N, 1> for RangeRate<D> {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; 1] {
        [range_rate(&x, &self.sensor, &self.velocity)]
    }

    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }

    fn covariance(&self) -> [[f64; 1]; 1] {
        diagonal([self.sd])
    }
}
