//! Backward simulation: 1 000 paths through 1 000 particles at 1 000 instants.

use super::{Options, Row, median, repeat, row};
use cpu_time::ProcessTime;
use std::time::Instant;
use zerre::belief::Gaussian;
use zerre::filter::{Filter, ParticleFilter, Settings};
use zerre::kernels::{NoiseSource, Threads};
use zerre::model::{Motion, measurement, simulate};
use zerre::rng::Stream;
use zerre::smooth::{Backward, History, backward_paths};
use zerre::{Error, Result, Time};

const COUNT: usize = 1000;

/// The way back through positions (sd 0.2) of a motion, `axes` of them; processor times are per path and step.
pub(super) fn ffbsi<A, const N: usize, const W: usize, const D: usize>(
    workload: &'static str,
    motion: A,
    how: Backward,
    options: &Options,
) -> Result<Row>
where
    A: Motion<N, W> + Clone,
    measurement::Position<D>:
        zerre::model::GaussianMeasurement<N, D> + zerre::model::Measurement<N, Value = [f64; D]>,
{
    let times: Vec<Time> = (0..COUNT).map(|k| Time::from_secs(k as f64)).collect();
    let sensor = measurement::Position::<D>::new(0.2)?;
    let truth = simulate::path(&motion, [0.0; N], &times, Stream::new(3).fork(0))?;
    let measured = simulate::measurements(&sensor, &truth, &times, Stream::new(3).fork(1))?;
    let prior = Gaussian::independent([0.0; N], [0.5; N])?;
    let settings = Settings { particles: COUNT, simd: options.simd, ..Settings::default() };
    let filter = ParticleFilter::new(prior, motion.clone(), sensor, settings)?;
    let mut cloud = filter.start(Time::ZERO, Stream::new(1))?;
    let mut history = History::new();
    for (at, z) in times.iter().zip(&measured) {
        filter.step(&mut cloud, *at, Some(z))?;
        history.record(&cloud)?;
    }
    let threads = Threads::new(options.threads)
        .map_err(|error| Error::Unsupported(format!("the system refuses threads: {error}")))?;
    let (mut walls, mut seed) = (Vec::new(), 0);
    let spent = repeat(options.budget, 3, || {
        seed += 1;
        let (cpu, wall) = (ProcessTime::now(), Instant::now());
        std::hint::black_box(backward_paths(&motion, &history, COUNT, how, Stream::new(seed), &threads)?);
        walls.push(wall.elapsed().as_secs_f64());
        Ok(cpu.elapsed())
    })?;
    walls.remove(0);
    let units = (COUNT * COUNT) as f64;
    let base = row(workload, NoiseSource::default(), options, COUNT, &spent, units);
    Ok(Row {
        threads: options.threads,
        cpu_seconds: Some(base.ns_per_particle_step * units * 1e-9),
        wall_seconds: Some(median(&mut walls)),
        ..base
    })
}
