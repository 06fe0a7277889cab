//! A cloud of weighted particles, in columns.

use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::kernels::{self, BLOCK, BlockSums, Simd, Threads, Total};
use crate::math::{Matrix, Real};
use crate::resample::{BlockWeights, Context, Resampling, Scratch};
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// `n` weighted particles of `N` state components, stored as columns.
///
/// After a step that resampled, the cloud still shows the weighted particles before resampling (they estimate
/// better); the survivors are kept as indices and gathered when the next step moves them.
#[derive(Clone, Debug)]
pub struct Cloud<const N: usize> {
    pub(crate) time: Time,
    pub(crate) stream: Stream,
    pub(crate) step: u64,
    /// `states[k][i]`: component k of particle i.
    pub(crate) states: [Vec<f64>; N],
    /// Log-weights up to a common constant; of no meaning while `equal`.
    pub(crate) log_weights: Vec<f64>,
    /// Whether all weights are equal as they enter the next step.
    pub(crate) equal: bool,
    /// ln of the sum of the weights that enter the next step.
    pub(crate) log_sum: f64,
    /// Weights of the last update, each block relative to its own maximum; empty until the first update.
    pub(crate) weights: Vec<f64>,
    pub(crate) blocks: Vec<BlockSums<N>>,
    /// Survivors of the last resampling that are not gathered yet, in what may be another number.
    pub(crate) ancestors: Vec<u32>,
    pub(crate) pending: bool,
    pub(crate) lineage: Lineage,
    /// The other half of two buffers, and the memory that steps use again and again.
    pub(crate) spare: [Vec<f64>; N],
    pub(crate) scores: Vec<f64>,
    /// What a step needs that may have to be taken back; empty until there is one.
    pub(crate) kept: Vec<f64>,
    pub(crate) scratch: Scratch,
}

/// Whom the particles of a cloud come from, among those of the cloud before the step as far as they had
/// survived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Lineage {
    /// Each from the one of its own number.
    #[default]
    Numbers,
    /// Each from the one that `ancestors` names: nothing is pending.
    Ancestors,
    /// From nobody alone.
    Lost,
}

/// Most particles that a cloud holds: indices and random counters are 32 bits wide.
pub const MAX_PARTICLES: usize = 1 << 26;

impl<const N: usize> Cloud<N> {
    /// Equally weighted particles from columns: `states[k][i]` is component `k` of particle `i`.
    ///
    /// # Errors
    /// Columns of different lengths, none or too many particles, a number that is not finite.
    pub fn from_columns(at: Time, stream: Stream, states: [Vec<f64>; N]) -> Result<Self> {
        let n = states.first().map_or(0, Vec::len);
        checked_number(n)?;
        for column in &states {
            if column.len() != n {
                return Err(Error::Shape { what: "particles in a column", found: column.len(), expected: n });
            }
            for &x in column {
                Error::finite("state of a particle", x)?;
            }
        }
        Ok(Cloud {
            time: at,
            stream,
            step: 0,
            log_weights: vec![0.0; n],
            equal: true,
            log_sum: Real::ln(n as f64),
            weights: vec![1.0; n],
            blocks: uniform_blocks(&states),
            ancestors: vec![0; n],
            pending: false,
            lineage: Lineage::default(),
            spare: std::array::from_fn(|_| vec![0.0; n]),
            scores: vec![0.0; n],
            kept: Vec::new(),
            scratch: Scratch::default(),
            states,
        })
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        self.log_weights.len()
    }

    /// Never true: a cloud has at least one particle.
    pub fn is_empty(&self) -> bool {
        self.log_weights.is_empty()
    }

    /// Time of the belief.
    pub fn time(&self) -> Time {
        self.time
    }

    /// Component `k` of all particles, in the units of the model.
    pub fn column(&self, k: usize) -> &[f64] {
        &self.states[k]
    }

    /// State of particle `i`.
    pub fn particle(&self, i: usize) -> [f64; N] {
        std::array::from_fn(|k| self.states[k][i])
    }

