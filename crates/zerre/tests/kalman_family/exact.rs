//! Exactness on linear normal worlds.

use crate::common::recording;
use crate::models::{Adrift, Glide, Growth, Level, direct, positions};
use zerre::Time;
use zerre::belief::{Gaussian, GaussianBelief};
use zerre::filter::{Extended, Filter, Kalman, Outcome, SigmaPoints, Unscented, Update, predict_measurement};
use zerre::math::{Cholesky, Matrix};
use zerre::rng::{Purpose, Stream};

/// One predict and update in numbers that binary holds exactly: P- = [[2, 1], [1, 1]] for x and vx, S = 4.
#[test]
fn a_step_by_hand() {
    let prior = Gaussian::new([0.0, 1.0, 0.0, 1.0], Matrix::identity()).unwrap();
    let mut sensor = positions(1.0);
    sensor.r = Matrix::identity() * 2.0;
    let filter = Kalman::new(Glide(0.0), sensor, prior).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let update = filter.step(&mut belief, Time::from_secs(1.0), Some(&[3.0, -1.0])).unwrap();
    assert_eq!(update.outcome, Outcome::Updated);
    // Gain (1/2, 1/4); innovations 2 and -2.
    for (found, expected) in belief.state.mean().iter().zip([2.0, 1.5, 0.0, 0.5]) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
    let p = belief.state.covariance();
    let expected = [[1.0, 0.5, 0.0, 0.0], [0.5, 0.75, 0.0, 0.0], [0.0, 0.0, 1.0, 0.5], [0.0, 0.0, 0.5, 0.75]];
    assert!((*p - Matrix(expected)).max_abs() < 1e-15);
    // Two densities N(2; 0, 4).
    let density = -0.5 * (4.0 / 4.0 + (std::f64::consts::TAU * 4.0).ln());
    assert!((update.log_evidence - 2.0 * density).abs() < 1e-14);
}

