//! A whole model: where the state begins, how it moves, how it is seen.

use super::{Likelihood, Motion, TransitionDensity};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::kernels::Simd;
use crate::time::Time;
use std::borrow::Borrow;

/// A state-space model.
#[derive(Clone, Debug)]
pub struct StateSpace<const N: usize, A, H> {
    /// The law of the first state.
    pub prior: Gaussian<N>,
    /// How the state moves.
    pub motion: A,
    /// How it is seen.
    pub sensor: H,
}

impl<const N: usize, A, H: Likelihood<N>> StateSpace<N, A, H> {
    /// ln p(x, z), the complete-data log-likelihood: of a path that is at `start` in its first state and at
    /// the time of each of `data` (measurements or their absence, in the order of time) in one more, and of
    /// the measurements. Where no time passes the state must stay. -inf where the model cannot lead or see
    /// so.
    ///
    /// # Errors
    /// Another number of states than data and one more; data out of order; a singular covariance of the
    /// prior; a motion without [`TransitionDensity`]; what the models refuse.
    pub fn log_density<const W: usize, Z: Borrow<H::Value>>(
        &self,
        start: Time,
        data: &[(Time, Option<Z>)],
        path: &[[f64; N]],
    ) -> Result<f64>
    where
        A: Motion<N, W>,
    {
        path_fits(path, data.len())?;
        let mut sum = match path.first() {
            None => 0.0,
            Some(first) => self.prior.log_density(first)?,
        };
        let mut from = start;
        for ((to, z), pair) in data.iter().zip(path.windows(2)) {
            let [before, after] = [pair[0], pair[1]];
            if *to < from {
                return Err(Error::OutOfOrder { from, to: *to });
            }
            if *to > from {
                let density = TransitionDensity::over(&self.motion, from, *to, &before)?;
                sum += density.log_density::<f64>(before, after);
            } else if before != after {
                sum = f64::NEG_INFINITY;
            }
            if let Some(z) = z {
                let digest = self.sensor.digest(z.borrow(), *to)?;
                let mut score = [0.0];
                H::score(&digest, Simd::best(), &after.each_ref().map(std::slice::from_ref), &mut score);
                sum += score[0];
            }
            from = *to;
        }
        Ok(if sum.is_nan() { f64::NEG_INFINITY } else { sum })
    }
}

/// Refuses a path that has not one state more than there are `data`.
pub(crate) fn path_fits<const N: usize>(path: &[[f64; N]], data: usize) -> Result<()> {
    if path.len() == data + 1 {
        return Ok(());
    }
    Err(Error::Shape { what: "states of a path", found: path.len(), expected: data + 1 })
}
