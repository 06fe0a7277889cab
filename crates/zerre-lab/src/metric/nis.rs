use super::{MetricInfo, common_dimension, squared_mahalanobis};
use crate::error::{Error, Result};

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "nis",
    about: "mean normalised innovation squared over its dimension; needs no truth, 1 when noise is modelled well",
    source: "Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 5.4",
    unit: "1",
};

/// The normalised innovation squared `v' S^-1 v` of every innovation; average them with
/// [`anees`](super::anees).
///
/// # Errors
/// [`Error::Shape`] or [`Error::NotFinite`] for rows that do not fit, [`Error::NotPositiveDefinite`] for a
/// covariance that is none.
pub fn nis<V: AsRef<[f64]>, S: AsRef<[f64]>>(innovation: &[V], covariance: &[S]) -> Result<Vec<f64>> {
    common_dimension("numbers of an innovation", innovation)?
        .ok_or(Error::Empty { what: "innovations to score" })?;
    if covariance.len() != innovation.len() {
        let (found, expected) = (covariance.len(), innovation.len());
        return Err(Error::Shape { what: "innovation covariances", index: 0, found, expected });
    }
    let rows = innovation.iter().zip(covariance).enumerate();
    rows.map(|(index, (v, s))| squared_mahalanobis(v.as_ref(), s.as_ref(), index)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        assert_eq!(nis(&[[3.0], [-2.0]], &[[9.0], [1.0]]).unwrap(), [1.0, 4.0]);
        assert!(matches!(nis(&[[3.0]], &[[0.0]]), Err(Error::NotPositiveDefinite { index: 0, row: 0 })));
        assert!(matches!(nis(&[[3.0]], &[[1.0], [1.0]]), Err(Error::Shape { found: 2, expected: 1, .. })));
        let (no_innovation, no_covariance): ([[f64; 1]; 0], [[f64; 1]; 0]) = ([], []);
        assert!(matches!(nis(&no_innovation, &no_covariance), Err(Error::Empty { .. })));
    }
}
