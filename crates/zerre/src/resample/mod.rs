//! Resampling: `n` weighted particles become `m` equally weighted ones, or `n` weighted hypotheses fewer.

mod optimal;

pub use optimal::Reduction;

mod interaction;

use crate::belief::MAX_PARTICLES;
use crate::error::{Error, Result};
use crate::kernels::{
    BLOCK, BlockSums, Cumulative, Positions, Simd, Threads, checked_sum, expand_copies, fill_sorted,
    fill_uniforms, merge_sorted, prefix_sums, split_copies, to_exponentials,
};
use crate::rng::{Purpose, Stream};
pub(crate) use interaction::{Mixture, Target};
use serde::{Deserialize, Serialize};

/// How the ancestors are drawn. All give particle i on average m w_i copies; they differ in the spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resampling {
    /// Independent draws: the largest spread (Gordon, Salmond and Smith, 1993).
    Multinomial,
    /// floor(m w_i) copies for sure, the rest multinomial (Liu and Chen, 1998).
    Residual,
    /// One draw in each of m equal strata (Kitagawa, 1996).
    Stratified,
    /// The same place in each of m equal strata (Carpenter, Clifford and Fearnhead, 1999): least work, small spread.
    #[default]
    Systematic,
}

/// When a particle filter resamples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Trigger {
    /// Never: sequential importance sampling.
    Never,
    /// After every measurement.
    Always,
    /// When the effective sample size falls below this fraction of the number of particles.
    Below(f64),
}

impl Default for Trigger {
    fn default() -> Self {
        Trigger::Below(0.5)
    }
}

impl Trigger {
    /// Whether `n` particles of effective sample size `ess` are to be resampled.
    pub fn fires(self, ess: f64, n: usize) -> bool {
        match self {
            Trigger::Never => false,
            Trigger::Always => true,
            Trigger::Below(fraction) => ess < fraction * n as f64,
        }
    }
}

/// Weights in blocks of [`BLOCK`], each relative to its own scale.
pub(crate) struct BlockWeights<'a> {
    pub(crate) weights: &'a [f64],
    /// (factor, sum of the block's weights before the factor), per block.
    pub(crate) blocks: &'a [(f64, f64)],
}

/// Memory that resampling uses again and again.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    cumulative: Vec<f64>,
    positions: Vec<f64>,
    copies: Vec<u32>,
    blocks: Vec<(Cumulative, usize)>,
    pairs: Vec<(f64, f64)>,
    /// Boxes of the state space with their weights, where the number of draws depends on them.
    pub(crate) bins: Vec<(u128, f64)>,
}

/// Resampling with memory that is used again: nothing is allocated after the first call of a size.
#[derive(Clone, Debug)]
pub struct Resampler {
    scheme: Resampling,
    simd: Simd,
    threads: Threads,
    scratch: Scratch,
}

impl Resampler {
    /// A resampler on the calling thread, with the processor's best instructions.
    pub fn new(scheme: Resampling) -> Self {
        Resampler { scheme, simd: Simd::best(), threads: Threads::Serial, scratch: Scratch::default() }
    }

    /// The same with other instructions and threads; results do not depend on them.
    #[must_use]
    pub fn with(self, simd: Simd, threads: Threads) -> Self {
        Resampler { simd, threads, ..self }
    }

    /// Ancestors (indices into `weights`, ascending) of `ancestors.len()` new particles. `weights` need not be
    /// normalised; `step` distinguishes repeated calls with one stream. Returns how many particles were drawn at
    /// least once.
    ///
    /// # Errors
    /// A weight that is negative or not finite, weights that are all zero or whose sum overflows, more than 2^26
    /// weights or draws.
    pub fn ancestors(
        &mut self,
        weights: &[f64],
        stream: Stream,
        step: u64,
        ancestors: &mut [u32],
    ) -> Result<usize> {
        for len in [weights.len(), ancestors.len()] {
            if len > MAX_PARTICLES {
                let (what, value) = ("number of particles", len as f64);
                return Err(Error::OutOfRange { what, value, needs: "it must not exceed 2^26" });
            }
        }
        let mut pairs = std::mem::take(&mut self.scratch.pairs);
        pairs.clear();
        let mut total = 0.0;
        for block in weights.chunks(BLOCK) {
            let (sum, good) = checked_sum(self.simd, block);
            if !good {
                let bad = block.iter().copied().find(|w| w.is_nan() || *w < 0.0).unwrap_or(f64::NAN);
                Error::not_negative("weight", bad)?;
            }
            total += sum;
            pairs.push((1.0, sum));
        }
        Error::positive("sum of the weights", total)?;
        if total < TINY {
            pairs.iter_mut().for_each(|(factor, _)| *factor = FROM_TINY);
        }
        if ancestors.is_empty() {
            return Ok(0);
        }
        let context = Context { level: self.simd, threads: &self.threads, stream, step };
        let drawn =
            self.scheme.draw(context, BlockWeights { weights, blocks: &pairs }, &mut self.scratch, ancestors);
        self.scratch.pairs = pairs;
        Ok(drawn)
    }
}

