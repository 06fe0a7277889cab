//! The multiple-model particle filter: exact where it can be computed by going through all sequences of modes, the
//! ordinary particle filter where there is one mode, and the thesis's outputs by hand.

use std::sync::Arc;
use zerre::belief::Gaussian;
use zerre::filter::{
    AfterResampling, Choice, Filter, Kalman, ModalBelief, ModalSettings, MultipleModel, ObservationError,
    Outcome, Output, ParticleFilter, ParticleUpdate, Rule, ScaledResidual, Selector, Settings, Update, Wsms,
};
use zerre::kernels::{Generator, NoiseSource, Resolution, Simd, Threads};
use zerre::model::measurement::{Position, RangeBearing};
use zerre::model::motion::{ConstantVelocity, RandomWalk};
use zerre::model::{Chain, JumpMarkov, Measurement};
use zerre::resample::{Resampling, Trigger};
use zerre::rng::Stream;
use zerre::{Error, Time};

const RESAMPLINGS: [Resampling; 4] =
    [Resampling::Multinomial, Resampling::Residual, Resampling::Stratified, Resampling::Systematic];

fn secs(t: f64) -> Time {
    Time::from_secs(t)
}

/// Time and measurement of each step of the linear world: predictions alone and two measurements at one time among
/// them.
const SCRIPT: [(f64, Option<f64>); 6] =
    [(1.0, Some(0.9)), (2.0, Some(3.5)), (3.0, None), (4.0, Some(8.0)), (4.0, Some(9.5)), (5.0, Some(9.0))];

const SENSOR_SD: f64 = 1.0;

fn prior() -> Gaussian<2> {
    Gaussian::independent([0.0, 1.0], [1.0, 1.0]).unwrap()
}

/// Nearly straight, and wild.
fn motions() -> [ConstantVelocity<1>; 2] {
    [0.05, 8.0].map(|density| ConstantVelocity::new(density).unwrap())
}

fn chain() -> Chain {
    let rows = vec![vec![0.95, 0.05], vec![0.15, 0.85]];
    Chain::per_step(rows).unwrap().with_initial(&[0.7, 0.3]).unwrap()
}

type Linear<E> = MultipleModel<2, 2, ConstantVelocity<1>, Position<1>, E>;

fn linear(chain: Chain, settings: ModalSettings) -> Linear<std::convert::Infallible> {
    let model = JumpMarkov::new(motions().to_vec(), chain).unwrap();
    MultipleModel::new(prior(), model, Position::new(SENSOR_SD).unwrap(), settings).unwrap()
}

/// Distance along the line.
struct Distance;

impl ObservationError<2, [f64; 1]> for Distance {
    fn error(&self, z: &[f64; 1], _: Time, x: &[f64; 2]) -> f64 {
        (z[0] - x[0]).abs()
    }
}

/// What is known after a step.
#[derive(Clone, Copy, Debug)]
struct Known {
    mean: [f64; 2],
    covariance: [[f64; 2]; 2],
    /// Probability of the second mode.
    wild: f64,
    /// Of all measurements so far.
    log_evidence: f64,
    ess: f64,
}

