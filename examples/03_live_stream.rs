//! A live stream: measurements arrive one by one through an iterator, some late, some not at all.
//!
//! Command: `cargo run --release -p zerre-examples --bin 03_live_stream`
//!
//! The source is a thread behind a channel; a file, a socket or a camera is an iterator in the same way. The loop is
//! the whole application: step, look at the outcome, decide.
//!
//! Conclude: a time without a measurement is a prediction (the standard deviation grows), a late measurement is a
//! typed refusal that leaves the belief as it was, and an absurd one is kept out by the gate. Nothing panics and
//! nothing is silently dropped.

use std::collections::BTreeMap;
use std::error::Error as StdError;
use std::sync::mpsc;
use std::thread;
use zerre::belief::Gaussian;
use zerre::filter::{Filter, Kalman, Outcome};
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::rng::{Purpose, Stream};
use zerre::{Error, Time};

/// What the source sends: a position, or `None` where the sensor looked and saw nothing.
struct Report {
    time: Time,
    position_m: Option<[f64; 2]>,
}

/// A sensor that watches a target pass at 20 m/s, with the faults that real ones have.
fn sensor(out: &mpsc::Sender<Report>) {
    for k in 0..60_u32 {
        let mut draws = Stream::new(3).draws(Purpose::Other, u64::from(k), 0);
        let [nx, ny] = [0; 2].map(|_| 4.0 * draws.normal());
        let t = f64::from(k);
        let seen = [20.0 * t + nx, 100.0 + ny];
        let (time, position_m) = match k {
            20..=27 => (t, None),             // behind a hill
            35 => (t - 3.0, Some(seen)),      // late
            45 => (t, Some([5.0e5, -7.0e5])), // absurd
            _ => (t, Some(seen)),
        };
        if out.send(Report { time: Time::from_secs(time), position_m }).is_err() {
            return; // nobody listens any more
        }
    }
}

fn main() -> Result<(), Box<dyn StdError>> {
    let prior = Gaussian::independent([0.0, 0.0, 0.0, 0.0], [500.0, 500.0, 30.0, 30.0])?;
    // A measurement less likely than one in ten thousand is not used.
    let filter =
        Kalman::new(ConstantVelocity::<2>::new(0.5)?, Position::<2>::new(4.0)?, prior)?.with_gate(0.9999)?;
    let mut belief = filter.start(Time::ZERO, Stream::new(1))?;

    let (sender, stream) = mpsc::channel();
    let source = thread::spawn(move || sensor(&sender));
    let mut outcomes: BTreeMap<String, u32> = BTreeMap::new();
    for report in stream {
        match filter.step(&mut belief, report.time, report.position_m.as_ref()) {
            Ok(update) => {
                *outcomes.entry(format!("{:?}", update.outcome).to_lowercase()).or_default() += 1;
                let k = report.time.secs();
                if k % 9.0 == 0.0 || update.outcome == Outcome::Gated {
                    let sd = belief.state.covariance().0[0][0].sqrt();
                    let [x, ..] = belief.state.mean();
                    println!("{k:>3} s  x = {x:7.1} m +- {sd:5.1} m  {:?}", update.outcome);
                }
            }
            Err(error @ Error::OutOfOrder { .. }) => {
                println!("       refused: {error}");
                *outcomes.entry("late".to_owned()).or_default() += 1;
            }
            Err(error) => return Err(error.into()),
        }
    }
    source.join().map_err(|_| "the source stopped with a panic")?;
    println!("outcomes: {outcomes:?}");
    Ok(())
}
