//! Nearly constant velocity: white-noise acceleration (Bar-Shalom, section 6.2.2).

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// Velocity as Brownian motion along each of `D` axes (1, 2 or 3): dv = sqrt(q) dB.
///
/// Over dt seconds each axis has F = [1 dt; 0 1] and Q = q [dt^3/3 dt^2/2; dt^2/2 dt].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantVelocity<const D: usize> {
    sqrt_density: f64,
}

/// One step of a [`ConstantVelocity`]: dt and the lower Cholesky factor of Q of one axis.
#[derive(Clone, Copy, Debug)]
pub struct ConstantVelocityStep {
    dt: f64,
    l11: f64,
    l21: f64,
    l22: f64,
}

impl<const D: usize> ConstantVelocity<D> {
    /// `density` is the power spectral density q of the acceleration, in m^2/s^3: the velocity of each axis changes
    /// by a standard deviation of sqrt(q t) over t seconds.
    ///
    /// # Errors
    /// `density` negative or not finite.
    pub fn new(density: f64) -> Result<Self> {
        let density = Error::not_negative("spectral density of the acceleration", density)?;
        Ok(ConstantVelocity { sqrt_density: density.sqrt() })
    }
}

impl ConstantVelocityStep {
    pub(super) fn new(sqrt_density: f64, dt: f64) -> Self {
        let sd = sqrt_density * dt.sqrt();
        let half = 0.5 * sd;
        ConstantVelocityStep { dt, l11: sd * dt / SQRT_3, l21: half * SQRT_3, l22: half }
    }

    /// Adds the noise to the positions and velocities at the front of `x`; `w` holds those of the positions first.
    #[inline(always)]
    pub(super) fn add_noise<R: Real, const D: usize, const N: usize>(&self, x: &mut [R; N], w: &[R; N]) {
        for d in 0..D {
            x[d] = add_scaled(x[d], self.l11, w[d]);
            x[D + d] = add_scaled(add_scaled(x[D + d], self.l21, w[d]), self.l22, w[D + d]);
        }
    }
}

const SQRT_3: f64 = 1.732_050_807_568_877_2;

macro_rules! in_dimensions {
    ($($d:literal),+) => {$(
        impl Motion<{ 2 * $d }, { 2 * $d }> for ConstantVelocity<$d> {
            type Step = ConstantVelocityStep;

            fn over(&self, from: Time, to: Time) -> Result<ConstantVelocityStep> {
                Ok(ConstantVelocityStep::new(self.sqrt_density, elapsed(from, to)?))
            }

            #[inline(always)]
            fn apply<R: Real>(
                step: &ConstantVelocityStep,
                mut x: [R; 2 * $d],
                w: [R; 2 * $d],
            ) -> [R; 2 * $d] {
                for d in 0..$d {
                    x[d] = add_scaled(x[d], step.dt, x[$d + d]);
                }
                step.add_noise::<R, $d, { 2 * $d }>(&mut x, &w);
                x
            }
        }
    )+};
}
in_dimensions!(1, 2, 3);
