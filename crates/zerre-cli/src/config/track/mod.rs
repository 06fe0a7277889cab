//! The configuration of `zerre track`. Every key may be absent: [`Effective`](super::Effective) says what then holds,
//! and why.

mod check;
mod extended;
mod settings;

use super::source::Source;
use crate::diagnostic::Diagnostic;
use clap::ValueEnum;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use zerre::belief::MAX_PARTICLES;

use check::{LEAST_SD, LEAST_STAY, MOST_SD};
pub use extended::{Count, ExtendedConfig, ExtendedSettings, Turning};
pub use settings::{InputSettings, LifeSettings, ParticleSettings, StartSettings};

/// What `zerre track` can be told. Units are part of the key; a noise that is absent is learnt from the recording.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(title = "zerre track")]
pub struct TrackConfig {
    /// The filter: a name of `zerre catalog filters`, or a table with settings.
    #[serde(deserialize_with = "name_or_table")]
    #[schemars(schema_with = "name_or_table_schema::<FilterConfig>")]
    pub filter: FilterConfig,
    /// How targets move: a name of `zerre catalog motions`, or a table with parameters.
    #[serde(deserialize_with = "name_or_table")]
    #[schemars(schema_with = "name_or_table_schema::<MotionConfig>")]
    pub motion: MotionConfig,
    /// How the recording is read.
    pub input: InputConfig,
    /// What is believed of a target before it is measured.
    pub start: StartConfig,
    /// What the sensors are: by the name in the column `sensor`; `default` holds for all others.
    pub sensor: BTreeMap<String, SensorConfig>,
    /// When a track ends, and what is reported of it.
    #[serde(rename = "track")]
    pub life: LifeConfig,
    /// Targets that give many points a scan.
    pub extended: Option<ExtendedConfig>,
}

/// The filter and its settings; one that the filter does not use is an error.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterConfig {
    /// A name of `zerre catalog filters`, or `auto`.
    pub name: Option<String>,
    /// Number of particles; of hypotheses with rb-mmpf.
    #[schemars(range(min = 1, max = MAX_PARTICLES))]
    pub particles: Option<u32>,
    /// A name of `zerre catalog resamplers`.
    pub resampling: Option<String>,
    /// When particles are resampled.
    pub resample_when: Option<ResampleWhen>,
    /// Share of the particles below which the effective number has to fall, for `resample_when = "below"`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub threshold: Option<f64>,
    /// Factor of the jitter after resampling (Gordon, Salmond and Smith 1993); 0 is none.
    #[schemars(range(min = 0.0))]
    pub roughening: Option<f64>,
    /// Resolution of the process-noise normals; states and weights are 64-bit always.
    pub normals: Option<Normals>,
    /// Generator of random numbers.
    pub generator: Option<Generator>,
}

/// The motion model and the parameters of those that have them; an absent noise is learnt from the recording.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionConfig {
    /// A name of `zerre catalog motions`, or `auto`.
    pub model: Option<String>,
    /// Standard deviation of the velocity averaged over a second, m/s (random-walk).
    #[schemars(range(min = 0.0, max = MOST_SD))]
    pub speed_sd_mps: Option<f64>,
    /// Standard deviation of the acceleration averaged over a second, m/s².
    #[schemars(range(min = 0.0, max = MOST_SD))]
    pub acceleration_sd_mps2: Option<f64>,
    /// Standard deviation of the jerk averaged over a second, m/s³ (constant-acceleration).
    #[schemars(range(min = 0.0, max = MOST_SD))]
    pub jerk_sd_mps3: Option<f64>,
    /// A known acceleration across the velocity, to the left, m/s² (manoeuvre-turn).
    pub lateral_acceleration_mps2: Option<f64>,
    /// A known turn rate, counter-clockwise, rad/s.
    pub turn_rate_rad_s: Option<f64>,
    /// Standard deviation of the change of the turn rate, rad/s².
    #[schemars(range(min = 0.0, max = MOST_SD))]
    pub turn_acceleration_sd_rad_s2: Option<f64>,
    /// Standard deviation of the rates at which length and width change, m/s (constant-velocity-box).
    #[schemars(range(min = 0.0, max = MOST_SD))]
    pub size_sd_mps: Option<f64>,
    /// Standard deviation of the rate at which the orientation changes, rad/s (constant-velocity-box).
    #[schemars(range(min = 0.0, max = MOST_SD))]
    pub orientation_sd_rad_s: Option<f64>,
    /// Time over which an acceleration persists, s.
    #[schemars(range(min = 0.0))]
    pub tau_s: Option<f64>,
    /// Largest acceleration, m/s².
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub a_max_mps2: Option<f64>,
    /// Probability of the largest acceleration, either way.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub p_max: Option<f64>,
    /// Probability of no acceleration.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub p_0: Option<f64>,
    /// The modes of filters for manoeuvring targets; what is absent is learnt from the recording.
    pub modes: ModesConfig,
}

