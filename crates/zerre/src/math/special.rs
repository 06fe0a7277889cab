//! Functions that lose their digits, or their domain, when written out: small arguments go through series.

use super::real::Real;

/// sin(x) / x, and 1 at 0, for every kind of number. Relative error below 1e-15 away from the zeros.
#[inline(always)]
pub fn sinc<R: Real>(x: R) -> R {
    let z = x * x;
    // The next term of the series is below 1e-17 at the border.
    let series = z.mul_add(z.constant(-1.0 / 5040.0), z.constant(1.0 / 120.0));
    let series = series.mul_add(z, z.constant(-1.0 / 6.0)).mul_add(z, z.constant(1.0));
    let border = z.constant(1e-3);
    let quotient = x.sin_cos().0 / z.if_lt(border, z.constant(1.0), x);
    z.if_lt(border, series, quotient)
}

/// (1 - e^-x) / x, and 1 at 0, for x >= 0: the share of a decay that its time average keeps.
pub fn decay_average(x: f64) -> f64 {
    if x < 1.0 { alternating_tail(x, 1) } else { (1.0 - Real::exp(-x)) / x }
}

/// (x - 1 + e^-x) / x^2, and 1/2 at 0, for x >= 0: the average of the averages before.
pub fn decay_second_average(x: f64) -> f64 {
    if x < 1.0 { alternating_tail(x, 2) } else { (x - 1.0 + Real::exp(-x)) / (x * x) }
}

/// (x - sin x) / x^3, and 1/6 at 0.
pub fn sine_defect(x: f64) -> f64 {
    if x.abs() < 1.0 {
        let (mut term, mut sum) = (1.0 / 6.0, 0.0);
        // Ten terms: x^20 / 23! is below 1e-22.
        for n in 0..10 {
            sum += term;
            term *= -x * x / f64::from((2 * n + 4) * (2 * n + 5));
        }
        sum
    } else {
        (x - Real::sin_cos(x).0) / (x * x * x)
    }
}

/// sum over n >= 0 of (-x)^n / (n + first)!, for 0 <= x < 1 and `first` 1 or 2.
fn alternating_tail(x: f64, first: i32) -> f64 {
    let (mut term, mut sum) = (1.0 / f64::from(first), 0.0);
    // Twenty terms: 1 / 21! is below 1e-19.
    for n in 0..20 {
        sum += term;
        term *= -x / f64::from(n + first + 1);
    }
    sum
}

/// ln Gamma(x) for x > 0; NaN otherwise. Relative error below 1e-14 except close to the zeros at 1 and 2, where
/// the absolute error is below 1e-14.
pub fn ln_gamma(x: f64) -> f64 {
    if x.is_nan() || x <= 0.0 {
        return f64::NAN;
    }
    // Stirling's series (Abramowitz and Stegun 6.1.41) from 10 up, below by the recurrence Gamma(x + 1) = x Gamma(x).
    let (mut x, mut product) = (x, 1.0);
    while x < 10.0 {
        product *= x;
        x += 1.0;
    }
    let z = 1.0 / (x * x);
    const SERIES: [f64; 7] = [
        1.0 / 12.0,
        -1.0 / 360.0,
        1.0 / 1260.0,
        -1.0 / 1680.0,
        1.0 / 1188.0,
        -691.0 / 360_360.0,
        1.0 / 156.0,
    ];
    let tail = SERIES.iter().rev().fold(0.0, |sum, &c| sum * z + c) / x;
    const HALF_LN_TAU: f64 = 0.918_938_533_204_672_8;
    (x - 0.5) * Real::ln(x) - x + HALF_LN_TAU + tail - Real::ln(product)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Dual;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} {b}");
    }

    /// The written-out forms are good to a few eps / x^k above x = 0.1; there and at the borders both must meet.
    #[test]
    fn series_meet_the_closed_forms() {
        for x in [0.1, 0.3, 0.7, 0.999_999, 1.0, 1.000_001, 3.0, 40.0, 800.0] {
            let scale = 8.0 * f64::EPSILON * (1.0 + 1.0 / (x * x * x));
            close(sinc(x), x.sin() / x, 8.0 * f64::EPSILON * (1.0 + x));
            close(decay_average(x), -(-x).exp_m1() / x, 4.0 * f64::EPSILON);
            close(decay_second_average(x), (x + (-x).exp_m1()) / (x * x), scale);
            close(sine_defect(x), (x - x.sin()) / (x * x * x), scale);
        }
        // Below, the first terms of the series suffice.
        for x in [0.0, 1e-300, 1e-9, 1e-3] {
            close(sinc(x), 1.0 - x * x / 6.0, 1e-13);
            close(decay_average(x), 1.0 - x / 2.0 + x * x / 6.0, 1e-10);
            close(decay_second_average(x), 0.5 - x / 6.0 + x * x / 24.0, 1e-10);
            close(sine_defect(x), 1.0 / 6.0 - x * x / 120.0, 1e-13);
        }
    }

    #[test]
    fn sinc_has_its_derivative() {
        for x in [-2.0, -0.031, 0.0, 1e-8, 0.02, 0.0317, 0.5, 4.0] {
            let d = sinc(Dual::<1>::variable(x, 0));
            // cos x / x - sin x / x^2, or the first terms of its series.
            let slope = if x.abs() < 0.1 {
                x * (-1.0 / 3.0 + x * x * (1.0 / 30.0 - x * x / 840.0))
            } else {
                (x.cos() - x.sin() / x) / x
            };
            // At the border x = 0.0316 the quotient rule cancels two terms of size 1 / x: eps / 0.03 and some.
            assert!((d.gradient[0] - slope).abs() < 1e-13, "{x}: {} {slope}", d.gradient[0]);
        }
    }

    /// Factorials are exact; Gamma(1/2) = sqrt(pi); the reflection formula covers small arguments.
    #[test]
    fn ln_gamma_has_its_known_values() {
        let mut factorial = 1.0_f64;
        for n in 1..=170 {
            let expected = factorial.ln();
            assert!((ln_gamma(f64::from(n)) - expected).abs() < 1e-14 * (1.0 + expected), "{n}");
            factorial *= f64::from(n);
        }
        for x in [1e-3, 0.1, 0.25, 0.5] {
            let reflected = (std::f64::consts::PI / (std::f64::consts::PI * x).sin()).ln();
            assert!((ln_gamma(x) + ln_gamma(1.0 - x) - reflected).abs() < 2e-14 * (1.0 + reflected));
        }
        assert!(ln_gamma(0.0).is_nan() && ln_gamma(-1.0).is_nan() && ln_gamma(f64::NAN).is_nan());
    }
}
