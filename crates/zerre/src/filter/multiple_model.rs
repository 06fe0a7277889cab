//! The multiple-model particle filter: every particle moves under every mode, each move is weighed by the measurement
//! and by the chain of modes, and the joint set is resampled (McGinnity and Irwin, IEEE Transactions on Aerospace and
//! Electronic Systems 36(3), 2000; algorithms 1 to 3 of Ucar's thesis, section 4.1).

use crate::belief::{
    Gaussian, MAX_PARTICLES, ModalCloud, ModalGaussian, SavedModalCloud, Segment, load_log, save_log,
};
use crate::error::{Error, Result};
use crate::filter::{Choice, Filter, Outcome, ParticleUpdate, Prior, Selector, Update, Wsms};
use crate::kernels::{
    self, BLOCK, BlockSums, NoiseBlock, NoiseKey, NoiseSource, Simd, Source, Threads, Total,
};
use crate::math::{Real, wrap};
use crate::model::jump::{MAX_MODES, Transition};
use crate::model::{GaussianMeasurement, JumpMarkov, Likelihood, Motion};
use crate::resample::{BlockWeights, Context, Resampling};
use crate::rng::{Purpose, Stream};
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::convert::Infallible;

/// Settings of particle filters with several modes.
#[derive(Clone, Debug)]
pub struct ModalSettings {
    /// Number of particles, 1 000 by default. Where each of them is moved under each of X modes, so many survive.
    pub particles: usize,
    /// How to resample.
    pub resampling: Resampling,
    /// How process noise is made.
    pub noise: NoiseSource,
    /// Instructions to use; results do not depend on it.
    pub simd: Simd,
    /// Threads to use; results do not depend on them.
    pub threads: Threads,
}

impl Default for ModalSettings {
    fn default() -> Self {
        ModalSettings {
            particles: 1000,
            resampling: Resampling::default(),
            noise: NoiseSource::default(),
            simd: Simd::best(),
            threads: Threads::Serial,
        }
    }
}

impl ModalSettings {
    /// Refuses a number of particles that no cloud holds, with each of them moved under `copies` modes.
    pub(crate) fn check(&self, copies: usize) -> Result<()> {
        if self.particles == 0 || self.particles > MAX_PARTICLES / copies.max(1) {
            let value = self.particles as f64;
            let needs = "it must lie between 1 and 2^26, all modes together";
            return Err(Error::OutOfRange { what: "number of particles", value, needs });
        }
        Ok(())
    }
}

/// What a [`MultipleModel`] gives as its estimate. The particles are the same in each case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Output {
    /// Mean of the particles that survived resampling: algorithm 1 of the thesis.
    Survivors,
    /// Weighted mean of all particles under all modes, before resampling: algorithm 2. The least variance of the three.
    #[default]
    Mixture,
    /// Weighted mean of the particles of one mode, that with the least error ([`ObservationError`]) in the step before:
    /// algorithm 3. It is no estimate of the posterior mean.
    LeastError,
}

/// What becomes of the weights after resampling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AfterResampling {
    /// They are equal, as the theory has it.
    #[default]
    Equal,
    /// The survivors are weighed by the measurement once more for [`Output::Survivors`], as step 5 of the thesis's
    /// resampling (section 2.5.3.2) says: it counts each measurement twice.
    Recomputed,
    /// The same, and the next step begins with these weights: its evidence is no longer that of the model.
    RecomputedKept,
}

/// How far an estimate is from what was measured.
pub trait ObservationError<const N: usize, V: ?Sized>: Send + Sync {
    /// The error of the state `x` at the measurement `z`, made at `at`; not negative. NaN counts as infinite.
    fn error(&self, z: &V, at: Time, x: &[f64; N]) -> f64;
}

/// No error is needed.
impl<const N: usize, V: ?Sized> ObservationError<N, V> for Infallible {
    fn error(&self, _: &V, _: Time, _: &[f64; N]) -> f64 {
        match *self {}
    }
}

