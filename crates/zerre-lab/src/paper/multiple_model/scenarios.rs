//! The three tracks, in metres and seconds, and what a radar sees of them.
//!
//! The thesis prints neither start, speed, heading, turn rate nor the place of the observer. Those here give the area
//! of its bounding boxes (196, 665 and 116 km^2) with its sequence of manoeuvres, and errors of its order.

use super::settings::{ACCELERATION_SD, PRIOR_POSITION_SD, PRIOR_VELOCITY_SD};
use zerre::belief::Gaussian;
use zerre::math::Real;
use zerre::math::wrap;
use zerre::model::measurement::RangeBearing;
use zerre::rng::{Purpose, Stream};
use zerre::{Result, Time};

/// How the target flies for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Flying {
    /// Straight on, with constant velocity.
    Straight,
    /// A turn to the left (counter-clockwise) at [`TURN_RATE`].
    Left,
    /// A turn to the right.
    Right,
    /// With the constant acceleration [`ACCELERATION`], along the velocity at the beginning.
    Accelerating,
}

/// Rate of all turns, rad/s: 4.5 degrees per second, known to the filters.
pub const TURN_RATE: f64 = 4.5 * std::f64::consts::PI / 180.0;

/// Acceleration of the accelerated legs, m/s^2.
pub const ACCELERATION: f64 = 10.0;

/// Steps of a second after the start; there is a measurement at the end of each.
pub const STEPS: usize = 100;

/// One track and its observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Number, from 1.
    pub number: u8,
    /// Speed at the start, m/s.
    pub speed: f64,
    /// Course at the start, degrees from the x axis, counter-clockwise.
    pub heading_deg: f64,
    /// Legs: how the target flies and for how many steps.
    pub legs: &'static [(Flying, usize)],
    /// Place of the radar, m.
    pub observer: [f64; 2],
    /// The modes that the filters have.
    pub modes: &'static [Flying],
}

use Flying::{Accelerating, Left, Right, Straight};

/// The scenarios, in their order.
pub const SCENARIOS: [Scenario; 3] = [
    Scenario {
        number: 1,
        speed: 250.0,
        heading_deg: 78.5,
        legs: &[(Straight, 38), (Left, 20), (Straight, 9), (Right, 10), (Straight, 23)],
        observer: [-6_000.0, 12_000.0],
        modes: &[Straight, Left, Right],
    },
    Scenario {
        number: 2,
        speed: 350.0,
        heading_deg: 31.6,
        legs: &[(Straight, 20), (Left, 15), (Straight, 15), (Right, 15), (Accelerating, 25), (Straight, 10)],
        observer: [4_000.0, 10_000.0],
        modes: &[Straight, Left, Right, Accelerating],
    },
    Scenario {
        number: 3,
        speed: 230.0,
        heading_deg: 41.0,
        legs: &[
            (Left, 10),
            (Right, 10),
            (Left, 14),
            (Right, 20),
            (Straight, 8),
            (Right, 23),
            (Accelerating, 15),
        ],
        observer: [-3_000.0, 16_000.0],
        modes: &[Straight, Left, Right, Accelerating],
    },
];

impl Scenario {
    /// The true states `[x, y, vx, vy, ax, ay]` at the steps 0 to [`STEPS`]: no noise moves the target.
    pub fn truth(&self) -> Vec<[f64; 6]> {
        let (sin, cos) = Real::sin_cos(self.heading_deg * (std::f64::consts::PI / 180.0));
        let mut state = [0.0, 0.0, self.speed * cos, self.speed * sin, 0.0, 0.0];
        let mut path = vec![state];
        for &(flying, steps) in self.legs {
            let [_, _, vx, vy, ..] = state;
            let along = ACCELERATION / (vx * vx + vy * vy).sqrt();
            let pull = if flying == Accelerating { [along * vx, along * vy] } else { [0.0; 2] };
            for _ in 0..steps {
                state = flying.step(state, pull);
                path.push(state);
            }
        }
        path
    }
}

impl Flying {
    /// The state a second later, under the acceleration `pull`.
    fn step(self, [x, y, vx, vy, ..]: [f64; 6], pull: [f64; 2]) -> [f64; 6] {
        let rate = match self {
            Straight | Accelerating => {
                let (ax, ay) = (pull[0], pull[1]);
                return [x + vx + 0.5 * ax, y + vy + 0.5 * ay, vx + ax, vy + ay, ax, ay];
            }
            Left => TURN_RATE,
            Right => -TURN_RATE,
        };
        let (s, c) = Real::sin_cos(rate);
        let (ahead, aside) = (s / rate, (1.0 - c) / rate);
        let place = [x + ahead * vx - aside * vy, y + aside * vx + ahead * vy];
        [place[0], place[1], c * vx - s * vy, s * vx + c * vy, 0.0, 0.0]
    }
}

/// The instants of the steps 0 to [`STEPS`].
pub fn times() -> impl Iterator<Item = Time> {
    (0..=STEPS as i64).map(|step| Time::from_nanos(step * 1_000_000_000))
}

/// What one run of a scenario hands to every filter.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// True positions at the steps 1 to [`STEPS`], m.
    pub truth: Vec<[f64; 2]>,
    /// Measurements `[range_m, bearing_rad]` at these steps.
    pub measured: Vec<[f64; 2]>,
    /// The radar, with its true noise.
    pub sensor: RangeBearing,
    /// What the filters know at the start.
    pub prior: Gaussian<6>,
}

