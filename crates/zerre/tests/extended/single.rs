//! What the tests of the filters of one shape share.

use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;
use zerre::belief::Gaussian;

use zerre::filter::{Filter, Outcome};
use zerre::math::{Cholesky, Matrix};
use zerre::model::motion::ConstantVelocity;
use zerre::rng::{Draws, Purpose, Stream};
use zerre::{Error, Time};

pub type Motion = ConstantVelocity<2>;

pub fn motion(density: f64) -> Motion {
    Motion::new(density).unwrap()
}

pub fn draws(seed: u64) -> Draws {
    Stream::new(seed).draws(Purpose::Measurement, 0, 0)
}

pub fn at(k: usize) -> Time {
    Time::from_secs(k as f64)
}

/// A point from N(centre, covariance).
pub fn normal(d: &mut Draws, centre: [f64; 2], covariance: &Matrix<2, 2>) -> [f64; 2] {
    let lower = *Cholesky::of("covariance", covariance).unwrap().factor();
    let e = lower * [d.normal(), d.normal()];
    [centre[0] + e[0], centre[1] + e[1]]
}

/// A point spread evenly over the ellipse with sides R(angle) diag(a, b).
pub fn inside(d: &mut Draws, [angle, a, b]: [f64; 3]) -> [f64; 2] {
    let (r, u) = (d.uniform().sqrt(), std::f64::consts::TAU * d.uniform());
    let (x, y) = (a * r * u.cos(), b * r * u.sin());
    turn(angle) * [x, y]
}

pub fn turn(angle: f64) -> Matrix<2, 2> {
    let (s, c) = angle.sin_cos();
    Matrix([[c, -s], [s, c]])
}

/// The turn of a planar state.
pub fn turn_state(angle: f64) -> Matrix<4, 4> {
    let t = turn(angle).0;
    Matrix::from_entries(|i, j| if i / 2 == j / 2 { t[i % 2][j % 2] } else { 0.0 })
}

pub fn turned(law: &Gaussian<4>, angle: f64) -> Gaussian<4> {
    let t = turn_state(angle);
    Gaussian::new(t * *law.mean(), t.congruence(law.covariance())).unwrap()
}

pub fn turned_scans(scans: &[Vec<[f64; 2]>], angle: f64) -> Vec<Vec<[f64; 2]>> {
    scans.iter().map(|scan| scan.iter().map(|y| turn(angle) * *y).collect()).collect()
}

/// Largest difference relative to the largest entry.
pub fn apart<const R: usize, const C: usize>(a: &Matrix<R, C>, b: &Matrix<R, C>) -> f64 {
    (*a - *b).max_abs() / b.max_abs().max(f64::MIN_POSITIVE)
}

pub fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{a} {b}");
}

/// Scans at 1, 2, ... s; the belief after the last, and the sum of the evidence.
pub fn run<F: Filter<Measurement = Vec<[f64; 2]>>>(f: &F, scans: &[Vec<[f64; 2]>]) -> (F::Belief, f64) {
    let mut belief = f.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut sum = 0.0;
    for (k, scan) in scans.iter().enumerate() {
        sum += f.step(&mut belief, at(k + 1), Some(scan)).unwrap().log_evidence;
    }
    (belief, sum)
}

/// Mean of numbers and the standard error of that mean.
pub fn mean_and_error(x: &[f64]) -> (f64, f64) {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let square = x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0);
    (mean, (square / n).sqrt())
}

/// What every filter must bear: scans of all kinds about the start of the target, refusals that leave the belief
/// as it was, and a belief that goes through text bit by bit.
pub fn bears<F>(f: &F, sound: impl Fn(&F::Belief) -> bool)
where
    F: Filter<Measurement = Vec<[f64; 2]>>,
    F::Belief: Clone + Debug + PartialEq + Serialize + DeserializeOwned,
{
    let mut d = draws(5);
    let many: Vec<[f64; 2]> =
        (0..10_000).map(|_| normal(&mut d, [0.0; 2], &Matrix([[4.0, 1.0], [1.0, 2.0]]))).collect();
    let kinds: [(&str, Vec<[f64; 2]>); 7] = [
        ("empty", vec![]),
        ("one", vec![[1.0, 0.5]]),
        ("the centre", vec![[0.0, 0.0]]),
        ("many", many),
        ("identical", vec![[1.0, -1.0]; 50]),
        ("collinear", (0..50).map(|k| [0.1 * f64::from(k) - 2.5, 0.2 * f64::from(k) - 5.0]).collect()),
        ("far", vec![[300.0, -200.0], [301.0, -200.0]]),
    ];
    let first = f.start(Time::ZERO, Stream::new(1)).unwrap();
    for (name, scan) in &kinds {
        let mut belief = first.clone();
        let update = f.step(&mut belief, at(1), Some(scan)).unwrap();
        assert_eq!(update.outcome, Outcome::Updated, "{name}");
        assert!(update.log_evidence.is_finite() && sound(&belief), "{name}: {update:?} {belief:?}");
        assert_eq!(scan.is_empty(), update.log_evidence == 0.0, "{name}");
        // Scan upon scan of the same kind.
        for k in 2..20 {
            if *name != "many" {
                assert!(
                    f.step(&mut belief, at(k), Some(scan)).unwrap().log_evidence.is_finite(),
                    "{name} {k}"
                );
            }
        }
        assert!(sound(&belief), "{name}: {belief:?}");
        let text = serde_json::to_string(&belief).unwrap();
        let mut back: F::Belief = serde_json::from_str(&text).unwrap();
        assert_eq!(back, belief, "{name}");
        f.step(&mut back, at(30), Some(&kinds[1].1)).unwrap();
        f.step(&mut belief, at(30), Some(&kinds[1].1)).unwrap();
        assert_eq!(back, belief, "{name}");
    }

    let mut belief = first.clone();
    let update = f.step(&mut belief, at(1), None).unwrap();
    assert_eq!((update.outcome, update.log_evidence), (Outcome::Predicted, 0.0));
    let kept = belief.clone();
    let bad = [f64::NAN, f64::INFINITY].map(|x| vec![[0.0, 1.0], [x, 0.0]]);
    for scan in &bad {
        assert!(matches!(f.step(&mut belief, at(2), Some(scan)), Err(Error::NotFinite { .. })));
        assert_eq!(belief, kept);
    }
    let huge = vec![[1e200, 1e200], [-1e200, 0.0]];
    assert!(f.step(&mut belief, at(2), Some(&huge)).is_err());
    assert_eq!(belief, kept);
    assert!(matches!(f.step(&mut belief, at(0), Some(&vec![])), Err(Error::OutOfOrder { .. })));
    assert!(matches!(f.step(&mut belief, at(0), None), Err(Error::OutOfOrder { .. })));
    assert_eq!(belief, kept);
}
