//! Resampling as indices: where the cumulative weights pass the positions of the draws.

use super::{BLOCK, LANES, Simd};
use crate::math::{Lanes, Real};
use fearless_simd::{Simd as Token, f64x8, prelude::*, u32x16, u64x8};

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
        let factor = Lanes::splat(simd, factor);
        let mut carry = Lanes::splat(simd, before);
        let whole = weights.len() / LANES * LANES;
        for (weights, out) in weights.chunks_exact(LANES).zip(out.chunks_exact_mut(LANES)) {
            let sums = prefix(simd, Lanes::load(simd, weights));
            sums.mul_add(factor, carry).store(out);
            carry = splat_last(simd, sums).mul_add(factor, carry);
        }
        if whole == weights.len() {
            return carry.0[0];
        }
        let rest = &mut out[whole..weights.len()];
        let mut all = [0.0; LANES];
        prefix(simd, load_zeros(simd, &weights[whole..])).mul_add(factor, carry).store(&mut all);
        rest.copy_from_slice(&all[..rest.len()]);
        rest[rest.len() - 1]
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
        // The portable slide becomes an expansion, which some processors run in microcode; a permutation is fast on
        // all.
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
    let mut drawn = write_runs(level, ends, first, ancestors);
    // The block's sum and its cumulative sums round differently: a position at the very end may be left to nobody. It
    // belongs to the last weight that is not zero.
    let nobody = first + weights.len() as u32;
    if ancestors.last() == Some(&nobody) {
        let start = ancestors.partition_point(|&a| a < nobody);
        let heir = first + weights.iter().rposition(|&w| w > 0.0).unwrap_or(0) as u32;
        drawn -= usize::from(start > 0 && ancestors[start - 1] == heir);
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
    let (eights, mut ends) = (weights.chunks_exact(LANES), ends.chunks_mut(LANES));
    let rest = eights.remainder();
    for (eight, ends) in eights.zip(&mut ends) {
        let sums = prefix(simd, Lanes::load(simd, eight));
        let below = positions.below(simd, sums.mul_add(factor, carry)).max(from).min(to) - from;
        to_integers(below).store_slice(ends);
        // The last of these sums, but from where the next eight need not wait for them.
        carry = splat_last(simd, sums).mul_add(factor, carry);
    }
    if let Some(ends) = ends.next() {
        let sums = prefix(simd, load_zeros(simd, rest)).mul_add(factor, carry);
        let below: [u64; LANES] = to_integers(positions.below(simd, sums).max(from).min(to) - from).into();
        ends.copy_from_slice(&below[..ends.len()]);
    }
}

/// Writes `first` to the places before `ends[0]`, `first + 1` from there to `ends[1]`, and so on; behind the last end
/// `first + ends.len()`. Returns how many different indices were written.
///
/// Each end leaves a mark, the index that begins there plus one; a running maximum then fills the gaps. No branch
/// depends on the data. Of ends that rounding has out of order the later one counts.
fn write_runs(level: Simd, ends: &[u64], first: u32, out: &mut [u32]) -> usize {
    #[inline(always)]
    fn run<S: Token>(simd: S, out: &mut [u32]) -> usize {
        let (zero, one) = (u32x16::splat(simd, 0), u32x16::splat(simd, 1));
        let (mut begun, mut carry) = (zero, zero);
        let mut sixteens = out.chunks_exact_mut(16);
        for out in &mut sixteens {
            let marks = u32x16::from_slice(simd, out);
            let x = simd.max_u32x16(marks, up::<S, 1, 15>(simd, marks));
            let x = simd.max_u32x16(x, up::<S, 2, 14>(simd, x));
            let x = simd.max_u32x16(x, up::<S, 4, 12>(simd, x));
            let x = simd.max_u32x16(x, up::<S, 8, 8>(simd, x));
            let x = simd.max_u32x16(x, carry);
            begun += simd.simd_eq_u32x16(marks, x).select(one, zero);
            carry = u32x16::splat(simd, x[15]);
            (x - one).store_slice(out);
        }
        let begun: [u32; 16] = begun.into();
        begun.iter().sum::<u32>() as usize + naive(sixteens.into_remainder(), carry[0])
    }
    /// Continues from the largest mark before; returns how many places began an index.
    #[inline(always)]
    fn naive(out: &mut [u32], mut largest: u32) -> usize {
        let mut begun = 0;
        for out in out {
            largest = largest.max(*out);
            begun += usize::from(*out == largest);
            *out = largest - 1;
        }
        begun
    }
    out.fill(0);
    for (mark, &end) in (first + 2..).zip(ends) {
        if let Some(out) = out.get_mut(end as usize) {
            *out = mark;
        }
    }
    if let Some(out) = out.first_mut() {
        *out = (*out).max(first + 1);
    }
    dispatch!(level, simd => run(simd, out), naive => naive(out, 0))
}

