//! Resampling for modes that interact: the new particles of a mode come from those of all modes, each mode with a share
//! of its own.
//!
//! No new mode needs a pass over all old particles. The old particles of a mode are resampled once, for all new modes
//! together, and the draws are dealt out: each new mode gets every so-manieth of those that are left. A draw is as
//! likely to go to a new mode as any other of its old mode, so that the copies of a particle keep their expectation.

use super::{BlockWeights, Context, Resampling, Scratch};
use crate::belief::Segment;
use crate::kernels::{BLOCK, BlockSums};
use crate::model::jump::MAX_MODES;
use crate::rng::Purpose;

/// Weighted particles in segments by mode.
#[derive(Clone, Copy)]
pub(crate) struct Mixture<'a, const N: usize> {
    pub(crate) weights: &'a [f64],
    pub(crate) blocks: &'a [BlockSums<N>],
    pub(crate) segments: &'a [Segment],
}

/// A new mode: how many particles it gets, where they go, and the share that each old mode (not segment) has in them.
/// The shares sum to 1; a mode without weight has none.
#[derive(Clone, Copy)]
pub(crate) struct Target {
    pub(crate) len: usize,
    pub(crate) first: usize,
    pub(crate) shares: [f64; MAX_MODES],
}

impl Resampling {
    /// Draws the rows of the particles of all `targets` from a mixture: row p of an old mode i of weights w gets on
    /// average len * shares\[i\] * w_p / sum(w) places in a target. They ascend. `pools` is memory. Returns how many
    /// rows were drawn at least once.
    pub(crate) fn draw_mixture<const N: usize>(
        self,
        context: Context<'_>,
        from: Mixture<'_, N>,
        targets: &[Target],
        scratch: &mut Scratch,
        pools: &mut [Vec<u32>; 2],
        ancestors: &mut [u32],
    ) -> usize {
        let (mut counts, mut phases) = ([[0; MAX_MODES]; MAX_MODES], [[0.0; MAX_MODES]; MAX_MODES]);
        let modes = from.segments.last().map_or(0, |segment| segment.mode + 1);
        for (j, target) in targets.iter().enumerate() {
            let mut draws = context.stream.draws(Purpose::Mode, context.step, j as u32);
            counts[j] = grid_counts(&target.shares, target.len, draws.uniform());
            phases[j][..modes].iter_mut().for_each(|phase| *phase = draws.uniform());
        }
        let mut places: [usize; MAX_MODES] =
            std::array::from_fn(|j| targets.get(j).map_or(0, |target| target.first));
        let mut drawn = 0;
        for segment in from.segments {
            let i = segment.mode;
            let len: usize = counts.iter().map(|counts| counts[i]).sum();
            let Some(most) = (0..targets.len()).max_by_key(|&j| counts[j][i]).filter(|_| len > 0) else {
                continue;
            };
            pools.iter_mut().for_each(|pool| pool.resize(len, 0));
            let [pool, other] = &mut *pools;
            let context = Context { step: context.step * MAX_MODES as u64 + i as u64, ..context };
            drawn += draw_segment(self, context, from, segment, scratch, pool);
            // Whoever gets most gets what is left: nothing has to be picked for it.
            let (mut left, mut other) = (pool.as_mut_slice(), other.as_mut_slice());
            for j in (0..targets.len()).filter(|&j| j != most && counts[j][i] > 0) {
                let out = &mut ancestors[places[j]..places[j] + counts[j][i]];
                places[j] += out.len();
                let rest = left.len() - out.len();
                deal(left, phases[j][i], out, &mut other[..rest]);
                (left, other) = (&mut other[..rest], left);
            }
            ancestors[places[most]..places[most] + left.len()].copy_from_slice(left);
            places[most] += left.len();
        }
        drawn
    }
}

/// How many of `len` draws each share gets: as many as points of an even grid with this offset fall on it.
fn grid_counts(shares: &[f64; MAX_MODES], len: usize, offset: f64) -> [usize; MAX_MODES] {
    let last = shares.iter().rposition(|&share| share > 0.0);
    let (mut counts, mut before, mut sum) = ([0; MAX_MODES], 0, 0.0);
    for (i, share) in shares.iter().enumerate() {
        sum += share;
        // Rounding must not take a draw from the last, nor give one to a share of nothing.
        let below = if Some(i) == last { len } else { (len as f64 * sum - offset).ceil().max(0.0) as usize };
        let below = if *share > 0.0 { below.clamp(before, len) } else { before };
        counts[i] = below - before;
        before = below;
    }
    counts
}

