//! Tracks as lines on the earth.

use super::{TrackRow, TrackTable, Unit};
use crate::error::{Error, Result};
use crate::geo::{Geodetic, LocalFrame};
use serde_json::{Value, json};
use std::collections::BTreeMap;

impl TrackTable {
    /// Writes GeoJSON (RFC 7946): a line for each track with its identity, start, end and number of points as
    /// properties, in a table with modes also how many rows have each as the most probable one; cut at the
    /// antimeridian, a point where there is only one. Heights are left out, and positions beyond the reach of
    /// the frame ([`LocalFrame::surface`]).
    ///
    /// # Errors
    /// [`Error::NoPosition`] unless there are components `x` and `y` in metres.
    pub fn geojson(&self, frame: &LocalFrame) -> Result<String> {
        let find = |name: &str| self.components.iter().position(|c| c.name == name && c.unit == Unit::M);
        let (Some(x), Some(y)) = (find("x"), find("y")) else { return Err(Error::NoPosition) };
        let mut tracks: BTreeMap<&str, Vec<&TrackRow>> = BTreeMap::new();
        for row in &self.rows {
            tracks.entry(&row.id).or_default().push(row);
        }
        let features: Vec<Value> = tracks
            .into_iter()
            .filter_map(|(id, mut rows)| {
                rows.sort_by_key(|r| r.time);
                let places =
                    rows.iter().filter_map(|r| frame.surface([r.mean[x], r.mean[y]])).collect::<Vec<_>>();
                let geometry = geometry(&places)?;
                let (first, last) = (rows.first()?, rows.last()?);
                let mut properties = json!({
                    "id": id,
                    "start_s": first.time.to_string(),
                    "end_s": last.time.to_string(),
                    "points": places.len(),
                });
                if self.modes {
                    let mut modes: BTreeMap<&str, u64> = BTreeMap::new();
                    for mode in rows.iter().filter_map(|r| r.mode.as_ref()) {
                        *modes.entry(&mode.name).or_default() += 1;
                    }
                    properties["modes"] = json!(modes);
                }
                Some(json!({ "type": "Feature", "properties": properties, "geometry": geometry }))
            })
            .collect();
        Ok(json!({ "type": "FeatureCollection", "features": features }).to_string())
    }
}

/// A line through the places; `None` without any.
fn geometry(places: &[Geodetic]) -> Option<Value> {
    let mut lines: Vec<Vec<[f64; 2]>> = vec![vec![position(places.first()?)]];
    for (a, b) in places.iter().zip(&places[1..]) {
        // A step of more than half a turn goes the other way round (RFC 7946, section 3.1.9).
        if (b.lon_deg - a.lon_deg).abs() > 180.0 {
            let side = a.lon_deg.signum() * 180.0;
            let (before, after) = ((side - a.lon_deg).abs(), (side + b.lon_deg).abs());
            let share = if before + after > 0.0 { before / (before + after) } else { 0.0 };
            let lat_deg = a.lat_deg + share * (b.lat_deg - a.lat_deg);
            let edge = |lon_deg| position(&Geodetic { lat_deg, lon_deg, alt_m: 0.0 });
            lines.last_mut()?.push(edge(side));
            lines.push(vec![edge(-side)]);
        }
        lines.last_mut()?.push(position(b));
    }
    Some(match &lines[..] {
        [line] if line.len() == 1 => json!({ "type": "Point", "coordinates": line[0] }),
        [line] => json!({ "type": "LineString", "coordinates": line }),
        _ => json!({ "type": "MultiLineString", "coordinates": lines }),
    })
}

/// Longitude and latitude in degrees to eight decimals: a millimetre.
fn position(place: &Geodetic) -> [f64; 2] {
    [place.lon_deg, place.lat_deg].map(|v| (v * 1e8).round() / 1e8)
}

#[cfg(test)]
mod tests {
    use super::super::tests::table;
    use super::super::{Component, LikelyMode};
    use super::*;

    fn places(pairs: &[(f64, f64)]) -> Vec<Geodetic> {
        pairs.iter().map(|&(lon_deg, lat_deg)| Geodetic { lat_deg, lon_deg, alt_m: 0.0 }).collect()
    }

    #[test]
    fn geojson_is_longitude_then_latitude() {
        let frame = LocalFrame::new(Geodetic::new(50.0, -1.0, 0.0).unwrap());
        let value: Value = serde_json::from_str(&table().geojson(&frame).unwrap()).unwrap();
        let feature = &value["features"][0];
        assert_eq!(feature["geometry"]["type"], "LineString");
        let [lon, lat] = [0, 1].map(|i| feature["geometry"]["coordinates"][0][i].as_f64().unwrap());
        assert!((lon + 1.0).abs() < 1e-5 && (lat - 50.0).abs() < 1e-4, "{lon} {lat}");
        assert_eq!(feature["properties"]["id"], "a,b");
        assert_eq!(feature["properties"]["start_s"], "1626098398.996");
        let no_position = TrackTable::new(vec![Component::new("x", Unit::M)]);
        assert!(matches!(no_position.geojson(&frame), Err(Error::NoPosition)));
    }

    #[test]
    fn geojson_is_cut_at_the_antimeridian() {
        let cut = geometry(&places(&[(179.0, 0.0), (-178.0, 3.0)])).unwrap();
        assert_eq!(cut["type"], "MultiLineString");
        assert_eq!(cut["coordinates"], json!([[[179.0, 0.0], [180.0, 1.0]], [[-180.0, 1.0], [-178.0, 3.0]]]));
        assert_eq!(geometry(&places(&[(1.0, 2.0)])).unwrap()["type"], "Point");
        assert_eq!(geometry(&[]), None);
    }

    #[test]
    fn geojson_counts_modes() {
        let mut with = TrackTable::with_modes(table().components().to_vec());
        for (row, name) in table().rows().iter().zip([None, Some("left")]) {
            let mode = name.map(|name| LikelyMode { name: name.to_owned(), probability: 0.75 });
            with.push(TrackRow { mode, ..row.clone() }).unwrap();
        }
        let frame = LocalFrame::new(Geodetic::new(50.0, -1.0, 0.0).unwrap());
        let value: Value = serde_json::from_str(&with.geojson(&frame).unwrap()).unwrap();
        assert_eq!(value["features"][0]["properties"]["modes"], json!({ "left": 1 }));
    }
}
