//! Random walks over free coordinates.

use crate::error::{Error, Result};
use crate::math::{Cholesky, Matrix, exp, ln};
use crate::rng::Draws;
use std::array::from_fn;

/// The scale of a random walk's steps, in standard deviations of the law that it walks in, that serves normal
/// laws best (Roberts, Gelman and Gilks, Annals of Applied Probability 7, 1997).
fn log_best_scale<const K: usize>() -> f64 {
    ln(2.38 / (K as f64).sqrt())
}

/// A random walk that fits the covariance of its steps and their size to the law that it walks in (Andrieu
/// and Thoms, Statistics and Computing 18, 2008, algorithm 4): gains k^-0.6, acceptance of 0.44 for one
/// coordinate and 0.234 for more.
#[derive(Clone, Debug)]
pub(super) struct Walk<const K: usize> {
    log_scale: f64,
    shape: Matrix<K, K>,
    root: Matrix<K, K>,
    centre: [f64; K],
    /// Steps that were learnt from.
    learnt: u64,
}

impl<const K: usize> Walk<K> {
    /// A walk that begins at `at` with steps of standard deviation `first` in every coordinate.
    ///
    /// # Errors
    /// `first` not above zero.
    pub(super) fn new(at: [f64; K], first: f64) -> Result<Self> {
        Error::positive("first step of a chain", first)?;
        let log_scale = log_best_scale::<K>();
        let unit = first / exp(log_scale);
        let shape = Matrix::identity() * (unit * unit);
        let root = *Cholesky::of("covariance of the steps", &shape)?.factor();
        Ok(Walk { log_scale, shape, root, centre: at, learnt: 0 })
    }

    /// A walk in a law of this covariance, which may be singular.
    ///
    /// # Errors
    /// A covariance that is none.
    pub(super) fn of_covariance(covariance: &Matrix<K, K>) -> Result<Self> {
        let root = Cholesky::semidefinite("covariance of the steps", covariance)?;
        Ok(Walk { log_scale: log_best_scale::<K>(), shape: *covariance, root, centre: [0.0; K], learnt: 0 })
    }

    /// Where a step from `at` leads.
    pub(super) fn propose(&self, at: &[f64; K], random: &mut Draws) -> [f64; K] {
        let step = self.root * from_fn::<f64, K, _>(|_| random.normal());
        let size = exp(self.log_scale);
        from_fn(|i| at[i] + size * step[i])
    }

    /// Learns from a step that had this chance of acceptance, and from where the walk is after it.
    pub(super) fn learn(&mut self, at: &[f64; K], chance: f64) {
        self.learnt += 1;
        let target = if K == 1 { 0.44 } else { 0.234 };
        let gain = exp(-0.6 * ln(self.learnt as f64 + 1.0));
        self.log_scale += gain * (chance - target);
        let off: [f64; K] = from_fn(|i| at[i] - self.centre[i]);
        self.centre = from_fn(|i| self.centre[i] + gain * off[i]);
        self.shape = self.shape * (1.0 - gain) + Matrix::outer(&off, &off) * gain;
        // A chain that has not moved yet has no shape to offer.
        if let Ok(factor) = Cholesky::of("covariance of the steps", &self.shape) {
            self.root = *factor.factor();
        }
    }
}

/// Refuses a log-likelihood that is NaN or +inf; -inf is impossible, and fine.
pub(super) fn log_checked(value: f64) -> Result<f64> {
    if value.is_nan() || value == f64::INFINITY {
        return Err(Error::NotFinite { what: "log-likelihood", value });
    }
    Ok(value)
}

/// The probability of a step from one log-density to another.
pub(super) fn chance(there: f64, here: f64) -> f64 {
    if there > f64::NEG_INFINITY { exp((there - here).min(0.0)) } else { 0.0 }
}
