//! Resampling for modes that interact: the new particles of a mode come from those of all modes, each mode with a weight
//! of its own. The old weights are summed up once for all new modes, not once for each.

use super::{BlockWeights, Context, Resampling, Scratch, sorted_uniforms};
use crate::belief::Segment;
use crate::kernels::{BLOCK, BlockSums, Simd, fill_uniforms, merge_sorted, prefix_sums};
use crate::model::jump::MAX_MODES;
use crate::rng::Purpose;

/// Weighted particles in segments by mode.
#[derive(Clone, Copy)]
pub(crate) struct Mixture<'a, const N: usize> {
    pub(crate) weights: &'a [f64],
    pub(crate) blocks: &'a [BlockSums<N>],
    pub(crate) segments: &'a [Segment],
}

/// Draws for which a search costs less than a merge: fewer than one in so many particles.
const SPARSE: usize = 8;

impl<const N: usize> Mixture<'_, N> {
    /// Sums up the weights of each segment, each from zero and with an infinity behind it, so that a mode of little weight
    /// keeps its digits.
    pub(crate) fn cumulate(self, level: Simd, scratch: &mut Scratch) {
        let len: usize = self.segments.iter().map(|s| s.len + 1).sum();
        scratch.cumulative.resize(len, 0.0);
        let mut rest = scratch.cumulative.as_mut_slice();
        for segment in self.segments {
            let (sums, behind) = std::mem::take(&mut rest).split_at_mut(segment.len);
            let max = self.max(segment);
            let mut before = 0.0;
            for (out, b) in sums.chunks_mut(BLOCK).zip(segment.blocks()) {
                let weights = &self.weights[b * BLOCK..b * BLOCK + out.len()];
                before = prefix_sums(level, weights, self.blocks[b].factor(max), before, out);
            }
            let (infinity, behind) = behind.split_at_mut(1);
            infinity.fill(f64::INFINITY);
            rest = behind;
        }
    }

    fn max(&self, segment: &Segment) -> f64 {
        self.blocks[segment.blocks()].iter().map(|b| b.max).fold(f64::NEG_INFINITY, f64::max)
    }
}

impl Resampling {
    /// Draws the rows (ascending) of new particles from a mixture that has been cumulated into `scratch`. Segment `s` gets
    /// the share `shares[s]` of them on average; the shares sum to 1, and a segment without weight has none.
    ///
    /// The indices are those that [`Resampling::draw`] finds for the weights of all rows, up to rounding.
    pub(crate) fn draw_mixture<const N: usize>(
        self,
        context: Context<'_>,
        from: Mixture<'_, N>,
        shares: &[f64; MAX_MODES],
        scratch: &mut Scratch,
        ancestors: &mut [u32],
    ) {
        let draws = ancestors.len();
        let positions = &mut scratch.positions;
        let unit = match self {
            Resampling::Residual => return draw_rows(self, context, from, shares, scratch, ancestors),
            Resampling::Multinomial => sorted_uniforms(context, draws, positions),
            Resampling::Systematic => {
                let offset = context.stream.draws(Purpose::Resample, context.step, 0).uniform();
                positions.resize(draws + 1, 0.0);
                positions.iter_mut().enumerate().for_each(|(r, p)| *p = r as f64 + offset);
                1.0 / draws as f64
            }
            Resampling::Stratified => {
                positions.resize(draws + 1, 0.0);
                fill_uniforms(context.level, context.stream, context.step, 0, positions);
                positions.iter_mut().enumerate().for_each(|(r, p)| *p += r as f64);
                1.0 / draws as f64
            }
        };
        let last = shares.iter().rposition(|&share| share > 0.0);
        let (mut start, mut before, mut rest) = (0, 0.0, scratch.cumulative.as_slice());
        for (s, segment) in from.segments.iter().enumerate() {
            let (sums, behind) = rest.split_at(segment.len + 1);
            rest = behind;
            if shares[s] == 0.0 {
                continue;
            }
            let after = before + shares[s];
            let end = if Some(s) == last {
                draws
            } else {
                start + positions[start..draws].partition_point(|p| p * unit < after)
            };
            // From places in the mixture to places in the segment's sums.
            let total = sums[segment.len - 1];
            let (stretch, most) = (total / shares[s], total * (1.0 - f64::EPSILON));
            let (scale, shift) = (stretch * unit, before * stretch);
            positions[start..end].iter_mut().for_each(|p| *p = (*p * scale - shift).max(0.0).min(most));
            let out = &mut ancestors[start..end];
            if out.len() * SPARSE < segment.len {
                search_sorted(sums, &positions[start..end], out);
            } else {
                let next = std::mem::replace(&mut positions[end], f64::INFINITY);
                merge_sorted(sums, &positions[start..=end], 1.0, out);
                positions[end] = next;
            }
            let first = segment.rows().start as u32;
            out.iter_mut().for_each(|row| *row += first);
            (start, before) = (end, after);
        }
    }
}

