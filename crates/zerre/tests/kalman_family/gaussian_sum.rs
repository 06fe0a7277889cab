//! The Gaussian sum filter beside the truth by brute-force quadrature, and what its simplifications cost.

use crate::models::{Glide, Level, direct, positions};
use zerre::belief::{Gaussian, Hypotheses, Hypothesis};
use zerre::filter::{
    Extended, Filter, GaussianSum, Kalman, Linear, Outcome, SigmaPoints, Simplified, SumSettings, Tangent,
    Transform,
};
use zerre::math::{Matrix, Real};
use zerre::model::{GaussianMeasurement, Motion, measurement, motion, simulate};
use zerre::rng::{Purpose, Stream};
use zerre::{Result, Time};

fn normal(x: f64, mean: f64, variance: f64) -> f64 {
    (-0.5 * (x - mean).powi(2) / variance).exp() / (std::f64::consts::TAU * variance).sqrt()
}

fn density(parts: &[Hypothesis<1>], x: f64) -> f64 {
    parts.iter().map(|p| p.weight * normal(x, p.law.mean()[0], p.law.covariance().0[0][0])).sum()
}

fn mixture(parts: &[(f64, f64, f64)]) -> Hypotheses<1> {
    let sum: f64 = parts.iter().map(|p| p.0).sum();
    let part = |&(weight, mean, variance): &(f64, f64, f64)| {
        let law = Gaussian::new([mean], Matrix([[variance]])).unwrap();
        Hypothesis { label: 0, weight: weight / sum, law }
    };
    Hypotheses::new(Time::ZERO, Stream::new(1), 1, parts.iter().map(part).collect()).unwrap()
}

/// D(p || q) by the trapezoidal rule.
fn divergence(p: &[Hypothesis<1>], q: &[Hypothesis<1>]) -> f64 {
    const STEP: f64 = 0.01;
    let at = |i: i32| {
        let x = f64::from(i) * STEP;
        let p = density(p, x);
        if p > 0.0 { p * (p / density(q, x)).ln() * STEP } else { 0.0 }
    };
    (-3000..3000).map(at).sum()
}

/// What a step of no time and no measurement makes of a mixture.
fn simplified(before: &Hypotheses<1>, settings: SumSettings) -> (Hypotheses<1>, Simplified) {
    let filter = GaussianSum::new(Tangent, Level(1.0), direct(1.0), prior(), settings).unwrap();
    let mut after = before.clone();
    let (update, done) = filter.advance(&mut after, Time::ZERO, None).unwrap();
    assert_eq!((update.outcome, update.log_evidence), (Outcome::Predicted, 0.0));
    (after, done)
}

fn prior() -> Gaussian<1> {
    Gaussian::new([0.0], Matrix([[1.0]])).unwrap()
}

fn parts(of: &Hypotheses<1>) -> Vec<Hypothesis<1>> {
    of.iter().copied().collect()
}

/// Random mixtures of eight parts, merged down to fewer: mean and covariance stay to a few roundings of
/// numbers up to 100, and the stated cost bounds the divergence that quadrature finds, without being empty.
#[test]
fn merging_keeps_moments_and_states_its_cost() {
    let mut draws = Stream::new(12).draws(Purpose::Other, 0, 0);
    let mut shares = Vec::new();
    for _ in 0..20 {
        let drawn: Vec<_> =
            (0..8).map(|_| (draws.uniform(), 3.0 * draws.normal(), 0.2 + 2.0 * draws.uniform())).collect();
        let before = mixture(&drawn);
        for few in [6, 3, 1] {
            let settings = SumSettings { parts: few, prune: 0.0, merge: 0.0, ..SumSettings::default() };
            let (after, done) = simplified(&before, settings);
            assert_eq!((after.len(), done.merges, done.splits, done.pruned), (few, 8 - few, 0, 0.0));
            let (p, q) = (before.combined().unwrap(), after.combined().unwrap());
            assert!((p.mean()[0] - q.mean()[0]).abs() < 1e-13);
            assert!((p.covariance().0[0][0] - q.covariance().0[0][0]).abs() < 1e-13);
            let lost = divergence(&parts(&before), &parts(&after));
            assert!(lost <= done.cost + 1e-9, "{lost} lost, {} stated", done.cost);
            shares.push(lost / done.cost);
        }
        // Cheap merges cost far less than the bound says; that of all parts does not.
        assert!(shares[shares.len() - 1] > 0.01, "{shares:?}");
    }
}

