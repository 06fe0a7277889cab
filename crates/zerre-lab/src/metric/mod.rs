//! Scores: one file each, all named in [`METRICS`].
//!
//! Points, means and covariances are rows: anything that is a slice of `f64` (`[f64; 2]`, `Vec<f64>`). Covariances
//! are row-major, `d * d` numbers for rows of `d`.

mod coverage;
mod crps;
mod gospa;
mod labelled_box;
mod median_error;
mod nees;
mod nis;
mod ospa;
mod region;
mod rmse;
mod shape;

pub use coverage::{Coverage, coverage, wilson_interval};
pub use crps::{crps_gaussian, crps_sample};
pub(crate) use crps::{crps_mixture, crps_sorted};
pub use gospa::{Gospa, gospa};
pub use labelled_box::LabelledBox;
pub(crate) use median_error::median;
pub use median_error::median_error;
pub use nees::{MeanChiSquare, anees, nees};
pub use nis::nis;
pub use ospa::ospa;
pub use region::Region;
pub use rmse::{Rmse, rmse};
pub use shape::{ShapeErrors, gauss_wasserstein_squared, mixture_wasserstein, shape_errors};

use crate::error::{Error, Result};

/// What the catalogue says of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct MetricInfo {
    /// Name on the command line.
    pub name: &'static str,
    /// What it means, in one line.
    pub about: &'static str,
    /// Where it is defined.
    pub source: &'static str,
    /// Unit of the value; "1" is a pure number, "state" the unit of what is compared.
    pub unit: &'static str,
}

/// Every metric, in the order in which tables show them.
pub const METRICS: &[MetricInfo] = &[
    rmse::INFO,
    median_error::INFO,
    gospa::INFO,
    ospa::INFO,
    crps::INFO,
    nees::INFO,
    nis::INFO,
    coverage::INFO,
];

/// The metric of that name.
pub fn find(name: &str) -> Option<&'static MetricInfo> {
    METRICS.iter().find(|metric| metric.name == name)
}

/// Estimate minus truth, row after row, and the length of a row.
fn errors<E: AsRef<[f64]>, T: AsRef<[f64]>>(estimate: &[E], truth: &[T]) -> Result<(Vec<f64>, usize)> {
    let dimension = common_dimension("numbers of an estimate", estimate)?
        .ok_or(Error::Empty { what: "estimates to compare with the truth" })?;
    if truth.len() != estimate.len() {
        return Err(Error::Shape {
            what: "true states",
            index: 0,
            found: truth.len(),
            expected: estimate.len(),
        });
    }
    let mut difference = Vec::with_capacity(estimate.len() * dimension);
    for (index, (e, t)) in estimate.iter().zip(truth).enumerate() {
        let t = row("numbers of a true state", index, t.as_ref(), dimension)?;
        difference.extend(e.as_ref().iter().zip(t).map(|(e, t)| e - t));
    }
    Ok((difference, dimension))
}

/// The length that all rows share, their numbers being finite; `None` without rows.
fn common_dimension<R: AsRef<[f64]>>(what: &'static str, rows: &[R]) -> Result<Option<usize>> {
    let Some(first) = rows.first() else { return Ok(None) };
    let dimension = first.as_ref().len();
    if dimension == 0 {
        return Err(Error::Empty { what });
    }
    for (index, r) in rows.iter().enumerate() {
        row(what, index, r.as_ref(), dimension)?;
    }
    Ok(Some(dimension))
}

/// `row`, if it has `expected` finite numbers.
fn row<'a>(what: &'static str, index: usize, row: &'a [f64], expected: usize) -> Result<&'a [f64]> {
    if row.len() != expected {
        return Err(Error::Shape { what, index, found: row.len(), expected });
    }
    match row.iter().find(|v| !v.is_finite()) {
        Some(&value) => Err(Error::NotFinite { what, index, value }),
        None => Ok(row),
    }
}

/// `e' C^-1 e` through the Cholesky factor of `covariance`; `index` is the place for the message.
///
/// What is left of a variance once the components before it are known carries the rounding of `d` products of the
/// size of the variance. Below that it is no number to divide by: the covariance is singular as far as it is known.
fn squared_mahalanobis(error: &[f64], covariance: &[f64], index: usize) -> Result<f64> {
    let d = error.len();
    let covariance = row("numbers of a covariance", index, covariance, d * d)?;
    let mut factor = vec![0.0; d * d];
    let mut whitened = vec![0.0; d];
    for i in 0..d {
        for j in 0..=i {
            // One ulp-sized asymmetry is rounding; more is a matrix in the wrong layout.
            let (lower, upper) = (covariance[i * d + j], covariance[j * d + i]);
            let scale = (covariance[i * d + i] * covariance[j * d + j]).abs().sqrt();
            if (lower - upper).abs() > 1e-9 * scale {
                return Err(Error::NotPositiveDefinite { index, row: i });
            }
            let dot: f64 = (0..j).map(|k| factor[i * d + k] * factor[j * d + k]).sum();
            let rest = lower - dot;
            if i == j {
                if rest.is_nan() || rest <= 4.0 * d as f64 * f64::EPSILON * lower {
                    return Err(Error::NotPositiveDefinite { index, row: i });
                }
                factor[i * d + i] = rest.sqrt();
            } else {
                factor[i * d + j] = rest / factor[j * d + j];
            }
        }
        let dot: f64 = (0..i).map(|k| factor[i * d + k] * whitened[k]).sum();
        whitened[i] = (error[i] - dot) / factor[i * d + i];
    }
    Ok(whitened.iter().map(|w| w * w).sum())
}