/// Length of the difference z - h(x) after its components have been multiplied by `scale`: with 1 / sd of each the
/// Mahalanobis distance, with (0.001, 1) metres and radians become the kilometres and radians of the thesis. Angles are
/// wrapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaledResidual<H, const M: usize> {
    /// The sensor, h.
    pub sensor: H,
    /// Factors of the components.
    pub scale: [f64; M],
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> ObservationError<N, H::Value>
    for ScaledResidual<H, M>
{
    fn error(&self, z: &H::Value, at: Time, x: &[f64; N]) -> f64 {
        let (seen, foretold) = (self.sensor.components(z), self.sensor.predict(at, *x));
        let scaled = |i: usize| {
            let d = seen[i] - foretold[i];
            self.scale[i] * if H::ANGLE[i] { wrap(d) } else { d }
        };
        (0..M).map(|i| scaled(i) * scaled(i)).sum::<f64>().sqrt()
    }
}

/// A multiple-model particle filter for the modes `A`, a sensor `H`, a prior `P` and, where an output or a selection
/// asks for it, an [`ObservationError`] `E`.
///
/// Each of n particles is moved under each of X modes; the weight of particle i under mode j is its likelihood times
/// the probability that j follows the particle's mode. The evidence is the mean of these weights over the particles:
/// its exponential is unbiased. Resampling brings the X n particles back to n, which keep the mode that they were drawn
/// with.
#[derive(Clone, Debug)]
pub struct MultipleModel<const N: usize, const W: usize, A, H, E = Infallible, P = Gaussian<N>> {
    prior: P,
    model: JumpMarkov<A>,
    sensor: H,
    error: Option<E>,
    settings: ModalSettings,
    output: Output,
    after: AfterResampling,
    selection: Option<Wsms>,
}

impl<const N: usize, const W: usize, A, H, P> MultipleModel<N, W, A, H, Infallible, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// A filter that gives [`Output::Mixture`], with equal weights after resampling, and computes every mode in every
    /// step.
    ///
    /// # Errors
    /// No or too many particles (the limit is for all modes together).
    pub fn new(prior: P, model: JumpMarkov<A>, sensor: H, settings: ModalSettings) -> Result<Self> {
        settings.check(model.modes().len())?;
        Ok(MultipleModel {
            prior,
            model,
            sensor,
            error: None,
            settings,
            output: Output::default(),
            after: AfterResampling::default(),
            selection: None,
        })
    }
}

impl<const N: usize, const W: usize, A, H, E, P> MultipleModel<N, W, A, H, E, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    E: ObservationError<N, H::Value>,
    P: Prior<N>,
{
    /// The same filter with an error for [`Output::LeastError`] and for a selection.
    #[must_use]
    pub fn with_error<F>(self, error: F) -> MultipleModel<N, W, A, H, F, P>
    where
        F: ObservationError<N, H::Value>,
    {
        let MultipleModel { prior, model, sensor, settings, output, after, selection, .. } = self;
        MultipleModel { prior, model, sensor, error: Some(error), settings, output, after, selection }
    }

    /// The same filter with another output.
    ///
    /// # Errors
    /// [`Output::LeastError`] without an error.
    pub fn with_output(self, output: Output) -> Result<Self> {
        if output == Output::LeastError && self.error.is_none() {
            return Err(Error::Unsupported("the output with the least error needs an error".into()));
        }
        Ok(MultipleModel { output, ..self })
    }

    /// The same filter with other weights after resampling.
    #[must_use]
    pub fn with_after_resampling(self, after: AfterResampling) -> Self {
        MultipleModel { after, ..self }
    }

    /// The same filter with a selection that lets steps compute one mode alone, without the chain. The evidence of such
    /// a step is that of the chosen mode; a measurement that this mode gives no likelihood calls all of them at once.
    ///
    /// # Errors
    /// No error to select by; rules that are out of range.
    pub fn with_selection(self, rules: Wsms) -> Result<Self> {
        rules.check()?;
        if self.error.is_none() {
            return Err(Error::Unsupported("a selection of models needs an error".into()));
        }
        Ok(MultipleModel { selection: Some(rules), ..self })
    }

    /// Settings of the filter.
    pub fn settings(&self) -> &ModalSettings {
        &self.settings
    }

    /// The modes and their chain.
    pub fn model(&self) -> &JumpMarkov<A> {
        &self.model
    }
}

/// The belief of a [`MultipleModel`].
#[derive(Clone, Debug)]
pub struct ModalBelief<const N: usize> {
    cloud: ModalCloud<N>,
    estimate: [f64; N],
    models_computed: usize,
    /// Mode that the last update selected: that with the least error, or the one computed alone.
    selected: Option<usize>,
    selector: Option<Selector>,
    carried: Carried<N>,
}

