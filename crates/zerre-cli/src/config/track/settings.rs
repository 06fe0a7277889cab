//! Defaults: what holds where nothing is said, and why.

use super::{
    Estimate, FilterConfig, Format, Generator, InputConfig, LifeConfig, Normals, ResampleWhen, StartConfig,
};
use crate::config::Effective;
use serde::Serialize;
use zerre::track::FilterSpec;

/// How the recording is read, settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputSettings {
    /// Format of the recording; `Auto` is still to be told from the file.
    pub format: Format,
    /// Share of rejected rows above which the recording is refused.
    pub max_rejected: f64,
}

impl InputConfig {
    /// The settings, with their reasons in `effective`. The origin and the columns are listed as given.
    pub fn settle(&self, effective: &mut Effective) -> InputSettings {
        let format = effective.settle(&["input", "format"], &self.format, Format::Auto, "told from the file");
        let why = "more than one bad row in a hundred is a wrong format, not noise";
        let max_rejected = effective.settle(&["input", "max_rejected"], &self.max_rejected, 0.01, why);
        for (header, name) in &self.columns {
            effective.settle_given(&["input", "columns", header], &Some(name));
        }
        if let Some(origin) = self.origin {
            effective.settle_given(&["input", "origin", "lat_deg"], &Some(origin.lat_deg));
            effective.settle_given(&["input", "origin", "lon_deg"], &Some(origin.lon_deg));
            effective.settle_given(&["input", "origin", "alt_m"], &Some(origin.alt_m));
        }
        InputSettings { format, max_rejected }
    }
}

/// The particles of a filter that has them, settled.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticleSettings {
    /// Number of particles.
    pub particles: u32,
    /// A name of the catalogue's resamplers, not yet checked.
    pub resampling: String,
    /// When particles are resampled.
    pub resample_when: ResampleWhen,
    /// Share of the particles below which the effective number has to fall.
    pub threshold: f64,
    /// Factor of the jitter after resampling.
    pub roughening: f64,
    /// Resolution of the process-noise normals.
    pub normals: Normals,
    /// Generator of random numbers.
    pub generator: Generator,
}

impl FilterConfig {
    /// The settings that the filter of this name uses, with their reasons in `effective`; the others have
    /// their defaults.
    pub fn settle_particles(&self, filter: &str, effective: &mut Effective) -> ParticleSettings {
        let mut settle = Used { of: FilterConfig::used_by(filter), effective };
        let enough = match filter {
            "rb-mmpf" => "hypotheses: four times as many gain less than 0.1 of log-evidence per measurement",
            _ => "enough for one target in the plane",
        };
        let default = FilterSpec::default_particles(filter) as u32;
        let systematic = "systematic".to_owned();
        let even = "evenly spaced: the least noise of the common schemes";
        let sparing = "resampling adds noise, so only when the weights need it";
        ParticleSettings {
            particles: settle.one("particles", &self.particles, default, enough),
            resampling: settle.one("resampling", &self.resampling, systematic, even),
            resample_when: settle.one("resample_when", &self.resample_when, ResampleWhen::Below, sparing),
            threshold: settle.one("threshold", &self.threshold, 0.5, "half of the particles still count"),
            roughening: settle.one("roughening", &self.roughening, 0.0, "process noise spreads the copies"),
            normals: settle.one("normals", &self.normals, Normals::F64, "full resolution"),
            generator: settle.one(
                "generator",
                &self.generator,
                Generator::Philox,
                "the reproducible standard",
            ),
        }
    }
}

/// Settles the keys `of` a filter, and no others.
struct Used<'a> {
    of: &'static [&'static str],
    effective: &'a mut Effective,
}

impl Used<'_> {
    fn one<T: Clone + Serialize>(&mut self, key: &str, given: &Option<T>, default: T, why: &str) -> T {
        if self.of.contains(&key) {
            self.effective.settle(&["filter", key], given, default, why)
        } else {
            default
        }
    }
}

/// What is believed of a target before it is measured, settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartSettings {
    /// Standard deviation of each component of the velocity, m/s.
    pub speed_sd_mps: f64,
    /// Standard deviation of each component of the acceleration, m/s².
    pub acceleration_sd_mps2: f64,
    /// Standard deviation of the turn rate, rad/s.
    pub turn_rate_sd_rad_s: f64,
    /// Standard deviation of length and width, m.
    pub size_sd_m: f64,
}

impl StartConfig {
    /// The settings, with their reasons in `effective`.
    pub fn settle(&self, effective: &mut Effective) -> StartSettings {
        let at = |key| ["start", key];
        StartSettings {
            speed_sd_mps: effective.settle(
                &at("speed_sd_mps"),
                &self.speed_sd_mps,
                30.0,
                "road traffic, ships and drones",
            ),
            acceleration_sd_mps2: effective.settle(
                &at("acceleration_sd_mps2"),
                &self.acceleration_sd_mps2,
                2.0,
                "a fifth of gravity: vehicles and airliners seldom exceed it",
            ),
            turn_rate_sd_rad_s: effective.settle(
                &at("turn_rate_sd_rad_s"),
                &self.turn_rate_sd_rad_s,
                0.05,
                "aviation's standard turn, 3 degrees per second",
            ),
            size_sd_m: effective.settle(
                &at("size_sd_m"),
                &self.size_sd_m,
                40.0,
                "airliners and ships; a car is smaller",
            ),
        }
    }
}

/// When a track ends and what is reported of it, settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LifeSettings {
    /// A longer silence ends a track, s.
    pub max_gap_s: f64,
    /// The point that stands for the belief.
    pub estimate: Estimate,
}

impl LifeConfig {
    /// The settings, with their reasons in `effective`.
    pub fn settle(&self, effective: &mut Effective) -> LifeSettings {
        let why = "after five minutes a prediction says nothing";
        LifeSettings {
            max_gap_s: effective.settle(&["track", "max_gap_s"], &self.max_gap_s, 300.0, why),
            estimate: effective.settle(
                &["track", "estimate"],
                &self.estimate,
                Estimate::Mean,
                "the least mean square error",
            ),
        }
    }
}