/// How a target manoeuvres. The quiet mode is the motion itself, with its noise; each mode lasts as long on average.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ModesConfig {
    /// Mean time in a mode, s.
    #[schemars(range(min = LEAST_STAY, max = MOST_SD))]
    pub stay_s: Option<f64>,
    /// Rate of the turning modes, to the left and to the right, rad/s; 0 for none (constant-velocity in the plane).
    #[schemars(range(min = 0.0, max = MOST_SD))]
    pub turn_rate_rad_s: Option<f64>,
    /// Noise of the manoeuvring mode, in standard deviations of the quiet one; 1 for no such mode.
    #[schemars(range(min = 1.0, max = MOST_SD))]
    pub manoeuvre_factor: Option<f64>,
}

impl FilterConfig {
    /// The keys that hold a setting, as the file writes them.
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            ("particles", self.particles.is_some()),
            ("resampling", self.resampling.is_some()),
            ("resample_when", self.resample_when.is_some()),
            ("threshold", self.threshold.is_some()),
            ("roughening", self.roughening.is_some()),
            ("normals", self.normals.is_some()),
            ("generator", self.generator.is_some()),
        ];
        all.into_iter().filter(|(_, given)| *given).map(|(key, _)| key).collect()
    }

    /// The keys that a filter of this name uses.
    pub fn used_by(filter: &str) -> &'static [&'static str] {
        match filter {
            "particle" | "sir" => &[
                "particles",
                "resampling",
                "resample_when",
                "threshold",
                "roughening",
                "normals",
                "generator",
            ],
            "sis" => &["particles", "normals", "generator"],
            "mmpf" | "imm-pf" => &["particles", "resampling", "normals", "generator"],
            "rb-mmpf" => &["particles"],
            _ => &[],
        }
    }
}

impl ModesConfig {
    /// The keys that hold a value, as the file writes them.
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            ("stay_s", self.stay_s),
            ("turn_rate_rad_s", self.turn_rate_rad_s),
            ("manoeuvre_factor", self.manoeuvre_factor),
        ];
        all.into_iter().filter(|(_, value)| value.is_some()).map(|(key, _)| key).collect()
    }
}

/// How the recording is read.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InputConfig {
    /// Format of the recording.
    pub format: Option<Format>,
    /// Share of rejected rows above which the recording is refused.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_rejected: Option<f64>,
    /// Where the local plane touches the earth.
    pub origin: Option<Geodetic>,
    /// Header of a column in the recording -> name with unit (`"Slant Range NM" = "range_nmi"`).
    pub columns: BTreeMap<String, String>,
}

/// A point on the WGS 84 ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Geodetic {
    /// Latitude, degrees north.
    #[schemars(range(min = -90.0, max = 90.0))]
    pub lat_deg: f64,
    /// Longitude, degrees east.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub lon_deg: f64,
    /// Height above the ellipsoid, m.
    #[serde(default)]
    pub alt_m: f64,
}

