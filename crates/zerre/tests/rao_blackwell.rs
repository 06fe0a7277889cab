//! The Rao-Blackwellised filter over labels that are drawn: against all sequences of a label of few values,
//! against the grid, and its refusals. Its enumerating case, modes, is in `imm.rs`.

use std::borrow::Borrow;
use zerre::belief::{Gaussian, Hypotheses, Hypothesis};
use zerre::filter::{Filter, Grid, Kalman, Linear, Outcome, RaoBlackwell, Tangent, Update};
use zerre::math::Real;
use zerre::model::measurement::{Conditioned, HeavyTailed, Linear as Sum, Position, RangeBearing};
use zerre::model::motion::{ConstantVelocity, RandomWalk};
use zerre::model::{GaussianMeasurement, Label, Latent, Measurement, Motion, NoiseScale, simulate};
use zerre::resample::Reduction;
use zerre::rng::{Draws, Stream};
use zerre::{Error, Result, Time};

fn secs(t: f64) -> Time {
    Time::from_secs(t)
}

fn walk() -> RandomWalk<1> {
    RandomWalk::new(0.5).unwrap()
}

fn sensor() -> Position<1> {
    Position::new(0.8).unwrap()
}

fn prior() -> Gaussian<1> {
    Gaussian::independent([0.3], [1.2]).unwrap()
}

/// One of three values: they displace the measurement and scale its noise, and the third changes the walk.
#[derive(Clone, Copy)]
struct Three {
    /// How many draws; none: all values, by their probabilities.
    draws: usize,
    /// Draws for a measurement are of even odds and weighed by p / q, instead of drawn from the chain.
    even: bool,
}

const FIRST: [f64; 3] = [0.5, 0.3, 0.2];
const ROWS: [[f64; 3]; 3] = [[0.7, 0.2, 0.1], [0.1, 0.8, 0.1], [0.3, 0.3, 0.4]];
const OFFSET: [f64; 3] = [0.0, 1.5, -2.0];
const SCALE: [f64; 3] = [1.0, 0.5, 4.0];
const WALK: [f64; 3] = [0.5, 0.5, 2.0];

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Value(u8);
impl Label for Value {}

impl Three {
    fn go(
        &self,
        law: &[f64; 3],
        even: bool,
        count: usize,
        draws: &mut Draws,
        out: &mut dyn FnMut(Value, f64),
    ) {
        if self.draws == 0 {
            return (0..3u8).for_each(|u| out(Value(u), law[u as usize]));
        }
        for _ in 0..count {
            let place = draws.uniform();
            let (u, weight) = if even {
                let u = (place * 3.0) as u8;
                (u, 3.0 * law[u as usize])
            } else {
                (u8::from(place > law[0]) + u8::from(place > law[0] + law[1]), 1.0)
            };
            out(Value(u), weight / count as f64);
        }
    }
}

impl Latent<1, 1, 1, Position<1>> for Three {
    type Label = Value;
    type Motion = RandomWalk<1>;
    type Sensor = Conditioned<Position<1>, 1>;
    /// Whether time passes, and whether something is measured.
    type Over = (bool, bool);

    fn branches(&self) -> usize {
        self.draws.max(3)
    }
    fn first(&self, _: &Position<1>, n: usize, draws: &mut Draws, out: &mut dyn FnMut(Value, f64)) {
        self.go(&FIRST, false, n, draws, out);
    }
    fn over(&self, _: &Position<1>, from: Time, to: Time, z: Option<&[f64; 1]>) -> Result<(bool, bool)> {
        Ok((to > from, z.is_some()))
    }
    fn branch(
        &self,
        &(moves, measured): &(bool, bool),
        from: &Hypothesis<1, Value>,
        draws: &mut Draws,
        out: &mut dyn FnMut(Value, f64),
    ) {
        if moves {
            self.go(&ROWS[from.label.0 as usize], self.even && measured, self.draws, draws, out);
        } else {
            out(from.label, 1.0);
        }
    }
    fn motion(&self, label: &Value) -> Result<impl Borrow<RandomWalk<1>>> {
        RandomWalk::new(WALK[label.0 as usize])
    }
    fn sensor(&self, base: &Position<1>, label: &Value) -> Result<impl Borrow<Self::Sensor>> {
        let u = label.0 as usize;
        Conditioned::new(*base).with_offset([OFFSET[u]])?.with_scale(SCALE[u])
    }
}

