//! Any linear measurement.

use super::finite;
use crate::error::{Error, Result};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix, Real};
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// z = H x + v with v ~ N(0, R): `M` components of a state of `N`. Values are `[z_1, ..]`, in the units of H x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear<const M: usize, const N: usize> {
    h: [[f64; N]; M],
    r: [[f64; M]; M],
    factor: Cholesky<M>,
}

/// A linear measurement, digested: the residual is whitened, L^-1 (z - H x) with R = L L'.
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
        let what = "covariance of the measurement";
        let covariance = Matrix(r);
        let skew = (covariance - covariance.transpose()).max_abs();
        if skew > 0.0 {
            return Err(Error::OutOfRange { what, value: skew, needs: "it must be symmetric" });
        }
        Ok(Linear { h, r, factor: Cholesky::of(what, &covariance)? })
    }
}

impl<const M: usize, const N: usize> Measurement<N> for Linear<M, N> {
    type Value = [f64; M];
    type Given<'z> = LinearGiven<M, N>;

    fn given(&self, z: &[f64; M], _: Time) -> Result<LinearGiven<M, N>> {
        let h = Matrix(self.h);
        let columns = Matrix(std::array::from_fn(|j| self.factor.whiten(&h.column(j))));
        Ok(LinearGiven {
            z: self.factor.whiten(finite("measured value", z)?),
            h: columns.transpose().0,
            constant: -0.5 * (self.factor.log_det() + M as f64 * LN_2PI),
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