/// Rows of a segment, as many as `rows` is long; returns how many different ones.
fn draw_segment<const N: usize>(
    scheme: Resampling,
    context: Context<'_>,
    from: Mixture<'_, N>,
    segment: &Segment,
    scratch: &mut Scratch,
    rows: &mut [u32],
) -> usize {
    let blocks = &from.blocks[segment.blocks()];
    let max = blocks.iter().map(|b| b.max).fold(f64::NEG_INFINITY, f64::max);
    let pairs = scratch.pairs(blocks, max);
    let weights = BlockWeights { weights: &from.weights[segment.rows()], blocks: &pairs };
    let drawn = scheme.draw(context, weights, scratch, rows);
    scratch.return_pairs(pairs);
    let first = (segment.first_block * BLOCK) as u32;
    rows.iter_mut().for_each(|row| *row += first);
    drawn
}

/// Deals as many entries of `pool` as `out` is long to it, those on an even grid, so that each entry is as likely as
/// any other, and the others to `rest`; `phase` is uniform on (0, 1).
fn deal(pool: &[u32], phase: f64, out: &mut [u32], rest: &mut [u32]) {
    /// Entries that are copied at once, wanted or not: the next copy overwrites what is too much.
    const AT_ONCE: usize = 8;
    let (mut grid, stride) = grid_of(pool.len(), out.len(), phase);
    let (mut kept, mut begin) = (0, 0);
    for out in out {
        let at = (grid >> 32) as usize;
        grid += stride;
        *out = pool[at];
        let run = at - begin;
        match (pool[begin..].first_chunk::<AT_ONCE>(), rest[kept..].first_chunk_mut::<AT_ONCE>()) {
            (Some(from), Some(to)) if run <= AT_ONCE => *to = *from,
            _ => rest[kept..kept + run].copy_from_slice(&pool[begin..at]),
        }
        kept += run;
        begin = at + 1;
    }
    rest[kept..].copy_from_slice(&pool[begin..]);
}

