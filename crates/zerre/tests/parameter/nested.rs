//! SMC^2.

use crate::{Data, LocalLevel, kalman, nile, quadrature, variances};
use std::sync::atomic::{AtomicUsize, Ordering};
use zerre::belief::{Fork, Gaussian};
use zerre::filter::{Filter, ParticleFilter, Settings};
use zerre::kernels::Threads;
use zerre::math::Matrix;
use zerre::model::{measurement::Position, motion::RandomWalk};
use zerre::parameter::{Law, NestedSettings, Parameters, SmcSquared};
use zerre::rng::Stream;
use zerre::{Error, Result, Time};

type Particles = ParticleFilter<1, 1, RandomWalk<1>, Position<1>>;

fn exact(theta: &[f64; 2], _: usize) -> Result<LocalLevel> {
    kalman(theta, 4e4)
}

fn particles(theta: &[f64; 2], particles: usize) -> Result<Particles> {
    let prior = Gaussian::new([1000.0], Matrix([[4e4]]))?;
    let settings = Settings { particles, ..Settings::default() };
    ParticleFilter::new(prior, RandomWalk::new(theta[1])?, Position::new(theta[0].sqrt())?, settings)
}

/// Log-evidence, means and mean squares of the logarithms, and the accepted shares of a run.
fn run<F>(
    data: &Data,
    settings: &NestedSettings,
    seed: u64,
    model: impl Fn(&[f64; 2], usize) -> Result<F> + Sync,
) -> ([f64; 5], Vec<f64>, usize)
where
    F: Filter<Measurement = [f64; 1]> + Send,
    F::Belief: Fork + Send,
{
    let start = Time::from_secs(1.0);
    let mut nested =
        SmcSquared::new(&variances(), settings.clone(), start, Stream::new(seed), model).unwrap();
    let (mut accepted, mut sum, mut size) = (Vec::new(), 0.0, 0);
    for &(to, z) in data {
        let update = nested.step(to, z).unwrap();
        accepted.extend(update.accepted);
        sum += update.log_evidence;
        size = update.particles;
    }
    assert_eq!(sum, nested.log_evidence());
    let mean = |k: usize, power: i32| nested.mean(|theta| theta[k].ln().powi(power));
    let weights: f64 = nested.values().map(|(weight, ..)| weight).sum();
    assert!((weights - 1.0).abs() < 1e-12);
    ([nested.log_evidence(), mean(0, 1), mean(1, 1), mean(0, 2), mean(1, 2)], accepted, size)
}

