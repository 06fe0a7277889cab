//! Pages that zerre serves to the browser of its own machine.
//!
//! A server listens on the loopback address only. Its pages live under a path that nobody can guess, requests
//! that name another host are refused (a foreign page could otherwise have its own name point here), and
//! pages may load nothing from elsewhere. The pages are files in this crate, embedded in the program.

pub mod choose;
pub mod error;
pub mod label;
mod server;

pub use error::{Error, Result};
pub use server::key;
