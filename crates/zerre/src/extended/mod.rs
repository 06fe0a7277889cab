//! Extended targets: many points a scan from one target, whose shape is learnt while it is tracked.
//!
//! | module | what |
//! |---|---|
//! | [`shape`] | unions of ellipses |
//! | [`statistics`] | sums over points, and the shape that follows from them |
//! | [`centre`] | where in a state the body is, and how it is turned |
//! | [`window`] | union of ellipses by variational expectation maximisation over a window of scans |
//! | [`random_matrix`] | one ellipse as a random matrix, its law inverse Wishart ([`inverse_wishart`]) |
//! | [`mem_ekf`] | one ellipse as orientation and semi-axes, by multiplicative noise |
//! | [`contour`] | a star-convex outline, its radius a Gaussian process |
//! | [`scan`] | scans of points as a measurement |
//! | [`online`] | particle filter that learns the shape scan by scan |
//! | [`batch`] | expectation maximisation over all scans at once, by particles |
//! | [`start`] | first shapes from the points alone, and how many ellipses they call for |
//! | [`rate`] | how many points a scan has |

pub mod batch;
pub mod centre;
pub mod contour;
pub mod inverse_wishart;
pub mod mem_ekf;
pub mod online;
mod path;
pub mod random_matrix;
pub mod rate;
pub mod scan;
pub mod shape;
pub mod start;
pub mod statistics;
pub mod window;

pub use shape::{Ellipse, MAX_ELLIPSES, Shape};
pub use statistics::{MStep, Sums};
