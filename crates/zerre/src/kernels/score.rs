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
        let count = out.len();
        let mut i = 0;
        while i + LANES <= count {
            let x = std::array::from_fn(|k| Lanes::load(simd, &states[k][i..i + LANES]));
            H::log_likelihood(given, x).store(&mut out[i..i + LANES]);
            i += LANES;
        }
        if i < count {
            let x = std::array::from_fn(|k| load_part(simd, &states[k][i..]));
            store_part(H::log_likelihood(given, x), &mut out[i..]);
        }
    }
    fn naive<const N: usize, H: Measurement<N>>(given: &H::Given<'_>, states: &[&[f64]; N], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = H::log_likelihood(given, std::array::from_fn(|k| states[k][i]));
        }
    }
    dispatch!(level, simd => run::<N, H, _>(simd, given, states, out), naive => naive::<N, H>(given, states, out));
}
