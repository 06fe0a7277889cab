//! What a study is asked to compare: a file of worlds and filters in which any number may be a list.

use super::comparison::{Comparison, Entry};
use super::contender::{CONTENDERS, Contender, ContenderInfo, dimensions};
use super::world::{Place, WORLDS};
use crate::scenario::Invalid;
use schemars::JsonSchema;
use serde::de::{IntoDeserializer, SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::marker::PhantomData;
use zerre::belief::MAX_PARTICLES;
use zerre::resample::{Resampling, Trigger};

/// The file.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Runs of each cell. Run number r draws the same truth and measurements for every filter.
    #[serde(default = "default_runs")]
    pub runs: u32,
    /// What is scored; the first one ranks. Scores of every step cost time: `crps` sorts all particles.
    #[serde(default = "default_metrics")]
    pub metrics: Vec<Metric>,
    /// Worlds; each list in one is an axis of the grid.
    pub world: Vec<WorldAxes>,
    /// Filters; each list in one is an axis of the grid.
    pub filter: Vec<FilterAxes>,
}

fn default_runs() -> u32 {
    200
}

fn default_metrics() -> Vec<Metric> {
    vec![Metric::Rmse, Metric::Coverage90]
}

/// What is scored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// Root mean square error of the position over the steps of a run.
    Rmse,
    /// Continuous ranked probability score of each component, averaged.
    Crps,
    /// Share of truths inside the central 90 % intervals.
    Coverage90,
    /// Log-evidence of a whole run.
    Evidence,
}

/// A world with its noises.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldAxes {
    /// A name of `zerre catalog worlds`.
    pub name: String,
    /// Variance of the measurement noise [default: the world's].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measurement_variance: Option<Many<f64>>,
    /// Variance of the process noise of a second (constant velocity: its density) [default: the world's].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process_variance: Option<Many<f64>>,
    /// Number of measurements, one a second [default: the world's].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<Many<u32>>,
}

/// A filter with its settings.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FilterAxes {
    /// A name of `zerre catalog contenders`.
    pub name: String,
    /// Number of particles (members, nodes, parts) [default: 1000].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub particles: Option<Many<u32>>,
    /// Instead of particles: as many as so many likelihood evaluations a step buy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evaluations: Option<Many<u32>>,
    /// How to resample [default: systematic].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resampling: Option<Many<Scheme>>,
    /// When to resample: below this share of the number of particles, or "always", or "never" [default: 0.5].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trigger: Option<Many<When>>,
}

/// How to resample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Independent draws.
    Multinomial,
    /// Whole copies for sure, the rest drawn.
    Residual,
    /// One draw in each of n equal strata.
    Stratified,
    /// The same place in each of n equal strata.
    Systematic,
}

impl From<Scheme> for Resampling {
    fn from(scheme: Scheme) -> Resampling {
        match scheme {
            Scheme::Multinomial => Resampling::Multinomial,
            Scheme::Residual => Resampling::Residual,
            Scheme::Stratified => Resampling::Stratified,
            Scheme::Systematic => Resampling::Systematic,
        }
    }
}

/// When to resample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum When {
    /// Below this share of the number of particles.
    Below(f64),
    /// By a word.
    Word(Word),
}

/// When to resample, by a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Word {
    /// After every measurement.
    Always,
    /// Not at all.
    Never,
}

impl From<When> for Trigger {
    fn from(when: When) -> Trigger {
        match when {
            When::Below(share) => Trigger::Below(share),
            When::Word(Word::Always) => Trigger::Always,
            When::Word(Word::Never) => Trigger::Never,
        }
    }
}

/// One value or a list of them.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Many<T> {
    /// One.
    One(T),
    /// An axis of the grid.
    List(Vec<T>),
}

impl<T> Many<T> {
    /// All of them.
    pub fn all(&self) -> &[T] {
        match self {
            Many::One(value) => std::slice::from_ref(value),
            Many::List(values) => values,
        }
    }
}

// By hand, because derived readers of untagged values say of a bad one that nothing fits, not what is wrong
// with it.
impl<'de, T: Deserialize<'de>> Deserialize<'de> for Many<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Either<T> {
            type Value = Many<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a value or a list of values")
            }

            fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Many<T>, E> {
                T::deserialize(value.into_deserializer()).map(Many::One)
            }

            fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Many<T>, E> {
                T::deserialize(value.into_deserializer()).map(Many::One)
            }

            fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Many<T>, E> {
                T::deserialize(value.into_deserializer()).map(Many::One)
            }

            fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<Many<T>, E> {
                T::deserialize(value.into_deserializer()).map(Many::One)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Many<T>, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(Many::List)
            }
        }
        deserializer.deserialize_any(Either(PhantomData))
    }
}

