//! The particle filter: sequential importance sampling with resampling (Gordon, Salmond and Smith, IEE Proceedings F
//! 140, 1993), with any [`proposal`](crate::proposal).

use crate::belief::{Cloud, Gaussian, Lineage};
use crate::error::{Error, Result};
use crate::filter::settings::{Prior, Settings};
use crate::filter::size::{Goal, Size};
use crate::filter::{Filter, Outcome, ParticleUpdate, Update};
use crate::kernels::{self, BLOCK, NoiseBlock, NoiseKey, Source, Survivors, Total};
use crate::model::{Likelihood, Motion, Noise};
use crate::proposal::{Bootstrap, Models, Proposal};
use crate::rng::{Purpose, Stream};
use crate::time::Time;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A particle filter for a motion model `M`, a sensor `H`, a prior `P` and a proposal `Q`.
#[derive(Clone, Debug)]
pub struct ParticleFilter<const N: usize, const W: usize, M, H, P = Gaussian<N>, Q = Bootstrap> {
    prior: P,
    motion: M,
    sensor: H,
    proposal: Q,
    settings: Settings,
}

impl<const N: usize, const W: usize, M, H, P> ParticleFilter<N, W, M, H, P>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// A filter from its models, with the transition as proposal.
    ///
    /// # Errors
    /// No or too many particles, a trigger, a roughening or a lookahead out of range.
    pub fn new(prior: P, motion: M, sensor: H, settings: Settings) -> Result<Self> {
        ParticleFilter::guided(prior, motion, sensor, Bootstrap, settings)
    }
}

/// What moves and weighs the particles of one step: a step if time passes, a digest if there is a
/// measurement, a guide if there are both and the proposal looks.
struct Plan<'a, S, D, G> {
    step: Option<&'a S>,
    digest: Option<&'a D>,
    guide: Option<&'a G>,
    /// Whether the states of before are needed afterwards.
    keeps: bool,
}

/// The particles that take noise of the motion's own law: a share of them, evenly spaced from a random place,
/// so that each is one with the same probability.
pub(super) struct Defensive {
    share: f64,
    offset: f64,
}

impl Defensive {
    pub(super) fn new(share: f64, stream: Stream, step: u64) -> Self {
        // No block of noise has numbers of this index.
        Defensive { share, offset: stream.draws(Purpose::Propose, step, u32::MAX).uniform() }
    }

    /// Writes 1 for those of the particles from `first` on, 0 for the others.
    pub(super) fn mark(&self, first: usize, takes_own: &mut [f64]) {
        if self.share == 0.0 {
            return takes_own.fill(0.0);
        }
        let count = |i: usize| (i as f64).mul_add(self.share, self.offset).floor();
        let mut before = count(first);
        for (i, takes) in (first + 1..).zip(takes_own) {
            let after = count(i);
            *takes = after - before;
            before = after;
        }
    }
}

