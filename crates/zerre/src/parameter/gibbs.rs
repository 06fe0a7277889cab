//! Particle Gibbs sampling.

use super::walk::{Walk, chance, log_checked};
use super::{Chain, Parameters};
use crate::error::{Error, Result};
use crate::model::{Likelihood, Motion, StateSpace};
use crate::rng::{Draws, Purpose, Stream};
use crate::smooth::conditional_path;
use crate::time::Time;
use std::borrow::Borrow;

/// Settings of [`particle_gibbs`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GibbsSettings {
    /// Values of the chain that are given out, 2 000 by default.
    pub draws: usize,
    /// Turns before, in which Metropolis-Hastings steps are fitted, 500 by default.
    pub burn_in: usize,
    /// Particles of the conditional filter, 2 at least, 20 by default.
    pub particles: usize,
    /// Standard deviation of the first steps in every free coordinate (see [`Law`](super::Law)), 0.3 by
    /// default.
    pub first_step: f64,
}

impl Default for GibbsSettings {
    fn default() -> Self {
        GibbsSettings { draws: 2000, burn_in: 500, particles: 20, first_step: 0.3 }
    }
}

/// How parameters are drawn when the path is given: the state at the start and at the time of each
/// measurement.
pub enum GivenPath<'a, const K: usize, const N: usize> {
    /// By so many steps of Metropolis and Hastings under p(path, measurements | parameters) times the prior.
    Steps(u32),
    /// Exactly, by a function of the path: where priors are conjugate.
    Exact(&'a mut ExactDraw<'a, K, N>),
}

/// A draw from p(parameters | path, measurements).
pub type ExactDraw<'a, const K: usize, const N: usize> =
    dyn FnMut(&[[f64; N]], &mut Draws) -> Result<[f64; K]> + 'a;

/// What [`particle_gibbs`] gives.
#[derive(Clone, Debug, PartialEq)]
pub struct GibbsChain<const K: usize, const N: usize> {
    /// The parameters; likelihoods are those of the measurements and the path together, and acceptance is
    /// that of the steps given a path (1 for exact draws).
    pub chain: Chain<K>,
    /// The last path, from which another chain can go on.
    pub path: Vec<[f64; N]>,
    /// For each instant, the share of turns after the burn-in that gave it another state. Where it is small,
    /// more particles help.
    pub renewed: Vec<f64>,
}

/// Particle Gibbs with ancestor sampling (Andrieu, Doucet and Holenstein, Journal of the Royal Statistical
/// Society B 72(3), 2010; Lindsten, Jordan and Schön, Journal of Machine Learning Research 15, 2014): in turn
/// a path given the parameters, by [`conditional_path`], and the parameters given the path, as `given` says.
/// The chain has the posterior of parameters and path as its law for any number of particles from two on.
/// `data` are measurements or their absence in the order of time, from a state at its first member. The chain
/// begins with the parameters of `start`, and with its path or, without one, with one that is drawn.
///
/// In the burn-in the steps are fitted as those of
/// [`particle_metropolis_hastings`](super::particle_metropolis_hastings); then they stay.
///
/// # Errors
/// A start outside the prior; settings out of range; a path whose density under the prior and the models is
/// zero; what [`conditional_path`], [`StateSpace::log_density`] and the closures refuse.
pub fn particle_gibbs<A, H, Z, const K: usize, const N: usize, const W: usize>(
    parameters: &Parameters<K>,
    (start, path): ([f64; K], Option<&[[f64; N]]>),
    settings: GibbsSettings,
    stream: Stream,
    data: (Time, &[(Time, Option<Z>)]),
    mut model: impl FnMut(&[f64; K]) -> Result<StateSpace<N, A, H>>,
    mut given: GivenPath<'_, K, N>,
) -> Result<GibbsChain<K, N>>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    Z: Borrow<H::Value>,
{
    let GibbsSettings { draws: count, burn_in, particles, first_step } = settings;
    Error::positive("draws of a chain", count as f64)?;
    let mut at = parameters.free(&start)?;
    let mut walk = Walk::new(at, first_step)?;
    let mut here = model(&start)?;
    let (mut theta, stretch) = parameters.bound(&at);
    let mut prior = parameters.log_prior(&theta) + stretch;
    let mut path = match path {
        Some(path) => path.to_vec(),
        None => conditional_path(&here, data, None, particles, stream.fork(0))?,
    };
    let mut chain =
        Chain { draws: Vec::with_capacity(count), log_likelihoods: vec![], accepted: 0.0, impossible: 0 };
    let (mut accepted, mut steps) = (0usize, 0usize);
    let mut renewed = vec![0usize; path.len()];
    for k in 1..=burn_in + count {
        let is_counted = k > burn_in;
        let next = conditional_path(&here, data, Some(&path), particles, stream.fork(k as u64))?;
        if is_counted {
            renewed.iter_mut().zip(next.iter().zip(&path)).for_each(|(n, (a, b))| *n += usize::from(a != b));
        }
        path = next;
        let mut random = stream.draws(Purpose::Parameter, k as u64, 0);
        let mut likelihood;
        match &mut given {
            GivenPath::Exact(draw) => {
                theta = draw(&path, &mut random)?;
                here = model(&theta)?;
                likelihood = log_checked(here.log_density(data.0, data.1, &path)?)?;
                (accepted, steps) = (accepted + usize::from(is_counted), steps + usize::from(is_counted));
            }
            GivenPath::Steps(moves) => {
                likelihood = log_checked(here.log_density(data.0, data.1, &path)?)?;
                Error::finite("log-density of a path", likelihood + prior)?;
                for _ in 0..*moves {
                    let to = walk.propose(&at, &mut random);
                    let (proposed, stretch) = parameters.bound(&to);
                    let its_prior = parameters.log_prior(&proposed) + stretch;
                    let mut there = (f64::NEG_INFINITY, None);
                    if its_prior > f64::NEG_INFINITY {
                        let model = model(&proposed)?;
                        there = (log_checked(model.log_density(data.0, data.1, &path)?)?, Some(model));
                    }
                    let chance = chance(there.0 + its_prior, likelihood + prior);
                    let taken = random.uniform() < chance;
                    if is_counted {
                        (accepted, steps) = (accepted + usize::from(taken), steps + 1);
                        chain.impossible += usize::from(there.0 == f64::NEG_INFINITY);
                    }
                    if let (true, Some(model)) = (taken, there.1) {
                        (at, theta, prior, likelihood, here) = (to, proposed, its_prior, there.0, model);
                    }
                    if !is_counted {
                        walk.learn(&at, chance);
                    }
                }
            }
        }
        if is_counted {
            chain.draws.push(theta);
            chain.log_likelihoods.push(likelihood);
        }
    }
    chain.accepted = accepted as f64 / steps.max(1) as f64;
    let renewed = renewed.into_iter().map(|n| n as f64 / count as f64).collect();
    Ok(GibbsChain { chain, path, renewed })
}
