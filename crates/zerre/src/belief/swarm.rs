//! Particles that a swarm has moved.

use crate::belief::{Cloud, MovedCloud, Pull};
use crate::swarm::Swarm;
use serde::{Deserialize, Serialize};

/// The particles of a [`SwarmFilter`](crate::filter::SwarmFilter), and what it says of the state: the mean of
/// the particles, or the best place that the swarm found.
#[derive(Clone, Debug)]
pub struct SwarmBelief<const N: usize> {
    pub(crate) moved: MovedCloud<N>,
    pub(crate) estimate: [f64; N],
}

impl<const N: usize> SwarmBelief<N> {
    pub(crate) fn new(cloud: Cloud<N>, swarm: &Swarm<N>) -> Self {
        SwarmBelief { estimate: cloud.mean(), moved: MovedCloud::new(cloud).with_swarm(swarm) }
    }

    /// The particles.
    pub fn cloud(&self) -> &Cloud<N> {
        &self.moved.cloud
    }

    /// What the filter says of the state.
    pub fn estimate(&self) -> [f64; N] {
        self.estimate
    }

    /// How the swarm of the last step changed mean and spread of the survivors; `None` where it did not move.
    pub fn pull(&self) -> Option<Pull<N>> {
        self.moved.pull
    }

    /// An independent continuation: the same particles, other random numbers from here on.
    #[must_use]
    pub fn fork(&self, label: u64) -> Self {
        SwarmBelief { moved: self.moved.fork(label), ..*self }
    }
}

impl<const N: usize> Serialize for SwarmBelief<N> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.cloud(), self.estimate.as_slice()).serialize(serializer)
    }
}

impl<'de, const N: usize> Deserialize<'de> for SwarmBelief<N> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (cloud, estimate): (Cloud<N>, Vec<f64>) = Deserialize::deserialize(deserializer)?;
        let estimate = <[f64; N]>::try_from(estimate)
            .map_err(|list| serde::de::Error::invalid_length(list.len(), &"as many as the state has"))?;
        Ok(SwarmBelief { moved: MovedCloud::new(cloud), estimate })
    }
}
