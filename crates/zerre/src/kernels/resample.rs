//! Resampling as indices: where the cumulative weights pass the positions of the draws.

use super::{BLOCK, LANES, Simd};
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
    let x = x + shift::<S, 1, 7>(simd, x);
    let x = x + shift::<S, 2, 6>(simd, x);
    x + shift::<S, 4, 4>(simd, x)
}

/// Every lane moved up by `BY` places; zeros move in. `REST` is 8 - `BY`.
#[inline(always)]
fn shift<S: Token, const BY: i64, const REST: usize>(simd: S, x: Lanes<S>) -> Lanes<S> {
    #[cfg(target_arch = "x86_64")]
    if let fearless_simd::Level::Avx512(token) = simd.level() {
        use std::arch::x86_64::{__m512d, _mm512_maskz_permutexvar_pd, _mm512_set_epi64};
        // The portable slide becomes an expansion, which some processors run in microcode; a permutation is fast on all.
        fearless_simd::kernel!(
            #[inline(always)]
            fn permute(avx512: Avx512, x: __m512d, by: i64) -> __m512d {
                let from = _mm512_set_epi64(7 - by, 6 - by, 5 - by, 4 - by, 3 - by, 2 - by, 1 - by, -by);
                _mm512_maskz_permutexvar_pd(0xffu8 << by, from, x)
            }
        );
        let lanes: [f64; LANES] = x.0.into();
        let lanes: f64x8<_> = lanes.simd_into(token);
        let moved: f64x8<_> = permute(token, lanes.into(), BY).simd_into(token);
        let moved: [f64; LANES] = moved.into();
        return Lanes(moved.simd_into(simd));
    }
    Lanes(simd.slide_f64x8::<REST>(f64x8::splat(simd, 0.0), x.0))
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
    pub(crate) fn below(self, c: f64, per_weight: f64) -> f64 {
        match self {
            Positions::Systematic { offset } => Real::mul_add(c, per_weight, -offset).ceil(),
            Positions::Stratified { offsets } => {
                let t = c * per_weight;
                let cell = t.floor();
                let u = offsets[(cell as usize).min(offsets.len() - 1)];
                if u < t - cell { cell + 1.0 } else { cell }
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
        ends: &mut [u64],
    ) {
        match positions {
            Positions::Systematic { offset } => {
                count_below(simd, weights, at, ends, &Systematic { per_weight, offset });
            }
            Positions::Stratified { offsets } => {
                count_below(simd, weights, at, ends, &Stratified { per_weight, offsets });
            }
        }
    }
    fn naive(weights: &[f64], at: Cumulative, positions: Positions<'_>, per_weight: f64, ends: &mut [u64]) {
        let (from, to) = (f64::from(at.draws.0), f64::from(at.draws.1));
        let mut carry = at.before;
        for (eight, ends) in weights.chunks(LANES).zip(ends.chunks_mut(LANES)) {
            let sums = prefix_naive(eight).map(|sum| Real::mul_add(sum, at.factor, carry));
            carry = sums[LANES - 1];
            for (end, c) in ends.iter_mut().zip(sums) {
                *end = (positions.below(c, per_weight).max(from).min(to) - from) as u64;
            }
        }
    }

    let mut ends = [0; BLOCK];
    let ends = &mut ends[..weights.len()];
    dispatch!(
        level,
        simd => run(simd, weights, at, positions, per_weight, ends),
        naive => naive(weights, at, positions, per_weight, ends)
    );
    let (start, mut drawn) = dispatch!(
        level,
        simd => write_ends(ends, first, ancestors, simd),
        naive => write_ends(ends, first, ancestors, ())
    );
    // The block's sum and its cumulative sums round differently: a position at the very end may be left to nobody. It
    // belongs to the last weight that is not zero.
    if start < ancestors.len() {
        let heir = first + weights.iter().rposition(|&w| w > 0.0).unwrap_or(0) as u32;
        drawn += usize::from(start == 0 || ancestors[start - 1] != heir);
        ancestors[start..].fill(heir);
    }
    drawn
}

/// [`Positions::below`] of eight cumulative weights. A trait instead of a closure, which may fail to be inlined.
trait Below {
    fn below<S: Token>(&self, simd: S, c: Lanes<S>) -> Lanes<S>;
}

struct Systematic {
    per_weight: f64,
    offset: f64,
}

impl Below for Systematic {
    #[inline(always)]
    fn below<S: Token>(&self, simd: S, c: Lanes<S>) -> Lanes<S> {
        let t = c.mul_add(Lanes::splat(simd, self.per_weight), Lanes::splat(simd, -self.offset));
        Lanes(simd.ceil_f64x8(t.0))
    }
}

struct Stratified<'a> {
    per_weight: f64,
    offsets: &'a [f64],
}

impl Below for Stratified<'_> {
    #[inline(always)]
    fn below<S: Token>(&self, simd: S, c: Lanes<S>) -> Lanes<S> {
        let t = c * self.per_weight;
        let cell = Lanes(simd.floor_f64x8(t.0));
        let last = self.offsets.len() - 1;
        let mut cells = [0; LANES];
        to_integers(cell.min(Lanes::splat(simd, last as f64))).store_slice(&mut cells);
        let mut u = [0.0; LANES];
        for j in 0..LANES {
            // The minimum above keeps the index inside; the compiler cannot see it.
            u[j] = self.offsets[(cells[j] as usize).min(last)];
        }
        Lanes::load(simd, &u).if_lt(t - cell, cell + 1.0, cell)
    }
}

