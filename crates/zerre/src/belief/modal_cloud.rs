//! Weighted particles that each have a mode, in columns, sorted by mode.

use super::cloud::{
    SavedBlock, heaviest_of, level_checked, load_block, quantiles_of, robust_mean_of, save_block, shape,
};
use crate::belief::{Gaussian, MAX_PARTICLES, ModalGaussian, matched};
use crate::error::{Error, Result};
use crate::kernels::{self, BLOCK, BlockSums, Simd, Source, Survivors, Threads, Total};
use crate::math::Matrix;
use crate::model::jump::MAX_MODES;
use crate::resample::Scratch;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Weighted particles of `N` state components, each in one of several modes: the belief of particle filters for
/// [`JumpMarkov`](crate::model::JumpMarkov) models.
///
/// Like a [`Cloud`](crate::belief::Cloud), it shows the weighted particles of the last step before resampling. How many
/// there are differs from step to step: a filter may move each survivor under every mode.
#[derive(Clone, Debug)]
pub struct ModalCloud<const N: usize> {
    pub(crate) time: Time,
    pub(crate) stream: Stream,
    pub(crate) step: u64,
    /// Number of modes of the model.
    pub(crate) modes: usize,
    /// One segment per mode that has particles, in the order of the modes.
    pub(crate) segments: Vec<Segment>,
    /// `states[k][row]`, rows as the segments say. Rows that belong to no particle have weight 0; their states mean
    /// nothing.
    pub(crate) states: [Vec<f64>; N],
    /// Weights, each block relative to its own maximum.
    pub(crate) weights: Vec<f64>,
    pub(crate) blocks: Vec<BlockSums<N>>,
    /// Log-weights as a step computes them; of no meaning between steps.
    pub(crate) scores: Vec<f64>,
    /// Rows that the last resampling drew, ascending; what stands here is of no meaning unless `resampled`.
    pub(crate) ancestors: Vec<u32>,
    pub(crate) resampled: bool,
    /// The particles that go on, where a filter gathers them: `counts[j]` of mode j, sorted by mode.
    pub(crate) survivors: [Vec<f64>; N],
    pub(crate) counts: [u32; MAX_MODES],
    pub(crate) scratch: Scratch,
    /// Draws that are not yet dealt out to modes, in filters whose modes interact.
    pub(crate) pools: [Vec<u32>; 2],
}

/// Particles of one mode: rows that begin with a whole block. The rest of the last block belongs to nobody.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segment {
    pub(crate) mode: usize,
    pub(crate) first_block: usize,
    pub(crate) len: usize,
}

impl Segment {
    pub(crate) fn rows(self) -> Range<usize> {
        self.first_block * BLOCK..self.first_block * BLOCK + self.len
    }

    pub(crate) fn blocks(self) -> Range<usize> {
        self.first_block..self.first_block + self.len.div_ceil(BLOCK)
    }

    /// Particles of block `block` (of all), counted from the first of the segment.
    pub(crate) fn particles_of(self, block: usize) -> Range<usize> {
        let first = (block - self.first_block) * BLOCK;
        first..self.len.min(first + BLOCK)
    }

    /// The segment among `all` that `block` belongs to.
    pub(crate) fn with_block(all: &[Segment], block: usize) -> Segment {
        let behind = all.partition_point(|s| s.first_block <= block);
        all[behind.max(1) - 1]
    }
}