/// The posterior after each step, by a Kalman filter for each sequence of modes.
fn enumerated() -> Vec<Known> {
    let sensor = Position::<1>::new(SENSOR_SD).unwrap();
    let kalman = motions().map(|m| Kalman::new(m, sensor, prior()).unwrap());
    let chain = chain();
    // Probability, evidence and law of each sequence so far, by its last mode.
    let start = kalman[0].start(Time::ZERO, Stream::new(0)).unwrap();
    let mut all = vec![(0, chain.initial()[0].ln(), start), (1, chain.initial()[1].ln(), start)];
    let mut now = Time::ZERO;
    let mut known = Vec::new();
    for (t, z) in SCRIPT {
        let to = secs(t);
        let jump = chain.over(now, to);
        let mut next = Vec::new();
        for (mode, log_weight, belief) in &all {
            for j in 0..2 {
                let p = jump.probability(*mode, j);
                if p > 0.0 {
                    let mut belief = *belief;
                    let z = z.map(|z| [z]);
                    let update = kalman[j].step(&mut belief, to, z.as_ref()).unwrap();
                    next.push((j, log_weight + p.ln() + update.log_evidence, belief));
                }
            }
        }
        (all, now) = (next, to);
        let evidence: f64 = all.iter().map(|(_, l, _)| l.exp()).sum();
        let weights: Vec<f64> = all.iter().map(|(_, l, _)| l.exp() / evidence).collect();
        let mut mean = [0.0; 2];
        for (w, (_, _, belief)) in weights.iter().zip(&all) {
            (0..2).for_each(|k| mean[k] += w * belief.state.mean()[k]);
        }
        let mut covariance = [[0.0; 2]; 2];
        for (w, (_, _, belief)) in weights.iter().zip(&all) {
            let d = [0, 1].map(|k| belief.state.mean()[k] - mean[k]);
            for r in 0..2 {
                for c in 0..2 {
                    covariance[r][c] += w * (belief.state.covariance().0[r][c] + d[r] * d[c]);
                }
            }
        }
        let wild = weights.iter().zip(&all).filter(|(_, a)| a.0 == 1).map(|(w, _)| w).sum();
        known.push(Known { mean, covariance, wild, log_evidence: evidence.ln(), ess: f64::INFINITY });
    }
    known
}

fn run(filter: &Linear<std::convert::Infallible>, stream: Stream) -> Vec<Known> {
    let mut belief = filter.start(Time::ZERO, stream).unwrap();
    let (mut log_evidence, mut least) = (0.0, f64::INFINITY);
    let report = |(t, z): &(f64, Option<f64>)| {
        let z = z.map(|z| [z]);
        let update = filter.step(&mut belief, secs(*t), z.as_ref()).unwrap();
        log_evidence += update.log_evidence;
        least = update.particles.unwrap().ess.min(least);
        let cloud = belief.cloud();
        let wild = cloud.probabilities().nth(1).unwrap();
        Known { mean: belief.estimate(), covariance: cloud.covariance().0, wild, log_evidence, ess: least }
    };
    SCRIPT.iter().map(report).collect()
}

/// Errors against what is exact, in its standard deviations: means, covariances, probability of the mode, evidence.
fn errors(found: &Known, exact: &Known) -> [f64; 7] {
    let sd = [0, 1].map(|k| exact.covariance[k][k].sqrt());
    let covariance = |r: usize, c: usize| (found.covariance[r][c] - exact.covariance[r][c]) / (sd[r] * sd[c]);
    [
        (found.mean[0] - exact.mean[0]) / sd[0],
        (found.mean[1] - exact.mean[1]) / sd[1],
        covariance(0, 0),
        covariance(1, 0),
        covariance(1, 1),
        found.wild - exact.wild,
        (found.log_evidence - exact.log_evidence).exp_m1(),
    ]
}

