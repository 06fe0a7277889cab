//! Speed and accuracy of the engine on fixed workloads, the same that other libraries were measured on.
//!
//! | workload | what |
//! |---|---|
//! | W1 | radar: constant velocity, range and bearing, 4 states, 4 normals, 100 steps, ESS trigger at one half |
//! | W1-ekf-guided, W1-ukf-guided | W1 with particles that look at the measurement before they move |
//! | W1-position, W1-optimal | the positions of W1's targets, measured: blind, and by the locally optimal proposal |
//! | W1-user-model | the same with models written by hand through `Real`, as a user would |
//! | W2 | univariate growth, 1 state, 100 steps |
//! | W3-... | one resampling of N weights exp(-2 a^2), a standard normal, to N indices |
//! | W4 | 100 independent runs of W1 with 5 000 particles, spread over threads |
//! | FFBSi-level, FFBSi | 1 000 backward paths through 1 000 particles at 1 000 instants, for positions of a random walk and of W1's motion; times are per path and step |
//! | FFBSi-moves | the latter by 30 moves of a chain in place of exact draws |
//! | W5 | W1 by the multiple-model filter, 5 000 particles under each of four modes: straight, accelerating, two turns |
//! | window-vb | a target of three ellipses, nine points a scan, window of 10 scans and 5 turns; times are per scan |
//! | rb-online-em | the same by 1 000 particles that sum over the ellipses of points; times are per particle and scan |
//! | balls-detector | what differs from plain ground in frames of 640 x 480 pixels; times are per frame |
//! | balls | three balls, 1 000 particles each: prediction, pairing, filters; times are per frame |
//! | deadline | W1's models on a target that circles, as many particles as fit into 1 ms; only when named |
//!
//! Times are processor time of the calling thread (W4: of the process), medians over repetitions; the first repetition
//! is not counted. `rmse` is the position error against the truth, `reference_distance` the RMS distance of the
//! filter's mean to that of 32 million particles: it must fall as 1 / sqrt(N).

mod balls;
mod deadline;
mod extended;
mod ffbsi;

pub use deadline::Kept;

use cpu_time::{ProcessTime, ThreadTime};
use rayon::prelude::*;
use serde::Serialize;
use std::time::{Duration, Instant};
use zerre::belief::Gaussian;
use zerre::filter::{
    Filter, Kalman, Linear, ModalSettings, MultipleModel, ParticleFilter, Settings, SigmaPoints, Tangent,
};
use zerre::kernels::{Generator, NoiseSource, Resolution, Simd, Threads};
use zerre::math::Real;
use zerre::model::{Chain, JumpMarkov, Likelihood, Measurement, Motion, measurement, motion, simulate};
use zerre::proposal::{Bootstrap, Guided, Proposal};
use zerre::resample::{Resampler, Resampling};
use zerre::rng::{Purpose, Stream};
use zerre::smooth::Backward;
use zerre::{Result, Time};

/// One line of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the workload.
    pub workload: &'static str,
    /// Generator of the process noise.
    pub generator: &'static str,
    /// Resolution of the process noise; states and weights are `f64` always.
    pub noise_bits: u32,
    /// Precision of states and weights.
    pub precision: &'static str,
    /// SIMD level.
    pub simd: &'static str,
    /// Number of particles.
    pub particles: usize,
    /// Threads at work.
    pub threads: usize,
    /// Repetitions behind the medians.
    pub repetitions: usize,
    /// Median processor time per particle and step (W3: per weight), in nanoseconds.
    pub ns_per_particle_step: f64,
    /// Fastest and slowest repetition.
    pub ns_range: (f64, f64),
    /// Mean position error, in the units of the workload.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse: Option<f64>,
    /// Standard error of `rmse` over the repetitions' seeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_standard_error: Option<f64>,
    /// RMS distance of the filter mean to the reference posterior mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_distance: Option<f64>,
    /// Processor seconds of the whole workload (W4, FFBSi).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu_seconds: Option<f64>,
    /// Wall seconds of the whole workload (W4, FFBSi).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wall_seconds: Option<f64>,
    /// How the steps kept their time (deadline); other times of this row are of the clock on the wall.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deadline: Option<Kept>,
    /// Most memory the process had used by the end of the row, where the system tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_mb: Option<f64>,
}

