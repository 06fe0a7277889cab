//! Models of time series, against what defines them.

use crate::matrices::linear;
use crate::seconds;
use zerre::math::Real;
use zerre::model::measurement::{BinomialLogit, StochasticVolatility};
use zerre::model::motion::{Autoregressive, DiscreteVelocity};
use zerre::model::{Measurement, Motion};
use zerre::{Error, Time};

fn log_likelihood<H: Measurement<1, Value = [f64; 1]>>(sensor: &H, z: f64, x: f64) -> f64 {
    H::log_likelihood(&sensor.given(&[z], Time::ZERO).unwrap(), [x])
}

#[test]
fn an_autoregression_keeps_its_stationary_law() {
    let motion = Autoregressive::new(-1.02, 0.9702, 0.178).unwrap();
    let law = motion.stationary().unwrap();
    let (f, q) = linear(&motion, Time::ZERO, seconds(1.0));
    let p = law.covariance().0[0][0];
    assert!((f[0][0] * p * f[0][0] + q[0][0] - p).abs() < 1e-15);
    let step = motion.over(Time::ZERO, seconds(1.0)).unwrap();
    assert_eq!(Autoregressive::apply(&step, [-1.02], [0.0]), [-1.02]);
    assert!((Autoregressive::apply(&step, [0.98], [2.0])[0] - (-1.02 + 2.0 * 0.9702 + 0.356)).abs() < 1e-15);
    // One application, however long the step.
    assert_eq!(linear(&motion, Time::ZERO, seconds(9.0)), (f, q));
    assert!(Autoregressive::new(0.0, 1.0, 1.0).unwrap().stationary().is_err());
    assert!(Autoregressive::new(f64::NAN, 0.5, 1.0).is_err() && Autoregressive::new(0.0, 0.5, -1.0).is_err());
}

#[test]
fn an_acceleration_constant_over_a_step_is_the_textbooks() {
    let (sd, t) = (0.3, 2.0);
    let (f, q) = linear(&DiscreteVelocity::<2>::new(sd).unwrap(), seconds(1.0), seconds(3.0));
    for i in 0..4 {
        for j in 0..4 {
            let same = i % 2 == j % 2;
            let expected = [[1.0, t], [0.0, 1.0]][i / 2][j / 2];
            assert_eq!(f[i][j], if same { expected } else { 0.0 });
            let g = [t * t / 2.0, t];
            let expected = if same { sd * sd * g[i / 2] * g[j / 2] } else { 0.0 };
            assert!((q[i][j] - expected).abs() < 1e-15);
        }
    }
    assert!(DiscreteVelocity::<1>::new(-1.0).is_err());
}

/// N(0, e^x) at a return, and its integral over returns by the midpoint rule, exact to rounding on a smooth
/// density sampled to 12 standard deviations.
#[test]
fn returns_have_the_variance_of_the_state() {
    let x = -1.3f64;
    let expected = -0.5 * (std::f64::consts::TAU.ln() + x + 0.49 / x.exp());
    assert!((log_likelihood(&StochasticVolatility, 0.7, x) - expected).abs() < 1e-14);
    let h = 0.1 * (0.5 * x).exp();
    let mass: f64 =
        (-120..=120).map(|i| h * Real::exp(log_likelihood(&StochasticVolatility, h * f64::from(i), x))).sum();
    assert!((mass - 1.0).abs() < 1e-13);
    assert!(Measurement::<1>::given(&StochasticVolatility, &[f64::NAN], Time::ZERO).is_err());
}

/// All counts together have probability one, and the mean of a binomial law.
#[test]
fn counts_follow_the_log_odds() {
    let sensor = BinomialLogit::new(50).unwrap();
    for x in [-30.0, -2.5, 0.0, 0.4, 700.0f64] {
        let probability = |z: u32| Real::exp(log_likelihood(&sensor, f64::from(z), x));
        let sum: f64 = (0..=50).map(probability).sum();
        let mean: f64 = (0..=50).map(|z| f64::from(z) * probability(z)).sum();
        // ln Gamma is good to 1e-14 of up to 150.
        assert!((sum - 1.0).abs() < 1e-11, "{x}: {sum}");
        assert!((mean - 50.0 / (1.0 + (-x).exp())).abs() < 1e-9, "{x}: {mean}");
    }
    // Two of three at even odds: 3 / 8.
    let three = BinomialLogit::new(3).unwrap();
    assert!((log_likelihood(&three, 2.0, 0.0) - 0.375f64.ln()).abs() < 1e-14);
    for bad in [-1.0, 51.0, 0.5, f64::NAN, f64::INFINITY] {
        assert!(Measurement::<1>::given(&sensor, &[bad], Time::ZERO).is_err());
    }
    assert!(matches!(BinomialLogit::new(0), Err(Error::OutOfRange { .. })));
}
