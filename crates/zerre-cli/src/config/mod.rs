//! Configurations: TOML files whose types give the reader, the checks, the JSON Schema and the explanation.

mod effective;
mod filled;
mod source;
mod starter;
mod track;

pub use effective::{Effective, Reason, Row};
pub use filled::filled;
pub use source::{Problem, Source};
pub use starter::{KINDS, schema, starter};
pub use track::*;
