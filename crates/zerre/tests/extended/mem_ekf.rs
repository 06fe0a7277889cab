//! MEM-EKF*.

use crate::single::*;
use zerre::Time;
use zerre::belief::Gaussian;
use zerre::extended::centre::FirstTwo;
use zerre::extended::inverse_wishart::InverseWishart;
use zerre::extended::mem_ekf::{MemEkf, MemSettings};
use zerre::extended::random_matrix::{RandomMatrix, RandomMatrixSettings, Rule};
use zerre::math::Matrix;
use zerre::rng::Draws;

type Mem = MemEkf<Motion, FirstTwo, 4, 4>;

const TRUTH: [f64; 3] = [0.5, 4.0, 1.5];
const NOISE: Matrix<2, 2> = Matrix([[0.04, 0.01], [0.01, 0.02]]);

fn filter(axes: [f64; 3], sd: [f64; 3], settings: MemSettings) -> Mem {
    let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [1.0, 1.0, 0.3, 0.3]).unwrap();
    MemEkf::new(motion(0.0), FirstTwo, prior, Gaussian::independent(axes, sd).unwrap(), settings).unwrap()
}

/// Points of the true ellipse on the path that the motion starts with, spread evenly or normal.
fn scans(d: &mut Draws, scans: usize, count: usize, even: bool) -> Vec<Vec<[f64; 2]>> {
    let sides = turn(TRUTH[0]) * Matrix::from_diagonal([TRUTH[1], TRUTH[2]]);
    let scan = |k: usize, d: &mut Draws| {
        let t = (k + 1) as f64;
        let point = |d: &mut Draws| {
            let e = if even { inside(d, TRUTH) } else { sides * [d.normal(), d.normal()] };
            normal(d, [t + e[0], e[1] - 2.0 * t], &NOISE)
        };
        (0..count).map(|_| point(d)).collect()
    };
    (0..scans).map(|k| scan(k, d)).collect()
}

/// With a shape that is known it is a Kalman filter for points with noise S S' c + R, and so is a random matrix with
/// as good as infinitely many degrees of freedom: its evidence then lacks terms of (35 points)^2 / 1e12.
#[test]
fn known_shape_is_the_kalman_filter() {
    let data = scans(&mut draws(1), 5, 7, true);
    let f = filter(TRUTH, [0.0; 3], MemSettings { noise: NOISE, ..MemSettings::default() });
    let (belief, evidence) = run(&f, &data);
    let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [1.0, 1.0, 0.3, 0.3]).unwrap();
    let sides = turn(TRUTH[0]) * Matrix::from_diagonal([TRUTH[1], TRUTH[2]]);
    let extent = InverseWishart::new(sides.congruence(&Matrix::identity()), 1e12).unwrap();
    let settings = RandomMatrixSettings {
        rule: Rule::Feldmann { noise: NOISE },
        scaling: 0.25,
        ..RandomMatrixSettings::default()
    };
    let other = RandomMatrix::new(motion(0.0), FirstTwo, prior, extent, settings).unwrap();
    let (same, known) = run(&other, &data);
    assert!(apart(belief.state.covariance(), same.state.covariance()) < 1e-9);
    for (a, b) in belief.state.mean().iter().zip(same.state.mean()) {
        close(*a, *b, 1e-9);
    }
    // ln Gamma of 5e11 carries an error of its own of 1e-3.
    close(evidence, known, 1e-3);
    assert_eq!(belief.axes.mean(), &TRUTH);
}

/// Over 30 seeds the errors have no mean beyond four standard errors, and the root mean square that the maximum
/// likelihood of n = 1000 points would have. From normal points that is l / sqrt(2 n) for a semi-axis, and
/// l1 l2 / (l1^2 - l2^2) / sqrt(n) for the orientation; points spread evenly over the ellipse have 1/2 of the
/// variance of the squares, and 2/3 of that of the product. Four standard deviations of a root mean square of 30 are
/// 4 / sqrt(60) = .52 of it.
#[test]
fn finds_the_ellipse() {
    let [_, a, b] = TRUTH;
    let least = [a * b / (a * a - b * b) / 1000f64.sqrt(), a / 2000f64.sqrt(), b / 2000f64.sqrt()];
    for (even, multiplicative, shares) in [(true, 0.25, [2.0 / 3.0, 0.5, 0.5]), (false, 1.0, [1.0; 3])] {
        let settings = MemSettings { multiplicative, noise: NOISE, ..MemSettings::default() };
        let f = filter([0.2, 3.0, 2.5], [0.5, 1.0, 1.0], settings);
        let mut errors = [const { Vec::new() }; 3];
        for seed in 0..30 {
            let (b, _) = run(&f, &scans(&mut draws(200 + seed), 100, 10, even));
            for (k, x) in [b.orientation(), b.semi_axes()[0], b.semi_axes()[1]].into_iter().enumerate() {
                errors[k].push(x - TRUTH[k]);
            }
        }
        for k in 0..3 {
            let (mean, error) = mean_and_error(&errors[k]);
            let square = errors[k].iter().map(|x| x * x).sum::<f64>() / 30.0;
            assert!(mean.abs() < 4.0 * error, "{even} {k}: {mean} {error}");
            assert!(square.sqrt() < 1.52 * least[k] * f64::sqrt(shares[k]), "{even} {k}: {square}");
        }
    }
}

