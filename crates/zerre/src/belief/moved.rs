//! Particles that Markov kernels move, with where they came from.

use crate::belief::Cloud;
use crate::kernels::{Simd, Source, Survivors, gather};
use crate::moves::{Frozen, Moved};
use serde::{Deserialize, Serialize};
use std::array::from_fn;

/// Particles that filters move by Markov kernels: a [`Cloud`] and the memory of the moves. Only the cloud is
/// saved.
#[derive(Clone, Debug)]
pub struct MovedCloud<const N: usize> {
    pub(crate) cloud: Cloud<N>,
    /// States before the step: those of the parents.
    pub(crate) parents: [Vec<f64>; N],
    /// States or parents on their way.
    pub(crate) spare: [Vec<f64>; N],
    /// Log-density of each particle under the law that it is moved by.
    pub(crate) densities: Vec<f64>,
    pub(crate) frozen: Frozen<N>,
    pub(crate) moved: Moved,
    /// Proposals of a chain: states, log-likelihoods, and rows of their parents; empty in filters without
    /// one.
    pub(crate) proposals: Proposals<N>,
    /// The proposals that the particles are.
    pub(crate) chosen: Vec<u32>,
}

/// What a chain chooses from.
#[derive(Clone, Debug)]
pub(crate) struct Proposals<const N: usize> {
    pub(crate) states: [Vec<f64>; N],
    pub(crate) scores: Vec<f64>,
    pub(crate) parents: Vec<u32>,
    /// Of each block, how many proposals have no likelihood that is a number.
    pub(crate) lost: Vec<usize>,
}

impl<const N: usize> MovedCloud<N> {
    pub(crate) fn new(cloud: Cloud<N>) -> Self {
        let n = cloud.len();
        MovedCloud {
            cloud,
            parents: from_fn(|_| vec![0.0; n]),
            spare: from_fn(|_| vec![0.0; n]),
            densities: vec![0.0; n],
            frozen: Frozen::new(n),
            moved: Moved::default(),
            proposals: Proposals {
                states: from_fn(|_| Vec::new()),
                scores: vec![],
                parents: vec![],
                lost: vec![],
            },
            chosen: Vec::new(),
        }
    }

    /// Keeps the states as they enter a step: those of the parents of its particles.
    pub(crate) fn remember_parents(&mut self, simd: Simd) {
        let MovedCloud { cloud, parents, .. } = self;
        if cloud.pending {
            let from = Survivors::new(cloud.states.each_ref().map(Vec::as_slice), &cloud.ancestors);
            gather(
                Source::Survivors(from.block(simd, 0, cloud.len())),
                &mut parents.each_mut().map(Vec::as_mut_slice),
            );
        } else {
            parents.iter_mut().zip(&cloud.states).for_each(|(to, from)| to.copy_from_slice(from));
        }
    }

    /// Lets the survivors of a resampling take the places of the particles, each with its parent.
    pub(crate) fn branch(&mut self, simd: Simd) {
        let MovedCloud { cloud, parents, spare, .. } = self;
        for columns in [&mut cloud.states, parents] {
            let from = Survivors::new(columns.each_ref().map(Vec::as_slice), &cloud.ancestors);
            gather(
                Source::Survivors(from.block(simd, 0, spare[0].len())),
                &mut spare.each_mut().map(Vec::as_mut_slice),
            );
            std::mem::swap(columns, spare);
        }
    }

    /// The particles.
    pub fn cloud(&self) -> &Cloud<N> {
        &self.cloud
    }

    /// An independent continuation: the same particles, other random numbers from here on.
    #[must_use]
    pub fn fork(&self, label: u64) -> Self {
        MovedCloud { cloud: self.cloud.fork(label), ..self.clone() }
    }

    /// What the moves of the last step did.
    pub fn moved(&self) -> Moved {
        self.moved
    }
}

impl<const N: usize> Serialize for MovedCloud<N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.cloud.serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for MovedCloud<N> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Cloud::deserialize(deserializer).map(MovedCloud::new)
    }
}
