//! The loop of one target, and the targets of a run.

use super::Plot;
use super::modes::{Moves, has_modes};
use super::motion::{MotionSpec, WithMotion, with_motion};
use super::saved::{SavedBelief, SavedTarget, SavedTracker, Version};
use super::sensor::{Frame, SensorSpec, Sensors, Work};
use crate::belief::{Cloud, Gaussian, GaussianBelief, ModalGaussian};
use crate::catalog::FILTERS;
use crate::error::{Error, Result};
use crate::filter::{
    Extended, Filter, Kalman, Linear, Outcome, ParticleFilter, Prior, Rejuvenation, Settings, SigmaPoints,
    Tangent, Transform, Unscented, Update, predict_measurement, step_modes,
};
use crate::kernels::{NoiseSource, Simd, Threads};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix};
use crate::model::{GaussianMeasurement, JumpMarkov, Measurement, Motion};
use crate::resample::{Resampling, Trigger};
use crate::rng::Stream;
use crate::time::{Span, Time};
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The filter of a tracker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterSpec {
    /// A name of [`FILTERS`].
    pub name: String,
    /// Number of particles.
    pub particles: usize,
    /// How to resample.
    pub resampling: Resampling,
    /// When to resample; `sis` never does.
    pub trigger: Trigger,
    /// See [`Rejuvenation::Roughen`].
    pub roughening: f64,
    /// How process noise is made.
    pub noise: NoiseSource,
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
    /// Where targets are believed to appear, metres, with the standard deviation of each coordinate: for readings
    /// that do not tell a position (bearings, ranges). With `None` such readings start no track.
    pub position: Option<([f64; 3], f64)>,
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
                particles: 2000,
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
                Ok(Box::new(Targets { rules, targets: BTreeMap::new() }))
            }
        }
        let jumping = has_modes(&self.filter.name);
        with_motion(&self.motion, self.dimensions, jumping, Build(self, engine))
    }
}

/// Follows identified targets: the object-safe edge of the library.
pub trait Tracker: Send {
    /// Takes a plot in and says what became of it. Plots of one identity come in order of time.
    ///
    /// # Errors
    /// A reading that the models have no place for, a number that is not finite; the tracks are then as they were.
    fn push(&mut self, plot: &Plot) -> Result<Row>;

    /// What the numbers of a state are, in order.
    fn states(&self) -> Vec<State>;

    /// Where the reading alone puts the target in the plane, metres; `None` if it does not tell.
    fn place(&self, plot: &Plot) -> Option<[f64; 2]>;

    /// All that is needed to go on later, to the same bits.
    fn save(&self) -> SavedTracker;

    /// Takes up what [`Tracker::save`] kept, in place of all tracks.
    ///
    /// # Errors
    /// A state of another specification; beliefs of another shape.
    fn restore(&mut self, saved: SavedTracker) -> Result<()>;
}

/// One number of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Metres along axis 0, 1, 2 (x, y, z).
    Position(usize),
    /// Metres per second along an axis.
    Velocity(usize),
    /// Metres per second squared along an axis.
    Acceleration(usize),
    /// Radians per second, counter-clockwise.
    TurnRate,
}

/// What became of a plot, and what is known after it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Identity of the track: that of the plot, with `#2`, `#3`, ... for tracks after a gap; `target` for plots
    /// without one. An identity that itself ends so gets `#1` on its first track: no two tracks of different
    /// identities have one name, and what stands before the last `#` is the identity.
    pub id: Arc<str>,
    /// Time of the estimate.
    pub time: Time,
    /// What became of the plot.
    pub event: Event,
    /// The step of the filter; `None` if there was none.
    pub update: Option<Update>,
    /// The estimate; empty while there is no track.
    pub mean: Vec<f64>,
    /// Covariance about the mean of the belief, row by row.
    pub covariance: Vec<f64>,
    /// The plot against what the belief foretold; `None` where nothing was foretold.
    pub innovation: Option<Innovation>,
}

/// What became of a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Event {
    /// It started a track.
    Started,
    /// It was used.
    Updated,
    /// It lay outside the gate; the belief was predicted.
    Gated,
    /// The belief gave it no likelihood; the belief was predicted.
    Degenerate,
    /// One degenerate update or one refused measurement too many: the belief was started anew from it. The row's
    /// update and innovation are of the belief that was given up; [`Outcome::Gated`] tells of the gate.
    Restarted,
    /// It is older than the belief; not used.
    OutOfOrder,
    /// There is no track, and it tells no position to start one; not used.
    Waiting,
}