/// Measurements of four steps, a second apart: the second at the time of the first, none at the third.
const SEEN: [(f64, Option<f64>); 5] =
    [(1.0, Some(0.9)), (1.0, Some(1.4)), (2.0, None), (3.0, Some(-1.0)), (4.0, Some(2.2))];

/// A sequence of labels: the last one, weight, mean and variance.
type Part = (usize, f64, f64, f64);

/// Evidence, mean, variance and probability of the last label by all 3^5 sequences, a scalar Kalman filter
/// for each.
fn by_all_sequences() -> (f64, f64, f64, [f64; 3]) {
    let mut parts: Vec<Part> = (0..3).map(|u| (u, FIRST[u], 0.3, 1.44)).collect();
    let mut now = 0.0;
    for (t, z) in SEEN {
        if t > now {
            let next = |&(u, w, m, p): &Part| -> [Part; 3] {
                std::array::from_fn(|v| (v, w * ROWS[u][v], m, p + WALK[v] * (t - now)))
            };
            parts = parts.iter().flat_map(next).collect();
            now = t;
        }
        if let Some(z) = z {
            for (u, w, m, p) in &mut parts {
                let r = 0.64 * SCALE[*u];
                let (e, s) = (z - *m - OFFSET[*u], *p + r);
                *w *= (-0.5 * e * e / s).exp() / (std::f64::consts::TAU * s).sqrt();
                (*m, *p) = (*m + *p * e / s, *p * r / s);
            }
        }
    }
    assert_eq!(parts.len(), 3 * 81);
    let sum: f64 = parts.iter().map(|part| part.1).sum();
    let of = |f: &dyn Fn(&Part) -> f64| parts.iter().map(|x| x.1 * f(x)).sum::<f64>() / sum;
    let mean = of(&|x| x.2);
    let variance = of(&|x| x.3 + (x.2 - mean).powi(2));
    (sum, mean, variance, std::array::from_fn(|u| of(&|x| f64::from(u8::from(x.0 == u)))))
}

type Rao<L, H> = RaoBlackwell<Linear, L, H, 1, 1, 1>;

/// The belief after [`SEEN`], and the evidence.
fn after<L: Latent<1, 1, 1, Position<1>>>(
    filter: &Rao<L, Position<1>>,
    stream: Stream,
) -> (Hypotheses<1, L::Label>, f64) {
    let mut belief = filter.start(Time::ZERO, stream).unwrap();
    let mut evidence = 0.0;
    for (t, z) in SEEN {
        evidence += filter.step(&mut belief, secs(t), z.map(|z| [z]).as_ref()).unwrap().log_evidence;
    }
    (belief, evidence.exp())
}

/// All values named and none reduced, it is the sum over all sequences, to rounding.
#[test]
fn a_label_of_few_values_is_summed_over() {
    let filter = Rao::new(Linear, Three { draws: 0, even: false }, sensor(), prior(), 1000).unwrap();
    let (belief, evidence) = after(&filter, Stream::new(1));
    let (exact, mean, variance, labels) = by_all_sequences();
    let law = belief.combined().unwrap();
    assert!((evidence / exact - 1.0).abs() < 1e-12, "{evidence} {exact}");
    assert!((law.mean()[0] - mean).abs() < 1e-12 && (law.covariance().0[0][0] - variance).abs() < 1e-12);
    for (u, p) in labels.into_iter().enumerate() {
        let found = belief.expectation(|label| f64::from(u8::from(usize::from(label.0) == u)));
        assert!((found - p).abs() < 1e-12, "{u}: {found} {p}");
    }
}

