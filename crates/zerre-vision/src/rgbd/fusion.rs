//! One posterior from any number of sources that each may be wrong: a mixture Kalman filter.
//!
//! Each source that has looked gives no, one or several readings, of which one at most is the point: it is an outlier
//! with a probability of its own. Given which reading is the point, everything is linear and normal; so the particles
//! are histories of answers to that question, and each carries a Kalman filter of the place (Chen and Liu, Journal of
//! the Royal Statistical Society B 62, 2000). Answers are drawn from their own posterior, source by source.
//!
//! The point can be *seen*, or be *hidden* from the cameras; and where a source has a better idea than the particles, it
//! may turn up anywhere (*jump*). Per particle all three are tried, weighed by what the sources say, and one is drawn.

use super::Reading;
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use zerre::Time;
use zerre::math::Real;
use zerre::resample::{Resampler, Resampling, Trigger};
use zerre::rng::{Draws, Purpose, Stream};

/// What is known of a source before it speaks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// What it is called.
    pub name: String,
    /// Standard deviation of its readings about the point where they are of it, pixels, in either direction.
    pub sd: f64,
    /// The same of its depth, millimetres.
    #[serde(default = "usual_depth_sd")]
    pub depth_sd: f64,
    /// Probability that none of its readings is of the point although it can be seen.
    pub outlier: f64,
    /// Mean of its readings less the point, pixels.
    #[serde(default)]
    pub offset: [f64; 2],
    /// Mean of its depths less that of the point, millimetres.
    #[serde(default)]
    pub depth_offset: f64,
    /// Whether it needs to see the point: a camera does, a model of the whole body does not.
    #[serde(default)]
    pub sees: bool,
}

fn usual_depth_sd() -> f64 {
    40.0
}

/// How a [`Fusion`] is set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FusionSettings {
    /// Number of particles.
    pub particles: usize,
    /// Root of the spectral density of the acceleration in the picture, pixels per second^1.5.
    pub acceleration: f64,
    /// The same along the camera's axis, millimetres per second^1.5.
    pub depth_acceleration: f64,
    /// How far a hidden point wanders, pixels per root of a second; ten times as many millimetres in depth.
    pub hidden_spread: f64,
    /// How far a source that need not see the point is off while it is hidden, a standard deviation in pixels: it guesses.
    pub hidden_sd: f64,
    /// How often a point that is seen becomes hidden, per second.
    pub hides: f64,
    /// How often a hidden point shows again, per second.
    pub returns: f64,
    /// How often a point is elsewhere all at once, per second.
    pub jumps: f64,
}

impl Default for FusionSettings {
    fn default() -> FusionSettings {
        FusionSettings {
            particles: 150,
            acceleration: 600.0,
            depth_acceleration: 1500.0,
            hidden_spread: 80.0,
            hidden_sd: 30.0,
            hides: 0.15,
            returns: 1.5,
            jumps: 0.3,
        }
    }
}

impl FusionSettings {
    /// # Errors
    /// A number out of its range.
    pub fn checked(&self) -> Result<()> {
        if self.particles == 0 {
            return Err(Error::OutOfRange { what: "particles", value: 0.0, needs: "it must be 1 or more" });
        }
        for (what, value) in [
            ("acceleration", self.acceleration),
            ("depth_acceleration", self.depth_acceleration),
            ("hidden_spread", self.hidden_spread),
            ("hidden_sd", self.hidden_sd),
            ("hides", self.hides),
            ("returns", self.returns),
            ("jumps", self.jumps),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::OutOfRange { what, value, needs: "it must be positive" });
            }
        }
        Ok(())
    }
}

impl Source {
    /// What a reading's confidence is multiplied with to be the probability that it is of the point: more than one cannot
    /// be sure.
    pub(super) fn share(&self, readings: &[Reading]) -> f64 {
        (1.0 - self.outlier) / readings.iter().map(|r| r.confidence).sum::<f64>().max(1.0)
    }

    /// Probability that none of the readings is of the point. Of a source that has to see it, doubtful readings or none at
    /// all speak against its being seen; one that need not has then said nothing.
    pub(super) fn wrong(&self, readings: &[Reading]) -> f64 {
        if self.sees {
            return self.outlier;
        }
        1.0 - self.share(readings) * readings.iter().map(|r| r.confidence).sum::<f64>()
    }

