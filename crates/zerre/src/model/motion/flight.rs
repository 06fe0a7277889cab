//! Straight flight and turns at a known rate with an acceleration that acts through each step and is then forgotten
//! (Ucar's thesis, sections 3.2 and 3.3; the turn: Li and Jilkov, section V.A).

use super::{add_scaled, elapsed};
use crate::error::{Error, Result};
use crate::math::{Real, sinc};
use crate::model::Motion;
use crate::time::Time;

/// The velocity turns left at a constant rate (none: straight flight), then an acceleration that is constant through
/// the step adds to it; its components are normal, and new in every step. The state is `[x, y, vx, vy, ax, ay]`; its
/// acceleration is not used, but drawn afresh, so that a mode that uses it may follow.
///
/// Two half steps are not one whole step: the noise is tuned for one sampling interval, as the thesis has it. Where
/// intervals differ, take [`CoordinatedTurn`](super::CoordinatedTurn).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    rate: f64,
    disturbance_sd: f64,
    acceleration_sd: f64,
}

/// One step of a [`Flight`].
#[derive(Clone, Copy, Debug)]
pub struct FlightStep {
    /// sin(rate dt) / rate and (1 - cos(rate dt)) / rate.
    ahead: f64,
    aside: f64,
    sin: f64,
    cos: f64,
    position_sd: f64,
    velocity_sd: f64,
    acceleration_sd: f64,
}

impl Flight {
    /// A turn at `rate_rad_s` (radians per second, positive to the left; 0 for straight flight) under accelerations of
    /// standard deviation `disturbance_sd` (m/s^2) along each axis; the acceleration of the state becomes normal with
    /// standard deviation `acceleration_sd` (m/s^2).
    ///
    /// # Errors
    /// A rate that is not finite; deviations that are negative or not finite.
    pub fn new(rate_rad_s: f64, disturbance_sd: f64, acceleration_sd: f64) -> Result<Self> {
        Ok(Flight {
            rate: Error::finite("turn rate", rate_rad_s)?,
            disturbance_sd: Error::not_negative("standard deviation of the disturbance", disturbance_sd)?,
            acceleration_sd: Error::not_negative("standard deviation of the acceleration", acceleration_sd)?,
        })
    }
}

impl Motion<6, 4> for Flight {
    type Step = FlightStep;

    fn over(&self, from: Time, to: Time) -> Result<FlightStep> {
        let dt = elapsed(from, to)?;
        let angle = self.rate * dt;
        let (s, c) = Real::sin_cos(0.5 * angle);
        let chord = dt * sinc(0.5 * angle);
        Ok(FlightStep {
            ahead: chord * c,
            aside: chord * s,
            sin: 2.0 * s * c,
            cos: c * c - s * s,
            position_sd: 0.5 * dt * dt * self.disturbance_sd,
            velocity_sd: dt * self.disturbance_sd,
            acceleration_sd: self.acceleration_sd,
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &FlightStep, [x, y, vx, vy, ..]: [R; 6], w: [R; 4]) -> [R; 6] {
        let (px, py) = (add_scaled(x, step.ahead, vx), add_scaled(y, step.ahead, vy));
        let (ux, uy) = (add_scaled(vx * step.cos, -step.sin, vy), add_scaled(vy * step.cos, step.sin, vx));
        [
            add_scaled(add_scaled(px, -step.aside, vy), step.position_sd, w[0]),
            add_scaled(add_scaled(py, step.aside, vx), step.position_sd, w[1]),
            add_scaled(ux, step.velocity_sd, w[0]),
            add_scaled(uy, step.velocity_sd, w[1]),
            w[2] * step.acceleration_sd,
            w[3] * step.acceleration_sd,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::motion::CoordinatedTurn;

    /// x' = x + S vx - C vy, vx' = c vx - s vy and so on, then w/2 and w (for a second), as the thesis prints them.
    #[test]
    fn one_second_is_that_of_the_thesis() {
        let x = [100.0, -50.0, 210.0, -90.0, 3.0, 4.0];
        let w = [0.3, -1.2, 0.7, 0.1];
        for rate in [0.0, 0.078, -0.078] {
            let step = Flight::new(rate, 2.0, 11.0).unwrap().over(Time::ZERO, Time::from_secs(1.0)).unwrap();
            let y = Flight::apply(&step, x, w);
            let (s, c) = f64::sin_cos(rate);
            let (ahead, aside) = if rate == 0.0 { (1.0, 0.0) } else { (s / rate, (1.0 - c) / rate) };
            let expected = [
                x[0] + ahead * x[2] - aside * x[3] + 0.5 * 2.0 * w[0],
                x[1] + aside * x[2] + ahead * x[3] + 0.5 * 2.0 * w[1],
                c * x[2] - s * x[3] + 2.0 * w[0],
                s * x[2] + c * x[3] + 2.0 * w[1],
                11.0 * w[2],
                11.0 * w[3],
            ];
            for (y, expected) in y.iter().zip(expected) {
                // A dozen roundings of numbers below 512.
                assert!((y - expected).abs() < 12.0 * 512.0 * f64::EPSILON, "{rate}: {y} {expected}");
            }
            let turn = CoordinatedTurn::new(rate, 0.0).unwrap();
            let step = turn.over(Time::ZERO, Time::from_secs(1.0)).unwrap();
            let quiet = Flight::new(rate, 0.0, 0.0).unwrap().over(Time::ZERO, Time::from_secs(1.0)).unwrap();
            let turned = CoordinatedTurn::apply(&step, [x[0], x[1], x[2], x[3]], [0.0; 4]);
            assert_eq!(Flight::apply(&quiet, x, w)[..4], turned);
        }
    }
}