/// The limit of the cost is kept, and a limit of zero still merges what is equal: for nothing.
#[test]
fn merging_stops_at_its_limit() {
    let before =
        mixture(&[(1.0, 0.0, 1.0), (1.0, 0.5, 1.0), (1.0, 1.0, 1.1), (1.0, 5.0, 1.0), (2.0, 5.0, 1.0)]);
    let run = |merge| simplified(&before, SumSettings { merge, prune: 0.0, ..SumSettings::default() });
    let (after, done) = run(0.0);
    assert_eq!((after.len(), done.merges), (4, 1));
    assert!(done.cost < 1e-15);
    let (after, done) = run(0.05);
    assert!(done.cost > 0.0 && done.cost <= 0.05 && after.len() < 4, "{done:?}");
    assert_eq!(run(f64::INFINITY).0.len(), 1);
}

/// D(q || p) = -ln(1 - dropped) for parts that do not overlap, and less where they do.
#[test]
fn pruning_states_what_it_drops() {
    let light = [(0.6, 0.0, 1.0), (0.4 - 3e-3, 1.0, 0.5), (1e-3, 12.0, 0.1), (2e-3, 0.3, 2.0)];
    let before = mixture(&light);
    let (after, done) =
        simplified(&before, SumSettings { prune: 2.5e-3, merge: 0.0, ..SumSettings::default() });
    assert_eq!(after.len(), 3);
    assert!((done.pruned - 1e-3).abs() < 1e-15);
    let lost = divergence(&parts(&after), &parts(&before));
    let bound = -(1.0 - done.pruned).ln();
    assert!(lost <= bound + 1e-9 && lost > 0.9 * bound, "{lost} {bound}");
    let (after, done) =
        simplified(&before, SumSettings { prune: 3.5e-3, merge: 0.0, ..SumSettings::default() });
    assert_eq!(after.len(), 2);
    let lost = divergence(&parts(&after), &parts(&before));
    assert!(lost <= -(1.0 - done.pruned).ln() + 1e-9);
}

/// One Gaussian, the Kalman filter's, whatever the transform.
#[test]
fn exact_on_a_linear_world() {
    fn check<T: Transform>(transform: T) {
        let prior = Gaussian::independent([0.0; 4], [3.0, 1.0, 3.0, 1.0]).unwrap();
        let kalman = Kalman::new(Glide(0.1), positions(1.0), prior).unwrap();
        let sum =
            GaussianSum::new(transform, Glide(0.1), positions(1.0), prior, SumSettings::default()).unwrap();
        let mut exact = kalman.start(Time::ZERO, Stream::new(0)).unwrap();
        let mut found = sum.start(Time::ZERO, Stream::new(0)).unwrap();
        for k in 0..30 {
            let (to, z) = (Time::from_secs(0.7 * f64::from(k)), [f64::from(k % 7), 1.0]);
            let z = (k % 4 != 3).then_some(&z);
            let said = kalman.step(&mut exact, to, z).unwrap();
            let (update, done) = sum.advance(&mut found, to, z).unwrap();
            assert_eq!((found.len(), done), (1, Simplified::default()));
            assert_eq!(update.outcome, said.outcome);
            assert!((update.log_evidence - said.log_evidence).abs() < 1e-11);
            let law = found.combined().unwrap();
            assert!((0..4).all(|i| (law.mean()[i] - exact.state.mean()[i]).abs() < 1e-11));
            assert!((*law.covariance() - *exact.state.covariance()).max_abs() < 1e-11);
        }
    }
    check(Linear);
    check(Tangent);
    check(SigmaPoints::default());
    check(SigmaPoints::cubature());
}