/// Who works, and from which numbers.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub(crate) level: Simd,
    pub(crate) threads: &'a Threads,
    pub(crate) stream: Stream,
    pub(crate) step: u64,
}

/// Draws per weight would overflow below this sum of weights; a power of two, which costs no digits, brings it back.
const TINY: f64 = 1e-290;
const FROM_TINY: f64 = f64::from_bits((1023 + 600) << 52);

impl Resampling {
    /// Ancestors (indices into `weights`, ascending) of `ancestors.len()` new particles; see [`Resampler::ancestors`].
    ///
    /// # Errors
    /// A weight that is negative or not finite, or weights that are all zero.
    pub fn ancestors(self, weights: &[f64], stream: Stream, step: u64, ancestors: &mut [u32]) -> Result<()> {
        Resampler::new(self).ancestors(weights, stream, step, ancestors).map(|_| ())
    }

    /// How many copies of each particle `draws` new ones contain.
    ///
    /// # Errors
    /// As [`Resampling::ancestors`].
    pub fn counts(self, weights: &[f64], stream: Stream, step: u64, draws: usize) -> Result<Vec<u32>> {
        let mut ancestors = vec![0; draws];
        self.ancestors(weights, stream, step, &mut ancestors)?;
        let mut counts = vec![0; weights.len()];
        for a in ancestors {
            counts[a as usize] += 1;
        }
        Ok(counts)
    }

    /// The engine's entry: weights by blocks, at least one above zero, all finite. Returns how many particles were
    /// drawn at least once.
    pub(crate) fn draw(
        self,
        context: Context<'_>,
        from: BlockWeights<'_>,
        scratch: &mut Scratch,
        ancestors: &mut [u32],
    ) -> usize {
        match self {
            Resampling::Systematic => {
                let offset = context.stream.draws(Purpose::Resample, context.step, 0).uniform();
                sorted(context, from, Positions::Systematic { offset }, &mut scratch.blocks, ancestors)
            }
            Resampling::Stratified => {
                let mut offsets = std::mem::take(&mut scratch.positions);
                offsets.resize(ancestors.len() + 1, 1.0);
                fill_uniforms(context.level, context.stream, context.step, 0, &mut offsets);
                offsets[ancestors.len()] = 1.0;
                let positions = Positions::Stratified { offsets: &offsets };
                let drawn = sorted(context, from, positions, &mut scratch.blocks, ancestors);
                scratch.positions = offsets;
                drawn
            }
            Resampling::Multinomial => {
                let total = cumulate(context.level, &from, &mut scratch.cumulative);
                let scale = total * sorted_uniforms(context, ancestors.len(), &mut scratch.positions);
                let positions = &scratch.positions[..ancestors.len()];
                merge_sorted(context.level, &scratch.cumulative, positions, scale, ancestors)
            }
            Resampling::Residual => residual(context, &from, scratch, ancestors),
        }
    }
}

/// Systematic and stratified resampling, block by block.
fn sorted(
    context: Context<'_>,
    from: BlockWeights<'_>,
    positions: Positions<'_>,
    blocks: &mut Vec<(Cumulative, usize)>,
    ancestors: &mut [u32],
) -> usize {
    let draws = ancestors.len();
    let total: f64 = from.blocks.iter().map(|(factor, sum)| factor * sum).sum();
    let per_weight = draws as f64 / total;
    blocks.clear();
    let (mut before, mut start) = (0.0, 0);
    for (b, &(factor, sum)) in from.blocks.iter().enumerate() {
        let after = before + factor * sum;
        let last = b + 1 == from.blocks.len();
        let below =
            if last { draws as f64 } else { positions.below(after, per_weight).clamp(0.0, draws as f64) };
        let end = (below as u32).max(start);
        blocks.push((Cumulative { before, factor, draws: (start, end) }, 0));
        (before, start) = (after, end);
    }
    // Trailing blocks without any weight must not inherit positions from rounding.
    if let Some(heir) = from.blocks.iter().rposition(|&(factor, sum)| factor * sum > 0.0) {
        blocks[heir].0.draws.1 = draws as u32;
        for (at, _) in &mut blocks[heir + 1..] {
            at.draws = (draws as u32, draws as u32);
        }
    }
    let range = |(at, _): &(Cumulative, usize)| at.draws.0 as usize..at.draws.1 as usize;
    context.threads.for_each_part(ancestors, blocks, range, |b, part, (at, drawn)| {
        let first = b * BLOCK;
        let weights = &from.weights[first..(first + BLOCK).min(from.weights.len())];
        *drawn = fill_sorted(context.level, weights, first as u32, *at, positions, per_weight, part);
    });
    blocks.iter().map(|(_, drawn)| drawn).sum()
}

