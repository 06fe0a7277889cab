//! The grid filter against exact filters, and against itself with half the spacing.

use zerre::belief::{Gaussian, GridBelief};
use zerre::filter::{Filter, Grid, Kalman, Outcome, Update};
use zerre::kernels::Simd;
use zerre::math::{Matrix, Real};
use zerre::model::motion::{self, ConstantVelocity, RandomWalk, WienerAcceleration};
use zerre::model::{GaussianMeasurement, Measurement, Motion, measurement, simulate};
use zerre::rng::{Purpose, Stream};
use zerre::{Error, Result, Time};

fn seconds(k: u32) -> Time {
    Time::from_secs(f64::from(k))
}

/// Largest distances of a grid from Kalman over `steps`: of means and standard deviations in standard
/// deviations, of the log-evidence of a step.
fn against_kalman<A, H, const N: usize, const W: usize, const M: usize>(
    grid: &Grid<N, W, A, H>,
    kalman: &Kalman<A, H, N, W, M>,
    steps: u32,
    z: impl Fn(u32) -> Option<[f64; M]>,
) -> [f64; 3]
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
{
    let mut exact = kalman.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut worst = [0.0f64; 3];
    for k in 0..steps {
        let z = z(k);
        let a = kalman.step(&mut exact, seconds(k), z.as_ref()).unwrap();
        let b = grid.step(&mut belief, seconds(k), z.as_ref()).unwrap();
        assert_eq!(a.outcome, b.outcome);
        assert_eq!(belief.time(), exact.time);
        let (mean, p, truth) = (belief.mean(), belief.covariance(), exact.state.covariance());
        for i in 0..N {
            let sd = truth.0[i][i].sqrt();
            worst[0] = worst[0].max((mean[i] - exact.state.mean()[i]).abs() / sd);
            for j in 0..N {
                let size = sd * truth.0[j][j].sqrt();
                worst[1] = worst[1].max((p.0[i][j] - truth.0[i][j]).abs() / size);
            }
        }
        worst[2] = worst[2].max((a.log_evidence - b.log_evidence).abs());
    }
    worst
}

/// In one dimension sums over nodes of a smooth density are exact to what lies beyond the support, 1e-17 of
/// the law. The first measurement narrows a law that did not move: cubic interpolation at 0.036 of its
/// standard deviations, 0.1 of the posterior's, is off by 3 / 128 0.1^4 3 = 7e-6 at most, and by much less on
/// the average over the nodes.
#[test]
fn a_linear_world_of_one_dimension_is_exact() {
    let prior = Gaussian::new([1.0], Matrix([[4.0]])).unwrap();
    let (motion, sensor) =
        (RandomWalk::<1>::new(0.5).unwrap(), measurement::Position::<1>::new(0.8).unwrap());
    let grid = Grid::new(prior, motion, sensor).unwrap();
    let kalman = Kalman::new(motion, sensor, prior).unwrap();
    let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
    let path: Vec<f64> = (0..40)
        .scan(0.0, |x, _| {
            *x += 0.7 * draws.normal();
            Some(*x + 0.8 * draws.normal())
        })
        .collect();
    let worst = against_kalman(&grid, &kalman, 40, |k| (k % 5 != 3).then(|| [path[k as usize]]));
    assert!(worst.iter().all(|&w| w < 1e-6), "{worst:?}");
}

/// In several dimensions the deposit's spline lacks a fourth cumulant of 0.0016 noise variances squared, per
/// axis. Of the density that is 0.0016 / 24 H_4 per step: 2e-4 at most where the law is as narrow as the
/// noise, and the measurement forgets it within a few steps.
#[test]
fn a_linear_world_of_two_dimensions_is_exact_to_the_spacing() {
    let prior = Gaussian::independent([0.0, 1.0], [1.0, 0.3]).unwrap();
    let (motion, sensor) =
        (ConstantVelocity::<1>::new(0.02).unwrap(), measurement::Position::<1>::new(1.0).unwrap());
    let grid = Grid::new(prior, motion, sensor).unwrap();
    let kalman = Kalman::new(motion, sensor, prior).unwrap();
    let mut draws = Stream::new(4).draws(Purpose::Other, 0, 0);
    let noise: Vec<f64> = (0..15).map(|_| draws.normal()).collect();
    let worst =
        against_kalman(&grid, &kalman, 15, |k| (k % 5 != 3).then(|| [f64::from(k) + noise[k as usize]]));
    assert!(worst.iter().all(|&w| w < 1e-3), "{worst:?}");
}

