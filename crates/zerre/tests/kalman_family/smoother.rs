//! The smoother against the joint law of all states, solved at once.

use crate::models::{Glide, Level, Wobble, direct, positions};
use zerre::belief::{Gaussian, GaussianBelief};
use zerre::filter::{Extended, Filter, Kalman, Linear, SigmaPoints, Tangent, Transform, Unscented};
use zerre::math::{Cholesky, Matrix, chi_square};
use zerre::model::{Motion, measurement::Position, motion::MarkovTurn, simulate};
use zerre::rng::{Purpose, Stream};
use zerre::smooth::{rauch_tung_striebel, smooth_gaussian};
use zerre::{Error, Result, Time};

const K: usize = 6;
const ALL: usize = 4 * K;

/// Adds J' C^-1 J to the information and J' C^-1 b to its vector, for residuals J x - b ~ N(0, C) of rows that
/// touch some of all the states.
fn add<const M: usize>(
    (information, vector): (&mut Matrix<ALL, ALL>, &mut [f64; ALL]),
    j: &Matrix<M, ALL>,
    b: [f64; M],
    c: &Matrix<M, M>,
) {
    let weighted = j.transpose() * Cholesky::of("C", c).unwrap().inverse();
    *information = *information + weighted * *j;
    let part = weighted * b;
    for (v, p) in vector.iter_mut().zip(part) {
        *v += p;
    }
}

/// Least squares over all states at once is the joint posterior of a linear normal world. Its information matrix has
/// a condition number of about 1e4 here, so both sides are good to about 1e4 times a few eps: 1e-9 has room.
#[test]
fn smoothed_beliefs_are_marginals_of_the_joint_posterior() {
    let (motion, sensor) = (Glide(0.4), positions(0.7));
    let prior = Gaussian::independent([0.0, 1.0, 0.0, 0.0], [3.0, 1.0, 3.0, 1.0]).unwrap();
    let filter = Kalman::new(motion, sensor, prior).unwrap();
    let mut draws = Stream::new(5).draws(Purpose::Other, 0, 0);

    let (mut information, mut vector) = (Matrix::ZERO, [0.0; ALL]);
    let mut blocks = |j: Matrix<4, ALL>, b, c: &Matrix<4, 4>| add((&mut information, &mut vector), &j, b, c);
    let block =
        |k: usize, m: Matrix<4, 4>| Matrix::from_entries(|i, j| if j / 4 == k { m.0[i][j % 4] } else { 0.0 });
    blocks(block(0, Matrix::identity()), *prior.mean(), prior.covariance());

    // Instants with the number of measurements at each: none, one, or two at once.
    let instants: [(f64, usize); K] = [(0.0, 1), (0.3, 1), (2.0, 0), (2.1, 2), (4.5, 0), (5.0, 1)];
    for (k, pair) in instants.windows(2).enumerate() {
        let dt: f64 = pair[1].0 - pair[0].0;
        let f = [[1.0, dt], [0.0, 1.0]];
        let q = [[dt.powi(3) / 3.0, dt * dt / 2.0], [dt * dt / 2.0, dt]];
        let twice = |m: [[f64; 2]; 2]| {
            Matrix::from_entries(|i, j| if i / 2 == j / 2 { m[i % 2][j % 2] } else { 0.0 })
        };
        let transition = block(k + 1, Matrix::identity()) - block(k, twice(f));
        blocks(transition, [0.0; 4], &(twice(q) * 0.4));
    }

    let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let (mut filtered, mut of_instant) = (Vec::new(), Vec::new());
    for (k, (t, count)) in instants.into_iter().enumerate() {
        for visit in 0..count.max(1) {
            let z = (visit < count).then(|| [t + draws.normal(), draws.normal()]);
            filter.step(&mut belief, Time::from_secs(t), z.as_ref()).unwrap();
            filtered.push(belief);
            of_instant.push(k);
            if let Some(z) = z {
                let j = Matrix::from_entries(|i, j| if j / 4 == k { sensor.h.0[i][j % 4] } else { 0.0 });
                add((&mut information, &mut vector), &j, z, &sensor.r);
            }
        }
    }

    let factor = Cholesky::of("information", &information).unwrap();
    let (mean, covariance) = (factor.solve(&vector), factor.inverse());
    let smoothed = rauch_tung_striebel(&motion, &filtered).unwrap();
    // On a linear world all ways of a Gaussian through a motion are the same.
    let classical = SigmaPoints { alpha: 0.5, beta: 2.0, kappa: Some(0.0) };
    for found in [
        smoothed.clone(),
        smooth_gaussian(&Linear, &motion, &filtered).unwrap(),
        smooth_gaussian(&SigmaPoints::default(), &motion, &filtered).unwrap(),
        smooth_gaussian(&SigmaPoints::cubature(), &motion, &filtered).unwrap(),
        smooth_gaussian(&classical, &motion, &filtered).unwrap(),
    ] {
        assert_eq!(found.len(), filtered.len());
        for ((belief, before), &k) in found.iter().zip(&filtered).zip(&of_instant) {
            assert_eq!(belief.time, before.time);
            for i in 0..4 {
                assert!((belief.state.mean()[i] - mean[4 * k + i]).abs() < 1e-9);
                for j in 0..4 {
                    let expected = covariance.0[4 * k + i][4 * k + j];
                    assert!((belief.state.covariance().0[i][j] - expected).abs() < 1e-9, "{k} {i} {j}");
                }
            }
        }
    }
    // The test would see a smoother that does nothing.
    let gap = smoothed[0].state.mean()[0] - filtered[0].state.mean()[0];
    assert!(gap.abs() > 1e-3);
}