/// What is believed of a target before it is measured: standard deviations around zero.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StartConfig {
    /// Of each component of the velocity, m/s.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub speed_sd_mps: Option<f64>,
    /// Of each component of the acceleration, m/s².
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub acceleration_sd_mps2: Option<f64>,
    /// Of the turn rate, rad/s.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub turn_rate_sd_rad_s: Option<f64>,
    /// Of length and width, m (constant-velocity-box).
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub size_sd_m: Option<f64>,
    /// Where targets are believed to appear: x, y or x, y, z, m; for bearings and ranges alone.
    #[schemars(length(min = 2, max = 3))]
    pub position_m: Option<Vec<f64>>,
    /// Standard deviation of each coordinate of it, m.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub position_sd_m: Option<f64>,
}

/// One sensor: where it stands and how far it errs. An absent standard deviation is learnt from the recording.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorConfig {
    /// Where it stands in the local plane: x, y or x, y, z, m.
    #[schemars(length(min = 2, max = 3))]
    pub position_m: Option<Vec<f64>>,
    /// Where it stands on the earth; instead of `position_m`.
    pub position: Option<Geodetic>,
    /// Of each coordinate of a measured position, m.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub position_sd_m: Option<f64>,
    /// Of a range, m.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub range_sd_m: Option<f64>,
    /// Of a bearing or an azimuth, rad.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub bearing_sd_rad: Option<f64>,
    /// The same in degrees; instead of `bearing_sd_rad`.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub bearing_sd_deg: Option<f64>,
    /// Of an elevation, rad.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub elevation_sd_rad: Option<f64>,
    /// The same in degrees; instead of `elevation_sd_rad`.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub elevation_sd_deg: Option<f64>,
    /// Of a range rate, m/s.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub range_rate_sd_mps: Option<f64>,
    /// Of a length and a width, m.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub size_sd_m: Option<f64>,
    /// Of an orientation or a heading, rad.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub orientation_sd_rad: Option<f64>,
    /// The same in degrees; instead of `orientation_sd_rad`.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub orientation_sd_deg: Option<f64>,
    /// Probability with which a true measurement lies inside the gate; 0 or absent: no gate.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gate: Option<f64>,
    /// A law with heavier tails than the normal.
    pub robust: Option<Robust>,
}

impl MotionConfig {
    /// The keys that hold a parameter, as the file writes them.
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            ("speed_sd_mps", self.speed_sd_mps),
            ("acceleration_sd_mps2", self.acceleration_sd_mps2),
            ("jerk_sd_mps3", self.jerk_sd_mps3),
            ("lateral_acceleration_mps2", self.lateral_acceleration_mps2),
            ("turn_rate_rad_s", self.turn_rate_rad_s),
            ("turn_acceleration_sd_rad_s2", self.turn_acceleration_sd_rad_s2),
            ("size_sd_mps", self.size_sd_mps),
            ("orientation_sd_rad_s", self.orientation_sd_rad_s),
            ("tau_s", self.tau_s),
            ("a_max_mps2", self.a_max_mps2),
            ("p_max", self.p_max),
            ("p_0", self.p_0),
        ];
        all.into_iter().filter(|(_, value)| value.is_some()).map(|(key, _)| key).collect()
    }

    /// The keys that a motion of this name uses; none for names that are no motion of targets.
    pub fn used_by(model: &str) -> &'static [&'static str] {
        match model {
            "random-walk" => &["speed_sd_mps"],
            "constant-velocity" | "wiener-acceleration" => &["acceleration_sd_mps2"],
            "constant-velocity-box" => &["acceleration_sd_mps2", "size_sd_mps", "orientation_sd_rad_s"],
            "constant-acceleration" => &["jerk_sd_mps3"],
            "singer" => &["acceleration_sd_mps2", "tau_s", "a_max_mps2", "p_max", "p_0"],
            "coordinated-turn" => &["acceleration_sd_mps2", "turn_rate_rad_s"],
            "manoeuvre-turn" => &["acceleration_sd_mps2", "lateral_acceleration_mps2"],
            "wiener-turn" => &["acceleration_sd_mps2", "turn_acceleration_sd_rad_s2"],
            "markov-turn" => &["acceleration_sd_mps2", "tau_s"],
            _ => &[],
        }
    }
}