/// For each weight the number of positions below its cumulative weight, counted from the block's first draw.
#[inline(always)]
fn count_below<S: Token>(simd: S, weights: &[f64], at: Cumulative, ends: &mut [u64], positions: &impl Below) {
    let (from, to) = (Lanes::splat(simd, f64::from(at.draws.0)), Lanes::splat(simd, f64::from(at.draws.1)));
    let factor = Lanes::splat(simd, at.factor);
    let mut carry = Lanes::splat(simd, at.before);
    let whole = weights.len() / LANES * LANES;
    for i in (0..whole).step_by(LANES) {
        let sums = prefix(simd, Lanes::load(simd, &weights[i..i + LANES])).mul_add(factor, carry);
        carry = splat_last(simd, sums);
        to_integers(positions.below(simd, sums).max(from).min(to) - from)
            .store_slice(&mut ends[i..i + LANES]);
    }
    if whole < weights.len() {
        let sums = prefix(simd, load_zeros(simd, &weights[whole..])).mul_add(factor, carry);
        let all: [u64; LANES] = to_integers(positions.below(simd, sums).max(from).min(to) - from).into();
        let rest = &mut ends[whole..];
        rest.copy_from_slice(&all[..rest.len()]);
    }
}

/// Writes `first + i` from the end before it to `ends[i]`, for all `i`; returns the last end, and how many `i` wrote
/// anything. The token only tells the compiler which instructions it may use.
#[inline(always)]
fn write_ends<T>(ends: &[u64], first: u32, out: &mut [u32], _: T) -> (usize, usize) {
    let (mut start, mut drawn, mut i) = (0, 0, 0);
    // Eight indices at once; what stands behind an end is overwritten by those that follow.
    while i < ends.len() && start + LANES <= out.len() {
        // Rounding may make a cumulative sum a little smaller than the one before.
        let end = (ends[i] as usize).max(start);
        let value = first + i as u32;
        out[start..start + LANES].fill(value);
        if end > start + LANES {
            out[start + LANES..end].fill(value);
        }
        drawn += usize::from(end != start);
        start = end;
        i += 1;
    }
    for (i, &end) in ends.iter().enumerate().skip(i) {
        let end = end as usize;
        if end > start {
            out[start..end].fill(first + i as u32);
            drawn += 1;
            start = end;
        }
    }
    (start, drawn)
}

/// Non-negative integer-valued lanes below 2^51 as integers: under the exponent of 2^52 the mantissa is the integer.
#[inline(always)]
fn to_integers<S: Token>(x: Lanes<S>) -> u64x8<S> {
    let bits: u64x8<S> = (x + 4_503_599_627_370_496.0).0.bitcast();
    bits & u64x8::splat(bits.simd, 0x000f_ffff_ffff_ffff)
}

/// The last lane in all lanes.
#[inline(always)]
fn splat_last<S: Token>(simd: S, x: Lanes<S>) -> Lanes<S> {
    Lanes::splat(simd, x.0[LANES - 1])
}

/// Splits `weights * factor * per_weight` into whole copies and fractions, and returns the number of copies. The two
/// factors stay apart: their product may overflow for the smallest weights.
pub(crate) fn split_copies(
    level: Simd,
    weights: &[f64],
    (factor, per_weight): (f64, f64),
    whole: &mut [u32],
    fraction: &mut [f64],
) -> u64 {
    #[inline(always)]
    fn run<T>(
        weights: &[f64],
        (factor, per_weight): (f64, f64),
        whole: &mut [u32],
        fraction: &mut [f64],
        _: T,
    ) -> u64 {
        let mut sum = 0;
        for ((w, whole), fraction) in weights.iter().zip(whole).zip(fraction) {
            let expected = w * factor * per_weight;
            // Below 2^31 by the limit on the number of particles; the signed conversion is one instruction.
            // What a sum of rounded weights leaves below a whole number counts as whole: equal weights are a copy each.
            let copies = (expected * (1.0 + 1e-12)) as i32;
            *whole = copies as u32;
            *fraction = (expected - f64::from(copies)).max(0.0);
            sum += copies as u64;
        }
        sum
    }
    dispatch!(
        level,
        simd => run(weights, (factor, per_weight), whole, fraction, simd),
        naive => run(weights, (factor, per_weight), whole, fraction, ())
    )
}

