//! Wiener-sequence acceleration: the acceleration jumps once per step (Bar-Shalom, section 6.3.3; Li and
//! Jilkov).

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// Acceleration as a random walk over steps along each of `D` axes (1, 2 or 3): it changes at the beginning of a
/// step and stays. Q = s^2 g g' with g = [T^2/2 T 1], of rank one for each axis.
///
/// Two half steps are not one whole step: the noise is tuned for one sampling interval. Where intervals differ,
/// take [`ConstantAcceleration`](super::ConstantAcceleration).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WienerAcceleration<const D: usize> {
    increment_sd: f64,
}

/// One step of a [`WienerAcceleration`].
#[derive(Clone, Copy, Debug)]
pub struct WienerAccelerationStep {
    dt: f64,
    half_dt2: f64,
    increment_sd: f64,
}

impl<const D: usize> WienerAcceleration<D> {
    /// The acceleration of each axis changes by a standard deviation of `increment_sd` (m/s^2) at each step.
    ///
    /// # Errors
    /// `increment_sd` negative or not finite.
    pub fn new(increment_sd: f64) -> Result<Self> {
        let increment_sd =
            Error::not_negative("standard deviation of the acceleration's increment", increment_sd)?;
        Ok(WienerAcceleration { increment_sd })
    }
}

macro_rules! in_dimensions {
    ($($d:literal),+) => {$(
        impl Motion<{ 3 * $d }, $d> for WienerAcceleration<$d> {
            type Step = WienerAccelerationStep;

            fn over(&self, from: Time, to: Time) -> Result<WienerAccelerationStep> {
                let dt = elapsed(from, to)?;
                Ok(WienerAccelerationStep { dt, half_dt2: 0.5 * dt * dt, increment_sd: self.increment_sd })
            }

            #[inline(always)]
            fn apply<R: Real>(
                step: &WienerAccelerationStep,
                mut x: [R; 3 * $d],
                w: [R; $d],
            ) -> [R; 3 * $d] {
                for d in 0..$d {
                    let (p, v, a) = (d, $d + d, 2 * $d + d);
                    x[a] = add_scaled(x[a], step.increment_sd, w[d]);
                    x[p] = add_scaled(add_scaled(x[p], step.dt, x[v]), step.half_dt2, x[a]);
                    x[v] = add_scaled(x[v], step.dt, x[a]);
                }
                x
            }
        }
    )+};
}
in_dimensions!(1, 2, 3);
