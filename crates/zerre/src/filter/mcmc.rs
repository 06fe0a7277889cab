//! The sequential Markov chain Monte Carlo filter: a chain in place of weights.

use crate::belief::{Cloud, Gaussian, Lineage, MAX_PARTICLES, MovedCloud, Proposals, Pull, moments};
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, ParticleUpdate, Prior, Update};
use crate::kernels::{self, BLOCK, NoiseBlock, NoiseKey, NoiseSource, Simd, Source, Survivors, Threads};
use crate::math::Real;
use crate::model::{Likelihood, Motion, TransitionDensity};
use crate::moves::{Move, Moved, PathLaw, Sweeps, spread_of};
use crate::rng::{Purpose, Stream};
use crate::time::Time;

/// Settings of a [`SequentialMcmc`] filter.
#[derive(Clone, Debug)]
pub struct McmcSettings {
    /// Number of particles: states of the chain that are kept.
    pub particles: usize,
    /// States of the chain before those; `None` for a quarter as many as are kept.
    pub burn_in: Option<usize>,
    /// Moves of each kept state with its parent fixed.
    pub kernel: Move,
    /// How many of these; they need a motion with a transition density. 0 for the chain alone.
    pub sweeps: u32,
    /// How process noise is made.
    pub noise: NoiseSource,
    /// Instructions to use; results do not depend on it.
    pub simd: Simd,
    /// Threads to use; results do not depend on them.
    pub threads: Threads,
}

impl Default for McmcSettings {
    fn default() -> Self {
        McmcSettings {
            particles: 1000,
            burn_in: None,
            kernel: Move::default(),
            sweeps: 1,
            noise: NoiseSource::default(),
            simd: Simd::best(),
            threads: Threads::Serial,
        }
    }
}

/// A filter whose particles are the states of a Markov chain on pairs of a parent a and a state x (Khan,
/// Balch and Dellaert, IEEE Transactions on Pattern Analysis and Machine Intelligence 27, 2005; Septier,
/// Pang, Carmi and Godsill, IEEE Conference on Acoustics, Speech and Signal Processing, 2009), of law p(z |
/// x) p(x | x_a) / N.
///
/// Joint proposals draw a parent and let it move; each is accepted with probability min(1, p(z | x') / p(z |
/// x)). Since they do not depend on where the chain is, all are made and weighed at once, and only the chain
/// walks through them. Every kept state is then refined by moves with its parent fixed ([`Move`]).
///
/// The particles have equal weights. The evidence is the mean likelihood of the proposals. The effective
/// sample size is that of the chain's repetitions before the refinement, and accounts for no other
/// correlation.
#[derive(Clone, Debug)]
pub struct SequentialMcmc<const N: usize, const W: usize, A, H, P = Gaussian<N>> {
    prior: P,
    motion: A,
    sensor: H,
    settings: McmcSettings,
    /// States of the chain, burn-in included.
    length: usize,
    moves: Sweeps,
}