/// Evidence, relative to the truth, and moments over independent runs: their means within five standard
/// errors of the truth, which come from the spread of the runs (nine degrees of freedom: beyond 5 lies 7e-4
/// of Student's law, and there are five comparisons). What evidence and moments of n values lack is of the
/// order of their variance over n, far below.
fn agrees(data: &Data, runs: &[[f64; 5]], most: f64) {
    let truth = quadrature(data, &variances());
    let n = runs.len() as f64;
    let second = |k: usize| truth.mean[k].powi(2) + truth.sd[k].powi(2);
    let expected = [1.0, truth.mean[0], truth.mean[1], second(0), second(1)];
    for (i, expected) in expected.into_iter().enumerate() {
        let value = |run: &[f64; 5]| if i == 0 { (run[0] - truth.log_evidence).exp() } else { run[i] };
        let mean = runs.iter().map(value).sum::<f64>() / n;
        let square = runs.iter().map(|run| (value(run) - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let error = (square / n).sqrt();
        assert!((mean - expected).abs() < 5.0 * error, "{i}: {mean} +- {error}, exact {expected}");
        // In posterior standard deviations; of a square as of twice the mean times the number.
        let unit = [1.0, truth.sd[0], truth.sd[1], 20.0 * truth.sd[0], 14.0 * truth.sd[1]][i];
        assert!(error / unit < most, "{i}: {error} in units of {unit}");
    }
}

/// Iterated batch importance sampling: Kalman filters inside.
#[test]
fn exact_filters_inside_give_evidence_and_posterior() {
    let Some(data) = nile() else { return };
    let settings = NestedSettings { values: 400, most_particles: 100, ..NestedSettings::default() };
    let runs: Vec<_> = (0..10).map(|seed| run(&data, &settings, seed, exact)).collect();
    assert!(runs.iter().all(|(_, accepted, _)| {
        (2..20).contains(&accepted.len()) && accepted.iter().all(|share| (0.15..0.6).contains(share))
    }));
    agrees(&data, &runs.iter().map(|run| run.0).collect::<Vec<_>>(), 0.05);
}

/// Few particles at first: their evidence scatters so much that moves are rarely accepted, and there are more
/// of them in the end.
#[test]
fn particles_inside_give_evidence_and_posterior() {
    let Some(data) = nile() else { return };
    let settings = NestedSettings { values: 150, particles: 20, ..NestedSettings::default() };
    let runs: Vec<_> = (0..10).map(|seed| run(&data, &settings, seed, particles)).collect();
    assert!(runs.iter().all(|(.., size)| (40..=640).contains(size)), "{runs:?}");
    agrees(&data, &runs.iter().map(|run| run.0).collect::<Vec<_>>(), 0.2);
}

#[test]
fn threads_do_not_count() {
    let data: Data =
        (1..20).map(|k| (Time::from_secs(f64::from(k)), Some([1000.0 + f64::from(k % 7) * 90.0]))).collect();
    let settings = NestedSettings { values: 40, particles: 10, trigger: 0.9, ..NestedSettings::default() };
    let threads = Threads::new(2).unwrap();
    let both = NestedSettings { threads, ..settings.clone() };
    let (serial, shared) = (run(&data, &settings, 3, particles), run(&data, &both, 3, particles));
    assert_eq!(serial, shared);
    assert!(!serial.1.is_empty());
    assert_ne!(serial, run(&data, &settings, 4, particles));
}

/// Before any measurement: the prior. What is impossible under all values does not count.
#[test]
fn borders() {
    let parameters = Parameters::new([("x", Law::Uniform { low: -1.0, high: 1.0 })]).unwrap();
    let calls = AtomicUsize::new(0);
    let model = |&[x]: &[f64; 1], _: usize| {
        calls.fetch_add(1, Ordering::Relaxed);
        let prior = Gaussian::new([x], Matrix([[1e-6]]))?;
        let settings = Settings { particles: 10, ..Settings::default() };
        ParticleFilter::new(prior, RandomWalk::<1>::new(1e-6)?, Position::<1>::new(0.3)?, settings)
    };
    let new = |settings| {
        SmcSquared::<1, _, [f64; 1], _>::new(&parameters, settings, Time::ZERO, Stream::new(1), model)
    };
    let settings = NestedSettings { values: 300, ..NestedSettings::default() };
    let mut nested = new(settings.clone()).unwrap();
    assert_eq!((calls.load(Ordering::Relaxed), nested.log_evidence()), (300, 0.0));
    // The mean of 300 numbers of variance 1/3.
    assert!(nested.mean(|x| x[0]).abs() < 5.0 * (1.0f64 / 900.0).sqrt() && nested.ess() > 299.999);
    let at = Time::from_secs;
    let update = nested.step(at(1.0), None).unwrap();
    assert_eq!((update.log_evidence, update.accepted), (0.0, None));
    let before = nested.mean(|x| x[0]);
    let impossible = nested.step(at(2.0), Some([1e200])).unwrap();
    assert_eq!((impossible.log_evidence, nested.mean(|x| x[0])), (f64::NEG_INFINITY, before));
    // Refused by all alike: as if it had not been.
    assert!(matches!(nested.step(at(1.5), None), Err(Error::OutOfOrder { .. })));
    assert!(nested.step(at(3.0), Some([f64::NAN])).is_err());
    let mut ess = nested.ess();
    for k in 3..40 {
        let update = nested.step(at(f64::from(k)), Some([0.5])).unwrap();
        assert!(update.log_evidence.is_finite());
        ess = ess.min(update.ess);
    }
    // 37 measurements of variance 0.09: the posterior has a standard deviation of 0.05 about 0.5.
    assert!(ess < 150.0 && (nested.mean(|x| x[0]) - 0.5).abs() < 0.03, "{ess} {}", nested.mean(|x| x[0]));
    for bad in [
        NestedSettings { values: 0, ..settings.clone() },
        NestedSettings { particles: 0, ..settings.clone() },
        NestedSettings { trigger: f64::NAN, ..settings.clone() },
    ] {
        assert!(new(bad).is_err());
    }
}