/// Averages over 100 seeds lie within 6.2 standard errors of the exact value (beyond lies 1.3e-8 of Student's law with
/// 99 degrees of freedom, and there are 168 comparisons); means and covariances, which are ratios of sums, within 4 /
/// ESS more, as in the laws of the filters. The exponential of the log-evidence is unbiased: nothing is allowed there.
fn agrees(filter: &Linear<std::convert::Infallible>) -> Result<(), String> {
    const RUNS: u64 = 100;
    let runs: Vec<_> = (0..RUNS).map(|r| run(filter, Stream::new(17).fork(r))).collect();
    let n = RUNS as f64;
    for (k, exact) in enumerated().iter().enumerate() {
        let errors: Vec<_> = runs.iter().map(|run| errors(&run[k], exact)).collect();
        let ess = runs.iter().map(|run| run[k].ess).sum::<f64>() / n;
        let what = ["mean", "mean", "covariance", "covariance", "covariance", "mode", "evidence"];
        for (i, what) in what.into_iter().enumerate() {
            let mean = errors.iter().map(|e| e[i]).sum::<f64>() / n;
            let variance = errors.iter().map(|e| (e[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
            let bias = if i < 6 { 4.0 / ess } else { 0.0 };
            let allowed = 6.2 * (variance / n).sqrt() + bias + 1e-12;
            if mean.is_nan() || mean.abs() > allowed {
                return Err(format!("{what} {i} of step {k} is off by {mean:.4}, allowed {allowed:.4}"));
            }
        }
    }
    Ok(())
}

#[test]
fn all_sequences_of_modes_are_weighed() {
    for resampling in RESAMPLINGS {
        let settings = ModalSettings { particles: 2000, resampling, ..ModalSettings::default() };
        agrees(&linear(chain(), settings)).unwrap_or_else(|e| panic!("{resampling:?}: {e}"));
    }
}

/// Weights without the chain are those of a chain that has no memory; another first mode is a smaller mistake. The mean
/// of the survivors is no mistake, but weights that count each measurement twice are one.
#[test]
fn a_forgotten_chain_is_found() {
    let settings = || ModalSettings { particles: 2000, ..ModalSettings::default() };
    let forgotten = Chain::staying(2, 0.5).unwrap().with_initial(chain().initial()).unwrap();
    assert!(agrees(&linear(forgotten, settings())).is_err());
    let first = chain().with_initial(&[0.3, 0.7]).unwrap();
    assert!(agrees(&linear(first, settings())).is_err());
    let survivors = || linear(chain(), settings()).with_output(Output::Survivors).unwrap();
    agrees(&survivors()).unwrap();
    for after in [AfterResampling::Recomputed, AfterResampling::RecomputedKept] {
        assert!(agrees(&survivors().with_after_resampling(after)).is_err(), "{after:?}");
    }
}

fn planar() -> (Gaussian<4>, ConstantVelocity<2>, Position<2>) {
    let prior = Gaussian::independent([0.0, 0.0, 1.0, -0.5], [1.0, 1.0, 0.2, 0.2]).unwrap();
    (prior, ConstantVelocity::new(0.02).unwrap(), Position::new(1.0).unwrap())
}

/// The planar script: a measurement without time passing, predictions, one measurement that nothing explains.
const PLANAR: [(f64, Option<[f64; 2]>); 8] = [
    (0.0, Some([0.3, -0.2])),
    (1.0, Some([1.0, 0.0])),
    (1.5, None),
    (2.0, Some([1e200, 0.0])),
    (2.5, Some([2.0, -1.0])),
    (2.5, Some([2.5, -1.0])),
    (4.0, None),
    (4.5, Some([4.0, -2.5])),
];

/// Means, weights, states and evidence of a particle filter that resamples after every measurement, bit by bit.
/// Particle counts are multiples of eight: in the last eight the padding of a segment adds zeros in another order.
#[test]
fn one_mode_is_the_particle_filter() {
    let (prior, motion, sensor) = planar();
    let sources = [(Generator::Philox, Resolution::Bits32), (Generator::Xoshiro, Resolution::Bits64)];
    for particles in [8, 512, 5000] {
        for resampling in RESAMPLINGS {
            for (generator, resolution) in sources {
                let noise = NoiseSource { generator, resolution };
                let trigger = Trigger::Always;
                let settings = Settings { particles, resampling, noise, trigger, ..Settings::default() };
                let plain = ParticleFilter::new(prior, motion, sensor, settings).unwrap();
                let model = JumpMarkov::new(vec![motion], Chain::staying(1, 1.0).unwrap()).unwrap();
                let settings = ModalSettings { particles, resampling, noise, ..ModalSettings::default() };
                let modal = MultipleModel::new(prior, model, sensor, settings).unwrap();
                let mut cloud = plain.start(Time::ZERO, Stream::new(5)).unwrap();
                let mut belief = modal.start(Time::ZERO, Stream::new(5)).unwrap();
                for (t, z) in PLANAR {
                    let expected = plain.step(&mut cloud, secs(t), z.as_ref()).unwrap();
                    let update = modal.step(&mut belief, secs(t), z.as_ref()).unwrap();
                    assert_eq!(update, expected, "{particles} {resampling:?} at {t}");
                    assert_eq!(belief.estimate(), cloud.mean());
                    assert!(belief.cloud().weights().eq(cloud.weights()));
                    assert!(
                        belief.cloud().particles().map(|p| p.2).eq((0..particles).map(|i| cloud.particle(i)))
                    );
                }
            }
        }
    }
}

/// A mode that is certain and never left is alone, whatever other modes there are.
#[test]
fn a_certain_mode_is_alone() {
    let rows = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    let certain = Chain::per_step(rows).unwrap().with_initial(&[1.0, 0.0]).unwrap();
    let settings = || ModalSettings { particles: 1000, ..ModalSettings::default() };
    let two = linear(certain, settings());
    let model = JumpMarkov::new(vec![motions()[0]], Chain::staying(1, 1.0).unwrap()).unwrap();
    let one = MultipleModel::new(prior(), model, Position::new(SENSOR_SD).unwrap(), settings()).unwrap();
    let mut a = two.start(Time::ZERO, Stream::new(3)).unwrap();
    let mut b = one.start(Time::ZERO, Stream::new(3)).unwrap();
    for (t, z) in SCRIPT.into_iter().filter(|(_, z)| z.is_some()) {
        let z = z.map(|z| [z]);
        // But for what it cost: the other mode's particles are weighed before they count for nothing.
        let of = |update: Update| {
            let free = |p| ParticleUpdate { particles: 0, evaluations: 0, ..p };
            (update.log_evidence, update.particles.map(free))
        };
        let found = two.step(&mut a, secs(t), z.as_ref()).unwrap();
        let expected = one.step(&mut b, secs(t), z.as_ref()).unwrap();
        assert_eq!((of(found), a.estimate()), (of(expected), b.estimate()));
        assert_eq!(a.cloud().probabilities().collect::<Vec<_>>(), [1.0, 0.0]);
    }
}

fn account<E: ObservationError<2, [f64; 1]>>(filter: &Linear<E>) -> String {
    let mut belief = filter.start(Time::ZERO, Stream::new(12)).unwrap();
    let mut text = String::new();
    for (t, z) in SCRIPT {
        let z = z.map(|z| [z]);
        let update = filter.step(&mut belief, secs(t), z.as_ref()).unwrap();
        text += &format!("{update:?} {}\n", serde_json::to_string(&belief).unwrap());
    }
    text
}

fn rules() -> Wsms {
    Wsms { threshold: 0.8, threshold_range: (0.2, 0.8), rule: Rule::Dynamic, ..Wsms::default() }
}

#[test]
fn threads_and_levels_change_no_bit() {
    for particles in [1, 100, 2500, 10_000] {
        for resampling in RESAMPLINGS {
            let accounts = |simd, threads: Threads| {
                let settings = || ModalSettings {
                    particles,
                    resampling,
                    simd,
                    threads: threads.clone(),
                    ..ModalSettings::default()
                };
                let thesis = linear(chain(), settings()).with_output(Output::Survivors).unwrap();
                let selecting = linear(chain(), settings()).with_error(Distance);
                let selecting =
                    selecting.with_output(Output::LeastError).unwrap().with_selection(rules()).unwrap();
                [
                    account(&linear(chain(), settings())),
                    account(&thesis.with_after_resampling(AfterResampling::RecomputedKept)),
                    account(&selecting),
                ]
            };
            let expected = accounts(Simd::scalar(), Threads::Serial);
            for simd in Simd::available() {
                assert!(
                    accounts(simd, Threads::Serial) == expected,
                    "{particles} {resampling:?} {}",
                    simd.name()
                );
            }
            for count in [1, 2, 4] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
                let pool = Threads::Pool(Arc::new(pool));
                assert!(
                    accounts(Simd::best(), pool) == expected,
                    "{particles} {resampling:?}, {count} threads"
                );
            }
        }
    }
}

/// A measurement that no mode explains leaves the very belief that no measurement leaves.
#[test]
fn what_nothing_explains_is_not_used() {
    let filter = linear(chain(), ModalSettings::default());
    let mut seen = filter.start(Time::ZERO, Stream::new(9)).unwrap();
    filter.step(&mut seen, secs(1.0), Some(&[1.0])).unwrap();
    let mut unseen = seen.clone();
    let update = filter.step(&mut seen, secs(2.0), Some(&[1e200])).unwrap();
    filter.step(&mut unseen, secs(2.0), None).unwrap();
    assert_eq!((update.outcome, update.log_evidence), (Outcome::Degenerate, f64::NEG_INFINITY));
    let text = |belief: &ModalBelief<2>| serde_json::to_string(belief).unwrap();
    assert_eq!(text(&seen), text(&unseen));
    assert!(update.particles.unwrap().ess > 100.0);
    // The chain goes on without the measurement: its law, within 5 standard deviations of a share of 1 000 particles.
    let before = enumerated()[0].wild;
    let expected = (1.0 - before) * 0.05 + before * 0.85;
    let found = unseen.cloud().probabilities().nth(1).unwrap();
    assert!((found - expected).abs() < 5.0 * (0.25 / 1000f64).sqrt(), "{found} {expected}");
    assert_eq!(filter.step(&mut seen, secs(3.0), Some(&[3.0])).unwrap().outcome, Outcome::Updated);
}

/// A sensor that goes mad on one side.
#[derive(Clone, Copy)]
struct Mad(Position<1>);

impl Measurement<2> for Mad {
    type Value = [f64; 1];
    type Given<'z> = <Position<1> as Measurement<2>>::Given<'z>;
    fn given<'z>(&'z self, z: &'z [f64; 1], at: Time) -> zerre::Result<Self::Given<'z>> {
        Measurement::<2>::given(&self.0, z, at)
    }
    fn log_likelihood<R: zerre::math::Real>(given: &Self::Given<'_>, x: [R; 2]) -> R {
        let sane = <Position<1> as Measurement<2>>::log_likelihood(given, x);
        // The logarithm of a negative number.
        sane + x[0].ln() * 0.0
    }
}

#[test]
fn particles_without_a_likelihood_are_counted_and_left_out() {
    let model = JumpMarkov::new(motions().to_vec(), chain()).unwrap();
    let sensor = Mad(Position::new(SENSOR_SD).unwrap());
    let filter = MultipleModel::new(prior(), model, sensor, ModalSettings::default()).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(2)).unwrap();
    let update = filter.step(&mut belief, secs(1.0), Some(&[0.5])).unwrap();
    let negative = belief.cloud().particles().filter(|(_, _, x)| x[0] < 0.0).count();
    assert!(negative > 100);
    assert_eq!(update.particles.unwrap().not_finite, negative);
    assert!(belief.cloud().particles().all(|(_, w, x)| w == 0.0 || x[0] > 0.0));
    assert!(belief.estimate()[0] > 0.0 && update.log_evidence.is_finite());
}

/// Mode of the least error, as the thesis says: that of the step before, and its own in the first step. The particles
/// are those of the other outputs.
#[test]
fn the_third_algorithm_takes_the_mode_that_erred_least_before() {
    let settings = || ModalSettings { particles: 500, ..ModalSettings::default() };
    let mixture = linear(chain(), settings());
    let third = linear(chain(), settings()).with_error(Distance).with_output(Output::LeastError).unwrap();
    let mut a = mixture.start(Time::ZERO, Stream::new(4)).unwrap();
    let mut b = third.start(Time::ZERO, Stream::new(4)).unwrap();
    let (mut before, mut changes, mut late) = (None, 0, 0);
    for k in 1..40 {
        // Straight, then wild.
        let t = f64::from(k);
        let z = [t + if k % 13 > 6 { 6.0 * (2.0 * t).sin() } else { 0.0 }];
        mixture.step(&mut a, secs(t), Some(&z)).unwrap();
        third.step(&mut b, secs(t), Some(&z)).unwrap();
        let error = |j: usize| (z[0] - b.cloud().mode_mean(j).unwrap()[0]).abs();
        let least = usize::from(error(1) < error(0));
        assert_eq!(b.estimate(), b.cloud().mode_mean(before.unwrap_or(least)).unwrap(), "step {k}");
        assert_eq!(b.selected(), Some(least));
        assert!(a.cloud().particles().eq(b.cloud().particles()));
        changes += usize::from(before.is_some_and(|before| before != least));
        late += usize::from(b.estimate() != b.cloud().mode_mean(least).unwrap());
        before = Some(least);
    }
    // The test sees both modes, and the lag.
    assert!(changes > 3 && late == changes, "{changes} {late}");
}

/// The first algorithm's output is the mean of the survivors, which a step over no time shows; with weights recomputed
/// it is weighed by the likelihood, and where they are kept the survivors go on with it. Roundings of sums of 700
/// numbers.
#[test]
fn the_first_algorithm_is_the_mean_of_the_survivors() {
    let sensor = Position::<1>::new(SENSOR_SD).unwrap();
    let z = [1.7];
    let given = Measurement::<2>::given(&sensor, &z, secs(1.0)).unwrap();
    let likelihood = |x: [f64; 2]| Position::<1>::log_likelihood(&given, x).exp();
    for after in [AfterResampling::Equal, AfterResampling::Recomputed, AfterResampling::RecomputedKept] {
        let settings = ModalSettings { particles: 700, ..ModalSettings::default() };
        let filter = linear(chain(), settings).with_output(Output::Survivors).unwrap();
        let filter = filter.with_after_resampling(after);
        let mut belief = filter.start(Time::ZERO, Stream::new(4)).unwrap();
        filter.step(&mut belief, secs(1.0), Some(&z)).unwrap();
        let estimate = belief.estimate();
        assert_ne!(estimate, belief.cloud().mean());
        filter.step(&mut belief, secs(1.0), None).unwrap();
        let survivors: Vec<_> = belief.cloud().particles().collect();
        assert_eq!(survivors.len(), 700);
        let weigh = |x| if after == AfterResampling::Equal { 1.0 } else { likelihood(x) };
        let total: f64 = survivors.iter().map(|(_, _, x)| weigh(*x)).sum();
        for k in 0..2 {
            let expected = survivors.iter().map(|(_, _, x)| weigh(*x) * x[k]).sum::<f64>() / total;
            assert!((estimate[k] - expected).abs() < 1e-12, "{after:?}: {estimate:?} {expected}");
        }
        for (_, w, x) in survivors {
            let kept =
                if after == AfterResampling::RecomputedKept { likelihood(x) / total } else { 1.0 / 700.0 };
            assert!((w - kept).abs() < 1e-15, "{after:?}: {w} {kept}");
        }
    }
}

/// The filter computes what the rules say, given what it came to; a step of one mode is one of that mode alone.
#[test]
fn a_selection_leads_the_filter() {
    let sensor = Position::<1>::new(SENSOR_SD).unwrap();
    for output in [Output::Mixture, Output::LeastError] {
        let settings = ModalSettings { particles: 500, ..ModalSettings::default() };
        let filter = linear(chain(), settings).with_error(Distance).with_output(output).unwrap();
        let filter = filter.with_selection(rules()).unwrap();
        let mut belief = filter.start(Time::ZERO, Stream::new(6)).unwrap();
        let mut selector = Selector::new(&rules(), 2).unwrap();
        let mut computed = [0; 3];
        for k in 1..60 {
            let t = f64::from(k);
            let z = [t + if k % 17 > 12 { 5.0 * (2.0 * t).sin() } else { 0.0 }];
            // A prediction asks nobody and tells nobody.
            if k % 10 == 0 {
                filter.step(&mut belief, secs(t - 0.5), None).unwrap();
                assert_eq!(belief.models_computed(), 2);
            }
            let choice = selector.choose(&rules());
            let update: Update = filter.step(&mut belief, secs(t), Some(&z)).unwrap();
            computed[belief.models_computed()] += 1;
            let cloud = belief.cloud();
            let mean = |j: usize| cloud.mode_mean(j).unwrap();
            let selected = match choice {
                Choice::All => {
                    assert_eq!((belief.models_computed(), cloud.len()), (2, 1000));
                    usize::from((z[0] - mean(1)[0]).abs() < (z[0] - mean(0)[0]).abs())
                }
                Choice::One(j) => {
                    assert_eq!((belief.models_computed(), cloud.len()), (1, 500));
                    assert_eq!(cloud.probabilities().nth(j), Some(1.0));
                    assert_eq!(belief.estimate(), mean(j));
                    // The evidence is the mean likelihood: no chain. Roundings of a sum of 500 numbers.
                    let given = Measurement::<2>::given(&sensor, &z, secs(t)).unwrap();
                    let sum: f64 =
                        cloud.particles().map(|p| Position::<1>::log_likelihood(&given, p.2).exp()).sum();
                    assert!((update.log_evidence - (sum / 500.0).ln()).abs() < 1e-12);
                    j
                }
            };
            assert_eq!(belief.selected(), Some(selected));
            selector.record(&rules(), selected, (z[0] - belief.estimate()[0]).abs());
        }
        assert!(computed[1] > 10 && computed[2] > 10, "{computed:?}");
    }
}

/// A measurement that the one selected mode gives no likelihood calls all modes; where they give none either, it is as
/// if there had been none.
#[test]
fn a_selected_mode_that_explains_nothing_is_not_alone() {
    let rules = Wsms { threshold: 1e6, threshold_range: (1.0, 1e6), ..Wsms::default() };
    let filter =
        linear(chain(), ModalSettings::default()).with_error(Distance).with_selection(rules).unwrap();
    let mut seen = filter.start(Time::ZERO, Stream::new(8)).unwrap();
    for k in 1..6 {
        filter.step(&mut seen, secs(f64::from(k)), Some(&[f64::from(k)])).unwrap();
    }
    assert_eq!(seen.models_computed(), 1);
    let mut unseen = seen.clone();
    let update = filter.step(&mut seen, secs(6.0), Some(&[1e200])).unwrap();
    filter.step(&mut unseen, secs(6.0), None).unwrap();
    assert_eq!((update.outcome, seen.models_computed()), (Outcome::Degenerate, 2));
    assert_eq!(serde_json::to_string(&seen).unwrap(), serde_json::to_string(&unseen).unwrap());
    filter.step(&mut seen, secs(7.0), Some(&[7.0])).unwrap();
    assert_eq!(seen.models_computed(), 1);
}

#[test]
fn residuals_are_scaled_and_wrapped() {
    let sensor = RangeBearing::new([0.0; 2], 10.0, 0.1).unwrap();
    let residual = ScaledResidual { sensor, scale: [1e-3, 1.0] };
    // The target lies 1 km to the west, at pi; measured 30 m beyond and on the other side of the cut.
    let x = [-1000.0, 0.0, 0.0, 0.0];
    let error = residual.error(&[1030.0, -3.1], Time::ZERO, &x);
    let angle = std::f64::consts::PI - 3.1;
    assert!((error - (0.03f64.powi(2) + angle * angle).sqrt()).abs() < 1e-12);
}

#[test]
fn borders() {
    // Sixteen modes, one particle.
    let walks: Vec<_> = (1..=16).map(|q| RandomWalk::<1>::new(f64::from(q)).unwrap()).collect();
    let model = JumpMarkov::new(walks, Chain::staying(16, 0.9).unwrap()).unwrap();
    let prior = Gaussian::independent([0.0], [1.0]).unwrap();
    let sensor = Position::<1>::new(1.0).unwrap();
    let settings = |particles| ModalSettings { particles, ..ModalSettings::default() };
    let filter = MultipleModel::new(prior, model.clone(), sensor, settings(1)).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    for k in 1..20 {
        let update = filter.step(&mut belief, secs(f64::from(k)), Some(&[0.5])).unwrap();
        assert_eq!((belief.models_computed(), belief.cloud().len()), (16, 16));
        assert!(update.log_evidence.is_finite() && belief.estimate()[0].is_finite());
        assert!((belief.cloud().probabilities().sum::<f64>() - 1.0).abs() < 1e-14);
    }
    let saved = serde_json::to_string(&belief).unwrap();
    let refused = filter.step(&mut belief, secs(18.0), Some(&[0.0]));
    assert_eq!(refused, Err(Error::OutOfOrder { from: secs(19.0), to: secs(18.0) }));
    assert!(filter.step(&mut belief, secs(20.0), Some(&[f64::NAN])).is_err());
    assert_eq!(serde_json::to_string(&belief).unwrap(), saved);
    // A belief of another number of modes.
    let one =
        JumpMarkov::new(vec![RandomWalk::<1>::new(1.0).unwrap()], Chain::staying(1, 1.0).unwrap()).unwrap();
    let other = MultipleModel::new(prior, one, sensor, settings(1)).unwrap();
    assert!(matches!(other.step(&mut belief, secs(20.0), None), Err(Error::Shape { .. })));
    // Settings.
    for particles in [0, (1 << 26) / 16 + 1] {
        assert!(MultipleModel::new(prior, model.clone(), sensor, settings(particles)).is_err());
    }
    let filter = MultipleModel::new(prior, model, sensor, settings(1)).unwrap();
    assert!(filter.clone().with_output(Output::LeastError).is_err());
    assert!(filter.with_selection(Wsms::default()).is_err());
}
