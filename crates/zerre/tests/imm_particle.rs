//! The IMM particle filter against all sequences of modes, one Kalman filter each; the same bits whoever computes; what
//! it does where nothing is left.

use zerre::belief::{Gaussian, GaussianBelief, ModalCloud};
use zerre::filter::{Filter, ImmParticle, Kalman, ModalSettings, Outcome, Update};
use zerre::kernels::{Simd, Threads};
use zerre::math::Real;
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::model::{Chain, JumpMarkov, Measurement, Motion};
use zerre::resample::Resampling;
use zerre::rng::{Purpose, Stream};
use zerre::{Error, Time};

const RESAMPLINGS: [Resampling; 4] =
    [Resampling::Multinomial, Resampling::Residual, Resampling::Stratified, Resampling::Systematic];

fn secs(t: f64) -> Time {
    Time::from_secs(t)
}

/// Time and measurement of each step: predictions alone and two measurements at one time among them.
const SCRIPT: [(f64, Option<f64>); 7] = [
    (0.0, Some(0.3)),
    (1.0, Some(0.9)),
    (2.0, Some(2.5)),
    (3.0, None),
    (4.0, Some(6.0)),
    (4.0, Some(7.0)),
    (5.0, Some(7.5)),
];

const SENSOR_SD: f64 = 1.5;

fn prior() -> Gaussian<2> {
    Gaussian::independent([0.0, 1.0], [1.0, 1.0]).unwrap()
}

fn sensor() -> Position<1> {
    Position::new(SENSOR_SD).unwrap()
}

type Model = JumpMarkov<ConstantVelocity<1>>;

fn model(densities: &[f64], rows: &[&[f64]], initial: &[f64]) -> Model {
    let rows = rows.iter().map(|row| row.to_vec()).collect();
    let chain = Chain::per_step(rows).unwrap().with_initial(initial).unwrap();
    let motions = densities.iter().map(|&q| ConstantVelocity::new(q).unwrap()).collect();
    JumpMarkov::new(motions, chain).unwrap()
}

/// Two modes, nearly straight and wild.
fn different() -> Model {
    model(&[0.05, 4.0], &[&[0.95, 0.05], &[0.15, 0.85]], &[0.7, 0.3])
}

