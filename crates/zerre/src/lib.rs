//! Particle filters and their relatives.

pub mod error;
pub mod filter;
pub mod time;
pub mod track;

pub use error::{Error, Result};
pub use time::{Span, Time};
