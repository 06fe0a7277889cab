//! What is known of a state: values that are copied, saved, compared and replayed.

mod cloud;
mod fork;
mod gaussian;
mod grid;
mod hypotheses;
mod modal;
mod modal_cloud;
mod moved;
mod paced;
mod swarm;

pub use cloud::{Cloud, MAX_PARTICLES};
pub(crate) use cloud::{
    Lineage, SavedCloud, checked_number, level_checked, load_log, quantiles_of, save_log,
};
pub use fork::Fork;
pub use gaussian::{Ellipse, Gaussian, GaussianBelief};
pub use grid::GridBelief;
pub(crate) use grid::{Lattice, Workspace};
pub use hypotheses::{Hypotheses, Hypothesis};
pub use modal::ModalGaussian;
pub(crate) use modal::matched;
pub use modal_cloud::ModalCloud;
pub(crate) use modal_cloud::{SavedModalCloud, Segment};
pub use moved::{MovedCloud, Pull};
pub(crate) use moved::{Proposals, moments};
pub use paced::PacedCloud;
pub use swarm::SwarmBelief;