impl<const N: usize> ModalCloud<N> {
    /// Particles from columns: `shares[j]` says how many are in mode j, and the log-weight of each of them (up to a
    /// common constant). The first ones are in mode 0.
    pub(crate) fn from_columns(
        at: Time,
        stream: Stream,
        columns: &[Vec<f64>; N],
        shares: &[(usize, f64)],
    ) -> Result<Self> {
        let n = shares.iter().map(|(count, _)| count).sum();
        if n == 0 || n > MAX_PARTICLES {
            return Err(Error::OutOfRange {
                what: "number of particles",
                value: n as f64,
                needs: "it must lie between 1 and 2^26",
            });
        }
        for column in columns {
            if column.len() != n {
                return Err(Error::Shape { what: "particles in a column", found: column.len(), expected: n });
            }
            for &x in column {
                Error::finite("state of a particle", x)?;
            }
        }
        let mut cloud = ModalCloud {
            time: at,
            stream,
            step: 0,
            modes: shares.len(),
            segments: Vec::with_capacity(shares.len()),
            states: std::array::from_fn(|_| Vec::new()),
            weights: Vec::new(),
            blocks: Vec::new(),
            scores: Vec::new(),
            ancestors: Vec::new(),
            resampled: false,
            survivors: std::array::from_fn(|_| Vec::new()),
            counts: [0; MAX_MODES],
            scratch: Scratch::default(),
            pools: [Vec::new(), Vec::new()],
        };
        cloud.lay_out(shares.iter().map(|&(count, _)| count).enumerate());
        let mut from = 0;
        for s in 0..cloud.segments.len() {
            let segment = cloud.segments[s];
            for k in 0..N {
                cloud.states[k][segment.rows()].copy_from_slice(&columns[k][from..from + segment.len]);
            }
            from += segment.len;
            cloud.weights[segment.rows()].fill(1.0);
            let (_, log_weight) = shares[segment.mode];
            for b in segment.blocks() {
                let rows = b * BLOCK..b * BLOCK + segment.particles_of(b).len();
                let count = rows.len() as f64;
                let sum_states = std::array::from_fn(|k| cloud.states[k][rows.clone()].iter().sum());
                cloud.blocks[b] = BlockSums { max: log_weight, sum: count, sum_squares: count, sum_states };
            }
        }
        Ok(cloud)
    }

    /// Makes room for particles: (mode, number) in the order of the modes; those of number 0 are left out. What stood
    /// in the rows is lost; rows of nobody get no weight. Nothing is allocated where as many blocks fitted before.
    pub(crate) fn lay_out(&mut self, shares: impl Iterator<Item = (usize, usize)>) {
        self.segments.clear();
        let mut first_block = 0;
        for (mode, len) in shares.filter(|&(_, len)| len > 0) {
            self.segments.push(Segment { mode, first_block, len });
            first_block += len.div_ceil(BLOCK);
        }
        let rows = first_block * BLOCK;
        self.states.iter_mut().for_each(|column| column.resize(rows, 0.0));
        self.weights.resize(rows, 0.0);
        self.scores.resize(rows, 0.0);
        self.blocks.resize(first_block, BlockSums::default());
        for segment in &self.segments {
            let nobody = segment.rows().end..segment.blocks().end * BLOCK;
            self.weights[nobody].fill(0.0);
        }
    }

    /// Room for `n` particles of every mode, out of which `n` are drawn: no step of at most as many allocates.
    pub(crate) fn reserve(&mut self, n: usize) {
        let blocks = self.modes * n.div_ceil(BLOCK);
        let rows = blocks * BLOCK;
        let columns = self.states.iter_mut().chain([&mut self.weights, &mut self.scores]);
        columns.for_each(|column| column.reserve(rows.saturating_sub(column.len())));
        self.blocks.reserve(blocks.saturating_sub(self.blocks.len()));
        self.segments.reserve(self.modes.saturating_sub(self.segments.len()));
        self.ancestors.reserve(n.saturating_sub(self.ancestors.len()));
        self.scratch.reserve(rows, n);
    }

    /// Counts the drawn ancestors by mode, after [`Resampling::draw`](crate::resample::Resampling). An ancestor in the
    /// rows of nobody, which rounding can draw at the very end of a segment, becomes the segment's last particle.
    pub(crate) fn count_ancestors(&mut self) {
        self.counts = [0; MAX_MODES];
        let mut start = 0;
        for segment in &self.segments {
            let (rows, end) = (segment.rows(), segment.blocks().end * BLOCK);
            let behind = start + self.ancestors[start..].partition_point(|&a| (a as usize) < end);
            let drawn = &mut self.ancestors[start..behind];
            for a in drawn.iter_mut().rev().take_while(|a| **a as usize >= rows.end) {
                *a = rows.end as u32 - 1;
            }
            self.counts[segment.mode] = drawn.len() as u32;
            start = behind;
        }
        self.resampled = true;
    }

