//! Prior laws.

use zerre::parameter::{Law, Parameters, maximum_likelihood};
use zerre::rng::{Purpose, Stream};

pub fn laws() -> [Law; 7] {
    [
        Law::Normal { mean: 1.0, sd: 2.0 },
        Law::LogNormal { median: 3.0, sd: 0.5 },
        Law::Uniform { low: -1.0, high: 4.0 },
        Law::Gamma { shape: 2.5, scale: 0.7 },
        Law::InverseGamma { shape: 4.0, scale: 3.0 },
        Law::Beta { alpha: 2.5, beta: 4.0 },
        Law::Beta { alpha: 1.0, beta: 3.0 },
    ]
}

/// Densities have the moments of the draws: mean and mean square of 100 000 within five standard errors of
/// what a sum over the density gives, and the density sums up to 1.
#[test]
fn densities_are_those_of_the_draws() {
    for law in laws() {
        let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
        let drawn: Vec<f64> = (0..100_000).map(|_| law.draw(&mut draws)).collect();
        // Of bounded functions all moments exist.
        let step = 0.002;
        let nodes: Vec<f64> = (-15_000..30_000).map(|i| (f64::from(i) + 0.5) * step).collect();
        let sum = |f: &dyn Fn(f64) -> f64| {
            nodes.iter().map(|&x| f(x) * law.log_density(x).exp() * step).sum::<f64>()
        };
        assert!((sum(&|_| 1.0) - 1.0).abs() < 1e-3, "{law:?}: {}", sum(&|_| 1.0));
        for f in [|x: f64| (x / 2.0).tanh(), |x: f64| 1.0 / (1.0 + x * x)] {
            let mean = drawn.iter().map(|&x| f(x)).sum::<f64>() / 1e5;
            let square = drawn.iter().map(|&x| (f(x) - mean).powi(2)).sum::<f64>() / 1e5;
            // 1e-4 for the tails beyond 60.
            assert!((mean - sum(&f)).abs() < 5.0 * (square / 1e5).sqrt() + 1e-4, "{law:?}");
        }
    }
}

/// Over the log-odds u the density is x (1 - x) p(x), smooth for all shapes: the midpoint rule is exact to
/// rounding. Mean and variance of 100 000 draws within five standard errors of the textbook's; shapes near
/// zero have draws at the borders.
#[test]
fn beta_has_the_moments_of_the_textbook() {
    for (alpha, beta) in [(2.5f64, 4.0f64), (0.2, 0.3), (40.0, 1.0), (0.02, 0.01)] {
        let law = Law::Beta { alpha, beta };
        if alpha.min(beta) > 0.1 {
            // Beyond |u| = 35 the number 1 - x has too few digits; e^(-0.2 * 35) = 1e-3 of the mass is there.
            let node = |i: i32| {
                let u = 0.01 * (f64::from(i) + 0.5);
                let x = 1.0 / (1.0 + (-u).exp());
                0.01 * (law.log_density(x) - u - 2.0 * (-u).exp().ln_1p()).exp()
            };
            let mass: f64 = (-3500..3500).map(node).sum();
            assert!((mass - 1.0).abs() < if beta < 1.0 { 1e-2 } else { 1e-12 }, "{law:?}: {mass}");
        }
        let mut draws = Stream::new(8).draws(Purpose::Other, 0, 0);
        let drawn: Vec<f64> = (0..100_000).map(|_| law.draw(&mut draws)).collect();
        assert!(drawn.iter().all(|x| (0.0..=1.0).contains(x)));
        let (sum, mean) = (alpha + beta, alpha / (alpha + beta));
        let variance = alpha * beta / (sum * sum * (sum + 1.0));
        let moments = |power: i32| {
            let terms = drawn.iter().map(|x| (x - mean).powi(power));
            let m = terms.clone().sum::<f64>() / 1e5;
            (m, (terms.map(|t| (t - m).powi(2)).sum::<f64>() / 1e5 / 1e5).sqrt())
        };
        for (power, expected) in [(1, 0.0), (2, variance)] {
            let (found, error) = moments(power);
            assert!((found - expected).abs() < 5.0 * error, "{law:?} {power}: {found} {expected} {error}");
        }
    }
}

#[test]
fn what_is_no_prior_is_refused() {
    for law in [
        Law::Normal { mean: 0.0, sd: 0.0 },
        Law::LogNormal { median: -1.0, sd: 1.0 },
        Law::Uniform { low: 1.0, high: 1.0 },
        Law::Gamma { shape: f64::NAN, scale: 1.0 },
        Law::InverseGamma { shape: 1.0, scale: -1.0 },
        Law::Beta { alpha: 1.0, beta: 0.0 },
    ] {
        assert!(Parameters::new([("x", law)]).is_err(), "{law:?}");
    }
    let fine = Law::Normal { mean: 0.0, sd: 1.0 };
    assert!(Parameters::new([("x", fine), ("x", fine)]).is_err());
    assert!(Parameters::<0>::new([]).is_err());
    let uniform = Parameters::new([("x", Law::Uniform { low: 0.0, high: 1.0 })]).unwrap();
    let at = |x| maximum_likelihood(&uniform, [x], Stream::new(0), |&[x], _| Ok(-(x - 0.25) * (x - 0.25)));
    assert!(at(0.0).is_err() && at(1.5).is_err());
    assert!((at(0.9).unwrap().theta[0] - 0.25).abs() < 1e-4);
    assert_eq!(uniform.list()[0].name, "x");
}
