use super::{MetricInfo, errors, squared_mahalanobis};
use crate::distribution::chi_square_quantile;
use crate::error::{Error, Result};

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "nees",
    about: "mean normalised estimation error squared over its dimension; 1 when the covariance is honest",
    source: "Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 5.4",
    unit: "1",
};

/// The normalised estimation error squared `e' P^-1 e` of every row.
///
/// # Errors
/// [`Error::Empty`], [`Error::Shape`] or [`Error::NotFinite`] for rows that cannot be compared,
/// [`Error::NotPositiveDefinite`] for a covariance that is none.
pub fn nees<E: AsRef<[f64]>, T: AsRef<[f64]>, C: AsRef<[f64]>>(
    estimate: &[E],
    truth: &[T],
    covariance: &[C],
) -> Result<Vec<f64>> {
    let (difference, dimension) = errors(estimate, truth)?;
    if covariance.len() != estimate.len() {
        let (found, expected) = (covariance.len(), estimate.len());
        return Err(Error::Shape { what: "covariances", index: 0, found, expected });
    }
    let rows = difference.chunks_exact(dimension).zip(covariance).enumerate();
    rows.map(|(index, (e, c))| squared_mahalanobis(e, c.as_ref(), index)).collect()
}

/// The mean of squared normalised errors beside the interval in which it should lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanChiSquare {
    /// Mean over the dimension: 1 when errors are as large as the covariance says.
    pub mean: f64,
    /// Lower end of the interval for `mean`.
    pub low: f64,
    /// Upper end of the interval for `mean`.
    pub high: f64,
    /// How many values were averaged.
    pub samples: usize,
    /// Degrees of freedom of one value.
    pub dimension: usize,
}

impl MeanChiSquare {
    /// Whether the mean is inside the interval.
    pub fn is_inside(&self) -> bool {
        self.low <= self.mean && self.mean <= self.high
    }
}

/// The average of NEES (or NIS) values over their dimension, and the central interval that holds it with
/// probability `confidence` when the values are independent and chi-square distributed. Values along one run are
/// not independent for NEES: average over runs at one time, or read the interval as too narrow.
///
/// # Errors
/// [`Error::Empty`] without values or dimension, [`Error::OutOfRange`] for a negative value or a `confidence`
/// outside (0, 1), [`Error::NotFinite`].
pub fn anees(values: &[f64], dimension: usize, confidence: f64) -> Result<MeanChiSquare> {
    if values.is_empty() {
        return Err(Error::Empty { what: "normalised errors to average" });
    }
    if dimension == 0 {
        return Err(Error::Empty { what: "degrees of freedom" });
    }
    Error::all_finite("normalised error", values)?;
    if let Some(&value) = values.iter().find(|v| **v < 0.0) {
        return Err(Error::OutOfRange {
            what: "a squared normalised error",
            value,
            needs: "it must not be negative",
        });
    }
    check_confidence(confidence)?;
    let degrees = (values.len() * dimension) as f64;
    Ok(MeanChiSquare {
        mean: values.iter().sum::<f64>() / degrees,
        low: chi_square_quantile(0.5 - confidence / 2.0, degrees) / degrees,
        high: chi_square_quantile(0.5 + confidence / 2.0, degrees) / degrees,
        samples: values.len(),
        dimension,
    })
}

/// A probability strictly between 0 and 1.
pub(super) fn check_confidence(confidence: f64) -> Result<()> {
    if confidence > 0.0 && confidence < 1.0 {
        Ok(())
    } else {
        let needs = "it must lie between 0 and 1";
        Err(Error::OutOfRange { what: "the probability of an interval", value: confidence, needs })
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_noise::Noise;
    use super::*;

    #[test]
    fn by_hand() {
        let found = nees(&[[1.0, 2.0]], &[[0.0, 0.0]], &[[4.0, 2.0, 2.0, 3.0]]).unwrap();
        assert!((found[0] - 11.0 / 8.0).abs() < 1e-14);
        // 100 degrees of freedom: 0.025 and 0.975 quantiles 74.222 and 129.561 (NIST tables).
        let mean = anees(&[2.0; 50], 2, 0.95).unwrap();
        assert_eq!(mean.mean, 1.0);
        assert!((mean.low - 0.742_22).abs() < 1e-5 && (mean.high - 1.295_61).abs() < 1e-5);
    }

    /// Errors drawn from N(0, P) with P = L L': the mean is inside a 99.99 % interval (fails for one seed in 10^4,
    /// and this seed is fixed); errors twice as long have four times the NEES and are outside.
    #[test]
    fn gaussian_errors_are_inside_and_doubled_ones_outside() {
        let (mut noise, mut errors) = (Noise(11), Vec::new());
        for _ in 0..2000 {
            let (a, b) = (noise.normal(), noise.normal());
            errors.push([3.0 * a, 0.5 * b - a]);
        }
        let (truth, covariance) = (vec![[0.0; 2]; 2000], vec![[9.0, -3.0, -3.0, 1.25]; 2000]);
        let honest = anees(&nees(&errors, &truth, &covariance).unwrap(), 2, 0.9999).unwrap();
        assert!(honest.is_inside(), "{honest:?}");
        let doubled: Vec<_> = errors.iter().map(|e| [2.0 * e[0], 2.0 * e[1]]).collect();
        let bold = anees(&nees(&doubled, &truth, &covariance).unwrap(), 2, 0.9999).unwrap();
        assert!(!bold.is_inside() && (bold.mean / honest.mean - 4.0).abs() < 1e-9);
    }

    #[test]
    fn refuses_bad_input() {
        assert!(matches!(anees(&[], 2, 0.95), Err(Error::Empty { .. })));
        assert!(matches!(anees(&[1.0], 0, 0.95), Err(Error::Empty { .. })));
        assert!(matches!(anees(&[-1.0], 1, 0.95), Err(Error::OutOfRange { .. })));
        assert!(matches!(anees(&[1.0], 1, 1.0), Err(Error::OutOfRange { .. })));
        assert!(matches!(anees(&[f64::INFINITY], 1, 0.9), Err(Error::NotFinite { .. })));
        let covariances: [[f64; 1]; 0] = [];
        assert!(matches!(nees(&[[1.0]], &[[1.0]], &covariances), Err(Error::Shape { .. })));
    }
}