/// Every lane moved up by `BY` places; zeros move in. `REST` is 16 - `BY`.
#[inline(always)]
fn up<S: Token, const BY: i32, const REST: usize>(simd: S, x: u32x16<S>) -> u32x16<S> {
    #[cfg(target_arch = "x86_64")]
    if let fearless_simd::Level::Avx512(token) = simd.level() {
        use std::arch::x86_64::{
            __m512i, _mm512_add_epi32, _mm512_maskz_permutexvar_epi32, _mm512_set_epi32, _mm512_set1_epi32,
        };
        fearless_simd::kernel!(
            #[inline(always)]
            fn permute(avx512: Avx512, x: __m512i, by: i32) -> __m512i {
                let lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
                let from = _mm512_add_epi32(lane, _mm512_set1_epi32(-by));
                _mm512_maskz_permutexvar_epi32(0xffffu16 << by, from, x)
            }
        );
        let lanes: [u32; 16] = x.into();
        let lanes: u32x16<_> = lanes.simd_into(token);
        let moved: u32x16<_> = permute(token, lanes.into(), BY).simd_into(token);
        let moved: [u32; 16] = moved.into();
        return moved.simd_into(simd);
    }
    simd.slide_u32x16::<REST>(u32x16::splat(simd, 0), x)
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

/// Writes each index as often as `counts` says; returns how many were written, and how many indices had any.
pub(crate) fn expand_copies(level: Simd, counts: &[u32], first: u32, out: &mut [u32]) -> (usize, usize) {
    let mut ends = [0; BLOCK];
    let ends = &mut ends[..counts.len()];
    let mut used = 0;
    for (end, &count) in ends.iter_mut().zip(counts) {
        used += u64::from(count);
        *end = used;
    }
    let used = used as usize;
    (used, write_runs(level, ends, first, &mut out[..used]))
}

/// For each of the sorted `positions` (times `scale`) the first `i` such that it lies below `cumulative[i]`; beyond the
/// last sum, where rounding may put it, the first `i` that reaches that sum. Neither slice is empty. Returns how many
/// different ones there are.
///
/// A merge by eights: all of eight sums are compared with all of eight positions, and whichever eight ends first gives
/// way to the next. That is more comparisons than a merge one by one, but hardly a branch, and none waits for another.
pub(crate) fn merge_sorted(
    level: Simd,
    cumulative: &[f64],
    positions: &[f64],
    scale: f64,
    out: &mut [u32],
) -> usize {
    #[inline(always)]
    fn run<S: Token>(simd: S, cumulative: &[f64], positions: &[f64], scale: f64, out: &mut [u32]) -> usize {
        let (eights, rest) = cumulative.as_chunks::<LANES>();
        let mut tail = [f64::INFINITY; LANES];
        tail[..rest.len()].copy_from_slice(rest);
        let one = u64x8::splat(simd, 1);
        let mut passed = 0;
        let mut sums = eights.first().unwrap_or(&tail);
        for (positions, out) in positions.chunks(LANES).zip(out.chunks_mut(LANES)) {
            let last = positions[positions.len() - 1] * scale;
            let targets = match <&[f64; LANES]>::try_from(positions) {
                Ok(eight) => Lanes::load(simd, eight),
                Err(_) => load_zeros(simd, positions),
            } * scale;
            let mut ranks = u64x8::splat(simd, (passed * LANES) as u64);
            loop {
                for &sum in sums {
                    let reached = simd.simd_le_f64x8(f64x8::splat(simd, sum), targets.0);
                    ranks = reached.select(ranks + one, ranks);
                }
                // The last eight end with an infinity.
                if sums[LANES - 1] > last || passed == eights.len() {
                    break;
                }
                passed += 1;
                sums = eights.get(passed).unwrap_or(&tail);
            }
            let ranks: [u64; LANES] = ranks.into();
            for (out, rank) in out.iter_mut().zip(ranks) {
                *out = rank as u32;
            }
        }
        distinct(out)
    }
    #[inline(always)]
    fn distinct(ascending: &[u32]) -> usize {
        1 + ascending.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }
    fn naive(cumulative: &[f64], positions: &[f64], scale: f64, out: &mut [u32]) -> usize {
        let mut i = 0;
        for (position, out) in positions.iter().zip(&mut *out) {
            while cumulative.get(i).is_some_and(|&sum| sum <= position * scale) {
                i += 1;
            }
            *out = i as u32;
        }
        distinct(out)
    }
    let mut drawn = dispatch!(
        level,
        simd => run(simd, cumulative, positions, scale, out),
        naive => naive(cumulative, positions, scale, out)
    );
    let nobody = cumulative.len() as u32;
    if out.last() == Some(&nobody) {
        let start = out.partition_point(|&a| a < nobody);
        let heir = cumulative.partition_point(|&sum| sum < cumulative[cumulative.len() - 1]) as u32;
        drawn -= usize::from(start > 0 && out[start - 1] == heir);
        out[start..].fill(heir);
    }
    drawn
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Draws, Purpose, Stream};

    fn draws(index: u32) -> Draws {
        Stream::new(11).draws(Purpose::Other, 0, index)
    }

    /// One place after the other, as the words of [`write_runs`] say.
    fn runs_by_hand(ends: &[u64], first: u32, len: usize) -> (Vec<u32>, usize) {
        let out: Vec<u32> = (0..len as u64)
            .map(|place| first + ends.iter().rposition(|&end| end <= place).map_or(0, |i| i as u32 + 1))
            .collect();
        let mut distinct = out.clone();
        distinct.dedup();
        (out, distinct.len())
    }

    #[test]
    fn runs_are_those_written_by_hand() {
        for case in 0..200 {
            let mut draws = draws(case);
            let sources = 1 + (draws.next_u32() % 40) as usize;
            let longest = [1, 3, 60][case as usize % 3];
            let mut ends = Vec::new();
            let mut end = 0;
            for _ in 0..sources {
                end += u64::from(draws.next_u32() % (longest + 1));
                // Now and then one step back, as rounding of sums may have it.
                ends.push(if draws.next_u32().is_multiple_of(16) { end.saturating_sub(1) } else { end });
            }
            // Shorter than the ends, as long, and with places that nobody fills.
            for len in [(end / 2) as usize, end as usize, end as usize + 5] {
                for first in [0, 1, 512] {
                    let by_hand = runs_by_hand(&ends, first, len);
                    for level in Simd::available() {
                        let mut out = vec![7; len];
                        let distinct = write_runs(level, &ends, first, &mut out);
                        assert_eq!((out, distinct), by_hand, "case {case} {level:?} first {first}");
                    }
                }
            }
        }
    }

    #[test]
    fn merging_is_searching_for_each_position() {
        for case in 0..200 {
            let mut draws = draws(1000 + case);
            let mut rising = |n: usize, zeros: bool| {
                let mut sum = 0.0;
                let mut sums: Vec<f64> = Vec::new();
                for _ in 0..n {
                    // Now and then sums that leap over many positions.
                    let leap = if draws.next_u32().is_multiple_of(16) { 20.0 } else { 1.0 };
                    let stays = zeros && draws.next_u32().is_multiple_of(3);
                    sum += if stays { 0.0 } else { leap * draws.uniform() };
                    sums.push(sum);
                }
                (sums, sum)
            };
            let (mut cumulative, total) = rising(1 + case as usize * 7 % 50, true);
            // A weight of nothing at the end, which not even rounding may draw.
            cumulative.push(total);
            let (positions, last) = rising(1 + case as usize * 11 % 70, false);
            // In half of the cases the last positions lie beyond all weights.
            let scale = if case % 2 == 0 { 0.999 } else { 1.05 } * total / last;
            let heir = cumulative.partition_point(|&c| c < total);
            let by_search: Vec<u32> = positions
                .iter()
                .map(|p| cumulative.partition_point(|&c| c <= p * scale).min(heir) as u32)
                .collect();
            for level in Simd::available() {
                let mut merged = vec![0; by_search.len()];
                let drawn = merge_sorted(level, &cumulative, &positions, scale, &mut merged);
                assert_eq!(merged, by_search, "case {case} {level:?}");
                merged.dedup();
                assert_eq!(drawn, merged.len(), "case {case} {level:?}");
            }
        }
    }

    #[test]
    fn sums_and_copies_are_those_of_one_weight_after_the_other() {
        let mut draws = draws(5000);
        for n in [1, 7, 8, 9, 16, 255, 512] {
            let weights: Vec<f64> = (0..n).map(|_| draws.uniform()).collect();
            let sum: f64 = weights.iter().sum();
            for level in Simd::available() {
                let (checked, good) = checked_sum(level, &weights);
                // Two orders of n additions of positive numbers.
                assert!(good && (checked - sum).abs() <= 2.0 * n as f64 * f64::EPSILON * sum);
                for bad in [-1e-300, f64::NAN] {
                    let mut spoilt = weights.clone();
                    spoilt[n / 2] = bad;
                    assert!(!checked_sum(level, &spoilt).1, "{level:?} {n} {bad}");
                }
                let (mut whole, mut fraction) = (vec![0; n], vec![0.0; n]);
                let sure = split_copies(level, &weights, (1.0, 100.0), &mut whole, &mut fraction);
                assert_eq!(sure, whole.iter().map(|&w| u64::from(w)).sum::<u64>());
                for ((w, whole), fraction) in weights.iter().zip(&whole).zip(&fraction) {
                    let expected = w * 100.0;
                    // A whole number that rounding missed is lifted by at most 1e-12 of itself.
                    assert!(
                        (expected - f64::from(*whole) - fraction).abs() <= 1e-12 * expected + f64::EPSILON
                    );
                    assert!((0.0..1.0).contains(fraction));
                }
                let (written, distinct) = expand_copies(level, &whole, 3, &mut vec![0; sure as usize + 4]);
                assert_eq!(written as u64, sure);
                assert_eq!(distinct, whole.iter().filter(|&&w| w > 0).count());
            }
        }
    }

    #[test]
    fn prefix_sums_are_the_same_on_every_level() {
        let mut draws = draws(6000);
        for n in [1, 8, 13, 64, 100] {
            let weights: Vec<f64> = (0..n).map(|_| draws.uniform()).collect();
            let mut exact = 0.25;
            let mut first = Vec::new();
            for level in Simd::available() {
                let mut out = vec![0.0; n];
                let last = prefix_sums(level, &weights, 0.5, 0.25, &mut out);
                assert_eq!(last, out[n - 1]);
                if first.is_empty() {
                    for (sum, w) in out.iter().zip(&weights) {
                        exact += 0.5 * w;
                        assert!((sum - exact).abs() <= 2.0 * n as f64 * f64::EPSILON * exact);
                    }
                    first = out;
                } else {
                    assert_eq!(out, first, "{level:?}");
                }
            }
        }
    }
}
