//! Coordinated turn by a given acceleration: the rate is the acceleration over the speed (Ristic, Arulampalam and
//! Gordon, *Beyond the Kalman Filter*, Artech House 2004, chapter 6; Li and Jilkov, section V.A).

use super::constant_velocity::ConstantVelocityStep;
use super::{elapsed, turn};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// A turn at constant lateral acceleration: fast targets turn slowly. The state is `[x, y, vx, vy]`.
///
/// The turn is exact for any step; the acceleration noise enters as in straight flight, at the end of the turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ManoeuvreTurn {
    acceleration: f64,
    sqrt_density: f64,
}

/// One step of a [`ManoeuvreTurn`].
#[derive(Clone, Copy, Debug)]
pub struct ManoeuvreTurnStep {
    dt: f64,
    half_speed_change: f64,
    least_speed: f64,
    noise: ConstantVelocityStep,
}

impl ManoeuvreTurn {
    /// A turn with lateral acceleration `acceleration` (m/s^2, positive to the left) and acceleration noise of power
    /// spectral density `density` (m^2/s^3).
    ///
    /// # Errors
    /// An acceleration that is not finite; `density` negative or not finite.
    pub fn new(acceleration: f64, density: f64) -> Result<Self> {
        Ok(ManoeuvreTurn {
            acceleration: Error::finite("acceleration of the turn", acceleration)?,
            sqrt_density: Error::not_negative("spectral density of the acceleration", density)?.sqrt(),
        })
    }
}

impl Motion<4, 4> for ManoeuvreTurn {
    type Step = ManoeuvreTurnStep;

    fn over(&self, from: Time, to: Time) -> Result<ManoeuvreTurnStep> {
        let dt = elapsed(from, to)?;
        let half_speed_change = 0.5 * self.acceleration * dt;
        Ok(ManoeuvreTurnStep {
            dt,
            half_speed_change,
            // So slow a target runs a million radians of a circle too small to matter: hold the angle there.
            least_speed: half_speed_change.abs() * 1e-6,
            noise: ConstantVelocityStep::new(self.sqrt_density, dt),
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &ManoeuvreTurnStep, mut x: [R; 4], w: [R; 4]) -> [R; 4] {
        let (vx, vy) = (x[2], x[3]);
        let speed = vx.mul_add(vx, vy.mul_add(vy, vy.constant(f64::MIN_POSITIVE))).sqrt();
        let speed = speed.max(speed.constant(step.least_speed));
        turn::along_arc(&mut x, step.dt, speed.constant(step.half_speed_change) / speed);
        step.noise.add_noise::<R, 2, 4>(&mut x, &w);
        x
    }
}