impl SensorConfig {
    /// Standard deviation of bearings, rad, from whichever key gives it.
    pub fn bearing_sd(&self) -> Option<f64> {
        self.bearing_sd_rad.or(self.bearing_sd_deg.map(f64::to_radians))
    }

    /// Standard deviation of orientations, rad, from whichever key gives it.
    pub fn orientation_sd(&self) -> Option<f64> {
        self.orientation_sd_rad.or(self.orientation_sd_deg.map(f64::to_radians))
    }

    /// Standard deviation of elevations, rad, from whichever key gives it.
    pub fn elevation_sd(&self) -> Option<f64> {
        self.elevation_sd_rad.or(self.elevation_sd_deg.map(f64::to_radians))
    }
}

/// A law of measurement errors with heavier tails than the normal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Robust {
    /// Student's t.
    StudentT {
        /// Degrees of freedom.
        #[schemars(range(min = 0.0))]
        dof: f64,
    },
    /// A share of the measurements errs more.
    Outliers {
        /// That share.
        #[schemars(range(min = 0.0, max = 1.0))]
        share: f64,
        /// Its standard deviation, in standard deviations of the others.
        #[schemars(range(min = 1.0, max = MOST_SD))]
        scale: f64,
    },
}

/// When a track ends, and what is reported of it.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LifeConfig {
    /// A longer silence of an identity ends its track and starts another, s.
    #[schemars(range(min = 0.0))]
    pub max_gap_s: Option<f64>,
    /// So many measurements in a row that the gate refuses start a track anew from the last of them. Absent: as many as
    /// right models would see refused once in 1e9 times at that gate, at least 3.
    #[schemars(range(min = 1))]
    pub restart_after_gated: Option<u32>,
    /// The point that stands for the belief.
    pub estimate: Option<Estimate>,
}

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$note:meta])* $variant:ident),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
        #[serde(rename_all = "kebab-case")]
        pub enum $name { $($(#[$note])* $variant),+ }
    };
}

words! {
    /// Formats of recordings.
    Format {
        /// Told from the file.
        Auto,
        /// Table with a header.
        Csv,
        /// OpenSky state vectors.
        Opensky,
        /// Ship positions.
        Ais,
        /// Radar plots around Barcelona.
        Lebl,
        /// Fixes of drones.
        Uav,
        /// Radar points of key frames.
        Nuscenes,
    }
}
words! {
    /// When particles are resampled.
    ResampleWhen {
        /// When the effective number falls below the threshold.
        Below,
        /// After every measurement.
        Always,
        /// Never.
        Never,
    }
}
words! {
    /// Resolution of the process-noise normals.
    Normals {
        /// 32-bit, faster.
        F32,
        /// 64-bit.
        F64,
    }
}
words! {
    /// Generators of random numbers.
    Generator {
        /// Philox4x32-10.
        Philox,
        /// Fewer rounds.
        Fast,
    }
}
words! {
    /// Points that stand for a belief.
    Estimate {
        /// The mean.
        Mean,
        /// The particle of the largest weight.
        MaxWeight,
        /// The mean of the particles around the heaviest one.
        RobustMean,
    }
}

impl From<String> for FilterConfig {
    fn from(name: String) -> FilterConfig {
        FilterConfig { name: Some(name), ..FilterConfig::default() }
    }
}

impl From<String> for MotionConfig {
    fn from(model: String) -> MotionConfig {
        MotionConfig { model: Some(model), ..MotionConfig::default() }
    }
}

/// Reads `filter = "particle"` and `[filter]` into the same type, keeping the places of errors inside the table,
/// which an untagged enum would lose.
fn name_or_table<'de, D: Deserializer<'de>, T: Deserialize<'de> + From<String>>(
    input: D,
) -> Result<T, D::Error> {
    struct Either<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de> + From<String>> Visitor<'de> for Either<T> {
        type Value = T;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a name in quotes or a table of settings")
        }
        fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<T, E> {
            if name.is_empty() { Err(E::custom("the name is empty")) } else { Ok(T::from(name.to_owned())) }
        }
        fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<T, A::Error> {
            T::deserialize(MapAccessDeserializer::new(table))
        }
    }
    input.deserialize_any(Either(PhantomData))
}

