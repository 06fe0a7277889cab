//! The worlds that the laws hold on, and what is seen in them.

use crate::list::{Sensor, World};
use zerre::Time;
use zerre::belief::Gaussian;
use zerre::filter::Prior;
use zerre::model::measurement::{Position, RangeBearing};
use zerre::model::motion::ConstantVelocity;
use zerre::model::simulate;
use zerre::rng::Stream;

/// Positions of a target under white acceleration, measured to `sd` metres: linear and Gaussian.
pub fn linear(sd: f64) -> World<Position<2>> {
    World {
        prior: Gaussian::independent([0.0, 0.0, 1.0, -0.5], [1.0, 1.0, 0.2, 0.2]).unwrap(),
        motion: ConstantVelocity::new(0.02).unwrap(),
        sensor: Position::new(sd).unwrap(),
    }
}

/// Range and bearing from afar. The curvature of the bearing displaces a position whose uncertainty across is s at
/// range r by s^2 / 2r: 10 m at 1 000 m give 0.05 m, of an uncertainty of 10 m.
pub fn radar() -> World<RangeBearing> {
    World {
        prior: Gaussian::independent([-800.0, 600.0, 10.0, -5.0], [10.0, 10.0, 2.0, 2.0]).unwrap(),
        motion: ConstantVelocity::new(0.5).unwrap(),
        sensor: RangeBearing::new([0.0; 2], 20.0, 0.02).unwrap(),
    }
}

/// One step: until when, and what is measured then.
pub type Seen = (Time, Option<[f64; 2]>);

/// Irregular steps: a measurement without time passing, steps without a measurement, one right after a prediction,
/// two at the same time.
const SCRIPT: [(f64, bool); 10] = [
    (0.0, true),
    (0.7, true),
    (1.7, true),
    (2.1, false),
    (2.1, true),
    (3.9, true),
    (3.9, true),
    (5.5, false),
    (6.0, true),
    (7.5, true),
];

/// What is seen of one target of `world`, and its true states.
pub fn script<H: Sensor>(world: &World<H>, stream: Stream) -> (Vec<Seen>, Vec<[f64; 4]>) {
    let times = SCRIPT.map(|(t, _)| Time::from_secs(t));
    let start = world.prior.columns(stream, 1).unwrap().map(|column| column[0]);
    let path = simulate::path(&world.motion, start, &times, stream).unwrap();
    let z = simulate::measurements(&world.sensor, &path, &times, stream).unwrap();
    let seen = times.iter().zip(z).zip(SCRIPT).map(|((&t, z), (_, is_seen))| (t, is_seen.then_some(z)));
    (seen.collect(), path)
}