/// Values drawn from their law, or from another and weighed, and reduced by any rule: over 2 000 runs the
/// evidence and sums weighed by it (which are unbiased, unlike their ratios) are those over all sequences,
/// within five standard errors, and these are small enough to see a wrong factor.
#[test]
fn draws_of_a_label_are_unbiased_under_any_reduction() {
    let (exact, mean, variance, labels) = by_all_sequences();
    for reduction in [Reduction::Optimal, Reduction::Systematic, Reduction::Multinomial] {
        for even in [false, true] {
            let filter = Rao::new(Linear, Three { draws: 3, even }, sensor(), prior(), 40).unwrap();
            let filter = filter.with_reduction(reduction);
            let runs = 2000;
            let mut values: [Vec<f64>; 4] = Default::default();
            for run in 0..runs {
                let (belief, evidence) = after(&filter, Stream::new(7).fork(run));
                let (law, e) = (belief.combined().unwrap(), evidence / exact);
                let (m, p) = (law.mean()[0], law.covariance().0[0][0]);
                let second = belief.expectation(|label| f64::from(u8::from(label.0 == 1)));
                let all = [e, e * (m - mean), e * (p + (m - mean).powi(2)), e * second];
                values.iter_mut().zip(all).for_each(|(values, value)| values.push(value));
            }
            for (values, expected) in values.iter().zip([1.0, 0.0, variance, labels[1]]) {
                let n = runs as f64;
                let mean = values.iter().sum::<f64>() / n;
                let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
                let error = 5.0 * (variance / n).sqrt();
                assert!(error < 0.1, "says nothing: {error}");
                assert!(
                    (mean - expected).abs() < error,
                    "{reduction:?} {even}: {mean}, not {expected} +- {error}"
                );
            }
        }
    }
}

/// Draws stay apart: every hypothesis that is kept goes on to all its draws, and nothing is drawn without a
/// measurement. Equal labels of equal laws go on as one.
#[test]
fn draws_are_kept_apart_and_named_values_are_not() {
    let robust = HeavyTailed::<_, 1>::student_t(sensor(), 3.0).unwrap();
    let filter = Rao::new(Linear, NoiseScale::new(walk(), 4).unwrap(), robust, prior(), 50).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(3)).unwrap();
    let count = |update: Update| update.particles.unwrap().evaluations;
    assert_eq!(belief.len(), 50);
    assert_eq!((count(filter.step(&mut belief, secs(1.0), None).unwrap()), belief.len()), (0, 50));
    for k in 2..5 {
        let update = filter.step(&mut belief, secs(f64::from(k)), Some(&[0.4])).unwrap();
        let particles = update.particles.unwrap();
        assert_eq!((particles.evaluations, belief.len(), particles.distinct_ancestors), (200, 200, 50));
        assert_eq!(particles.resampled, k > 2);
        assert!(particles.ess > 1.0 && particles.ess < 200.0 && particles.not_finite == 0);
    }
    // Two measurements at one time have noise of their own each.
    let before = belief.clone();
    filter.step(&mut belief, secs(4.0), Some(&[0.4])).unwrap();
    assert!(belief.iter().all(|h| before.iter().all(|old| old.label != h.label)));
    // What no label can explain is passed over, and counted.
    let (mut twin, mut update) =
        (belief.clone(), filter.step(&mut belief, secs(5.0), Some(&[1e200])).unwrap());
    assert_eq!((update.outcome, count(update)), (Outcome::Degenerate, 200));
    let predicted = filter.step(&mut twin, secs(5.0), None).unwrap();
    update.particles.as_mut().unwrap().evaluations = 0;
    assert!(belief == twin && update.particles == predicted.particles);

    let named = Rao::new(Linear, Three { draws: 0, even: false }, sensor(), prior(), 50).unwrap();
    let mut belief = named.start(Time::ZERO, Stream::new(3)).unwrap();
    for k in 1..3 {
        // The first two values leave one law.
        named.step(&mut belief, secs(f64::from(k)), None).unwrap();
        assert_eq!(belief.len(), 3 * k as usize, "{k}");
    }
}