    /// Normalised weights, in the order of the particles.
    pub fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        let total = Total::of(&self.blocks);
        self.weights.chunks(BLOCK).zip(&self.blocks).flat_map(move |(weights, block)| {
            let share = block.factor(total.max) / total.sum;
            weights.iter().map(move |w| w * share)
        })
    }

    /// Effective sample size 1 / sum w^2; 0 once every particle is lost (see
    /// [`Outcome::Degenerate`](crate::filter::Outcome::Degenerate)).
    pub fn ess(&self) -> f64 {
        Total::of(&self.blocks).ess()
    }

    /// Weighted mean.
    pub fn mean(&self) -> [f64; N] {
        let total = Total::of(&self.blocks);
        total.sum_states.map(|s| s / total.sum)
    }

    /// Weighted covariance about the mean, `N` x `N` (divided by the sum of the weights).
    pub fn covariance(&self) -> Matrix<N, N> {
        let mean = self.mean();
        let mut sums = Matrix::<N, N>::from_entries(|_, _| 0.0);
        for (i, w) in self.weights().enumerate() {
            let d: [f64; N] = std::array::from_fn(|k| self.states[k][i] - mean[k]);
            for r in 0..N {
                let wd = w * d[r];
                for c in 0..=r {
                    sums.0[r][c] += wd * d[c];
                }
            }
        }
        Matrix::from_entries(|r, c| if c <= r { sums.0[r][c] } else { sums.0[c][r] })
    }

    /// Mean and covariance as a Gaussian.
    ///
    /// # Errors
    /// [`Error::NotFinite`] once every particle is lost.
    pub fn gaussian(&self) -> Result<Gaussian<N>> {
        // A few distinct particles leave a covariance whose smallest eigenvalues are rounding errors of either sign.
        Gaussian::computed("mean of the cloud", "covariance of the cloud", self.mean(), self.covariance())
    }

    /// Weight and state of each particle.
    pub(crate) fn weighted(&self) -> impl Iterator<Item = (f64, [f64; N])> + '_ {
        self.weights().enumerate().map(|(i, w)| (w, self.particle(i)))
    }

    /// The heaviest particle; the first one of several.
    pub fn max_weight(&self) -> [f64; N] {
        heaviest_of(self.weighted())
    }

    /// Weighted mean of the heaviest `share` of the particles (0.1: the best tenth), at least one.
    ///
    /// # Errors
    /// `share` outside (0, 1].
    pub fn robust_mean(&self, share: f64) -> Result<[f64; N]> {
        robust_mean_of(self.weighted(), share)
    }

    /// Smallest value of component `k` whose cumulative weight reaches each of `levels`; NaN once every particle is
    /// lost.
    ///
    /// # Errors
    /// A level outside [0, 1].
    pub fn quantiles<const Q: usize>(&self, k: usize, levels: [f64; Q]) -> Result<[f64; Q]> {
        level_checked(&levels)?;
        Ok(quantiles_of(self.states[k].iter().copied().zip(self.weights()), levels))
    }

    /// An independent continuation: the same particles, other random numbers from here on.
    #[must_use]
    pub fn fork(&self, label: u64) -> Self {
        Cloud { stream: self.stream.fork(label), ..self.clone() }
    }

    /// Gives all particles the same weight: they are draws of one law.
    pub(crate) fn equalise(&mut self) {
        let n = self.len();
        self.weights.fill(1.0);
        for (b, sums) in self.blocks.iter_mut().enumerate() {
            *sums = uniform_block(&self.states, b * BLOCK..((b + 1) * BLOCK).min(n));
        }
        (self.equal, self.pending, self.log_sum) = (true, false, Real::ln(n as f64));
    }

    /// Makes the scores log-weights, up to a common constant, that the particles show; returns their sums.
    pub(crate) fn weigh(&mut self, simd: Simd) -> Total<N> {
        let n = self.len();
        for (b, sums) in self.blocks.iter_mut().enumerate() {
            let range = b * BLOCK..((b + 1) * BLOCK).min(n);
            let states = self.states.each_ref().map(|c| &c[range.clone()]);
            *sums = kernels::weigh(
                simd,
                None,
                &mut self.scores[range.clone()],
                &states,
                &mut self.weights[range],
            );
        }
        self.total()
    }

    /// Lets the weights that the scores were made into enter the next step; `log_sum` is that of their sum.
    pub(crate) fn keep_weights(&mut self, log_sum: f64) {
        std::mem::swap(&mut self.log_weights, &mut self.scores);
        (self.equal, self.pending, self.log_sum) = (false, false, log_sum);
    }

    /// Draws `children` survivors by the weights, whose sums are `total`; they are gathered when the next step
    /// moves them. Returns how many particles were drawn at least once.
    pub(crate) fn resample(
        &mut self,
        resampling: Resampling,
        (level, threads): (Simd, &Threads),
        total: &Total<N>,
        children: usize,
    ) -> usize {
        self.ancestors.resize(children, 0);
        let pairs = self.scratch.pairs(&self.blocks, total.max);
        let context = Context { level, threads, stream: self.stream, step: self.step };
        let from = BlockWeights { weights: &self.weights, blocks: &pairs };
        let drawn = resampling.draw(context, from, &mut self.scratch, &mut self.ancestors);
        self.scratch.return_pairs(pairs);
        (self.pending, self.equal) = (true, true);
        self.log_sum = Real::ln(children as f64);
        drawn
    }

    /// Moves all particles by the same vector.
    pub(crate) fn translate(&mut self, by: &[f64; N]) {
        for (column, by) in self.states.iter_mut().zip(by) {
            column.iter_mut().for_each(|x| *x += by);
        }
        for block in &mut self.blocks {
            for (sum, by) in block.sum_states.iter_mut().zip(by) {
                *sum += by * block.sum;
            }
        }
    }

    /// How many particles the next step has.
    pub(crate) fn coming(&self) -> usize {
        if self.pending { self.ancestors.len() } else { self.len() }
    }

    /// Room for `most` particles.
    pub(crate) fn reserve(&mut self, most: usize) {
        let room = |list: &mut Vec<f64>| list.reserve_exact(most.saturating_sub(list.len()));
        self.states.iter_mut().chain(&mut self.spare).for_each(room);
        [&mut self.log_weights, &mut self.weights, &mut self.scores].into_iter().for_each(room);
        self.blocks.reserve_exact(most.div_ceil(BLOCK).saturating_sub(self.blocks.len()));
        self.ancestors.reserve_exact(most.saturating_sub(self.ancestors.len()));
    }

    /// Gives all that a step writes `n` places. What the new ones hold has no meaning.
    pub(crate) fn resize(&mut self, n: usize) {
        self.states.iter_mut().for_each(|column| column.resize(n, 0.0));
        [&mut self.log_weights, &mut self.weights, &mut self.scores]
            .into_iter()
            .for_each(|column| column.resize(n, 0.0));
        self.blocks.resize(n.div_ceil(BLOCK), BlockSums::default());
    }

    /// Sums over all blocks of the last update.
    pub(crate) fn total(&self) -> Total<N> {
        Total::of(&self.blocks)
    }
}

