//! Particle filters and their relatives.

pub mod belief;
pub mod catalog;
pub mod error;
pub mod filter;
pub mod kernels;
pub mod math;
pub mod model;
pub mod resample;
pub mod rng;
pub mod smooth;
pub mod time;
pub mod track;

pub use error::{Error, Result};
pub use time::{Span, Time};