impl Event {
    /// The word for tables: `started`, `out-of-order`.
    pub fn name(self) -> &'static str {
        match self {
            Event::Started => "started",
            Event::Updated => "updated",
            Event::Gated => "gated",
            Event::Degenerate => "degenerate",
            Event::Restarted => "restarted",
            Event::OutOfOrder => "out-of-order",
            Event::Waiting => "waiting",
        }
    }
}

/// A measurement against its prediction; for particles by the mean and covariance of the cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Innovation {
    /// L^-1 nu with S = L L': components in predicted standard deviations, uncorrelated where the models fit.
    pub whitened: Vec<f64>,
    /// nu' S^-1 nu.
    pub nis: f64,
    /// trace(S^-1 R) / dimension: the share of the measurement's noise in S.
    pub noise_share: f64,
}

/// Name of a target's first, second, ... track: another one for every pair. The random streams are keyed by it.
fn track_name(identity: Arc<str>, track: u32) -> Arc<str> {
    let numbered = |number: &str| {
        number.starts_with(|c: char| ('1'..='9').contains(&c)) && number.bytes().all(|b| b.is_ascii_digit())
    };
    match identity.rsplit_once('#') {
        Some((_, number)) if numbered(number) => Arc::from(format!("{identity}#{track}")),
        _ if track > 1 => Arc::from(format!("{identity}#{track}")),
        _ => identity,
    }
}

/// FNV-1a with 64 bits (Fowler, Noll and Vo, draft-eastlake-fnv): the label under which the random stream of a
/// track is forked from the seed. The same text has the same hash for ever.
pub fn stable_hash(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// How a Gaussian belief is updated.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Family {
    Kalman,
    Extended,
    Unscented,
}

impl Family {
    /// The family of a filter's name, and whether it has particles.
    fn named(name: &str) -> Result<(Family, bool)> {
        match name {
            "kalman" | "imm-kalman" => Ok((Family::Kalman, false)),
            "ekf" | "imm-ekf" => Ok((Family::Extended, false)),
            "ukf" | "imm-ukf" => Ok((Family::Unscented, false)),
            // Until the cloud is drawn.
            "particle" | "sir" | "sis" => Ok((Family::Unscented, true)),
            _ => {
                let known: Vec<_> = FILTERS.iter().map(|entry| entry.name).collect();
                let text = format!("there is no filter `{name}`; known: {}", known.join(", "));
                Err(Error::Unsupported(text))
            }
        }
    }
}

/// A belief of a target.
pub(super) enum Belief<const N: usize> {
    Gaussian(GaussianBelief<N>),
    Modal(ModalGaussian<N>),
    Cloud(Box<Cloud<N>>),
}

impl<const N: usize> Belief<N> {
    pub(super) fn time(&self) -> Time {
        match self {
            Belief::Gaussian(belief) => belief.time,
            Belief::Modal(belief) => belief.time(),
            Belief::Cloud(cloud) => cloud.time(),
        }
    }

    /// How many modes it knows; `None` if it knows of none.
    fn modes(&self) -> Option<usize> {
        match self {
            Belief::Modal(belief) => Some(belief.len()),
            Belief::Gaussian(_) | Belief::Cloud(_) => None,
        }
    }

    fn law(&self) -> Result<Gaussian<N>> {
        match self {
            Belief::Gaussian(belief) => Ok(belief.state),
            Belief::Modal(belief) => belief.combined(),
            Belief::Cloud(cloud) => cloud.gaussian(),
        }
    }
}

/// What is known of one target.
pub(super) struct Target<const N: usize> {
    id: Arc<str>,
    belief: Belief<N>,
    /// Which track of the identity this is, from 1.
    track: u32,
    /// How often its belief was started.
    starts: u32,
    /// Updates that a cloud still waits for: see [`Rules::begin`].
    warm_up: u32,
    /// Degenerate updates in a row.
    degenerate: u32,
    /// Times in a row at which nothing but refused measurements came.
    gated: u32,
}

/// Models and settings: what all targets share.
pub(super) struct Rules<A, F: Frame<N, D>, const N: usize, const W: usize, const D: usize> {
    spec: TrackerSpec,
    motion: A,
    /// Its modes, for filters that have them.
    modes: Option<JumpMarkov<A>>,
    pub(super) sensors: Sensors<F, N, D>,
    family: Family,
    particles: Option<ParticleFilter<N, W, A, Sensors<F, N, D>>>,
    stream: Stream,
}

