//! What is known of a state: values that are copied, saved, compared and replayed.

mod gaussian;

pub use gaussian::{Ellipse, Gaussian, GaussianBelief};