/// Nothing depends on the axes: rounding alone, amplified by some hundred operations.
#[test]
fn a_turn_of_the_plane_turns_the_answer() {
    let data = scans(&mut draws(3), 10, 6, true);
    let angle = 0.7;
    let with = |angle: f64| {
        let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [1.0, 1.0, 0.3, 0.3]).unwrap();
        let axes = Gaussian::independent([0.2 + angle, 3.0, 2.0], [0.5, 1.0, 1.0]).unwrap();
        let noise = turn(angle).congruence(&NOISE);
        let settings = MemSettings { noise, wander: [0.1, 0.2, 0.3], ..MemSettings::default() };
        MemEkf::new(motion(0.1), FirstTwo, turned(&prior, angle), axes, settings).unwrap()
    };
    let (a, evidence) = run(&with(0.0), &data);
    let (b, same) = run(&with(angle), &turned_scans(&data, angle));
    close(same, evidence, 1e-10);
    close(b.axes.mean()[0] - angle, a.axes.mean()[0], 1e-10);
    close(b.axes.mean()[1], a.axes.mean()[1], 1e-10);
    close(b.axes.mean()[2], a.axes.mean()[2], 1e-10);
    assert!(apart(b.axes.covariance(), a.axes.covariance()) < 1e-10);
    assert!(apart(b.state.covariance(), turned(&a.state, angle).covariance()) < 1e-10);
    let extents = [&a, &b].map(|x| x.shape().unwrap().ellipses()[0].extent);
    assert!(apart(&extents[1], &turn(angle).congruence(&extents[0])) < 1e-10);
}

/// The density of one point is normal: the plane's sum is exact to 1e-9 at six standard deviations and more.
#[test]
fn evidence_is_a_density() {
    use zerre::filter::Filter;
    use zerre::rng::Stream;
    let f = filter([0.2, 3.0, 2.0], [0.5, 1.0, 1.0], MemSettings { noise: NOISE, ..MemSettings::default() });
    let ahead = f.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut sum = 0.0;
    for i in -60..=60 {
        for j in -60..=60 {
            let y = vec![[0.25 * f64::from(i), 0.25 * f64::from(j)]];
            sum += f.step(&mut ahead.clone(), Time::ZERO, Some(&y)).unwrap().log_evidence.exp();
        }
    }
    close(sum / 16.0, 1.0, 1e-8);
}

#[test]
fn bears_all_scans() {
    for settings in [
        MemSettings::default(),
        MemSettings { multiplicative: 1.0, noise: NOISE, wander: [0.1; 3], ..MemSettings::default() },
    ] {
        for axes in [[0.2, 3.0, 2.0], [0.0, 2.0, 2.0]] {
            bears(&filter(axes, [0.5, 1.0, 1.0], settings), |b| {
                let upright = std::f64::consts::FRAC_PI_2;
                b.shape().is_ok()
                    && b.orientation().abs() <= upright
                    && b.semi_axes().iter().all(|l| *l > 0.0)
            });
        }
    }
}

#[test]
fn refusals() {
    let new = |axes, settings| {
        let prior = Gaussian::independent([0.0; 4], [1.0; 4]).unwrap();
        let axes = Gaussian::independent(axes, [0.1; 3]).unwrap();
        MemEkf::<_, _, 4, 4>::new(motion(1.0), FirstTwo, prior, axes, settings).map(|_| ())
    };
    let good = MemSettings::default();
    assert!(new(TRUTH, good).is_ok());
    assert!(new([0.0, 0.0, 1.0], good).is_err() && new([0.0, 1.0, -1.0], good).is_err());
    for bad in [0.0, -1.0, f64::NAN] {
        assert!(new(TRUTH, MemSettings { multiplicative: bad, ..good }).is_err());
        assert!(new(TRUTH, MemSettings { floor: bad, ..good }).is_err());
    }
    assert!(new(TRUTH, MemSettings { wander: [0.0, -1.0, 0.0], ..good }).is_err());
    assert!(new(TRUTH, MemSettings { noise: Matrix([[0.0, 1.0], [1.0, 0.0]]), ..good }).is_err());
}
