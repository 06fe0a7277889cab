//! Range and bearing: a scanning radar, a sonar (Bar-Shalom, section 10.4.3).

use super::{diagonal, direction, finite, length, log_constant};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// Distance and direction of the position (x, y) from a sensor. Values are `[range_m, bearing_rad]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeBearing {
    sensor: [f64; 2],
    sds: [f64; 2],
}

/// A range and a bearing, digested.
#[derive(Clone, Copy, Debug)]
pub struct RangeBearingGiven {
    sensor: [f64; 2],
    range: f64,
    sin: f64,
    cos: f64,
    per_range_sd: f64,
    per_bearing_sd: f64,
    constant: f64,
}

impl RangeBearing {
    /// A sensor at `sensor_m` (metres), with independent noise of `range_sd_m` (metres) and `bearing_sd_rad`
    /// (radians).
    ///
    /// # Errors
    /// A position that is not finite, a standard deviation that is not positive and finite.
    pub fn new(sensor_m: [f64; 2], range_sd_m: f64, bearing_sd_rad: f64) -> Result<Self> {
        Ok(RangeBearing {
            sensor: *finite("position of the sensor", &sensor_m)?,
            sds: [
                Error::positive("standard deviation of the range", range_sd_m)?,
                Error::positive("standard deviation of the bearing", bearing_sd_rad)?,
            ],
        })
    }
}

impl<const N: usize> Measurement<N> for RangeBearing {
    type Value = [f64; 2];
    type Given<'z> = RangeBearingGiven;

    fn given(&self, z: &[f64; 2], _: Time) -> Result<RangeBearingGiven> {
        let range = Error::not_negative("measured range", z[0])?;
        let (sin, cos) = direction("measured bearing", z[1])?;
        Ok(RangeBearingGiven {
            sensor: self.sensor,
            range,
            sin,
            cos,
            per_range_sd: 1.0 / self.sds[0],
            per_bearing_sd: 1.0 / self.sds[1],
            constant: log_constant(&self.sds),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &RangeBearingGiven, x: [R; N]) -> R {
        const { assert!(N >= 2, "the state has no position in the plane") };
        let (dx, dy) = (x[0] - given.sensor[0], x[1] - given.sensor[1]);
        // Turned back by the measured bearing, the direction is the residual itself, already wrapped.
        let ahead = dx.mul_add(dx.constant(given.cos), dy * given.sin);
        let left = dy.mul_add(dy.constant(given.cos), -(dx * given.sin));
        let range = (length(dx, dy) - given.range) * given.per_range_sd;
        let bearing = left.atan2(ahead) * given.per_bearing_sd;
        range.mul_add(range, bearing * bearing) * -0.5 + given.constant
    }
}

impl<const N: usize> GaussianMeasurement<N, 2> for RangeBearing {
    const ANGLE: [bool; 2] = [false, true];

    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; 2] {
        const { assert!(N >= 2, "the state has no position in the plane") };
        let (dx, dy) = (x[0] - self.sensor[0], x[1] - self.sensor[1]);
        [length(dx, dy), dy.atan2(dx)]
    }

    fn components(&self, z: &[f64; 2]) -> [f64; 2] {
        *z
    }

    fn covariance(&self) -> [[f64; 2]; 2] {
        diagonal(self.sds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn bearings_wrap_behind_the_sensor() {
        let sensor = RangeBearing::new([1.0, 2.0], 0.5, 0.1).unwrap();
        let just_above = [1.0 - 10.0, 2.0 + 1e-3];
        let residual = 2e-4;
        for measured in [-PI + 1e-4, PI + 1e-4] {
            let given = Measurement::<2>::given(&sensor, &[10.0, measured], Time::ZERO).unwrap();
            // Across the cut the two differ by 1e-4 + 1e-3 / 10, not by a turn.
            let expected = given.constant - 0.5 * (residual / 0.1f64).powi(2);
            let found = <RangeBearing as Measurement<2>>::log_likelihood(&given, just_above);
            // The range is off by 5e-8; atan(1e-4) differs from 1e-4 by 3e-13.
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn bad_values_are_refused() {
        let sensor = RangeBearing::new([0.0; 2], 1.0, 0.1).unwrap();
        for z in [[-1.0, 0.0], [f64::NAN, 0.0], [1.0, f64::INFINITY], [1.0, 1e30]] {
            assert!(Measurement::<4>::given(&sensor, &z, Time::ZERO).is_err(), "{z:?}");
        }
        for (range_sd, bearing_sd) in [(0.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            assert!(RangeBearing::new([0.0; 2], range_sd, bearing_sd).is_err());
        }
        assert!(RangeBearing::new([f64::NAN, 0.0], 1.0, 1.0).is_err());
    }
}