#[test]
fn borders() {
    let belief = |secs, variance| GaussianBelief {
        time: Time::from_secs(secs),
        state: Gaussian::new([0.0], Matrix([[variance]])).unwrap(),
    };
    assert_eq!(rauch_tung_striebel(&Level(1.0), &[]).unwrap(), []);
    assert_eq!(rauch_tung_striebel(&Level(1.0), &[belief(1.0, 2.0)]).unwrap(), [belief(1.0, 2.0)]);
    let backwards = rauch_tung_striebel(&Level(1.0), &[belief(1.0, 2.0), belief(0.0, 2.0)]);
    assert!(matches!(backwards, Err(Error::OutOfOrder { .. })));
    let singular = rauch_tung_striebel(&Level(0.0), &[belief(0.0, 0.0), belief(1.0, 0.0)]);
    assert!(matches!(singular, Err(Error::NotPositiveDefinite { .. })));
}

/// A level that does not move: each smoothed belief is the last filtered one.
#[test]
fn a_constant_has_one_smoothed_law() {
    let prior = Gaussian::new([0.0], Matrix([[4.0]])).unwrap();
    let filter = Kalman::new(Level(0.0), direct(1.0), prior).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let mut filtered = vec![belief];
    for k in 1..6 {
        filter.step(&mut belief, Time::from_secs(f64::from(k)), Some(&[f64::from(k % 3)])).unwrap();
        filtered.push(belief);
    }
    for smoothed in rauch_tung_striebel(&Level(0.0), &filtered).unwrap() {
        assert!((smoothed.state.mean()[0] - belief.state.mean()[0]).abs() < 1e-14);
        assert!((smoothed.state.covariance().0[0][0] - belief.state.covariance().0[0][0]).abs() < 1e-14);
    }
}