/// x + 1e-9 x^2 + w: bent enough to be split where the limit is zero, and otherwise a random walk.
struct Bent;

impl Motion<2, 2> for Bent {
    type Step = ();
    fn over(&self, _: Time, _: Time) -> Result<()> {
        Ok(())
    }
    fn apply<R: Real>(_: &(), x: [R; 2], w: [R; 2]) -> [R; 2] {
        [x[0] + x[0] * x[1] * 1e-9 + w[0], x[1] + x[1] * x[1] * 1e-9 + w[1] * 0.5]
    }
}

/// Splitting changes neither mean nor covariance: of 63 splits nothing is left but the curvature of 1e-9.
#[test]
fn splitting_keeps_moments() {
    let prior = Gaussian::new([1.0, -2.0], Matrix([[2.0, 0.9], [0.9, 1.0]])).unwrap();
    let sensor = measurement::Linear::new([[1.0, 0.0]], [[1.0]]).unwrap();
    let settings = SumSettings { parts: 43, split: 0.0, prune: 0.0, merge: 0.0 };
    let filter = GaussianSum::new(Tangent, Bent, sensor, prior, settings).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let (_, done) = filter.advance(&mut belief, Time::from_secs(1.0), None).unwrap();
    assert_eq!((done.splits, done.merges, belief.len()), (64, 129 - 43, 43));
    let law = belief.combined().unwrap();
    let expected = Matrix([[3.0, 0.9], [0.9, 1.25]]);
    assert!((law.mean()[0] - 1.0).abs() < 1e-7 && (law.mean()[1] + 2.0).abs() < 1e-7);
    assert!((*law.covariance() - expected).max_abs() < 1e-7, "{law:?}");
    // Parts are narrower than the whole: it was split indeed.
    assert!(belief.iter().all(|part| part.law.covariance().0[0][0] < 2.9));
}

/// Densities on a lattice, by brute force.
struct Lattice {
    nodes: Vec<f64>,
    step: f64,
}

impl Lattice {
    fn new() -> Self {
        let step = 0.06;
        Lattice { nodes: (-700..=700).map(|i| f64::from(i) * step).collect(), step }
    }

    /// p(x_k | z_1..k-1) from p(x_k-1 | z_1..k-1) for additive noise.
    fn predicted(&self, p: &[f64], f: impl Fn(f64) -> f64, variance: f64) -> Vec<f64> {
        let images: Vec<f64> = self.nodes.iter().map(|&x| f(x)).collect();
        let at = |y: f64| {
            p.iter().zip(&images).map(|(p, image)| p * normal(y, *image, variance)).sum::<f64>() * self.step
        };
        self.nodes.iter().map(|&y| at(y)).collect()
    }

    /// The evidence of z; `p` becomes the posterior.
    fn updated(&self, p: &mut [f64], likelihood: impl Fn(f64) -> f64) -> f64 {
        p.iter_mut().zip(&self.nodes).for_each(|(p, &x)| *p *= likelihood(x));
        let evidence = p.iter().sum::<f64>() * self.step;
        p.iter_mut().for_each(|p| *p /= evidence);
        evidence
    }

    /// Integral of |p - q|: 0 for the same law, 2 for laws that have nothing in common.
    fn distance(&self, p: &[f64], q: impl Fn(f64) -> f64) -> f64 {
        p.iter().zip(&self.nodes).map(|(p, &x)| (p - q(x)).abs()).sum::<f64>() * self.step
    }
}

