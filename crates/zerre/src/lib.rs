//! Particle filters and their relatives.

// The same bits on every machine: nothing of the system that differs (clippy.toml). Tests may compare with it.
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod belief;
pub mod catalog;
pub mod error;
pub mod extended;
pub mod filter;
pub mod kernels;
pub mod math;
pub mod model;
pub mod moves;
pub mod parameter;
pub mod proposal;
pub mod resample;
pub mod rng;
pub mod smooth;
pub mod swarm;
pub mod time;
pub mod track;

pub use error::{Error, Result};
pub use time::{Span, Time};

/// The library example of the front page, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct FrontPage;
