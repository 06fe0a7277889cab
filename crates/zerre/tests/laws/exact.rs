//! Law 1: on a linear Gaussian world mean, covariance and evidence are those of the Kalman filter.
//!
//! A filter that is consistent in the number of particles is run with many seeds. What it estimates, averaged
//! over them, lies within Z standard errors (of the average, from the spread over the seeds) of the exact
//! value, with two qualifications. Means and covariances are ratios of sums, whose bias is of the order of 1
//! / ESS posterior standard deviations (delta method: for the mean it is -Cov(w, w (x - mu)) / N in
//! normalised weights, of the order of E[w^2] / N = 1 / ESS); `BIAS` / ESS is allowed for it, where the ESS
//! is the smallest of the run. The exponential of the log-evidence is unbiased: nothing is allowed there. An
//! approximate filter states its own bias, over n, for all three.
//!
//! The average of 100 runs has 99 degrees of freedom: beyond Z = 6.2 lies 1.3e-8 of Student's law. There are some
//! 90 filters with 10 steps of 15 numbers: 13 500 comparisons, so that a right implementation fails with
//! probability 1.8e-4.

use crate::list::{Class, Estimates, Means, Run, UnderLaw, filters};
use crate::worlds::{self, Seen};
use crate::{Verdict, uphold};
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Filter, Kalman, Kernel, ParticleFilter, Rejuvenation, Settings, Update};
use zerre::math::{Cholesky, Matrix};
use zerre::model::Measurement;
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::resample::Trigger;
use zerre::rng::{Purpose, Stream};
use zerre::{Result, Time};

const Z: f64 = 6.2;
const BIAS: f64 = 4.0;
const RUNS: u64 = 100;
const PARTICLES: usize = 2000;

/// What a filter says after one step; `log_evidence` is of all measurements so far.
struct Report {
    mean: [f64; 4],
    covariance: Matrix<4, 4>,
    log_evidence: f64,
    ess: f64,
}

fn run(filter: &dyn UnderLaw, script: &[Seen], stream: Stream) -> Vec<Report> {
    let mut run = filter.begin(stream);
    let (mut log_evidence, mut least) = (0.0, f64::INFINITY);
    let report = |(to, z): &Seen| {
        let update = run.step(*to, z.as_ref()).unwrap();
        log_evidence += update.log_evidence;
        let ess = update.particles.map_or(f64::INFINITY, |p| p.ess);
        least = ess.min(least);
        Report { mean: run.mean(), covariance: run.covariance(), log_evidence, ess: least }
    };
    script.iter().map(report).collect()
}

/// Errors against the exact report, in units of its standard deviations: 4 means, 10 covariances, evidence.
fn errors(found: &Report, exact: &Report) -> [f64; 15] {
    let sd = exact.covariance.diagonal().map(f64::sqrt);
    let mut e = [0.0; 15];
    let mut at = 4;
    for i in 0..4 {
        e[i] = (found.mean[i] - exact.mean[i]) / sd[i];
        for j in 0..=i {
            e[at] = (found.covariance.0[i][j] - exact.covariance.0[i][j]) / (sd[i] * sd[j]);
            at += 1;
        }
    }
    e[14] = (found.log_evidence - exact.log_evidence).exp_m1();
    e
}

