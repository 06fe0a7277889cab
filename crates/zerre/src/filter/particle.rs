//! The particle filter: sequential importance sampling with resampling (Gordon, Salmond and Smith, IEE Proceedings F
//! 140, 1993), with the transition as proposal.

use crate::belief::{Cloud, Gaussian, MAX_PARTICLES};
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, ParticleUpdate, Update};
use crate::kernels::{
    self, BLOCK, NoiseBlock, NoiseKey, NoiseSource, Resolution, Simd, Source, Survivors, Threads, Total,
};
use crate::math::{Cholesky, Real};
use crate::model::{Likelihood, Motion, Noise};
use crate::resample::{BlockWeights, Context, Resampling, Trigger};
use crate::rng::{Purpose, Stream};
use crate::time::Time;

/// Where the first particles come from.
pub trait Prior<const N: usize>: Send + Sync {
    /// `n` independent states in columns.
    ///
    /// # Errors
    /// A law that cannot be drawn from.
    fn columns(&self, stream: Stream, n: usize) -> Result<[Vec<f64>; N]>;
}

impl<const N: usize> Prior<N> for Gaussian<N> {
    fn columns(&self, stream: Stream, n: usize) -> Result<[Vec<f64>; N]> {
        // Not triangular: a semidefinite factor takes its pivots in the order of their size.
        let factor = Cholesky::semidefinite("covariance of the prior", self.covariance())?;
        let mut columns = std::array::from_fn(|_| vec![0.0; n]);
        let source = NoiseSource { resolution: Resolution::Bits64, ..NoiseSource::default() };
        let mut noise = NoiseBlock::<N>::new();
        for (block, first) in (0..n).step_by(BLOCK).enumerate() {
            let last = n.min(first + BLOCK);
            let key = NoiseKey { stream, purpose: Purpose::Prior, step: 0, block };
            kernels::fill_noise(
                Simd::best(),
                source,
                Noise::StandardNormal,
                key,
                (last - first, N),
                &mut noise,
            );
            let mut states = columns.each_mut().map(|c| &mut c[first..last]);
            kernels::draw_normal(Simd::best(), self.mean(), &factor.0, &noise, &mut states);
        }
        Ok(columns)
    }
}

/// Settings of a [`ParticleFilter`].
#[derive(Clone, Debug)]
pub struct Settings {
    /// Number of particles, 1 000 by default.
    pub particles: usize,
    /// How to resample.
    pub resampling: Resampling,
    /// When to resample.
    pub trigger: Trigger,
    /// Roughening (Gordon, Salmond and Smith, section 3.2): after resampling, component k gets normal jitter of
    /// standard deviation `roughening` E_k n^(-1/N), E_k being the spread between the largest and the smallest
    /// particle. 0 (the default) for none; 0.2 is the authors' value. It widens the posterior.
    pub roughening: f64,
    /// How process noise is made.
    pub noise: NoiseSource,
    /// Instructions to use; results do not depend on it.
    pub simd: Simd,
    /// Threads to use; results do not depend on them.
    pub threads: Threads,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            particles: 1000,
            resampling: Resampling::default(),
            trigger: Trigger::default(),
            roughening: 0.0,
            noise: NoiseSource::default(),
            simd: Simd::best(),
            threads: Threads::Serial,
        }
    }
}

/// A particle filter for a motion model `M`, a sensor `H` and a prior `P`.
#[derive(Clone, Debug)]
pub struct ParticleFilter<const N: usize, const W: usize, M, H, P = Gaussian<N>> {
    prior: P,
    motion: M,
    sensor: H,
    settings: Settings,
}

