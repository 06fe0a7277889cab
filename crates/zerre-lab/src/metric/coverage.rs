use super::MetricInfo;
use super::nees::check_confidence;
use crate::distribution::{chi_square_quantile, normal_quantile};
use crate::error::{Error, Result};

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "coverage",
    about: "share of true states inside the 50, 90 and 95 % ellipsoids of the estimate",
    source: "interval: E. B. Wilson, J. of the American Statistical Association 22, 1927",
    unit: "1",
};

/// How often the truth lay inside the ellipsoid of one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Probability that the ellipsoid claims, in (0, 1).
    pub level: f64,
    /// How many true states lay inside.
    pub inside: usize,
    /// How many were looked at.
    pub total: usize,
    /// Lower end of the 95 % Wilson interval of the share.
    pub low: f64,
    /// Upper end of the 95 % Wilson interval of the share.
    pub high: f64,
}

impl Coverage {
    /// The share inside.
    pub fn share(&self) -> f64 {
        self.inside as f64 / self.total as f64
    }
}

/// For each of `levels` the share of [`nees`](super::nees) values inside the ellipsoid of that probability.
///
/// # Errors
/// [`Error::Empty`] without values or dimension, [`Error::NotFinite`], [`Error::OutOfRange`] for a level outside
/// (0, 1).
pub fn coverage(nees: &[f64], dimension: usize, levels: &[f64]) -> Result<Vec<Coverage>> {
    if dimension == 0 {
        return Err(Error::Empty { what: "degrees of freedom" });
    }
    Error::all_finite("normalised error", nees)?;
    let of_level = |&level: &f64| {
        check_confidence(level)?;
        let edge = chi_square_quantile(level, dimension as f64);
        let (inside, total) = (nees.iter().filter(|v| **v <= edge).count(), nees.len());
        let (low, high) = wilson_interval(inside, total, 0.95)?;
        Ok(Coverage { level, inside, total, low, high })
    };
    levels.iter().map(of_level).collect()
}

/// The Wilson score interval of a share: `inside` of `total` seen.
///
/// # Errors
/// [`Error::Empty`] for a total of zero, [`Error::Shape`] for more inside than there are, [`Error::OutOfRange`] for
/// a `confidence` outside (0, 1).
pub fn wilson_interval(inside: usize, total: usize, confidence: f64) -> Result<(f64, f64)> {
    if total == 0 {
        return Err(Error::Empty { what: "cases of which to take a share" });
    }
    if inside > total {
        return Err(Error::Shape { what: "cases inside", index: 0, found: inside, expected: total });
    }
    check_confidence(confidence)?;
    let z = normal_quantile(0.5 + confidence / 2.0);
    let (n, p) = (total as f64, inside as f64 / total as f64);
    let centre = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    // At a share of exactly 0 or 1 the interval ends there; rounding may not.
    let low = if inside == 0 { 0.0 } else { centre - half };
    let high = if inside == total { 1.0 } else { centre + half };
    Ok((low, high))
}

#[cfg(test)]
mod tests {
    use super::super::test_noise::Noise;
    use super::*;

    /// z^2 = 3.8415: for 0 of 10 the upper end is z^2 / (n + z^2) = 0.2775; for 5 of 10 the ends are
    /// 1/2 -+ z / (2 sqrt(n + z^2)) = 0.2366 and 0.7634.
    #[test]
    fn wilson_by_hand() {
        let (low, high) = wilson_interval(0, 10, 0.95).unwrap();
        assert!(low == 0.0 && (high - 0.2775).abs() < 5e-5);
        let (low, high) = wilson_interval(5, 10, 0.95).unwrap();
        assert!((low - 0.2366).abs() < 5e-5 && (high - 0.7634).abs() < 5e-5);
        assert_eq!(wilson_interval(3, 3, 0.95).unwrap().1, 1.0);
        assert!(matches!(wilson_interval(0, 0, 0.95), Err(Error::Empty { .. })));
        assert!(matches!(wilson_interval(4, 3, 0.95), Err(Error::Shape { .. })));
    }

    /// Each share is within 4 standard errors sqrt(p (1 - p) / n) of its level (one seed in 5 000 would not be).
    #[test]
    fn gaussian_errors_are_covered_as_claimed() {
        let mut noise = Noise(5);
        let values: Vec<f64> =
            (0..4000).map(|_| (0..3).map(|_| noise.normal().powi(2)).sum::<f64>()).collect();
        for c in coverage(&values, 3, &[0.5, 0.9, 0.95]).unwrap() {
            let error = (c.level * (1.0 - c.level) / 4000.0).sqrt();
            assert!((c.share() - c.level).abs() < 4.0 * error, "{c:?}");
            assert!(c.low < c.share() && c.share() < c.high && c.total == 4000);
        }
        // Told the wrong dimension, the shares are far off.
        let wrong = coverage(&values, 1, &[0.9]).unwrap()[0];
        assert!(wrong.high < 0.75, "{wrong:?}");
    }

    #[test]
    fn refuses_bad_input() {
        assert!(matches!(coverage(&[], 1, &[0.5]), Err(Error::Empty { .. })));
        assert!(matches!(coverage(&[1.0], 0, &[0.5]), Err(Error::Empty { .. })));
        assert!(matches!(coverage(&[1.0], 1, &[95.0]), Err(Error::OutOfRange { .. })));
        assert!(matches!(coverage(&[f64::NAN], 1, &[0.5]), Err(Error::NotFinite { .. })));
    }
}
