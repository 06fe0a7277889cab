//! The few distribution functions that scores and verdicts need.

use statrs::distribution::{ContinuousCDF, Normal};
use statrs::function::beta::beta_reg;
use statrs::function::gamma::gamma_lr;

/// P(X <= x) of a chi-square variable with `degrees` degrees of freedom (above zero).
pub(crate) fn chi_square_cdf(x: f64, degrees: f64) -> f64 {
    if x <= 0.0 { 0.0 } else { gamma_lr(degrees / 2.0, x / 2.0) }
}

/// The x with P(X <= x) = `probability` (inside (0, 1)) of a chi-square variable.
///
/// Bisection between bounds grown from the mean: the distribution function is monotone, so it cannot miss, and the
/// result is as exact as the distribution function itself.
pub(crate) fn chi_square_quantile(probability: f64, degrees: f64) -> f64 {
    let (mut low, mut high) = (0.0, degrees.max(1.0));
    while chi_square_cdf(high, degrees) < probability && high < 1e300 {
        low = high;
        high *= 2.0;
    }
    // Halving a bracket of width `high` until neighbours meet takes at most 53 steps plus those to small numbers.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if chi_square_cdf(middle, degrees) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// P(X <= x) of a standard normal variable.
pub(crate) fn normal_cdf(x: f64) -> f64 {
    Normal::standard().cdf(x)
}

/// P(T > t) of Student's t with `degrees` degrees of freedom (above zero), by the incomplete beta function.
pub(crate) fn student_tail(t: f64, degrees: f64) -> f64 {
    let tail = 0.5 * beta_reg(0.5 * degrees, 0.5, degrees / (degrees + t * t));
    if t < 0.0 { 1.0 - tail } else { tail }
}

/// The t with P(T <= t) = `probability` (at least 1/2, below 1) of Student's t, by bisection of
/// [`student_tail`].
pub(crate) fn student_quantile(probability: f64, degrees: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while student_tail(high, degrees) > 1.0 - probability && high < 1e300 {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if student_tail(middle, degrees) > 1.0 - probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The x with P(X <= x) = `probability` (inside (0, 1)) of Fisher's F with these degrees of freedom (above zero), by
/// bisection of the incomplete beta function.
pub(crate) fn fisher_quantile(probability: f64, over: f64, under: f64) -> f64 {
    // P(X <= x) is the incomplete beta function at over x / (over x + under), a share of 1.
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if beta_reg(0.5 * over, 0.5 * under, middle) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    let share = 0.5 * (low + high);
    under * share / (over * (1.0 - share))
}

/// The x with P(X <= x) = `probability` (inside (0, 1)) of a standard normal variable.
pub(crate) fn normal_quantile(probability: f64) -> f64 {
    Normal::standard().inverse_cdf(probability)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table values: NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.4 (three decimals printed).
    #[test]
    fn chi_square_quantiles_are_the_tables() {
        let table = [
            (0.95, 1.0, 3.841),
            (0.99, 1.0, 6.635),
            (0.95, 2.0, 5.991),
            (0.90, 4.0, 7.779),
            (0.975, 10.0, 20.483),
            (0.025, 10.0, 3.247),
            (0.999, 3.0, 16.266),
            (0.95, 100.0, 124.342),
            (0.05, 100.0, 77.929),
        ];
        for (probability, degrees, value) in table {
            let found = chi_square_quantile(probability, degrees);
            assert!((found - value).abs() < 6e-4, "{probability} {degrees}: {found} instead of {value}");
        }
    }

    /// Table values: NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.3 (three decimals printed). With two
    /// degrees above, the quantile has a closed form.
    #[test]
    fn fisher_quantiles_are_the_tables() {
        for (probability, over, under, value) in [
            (0.95, 1.0, 10.0, 4.965),
            (0.95, 5.0, 5.0, 5.050),
            (0.99, 4.0, 20.0, 4.431),
            (0.95, 10.0, 100.0, 1.927),
        ] {
            let found = fisher_quantile(probability, over, under);
            assert!((found - value).abs() < 6e-4, "{over} {under}: {found} instead of {value}");
        }
        for under in [1.0, 7.5, 300.0] {
            let exact = 0.5 * under * (0.025f64.powf(-2.0 / under) - 1.0);
            assert!((fisher_quantile(0.975, 2.0, under) / exact - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn chi_square_of_two_is_the_exponential() {
        // The series and the continued fraction of the incomplete gamma function end at terms of 1e-15.
        for x in [1e-6, 0.1, 1.0, 5.0, 40.0] {
            assert!((chi_square_cdf(x, 2.0) + (-x / 2.0_f64).exp_m1()).abs() < 1e-14);
        }
        // The same over the density at the median, 1/4.
        assert!((chi_square_quantile(0.5, 2.0) - 2.0 * 2.0_f64.ln()).abs() < 4e-14);
    }

    /// The distribution function is the exponential of a ln x - x - ln Gamma(a), a = 30 000 at the most: three numbers
    /// of up to 3e5, each rounded to half an ulp, are 1e-10 together.
    #[test]
    fn quantiles_invert_the_distribution_function() {
        for degrees in [1.0, 2.0, 7.0, 300.0, 60_000.0] {
            for probability in [1e-4, 0.025, 0.5, 0.975, 0.9999] {
                let x = chi_square_quantile(probability, degrees);
                assert!((chi_square_cdf(x, degrees) - probability).abs() < 1e-10, "{degrees} {probability}");
            }
        }
        // Fifteen decimals are printed. The distribution function is a rational form: scores are printed to four
        // digits of metres, and 1e-9 of a standard deviation does not reach them.
        assert!((normal_quantile(0.975) - 1.959_963_984_540_054).abs() < 2e-15);
        assert!((normal_cdf(-1.0) - 0.158_655_253_931_457).abs() < 1e-9);
    }
}
