//! Coordinated turn of known rate (Bar-Shalom, section 11.7.1; Li and Jilkov, section V.A) with white-noise
//! acceleration.

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::{Real, sinc, sine_defect};
use crate::model::Motion;
use crate::time::Time;

/// The velocity (vx, vy) turns left at a constant rate, and white-noise acceleration acts on it. The state is
/// `[x, y, vx, vy]`.
///
/// The noise is carried along the turn: Q is the exact integral, not that of straight flight, and at rate zero both
/// agree with [`ConstantVelocity`](super::ConstantVelocity).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinatedTurn {
    rate: f64,
    sqrt_density: f64,
}

/// One step of a [`CoordinatedTurn`].
#[derive(Clone, Copy, Debug)]
pub struct CoordinatedTurnStep {
    /// sin(rate dt) / rate and (1 - cos(rate dt)) / rate.
    ahead: f64,
    aside: f64,
    sin: f64,
    cos: f64,
    /// Cholesky factor with plane vectors as complex numbers: noise of the position, of the velocity with it
    /// (turned), of the velocity alone.
    position: f64,
    shared: [f64; 2],
    velocity: f64,
}

impl CoordinatedTurn {
    /// A turn at `rate_rad_s` (radians per second, positive to the left) with acceleration noise of power spectral
    /// density `density` (m^2/s^3).
    ///
    /// # Errors
    /// A rate that is not finite; `density` negative or not finite.
    pub fn new(rate_rad_s: f64, density: f64) -> Result<Self> {
        Ok(CoordinatedTurn {
            rate: Error::finite("turn rate", rate_rad_s)?,
            sqrt_density: Error::not_negative("spectral density of the acceleration", density)?.sqrt(),
        })
    }
}

impl Motion<4, 4> for CoordinatedTurn {
    type Step = CoordinatedTurnStep;

    fn over(&self, from: Time, to: Time) -> Result<CoordinatedTurnStep> {
        let dt = elapsed(from, to)?;
        let angle = self.rate * dt;
        let (s, c) = Real::sin_cos(0.5 * angle);
        let chord = sinc(0.5 * angle);
        // For unit dt and density, with g = (1 - e^(-i angle u)) / (i angle) ~ u: the integrals of |g|^2 = 2 defect
        // and of g = chord^2 / 2 - i angle defect, and of 1.
        let defect = sine_defect(angle);
        let position = (2.0 * defect).sqrt();
        let shared = [0.5 * chord * chord / position, angle * defect / position];
        let velocity = (1.0 - shared[0] * shared[0] - shared[1] * shared[1]).sqrt();
        let sd = self.sqrt_density * dt.sqrt();
        Ok(CoordinatedTurnStep {
            ahead: dt * chord * c,
            aside: dt * chord * s,
            sin: 2.0 * s * c,
            cos: c * c - s * s,
            position: sd * dt * position,
            shared: shared.map(|l| sd * l),
            velocity: sd * velocity,
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &CoordinatedTurnStep, [x, y, vx, vy]: [R; 4], w: [R; 4]) -> [R; 4] {
        let [along, across] = step.shared;
        let (px, py) = (add_scaled(x, step.ahead, vx), add_scaled(y, step.ahead, vy));
        let (ux, uy) = (add_scaled(vx * step.cos, -step.sin, vy), add_scaled(vy * step.cos, step.sin, vx));
        [
            add_scaled(add_scaled(px, -step.aside, vy), step.position, w[0]),
            add_scaled(add_scaled(py, step.aside, vx), step.position, w[1]),
            add_scaled(add_scaled(add_scaled(ux, along, w[0]), -across, w[1]), step.velocity, w[2]),
            add_scaled(add_scaled(add_scaled(uy, along, w[1]), across, w[0]), step.velocity, w[3]),
        ]
    }
}
