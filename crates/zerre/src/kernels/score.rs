//! Log-likelihood of a block of particles.

use super::propagate::{load_part, store_part};
use super::{LANES, Simd};
use crate::math::Lanes;
use crate::model::Measurement;
use fearless_simd::Simd as Token;

/// `out[i] <- log p(z | states[..][i])`.
pub(crate) fn score<const N: usize, H: Measurement<N>>(
    level: Simd,
    given: &H::Given<'_>,
    states: &[&[f64]; N],
    out: &mut [f64],
) {
    #[inline(always)]
    fn run<const N: usize, H: Measurement<N>, S: Token>(
        simd: S,
        given: &H::Given<'_>,
        states: &[&[f64]; N],
        out: &mut [f64],
    ) {
        let whole = out.len() / LANES * LANES;
        // A local copy of the column slices: the stores below could otherwise alias them.
        let states = *states;
        assert!(states.iter().all(|c| c.len() == out.len()));
        let mut x = [Lanes::splat(simd, 0.0); N];
        for i in (0..whole).step_by(LANES) {
            for k in 0..N {
                x[k] = Lanes::load(simd, &states[k][i..i + LANES]);
            }
            H::log_likelihood(given, x).store(&mut out[i..i + LANES]);
        }
        if whole < out.len() {
            for k in 0..N {
                x[k] = load_part(simd, &states[k][whole..]);
            }
            store_part(H::log_likelihood(given, x), &mut out[whole..]);
        }
    }
    fn naive<const N: usize, H: Measurement<N>>(given: &H::Given<'_>, states: &[&[f64]; N], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = H::log_likelihood(given, std::array::from_fn(|k| states[k][i]));
        }
    }
    dispatch!(level, simd => run::<N, H, _>(simd, given, states, out), naive => naive::<N, H>(given, states, out));
}