fn worlds() -> [(&'static str, Model); 5] {
    [
        ("one mode", model(&[0.5], &[&[1.0]], &[1.0])),
        ("two alike", model(&[0.5, 0.5], &[&[0.8, 0.2], &[0.5, 0.5]], &[0.1, 0.9])),
        ("two different", different()),
        ("a known one of two", model(&[0.05, 4.0], &[&[1.0, 0.0], &[0.0, 1.0]], &[0.0, 1.0])),
        // Modes that cannot be reached at first, and one that cannot be left.
        (
            "a ladder of three",
            model(
                &[0.05, 4.0, 1.0],
                &[&[0.7, 0.3, 0.0], &[0.0, 0.6, 0.4], &[0.0, 0.0, 1.0]],
                &[1.0, 0.0, 0.0],
            ),
        ),
    ]
}

/// Evidence Z of all measurements up to a step, and Z times: the probability of each of three modes, the means of both
/// components, their squares and their product. A particle filter's estimate of each of them is unbiased, whatever the
/// number of particles; that of the mean alone, a ratio, is not.
type Sums = [f64; 9];

fn sums(evidence: f64, modes: [f64; 3], mean: [f64; 2], covariance: [[f64; 2]; 2]) -> Sums {
    let moment = |r: usize, c: usize| covariance[r][c] + mean[r] * mean[c];
    let [a, b, c] = modes;
    [1.0, a, b, c, mean[0], mean[1], moment(0, 0), moment(1, 1), moment(1, 0)].map(|x| evidence * x)
}

/// By a Kalman filter for each sequence of modes.
fn enumerated(model: &Model) -> Vec<Sums> {
    let kalman: Vec<_> =
        model.modes().iter().map(|&motion| Kalman::new(motion, sensor(), prior()).unwrap()).collect();
    let start = |(j, &p): (usize, &f64)| -> (usize, f64, GaussianBelief<2>) {
        (j, p, kalman[j].start(Time::ZERO, Stream::new(0)).unwrap())
    };
    let mut all: Vec<_> = model.chain().initial().iter().enumerate().map(start).collect();
    let mut now = Time::ZERO;
    let step = |&(t, z): &(f64, Option<f64>)| {
        let jump = model.chain().over(now, secs(t));
        let mut next = Vec::new();
        for &(i, weight, belief) in &all {
            for (j, kalman) in kalman.iter().enumerate() {
                let mut belief = belief;
                let z = z.map(|z| [z]);
                let update = kalman.step(&mut belief, secs(t), z.as_ref()).unwrap();
                next.push((j, weight * jump.probability(i, j) * update.log_evidence.exp(), belief));
            }
        }
        next.retain(|(_, weight, _)| *weight > 0.0);
        (all, now) = (next, secs(t));
        let mut total = [0.0; 9];
        for (j, weight, belief) in &all {
            let modes = std::array::from_fn(|k| f64::from(u8::from(k == *j)));
            let of = sums(*weight, modes, *belief.state.mean(), belief.state.covariance().0);
            total.iter_mut().zip(of).for_each(|(total, of)| *total += of);
        }
        total
    };
    SCRIPT.iter().map(step).collect()
}

/// One run of a filter over the script.
type Run<'a> = &'a dyn Fn(Stream) -> Vec<Sums>;

/// Averages over R runs lie within 5.5 standard errors of the exact values, as the runs themselves show them: beyond
/// lies 4e-8 of the normal law, and there are fewer than 1300 comparisons. Sums that are exact in every run (no mode
/// but one) may differ by rounding.
fn unbiased(model: &Model, run: Run<'_>, runs: u64) -> Result<(), String> {
    let exact = enumerated(model);
    let mut first = vec![[0.0; 9]; SCRIPT.len()];
    let mut second = first.clone();
    for r in 0..runs {
        for (k, sums) in run(Stream::new(23).fork(r)).iter().enumerate() {
            for i in 0..9 {
                let x = (sums[i] - exact[k][i]) / exact[k][0];
                first[k][i] += x;
                second[k][i] += x * x;
            }
        }
    }
    let n = runs as f64;
    for k in 0..SCRIPT.len() {
        for i in 0..9 {
            let mean = first[k][i] / n;
            let variance = (second[k][i] / n - mean * mean).max(0.0);
            let allowed = 5.5 * (variance / n).sqrt() + 1e-12;
            if mean.is_nan() || mean.abs() > allowed {
                return Err(format!("sum {i} of step {k} is off by {mean:.3e}, allowed {allowed:.3e}"));
            }
        }
    }
    Ok(())
}

type Linear = ImmParticle<2, 2, ConstantVelocity<1>, Position<1>>;

fn filter(model: &Model, settings: ModalSettings) -> Linear {
    ImmParticle::new(prior(), model.clone(), sensor(), settings).unwrap()
}

fn particles(particles: usize, resampling: Resampling) -> ModalSettings {
    ModalSettings { particles, resampling, ..ModalSettings::default() }
}

fn run(filter: &Linear, stream: Stream) -> Vec<Sums> {
    let mut cloud = filter.start(Time::ZERO, stream).unwrap();
    let mut log_evidence = 0.0;
    let step = |&(t, z): &(f64, Option<f64>)| {
        let z = z.map(|z| [z]);
        log_evidence += filter.step(&mut cloud, secs(t), z.as_ref()).unwrap().log_evidence;
        let mut modes = [0.0; 3];
        modes.iter_mut().zip(cloud.probabilities()).for_each(|(to, p)| *to = p);
        sums(log_evidence.exp(), modes, cloud.mean(), cloud.covariance().0)
    };
    SCRIPT.iter().map(step).collect()
}

#[test]
fn all_sequences_of_modes_are_weighed() {
    for (name, model) in worlds() {
        for resampling in RESAMPLINGS {
            let filter = filter(&model, particles(150, resampling));
            let verdict = unbiased(&model, &|stream| run(&filter, stream), 2000);
            verdict.unwrap_or_else(|e| panic!("{name}, {resampling:?}: {e}"));
        }
    }
}

/// The filter as it is written down: one particle after the other, every draw a walk over all weights. With `forgets`
/// the particles of a mode are not weighed by its probability c_j / N_j but all alike.
fn by_hand(model: &Model, n: usize, forgets: bool, stream: Stream) -> Vec<Sums> {
    let modes = model.modes().len();
    let mut draws = stream.draws(Purpose::Other, 0, 0);
    let mut all: Vec<(usize, f64, [f64; 2])> = Vec::new();
    for (j, p) in model.chain().initial().iter().enumerate() {
        for _ in 0..n {
            all.push((j, p / n as f64, [draws.normal(), 1.0 + draws.normal()]));
        }
    }
    let (mut now, mut evidence) = (Time::ZERO, 1.0);
    let step = |&(t, z): &(f64, Option<f64>)| {
        let to = secs(t);
        if to > now {
            let jump = model.chain().over(now, to);
            let mut next = Vec::new();
            for (j, motion) in model.modes().iter().enumerate() {
                let step = motion.over(now, to).unwrap();
                let share: f64 = all.iter().map(|(i, w, _)| w * jump.probability(*i, j)).sum();
                for _ in 0..n {
                    let mut place = draws.uniform() * share;
                    let parent = all.iter().find(|(i, w, _)| {
                        place -= w * jump.probability(*i, j);
                        place < 0.0
                    });
                    let x = parent.unwrap_or(&all[0]).2;
                    let moved = ConstantVelocity::<1>::apply(&step, x, [draws.normal(), draws.normal()]);
                    let weight = if forgets { 1.0 / (n * modes) as f64 } else { share / n as f64 };
                    next.push((j, weight, moved));
                }
            }
            (all, now) = (next, to);
        }
        if let Some(z) = z {
            let seen = sensor();
            let given = Measurement::<2>::given(&seen, &[z], to).unwrap();
            for (_, w, x) in &mut all {
                *w *= <Position<1> as Measurement<2>>::log_likelihood(&given, *x).exp();
            }
            let sum: f64 = all.iter().map(|(_, w, _)| w).sum();
            all.iter_mut().for_each(|(_, w, _)| *w /= sum);
            evidence *= sum;
        }
        let mut total = [0.0; 9];
        for &(j, w, x) in &all {
            let modes = std::array::from_fn(|k| f64::from(u8::from(k == j)));
            let of = sums(evidence * w, modes, x, [[0.0; 2]; 2]);
            total.iter_mut().zip(of).for_each(|(total, of)| *total += of);
        }
        total
    };
    SCRIPT.iter().map(step).collect()
}

/// The test of the filter finds one that forgets the probabilities of the modes, and passes one that does not.
#[test]
fn forgotten_probabilities_are_found() {
    let model = different();
    unbiased(&model, &|stream| by_hand(&model, 40, false, stream), 1000).unwrap();
    assert!(unbiased(&model, &|stream| by_hand(&model, 40, true, stream), 1000).is_err());
    // Nor does a filter for another chain pass.
    let other = filter(&worlds()[1].1, particles(150, Resampling::Systematic));
    assert!(unbiased(&model, &|stream| run(&other, stream), 1000).is_err());
}

/// Everything that a run shows, as text.
fn account(settings: ModalSettings, resumed: bool) -> String {
    let filter = filter(&worlds()[4].1, settings);
    let mut cloud = filter.start(Time::ZERO, Stream::new(5)).unwrap();
    let mut text = String::new();
    for (t, z) in SCRIPT {
        let z = z.map(|z| [z]);
        if resumed {
            cloud = serde_json::from_str(&serde_json::to_string(&cloud).unwrap()).unwrap();
        }
        let update = filter.step(&mut cloud, secs(t), z.as_ref()).unwrap();
        text += &format!("{update:?} {}\n", serde_json::to_string(&cloud).unwrap());
    }
    text
}

/// Ten thousand particles are twenty blocks: several threads do take part.
#[test]
fn levels_threads_and_interruptions_change_no_bit() {
    for resampling in RESAMPLINGS {
        for n in [1, 2, 700, 10_000] {
            let settings = particles(n, resampling);
            let expected = account(settings.clone(), false);
            assert!(account(settings.clone(), true) == expected, "resumed, {resampling:?} {n}");
            for simd in Simd::available() {
                for count in [1, 2, 4] {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
                    let threads = Threads::Pool(std::sync::Arc::new(pool));
                    let found = account(ModalSettings { simd, threads, ..settings.clone() }, false);
                    assert!(found == expected, "{} {count} threads, {resampling:?} {n}", simd.name());
                }
            }
        }
    }
}

/// Each mode that is possible has its part of the particles, at least one; the others have none.
#[test]
fn particles_are_shared_by_the_modes_that_are_possible() {
    let parts = |cloud: &ModalCloud<2>| {
        let mut parts = [0; 3];
        cloud.particles().for_each(|(j, ..)| parts[j] += 1);
        parts
    };
    for (n, expected) in
        [(100, [[100, 0, 0], [50, 50, 0], [34, 33, 33]]), (1, [[1, 0, 0], [1, 1, 0], [1, 1, 1]])]
    {
        let filter = filter(&worlds()[4].1, particles(n, Resampling::default()));
        let mut cloud = filter.start(Time::ZERO, Stream::new(5)).unwrap();
        for (k, expected) in expected.into_iter().enumerate() {
            filter.step(&mut cloud, secs(k as f64), Some(&[k as f64])).unwrap();
            assert_eq!(parts(&cloud), expected);
        }
        assert!((cloud.probabilities().sum::<f64>() - 1.0).abs() < 1e-14);
    }
}

/// A measurement that kills every mode is not used: the belief is that of a prediction, and goes on.
#[test]
fn a_measurement_that_kills_every_mode_is_counted() {
    let filter = filter(&different(), particles(1000, Resampling::Systematic));
    let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    filter.step(&mut cloud, secs(1.0), Some(&[1.0])).unwrap();
    let shown = |cloud: &ModalCloud<2>| cloud.particles().collect::<Vec<_>>();
    // No time passes, or some.
    for to in [1.0, 2.0] {
        let mut predicted = cloud.clone();
        filter.step(&mut predicted, secs(to), None).unwrap();
        let update = filter.step(&mut cloud, secs(to), Some(&[1e200])).unwrap();
        assert_eq!((update.outcome, update.log_evidence), (Outcome::Degenerate, f64::NEG_INFINITY));
        assert_eq!(shown(&cloud), shown(&predicted));
        assert!(cloud.ess() > 0.0 && update.particles.unwrap().not_finite == 0);
    }
    let update = filter.step(&mut cloud, secs(3.0), Some(&[3.0])).unwrap();
    assert!(update.outcome == Outcome::Updated && update.log_evidence.is_finite());
}

#[test]
fn refusals_leave_the_belief_as_it_was() {
    let filter = filter(&different(), particles(100, Resampling::Systematic));
    let mut cloud = filter.start(secs(1.0), Stream::new(1)).unwrap();
    let before = serde_json::to_string(&cloud).unwrap();
    assert!(matches!(filter.step(&mut cloud, Time::ZERO, None), Err(Error::OutOfOrder { .. })));
    assert!(matches!(filter.step(&mut cloud, secs(2.0), Some(&[f64::NAN])), Err(Error::NotFinite { .. })));
    assert_eq!(serde_json::to_string(&cloud).unwrap(), before);
    let three = self::filter(&worlds()[4].1, particles(100, Resampling::Systematic));
    assert!(matches!(three.step(&mut cloud, secs(2.0), None), Err(Error::Shape { .. })));
    for n in [0, 1 << 26] {
        let settings = particles(n, Resampling::Systematic);
        assert!(Linear::new(prior(), different(), sensor(), settings).is_err());
    }
}

/// A mode that loses some of its particles or all of them, and the others none.
#[derive(Clone, Copy, Debug)]
struct Losing {
    beyond: f64,
}

impl Motion<2, 2> for Losing {
    type Step = f64;
    fn over(&self, _: Time, _: Time) -> zerre::Result<f64> {
        Ok(self.beyond)
    }
    #[inline(always)]
    fn apply<R: Real>(beyond: &f64, x: [R; 2], w: [R; 2]) -> [R; 2] {
        let nan = x[0].constant(f64::NAN);
        [(x[0] + w[0]).if_lt(x[0].constant(*beyond), x[0] + w[0], nan), x[1]]
    }
}

fn losing(beyond: [f64; 2], z: Option<f64>) -> (Update, ModalCloud<2>, Update) {
    let chain = Chain::staying(2, 0.5).unwrap();
    let model = JumpMarkov::new(beyond.map(|beyond| Losing { beyond }).to_vec(), chain).unwrap();
    let filter = ImmParticle::new(prior(), model, sensor(), particles(2000, Resampling::Systematic)).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    let first = filter.step(&mut cloud, secs(1.0), z.map(|z| [z]).as_ref()).unwrap();
    let shown = cloud.clone();
    (first, shown, filter.step(&mut cloud, secs(2.0), Some(&[0.0])).unwrap())
}

#[test]
fn lost_states_are_counted_and_stay_worthless() {
    for z in [None, Some(0.0), Some(1e200)] {
        let (update, cloud, next) = losing([0.0, f64::INFINITY], z);
        // Half of a thousand, +-5 sd.
        let lost = update.particles.unwrap().not_finite;
        assert!((420..580).contains(&lost), "{lost}");
        assert!(cloud.mean().iter().all(|x| x.is_finite()));
        assert_eq!(cloud.weights().filter(|&w| w == 0.0).count(), lost);
        assert_eq!(next.outcome, Outcome::Updated);
        // Of a prediction the lost ones are half of the first mode's probability.
        if z != Some(0.0) {
            let first = cloud.probabilities().next().unwrap();
            assert!((first - 0.5 * (1000 - lost) as f64 / (1000.0 - 0.5 * lost as f64)).abs() < 1e-12);
        }
    }
    let (update, cloud, next) = losing([f64::NEG_INFINITY; 2], Some(0.0));
    assert_eq!((update.outcome, next.outcome), (Outcome::Degenerate, Outcome::Degenerate));
    assert_eq!((update.particles.unwrap().ess, next.particles.unwrap().ess), (0.0, 0.0));
    assert!(cloud.mean()[0].is_nan());
}