/// One step back through a motion that is linear neither in x nor in w, by the sums of Särkkä's algorithm
/// written out with the textbook's weights.
#[test]
fn the_unscented_smoother_is_its_textbook() {
    let at = |secs, mean, variance| GaussianBelief {
        time: Time::from_secs(secs),
        state: Gaussian::new([mean], Matrix([[variance]])).unwrap(),
    };
    let (now, after) = (at(0.0, 0.7, 0.3), at(0.5, 1.1, 0.2));
    for points in [SigmaPoints::default(), SigmaPoints::cubature()] {
        // Two variables: c = 2 for both, and the weights of the centre are 0 for the mean, beta for the
        // covariance.
        let f = |x: f64, w: f64| Wobble::apply(&0.5, [x], [w])[0];
        let (dx, dw) = (0.6f64.sqrt(), 2f64.sqrt());
        let (up, down) = (f(0.7 + dx, 0.0), f(0.7 - dx, 0.0));
        let images = [up, down, f(0.7, dw), f(0.7, -dw)];
        let mean = images.iter().sum::<f64>() / 4.0;
        let square = |y: f64| (y - mean) * (y - mean);
        let variance =
            images.iter().map(|&y| square(y)).sum::<f64>() / 4.0 + points.beta * square(f(0.7, 0.0));
        let gain = dx * (up - down) / 4.0 / variance;
        let expected = (0.7 + gain * (1.1 - mean), 0.3 + gain * gain * (0.2 - variance));

        let found = smooth_gaussian(&points, &Wobble, &[now, after]).unwrap();
        assert!((found[0].state.mean()[0] - expected.0).abs() < 1e-14, "{points:?}");
        assert!((found[0].state.covariance().0[0][0] - expected.1).abs() < 1e-14, "{points:?}");
        assert_eq!(found[1], after);
    }
}

/// A target that turns at an unknown rate, seen in position: filtered and smoothed by `transform`, over many
/// runs. At the middle step the normalised errors squared sum up to a chi-square number of 5 degrees of
/// freedom per run, within its 1e-6 quantiles and 5 % for the curvature, and smoothing makes the errors
/// smaller.
fn consistent<T: Transform, F>(
    transform: &T,
    filter: impl Fn(MarkovTurn, Position<2>, Gaussian<5>) -> Result<F>,
) where
    F: Filter<Measurement = [f64; 2], Belief = GaussianBelief<5>>,
{
    const RUNS: u32 = 150;
    let motion = MarkovTurn::new(0.5, 0.05, 20.0).unwrap();
    let sensor = Position::<2>::new(3.0).unwrap();
    let prior = Gaussian::independent([0.0, 0.0, 12.0, 0.0, 0.1], [5.0, 5.0, 2.0, 2.0, 0.1]).unwrap();
    let filter = filter(motion, sensor, prior).unwrap();
    let times: Vec<Time> = (0..21).map(|k| Time::from_secs(f64::from(k))).collect();
    let (mut nees, mut before, mut after) = (0.0, 0.0, 0.0);
    for run in 0..RUNS {
        let stream = Stream::new(61).fork(u64::from(run));
        let start = zerre::filter::Prior::columns(&prior, stream, 1).unwrap().map(|column| column[0]);
        let path = simulate::path(&motion, start, &times, stream).unwrap();
        let seen = simulate::measurements(&sensor, &path, &times, stream).unwrap();
        let mut belief = filter.start(Time::ZERO, stream).unwrap();
        let mut filtered = Vec::new();
        for (&to, z) in times.iter().zip(&seen) {
            filter.step(&mut belief, to, Some(z)).unwrap();
            filtered.push(belief);
        }
        let smoothed = smooth_gaussian(transform, &motion, &filtered).unwrap();
        for belief in &smoothed {
            assert!(Cholesky::of("P", belief.state.covariance()).is_ok());
        }
        let off = |law: &Gaussian<5>| (0..2).map(|i| (law.mean()[i] - path[10][i]).powi(2)).sum::<f64>();
        before += off(&filtered[10].state);
        after += off(&smoothed[10].state);
        nees += smoothed[10].state.mahalanobis_squared(&path[10]).unwrap();
    }
    let low = 0.95 * chi_square::quantile(5e-7, 5 * RUNS).unwrap();
    let high = 1.05 * chi_square::quantile(1.0 - 5e-7, 5 * RUNS).unwrap();
    assert!((low..=high).contains(&nees), "{nees} not in {low} to {high}");
    assert!(after < 0.8 * before, "{after} after, {before} before");
}

#[test]
fn smoothers_are_consistent_on_a_curved_world() {
    consistent(&Tangent, |motion, sensor, prior| Ok(Extended::new(motion, sensor, prior)));
    for points in [SigmaPoints::default(), SigmaPoints::cubature()] {
        consistent(&points, |motion, sensor, prior| Unscented::new(motion, sensor, prior, points));
    }
}