impl<A, F, const N: usize, const W: usize, const D: usize> Rules<A, F, N, W, D>
where
    A: Motion<N, W> + Clone + 'static,
    F: Frame<N, D>,
{
    pub(super) fn new(spec: &TrackerSpec, moves: Moves<A>, engine: Engine) -> Result<Self> {
        let sensors = Sensors::new(&spec.sensors)?;
        let (family, clouds) = Family::named(&spec.filter.name)?;
        let start = &spec.start;
        Error::positive("standard deviation of the speed at the start", start.speed_sd_mps)?;
        Error::positive("standard deviation of the acceleration at the start", start.acceleration_sd_mps2)?;
        Error::positive("standard deviation of the turn rate at the start", start.turn_rate_sd_rad_s)?;
        let mut rules = Rules {
            spec: spec.clone(),
            motion: moves.quiet,
            modes: moves.modes,
            sensors,
            family,
            particles: None,
            stream: Stream::new(spec.seed),
        };
        if clouds {
            let filter = &spec.filter;
            let settings = Settings {
                particles: filter.particles,
                resampling: filter.resampling,
                trigger: if filter.name == "sis" { Trigger::Never } else { filter.trigger },
                rejuvenation: Rejuvenation::Roughen(filter.roughening),
                lookahead: None,
                noise: filter.noise,
                simd: engine.simd,
                threads: engine.threads,
            };
            let (position, sd) = start.position.unwrap_or(([0.0; 3], 1.0));
            let prior = rules.prior(&Gaussian::independent(from_fn(|i| position[i]), [sd; D])?)?;
            let filter = ParticleFilter::new(prior, rules.motion.clone(), rules.sensors.clone(), settings)?;
            rules.particles = Some(filter);
        }
        Ok(rules)
    }

    /// The law of a state of which a position is known: everything else is as the start says, around zero.
    pub(super) fn prior(&self, position: &Gaussian<D>) -> Result<Gaussian<N>> {
        let start = &self.spec.start;
        let mean = from_fn(|i| if i < D { position.mean()[i] } else { 0.0 });
        let covariance = Matrix::from_entries(|i, j| match states::<N, D>(i) {
            State::Position(_) if j < D => position.covariance().0[i][j],
            State::Velocity(_) if i == j => start.speed_sd_mps * start.speed_sd_mps,
            State::Acceleration(_) if i == j => start.acceleration_sd_mps2 * start.acceleration_sd_mps2,
            State::TurnRate if i == j => start.turn_rate_sd_rad_s * start.turn_rate_sd_rad_s,
            _ => 0.0,
        });
        Gaussian::new(mean, covariance)
    }

    /// The belief that `plot` starts; `None` if it tells no position. With it, how many updates a cloud waits for.
    ///
    /// A precise plot leaves the velocity open: of particles spread over all velocities hardly one would meet the
    /// next plot. So the belief stays Gaussian until as many plots as the state has orders (position, velocity,
    /// acceleration) have fixed it, and the cloud is drawn then. A belief that starts from a configured position
    /// is a cloud at once, because what comes first then (bearings) makes it far from normal.
    pub(super) fn begin(&self, plot: &Plot) -> Result<Option<(Gaussian<N>, u32)>> {
        if let Some(position) = self.sensors.of(plot).place(&plot.reading)? {
            return Ok(Some((self.prior(&position)?, N.div_ceil(D) as u32 - 1)));
        }
        let Some((position, sd)) = self.spec.start.position else { return Ok(None) };
        let law = Gaussian::independent(from_fn(|i| position[i]), [sd; D])?;
        Ok(Some((self.prior(&law)?, 0)))
    }

    /// Updates a Gaussian belief by `plot`, or predicts it to the plot's time where `used` is false.
    fn update(&self, belief: &mut GaussianBelief<N>, plot: &Plot, used: bool) -> Result<Update> {
        struct Step<'a, A, const N: usize, const W: usize> {
            motion: &'a A,
            family: Family,
            belief: &'a mut GaussianBelief<N>,
            at: Time,
            used: bool,
        }
        impl<A: Motion<N, W> + Clone, const N: usize, const W: usize> Work<N> for Step<'_, A, N, W> {
            type Out = Update;
            fn with<H, const M: usize>(self, model: &H, z: &[f64; M]) -> Result<Update>
            where
                H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
            {
                let (motion, model, prior) = (self.motion.clone(), model.clone(), self.belief.state);
                let z = self.used.then_some(z);
                match self.family {
                    Family::Kalman => Kalman::new(motion, model, prior)?.step(self.belief, self.at, z),
                    Family::Extended => Extended::new(motion, model, prior).step(self.belief, self.at, z),
                    Family::Unscented => Unscented::new(motion, model, prior, SigmaPoints::default())?.step(
                        self.belief,
                        self.at,
                        z,
                    ),
                }
            }
        }
        let step = Step { motion: &self.motion, family: self.family, belief, at: plot.time, used };
        self.sensors.of(plot).with(&plot.reading, step)
    }

    /// [`Rules::update`] for a Gaussian in each mode of `model`.
    fn update_modes(
        &self,
        model: &JumpMarkov<A>,
        belief: &mut ModalGaussian<N>,
        plot: &Plot,
        used: bool,
    ) -> Result<Update> {
        struct Step<'a, A, const N: usize, const W: usize> {
            model: &'a JumpMarkov<A>,
            family: Family,
            belief: &'a mut ModalGaussian<N>,
            at: Time,
            used: bool,
        }
        impl<A: Motion<N, W>, const N: usize, const W: usize> Work<N> for Step<'_, A, N, W> {
            type Out = Update;
            fn with<H, const M: usize>(self, sensor: &H, z: &[f64; M]) -> Result<Update>
            where
                H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
            {
                let (model, belief, at) = (self.model, self.belief, self.at);
                let z = self.used.then_some(z);
                match self.family {
                    Family::Kalman => {
                        for mode in model.modes() {
                            Linear.accept(mode, sensor, belief.mode(0))?;
                        }
                        step_modes(&Linear, model, sensor, None, belief, at, z)
                    }
                    Family::Extended => step_modes(&Tangent, model, sensor, None, belief, at, z),
                    Family::Unscented => {
                        step_modes(&SigmaPoints::default(), model, sensor, None, belief, at, z)
                    }
                }
            }
        }
        let step = Step { model, family: self.family, belief, at: plot.time, used };
        self.sensors.of(plot).with(&plot.reading, step)
    }

    /// The step of the filter, or of the one that stands for it until a cloud is drawn: an update by `plot`, or a
    /// prediction to its time where `used` is false.
    pub(super) fn step(&self, belief: &mut Belief<N>, plot: &Plot, used: bool) -> Result<Update> {
        match (belief, &self.particles, &self.modes) {
            (Belief::Gaussian(belief), _, _) => self.update(belief, plot, used),
            (Belief::Modal(belief), _, Some(model)) => self.update_modes(model, belief, plot, used),
            (Belief::Cloud(cloud), Some(filter), _) => filter.step(cloud, plot.time, used.then_some(plot)),
            _ => Err(Error::Unsupported("a belief of another filter".to_owned())),
        }
    }

    /// What `belief` foretells, against what was measured; `None` where it foretells nothing finite.
    pub(super) fn foretold(&self, belief: &Belief<N>, plot: &Plot) -> Result<Option<Foretold>> {
        match belief {
            Belief::Gaussian(belief) => self.innovation(&belief.state, belief.time, plot),
            Belief::Modal(belief) => {
                let mut ahead = Belief::Modal(belief.clone());
                if belief.time() < plot.time {
                    self.step(&mut ahead, plot, false)?;
                }
                ahead.law().and_then(|law| self.innovation(&law, plot.time, plot)).or(Ok(None))
            }
            // A cloud without spread, or without a particle left, foretells nothing; the filter can still go on.
            Belief::Cloud(cloud) => {
                Ok(cloud.gaussian().and_then(|law| self.innovation(&law, cloud.time(), plot)).unwrap_or(None))
            }
        }
    }

    /// What `state` at `from` foretells, against what was measured; `None` where it foretells nothing finite.
    fn innovation(&self, state: &Gaussian<N>, from: Time, plot: &Plot) -> Result<Option<Foretold>> {
        struct Foretell<'a, A, const N: usize, const W: usize> {
            motion: &'a A,
            state: &'a Gaussian<N>,
            from: Time,
            at: Time,
        }
        impl<A: Motion<N, W>, const N: usize, const W: usize> Work<N> for Foretell<'_, A, N, W> {
            type Out = Option<Foretold>;
            fn with<H, const M: usize>(self, model: &H, z: &[f64; M]) -> Result<Self::Out>
            where
                H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
            {
                for &component in z {
                    Error::finite("measurement", component)?;
                }
                let Ok(foretold) = predict_measurement(self.motion, model, self.state, self.from, self.at)
                else {
                    return Ok(None);
                };
                let Ok(factor) = Cholesky::of("covariance of the innovation", &foretold.covariance) else {
                    return Ok(None);
                };
                let whitened = factor.whiten(&foretold.innovation(z));
                let nis: f64 = whitened.iter().map(|w| w * w).sum();
                let shares = factor.solve_matrix(&Matrix(model.covariance())).diagonal();
                let log_density = -0.5 * (nis + factor.log_det() + M as f64 * LN_2PI);
                let noise_share = shares.iter().sum::<f64>() / M as f64;
                let least_share = shares.into_iter().fold(f64::INFINITY, f64::min);
                let innovation = Innovation { whitened: whitened.to_vec(), nis, noise_share };
                let finite = nis.is_finite() && noise_share.is_finite();
                Ok(finite.then_some(Foretold { innovation, log_density, least_share }))
            }
        }
        let work = Foretell { motion: &self.motion, state, from, at: plot.time };
        self.sensors.of(plot).with(&plot.reading, work)
    }

    /// Whether an innovation lies outside the gate of the plot's sensor.
    pub(super) fn gated(&self, plot: &Plot, innovation: Option<&Innovation>) -> bool {
        innovation.is_some_and(|i| i.nis > self.sensors.of(plot).threshold(i.whitened.len()))
    }

    /// Random numbers of a belief: its track's, and other ones after each start.
    fn stream_of(&self, id: &str, starts: u32) -> Stream {
        self.stream.fork(stable_hash(id)).fork(u64::from(starts))
    }

    /// The law as the filter keeps it: a cloud once nothing is to wait for.
    pub(super) fn form(
        &self,
        id: &str,
        starts: u32,
        at: Time,
        law: Gaussian<N>,
        warm_up: u32,
    ) -> Result<Belief<N>> {
        if let Some(model) = &self.modes {
            return self.in_modes(model, at, law);
        }
        match self.particles.as_ref().filter(|_| warm_up == 0) {
            None => Ok(Belief::Gaussian(GaussianBelief { time: at, state: law })),
            Some(filter) => {
                let stream = self.stream_of(id, starts);
                let columns = law.columns(stream, filter.settings().particles)?;
                Ok(Belief::Cloud(Box::new(Cloud::from_columns(at, stream, columns)?)))
            }
        }
    }

    /// The law in every mode.
    fn in_modes(&self, model: &JumpMarkov<A>, at: Time, law: Gaussian<N>) -> Result<Belief<N>> {
        let initial = model.chain().initial().to_vec();
        let laws = vec![law; initial.len()];
        Ok(Belief::Modal(ModalGaussian::new(at, initial, laws)?))
    }

    /// A target whose first plot this is; the second value is the filter's step where there was one.
    fn start(&self, id: Arc<str>, track: u32, starts: u32, plot: &Plot) -> Result<Option<Started<N>>> {
        let Some((law, warm_up)) = self.begin(plot)? else { return Ok(None) };
        let belief = self.form(&id, starts, plot.time, law, warm_up)?;
        let mut target = Target { id, belief, track, starts, warm_up, degenerate: 0, gated: 0 };
        // A plot that gave no position has still to be used.
        let update = match self.sensors.of(plot).place(&plot.reading)? {
            Some(_) => None,
            None => Some(self.advance(&mut target, plot, true)?),
        };
        Ok(Some((target, update)))
    }

    /// The filter's step.
    fn advance(&self, target: &mut Target<N>, plot: &Plot, used: bool) -> Result<Update> {
        let update = self.step(&mut target.belief, plot, used)?;
        if let Belief::Gaussian(GaussianBelief { time, state }) = target.belief
            && update.outcome == Outcome::Updated
            && target.warm_up > 0
        {
            target.warm_up -= 1;
            target.belief = self.form(&target.id, target.starts, time, state, target.warm_up)?;
        }
        Ok(update)
    }

    /// Takes a plot in.
    fn push(&self, slot: &mut Option<Target<N>>, plot: &Plot) -> Result<Row> {
        for &value in plot.reading.values() {
            Error::finite("measurement", value)?;
        }
        let identity = plot.id.clone().unwrap_or_else(|| Arc::from("target"));
        let silent = |t: &Target<N>| plot.time - t.belief.time() > self.spec.life.max_gap;
        if slot.as_ref().is_none_or(silent) {
            let track = slot.as_ref().map_or(1, |t| t.track + 1);
            let id = track_name(identity, track);
            return match self.start(Arc::clone(&id), track, 1, plot)? {
                None => Ok(Row::without_belief(id, plot.time, Event::Waiting)),
                Some((target, update)) => {
                    let row = self.row(&target, Event::Started, update, None);
                    *slot = Some(target);
                    row
                }
            };
        }
        let Some(target) = slot.as_mut() else {
            return Ok(Row::without_belief(identity, plot.time, Event::Waiting));
        };
        if plot.time < target.belief.time() {
            return self.row(target, Event::OutOfOrder, None, None);
        }
        let foretold = self.foretold(&target.belief, plot)?;
        let innovation = foretold.map(|foretold| foretold.innovation);
        let gated = self.gated(plot, innovation.as_ref());
        // What comes at one time may be wrong for one reason: it counts once.
        let again = target.gated > 0 && plot.time == target.belief.time();
        let update = self.advance(target, plot, !gated)?;
        let event = match update.outcome {
            _ if gated => Event::Gated,
            Outcome::Degenerate => Event::Degenerate,
            _ => Event::Updated,
        };
        let update = Update { outcome: if gated { Outcome::Gated } else { update.outcome }, ..update };
        let lost = event == Event::Degenerate || !gated && is_starved(&update, innovation.as_ref());
        // One refused measurement tells nothing of the belief: it neither counts nor clears the count. Many in a row
        // tell that no measurement will ever reach the belief again.
        target.degenerate = if lost {
            target.degenerate + 1
        } else if gated {
            target.degenerate
        } else {
            0
        };
        target.gated = match event {
            Event::Gated if !again => target.gated.saturating_add(1),
            Event::Updated => 0,
            _ => target.gated,
        };
        let most_gated = self.spec.life.restart_after_gated.unwrap_or(self.sensors.of(plot).refusals());
        let locked_out = gated && target.gated >= most_gated.max(1);
        let dead = update.particles.is_some_and(|p| p.ess == 0.0);
        if dead || locked_out || lost && target.degenerate >= self.spec.life.restart_after.max(1) {
            let restarted = self.start(Arc::clone(&target.id), target.track, target.starts + 1, plot)?;
            if let Some((restarted, _)) = restarted {
                *target = restarted;
                return self.row(target, Event::Restarted, Some(update), innovation);
            }
        }
        self.row(target, event, Some(update), innovation)
    }

    fn row(
        &self,
        target: &Target<N>,
        event: Event,
        update: Option<Update>,
        innovation: Option<Innovation>,
    ) -> Result<Row> {
        let Ok(law) = target.belief.law() else {
            // Every particle is lost: there is no estimate until the next start.
            let row = Row::without_belief(Arc::clone(&target.id), target.belief.time(), event);
            return Ok(Row { update, innovation, ..row });
        };
        let mean = match (&target.belief, self.spec.life.estimate) {
            (Belief::Cloud(cloud), Estimate::MaxWeight) => cloud.max_weight(),
            (Belief::Cloud(cloud), Estimate::RobustMean) => cloud.robust_mean(0.1)?,
            _ => *law.mean(),
        };
        Ok(Row {
            id: Arc::clone(&target.id),
            time: target.belief.time(),
            event,
            update,
            mean: mean.to_vec(),
            covariance: law.covariance().0.iter().flatten().copied().collect(),
            innovation,
        })
    }
}

