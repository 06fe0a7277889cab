//! Tables that carry names of their own: each is a mapping to the contract's columns and a few rules.

use crate::columns::Quantity;
use crate::error::{Error, Result};
use crate::geo::Geodetic;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;
use zerre::{Span, Time};

/// The tables that can be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Told from the header.
    #[default]
    Auto,
    /// The contract's own columns, [`COLUMNS`](crate::COLUMNS).
    Csv,
    /// State vectors of aircraft from The OpenSky Network (ADS-B).
    Opensky,
    /// Position reports of ships (AIS) with columns `Time,MMSI,Latitude_degrees,Longitude_degrees`.
    Ais,
    /// Airport surface radar or multilateration, decoded from ASTERIX category 010.
    Lebl,
    /// Satellite positioning log of one vehicle.
    Uav,
    /// Labelled radar points of nuScenes key frames, a file for each, and the labelled boxes.
    Nuscenes,
}

impl Format {
    /// Every format with its name and one line about it.
    pub const ALL: &[(Format, &str, &str)] = &[
        (Format::Auto, "auto", "told from the header"),
        (Format::Csv, "csv", "columns with the names and units of the contract"),
        (Format::Opensky, "opensky", "OpenSky state vectors of aircraft (ADS-B); id is icao24"),
        (Format::Ais, "ais", "position reports of ships (AIS); id is MMSI"),
        (
            Format::Lebl,
            "lebl",
            "airport surface radar or multilateration (ASTERIX 010); id is track or addr, sizes of the radar",
        ),
        (Format::Uav, "uav", "satellite positioning log of one vehicle; id is uav"),
        (
            Format::Nuscenes,
            "nuscenes",
            "labelled radar points, a file for each key frame (its number ends the name); id is frame/label",
        ),
    ];
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Format::ALL.iter().find(|(format, ..)| format == self).map_or("", |(_, name, _)| name);
        f.pad(name)
    }
}

impl std::str::FromStr for Format {
    type Err = Error;

    /// The format of this name, or [`Error::UnknownFormat`].
    fn from_str(name: &str) -> Result<Format> {
        let found = Format::ALL.iter().find(|(_, known, _)| *known == name).map(|(format, ..)| *format);
        found.ok_or_else(|| Error::UnknownFormat {
            name: name.to_owned(),
            known: Format::ALL.iter().map(|(_, name, _)| *name).collect::<Vec<_>>().join(", "),
        })
    }
}

/// How a table differs from the contract.
pub(crate) struct Dialect {
    pub format: Format,
    /// The header must hold all of these.
    pub signature: &'static [&'static str],
    /// Name in the header, name in the contract. Of several times the first that a row has counts. Empty: the
    /// header's names are the contract's.
    pub columns: &'static [(&'static str, &'static str)],
    /// The one target that all rows are about.
    pub id: Option<&'static str>,
    /// Date and time without an offset are UTC.
    pub utc: bool,
    /// Numbers that the source writes where it has none.
    pub absent: &'static [(Quantity, f64)],
    /// Header name, cell and reason of rows that are no measurement.
    pub leave_out: Option<(&'static str, &'static str, &'static str)>,
    /// A report of the same target, time and position as its last one is the same report again.
    pub drop_repeats: bool,
    /// Reference point of positions in metres, where the source fixes it.
    pub origin: Option<Geodetic>,
    /// Where frames are counted, of a table without times: what its rows are of.
    pub frames: Option<Frames>,
    /// The rows say what is there, not what was measured.
    pub labels: bool,
}

/// Where the number of a frame stands. The time of its rows is [`KEY_FRAME`] for each frame, and the number is that of
/// their scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Frames {
    /// At the end of the name of the file, whose rows are all of it. Identities hold within it.
    Name,
    /// In the column of scans.
    Column,
}

/// Time from one key frame of nuScenes to the next.
pub(crate) const KEY_FRAME: Span = Span::from_nanos(500_000_000);

const PLAIN: Dialect = Dialect {
    format: Format::Csv,
    signature: &[],
    columns: &[],
    id: None,
    utc: false,
    absent: &[],
    leave_out: None,
    drop_repeats: false,
    origin: None,
    frames: None,
    labels: false,
};

