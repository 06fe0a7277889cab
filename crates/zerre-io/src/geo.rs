//! WGS 84 and local east-north-up frames.
//!
//! Sines and arc tangents come from the crate `libm`, in Rust, so that positions have the same bits on every
//! machine.

use crate::error::{Error, Result};
use libm::{atan2, cos, sin};
use serde::Serialize;

/// Semi-major axis of the ellipsoid in metres (WGS 84, by definition).
const A: f64 = 6_378_137.0;
/// Flattening (WGS 84, by definition).
const F: f64 = 1.0 / 298.257_223_563;
/// Semi-minor axis in metres.
const B: f64 = A * (1.0 - F);
/// First eccentricity squared.
const E2: f64 = F * (2.0 - F);
/// Second eccentricity squared.
const EP2: f64 = E2 / (1.0 - E2);

/// Cosine of the largest angle between the verticals of a position and of the origin (60 degrees, some 6 700 km):
/// a plane that touches the Earth says little about what lies beyond.
const MIN_COS: f64 = 0.5;

/// A place on Earth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Geodetic {
    /// Geodetic latitude in degrees, north is positive.
    pub lat_deg: f64,
    /// Longitude in degrees, east is positive.
    pub lon_deg: f64,
    /// Height above the ellipsoid in metres.
    pub alt_m: f64,
}

impl Geodetic {
    /// A place.
    ///
    /// # Errors
    /// [`Error::BadPlace`] unless all are finite, the latitude is within 90 and the longitude within 180 degrees.
    pub fn new(lat_deg: f64, lon_deg: f64, alt_m: f64) -> Result<Geodetic> {
        if lat_deg.abs() <= 90.0 && lon_deg.abs() <= 180.0 && alt_m.is_finite() {
            Ok(Geodetic { lat_deg, lon_deg, alt_m })
        } else {
            Err(Error::BadPlace { lat_deg, lon_deg, alt_m })
        }
    }

    /// Earth-centred, Earth-fixed coordinates in metres.
    pub fn ecef(self) -> [f64; 3] {
        let (lat, lon) = (self.lat_deg.to_radians(), self.lon_deg.to_radians());
        let n = A / (1.0 - E2 * sin(lat) * sin(lat)).sqrt();
        let p = (n + self.alt_m) * cos(lat);
        [p * cos(lon), p * sin(lon), (n * (1.0 - E2) + self.alt_m) * sin(lat)]
    }

    /// The place with these Earth-centred, Earth-fixed coordinates in metres: Bowring's iteration on the reduced
    /// latitude (Survey Review 23, 1976), to well below a millimetre from 5 000 km under the surface to the Moon.
    pub fn from_ecef([x, y, z]: [f64; 3]) -> Geodetic {
        let p = (x * x + y * y).sqrt();
        let mut reduced = atan2(z * A, p * B);
        let mut lat = 0.0;
        for _ in 0..6 {
            let (s, c) = (sin(reduced), cos(reduced));
            lat = atan2(z + EP2 * B * s * s * s, p - E2 * A * c * c * c);
            reduced = atan2((1.0 - F) * sin(lat), cos(lat));
        }
        let (s, c) = (sin(lat), cos(lat));
        // Unlike p / cos(lat) - n this holds at the poles as well.
        let alt_m = p * c + z * s - A * (1.0 - E2 * s * s).sqrt();
        Geodetic { lat_deg: lat.to_degrees(), lon_deg: atan2(y, x).to_degrees(), alt_m }
    }
}

/// A plane that touches the Earth: x east, y north, z up from the origin, in metres.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LocalFrame {
    origin: Geodetic,
    #[serde(skip)]
    centre: [f64; 3],
    /// East, north and up as Earth-fixed unit vectors.
    #[serde(skip)]
    axes: [[f64; 3]; 3],
}

impl LocalFrame {
    /// The frame that touches the Earth at `origin`.
    pub fn new(origin: Geodetic) -> LocalFrame {
        let (lat, lon) = (origin.lat_deg.to_radians(), origin.lon_deg.to_radians());
        let ((sp, cp), (sl, cl)) = ((sin(lat), cos(lat)), (sin(lon), cos(lon)));
        let axes = [[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]];
        LocalFrame { origin, centre: origin.ecef(), axes }
    }

    /// Where the frame touches the Earth.
    pub fn origin(&self) -> Geodetic {
        self.origin
    }

    /// East, north, up in metres.
    pub fn local(&self, place: Geodetic) -> [f64; 3] {
        let p = place.ecef();
        let d = [p[0] - self.centre[0], p[1] - self.centre[1], p[2] - self.centre[2]];
        self.axes.map(|axis| dot(axis, d))
    }

    /// The place at `[east, north, up]` metres.
    pub fn geodetic(&self, local: [f64; 3]) -> Geodetic {
        let [e, n, u] = self.axes;
        let along = |i: usize| self.centre[i] + e[i] * local[0] + n[i] * local[1] + u[i] * local[2];
        Geodetic::from_ecef([along(0), along(1), along(2)])
    }

    /// East and north of a place whose height does not count: it is taken at the origin's. `None` if it is more
    /// than 60 degrees of arc away.
    pub fn east_north(&self, lat_deg: f64, lon_deg: f64) -> Option<[f64; 2]> {
        let place = Geodetic { lat_deg, lon_deg, alt_m: self.origin.alt_m };
        self.sees(place).then(|| {
            let [east, north, _] = self.local(place);
            [east, north]
        })
    }