/// The first point of an even grid of `count` points on `len` places and the distance to the next, both times 2^32. The
/// distance is at least one place, so that no two points share one.
fn grid_of(len: usize, count: usize, phase: f64) -> (u64, u64) {
    let stride = ((len as u64) << 32) / count as u64;
    (((phase * stride as f64) as u64).min(stride - 1), stride)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{Simd, Threads};
    use crate::rng::Stream;

    const SCHEMES: [Resampling; 4] =
        [Resampling::Systematic, Resampling::Stratified, Resampling::Multinomial, Resampling::Residual];

    /// Segments of the given lengths with uneven weights, some of them zero, and targets with the shares that chance
    /// gives them; a mode without weight has none.
    struct Case {
        weights: Vec<f64>,
        blocks: Vec<BlockSums<1>>,
        segments: Vec<Segment>,
        targets: Vec<Target>,
        draws: usize,
    }

    impl Case {
        fn new(lens: &[usize], into: &[usize], seed: u64) -> Case {
            let mut draws = Stream::new(seed).draws(Purpose::Other, 0, 0);
            let (mut weights, mut blocks, mut segments) = (Vec::new(), Vec::new(), Vec::new());
            for (mode, &len) in lens.iter().enumerate() {
                segments.push(Segment { mode, first_block: blocks.len(), len });
                for first in (0..len).step_by(BLOCK) {
                    let from = weights.len();
                    for row in first..len.min(first + BLOCK) {
                        let w = draws.uniform().powi(4);
                        weights.push(if row % 7 == 3 { 0.0 } else { w });
                    }
                    let sum = weights[from..].iter().sum();
                    weights.resize(from + BLOCK, 0.0);
                    blocks.push(BlockSums { max: -3.0 * draws.uniform(), sum, ..BlockSums::default() });
                }
            }
            let mut first = 0;
            let mut target = |&len: &usize| {
                let mut shares = [0.0; MAX_MODES];
                for share in &mut shares[..lens.len()] {
                    *share = if draws.uniform() < 0.3 { 0.0 } else { draws.uniform().powi(3) };
                }
                shares[0] += 1e-3;
                let sum: f64 = shares.iter().sum();
                first += len;
                Target { len, first: first - len, shares: shares.map(|share| share / sum) }
            };
            let targets = into.iter().map(&mut target).collect();
            Case { weights, blocks, segments, targets, draws: into.iter().sum() }
        }

        fn draw(&self, scheme: Resampling, level: Simd, step: u64) -> Vec<u32> {
            let threads = &Threads::Serial;
            let context = Context { level, threads, stream: Stream::new(9), step };
            let from = Mixture { weights: &self.weights, blocks: &self.blocks, segments: &self.segments };
            let mut ancestors = vec![u32::MAX; self.draws];
            let (mut scratch, mut pools) = (Scratch::default(), [Vec::new(), Vec::new()]);
            let (targets, out) = (&self.targets, &mut ancestors);
            let drawn = scheme.draw_mixture(context, from, targets, &mut scratch, &mut pools, out);
            let different: std::collections::BTreeSet<_> = out.iter().collect();
            assert_eq!(drawn, different.len(), "{scheme:?}");
            ancestors
        }
    }

    /// The twin deals by marks: nothing is moved, and every draw walks over all entries that are left.
    fn dealt_by_hand(pool: &[u32], phase: f64, count: usize) -> (Vec<u32>, Vec<u32>) {
        let (first, stride) = grid_of(pool.len(), count, phase);
        let mut is_taken = vec![false; pool.len()];
        (0..count as u64).for_each(|s| is_taken[((first + s * stride) >> 32) as usize] = true);
        let of = |taken: bool| pool.iter().zip(&is_taken).filter(|p| *p.1 == taken).map(|p| *p.0).collect();
        (of(true), of(false))
    }

    #[test]
    fn dealing_gives_the_entries_of_its_twin() {
        let mut draws = Stream::new(2).draws(Purpose::Other, 0, 0);
        for len in [1, 2, 3, 10, 511, 1250] {
            for count in [1, 2, len / 12, len / 3, len / 2, len - 1, len] {
                for _ in 0..20 {
                    let (count, phase) = (count.clamp(1, len), draws.uniform());
                    let pool: Vec<u32> = (0..len as u32).map(|k| k / 2).collect();
                    let (mut out, mut rest) = (vec![0; count], vec![0; len - count]);
                    deal(&pool, phase, &mut out, &mut rest);
                    assert_eq!((out, rest), dealt_by_hand(&pool, phase, count), "{len} {count} {phase}");
                }
            }
        }
    }

    #[test]
    fn draws_ascend_have_weight_and_are_the_same_on_every_level() {
        for seed in 0..20 {
            for (lens, into) in [
                (&[700][..], &[700][..]),
                (&[1, 1, 1], &[1, 1, 1]),
                (&[512, 513, 5], &[300, 1, 700]),
                (&[1250; 4], &[1250; 4]),
                (&[40; 16], &[40; 16]),
            ] {
                let case = Case::new(lens, into, seed);
                for scheme in SCHEMES {
                    let rows = case.draw(scheme, Simd::scalar(), seed);
                    assert_eq!(rows, case.draw(scheme, Simd::best(), seed), "{lens:?} {scheme:?} {seed}");
                    for target in &case.targets {
                        let rows = &rows[target.first..target.first + target.len];
                        assert!(rows.is_sorted());
                        assert!(rows.iter().all(|&row| case.weights[row as usize] > 0.0), "{scheme:?}");
                    }
                }
            }
        }
    }

    /// E[copies] = len * share * w / sum(w): the mean over R runs lies within 5.5 standard errors, sqrt(variance / R);
    /// the variance of a count is at most about that of independent draws, which is at most its mean. Where fewer than
    /// one copy is expected in all runs one is allowed for.
    #[test]
    fn copies_are_unbiased() {
        let case = Case::new(&[30, 600, 3], &[12, 40], 1);
        let runs = 4000u64;
        for scheme in SCHEMES {
            let mut counts = vec![vec![0.0; case.weights.len()]; 2];
            for step in 0..runs {
                let rows = case.draw(scheme, Simd::best(), step);
                for (counts, target) in counts.iter_mut().zip(&case.targets) {
                    for &row in &rows[target.first..target.first + target.len] {
                        counts[row as usize] += 1.0;
                    }
                }
            }
            for (counts, target) in counts.iter().zip(&case.targets) {
                for segment in &case.segments {
                    let of = |row: usize| case.weights[row] * case.blocks[row / BLOCK].max.exp();
                    let total: f64 = segment.rows().map(of).sum();
                    for row in segment.rows() {
                        let expected = target.len as f64 * target.shares[segment.mode] * of(row) / total;
                        let mean = counts[row] / runs as f64;
                        let error = (expected.max(1.0 / runs as f64) / runs as f64).sqrt();
                        assert!(
                            (mean - expected).abs() <= 5.5 * error,
                            "{scheme:?} {row}: {mean} {expected}"
                        );
                    }
                }
            }
        }
    }
}