impl<const N: usize, const W: usize, M, H, P, Q> ParticleFilter<N, W, M, H, P, Q>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
    Q: Proposal<N, W, M, H>,
{
    /// A filter from its models and a proposal, such as [`Guided`](crate::proposal::Guided).
    ///
    /// # Errors
    /// No or too many particles, a trigger, a roughening or a lookahead out of range, models that the
    /// proposal is not for.
    pub fn guided(prior: P, motion: M, sensor: H, proposal: Q, settings: Settings) -> Result<Self> {
        settings.checked(N)?;
        proposal.accept(&motion, &sensor)?;
        Ok(ParticleFilter { prior, motion, sensor, proposal, settings })
    }

    /// Settings of the filter.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The motion model.
    pub fn motion(&self) -> &M {
        &self.motion
    }

    /// The sensor.
    pub fn sensor(&self) -> &H {
        &self.sensor
    }

    /// Moves and weighs all blocks; fills `cloud.scores`, `weights` and `blocks`. Without a digest the weights stay
    /// what they were. Returns how often the measurement was evaluated.
    fn visit(&self, cloud: &mut Cloud<N>, plan: &Plan<'_, M::Step, H::Digest<'_>, Q::Given<'_>>) -> usize {
        let Settings { simd, noise: source, ref threads, .. } = self.settings;
        let (law, components) = (self.motion.noise(), self.motion.noise_components());
        let (stream, number) = (cloud.stream, cloud.step);
        let (gathers, keeps) = (cloud.pending, plan.keeps);
        let n = cloud.coming();
        if gathers || keeps {
            std::mem::swap(&mut cloud.states, &mut cloud.spare);
        }
        cloud.resize(n);
        let from = cloud.spare.each_ref().map(Vec::as_slice);
        let survivors = Survivors::new(from, &cloud.ancestors);
        let states = cloud.states.each_mut().map(Vec::as_mut_slice);
        let scores: [&mut [f64]; 2] = [&mut cloud.scores, &mut cloud.weights];
        let log_weights = (!cloud.equal).then_some(&cloud.log_weights);
        let defensive = plan.guide.map(|guide| Defensive::new(Q::defensive(guide), stream, number));
        let evaluations = AtomicUsize::new(0);
        threads.for_each_block(
            states,
            scores,
            &mut cloud.blocks,
            |b, mut states, [scores, weights], sums| {
                let (first, last) = (b * BLOCK, b * BLOCK + scores.len());
                let place = if gathers {
                    Source::Survivors(survivors.block(simd, first, last))
                } else if keeps {
                    Source::Columns(from.map(|c| &c[first..last]))
                } else {
                    Source::Here
                };
                let count = (last - first, components);
                let key = |purpose| NoiseKey { stream, purpose, step: number, block: b };
                if let (Some(guide), Some(defensive)) = (plan.guide, &defensive) {
                    kernels::gather(place, &mut states);
                    defensive.mark(first, weights);
                    let (mut noise, mut own) = (NoiseBlock::<W>::new(), None);
                    let mut purpose = Purpose::Motion;
                    if let Noise::Gamma { shape } = law {
                        let own = own.insert(NoiseBlock::<W>::new());
                        kernels::fill_gamma(shape, key(purpose), count, |i| weights[i] != 0.0, own);
                        purpose = Purpose::Propose;
                    }
                    kernels::fill_noise(simd, source, Noise::StandardNormal, key(purpose), count, &mut noise);
                    let made = Q::propose(guide, simd, (&noise, own.as_ref()), &mut states, weights);
                    evaluations.fetch_add(made, Ordering::Relaxed);
                } else if let Some(step) = plan.step {
                    let mut noise = NoiseBlock::<W>::new();
                    kernels::fill_noise(simd, source, law, key(Purpose::Motion), count, &mut noise);
                    kernels::propagate::<N, W, M>(simd, step, &noise, place, &mut states);
                } else {
                    kernels::gather(place, &mut states);
                }
                let states = states.each_ref().map(|c| &**c);
                match plan.digest {
                    Some(digest) => H::score(digest, simd, &states, scores),
                    None => scores.fill(0.0),
                }
                if plan.guide.is_some() {
                    scores.iter_mut().zip(&*weights).for_each(|(score, ratio)| *score += ratio);
                }
                let log_weights = log_weights.map(|l| &l[first..last]);
                *sums = kernels::weigh(simd, log_weights, scores, &states, weights);
            },
        );
        cloud.pending = false;
        evaluations.into_inner() + if plan.digest.is_some() { cloud.len() } else { 0 }
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
        cloud.weigh(self.settings.simd);
        count
    }

    /// Draws the survivors; they are gathered when the next step moves them.
    pub(super) fn resample(&self, cloud: &mut Cloud<N>, total: &Total<N>, goal: &Goal<'_>) -> usize {
        let Settings { simd, ref threads, resampling, .. } = self.settings;
        let children = goal.count(simd, cloud, total);
        cloud.resample(resampling, (simd, threads), total, children)
    }
}

impl<const N: usize, const W: usize, M, H, P, Q> Filter for ParticleFilter<N, W, M, H, P, Q>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
    Q: Proposal<N, W, M, H>,
{
    type Measurement = H::Value;
    type Belief = Cloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<Cloud<N>> {
        let Settings { particles, ref size, .. } = self.settings;
        self.start_with_room(at, stream, size.most(particles))
    }

    fn step(&self, cloud: &mut Cloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        // The number that the next resampling leaves: with a lookahead it is that of this very step.
        let of = cloud.step + u64::from(self.settings.lookahead.is_none());
        self.step_toward(cloud, to, z, &self.settings.size.goal(of))
    }
}

