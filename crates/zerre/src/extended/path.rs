//! The path of a target's state through a few scans, in plain steps of small matrices.
//!
//! A window is smoothed many times a second, so nothing here allocates, checks or fuses: laws are checked where they
//! enter and where they leave.

use crate::belief::Gaussian;
use crate::error::Result;
use crate::math::{Matrix, ln, vector_serde};
use serde::{Deserialize, Serialize};
use std::array::from_fn;

/// Mean and covariance, unchecked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Moments<const N: usize> {
    #[serde(with = "vector_serde")]
    pub mean: [f64; N],
    pub covariance: Matrix<N, N>,
}

impl<const N: usize> From<&Gaussian<N>> for Moments<N> {
    fn from(law: &Gaussian<N>) -> Self {
        Moments { mean: *law.mean(), covariance: *law.covariance() }
    }
}

/// A motion by its tangent: x' = value + F (x - at) + noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Leap<const N: usize> {
    #[serde(with = "vector_serde")]
    pub at: [f64; N],
    #[serde(with = "vector_serde")]
    pub value: [f64; N],
    pub slope: Matrix<N, N>,
    pub noise: Matrix<N, N>,
}

/// Numbers of a pose: x and y of the centre and, for bodies that turn, the heading.
pub(super) const POSE: usize = 3;

/// The pose of a state's law, by the tangent at its mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Pose<const N: usize> {
    #[serde(with = "vector_serde")]
    pub mean: [f64; N],
    /// m, m, rad.
    pub at: [f64; POSE],
    /// Derivative by the state.
    pub slope: Matrix<POSE, N>,
    pub spread: Matrix<POSE, POSE>,
}

/// What points say of a pose u, about some: exp(b'u - u'Ju / 2); J, the information, may be singular.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Said {
    pub information: Matrix<POSE, POSE>,
    pub vector: [f64; POSE],
}

impl Said {
    pub const NOTHING: Said = Said { information: Matrix::ZERO, vector: [0.0; POSE] };

    /// The mean of its logarithm under the law of a state, said about the pose `from`.
    #[inline(always)]
    pub fn expected<const P: usize, const N: usize>(&self, from: &Pose<N>, state: &Moments<N>) -> f64 {
        let (b, j) = (&self.vector, &self.information.0);
        let (u, (_, spread)) = (from.to::<P>(state), from.spread_of::<P>(state));
        let mut sum = 0.0;
        for p in 0..P {
            sum += b[p] * u[p];
            for q in 0..P {
                sum -= 0.5 * j[p][q] * (u[p] * u[q] + spread[p][q]);
            }
        }
        sum
    }
}

impl<const N: usize> Pose<N> {
    /// How far off the pose of another state is, by the tangent.
    #[inline(always)]
    pub fn to<const P: usize>(&self, state: &Moments<N>) -> [f64; POSE] {
        let mut u = [0.0; POSE];
        for p in 0..P {
            for k in 0..N {
                u[p] += self.slope.0[p][k] * (state.mean[k] - self.mean[k]);
            }
        }
        u
    }

