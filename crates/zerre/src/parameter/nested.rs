//! SMC^2: a particle filter over parameters whose every particle has a filter of its own.

use super::walk::{Walk, chance, log_checked};
use super::{Parameters, run};
use crate::belief::Fork;
use crate::error::{Error, Result};
use crate::filter::Filter;
use crate::kernels::Threads;
use crate::math::{Matrix, exp, ln};
use crate::resample::{Resampler, Resampling};
use crate::rng::{Purpose, Stream};
use crate::time::Time;
use std::array::from_fn;
use std::borrow::Borrow;

/// Settings of [`SmcSquared`].
#[derive(Clone, Debug)]
pub struct NestedSettings {
    /// Values of the parameters that are carried along, 500 by default.
    pub values: usize,
    /// Values are drawn and moved anew once their effective number falls below this share of them, one half
    /// by default.
    pub trigger: f64,
    /// How often each value is then moved, 3 by default.
    pub moves: usize,
    /// Particles that filters begin with, 100 by default.
    pub particles: usize,
    /// Particles that they may get: the number is doubled whenever less than a fifth of the moves are
    /// accepted. 12 800 by default.
    pub most_particles: usize,
    /// Threads over the values; results do not depend on them.
    pub threads: Threads,
}

impl Default for NestedSettings {
    fn default() -> Self {
        NestedSettings {
            values: 500,
            trigger: 0.5,
            moves: 3,
            particles: 100,
            most_particles: 12_800,
            threads: Threads::Serial,
        }
    }
}

/// What a step of [`SmcSquared`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NestedUpdate {
    /// ln p(z_k | z_1..k-1) of the model, its parameters summed out under their priors; 0 without a
    /// measurement, -inf where it is impossible under all values: it then does not count.
    pub log_evidence: f64,
    /// Effective number of values, before they were moved.
    pub ess: f64,
    /// Share of moves that were accepted, where there were any.
    pub accepted: Option<f64>,
    /// Particles that filters have from here on.
    pub particles: usize,
}

/// Less than this share of moves accepted asks for more particles.
const LEAST_ACCEPTED: f64 = 0.2;

/// The posterior of parameters and state, and the evidence of a model, after each measurement (SMC^2: Chopin,
/// Jacob and Papaspiliopoulos, Journal of the Royal Statistical Society B 75(3), 2013). Values drawn from the
/// prior are weighted by the evidence that their filters give; once few of them count they are drawn by
/// weight and moved by particle marginal Metropolis-Hastings with steps of their own covariance, over all
/// measurements so far. Filters get twice as many particles where moves are rarely accepted (the exchange
/// step of section 3.6). With a filter that is exact it is iterated batch importance sampling (Chopin,
/// Biometrika 89, 2002).
///
/// The cost of a move grows with the number of measurements, while moves become rarer: all in all it grows
/// with the square of that number.
pub struct SmcSquared<const K: usize, F: Filter, Z, M> {
    parameters: Parameters<K>,
    settings: NestedSettings,
    model: M,
    stream: Stream,
    start: Time,
    data: Vec<(Time, Option<Z>)>,
    particles: usize,
    members: Vec<Member<K, F>>,
    log_evidence: f64,
}

/// A value and what its filter knows.
struct Member<const K: usize, F: Filter> {
    free: [f64; K],
    theta: [f64; K],
    /// Of the prior, in free coordinates.
    log_prior: f64,
    filter: F,
    belief: F::Belief,
    log_likelihood: f64,
    /// Normalised.
    log_weight: f64,
}