impl<const N: usize, const W: usize, M, H, P> ParticleFilter<N, W, M, H, P>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// A filter from its models.
    ///
    /// # Errors
    /// No or too many particles, a trigger or roughening out of range.
    pub fn new(prior: P, motion: M, sensor: H, settings: Settings) -> Result<Self> {
        if settings.particles == 0 || settings.particles > MAX_PARTICLES {
            let value = settings.particles as f64;
            return Err(Error::OutOfRange {
                what: "number of particles",
                value,
                needs: "it must lie between 1 and 2^26",
            });
        }
        if let Trigger::Below(fraction) = settings.trigger {
            Error::not_negative("fraction that triggers resampling", fraction)?;
        }
        Error::not_negative("roughening", settings.roughening)?;
        Ok(ParticleFilter { prior, motion, sensor, settings })
    }

    /// Settings of the filter.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Moves and weighs all blocks; fills `cloud.scores`, `weights` and `blocks`. Without a digest the weights stay
    /// what they were.
    fn visit(&self, cloud: &mut Cloud<N>, step: Option<&M::Step>, digest: Option<&H::Digest<'_>>) {
        let Settings { simd, noise: source, ref threads, .. } = self.settings;
        let (law, components) = (self.motion.noise(), self.motion.noise_components());
        let (stream, number) = (cloud.stream, cloud.step);
        let in_place = !cloud.pending;
        if !in_place {
            std::mem::swap(&mut cloud.states, &mut cloud.spare);
        }
        let survivors = Survivors::new(cloud.spare.each_ref().map(Vec::as_slice), &cloud.ancestors);
        let states = cloud.states.each_mut().map(Vec::as_mut_slice);
        let scores: [&mut [f64]; 2] = [&mut cloud.scores, &mut cloud.weights];
        let log_weights = (!cloud.equal).then_some(&cloud.log_weights);
        threads.for_each_block(
            states,
            scores,
            &mut cloud.blocks,
            |b, mut states, [scores, weights], sums| {
                let (first, last) = (b * BLOCK, b * BLOCK + scores.len());
                let survivors = (!in_place).then(|| survivors.block(simd, first, last));
                if let Some(step) = step {
                    let mut noise = NoiseBlock::<W>::new();
                    let key = NoiseKey { stream, purpose: Purpose::Motion, step: number, block: b };
                    kernels::fill_noise(simd, source, law, key, (last - first, components), &mut noise);
                    let source = survivors.map_or(Source::Here, Source::Survivors);
                    kernels::propagate::<N, W, M>(simd, step, &noise, source, &mut states);
                } else if let Some(survivors) = survivors {
                    kernels::gather(survivors, &mut states);
                }
                let states = states.each_ref().map(|c| &**c);
                match digest {
                    Some(digest) => H::score(digest, simd, &states, scores),
                    None => scores.fill(0.0),
                }
                let log_weights = log_weights.map(|l| &l[first..last]);
                *sums = kernels::weigh(simd, log_weights, scores, &states, weights);
            },
        );
        cloud.pending = false;
    }

    /// Jitters the survivors of the last resampling.
    fn roughen(&self, cloud: &mut Cloud<N>) {
        let n = cloud.len();
        let scale = self.settings.roughening * Real::exp(-Real::ln(n as f64) / N as f64);
        std::mem::swap(&mut cloud.states, &mut cloud.spare);
        let survivors = Survivors::new(cloud.spare.each_ref().map(Vec::as_slice), &cloud.ancestors);
        let survivors = survivors.block(self.settings.simd, 0, n);
        kernels::gather(survivors, &mut cloud.states.each_mut().map(Vec::as_mut_slice));
        cloud.pending = false;
        let sd: [f64; N] = std::array::from_fn(|k| {
            let column = &cloud.states[k];
            let low = column.iter().copied().fold(f64::INFINITY, f64::min);
            let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            scale * (high - low)
        });
        for i in 0..n {
            let mut draws = cloud.stream.draws(Purpose::Roughen, cloud.step, i as u32);
            for k in 0..N {
                cloud.states[k][i] += sd[k] * draws.normal();
            }
        }
    }

    /// Makes particles worthless whose likelihood is NaN or infinite or whose state is lost; returns how many there
    /// were. A state that is no number would spoil the sums even at weight zero: it becomes zero, and the particle
    /// stays worthless even if the measurement is taken back.
    fn mend(&self, cloud: &mut Cloud<N>) -> usize {
        let mut count = 0;
        for i in 0..cloud.len() {
            let score = cloud.scores[i];
            let lost = cloud.states.iter().any(|c| !c[i].is_finite());
            let had_weight = cloud.equal || cloud.log_weights[i] != f64::NEG_INFINITY;
            if lost || score.is_nan() || score == f64::INFINITY {
                count += usize::from(had_weight);
                cloud.scores[i] = f64::NEG_INFINITY;
            }
            if lost {
                if cloud.equal {
                    cloud.log_weights.fill(0.0);
                    cloud.equal = false;
                }
                cloud.log_weights[i] = f64::NEG_INFINITY;
                cloud.states.iter_mut().for_each(|c| c[i] = 0.0);
            }
        }
        for b in 0..cloud.blocks.len() {
            let range = b * BLOCK..((b + 1) * BLOCK).min(cloud.log_weights.len());
            let states = cloud.states.each_ref().map(|c| &c[range.clone()]);
            let (scores, weights) = (&mut cloud.scores[range.clone()], &mut cloud.weights[range]);
            cloud.blocks[b] = kernels::weigh(self.settings.simd, None, scores, &states, weights);
        }
        count
    }

    /// Draws the survivors; they are gathered when the next step moves them.
    fn resample(&self, cloud: &mut Cloud<N>, total: &Total<N>) -> usize {
        let pairs = cloud.scratch.pairs(&cloud.blocks, total.max);
        let context = Context {
            level: self.settings.simd,
            threads: &self.settings.threads,
            stream: cloud.stream,
            step: cloud.step,
        };
        let from = BlockWeights { weights: &cloud.weights, blocks: &pairs };
        let drawn = self.settings.resampling.draw(context, from, &mut cloud.scratch, &mut cloud.ancestors);
        cloud.scratch.return_pairs(pairs);
        (cloud.pending, cloud.equal) = (true, true);
        cloud.log_sum = Real::ln(cloud.len() as f64);
        drawn
    }
}

