//! The columns that tables may have: one list for the reader, the documentation and the command line.

/// A mapping to this name leaves a column of the header out.
pub const IGNORE: &str = "ignore";

/// What a column holds, whatever its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Quantity {
    /// x, or east.
    X,
    /// y, or north.
    Y,
    /// z, or up.
    Z,
    /// Distance from the sensor.
    Range,
    /// Direction in the x-y plane.
    Bearing,
    /// Angle above the x-y plane.
    Elevation,
    /// Rate of change of the range.
    RangeRate,
    /// Length of a body.
    Length,
    /// Width of a body.
    Width,
    /// Direction of the length in the x-y plane.
    Orientation,
    /// Geodetic latitude.
    Latitude,
    /// Longitude.
    Longitude,
    /// Height above the ellipsoid.
    Altitude,
    /// Velocity along x.
    VelocityX,
    /// Velocity along y.
    VelocityY,
    /// Velocity along z.
    VelocityZ,
    /// Variance of x.
    VarianceX,
    /// Covariance of x and y.
    CovarianceXy,
    /// Variance of y.
    VarianceY,
    /// Seconds since an epoch.
    Seconds,
    /// Date and time of day.
    Calendar,
    /// Identity of the target.
    Id,
    /// Name of the sensor.
    Sensor,
    /// Number of the scan.
    Scan,
}

/// What a column is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// When it was measured.
    Time,
    /// Who, by what, in which scan.
    Label,
    /// A measured number.
    Measurement,
    /// A number of an estimate or of the truth, read by [`Trajectories`](crate::Trajectories) only.
    Estimate,
}

impl Quantity {
    /// How many quantities are numbers: they come first in the enumeration.
    pub(crate) const NUMBERS: usize = Quantity::VarianceY as usize + 1;

    /// What columns of this quantity are for.
    pub const fn role(self) -> Role {
        use Quantity::*;
        match self {
            X | Y | Z | Range | Bearing | Elevation | RangeRate | Length | Width | Orientation | Latitude
            | Longitude | Altitude => Role::Measurement,
            VelocityX | VelocityY | VelocityZ | VarianceX | CovarianceXy | VarianceY => Role::Estimate,
            Seconds | Calendar => Role::Time,
            Id | Sensor | Scan => Role::Label,
        }
    }

    /// Whether it is of the size of a body.
    pub(crate) const fn is_size(self) -> bool {
        matches!(self, Quantity::Length | Quantity::Width | Quantity::Orientation)
    }

    /// Name for messages.
    pub(crate) const fn name(self) -> &'static str {
        use Quantity::*;
        match self {
            X => "x",
            Y => "y",
            Z => "z",
            Range => "the range",
            Bearing => "the bearing",
            Elevation => "the elevation",
            RangeRate => "the range rate",
            Length => "the length",
            Width => "the width",
            Orientation => "the orientation",
            Latitude => "the latitude",
            Longitude => "the longitude",
            Altitude => "the altitude",
            VelocityX => "the velocity along x",
            VelocityY => "the velocity along y",
            VelocityZ => "the velocity along z",
            VarianceX => "the variance of x",
            CovarianceXy => "the covariance of x and y",
            VarianceY => "the variance of y",
            Seconds | Calendar => "the time",
            Id => "the identity",
            Sensor => "the sensor",
            Scan => "the scan",
        }
    }
}

/// A column of the contract.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its exact name, unit included.
    pub name: &'static str,
    /// What it holds.
    pub quantity: Quantity,
    /// What it means, in one line.
    pub about: &'static str,
    /// To SI units and radians.
    si: fn(f64) -> f64,
}

