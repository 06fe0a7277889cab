//! The position itself: a camera, a satellite receiver, a tracker further down.

use super::{finite, log_constant};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::{GaussianMeasurement, Measurement};
use crate::time::Time;

/// The first `D` components of the state, each with independent normal noise of the same size. Values are
/// positions in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position<const D: usize> {
    sd: f64,
}

/// A position, digested.
#[derive(Clone, Copy, Debug)]
pub struct PositionGiven<const D: usize> {
    z: [f64; D],
    per_sd: f64,
    constant: f64,
}

impl<const D: usize> Position<D> {
    /// Noise of standard deviation `sd_m` (metres) on each axis.
    ///
    /// # Errors
    /// `sd_m` not positive and finite.
    pub fn new(sd_m: f64) -> Result<Self> {
        Ok(Position { sd: Error::positive("standard deviation of the position", sd_m)? })
    }
}

impl<const N: usize, const D: usize> Measurement<N> for Position<D> {
    type Value = [f64; D];
    type Given<'z> = PositionGiven<D>;

    fn given(&self, z: &[f64; D], _: Time) -> Result<PositionGiven<D>> {
        let z = *finite("measured position", z)?;
        Ok(PositionGiven { z, per_sd: 1.0 / self.sd, constant: log_constant(&[self.sd; D]) })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &PositionGiven<D>, x: [R; N]) -> R {
        const { assert!(D > 0 && N >= D, "the state has no such position") };
        let mut sum = x[0].constant(0.0);
        for (&x, &z) in x.iter().zip(&given.z) {
            let e = (x - z) * given.per_sd;
            sum = e.mul_add(e, sum);
        }
        sum * -0.5 + given.constant
    }
}

impl<const N: usize, const D: usize> GaussianMeasurement<N, D> for Position<D> {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; D] {
        let mut h = [x[0]; D];
        h.copy_from_slice(&x[..D]);
        h
    }

    fn components(&self, z: &[f64; D]) -> [f64; D] {
        *z
    }

    fn covariance(&self) -> [[f64; D]; D] {
        super::diagonal([self.sd; D])
    }
}
