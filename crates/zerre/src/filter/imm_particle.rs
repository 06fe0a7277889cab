//! The interacting-multiple-model particle filter (Blom and Bloem, IEEE Conference on Decision and Control, 2003;
//! 2004): the same number of particles in every mode, drawn at each step from those of all modes.

use crate::belief::{Gaussian, MAX_PARTICLES, ModalCloud, ModalGaussian, Segment};
use crate::error::{Error, Result};
use crate::filter::multiple_model::{drawn_by_mode, particles_in, stream_of};
use crate::filter::{Filter, ModalSettings, Outcome, ParticleUpdate, Prior, Update};
use crate::kernels::{self, BLOCK, NoiseBlock, NoiseKey, Source, Survivors};
use crate::math::Real;
use crate::model::jump::{MAX_MODES, Transition};
use crate::model::{JumpMarkov, Likelihood, Motion};
use crate::resample::{Context, Mixture, Target};
use crate::rng::{Purpose, Stream};
use crate::time::Time;

/// A particle filter for modes `A` that interact, a sensor `H` and a prior `P`.
///
/// N particles in all, N / X in each of X modes whatever its probability. A step begins with the interaction: for each
/// mode j that can follow, of predicted probability c_j = sum over i of p_ij mu_i, its N_j particles are drawn from
/// those of all modes i with weights p_ij w. They are moved under mode j and weighed by c_j / N_j times their
/// likelihood. A step costs N moves, where [`MultipleModel`](super::MultipleModel) makes X N, and rare modes keep their
/// particles.
///
/// The evidence is the sum of the weights; its exponential is unbiased. Modes that cannot follow (c_j = 0) get no
/// particles, the others share them; each gets at least one, so that there may be as many particles as modes where
/// fewer were asked for. Of a step in which no time passes only the weights change.
///
/// Its updates count the interaction as resampling: [`ParticleUpdate::distinct_ancestors`] are the particles that it
/// drew.
#[derive(Clone, Debug)]
pub struct ImmParticle<const N: usize, const W: usize, A, H, P = Gaussian<N>> {
    prior: P,
    model: JumpMarkov<A>,
    sensor: H,
    settings: ModalSettings,
}

/// Shares of `n` particles for modes of the given probabilities: equal ones for all that are possible.
fn quotas(n: usize, law: &[f64]) -> impl Iterator<Item = usize> + '_ {
    let possible = law.iter().filter(|&&p| p > 0.0).count().max(1);
    let mut rank = 0;
    law.iter().map(move |&p| {
        if p > 0.0 {
            rank += 1;
            (n / possible + usize::from(rank <= n % possible)).max(1)
        } else {
            0
        }
    })
}

/// How the particles of a mode come about.
struct Plan<S> {
    /// Step of each mode that has particles.
    moves: [Option<S>; MAX_MODES],
    /// ln(c_j / N_j): log-weight of each of its particles before the measurement.
    log_weights: [f64; MAX_MODES],
    streams: [Stream; MAX_MODES],
}

