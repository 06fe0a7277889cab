//! The section `[extended]`: targets that give many points a scan.

use super::check::{LEAST_SD, MOST_SD, between, deviation, positive, probability};
use crate::config::{Effective, Problem};
use clap::ValueEnum;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use zerre::extended::MAX_ELLIPSES;
use zerre::track::{ExtendedFilter, ExtendedSpec};

/// Targets that give many points a scan: their shape is learnt while they are followed. The section, if only its name,
/// makes rows of one `id` and one time (or one `scan`) the points of one scan.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExtendedConfig {
    /// A name of `zerre catalog extended-filters`.
    pub filter: Option<String>,
    /// How the body turns (window-vb).
    pub rotation: Option<Turning>,
    /// Number of ellipses of the shape (window-vb), or `auto`: as many as the points call for.
    pub ellipses: Option<Count>,
    /// Scans that the first shape is found from.
    #[schemars(range(min = 1, max = MOST_SCANS))]
    pub first_scans: Option<u32>,
    /// Scans in the window (window-vb).
    #[schemars(range(min = 1, max = MOST_SCANS))]
    pub window: Option<u32>,
    /// Turns between path and shape after each scan (window-vb).
    #[schemars(range(min = 1, max = MOST_SCANS))]
    pub sweeps: Option<u32>,
    /// Share of what is known of the shape that is kept from scan to scan: 1 for one that stays.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub keep: Option<f64>,
    /// Least standard deviation of points along an axis of an ellipse, m.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub least_sd_m: Option<f64>,
    /// Area over which points of no target are uniform, m² (window-vb); absent: there are none.
    #[schemars(range(min = 0.0))]
    pub clutter_area_m2: Option<f64>,
    /// Points of no target in a scan; absent: learnt.
    #[schemars(range(min = LEAST_SD, max = MOST_SD))]
    pub clutter_rate: Option<f64>,
}

/// More scans in a window, or sweeps, than anybody waits for.
const MOST_SCANS: u32 = 10_000;

/// How a body turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Turning {
    /// As the points are more likely.
    Auto,
    /// It keeps its direction in the plane.
    None,
    /// It points along its velocity.
    Velocity,
}

/// A number, or as many as it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    /// As many as it takes.
    Auto,
    /// So many.
    Fixed(u32),
}

impl Serialize for Count {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Count::Auto => to.serialize_str("auto"),
            Count::Fixed(number) => to.serialize_u32(*number),
        }
    }
}

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(input: D) -> Result<Count, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = Count;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"auto\" or a whole number of at least 1")
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Count, E> {
                if text == "auto" {
                    Ok(Count::Auto)
                } else {
                    Err(E::invalid_value(serde::de::Unexpected::Str(text), &self))
                }
            }
            fn visit_i64<E: serde::de::Error>(self, number: i64) -> Result<Count, E> {
                // What is out of range is for the check to say, in its words.
                Ok(Count::Fixed(u32::try_from(number.max(0)).unwrap_or(u32::MAX)))
            }
        }
        input.deserialize_any(Either)
    }
}

impl JsonSchema for Count {
    fn schema_name() -> Cow<'static, str> {
        "Count".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "string", "enum": ["auto"] },
            { "type": "integer", "minimum": 1, "maximum": MAX_ELLIPSES },
        ] })
    }
}

/// The settings of `[extended]`, settled.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtendedSettings {
    /// A name of the catalogue's extended filters, not yet checked.
    pub filter: String,
    /// How the body turns.
    pub rotation: Turning,
    /// Number of ellipses.
    pub ellipses: Count,
    /// Scans that the first shape is found from.
    pub first_scans: u32,
    /// Scans in the window.
    pub window: u32,
    /// Turns after each scan.
    pub sweeps: u32,
    /// Share of the shape that is kept from scan to scan.
    pub keep: f64,
    /// Least standard deviation of an ellipse, m.
    pub least_sd_m: f64,
    /// Area of the clutter, m², and its rate where that is known.
    pub clutter: Option<(f64, Option<f64>)>,
}

