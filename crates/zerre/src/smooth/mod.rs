//! Smoothers: what is known of a state once the measurements after it are in as well.

mod imm;
mod rts;

pub use imm::smooth_modes;
pub use rts::{rauch_tung_striebel, smooth_gaussian};