/// What is measured, and how thoroughly.
#[derive(Clone, Debug)]
pub struct Options {
    /// SIMD level.
    pub simd: Simd,
    /// Threads of W4 and FFBSi.
    pub threads: usize,
    /// Time that the repetitions of a row may take together.
    pub budget: Duration,
    /// Steps of the workload `deadline`, of a millisecond each.
    pub deadline_steps: usize,
}

const STEPS: usize = 100;
const W1_DATA: &str = include_str!("../../zerre/benches/data/W1.csv");
const W1_REFERENCE: &str = include_str!("../../zerre/benches/data/W1_ref.csv");
const W2_DATA: &str = include_str!("../../zerre/benches/data/W2.csv");
const W2_REFERENCE: &str = include_str!("../../zerre/benches/data/W2_ref.csv");

/// The workload that runs only when it is asked for by name: it takes as long as its steps.
const DEADLINE: &str = "deadline";

type Job<'a> = Box<dyn Fn(&'static str) -> Result<Row> + 'a>;

/// The names of the workloads.
pub fn workloads() -> Vec<&'static str> {
    let options = Options { simd: Simd::best(), threads: 1, budget: Duration::ZERO, deadline_steps: 0 };
    let mut names: Vec<_> = jobs(&options).into_iter().map(|(name, _)| name).collect();
    names.dedup();
    names
}

/// Runs the workloads called `names`, all but `deadline` if there are none; `progress` hears of every row.
///
/// # Errors
/// A model refuses its parameters, or the system refuses threads.
pub fn run(options: &Options, names: &[String], mut progress: impl FnMut(&Row) -> bool) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    let is_chosen = |name: &str| {
        if names.is_empty() { name != DEADLINE } else { names.iter().any(|one| one == name) }
    };
    for (name, job) in jobs(options).into_iter().filter(|(name, _)| is_chosen(name)) {
        let row = job(name)?;
        let go_on = progress(&row);
        rows.push(row);
        if !go_on {
            break;
        }
    }
    Ok(rows)
}

/// Every row with the name of its workload.
fn jobs(options: &Options) -> Vec<(&'static str, Job<'_>)> {
    let philox = NoiseSource::default();
    let sources = [
        philox,
        NoiseSource { generator: Generator::Xoshiro, ..philox },
        NoiseSource { resolution: Resolution::Bits64, ..philox },
    ];
    let mut jobs: Vec<(&'static str, Job<'_>)> = Vec::new();
    for n in [1_000, 10_000, 100_000, 1_000_000] {
        for source in sources {
            jobs.push(("W1", Box::new(move |name| radar(name, built_in()?, Bootstrap, n, source, options))));
        }
    }
    jobs.push(("W1-user-model", {
        let models = || (UserMotion::new(), UserSensor);
        Box::new(move |name| radar(name, models(), Bootstrap, 10_000, philox, options))
    }));
    jobs.push(("W1-ekf-guided", {
        let proposal = Guided::<_, 2>::new(Tangent);
        Box::new(move |name| radar(name, built_in()?, proposal, 10_000, philox, options))
    }));
    jobs.push(("W1-ukf-guided", {
        let proposal = Guided::<_, 2>::new(SigmaPoints::default());
        Box::new(move |name| radar(name, built_in()?, proposal, 10_000, philox, options))
    }));
    jobs.push(("W1-position", Box::new(|name| positions(name, Bootstrap, 10_000, options))));
    jobs.push(("W1-optimal", Box::new(|name| positions(name, Guided::<_, 2>::new(Linear), 10_000, options))));
    for n in [10_000, 1_000_000] {
        jobs.push(("W2", Box::new(move |name| growth(name, n, philox, options))));
    }
    for (name, scheme) in [
        ("W3-multinomial", Resampling::Multinomial),
        ("W3-residual", Resampling::Residual),
        ("W3-stratified", Resampling::Stratified),
        ("W3-systematic", Resampling::Systematic),
    ] {
        jobs.push((name, Box::new(move |name| resampling(name, scheme, 100_000, options))));
    }
    jobs.push(("W4", Box::new(|name| many_runs(name, 1, options))));
    if options.threads > 1 {
        jobs.push(("W4", Box::new(|name| many_runs(name, options.threads, options))));
    }
    jobs.push(("W5", Box::new(|name| multiple_model(name, options))));
    jobs.push((
        "FFBSi-level",
        Box::new(|name| {
            let motion = motion::RandomWalk::<1>::new(0.05)?;
            ffbsi::ffbsi::<_, 1, 1, 1>(name, motion, Backward::default(), options)
        }),
    ));
    for (name, how) in [("FFBSi", Backward::default()), ("FFBSi-moves", Backward::Moves { count: 30 })] {
        jobs.push((
            name,
            Box::new(move |name| ffbsi::ffbsi::<_, 4, 4, 2>(name, built_in()?.0, how, options)),
        ));
    }
    jobs.push(("window-vb", Box::new(|name| extended::window(name, options))));
    jobs.push(("rb-online-em", Box::new(|name| extended::online(name, options))));
    jobs.push(("balls-detector", Box::new(|name| balls::detector(name, options))));
    jobs.push(("balls", Box::new(|name| balls::filters(name, options))));
    jobs.push((DEADLINE, Box::new(|name| deadline::run(name, options.deadline_steps, options))));
    jobs
}

