//! Smoothers on a linear world, against the exact one.

mod laws;
mod list;
mod paths;

use zerre::Time;
use zerre::belief::{Gaussian, GaussianBelief};
use zerre::filter::{Filter, Kalman};
use zerre::math::{Cholesky, Matrix};
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::rng::Stream;

const DENSITY: f64 = 0.4;
/// When, and what is measured then.
type Seen = (f64, Option<f64>);

/// Instants with their measurements: missing ones, two at once, uneven steps.
const DATA: [Seen; 10] = [
    (0.0, Some(0.3)),
    (0.7, Some(1.9)),
    (1.0, None),
    (2.2, Some(2.4)),
    (2.2, Some(3.6)),
    (3.0, Some(2.9)),
    (4.1, None),
    (5.0, Some(6.1)),
    (5.6, Some(7.4)),
    (6.0, Some(6.8)),
];
const LAST: usize = DATA.len() - 1;

fn prior() -> Gaussian<2> {
    Gaussian::independent([0.0, 1.0], [1.0, 0.8]).unwrap()
}

fn motion() -> ConstantVelocity<1> {
    ConstantVelocity::new(DENSITY).unwrap()
}

fn sensor() -> Position<1> {
    Position::new(0.8).unwrap()
}

/// The beliefs of a filter after each step of `data`. A measurement that is no number is refused and leaves
/// nothing behind.
fn follow<F: Filter<Measurement = [f64; 1]>>(
    filter: &F,
    data: &[Seen],
    seed: u64,
    mut each: impl FnMut(&F::Belief),
) {
    let mut belief = filter.start(Time::ZERO, Stream::new(seed)).unwrap();
    for &(t, z) in data {
        let stepped = filter.step(&mut belief, Time::from_secs(t), z.map(|z| [z]).as_ref());
        assert_eq!(stepped.is_err(), z.is_some_and(f64::is_nan));
        if stepped.is_ok() {
            each(&belief);
        }
    }
}

fn exact(data: &[Seen]) -> Vec<GaussianBelief<2>> {
    let kalman = Kalman::new(motion(), sensor(), prior()).unwrap();
    let mut filtered = Vec::new();
    follow(&kalman, data, 0, |belief| filtered.push(*belief));
    filtered
}

/// F and Q of a step.
fn textbook(t: f64) -> (Matrix<2, 2>, Matrix<2, 2>) {
    let q = Matrix([[t * t * t / 3.0, t * t / 2.0], [t * t / 2.0, t]]) * DENSITY;
    (Matrix([[1.0, t], [0.0, 1.0]]), q)
}

/// Cov[x_k, x_{k+1} | all]: G P_s' with the gain G = P F' (F P F' + Q)^-1.
fn lag_one(filtered: &GaussianBelief<2>, after: &GaussianBelief<2>) -> Matrix<2, 2> {
    let dt = (after.time - filtered.time).secs();
    if dt == 0.0 {
        return *after.state.covariance();
    }
    let (f, q) = textbook(dt);
    let p = filtered.state.covariance();
    let predicted = Cholesky::of("P", &(f.congruence(p) + q)).unwrap();
    predicted.solve_matrix(&(f * *p)).transpose() * *after.state.covariance()
}
