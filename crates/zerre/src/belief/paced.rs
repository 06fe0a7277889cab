//! Particles whose number keeps step with a clock.

use crate::belief::Cloud;
use crate::filter::Pace;
use serde::{Deserialize, Serialize};

/// What a [`Deadline`](crate::filter::Deadline) knows: a [`Cloud`], and what particles have cost so far.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PacedCloud<const N: usize> {
    pub(crate) cloud: Cloud<N>,
    pub(crate) pace: Pace,
}

impl<const N: usize> PacedCloud<N> {
    /// The particles.
    pub fn cloud(&self) -> &Cloud<N> {
        &self.cloud
    }
}
