//! Many targets: plots in, tracks out.
//!
//! Inside the library everything is chosen by types. Here, at the edge, motions, sensors and filters are chosen by
//! the names of the [catalogue](crate::catalog): a [`TrackerSpec`] is data that can be written down, and
//! [`TrackerSpec::build`] makes a [`Tracker`] of it.
//!
//! ```
//! use std::sync::Arc;
//! use zerre::track::{Plot, Reading, SensorSpec, TrackerSpec};
//! use zerre::Time;
//!
//! let mut spec = TrackerSpec::new("particle", "constant-velocity");
//! spec.motion.acceleration_sd_mps2 = Some(0.5);
//! let gps = SensorSpec { position_sd_m: Some(2.0), ..SensorSpec::default() };
//! spec.sensors.insert("default".to_owned(), gps);
//!
//! let mut tracker = spec.build(Default::default())?;
//! for second in 0..10 {
//!     let time = Time::from_secs(f64::from(second));
//!     let reading = Reading::Position2([12.0 * time.secs(), 3.0]);
//!     let id = Some(Arc::from("boat"));
//!     let row = tracker.push(&Plot { time, id, sensor: None, scan: None, line: 0, reading })?;
//!     assert_eq!(&*row.id, "boat");
//! }
//! # Ok::<(), zerre::Error>(())
//! ```

mod belief;
mod extended;
mod kind;
mod learn;
mod modes;
mod motion;
mod plot;
mod row;
mod rules;
mod saved;
mod sensor;
mod spec;
mod tail;
mod tracker;

pub use extended::{Body, ClutterSpec, ExtendedFilter, ExtendedRow, ExtendedSpec, Interval, Rotation, Scan};
pub use kind::{has_modes, has_particles};
pub use learn::{HEAVY_TAILS, Learnt, Unknown, learn};
pub use modes::{Mode, ModeSpec, has_turns};
pub use motion::{MotionSpec, has_size};
pub use plot::{Plot, Reading};
pub use row::{Event, Innovation, Row, State};
pub use saved::{SavedTracker, VERSION};
pub use sensor::{DEFAULT_SENSOR, Noise, SensorSpec};
pub use spec::{Engine, Estimate, FilterSpec, LifeSpec, StartSpec, TrackerSpec};
pub use tail::Robust;
pub use tracker::{Tracker, stable_hash};

#[cfg(test)]
mod tests;
