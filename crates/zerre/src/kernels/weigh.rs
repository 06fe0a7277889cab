//! From log-weights to weights, sums and the mean in one visit per block, relative to the block's own maximum; the
//! blocks meet afterwards with the factors exp(max_b - max).

use super::{LANES, Simd};
use crate::math::{Lanes, Real};
use fearless_simd::Simd as Token;

/// What a block adds to the whole, relative to its largest log-weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockSums<const N: usize> {
    /// Largest log-weight; -inf if all weights are zero.
    pub(crate) max: f64,
    /// Sum of w = exp(log-weight - max).
    pub(crate) sum: f64,
    /// Sum of w^2.
    pub(crate) sum_squares: f64,
    /// Sums of w x.
    pub(crate) sum_states: [f64; N],
}

impl<const N: usize> Default for BlockSums<N> {
    fn default() -> Self {
        BlockSums { max: f64::NEG_INFINITY, sum: 0.0, sum_squares: 0.0, sum_states: [0.0; N] }
    }
}

/// Sums over all blocks, relative to the largest log-weight of all.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Total<const N: usize> {
    pub(crate) max: f64,
    pub(crate) sum: f64,
    pub(crate) sum_squares: f64,
    pub(crate) sum_states: [f64; N],
}

impl<const N: usize> Total<N> {
    /// Merges blocks in their order.
    pub(crate) fn of(blocks: &[BlockSums<N>]) -> Self {
        let max = blocks.iter().map(|b| b.max).fold(f64::NEG_INFINITY, f64::max);
        let mut total = Total { max, sum: 0.0, sum_squares: 0.0, sum_states: [0.0; N] };
        for b in blocks {
            let f = b.factor(max);
            total.sum += f * b.sum;
            total.sum_squares += f * f * b.sum_squares;
            for k in 0..N {
                total.sum_states[k] += f * b.sum_states[k];
            }
        }
        total
    }

    /// 1 / sum w^2 of normalised weights; 0 if there is no weight at all.
    pub(crate) fn ess(&self) -> f64 {
        if self.sum > 0.0 { self.sum * self.sum / self.sum_squares } else { 0.0 }
    }

    /// ln of the sum of all weights.
    pub(crate) fn log_sum(&self) -> f64 {
        self.max + Real::ln(self.sum)
    }
}

impl<const N: usize> BlockSums<N> {
    /// What turns the block's weights into weights relative to `max`.
    pub(crate) fn factor(&self, max: f64) -> f64 {
        /// Compiled for the processor at hand: scalar code for all processors has no fused multiplication.
        #[inline(always)]
        fn exp<T>(x: f64, _: T) -> f64 {
            Real::exp(x)
        }
        if self.max == f64::NEG_INFINITY {
            return 0.0;
        }
        let x = self.max - max;
        dispatch!(Simd::best(), simd => exp(x, simd), naive => exp(x, ()))
    }
}

/// Adds `log_weights` (where given) to `scores`, writes exp(score - max) to `weights`, and sums up.
pub(crate) fn weigh<const N: usize>(
    level: Simd,
    log_weights: Option<&[f64]>,
    scores: &mut [f64],
    states: &[&[f64]; N],
    weights: &mut [f64],
) -> BlockSums<N> {
    dispatch!(
        level,
        simd => run(simd, log_weights, scores, states, weights),
        naive => naive(log_weights, scores, states, weights)
    )
}

fn naive<const N: usize>(
    log_weights: Option<&[f64]>,
    scores: &mut [f64],
    states: &[&[f64]; N],
    weights: &mut [f64],
) -> BlockSums<N> {
    if let Some(old) = log_weights {
        scores.iter_mut().zip(old).for_each(|(score, old)| *score += old);
    }
    let max = scores.iter().copied().fold(f64::NEG_INFINITY, |max, s| if max < s { s } else { max });
    if max == f64::NEG_INFINITY {
        weights.fill(0.0);
        return worthless(scores, states);
    }
    let mut lanes = [(0.0, 0.0, [0.0; N]); LANES];
    for i in 0..scores.len() {
        let w = Real::exp(scores[i] - max);
        weights[i] = w;
        let (sum, sum_squares, sum_states) = &mut lanes[i % LANES];
        *sum += w;
        *sum_squares = w.mul_add(w, *sum_squares);
        for k in 0..N {
            sum_states[k] = w.mul_add(states[k][i], sum_states[k]);
        }
    }
    let fold = |numbers: [f64; LANES]| fold_array(numbers, |a, b| a + b);
    BlockSums {
        max,
        sum: fold(lanes.map(|l| l.0)),
        sum_squares: fold(lanes.map(|l| l.1)),
        sum_states: std::array::from_fn(|k| fold(lanes.map(|l| l.2[k]))),
    }
}