/// Whether particles have lost their target: hardly more than one carries all the weight, and the measurement is
/// where the cloud all but excluded it (one in 10^10 for two components). Log-weights do not underflow, so the filter
/// itself goes on with the least bad particle.
fn is_starved(update: &Update, innovation: Option<&Innovation>) -> bool {
    const NIS: f64 = 46.0;
    const ESS: f64 = 2.0;
    update.particles.is_some_and(|p| p.ess < ESS) && innovation.is_some_and(|i| i.nis > NIS)
}

/// A measurement against its prediction, and what only learning asks.
pub(super) struct Foretold {
    pub(super) innovation: Innovation,
    /// ln N(nu; 0, S).
    pub(super) log_density: f64,
    /// The least of the components' shares of noise, of which `noise_share` is the mean.
    pub(super) least_share: f64,
}

/// A target, and the step of the filter that started it where there was one.
type Started<const N: usize> = (Target<N>, Option<Update>);

impl Row {
    fn without_belief(id: Arc<str>, time: Time, event: Event) -> Row {
        Row { id, time, event, update: None, mean: Vec::new(), covariance: Vec::new(), innovation: None }
    }
}

/// What component `i` of a state of `N` numbers in `D` dimensions is.
fn states<const N: usize, const D: usize>(i: usize) -> State {
    match i / D {
        0 => State::Position(i),
        1 => State::Velocity(i - D),
        _ if N == 3 * D => State::Acceleration(i - 2 * D),
        _ => State::TurnRate,
    }
}