/// Tried in this order; the contract's own names come last.
const DIALECTS: &[Dialect] = &[
    Dialect {
        format: Format::Opensky,
        signature: &["icao24", "lastposupdate", "lat", "lon"],
        // `time` is when the network answered, `lastposupdate` when the position was received; a state vector
        // repeats the last position until a new one comes.
        columns: &[
            ("lastposupdate", "time_s"),
            ("time", "time_s"),
            ("icao24", "id"),
            ("lat", "lat_deg"),
            ("lon", "lon_deg"),
            ("geoaltitude", "alt_m"),
        ],
        drop_repeats: true,
        ..PLAIN
    },
    Dialect {
        format: Format::Ais,
        signature: &["MMSI", "Time", "Latitude_degrees", "Longitude_degrees"],
        columns: &[
            ("Time", "time"),
            ("MMSI", "id"),
            ("Latitude_degrees", "lat_deg"),
            ("Longitude_degrees", "lon_deg"),
        ],
        utc: true,
        // ITU-R M.1371: not available.
        absent: &[(Quantity::Latitude, 91.0), (Quantity::Longitude, 181.0)],
        ..PLAIN
    },
    Dialect {
        format: Format::Uav,
        signature: &["latitude", "longitude", "altitude (m)", "time"],
        columns: &[
            ("time", "time"),
            ("latitude", "lat_deg"),
            ("longitude", "lon_deg"),
            ("altitude (m)", "alt_m"),
        ],
        id: Some("uav"),
        utc: true,
        ..PLAIN
    },
    Dialect {
        format: Format::Lebl,
        signature: &["tod", "track", "rho_m", "theta_deg"],
        columns: &[
            ("tod", "time_s"),
            ("track", "id"),
            ("rho_m", "range_m"),
            ("theta_deg", "azimuth_deg"),
            ("length_m", "length_m"),
            ("width_m", "width_m"),
            ("orient_deg", "heading_deg"),
        ],
        origin: Some(Geodetic { lat_deg: 41.295_618_33, lon_deg: 2.095_114_167, alt_m: 0.0 }),
        ..PLAIN
    },
    Dialect {
        format: Format::Lebl,
        signature: &["tod", "addr", "x_m", "y_m", "rab"],
        columns: &[("tod", "time_s"), ("addr", "id"), ("x_m", "x_m"), ("y_m", "y_m")],
        leave_out: Some(("rab", "1", "fixed field monitor")),
        origin: Some(Geodetic { lat_deg: 41.297_062_78, lon_deg: 2.078_447_222, alt_m: 0.0 }),
        ..PLAIN
    },
    Dialect {
        format: Format::Nuscenes,
        // Malzer and Baum's points of nuScenes: `time` is the age of a point within its frame.
        signature: &["x", "y", "velocity", "motion", "time", "label"],
        columns: &[("x", "x_m"), ("y", "y_m"), ("label", "id")],
        leave_out: Some(("label", "-1", "of no object")),
        frames: Some(Frames::Name),
        ..PLAIN
    },
    Dialect {
        format: Format::Nuscenes,
        signature: &["frame", "name", "cx_m", "cy_m", "width_m", "length_m", "yaw_rad"],
        columns: &[
            ("frame", "scan"),
            ("name", "id"),
            ("cx_m", "x_m"),
            ("cy_m", "y_m"),
            ("length_m", "length_m"),
            ("width_m", "width_m"),
            ("yaw_rad", "orientation_rad"),
        ],
        frames: Some(Frames::Column),
        labels: true,
        ..PLAIN
    },
    PLAIN,
];

/// A frame that a file is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    /// Its number.
    pub number: u64,
    /// What tells it from others, in front of identities: the name of the file from its first digit on.
    pub name: String,
}

impl Frame {
    /// The frame that a file is named for: `radar_0400_07.csv` is frame 7, `0400_07`.
    pub fn of_file(file: &str) -> Result<Frame> {
        let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        match stem[stem.len() - digits..].parse() {
            Ok(number) => {
                let name = stem.trim_start_matches(|c: char| !c.is_ascii_digit()).to_owned();
                Ok(Frame { number, name })
            }
            Err(_) => Err(Error::NoFrame { file: file.to_owned() }),
        }
    }
}

/// When a frame was.
pub(crate) fn frame_time(number: u64) -> Option<Time> {
    let number = i64::try_from(number).ok()?;
    KEY_FRAME.nanos().checked_mul(number).map(Time::from_nanos)
}

/// The rules for a table of this header, told from it if `format` is [`Format::Auto`].
pub(crate) fn dialect(file: &str, format: Format, header: &[String]) -> Result<&'static Dialect> {
    let missing = |d: &Dialect| d.signature.iter().find(|&&name| !header.iter().any(|h| h == name)).copied();
    let mut mismatch = None;
    for d in DIALECTS.iter().filter(|d| format == Format::Auto || format == d.format) {
        match missing(d) {
            None => return Ok(d),
            Some(name) => mismatch = mismatch.or(Some(name)),
        }
    }
    Err(Error::FormatMismatch { file: file.to_owned(), format, missing: mismatch.unwrap_or_default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::Column;

    #[test]
    fn dialects_speak_the_contract() {
        for d in DIALECTS {
            assert!(d.columns.iter().all(|(_, target)| Column::find(target).is_some()), "{}", d.format);
            if let Some((column, ..)) = d.leave_out {
                assert!(d.signature.contains(&column), "{}", d.format);
            }
        }
    }

    #[test]
    fn files_are_frames_by_the_number_that_ends_their_name() {
        for (file, number, name) in [
            ("a/b/radar_0400_07.csv", 7, "0400_07"),
            ("12.csv", 12, "12"),
            ("scene-3/x9.y_000.csv", 0, "9.y_000"),
        ] {
            assert_eq!(Frame::of_file(file).unwrap(), Frame { number, name: name.to_owned() }, "{file}");
        }
        for file in ["radar.csv", "standard input", "7_radar.csv", "99999999999999999999999.csv", ""] {
            assert!(matches!(Frame::of_file(file), Err(Error::NoFrame { .. })), "{file}");
        }
        assert_eq!(frame_time(7).unwrap().secs(), 3.5);
        assert_eq!(frame_time(u64::MAX), None);
    }

    #[test]
    fn names_go_both_ways() {
        for (format, name, _) in Format::ALL {
            assert_eq!(name.parse::<Format>().unwrap(), *format);
            assert_eq!(format.to_string(), *name);
            assert_eq!(serde_json::to_value(format).unwrap(), *name);
        }
        assert!("kml".parse::<Format>().unwrap_err().to_string().contains("opensky"));
    }
}
