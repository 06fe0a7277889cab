//! Sources and sinks of zerre: tables of measurements in, tracks out.
//!
//! A table is read row by row ([`TableReader`]) or whole and in order of time ([`Recording`]); its columns are the
//! list [`COLUMNS`], and tables with their own column names are [`Format`]s over the same reader. Estimates and
//! truth are [`Trajectories`], results are a [`TrackTable`], shapes ([`write_ellipses`]) or columns
//! ([`write_results`]), and every file appears whole or not at all ([`write_atomically`]).
//!
//! ```
//! use zerre_io::{Options, Recording};
//! let table = "time_s,id,range_km,azimuth_deg\n0.1,a,1.5,90\n0.2,a,,91\n";
//! let recording = Recording::read("radar.csv", table.as_bytes(), &Options::default())?;
//! assert_eq!(recording.plots.len(), 2); // range and bearing, then a bearing alone
//! assert_eq!(recording.summary.counts.missing, 1);
//! # Ok::<(), zerre_io::Error>(())
//! ```

mod atomic;
mod columns;
mod error;
mod formats;
mod geo;
mod header;
mod results;
mod rows;
mod shapes;
mod table;
mod tracks;
mod truth;

pub use atomic::write_atomically;
pub use columns::{COLUMNS, Column, IGNORE, Quantity, Role};
pub use error::{Error, Result};
pub use formats::Format;
pub use geo::{Geodetic, LocalFrame};
pub use header::Ignored;
pub use results::{Values, write_results};
pub use rows::{Counts, MAX_LINE_BYTES, Options, Rejection, Summary};
pub use shapes::{EllipseRow, write_ellipses};
pub use table::{Recording, TableReader};
pub use tracks::{Component, LikelyMode, TrackCsv, TrackRow, TrackTable, Unit};
pub use truth::{Trajectories, Trajectory, TrajectoryPoint};