fn name_or_table_schema<T: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    json_schema!({ "anyOf": [{ "type": "string", "minLength": 1 }, generator.subschema_for::<T>()] })
}

impl TrackConfig {
    /// Reads and checks a configuration.
    ///
    /// # Errors
    /// Whatever is wrong with it, with its place.
    pub fn from_source(source: &Source) -> Result<TrackConfig, Diagnostic> {
        let config: TrackConfig = source.parse()?;
        config.check().map_err(|problem| source.diagnose(&problem))?;
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<TrackConfig, String> {
        TrackConfig::from_source(&Source::new("f.toml", text)).map_err(|error| error.to_string())
    }

    #[test]
    fn names_and_tables_are_both_taken() {
        let short = read("filter = \"particle\"\nmotion = \"singer\"").unwrap();
        let long = read("[filter]\nname = \"particle\"\n[motion]\nmodel = \"singer\"").unwrap();
        assert_eq!(short, long);
        assert_eq!(read("").unwrap(), TrackConfig::default());
    }

    #[test]
    fn every_complaint_points_at_its_value() {
        let cases = [
            ("filter = 3", "f.toml:1:10", "a name in quotes or a table"),
            ("filter = \"\"", "f.toml:1:10", "the name is empty"),
            ("[filter]\nparticles = 0", "f.toml:2:13", "0 is out of range; from 1 to 67108864"),
            ("[filter]\nparticles = 1000000000", "f.toml:2:13", "1000000000 is out of range; from 1 to"),
            ("[filter]\nparticles = 1e9", "f.toml:2:13", "expected a whole number"),
            ("[filter]\nparticles = -5", "f.toml:2:13", "integer `-5`, expected a whole number"),
            ("[filter]\nresample_when = \"belwo\"", "f.toml:2:17", "did you mean `below`?"),
            ("[filter]\nthreshold = 1.5", "f.toml:2:13", "1.5 is out of range"),
            ("[filter]\nparticels = 5", "f.toml:2:1", "did you mean `particles`?"),
            ("[motion]\nacceleration_sd_mps2 = -1", "f.toml:2:24", "-1.0 is out of range"),
            ("[motion]\nacceleration_sd_mps2 = 1e300", "f.toml:2:24", "1e300 is out of range"),
            ("[motion]\nturn_rate_rad_s = -1e300", "f.toml:2:19", "1e9 either way"),
            ("[motion]\ntau_s = 0", "f.toml:2:9", "above zero"),
            ("[motion.modes]\nstay_s = 0", "f.toml:2:10", "0.0 is out of range; seconds from"),
            ("[motion.modes]\nturn_rate_rad_s = -1", "f.toml:2:19", "zero or a number above it"),
            ("[motion.modes]\nmanoeuvre_factor = 0.5", "f.toml:2:20", "1 to 1e9 is needed"),
            ("[motion.modes]\nstay = 5", "f.toml:2:1", "did you mean `stay_s`?"),
            ("[input]\nmax_rejected = nan", "f.toml:2:16", "not a finite number"),
            ("[input]\norigin = { lat_deg = 91, lon_deg = 0 }", "f.toml:2:22", "-90 to 90"),
            ("[input]\norigin = { lat_deg = 1 }", "f.toml:2:10", "lon_deg"),
            (
                "[sensor.north]\n\nrange_sd_m = -3",
                "f.toml:3:14",
                "sensor.north.range_sd_m: -3.0 is out of range",
            ),
            (
                "[sensor.a]\nrange_sd_m = 1e300",
                "f.toml:2:14",
                "1e300 is out of range; a number above zero, from 1e-9",
            ),
            ("[sensor.a]\nbearing_sd_deg = 1e-300", "f.toml:2:18", "1e-300 is out of range"),
            ("[sensor.a]\nposition_sd_m = 0", "f.toml:2:17", "above zero"),
            ("[sensor.a]\nposition_m = [1, 1e300]", "f.toml:2:14", "1e12 either way"),
            ("[start]\nspeed_sd_mps = 1e300", "f.toml:2:16", "to 1e9"),
            ("[sensor.a]\nbearing_sd_deg = 1\nbearing_sd_rad = 1", "f.toml:2:18", "keep one of the two"),
            ("[sensor.a]\nposition_m = [1]", "f.toml:2:14", "the list holds 1"),
            ("[sensor.a]\nposition_m = [1, inf]", "f.toml:2:14", "inf is not a finite"),
            ("[sensor.a]\ngate = 1", "f.toml:2:8", "below 1"),
            ("[sensor.a]\nrobust = { kind = \"student-t\", dof = 0 }", "f.toml:2:38", "above zero"),
            ("[sensor.a]\nrobust = { kind = \"student\", dof = 4 }", "f.toml:2:", "student-t"),
            (
                "[sensor.a]\nrobust = { kind = \"outliers\", share = 0.1, scale = 0.5 }",
                "f.toml:2:52",
                "1 to 1e9 is needed",
            ),
            ("[track]\nmax_gap_s = \"long\"", "f.toml:2:13", "expected a number"),
            ("[track]\nrestart_after_gated = 0", "f.toml:2:23", "at least 1 is needed"),
            ("[track]\nmax_gap_s = 1\nmax_gap_s = 2", "f.toml:3:1", "duplicate"),
            ("[extended]\nellipses = \"three\"", "f.toml:2:12", "\"auto\" or a whole number of at least 1"),
            ("[extended]\nellipses = 17", "f.toml:2:12", "17 is out of range; from 1 to 16 ellipses"),
            ("[extended]\nellipses = -1", "f.toml:2:12", "from 1 to 16 ellipses"),
            ("[extended]\nwindow = 0", "f.toml:2:10", "from 1 to 10000 scans can be had"),
            ("[extended]\nkeep = 1.5", "f.toml:2:8", "a number from 0 to 1"),
            ("[extended]\nrotation = \"spin\"", "f.toml:2:12", "velocity"),
            ("[extended]\nclutter_rate = 2", "f.toml:2:16", "means nothing without `clutter_area_m2`"),
            ("[extended]\nwindows = 5", "f.toml:2:1", "did you mean `window`?"),
            ("[trak]", "f.toml:1:2", "did you mean `track`?"),
            ("[track", "f.toml:1:", "error"),
        ];
        for (text, place, says) in cases {
            let shown = read(text).unwrap_err();
            assert!(shown.contains(place) && shown.contains(says), "{text}\n=> {shown}");
        }
    }

    #[test]
    fn degrees_become_radians() {
        let config = read("[sensor.default]\nbearing_sd_deg = 180\nelevation_sd_rad = 0.5").unwrap();
        let sensor = &config.sensor["default"];
        assert_eq!((sensor.bearing_sd(), sensor.elevation_sd()), (Some(std::f64::consts::PI), Some(0.5)));
    }

    proptest::proptest! {
        /// A damaged configuration is read or refused in words, whatever the damage.
        #[test]
        fn damage_is_never_a_panic(
            start in 0usize..3600,
            length in 0usize..40,
            patch in "[\\[\\]{}=\"'.,#\\-\\neinfa0-9é\\x00-\\x1f]{0,12}",
        ) {
            // Every setting switched on; prose stays a comment.
            let whole = crate::config::starter("track").unwrap().replace("\n#", "\n").replace("\n ", "\n# ");
            proptest::prop_assert!(read(&whole).is_ok());
            let mut text: Vec<char> = whole.chars().collect();
            let start = start.min(text.len());
            let end = (start + length).min(text.len());
            text.splice(start..end, patch.chars());
            let text = String::from_iter(text);
            if let Err(shown) = read(&text) {
                proptest::prop_assert!(shown.starts_with("error: ") && shown.len() > "error: ".len());
            }
        }
    }
}