impl<const N: usize, const W: usize, A, H, P> ImmParticle<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// A filter from its models.
    ///
    /// # Errors
    /// No or too many particles.
    pub fn new(prior: P, model: JumpMarkov<A>, sensor: H, settings: ModalSettings) -> Result<Self> {
        // One copy of each, and at most a block of nobody's rows per mode.
        if settings.particles > MAX_PARTICLES - MAX_MODES * BLOCK {
            let value = settings.particles as f64;
            let needs = "it must not exceed 2^26 less a block for each mode";
            return Err(Error::OutOfRange { what: "number of particles", value, needs });
        }
        settings.check(1)?;
        Ok(ImmParticle { prior, model, sensor, settings })
    }

    /// Settings of the filter.
    pub fn settings(&self) -> &ModalSettings {
        &self.settings
    }

    /// The modes and their chain.
    pub fn model(&self) -> &JumpMarkov<A> {
        &self.model
    }

    /// A cloud whose modes have the probabilities `law`, with particles that `columns` makes.
    fn begin(
        &self,
        at: Time,
        stream: Stream,
        law: &[f64],
        columns: impl FnOnce(&[(usize, f64)]) -> Result<[Vec<f64>; N]>,
    ) -> Result<ModalCloud<N>> {
        let mut shares = [(0, 0.0); MAX_MODES];
        for ((share, &p), len) in shares.iter_mut().zip(law).zip(quotas(self.settings.particles, law)) {
            *share = (len, Real::ln(p) - Real::ln(len as f64));
        }
        let shares = &shares[..law.len()];
        let mut cloud = ModalCloud::from_columns(at, stream, &columns(shares)?, shares)?;
        // Whatever modes turn out to be possible, no later step needs more.
        let rows = self.settings.particles.max(law.len()) + law.len() * BLOCK;
        for column in cloud.states.iter_mut().chain(&mut cloud.survivors) {
            column.reserve(rows.saturating_sub(column.len()));
        }
        cloud.weights.reserve(rows.saturating_sub(cloud.weights.len()));
        cloud.scores.reserve(rows.saturating_sub(cloud.scores.len()));
        cloud.blocks.reserve((rows / BLOCK + 1).saturating_sub(cloud.blocks.len()));
        cloud.ancestors.reserve(rows);
        cloud.pools.iter_mut().for_each(|pool| pool.reserve(rows));
        cloud.scratch.reserve(rows, rows);
        Ok(cloud)
    }

    /// The cloud of particles drawn from `law`: each mode's from its own Gaussian.
    pub(crate) fn draw(&self, law: &ModalGaussian<N>, stream: Stream) -> Result<ModalCloud<N>> {
        self.begin(law.time(), stream, law.probabilities(), |shares| drawn_by_mode(law, stream, shares))
    }

    /// The interaction: lays the cloud out anew and writes for each of its rows the row of the old states,
    /// which now stand in `survivors`. Returns how many of the old particles were drawn.
    fn interact(&self, cloud: &mut ModalCloud<N>, law: &[f64], after: &[f64], jump: &Transition) -> usize {
        let ModalSettings { particles: n, resampling, simd, ref threads, .. } = self.settings;
        let modes = law.len();
        let mut targets = [Target { len: 0, first: 0, shares: [0.0; MAX_MODES] }; MAX_MODES];
        let mut rows = 0;
        for (j, (target, len)) in targets.iter_mut().zip(quotas(n, after)).enumerate() {
            (target.len, target.first) = (len, rows);
            rows += len.next_multiple_of(BLOCK);
            if len > 0 {
                let share = |i: usize| jump.probability(i, j) * law[i] / after[j];
                (0..modes).for_each(|i| target.shares[i] = share(i));
            }
        }
        let context = Context { level: simd, threads, stream: cloud.stream, step: cloud.step };
        let ModalCloud { weights, blocks, segments, ancestors, pools, scratch, .. } = &mut *cloud;
        ancestors.resize(rows, 0);
        let from = Mixture { weights, blocks, segments };
        let drawn = resampling.draw_mixture(context, from, &targets[..modes], scratch, pools, ancestors);
        std::mem::swap(&mut cloud.states, &mut cloud.survivors);
        cloud.lay_out(quotas(n, after).enumerate());
        drawn
    }

    /// Moves and weighs the particles of all segments, out of the survivors.
    fn visit(&self, cloud: &mut ModalCloud<N>, plan: &Plan<A::Step>, digest: Option<&H::Digest<'_>>) {
        let ModalSettings { simd, noise: source, ref threads, .. } = self.settings;
        let (segments, number) = (&cloud.segments, cloud.step);
        let survivors = Survivors::new(cloud.survivors.each_ref().map(Vec::as_slice), &cloud.ancestors);
        let states = cloud.states.each_mut().map(Vec::as_mut_slice);
        let scores: [&mut [f64]; 2] = [&mut cloud.scores, &mut cloud.weights];
        threads.for_each_block(states, scores, &mut cloud.blocks, |b, states, [scores, weights], sums| {
            let segment = Segment::with_block(segments, b);
            let (mode, count) = (segment.mode, segment.particles_of(b).len());
            let mut states = states.map(|column| &mut column[..count]);
            let (scores, weights) = (&mut scores[..count], &mut weights[..count]);
            let survivors = survivors.block(simd, b * BLOCK, b * BLOCK + count);
            if let Some(step) = &plan.moves[mode] {
                let motion = &self.model.modes()[mode];
                let mut noise = NoiseBlock::<W>::new();
                let (stream, block) = (plan.streams[mode], b - segment.first_block);
                let key = NoiseKey { stream, purpose: Purpose::Motion, step: number, block };
                let size = (count, motion.noise_components());
                kernels::fill_noise(simd, source, motion.noise(), key, size, &mut noise);
                let from = Source::Survivors(survivors);
                kernels::propagate::<N, W, A>(simd, step, &noise, from, &mut states);
            }
            let states = states.each_ref().map(|c| &**c);
            match digest {
                Some(digest) => H::score(digest, simd, &states, scores),
                None => scores.fill(0.0),
            }
            *sums = kernels::weigh(simd, None, scores, &states, weights);
            sums.max += plan.log_weights[mode];
        });
    }

    /// Makes particles worthless whose likelihood is NaN or infinite or whose state is lost; returns how many there
    /// were, and whether the measurement had to be taken back because nothing would be left of it. Of a lost state
    /// nothing may enter the sums: it becomes zero.
    fn mend(&self, cloud: &mut ModalCloud<N>, log_weights: &[f64; MAX_MODES]) -> (usize, bool) {
        let lost = |cloud: &ModalCloud<N>, row: usize| cloud.states.iter().any(|c| !c[row].is_finite());
        let worthless = |score: f64| score.is_nan() || score == f64::INFINITY;
        let takes_part = |row: usize| {
            let score = cloud.scores[row];
            score != f64::NEG_INFINITY && !worthless(score) && !lost(cloud, row)
        };
        let back = !cloud.segments.iter().any(|s| s.rows().any(takes_part));
        let mut count = 0;
        for s in 0..cloud.segments.len() {
            let segment = cloud.segments[s];
            for row in segment.rows() {
                let is_lost = lost(cloud, row);
                let is_bad = is_lost || worthless(cloud.scores[row]);
                count += usize::from(is_bad);
                if back || is_bad {
                    let stays = back && !is_lost;
                    cloud.scores[row] = if stays { 0.0 } else { f64::NEG_INFINITY };
                }
                if is_lost {
                    cloud.states.iter_mut().for_each(|c| c[row] = 0.0);
                }
            }
            segment.blocks().for_each(|b| self.weigh(cloud, segment, b, log_weights[segment.mode]));
        }
        (count, back)
    }

    /// Weights and sums of block `b` of a segment from its scores, and a log-weight that all of them have.
    fn weigh(&self, cloud: &mut ModalCloud<N>, segment: Segment, b: usize, log_weight: f64) {
        let rows = b * BLOCK..b * BLOCK + segment.particles_of(b).len();
        let states = cloud.states.each_ref().map(|c| &c[rows.clone()]);
        let (scores, weights) = (&mut cloud.scores[rows.clone()], &mut cloud.weights[rows]);
        cloud.blocks[b] = kernels::weigh(self.settings.simd, None, scores, &states, weights);
        cloud.blocks[b].max += log_weight;
    }

    /// Takes in a measurement while no time passes: each particle keeps its place and its mode.
    fn weigh_in_place(&self, cloud: &mut ModalCloud<N>, digest: &H::Digest<'_>) -> Update {
        let before = cloud.total();
        let (mut not_finite, mut degenerate) = (0, true);
        for segment in &cloud.segments {
            let rows = segment.rows();
            let states = cloud.states.each_ref().map(|c| &c[rows.clone()]);
            let scores = &mut cloud.scores[rows.clone()];
            H::score(digest, self.settings.simd, &states, scores);
            for (score, &w) in scores.iter_mut().zip(&cloud.weights[rows]) {
                let is_bad = score.is_nan() || *score == f64::INFINITY;
                not_finite += usize::from(is_bad && w > 0.0);
                let usable = w > 0.0 && !is_bad;
                *score = if usable { *score + Real::ln(w) } else { f64::NEG_INFINITY };
                degenerate &= *score == f64::NEG_INFINITY;
            }
        }
        let mut particles = ParticleUpdate {
            particles: cloud.len(),
            ess: before.ess(),
            resampled: false,
            distinct_ancestors: cloud.len(),
            not_finite,
            evaluations: cloud.len(),
        };
        if degenerate {
            let (outcome, log_evidence) = (Outcome::Degenerate, f64::NEG_INFINITY);
            return Update { outcome, log_evidence, particles: Some(particles) };
        }
        for s in 0..cloud.segments.len() {
            let segment = cloud.segments[s];
            for b in segment.blocks() {
                let before = cloud.blocks[b].max;
                self.weigh(cloud, segment, b, before);
            }
        }
        let total = cloud.total();
        particles.ess = total.ess();
        let log_evidence = total.log_sum() - before.log_sum();
        Update { outcome: Outcome::Updated, log_evidence, particles: Some(particles) }
    }
}