impl<const N: usize, const W: usize, A, H, P> SequentialMcmc<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// A filter from its models.
    ///
    /// # Errors
    /// No or too many particles, parameters of the moves out of range.
    pub fn new(prior: P, motion: A, sensor: H, settings: McmcSettings) -> Result<Self> {
        let n = settings.particles;
        let length = n.saturating_add(settings.burn_in.unwrap_or(n / 4));
        if n == 0 || length > MAX_PARTICLES {
            let needs = "it must be at least 1, and with the burn-in at most 2^26";
            return Err(Error::OutOfRange { what: "number of particles", value: n as f64, needs });
        }
        let moves = Sweeps { kernel: settings.kernel, count: settings.sweeps };
        moves.check()?;
        Ok(SequentialMcmc { prior, motion, sensor, settings, length, moves })
    }

    /// Settings of the filter.
    pub fn settings(&self) -> &McmcSettings {
        &self.settings
    }

    /// Makes the proposals of a step, weighed where there is a measurement, from the particles in
    /// `cloud.states`: from parents that are drawn, or each particle from itself.
    fn propose(
        &self,
        cloud: &Cloud<N>,
        proposals: &mut Proposals<N>,
        (step, digest): (Option<&A::Step>, Option<&H::Digest<'_>>),
    ) {
        let McmcSettings { simd, noise: source, ref threads, .. } = self.settings;
        let n = cloud.len();
        let count = if digest.is_some() { self.length } else { n };
        proposals.resize(count);
        let (stream, number) = (cloud.stream, cloud.step);
        for (j, parent) in proposals.parents.iter_mut().enumerate() {
            let place = || (stream.draws(Purpose::Resample, number, j as u32).uniform() * n as f64) as usize;
            *parent = if digest.is_some() { place().min(n - 1) } else { j } as u32;
        }
        let survivors = Survivors::new(cloud.states.each_ref().map(Vec::as_slice), &proposals.parents);
        let columns = proposals.states.each_mut().map(Vec::as_mut_slice);
        let law = self.motion.noise();
        threads.for_each_block(
            columns,
            [&mut proposals.scores],
            &mut proposals.lost,
            |b, mut states, [scores], lost| {
                let (first, last) = (b * BLOCK, b * BLOCK + scores.len());
                let from = survivors.block(simd, first, last);
                if let Some(step) = step {
                    let mut noise = NoiseBlock::<W>::new();
                    let key = NoiseKey { stream, purpose: Purpose::Motion, step: number, block: b };
                    let size = (last - first, self.motion.noise_components());
                    kernels::fill_noise(simd, source, law, key, size, &mut noise);
                    kernels::propagate::<N, W, A>(simd, step, &noise, Source::Survivors(from), &mut states);
                } else {
                    kernels::gather(Source::Survivors(from), &mut states);
                }
                let states = states.each_ref().map(|c| &**c);
                match digest {
                    Some(digest) => H::score(digest, simd, &states, scores),
                    None => scores.fill(0.0),
                }
                *lost = 0;
                for (i, score) in scores.iter_mut().enumerate() {
                    let is_lost =
                        score.is_nan() || *score == f64::INFINITY || states.iter().any(|c| !c[i].is_finite());
                    *lost += usize::from(is_lost);
                    *score = if is_lost { f64::NEG_INFINITY } else { *score };
                }
            },
        );
    }

    /// Walks through the proposals; the kept ones are written to `chosen`. There is one of some likelihood.
    fn walk(&self, cloud: &Cloud<N>, proposals: &Proposals<N>, chosen: &mut Vec<u32>) -> usize {
        let scores = &proposals.scores;
        let mut here = scores.iter().position(|&s| s > f64::NEG_INFINITY).unwrap_or(0);
        let (mut accepted, burn_in) = (0, self.length - cloud.len());
        chosen.clear();
        for (j, &score) in scores.iter().enumerate() {
            let gain = score - scores[here];
            let chance = || Real::ln(cloud.stream.draws(Purpose::Move, cloud.step, j as u32).uniform());
            if score > f64::NEG_INFINITY && (gain >= 0.0 || chance() < gain) {
                here = j;
                accepted += 1;
            }
            if j >= burn_in {
                chosen.push(here as u32);
            }
        }
        accepted
    }
}

impl<const N: usize> Proposals<N> {
    fn resize(&mut self, count: usize) {
        self.states.iter_mut().for_each(|c| c.resize(count, 0.0));
        self.scores.resize(count, 0.0);
        self.parents.resize(count, 0);
        self.lost.resize(count.div_ceil(BLOCK), 0);
    }
}

/// ln of the mean of e^x.
fn log_mean_exp(list: &[f64]) -> f64 {
    let max = list.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if max == f64::NEG_INFINITY {
        return max;
    }
    let sum: f64 = list.iter().map(|x| Real::exp(x - max)).sum();
    max + Real::ln(sum / list.len() as f64)
}

/// Effective size and number of different entries of a list in which equal ones follow each other.
fn repetitions(chosen: &[u32]) -> (f64, usize) {
    let (mut squares, mut distinct) = (0.0, 0);
    for run in chosen.chunk_by(|a, b| a == b) {
        squares += (run.len() * run.len()) as f64;
        distinct += 1;
    }
    ((chosen.len() * chosen.len()) as f64 / squares, distinct)
}