/// The local level model of the Nile's annual flow, Durbin and Koopman (2012), ch. 2, against an independent
/// implementation that printed 12 digits (relative error 5e-12; a hundred steps of rounding add about 1e-14).
#[test]
fn nile() {
    let folder = "smc_timeseries";
    let (Some(flows), Some(reference)) =
        (recording(&format!("{folder}/nile.csv")), recording(&format!("{folder}/reference_nile_kalman.csv")))
    else {
        return;
    };
    let rows = |path| -> Vec<Vec<String>> {
        let text = std::fs::read_to_string(path).unwrap();
        text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let (flows, reference) = (rows(flows), rows(reference));
    assert_eq!((flows.len(), reference.len()), (100, 100));

    let prior = Gaussian::new([0.0], Matrix([[1e7]])).unwrap();
    let filter = Kalman::new(Level(1469.1), direct(15099.0), prior).unwrap();
    let mut belief = filter.start(Time::from_secs(1.0), Stream::new(0)).unwrap();
    let mut total = 0.0;
    for (flow, row) in flows.iter().zip(&reference) {
        let number = |i: usize| row[i].parse::<f64>().unwrap();
        let z = [flow[1].parse::<f64>().unwrap()];
        let update = filter.step(&mut belief, Time::from_secs(number(0)), Some(&z)).unwrap();
        total += update.log_evidence;
        let found = [update.log_evidence, total, belief.state.mean()[0], belief.state.covariance().0[0][0]];
        for (i, found) in found.into_iter().enumerate() {
            let expected = number(i + 1);
            assert!((found - expected).abs() < 2e-11 * expected.abs(), "year {}: {found} {expected}", row[0]);
        }
    }
    assert!((total + 641.585_578).abs() < 1e-6);
}

/// A run of irregular steps, some without a measurement, some of no time.
fn run<F: Filter<Measurement = [f64; 2], Belief = GaussianBelief<4>>>(
    filter: &F,
) -> Vec<(GaussianBelief<4>, Update)> {
    let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
    let mut now = 0.0;
    (0..300)
        .map(|k| {
            now += if k % 7 == 3 { 0.0 } else { 2.0 * draws.uniform() };
            let z = [0.5 * now + draws.normal(), 3.0 - 0.2 * now + draws.normal()];
            let update = filter.step(&mut belief, Time::from_secs(now), (k % 5 != 4).then_some(&z)).unwrap();
            (belief, update)
        })
        .collect()
}

fn prior() -> Gaussian<4> {
    Gaussian::independent([1.0, 0.5, 2.0, -0.2], [5.0, 1.0, 5.0, 1.0]).unwrap()
}

/// Tangents of linear functions are the functions, so the extended filter runs the Kalman filter's arithmetic.
#[test]
fn extended_is_kalman_on_linear_models() {
    let kalman = run(&Kalman::new(Glide(0.1), positions(1.0), prior()).unwrap());
    assert_eq!(kalman, run(&Extended::new(Glide(0.1), positions(1.0), prior())));
}

/// Sigma points differ from the mean by about a standard deviation (1 here) where the mean is up to 150, so images
/// are rounded at 150 eps = 3e-14 of a deviation; the filter forgets its errors within some ten steps, which
/// leaves below 1e-12 of the standard deviations. 1e-9 has room and is far below any real difference.
#[test]
fn unscented_is_kalman_on_linear_models() {
    let kalman = run(&Kalman::new(Glide(0.1), positions(1.0), prior()).unwrap());
    let classical = SigmaPoints { alpha: 0.5, beta: 2.0, kappa: Some(0.0) };
    for points in [SigmaPoints::default(), classical] {
        let unscented = run(&Unscented::new(Glide(0.1), positions(1.0), prior(), points).unwrap());
        for ((a, update_a), (b, update_b)) in kalman.iter().zip(&unscented) {
            assert_eq!((a.time, update_a.outcome), (b.time, update_b.outcome));
            let (p, q) = (a.state.covariance(), b.state.covariance());
            let sd = p.diagonal().map(f64::sqrt);
            for i in 0..4 {
                assert!((a.state.mean()[i] - b.state.mean()[i]).abs() < 1e-9 * sd[i]);
                for j in 0..4 {
                    assert!((p.0[i][j] - q.0[i][j]).abs() < 1e-9 * sd[i] * sd[j]);
                }
            }
            assert!(
                (update_a.log_evidence - update_b.log_evidence).abs()
                    < 1e-9 * (1.0 + update_a.log_evidence.abs())
            );
        }
    }
}

/// Evidence by the chain rule is the joint density of all measurements: two of them, by a bivariate normal.
#[test]
fn evidence_is_the_joint_density() {
    let prior = Gaussian::new([1.0], Matrix([[2.0]])).unwrap();
    let filter = Kalman::new(Level(0.5), direct(1.0), prior).unwrap();
    let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let one = filter.step(&mut belief, Time::ZERO, Some(&[2.0])).unwrap();
    let two = filter.step(&mut belief, Time::from_secs(2.0), Some(&[-1.0])).unwrap();
    let joint = Gaussian::new([1.0, 1.0], Matrix([[3.0, 2.0], [2.0, 4.0]])).unwrap();
    let expected = joint.log_density(&[2.0, -1.0]).unwrap();
    assert!((one.log_evidence + two.log_evidence - expected).abs() < 1e-14);
}

/// Mean and variance of gamma noise are its shape.
#[test]
fn noise_that_is_not_centred() {
    let prior = Gaussian::new([10.0], Matrix([[4.0]])).unwrap();
    let law = Growth { shape: 3.0 };
    let (from, to) = (Time::ZERO, Time::from_secs(2.0));
    let extended = Extended::new(law, direct(1.0), prior).predict(&prior, from, to).unwrap();
    let unscented = Unscented::new(law, direct(1.0), prior, SigmaPoints::default())
        .unwrap()
        .predict(&prior, from, to)
        .unwrap();
    for found in [extended, unscented] {
        assert!((found.mean()[0] - 16.0).abs() < 1e-13 && (found.covariance().0[0][0] - 16.0).abs() < 1e-13);
    }
}

/// The measurement is predicted for the time of the step: 5 + 3 s is just what is seen, so the mean stays.
#[test]
fn sensors_may_depend_on_time() {
    let prior = Gaussian::new([5.0], Matrix([[4.0]])).unwrap();
    let at = Time::from_secs(3.0);
    let unscented = Unscented::new(Level(1.0), Adrift, prior, SigmaPoints::default()).unwrap();
    for (posterior, _) in [
        Kalman::new(Level(1.0), Adrift, prior).unwrap().update(&prior, &[8.0], at).unwrap(),
        Extended::new(Level(1.0), Adrift, prior).update(&prior, &[8.0], at).unwrap(),
        unscented.update(&prior, &[8.0], at).unwrap(),
    ] {
        assert!((posterior.mean()[0] - 5.0).abs() < 1e-14);
    }
    let foretold = predict_measurement(&Level(1.0), &Adrift, &prior, Time::ZERO, at).unwrap();
    assert!((foretold.mean[0] - 8.0).abs() < 1e-14 && (foretold.covariance.0[0][0] - 8.0).abs() < 1e-13);
}

/// Ten thousand sharp measurements: covariances stay exactly symmetric and positive definite.
#[test]
fn joseph_form_survives_tiny_noise() {
    let sensor = positions(1e-7);
    let wide = Gaussian::independent([0.0; 4], [1e4, 1e3, 1e4, 1e3]).unwrap();
    fn survive<F: Filter<Measurement = [f64; 2], Belief = GaussianBelief<4>>>(filter: &F) {
        let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
        for k in 1..=10_000 {
            let t = f64::from(k) * 0.01;
            let z = [t.sin(), t.cos()];
            let update = filter.step(&mut belief, Time::from_secs(t), Some(&z)).unwrap();
            assert_eq!(update.outcome, Outcome::Updated, "step {k}");
            let p = belief.state.covariance();
            assert_eq!(*p, p.transpose());
            assert!(Cholesky::of("P", p).is_ok(), "step {k}: {p:?}");
        }
    }
    survive(&Kalman::new(Glide(1e-3), sensor, wide).unwrap());
    survive(&Unscented::new(Glide(1e-3), sensor, wide, SigmaPoints::default()).unwrap());
}

/// The short form (I - K H) P, which the test above is there to keep out, loses everything in one step.
#[test]
fn the_short_form_does_not() {
    let (p, r) = (1e8, 1e-9);
    let gain = p / (p + r);
    assert!(Cholesky::of("P", &Matrix([[(1.0 - gain) * p]])).is_err());
    let prior = Gaussian::new([0.0], Matrix([[p]])).unwrap();
    let filter = Kalman::new(Level(1.0), direct(r), prior).unwrap();
    let (posterior, _) = filter.update(&prior, &[1.0], Time::ZERO).unwrap();
    assert!((posterior.covariance().0[0][0] / r - 1.0).abs() < 1e-15);
}

/// Innovations of any belief by one rule; on a linear world it is the filter's own.
#[test]
fn predicted_measurements() {
    let prior = prior();
    let filter = Kalman::new(Glide(0.1), positions(1.0), prior).unwrap();
    let (from, to) = (Time::ZERO, Time::from_secs(2.0));
    let state = filter.predict(&prior, from, to).unwrap();
    let foretold = predict_measurement(&Glide(0.1), &positions(1.0), &prior, from, to).unwrap();
    let s = positions(1.0).h.congruence(state.covariance()) + positions(1.0).r;
    assert!((foretold.covariance - s).max_abs() < 1e-12);
    let z = [2.0, 5.0];
    let nu = [z[0] - state.mean()[0], z[1] - state.mean()[2]];
    let nis = Cholesky::of("S", &s).unwrap().mahalanobis_squared(&nu);
    assert!((foretold.nis(&z).unwrap() - nis).abs() < 1e-12);
    assert!(foretold.nis(&[f64::NAN, 0.0]).is_err());
    assert!(predict_measurement(&Glide(0.1), &positions(1.0), &prior, to, from).is_err());
}
