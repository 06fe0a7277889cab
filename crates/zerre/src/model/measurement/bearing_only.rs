//! Bearing without range: a passive sonar, a direction finder (Ristic, Arulampalam and Gordon, *Beyond the Kalman
//! Filter*, Artech House 2004, chapter 6).

use super::{diagonal, direction, finite, from_sensor, log_constant, turned_back};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// Direction of the position (x, y) from a sensor. Values are `[bearing_rad]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingOnly {
    sensor: [f64; 2],
    sd: f64,
}

/// A bearing, digested.
#[derive(Clone, Copy, Debug)]
pub struct BearingOnlyGiven {
    sensor: [f64; 2],
    sin: f64,
    cos: f64,
    per_sd: f64,
    constant: f64,
}

impl BearingOnly {
    /// A sensor at `sensor_m` (metres) with noise of standard deviation `sd_rad` (radians).
    ///
    /// # Errors
    /// A position that is not finite, a standard deviation that is not positive and finite.
    pub fn new(sensor_m: [f64; 2], sd_rad: f64) -> Result<Self> {
        Ok(BearingOnly {
            sensor: *finite("position of the sensor", &sensor_m)?,
            sd: Error::positive("standard deviation of the bearing", sd_rad)?,
        })
    }
}

impl<const N: usize> Measurement<N> for BearingOnly {
    type Value = [f64; 1];
    type Given<'z> = BearingOnlyGiven;

    fn given(&self, &[bearing]: &[f64; 1], _: Time) -> Result<BearingOnlyGiven> {
        let (sin, cos) = direction("measured bearing", bearing)?;
        Ok(BearingOnlyGiven {
            sensor: self.sensor,
            sin,
            cos,
            per_sd: 1.0 / self.sd,
            constant: log_constant(&[self.sd]),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &BearingOnlyGiven, x: [R; N]) -> R {
        let [dx, dy] = from_sensor(&x, &given.sensor);
        let e = turned_back(dx, dy, given.sin, given.cos) * given.per_sd;
        e * e * -0.5 + given.constant
    }
}

impl<const N: usize> GaussianMeasurement<N, 1> for BearingOnly {
    const ANGLE: [bool; 1] = [true];

    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; 1] {
        let [dx, dy] = from_sensor(&x, &self.sensor);
        [dy.atan2(dx)]
    }

    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }

    fn covariance(&self) -> [[f64; 1]; 1] {
        diagonal([self.sd])
    }
}
