//! Likelihoods that are taken in by degrees: a peaked measurement moves the particles instead of killing them.

use crate::belief::{Gaussian, Lineage, MovedCloud, Pull, moments};
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, ParticleFilter, Prior, Settings, Update};
use crate::kernels::BLOCK;
use crate::math::Real;
use crate::model::{Likelihood, Motion, TransitionDensity};
use crate::moves::{Move, Moved, PathLaw, Sweeps, spread_of};
use crate::rng::Stream;
use crate::time::Time;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A particle filter that takes p(z | x) in by growing powers (annealed importance sampling within a step: Neal,
/// Statistics and Computing 11, 2001; Del Moral, Doucet and Jasra, Journal of the Royal Statistical Society B 68,
/// 2006). Each power is the largest that leaves a given share of the particles effective; then the particles are
/// resampled, and moved by a Markov kernel under p(z | x)^power p(x | x_a), a being the parent. A measurement that
/// leaves enough of them effective at once is taken in at once, and the filter is a [`ParticleFilter`]. The motion
/// must have a transition density.
///
/// The effective share is that of the new weights given the old ones (the conditional effective sample size of
/// Zhou, Johansen and Aston, Journal of Computational and Graphical Statistics 25, 2016). Because powers are chosen
/// by the particles that they weigh, the exponential of the log-evidence has a bias, of the order of 1 / n.
#[derive(Clone, Debug)]
pub struct Tempered<const N: usize, const W: usize, A, H, P = Gaussian<N>> {
    filter: ParticleFilter<N, W, A, H, P>,
    moves: Sweeps,
    share: f64,
}

/// Powers of one step; the last takes in what is left. Reached only by likelihoods that differ by some 1e60
/// nats.
const MOST_POWERS: u64 = 200;
/// How near the effective share comes to the wanted one, relatively.
const NEAR: f64 = 0.01;

impl<const N: usize, const W: usize, A, H, P> Tempered<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// Takes measurements in by powers that leave half of the particles of `filter` effective, with so many moves
    /// of each particle by `kernel` after each resampling. After the last power the particles are resampled and
    /// moved where the trigger of `filter` says so.
    ///
    /// # Errors
    /// Parameters of the kernel out of range; a filter that rejuvenates its particles itself, changes their
    /// number or looks ahead. A motion without a density is refused by the first step that takes time.
    pub fn new(filter: ParticleFilter<N, W, A, H, P>, kernel: Move, sweeps: u32) -> Result<Self> {
        filter.settings().for_own_weights()?;
        let moves = Sweeps { kernel, count: sweeps };
        moves.check()?;
        Ok(Tempered { filter, moves, share: 0.5 })
    }

    /// The same with another share of the particles that each power leaves effective: more takes more powers.
    ///
    /// # Errors
    /// A share outside (0, 1).
    pub fn with_share(self, share: f64) -> Result<Self> {
        if !(share > 0.0 && share < 1.0) {
            let needs = "it must lie between 0 and 1";
            return Err(Error::OutOfRange { what: "effective share of the particles", value: share, needs });
        }
        Ok(Tempered { share, ..self })
    }

    /// Writes the log-likelihood of each particle, -inf where it has none; returns how many are no numbers.
    fn score(&self, belief: &mut MovedCloud<N>, digest: &H::Digest<'_>) -> usize {
        let &Settings { simd, ref threads, .. } = self.filter.settings();
        let MovedCloud { cloud, likelihoods, .. } = belief;
        let states = cloud.states.each_mut().map(Vec::as_mut_slice);
        // Of a type without size: this takes no memory.
        let mut blocks = vec![(); likelihoods.len().div_ceil(BLOCK)];
        let lost = AtomicUsize::new(0);
        threads.for_each_block(states, [likelihoods], &mut blocks[..], |_, states, [scores], _: &mut ()| {
            H::score(digest, simd, &states.each_ref().map(|c| &**c), scores);
            for score in scores.iter_mut().filter(|s| s.is_nan() || **s == f64::INFINITY) {
                *score = f64::NEG_INFINITY;
                lost.fetch_add(1, Ordering::Relaxed);
            }
        });
        lost.into_inner()
    }
}