/// Every known column. A name here is all that a new unit or quantity needs.
pub const COLUMNS: &[Column] = {
    use Quantity::*;
    const fn column(
        name: &'static str,
        quantity: Quantity,
        si: fn(f64) -> f64,
        about: &'static str,
    ) -> Column {
        Column { name, quantity, about, si }
    }
    &[
        column("time_s", Seconds, same, "decimal seconds since any epoch, read exactly to a nanosecond"),
        column("t_s", Seconds, same, "another name of time_s"),
        column(
            "time",
            Calendar,
            same,
            "RFC 3339, such as 2021-07-12T14:00:00.5Z, read exactly to a nanosecond",
        ),
        column("id", Id, same, "identity of the target"),
        column("sensor", Sensor, same, "name of the sensor"),
        column("scan", Scan, same, "number of the scan, a whole number"),
        column("x_m", X, same, "position along x (east), metres"),
        column("x_km", X, kilo, "position along x (east), kilometres"),
        column("y_m", Y, same, "position along y (north), metres"),
        column("y_km", Y, kilo, "position along y (north), kilometres"),
        column("z_m", Z, same, "position along z (up), metres"),
        column("z_km", Z, kilo, "position along z (up), kilometres"),
        column("range_m", Range, same, "distance from the sensor, metres"),
        column("range_km", Range, kilo, "distance from the sensor, kilometres"),
        column("bearing_rad", Bearing, wrap, "direction counter-clockwise from the x axis, radians"),
        column("bearing_deg", Bearing, bearing_deg, "direction counter-clockwise from the x axis, degrees"),
        column("azimuth_rad", Bearing, azimuth, "direction clockwise from north (the y axis), radians"),
        column("azimuth_deg", Bearing, azimuth_deg, "direction clockwise from north (the y axis), degrees"),
        column(
            "elevation_rad",
            Elevation,
            same,
            "angle above the x-y plane, radians; with range and bearing",
        ),
        column(
            "elevation_deg",
            Elevation,
            degrees,
            "angle above the x-y plane, degrees; with range and bearing",
        ),
        column(
            "range_rate_mps",
            RangeRate,
            same,
            "rate of change of the range, metres per second, away is positive",
        ),
        column("length_m", Length, same, "length of a body, metres; with width and orientation"),
        column("width_m", Width, same, "width of a body, metres"),
        column(
            "orientation_rad",
            Orientation,
            wrap,
            "direction of the length, counter-clockwise from the x axis, radians",
        ),
        column(
            "orientation_deg",
            Orientation,
            bearing_deg,
            "direction of the length, counter-clockwise from the x axis, degrees",
        ),
        column("heading_rad", Orientation, azimuth, "direction of the length, clockwise from north, radians"),
        column(
            "heading_deg",
            Orientation,
            azimuth_deg,
            "direction of the length, clockwise from north, degrees",
        ),
        column("lat_deg", Latitude, same, "geodetic latitude (WGS 84), degrees"),
        column("lon_deg", Longitude, same, "longitude (WGS 84), degrees east"),
        column("alt_m", Altitude, same, "height above the ellipsoid (WGS 84), metres"),
        column("vx_mps", VelocityX, same, "velocity along x of an estimate or the truth, metres per second"),
        column("vy_mps", VelocityY, same, "velocity along y of an estimate or the truth, metres per second"),
        column("vz_mps", VelocityZ, same, "velocity along z of an estimate or the truth, metres per second"),
        column("var_x_m2", VarianceX, same, "variance of an estimate's x, square metres"),
        column("cov_xy_m2", CovarianceXy, same, "covariance of an estimate's x and y, square metres"),
        column("var_y_m2", VarianceY, same, "variance of an estimate's y, square metres"),
    ]
};

impl Column {
    /// The column of this exact name.
    pub fn find(name: &str) -> Option<&'static Column> {
        COLUMNS.iter().find(|c| c.name == name)
    }

    /// The name without its unit, shared by the columns of one quantity and convention (`range_m`, `range_km`).
    fn stem(&self) -> &'static str {
        match self.quantity.role() {
            Role::Label => self.name,
            _ => self.name.rsplit_once('_').map_or(self.name, |(stem, _)| stem),
        }
    }

    /// The number in SI units and radians, or why it cannot be one of this column.
    pub(crate) fn number(&self, text: &str) -> std::result::Result<f64, &'static str> {
        let raw: f64 = text.parse().map_err(|_| "not a number")?;
        let value = (self.si)(raw);
        if !value.is_finite() {
            return Err("not a finite number");
        }
        let (fits, reason) = match self.quantity {
            Quantity::Range => (value >= 0.0, "negative range"),
            Quantity::Length | Quantity::Width => (value >= 0.0, "negative length"),
            Quantity::Elevation => (value.abs() <= QUARTER_TURN, "elevation beyond a quarter turn"),
            Quantity::Latitude => (value.abs() <= 90.0, "latitude beyond 90 degrees"),
            Quantity::Longitude => (value.abs() <= 180.0, "longitude beyond 180 degrees"),
            Quantity::VarianceX | Quantity::VarianceY => (value >= 0.0, "negative variance"),
            _ => (true, ""),
        };
        if fits { Ok(value) } else { Err(reason) }
    }
}