/// The law.
fn exact(filter: &dyn UnderLaw, class: Class, exact: &[Report], script: &[Seen]) -> Verdict {
    if class == Class::Exact {
        // Rounding of some ten steps of a dozen operations each, and of sigma points: far below 1e-9.
        for (k, (found, exact)) in run(filter, script, Stream::new(0)).iter().zip(exact).enumerate() {
            let worst = errors(found, exact).into_iter().fold(0.0, |a, e| f64::max(a, e.abs()));
            if worst.is_nan() || worst > 1e-9 {
                return Err(format!("step {k}: off by {worst:e} standard deviations"));
            }
        }
        return Ok(());
    }
    let runs: Vec<_> = (0..RUNS).map(|r| run(filter, script, Stream::new(41).fork(r))).collect();
    let n = RUNS as f64;
    for (k, exact) in exact.iter().enumerate() {
        let errors: Vec<_> = runs.iter().map(|run| errors(&run[k], exact)).collect();
        let ess = runs.iter().map(|run| run[k].ess).sum::<f64>() / n;
        for i in 0..15 {
            let mean = errors.iter().map(|e| e[i]).sum::<f64>() / n;
            let variance = errors.iter().map(|e| (e[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
            let bias = match class {
                Class::Approximate { bias } => bias / ess,
                _ if i < 14 => BIAS / ess,
                _ => 0.0,
            };
            let allowed = Z * (variance / n).sqrt() + bias + 1e-12;
            if mean.is_nan() || mean.abs() > allowed {
                let what = match i {
                    0..4 => "mean",
                    4..14 => "covariance",
                    _ => "evidence",
                };
                return Err(format!(
                    "{what} {i} of step {k} is off by {mean:.4}, allowed {allowed:.4} (ESS {ess:.0})"
                ));
            }
        }
    }
    Ok(())
}

fn world() -> (crate::list::World<Position<2>>, Vec<Seen>, Vec<Report>) {
    let world = worlds::linear(2.0);
    let (script, _) = worlds::script(&world, Stream::new(5));
    let kalman = Kalman::new(world.motion, world.sensor, world.prior).unwrap();
    let reference = run(&kalman, &script, Stream::new(0));
    (world, script, reference)
}

#[test]
fn every_filter_agrees_with_kalman() {
    let (world, script, reference) = world();
    let list = filters(&world, &Means::serial(PARTICLES));
    let bound = list.iter().filter(|entry| entry.class.is_bound_here());
    uphold(bound.map(|e| (e.name.clone(), exact(&*e.filter, e.class, &reference, &script))));
}

type Sir = ParticleFilter<4, 4, ConstantVelocity<2>, Position<2>>;

/// Resampling below a threshold, resamplings of some steps and not of others: where the usual mistakes show.
fn adaptive() -> Sir {
    let world = worlds::linear(2.0);
    let trigger = Trigger::Below(0.7);
    let settings = Settings { particles: PARTICLES, trigger, ..Settings::default() };
    ParticleFilter::new(world.prior, world.motion, world.sensor, settings).unwrap()
}

#[test]
fn the_adaptive_run_resamples_now_and_then() {
    let (_, script, _) = world();
    let filter = adaptive();
    let mut cloud = filter.start(Time::ZERO, Stream::new(41)).unwrap();
    let resampled: Vec<bool> = script
        .iter()
        .filter(|(_, z)| z.is_some())
        .map(|(to, z)| filter.step(&mut cloud, *to, z.as_ref()).unwrap().particles.unwrap().resampled)
        .collect();
    let times = resampled.iter().filter(|&&r| r).count();
    assert!(times >= 2 && times + 2 <= resampled.len(), "{resampled:?}");
}

/// A particle filter with one of the mistakes that were found in the field.
struct Mistaken {
    filter: Sir,
    mistake: Mistake,
}

#[derive(Clone, Copy, PartialEq)]
enum Mistake {
    None,
    /// Evidence as the plain mean of the likelihoods, although the step before did not resample.
    ForgottenWeights,
    /// Means as if resampling had made the weights equal, although it had not.
    EqualWeights,
    /// Measurements of a time that the belief already has are passed over.
    SecondMeasurementLost,
    /// The belief stands still where there is no measurement.
    NoPrediction,
}

struct MistakenRun<'f> {
    of: &'f Mistaken,
    cloud: Cloud<4>,
}

impl UnderLaw for Mistaken {
    fn begin(&self, stream: Stream) -> Box<dyn Run + '_> {
        Box::new(MistakenRun { of: self, cloud: self.filter.start(Time::ZERO, stream).unwrap() })
    }
    fn resume(&self, saved: &str) -> Box<dyn Run + '_> {
        Box::new(MistakenRun { of: self, cloud: serde_json::from_str(saved).unwrap() })
    }
}

impl Run for MistakenRun<'_> {
    fn step(&mut self, to: Time, z: Option<&[f64; 2]>) -> Result<Update> {
        let Mistaken { filter, mistake } = self.of;
        let again = to == self.cloud.time() && to > Time::ZERO;
        if *mistake == Mistake::NoPrediction && z.is_none() {
            self.cloud = again_at(&self.cloud, to);
        }
        let z = z.filter(|_| !(*mistake == Mistake::SecondMeasurementLost && again));
        let mut update = filter.step(&mut self.cloud, to, z)?;
        if let (Mistake::ForgottenWeights, Some(z)) = (mistake, z) {
            let sensor = worlds::linear(2.0).sensor;
            let given = Measurement::<4>::given(&sensor, z, to)?;
            let n = self.cloud.len();
            let likelihood = |i| Position::<2>::log_likelihood(&given, self.cloud.particle(i)).exp();
            update.log_evidence = ((0..n).map(likelihood).sum::<f64>() / n as f64).ln();
        }
        Ok(update)
    }
    fn save(&self) -> String {
        serde_json::to_string(&self.cloud).unwrap()
    }
}