/// For each position the first `i` such that it lies below `sums[i]`, by halving; the last sum is infinite. Eight searches
/// run side by side, because each waits for its own loads.
fn search_sorted(sums: &[f64], positions: &[f64], out: &mut [u32]) {
    const WAYS: usize = 8;
    for (positions, out) in positions.chunks(WAYS).zip(out.chunks_mut(WAYS)) {
        let mut at = [0.0; WAYS];
        at[..positions.len()].copy_from_slice(positions);
        let (mut first, mut size) = ([0; WAYS], sums.len());
        while size > 1 {
            let half = size / 2;
            for (first, at) in first.iter_mut().zip(at) {
                *first += if sums[*first + half - 1] <= at { half } else { 0 };
            }
            size -= half;
        }
        for (out, first) in out.iter_mut().zip(first) {
            *out = first as u32;
        }
    }
}

/// A pass over all rows: what every scheme can do, and residual resampling has to, because the whole copies of a particle
/// depend on the new mode.
fn draw_rows<const N: usize>(
    scheme: Resampling,
    context: Context<'_>,
    from: Mixture<'_, N>,
    shares: &[f64; MAX_MODES],
    scratch: &mut Scratch,
    ancestors: &mut [u32],
) {
    let mut pairs = std::mem::take(&mut scratch.pairs);
    pairs.clear();
    for (segment, share) in from.segments.iter().zip(shares) {
        let max = from.max(segment);
        let blocks = &from.blocks[segment.blocks()];
        let total: f64 = blocks.iter().map(|b| b.factor(max) * b.sum).sum();
        let scale = if *share > 0.0 { share / total } else { 0.0 };
        pairs.extend(blocks.iter().map(|b| (b.factor(max) * scale, b.sum)));
    }
    // Nobody misses the sums of the segments that stood in the scratch: a pass over all rows has no use for them.
    scheme.draw(context, BlockWeights { weights: from.weights, blocks: &pairs }, scratch, ancestors);
    scratch.pairs = pairs;
}

impl Scratch {
    /// Makes room for any draws from and to so many rows.
    pub(crate) fn reserve(&mut self, rows: usize) {
        self.cumulative.reserve(rows + MAX_MODES);
        self.positions.reserve(rows + 1);
        self.copies.reserve(rows);
        self.blocks.reserve(rows / BLOCK + 1);
        self.pairs.reserve(rows / BLOCK + 1);
    }

    /// How many different rows, of `rows` in all, the `ancestors` name.
    pub(crate) fn count_distinct(&mut self, rows: usize, ancestors: impl Iterator<Item = u32>) -> usize {
        let marks = &mut self.copies;
        marks.clear();
        marks.resize(rows.div_ceil(32), 0);
        for a in ancestors {
            marks[a as usize / 32] |= 1 << (a % 32);
        }
        marks.iter().map(|marks| marks.count_ones() as usize).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::Threads;
    use crate::rng::Stream;

    /// Segments of the given lengths with weights from `weight(row)`, and the shares that chance gives them.
    struct Case {
        weights: Vec<f64>,
        blocks: Vec<BlockSums<1>>,
        segments: Vec<Segment>,
        shares: [f64; MAX_MODES],
    }

    impl Case {
        fn new(lens: &[usize], seed: u64) -> Case {
            let mut draws = Stream::new(seed).draws(Purpose::Other, 0, 0);
            let (mut weights, mut blocks, mut segments) = (Vec::new(), Vec::new(), Vec::new());
            let mut shares = [0.0; MAX_MODES];
            for (mode, &len) in lens.iter().enumerate() {
                segments.push(Segment { mode, first_block: blocks.len(), len });
                for first in (0..len).step_by(BLOCK) {
                    let count = (len - first).min(BLOCK);
                    let from = weights.len();
                    // From even to hopelessly uneven, with zeros.
                    let power = [0.0, 1.0, 8.0][(seed % 3) as usize];
                    weights.extend((0..count).map(|_| {
                        let w = draws.uniform().powf(power);
                        if power > 0.0 && draws.uniform() < 0.1 { 0.0 } else { w }
                    }));
                    let sum = weights[from..].iter().sum();
                    weights.resize(from + BLOCK, 0.0);
                    let max = -3.0 * draws.uniform();
                    blocks.push(BlockSums { max, sum, ..BlockSums::default() });
                }
                let has_weight = weights[segments[mode].rows()].iter().any(|&w| w > 0.0);
                let share = if draws.uniform() < 0.2 { 0.0 } else { draws.uniform().powi(3) };
                shares[mode] = if has_weight { share } else { 0.0 };
            }
            if shares.iter().all(|&share| share == 0.0) {
                shares[0] = 1.0;
                weights[0] = 1.0;
                blocks[0].sum = weights[..BLOCK].iter().sum();
            }
            let sum: f64 = shares.iter().sum();
            Case { weights, blocks, segments, shares: shares.map(|share| share / sum) }
        }

        fn mixture(&self) -> Mixture<'_, 1> {
            Mixture { weights: &self.weights, blocks: &self.blocks, segments: &self.segments }
        }
    }

