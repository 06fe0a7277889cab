//! A narrow measurement, and what a swarm makes of the posterior.
//!
//! Command: `cargo run --release -p zerre-examples --bin 07_swarm`
//!
//! A walker in space whose step is twenty times wider than what the sensor leaves open. Columns: root mean square error;
//! share of the steps on which the 90 % ellipsoid holds the truth; by how many nats the evidence of all measurements is
//! off Kalman's; likelihood evaluations a step.
//!
//! Conclude: of plain particles hardly one meets the measurement, and what survives is copies of it. Bees that start from
//! copies have nothing to learn from each other: as papers have them, they stay where they are, and say that they are
//! sure. The same colony, started from a prediction and used as a proposal whose points are weighed, finds the place and
//! says how well it knows it. A likelihood that is taken in by degrees does as well, and needs no swarm.

use std::error::Error as StdError;
use zerre::belief::{Cloud, Gaussian, MovedCloud};
use zerre::filter::{
    Filter, Kalman, ParticleFilter, Readings, Settings, SwarmFilter, SwarmImportance, Tempered,
};
use zerre::model::{measurement::Position, motion::RandomWalk, simulate};
use zerre::moves::Move;
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::swarm::{BeeColony, Coordinates, Swarm};
use zerre::{Result, Time};

const STEPS: i64 = 100;

/// What was seen, and what was there.
struct Record {
    times: Vec<Time>,
    truth: Vec<[f64; 3]>,
    seen: Vec<[f64; 3]>,
}

/// Runs a filter and prints its line; returns the log-evidence.
fn show<F>(
    name: &str,
    filter: &F,
    record: &Record,
    law: impl Fn(&F::Belief) -> Result<Gaussian<3>>,
    exact: Option<f64>,
) -> Result<f64>
where
    F: Filter<Measurement = [f64; 3]>,
{
    let mut belief = filter.start(Time::ZERO, Stream::new(7))?;
    let (mut squares, mut held, mut log_evidence, mut evaluations) = (0.0, 0, 0.0, 0);
    for ((time, truth), z) in record.times.iter().zip(&record.truth).zip(&record.seen) {
        let update = filter.step(&mut belief, *time, Some(z))?;
        log_evidence += update.log_evidence;
        evaluations += update.particles.map_or(1, |p| p.evaluations);
        let law = law(&belief)?;
        squares += law.mean().iter().zip(truth).map(|(m, x)| (m - x) * (m - x)).sum::<f64>();
        // The quantile of chi-square with three degrees of freedom at 90 %. Particles that are all alike have no
        // ellipsoid.
        held += usize::from(law.mahalanobis_squared(truth).is_ok_and(|d| d < 6.251));
    }
    let n = STEPS as f64;
    let off = log_evidence - exact.unwrap_or(log_evidence);
    println!(
        "{name:<30} {:8.4} {:8.2} {off:10.1} {:8}",
        (squares / n).sqrt(),
        held as f64 / n,
        evaluations / STEPS as usize
    );
    Ok(log_evidence)
}

fn main() -> std::result::Result<(), Box<dyn StdError>> {
    let (motion, sensor) = (RandomWalk::<3>::new(1.0)?, Position::<3>::new(0.05)?);
    let prior = Gaussian::independent([0.0; 3], [1.0; 3])?;
    let times: Vec<Time> = (0..=STEPS).map(|k| Time::from_nanos(k * 1_000_000_000)).collect();
    let path = simulate::path(&motion, [0.0; 3], &times, Stream::new(42))?;
    let seen = simulate::measurements(&sensor, &path[1..], &times[1..], Stream::new(42))?;
    let record = Record { times: times[1..].to_vec(), truth: path[1..].to_vec(), seen };

    let inside = |particles, trigger| {
        ParticleFilter::new(prior, motion, sensor, Settings { particles, trigger, ..Settings::default() })
    };
    let of_cloud = |cloud: &Cloud<3>| cloud.gaussian();
    let of_moved = |belief: &MovedCloud<3>| belief.cloud().gaussian();
    let colony =
        |cycles| Swarm::Bees(BeeColony { cycles, coordinates: Coordinates::All, ..BeeColony::default() });

    println!("{:<30} {:>8} {:>8} {:>10} {:>8}", "", "RMSE", "in 90 %", "nats off", "evals");
    let exact =
        show("Kalman", &Kalman::new(motion, sensor, prior)?, &record, |belief| Ok(belief.state), None)?;
    let exact = Some(exact);
    show("particles, 4 000", &inside(4000, Trigger::default())?, &record, of_cloud, exact)?;
    let paper = SwarmFilter::new(inside(50, Trigger::Always)?, colony(39), Readings::default())?;
    show("bees as papers have them", &paper, &record, |belief| belief.cloud().gaussian(), exact)?;
    let proposal = SwarmImportance::new(inside(80, Trigger::default())?, colony(24))?;
    show("bees as a proposal, weighed", &proposal, &record, of_moved, exact)?;
    let tempered = Tempered::new(inside(400, Trigger::default())?, Move::default(), 1)?;
    show("by degrees, random walk", &tempered, &record, of_moved, exact)?;
    let bees = Tempered::new(inside(400, Trigger::default())?, Move::Stretch, 1)?;
    show("by degrees, exact bee move", &bees, &record, of_moved, exact)?;
    Ok(())
}