/// The same particles, with the clock put forward.
fn again_at(cloud: &Cloud<4>, to: Time) -> Cloud<4> {
    let columns = std::array::from_fn(|k| cloud.column(k).to_vec());
    Cloud::from_columns(to, Stream::new(to.nanos() as u64), columns).unwrap()
}

impl Estimates for MistakenRun<'_> {
    fn mean(&self) -> [f64; 4] {
        if self.of.mistake != Mistake::EqualWeights {
            return self.cloud.mean();
        }
        std::array::from_fn(|k| self.cloud.column(k).iter().sum::<f64>() / self.cloud.len() as f64)
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.cloud.covariance()
    }
}

#[test]
fn the_law_finds_the_usual_mistakes() {
    let (_, script, reference) = world();
    let judge =
        |mistake| exact(&Mistaken { filter: adaptive(), mistake }, Class::Consistent, &reference, &script);
    judge(Mistake::None).unwrap();
    assert!(judge(Mistake::ForgottenWeights).unwrap_err().starts_with("evidence"));
    assert!(judge(Mistake::EqualWeights).unwrap_err().starts_with("mean"));
    assert!(judge(Mistake::SecondMeasurementLost).is_err());
    assert!(judge(Mistake::NoPrediction).is_err());
}

#[test]
fn the_law_finds_a_wrong_gain() {
    let (_, script, reference) = world();
    let other = worlds::linear(2.0 + 1e-6);
    let kalman = Kalman::new(other.motion, other.sensor, other.prior).unwrap();
    assert!(exact(&kalman, Class::Exact, &reference, &script).is_err());
    // The tolerance of an approximate filter finds errors of the sensor of a tenth.
    let list = filters(&worlds::linear(1.8), &Means::serial(PARTICLES));
    for entry in list.iter().filter(|entry| matches!(entry.class, Class::Approximate { .. })) {
        assert!(exact(&*entry.filter, entry.class, &reference, &script).is_err(), "{}", entry.name);
    }
}

/// Roughening is not the posterior, and this is how: after resampling the particles are jittered by
/// 0.2 E n^(-1/4) per component, E the spread from the smallest to the largest (section 3.2 of the source). The plain
/// filter with the same seed shows the survivors without it. A sample variance of n normal numbers has a standard
/// error of sqrt(2 / n), a mean one of sqrt(1 / n); five of them are allowed.
#[test]
fn roughening_widens_by_what_its_source_says() {
    let world = worlds::linear(2.0);
    let n = 4000;
    let survivors = |rejuvenation| {
        let trigger = Trigger::Always;
        let settings = Settings { particles: n, trigger, rejuvenation, ..Settings::default() };
        let filter = ParticleFilter::new(world.prior, world.motion, world.sensor, settings).unwrap();
        let mut cloud = filter.start(Time::ZERO, Stream::new(3)).unwrap();
        filter.step(&mut cloud, Time::ZERO, Some(&[0.5, 0.5])).unwrap();
        filter.step(&mut cloud, Time::ZERO, None).unwrap();
        cloud
    };
    let (plain, rough) = (survivors(Rejuvenation::Nothing), survivors(Rejuvenation::Roughen(0.2)));
    for k in 0..4 {
        let column = plain.column(k);
        let spread = column.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            - column.iter().copied().fold(f64::INFINITY, f64::min);
        let sd = 0.2 * spread * (n as f64).powf(-0.25);
        let jitter: Vec<f64> = rough.column(k).iter().zip(column).map(|(a, b)| (a - b) / sd).collect();
        let mean = jitter.iter().sum::<f64>() / n as f64;
        let variance = jitter.iter().map(|j| j * j).sum::<f64>() / n as f64;
        assert!(mean.abs() < 5.0 / (n as f64).sqrt(), "component {k}: mean {mean}");
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / n as f64).sqrt(), "component {k}: variance {variance}");
    }
    // Law 1 would find it, which is why it declares itself a reproduction.
    let (world, script, reference) = self::world();
    let list = filters(&world, &Means::serial(PARTICLES));
    let entry = list.iter().find(|e| e.class == Class::Reproduction).unwrap();
    assert!(exact(&*entry.filter, Class::Consistent, &reference, &script).is_err());
}