    /// # Errors
    /// A number out of its range.
    pub fn checked(&self) -> Result<()> {
        for (what, value) in [("sd of a source", self.sd), ("depth_sd of a source", self.depth_sd)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::OutOfRange { what, value, needs: "it must be positive" });
            }
        }
        if !(self.outlier > 0.0 && self.outlier < 1.0) {
            let needs = "it must lie between 0 and 1";
            return Err(Error::OutOfRange { what: "outlier of a source", value: self.outlier, needs });
        }
        match self.offset.iter().chain([&self.depth_offset]).find(|v| !v.is_finite()) {
            Some(&value) => {
                Err(Error::OutOfRange { what: "offset of a source", value, needs: "it must be finite" })
            }
            None => Ok(()),
        }
    }
}

/// What a source that has looked says. A source that has not (it has another rate, or is switched off) has none.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// Which source, by its place in the list.
    pub source: usize,
    /// What may be the point; nothing where it found nothing.
    pub readings: &'a [Reading],
    /// Where it looked, square pixels: readings of something else are anywhere in it.
    pub area: f64,
}

/// Depths at which readings of something else may be, millimetres.
const DEPTH_RANGE: f64 = 3000.0;
/// How long a hidden point keeps its velocity, seconds.
const HIDDEN_MEMORY: f64 = 0.1;
/// Standard deviations of the velocity of a point that turns up elsewhere, in pixels and millimetres per second.
const JUMP_SPEED: [f64; 3] = [100.0, 100.0, 300.0];
/// Standard deviation of its depth about the last one, millimetres.
const JUMP_DEPTH: f64 = 250.0;

/// Place and velocity along an axis: means and covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axis {
    mean: [f64; 2],
    place: f64,
    cross: f64,
    speed: f64,
}

impl Axis {
    fn still(mean: f64, sd: f64, speed_sd: f64) -> Axis {
        Axis { mean: [mean, 0.0], place: sd * sd, cross: 0.0, speed: speed_sd * speed_sd }
    }

    /// Nearly constant velocity: the acceleration is white noise of spectral density `q`.
    fn moved(mut self, dt: f64, q: f64) -> Axis {
        self.mean[0] += dt * self.mean[1];
        self.place += dt * (2.0 * self.cross + dt * self.speed) + q * dt * dt * dt / 3.0;
        self.cross += dt * self.speed + q * dt * dt / 2.0;
        self.speed += q * dt;
        self
    }

    /// A walk without aim; the velocity is forgotten.
    fn wandered(mut self, dt: f64, spread: f64) -> Axis {
        let keep = Real::exp(-dt / HIDDEN_MEMORY);
        self.mean[0] += HIDDEN_MEMORY * (1.0 - keep) * self.mean[1];
        self.mean[1] *= keep;
        self.place += spread * spread * dt;
        self.cross *= keep;
        self.speed = keep * keep * self.speed + (1.0 - keep * keep) * spread * spread;
        self
    }

    fn update(&mut self, z: f64, variance: f64) {
        let total = self.place + variance;
        let gain = [self.place / total, self.cross / total];
        let innovation = z - self.mean[0];
        self.mean[0] += gain[0] * innovation;
        self.mean[1] += gain[1] * innovation;
        self.speed -= gain[1] * self.cross;
        self.cross *= 1.0 - gain[0];
        self.place *= 1.0 - gain[0];
    }
}

/// A history of answers, with the law of the place given it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Particle {
    /// To the right and down, pixels, and along the camera's axis, millimetres.
    axes: [Axis; 3],
    hidden: bool,
}

/// A point that may be anywhere in a frame, about a depth.
fn anywhere(frame: [f64; 2], depth: f64) -> [Axis; 3] {
    std::array::from_fn(|k| match k {
        0 | 1 => Axis::still(frame[k] / 2.0, frame[k] / 12_f64.sqrt(), JUMP_SPEED[k]),
        _ => Axis::still(depth, JUMP_DEPTH, JUMP_SPEED[k]),
    })
}