/// Speed-up that `threads` threads reach on loops that touch no memory: what the machine itself allows.
pub fn memory_free_scaling(threads: usize) -> f64 {
    fn spin() -> u64 {
        (0..400_000_000u64)
            .fold(1, |x, i| std::hint::black_box(x).wrapping_mul(6_364_136_223_846_793_005).wrapping_add(i))
    }
    let time = |count: usize| {
        let start = Instant::now();
        std::thread::scope(|scope| {
            for _ in 0..count {
                scope.spawn(|| std::hint::black_box(spin()));
            }
        });
        start.elapsed().as_secs_f64()
    };
    let alone = time(1);
    threads as f64 * alone / time(threads)
}

type Radar = (motion::ConstantVelocity<2>, measurement::RangeBearing);

fn built_in() -> Result<Radar> {
    Ok((motion::ConstantVelocity::new(0.05)?, measurement::RangeBearing::new([-6.0, 12.0], 0.1, 0.01)?))
}

/// Constant velocity with q = 0.05, written without help from the library.
#[derive(Clone, Copy)]
struct UserMotion {
    l11: f64,
    l21: f64,
    l22: f64,
}

impl UserMotion {
    fn new() -> Self {
        let q: f64 = 0.05;
        let l11 = (q / 3.0).sqrt();
        let l21 = q / 2.0 / l11;
        UserMotion { l11, l21, l22: (q - l21 * l21).sqrt() }
    }
}

impl Motion<4, 4> for UserMotion {
    type Step = (f64, f64, f64, f64);

    fn over(&self, from: Time, to: Time) -> Result<Self::Step> {
        Ok(((to - from).secs(), self.l11, self.l21, self.l22))
    }

    #[inline(always)]
    fn apply<R: Real>(&(dt, a, b, c): &Self::Step, [x, y, vx, vy]: [R; 4], w: [R; 4]) -> [R; 4] {
        [x + vx * dt + w[0] * a, y + vy * dt + w[1] * a, vx + w[0] * b + w[2] * c, vy + w[1] * b + w[3] * c]
    }
}

/// ln(2 pi 0.1 0.01).
const LOG_NORMALISER: f64 = -5.069_878_212_572_791_5;

/// Range and bearing from (-6, 12), written as in a textbook: the innovation is wrapped by sine and cosine.
struct UserSensor;

impl Measurement<4> for UserSensor {
    type Value = [f64; 2];
    type Given<'z> = [f64; 3];

