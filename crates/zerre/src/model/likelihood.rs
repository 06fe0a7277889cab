//! The batch level below [`Measurement`]: a whole block of particles scored at once.

use super::Measurement;
use crate::error::Result;
use crate::kernels::{self, Simd};
use crate::time::Time;

/// What particle filters ask of a sensor. Every [`Measurement`] is one; sensors that choose among models at run time,
/// image likelihoods and bindings implement it directly.
pub trait Likelihood<const N: usize>: Send + Sync {
    /// What the sensor reports.
    type Value: ?Sized;
    /// A measurement digested once, to score any number of states.
    type Digest<'z>: Sync
    where
        Self: 'z;

    /// Digests `z`, measured at `at`.
    ///
    /// # Errors
    /// Numbers that are not finite, a parameter out of range.
    fn digest<'z>(&'z self, z: &'z Self::Value, at: Time) -> Result<Self::Digest<'z>>;

    /// Writes log p(z | x_i), constants included, for the states in columns: `states[k][i]` is component `k` of
    /// particle `i`, and `out` is as long as the columns. -inf is a likelihood of zero.
    fn score(digest: &Self::Digest<'_>, simd: Simd, states: &[&[f64]; N], out: &mut [f64]);
}

impl<const N: usize, H: Measurement<N>> Likelihood<N> for H {
    type Value = H::Value;
    type Digest<'z>
        = H::Given<'z>
    where
        H: 'z;

    fn digest<'z>(&'z self, z: &'z H::Value, at: Time) -> Result<H::Given<'z>> {
        self.given(z, at)
    }

    fn score(digest: &H::Given<'_>, simd: Simd, states: &[&[f64]; N], out: &mut [f64]) {
        kernels::score::<N, H>(simd, digest, states, out);
    }
}