/// The heaviest state; the first one of several, NaN of none.
pub(super) fn heaviest_of<const N: usize>(weighted: impl Iterator<Item = (f64, [f64; N])>) -> [f64; N] {
    weighted.fold((-1.0, [f64::NAN; N]), |best, one| if one.0 > best.0 { one } else { best }).1
}

/// Weighted mean of the heaviest `share` of the states, at least one.
pub(super) fn robust_mean_of<const N: usize>(
    weighted: impl Iterator<Item = (f64, [f64; N])>,
    share: f64,
) -> Result<[f64; N]> {
    if !(share > 0.0 && share <= 1.0) {
        return Err(Error::OutOfRange {
            what: "share of the particles",
            value: share,
            needs: "it must lie in (0, 1]",
        });
    }
    let mut order: Vec<(f64, [f64; N])> = weighted.collect();
    let kept = ((share * order.len() as f64).ceil() as usize).max(1);
    // Stable: ties stay in the order of the particles.
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    order.truncate(kept);
    let (mut sum, mut mean) = (0.0, [0.0; N]);
    for (w, x) in &order {
        sum += w;
        for k in 0..N {
            mean[k] += w * x[k];
        }
    }
    Ok(mean.map(|m| m / sum))
}

/// Refuses levels of quantiles outside [0, 1].
pub(crate) fn level_checked(levels: &[f64]) -> Result<()> {
    match levels.iter().find(|level| !(0.0..=1.0).contains(*level)) {
        None => Ok(()),
        Some(&value) => {
            Err(Error::OutOfRange { what: "level of a quantile", value, needs: "it must lie in [0, 1]" })
        }
    }
}