/// All targets of a run, by identity.
struct Targets<A, F: Frame<N, D>, const N: usize, const W: usize, const D: usize> {
    rules: Rules<A, F, N, W, D>,
    targets: BTreeMap<Option<Arc<str>>, Option<Target<N>>>,
}

impl<A, F, const N: usize, const W: usize, const D: usize> Tracker for Targets<A, F, N, W, D>
where
    A: Motion<N, W> + Clone + 'static,
    F: Frame<N, D>,
{
    fn push(&mut self, plot: &Plot) -> Result<Row> {
        let slot = self.targets.entry(plot.id.clone()).or_default();
        self.rules.push(slot, plot)
    }

    fn states(&self) -> Vec<State> {
        (0..N).map(states::<N, D>).collect()
    }

    fn place(&self, plot: &Plot) -> Option<[f64; 2]> {
        let law = self.rules.sensors.of(plot).place(&plot.reading).ok()??;
        Some([law.mean()[0], law.mean()[1]])
    }

    fn save(&self) -> SavedTracker {
        let save = |target: &Target<N>| SavedTarget {
            track: target.track,
            starts: target.starts,
            warm_up: target.warm_up,
            degenerate: target.degenerate,
            gated: target.gated,
            belief: match &target.belief {
                Belief::Gaussian(belief) => SavedBelief::gaussian(belief),
                Belief::Modal(belief) => SavedBelief::modal(belief),
                Belief::Cloud(cloud) => SavedBelief::Cloud(cloud.saved()),
            },
        };
        SavedTracker {
            version: Version::CURRENT,
            spec: self.rules.spec.clone(),
            targets: self
                .targets
                .iter()
                .filter_map(|(id, target)| Some((id.as_deref().map(str::to_owned), save(target.as_ref()?))))
                .collect(),
        }
    }

    fn restore(&mut self, saved: SavedTracker) -> Result<()> {
        if saved.spec != self.rules.spec {
            let text = "the saved tracks were made by another configuration; build the tracker from theirs";
            return Err(Error::Unsupported(text.to_owned()));
        }
        let mut targets = BTreeMap::new();
        for (id, target) in saved.targets {
            let id: Option<Arc<str>> = id.map(Arc::from);
            let name = id.clone().unwrap_or_else(|| Arc::from("target"));
            let SavedTarget { track, starts, warm_up, degenerate, gated, belief } = target;
            let name = track_name(name, track);
            let belief = match belief {
                SavedBelief::Cloud(cloud) => Belief::Cloud(Box::new(Cloud::restore(cloud)?)),
                SavedBelief::Gaussian { time, mean, covariance } => {
                    Belief::Gaussian(SavedBelief::restored(time, mean, covariance)?)
                }
                SavedBelief::Modal { time, modes } => {
                    Belief::Modal(SavedBelief::restored_modes(time, modes)?)
                }
            };
            if matches!(belief, Belief::Cloud(_)) && self.rules.particles.is_none() {
                let text = format!("the saved belief of `{name}` is a cloud; this filter has no particles");
                return Err(Error::Unsupported(text));
            }
            let modes = self.rules.modes.as_ref().map(|model| model.modes().len());
            if modes != belief.modes() {
                let text = format!("the saved belief of `{name}` has other modes than this filter");
                return Err(Error::Unsupported(text));
            }
            targets.insert(id, Some(Target { id: name, belief, track, starts, warm_up, degenerate, gated }));
        }
        self.targets = targets;
        Ok(())
    }
}