/// The square of a state that may have either sign: the posterior has two modes, of which an extended filter
/// sees one and the sum both.
#[test]
fn both_modes_of_a_square() {
    let lattice = Lattice::new();
    let law = Gaussian::new([0.5], Matrix([[25.0]])).unwrap();
    let sensor = measurement::Growth::new(1.0).unwrap();
    let still = motion::RandomWalk::<1>::new(1.0).unwrap();
    let mut truth: Vec<f64> = lattice.nodes.iter().map(|&x| normal(x, 0.5, 25.0)).collect();
    let evidence = lattice.updated(&mut truth, |x| normal(2.5, x * x / 20.0, 1.0));
    let (one, _) = Extended::new(still, sensor, law).update(&law, &[2.5], Time::ZERO).unwrap();
    let one = lattice.distance(&truth, |x| normal(x, one.mean()[0], one.covariance().0[0][0]));

    fn distance<T: Transform>(
        (transform, settings): (T, SumSettings),
        lattice: &Lattice,
        (truth, evidence): (&[f64], f64),
        law: Gaussian<1>,
    ) -> f64 {
        let sensor = measurement::Growth::new(1.0).unwrap();
        let still = motion::RandomWalk::<1>::new(1.0).unwrap();
        let filter = GaussianSum::new(transform, still, sensor, law, settings).unwrap();
        let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
        let (update, done) = filter.advance(&mut belief, Time::ZERO, Some(&[2.5])).unwrap();
        assert!(done.splits > 3, "{done:?}");
        assert!((update.log_evidence - evidence.ln()).abs() < 0.1, "{} {evidence}", update.log_evidence);
        let all = parts(&belief);
        lattice.distance(truth, |x| density(&all, x))
    }
    let truth = (&truth[..], evidence);
    let tangent = distance((Tangent, SumSettings::default()), &lattice, truth, law);
    let points = distance((SigmaPoints::default(), SumSettings::default()), &lattice, truth, law);
    assert!(one > 0.8 && tangent < 0.2 && points < 0.1, "{one}; {tangent} {points}");
    // The finer the parts, the nearer the truth.
    let fine = SumSettings { parts: 300, split: 1e-4, prune: 1e-9, merge: 1e-6 };
    let fine = distance((Tangent, fine), &lattice, truth, law);
    assert!(fine < 0.5 * tangent, "{fine} {tangent}");
}

/// The growth model of Gordon, Salmond and Smith over fifteen steps.
#[test]
fn nearer_the_truth_than_one_gaussian() {
    let lattice = Lattice::new();
    let (moves, sensor) = (motion::Growth::new(10.0).unwrap(), measurement::Growth::new(1.0).unwrap());
    let law = Gaussian::new([0.0], Matrix([[5.0]])).unwrap();
    let times: Vec<Time> = (0..=15).map(|k| Time::from_secs(f64::from(k))).collect();
    let path = simulate::path(&moves, [0.1], &times, Stream::new(8)).unwrap();
    let seen = simulate::measurements(&sensor, &path, &times, Stream::new(8)).unwrap();
    let extended = Extended::new(moves, sensor, law);
    let sum = GaussianSum::new(Tangent, moves, sensor, law, SumSettings::default()).unwrap();
    let mut one = extended.start(Time::ZERO, Stream::new(0)).unwrap();
    let mut many = sum.start(Time::ZERO, Stream::new(0)).unwrap();
    let mut truth: Vec<f64> = lattice.nodes.iter().map(|&x| normal(x, 0.0, 5.0)).collect();
    let (mut apart, mut log_evidence) = ([0.0; 2], [0.0; 3]);
    for k in 1..=15 {
        let step = moves.over(times[k - 1], times[k]).unwrap();
        truth = lattice.predicted(&truth, |x| motion::Growth::apply(&step, [x], [0.0])[0], 10.0);
        let z = &seen[k];
        let hidden = |x: f64| GaussianMeasurement::<1, 1>::predict(&sensor, times[k], [x])[0];
        log_evidence[2] += lattice.updated(&mut truth, |x| normal(z[0], hidden(x), 1.0)).ln();
        log_evidence[0] += extended.step(&mut one, times[k], Some(z)).unwrap().log_evidence;
        log_evidence[1] += sum.step(&mut many, times[k], Some(z)).unwrap().log_evidence;
        let (mean, variance) = (one.state.mean()[0], one.state.covariance().0[0][0]);
        apart[0] += lattice.distance(&truth, |x| normal(x, mean, variance)) / 15.0;
        let all = parts(&many);
        apart[1] += lattice.distance(&truth, |x| density(&all, x)) / 15.0;
    }
    assert!(apart[1] < 0.2 && apart[0] > 0.6, "{apart:?}");
    let off = |i: usize| (log_evidence[i] - log_evidence[2]).abs();
    assert!(off(1) < 0.5 && off(0) > 1.0, "{log_evidence:?}");
}

