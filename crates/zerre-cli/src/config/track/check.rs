//! Ranges: which values have a meaning.

use super::{ExtendedConfig, Geodetic, ModesConfig, Robust, SensorConfig, TrackConfig};
use crate::config::Problem;
use zerre::belief::MAX_PARTICLES;

/// The least standard deviation of a sensor or a start, in the unit of its key. Squares of much smaller ones vanish in
/// sums with those of other quantities, and at last in 64-bit numbers themselves.
pub(super) const LEAST_SD: f64 = 1e-9;
/// The largest standard deviation, likewise: of much larger ones products of squares overflow.
pub(super) const MOST_SD: f64 = 1e9;
/// The least mean time in a mode, s: the least that [`Chain::sojourns`](zerre::model::Chain::sojourns) takes.
pub(super) const LEAST_STAY: f64 = 1e-6;
/// The largest coordinate, metres: far beyond the Moon.
pub(super) const MOST_COORDINATE: f64 = 1e12;

impl TrackConfig {
    /// Whether the values have a meaning, as far as that shows without the recording.
    ///
    /// # Errors
    /// The first value that has none.
    pub fn check(&self) -> Result<(), Problem> {
        let filter = |key| ["filter", key];
        if let Some(particles) = self.filter.particles
            && !(1..=MAX_PARTICLES).contains(&(particles as usize))
        {
            let what = format!("{particles} is out of range; from 1 to {MAX_PARTICLES} particles can be had");
            return Err(problem(&filter("particles"), &what));
        }
        probability(&filter("threshold"), self.filter.threshold)?;
        not_negative(&filter("roughening"), self.filter.roughening)?;

        let m = &self.motion;
        let motion = |key| ["motion", key];
        noise(&motion("speed_sd_mps"), m.speed_sd_mps)?;
        within(&motion("lateral_acceleration_mps2"), m.lateral_acceleration_mps2, MOST_SD)?;
        noise(&motion("acceleration_sd_mps2"), m.acceleration_sd_mps2)?;
        noise(&motion("jerk_sd_mps3"), m.jerk_sd_mps3)?;
        within(&motion("turn_rate_rad_s"), m.turn_rate_rad_s, MOST_SD)?;
        noise(&motion("turn_acceleration_sd_rad_s2"), m.turn_acceleration_sd_rad_s2)?;
        noise(&motion("size_sd_mps"), m.size_sd_mps)?;
        noise(&motion("orientation_sd_rad_s"), m.orientation_sd_rad_s)?;
        positive(&motion("tau_s"), m.tau_s)?;
        deviation(&motion("a_max_mps2"), m.a_max_mps2)?;
        probability(&motion("p_max"), m.p_max)?;
        probability(&motion("p_0"), m.p_0)?;
        m.modes.check()?;

        probability(&["input", "max_rejected"], self.input.max_rejected)?;
        geodetic(&["input", "origin"], self.input.origin)?;
        deviation(&["start", "speed_sd_mps"], self.start.speed_sd_mps)?;
        deviation(&["start", "acceleration_sd_mps2"], self.start.acceleration_sd_mps2)?;
        deviation(&["start", "turn_rate_sd_rad_s"], self.start.turn_rate_sd_rad_s)?;
        deviation(&["start", "size_sd_m"], self.start.size_sd_m)?;
        deviation(&["start", "position_sd_m"], self.start.position_sd_m)?;
        coordinates(&["start", "position_m"], self.start.position_m.as_deref())?;
        if self.start.position_m.is_some() != self.start.position_sd_m.is_some() {
            return Err(problem(&["start"], "position_m and position_sd_m need each other"));
        }
        positive(&["track", "max_gap_s"], self.life.max_gap_s)?;
        if self.life.restart_after_gated == Some(0) {
            let what = "0 is out of range; at least 1 is needed (a large number: never)";
            return Err(problem(&["track", "restart_after_gated"], what));
        }
        self.sensor.iter().try_for_each(|(name, sensor)| sensor.check(name))?;
        self.extended.as_ref().map_or(Ok(()), ExtendedConfig::check)
    }
}

