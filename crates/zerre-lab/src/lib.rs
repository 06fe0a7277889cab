//! Scenarios, metrics, studies and reports.
//!
//! Everything here takes plain data (slices and small structs), so that estimates of any filter, or of another
//! program, are scored, judged and drawn in the same way.

pub mod agreement;
pub mod balls;
pub mod bench;
pub mod consistency;
mod distribution;
pub mod error;
pub mod fusion;
pub mod metric;
mod number;
pub mod otb;
pub mod paper;
pub mod report;
pub mod scenario;
pub mod score;
pub mod study;

pub use error::{Error, Result};
pub use number::{number, signed};
