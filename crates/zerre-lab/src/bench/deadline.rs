//! The workload `deadline`: whether steps keep their time.

use super::{Options, Row, built_in, radar_prior, row, settings};
use serde::Serialize;
use std::time::{Duration, Instant};
use zerre::filter::{Budget, Deadline, Filter, ParticleFilter};
use zerre::kernels::NoiseSource;
use zerre::model::simulate;
use zerre::rng::Stream;
use zerre::{Result, Time};

/// How steps with a budget of time fared, by the clock on the wall.
#[derive(Clone, Debug, Serialize)]
pub struct Kept {
    /// The budget of a step, in milliseconds.
    pub budget_ms: f64,
    /// Share of the steps that kept it.
    pub share: f64,
    /// Numbers of particles: the quantiles at 1 %, 50 % and 99 %.
    pub particles: [usize; 3],
    /// Milliseconds of a step: the quantiles at 50 % and 99.9 %, and the longest.
    pub milliseconds: [f64; 3],
}

/// Steps that are not counted: until the number of particles has settled.
const WARM_UP: usize = 500;
const BUDGET: Duration = Duration::from_millis(1);

/// W1's models on a target that circles in the place of W1's, for as long as is asked.
pub(super) fn run(workload: &'static str, steps: usize, options: &Options) -> Result<Row> {
    let (motion, sensor) = built_in()?;
    let prior = radar_prior()?;
    let &[x, y, vx, vy] = prior.mean();
    let (speed, radius) = (vx.hypot(vy), 8.0);
    let centre = [x + radius * vy / speed, y - radius * vx / speed];
    let times: Vec<Time> =
        (0..(WARM_UP + steps) as i64).map(|k| Time::from_nanos(k * 1_000_000_000)).collect();
    let on_circle = |at: &Time| {
        let (sin, cos) = (-at.secs() * speed / radius).sin_cos();
        let (rx, ry) = (x - centre[0], y - centre[1]);
        let (px, py) = (centre[0] + rx * cos - ry * sin, centre[1] + rx * sin + ry * cos);
        [px, py, vx * cos - vy * sin, vx * sin + vy * cos]
    };
    let truth: Vec<[f64; 4]> = times.iter().map(on_circle).collect();
    let stream = Stream::new(5);
    let measured = simulate::measurements(&sensor, &truth, &times, stream)?;

    let source = NoiseSource::default();
    let filter = ParticleFilter::new(prior, motion, sensor, settings(10_000, source, options))?;
    let budget = Budget { most: 400_000, ..Budget::per_step(BUDGET) };
    let origin = Instant::now();
    let timed = Deadline::new(filter, budget, move || origin.elapsed())?;
    let mut belief = timed.start(Time::ZERO, stream)?;
    let (mut spent, mut costs, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
    let mut square = 0.0;
    for (k, ((at, z), x)) in times.iter().zip(&measured).zip(&truth).enumerate() {
        let since = Instant::now();
        let update = timed.step(&mut belief, *at, Some(z))?;
        let time = since.elapsed().as_secs_f64();
        if k >= WARM_UP {
            let n = update.particles.map_or(0, |p| p.particles);
            spent.push(1e3 * time);
            costs.push(time / n as f64);
            numbers.push(n);
            let mean = belief.cloud().mean();
            square += (mean[0] - x[0]).powi(2) + (mean[1] - x[1]).powi(2);
        }
    }
    let budget_ms = 1e3 * BUDGET.as_secs_f64();
    let share = spent.iter().filter(|ms| **ms <= budget_ms).count() as f64 / spent.len() as f64;
    spent.sort_unstable_by(f64::total_cmp);
    numbers.sort_unstable();
    let at = |share: f64| (share * (spent.len() - 1) as f64) as usize;
    let kept = Kept {
        budget_ms,
        share,
        particles: [0.01, 0.5, 0.99].map(|share| numbers[at(share)]),
        milliseconds: [0.5, 0.999, 1.0].map(|share| spent[at(share)]),
    };
    Ok(Row {
        rmse: Some((square / spent.len() as f64).sqrt()),
        deadline: Some(kept.clone()),
        ..row(workload, source, options, kept.particles[1], &costs, 1.0)
    })
}