    /// Copies the ancestors' states to the survivors.
    pub(crate) fn gather_survivors(&mut self, simd: Simd, threads: &Threads) {
        let n = self.ancestors.len();
        self.survivors.iter_mut().for_each(|column| column.resize(n, 0.0));
        let from = Survivors::new(self.states.each_ref().map(Vec::as_slice), &self.ancestors);
        let to = self.survivors.each_mut().map(Vec::as_mut_slice);
        // Nothings take no memory.
        let mut nothing = vec![(); n.div_ceil(BLOCK)];
        threads.for_each_block(to, [], &mut nothing, |b, mut to: [&mut [f64]; N], [], ()| {
            let first = b * BLOCK;
            let block = from.block(simd, first, first + to.first().map_or(0, |c| c.len()));
            kernels::gather(Source::Survivors(block), &mut to);
        });
    }

    /// All particles survive: there was no resampling.
    pub(crate) fn keep_all(&mut self) {
        let n = self.len();
        self.survivors.iter_mut().for_each(|column| column.resize(n, 0.0));
        (self.counts, self.resampled) = ([0; MAX_MODES], false);
        let mut start = 0;
        for segment in &self.segments {
            for (to, from) in self.survivors.iter_mut().zip(&self.states) {
                to[start..start + segment.len].copy_from_slice(&from[segment.rows()]);
            }
            self.counts[segment.mode] = segment.len as u32;
            start += segment.len;
        }
    }

    /// Number of particles that go on.
    pub(crate) fn survivors(&self) -> usize {
        self.counts.iter().sum::<u32>() as usize
    }

    /// Sums over all blocks of the last update.
    pub(crate) fn total(&self) -> Total<N> {
        Total::of(&self.blocks)
    }

    /// Sums over the particles of mode `j`; `max` is -inf if there are none.
    pub(crate) fn total_of(&self, j: usize) -> Total<N> {
        let segment = self.segments.iter().find(|s| s.mode == j);
        Total::of(segment.map_or(&[], |s| &self.blocks[s.blocks()]))
    }

    /// Number of weighted particles; differs from step to step.
    pub fn len(&self) -> usize {
        self.segments.iter().map(|s| s.len).sum()
    }

    /// Never true: a cloud has at least one particle.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// Number of modes of the model.
    pub fn modes(&self) -> usize {
        self.modes
    }

    /// Time of the belief.
    pub fn time(&self) -> Time {
        self.time
    }