#[test]
fn a_linear_world_of_three_dimensions_is_exact_to_the_spacing() {
    let prior = Gaussian::independent([0.0, 1.0, -1.0], [1.0, 0.9, 0.8]).unwrap();
    let motion = RandomWalk::<3>::new(0.5).unwrap();
    let h = [[1.0, 0.5, 0.0], [0.0, 1.0, -0.5]];
    let sensor = measurement::Linear::<2, 3>::new(h, [[0.5, 0.1], [0.1, 0.4]]).unwrap();
    let grid = Grid::new(prior, motion, sensor).unwrap();
    let kalman = Kalman::new(motion, sensor, prior).unwrap();
    let worst = against_kalman(&grid, &kalman, 5, |k| Some([0.3 * f64::from(k), -0.5]));
    assert!(worst.iter().all(|&w| w < 1e-3), "{worst:?}");
}

/// Means and evidences of a run.
fn run<A, H>(grid: &Grid<1, 1, A, H>, data: &[[f64; 1]]) -> Vec<(f64, f64, Update)>
where
    A: Motion<1, 1>,
    H: Measurement<1, Value = [f64; 1]>,
{
    let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
    (1..)
        .zip(data)
        .map(|(k, z)| {
            let update = grid.step(&mut belief, seconds(k), Some(z)).unwrap();
            (belief.mean()[0], belief.covariance().0[0][0].sqrt(), update)
        })
        .collect()
}

/// Truth, measurements and the two grids of a growth model: the largest changes of means and evidences, and
/// the error of the mean.
fn halved<A, H>(motion: A, sensor: H, first: f64, prior: Gaussian<1>, steps: u32, nodes: usize) -> [f64; 3]
where
    A: Motion<1, 1> + Clone,
    H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone,
{
    let times: Vec<Time> = (0..=steps).map(seconds).collect();
    let mut worst = [0.0f64; 3];
    for seed in 0..3 {
        let path = simulate::path(&motion, [first], &times, Stream::new(seed)).unwrap();
        let data = simulate::measurements(&sensor, &path, &times, Stream::new(seed)).unwrap();
        let [coarse, fine] = [nodes, 2 * nodes].map(|n| {
            let grid = Grid::new(prior, motion.clone(), sensor.clone()).unwrap().with_nodes(n).unwrap();
            run(&grid, &data[1..])
        });
        let mut squares = 0.0;
        for ((a, b), x) in coarse.iter().zip(&fine).zip(&path[1..]) {
            worst[0] = worst[0].max((a.0 - b.0).abs()).max((a.1 - b.1).abs());
            worst[1] = worst[1].max((a.2.log_evidence - b.2.log_evidence).abs());
            squares += (b.0 - x[0]).square();
        }
        worst[2] = worst[2].max((squares / f64::from(steps)).sqrt());
    }
    worst
}

#[test]
fn growth_models_do_not_depend_on_the_spacing() {
    let prior = Gaussian::new([1.0], Matrix([[0.75]])).unwrap();
    for variance in [1.0, 3.0, 6.0] {
        let motion = motion::UpfGrowth::new(3.0, 2.0).unwrap();
        let worst = halved(motion, measurement::UpfGrowth::new(variance).unwrap(), 1.0, prior, 50, 500);
        assert!(worst[0] < 1e-3 && worst[1] < 1e-3, "Q = {variance}: {worst:?}");
    }
    let (motion, sensor) = (motion::Growth::new(10.0).unwrap(), measurement::Growth::new(1.0).unwrap());
    let prior = Gaussian::new([0.0], Matrix([[5.0]])).unwrap();
    let worst = halved(motion, sensor, 0.3, prior, 50, 500);
    assert!(worst[0] < 1e-3 && worst[1] < 1e-3, "univariate growth: {worst:?}");
}