/// Quantiles of (value, weight); NaN without any weight.
pub(crate) fn quantiles_of<const Q: usize>(
    weighted: impl Iterator<Item = (f64, f64)>,
    levels: [f64; Q],
) -> [f64; Q] {
    let mut sorted: Vec<(f64, f64)> = weighted.filter(|&(_, w)| w > 0.0).collect();
    sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut cumulative = 0.0;
    for (_, w) in &mut sorted {
        cumulative += *w;
        *w = cumulative;
    }
    levels.map(|level| {
        let at = sorted.partition_point(|&(_, c)| c < level * cumulative);
        sorted.get(at).or(sorted.last()).map_or(f64::NAN, |&(x, _)| x)
    })
}

/// Refuses no or too many particles.
pub(crate) fn checked_number(n: usize) -> Result<usize> {
    let needs = "it must lie between 1 and 2^26";
    let refusal = Error::OutOfRange { what: "number of particles", value: n as f64, needs };
    if (1..=MAX_PARTICLES).contains(&n) { Ok(n) } else { Err(refusal) }
}

/// Block sums of equal weights.
fn uniform_blocks<const N: usize>(states: &[Vec<f64>; N]) -> Vec<BlockSums<N>> {
    let n = states.first().map_or(0, Vec::len);
    (0..n.div_ceil(BLOCK)).map(|b| uniform_block(states, b * BLOCK..((b + 1) * BLOCK).min(n))).collect()
}

/// Sums of a block of equal weights.
fn uniform_block<const N: usize>(states: &[Vec<f64>; N], rows: Range<usize>) -> BlockSums<N> {
    let count = rows.len() as f64;
    let sum_states = std::array::from_fn(|k| states[k][rows.clone()].iter().sum());
    BlockSums { max: 0.0, sum: count, sum_squares: count, sum_states }
}

/// What of a cloud is saved; the rest follows from it. The logarithm of a weight of zero is saved as absent, because
/// text formats have no infinities.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SavedCloud {
    time: Time,
    stream: Stream,
    step: u64,
    states: Vec<Vec<f64>>,
    /// Absent while all weights are equal.
    log_weights: Option<Vec<Option<f64>>>,
    log_sum: f64,
    weights: Vec<f64>,
    blocks: Vec<SavedBlock>,
    survivors: Option<Vec<u32>>,
}

/// A log-weight as it is saved.
pub(crate) fn save_log(weight: f64) -> Option<f64> {
    (weight != f64::NEG_INFINITY).then_some(weight)
}

pub(crate) fn load_log(saved: Option<f64>) -> Result<f64> {
    saved.map_or(Ok(f64::NEG_INFINITY), |weight| Error::finite("saved log-weight", weight))
}

/// Refuses a number of things other than `expected`.
pub(super) fn shape(what: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::Shape { what, found, expected }) }
}

/// Sums of a block: the largest log-weight, sums of w, w^2 and w x.
pub(super) type SavedBlock = (Option<f64>, f64, f64, Vec<f64>);

pub(super) fn save_block<const N: usize>(block: &BlockSums<N>) -> SavedBlock {
    (save_log(block.max), block.sum, block.sum_squares, block.sum_states.to_vec())
}

pub(super) fn load_block<const N: usize>((max, sum, sum_squares, sums): SavedBlock) -> Result<BlockSums<N>> {
    shape("sums of a saved block", sums.len(), N)?;
    for &s in sums.iter().chain([&sum, &sum_squares]) {
        Error::finite("sum of a saved block", s)?;
    }
    let mut sums = sums.into_iter();
    let sum_states = std::array::from_fn(|_| sums.next().unwrap_or_default());
    Ok(BlockSums { max: load_log(max)?, sum, sum_squares, sum_states })
}

