//! Coordinated turn of unknown rate that returns to straight flight (Li and Jilkov, section V.B).

use super::constant_velocity::ConstantVelocityStep;
use super::{add_scaled, elapsed, turn};
use crate::error::{Error, Result};
use crate::math::{Real, decay_average};
use crate::model::Motion;
use crate::time::Time;

/// The turn rate is part of the state, `[x, y, vx, vy, turn_rate]`, and is a first-order Markov process:
/// it decays with a time constant and is stirred so that its standard deviation stays.
///
/// Over a step the heading turns by the exact mean of that process; the path is the arc of that angle, and the
/// acceleration noise enters as in straight flight, at the end of the turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkovTurn {
    sqrt_density: f64,
    rate_sd: f64,
    time_constant: f64,
}

/// One step of a [`MarkovTurn`].
#[derive(Clone, Copy, Debug)]
pub struct MarkovTurnStep {
    dt: f64,
    half_turn_per_rate: f64,
    noise: ConstantVelocityStep,
    keep: f64,
    rate_sd: f64,
}

impl MarkovTurn {
    /// Acceleration noise of power spectral density `density` (m^2/s^3); a turn rate of stationary standard
    /// deviation `rate_sd_rad_s` (radians per second) that lasts for about `time_constant_s` seconds.
    ///
    /// # Errors
    /// A density or standard deviation that is negative or not finite; a time constant that is not finite or below
    /// a nanosecond.
    pub fn new(density: f64, rate_sd_rad_s: f64, time_constant_s: f64) -> Result<Self> {
        Ok(MarkovTurn {
            sqrt_density: Error::not_negative("spectral density of the acceleration", density)?.sqrt(),
            rate_sd: Error::not_negative("standard deviation of the turn rate", rate_sd_rad_s)?,
            time_constant: super::time_constant("time constant of the turn rate", time_constant_s)?,
        })
    }
}

impl Motion<5, 5> for MarkovTurn {
    type Step = MarkovTurnStep;

    fn over(&self, from: Time, to: Time) -> Result<MarkovTurnStep> {
        let dt = elapsed(from, to)?;
        let decay = dt / self.time_constant;
        Ok(MarkovTurnStep {
            dt,
            half_turn_per_rate: 0.5 * dt * decay_average(decay),
            noise: ConstantVelocityStep::new(self.sqrt_density, dt),
            keep: Real::exp(-decay),
            // 1 - e^(-2 decay), without cancellation.
            rate_sd: self.rate_sd * (2.0 * decay * decay_average(2.0 * decay)).sqrt(),
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &MarkovTurnStep, mut x: [R; 5], w: [R; 5]) -> [R; 5] {
        let half = x[4] * step.half_turn_per_rate;
        turn::along_arc(&mut x, step.dt, half);
        step.noise.add_noise::<R, 2, 5>(&mut x, &w);
        x[4] = add_scaled(x[4] * step.keep, step.rate_sd, w[4]);
        x
    }
}
