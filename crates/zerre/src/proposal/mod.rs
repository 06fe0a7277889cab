//! Proposals: where a particle filter looks for the next states.
//!
//! A proposal draws the process noise w of a particle from some q(w | x, z) instead of its law p(w), moves
//! the particle by it, and multiplies its weight by p(w) / q(w | x, z) beside the likelihood. No transition
//! density is needed, and noise may enter the motion anywhere; where it is added with full rank, this is the
//! usual proposal of states.
//!
//! [`Guided`] makes q a normal law that approximates the posterior of w, p(w | x, z), particle by particle:
//! see there.

mod engine;
mod fit;
mod guided;

pub(crate) use engine::{Engine, Models};
pub use guided::{DEFENSIVE, Guided};

/// What a [`ParticleFilter`](crate::filter::ParticleFilter) moves its particles by: [`Bootstrap`] or
/// [`Guided`].
pub trait Proposal<const N: usize, const W: usize, A, H>: Engine<N, W, A, H>
where
    A: crate::model::Motion<N, W>,
    H: crate::model::Likelihood<N>,
{
}

impl<const N: usize, const W: usize, A, H, Q> Proposal<N, W, A, H> for Q
where
    A: crate::model::Motion<N, W>,
    H: crate::model::Likelihood<N>,
    Q: Engine<N, W, A, H>,
{
}

/// The law of the noise itself, blind to the measurement (Gordon, Salmond and Smith, IEE Proceedings F 140,
/// 1993).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bootstrap;
