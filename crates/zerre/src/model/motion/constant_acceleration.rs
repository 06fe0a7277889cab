//! Nearly constant acceleration: white-noise jerk (Bar-Shalom, section 6.2.3).

use super::{ThirdOrderStep, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// Acceleration as Brownian motion along each of `D` axes (1, 2 or 3): da = sqrt(q) dB.
///
/// Over T seconds each axis has F = [1 T T^2/2; 0 1 T; 0 0 1] and
/// Q = q [T^5/20 T^4/8 T^3/6; T^4/8 T^3/3 T^2/2; T^3/6 T^2/2 T].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantAcceleration<const D: usize> {
    sqrt_density: f64,
}

impl<const D: usize> ConstantAcceleration<D> {
    /// `density` is the power spectral density q of the jerk, in m^2/s^5: the acceleration of each axis changes by
    /// a standard deviation of sqrt(q t) over t seconds.
    ///
    /// # Errors
    /// `density` negative or not finite.
    pub fn new(density: f64) -> Result<Self> {
        let density = Error::not_negative("spectral density of the jerk", density)?;
        Ok(ConstantAcceleration { sqrt_density: density.sqrt() })
    }

    fn step(&self, dt: f64) -> ThirdOrderStep {
        let sd = self.sqrt_density * dt.sqrt();
        ThirdOrderStep {
            f12: dt,
            f13: 0.5 * dt * dt,
            f23: dt,
            f33: 1.0,
            l11: sd * dt * dt / (2.0 * SQRT_5),
            l21: sd * dt * SQRT_5 / 4.0,
            l22: sd * dt / (4.0 * SQRT_3),
            l31: sd * SQRT_5 / 3.0,
            l32: sd / SQRT_3,
            l33: sd / 3.0,
        }
    }
}

const SQRT_3: f64 = 1.732_050_807_568_877_2;
const SQRT_5: f64 = 2.236_067_977_499_79;

super::third_order_motion!(ConstantAcceleration);