/// What is known after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Fused {
    /// Posterior mean of the place, pixels.
    pub at: [f64; 2],
    /// Its covariance.
    pub covariance: [[f64; 2]; 2],
    /// Posterior mean of the velocity, pixels per second.
    pub velocity: [f64; 2],
    /// Mean and variance of the depth, millimetres.
    pub depth: [f64; 2],
    /// Probability that the point is hidden from the cameras.
    pub p_lost: f64,
    /// Of every source the probability that one of its readings is the point; `None` where it has not looked.
    pub trust: Vec<Option<f64>>,
    /// Effective number of particles before resampling.
    pub ess: f64,
}

impl Fused {
    /// Whether the point is more likely hidden than seen.
    pub fn is_lost(&self) -> bool {
        self.p_lost > 0.5
    }
}

/// The filter.
#[derive(Clone, Debug)]
pub struct Fusion {
    settings: FusionSettings,
    sources: Vec<Source>,
    frame: [f64; 2],
    stream: Stream,
    time: Time,
    step: u64,
    particles: Vec<Particle>,
    weights: Vec<f64>,
    /// Of every particle and source, how sure the one drawn answer was.
    trust: Vec<f64>,
    resampler: Resampler,
    ancestors: Vec<u32>,
    spare: Vec<Particle>,
}

impl Fusion {
    /// A filter of a point that is at `first` with a standard deviation of `sd` pixels, as sure as that is; else it may be
    /// anywhere in frames of this size.
    ///
    /// # Errors
    /// Settings or sources out of range, a first place that is not finite.
    pub fn start(
        settings: FusionSettings,
        sources: Vec<Source>,
        (frame, first, sd): ((usize, usize), Reading, f64),
        (time, stream): (Time, Stream),
    ) -> Result<Fusion> {
        settings.checked()?;
        sources.iter().try_for_each(Source::checked)?;
        for value in [first.at[0], first.at[1], sd, first.depth_mm.unwrap_or(0.0)] {
            zerre::Error::finite("the first place", value)?;
        }
        let depth =
            first.depth_mm.map_or(Axis::still(2000.0, 1000.0, 300.0), |z| Axis::still(z, 50.0, 300.0));
        let [x, y] = first.at.map(|v| Axis::still(v, sd, 100.0));
        let n = settings.particles;
        let frame = [frame.0 as f64, frame.1 as f64];
        let there = Particle { axes: [x, y, depth], hidden: false };
        let elsewhere = Particle { axes: anywhere(frame, depth.mean[0]), hidden: false };
        // As many particles hold the first place to be right as it is sure, at least one.
        let sure = ((first.confidence * n as f64).round() as usize).clamp(1, n);
        let mut particles = vec![elsewhere; n];
        particles[..sure].fill(there);
        Ok(Fusion {
            frame,
            stream,
            time,
            step: 0,
            particles,
            weights: vec![1.0 / n as f64; n],
            trust: Vec::new(),
            resampler: Resampler::new(Resampling::Systematic),
            ancestors: vec![0; n],
            spare: Vec::with_capacity(n),
            settings,
            sources,
        })
    }

    /// The sources, in the order that [`Evidence::source`] counts them.
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Where the point will be, if it goes on as it does: mean and standard deviation in pixels, and those of its depth in
    /// millimetres.
    pub fn foretell(&self, to: Time) -> ([f64; 2], f64, [f64; 2]) {
        let dt = (to - self.time).secs();
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        for (particle, weight) in self.particles.iter().zip(&self.weights) {
            let moved = self.moved(particle, dt);
            for (k, axis) in moved.axes.iter().enumerate() {
                sum[k] += weight * axis.mean[0];
                squares[k] += weight * (axis.place + axis.mean[0] * axis.mean[0]);
            }
        }
        let variance = |k: usize| (squares[k] - sum[k] * sum[k]).max(0.0);
        ([sum[0], sum[1]], ((variance(0) + variance(1)) / 2.0).sqrt(), [sum[2], variance(2).sqrt()])
    }

    /// The particles' places and weights.
    pub fn particles(&self) -> impl Iterator<Item = ([f64; 2], f64)> {
        let places = self.particles.iter().map(|p| [p.axes[0].mean[0], p.axes[1].mean[0]]);
        places.zip(self.weights.iter().copied())
    }

