//! Discrete white-noise acceleration (Bar-Shalom, section 6.3.2).

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// Along each of `D` axes (1, 2 or 3) the acceleration is constant over a step and independent of that of
/// other steps: Q = s^2 g g' with g = [T^2/2 T], of rank one for each axis, so that it has no transition
/// density.
///
/// Two half steps are not one whole step: the noise is tuned for one sampling interval. Where intervals
/// differ, take [`ConstantVelocity`](super::ConstantVelocity). It is the motion of the bearings-only
/// benchmark (Gordon, Salmond and Smith, IEE Proceedings F 140, 1993), with steps of 1 s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscreteVelocity<const D: usize> {
    acceleration_sd: f64,
}

/// One step of a [`DiscreteVelocity`].
#[derive(Clone, Copy, Debug)]
pub struct DiscreteVelocityStep {
    dt: f64,
    by_position: f64,
    by_velocity: f64,
}

impl<const D: usize> DiscreteVelocity<D> {
    /// The acceleration of each axis has the standard deviation `acceleration_sd` (m/s^2).
    ///
    /// # Errors
    /// `acceleration_sd` negative or not finite.
    pub fn new(acceleration_sd: f64) -> Result<Self> {
        let what = "standard deviation of the acceleration";
        Ok(DiscreteVelocity { acceleration_sd: Error::not_negative(what, acceleration_sd)? })
    }
}

macro_rules! in_dimensions {
    ($($d:literal),+) => {$(
        impl Motion<{ 2 * $d }, $d> for DiscreteVelocity<$d> {
            type Step = DiscreteVelocityStep;

            fn over(&self, from: Time, to: Time) -> Result<DiscreteVelocityStep> {
                let dt = elapsed(from, to)?;
                let by_velocity = dt * self.acceleration_sd;
                Ok(DiscreteVelocityStep { dt, by_position: 0.5 * dt * by_velocity, by_velocity })
            }

            #[inline(always)]
            fn apply<R: Real>(
                step: &DiscreteVelocityStep,
                mut x: [R; 2 * $d],
                w: [R; $d],
            ) -> [R; 2 * $d] {
                for d in 0..$d {
                    let v = $d + d;
                    x[d] = add_scaled(add_scaled(x[d], step.dt, x[v]), step.by_position, w[d]);
                    x[v] = add_scaled(x[v], step.by_velocity, w[d]);
                }
                x
            }
        }
    )+};
}
in_dimensions!(1, 2, 3);
