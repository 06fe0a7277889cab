//! The chi-square law: thresholds of gates, bounds of consistency tests.

use super::gamma;
use crate::error::Result;

/// P(X <= x) for X chi-square with `dof` degrees of freedom.
///
/// # Errors
/// `x` negative or not finite, no degrees of freedom.
pub fn cdf(x: f64, dof: u32) -> Result<f64> {
    Ok(gamma::regularised(0.5 * f64::from(dof), 0.5 * x)?.0)
}

/// The x with P(X <= x) = `p`: the quantile, by bisection down to neighbouring numbers.
///
/// # Errors
/// `p` outside [0, 1), no degrees of freedom.
pub fn quantile(p: f64, dof: u32) -> Result<f64> {
    Ok(2.0 * gamma::quantile(p, 0.5 * f64::from(dof))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_tables() {
        // Tabulated values; 2 degrees of freedom are -2 ln(1 - p).
        let table = [
            (0.95, 1, 3.841_458_820_694_124),
            (0.95, 2, 5.991_464_547_107_979),
            (0.95, 3, 7.814_727_903_251_179),
            (0.95, 4, 9.487_729_036_781_154),
            (0.99, 1, 6.634_896_601_021_214),
            (0.99, 4, 13.276_704_135_987_622),
            (0.5, 1, 0.454_936_423_119_572_7),
            (0.025, 100, 74.221_927_474_923_73),
            (0.95, 100, 124.342_113_404_004_07),
        ];
        for (p, dof, x) in table {
            let q = quantile(p, dof).unwrap();
            assert!((q / x - 1.0).abs() < 1e-12, "{p} {dof}: {q} {x}");
        }
        for p in [0.0, 1e-12, 0.3, 0.999_999] {
            let x = quantile(p, 2).unwrap();
            assert!((x + 2.0 * (-p).ln_1p()).abs() <= 1e-12 * x, "{p}");
        }
    }

    #[test]
    fn quantile_and_cdf_are_inverse() {
        for dof in [1, 2, 3, 4, 7, 50, 4_000] {
            for p in [1e-6, 0.01, 0.3, 0.5, 0.9, 0.999] {
                // The slope of the law is at most of order one where p is; see the error of the factor in front.
                let back = cdf(quantile(p, dof).unwrap(), dof).unwrap();
                assert!((back - p).abs() < 1e-10, "{p} {dof}: {back}");
            }
        }
    }

    #[test]
    fn refusals() {
        for p in [1.0, -0.1, f64::NAN, f64::INFINITY] {
            assert!(quantile(p, 1).is_err(), "{p}");
        }
        assert!(quantile(0.5, 0).is_err());
        assert!(cdf(-1.0, 1).is_err() && cdf(f64::NAN, 1).is_err());
    }
}