/// Standard deviations `[m, rad]` that the noise label of the thesis stands for: kilometres and radians.
pub fn deviations(noise: f64) -> [f64; 2] {
    [1000.0 * noise, noise]
}

impl Scenario {
    /// One run: measurements with the noise label `noise` and a drawn prior. The standard normals behind both depend on
    /// `stream` alone, so that every noise and every filter sees the same luck.
    ///
    /// # Errors
    /// A noise that is not positive and finite.
    pub fn world(&self, noise: f64, stream: Stream) -> Result<World> {
        let [range_sd, bearing_sd] = deviations(noise);
        let path = self.truth();
        let measured = (1..).zip(&path[1..]).map(|(step, state)| {
            let mut draws = stream.draws(Purpose::Measurement, step, 0);
            let (dx, dy) = (state[0] - self.observer[0], state[1] - self.observer[1]);
            let range = (dx * dx + dy * dy).sqrt() + range_sd * draws.normal();
            let bearing = Real::atan2(dy, dx) + bearing_sd * draws.normal();
            [range, wrap(bearing)]
        });
        let spread = [PRIOR_POSITION_SD, PRIOR_POSITION_SD, PRIOR_VELOCITY_SD, PRIOR_VELOCITY_SD];
        let mut draws = stream.draws(Purpose::Prior, 0, 0);
        let mut mean = [0.0; 6];
        for k in 0..4 {
            mean[k] = path[0][k] + spread[k] * draws.normal();
        }
        let [p, q, v, w] = spread;
        Ok(World {
            truth: path[1..].iter().map(|state| [state[0], state[1]]).collect(),
            measured: measured.collect(),
            sensor: RangeBearing::new(self.observer, range_sd, bearing_sd)?,
            prior: Gaussian::independent(mean, [p, q, v, w, ACCELERATION_SD, ACCELERATION_SD])?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Box, end and ranges in kilometres, as the definition of the scenarios gives them to six or seven figures.
    struct Expected {
        extent: [f64; 2],
        area: f64,
        end: [f64; 4],
        range: [f64; 3],
    }

    const EXPECTED: [Expected; 3] = [
        Expected {
            extent: [9.94475, 19.66884],
            area: 195.602,
            end: [-7.988795, 19.668838, -0.137984, 0.208472],
            range: [2.834, 7.364, 13.416],
        },
        Expected {
            extent: [24.48676, 27.21885],
            area: 666.501,
            end: [24.486761, 27.218851, 0.511036, 0.314392],
            range: [3.687, 10.276, 26.762],
        },
        Expected {
            extent: [10.51546, 11.01222],
            area: 115.799,
            end: [10.515459, 3.534612, 0.003316, -0.379986],
            range: [9.183, 13.031, 18.386],
        },
    ];

    /// Printed numbers are right to half a unit of their last digit; beyond that a millionth is allowed.
    fn printed(found: f64, expected: f64, digits: i32) -> bool {
        (found - expected).abs() <= 0.5 * 10f64.powi(-digits) + 1e-6 * expected.abs()
    }

    #[test]
    fn the_tracks_are_those_of_the_definition() {
        for (scenario, expected) in SCENARIOS.iter().zip(&EXPECTED) {
            let path = scenario.truth();
            assert_eq!(path.len(), STEPS + 1, "{}", scenario.number);
            let extent = [0, 1].map(|k| {
                let values = || path.iter().map(|state| state[k] * 1e-3);
                values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
            });
            for k in 0..2 {
                assert!(printed(extent[k], expected.extent[k], 5), "{extent:?}");
            }
            assert!(printed(extent[0] * extent[1], expected.area, 3), "{extent:?}");
            for k in 0..4 {
                assert!(printed(path[STEPS][k] * 1e-3, expected.end[k], 6), "{:?}", path[STEPS]);
            }
            let ranges: Vec<f64> = path
                .iter()
                .map(|s| (s[0] - scenario.observer[0]).hypot(s[1] - scenario.observer[1]) * 1e-3)
                .collect();
            let found = [
                ranges.iter().copied().fold(f64::MAX, f64::min),
                ranges.iter().sum::<f64>() / ranges.len() as f64,
                ranges.iter().copied().fold(f64::MIN, f64::max),
            ];
            for k in 0..3 {
                assert!(printed(found[k], expected.range[k], 3), "{found:?}");
            }
        }
    }

    #[test]
    fn every_noise_sees_the_same_normals() {
        let stream = Stream::new(5);
        for scenario in &SCENARIOS {
            let quiet = scenario.world(0.01, stream).unwrap();
            let loud = scenario.world(0.2, stream).unwrap();
            assert_eq!((quiet.prior, &quiet.truth), (loud.prior, &loud.truth));
            for ((place, few), many) in quiet.truth.iter().zip(&quiet.measured).zip(&loud.measured) {
                let (dx, dy) = (place[0] - scenario.observer[0], place[1] - scenario.observer[1]);
                // Ranges below 27 km round to 4e-12 m; the noise label differs by a factor of 20.
                assert!((20.0 * (few[0] - dx.hypot(dy)) - (many[0] - dx.hypot(dy))).abs() < 1e-9);
                let off = |z: &[f64; 2]| wrap(z[1] - dy.atan2(dx));
                assert!(wrap(20.0 * off(few) - off(many)).abs() < 1e-12);
            }
            assert_ne!(scenario.world(0.1, Stream::new(6)).unwrap().measured, quiet.measured);
        }
    }
}
