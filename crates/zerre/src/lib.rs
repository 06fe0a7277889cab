//! Particle filters and their relatives.

pub mod belief;
pub mod error;
pub mod filter;
pub mod math;
pub mod model;
pub mod rng;
pub mod time;
pub mod track;

pub use error::{Error, Result};
pub use time::{Span, Time};