impl<const N: usize, const W: usize, M, H, P> Filter for ParticleFilter<N, W, M, H, P>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = Cloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<Cloud<N>> {
        Cloud::from_columns(at, stream, self.prior.columns(stream, self.settings.particles)?)
    }

    fn step(&self, cloud: &mut Cloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        if to < cloud.time {
            return Err(Error::OutOfOrder { from: cloud.time, to });
        }
        let digest = z.map(|z| self.sensor.digest(z, to)).transpose()?;
        let moved = (to > cloud.time).then(|| self.motion.over(cloud.time, to)).transpose()?;
        if cloud.pending && self.settings.roughening > 0.0 {
            self.roughen(cloud);
        }
        cloud.step += 1;
        let n = cloud.len();
        self.visit(cloud, moved.as_ref(), digest.as_ref());
        cloud.time = to;

        let mut total = cloud.total();
        let mut not_finite = 0;
        if !(total.sum.is_finite()
            && total.max < f64::INFINITY
            && total.sum_states.iter().all(|s| s.is_finite()))
        {
            not_finite = self.mend(cloud);
            total = cloud.total();
        }
        let mut particles =
            ParticleUpdate { ess: total.ess(), resampled: false, distinct_ancestors: n, not_finite };
        if total.max == f64::NEG_INFINITY {
            // The measurement has no likelihood anywhere: take it back. The scores were not yet the log-weights.
            self.restore_weights(cloud);
            let total = cloud.total();
            (particles.ess, cloud.log_sum) = (total.ess(), total.log_sum());
            return Ok(Update {
                outcome: Outcome::Degenerate,
                log_evidence: f64::NEG_INFINITY,
                particles: Some(particles),
            });
        }
        let log_sum = total.log_sum();
        let log_evidence = if digest.is_some() { log_sum - cloud.log_sum } else { 0.0 };
        if digest.is_some() && self.settings.trigger.fires(particles.ess, n) {
            particles.resampled = true;
            particles.distinct_ancestors = self.resample(cloud, &total);
        } else if digest.is_some() || not_finite > 0 {
            std::mem::swap(&mut cloud.log_weights, &mut cloud.scores);
            (cloud.equal, cloud.log_sum) = (false, log_sum);
        }
        let outcome = if digest.is_some() { Outcome::Updated } else { Outcome::Predicted };
        Ok(Update { outcome, log_evidence, particles: Some(particles) })
    }
}

impl<const N: usize, const W: usize, M, H, P> ParticleFilter<N, W, M, H, P>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// Weights and sums as they were before the last measurement, for the states as they are now.
    fn restore_weights(&self, cloud: &mut Cloud<N>) {
        for b in 0..cloud.blocks.len() {
            let range = b * BLOCK..((b + 1) * BLOCK).min(cloud.log_weights.len());
            let states = cloud.states.each_ref().map(|c| &c[range.clone()]);
            let (scores, weights) = (&mut cloud.scores[range.clone()], &mut cloud.weights[range.clone()]);
            scores.fill(0.0);
            let log_weights = (!cloud.equal).then(|| &cloud.log_weights[range]);
            cloud.blocks[b] = kernels::weigh(self.settings.simd, log_weights, scores, &states, weights);
        }
    }
}