/// Measurements a thousand times finer than the prediction: the standard deviation of the posterior is
/// sqrt(1e-5) over the slope of the sensor, 0.4 x or 0.5, at most 0.0063 for x above 1; five times that
/// covers three runs of 60 steps.
#[test]
fn the_support_follows_sharp_measurements() {
    let motion = motion::UpfGrowth::new(3.0, 2.0).unwrap();
    let prior = Gaussian::new([1.0], Matrix([[0.75]])).unwrap();
    let worst = halved(motion, measurement::UpfGrowth::new(1e-5).unwrap(), 1.0, prior, 60, 500);
    assert!(worst[0] < 1e-4 && worst[1] < 1e-3 && worst[2] < 0.03, "{worst:?}");
}

/// Two sharp measurements at the very start, and one at an instant already predicted: nothing moves, and the
/// nodes are interpolated. Cubic interpolation of a normal law at 0.036 of its standard deviations is good to
/// 1e-7.
#[test]
fn measurements_of_one_instant_add_up() {
    let prior = Gaussian::new([1.0], Matrix([[4.0]])).unwrap();
    let (motion, sensor) =
        (RandomWalk::<1>::new(0.5).unwrap(), measurement::Position::<1>::new(0.01).unwrap());
    let grid = Grid::new(prior, motion, sensor).unwrap();
    let kalman = Kalman::new(motion, sensor, prior).unwrap();
    let mut exact = kalman.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
    for (k, z) in [(0, 1.5), (0, 1.51), (1, 2.0), (1, 1.98)] {
        let a = kalman.step(&mut exact, seconds(k), Some(&[z])).unwrap();
        let b = grid.step(&mut belief, seconds(k), Some(&[z])).unwrap();
        let sd = exact.state.covariance().0[0][0].sqrt();
        assert!((belief.mean()[0] - exact.state.mean()[0]).abs() < 1e-5 * sd, "{k}");
        assert!((belief.covariance().0[0][0].sqrt() / sd - 1.0).abs() < 1e-5, "{k}");
        assert!((a.log_evidence - b.log_evidence).abs() < 1e-5, "{k}");
    }
    // Nothing at all leaves the belief alone.
    let before = serde_json::to_string(&belief).unwrap();
    let nothing = grid.step(&mut belief, seconds(1), None).unwrap();
    assert_eq!((nothing.outcome, nothing.log_evidence), (Outcome::Predicted, 0.0));
    assert_eq!(serde_json::to_string(&belief).unwrap(), before);
}

#[test]
fn quantiles_are_those_of_the_law() {
    // Of the standard normal law at 0.05, 0.5, 0.9.
    let expected = [-1.644_853_626_951_472_7, 0.0, 1.281_551_565_544_600_4];
    let levels = [0.05, 0.5, 0.9];
    let one = Gaussian::new([3.0], Matrix([[4.0]])).unwrap();
    let sensor = measurement::Position::<1>::new(1.0).unwrap();
    let grid = Grid::new(one, RandomWalk::<1>::new(1.0).unwrap(), sensor).unwrap();
    let belief = grid.start(Time::ZERO, Stream::new(0)).unwrap();
    for (found, e) in belief.quantiles(0, levels).unwrap().iter().zip(expected) {
        // A cdf that is straight over cells of h = 0.036 standard deviations is off by h^2 / 8 of its
        // curvature, and the cells widen the law by h^2 / 24: 3.6e-4 standard deviations at 1.64 of them.
        assert!((found - (3.0 + 2.0 * e)).abs() < 8e-4, "{found} {e}");
    }
    let two = Gaussian::new([0.0, 1.0], Matrix([[1.0, 0.6], [0.6, 4.0]])).unwrap();
    let grid = Grid::new(two, RandomWalk::<2>::new(1.0).unwrap(), sensor).unwrap();
    let belief = grid.start(Time::ZERO, Stream::new(0)).unwrap();
    for (k, mean, sd) in [(0, 0.0, 1.0), (1, 1.0, 2.0)] {
        for (found, e) in belief.quantiles(k, levels).unwrap().iter().zip(expected) {
            // Cells of 0.29 standard deviations spread evenly widen the law by h^2 / 24 = 0.4 %.
            assert!((found - (mean + sd * e)).abs() < 0.01 * sd, "{k}: {found} {e}");
        }
    }
    assert!(belief.quantiles(2, [0.5]).is_err() && belief.quantiles(0, [1.1]).is_err());
}

