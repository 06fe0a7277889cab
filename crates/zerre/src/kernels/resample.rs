//! Resampling as indices: where the cumulative weights pass the positions of the draws.

use super::{LANES, Simd};
use crate::math::{Lanes, Real};
use fearless_simd::{Simd as Token, f64x8, prelude::*, u64x8};

/// Where a block stands in the cumulative weights of the whole.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cumulative {
    /// Sum of the weights of all blocks before.
    pub(crate) before: f64,
    /// Factor from the block's weights to common ones.
    pub(crate) factor: f64,
    /// Number of draws that fall before the block, and before its end.
    pub(crate) draws: (u32, u32),
}

/// Cumulative sums of `weights * factor`, starting from `before`; written to `out`, the last one returned.
pub(crate) fn prefix_sums(level: Simd, weights: &[f64], factor: f64, before: f64, out: &mut [f64]) -> f64 {
    #[inline(always)]
    fn run<S: Token>(simd: S, weights: &[f64], factor: f64, before: f64, out: &mut [f64]) -> f64 {
        let mut carry = before;
        let mut i = 0;
        while i < weights.len() {
            let n = LANES.min(weights.len() - i);
            let w = load_zeros(simd, &weights[i..i + n]);
            let sums = prefix(simd, w).mul_add(Lanes::splat(simd, factor), Lanes::splat(simd, carry));
            let mut a = [0.0; LANES];
            sums.store(&mut a);
            out[i..i + n].copy_from_slice(&a[..n]);
            carry = a[n - 1];
            i += n;
        }
        carry
    }
    fn naive(weights: &[f64], factor: f64, mut carry: f64, out: &mut [f64]) -> f64 {
        for (weights, out) in weights.chunks(LANES).zip(out.chunks_mut(LANES)) {
            let sums = prefix_naive(weights);
            for (out, sum) in out.iter_mut().zip(sums) {
                *out = Real::mul_add(sum, factor, carry);
            }
            carry = out[out.len() - 1];
        }
        carry
    }
    dispatch!(
        level,
        simd => run(simd, weights, factor, before, out),
        naive => naive(weights, factor, before, out)
    )
}

/// Inclusive prefix sums of eight lanes, in three steps of distance 1, 2, 4.
#[inline(always)]
fn prefix<S: Token>(simd: S, x: Lanes<S>) -> Lanes<S> {
    let zero = f64x8::splat(simd, 0.0);
    let x = x.0;
    let x = x + simd.slide_f64x8::<7>(zero, x);
    let x = x + simd.slide_f64x8::<6>(zero, x);
    Lanes(x + simd.slide_f64x8::<4>(zero, x))
}

/// The twin of [`prefix`]: the same additions in the same order; missing weights are zero.
fn prefix_naive(weights: &[f64]) -> [f64; LANES] {
    let mut x = [0.0; LANES];
    x[..weights.len()].copy_from_slice(weights);
    for distance in [1, 2, 4] {
        for j in (distance..LANES).rev() {
            x[j] += x[j - distance];
        }
    }
    x
}

#[inline(always)]
fn load_zeros<S: Token>(simd: S, from: &[f64]) -> Lanes<S> {
    if from.len() == LANES {
        return Lanes::load(simd, from);
    }
    let mut all = [0.0; LANES];
    all[..from.len()].copy_from_slice(from);
    Lanes::load(simd, &all)
}

/// How the draws lie in the cumulative weights.
#[derive(Clone, Copy)]
pub(crate) enum Positions<'a> {
    /// (j + u) / draws: one uniform number for all (Carpenter, Clifford and Fearnhead, 1999).
    Systematic { offset: f64 },
    /// (j + u_j) / draws (Kitagawa, 1996); the slice has one number per draw and a last one that is 1.
    Stratified { offsets: &'a [f64] },
}

impl Positions<'_> {
    /// How many positions lie below the cumulative weight `c`, with `per_weight` draws for a weight of 1.
    pub(crate) fn below(self, c: f64, per_weight: f64) -> u64 {
        match self {
            Positions::Systematic { offset } => Real::mul_add(c, per_weight, -offset).ceil().max(0.0) as u64,
            Positions::Stratified { offsets } => {
                let t = c * per_weight;
                let cell = (t as usize).min(offsets.len() - 1);
                cell as u64 + u64::from(offsets[cell] < t - cell as f64)
            }
        }
    }

    /// [`Positions::below`] of eight cumulative weights.
    #[inline(always)]
    fn below_lanes<S: Token>(self, simd: S, c: Lanes<S>, per_weight: f64) -> [u64; LANES] {
        match self {
            Positions::Systematic { offset } => {
                let t = c.mul_add(Lanes::splat(simd, per_weight), Lanes::splat(simd, -offset));
                to_integers(simd, Lanes(simd.ceil_f64x8(t.0)).max(Lanes::splat(simd, 0.0)))
            }
            Positions::Stratified { offsets } => {
                let t = c * per_weight;
                let floor = Lanes(simd.floor_f64x8(t.0));
                let cells = to_integers(simd, floor);
                let last = offsets.len() - 1;
                let u: [f64; LANES] = std::array::from_fn(|j| offsets[(cells[j] as usize).min(last)]);
                let one = Lanes::splat(simd, 1.0);
                let next = Lanes::load(simd, &u).if_lt(t - floor, floor + one, floor);
                to_integers(simd, next)
            }
        }
    }
}

