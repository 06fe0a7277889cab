//! Tables that carry names of their own: each is a mapping to the contract's columns and a few rules.

use crate::columns::Quantity;
use crate::error::{Error, Result};
use crate::geo::Geodetic;
use serde::{Deserialize, Serialize};
use std::fmt;

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
}

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
    PLAIN,
];

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
    fn names_go_both_ways() {
        for (format, name, _) in Format::ALL {
            assert_eq!(name.parse::<Format>().unwrap(), *format);
            assert_eq!(format.to_string(), *name);
            assert_eq!(serde_json::to_value(format).unwrap(), *name);
        }
        assert!("kml".parse::<Format>().unwrap_err().to_string().contains("opensky"));
    }
}