const QUARTER_TURN: f64 = std::f64::consts::FRAC_PI_2;

fn same(v: f64) -> f64 {
    v
}
fn kilo(v: f64) -> f64 {
    v * 1000.0
}
fn degrees(v: f64) -> f64 {
    v.to_radians()
}
/// Into (-pi, pi].
fn wrap(v: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let r = v % TAU;
    if r > PI {
        r - TAU
    } else if r <= -PI {
        r + TAU
    } else {
        r
    }
}
/// Degrees are reduced before they become radians: 360 degrees are exactly no turn.
fn bearing_deg(v: f64) -> f64 {
    wrap((v % 360.0).to_radians())
}
fn azimuth(v: f64) -> f64 {
    wrap(QUARTER_TURN - v)
}
fn azimuth_deg(v: f64) -> f64 {
    wrap((90.0 - v % 360.0).to_radians())
}

/// Units that people write and that are not in [`COLUMNS`] for every quantity. Only a known stem with one of these
/// is an error; any other unknown name is reported and ignored.
const UNIT_WORDS: &[&str] = &[
    "s", "ms", "us", "ns", "sec", "secs", "seconds", "min", "h", "m", "mm", "cm", "km", "metres", "meters",
    "mi", "mile", "miles", "nm", "nmi", "ft", "feet", "kft", "yd", "yards", "rad", "mrad", "radians", "deg",
    "degrees", "gon", "mps", "mph", "kmh", "kph", "kn", "kt", "kts", "knots", "fps", "fl", "in", "inch",
    "inches", "yard", "furlong", "furlongs", "fathom", "fathoms", "minutes", "hr", "hrs", "hour", "hours",
];

/// The columns of a wanted quantity that `header` names in a unit that is not known; `None` if it does not.
pub(crate) fn other_units(header: &str, wanted: impl Fn(Quantity) -> bool) -> Option<String> {
    let (_, unit) = header.rsplit_once('_')?;
    let is_unit = UNIT_WORDS.contains(&unit.to_ascii_lowercase().as_str());
    if is_unit { any_units(header, wanted) } else { None }
}

/// The columns of a wanted quantity whose stem `header` has, whatever stands where the unit should be.
pub(crate) fn any_units(header: &str, wanted: impl Fn(Quantity) -> bool) -> Option<String> {
    let (stem, _) = header.rsplit_once('_')?;
    if Column::find(header).is_some() {
        return None;
    }
    let of_stem = |c: &&Column| {
        c.quantity.role() != Role::Label && wanted(c.quantity) && c.stem().eq_ignore_ascii_case(stem)
    };
    let known: Vec<_> = COLUMNS.iter().filter(of_stem).map(|c| c.name).collect();
    (!known.is_empty()).then(|| known.join(", "))
}

/// The known column whose name `header` is but for the case of its letters.
pub(crate) fn other_case(header: &str) -> Option<&'static Column> {
    COLUMNS.iter().find(|c| c.name != header && c.name.eq_ignore_ascii_case(header))
}