/// [`squared_mahalanobis`], or `None` where the covariance is not positive definite.
pub(crate) fn squared_mahalanobis_if_definite(
    error: &[f64],
    covariance: &[f64],
    index: usize,
) -> Result<Option<f64>> {
    match squared_mahalanobis(error, covariance, index) {
        Ok(value) => Ok(Some(value)),
        Err(Error::NotPositiveDefinite { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Euclidean distance of two rows of the same length.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Distances between two sets of points, row-major (rows `a`, columns `b`).
fn distances<A: AsRef<[f64]>, B: AsRef<[f64]>>(a: &[A], b: &[B]) -> Result<Vec<f64>> {
    let of_a = common_dimension("coordinates of an estimate", a)?;
    let of_b = common_dimension("coordinates of a true object", b)?;
    if let (Some(expected), Some(found)) = (of_a, of_b)
        && expected != found
    {
        return Err(Error::Shape { what: "coordinates of a true object", index: 0, found, expected });
    }
    let mut all = Vec::with_capacity(a.len() * b.len());
    for p in a {
        all.extend(b.iter().map(|q| distance(p.as_ref(), q.as_ref())));
    }
    Error::all_finite("distance", &all)?;
    Ok(all)
}

/// The order and the cut-off distance of a set metric.
fn check_order_and_cutoff(p: f64, c: f64) -> Result<()> {
    if !p.is_finite() || p < 1.0 {
        return Err(Error::OutOfRange { what: "the order p", value: p, needs: "it must be 1 or more" });
    }
    if !c.is_finite() || c <= 0.0 {
        return Err(Error::OutOfRange { what: "the cut-off c", value: c, needs: "it must be above zero" });
    }
    Ok(())
}

/// A seeded source of normal numbers for statistical tests.
#[cfg(test)]
pub(crate) mod test_noise {
    /// SplitMix64 under Box and Muller: independent of the library under test.
    pub(crate) struct Noise(pub u64);

    impl Noise {
        /// Uniform in (0, 1).
        pub(crate) fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^= z >> 31;
            ((z >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        }

        /// Standard normal.
        pub(crate) fn normal(&mut self) -> f64 {
            let radius = (-2.0 * self.uniform().ln()).sqrt();
            radius * (std::f64::consts::TAU * self.uniform()).cos()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        for metric in METRICS {
            assert_eq!(METRICS.iter().filter(|m| m.name == metric.name).count(), 1, "{}", metric.name);
            assert_eq!(find(metric.name), Some(metric));
            assert!(!metric.about.is_empty() && !metric.source.is_empty() && !metric.unit.is_empty());
        }
        assert_eq!(find("no such metric"), None);
    }

    #[test]
    fn mahalanobis_by_hand() {
        // C = [[4, 2], [2, 3]], C^-1 = [[3, -2], [-2, 4]] / 8; e = (1, 2): (3 - 8 + 16) / 8.
        let found = squared_mahalanobis(&[1.0, 2.0], &[4.0, 2.0, 2.0, 3.0], 0).unwrap();
        assert!((found - 11.0 / 8.0).abs() < 1e-14);
    }

    #[test]
    fn covariances_that_are_none_are_refused() {
        let e = [1.0, 1.0];
        let refused = |c: &[f64]| squared_mahalanobis(&e, c, 7);
        assert_eq!(refused(&[1.0, 2.0, 2.0, 1.0]), Err(Error::NotPositiveDefinite { index: 7, row: 1 }));
        assert_eq!(refused(&[1.0, 0.5, 0.0, 1.0]), Err(Error::NotPositiveDefinite { index: 7, row: 1 }));
        // On a line up to rounding: two particles at (0, 0) and (0.1, 0.3).
        let line = [0.1 * 0.1, 0.1 * 0.3, 0.1 * 0.3, 0.3 * 0.3 * (1.0 + f64::EPSILON)];
        assert_eq!(refused(&line), Err(Error::NotPositiveDefinite { index: 7, row: 1 }));
        assert_eq!(refused(&[0.0; 4]), Err(Error::NotPositiveDefinite { index: 7, row: 0 }));
        assert!(matches!(refused(&[1.0, 0.0, 1.0]), Err(Error::Shape { found: 3, expected: 4, .. })));
        assert!(matches!(refused(&[1.0, 0.0, 0.0, f64::NAN]), Err(Error::NotFinite { index: 7, .. })));
    }
}