impl ExtendedConfig {
    /// The filter that is taken where none is named.
    pub const FILTER: &str = "window-vb";

    /// The keys that hold a setting, as the file writes them.
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            ("rotation", self.rotation.is_some()),
            ("ellipses", self.ellipses.is_some()),
            ("first_scans", self.first_scans.is_some()),
            ("window", self.window.is_some()),
            ("sweeps", self.sweeps.is_some()),
            ("keep", self.keep.is_some()),
            ("least_sd_m", self.least_sd_m.is_some()),
            ("clutter_area_m2", self.clutter_area_m2.is_some()),
            ("clutter_rate", self.clutter_rate.is_some()),
        ];
        all.into_iter().filter(|(_, given)| *given).map(|(key, _)| key).collect()
    }

    /// The keys that a filter of this name uses.
    pub fn used_by(filter: &str) -> &'static [&'static str] {
        match filter {
            "window-vb" => &[
                "rotation",
                "ellipses",
                "first_scans",
                "window",
                "sweeps",
                "keep",
                "least_sd_m",
                "clutter_area_m2",
                "clutter_rate",
            ],
            _ => &["first_scans", "keep", "least_sd_m"],
        }
    }

    pub(super) fn check(&self) -> Result<(), Problem> {
        let at = |key| ["extended", key];
        let most = MAX_ELLIPSES as u32;
        if let Some(Count::Fixed(number)) = self.ellipses {
            between(&at("ellipses"), Some(number), most, "ellipses")?;
        }
        between(&at("first_scans"), self.first_scans, MOST_SCANS, "scans")?;
        between(&at("window"), self.window, MOST_SCANS, "scans")?;
        between(&at("sweeps"), self.sweeps, MOST_SCANS, "sweeps")?;
        probability(&at("keep"), self.keep)?;
        deviation(&at("least_sd_m"), self.least_sd_m)?;
        positive(&at("clutter_area_m2"), self.clutter_area_m2)?;
        deviation(&at("clutter_rate"), self.clutter_rate)?;
        if self.clutter_rate.is_some() && self.clutter_area_m2.is_none() {
            let path = at("clutter_rate").map(str::to_owned).to_vec();
            return Err(Problem { path, what: "it means nothing without `clutter_area_m2`".to_owned() });
        }
        Ok(())
    }

    /// The settings that the filter uses, with their reasons in `effective`; the others have their defaults.
    pub fn settle(&self, effective: &mut Effective) -> ExtendedSettings {
        let why = "any shape, told apart by parts: it explains points better than a single ellipse";
        let filter =
            effective.settle(&["extended", "filter"], &self.filter, ExtendedConfig::FILTER.to_owned(), why);
        let spec = ExtendedSpec::new(ExtendedFilter::WindowVb, 1.0);
        let mut settle = Used { of: ExtendedConfig::used_by(&filter), effective };
        let few = "enough for three ellipses at ten points a scan, few enough for a target that turns";
        ExtendedSettings {
            rotation: settle.one("rotation", &self.rotation, Turning::Auto, "as the points are more likely"),
            ellipses: settle.one("ellipses", &self.ellipses, Count::Auto, "as many as the points call for"),
            first_scans: settle.one("first_scans", &self.first_scans, spec.first_scans as u32, few),
            window: settle.one("window", &self.window, spec.window as u32, few),
            sweeps: settle.one("sweeps", &self.sweeps, spec.sweeps as u32, "more change little"),
            keep: settle.one("keep", &self.keep, spec.keep, "a body does not change its shape"),
            least_sd_m: settle.one(
                "least_sd_m",
                &self.least_sd_m,
                spec.least_sd_m,
                "thinner than what is tracked",
            ),
            clutter: {
                let area = settle.given("clutter_area_m2", &self.clutter_area_m2);
                let rate = settle.given("clutter_rate", &self.clutter_rate);
                area.map(|area| (area, rate))
            },
            filter,
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
            self.effective.settle(&["extended", key], given, default, why)
        } else {
            default
        }
    }

    fn given(&mut self, key: &str, given: &Option<f64>) -> Option<f64> {
        self.effective.settle_given(&["extended", key], given)
    }
}
