//! Smoothers: what is known of a state once the measurements after it are in as well.

mod backward;
mod conditional;
mod fixed_lag;
mod history;
mod imm;
mod paris;
mod rts;

pub use backward::{Backward, Paths, backward_paths};
pub use conditional::conditional_path;
pub use history::{History, Smoothed};
pub use imm::smooth_modes;
pub use paris::{Paris, PathStep};
pub use rts::{rauch_tung_striebel, smooth_gaussian};