/// Regularisation without shrinking is not the posterior either: survivors are jittered by h D e, D D' the
/// covariance of the weighted cloud and h = A n^(-1/8) for four components, A of the source. In units of h D
/// the jitter has mean 0 and the covariance of the kernel, I or I / 8; five standard errors are allowed (as
/// above; of the covariance of two components of e, 1 / sqrt(n) at most).
#[test]
fn regularisation_widens_by_what_its_source_says() {
    let world = worlds::linear(2.0);
    let n = 4000;
    let survivors = |rejuvenation| {
        let trigger = Trigger::Always;
        let settings = Settings { particles: n, trigger, rejuvenation, ..Settings::default() };
        let filter = ParticleFilter::new(world.prior, world.motion, world.sensor, settings).unwrap();
        let mut cloud = filter.start(Time::ZERO, Stream::new(3)).unwrap();
        filter.step(&mut cloud, Time::ZERO, Some(&[0.5, 0.5])).unwrap();
        let covariance = cloud.covariance();
        filter.step(&mut cloud, Time::ZERO, None).unwrap();
        (cloud, covariance)
    };
    let (plain, covariance) = survivors(Rejuvenation::Nothing);
    let root = Cholesky::of("P", &covariance).unwrap();
    // (4 / 6)^(1/8), and (8 / c 8 (2 sqrt pi)^4)^(1/8) with c = pi^2 / 2, the volume of the unit ball.
    let ball = 0.5 * std::f64::consts::PI.powi(2);
    let epanechnikov = (64.0 / ball * 16.0 * std::f64::consts::PI.powi(2)).powf(0.125);
    for (kernel, a, variance) in
        [(Kernel::Gaussian, (4.0 / 6.0f64).powf(0.125), 1.0f64), (Kernel::Epanechnikov, epanechnikov, 0.125)]
    {
        let (rough, _) = survivors(Rejuvenation::Regularise { kernel, shrink: false });
        let h = a * (n as f64).powf(-0.125);
        let (mut mean, mut square) = ([0.0; 4], Matrix::<4, 4>::ZERO);
        for i in 0..n {
            let (x, y) = (plain.particle(i), rough.particle(i));
            let e = root.whiten(&std::array::from_fn(|k| (y[k] - x[k]) / h)).map(|e| e / variance.sqrt());
            mean = std::array::from_fn(|k| mean[k] + e[k] / n as f64);
            square = square + Matrix::outer(&e, &e) * (1.0 / n as f64);
        }
        assert!(mean.iter().all(|m| m.abs() < 5.0 / (n as f64).sqrt()), "{kernel:?}: {mean:?}");
        let worst = (square - Matrix::identity()).max_abs();
        assert!(worst < 5.0 * (2.0 / n as f64).sqrt(), "{kernel:?}: {square:?}");
    }
    // Law 1 would find it.
    let (world, script, reference) = self::world();
    let list = filters(&world, &Means::serial(PARTICLES));
    let entry = list.iter().find(|e| e.name.starts_with("regularised without shrinking")).unwrap();
    assert_eq!(entry.class, Class::Reproduction);
    assert!(exact(&*entry.filter, Class::Consistent, &reference, &script).is_err());
}

/// A prior is drawn as its law says: the mean of n particles has the covariance P / n.
#[test]
fn first_particles_have_the_law_of_the_prior() {
    let p =
        Matrix([[4.0, 1.2, 0.0, 0.5], [1.2, 1.0, 0.3, 0.0], [0.0, 0.3, 2.0, -0.4], [0.5, 0.0, -0.4, 0.3]]);
    let prior = Gaussian::new([1.0, -2.0, 0.0, 30.0], p).unwrap();
    let world = worlds::linear(1.0);
    let n = 100_000;
    let settings = Settings { particles: n, ..Settings::default() };
    let filter = ParticleFilter::new(prior, world.motion, world.sensor, settings).unwrap();
    let cloud = filter.start(Time::ZERO, Stream::new(8)).unwrap();
    let (mean, covariance) = (cloud.mean(), cloud.covariance());
    for i in 0..4 {
        let sd = (p.0[i][i] / n as f64).sqrt();
        assert!((mean[i] - prior.mean()[i]).abs() < 5.0 * sd, "{mean:?}");
        for j in 0..4 {
            // Var of a sample covariance: (p_ii p_jj + p_ij^2) / n.
            let se = ((p.0[i][i] * p.0[j][j] + p.0[i][j].powi(2)) / n as f64).sqrt();
            assert!((covariance.0[i][j] - p.0[i][j]).abs() < 5.0 * se, "{i} {j}: {covariance:?}");
        }
    }
    // Not the same numbers as those of the simulation's other purposes.
    let mut other = Stream::new(8).draws(Purpose::Motion, 0, 0);
    assert!((cloud.column(0)[0] - 1.0 - 2.0 * other.normal()).abs() > 1e-9);
}