impl<const N: usize, const W: usize, A, H, P> Filter for SequentialMcmc<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = MovedCloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<MovedCloud<N>> {
        let columns = self.prior.columns(stream, self.settings.particles)?;
        let mut belief = MovedCloud::new(Cloud::from_columns(at, stream, columns)?);
        belief.proposals.resize(self.length);
        belief.chosen.reserve(self.settings.particles);
        Ok(belief)
    }

    fn step(&self, belief: &mut MovedCloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let from = belief.cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let digest = z.map(|z| self.sensor.digest(z, to)).transpose()?;
        let step = (to > from).then(|| self.motion.over(from, to)).transpose()?;
        let refines = self.moves.count > 0 && z.is_some() && to > from;
        let density = refines
            .then(|| TransitionDensity::over(&self.motion, from, to, &belief.cloud.mean()))
            .transpose()?;
        let MovedCloud { cloud, parents, densities, frozen, moved, pull, proposals, chosen, .. } = belief;
        (*moved, *pull) = (Moved::default(), None);
        cloud.step += 1;
        cloud.time = to;
        cloud.lineage = Lineage::Numbers;
        let n = cloud.len();
        self.propose(cloud, proposals, (step.as_ref(), digest.as_ref()));
        let not_finite = proposals.lost.iter().sum();
        let mut particles = ParticleUpdate {
            particles: n,
            ess: n as f64,
            resampled: false,
            distinct_ancestors: n,
            not_finite,
            evaluations: 0,
        };
        let log_evidence = if digest.is_some() { log_mean_exp(&proposals.scores) } else { 0.0 };
        let Some(digest) = digest.filter(|_| log_evidence > f64::NEG_INFINITY) else {
            if z.is_some() {
                // The prediction stands.
                particles.evaluations = self.length;
                self.propose(cloud, proposals, (step.as_ref(), None));
            }
            // Predicted states, as far as they are states.
            for i in 0..n {
                if proposals.states.iter().all(|c| c[i].is_finite()) {
                    cloud.states.iter_mut().zip(&proposals.states).for_each(|(to, from)| to[i] = from[i]);
                }
            }
            cloud.equalise();
            let outcome = if z.is_some() { Outcome::Degenerate } else { Outcome::Predicted };
            return Ok(Update { outcome, log_evidence, particles: Some(particles) });
        };
        let accepted = self.walk(cloud, proposals, chosen);
        *moved += Moved { accepted, evaluations: self.length };
        for k in 0..N {
            for (parent, &c) in parents[k].iter_mut().zip(&*chosen) {
                *parent = cloud.states[k][proposals.parents[c as usize] as usize];
            }
            for (state, &c) in cloud.states[k].iter_mut().zip(&*chosen) {
                *state = proposals.states[k][c as usize];
            }
        }
        for (ancestor, &c) in cloud.ancestors.iter_mut().zip(&*chosen) {
            *ancestor = proposals.parents[c as usize];
        }
        cloud.lineage = Lineage::Ancestors;
        (particles.ess, particles.distinct_ancestors) = repetitions(chosen);
        particles.resampled = true;
        cloud.equalise();
        if let Some(density) = &density {
            let simd = self.settings.simd;
            let law = PathLaw::<A, H, N, W> { density, digest: &digest, parents, power: 1.0, simd };
            let means = (&self.settings.threads, spread_of(cloud));
            densities.iter_mut().zip(&*chosen).for_each(|(to, &c)| *to = proposals.scores[c as usize]);
            law.complete(0, &cloud.states.each_ref().map(Vec::as_slice), densities);
            let before = moments(&cloud.states);
            *moved += self.moves.run(cloud, densities, frozen, &law, means);
            *pull = Some(Pull::between(before, moments(&cloud.states)));
            cloud.equalise();
        }
        particles.evaluations = moved.evaluations;
        Ok(Update { outcome: Outcome::Updated, log_evidence, particles: Some(particles) })
    }
}
