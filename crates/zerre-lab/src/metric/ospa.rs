use super::{MetricInfo, check_order_and_cutoff, distances};
use crate::error::Result;
use zerre::math::assignment::assign;

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "ospa",
    about: "distance per object between two sets, cut off at c; for comparison with older papers",
    source: "Schuhmacher, Vo and Vo, IEEE Trans. on Signal Processing 56, 2008, doi:10.1109/TSP.2008.920469",
    unit: "m",
};

/// The optimal sub-pattern assignment metric of order `p` with cut-off `c`; zero when both sets are empty.
///
/// # Errors
/// As [`gospa`](super::gospa).
pub fn ospa<E: AsRef<[f64]>, T: AsRef<[f64]>>(estimates: &[E], truth: &[T], p: f64, c: f64) -> Result<f64> {
    check_order_and_cutoff(p, c)?;
    let cut: Vec<f64> = distances(estimates, truth)?.iter().map(|d| (d / c).min(1.0).powf(p)).collect();
    let larger = estimates.len().max(truth.len());
    if larger == 0 {
        return Ok(0.0);
    }
    let unpaired = estimates.len().abs_diff(truth.len());
    let best = assign(&cut, estimates.len(), truth.len())?;
    Ok(c * ((best.cost + unpaired as f64) / larger as f64).powf(1.0 / p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let none: [[f64; 1]; 0] = [];
        assert_eq!(ospa(&none, &none, 2.0, 10.0).unwrap(), 0.0);
        assert_eq!(ospa(&none, &[[1.0]], 2.0, 10.0).unwrap(), 10.0);
        // One pair 3 apart and one left over: sqrt((9 + 100) / 2).
        let found = ospa(&[[3.0]], &[[50.0], [0.0]], 2.0, 10.0).unwrap();
        // Half a dozen roundings of half an ulp.
        assert!((found - 54.5_f64.sqrt()).abs() <= 3.0 * f64::EPSILON * found);
        assert!(ospa(&[[3.0]], &[[0.0]], 0.0, 10.0).is_err());
    }
}