/// Writes each index as often as it has copies; returns how many were written, and how many indices had any.
pub(crate) fn expand_copies(level: Simd, copies: &[u32], first: u32, out: &mut [u32]) -> (usize, usize) {
    let mut ends = [0; BLOCK];
    let ends = &mut ends[..copies.len()];
    let mut used = 0;
    for (end, &copies) in ends.iter_mut().zip(copies) {
        used += u64::from(copies);
        *end = used;
    }
    let used = used as usize;
    let (_, drawn) = dispatch!(
        level,
        simd => write_ends(ends, first, &mut out[..used], simd),
        naive => write_ends(ends, first, &mut out[..used], ())
    );
    (used, drawn)
}

/// For each of the sorted `positions` (times `scale`) the first `i` such that it lies below `cumulative[i]`, or the last
/// `i` if there is none. Both slices end with an infinity that is not part of the data.
///
/// Free of branches that depend on the data; several merges run side by side, because each waits for its own loads.
pub(crate) fn merge_sorted(cumulative: &[f64], positions: &[f64], scale: f64, out: &mut [u32]) {
    const WAYS: usize = 4;
    let (n, m) = (cumulative.len() - 1, positions.len() - 1);
    let border = |q: usize| q * n / WAYS;
    // Where the positions of each part begin; a part without weights has none.
    let mut begin = [0; WAYS + 1];
    begin[WAYS] = m;
    for (q, begin) in begin.iter_mut().enumerate().take(WAYS).skip(1) {
        let below = if border(q) == 0 { 0.0 } else { cumulative[border(q) - 1] };
        *begin = positions[..m].partition_point(|p| p * scale < below);
    }
    let mut at: [(usize, usize); WAYS] = std::array::from_fn(|q| (border(q), begin[q]));
    let steps: [usize; WAYS] =
        std::array::from_fn(|q| (border(q + 1) - border(q)) + (begin[q + 1] - begin[q]));
    let together = steps.iter().copied().min().unwrap_or(0);
    for _ in 0..together {
        for (i, j) in &mut at {
            merge_step(cumulative, positions, scale, out, i, j);
        }
    }
    for (q, (i, j)) in at.iter_mut().enumerate() {
        for _ in together..steps[q] {
            merge_step(cumulative, positions, scale, out, i, j);
        }
    }
    // A part that is done writes once more, to the first place of the next part.
    for q in 1..WAYS {
        if begin[q] < m {
            let target = positions[begin[q]] * scale;
            out[begin[q]] = cumulative[..n].partition_point(|&c| c <= target).min(n - 1) as u32;
        }
    }
    // Positions beyond the last sum, by rounding, belong to the last weight.
    for a in out.iter_mut().rev().take_while(|a| **a as usize >= n) {
        *a = (n - 1) as u32;
    }
}

#[inline(always)]
fn merge_step(
    cumulative: &[f64],
    positions: &[f64],
    scale: f64,
    out: &mut [u32],
    i: &mut usize,
    j: &mut usize,
) {
    let falls = positions[*j] * scale < cumulative[*i];
    if let Some(out) = out.get_mut(*j) {
        *out = *i as u32;
    }
    *j += usize::from(falls);
    *i += usize::from(!falls);
}

/// Sum of weights and whether all of them are at least zero (false for NaN).
pub(crate) fn checked_sum(level: Simd, weights: &[f64]) -> (f64, bool) {
    #[inline(always)]
    fn run<T>(weights: &[f64], _: T) -> (f64, bool) {
        let (mut sums, mut good) = ([0.0; LANES], true);
        let chunks = weights.chunks_exact(LANES);
        for (sum, &w) in sums.iter_mut().zip(chunks.remainder()) {
            *sum += w;
            good &= w >= 0.0;
        }
        for eight in chunks {
            for (sum, &w) in sums.iter_mut().zip(eight) {
                *sum += w;
                good &= w >= 0.0;
            }
        }
        (sums.iter().sum(), good)
    }
    dispatch!(level, simd => run(weights, simd), naive => run(weights, ()))
}