    fn moved(&self, particle: &Particle, dt: f64) -> Particle {
        let FusionSettings { acceleration, depth_acceleration, hidden_spread, .. } = self.settings;
        let mut moved = *particle;
        for (k, axis) in moved.axes.iter_mut().enumerate() {
            *axis = if particle.hidden {
                axis.wandered(dt, if k < 2 { hidden_spread } else { 10.0 * hidden_spread })
            } else {
                axis.moved(dt, (if k < 2 { acceleration } else { depth_acceleration }).square())
            };
        }
        moved
    }

    /// What the sources say of a particle: an answer for each of them is drawn. Returns the evidence, relative to that of
    /// readings which are all of something else.
    fn hear(
        &self,
        particle: &mut Particle,
        evidence: &[Evidence<'_>],
        draws: &mut Draws,
        trust: &mut [f64],
    ) -> f64 {
        let mut total = 1.0;
        for Evidence { source: number, readings, area } in evidence {
            let source = &self.sources[*number];
            trust[*number] = 0.0;
            if particle.hidden && source.sees {
                continue;
            }
            let guess = if particle.hidden { self.settings.hidden_sd.square() } else { 0.0 };
            let variance = source.sd * source.sd + guess;
            let spread = [particle.axes[0].place + variance, particle.axes[1].place + variance];
            let scale = area / (TAU * (spread[0] * spread[1]).sqrt());
            let deep = particle.axes[2].place + source.depth_sd * source.depth_sd;
            let deep_scale = DEPTH_RANGE / (TAU * deep).sqrt();
            let share = source.share(readings);
            let of = |reading: &Reading| {
                let [dx, dy] = [0, 1].map(|k| reading.at[k] - source.offset[k] - particle.axes[k].mean[0]);
                let mut distance = dx * dx / spread[0] + dy * dy / spread[1];
                let mut scale = scale * share * reading.confidence;
                if let Some(depth) = reading.depth_mm {
                    distance += (depth - source.depth_offset - particle.axes[2].mean[0]).square() / deep;
                    scale *= deep_scale;
                }
                scale * Real::exp(-0.5 * distance)
            };
            let good: f64 = readings.iter().map(of).sum();
            let outlier = source.wrong(readings);
            let sum = outlier + good;
            total *= sum;
            trust[*number] = good / sum;
            let mut rest = draws.uniform() * sum - outlier;
            if rest < 0.0 || good == 0.0 {
                continue;
            }
            let mut chosen = None;
            for reading in readings.iter().filter(|r| r.confidence > 0.0) {
                chosen = Some(reading);
                rest -= of(reading);
                if rest < 0.0 {
                    break;
                }
            }
            if let Some(reading) = chosen {
                for k in 0..2 {
                    particle.axes[k].update(reading.at[k] - source.offset[k], variance);
                }
                if let Some(depth) = reading.depth_mm {
                    particle.axes[2].update(depth - source.depth_offset, source.depth_sd * source.depth_sd);
                }
            }
        }
        total
    }

    /// Time passes, and the sources speak.
    ///
    /// # Errors
    /// A time before the last one, a source that is not in the list, a reading that is not finite, an area that is not
    /// positive; nothing has changed then.
    pub fn step(&mut self, to: Time, evidence: &[Evidence<'_>]) -> Result<Fused> {
        if to < self.time {
            return Err(zerre::Error::OutOfOrder { from: self.time, to }.into());
        }
        for said in evidence {
            if said.source >= self.sources.len() {
                let (found, expected) = (said.source, self.sources.len());
                return Err(zerre::Error::Shape {
                    what: "number of a source (from 0, below)",
                    found,
                    expected,
                }
                .into());
            }
            if !(said.area > 0.0 && said.area.is_finite()) {
                let needs = "it must be positive";
                return Err(Error::OutOfRange { what: "area of a source", value: said.area, needs });
            }
            for reading in said.readings {
                reading.checked()?;
            }
        }
        let dt = (to - self.time).secs();
        (self.time, self.step) = (to, self.step + 1);
        let chance = |rate: f64| 1.0 - Real::exp(-rate * dt);
        let [hides, returns, jumps] =
            [self.settings.hides, self.settings.returns, self.settings.jumps].map(chance);
        let count = self.sources.len();
        let mut particles = std::mem::take(&mut self.particles);
        let mut weights = std::mem::take(&mut self.weights);
        let mut trust = std::mem::take(&mut self.trust);
        trust.resize(particles.len() * count, 0.0);
        let mut said = vec![0.0; 3 * count];
        for (i, (particle, weight)) in particles.iter_mut().zip(&mut weights).enumerate() {
            let mut draws = self.stream.draws(Purpose::Mode, self.step, i as u32);
            let hidden = particle.hidden;
            let moved = self.moved(particle, dt);
            let anywhere = anywhere(self.frame, moved.axes[2].mean[0]);
            let stays = if hidden { 0.5 * returns } else { (1.0 - hides) * (1.0 - jumps) };
            let turns_up = if hidden { 0.5 * returns } else { (1.0 - hides) * jumps };
            let mut branches = [
                (stays, Particle { hidden: false, ..moved }),
                (turns_up, Particle { axes: anywhere, hidden: false }),
                (1.0 - stays - turns_up, Particle { hidden: true, ..moved }),
            ];
            let mut sum = 0.0;
            for ((probability, branch), trust) in branches.iter_mut().zip(said.chunks_mut(count.max(1))) {
                *probability *= self.hear(branch, evidence, &mut draws, trust);
                sum += *probability;
            }
            let mut rest = draws.uniform() * sum;
            let mut chosen = 0;
            for (k, (probability, _)) in branches.iter().enumerate() {
                if *probability > 0.0 {
                    chosen = k;
                    rest -= probability;
                    if rest < 0.0 {
                        break;
                    }
                }
            }
            *particle = branches[chosen].1;
            *weight *= sum;
            trust[i * count..(i + 1) * count].copy_from_slice(&said[chosen * count..(chosen + 1) * count]);
        }
        (self.particles, self.trust) = (particles, trust);
        let sum: f64 = weights.iter().sum();
        let n = weights.len() as f64;
        // An outlier has a probability, so no weight is 0; underflow is met as a doubt of everything.
        let sound = sum > 0.0 && sum.is_finite();
        weights.iter_mut().for_each(|w| *w = if sound { *w / sum } else { 1.0 / n });
        self.weights = weights;
        let fused = self.summary(evidence);
        self.resample(fused.ess)?;
        Ok(fused)
    }

    fn summary(&self, evidence: &[Evidence<'_>]) -> Fused {
        let mut mean = [0.0; 3];
        let (mut velocity, mut p_lost, mut squares) = ([0.0; 2], 0.0, 0.0);
        let mut trust = vec![None; self.sources.len()];
        evidence.iter().for_each(|said| trust[said.source] = Some(0.0));
        for (i, (particle, w)) in self.particles.iter().zip(&self.weights).enumerate() {
            for k in 0..3 {
                mean[k] += w * particle.axes[k].mean[0];
            }
            for k in 0..2 {
                velocity[k] += w * particle.axes[k].mean[1];
            }
            p_lost += if particle.hidden { *w } else { 0.0 };
            squares += w * w;
            for (source, trust) in trust.iter_mut().enumerate() {
                if let Some(trust) = trust {
                    *trust += w * self.trust[i * self.sources.len() + source];
                }
            }
        }
        let mut covariance = [[0.0; 2]; 2];
        let mut deep = 0.0;
        for (particle, w) in self.particles.iter().zip(&self.weights) {
            let off: [f64; 3] = std::array::from_fn(|k| particle.axes[k].mean[0] - mean[k]);
            for i in 0..2 {
                covariance[i][i] += w * particle.axes[i].place;
                for j in 0..2 {
                    covariance[i][j] += w * off[i] * off[j];
                }
            }
            deep += w * (particle.axes[2].place + off[2] * off[2]);
        }
        Fused {
            at: [mean[0], mean[1]],
            covariance,
            velocity,
            depth: [mean[2], deep],
            p_lost,
            trust,
            ess: 1.0 / squares,
        }
    }

    fn resample(&mut self, ess: f64) -> Result<()> {
        let n = self.particles.len();
        if !Trigger::default().fires(ess, n) {
            return Ok(());
        }
        self.resampler.ancestors(&self.weights, self.stream, self.step, &mut self.ancestors)?;
        self.spare.clear();
        self.spare.extend(self.ancestors.iter().map(|&a| self.particles[a as usize]));
        std::mem::swap(&mut self.particles, &mut self.spare);
        self.weights.fill(1.0 / n as f64);
        Ok(())
    }
}