impl<const N: usize> ModalBelief<N> {
    /// The estimate that the filter's [`Output`] asks for; NaN once every particle is lost.
    pub fn estimate(&self) -> [f64; N] {
        self.estimate
    }

    /// The weighted particles of the last step, before resampling.
    pub fn cloud(&self) -> &ModalCloud<N> {
        &self.cloud
    }

    /// Time of the belief.
    pub fn time(&self) -> Time {
        self.cloud.time
    }

    /// Under how many modes the last step moved the particles; 0 if no time passed.
    pub fn models_computed(&self) -> usize {
        self.models_computed
    }

    /// Mode that the last update selected: of all modes the one with the least error, or the one computed alone; `None`
    /// before the first update and without an error to select by.
    pub fn selected(&self) -> Option<usize> {
        self.selected
    }

    /// An independent continuation: the same particles, other random numbers from here on.
    #[must_use]
    pub fn fork(&self, label: u64) -> Self {
        ModalBelief { cloud: self.cloud.fork(label), ..self.clone() }
    }
}

/// Weights that the survivors carry into the next step.
#[derive(Clone, Debug)]
struct Carried<const N: usize> {
    /// Log-weights up to a common constant; of no meaning while `equal`.
    log_weights: Vec<f64>,
    equal: bool,
    /// ln of the sum of the weights.
    log_sum: f64,
    /// Memory of the second weighing.
    weights: Vec<f64>,
    blocks: Vec<BlockSums<N>>,
}

impl<const N: usize> Carried<N> {
    fn equal(n: usize) -> Self {
        Carried {
            log_weights: Vec::new(),
            equal: true,
            log_sum: Real::ln(n as f64),
            weights: Vec::new(),
            blocks: Vec::new(),
        }
    }
}

/// What of a belief is saved.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SavedModalBelief {
    cloud: SavedModalCloud,
    estimate: Vec<f64>,
    models_computed: usize,
    selected: Option<usize>,
    selector: Option<Selector>,
    /// Log-weights of the survivors and the logarithm of their sum; absent while they are equal.
    carried: Option<(Vec<Option<f64>>, f64)>,
}

impl<const N: usize> Serialize for ModalBelief<N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.saved().serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for ModalBelief<N> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let saved = SavedModalBelief::deserialize(deserializer)?;
        ModalBelief::restore(saved).map_err(serde::de::Error::custom)
    }
}

impl<const N: usize> ModalBelief<N> {
    /// What has to be kept to go on to the same bits.
    pub(crate) fn saved(&self) -> SavedModalBelief {
        let carried = &self.carried;
        let logs = || (carried.log_weights.iter().map(|&l| save_log(l)).collect(), carried.log_sum);
        SavedModalBelief {
            cloud: self.cloud.saved(),
            estimate: self.estimate.to_vec(),
            models_computed: self.models_computed,
            selected: self.selected,
            selector: self.selector.clone(),
            carried: (!carried.equal).then(logs),
        }
    }

    /// The belief that was saved.
    pub(crate) fn restore(saved: SavedModalBelief) -> Result<Self> {
        let cloud = ModalCloud::<N>::restore(saved.cloud)?;
        let shape = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(Error::Shape { what, found, expected }) }
        };
        shape("components of a saved estimate", saved.estimate.len(), N)?;
        for &x in &saved.estimate {
            Error::finite("saved estimate", x)?;
        }
        if let Some(mode) = saved.selected.filter(|&mode| mode >= cloud.modes) {
            return Err(Error::Shape { what: "selected mode", found: mode, expected: cloud.modes - 1 });
        }
        let n = cloud.survivors();
        let mut carried = Carried::equal(n);
        if let Some((log_weights, log_sum)) = saved.carried {
            shape("log-weights of saved survivors", log_weights.len(), n)?;
            carried.log_weights = log_weights.into_iter().map(load_log).collect::<Result<_>>()?;
            carried.log_sum = Error::finite("logarithm of the sum of the saved weights", log_sum)?;
            carried.equal = false;
        }
        let mut estimate = saved.estimate.into_iter();
        Ok(ModalBelief {
            cloud,
            estimate: std::array::from_fn(|_| estimate.next().unwrap_or_default()),
            models_computed: saved.models_computed,
            selected: saved.selected,
            selector: saved.selector,
            carried,
        })
    }
}