impl ModesConfig {
    fn check(&self) -> Result<(), Problem> {
        let at = |key| ["motion", "modes", key];
        let stay = |v: f64| (LEAST_STAY..=MOST_SD).contains(&v);
        let needs = format!("seconds from {LEAST_STAY:e} to {MOST_SD:e} are needed");
        range(&at("stay_s"), self.stay_s, stay, &needs)?;
        noise(&at("turn_rate_rad_s"), self.turn_rate_rad_s)?;
        let factor = |v: f64| (1.0..=MOST_SD).contains(&v);
        let needs = format!("1 to {MOST_SD:e} is needed: 1 stands for no manoeuvring mode");
        range(&at("manoeuvre_factor"), self.manoeuvre_factor, factor, &needs)
    }
}

impl SensorConfig {
    fn check(&self, name: &str) -> Result<(), Problem> {
        let at = |key| ["sensor", name, key];
        deviation(&at("position_sd_m"), self.position_sd_m)?;
        deviation(&at("range_sd_m"), self.range_sd_m)?;
        deviation(&at("bearing_sd_rad"), self.bearing_sd_rad)?;
        deviation(&at("bearing_sd_deg"), self.bearing_sd_deg)?;
        deviation(&at("elevation_sd_rad"), self.elevation_sd_rad)?;
        deviation(&at("elevation_sd_deg"), self.elevation_sd_deg)?;
        deviation(&at("range_rate_sd_mps"), self.range_rate_sd_mps)?;
        deviation(&at("size_sd_m"), self.size_sd_m)?;
        deviation(&at("orientation_sd_rad"), self.orientation_sd_rad)?;
        deviation(&at("orientation_sd_deg"), self.orientation_sd_deg)?;
        let both = self.orientation_sd_deg.is_some() && self.orientation_sd_rad.is_some();
        either(&at("orientation_sd_deg"), "orientation_sd_rad", both)?;
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
                    |v| (1.0..=MOST_SD).contains(&v),
                    "1 to 1e9 is needed: outliers err more than the others",
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
    list.iter().try_for_each(|value| within(path, Some(*value), MOST_COORDINATE))
}

fn problem(path: &[&str], what: &str) -> Problem {
    Problem { path: path.iter().map(|key| (*key).to_owned()).collect(), what: what.to_owned() }
}

fn range(path: &[&str], value: Option<f64>, holds: impl Fn(f64) -> bool, needs: &str) -> Result<(), Problem> {
    match value {
        Some(value) if !value.is_finite() => Err(problem(path, &format!("{value} is not a finite number"))),
        Some(value) if !holds(value) => Err(problem(path, &format!("{value:?} is out of range; {needs}"))),
        _ => Ok(()),
    }
}

fn within(path: &[&str], value: Option<f64>, most: f64) -> Result<(), Problem> {
    range(path, value, |v| v.abs() <= most, &format!("at most {most:e} either way is needed"))
}

/// A standard deviation that may not be zero.
pub(super) fn deviation(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    let needs = format!("a number above zero, from {LEAST_SD:e} to {MOST_SD:e}, is needed");
    range(path, value, |v| (LEAST_SD..=MOST_SD).contains(&v), &needs)
}

/// A standard deviation of a motion: zero is none.
fn noise(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    let needs = format!("zero or a number above it, at most {MOST_SD:e}, is needed");
    range(path, value, |v| (0.0..=MOST_SD).contains(&v), &needs)
}

pub(super) fn positive(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    range(path, value, |v| v > 0.0, "a number above zero is needed")
}

fn not_negative(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    range(path, value, |v| v >= 0.0, "zero or a number above it is needed")
}

pub(super) fn probability(path: &[&str], value: Option<f64>) -> Result<(), Problem> {
    range(path, value, |v| (0.0..=1.0).contains(&v), "a number from 0 to 1 is needed")
}

/// A whole number from 1 on.
pub(super) fn between(path: &[&str], value: Option<u32>, most: u32, what: &str) -> Result<(), Problem> {
    match value {
        Some(value) if !(1..=most).contains(&value) => {
            Err(problem(path, &format!("{value} is out of range; from 1 to {most} {what} can be had")))
        }
        _ => Ok(()),
    }
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
    within(&at("alt_m"), Some(point.alt_m), MOST_COORDINATE)
}
