//! A tracker written down: names of the catalogue and numbers.

use super::kind::Kind;
use super::modes::Moves;
use super::motion::{MotionSpec, WithMotion, with_motion};
use super::rules::Rules;
use super::sensor::{Frame, SensorSpec};
use super::tracker::{Targets, Tracker};
use crate::error::Result;
use crate::kernels::{NoiseSource, Simd, Threads};
use crate::model::Motion;
use crate::resample::{Resampling, Trigger};
use crate::time::Span;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The filter of a tracker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterSpec {
    /// A name of [`FILTERS`](crate::catalog::FILTERS).
    pub name: String,
    /// Number of particles: of `mmpf` those that survive a step, of `imm-pf` those of all modes together; of
    /// `rb-mmpf` the number of hypotheses.
    pub particles: usize,
    /// How to resample; `rb-mmpf` reduces its hypotheses instead.
    pub resampling: Resampling,
    /// When to resample; `sis` never does, filters with modes always.
    pub trigger: Trigger,
    /// See [`Rejuvenation::Roughen`](crate::filter::Rejuvenation::Roughen); without modes only.
    pub roughening: f64,
    /// How process noise is made.
    pub noise: NoiseSource,
}

impl FilterSpec {
    /// Enough particles for one target in the plane, or as many hypotheses as tell its last few changes of
    /// mode.
    pub fn default_particles(filter: &str) -> usize {
        if filter == "rb-mmpf" { 100 } else { 2000 }
    }
}

/// What is believed of a target before it is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StartSpec {
    /// Standard deviation of each component of the velocity, m/s.
    pub speed_sd_mps: f64,
    /// Of each component of the acceleration, m/s^2.
    pub acceleration_sd_mps2: f64,
    /// Of the turn rate, rad/s.
    pub turn_rate_sd_rad_s: f64,
    /// Of length and width, m.
    #[serde(default = "usual_size")]
    pub size_sd_m: f64,
    /// Where targets are believed to appear, metres, with the standard deviation of each coordinate: for readings
    /// that do not tell a position (bearings, ranges). With `None` such readings start no track.
    pub position: Option<([f64; 3], f64)>,
}

/// A ship or an airliner is larger by a factor, a car smaller.
fn usual_size() -> f64 {
    40.0
}

/// When tracks end, and what is reported of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LifeSpec {
    /// A longer silence of an identity ends its track; the next plot starts another.
    pub max_gap: Span,
    /// So many updates in a row that are degenerate, or find the cloud where the target is not, start the belief
    /// anew from the plot.
    pub restart_after: u32,
    /// So many measurements of a target in a row that the gate refuses start the belief anew from the last of them:
    /// the track, not the measurements, is wrong. Several of one time count as one. `None`: as many as right models
    /// would see refused with a probability of 1e-9 at the gate of the sensor, and no fewer than three.
    #[serde(default)]
    pub restart_after_gated: Option<u32>,
    /// The point that stands for the belief.
    pub estimate: Estimate,
}

/// A point that stands for a belief. Beliefs without particles have a mean only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimate {
    /// The mean.
    #[default]
    Mean,
    /// The heaviest particle.
    MaxWeight,
    /// The mean of the heaviest tenth of the particles.
    RobustMean,
}

/// A tracker written down: names of the catalogue and numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackerSpec {
    /// Dimensions of positions: 2 or 3.
    pub dimensions: usize,
    /// The filter.
    pub filter: FilterSpec,
    /// How targets move.
    pub motion: MotionSpec,
    /// Sensors by name; [`DEFAULT_SENSOR`](super::DEFAULT_SENSOR) stands for all others.
    pub sensors: BTreeMap<String, SensorSpec>,
    /// What is believed at first.
    pub start: StartSpec,
    /// When tracks end, and what is reported.
    pub life: LifeSpec,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// What computes; it never changes a result.
#[derive(Clone, Debug)]
pub struct Engine {
    /// Instructions to use.
    pub simd: Simd,
    /// Threads over the particles of one target.
    pub threads: Threads,
}

impl Default for Engine {
    /// The best instructions of this processor, on the calling thread.
    fn default() -> Self {
        Engine { simd: Simd::best(), threads: Threads::Serial }
    }
}

impl TrackerSpec {
    /// A tracker in the plane with the default settings and no sensor yet.
    pub fn new(filter: &str, motion: &str) -> TrackerSpec {
        TrackerSpec {
            dimensions: 2,
            filter: FilterSpec {
                name: filter.to_owned(),
                particles: FilterSpec::default_particles(filter),
                resampling: Resampling::default(),
                trigger: Trigger::default(),
                roughening: 0.0,
                noise: NoiseSource::default(),
            },
            motion: MotionSpec { model: motion.to_owned(), ..MotionSpec::default() },
            sensors: BTreeMap::new(),
            start: StartSpec {
                speed_sd_mps: 30.0,
                acceleration_sd_mps2: 2.0,
                turn_rate_sd_rad_s: 0.05,
                size_sd_m: usual_size(),
                position: None,
            },
            life: LifeSpec {
                max_gap: Span::from_nanos(300_000_000_000),
                restart_after: 3,
                restart_after_gated: None,
                estimate: Estimate::Mean,
            },
            seed: 1,
        }
    }

    /// The tracker.
    ///
    /// # Errors
    /// A name that there is not, parameters that are absent or out of range, models that do not fit each other.
    pub fn build(&self, engine: Engine) -> Result<Box<dyn Tracker>> {
        struct Build<'a>(&'a TrackerSpec, Engine);
        impl WithMotion for Build<'_> {
            type Out = Box<dyn Tracker>;
            fn with<A, F, const N: usize, const W: usize, const D: usize>(
                self,
                moves: Moves<A>,
            ) -> Result<Box<dyn Tracker>>
            where
                A: Motion<N, W> + Clone + 'static,
                F: Frame<N, D>,
            {
                let rules = Rules::<A, F, N, W, D>::new(self.0, moves, self.1)?;
                Ok(Box::new(Targets::new(rules)))
            }
        }
        let jumping = Kind::named(&self.filter.name)?.modes;
        with_motion(&self.motion, self.dimensions, jumping, Build(self, engine))
    }
}
