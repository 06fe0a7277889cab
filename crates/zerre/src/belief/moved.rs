//! Particles that Markov kernels move, with where they came from.

use crate::belief::Cloud;
use crate::kernels::{Simd, Source, Survivors, gather};
use crate::model::{Motion, TransitionDensity};
use crate::moves::{Frozen, Moved};
use crate::swarm::{Forecast, Memory, Swarm};
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
    /// Log-likelihood of each particle.
    pub(crate) likelihoods: Vec<f64>,
    pub(crate) frozen: Frozen<N>,
    pub(crate) moved: Moved,
    /// What the moves of the last step did to the particles as a whole.
    pub(crate) pull: Option<Pull<N>>,
    /// The particles before the step, as far as a density of what they foretell is needed.
    pub(crate) forecast: Forecast<N>,
    /// Where a swarm stands, as kernels about its points.
    pub(crate) about: Forecast<N>,
    /// Memory of a swarm.
    pub(crate) swarm: Memory,
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
            likelihoods: vec![0.0; n],
            frozen: Frozen::new(n),
            moved: Moved::default(),
            pull: None,
            forecast: Forecast::default(),
            about: Forecast::default(),
            swarm: Memory::default(),
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

    /// The same with room for what a swarm and its fitness need.
    pub(crate) fn with_swarm(self, swarm: &Swarm<N>) -> Self {
        let n = self.cloud.len();
        let (forecast, about) = (Forecast::with_room(n), Forecast::with_room(n));
        MovedCloud { forecast, about, swarm: swarm.memory(n), ..self }
    }

    /// Keeps what a step foretells of the particles as they enter it.
    pub(crate) fn foretell<A: Motion<N, W>, const W: usize>(
        &mut self,
        simd: Simd,
        density: &TransitionDensity<A, N, W>,
    ) {
        self.remember_parents(simd);
        let MovedCloud { cloud, parents, forecast, .. } = self;
        let equal = cloud.equal.then_some(1.0 / cloud.len() as f64);
        match equal {
            Some(weight) => forecast.fill(simd, density, parents, std::iter::repeat_n(weight, cloud.len())),
            None => forecast.fill(simd, density, parents, cloud.weights()),
        }
    }

    /// Lets the survivors of a resampling take the places of the particles, each with its parent and its
    /// log-likelihood.
    pub(crate) fn branch(&mut self, simd: Simd) {
        let MovedCloud { cloud, parents, spare, likelihoods, densities, .. } = self;
        for (to, &a) in densities.iter_mut().zip(&cloud.ancestors) {
            *to = likelihoods[a as usize];
        }
        std::mem::swap(likelihoods, densities);
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

    /// How the moves of the last step changed mean and spread of the survivors; `None` where there were no
    /// moves. Moves that keep the law pull by chance alone.
    pub fn pull(&self) -> Option<Pull<N>> {
        self.pull
    }
}

/// Mean and standard deviation of each component of equally weighted particles, before a move and after it,
/// in the units of the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull<const N: usize> {
    /// Means: before, after.
    pub mean: [[f64; N]; 2],
    /// Standard deviations: before, after.
    pub sd: [[f64; N]; 2],
}

/// Mean and standard deviation of each component of `states`.
pub(crate) fn moments<const N: usize>(states: &[Vec<f64>; N]) -> [[f64; N]; 2] {
    let n = states.first().map_or(0, Vec::len) as f64;
    let mean = states.each_ref().map(|column| column.iter().sum::<f64>() / n);
    let sd = from_fn(|k| {
        let square = |x: &f64| (x - mean[k]) * (x - mean[k]);
        (states[k].iter().map(square).sum::<f64>() / n).sqrt()
    });
    [mean, sd]
}

impl<const N: usize> Pull<N> {
    pub(crate) fn between(before: [[f64; N]; 2], after: [[f64; N]; 2]) -> Self {
        Pull { mean: [before[0], after[0]], sd: [before[1], after[1]] }
    }

    /// With what another move did later: resampling in between is no pull.
    pub(crate) fn then(mut self, before: [[f64; N]; 2], after: [[f64; N]; 2]) -> Self {
        for k in 0..N {
            self.mean[1][k] += after[0][k] - before[0][k];
            self.sd[1][k] *= if before[1][k] > 0.0 { after[1][k] / before[1][k] } else { 1.0 };
        }
        self
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