/// ln sum W u and the effective share (sum W u)^2 / sum W u^2 of weights W times u = exp(power l).
fn taken(weights: &[f64], likelihoods: &[f64], power: f64) -> (f64, f64) {
    let heavy = weights.iter().zip(likelihoods).filter(|(weight, _)| **weight > 0.0);
    let max = heavy.map(|(_, likelihood)| *likelihood).fold(f64::NEG_INFINITY, f64::max);
    let (mut total, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for (weight, likelihood) in weights.iter().zip(likelihoods) {
        let u = Real::exp((power * (likelihood - max)).min(0.0));
        total += weight;
        sum += weight * u;
        squares += weight * u * u;
    }
    (power * max + Real::ln(sum / total), sum * sum / (squares * total))
}

/// The largest power up to `most` that leaves `share` of what is possible effective.
fn next_power(weights: &[f64], likelihoods: &[f64], most: f64, share: f64) -> f64 {
    let effective = |power: f64| taken(weights, likelihoods, power).1;
    // Particles that the measurement makes impossible are lost to any power.
    let goal = share * effective(f64::MIN_POSITIVE);
    if effective(most) >= goal {
        return most;
    }
    // ln of a power that is too small, and of one that is too large.
    let (mut low, mut high) = (None, Real::ln(most));
    let mut stride = 1.0;
    for _ in 0..200 {
        let middle = low.map_or(high - stride, |low: f64| 0.5 * (low + high));
        let power = Real::exp(middle);
        let found = effective(power);
        if (found - goal).abs() <= NEAR * goal || power == 0.0 {
            return power;
        }
        if found > goal {
            low = Some(middle);
        } else {
            (high, stride) = (middle, 2.0 * stride);
        }
    }
    Real::exp(low.unwrap_or(high))
}

impl<const N: usize, const W: usize, A, H, P> Filter for Tempered<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = MovedCloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<MovedCloud<N>> {
        let mut belief = MovedCloud::new(self.filter.start(at, stream)?);
        belief.chosen.reserve(belief.cloud.len());
        Ok(belief)
    }

    fn step(&self, belief: &mut MovedCloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let from = belief.cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let (Some(z), true) = (z, to > from) else {
            let update = self.filter.step(&mut belief.cloud, to, z)?;
            (belief.moved, belief.pull) = (Moved::default(), None);
            return Ok(update);
        };
        let density = TransitionDensity::over(self.filter.motion(), from, to, &belief.cloud.mean())?;
        let digest = self.filter.sensor().digest(z, to)?;
        let &Settings { simd, ref threads, trigger, resampling, .. } = self.filter.settings();
        belief.remember_parents(simd);
        let mut update = self.filter.step(&mut belief.cloud, to, None)?;
        (belief.moved, belief.pull) = (Moved::default(), None);
        let n = belief.cloud.len();
        let not_finite = self.score(belief, &digest);
        let MovedCloud { cloud, likelihoods, chosen, .. } = &mut *belief;
        let stream = cloud.stream;
        let possible = |(score, weight): (&f64, f64)| *score > f64::NEG_INFINITY && weight > 0.0;
        if !likelihoods.iter().zip(cloud.weights()).any(possible) {
            update.outcome = Outcome::Degenerate;
            update.log_evidence = f64::NEG_INFINITY;
            if let Some(particles) = &mut update.particles {
                (particles.not_finite, particles.evaluations) = (particles.not_finite + not_finite, n);
            }
            return Ok(update);
        }
        chosen.clear();
        chosen.extend(0..n as u32);
        let (mut power, mut log_evidence, mut powers) = (0.0, 0.0, 0);
        loop {
            powers += 1;
            let MovedCloud { cloud, likelihoods, densities: weights, .. } = &mut *belief;
            weights.clear();
            weights.extend(cloud.weights());
            let left = 1.0 - power;
            let more = match powers {
                MOST_POWERS => left,
                _ => next_power(weights, likelihoods, left, self.share),
            };
            let is_last = more >= left;
            power = if is_last { 1.0 } else { power + more };
            log_evidence += taken(weights, likelihoods, more).0;
            for ((score, &weight), &likelihood) in cloud.scores.iter_mut().zip(&*weights).zip(&*likelihoods) {
                *score =
                    if weight > 0.0 { more.mul_add(likelihood, Real::ln(weight)) } else { f64::NEG_INFINITY };
            }
            let total = cloud.weigh(simd);
            let ess = total.ess();
            let resampled = !is_last || trigger.fires(ess, n);
            if let Some(particles) = &mut update.particles {
                (particles.ess, particles.resampled) = (ess, resampled);
            }
            if !resampled {
                cloud.keep_weights(total.log_sum());
                break;
            }
            let spread = spread_of(cloud);
            cloud.stream = stream.fork(powers);
            cloud.resample(resampling, (simd, threads), &total, n);
            belief.branch(simd);
            let MovedCloud { cloud, parents, densities, likelihoods, frozen, moved, pull, chosen, .. } =
                &mut *belief;
            for ancestor in &mut cloud.ancestors {
                *ancestor = chosen[*ancestor as usize];
            }
            chosen.copy_from_slice(&cloud.ancestors);
            let law = PathLaw::<A, H, N, W> { density: &density, digest: &digest, parents, power, simd };
            densities.copy_from_slice(likelihoods);
            law.complete(0, &cloud.states.each_ref().map(Vec::as_slice), densities);
            let before = moments(&cloud.states);
            *moved += self.moves.run(cloud, densities, frozen, &law, (threads, spread));
            let after = moments(&cloud.states);
            *pull = Some(pull.map_or(Pull::between(before, after), |first| first.then(before, after)));
            law.likelihoods(&cloud.states, densities, likelihoods);
            cloud.equalise();
            cloud.lineage = Lineage::Ancestors;
            if is_last {
                break;
            }
        }
        belief.cloud.stream = stream;
        update.outcome = Outcome::Updated;
        update.log_evidence = log_evidence;
        if let Some(particles) = &mut update.particles {
            particles.not_finite += not_finite;
            particles.evaluations = n + belief.moved.evaluations;
            particles.distinct_ancestors = belief.chosen.chunk_by(|a, b| a == b).count();
        }
        Ok(update)
    }
}
