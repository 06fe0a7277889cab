//! Nearly constant velocity of a box whose size and direction wander: Bar-Shalom, section 6.2.2 and chapter 4.

use super::constant_velocity::ConstantVelocityStep;
use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// The state is `[x, y, vx, vy, length, width, orientation]`: the middle of a box moves by
/// [`ConstantVelocity`](super::ConstantVelocity), and the last three are Brownian motion, whichever way it moves: what a
/// radar sees of a body changes with the side that it is seen from. The orientation is that of the length,
/// counter-clockwise from the x axis, rad, on the whole line; half a turn is the same box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantVelocityBox {
    sqrt_density: f64,
    sqrt_size_density: f64,
    sqrt_turn_density: f64,
}

/// One step of a [`ConstantVelocityBox`].
#[derive(Clone, Copy, Debug)]
pub struct ConstantVelocityBoxStep {
    dt: f64,
    noise: ConstantVelocityStep,
    size_sd: f64,
    turn_sd: f64,
}

impl ConstantVelocityBox {
    /// Acceleration noise of power spectral density `density` (m^2/s^3); the variances of length and width grow by
    /// `size_density` per second (m^2/s), that of the orientation by `turn_density` (rad^2/s).
    ///
    /// # Errors
    /// A density that is negative or not finite.
    pub fn new(density: f64, size_density: f64, turn_density: f64) -> Result<Self> {
        Ok(ConstantVelocityBox {
            sqrt_density: Error::not_negative("spectral density of the acceleration", density)?.sqrt(),
            sqrt_size_density: Error::not_negative("density of the size", size_density)?.sqrt(),
            sqrt_turn_density: Error::not_negative("density of the orientation", turn_density)?.sqrt(),
        })
    }
}

impl Motion<7, 7> for ConstantVelocityBox {
    type Step = ConstantVelocityBoxStep;

    fn over(&self, from: Time, to: Time) -> Result<ConstantVelocityBoxStep> {
        let dt = elapsed(from, to)?;
        Ok(ConstantVelocityBoxStep {
            dt,
            noise: ConstantVelocityStep::new(self.sqrt_density, dt),
            size_sd: self.sqrt_size_density * dt.sqrt(),
            turn_sd: self.sqrt_turn_density * dt.sqrt(),
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &ConstantVelocityBoxStep, mut x: [R; 7], w: [R; 7]) -> [R; 7] {
        for d in 0..2 {
            x[d] = add_scaled(x[d], step.dt, x[2 + d]);
        }
        step.noise.add_noise::<R, 2, 7>(&mut x, &w);
        for i in 4..6 {
            x[i] = add_scaled(x[i], step.size_sd, w[i]);
        }
        x[6] = add_scaled(x[6], step.turn_sd, w[6]);
        x
    }
}