#[test]
fn borders() {
    let with = |change: fn(&mut SumSettings)| {
        let mut settings = SumSettings::default();
        change(&mut settings);
        GaussianSum::new(Tangent, Level(1.0), direct(1.0), prior(), settings)
    };
    assert!(with(|s| s.parts = 0).is_err() && with(|s| s.parts = 5000).is_err());
    assert!(with(|s| s.split = -1.0).is_err() && with(|s| s.split = f64::NAN).is_err());
    assert!(with(|s| s.prune = 1.0).is_err() && with(|s| s.merge = f64::NAN).is_err());
    let filter = with(|s| s.parts = 1).unwrap().with_gate(0.99).unwrap();
    assert!(filter.clone().with_gate(1.0).is_err());
    let two = Hypothesis { label: 1, weight: 1.0, law: prior() };
    let mut two = Hypotheses::new(Time::ZERO, Stream::new(1), 2, vec![two]).unwrap();
    assert!(filter.advance(&mut two, Time::ZERO, None).is_err());

    // The gate looks at the whole: far from both parts, and between them.
    let mut wide = mixture(&[(1.0, -20.0, 1.0), (1.0, 20.0, 1.0)]);
    let before = wide.combined().unwrap();
    assert_eq!(filter.step(&mut wide, Time::ZERO, Some(&[90.0])).unwrap().outcome, Outcome::Gated);
    assert_eq!(wide.combined().unwrap(), before);
    let between = filter.step(&mut wide, Time::ZERO, Some(&[0.0])).unwrap();
    assert_eq!(between.outcome, Outcome::Updated);

    // Parts that are known exactly merge last, and at a price that says so.
    let exact = mixture(&[(1.0, 0.0, 0.0), (1.0, 0.1, 1.0), (1.0, 0.0, 1.0)]);
    let (after, done) = simplified(&exact, SumSettings { parts: 2, merge: 0.0, ..SumSettings::default() });
    assert!(
        after.len() == 2
            && done.cost < 0.01
            && after.iter().any(|p| p.law == exact.iter().next().unwrap().law)
    );
    let (after, done) = simplified(&exact, SumSettings { parts: 1, merge: 0.0, ..SumSettings::default() });
    assert!(after.len() == 1 && done.cost == f64::INFINITY);
}

/// A measurement that no part can explain is as none, though parts had been split for it.
#[test]
fn an_impossible_measurement_is_as_none() {
    let (moves, sensor) = (motion::Growth::new(10.0).unwrap(), measurement::Growth::new(1.0).unwrap());
    let law = Gaussian::new([0.0], Matrix([[5.0]])).unwrap();
    let filter = GaussianSum::new(Tangent, moves, sensor, law, SumSettings::default()).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let mut twin = belief.clone();
    let to = Time::from_secs(1.0);
    let (update, done) = filter.advance(&mut belief, to, Some(&[1e200])).unwrap();
    assert_eq!((update.outcome, update.log_evidence), (Outcome::Degenerate, f64::NEG_INFINITY));
    assert_eq!(done, filter.advance(&mut twin, to, None).unwrap().1);
    assert_eq!(belief, twin);
}
