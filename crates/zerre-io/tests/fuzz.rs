//! Fuzz targets of every reader: any bytes give data or an error, never a panic, and no row is lost unseen.
//!
//! `cargo test` runs each for a second or so on random and mutated bytes. For a longer, coverage-guided run install
//! `cargo-bolero` and call, for example, `cargo bolero test --package zerre-io tables`.

use bolero::check;
use zerre_io::{Format, Options, Recording, TableReader, Trajectories};

/// Headers of all formats, so that short inputs get past them.
const HEADERS: [(Format, &str); 6] = [
    (Format::Auto, ""),
    (Format::Csv, "time_s,id,sensor,x_m,y_m,range_km,azimuth_deg,range_rate_mps\n"),
    (
        Format::Opensky,
        "time,icao24,lat,lon,velocity,heading,vertrate,callsign,onground,alert,spi,squawk,\
         baroaltitude,geoaltitude,lastposupdate,lastcontact\n",
    ),
    (Format::Ais, "Time,MMSI,Latitude_degrees,Longitude_degrees,COG_degrees,SOG_knots\n"),
    (
        Format::Lebl,
        "tod,msg,track,rho_m,theta_deg,x_m,y_m,vx_mps,vy_mps,gs_nmps,ta_deg,length_m,orient_deg,\
         width_m,ax,ay,trd,tstat\n",
    ),
    (
        Format::Uav,
        "time,timestamp,latitude,longitude,altitude (m),speed,heading,date,groupNb,Vx m/s,Vy m/s\n",
    ),
];

/// Runs `read` on the bytes alone and behind the header of each format.
fn behind_headers(bytes: &[u8], read: impl Fn(&[u8], &Options)) {
    for (format, header) in HEADERS {
        let text = [header.as_bytes(), bytes].concat();
        // The share of bad rows is no reason to stop: every row is to be read.
        read(&text, &Options { format, max_rejected: 1.0, ..Options::default() });
    }
}

#[test]
fn tables() {
    check!().with_iterations(3000).for_each(|bytes: &[u8]| {
        behind_headers(bytes, |text, options| {
            if let Ok(mut reader) = TableReader::new("fuzz", text, options) {
                for plot in reader.by_ref() {
                    if plot.is_err() {
                        break;
                    }
                }
                let counts = reader.counts();
                let sum = |map: &std::collections::BTreeMap<&'static str, u64>| map.values().sum::<u64>();
                assert_eq!(counts.read, counts.used + sum(&counts.rejected) + sum(&counts.left_out));
            }
        });
    });
}

#[test]
fn recordings() {
    check!().with_iterations(1000).for_each(|bytes: &[u8]| {
        behind_headers(bytes, |text, options| {
            if let Ok(recording) = Recording::read("fuzz", text, options) {
                assert!(recording.plots.is_sorted_by_key(|plot| plot.time));
                let finite = |plot: &zerre::track::Plot| plot.reading.values().iter().all(|v| v.is_finite());
                assert!(recording.plots.iter().all(finite));
            }
        });
    });
}

#[test]
fn trajectories() {
    check!().with_iterations(1000).for_each(|bytes: &[u8]| {
        behind_headers(bytes, |text, options| {
            let _ = Trajectories::read("fuzz", text, options);
        });
    });
}
