//! Markov chains over parameters.

use super::Parameters;
use super::walk::{Walk, chance, log_checked};
use crate::error::{Error, Result};
use crate::rng::{Purpose, Stream};

/// Settings of [`particle_metropolis_hastings`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainSettings {
    /// Values of the chain that are given out, 2 000 by default.
    pub draws: usize,
    /// Moves before, in which the proposals are fitted, 500 by default.
    pub burn_in: usize,
    /// Standard deviation of the first proposals in every free coordinate (see [`Law`](super::Law)), 0.3 by
    /// default.
    pub first_step: f64,
}

impl Default for ChainSettings {
    fn default() -> Self {
        ChainSettings { draws: 2000, burn_in: 500, first_step: 0.3 }
    }
}

/// A chain after its burn-in.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain<const K: usize> {
    /// Values of the parameters, one per move: repeated where the move was rejected.
    pub draws: Vec<[f64; K]>,
    /// The log-likelihood of each, as it was estimated when the chain came there.
    pub log_likelihoods: Vec<f64>,
    /// Share of moves that were accepted.
    pub accepted: f64,
    /// Proposals whose likelihood was zero, those outside the prior and those that a model refused.
    pub impossible: usize,
}

impl<const K: usize> Chain<K> {
    /// Mean of the values of a function.
    pub fn mean(&self, of: impl Fn(&[f64; K]) -> f64) -> f64 {
        self.draws.iter().map(of).sum::<f64>() / self.draws.len() as f64
    }

    /// Standard error of [`Chain::mean`], from the means of sqrt(n) batches of neighbours, so that what
    /// neighbours have in common is counted (Flegal and Jones, Annals of Statistics 38, 2010). NaN for fewer
    /// than four values.
    pub fn standard_error(&self, of: impl Fn(&[f64; K]) -> f64) -> f64 {
        let size = (self.draws.len() as f64).sqrt() as usize;
        let batches: Vec<f64> = self
            .draws
            .chunks_exact(size.max(1))
            .map(|batch| batch.iter().map(&of).sum::<f64>() / batch.len() as f64)
            .collect();
        let count = batches.len() as f64;
        let mean = batches.iter().sum::<f64>() / count;
        let square: f64 = batches.iter().map(|b| (b - mean) * (b - mean)).sum();
        (square / (count - 1.0) / count).sqrt()
    }
}

/// Particle marginal Metropolis-Hastings (Andrieu, Doucet and Holenstein, Journal of the Royal Statistical
/// Society B 72(3), 2010) from `start`: a random walk over the parameters whose moves are accepted with the
/// ratio of priors times *estimated* likelihoods. Where the estimates of `log_likelihood` are unbiased before
/// the logarithm is taken, as those of particle filters are, the chain has the posterior itself as its law,
/// whatever their spread; what spread there is makes it stick. About as many particles serve best as give the
/// log-likelihood a standard deviation of 1 to 1.7 (Doucet, Pitt, Deligiannidis and Kohn, Biometrika 102(2),
/// 2015). The estimate of the current value is kept, never made anew. With exact likelihoods it is the
/// algorithm of Metropolis and Hastings.
///
/// In the burn-in the covariance of the steps and their size are fitted (Andrieu and Thoms, Statistics and
/// Computing 18, 2008, algorithm 4); then they stay. Each move hands another [`Stream`] to `log_likelihood`.
/// -inf means impossible: return it where a model refuses the value.
///
/// # Errors
/// A start outside the prior or of likelihood zero, settings out of range, a log-likelihood that is NaN or
/// +inf, and the errors of `log_likelihood`.
pub fn particle_metropolis_hastings<const K: usize>(
    parameters: &Parameters<K>,
    start: [f64; K],
    settings: ChainSettings,
    stream: Stream,
    mut log_likelihood: impl FnMut(&[f64; K], Stream) -> Result<f64>,
) -> Result<Chain<K>> {
    Error::positive("draws of a chain", settings.draws as f64)?;
    let mut at = parameters.free(&start)?;
    let mut walk = Walk::new(at, settings.first_step)?;
    let mut likelihood = log_likelihood(&start, stream.fork(0))?;
    let (mut theta, stretch) = parameters.bound(&at);
    let mut height = Error::finite(
        "log-density of the posterior at the start",
        likelihood + parameters.log_prior(&theta) + stretch,
    )?;

    let (mut draws, mut log_likelihoods) =
        (Vec::with_capacity(settings.draws), Vec::with_capacity(settings.draws));
    let (mut accepted, mut impossible) = (0usize, 0);
    for k in 1..=settings.burn_in + settings.draws {
        let mut random = stream.draws(Purpose::Parameter, k as u64, 0);
        let to = walk.propose(&at, &mut random);
        let (proposed, stretch) = parameters.bound(&to);
        let prior = parameters.log_prior(&proposed) + stretch;
        let estimate = if prior > f64::NEG_INFINITY {
            log_checked(log_likelihood(&proposed, stream.fork(k as u64))?)?
        } else {
            f64::NEG_INFINITY
        };
        let there = estimate + prior;
        let chance = chance(there, height);
        let taken = random.uniform() < chance;
        if taken {
            (at, theta, height, likelihood) = (to, proposed, there, estimate);
        }
        if k <= settings.burn_in {
            walk.learn(&at, chance);
        } else {
            accepted += usize::from(taken);
            impossible += usize::from(there == f64::NEG_INFINITY);
            draws.push(theta);
            log_likelihoods.push(likelihood);
        }
    }
    let accepted = accepted as f64 / settings.draws as f64;
    Ok(Chain { draws, log_likelihoods, accepted, impossible })
}
