//! A sensor given what is hidden about it.

use crate::error::{Error, Result};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix, Real};
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;
use std::array::from_fn;

/// A sensor whose noise is normal and known but for what a [`Latent`](crate::model::Latent) says: z = h(x) +
/// d + v, v ~ N(0, s R), with h and R of the sensor. What that sensor says itself of the tails of its noise
/// does not count: it is what s stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditioned<H, const M: usize> {
    sensor: H,
    offset: [f64; M],
    scale: f64,
}

/// A measurement digested.
#[derive(Clone, Copy, Debug)]
pub struct ConditionedGiven<'z, H, const M: usize> {
    of: &'z Conditioned<H, M>,
    at: Time,
    z: [f64; M],
    /// L^-1 of s R = L L'.
    whiten: [[f64; M]; M],
    constant: f64,
}

impl<H, const M: usize> Conditioned<H, M> {
    /// The sensor with normal noise: d = 0 and s = 1.
    pub fn new(sensor: H) -> Self {
        Conditioned { sensor, offset: [0.0; M], scale: 1.0 }
    }

    /// Adds `offset` d, in the units of the components.
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn with_offset(self, offset: [f64; M]) -> Result<Self> {
        for d in offset {
            Error::finite("offset of the measurement", d)?;
        }
        Ok(Conditioned { offset, ..self })
    }

    /// Multiplies the covariance of the noise by `scale` s.
    ///
    /// # Errors
    /// `scale` not positive and finite.
    pub fn with_scale(self, scale: f64) -> Result<Self> {
        Ok(Conditioned { scale: Error::positive("scale of the covariance", scale)?, ..self })
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> Measurement<N> for Conditioned<H, M> {
    type Value = H::Value;
    type Given<'z>
        = ConditionedGiven<'z, H, M>
    where
        H: 'z;

    fn given<'z>(&'z self, z: &'z H::Value, at: Time) -> Result<Self::Given<'z>> {
        let z = self.sensor.components(z);
        for component in z {
            Error::finite("measurement", component)?;
        }
        let factor = Cholesky::of("covariance of the measurement", &Matrix(self.covariance()))?;
        let columns: [[f64; M]; M] = from_fn(|j| factor.whiten(&from_fn(|i| f64::from(u8::from(i == j)))));
        let constant = -0.5 * (factor.log_det() + M as f64 * LN_2PI);
        Ok(ConditionedGiven { of: self, at, z, whiten: Matrix(columns).transpose().0, constant })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Self::Given<'_>, x: [R; N]) -> R {
        let mut residual = given.of.predict(given.at, x);
        for i in 0..M {
            residual[i] = residual[i] - given.z[i];
            if H::ANGLE[i] {
                let (sin, cos) = residual[i].sin_cos();
                residual[i] = sin.atan2(cos);
            }
        }
        let mut sum = x[0].constant(0.0);
        for i in 0..M {
            let mut e = residual[i] * given.whiten[i][i];
            for j in 0..i {
                e = residual[j].mul_add(e.constant(given.whiten[i][j]), e);
            }
            sum = e.mul_add(e, sum);
        }
        sum * -0.5 + given.constant
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> GaussianMeasurement<N, M>
    for Conditioned<H, M>
{
    const ANGLE: [bool; M] = H::ANGLE;

    #[inline(always)]
    fn predict<R: Real>(&self, at: Time, x: [R; N]) -> [R; M] {
        let mut h = self.sensor.predict(at, x);
        for i in 0..M {
            h[i] = h[i] + self.offset[i];
        }
        h
    }

    fn components(&self, z: &H::Value) -> [f64; M] {
        self.sensor.components(z)
    }

    fn covariance(&self) -> [[f64; M]; M] {
        self.sensor.covariance().map(|row| row.map(|r| r * self.scale))
    }
}