impl<'de> Deserialize<'de> for When {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = When;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, \"always\" or \"never\"")
            }

            fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<When, E> {
                Ok(When::Below(value as f64))
            }

            fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<When, E> {
                Ok(When::Below(value as f64))
            }

            fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<When, E> {
                Ok(When::Below(value))
            }

            fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<When, E> {
                Word::deserialize(value.into_deserializer()).map(When::Word)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// Most runs of a cell: all of them are held until the end.
const MOST_RUNS: u32 = 1_000_000;

fn invalid(path: &[&str], what: impl Into<String>) -> Invalid {
    Invalid { path: path.iter().map(|key| (*key).to_owned()).collect(), what: what.into() }
}

fn unknown(what: &str, name: &str, known: impl Iterator<Item = &'static str>) -> String {
    format!("there is no {what} `{name}`: known are {}", known.collect::<Vec<_>>().join(", "))
}

/// The values of an axis, or its default alone.
fn axis<T: Copy>(
    given: Option<&Many<T>>,
    path: [&str; 3],
    check: impl Fn(T) -> Option<&'static str>,
) -> Result<Vec<Option<T>>, Invalid> {
    let Some(many) = given else { return Ok(vec![None]) };
    if many.all().is_empty() {
        return Err(invalid(&path, "the list is empty: leave the key out for the default"));
    }
    for (at, value) in many.all().iter().enumerate() {
        if let Some(needs) = check(*value) {
            let number = at.to_string();
            let whole = [path[0], path[1], path[2], &number];
            return Err(invalid(if matches!(many, Many::One(_)) { &path } else { &whole }, needs));
        }
    }
    Ok(many.all().iter().copied().map(Some).collect())
}

fn positive(value: f64) -> Option<&'static str> {
    (!(value > 0.0 && value.is_finite())).then_some("it must be positive and finite")
}

fn counted(most: usize) -> impl Fn(u32) -> Option<&'static str> {
    move |value| match value {
        0 => Some("it must be at least 1"),
        _ if value as usize > most => Some("it is too large"),
        _ => None,
    }
}

impl Spec {
    /// The grid that the file spans.
    ///
    /// # Errors
    /// The first value that has no meaning, with its place in the file.
    pub fn comparison(&self, seed: u64) -> Result<Comparison, Invalid> {
        if self.runs == 0 || self.runs > MOST_RUNS {
            return Err(invalid(&["runs"], format!("it must lie between 1 and {MOST_RUNS}")));
        }
        if !matches!(self.metrics.first(), Some(Metric::Rmse | Metric::Crps)) {
            return Err(invalid(&["metrics"], "the first metric ranks: it must be \"rmse\" or \"crps\""));
        }
        for (key, count) in [("world", self.world.len()), ("filter", self.filter.len())] {
            if count == 0 {
                return Err(invalid(&[key], "at least one is needed"));
            }
        }
        let mut places = Vec::new();
        for (at, axes) in self.world.iter().enumerate() {
            for place in axes.places(&at.to_string())? {
                if !places.contains(&place) {
                    places.push(place);
                }
            }
        }
        let mut entries = Vec::new();
        for (place, of) in places.iter().enumerate() {
            let noise = dimensions(of).map_err(|e| invalid(&["world"], e.to_string()))?.1;
            for (at, axes) in self.filter.iter().enumerate() {
                for contender in axes.contenders(&at.to_string(), noise)? {
                    let entry = Entry { place, contender };
                    if !entries.contains(&entry) {
                        entries.push(entry);
                    }
                }
            }
        }
        Ok(Comparison::new(self.runs as usize, self.metrics.clone(), places, entries, seed))
    }
}

impl WorldAxes {
    fn places(&self, at: &str) -> Result<Vec<Place>, Invalid> {
        let Some(own) = Place::named(&self.name) else {
            let known = WORLDS.iter().map(|world| world.name);
            return Err(invalid(&["world", at, "name"], unknown("world", &self.name, known)));
        };
        let path = |key| ["world", at, key];
        let measured = axis(self.measurement_variance.as_ref(), path("measurement_variance"), positive)?;
        let moved = axis(self.process_variance.as_ref(), path("process_variance"), positive)?;
        let steps = axis(self.steps.as_ref(), path("steps"), counted(1_000_000))?;
        let mut places = Vec::new();
        for &measurement_variance in &measured {
            for &process_variance in &moved {
                for steps in &steps {
                    let steps = steps.map(|steps| steps as usize);
                    let place = Place { measurement_variance, process_variance, steps, ..own };
                    let key = if measurement_variance.is_some() {
                        "measurement_variance"
                    } else {
                        "process_variance"
                    };
                    dimensions(&place).map_err(|error| invalid(&path(key), error.to_string()))?;
                    places.push(place);
                }
            }
        }
        Ok(places)
    }
}