    /// P H' and H P H' of another state.
    #[inline(always)]
    pub fn spread_of<const P: usize>(&self, state: &Moments<N>) -> ([[f64; POSE]; N], [[f64; POSE]; POSE]) {
        let (mut cross, mut spread) = ([[0.0; POSE]; N], [[0.0; POSE]; POSE]);
        for i in 0..N {
            for p in 0..P {
                for k in 0..N {
                    cross[i][p] += state.covariance.0[i][k] * self.slope.0[p][k];
                }
            }
        }
        for p in 0..P {
            for q in 0..=p {
                for k in 0..N {
                    spread[p][q] += self.slope.0[p][k] * cross[k][q];
                }
                spread[q][p] = spread[p][q];
            }
        }
        (cross, spread)
    }
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
        let mut mean = leap.value;
        for (mean, slope) in mean.iter_mut().zip(&leap.slope.0) {
            for k in 0..N {
                *mean += slope[k] * (self.mean[k] - leap.at[k]);
            }
        }
        Moments { mean, covariance: congruence(&leap.slope, &self.covariance) + leap.noise }
    }

    /// Given what points say of its pose, of `P` numbers, about the pose `from`. With it comes the logarithm of the mean
    /// of what they say.
    #[inline(always)]
    pub fn given<const P: usize>(&self, from: &Pose<N>, said: &Said) -> (Moments<N>, f64) {
        let (u, (cross, spread)) = (from.to::<P>(self), from.spread_of::<P>(self));
        // J = L L', A = I + L' S L: (I + J S)^-1 = I - L A^-1 L' S whether or not J is singular.
        let root = semidefinite::<P>(&said.information.0);
        let mut inner = [[0.0; POSE]; POSE];
        let mut sl = [[0.0; POSE]; POSE];
        for p in 0..P {
            for q in 0..P {
                for k in q..P {
                    sl[p][q] += spread[p][k] * root[k][q];
                }
            }
        }
        for p in 0..P {
            for q in 0..=p {
                for k in p..P {
                    inner[p][q] += root[k][p] * sl[k][q];
                }
            }
            inner[p][p] += 1.0;
        }
        let (lower, log_det) = definite::<P>(&inner);
        let (mut rest, mut seen) = ([0.0; POSE], 0.0);
        for p in 0..P {
            rest[p] = said.vector[p];
            for q in 0..P {
                rest[p] -= said.information.0[p][q] * u[q];
            }
            seen += u[p] * (said.vector[p] + rest[p]);
        }
        // a = C^-1 L' S r with A = C C'; r' S (I + J S)^-1 r = r' S r - a'a.
        let (mut a, mut along) = ([0.0; POSE], 0.0);
        for p in 0..P {
            for k in 0..P {
                a[p] += sl[k][p] * rest[k];
                along += rest[p] * spread[p][k] * rest[k];
            }
            for k in 0..p {
                a[p] -= lower[p][k] * a[k];
            }
            a[p] *= lower[p][p];
            along -= a[p] * a[p];
        }
        // D = P H' L C'^-1: the mean gains P H' r - D a, the covariance loses D D'.
        let mut taken = [[0.0; POSE]; N];
        let mut mean = self.mean;
        for i in 0..N {
            for p in 0..P {
                for k in p..P {
                    taken[i][p] += cross[i][k] * root[k][p];
                }
                for k in 0..p {
                    taken[i][p] -= lower[p][k] * taken[i][k];
                }
                taken[i][p] *= lower[p][p];
                mean[i] += cross[i][p] * rest[p] - taken[i][p] * a[p];
            }
        }
        let mut covariance = self.covariance;
        for i in 0..N {
            for j in 0..N {
                for p in 0..P {
                    covariance.0[i][j] -= taken[i][p] * taken[j][p];
                }
            }
        }
        (Moments { mean, covariance }, 0.5 * (seen + along - log_det))
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

/// The lower factor L of a positive semidefinite matrix L L', zero along what it does not know.
#[inline(always)]
fn semidefinite<const P: usize>(a: &[[f64; POSE]; POSE]) -> [[f64; POSE]; POSE] {
    let mut l = [[0.0; POSE]; POSE];
    for j in 0..P {
        let mut pivot = a[j][j];
        for k in 0..j {
            pivot -= l[j][k] * l[j][k];
        }
        // Rounding may leave a little where there is nothing.
        if pivot <= 1e-14 * a[j][j] {
            continue;
        }
        l[j][j] = pivot.sqrt();
        for i in j + 1..P {
            let mut rest = a[i][j];
            for k in 0..j {
                rest -= l[i][k] * l[j][k];
            }
            l[i][j] = rest / l[j][j];
        }
    }
    l
}

/// The lower factor of I + a positive semidefinite matrix, with the reciprocals of its diagonal, and the logarithm of the
/// determinant.
#[inline(always)]
fn definite<const P: usize>(a: &[[f64; POSE]; POSE]) -> ([[f64; POSE]; POSE], f64) {
    let (mut l, mut det) = ([[0.0; POSE]; POSE], 1.0);
    for j in 0..P {
        let mut pivot = a[j][j];
        for k in 0..j {
            pivot -= l[j][k] * l[j][k];
        }
        det *= pivot;
        l[j][j] = 1.0 / pivot.sqrt();
        for i in j + 1..P {
            let mut rest = a[i][j];
            for k in 0..j {
                rest -= l[i][k] * l[j][k];
            }
            l[i][j] = rest * l[j][j];
        }
    }
    (l, ln(det))
}