impl<const N: usize, const W: usize, A, H, P> Filter for ImmParticle<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = ModalCloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<ModalCloud<N>> {
        let columns = |shares: &[(usize, f64)]| self.prior.columns(stream, particles_in(shares));
        self.begin(at, stream, self.model.chain().initial(), columns)
    }

    fn step(&self, cloud: &mut ModalCloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let from = cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let digest = z.map(|z| self.sensor.digest(z, to)).transpose()?;
        let modes = self.model.modes();
        if cloud.modes != modes.len() {
            let what = "modes of the belief";
            return Err(Error::Shape { what, found: cloud.modes, expected: modes.len() });
        }
        if to == from {
            return Ok(match &digest {
                Some(digest) => self.weigh_in_place(cloud, digest),
                None => unmoved(cloud, Outcome::Predicted, 0.0),
            });
        }
        let mut law = [0.0; MAX_MODES];
        law.iter_mut().zip(cloud.probabilities()).for_each(|(law, p)| *law = p);
        let law = &law[..modes.len()];
        let transition = self.model.chain().over(from, to);
        let after = transition.predict(law);
        let after = &after[..modes.len()];
        let mut plan = Plan {
            moves: std::array::from_fn(|_| None),
            log_weights: [f64::NEG_INFINITY; MAX_MODES],
            streams: std::array::from_fn(|j| {
                if j < modes.len() { stream_of(cloud.stream, j) } else { cloud.stream }
            }),
        };
        for (j, len) in quotas(self.settings.particles, after).enumerate() {
            if len > 0 {
                plan.moves[j] = Some(modes[j].over(from, to)?);
                plan.log_weights[j] = Real::ln(after[j]) - Real::ln(len as f64);
            }
        }
        cloud.time = to;
        cloud.step += 1;
        if !after.iter().any(|&p| p > 0.0) {
            // Every particle was lost in an earlier step.
            return Ok(match digest {
                Some(_) => unmoved(cloud, Outcome::Degenerate, f64::NEG_INFINITY),
                None => unmoved(cloud, Outcome::Predicted, 0.0),
            });
        }
        let distinct_ancestors = self.interact(cloud, law, after, &transition);
        self.visit(cloud, &plan, digest.as_ref());

        let mut total = cloud.total();
        let (mut not_finite, mut degenerate) = (0, false);
        if !(total.sum.is_finite()
            && total.sum > 0.0
            && total.max < f64::INFINITY
            && total.sum_states.iter().all(|s| s.is_finite()))
        {
            (not_finite, degenerate) = self.mend(cloud, &plan.log_weights);
            total = cloud.total();
        }
        let (outcome, log_evidence) = match digest {
            None => (Outcome::Predicted, 0.0),
            Some(_) if degenerate => (Outcome::Degenerate, f64::NEG_INFINITY),
            // The weights summed to 1 before the measurement.
            Some(_) => (Outcome::Updated, total.log_sum()),
        };
        let particles = ParticleUpdate {
            particles: cloud.len(),
            ess: total.ess(),
            resampled: true,
            distinct_ancestors,
            not_finite,
            evaluations: if digest.is_some() { cloud.len() } else { 0 },
        };
        Ok(Update { outcome, log_evidence, particles: Some(particles) })
    }
}

/// What there is to say of a step that leaves the particles as they are.
fn unmoved<const N: usize>(cloud: &ModalCloud<N>, outcome: Outcome, log_evidence: f64) -> Update {
    let particles = ParticleUpdate {
        particles: cloud.len(),
        ess: cloud.ess(),
        resampled: false,
        distinct_ancestors: cloud.len(),
        not_finite: 0,
        evaluations: 0,
    };
    Update { outcome, log_evidence, particles: Some(particles) }
}
