//! The normal law.

use super::matrix::Cholesky;

/// ln(2 pi).
pub const LN_2PI: f64 = 1.837_877_066_409_345_3;

/// ln N(d; 0, A): log density of a difference `d` from the mean, given the Cholesky factor of the covariance A.
pub fn log_density<const N: usize>(d: &[f64; N], covariance: &Cholesky<N>) -> f64 {
    -0.5 * (covariance.mahalanobis_squared(d) + covariance.log_det() + N as f64 * LN_2PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Matrix;

    #[test]
    fn densities_by_hand() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-14, "{a} {b}");
        close(LN_2PI, std::f64::consts::TAU.ln());
        let unit = Cholesky::of("P", &Matrix([[1.0]])).unwrap();
        close(log_density(&[0.0], &unit).exp(), 0.398_942_280_401_432_7);
        // Correlated: det = 3, d' P^-1 d = (2 - 2 + 2) / 3 for d = (1, 1).
        let pair = Cholesky::of("P", &Matrix([[2.0, 1.0], [1.0, 2.0]])).unwrap();
        close(log_density(&[1.0, 1.0], &pair), -0.5 * (2.0 / 3.0 + 3f64.ln()) - LN_2PI);
    }
}
