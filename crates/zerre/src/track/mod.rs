//! Many targets: plots in, tracks out.

mod plot;

pub use plot::{Plot, Reading};