    /// The inverse of [`east_north`](LocalFrame::east_north): the place at the origin's height that lies straight
    /// above or below. `None` if there is none within 60 degrees of arc.
    pub fn surface(&self, [east, north]: [f64; 2]) -> Option<Geodetic> {
        let mut up = -(east * east + north * north) / (2.0 * A);
        // Newton's method: height grows with `up` by the cosine between the verticals.
        for _ in 0..20 {
            let place = self.geodetic([east, north, up]);
            let slope = dot(self.axes[2], LocalFrame::new(place).axes[2]);
            if slope.is_nan() || slope < MIN_COS / 2.0 {
                return None;
            }
            let excess = place.alt_m - self.origin.alt_m;
            if excess.abs() < 1e-6 {
                return self.sees(place).then_some(Geodetic { alt_m: self.origin.alt_m, ..place });
            }
            up -= excess / slope;
        }
        None
    }

    /// Whether the place is near enough for the frame to mean something.
    pub(crate) fn sees(&self, place: Geodetic) -> bool {
        dot(self.axes[2], LocalFrame::new(place).axes[2]) >= MIN_COS
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn distance(a: Geodetic, b: Geodetic) -> f64 {
        let (a, b) = (a.ecef(), b.ecef());
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    }

    /// IOGP Guidance Note 7-2, examples of methods 9602 (geographic to geocentric) and 9837 (to topocentric).
    #[test]
    fn the_published_examples() {
        let point =
            Geodetic::new(53.0 + 48.0 / 60.0 + 33.82 / 3600.0, 2.0 + 7.0 / 60.0 + 46.38 / 3600.0, 73.0)
                .unwrap();
        for (got, want) in point.ecef().into_iter().zip([3_771_793.968, 140_253.342, 5_124_304.349]) {
            assert!((got - want).abs() < 1e-3, "{got} {want}");
        }
        let frame = LocalFrame::new(Geodetic::new(55.0, 5.0, 200.0).unwrap());
        for (got, want) in frame.local(point).into_iter().zip([-189_013.869, -128_642.040, -4_220.171]) {
            assert!((got - want).abs() < 1e-3, "{got} {want}");
        }
    }

    #[test]
    fn equator_and_poles() {
        assert_eq!(Geodetic::new(0.0, 0.0, 0.0).unwrap().ecef(), [A, 0.0, 0.0]);
        for lat in [90.0, -90.0] {
            let pole = Geodetic::new(lat, 0.0, 10.0).unwrap();
            assert!((pole.ecef()[2].abs() - 6_356_762.314_245).abs() < 1e-6);
            let back = Geodetic::from_ecef(pole.ecef());
            assert!((back.lat_deg - lat).abs() < 1e-12 && (back.alt_m - 10.0).abs() < 1e-6);
            // Across the pole: a metre beyond it lies on the opposite meridian.
            let beyond = LocalFrame::new(pole).geodetic([0.0, 1.0 * lat.signum(), 0.0]);
            assert!((beyond.lon_deg.abs() - 180.0).abs() < 1e-6, "{beyond:?}");
        }
        let centre = Geodetic::from_ecef([0.0; 3]);
        assert!(centre.lat_deg.is_finite() && centre.alt_m.is_finite());
    }

    #[test]
    fn the_antimeridian_is_no_border() {
        let frame = LocalFrame::new(Geodetic::new(10.0, 179.999, 0.0).unwrap());
        let [east, north] = frame.east_north(10.0, -179.999).unwrap();
        // 0.002 degrees of a parallel whose radius is n cos(lat) = 6 282 km.
        assert!((east - 219.28).abs() < 0.1 && north.abs() < 0.1, "{east} {north}");
        let place = frame.surface([east, north]).unwrap();
        assert!((place.lon_deg + 179.999).abs() < 1e-9);
    }

    #[test]
    fn far_places_are_refused() {
        let frame = LocalFrame::new(Geodetic::new(50.0, 0.0, 0.0).unwrap());
        assert!(frame.east_north(50.0, 54.8).is_some());
        assert_eq!(frame.east_north(-50.0, 0.0), None);
        assert_eq!(frame.surface([7e6, 0.0]), None);
        assert_eq!(frame.surface([1e300, 0.0]), None);
    }

    proptest! {
        #[test]
        fn round_trips(
            lat in -90.0..90.0f64, lon in -180.0..180.0f64, alt in -10e3..40e6f64,
            lat0 in -90.0..90.0f64, lon0 in -180.0..180.0f64, alt0 in -1e3..10e3f64,
        ) {
            let place = Geodetic::new(lat, lon, alt).unwrap();
            prop_assert!(distance(place, Geodetic::from_ecef(place.ecef())) < 1e-4);
            let frame = LocalFrame::new(Geodetic::new(lat0, lon0, alt0).unwrap());
            prop_assert!(distance(place, frame.geodetic(frame.local(place))) < 1e-4);
        }

        #[test]
        fn the_surface_is_the_inverse(
            lat0 in -90.0..90.0f64, lon0 in -180.0..180.0f64, alt0 in -1e3..10e3f64,
            r in 0.0..5.4e6f64, direction in -PI..PI,
        ) {
            let frame = LocalFrame::new(Geodetic::new(lat0, lon0, alt0).unwrap());
            let [e, n] = [r * direction.cos(), r * direction.sin()];
            let place = frame.surface([e, n]).unwrap();
            let [east, north] = frame.east_north(place.lat_deg, place.lon_deg).unwrap();
            // `surface` stops within 1e-6 m of height, which moves the foot of the vertical by less.
            prop_assert!((east - e).abs() < 1e-4 && (north - n).abs() < 1e-4);
        }
    }
}