/// How the particles of a step come about.
struct Plan<'a, S> {
    /// Step of each mode; none where no time passes.
    steps: Option<&'a [Option<S>; MAX_MODES]>,
    /// Logarithms of the chain's probabilities, where there is one: `jump[i][j]`.
    jump: Option<&'a [[f64; MAX_MODES]; MAX_MODES]>,
    choice: Choice,
}

impl<'a, S> Plan<'a, S> {
    /// Survivors that stand before the first one of mode `j`'s segment: without time each goes on in its mode.
    fn first(&self, counts: &[u32; MAX_MODES], j: usize) -> usize {
        if self.steps.is_some() { 0 } else { counts[..j].iter().sum::<u32>() as usize }
    }

    fn step(&self, j: usize) -> Option<&'a S> {
        self.steps.and_then(|steps| steps[j].as_ref())
    }

    /// The chain weighs the modes against each other where there are several.
    fn jump(&self) -> Option<&'a [[f64; MAX_MODES]; MAX_MODES]> {
        self.jump.filter(|_| self.choice == Choice::All)
    }
}

/// What came of moving and weighing.
struct Weighed<const N: usize> {
    total: Total<N>,
    /// Particles without a likelihood or a state.
    not_finite: usize,
    /// The measurement was taken back, because nothing would have been left.
    degenerate: bool,
}

/// Adds the chain's log-probabilities of mode `j` to the scores of the survivors `rows`, which are sorted by mode.
fn add_jumps(
    jump: &[[f64; MAX_MODES]; MAX_MODES],
    counts: &[u32; MAX_MODES],
    j: usize,
    rows: std::ops::Range<usize>,
    scores: &mut [f64],
) {
    let mut first = 0;
    for (row, &count) in jump.iter().zip(counts) {
        let last = first + count as usize;
        let (from, to) = (first.max(rows.start), last.min(rows.end));
        if from < to && row[j] != 0.0 {
            scores[from - rows.start..to - rows.start].iter_mut().for_each(|score| *score += row[j]);
        }
        first = last;
    }
}

fn logarithms(transition: &Transition) -> [[f64; MAX_MODES]; MAX_MODES] {
    let mut logs = [[0.0; MAX_MODES]; MAX_MODES];
    for (i, row) in logs.iter_mut().enumerate().take(transition.len()) {
        for (j, log) in row.iter_mut().enumerate().take(transition.len()) {
            *log = Real::ln(transition.probability(i, j));
        }
    }
    logs
}

/// How many of `n` particles begin in each mode: one uniform number places a grid of n over the law.
pub(crate) fn first_counts(law: &[f64], n: usize, stream: Stream) -> [usize; MAX_MODES] {
    let offset = stream.draws(Purpose::Mode, 0, 0).uniform();
    let total: f64 = law.iter().sum();
    let (mut counts, mut before, mut sum) = ([0; MAX_MODES], 0, 0.0);
    for (j, p) in law.iter().enumerate() {
        sum += p;
        // Whoever comes last must not lose a particle to rounding, nor a mode of no probability gain one.
        let rest = law[j + 1..].iter().all(|&p| p == 0.0);
        let below = if rest { n } else { (n as f64 * (sum / total) - offset).ceil().max(0.0) as usize };
        let below = below.clamp(before, n);
        counts[j] = below - before;
        before = below;
    }
    counts
}

/// Random numbers of mode `j`: the first mode has the belief's own, so that a single mode is an ordinary particle
/// filter.
pub(crate) fn stream_of(stream: Stream, j: usize) -> Stream {
    const MODE: u64 = 0x6d6f_6465 << 32;
    if j == 0 { stream } else { stream.fork(MODE | j as u64) }
}

/// How many particles there are in all modes together.
pub(crate) fn particles_in(shares: &[(usize, f64)]) -> usize {
    shares.iter().map(|share| share.0).sum()
}

/// States drawn from the Gaussian of each mode, as many as `shares` says, one mode after the other.
pub(crate) fn drawn_by_mode<const N: usize>(
    law: &ModalGaussian<N>,
    stream: Stream,
    shares: &[(usize, f64)],
) -> Result<[Vec<f64>; N]> {
    let mut columns = std::array::from_fn(|_| Vec::with_capacity(particles_in(shares)));
    for (j, &(count, _)) in shares.iter().enumerate().filter(|(_, share)| share.0 > 0) {
        let drawn = law.mode(j).columns(stream_of(stream, j), count)?;
        columns.iter_mut().zip(drawn).for_each(|(all, of_mode): (&mut Vec<f64>, _)| all.extend(of_mode));
    }
    Ok(columns)
}