    /// Mode, normalised weight and state of each particle; the modes ascend.
    pub fn particles(&self) -> impl Iterator<Item = (usize, f64, [f64; N])> + '_ {
        let total = self.total();
        self.segments.iter().flat_map(move |segment| {
            segment.rows().map(move |row| {
                let share = self.blocks[row / BLOCK].factor(total.max) / total.sum;
                (segment.mode, self.weights[row] * share, std::array::from_fn(|k| self.states[k][row]))
            })
        })
    }

    /// Normalised weights, in the order of [`ModalCloud::particles`].
    pub fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        self.particles().map(|(_, w, _)| w)
    }

    /// Probability of each mode. They are NaN once every particle is lost.
    pub fn probabilities(&self) -> impl Iterator<Item = f64> + '_ {
        let total = self.total();
        (0..self.modes).map(move |j| {
            let of = self.total_of(j);
            if of.sum == 0.0 && total.sum > 0.0 {
                return 0.0;
            }
            BlockSums { max: of.max, ..BlockSums::<N>::default() }.factor(total.max) * of.sum / total.sum
        })
    }

    /// Weighted mean of the particles of mode `j`; `None` if they have no weight.
    pub fn mode_mean(&self, j: usize) -> Option<[f64; N]> {
        let of = self.total_of(j);
        (of.sum > 0.0).then(|| of.sum_states.map(|s| s / of.sum))
    }

    /// Effective sample size 1 / sum w^2; 0 once every particle is lost.
    pub fn ess(&self) -> f64 {
        self.total().ess()
    }

    /// Weighted mean over all modes.
    pub fn mean(&self) -> [f64; N] {
        let total = self.total();
        total.sum_states.map(|s| s / total.sum)
    }

    /// Weighted covariance about the mean over all modes, `N` x `N`: that of each mode, and their spread.
    pub fn covariance(&self) -> Matrix<N, N> {
        let mean = self.mean();
        let mut sums = Matrix::<N, N>::from_entries(|_, _| 0.0);
        for (_, w, x) in self.particles() {
            for r in 0..N {
                let wd = w * (x[r] - mean[r]);
                for c in 0..=r {
                    sums.0[r][c] += wd * (x[c] - mean[c]);
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
        Gaussian::computed("mean of the cloud", "covariance of the cloud", self.mean(), self.covariance())
    }

    /// For each mode its probability and the Gaussian with the mean and covariance of its particles. A mode
    /// without weight has the law of the whole, which says nothing.
    ///
    /// # Errors
    /// There are none once every particle is lost.
    pub fn by_mode(&self) -> Result<ModalGaussian<N>> {
        let mut laws = [None; MAX_MODES];
        for segment in &self.segments {
            let Some(mean) = self.mode_mean(segment.mode) else { continue };
            let of = self.total_of(segment.mode);
            let mut sums = Matrix::<N, N>::ZERO;
            for row in segment.rows() {
                let w = self.weights[row] * self.blocks[row / BLOCK].factor(of.max) / of.sum;
                let d: [f64; N] = std::array::from_fn(|k| self.states[k][row] - mean[k]);
                for r in 0..N {
                    for c in 0..=r {
                        sums.0[r][c] += w * d[r] * d[c];
                    }
                }
            }
            let covariance = Matrix::from_entries(|r, c| if c <= r { sums.0[r][c] } else { sums.0[c][r] });
            let law = Gaussian::computed("mean of a mode", "covariance of a mode", mean, covariance)?;
            laws[segment.mode] = Some(law);
        }
        let laws = &laws[..self.modes];
        let probabilities: Vec<f64> = self.probabilities().collect();
        let known: Vec<_> =
            probabilities.iter().zip(laws).filter_map(|(&p, law)| Some((p, law.as_ref()?))).collect();
        let whole = matched(known.len(), &|i| known[i])?;
        let laws = laws.iter().map(|law| law.unwrap_or(whole)).collect();
        ModalGaussian::new(self.time, probabilities, laws)
    }

    /// The heaviest particle; the first one of several.
    pub fn max_weight(&self) -> [f64; N] {
        heaviest_of(self.particles().map(|(_, w, x)| (w, x)))
    }

    /// Weighted mean of the heaviest `share` of the particles (0.1: the best tenth), at least one.
    ///
    /// # Errors
    /// `share` outside (0, 1].
    pub fn robust_mean(&self, share: f64) -> Result<[f64; N]> {
        robust_mean_of(self.particles().map(|(_, w, x)| (w, x)), share)
    }

    /// Smallest value of component `k` whose cumulative weight reaches each of `levels`; NaN once every
    /// particle is lost.
    ///
    /// # Errors
    /// A level outside [0, 1].
    pub fn quantiles<const Q: usize>(&self, k: usize, levels: [f64; Q]) -> Result<[f64; Q]> {
        level_checked(&levels)?;
        Ok(quantiles_of(self.particles().map(|(_, w, x)| (x[k], w)), levels))
    }

    /// An independent continuation: the same particles, other random numbers from here on.
    #[must_use]
    pub fn fork(&self, label: u64) -> Self {
        ModalCloud { stream: self.stream.fork(label), ..self.clone() }
    }
}

/// What of a cloud is saved; the rest follows from it. Particles stand without gaps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SavedModalCloud {
    time: Time,
    stream: Stream,
    step: u64,
    modes: usize,
    /// Mode and number of particles.
    segments: Vec<(usize, usize)>,
    states: Vec<Vec<f64>>,
    weights: Vec<f64>,
    blocks: Vec<SavedBlock>,
    /// Absent where there was no resampling.
    survivors: Option<Vec<u32>>,
}

impl<const N: usize> Serialize for ModalCloud<N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.saved().serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for ModalCloud<N> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let saved = SavedModalCloud::deserialize(deserializer)?;
        ModalCloud::restore(saved).map_err(serde::de::Error::custom)
    }
}

