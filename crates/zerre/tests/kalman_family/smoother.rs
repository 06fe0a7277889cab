//! The smoother against the joint law of all states, solved at once.

use crate::models::{Glide, Level, direct, positions};
use zerre::belief::{Gaussian, GaussianBelief};
use zerre::filter::{Filter, Kalman};
use zerre::math::{Cholesky, Matrix};
use zerre::rng::{Purpose, Stream};
use zerre::smooth::rauch_tung_striebel;
use zerre::{Error, Time};

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
    assert_eq!(smoothed.len(), filtered.len());
    for ((belief, before), k) in smoothed.iter().zip(&filtered).zip(of_instant) {
        assert_eq!(belief.time, before.time);
        for i in 0..4 {
            assert!((belief.state.mean()[i] - mean[4 * k + i]).abs() < 1e-9);
            for j in 0..4 {
                let expected = covariance.0[4 * k + i][4 * k + j];
                assert!((belief.state.covariance().0[i][j] - expected).abs() < 1e-9, "{k} {i} {j}");
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
