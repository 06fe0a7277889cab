//! What is believed of a target, in the form of any filter.

use super::spec::Estimate;
use crate::belief::{Cloud, Gaussian, GaussianBelief, Hypotheses, ModalCloud, ModalGaussian};
use crate::error::Result;
use crate::filter::ModalBelief;
use crate::time::Time;

/// A belief of a target.
pub(super) enum Belief<const N: usize> {
    Gaussian(GaussianBelief<N>),
    Modal(ModalGaussian<N>),
    Hypotheses(Hypotheses<N>),
    Cloud(Box<Cloud<N>>),
    EveryMode(Box<ModalBelief<N>>),
    Interacting(Box<ModalCloud<N>>),
}

impl<const N: usize> Belief<N> {
    pub(super) fn time(&self) -> Time {
        match self {
            Belief::Gaussian(belief) => belief.time,
            Belief::Modal(belief) => belief.time(),
            Belief::Hypotheses(belief) => belief.time(),
            Belief::Cloud(cloud) => cloud.time(),
            Belief::EveryMode(belief) => belief.time(),
            Belief::Interacting(cloud) => cloud.time(),
        }
    }

    pub(super) fn has_particles(&self) -> bool {
        matches!(self, Belief::Cloud(_) | Belief::EveryMode(_) | Belief::Interacting(_))
    }

    /// As one Gaussian for each mode; `None` if it knows of no modes.
    ///
    /// # Errors
    /// Every particle is lost.
    pub(super) fn by_mode(&self) -> Result<Option<ModalGaussian<N>>> {
        match self {
            Belief::Gaussian(_) | Belief::Cloud(_) => Ok(None),
            Belief::Modal(belief) => Ok(Some(belief.clone())),
            Belief::Hypotheses(belief) => belief.by_mode().map(Some),
            Belief::EveryMode(belief) => belief.cloud().by_mode().map(Some),
            Belief::Interacting(cloud) => cloud.by_mode().map(Some),
        }
    }

    /// Mean and covariance of the whole.
    ///
    /// # Errors
    /// Every particle is lost.
    pub(super) fn law(&self) -> Result<Gaussian<N>> {
        match self {
            Belief::Gaussian(belief) => Ok(belief.state),
            Belief::Modal(belief) => belief.combined(),
            Belief::Hypotheses(belief) => belief.combined(),
            Belief::Cloud(cloud) => cloud.gaussian(),
            Belief::EveryMode(belief) => belief.cloud().gaussian(),
            Belief::Interacting(cloud) => cloud.gaussian(),
        }
    }

    /// How many modes it knows of; 0 if of none.
    pub(super) fn modes(&self) -> usize {
        match self {
            Belief::Gaussian(_) | Belief::Cloud(_) => 0,
            Belief::Modal(belief) => belief.len(),
            Belief::Hypotheses(belief) => belief.modes(),
            Belief::EveryMode(belief) => belief.cloud().modes(),
            Belief::Interacting(cloud) => cloud.modes(),
        }
    }

    /// Probability of each mode.
    pub(super) fn probabilities(&self) -> Vec<f64> {
        match self {
            Belief::Gaussian(_) | Belief::Cloud(_) => Vec::new(),
            Belief::Modal(belief) => belief.probabilities().to_vec(),
            Belief::Hypotheses(belief) => (0..belief.modes()).map(|j| belief.probability(j)).collect(),
            Belief::EveryMode(belief) => belief.cloud().probabilities().collect(),
            Belief::Interacting(cloud) => cloud.probabilities().collect(),
        }
    }

    /// The point that stands for it: `mean`, its mean, unless there are particles to choose another one from.
    pub(super) fn point(&self, estimate: Estimate, mean: &[f64; N]) -> Result<[f64; N]> {
        const SHARE: f64 = 0.1;
        match (estimate, self) {
            (Estimate::Mean, _) => Ok(*mean),
            (_, Belief::Gaussian(_) | Belief::Modal(_) | Belief::Hypotheses(_)) => Ok(*mean),
            (Estimate::MaxWeight, Belief::Cloud(cloud)) => Ok(cloud.max_weight()),
            (Estimate::MaxWeight, Belief::EveryMode(belief)) => Ok(belief.cloud().max_weight()),
            (Estimate::MaxWeight, Belief::Interacting(cloud)) => Ok(cloud.max_weight()),
            (Estimate::RobustMean, Belief::Cloud(cloud)) => cloud.robust_mean(SHARE),
            (Estimate::RobustMean, Belief::EveryMode(belief)) => belief.cloud().robust_mean(SHARE),
            (Estimate::RobustMean, Belief::Interacting(cloud)) => cloud.robust_mean(SHARE),
        }
    }
}