impl<const N: usize, const W: usize, A, H, E, P> MultipleModel<N, W, A, H, E, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    E: ObservationError<N, H::Value>,
    P: Prior<N>,
{
    /// Moves and weighs the particles of all segments, out of the survivors.
    fn visit(&self, belief: &mut ModalBelief<N>, plan: &Plan<'_, A::Step>, digest: Option<&H::Digest<'_>>) {
        let ModalSettings { simd, noise: source, ref threads, .. } = self.settings;
        let ModalCloud { stream, step: number, counts, .. } = belief.cloud;
        let cloud = &mut belief.cloud;
        let streams: [Stream; MAX_MODES] =
            std::array::from_fn(|j| if plan.step(j).is_some() { stream_of(stream, j) } else { stream });
        let (segments, survivors) = (&cloud.segments, cloud.survivors.each_ref());
        let carried = (!belief.carried.equal).then_some(&belief.carried.log_weights);
        let states = cloud.states.each_mut().map(Vec::as_mut_slice);
        let scores: [&mut [f64]; 2] = [&mut cloud.scores, &mut cloud.weights];
        threads.for_each_block(states, scores, &mut cloud.blocks, |b, states, [scores, weights], sums| {
            let segment = Segment::with_block(segments, b);
            let (mode, part) = (segment.mode, segment.particles_of(b));
            let count = part.len();
            let first = plan.first(&counts, mode) + part.start;
            let rows = first..first + count;
            let mut states = states.map(|column| &mut column[..count]);
            let (scores, weights) = (&mut scores[..count], &mut weights[..count]);
            let from = survivors.map(|column| &column[rows.clone()]);
            if let Some(step) = plan.step(mode) {
                let motion = &self.model.modes()[mode];
                let mut noise = NoiseBlock::<W>::new();
                let block = b - segment.first_block;
                let key = NoiseKey { stream: streams[mode], purpose: Purpose::Motion, step: number, block };
                let size = (count, motion.noise_components());
                kernels::fill_noise(simd, source, motion.noise(), key, size, &mut noise);
                kernels::propagate::<N, W, A>(simd, step, &noise, Source::Columns(from), &mut states);
            } else {
                for (to, from) in states.iter_mut().zip(from) {
                    to.copy_from_slice(from);
                }
            }
            let states = states.each_ref().map(|c| &**c);
            match digest {
                Some(digest) => H::score(digest, simd, &states, scores),
                None => scores.fill(0.0),
            }
            if let Some(jump) = plan.jump() {
                add_jumps(jump, &counts, mode, rows.clone(), scores);
            }
            let carried = carried.map(|log_weights| &log_weights[rows]);
            *sums = kernels::weigh(simd, carried, scores, &states, weights);
        });
    }

    /// Moves the survivors and weighs them by measurement and chain.
    fn weigh(
        &self,
        belief: &mut ModalBelief<N>,
        plan: &Plan<'_, A::Step>,
        digest: Option<&H::Digest<'_>>,
    ) -> Weighed<N> {
        let cloud = &mut belief.cloud;
        let (n, counts) = (cloud.survivors(), cloud.counts);
        let of = |j| match plan.choice {
            _ if plan.steps.is_none() => counts[j] as usize,
            Choice::One(one) if j != one => 0,
            _ => n,
        };
        cloud.lay_out((0..self.model.modes().len()).map(|j| (j, of(j))));
        belief.models_computed = if plan.steps.is_some() { cloud.segments.len() } else { 0 };
        self.visit(belief, plan, digest);
        let total = belief.cloud.total();
        if total.sum.is_finite()
            && total.sum > 0.0
            && total.max < f64::INFINITY
            && total.sum_states.iter().all(|s| s.is_finite())
        {
            return Weighed { total, not_finite: 0, degenerate: false };
        }
        let (not_finite, degenerate) = self.mend(belief, plan);
        Weighed { total: belief.cloud.total(), not_finite, degenerate }
    }

    /// Makes particles worthless whose likelihood is NaN or infinite or whose state is lost; returns how many there
    /// were, and whether the measurement had to be taken back because nothing would be left of it: the weights are then
    /// those of a prediction. Of a lost state nothing may enter the sums: it becomes zero.
    fn mend(&self, belief: &mut ModalBelief<N>, plan: &Plan<'_, A::Step>) -> (usize, bool) {
        let ModalBelief { cloud, carried, .. } = belief;
        let counts = cloud.counts;
        let lost = |cloud: &ModalCloud<N>, row: usize| cloud.states.iter().any(|c| !c[row].is_finite());
        let worthless = |score: f64| score.is_nan() || score == f64::INFINITY;
        let takes_part = |cloud: &ModalCloud<N>, row: usize| {
            let score = cloud.scores[row];
            score != f64::NEG_INFINITY && !worthless(score) && !lost(cloud, row)
        };
        let back = !cloud.segments.iter().any(|s| s.rows().any(|row| takes_part(cloud, row)));
        let mut count = 0;
        for s in 0..cloud.segments.len() {
            let segment = cloud.segments[s];
            let first = plan.first(&counts, segment.mode);
            for b in segment.blocks() {
                let part = segment.particles_of(b);
                let rows = b * BLOCK..b * BLOCK + part.len();
                // The weights without the measurement.
                let mut before = [0.0; BLOCK];
                let before = &mut before[..part.len()];
                let survivors = first + part.start..first + part.end;
                if !carried.equal {
                    before.copy_from_slice(&carried.log_weights[survivors.clone()]);
                }
                if let Some(jump) = plan.jump() {
                    add_jumps(jump, &counts, segment.mode, survivors, before);
                }
                for (row, &before) in rows.clone().zip(before.iter()) {
                    let is_lost = lost(cloud, row);
                    if is_lost || worthless(cloud.scores[row]) {
                        count += usize::from(before != f64::NEG_INFINITY);
                        cloud.scores[row] = f64::NEG_INFINITY;
                    }
                    if back {
                        cloud.scores[row] = if is_lost { f64::NEG_INFINITY } else { before };
                    }
                    if is_lost {
                        cloud.states.iter_mut().for_each(|c| c[row] = 0.0);
                    }
                }
                let states = cloud.states.each_ref().map(|c| &c[rows.clone()]);
                let (scores, weights) = (&mut cloud.scores[rows.clone()], &mut cloud.weights[rows]);
                cloud.blocks[b] = kernels::weigh(self.settings.simd, None, scores, &states, weights);
            }
        }
        (count, back)
    }

    /// Draws and gathers the survivors, with equal weights.
    fn resample(&self, belief: &mut ModalBelief<N>, total: &Total<N>) -> usize {
        let cloud = &mut belief.cloud;
        let n = cloud.survivors();
        cloud.ancestors.resize(n, 0);
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
        cloud.count_ancestors();
        cloud.gather_survivors(self.settings.simd, &self.settings.threads);
        (belief.carried.equal, belief.carried.log_sum) = (true, Real::ln(n as f64));
        drawn
    }

    /// No resampling: all particles go on with the weights that they had.
    fn keep(belief: &mut ModalBelief<N>, not_finite: usize, total: &Total<N>) {
        let ModalBelief { cloud, carried, .. } = belief;
        cloud.keep_all();
        if not_finite > 0 {
            carried.log_weights.clear();
            for segment in &cloud.segments {
                carried.log_weights.extend_from_slice(&cloud.scores[segment.rows()]);
            }
            (carried.equal, carried.log_sum) = (false, total.log_sum());
        }
    }

    /// Every particle is lost: some go on without weight, and stay so.
    fn lose(&self, belief: &mut ModalBelief<N>) {
        let ModalBelief { cloud, carried, .. } = belief;
        let n = cloud.survivors();
        let rows = cloud.segments.iter().flat_map(|s| s.rows()).take(n);
        cloud.ancestors.clear();
        cloud.ancestors.extend(rows.map(|row| row as u32));
        cloud.count_ancestors();
        cloud.gather_survivors(self.settings.simd, &self.settings.threads);
        carried.log_weights.clear();
        carried.log_weights.resize(n, f64::NEG_INFINITY);
        (carried.equal, carried.log_sum) = (false, f64::NEG_INFINITY);
    }

    /// Weighs the survivors by the measurement once more; the sums of their weights and states.
    fn weigh_again(&self, belief: &mut ModalBelief<N>, digest: &H::Digest<'_>) -> Total<N> {
        let ModalSettings { simd, ref threads, .. } = self.settings;
        let n = belief.cloud.survivors();
        let Carried { log_weights, weights, blocks, .. } = &mut belief.carried;
        log_weights.resize(n, 0.0);
        weights.resize(n, 0.0);
        blocks.resize(n.div_ceil(BLOCK), BlockSums::default());
        let states = belief.cloud.survivors.each_ref();
        threads.for_each_block([log_weights, weights], [], blocks, |b, [scores, weights], [], sums| {
            let rows = b * BLOCK..b * BLOCK + scores.len();
            let states = states.map(|column| &column[rows.clone()]);
            H::score(digest, simd, &states, scores);
            *sums = kernels::weigh(simd, None, scores, &states, weights);
        });
        Total::of(blocks)
    }

    /// A belief whose modes have the probabilities `law`, with particles that `columns` makes.
    fn begin(
        &self,
        at: Time,
        stream: Stream,
        law: &[f64],
        columns: impl FnOnce(&[(usize, f64)]) -> Result<[Vec<f64>; N]>,
    ) -> Result<ModalBelief<N>> {
        let n = self.settings.particles;
        let mut shares = [(0, 0.0); MAX_MODES];
        for (share, count) in shares.iter_mut().zip(first_counts(law, n, stream)) {
            share.0 = count;
        }
        let shares = &shares[..law.len()];
        let mut cloud = ModalCloud::from_columns(at, stream, &columns(shares)?, shares)?;
        cloud.keep_all();
        cloud.reserve(n);
        let selection = self.selection.as_ref();
        Ok(ModalBelief {
            estimate: cloud.mean(),
            models_computed: 0,
            selected: None,
            selector: selection.map(|rules| Selector::new(rules, law.len())).transpose()?,
            carried: Carried::equal(n),
            cloud,
        })
    }

    /// The belief of particles drawn from `law`: each mode's from its own Gaussian.
    pub(crate) fn draw(&self, law: &ModalGaussian<N>, stream: Stream) -> Result<ModalBelief<N>> {
        self.begin(law.time(), stream, law.probabilities(), |shares| drawn_by_mode(law, stream, shares))
    }

    /// Mode with the least error of its mean; `None` where none has an error that is a number.
    fn least_error(&self, cloud: &ModalCloud<N>, z: &H::Value) -> Option<usize> {
        let error = self.error.as_ref()?;
        let mut best: Option<(usize, f64)> = None;
        for segment in &cloud.segments {
            let Some(mean) = cloud.mode_mean(segment.mode) else { continue };
            let e = error.error(z, cloud.time, &mean);
            if e.is_finite() && best.is_none_or(|(_, least)| e < least) {
                best = Some((segment.mode, e));
            }
        }
        best.map(|(mode, _)| mode)
    }
}