/// A mean and the log-evidence so far.
type Said = (f64, f64);

/// A random walk under Student noise, as the grid has it: to 1e-4 with 2 000 nodes, as halving them shows in
/// `grid.rs`. Evidence and mean of 200 runs lie within five standard errors; the mean, a ratio, has a bias of
/// the order of 1 / ESS posterior standard deviations, 1 / 100 here, for which as much is allowed.
#[test]
fn student_noise_has_the_evidence_of_the_grid() {
    let robust = HeavyTailed::<_, 1>::student_t(sensor(), 3.0).unwrap();
    let times: Vec<Time> = (0..15).map(|k| secs(f64::from(k))).collect();
    let path = simulate::path(&walk(), [0.0], &times, Stream::new(5)).unwrap();
    let mut data = simulate::measurements(&robust, &path, &times, Stream::new(5)).unwrap();
    // And one that is an outlier for sure.
    data[7][0] += 9.0;
    let through = |belief: &mut dyn FnMut(Time, &[f64; 1]) -> Said| -> Vec<Said> {
        times[1..].iter().zip(&data[1..]).map(|(&t, z)| belief(t, z)).collect()
    };
    let grid = Grid::new(prior(), walk(), robust).unwrap().with_nodes(2000).unwrap();
    let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut sum = 0.0;
    let exact = through(&mut |t, z| {
        sum += grid.step(&mut belief, t, Some(z)).unwrap().log_evidence;
        (belief.mean()[0], sum)
    });
    let sd = belief.covariance().0[0][0].sqrt();
    let filter = Rao::new(Linear, NoiseScale::new(walk(), 4).unwrap(), robust, prior(), 200).unwrap();
    let runs: Vec<Vec<Said>> = (0..200)
        .map(|run| {
            let mut belief = filter.start(Time::ZERO, Stream::new(11).fork(run)).unwrap();
            let mut sum = 0.0;
            through(&mut |t, z| {
                let update = filter.step(&mut belief, t, Some(z)).unwrap();
                assert!(update.particles.unwrap().ess > 10.0);
                sum += update.log_evidence;
                (belief.mean()[0], sum)
            })
        })
        .collect();
    let average = |of: &dyn Fn(&[Said]) -> f64| {
        let mean = runs.iter().map(|run| of(run)).sum::<f64>() / 200.0;
        let variance = runs.iter().map(|run| (of(run) - mean).powi(2)).sum::<f64>() / 200.0;
        (mean, (variance / 200.0).sqrt())
    };
    for (k, &(m, evidence)) in exact.iter().enumerate() {
        let (mean, error) = average(&|run| run[k].0);
        assert!((mean - m).abs() < 5.0 * error + 0.01 * sd, "{k}: {mean} +- {error}, not {m}");
        let (ratio, error) = average(&|run| (run[k].1 - evidence).exp());
        assert!((ratio - 1.0).abs() < 5.0 * error + 1e-3, "{k}: {ratio} +- {error}");
        assert!(error < 0.02, "says nothing: {error}");
    }
}

/// With Student noise of very many degrees of freedom nu it is Kalman: s = 1 + O(sqrt(2 / nu)), six times
/// 1.4e-5 at most among these draws, and means move by at most that times the innovation, here below 4.
#[test]
fn noise_that_is_nearly_normal_gives_nearly_kalman() {
    let robust = HeavyTailed::<_, 1>::student_t(sensor(), 1e10).unwrap();
    let rao = Rao::new(Linear, NoiseScale::new(walk(), 2).unwrap(), robust, prior(), 20).unwrap();
    let kalman = Kalman::new(walk(), sensor(), prior()).unwrap();
    let mut belief = rao.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut exact = kalman.start(Time::ZERO, Stream::new(1)).unwrap();
    for (k, z) in (1..).zip([0.4, 1.9, -1.0, 0.0, 2.0]) {
        let found = rao.step(&mut belief, secs(f64::from(k)), Some(&[z])).unwrap();
        let expected = kalman.step(&mut exact, secs(f64::from(k)), Some(&[z])).unwrap();
        assert!((belief.mean()[0] - exact.state.mean()[0]).abs() < 4e-4);
        assert!((found.log_evidence - expected.log_evidence).abs() < 4e-4);
    }
}

