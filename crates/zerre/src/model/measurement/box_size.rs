//! Length, width and orientation of a box, as the extractors of surface radars report them (EUROCONTROL ASTERIX
//! category 010, item I010/270).

use super::{diagonal, direction, finite, log_constant, turned_back};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// Components 4, 5 and 6 of the state: length, width and orientation. Values are
/// `[length_m, width_m, orientation_rad]`.
///
/// Both ends of a box look alike: the orientation is an axis, and is compared as axes are, by twice the angle (Mardia and
/// Jupp, Directional Statistics, section 1.1). Components of the measurement, and its density, are those of length,
/// width and twice the orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxSize {
    /// Of length, width and twice the orientation.
    sds: [f64; 3],
}

/// A size and an orientation, digested.
#[derive(Clone, Copy, Debug)]
pub struct BoxSizeGiven {
    size: [f64; 2],
    sin: f64,
    cos: f64,
    per_sd: [f64; 3],
    constant: f64,
}

impl BoxSize {
    /// Independent noise of `size_sd_m` (metres) on length and width and of `orientation_sd_rad` (radians) on the
    /// orientation.
    ///
    /// # Errors
    /// A standard deviation that is not positive and finite.
    pub fn new(size_sd_m: f64, orientation_sd_rad: f64) -> Result<Self> {
        let size = Error::positive("standard deviation of the size", size_sd_m)?;
        let turn = Error::positive("standard deviation of the orientation", orientation_sd_rad)?;
        Ok(BoxSize { sds: [size, size, 2.0 * turn] })
    }
}

impl<const N: usize> Measurement<N> for BoxSize {
    type Value = [f64; 3];
    type Given<'z> = BoxSizeGiven;

    fn given(&self, z: &[f64; 3], _: Time) -> Result<BoxSizeGiven> {
        let [length, width, orientation] = *finite("measured size", z)?;
        let (sin, cos) = direction("measured orientation", 2.0 * orientation)?;
        let per_sd = self.sds.map(|sd| 1.0 / sd);
        Ok(BoxSizeGiven { size: [length, width], sin, cos, per_sd, constant: log_constant(&self.sds) })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &BoxSizeGiven, x: [R; N]) -> R {
        const { assert!(N >= 7, "the state has no length, width and orientation") };
        let (sin, cos) = (x[6] + x[6]).sin_cos();
        let turn = turned_back(cos, sin, given.sin, given.cos) * given.per_sd[2];
        let length = (x[4] - given.size[0]) * given.per_sd[0];
        let width = (x[5] - given.size[1]) * given.per_sd[1];
        length.mul_add(length, width.mul_add(width, turn * turn)) * -0.5 + given.constant
    }
}

impl<const N: usize> GaussianMeasurement<N, 3> for BoxSize {
    const ANGLE: [bool; 3] = [false, false, true];

    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; 3] {
        const { assert!(N >= 7, "the state has no length, width and orientation") };
        [x[4], x[5], x[6] + x[6]]
    }

    fn components(&self, z: &[f64; 3]) -> [f64; 3] {
        [z[0], z[1], 2.0 * z[2]]
    }

    fn covariance(&self) -> [[f64; 3]; 3] {
        diagonal(self.sds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::Gaussian;
    use crate::filter::{Extended, Filter};
    use crate::model::motion::ConstantVelocityBox;
    use crate::rng::Stream;
    use std::f64::consts::PI;

    /// Either end may be the front.
    #[test]
    fn half_a_turn_is_no_error() {
        let sensor = BoxSize::new(2.0, 0.1).unwrap();
        let state = [0.0, 0.0, 0.0, 0.0, 30.0, 25.0, 1.5];
        let score = |orientation: f64| {
            let given = Measurement::<7>::given(&sensor, &[31.0, 25.0, orientation], Time::ZERO).unwrap();
            <BoxSize as Measurement<7>>::log_likelihood(&given, state)
        };
        for turns in [-2.0, -1.0, 1.0, 4.0] {
            // Rounding of sines of angles up to 30.
            assert!((score(1.6) - score(1.6 + turns * PI)).abs() < 1e-10);
        }
        assert!((score(1.6) - score(1.5) + 0.5).abs() < 1e-10, "one standard deviation");
    }

    /// A filter whose axis lies just below a quarter turn sees one just above it, reported from the other end, as near.
    #[test]
    fn a_filter_turns_the_short_way() {
        let prior =
            Gaussian::independent([0.0, 0.0, 0.0, 0.0, 30.0, 25.0, 1.5], [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1]);
        let motion = ConstantVelocityBox::new(1.0, 0.1, 0.01).unwrap();
        let filter = Extended::new(motion, BoxSize::new(1.0, 0.1).unwrap(), prior.unwrap());
        let mut belief = filter.start(Time::ZERO, Stream::new(1)).unwrap();
        filter.step(&mut belief, Time::ZERO, Some(&[30.0, 25.0, 1.7 - PI])).unwrap();
        // Half-way between 1.5 and 1.7, both being known to a tenth.
        assert!((belief.state.mean()[6] - 1.6).abs() < 1e-12, "{:?}", belief.state.mean());
    }

    #[test]
    fn bad_values_are_refused() {
        let sensor = BoxSize::new(1.0, 0.1).unwrap();
        for z in [[f64::NAN, 0.0, 0.0], [1.0, f64::INFINITY, 0.0], [1.0, 1.0, f64::NAN], [1.0, 1.0, 1e30]] {
            assert!(Measurement::<7>::given(&sensor, &z, Time::ZERO).is_err(), "{z:?}");
        }
        assert!(BoxSize::new(0.0, 1.0).is_err() && BoxSize::new(1.0, -1.0).is_err());
    }
}