/// The known column that `header` may have meant.
pub(crate) fn did_you_mean(header: &str) -> Option<&'static str> {
    let asked = header.trim().to_ascii_lowercase();
    let stem = |c: &&Column| c.stem() == asked || (c.stem().len() >= 3 && asked.starts_with(c.stem()));
    let near =
        COLUMNS.iter().map(|c| (strsim::damerau_levenshtein(&asked, c.name), c)).min_by_key(|(d, _)| *d);
    match near {
        Some((distance, c)) if distance * 3 <= asked.len() => Some(c.name),
        _ => COLUMNS.iter().find(stem).map(|c| c.name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn value(column: &str, text: &str) -> Result<f64, &'static str> {
        Column::find(column).unwrap().number(text)
    }

    #[test]
    fn names_are_unique_and_numbers_come_first() {
        for (i, a) in COLUMNS.iter().enumerate() {
            assert!(COLUMNS[i + 1..].iter().all(|b| a.name != b.name), "{}", a.name);
            let number = matches!(a.quantity.role(), Role::Measurement | Role::Estimate);
            assert_eq!(number, (a.quantity as usize) < Quantity::NUMBERS, "{}", a.name);
        }
    }

    #[test]
    fn units_become_si_and_conventions_meet() {
        assert_eq!(value("range_km", "1.5"), Ok(1500.0));
        assert_eq!(value("azimuth_deg", "0"), Ok(FRAC_PI_2)); // north is up
        assert_eq!(value("azimuth_deg", "90"), Ok(0.0)); // east is the x axis
        assert_eq!(value("azimuth_deg", "270"), Ok(PI));
        assert_eq!(value("bearing_deg", "-180"), Ok(PI));
        assert_eq!(value("bearing_deg", "360"), Ok(0.0));
        assert!((value("azimuth_rad", "4").unwrap() - (FRAC_PI_2 - 4.0)).abs() < 1e-15);
        assert!((value("elevation_deg", "45").unwrap() - PI / 4.0).abs() < 1e-15);
    }

    #[test]
    fn bad_values_say_why() {
        assert_eq!(value("x_m", "NaN"), Err("not a finite number"));
        assert_eq!(value("x_km", "1e306"), Err("not a finite number"));
        assert_eq!(value("x_m", "1,5"), Err("not a number"));
        assert_eq!(value("range_m", "-1"), Err("negative range"));
        assert_eq!(value("lat_deg", "90.1"), Err("latitude beyond 90 degrees"));
        assert_eq!(value("elevation_deg", "91"), Err("elevation beyond a quarter turn"));
    }

    #[test]
    fn names_are_mended() {
        assert_eq!(other_units("range_miles", |_| true).as_deref(), Some("range_m, range_km"));
        assert_eq!(other_units("time_ms", |_| true).as_deref(), Some("time_s, time"));
        assert_eq!(other_units("x_speed", |_| true), None);
        assert_eq!(other_units("width_px", |_| true), None);
        assert_eq!(other_units("range_km", |_| true), None);
        assert_eq!(other_units("x_furlong", |_| true).as_deref(), Some("x_m, x_km"));
        assert_eq!(any_units("x_speed", |q| q == Quantity::X).as_deref(), Some("x_m, x_km"));
        assert_eq!(any_units("x_speed", |q| q == Quantity::Y), None);
        assert_eq!(other_case("TIME_S").map(|c| c.name), Some("time_s"));
        assert!(other_case("time_s").is_none() && other_case("TIME_MS").is_none());
        assert_eq!(did_you_mean("Range_m"), Some("range_m"));
        assert_eq!(did_you_mean("latitude"), Some("lat_deg"));
        assert_eq!(did_you_mean("x"), Some("x_m"));
        assert_eq!(did_you_mean("bearing_degs"), Some("bearing_deg"));
        assert_eq!(did_you_mean("comment"), None);
    }

    proptest! {
        #[test]
        fn angles_are_wrapped(degrees in -1e6..1e6f64) {
            for column in ["bearing_deg", "azimuth_deg"] {
                let b = value(column, &degrees.to_string()).unwrap();
                prop_assert!(b > -PI && b <= PI);
                let turn = if column == "bearing_deg" { degrees } else { 90.0 - degrees };
                // 1e6 degrees lose 17 453 * 2^-53 / 2 in the conversion of the reference value.
                prop_assert!((b.sin() - turn.to_radians().sin()).abs() < 1e-11);
            }
        }
    }
}