impl<const K: usize, F, Z, M> SmcSquared<K, F, Z, M>
where
    F: Filter + Send,
    F::Belief: Fork + Send,
    Z: Borrow<F::Measurement> + Sync,
    M: Fn(&[f64; K], usize) -> Result<F> + Sync,
{
    /// Begins at `start`, before any measurement. `model` gives the filter of a value of the parameters, with
    /// so many particles if it has any; what its models refuse must be outside the prior.
    ///
    /// # Errors
    /// Settings out of range; what the model and its filters refuse.
    pub fn new(
        parameters: &Parameters<K>,
        settings: NestedSettings,
        start: Time,
        stream: Stream,
        model: M,
    ) -> Result<Self> {
        Error::positive("number of values of the parameters", settings.values as f64)?;
        Error::positive("number of particles", settings.particles as f64)?;
        Error::not_negative("share that triggers moves", settings.trigger)?;
        let log_weight = -ln(settings.values as f64);
        let begin = |i: usize| {
            let own = stream.fork(i as u64);
            let theta = parameters.draw(&mut own.draws(Purpose::Prior, 0, 0));
            let free = parameters.free(&theta)?;
            let (theta, stretch) = parameters.bound(&free);
            let filter = model(&theta, settings.particles)?;
            let belief = filter.start(start, own)?;
            let log_prior = parameters.log_prior(&theta) + stretch;
            Ok(Member { free, theta, log_prior, filter, belief, log_likelihood: 0.0, log_weight })
        };
        let members = (0..settings.values).map(begin).collect::<Result<_>>()?;
        let (parameters, particles) = (parameters.clone(), settings.particles);
        let (data, log_evidence) = (Vec::new(), 0.0);
        Ok(SmcSquared { parameters, settings, model, stream, start, data, particles, members, log_evidence })
    }

    /// Takes in a measurement, or a time without one.
    ///
    /// # Errors
    /// What the filter of the first value refuses (a measurement that is not finite, a step back in time):
    /// all is then as it was. What the model or another filter refuses: nothing can go on then.
    pub fn step(&mut self, to: Time, z: Option<Z>) -> Result<NestedUpdate> {
        if let Some(first) = self.members.first() {
            first.filter.step(&mut first.belief.clone(), to, z.as_ref().map(Borrow::borrow))?;
        }
        self.data.push((to, z));
        let z = self.data.last().and_then(|(_, z)| z.as_ref());
        let is_seen = z.is_some();
        let gains = each(&self.settings.threads, &mut self.members, |_, member| {
            let update = member.filter.step(&mut member.belief, to, z.map(Borrow::borrow))?;
            Ok(update.log_evidence)
        })?;
        let both = |(member, gain): (&Member<K, F>, &f64)| member.log_weight + gain;
        let mut log_evidence = log_sum_exp(self.members.iter().zip(&gains).map(both));
        if !is_seen {
            log_evidence = 0.0;
        } else if log_evidence > f64::NEG_INFINITY {
            for (member, gain) in self.members.iter_mut().zip(&gains) {
                member.log_weight += gain - log_evidence;
                member.log_likelihood += gain;
            }
        } else if let Some((_, z)) = self.data.last_mut() {
            // All filters have predicted without it, and will when they run again.
            *z = None;
        }
        self.log_evidence += log_evidence;
        let ess = self.ess();
        let few = self.settings.trigger * self.members.len() as f64;
        let accepted = if ess < few { Some(self.rejuvenate()?) } else { None };
        Ok(NestedUpdate { log_evidence, ess, accepted, particles: self.particles })
    }

    /// Draws the values by weight and moves them. Returns the share of moves that were accepted.
    fn rejuvenate(&mut self) -> Result<f64> {
        let SmcSquared { parameters, settings, model, stream, start, data, particles, members, .. } = self;
        // Apart from the labels of the first values.
        let round = stream.fork(u64::MAX).fork(data.len() as u64);
        let weights: Vec<f64> = members.iter().map(|member| exp(member.log_weight)).collect();
        let walk = Walk::of_covariance(&covariance(&weights, members))?;
        let mut ancestors = vec![0; members.len()];
        Resampler::new(Resampling::Systematic).ancestors(&weights, round, 0, &mut ancestors)?;
        let log_weight = -ln(members.len() as f64);
        let copy = |(label, &ancestor): (u64, &u32)| {
            let Member { free, theta, log_prior, ref belief, log_likelihood, .. } =
                members[ancestor as usize];
            let (filter, belief) = (model(&theta, *particles)?, belief.fork(label));
            Ok(Member { free, theta, log_prior, filter, belief, log_likelihood, log_weight })
        };
        *members = (0..).zip(&ancestors).map(copy).collect::<Result<_>>()?;
        let accepted = each(&settings.threads, members, |i, member| {
            let own = round.fork(i as u64);
            let mut accepted = 0;
            for k in 0..settings.moves {
                let mut random = own.draws(Purpose::Parameter, k as u64, 0);
                let free = walk.propose(&member.free, &mut random);
                let (theta, stretch) = parameters.bound(&free);
                let log_prior = parameters.log_prior(&theta) + stretch;
                if log_prior == f64::NEG_INFINITY {
                    continue;
                }
                let filter = model(&theta, *particles)?;
                let (belief, sum) = run(&filter, *start, data, own.fork(k as u64))?;
                let (there, here) = (log_checked(sum)? + log_prior, member.log_likelihood + member.log_prior);
                if random.uniform() < chance(there, here) {
                    let log_likelihood = sum;
                    *member = Member { free, theta, log_prior, filter, belief, log_likelihood, log_weight };
                    accepted += 1;
                }
            }
            Ok(accepted)
        })?;
        let accepted = accepted.iter().sum::<usize>() as f64 / (members.len() * settings.moves).max(1) as f64;
        if accepted < LEAST_ACCEPTED && 2 * *particles <= settings.most_particles {
            *particles *= 2;
            each(&settings.threads, members, |i, member| {
                member.filter = model(&member.theta, *particles)?;
                let own = round.fork(i as u64).fork(u64::MAX);
                let (belief, sum) = run(&member.filter, *start, data, own)?;
                member.log_weight += log_checked(sum)? - member.log_likelihood;
                (member.belief, member.log_likelihood) = (belief, sum);
                Ok(())
            })?;
            let sum = log_sum_exp(members.iter().map(|member| member.log_weight));
            Error::finite("log-weight after an exchange of filters", sum)?;
            members.iter_mut().for_each(|member| member.log_weight -= sum);
        }
        Ok(accepted)
    }
}