/// Cumulative weights of all particles; returns the total.
fn cumulate(level: Simd, from: &BlockWeights<'_>, out: &mut Vec<f64>) -> f64 {
    let n = from.weights.len();
    out.resize(n, 0.0);
    let mut before = 0.0;
    for ((weights, out), &(factor, _)) in
        from.weights.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).zip(from.blocks)
    {
        before = prefix_sums(level, weights, factor, before, out);
    }
    before
}

/// `count` sorted positions (cumulative exponential spacings), and one that is the end of the last spacing; returns the
/// factor that brings them into (0, 1).
fn sorted_uniforms(context: Context<'_>, count: usize, positions: &mut Vec<f64>) -> f64 {
    positions.resize(count + 1, 0.0);
    let mut before = 0.0;
    for (b, block) in positions.chunks_mut(BLOCK).enumerate() {
        let mut spacings = [0.0; BLOCK];
        let spacings = &mut spacings[..block.len()];
        fill_uniforms(context.level, context.stream, context.step, b * BLOCK, spacings);
        to_exponentials(context.level, spacings);
        before = prefix_sums(context.level, spacings, 1.0, before, block);
    }
    1.0 / before
}

/// Residual resampling: whole copies first, multinomial draws on the fractions.
fn residual(
    context: Context<'_>,
    from: &BlockWeights<'_>,
    scratch: &mut Scratch,
    ancestors: &mut [u32],
) -> usize {
    let draws = ancestors.len();
    let total: f64 = from.blocks.iter().map(|(factor, sum)| factor * sum).sum();
    let n = from.weights.len();
    scratch.copies.resize(n, 0);
    scratch.cumulative.resize(n, 0.0);
    let (mut sure, mut before) = (0, 0.0);
    for (b, weights) in from.weights.chunks(BLOCK).enumerate() {
        let factors = (from.blocks[b].0, draws as f64 / total);
        let range = b * BLOCK..b * BLOCK + weights.len();
        let mut fractions = [0.0; BLOCK];
        let fractions = &mut fractions[..weights.len()];
        sure += split_copies(context.level, weights, factors, &mut scratch.copies[range.clone()], fractions);
        before = prefix_sums(context.level, fractions, 1.0, before, &mut scratch.cumulative[range]);
    }
    // Whole parts of expectations that sum to `draws` sum to at most that: each is lifted by less than 1e-11 of itself.
    let rest = draws.saturating_sub(sure as usize);
    // The rest varies: room for any, so that no later step allocates.
    scratch.positions.reserve((draws + 1).saturating_sub(scratch.positions.len()));
    if rest > 0 {
        let scale = before * sorted_uniforms(context, rest, &mut scratch.positions);
        let extra = &mut ancestors[..rest];
        merge_sorted(context.level, &scratch.cumulative, &scratch.positions[..rest], scale, extra);
        for &a in extra.iter() {
            scratch.copies[a as usize] += 1;
        }
    }
    let (mut start, mut drawn) = (0, 0);
    for (b, copies) in scratch.copies.chunks(BLOCK).enumerate() {
        let (used, distinct) =
            expand_copies(context.level, copies, (b * BLOCK) as u32, &mut ancestors[start..]);
        start += used;
        drawn += distinct;
    }
    drawn
}

impl Scratch {
    /// Room for `draws` out of `rows` weights, so that no later draw of at most as many allocates.
    pub(crate) fn reserve(&mut self, rows: usize, draws: usize) {
        fn room<T>(list: &mut Vec<T>, len: usize) {
            list.reserve(len.saturating_sub(list.len()));
        }
        room(&mut self.cumulative, rows);
        room(&mut self.positions, draws + 1);
        room(&mut self.copies, rows);
        room(&mut self.blocks, rows.div_ceil(BLOCK));
        room(&mut self.pairs, rows.div_ceil(BLOCK));
    }

    /// Room for numbers that are of use until the next draw.
    pub(crate) fn masses(&mut self) -> &mut Vec<f64> {
        &mut self.cumulative
    }

    /// Block factors and sums as [`BlockWeights`] wants them.
    pub(crate) fn pairs<const N: usize>(&mut self, blocks: &[BlockSums<N>], max: f64) -> Vec<(f64, f64)> {
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.clear();
        pairs.extend(blocks.iter().map(|b| (b.factor(max), b.sum)));
        pairs
    }

    /// Gives the memory of [`Scratch::pairs`] back.
    pub(crate) fn return_pairs(&mut self, pairs: Vec<(f64, f64)>) {
        self.pairs = pairs;
    }
}