    const SCHEMES: [Resampling; 4] =
        [Resampling::Systematic, Resampling::Stratified, Resampling::Multinomial, Resampling::Residual];

    /// The twin is the resampling of all rows, which weighs each of them and knows nothing of segments.
    #[test]
    fn one_cumulation_finds_the_rows_of_a_pass_over_all() {
        for seed in 0..60 {
            for lens in [&[1][..], &[700], &[1, 1, 1], &[512, 513, 5], &[1250; 4], &[40; 16]] {
                let case = Case::new(lens, seed);
                for scheme in SCHEMES {
                    for draws in [1, 7, 500, 1250] {
                        for level in [Simd::scalar(), Simd::best()] {
                            let threads = &Threads::Serial;
                            let context = Context { level, threads, stream: Stream::new(seed), step: 3 };
                            let (mut fast, mut naive) = (vec![0; draws], vec![0; draws]);
                            let mut scratch = Scratch::default();
                            case.mixture().cumulate(level, &mut scratch);
                            let from = case.mixture();
                            scheme.draw_mixture(context, from, &case.shares, &mut scratch, &mut fast);
                            draw_rows(scheme, context, from, &case.shares, &mut scratch, &mut naive);
                            assert_eq!(fast, naive, "{lens:?} {scheme:?} {draws} {seed}");
                            let worthless =
                                fast.iter().find(|&&row| case.weights[row as usize] == 0.0).copied();
                            assert_eq!(worthless, None, "{lens:?} {scheme:?} {draws} {seed}");
                        }
                    }
                }
            }
        }
    }

    /// E[copies] = draws * share * w / (sum of the segment's w): the mean over R runs lies within 5 standard errors,
    /// sqrt(variance / R), the variance of a count being at most that of the multinomial, draws p.
    #[test]
    fn copies_are_unbiased() {
        let case = Case::new(&[30, 600, 3], 1);
        let (runs, draws) = (4000u64, 16);
        for scheme in SCHEMES {
            let mut counts = vec![0.0; case.weights.len()];
            let mut scratch = Scratch::default();
            case.mixture().cumulate(Simd::best(), &mut scratch);
            let mut rows = vec![0; draws];
            for step in 0..runs {
                let threads = &Threads::Serial;
                let context = Context { level: Simd::best(), threads, stream: Stream::new(4), step };
                scheme.draw_mixture(context, case.mixture(), &case.shares, &mut scratch, &mut rows);
                rows.iter().for_each(|&row| counts[row as usize] += 1.0);
            }
            for (s, segment) in case.segments.iter().enumerate() {
                let of = |row: usize| case.weights[row] * case.blocks[row / BLOCK].max.exp();
                let total: f64 = segment.rows().map(of).sum();
                for row in segment.rows() {
                    let expected = draws as f64 * case.shares[s] * of(row) / total;
                    let mean = counts[row] / runs as f64;
                    let error = (expected.max(1.0 / runs as f64) / runs as f64).sqrt();
                    assert!((mean - expected).abs() <= 5.0 * error, "{scheme:?} {row}: {mean} {expected}");
                }
            }
        }
    }
}
