use super::{MetricInfo, errors};
use crate::error::Result;

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "rmse",
    about: "root mean square error, per component and of the whole vector",
    source: "Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 11.5",
    unit: "state",
};

/// Root mean square errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Rmse {
    /// Root of the mean squared length of the error vector.
    pub pooled: f64,
    /// Root mean square of each component; their squares sum to that of `pooled`.
    pub components: Vec<f64>,
}

/// The root mean square error of `estimate` against `truth`, row by row.
///
/// # Errors
/// [`Error::Empty`](crate::Error::Empty), [`Error::Shape`](crate::Error::Shape) or
/// [`Error::NotFinite`](crate::Error::NotFinite) for rows that cannot be compared.
pub fn rmse<E: AsRef<[f64]>, T: AsRef<[f64]>>(estimate: &[E], truth: &[T]) -> Result<Rmse> {
    let (difference, dimension) = errors(estimate, truth)?;
    let mut mean_square = vec![0.0; dimension];
    for row in difference.chunks_exact(dimension) {
        for (sum, e) in mean_square.iter_mut().zip(row) {
            *sum += e * e / estimate.len() as f64;
        }
    }
    Ok(Rmse {
        pooled: mean_square.iter().sum::<f64>().sqrt(),
        components: mean_square.into_iter().map(f64::sqrt).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    #[test]
    fn by_hand() {
        // Errors (3, 4) and (0, 0): mean squares 4.5 and 8, together 12.5.
        let found = rmse(&[[3.0, 4.0], [1.0, 1.0]], &[vec![0.0, 0.0], vec![1.0, 1.0]]).unwrap();
        assert!((found.components[0] - 4.5_f64.sqrt()).abs() < 1e-15);
        assert!((found.components[1] - 8.0_f64.sqrt()).abs() < 1e-15);
        assert!((found.pooled - 12.5_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn refuses_what_cannot_be_compared() {
        let none: [[f64; 2]; 0] = [];
        assert!(matches!(rmse(&none, &none), Err(Error::Empty { .. })));
        assert!(matches!(rmse(&[[1.0]], &[[1.0], [2.0]]), Err(Error::Shape { found: 2, expected: 1, .. })));
        assert!(matches!(rmse(&[[1.0, 2.0]], &[[1.0]]), Err(Error::Shape { found: 1, expected: 2, .. })));
        assert!(matches!(
            rmse(&[[1.0], [f64::NAN]], &[[1.0], [1.0]]),
            Err(Error::NotFinite { index: 1, .. })
        ));
    }
}
