use super::{MetricInfo, errors};
use crate::error::Result;

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "median_error",
    about: "median length of the error vector; a few lost moments do not move it",
    source: "Hyndman and Koehler, Int. J. of Forecasting 22, 2006, doi:10.1016/j.ijforecast.2006.03.001",
    unit: "state",
};

/// The median length of `estimate` minus `truth`; of an even number of rows the mean of the middle two.
///
/// # Errors
/// [`Error::Empty`](crate::Error::Empty), [`Error::Shape`](crate::Error::Shape) or
/// [`Error::NotFinite`](crate::Error::NotFinite) for rows that cannot be compared.
pub fn median_error<E: AsRef<[f64]>, T: AsRef<[f64]>>(estimate: &[E], truth: &[T]) -> Result<f64> {
    let (difference, dimension) = errors(estimate, truth)?;
    let lengths = difference.chunks_exact(dimension).map(|e| e.iter().map(|e| e * e).sum::<f64>().sqrt());
    Ok(median(lengths.collect()))
}

/// Median of finite numbers, of which there is at least one.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len() % 2 == 1 { values[half] } else { 0.5 * (values[half - 1] + values[half]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let zero = [[0.0, 0.0]; 4];
        let found = median_error(&[[3.0, 4.0], [0.0, 1.0], [300.0, 400.0], [0.0, 2.0]], &zero).unwrap();
        assert_eq!(found, 3.5);
        assert_eq!(median_error(&[[1.0], [-9.0], [2.0]], &[[0.0]; 3]).unwrap(), 2.0);
        assert!(median_error(&[[1.0]], &[[1.0]; 2]).is_err());
    }
}