impl<const N: usize, const W: usize, M, H, P, Q> ParticleFilter<N, W, M, H, P, Q>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
    Q: Proposal<N, W, M, H>,
{
    /// The first particles, with room for `most`, so that no later step of at most as many allocates.
    pub(super) fn start_with_room(&self, at: Time, stream: Stream, most: usize) -> Result<Cloud<N>> {
        let Settings { particles: n, ref size, lookahead, .. } = self.settings;
        let mut cloud = Cloud::from_columns(at, stream, self.prior.columns(stream, n)?)?;
        if most > n {
            cloud.reserve(most);
        }
        if lookahead.is_some() || most > n || *size != Size::Fixed {
            cloud.scratch.reserve(most, most);
        }
        if lookahead.is_some() || Q::GUIDED {
            cloud.kept.reserve_exact(most);
        }
        if matches!(size, Size::Kld(_)) {
            cloud.scratch.bins.reserve_exact(most);
        }
        Ok(cloud)
    }

    /// A step whose resampling, if there is one, leaves as many particles as `goal` says.
    pub(super) fn step_toward(
        &self,
        cloud: &mut Cloud<N>,
        to: Time,
        z: Option<&H::Value>,
        goal: &Goal<'_>,
    ) -> Result<Update> {
        let from = cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let Settings { simd, rejuvenation, lookahead, .. } = self.settings;
        let digest = z.map(|z| self.sensor.digest(z, to)).transpose()?;
        let moved = (to > from).then(|| self.motion.over(from, to)).transpose()?;
        let guide = match (z, &moved) {
            (Some(z), Some(step)) if Q::GUIDED => {
                let models = Models { motion: &self.motion, step, sensor: &self.sensor, at: to };
                Some(self.proposal.given(models, z, &cloud.particle(0))?)
            }
            _ => None,
        };
        if cloud.pending {
            rejuvenation.apply(simd, cloud);
        }
        cloud.step += 1;
        cloud.lineage = Lineage::Numbers;
        let before = (cloud.pending, cloud.equal, cloud.log_sum);
        let (ahead, expectations) = match (lookahead, &moved, &digest) {
            (Some(exponent), Some(step), Some(digest)) => {
                self.look_ahead(cloud, (exponent, goal), (step, digest, guide.as_ref()))
            }
            _ => (None, 0),
        };
        let keeps = guide.is_some() || ahead.is_some();
        let plan = Plan { step: moved.as_ref(), digest: digest.as_ref(), guide: guide.as_ref(), keeps };
        let evaluations = expectations + self.visit(cloud, &plan);
        cloud.time = to;
        let n = cloud.len();

        let mut total = cloud.total();
        let mut not_finite = 0;
        if !(total.sum.is_finite()
            && total.max < f64::INFINITY
            && total.sum_states.iter().all(|s| s.is_finite()))
        {
            if keeps && ahead.is_none() {
                cloud.kept.clone_from(&cloud.log_weights);
            }
            not_finite = self.mend(cloud);
            total = cloud.total();
        }
        let mut particles = ParticleUpdate {
            particles: n,
            ess: total.ess(),
            resampled: ahead.is_some(),
            distinct_ancestors: ahead.unwrap_or(n),
            not_finite,
            evaluations,
        };
        if total.max == f64::NEG_INFINITY {
            // The measurement has no likelihood anywhere: take it back.
            if keeps {
                // The particles were moved with a view to it: all that was done is undone, and done without
                // it.
                std::mem::swap(&mut cloud.states, &mut cloud.spare);
                if ahead.is_some() || not_finite > 0 {
                    std::mem::swap(&mut cloud.log_weights, &mut cloud.kept);
                }
                cloud.resize(cloud.states.first().map_or(n, Vec::len));
                (cloud.pending, cloud.equal, cloud.log_sum) = before;
                // Looking ahead has gathered the survivors.
                cloud.pending &= ahead.is_none();
                (cloud.time, cloud.step) = (from, cloud.step - 1);
                let update = self.step_toward(cloud, to, None, goal)?;
                let particles = update.particles.map(|p| ParticleUpdate { particles: n, evaluations, ..p });
                return Ok(Update {
                    outcome: Outcome::Degenerate,
                    log_evidence: f64::NEG_INFINITY,
                    particles,
                });
            }
            // The scores were not yet the log-weights.
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
        let trigger = self.settings.trigger;
        let wanted = trigger.fires(particles.ess, n) || goal.insists(n);
        if digest.is_some() && lookahead.is_none() && wanted {
            particles.resampled = true;
            particles.distinct_ancestors = self.resample(cloud, &total, goal);
        } else if digest.is_some() || not_finite > 0 {
            cloud.keep_weights(log_sum);
        }
        let outcome = if digest.is_some() { Outcome::Updated } else { Outcome::Predicted };
        Ok(Update { outcome, log_evidence, particles: Some(particles) })
    }
}

impl<const N: usize, const W: usize, M, H, P, Q> ParticleFilter<N, W, M, H, P, Q> {
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