fn growth() -> Grid<1, 1, motion::Growth, measurement::Growth> {
    let prior = Gaussian::new([0.0], Matrix([[5.0]])).unwrap();
    let (motion, sensor) = (motion::Growth::new(10.0).unwrap(), measurement::Growth::new(1.0).unwrap());
    Grid::new(prior, motion, sensor).unwrap().with_nodes(120).unwrap()
}

#[test]
fn a_saved_belief_goes_on_to_the_same_bits_on_every_level() {
    let data = [[3.0], [0.2], [12.0], [7.0]];
    let mut runs = Vec::new();
    for level in Simd::available() {
        let grid = growth().with_simd(level);
        let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
        let mut evidence = Vec::new();
        for (k, z) in (1..).zip(&data) {
            evidence.push(grid.step(&mut belief, seconds(k), Some(z)).unwrap().log_evidence.to_bits());
            let text = serde_json::to_string(&belief).unwrap();
            belief = serde_json::from_str(&text).unwrap();
            assert_eq!(serde_json::to_string(&belief).unwrap(), text);
        }
        runs.push((evidence, belief.nodes().map(|(_, m)| m.to_bits()).collect::<Vec<_>>()));
    }
    let mut whole = growth().start(Time::ZERO, Stream::new(1)).unwrap();
    for (k, z) in (1..).zip(&data) {
        growth().step(&mut whole, seconds(k), Some(z)).unwrap();
    }
    runs.push((runs[0].0.clone(), whole.nodes().map(|(_, m)| m.to_bits()).collect()));
    assert!(runs.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn a_broken_save_is_refused() {
    let belief = growth().start(Time::ZERO, Stream::new(1)).unwrap();
    let text = serde_json::to_string(&belief).unwrap();
    assert!(serde_json::from_str::<GridBelief<1>>(&text).is_ok());
    assert!(serde_json::from_str::<GridBelief<2>>(&text).is_err());
    for (from, to) in
        [("\"count\":[120]", "\"count\":[119]"), ("\"spacing\":[", "\"spacing\":[-"), ("e-", "e9")]
    {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text);
        assert!(serde_json::from_str::<GridBelief<1>>(&broken).is_err(), "{from}");
    }
}

/// A sensor that gives no state any likelihood at 9, and NaN to half of them at 8.
struct Moody;

impl Measurement<1> for Moody {
    type Value = f64;
    type Given<'z> = f64;
    fn given(&self, &z: &f64, _: Time) -> Result<f64> {
        Error::finite("mood", z)
    }
    fn log_likelihood<R: Real>(&given: &f64, [x]: [R; 1]) -> R {
        let zero = x.constant(0.0);
        if given == 9.0 {
            return x.constant(f64::NEG_INFINITY);
        }
        if given == 8.0 { zero.if_lt(x, zero, x.constant(f64::NAN)) } else { zero }
    }
}

#[test]
fn impossible_measurements_are_degenerate_and_bad_ones_refused() {
    let prior = Gaussian::new([0.0], Matrix([[1.0]])).unwrap();
    let grid = Grid::new(prior, RandomWalk::<1>::new(1.0).unwrap(), Moody).unwrap();
    let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
    let update = grid.step(&mut belief, seconds(1), Some(&9.0)).unwrap();
    assert_eq!((update.outcome, update.log_evidence), (Outcome::Degenerate, f64::NEG_INFINITY));
    assert!((belief.covariance().0[0][0] - 2.0).abs() < 1e-9, "it was predicted");
    assert!(grid.step(&mut belief, seconds(2), Some(&f64::NAN)).is_err());
    assert!(matches!(grid.step(&mut belief, Time::ZERO, None), Err(Error::OutOfOrder { .. })));
    assert_eq!(belief.time(), seconds(1));
    assert_eq!(grid.step(&mut belief, seconds(1), Some(&1.0)).unwrap().outcome, Outcome::Updated);
    // Half of the states are left, with half the probability; the border cuts through a cell of 0.036
    // deviations.
    let update = grid.step(&mut belief, seconds(1), Some(&8.0)).unwrap();
    assert!((update.log_evidence - 0.5f64.ln()).abs() < 0.03, "{update:?}");
}

#[test]
fn what_a_grid_cannot_do_is_refused() {
    let position = measurement::Position::<1>::new(1.0).unwrap();
    let four = Gaussian::independent([0.0; 4], [1.0; 4]).unwrap();
    let velocity = ConstantVelocity::<2>::new(1.0).unwrap();
    assert!(matches!(Grid::new(four, velocity, position), Err(Error::Unsupported(_))));
    let singular = Gaussian::new([0.0], Matrix([[0.0]])).unwrap();
    let walk = RandomWalk::<1>::new(1.0).unwrap();
    assert!(matches!(Grid::new(singular, walk, position), Err(Error::NotPositiveDefinite { .. })));
    let prior = Gaussian::new([0.0], Matrix([[1.0]])).unwrap();
    assert!(Grid::new(prior, walk, position).unwrap().with_nodes(15).is_err());
    // No density: the noise of three components has one dimension.
    let three = Gaussian::independent([0.0; 3], [1.0; 3]).unwrap();
    let grid = Grid::new(three, WienerAcceleration::<1>::new(1.0).unwrap(), position).unwrap();
    let mut belief = grid.with_nodes(16).unwrap().start(Time::ZERO, Stream::new(1)).unwrap();
    let grid = Grid::new(three, WienerAcceleration::<1>::new(1.0).unwrap(), position).unwrap();
    assert!(matches!(grid.step(&mut belief, seconds(1), None), Err(Error::Unsupported(_))));
    assert_eq!((belief.time(), belief.len()), (Time::ZERO, 4096));
    // Noise so small beside the spread that no lattice holds both.
    let grid = Grid::new(prior, RandomWalk::<1>::new(1e-14).unwrap(), position).unwrap();
    let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
    let refusal = grid.step(&mut belief, seconds(1), None).unwrap_err();
    assert!(refusal.to_string().contains("too small"), "{refusal}");
}

/// Errors are as large as the covariance says: over 300 worlds drawn from the model NEES after each of ten steps is
/// chi-square with 300 degrees of freedom, five standard deviations of which a right filter leaves in one test of a
/// hundred thousand. A grid that is told half the noise leaves them at once.
#[test]
fn errors_are_as_large_as_it_says() {
    let nees = |told: f64| {
        let prior = Gaussian::new([0.0], Matrix([[1.0]])).unwrap();
        let (motion, sensor) =
            (RandomWalk::<1>::new(0.5).unwrap(), measurement::Position::<1>::new(0.8).unwrap());
        let believed = measurement::Position::<1>::new(0.8 * told).unwrap();
        let grid = Grid::new(prior, motion, believed).unwrap().with_nodes(100).unwrap();
        let mut sums = [0.0; 10];
        for world in 0..300 {
            let stream = Stream::new(77).fork(world);
            let start = stream.draws(Purpose::Prior, 0, 0).normal();
            let times: Vec<Time> = (0..10).map(seconds).collect();
            let truth = simulate::path(&motion, [start], &times, stream.fork(0)).unwrap();
            let measured = simulate::measurements(&sensor, &truth, &times, stream.fork(1)).unwrap();
            let mut belief = grid.start(Time::ZERO, Stream::new(1)).unwrap();
            for (k, sum) in sums.iter_mut().enumerate() {
                grid.step(&mut belief, times[k], Some(&measured[k])).unwrap();
                *sum += (belief.mean()[0] - truth[k][0]).powi(2) / belief.covariance().0[0][0];
            }
        }
        sums
    };
    let far = |sum: &f64| (sum - 300.0).abs() > 5.0 * 600f64.sqrt();
    assert!(!nees(1.0).iter().any(far), "{:?}", nees(1.0));
    assert!(nees(0.5).iter().all(far), "{:?}", nees(0.5));
}