/// A sensor given its label: z = h(x) + d + v with v ~ N(0, s R), angles wrapped, whatever tails the sensor
/// has.
#[test]
fn a_conditioned_sensor_has_the_law_that_it_says() {
    let radar = RangeBearing::new([1.0, 2.0], 3.0, 0.1).unwrap();
    let robust = HeavyTailed::<_, 2>::student_t(radar, 3.0).unwrap();
    let (offset, scale) = ([2.0, 0.3], 2.5f64);
    let same = Conditioned::new(robust).with_offset(offset).unwrap().with_scale(scale).unwrap();
    let wider = RangeBearing::new([1.0, 2.0], 3.0 * scale.sqrt(), 0.1 * scale.sqrt()).unwrap();
    for (x, z) in [([-9.0, 2.1], [13.0, -2.9]), ([5.0, -4.0], [6.0, -0.6])] {
        let given = Measurement::<2>::given(&same, &z, Time::ZERO).unwrap();
        let found = <Conditioned<_, 2> as Measurement<2>>::log_likelihood(&given, x);
        let shifted = [z[0] - offset[0], z[1] - offset[1]];
        let given = Measurement::<2>::given(&wider, &shifted, Time::ZERO).unwrap();
        let expected = RangeBearing::log_likelihood(&given, x);
        assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{found} {expected}");
    }
    assert!(!GaussianMeasurement::<2, 2>::is_heavy_tailed(&same));
    let sensor = || Conditioned::<_, 1>::new(sensor());
    assert!(sensor().with_offset([f64::NAN]).is_err() && sensor().with_scale(0.0).is_err());
    assert!(Measurement::<1>::given(&sensor(), &[f64::INFINITY], Time::ZERO).is_err());
}

/// A label that is no label at times.
struct Spoilt(f64);