/// Resamples one block: writes `first + i` for every position that falls on weight `i` of the block. `ancestors` is
/// the part that belongs to this block, from `at.draws.0` to `at.draws.1`. Returns how many of the weights were drawn
/// at least once.
pub(crate) fn fill_sorted(
    level: Simd,
    weights: &[f64],
    first: u32,
    at: Cumulative,
    positions: Positions<'_>,
    per_weight: f64,
    ancestors: &mut [u32],
) -> usize {
    #[inline(always)]
    fn run<S: Token>(
        simd: S,
        weights: &[f64],
        at: Cumulative,
        positions: Positions<'_>,
        per_weight: f64,
        mut take: impl FnMut(usize, &[u64]),
    ) {
        let mut carry = at.before;
        for (i, eight) in weights.chunks(LANES).enumerate() {
            let sums = prefix(simd, load_zeros(simd, eight))
                .mul_add(Lanes::splat(simd, at.factor), Lanes::splat(simd, carry));
            let below = positions.below_lanes(simd, sums, per_weight);
            carry = last_lane(sums);
            take(i * LANES, &below[..eight.len()]);
        }
    }
    fn naive(
        weights: &[f64],
        at: Cumulative,
        positions: Positions<'_>,
        per_weight: f64,
        mut take: impl FnMut(usize, &[u64]),
    ) {
        let mut carry = at.before;
        for (i, eight) in weights.chunks(LANES).enumerate() {
            let sums = prefix_naive(eight).map(|sum| Real::mul_add(sum, at.factor, carry));
            carry = sums[LANES - 1];
            take(i * LANES, &sums.map(|c| positions.below(c, per_weight))[..eight.len()]);
        }
    }

    let (mut start, mut drawn) = (0, 0);
    let last = ancestors.len() as u64;
    let mut take = |i: usize, below: &[u64]| {
        for (j, &b) in below.iter().enumerate() {
            let end = b.saturating_sub(u64::from(at.draws.0)).min(last) as usize;
            drawn += usize::from(end > start);
            put(ancestors, start, end, first + (i + j) as u32);
            start = start.max(end);
        }
    };
    dispatch!(
        level,
        simd => run(simd, weights, at, positions, per_weight, &mut take),
        naive => naive(weights, at, positions, per_weight, &mut take)
    );
    if start < ancestors.len() {
        // The block's sum and its cumulative sums round differently: a position at the very end may be left to nobody.
        // It belongs to the last weight that is not zero.
        let heir = first + weights.iter().rposition(|&w| w > 0.0).unwrap_or(0) as u32;
        drawn += usize::from(start == 0 || ancestors[start - 1] != heir);
        ancestors[start..].fill(heir);
    }
    drawn
}

#[inline(always)]
fn last_lane<S: Token>(x: Lanes<S>) -> f64 {
    let mut a = [0.0; LANES];
    x.store(&mut a);
    a[LANES - 1]
}

/// Writes `value` to `out[start..end]`; eight at once, whatever stands behind is overwritten by those that follow.
#[inline(always)]
pub(crate) fn put(out: &mut [u32], start: usize, end: usize, value: u32) {
    if start + LANES <= out.len() && end <= start + LANES {
        out[start..start + LANES].fill(value);
    } else if end > start {
        out[start..end].fill(value);
    }
}

/// Non-negative integer-valued lanes below 2^51 as integers.
#[inline(always)]
fn to_integers<S: Token>(simd: S, x: Lanes<S>) -> [u64; LANES] {
    // Under the exponent of 2^52 the mantissa is the integer.
    let bits: u64x8<S> = (x + 4_503_599_627_370_496.0).0.bitcast();
    (bits & u64x8::splat(simd, 0x000f_ffff_ffff_ffff)).into()
}

/// For sorted `positions`, calls `hit(i)` for each with the first `i` such that position < cumulative[i]; the last
/// `i` takes what is left. Free of branches that depend on the data.
#[inline(always)]
pub(crate) fn merge_sorted(cumulative: &[f64], positions: &[f64], scale: f64, out: &mut [u32]) {
    let n = cumulative.len();
    let (mut i, mut j) = (0, 0);
    while j < positions.len() {
        if i + 1 >= n {
            out[j..positions.len()].fill((n - 1) as u32);
            return;
        }
        let falls = positions[j] * scale < cumulative[i];
        out[j] = i as u32;
        j += usize::from(falls);
        i += usize::from(!falls);
    }
}