/// Sums of a block without any weight. A NaN among its scores or a lost state has left no trace in the maximum; the
/// sum shows it, as it does in other blocks.
#[cold]
fn worthless<const N: usize>(scores: &[f64], states: &[&[f64]; N]) -> BlockSums<N> {
    let lost = states.iter().any(|column| column.iter().any(|x| !x.is_finite()));
    let sum = if lost || scores.iter().any(|s| s.is_nan()) { f64::NAN } else { 0.0 };
    BlockSums { sum, ..BlockSums::default() }
}

#[inline(always)]
fn run<const N: usize, S: Token>(
    simd: S,
    log_weights: Option<&[f64]>,
    scores: &mut [f64],
    states: &[&[f64]; N],
    weights: &mut [f64],
) -> BlockSums<N> {
    let count = scores.len();
    let whole = count / LANES * LANES;
    // A local copy of the column slices: the stores below could otherwise alias them.
    let states = *states;
    assert!(weights.len() == count && states.iter().all(|c| c.len() == count));
    let mut max = Lanes::splat(simd, f64::NEG_INFINITY);
    match log_weights {
        Some(old) => {
            let old = &old[..count];
            for i in (0..whole).step_by(LANES) {
                let l = Lanes::load(simd, &scores[i..i + LANES]) + Lanes::load(simd, &old[i..i + LANES]);
                l.store(&mut scores[i..i + LANES]);
                max = max.max(l);
            }
        }
        None => {
            for i in (0..whole).step_by(LANES) {
                max = max.max(Lanes::load(simd, &scores[i..i + LANES]));
            }
        }
    }
    let mut tail = [f64::NEG_INFINITY; LANES];
    if whole < count {
        if let Some(old) = log_weights {
            for i in whole..count {
                scores[i] += old[i];
            }
        }
        tail[..count - whole].copy_from_slice(&scores[whole..]);
    }
    let tail = Lanes::load(simd, &tail);
    let max = fold(max.max(tail), f64::max);
    if max == f64::NEG_INFINITY {
        weights.fill(0.0);
        return worthless(scores, &states);
    }

    let zero = Lanes::splat(simd, 0.0);
    let (mut sum, mut sum_squares, mut sum_states) = (zero, zero, [zero; N]);
    for i in (0..whole).step_by(LANES) {
        let w = (Lanes::load(simd, &scores[i..i + LANES]) - max).exp();
        w.store(&mut weights[i..i + LANES]);
        sum = sum + w;
        sum_squares = w.mul_add(w, sum_squares);
        for k in 0..N {
            sum_states[k] = w.mul_add(Lanes::load(simd, &states[k][i..i + LANES]), sum_states[k]);
        }
    }
    if whole < count {
        let w = (tail - max).exp();
        super::propagate::store_part(w, &mut weights[whole..]);
        sum = sum + w;
        sum_squares = w.mul_add(w, sum_squares);
        for k in 0..N {
            sum_states[k] = w.mul_add(super::propagate::load_part(simd, &states[k][whole..]), sum_states[k]);
        }
    }
    let add = |a, b| a + b;
    BlockSums {
        max,
        sum: fold(sum, add),
        sum_squares: fold(sum_squares, add),
        sum_states: sum_states.map(|s| fold(s, add)),
    }
}

/// Combines eight lanes in the order ((0 4) (2 6)) ((1 5) (3 7)).
#[inline(always)]
fn fold<S: Token>(lanes: Lanes<S>, op: impl Fn(f64, f64) -> f64) -> f64 {
    let mut a = [0.0; LANES];
    lanes.store(&mut a);
    fold_array(a, op)
}

#[inline(always)]
pub(super) fn fold_array(a: [f64; LANES], op: impl Fn(f64, f64) -> f64) -> f64 {
    op(op(op(a[0], a[4]), op(a[2], a[6])), op(op(a[1], a[5]), op(a[3], a[7])))
}