impl Latent<1, 1, 1, Position<1>> for Spoilt {
    type Label = f64;
    type Motion = RandomWalk<1>;
    type Sensor = Position<1>;
    type Over = ();
    fn branches(&self) -> usize {
        2
    }
    fn first(&self, _: &Position<1>, _: usize, _: &mut Draws, out: &mut dyn FnMut(f64, f64)) {
        out(0.0, 1.0);
    }
    fn over(&self, _: &Position<1>, _: Time, _: Time, _: Option<&[f64; 1]>) -> Result<()> {
        Ok(())
    }
    fn branch(&self, (): &(), _: &Hypothesis<1, f64>, _: &mut Draws, out: &mut dyn FnMut(f64, f64)) {
        out(1.0, self.0);
    }
    fn motion(&self, label: &f64) -> Result<impl Borrow<RandomWalk<1>>> {
        RandomWalk::new(1.0 - 2.0 * label)
    }
    fn sensor(&self, base: &Position<1>, _: &f64) -> Result<impl Borrow<Position<1>>> {
        Ok(base)
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let robust = HeavyTailed::<_, 1>::student_t(sensor(), 3.0).unwrap();
    let scales = |branches| NoiseScale::new(walk(), branches);
    assert!(scales(1).is_err() && scales(17).is_err());
    let scales = scales(4).unwrap();
    let normal = Rao::new(Linear, scales, sensor(), prior(), 10);
    assert!(matches!(normal, Err(Error::Unsupported(reason)) if reason.contains("normal")));
    assert!(Rao::new(Linear, scales, robust, prior(), 0).is_err());
    let motion = NoiseScale::new(ConstantVelocity::<2>::new(1.0).unwrap(), 4).unwrap();
    let radar = HeavyTailed::<_, 2>::student_t(RangeBearing::new([0.0; 2], 1.0, 0.1).unwrap(), 3.0).unwrap();
    let wide = Gaussian::independent([9.0, 0.0, 0.0, 0.0], [1.0; 4]).unwrap();
    assert!(matches!(RaoBlackwell::new(Linear, motion, radar, wide, 10), Err(Error::Unsupported(_))));
    let curved = RaoBlackwell::new(Tangent, motion, radar, wide, 10).unwrap();
    let mut belief = curved.start(Time::ZERO, Stream::new(1)).unwrap();
    assert_eq!(curved.step(&mut belief, secs(1.0), Some(&[9.0, 0.0])).unwrap().outcome, Outcome::Updated);

    // Steps that fail leave the belief as it was: labels that make no motion, weights that are none.
    for weight in [1.0, -1.0, f64::NAN, 0.0, f64::INFINITY] {
        let spoilt = Rao::new(Linear, Spoilt(weight), sensor(), prior(), 10).unwrap();
        let mut belief = spoilt.start(Time::ZERO, Stream::new(1)).unwrap();
        let before = belief.clone();
        assert!(spoilt.step(&mut belief, secs(1.0), Some(&[0.0])).is_err(), "{weight}");
        assert!(belief == before);
    }
    // A belief of modes is no belief of drawn labels, and the other way round.
    let drawn = Rao::new(Linear, scales, robust, prior(), 10).unwrap();
    let part = Hypothesis { label: 1.0, weight: 1.0, law: prior() };
    let mut belief = Hypotheses::new(Time::ZERO, Stream::new(1), 2, vec![part]).unwrap();
    assert!(matches!(drawn.step(&mut belief, secs(1.0), None), Err(Error::Shape { .. })));
}

/// Draws with a residual in view stand for the law of the scale: E_q[p / q f(s)] = E_p[f(s)], within five
/// standard errors of 40 000 draws, for 1 and 1 / s, whose mean is 1 under Student noise and 1 - e + e /
/// scale^2 with outliers.
#[test]
fn scales_drawn_with_a_residual_in_view_keep_their_law() {
    let check = |sensor: HeavyTailed<Position<2>, 2>, expected: f64| {
        for distance in [0.0, 2.0, 60.0, 1e6, f64::INFINITY] {
            let mut draws = Stream::new(8).draws(zerre::rng::Purpose::Other, 0, 0);
            let mut values = [vec![], vec![]];
            for _ in 0..40_000 {
                let (s, ratio) =
                    GaussianMeasurement::<2, 2>::propose_covariance_scale(&sensor, distance, &mut draws);
                assert!((0.0..2.000_001).contains(&ratio) && s > 0.0, "{distance}: {s} {ratio}");
                values[0].push(ratio);
                values[1].push(ratio / s);
            }
            for (values, expected) in values.iter().zip([1.0, expected]) {
                let mean = values.iter().sum::<f64>() / 40_000.0;
                let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 40_000.0;
                let error = 5.0 * (variance / 40_000.0).sqrt() + 1e-12;
                assert!(error < 0.1 && (mean - expected).abs() < error, "{distance}: {mean} +- {error}");
            }
        }
    };
    let position = Position::<2>::new(1.0).unwrap();
    check(HeavyTailed::student_t(position, 3.0).unwrap(), 1.0);
    check(HeavyTailed::student_t(position, 1e15).unwrap(), 1.0);
    check(HeavyTailed::outliers(position, 0.1, 5.0).unwrap(), 0.9 + 0.1 / 25.0);
}

/// A bias of the sensor that follows u' = 0.8 u + 0.6 w: the label is u, or a second component of the state.
#[derive(Clone, Copy)]
struct Bias;

impl Bias {
    fn next<R: Real>(u: R, w: R) -> R {
        u * 0.8 + w * 0.6
    }
}

impl Latent<1, 1, 1, Position<1>> for Bias {
    type Label = f64;
    type Motion = RandomWalk<1>;
    type Sensor = Conditioned<Position<1>, 1>;
    type Over = bool;
    fn branches(&self) -> usize {
        4
    }
    fn first(&self, _: &Position<1>, count: usize, draws: &mut Draws, out: &mut dyn FnMut(f64, f64)) {
        (0..count).for_each(|_| out(draws.normal(), 1.0 / count as f64));
    }
    fn over(&self, _: &Position<1>, from: Time, to: Time, _: Option<&[f64; 1]>) -> Result<bool> {
        Ok(to > from)
    }
    fn branch(
        &self,
        moves: &bool,
        from: &Hypothesis<1, f64>,
        draws: &mut Draws,
        out: &mut dyn FnMut(f64, f64),
    ) {
        if *moves {
            (0..4).for_each(|_| out(Bias::next(from.label, draws.normal()), 0.25));
        } else {
            out(from.label, 1.0);
        }
    }
    fn motion(&self, _: &f64) -> Result<impl Borrow<RandomWalk<1>>> {
        Ok(walk())
    }
    fn sensor(&self, base: &Position<1>, bias: &f64) -> Result<impl Borrow<Self::Sensor>> {
        Conditioned::new(*base).with_offset([*bias])
    }
}

impl Motion<2, 2> for Bias {
    type Step = f64;
    fn over(&self, from: Time, to: Time) -> Result<f64> {
        Ok((0.5 * (to - from).secs()).sqrt())
    }
    #[inline(always)]
    fn apply<R: Real>(sd: &f64, [x, u]: [R; 2], [v, w]: [R; 2]) -> [R; 2] {
        [x + v * *sd, Bias::next(u, w)]
    }
}

/// A label that lasts, with a law so straight that a Kalman filter over both is exact: evidence and what it
/// weighs (the means of x and u, the variance of x) within five standard errors over 400 runs.
#[test]
fn a_label_that_lasts_is_followed_as_a_component_of_the_state_would_be() {
    let both = Gaussian::independent([0.3, 0.0], [1.2, 1.0]).unwrap();
    let sum = Sum::<1, 2>::new([[1.0, 1.0]], [[0.64]]).unwrap();
    let kalman = Kalman::new(Bias, sum, both).unwrap();
    let mut exact = kalman.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut log_evidence = 0.0;
    for (t, z) in SEEN {
        log_evidence += kalman.step(&mut exact, secs(t), z.map(|z| [z]).as_ref()).unwrap().log_evidence;
    }
    let ([x, u], variance) = (*exact.state.mean(), exact.state.covariance().0[0][0]);
    let filter = Rao::new(Linear, Bias, sensor(), prior(), 60).unwrap();
    let runs: Vec<[f64; 4]> = (0..400)
        .map(|run| {
            let (belief, evidence) = after(&filter, Stream::new(13).fork(run));
            let (law, e) = (belief.combined().unwrap(), evidence / log_evidence.exp());
            let (m, p) = (law.mean()[0], law.covariance().0[0][0]);
            [e, e * (m - x), e * (belief.expectation(|&u| u) - u), e * (p + (m - x).powi(2))]
        })
        .collect();
    for (k, expected) in [1.0, 0.0, 0.0, variance].into_iter().enumerate() {
        let mean = runs.iter().map(|run| run[k]).sum::<f64>() / 400.0;
        let variance = runs.iter().map(|run| (run[k] - mean).powi(2)).sum::<f64>() / 400.0;
        let error = 5.0 * (variance / 400.0).sqrt();
        assert!(error < 0.1, "says nothing: {error}");
        assert!((mean - expected).abs() < error, "{k}: {mean}, not {expected} +- {error}");
    }
}
