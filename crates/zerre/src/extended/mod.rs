//! Extended targets: many points a scan from one target, whose shape is learnt while it is tracked.
//!
//! | module | what |
//! |---|---|
//! | [`shape`] | unions of ellipses |
//! | [`statistics`] | sums over points, and the shape that follows from them |

mod path;
pub mod rate;
pub mod shape;
pub mod start;
pub mod statistics;
pub mod window;

pub use shape::{Ellipse, MAX_ELLIPSES, Shape};
pub use statistics::{MStep, Sums};