impl<const K: usize, F: Filter, Z, M> SmcSquared<K, F, Z, M> {
    /// ln p(z_1..k) of the model, its parameters summed out under their priors.
    pub fn log_evidence(&self) -> f64 {
        self.log_evidence
    }

    /// Effective number of values.
    pub fn ess(&self) -> f64 {
        1.0 / self.members.iter().map(|member| exp(2.0 * member.log_weight)).sum::<f64>()
    }

    /// Weight of each value, the value, and what its filter knows of the state. Weights sum to one.
    pub fn values(&self) -> impl Iterator<Item = (f64, &[f64; K], &F::Belief)> {
        self.members.iter().map(|member| (exp(member.log_weight), &member.theta, &member.belief))
    }

    /// Posterior mean of a function of the parameters.
    pub fn mean(&self, of: impl Fn(&[f64; K]) -> f64) -> f64 {
        self.values().map(|(weight, theta, _)| weight * of(theta)).sum()
    }
}

/// Runs `work` for every item, on as many threads as there are; its results in order, or the first error.
fn each<T: Send, R: Send>(
    threads: &Threads,
    items: &mut [T],
    work: impl Fn(usize, &mut T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let mut places: Vec<(&mut T, Option<Result<R>>)> = items.iter_mut().map(|item| (item, None)).collect();
    threads.share(&mut places, |i, (item, result)| *result = Some(work(i, item)));
    places.into_iter().filter_map(|(_, result)| result).collect()
}

/// ln of the sum of exponentials; -inf of none.
fn log_sum_exp(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let max = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if max == f64::NEG_INFINITY { max } else { max + ln(logs.map(|log| exp(log - max)).sum::<f64>()) }
}

/// Covariance of the values in free coordinates.
fn covariance<const K: usize, F: Filter>(weights: &[f64], members: &[Member<K, F>]) -> Matrix<K, K> {
    let mean: [f64; K] = from_fn(|k| weights.iter().zip(members).map(|(w, m)| w * m.free[k]).sum());
    weights.iter().zip(members).fold(Matrix::ZERO, |sum, (&w, member)| {
        let off: [f64; K] = from_fn(|k| member.free[k] - mean[k]);
        sum + Matrix::outer(&off, &off) * w
    })
}
