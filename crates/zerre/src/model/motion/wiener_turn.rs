//! Coordinated turn of unknown rate that wanders (Bar-Shalom, section 11.7.2; Li and Jilkov, section V.B).

use super::constant_velocity::ConstantVelocityStep;
use super::{add_scaled, elapsed, turn};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// The turn rate is part of the state, `[x, y, vx, vy, turn_rate]`, and follows Brownian motion.
///
/// The turn itself is exact for any step; the rate is held over a step, and the acceleration noise enters as in
/// straight flight, at the end of the turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WienerTurn {
    sqrt_density: f64,
    sqrt_rate_density: f64,
}

/// One step of a [`WienerTurn`].
#[derive(Clone, Copy, Debug)]
pub struct WienerTurnStep {
    dt: f64,
    noise: ConstantVelocityStep,
    rate_sd: f64,
}

impl WienerTurn {
    /// Acceleration noise of power spectral density `density` (m^2/s^3); the variance of the turn rate grows by
    /// `rate_density` per second (rad^2/s^3).
    ///
    /// # Errors
    /// A density that is negative or not finite.
    pub fn new(density: f64, rate_density: f64) -> Result<Self> {
        Ok(WienerTurn {
            sqrt_density: Error::not_negative("spectral density of the acceleration", density)?.sqrt(),
            sqrt_rate_density: Error::not_negative("density of the turn rate", rate_density)?.sqrt(),
        })
    }
}

impl Motion<5, 5> for WienerTurn {
    type Step = WienerTurnStep;

    fn over(&self, from: Time, to: Time) -> Result<WienerTurnStep> {
        let dt = elapsed(from, to)?;
        Ok(WienerTurnStep {
            dt,
            noise: ConstantVelocityStep::new(self.sqrt_density, dt),
            rate_sd: self.sqrt_rate_density * dt.sqrt(),
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &WienerTurnStep, mut x: [R; 5], w: [R; 5]) -> [R; 5] {
        let half = x[4] * (0.5 * step.dt);
        turn::along_arc(&mut x, step.dt, half);
        step.noise.add_noise::<R, 2, 5>(&mut x, &w);
        x[4] = add_scaled(x[4], step.rate_sd, w[4]);
        x
    }
}
