//! Any linear measurement.

use super::{finite, log_constant, lower_factor};
use crate::error::Result;
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// z = H x + v with v ~ N(0, R): `M` components of a state of `N`. Values are `[z_1, ..]`, in the units of H x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear<const M: usize, const N: usize> {
    h: [[f64; N]; M],
    r: [[f64; M]; M],
    /// Inverse of the lower Cholesky factor of R, and that factor's diagonal.
    whiten: [[f64; M]; M],
    diagonal: [f64; M],
}

/// A linear measurement, digested: the residual is whitened by rows, L^-1 (z - H x).
#[derive(Clone, Copy, Debug)]
pub struct LinearGiven<const M: usize, const N: usize> {
    z: [f64; M],
    h: [[f64; N]; M],
    constant: f64,
}

impl<const M: usize, const N: usize> Linear<M, N> {
    /// The matrix `h`, row by row, and the covariance `r` of the noise.
    ///
    /// # Errors
    /// Numbers that are not finite; `r` not symmetric positive definite.
    pub fn new(h: [[f64; N]; M], r: [[f64; M]; M]) -> Result<Self> {
        for row in &h {
            finite("measurement matrix", row)?;
        }
        let l = lower_factor("covariance of the measurement", &r)?;
        let mut whiten = [[0.0; M]; M];
        for i in 0..M {
            let mut row: [f64; M] = std::array::from_fn(|j| (j..i).map(|k| -l[i][k] * whiten[k][j]).sum());
            row[i] = 1.0;
            whiten[i] = *finite("inverse covariance of the measurement", &row.map(|c| c / l[i][i]))?;
        }
        Ok(Linear { h, r, whiten, diagonal: std::array::from_fn(|i| l[i][i]) })
    }

    fn whitened<const K: usize>(&self, a: &[[f64; K]; M]) -> [[f64; K]; M] {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..=i).map(|k| self.whiten[i][k] * a[k][j]).sum()))
    }
}

impl<const M: usize, const N: usize> Measurement<N> for Linear<M, N> {
    type Value = [f64; M];
    type Given<'z> = LinearGiven<M, N>;

    fn given(&self, z: &[f64; M], _: Time) -> Result<LinearGiven<M, N>> {
        let z = finite("measured value", z)?.map(|z| [z]);
        Ok(LinearGiven {
            z: self.whitened(&z).map(|[z]| z),
            h: self.whitened(&self.h),
            constant: log_constant(&self.diagonal),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &LinearGiven<M, N>, x: [R; N]) -> R {
        let mut sum = x[0].constant(0.0);
        for (row, &z) in given.h.iter().zip(&given.z) {
            let e = dot(row, &x) - z;
            sum = e.mul_add(e, sum);
        }
        sum * -0.5 + given.constant
    }
}

#[inline(always)]
fn dot<R: Real, const N: usize>(row: &[f64; N], x: &[R; N]) -> R {
    let mut sum = x[0] * row[0];
    for (&x, &c) in x.iter().zip(row).skip(1) {
        sum = x.mul_add(x.constant(c), sum);
    }
    sum
}

impl<const M: usize, const N: usize> GaussianMeasurement<N, M> for Linear<M, N> {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; M] {
        let mut h = [x[0]; M];
        for (h, row) in h.iter_mut().zip(&self.h) {
            *h = dot(row, &x);
        }
        h
    }

    fn components(&self, z: &[f64; M]) -> [f64; M] {
        *z
    }

    fn covariance(&self) -> [[f64; M]; M] {
        self.r
    }
}