    fn given(&self, &[range, bearing]: &[f64; 2], _: Time) -> Result<[f64; 3]> {
        Ok([range, bearing.cos(), bearing.sin()])
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(&[range, cos, sin]: &[f64; 3], [x, y, ..]: [R; 4]) -> R {
        let (dx, dy) = (x + 6.0, y - 12.0);
        let along = dx * cos + dy * sin;
        let across = dy * cos - dx * sin;
        let e = ((dx * dx + dy * dy).sqrt() - range) * 10.0;
        let b = across.atan2(along) * 100.0;
        (e * e + b * b) * -0.5 - LOG_NORMALISER
    }
}

fn radar<M, H, Q>(
    workload: &'static str,
    (motion, sensor): (M, H),
    proposal: Q,
    n: usize,
    source: NoiseSource,
    options: &Options,
) -> Result<Row>
where
    M: Motion<4, 4>,
    H: Likelihood<4, Value = [f64; 2]>,
    Q: Proposal<4, 4, M, H>,
{
    let data = table(W1_DATA);
    let measured = data.iter().map(|row| [row[4], row[5]]).collect();
    let settings = settings(n, source, options);
    let filter = ParticleFilter::guided(radar_prior()?, motion, sensor, proposal, settings)?;
    let truth = data.iter().map(|row| [row[0], row[1]]).collect();
    let reference = table(W1_REFERENCE).iter().map(|row| [row[0], row[1]]).collect();
    sequence(workload, &filter, &Known { measured, truth, reference }, options)
}

/// W1 with measured positions, to 0.2 m; what they leave is known exactly.
fn positions<Q>(workload: &'static str, proposal: Q, n: usize, options: &Options) -> Result<Row>
where
    Q: Proposal<4, 4, motion::ConstantVelocity<2>, measurement::Position<2>>,
{
    let truth: Vec<[f64; 2]> = table(W1_DATA).iter().map(|row| [row[0], row[1]]).collect();
    let (motion, sensor) = (built_in()?.0, measurement::Position::new(0.2)?);
    let mut draws = Stream::new(2).draws(Purpose::Measurement, 0, 0);
    let measured: Vec<[f64; 2]> = truth.iter().map(|x| x.map(|x| x + 0.2 * draws.normal())).collect();
    let kalman = Kalman::new(motion, sensor, radar_prior()?)?;
    let mut belief = kalman.start(Time::ZERO, Stream::new(1))?;
    let mut reference = Vec::with_capacity(STEPS);
    for (k, z) in measured.iter().enumerate() {
        kalman.step(&mut belief, Time::from_nanos(k as i64 * 1_000_000_000), Some(z))?;
        let mean = belief.state.mean();
        reference.push([mean[0], mean[1]]);
    }
    let settings = settings(n, NoiseSource::default(), options);
    let filter = ParticleFilter::guided(radar_prior()?, motion, sensor, proposal, settings)?;
    sequence(workload, &filter, &Known { measured, truth, reference }, options)
}

/// A mode of W5, over `[x, y, vx, vy, ax, ay]` and steps of a second, with white-noise acceleration of density 0.05.
#[derive(Clone, Copy)]
enum Mode {
    Straight,
    Accelerating,
    /// Radians per second.
    Turn(f64),
}

/// Coefficients of the mode's step, and of the noise of W1.
enum ModeStep {
    Straight(UserMotion),
    Accelerating(UserMotion),
    Turn { ahead: f64, aside: f64, sin: f64, cos: f64, noise: UserMotion },
}

impl Motion<6, 6> for Mode {
    type Step = ModeStep;

    fn over(&self, _: Time, _: Time) -> Result<ModeStep> {
        let noise = UserMotion::new();
        Ok(match *self {
            Mode::Straight => ModeStep::Straight(noise),
            Mode::Accelerating => ModeStep::Accelerating(noise),
            Mode::Turn(rate) => {
                let (sin, cos) = rate.sin_cos();
                ModeStep::Turn { ahead: sin / rate, aside: (1.0 - cos) / rate, sin, cos, noise }
            }
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &ModeStep, [x, y, vx, vy, ax, ay]: [R; 6], w: [R; 6]) -> [R; 6] {
        let none = x.constant(0.0);
        let ([x, y, vx, vy, ax, ay], n) = match step {
            ModeStep::Straight(n) => ([x + vx, y + vy, vx, vy, none, none], n),
            ModeStep::Accelerating(n) => {
                let (px, py) = (x + vx + ax * 0.5, y + vy + ay * 0.5);
                ([px, py, vx + ax, vy + ay, ax + w[4] * 0.05, ay + w[5] * 0.05], n)
            }
            ModeStep::Turn { ahead, aside, sin, cos, noise } => {
                let (px, py) = (x + vx * *ahead - vy * *aside, y + vx * *aside + vy * *ahead);
                ([px, py, vx * *cos - vy * *sin, vx * *sin + vy * *cos, none, none], noise)
            }
        };
        [
            x + w[0] * n.l11,
            y + w[1] * n.l11,
            vx + w[0] * n.l21 + w[2] * n.l22,
            vy + w[1] * n.l21 + w[3] * n.l22,
            ax,
            ay,
        ]
    }

    fn noise_components(&self) -> usize {
        if matches!(self, Mode::Accelerating) { 6 } else { 4 }
    }
}

fn multiple_model(workload: &'static str, options: &Options) -> Result<Row> {
    const PARTICLES: usize = 5_000;
    let modes = vec![Mode::Straight, Mode::Accelerating, Mode::Turn(0.1), Mode::Turn(-0.1)];
    // Every mode as likely as every other at every step.
    let chain = Chain::per_step(vec![vec![0.25; 4]; 4])?;
    let prior = Gaussian::independent([0.0, 0.0, 0.5, 0.3, 0.0, 0.0], [0.5, 0.5, 0.3, 0.3, 1e-6, 1e-6])?;
    let settings = ModalSettings { particles: PARTICLES, simd: options.simd, ..ModalSettings::default() };
    let source = settings.noise;
    let filter = MultipleModel::new(prior, JumpMarkov::new(modes, chain)?, built_in()?.1, settings)?;
    let data = table(W1_DATA);
    let mut errors = Vec::new();
    let mut seed = 1000;
    let times = repeat(options.budget, 5, || {
        let mut belief = filter.start(Time::ZERO, Stream::new(seed))?;
        seed += 1;
        let mut error = 0.0;
        let start = ThreadTime::now();
        for (k, row) in data.iter().enumerate() {
            filter.step(&mut belief, Time::from_nanos(k as i64 * 1_000_000_000), Some(&[row[4], row[5]]))?;
            let x = belief.estimate();
            error += (x[0] - row[0]).powi(2) + (x[1] - row[1]).powi(2);
        }
        let time = start.elapsed();
        errors.push((error / STEPS as f64).sqrt());
        Ok(time)
    })?;
    let (rmse, standard_error) = mean_and_error(&errors);
    Ok(Row {
        rmse: Some(rmse),
        rmse_standard_error: Some(standard_error),
        ..row(workload, source, options, PARTICLES, &times, (PARTICLES * STEPS) as f64)
    })
}

/// Mean, and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
    (mean, (spread / values.len() as f64).sqrt())
}

fn radar_prior() -> Result<Gaussian<4>> {
    Gaussian::independent([0.0, 0.0, 0.5, 0.3], [0.5, 0.5, 0.3, 0.3])
}

fn growth(workload: &'static str, n: usize, source: NoiseSource, options: &Options) -> Result<Row> {
    let data = table(W2_DATA);
    let measured = data.iter().map(|row| [row[1]]).collect();
    let prior = Gaussian::independent([0.0], [10f64.sqrt()])?;
    let (motion, sensor) = (motion::Growth::new(10.0)?, measurement::Growth::new(1.0)?);
    let filter = ParticleFilter::new(prior, motion, sensor, settings(n, source, options))?;
    let truth = data.iter().map(|row| [row[0]]).collect();
    let reference = table(W2_REFERENCE).iter().map(|row| [row[0]]).collect();
    sequence(workload, &filter, &Known { measured, truth, reference }, options)
}

fn settings(particles: usize, noise: NoiseSource, options: &Options) -> Settings {
    Settings { particles, noise, simd: options.simd, ..Settings::default() }
}

/// A recording of which everything is known, step by step.
struct Known<const D: usize, const Z: usize> {
    measured: Vec<[f64; Z]>,
    truth: Vec<[f64; D]>,
    /// Posterior mean.
    reference: Vec<[f64; D]>,
}

/// Runs a filter over one recording again and again, with a new seed each time.
fn sequence<const N: usize, const W: usize, const D: usize, const Z: usize, M, H, Q>(
    workload: &'static str,
    filter: &ParticleFilter<N, W, M, H, Gaussian<N>, Q>,
    known: &Known<D, Z>,
    options: &Options,
) -> Result<Row>
where
    M: Motion<N, W>,
    H: Likelihood<N, Value = [f64; Z]>,
    Q: Proposal<N, W, M, H>,
{
    let Settings { particles: n, noise: source, .. } = *filter.settings();
    let (mut errors, mut distances) = (Vec::new(), Vec::new());
    let mut seed = 1000;
    let times = repeat(options.budget, 5, || {
        let mut cloud = filter.start(Time::ZERO, Stream::new(seed))?;
        seed += 1;
        let (mut error, mut distance) = (0.0, 0.0);
        let start = ThreadTime::now();
        for (k, z) in known.measured.iter().enumerate() {
            filter.step(&mut cloud, Time::from_nanos(k as i64 * 1_000_000_000), Some(z))?;
            let mean = cloud.mean();
            for d in 0..D {
                error += (mean[d] - known.truth[k][d]).powi(2);
                distance += (mean[d] - known.reference[k][d]).powi(2);
            }
        }
        let time = start.elapsed();
        errors.push((error / STEPS as f64).sqrt());
        distances.push((distance / STEPS as f64).sqrt());
        Ok(time)
    })?;
    let (rmse, standard_error) = mean_and_error(&errors);
    Ok(Row {
        rmse: Some(rmse),
        rmse_standard_error: Some(standard_error),
        reference_distance: Some(mean_and_error(&distances).0),
        ..row(workload, source, options, n, &times, (n * STEPS) as f64)
    })
}

fn resampling(workload: &'static str, scheme: Resampling, n: usize, options: &Options) -> Result<Row> {
    let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
    let weights: Vec<f64> = (0..n).map(|_| (-2.0 * draws.normal().powi(2)).exp()).collect();
    let mut ancestors = vec![0; n];
    let mut resampler = Resampler::new(scheme).with(options.simd, Threads::Serial);
    let mut step = 0;
    let times = repeat(options.budget / 4, 20, || {
        let start = ThreadTime::now();
        resampler.ancestors(&weights, Stream::new(1), step, &mut ancestors)?;
        step += 1;
        Ok(start.elapsed())
    })?;
    Ok(row(workload, NoiseSource::default(), options, n, &times, n as f64))
}

fn many_runs(workload: &'static str, threads: usize, options: &Options) -> Result<Row> {
    const RUNS: usize = 100;
    const PARTICLES: usize = 5_000;
    let (motion, sensor) = built_in()?;
    let times: Vec<Time> = (0..STEPS as i64).map(|k| Time::from_nanos(k * 1_000_000_000)).collect();
    let mut runs = Vec::with_capacity(RUNS);
    for run in 0..RUNS as u64 {
        let stream = Stream::new(4).fork(run);
        let mut draws = stream.draws(Purpose::Prior, 0, 0);
        let start = [
            0.5 * draws.normal(),
            0.5 * draws.normal(),
            0.5 + 0.3 * draws.normal(),
            0.3 + 0.3 * draws.normal(),
        ];
        let truth = simulate::path(&motion, start, &times, stream)?;
        let measured = simulate::measurements(&sensor, &truth, &times, stream)?;
        runs.push((truth, measured));
    }
    let source = NoiseSource::default();
    let filter = ParticleFilter::new(radar_prior()?, motion, sensor, settings(PARTICLES, source, options))?;
    let one = |run: usize| -> Result<f64> {
        let (truth, measured) = &runs[run];
        let mut cloud = filter.start(Time::ZERO, Stream::new(900).fork(run as u64))?;
        let mut error = 0.0;
        for ((at, x), z) in times.iter().zip(truth).zip(measured) {
            filter.step(&mut cloud, *at, Some(z))?;
            let mean = cloud.mean();
            error += (mean[0] - x[0]).powi(2) + (mean[1] - x[1]).powi(2);
        }
        Ok((error / STEPS as f64).sqrt())
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| zerre::Error::Unsupported(format!("no threads: {error}")))?;
    let (mut errors, mut walls) = (Vec::new(), Vec::new());
    let times = repeat(options.budget, 3, || {
        let (cpu, wall) = (ProcessTime::now(), Instant::now());
        errors = pool.install(|| (0..RUNS).into_par_iter().map(one).collect::<Result<Vec<f64>>>())?;
        walls.push(wall.elapsed().as_secs_f64());
        Ok(cpu.elapsed())
    })?;
    walls.remove(0);
    let rmse = errors.iter().sum::<f64>() / RUNS as f64;
    let particle_steps = (RUNS * PARTICLES * STEPS) as f64;
    let base = row(workload, source, options, PARTICLES, &times, particle_steps);
    Ok(Row {
        threads,
        rmse: Some(rmse),
        cpu_seconds: Some(base.ns_per_particle_step * particle_steps * 1e-9),
        wall_seconds: Some(median(&mut walls)),
        ..base
    })
}

/// Repeats `once` within the budget, `least` times at least, and leaves the first time out.
fn repeat(budget: Duration, least: usize, mut once: impl FnMut() -> Result<Duration>) -> Result<Vec<f64>> {
    once()?;
    let start = Instant::now();
    let mut times = Vec::new();
    while times.len() < least || (start.elapsed() < budget && times.len() < 200) {
        times.push(once()?.as_secs_f64());
    }
    Ok(times)
}

fn row(
    workload: &'static str,
    source: NoiseSource,
    options: &Options,
    n: usize,
    times: &[f64],
    units: f64,
) -> Row {
    let mut ns: Vec<f64> = times.iter().map(|t| t * 1e9 / units).collect();
    let median = median(&mut ns);
    Row {
        workload,
        generator: match source.generator {
            Generator::Philox => "philox",
            Generator::Xoshiro => "xoshiro",
        },
        noise_bits: match source.resolution {
            Resolution::Bits32 => 32,
            Resolution::Bits64 => 64,
        },
        precision: "f64",
        simd: options.simd.name(),
        particles: n,
        threads: 1,
        repetitions: ns.len(),
        ns_per_particle_step: median,
        ns_range: (ns[0], ns[ns.len() - 1]),
        rmse: None,
        rmse_standard_error: None,
        reference_distance: None,
        cpu_seconds: None,
        wall_seconds: None,
        deadline: None,
        peak_mb: peak_mb(),
    }
}

/// Sorts, and returns the middle.
fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}

/// Peak resident memory of the process, on systems with `/proc`.
fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}

fn table(text: &str) -> Vec<Vec<f64>> {
    text.lines().map(|line| line.split(',').filter_map(|cell| cell.parse().ok()).collect()).collect()
}

/// A peer's figure, measured with the scripts named in `benches/README.md`.
#[derive(Clone, Debug, Serialize)]
pub struct Peer {
    /// Name and version.
    pub peer: &'static str,
    /// Workload.
    pub workload: &'static str,
    /// Number of particles.
    pub particles: usize,
    /// Median processor time per particle and step.
    pub ns_per_particle_step: f64,
}

/// The recorded peers: on the machine and at the time that the record's head names.
pub fn peers() -> Vec<Peer> {
    include_str!("../../zerre/benches/record/peers.csv")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .filter_map(|line| {
            let mut cells = line.split(',');
            let (peer, workload) = (cells.next()?, cells.next()?);
            let particles = cells.next()?.parse().ok()?;
            Some(Peer { peer, workload, particles, ns_per_particle_step: cells.next()?.parse().ok()? })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_workload_runs_and_is_right() {
        let options = Options { simd: Simd::best(), threads: 1, budget: Duration::ZERO, deadline_steps: 50 };
        let source = NoiseSource::default();
        let blind = radar("W1", built_in().unwrap(), Bootstrap, 1000, source, &options).unwrap();
        let by_hand =
            radar("W1-user-model", (UserMotion::new(), UserSensor), Bootstrap, 1000, source, &options)
                .unwrap();
        // The same mathematics on the same random numbers: only rounding differs, until it decides a resampling.
        for row in [&blind, &by_hand] {
            // Peers at this N: rmse 0.31 +- 0.01 (sd over seeds 0.007), distance 0.055..0.078.
            assert!((row.rmse.unwrap() - 0.312).abs() < 0.02, "{row:?}");
            assert!(row.reference_distance.unwrap() < 0.1, "{row:?}");
        }
        // As near to the posterior with the same number of particles, or nearer, but for a tenth of it.
        let tangent = Guided::<_, 2>::new(Tangent);
        let guided = radar("W1-ekf-guided", built_in().unwrap(), tangent, 1000, source, &options).unwrap();
        assert!(guided.reference_distance.unwrap() < 1.1 * blind.reference_distance.unwrap(), "{guided:?}");
        let blind = positions("W1-position", Bootstrap, 1000, &options).unwrap();
        let optimal = positions("W1-optimal", Guided::<_, 2>::new(Linear), 1000, &options).unwrap();
        assert!(optimal.reference_distance.unwrap() < blind.reference_distance.unwrap(), "{optimal:?}");
        assert!(peers().len() > 5);
        // How many particles there is time for depends on the machine. With any number the filter errs by less
        // than the measurement alone, 0.01 rad at up to 29 and 0.1 along.
        let names = ["deadline".to_owned()];
        let rows = run(&options, &names, |_| true).unwrap();
        assert_eq!((rows.len(), rows[0].repetitions), (1, 50));
        assert!(rows[0].rmse.unwrap() < 0.31, "{rows:?}");
        let kept = rows[0].deadline.as_ref().unwrap();
        assert!((0.0..=1.0).contains(&kept.share) && kept.particles.is_sorted() && kept.particles[0] >= 100);
    }
}
