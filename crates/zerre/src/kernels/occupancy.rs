//! How many boxes independent draws are expected to fall into.

use super::propagate::{load_part, store_part};
use super::weigh::fold_array;
use super::{LANES, Simd};
use crate::math::{Lanes, Real};
use fearless_simd::Simd as Token;

/// ln of the probability 1 - p that a draw misses a box of mass p, in place; of a box that holds everything
/// the least logarithm there is.
pub(crate) fn log_absent(level: Simd, masses: &mut [f64]) {
    #[inline(always)]
    fn one<R: Real>(p: R) -> R {
        (-p + 1.0).max(p.constant(f64::MIN_POSITIVE)).ln()
    }
    #[inline(always)]
    fn run<S: Token>(simd: S, masses: &mut [f64]) {
        for part in masses.chunks_mut(LANES) {
            store_part(one(load_part(simd, part)), part);
        }
    }
    dispatch!(
        level,
        simd => run(simd, masses),
        naive => masses.iter_mut().for_each(|p| *p = one(*p))
    );
}

/// Sum over boxes of 1 - (1 - p)^n, from the logarithms of 1 - p.
pub(crate) fn expected_occupied(level: Simd, absent: &[f64], n: f64) -> f64 {
    #[inline(always)]
    fn run<S: Token>(simd: S, absent: &[f64], n: f64) -> f64 {
        let mut sums = Lanes::splat(simd, 0.0);
        let whole = absent.len() / LANES * LANES;
        for eight in absent[..whole].chunks(LANES) {
            sums = sums + (Lanes::load(simd, eight) * n).exp();
        }
        let mut lanes = [0.0; LANES];
        sums.store(&mut lanes);
        if whole < absent.len() {
            let rest = &absent[whole..];
            let mut missed = [0.0; LANES];
            store_part((load_part(simd, rest) * n).exp(), &mut missed[..rest.len()]);
            lanes.iter_mut().zip(missed).for_each(|(sum, missed)| *sum += missed);
        }
        fold_array(lanes, |a, b| a + b)
    }
    fn naive(absent: &[f64], n: f64) -> f64 {
        let mut lanes = [0.0; LANES];
        for (i, log) in absent.iter().enumerate() {
            lanes[i % LANES] += Real::exp(log * n);
        }
        fold_array(lanes, |a, b| a + b)
    }
    let missed = dispatch!(level, simd => run(simd, absent, n), naive => naive(absent, n));
    absent.len() as f64 - missed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_is_the_naive_twin_and_the_closed_form() {
        let masses: Vec<f64> = (1..=29).map(|i| f64::from(i) / 435.0).collect();
        let run = |level, masses: &[f64], n| {
            let mut logs = masses.to_vec();
            log_absent(level, &mut logs);
            expected_occupied(level, &logs, n)
        };
        for n in [1.0, 2.0, 100.0, 1e6] {
            for len in [1, 7, 8, 9, 16, 29] {
                let found = run(Simd::scalar(), &masses[..len], n);
                let exact: f64 = masses[..len].iter().map(|p| 1.0 - (1.0 - p).powf(n)).sum();
                assert!((found - exact).abs() < 1e-11, "{n} {len}");
                for level in Simd::available() {
                    assert_eq!(run(level, &masses[..len], n).to_bits(), found.to_bits());
                }
            }
        }
        // Everything in one box, and a box without anything.
        assert_eq!(run(Simd::best(), &[1.0, 0.0], 5.0), 1.0);
    }
}
