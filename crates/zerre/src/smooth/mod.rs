//! Smoothers: what is known of a state once the measurements after it are in as well.

mod rts;

pub use rts::rauch_tung_striebel;
