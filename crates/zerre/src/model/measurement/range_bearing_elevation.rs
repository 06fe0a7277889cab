//! Range, bearing and elevation: a radar that sees height (Bar-Shalom, Li and Kirubarajan 2001, chapter 10).

use super::{diagonal, direction, finite, from_sensor, length, log_constant, turned_back};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// Distance and direction of the position (x, y, z) from a sensor. Values are
/// `[range_m, bearing_rad, elevation_rad]`; elevation is the angle above the plane of x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeBearingElevation {
    sensor: [f64; 3],
    sds: [f64; 3],
}

/// A range, a bearing and an elevation, digested.
#[derive(Clone, Copy, Debug)]
pub struct RangeBearingElevationGiven {
    sensor: [f64; 3],
    range: f64,
    bearing: (f64, f64),
    elevation: (f64, f64),
    per_sd: [f64; 3],
    constant: f64,
}

impl RangeBearingElevation {
    /// A sensor at `sensor_m` (metres), with independent noise of `range_sd_m` (metres), `bearing_sd_rad` and
    /// `elevation_sd_rad` (radians).
    ///
    /// # Errors
    /// A position that is not finite, a standard deviation that is not positive and finite.
    pub fn new(
        sensor_m: [f64; 3],
        range_sd_m: f64,
        bearing_sd_rad: f64,
        elevation_sd_rad: f64,
    ) -> Result<Self> {
        Ok(RangeBearingElevation {
            sensor: *finite("position of the sensor", &sensor_m)?,
            sds: [
                Error::positive("standard deviation of the range", range_sd_m)?,
                Error::positive("standard deviation of the bearing", bearing_sd_rad)?,
                Error::positive("standard deviation of the elevation", elevation_sd_rad)?,
            ],
        })
    }
}

impl<const N: usize> Measurement<N> for RangeBearingElevation {
    type Value = [f64; 3];
    type Given<'z> = RangeBearingElevationGiven;

    fn given(&self, z: &[f64; 3], _: Time) -> Result<RangeBearingElevationGiven> {
        Ok(RangeBearingElevationGiven {
            sensor: self.sensor,
            range: Error::not_negative("measured range", z[0])?,
            bearing: direction("measured bearing", z[1])?,
            elevation: direction("measured elevation", z[2])?,
            per_sd: self.sds.map(|sd| 1.0 / sd),
            constant: log_constant(&self.sds),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &RangeBearingElevationGiven, x: [R; N]) -> R {
        let [dx, dy, dz] = from_sensor(&x, &given.sensor);
        let ground = length([dx, dy]);
        let range = (length([dx, dy, dz]) - given.range) * given.per_sd[0];
        let bearing = turned_back(dx, dy, given.bearing.0, given.bearing.1) * given.per_sd[1];
        let elevation = turned_back(ground, dz, given.elevation.0, given.elevation.1) * given.per_sd[2];
        let angles = bearing.mul_add(bearing, elevation * elevation);
        range.mul_add(range, angles) * -0.5 + given.constant
    }
}

impl<const N: usize> GaussianMeasurement<N, 3> for RangeBearingElevation {
    const ANGLE: [bool; 3] = [false, true, true];

    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; 3] {
        let [dx, dy, dz] = from_sensor(&x, &self.sensor);
        [length([dx, dy, dz]), dy.atan2(dx), dz.atan2(length([dx, dy]))]
    }

    fn components(&self, z: &[f64; 3]) -> [f64; 3] {
        *z
    }

    fn covariance(&self) -> [[f64; 3]; 3] {
        diagonal(self.sds)
    }
}