/// Mean of columns, in eight lanes.
fn plain_mean<const N: usize>(columns: &[Vec<f64>; N]) -> [f64; N] {
    columns.each_ref().map(|column| {
        let mut lanes = [0.0; 8];
        let eights = column.chunks_exact(8);
        for (lane, x) in lanes.iter_mut().zip(eights.remainder()) {
            *lane += x;
        }
        for eight in eights {
            for (lane, x) in lanes.iter_mut().zip(eight) {
                *lane += x;
            }
        }
        lanes.iter().sum::<f64>() / column.len() as f64
    })
}

impl<const N: usize, const W: usize, A, H, E, P> Filter for MultipleModel<N, W, A, H, E, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    E: ObservationError<N, H::Value>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = ModalBelief<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<ModalBelief<N>> {
        let columns = |shares: &[(usize, f64)]| self.prior.columns(stream, particles_in(shares));
        self.begin(at, stream, self.model.chain().initial(), columns)
    }

    fn step(&self, belief: &mut ModalBelief<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let from = belief.cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let digest = z.map(|z| self.sensor.digest(z, to)).transpose()?;
        let (modes, n) = (self.model.modes(), belief.cloud.survivors());
        let (found, expected) = (belief.cloud.modes, modes.len());
        if found != expected {
            return Err(Error::Shape { what: "modes of the belief", found, expected });
        }
        let mut choice = match (&self.selection, &belief.selector) {
            (Some(rules), Some(selector)) if z.is_some() && to > from => selector.choose(rules),
            _ => Choice::All,
        };
        if let Choice::One(found) = choice
            && found >= modes.len()
        {
            return Err(Error::Shape { what: "selected mode", found, expected: modes.len() - 1 });
        }
        let mut steps: [Option<A::Step>; MAX_MODES] = std::array::from_fn(|_| None);
        if to > from {
            for (step, mode) in steps.iter_mut().zip(modes) {
                *step = Some(mode.over(from, to)?);
            }
        }
        let jump = (to > from && modes.len() > 1).then(|| logarithms(&self.model.chain().over(from, to)));

        belief.cloud.step += 1;
        belief.cloud.time = to;
        let mut plan = Plan { steps: (to > from).then_some(&steps), jump: jump.as_ref(), choice };
        let mut weighed = self.weigh(belief, &plan, digest.as_ref());
        let mut evaluations = belief.cloud.len();
        if weighed.degenerate && choice != Choice::All {
            // The selected mode explains nothing: the others may.
            choice = Choice::All;
            plan.choice = choice;
            weighed = self.weigh(belief, &plan, digest.as_ref());
            evaluations += belief.cloud.len();
        }
        let Weighed { total, not_finite, degenerate } = weighed;
        let candidates = belief.cloud.len();
        let mut particles = ParticleUpdate {
            particles: candidates,
            ess: total.ess(),
            resampled: false,
            distinct_ancestors: n,
            not_finite,
            evaluations: if digest.is_some() { evaluations } else { 0 },
        };
        let (outcome, log_evidence) = match digest {
            _ if degenerate => (Outcome::Degenerate, f64::NEG_INFINITY),
            None => (Outcome::Predicted, 0.0),
            Some(_) => (Outcome::Updated, total.log_sum() - belief.carried.log_sum),
        };

        // The output, as far as it comes before resampling.
        let mixture = total.sum_states.map(|s| s / total.sum);
        belief.estimate = mixture;
        let best = z.filter(|_| outcome == Outcome::Updated).and_then(|z| self.least_error(&belief.cloud, z));
        if self.output == Output::LeastError
            && let Some(mode) = belief.selected.or(best)
            && let Some(mean) = belief.cloud.mode_mean(mode)
        {
            belief.estimate = mean;
        }
        let selected = if let Choice::One(mode) = choice { Some(mode) } else { best };
        belief.selected = selected.or(belief.selected);

        if total.sum == 0.0 {
            self.lose(belief);
        } else if digest.is_some() && !degenerate || candidates > n {
            particles.resampled = true;
            particles.distinct_ancestors = self.resample(belief, &total);
            if self.output == Output::Survivors {
                belief.estimate = plain_mean(&belief.cloud.survivors);
            }
            if let (Some(digest), Outcome::Updated) = (&digest, outcome)
                && (self.after == AfterResampling::RecomputedKept
                    || self.after == AfterResampling::Recomputed && self.output == Output::Survivors)
            {
                let again = self.weigh_again(belief, digest);
                particles.evaluations += n;
                if self.output == Output::Survivors {
                    belief.estimate = again.sum_states.map(|s| s / again.sum);
                }
                if self.after == AfterResampling::RecomputedKept {
                    (belief.carried.equal, belief.carried.log_sum) = (false, again.log_sum());
                }
            }
        } else {
            Self::keep(belief, not_finite, &total);
        }

        if let (Some(rules), Some(selector), Some(z)) = (&self.selection, &mut belief.selector, z)
            && let (Some(error), Some(mode)) = (&self.error, belief.selected)
            && to > from
            && outcome == Outcome::Updated
        {
            selector.record(rules, mode, error.error(z, to, &belief.estimate));
        }
        Ok(Update { outcome, log_evidence, particles: Some(particles) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// floor(n p) or ceil(n p) each, n in all, nothing without probability, and n p on average: a count that is n p in
    /// the mean and varies by less than one has a standard deviation of at most 1/2.
    #[test]
    fn first_modes_follow_their_law() {
        let law = [0.31, 0.0, 0.17, 0.52, 0.0];
        let (n, runs) = (10, 4000);
        let mut sums = [0.0; 5];
        for seed in 0..runs {
            let counts = first_counts(&law, n, Stream::new(seed));
            assert_eq!(counts.iter().sum::<usize>(), n);
            for (j, p) in law.iter().enumerate() {
                let expected = n as f64 * p;
                let within = expected.floor()..=expected.ceil();
                assert!(within.contains(&(counts[j] as f64)), "{counts:?}");
                sums[j] += counts[j] as f64;
            }
        }
        for (j, p) in law.iter().enumerate() {
            let error = (sums[j] / runs as f64 - n as f64 * p).abs();
            assert!(error <= 5.0 * 0.5 / (runs as f64).sqrt(), "mode {j}: off by {error}");
        }
    }
}
