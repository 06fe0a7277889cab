//! The path of a target's state through a few scans, in plain steps of small matrices.
//!
//! A window is smoothed many times a second, so nothing here allocates, checks or fuses: laws are checked where they
//! enter and where they leave.

use crate::belief::Gaussian;
use crate::error::Result;
use crate::math::{Matrix, ln};
use std::array::from_fn;

/// Mean and covariance, unchecked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moments<const N: usize> {
    pub mean: [f64; N],
    pub covariance: Matrix<N, N>,
}

impl<const N: usize> From<&Gaussian<N>> for Moments<N> {
    fn from(law: &Gaussian<N>) -> Self {
        Moments { mean: *law.mean(), covariance: *law.covariance() }
    }
}

/// A motion about the state that it starts from: x' = value + F (x - mean) + noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leap<const N: usize> {
    pub value: [f64; N],
    pub slope: Matrix<N, N>,
    pub noise: Matrix<N, N>,
}

/// A B, in plain steps.
fn product<const R: usize, const K: usize, const C: usize>(
    a: &Matrix<R, K>,
    b: &Matrix<K, C>,
) -> Matrix<R, C> {
    let mut out = Matrix::ZERO;
    for i in 0..R {
        for k in 0..K {
            let factor = a.0[i][k];
            // Models leave most of their slopes zero.
            if factor != 0.0 {
                for j in 0..C {
                    out.0[i][j] += factor * b.0[k][j];
                }
            }
        }
    }
    out
}

/// A P A' for a symmetric P.
fn congruence<const R: usize, const K: usize>(a: &Matrix<R, K>, p: &Matrix<K, K>) -> Matrix<R, R> {
    let ap = product(a, p);
    let mut out = Matrix::ZERO;
    for i in 0..R {
        for j in 0..=i {
            let mut sum = 0.0;
            for k in 0..K {
                sum += ap.0[i][k] * a.0[j][k];
            }
            (out.0[i][j], out.0[j][i]) = (sum, sum);
        }
    }
    out
}

impl<const N: usize> Moments<N> {
    /// After the leap.
    pub fn after(&self, leap: &Leap<N>) -> Moments<N> {
        Moments { mean: leap.value, covariance: congruence(&leap.slope, &self.covariance) + leap.noise }
    }

    /// Given exp(b'h - h'Jh / 2) of the centre h, b being `vector` and J `information`, which may be singular;
    /// `seen` is h at the mean and `slope` its derivative. With it comes the logarithm of the mean of that
    /// factor.
    pub fn given(
        &self,
        seen: [f64; 2],
        slope: &Matrix<2, N>,
        information: &Matrix<2, 2>,
        vector: [f64; 2],
    ) -> (Moments<N>, f64) {
        // K = P H' (I + J H P H')^-1 J, in which J may be singular.
        let cross = product(&self.covariance, &slope.transpose());
        let spread = product(slope, &cross);
        let weighed = product(information, &spread);
        let [[a, b], [c, d]] = weighed.0;
        let (a, d) = (a + 1.0, d + 1.0);
        let det = a * d - b * c;
        let inverse = Matrix([[d / det, -b / det], [-c / det, a / det]]);
        let rest = [
            vector[0] - information.0[0][0] * seen[0] - information.0[0][1] * seen[1],
            vector[1] - information.0[1][0] * seen[0] - information.0[1][1] * seen[1],
        ];
        let step = [
            inverse.0[0][0] * rest[0] + inverse.0[0][1] * rest[1],
            inverse.0[1][0] * rest[0] + inverse.0[1][1] * rest[1],
        ];
        let mean = from_fn(|i| self.mean[i] + cross.0[i][0] * step[0] + cross.0[i][1] * step[1]);
        // P - P H' (I + J S)^-1 J H P.
        let taken = product(&inverse, information);
        let taken = Matrix([
            [taken.0[0][0], 0.5 * (taken.0[0][1] + taken.0[1][0])],
            [0.5 * (taken.0[0][1] + taken.0[1][0]), taken.0[1][1]],
        ]);
        // b's - s'Js / 2 + r' S (I + J S)^-1 r / 2 - ln |I + J S| / 2 with r = b - J s.
        let at = |k: usize| seen[k] * (vector[k] + rest[k]);
        let along = |k: usize| (spread.0[k][0] * step[0] + spread.0[k][1] * step[1]) * rest[k];
        let log_mean = 0.5 * (at(0) + at(1) + along(0) + along(1) - ln(det));
        (Moments { mean, covariance: self.covariance - congruence(&cross, &taken) }, log_mean)
    }

    /// Given the law `after` of what comes by the leap, whose prediction was `ahead`. Where that is singular the state
    /// stays as it is.
    pub fn condition(&self, leap: &Leap<N>, ahead: &Moments<N>, after: &Moments<N>) -> Moments<N> {
        let Some(lower) = cholesky(&ahead.covariance) else { return *self };
        // G' = Cov(y)^-1 F P.
        let mut gain = product(&leap.slope, &self.covariance);
        for j in 0..N {
            for i in 0..N {
                let mut sum = gain.0[i][j];
                for k in 0..i {
                    sum -= lower[i][k] * gain.0[k][j];
                }
                gain.0[i][j] = sum * lower[i][i];
            }
            for i in (0..N).rev() {
                let mut sum = gain.0[i][j];
                for k in i + 1..N {
                    sum -= lower[k][i] * gain.0[k][j];
                }
                gain.0[i][j] = sum * lower[i][i];
            }
        }
        let gain = gain.transpose();
        let moved: [f64; N] = from_fn(|i| after.mean[i] - ahead.mean[i]);
        let mut mean = self.mean;
        for i in 0..N {
            for k in 0..N {
                mean[i] += gain.0[i][k] * moved[k];
            }
        }
        let change = after.covariance - ahead.covariance;
        Moments { mean, covariance: self.covariance + congruence(&gain, &change) }
    }

    /// The law, checked.
    pub fn law(&self) -> Result<Gaussian<N>> {
        Gaussian::computed("mean of the path", "covariance of the path", self.mean, self.covariance)
    }
}

/// The lower factor with the reciprocals of its diagonal; `None` where there is none.
fn cholesky<const N: usize>(a: &Matrix<N, N>) -> Option<[[f64; N]; N]> {
    let mut l = [[0.0; N]; N];
    for j in 0..N {
        let mut pivot = a.0[j][j];
        for k in 0..j {
            pivot -= l[j][k] * l[j][k];
        }
        if pivot.is_nan() || pivot <= 0.0 || pivot == f64::INFINITY {
            return None;
        }
        let per = 1.0 / pivot.sqrt();
        l[j][j] = per;
        for i in j + 1..N {
            let mut rest = a.0[i][j];
            for k in 0..j {
                rest -= l[i][k] * l[j][k];
            }
            l[i][j] = rest * per;
        }
    }
    Some(l)
}