impl<const N: usize> ModalCloud<N> {
    /// What has to be kept to go on to the same bits.
    pub(crate) fn saved(&self) -> SavedModalCloud {
        let packed = |column: &Vec<f64>| {
            self.segments.iter().flat_map(|s| column[s.rows()].iter().copied()).collect::<Vec<f64>>()
        };
        SavedModalCloud {
            time: self.time,
            stream: self.stream,
            step: self.step,
            modes: self.modes,
            segments: self.segments.iter().map(|s| (s.mode, s.len)).collect(),
            states: self.states.iter().map(packed).collect(),
            weights: packed(&self.weights),
            blocks: self.blocks.iter().map(save_block).collect(),
            survivors: self.resampled.then(|| self.ancestors.clone()),
        }
    }

    /// The cloud that was saved.
    pub(crate) fn restore(saved: SavedModalCloud) -> Result<Self> {
        if saved.modes == 0 || saved.modes > MAX_MODES {
            let (what, value) = ("number of modes", saved.modes as f64);
            return Err(Error::OutOfRange { what, value, needs: "it must lie between 1 and 16" });
        }
        let mut shares = [(0, 0.0); MAX_MODES];
        for pair in saved.segments.windows(2) {
            if pair[0].0 >= pair[1].0 {
                let (what, found) = ("mode of a segment", pair[1].0);
                return Err(Error::Shape { what, found, expected: pair[0].0 + 1 });
            }
        }
        for &(mode, len) in &saved.segments {
            if mode >= saved.modes || len == 0 || len > MAX_PARTICLES {
                let (what, value) = ("particles of a segment", len as f64);
                return Err(Error::OutOfRange { what, value, needs: "a mode of the model must have some" });
            }
            shares[mode].0 = len;
        }
        shape("columns of a saved cloud", saved.states.len(), N)?;
        let mut columns = saved.states.into_iter();
        let columns = std::array::from_fn(|_| columns.next().unwrap_or_default());
        let mut cloud = ModalCloud::from_columns(saved.time, saved.stream, &columns, &shares[..saved.modes])?;
        shape("weights of a saved cloud", saved.weights.len(), cloud.len())?;
        shape("blocks of a saved cloud", saved.blocks.len(), cloud.blocks.len())?;
        for &w in &saved.weights {
            Error::not_negative("saved weight", w)?;
        }
        let mut from = 0;
        for segment in &cloud.segments {
            cloud.weights[segment.rows()].copy_from_slice(&saved.weights[from..from + segment.len]);
            from += segment.len;
        }
        cloud.blocks = saved.blocks.into_iter().map(load_block).collect::<Result<_>>()?;
        Error::positive("sum of the saved weights", cloud.total().sum)?;
        cloud.step = saved.step;
        match saved.survivors {
            None => cloud.keep_all(),
            Some(survivors) => {
                let rows = cloud.weights.len();
                let last = survivors.last().map_or(rows, |&a| a as usize);
                if last >= rows || survivors.windows(2).any(|pair| pair[0] > pair[1]) {
                    return Err(Error::Shape {
                        what: "index of a survivor",
                        found: last,
                        expected: rows - 1,
                    });
                }
                cloud.ancestors = survivors;
                cloud.count_ancestors();
                cloud.gather_survivors(Simd::best(), &Threads::Serial);
            }
        }
        Ok(cloud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(shares: &[(usize, f64)]) -> ModalCloud<1> {
        let n: usize = shares.iter().map(|s| s.0).sum();
        let column = (0..n).map(|i| i as f64).collect();
        ModalCloud::from_columns(Time::ZERO, Stream::new(1), &[column], shares).unwrap()
    }

    /// 600 particles of mode 0, none of mode 1, 3 of mode 2 with three times the weight.
    #[test]
    fn particles_stand_by_mode() {
        let cloud = cloud(&[(600, 0.0), (0, 0.0), (3, 3f64.ln())]);
        assert_eq!((cloud.len(), cloud.modes(), cloud.blocks.len()), (603, 3, 3));
        let sum = 600.0 + 9.0;
        for (i, (mode, w, x)) in cloud.particles().enumerate() {
            let (expected_mode, expected) = if i < 600 { (0, 1.0) } else { (2, 3.0) };
            assert!(mode == expected_mode && x == [i as f64]);
            assert!((w - expected / sum).abs() < 1e-15);
        }
        let p: Vec<f64> = cloud.probabilities().collect();
        assert!((p[0] - 600.0 / sum).abs() < 1e-15 && p[1] == 0.0 && (p[2] - 9.0 / sum).abs() < 1e-15);
        assert_eq!((cloud.mode_mean(0), cloud.mode_mean(1)), (Some([299.5]), None));
        assert!((cloud.mode_mean(2).unwrap()[0] - 601.0).abs() < 1e-12);
        let mean = (600.0 * 299.5 + 9.0 * 601.0) / sum;
        assert!((cloud.mean()[0] - mean).abs() < 1e-12);
        let by_mode = cloud.by_mode().unwrap();
        let (whole, all) = (by_mode.combined().unwrap(), cloud.covariance().0[0][0]);
        // Variance of 0..=599: (600^2 - 1) / 12; of three neighbours 2/3. Sums of 600 lose some 1e-14.
        for (j, variance) in [(0, (360_000.0 - 1.0) / 12.0), (1, all), (2, 2.0 / 3.0)] {
            let found = by_mode.mode(j).covariance().0[0][0];
            assert!((found / variance - 1.0).abs() < 1e-12, "mode {j}: {found}");
        }
        assert!((whole.mean()[0] - mean).abs() < 1e-12 && by_mode.probabilities()[1] == 0.0);
        assert!((whole.covariance().0[0][0] / all - 1.0).abs() < 1e-12);
        assert_eq!(cloud.max_weight(), [600.0]);
        assert!((cloud.robust_mean(0.004).unwrap()[0] - 601.0).abs() < 1e-12);
        // 302 of 609 weights lie below particle 302; the last nine on the last three.
        assert_eq!(cloud.quantiles(0, [0.0, 302.5 / sum, 1.0]).unwrap(), [0.0, 302.0, 602.0]);
        assert!(cloud.quantiles(0, [1.5]).is_err());
    }

    /// Rounding may draw a row of nobody at the end of a segment: it stands for the last particle there.
    #[test]
    fn nobody_is_never_drawn() {
        let mut cloud = cloud(&[(5, 0.0), (0, 0.0), (600, 0.0)]);
        cloud.ancestors = vec![0, 4, 5, 511, 512, 512 + 599, 512 + 600];
        cloud.count_ancestors();
        assert_eq!(cloud.ancestors, [0, 4, 4, 4, 512, 512 + 599, 512 + 599]);
        assert_eq!((cloud.counts[..3].to_vec(), cloud.survivors()), (vec![4, 0, 3], 7));
        for simd in Simd::available() {
            cloud.gather_survivors(simd, &Threads::Serial);
            assert_eq!(cloud.survivors[0], [0.0, 4.0, 4.0, 4.0, 5.0, 604.0, 604.0]);
        }
    }

    #[test]
    fn what_is_no_cloud_is_refused() {
        let mut cloud = cloud(&[(2, 0.0), (1, 0.0)]);
        cloud.ancestors = vec![0, 1, 512];
        cloud.count_ancestors();
        let saved = serde_json::to_string(&cloud).unwrap();
        let load = |text: &str| serde_json::from_str::<ModalCloud<1>>(text);
        assert_eq!(serde_json::to_string(&load(&saved).unwrap()).unwrap(), saved);
        for (from, to) in [
            ("\"segments\":[[0,2],[1,1]]", "\"segments\":[[0,2],[0,1]]"),
            ("\"segments\":[[0,2],[1,1]]", "\"segments\":[[0,2],[2,1]]"),
            ("\"segments\":[[0,2],[1,1]]", "\"segments\":[[0,3]]"),
            ("\"modes\":2", "\"modes\":17"),
            ("\"weights\":[1.0", "\"weights\":[-1.0"),
            ("\"survivors\":[0,1,512]", "\"survivors\":[0,1,1024]"),
            ("\"survivors\":[0,1,512]", "\"survivors\":[1,0,512]"),
            ("\"survivors\":[0,1,512]", "\"survivors\":[]"),
        ] {
            assert!(saved.contains(from), "{saved}");
            assert!(load(&saved.replace(from, to)).is_err(), "{to}");
        }
    }
}
