//! Rules that change beliefs. A filter holds models and settings and never changes; a belief is a value.

mod deadline;
mod ensemble;
mod extended;
mod gaussian;
mod gaussian_sum;
mod grid;
pub(crate) mod imm;
mod imm_particle;
mod kalman;
mod look_ahead;
mod mcmc;
mod multiple_model;
mod particle;
pub(crate) mod rao_blackwell;
mod rejuvenation;
mod resample_move;
mod selection;
mod settings;
mod size;
mod swarm;
mod swarm_importance;
mod tempered;
mod unscented;

pub(crate) use deadline::Pace;
pub use deadline::{Budget, Deadline};
pub use ensemble::{Correcting, Ensemble, EnsembleSettings};
pub(crate) use extended::MotionTangent;
pub use extended::{Extended, Tangent};
pub use gaussian::{GaussianFilter, Joint, PredictedMeasurement, Transform, predict_measurement};
pub(crate) use gaussian::{innovation, predict_law};
pub use gaussian_sum::{GaussianSum, Simplified, SumSettings};
pub use grid::Grid;
pub(crate) use imm::step_with as step_modes;
pub use imm::{Imm, ImmExtended, ImmKalman, ImmUnscented};
pub use imm_particle::ImmParticle;
pub(crate) use kalman::same;
pub use kalman::{Kalman, Linear};
pub use mcmc::{McmcSettings, SequentialMcmc};
pub(crate) use multiple_model::SavedModalBelief;
pub use multiple_model::{
    AfterResampling, ModalBelief, ModalSettings, MultipleModel, ObservationError, Output, ScaledResidual,
};
pub use particle::ParticleFilter;
pub use rao_blackwell::RaoBlackwell;
pub(crate) use rao_blackwell::{check_hypotheses, step_with as step_hypotheses};
pub use rejuvenation::{Kernel, Rejuvenation};
pub use resample_move::ResampleMove;
pub use selection::{Choice, MAX_WINDOW, Rule, Selector, Wsms, weighted_votes};
pub use settings::{Prior, Settings};
pub use size::{Boxes, Kld, Size};
pub use swarm::{Fitness, MovedWeights, Readings, SwarmEstimate, SwarmFilter};
pub use swarm_importance::SwarmImportance;
pub use tempered::Tempered;
pub(crate) use unscented::Spread;
pub use unscented::{SigmaPoints, Unscented};

use crate::error::Result;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};

/// A Bayesian filter.
pub trait Filter {
    /// What the sensor reports.
    type Measurement: ?Sized;
    /// What is known of the state.
    type Belief;

    /// The belief before any measurement.
    ///
    /// # Errors
    /// A prior that is not a law (not finite, not positive definite).
    fn start(&self, at: Time, stream: Stream) -> Result<Self::Belief>;

    /// Moves the belief to `to` and takes `z` in. Without `z` it is a prediction; with `to` equal to the belief's
    /// time it is an update alone, and draws no process noise.
    ///
    /// # Errors
    /// A step back in time, a measurement that is not finite, a model that refuses its parameters. The belief is
    /// then as it was.
    fn step(&self, belief: &mut Self::Belief, to: Time, z: Option<&Self::Measurement>) -> Result<Update>;
}

/// What one step did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Update {
    /// What became of the measurement.
    pub outcome: Outcome,
    /// log p(z_k | z_1..k-1), or its estimate; 0 without a measurement, -inf when the outcome is degenerate.
    pub log_evidence: f64,
    /// How the particles fared; `None` for filters without particles.
    pub particles: Option<ParticleUpdate>,
}

/// How the particles fared in one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParticleUpdate {
    /// How many particles the step moved and weighed.
    #[serde(default)]
    pub particles: usize,
    /// Effective sample size 1 / sum w^2 after weighting, before resampling.
    pub ess: f64,
    /// Whether the step ended with resampling.
    pub resampled: bool,
    /// How many particles of the step before have descendants in this one.
    pub distinct_ancestors: usize,
    /// Particles whose likelihood was NaN or +inf, or whose state ceased to be finite: they got weight zero.
    pub not_finite: usize,
    /// How often the step evaluated the measurement of a particle: once per weight, and as often as a
    /// proposal asked for it. A tangent by `W` components of noise counts as `W` + 1.
    #[serde(default)]
    pub evaluations: usize,
}

/// What became of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Outcome {
    /// There was none: the belief was predicted.
    Predicted,
    /// It was used.
    Updated,
    /// It lay outside the gate and was not used; the belief was predicted.
    Gated,
    /// No particle (or no Gaussian) gives it any likelihood that the arithmetic can hold: it was not used, the
    /// belief was predicted, and the caller's policy decides what follows. With an effective sample size of 0 no
    /// particle has a finite state any more: that belief cannot go on, and its estimates are NaN.
    Degenerate,
}