impl FilterAxes {
    fn contenders(&self, at: &str, noise: usize) -> Result<Vec<Contender>, Invalid> {
        let path = |key| ["filter", at, key];
        let Some(info) = ContenderInfo::named(&self.name) else {
            let known = CONTENDERS.iter().map(|info| info.name);
            return Err(invalid(&path("name"), unknown("filter", &self.name, known)));
        };
        let given = [
            ("particles", self.particles.is_some()),
            ("evaluations", self.evaluations.is_some()),
            ("resampling", self.resampling.is_some()),
            ("trigger", self.trigger.is_some()),
        ];
        if let Some((key, _)) = given.iter().find(|(_, is)| *is && !info.is_sampled()) {
            return Err(invalid(&path(key), format!("{} has no particles", info.name)));
        }
        if self.particles.is_some() && self.evaluations.is_some() {
            return Err(invalid(&path("evaluations"), "give particles or evaluations, not both"));
        }
        let mut counts = Vec::new();
        for evaluations in axis(self.evaluations.as_ref(), path("evaluations"), counted(MAX_PARTICLES))? {
            counts.extend(evaluations.map(|budget| info.particles(budget as usize, noise)));
        }
        if counts.is_empty() {
            let particles = axis(self.particles.as_ref(), path("particles"), counted(MAX_PARTICLES))?;
            counts.extend(particles.into_iter().map(|n| n.map_or(1000, |n| n as usize)));
        }
        let share = |when: When| match when {
            When::Below(share) if !(share >= 0.0 && share.is_finite()) => Some("it must not be negative"),
            _ => None,
        };
        let schemes = axis(self.resampling.as_ref(), path("resampling"), |_| None)?;
        let triggers = axis(self.trigger.as_ref(), path("trigger"), share)?;
        let mut all = Vec::new();
        for particles in counts {
            for scheme in &schemes {
                for when in &triggers {
                    let plain = info.with(particles);
                    all.push(Contender {
                        resampling: scheme.map_or(plain.resampling, Resampling::from),
                        trigger: when.map_or(plain.trigger, Trigger::from),
                        ..plain
                    });
                }
            }
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec() -> Spec {
        let axes = |name: &str| FilterAxes {
            name: name.to_owned(),
            particles: None,
            evaluations: None,
            resampling: None,
            trigger: None,
        };
        let world = |name: &str| WorldAxes {
            name: name.to_owned(),
            measurement_variance: None,
            process_variance: None,
            steps: None,
        };
        Spec {
            runs: 3,
            metrics: default_metrics(),
            world: vec![
                WorldAxes { measurement_variance: Some(Many::List(vec![1.0, 2.0])), ..world("ungm") },
                world("linear"),
            ],
            filter: vec![
                axes("kalman"),
                FilterAxes {
                    evaluations: Some(Many::List(vec![40, 80])),
                    trigger: Some(Many::List(vec![When::Below(0.5), When::Word(Word::Always)])),
                    ..axes("bootstrap")
                },
                FilterAxes { particles: Some(Many::One(40)), ..axes("bootstrap") },
            ],
        }
    }

    /// Three worlds; one filter without particles, two budgets times two triggers, and one that is there
    /// already.
    #[test]
    fn lists_span_the_grid_and_nothing_stands_twice() {
        let grid = spec().comparison(1).unwrap();
        assert_eq!((grid.places.len(), grid.entries.len()), (3, 3 * 5));
        assert_eq!(grid.entries[1].contender.particles, 40);
    }

    #[test]
    fn what_has_no_meaning_is_named() {
        let path = |spec: &Spec| spec.comparison(1).unwrap_err().path.join(".");
        let mut of = spec();
        of.world[0].measurement_variance = Some(Many::List(vec![1.0, 0.0]));
        assert_eq!(path(&of), "world.0.measurement_variance.1");
        of = spec();
        of.filter[2].particles = Some(Many::One(0));
        assert_eq!(path(&of), "filter.2.particles");
        of = spec();
        of.filter[0].trigger = Some(Many::One(When::Below(0.5)));
        assert_eq!(path(&of), "filter.0.trigger");
        of = spec();
        of.metrics = vec![Metric::Evidence];
        assert_eq!(path(&of), "metrics");
    }
}