impl<const N: usize> Serialize for Cloud<N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.saved().serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for Cloud<N> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let saved = SavedCloud::deserialize(deserializer)?;
        Cloud::restore(saved).map_err(serde::de::Error::custom)
    }
}

impl<const N: usize> Cloud<N> {
    /// What has to be kept to go on to the same bits.
    pub(crate) fn saved(&self) -> SavedCloud {
        SavedCloud {
            time: self.time,
            stream: self.stream,
            step: self.step,
            states: self.states.to_vec(),
            log_weights: (!self.equal).then(|| self.log_weights.iter().map(|&l| save_log(l)).collect()),
            log_sum: self.log_sum,
            weights: self.weights.clone(),
            blocks: self.blocks.iter().map(save_block).collect(),
            survivors: self.pending.then(|| self.ancestors.clone()),
        }
    }

    /// The cloud that was saved.
    pub(crate) fn restore(saved: SavedCloud) -> Result<Self> {
        shape("columns of a saved cloud", saved.states.len(), N)?;
        let mut columns = saved.states.into_iter();
        let states = std::array::from_fn(|_| columns.next().unwrap_or_default());
        let mut cloud = Cloud::from_columns(saved.time, saved.stream, states)?;
        let n = cloud.len();
        shape("weights of a saved cloud", saved.weights.len(), n)?;
        shape("blocks of a saved cloud", saved.blocks.len(), n.div_ceil(BLOCK))?;
        cloud.blocks = saved.blocks.into_iter().map(load_block).collect::<Result<_>>()?;
        for &w in &saved.weights {
            Error::not_negative("saved weight", w)?;
        }
        Error::positive("sum of the saved weights", cloud.total().sum)?;
        Error::finite("logarithm of the sum of the saved weights", saved.log_sum)?;
        if let Some(log_weights) = saved.log_weights {
            shape("log-weights of a saved cloud", log_weights.len(), n)?;
            cloud.log_weights = log_weights.into_iter().map(load_log).collect::<Result<_>>()?;
            cloud.equal = false;
        }
        if let Some(survivors) = saved.survivors {
            checked_number(survivors.len())?;
            if let Some(&bad) = survivors.iter().find(|&&a| a as usize >= n) {
                return Err(Error::Shape {
                    what: "index of a survivor",
                    found: bad as usize,
                    expected: n - 1,
                });
            }
            (cloud.ancestors, cloud.pending) = (survivors, true);
        }
        (cloud.step, cloud.log_sum, cloud.weights) = (saved.step, saved.log_sum, saved.weights);
        Ok(cloud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Survivors of a collapse are few: rounding makes their covariance indefinite, and it must pass all the same.
    #[test]
    fn a_collapsed_cloud_is_a_law() {
        for distinct in 1..=4 {
            for seed in 0..50 {
                let mut draws = Stream::new(seed).draws(crate::rng::Purpose::Other, distinct, 0);
                let points: Vec<[f64; 4]> =
                    (0..distinct).map(|_| std::array::from_fn(|_| 1e3 + draws.normal())).collect();
                let column = |k: usize| (0..2000).map(|i| points[i % points.len()][k]).collect();
                let states = std::array::from_fn(column);
                let cloud = Cloud::<4>::from_columns(Time::ZERO, Stream::new(1), states).unwrap();
                let law = cloud.gaussian().unwrap();
                assert!((0..4).all(|k| law.mean()[k].is_finite() && law.covariance().0[k][k] >= 0.0));
            }
        }
    }

    #[test]
    fn a_lost_cloud_has_no_quantiles() {
        let mut cloud = Cloud::<1>::from_columns(Time::ZERO, Stream::new(1), [vec![1.0, 2.0]]).unwrap();
        cloud.weights.fill(0.0);
        cloud.blocks[0] = BlockSums::default();
        assert!(cloud.quantiles(0, [0.5]).unwrap()[0].is_nan());
        assert!(cloud.gaussian().is_err());
    }
}
