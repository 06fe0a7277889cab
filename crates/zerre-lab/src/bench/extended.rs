//! A target of three ellipses, nine points a scan: the scene of Özkan 2019.

use super::{Options, Row, repeat, row};
use crate::paper::extended_target::scenario::{motion, near, prior, record};
use cpu_time::ThreadTime;
use zerre::extended::MStep;
use zerre::extended::centre::FirstTwo;
use zerre::extended::online::{OnlineEm, OnlineSettings};
use zerre::extended::window::{WindowSettings, WindowVb};
use zerre::filter::Filter;
use zerre::kernels::NoiseSource;
use zerre::rng::Stream;
use zerre::{Result, Time};

/// Scans behind a time, after those that fill the window.
const SCANS: usize = 200;
const FIRST: usize = 20;

fn timed<F>(workload: &'static str, filter: &F, particles: usize, options: &Options) -> Result<Row>
where
    F: Filter<Measurement = Vec<[f64; 2]>>,
    F::Belief: Clone,
{
    let record = record(FIRST + SCANS, 9, 0, Stream::new(5))?;
    let mut start = filter.start(Time::ZERO, Stream::new(1))?;
    let mut scans = record.times.iter().zip(&record.scans);
    for (at, scan) in scans.by_ref().take(FIRST) {
        filter.step(&mut start, *at, Some(scan))?;
    }
    let spent = repeat(options.budget, 3, || {
        let mut belief = start.clone();
        let cpu = ThreadTime::now();
        for (at, scan) in scans.clone() {
            filter.step(&mut belief, *at, Some(scan))?;
        }
        let spent = cpu.elapsed();
        std::hint::black_box(belief);
        Ok(spent)
    })?;
    Ok(row(workload, NoiseSource::default(), options, particles, &spent, (particles * SCANS) as f64))
}

/// The window filter, 10 scans and 5 turns; a scan counts as one particle.
pub(super) fn window(workload: &'static str, options: &Options) -> Result<Row> {
    let m_step = MStep { weights: false, ..MStep::default() };
    let settings = WindowSettings { window: 10, sweeps: 5, m_step, ..WindowSettings::default() };
    timed(workload, &WindowVb::new(motion()?, FirstTwo, prior()?, near()?, settings)?, 1, options)
}

/// The particle filter that sums over the ellipses of points.
pub(super) fn online(workload: &'static str, options: &Options) -> Result<Row> {
    let m_step = MStep { weights: false, ..MStep::default() };
    let settings =
        OnlineSettings { particles: 1000, m_step, simd: options.simd, ..OnlineSettings::default() };
    timed(workload, &OnlineEm::new(motion()?, FirstTwo, prior()?, near()?, settings)?, 1000, options)
}
