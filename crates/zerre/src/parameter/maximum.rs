//! Maximum likelihood.

use super::Parameters;
use super::walk::log_checked;
use crate::error::{Error, Result};
use crate::math::simplex::{Search, climb};
use crate::rng::Stream;
use std::array::from_fn;

/// Where a likelihood is largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maximum<const K: usize> {
    /// The values of the parameters.
    pub theta: [f64; K],
    /// The log-likelihood there.
    pub log_likelihood: f64,
    /// How often the likelihood was computed.
    pub evaluations: usize,
}

/// How near corners of the simplex lie to each other at the end, in free coordinates (see
/// [`Law`](super::Law)).
const CLOSE: f64 = 1e-5;
/// Turns that the simplex takes at most.
const TURNS: usize = 1000;

/// The largest likelihood near `start`, by the simplex of Nelder and Mead in free coordinates, which
/// `parameters` give; the priors themselves do not count. Every value sees the same random numbers, those of
/// `stream` (common random numbers): the estimate of a particle filter is then a fixed function of the
/// parameters, and differences between neighbours are far less noisy than either. Resampling leaves small
/// jumps in it (Pitt, Warwick Economic Research Paper 651, 2002; Malik and Pitt, Journal of Econometrics
/// 165(2), 2011), which the simplex passes over.
///
/// # Errors
/// A start outside the prior or of likelihood zero, a log-likelihood that is NaN or +inf, and the errors of
/// `log_likelihood`.
pub fn maximum_likelihood<const K: usize>(
    parameters: &Parameters<K>,
    start: [f64; K],
    stream: Stream,
    mut log_likelihood: impl FnMut(&[f64; K], Stream) -> Result<f64>,
) -> Result<Maximum<K>> {
    let search = Search { first: 0.5, close: CLOSE, turns: TURNS };
    let theta = |free: &[f64]| parameters.bound(&from_fn(|k| free[k])).0;
    let summit =
        climb(&parameters.free(&start)?, search, |free| log_checked(log_likelihood(&theta(free), stream)?))?;
    let log_likelihood = Error::finite("log-likelihood around the start", summit.height)?;
    Ok(Maximum { theta: theta(&summit.at), log_likelihood, evaluations: summit.evaluations })
}
