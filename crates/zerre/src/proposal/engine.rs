//! What the particle filter asks of a proposal.

use super::Bootstrap;
use crate::error::Result;
use crate::kernels::{NoiseBlock, Simd};
use crate::model::{Likelihood, Motion};
use crate::time::Time;
use std::convert::Infallible;

/// The models of a filter in one step.
pub struct Models<'a, S, A, H> {
    pub(crate) motion: &'a A,
    pub(crate) step: &'a S,
    pub(crate) sensor: &'a H,
    /// When the measurement was made.
    pub(crate) at: Time,
}

/// A proposal, block by block.
pub trait Engine<const N: usize, const W: usize, A: Motion<N, W>, H: Likelihood<N>>: Send + Sync {
    /// A measurement digested once, to propose any number of particles.
    type Given<'a>: Sync
    where
        A: 'a,
        H: 'a;

    /// Whether the measurement guides it; else none of what follows is called.
    const GUIDED: bool;

    /// Refuses models that it is not for.
    fn accept(&self, motion: &A, sensor: &H) -> Result<()>;

    /// Digests a step to a measurement `z`; `near` is a state that the cloud holds.
    fn given<'a>(
        &self,
        models: Models<'a, A::Step, A, H>,
        z: &H::Value,
        near: &[f64; N],
    ) -> Result<Self::Given<'a>>;

    /// The share of the particles that take noise of the law of the motion.
    fn defensive(given: &Self::Given<'_>) -> f64;

    /// Moves the particles of a block: see [`kernels::propose`](crate::kernels::propose). Returns how often h
    /// was evaluated.
    fn propose(
        given: &Self::Given<'_>,
        simd: Simd,
        noise: (&NoiseBlock<W>, Option<&NoiseBlock<W>>),
        states: &mut [&mut [f64]; N],
        ratios: &mut [f64],
    ) -> usize;
}

impl<const N: usize, const W: usize, A: Motion<N, W>, H: Likelihood<N>> Engine<N, W, A, H> for Bootstrap {
    type Given<'a>
        = Infallible
    where
        A: 'a,
        H: 'a;

    const GUIDED: bool = false;

    fn accept(&self, _: &A, _: &H) -> Result<()> {
        Ok(())
    }

    fn given<'a>(&self, _: Models<'a, A::Step, A, H>, _: &H::Value, _: &[f64; N]) -> Result<Infallible> {
        Err(crate::Error::Unsupported("the transition looks at no measurement".into()))
    }

    fn defensive(given: &Infallible) -> f64 {
        match *given {}
    }

    fn propose(
        given: &Infallible,
        _: Simd,
        _: (&NoiseBlock<W>, Option<&NoiseBlock<W>>),
        _: &mut [&mut [f64]; N],
        _: &mut [f64],
    ) -> usize {
        match *given {}
    }
}
