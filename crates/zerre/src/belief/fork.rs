//! Copies that go their own ways.

use super::{
    Cloud, GaussianBelief, GridBelief, Hypotheses, ModalCloud, ModalGaussian, MovedCloud, SwarmBelief,
};
use crate::filter::ModalBelief;

/// A belief of which several copies go on from the same measurements.
pub trait Fork: Clone {
    /// An independent continuation: the same belief, other random numbers from here on, if it draws any.
    #[must_use]
    fn fork(&self, label: u64) -> Self;
}

/// What draws nothing is its own continuation.
fn same<B: Clone>(belief: &B, _: u64) -> B {
    belief.clone()
}

macro_rules! fork {
    ($($belief:ident by $fork:expr;)*) => {$(
        impl<const N: usize> Fork for $belief<N> {
            fn fork(&self, label: u64) -> Self {
                $fork(self, label)
            }
        }
    )*};
}

fork! {
    Cloud by Cloud::fork;
    MovedCloud by MovedCloud::fork;
    SwarmBelief by SwarmBelief::fork;
    ModalCloud by ModalCloud::fork;
    ModalBelief by ModalBelief::fork;
    Hypotheses by Hypotheses::fork;
    GaussianBelief by same;
    ModalGaussian by same;
    GridBelief by same;
}
