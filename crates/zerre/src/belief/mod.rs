//! What is known of a state: values that are copied, saved, compared and replayed.

mod cloud;
mod gaussian;
mod modal;

pub(crate) use cloud::SavedCloud;
pub use cloud::{Cloud, MAX_PARTICLES};
pub use gaussian::{Ellipse, Gaussian, GaussianBelief};
pub use modal::ModalGaussian;
pub(crate) use modal::matched;
