//! Ranges: which values have a meaning.

use super::{Geodetic, Robust, SensorConfig, TrackConfig};
use crate::config::Problem;

impl TrackConfig {
    /// Whether the values have a meaning, as far as that shows without the recording.
    ///
    /// # Errors
    /// The first value that has none.
    pub fn check(&self) -> Result<(), Problem> {
        let filter = |key| ["filter", key];
        if self.filter.particles == Some(0) {
            return Err(problem(&filter("particles"), "at least one particle is needed"));
        }
        probability(&filter("threshold"), self.filter.threshold)?;
        not_negative(&filter("roughening"), self.filter.roughening)?;

        let m = &self.motion;
        let motion = |key| ["motion", key];
        not_negative(&motion("speed_sd_mps"), m.speed_sd_mps)?;
        finite(&motion("lateral_acceleration_mps2"), m.lateral_acceleration_mps2)?;
        not_negative(&motion("acceleration_sd_mps2"), m.acceleration_sd_mps2)?;
        not_negative(&motion("jerk_sd_mps3"), m.jerk_sd_mps3)?;
        finite(&motion("turn_rate_rad_s"), m.turn_rate_rad_s)?;
        not_negative(&motion("turn_acceleration_sd_rad_s2"), m.turn_acceleration_sd_rad_s2)?;
        positive(&motion("tau_s"), m.tau_s)?;
        positive(&motion("a_max_mps2"), m.a_max_mps2)?;
        probability(&motion("p_max"), m.p_max)?;
        probability(&motion("p_0"), m.p_0)?;

        probability(&["input", "max_rejected"], self.input.max_rejected)?;
        geodetic(&["input", "origin"], self.input.origin)?;
        positive(&["start", "speed_sd_mps"], self.start.speed_sd_mps)?;
        positive(&["start", "acceleration_sd_mps2"], self.start.acceleration_sd_mps2)?;
        positive(&["start", "turn_rate_sd_rad_s"], self.start.turn_rate_sd_rad_s)?;
        positive(&["start", "position_sd_m"], self.start.position_sd_m)?;
        coordinates(&["start", "position_m"], self.start.position_m.as_deref())?;
        if self.start.position_m.is_some() != self.start.position_sd_m.is_some() {
            return Err(problem(&["start"], "position_m and position_sd_m need each other"));
        }
        positive(&["track", "max_gap_s"], self.life.max_gap_s)?;
        self.sensor.iter().try_for_each(|(name, sensor)| sensor.check(name))
    }
}

impl SensorConfig {
    fn check(&self, name: &str) -> Result<(), Problem> {
        let at = |key| ["sensor", name, key];
        positive(&at("position_sd_m"), self.position_sd_m)?;
        positive(&at("range_sd_m"), self.range_sd_m)?;
        positive(&at("bearing_sd_rad"), self.bearing_sd_rad)?;
        positive(&at("bearing_sd_deg"), self.bearing_sd_deg)?;
        positive(&at("elevation_sd_rad"), self.elevation_sd_rad)?;
        positive(&at("elevation_sd_deg"), self.elevation_sd_deg)?;
        positive(&at("range_rate_sd_mps"), self.range_rate_sd_mps)?;
        either(
            &at("bearing_sd_deg"),
            "bearing_sd_rad",
            self.bearing_sd_deg.is_some() && self.bearing_sd_rad.is_some(),
        )?;
        let both = self.elevation_sd_deg.is_some() && self.elevation_sd_rad.is_some();
        either(&at("elevation_sd_deg"), "elevation_sd_rad", both)?;
        either(&at("position"), "position_m", self.position.is_some() && self.position_m.is_some())?;
        geodetic(&at("position"), self.position)?;
        coordinates(&at("position_m"), self.position_m.as_deref())?;
        let below_one = |value: f64| (0.0..1.0).contains(&value);
        range(&at("gate"), self.gate, below_one, "a probability from 0 to below 1 is needed (0: no gate)")?;
        let robust = |key| ["sensor", name, "robust", key];
        match self.robust {
            None => Ok(()),
            Some(Robust::StudentT { dof }) => positive(&robust("dof"), Some(dof)),
            Some(Robust::Outliers { share, scale }) => {
                range(&robust("share"), Some(share), below_one, "a share from 0 to below 1 is needed")?;
                range(
                    &robust("scale"),
                    Some(scale),
                    |v| v >= 1.0,
                    "at least 1 is needed: outliers err more than the others",
                )
            }
        }
    }
}

fn coordinates(path: &[&str], list: Option<&[f64]>) -> Result<(), Problem> {
    let Some(list) = list else { return Ok(()) };
    if !(2..=3).contains(&list.len()) {
        let what = format!("x, y or x, y, z are needed; the list holds {}", list.len());
        return Err(problem(path, &what));
    }
    list.iter().try_for_each(|value| finite(path, Some(*value)))
}

fn problem(path: &[&str], what: &str) -> Problem {
    Problem { path: path.iter().map(|key| (*key).to_owned()).collect(), what: what.to_owned() }
}

fn range(path: &[&str], value: Option<f64>, holds: impl Fn(f64) -> bool, needs: &str) -> Result<(), Problem> {
    match value {
        Some(value) if !value.is_finite() => Err(problem(path, &format!("{value} is not a finite number"))),
        Some(value) if !holds(value) => Err(problem(path, &format!("{value} is out of range; {needs}"))),
        _ => Ok(()),
    }
}

fn finite(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    range(path, value, |_| true, "")
}

fn positive(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    range(path, value, |v| v > 0.0, "a number above zero is needed")
}

fn not_negative(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    range(path, value, |v| v >= 0.0, "zero or a number above it is needed")
}

fn probability(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    range(path, value, |v| (0.0..=1.0).contains(&v), "a number from 0 to 1 is needed")
}

fn either(path: &[&str], other: &str, both: bool) -> Result<(), Problem> {
    if both {
        Err(problem(path, &format!("`{other}` is given as well; keep one of the two")))
    } else {
        Ok(())
    }
}

fn geodetic(path: &[&str], point: Option<Geodetic>) -> Result<(), Problem> {
    let Some(point) = point else { return Ok(()) };
    let at = |key| [path, &[key]].concat();
    range(&at("lat_deg"), Some(point.lat_deg), |v| v.abs() <= 90.0, "degrees from -90 to 90 are needed")?;
    range(&at("lon_deg"), Some(point.lon_deg), |v| v.abs() <= 180.0, "degrees from -180 to 180 are needed")?;
    finite(&at("alt_m"), Some(point.alt_m))
}
