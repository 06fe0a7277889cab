//! Noises that nobody told, learnt from the recording itself: the most likely ones.

use super::Plot;
use super::belief::Belief;
use super::kind::{Form, Kind, has_modes};
use super::modes::{ModeSpec, Moves};
use super::motion::{WithMotion, with_motion};
use super::row::{Event, Innovation};
use super::rules::{Foretold, Rules};
use super::sensor::{Frame, Noise};
use super::spec::{Engine, TrackerSpec};
use super::tail::Robust;
use crate::error::{Error, Result};
use crate::filter::Outcome;
use crate::math::simplex::{Search, climb};
use crate::math::{exp, ln};
use crate::model::Motion;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A number to learn.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Unknown {
    /// The standard deviation of this noise of this sensor.
    Sensor(String, Noise),
    /// How much the motion wanders: [`MotionSpec::wander`](super::MotionSpec::wander).
    Motion,
    /// The mean time in a mode: [`ModeSpec::stay_s`].
    Stay,
    /// The rate of the turning modes: [`ModeSpec::turn_rate_rad_s`].
    TurnRate,
    /// The noise of the manoeuvring mode: [`ModeSpec::manoeuvre_factor`].
    Manoeuvre,
}

impl Unknown {
    /// Whether only filters with modes have it.
    fn is_of_modes(&self) -> bool {
        matches!(self, Unknown::Stay | Unknown::TurnRate | Unknown::Manoeuvre)
    }
}

/// What was learnt.
#[derive(Clone, Debug, PartialEq)]
pub struct Learnt {
    /// The specification with the numbers in it.
    pub spec: TrackerSpec,
    /// The numbers, in the order asked for; SI units and radians.
    pub values: Vec<f64>,
    /// How many plots were used.
    pub plots: usize,
    /// Of how many targets.
    pub targets: usize,
    /// Sensors that got [`HEAVY_TAILS`], and by how much that raised the log-evidence of the unscented filter.
    pub heavy_tails: Option<(Vec<String>, f64)>,
}

/// What learning tries beside the normal law: few outliers move nothing, and the bulk is nearly normal.
pub const HEAVY_TAILS: Robust = Robust::StudentT { dof: 4.0 };

/// So many plots tell two or three numbers to a few per cent, in well under a second.
const MOST_PLOTS: usize = 1000;
/// More targets would leave too few plots for each.
const MOST_TARGETS: usize = 20;
/// Natural units of log-evidence by which heavier tails must win: a law with one more number has to earn it.
const CLEARLY: f64 = 3.0;

/// Least share of the measurement noise in the innovation's variance. Recordings that a receiver has smoothed are most
/// likely under no noise at all; estimates then are the measurements, and stay so up to this share, while particles
/// need a likelihood that is not much narrower than what was foretold.
const LEAST_SHARE: f64 = 0.05;

/// The values of `unknown` under which the extended Kalman filter (for filters with modes, `imm-ekf`) gives
/// the plots the largest evidence; all else is as `spec` says, but that sensors whose noise is learnt get
/// [`HEAVY_TAILS`] where no law is given and the evidence is clearly for them. Plots are in order of time;
/// the first thousand of at most twenty targets count. A noise of which the recording tells no more than that
/// it is small against the wandering of the motion is set to where it makes a twentieth of the innovation's
/// variance. For filters with particles the evidence is less what they lose on innovations that they do not
/// reach: a rare manoeuvre must not leave all of them behind.
///
/// The search is a coarse grid (a common factor on all sensors by the motion) and then the simplex of Nelder and
/// Mead (Computer Journal 7, 1965) on the logarithms: deterministic. With modes all numbers are searched for together
/// from where the one motion was most likely and less, with few values of those of the modes.
///
/// # Errors
/// Plots that tell nothing (no target is measured twice), and what the models refuse.
pub fn learn(spec: &TrackerSpec, unknown: &[Unknown], plots: &[Plot]) -> Result<Learnt> {
    let chosen = choose(plots);
    let count = chosen.iter().map(Vec::len).sum::<usize>();
    if count < 2 * unknown.len() {
        let text = match count {
            0 => "no target is measured more than once, and one measurement tells nothing of its own noise"
                .to_owned(),
            _ => format!("{count} measurements are too few to learn {} noises from", unknown.len()),
        };
        return Err(Error::Unsupported(text));
    }
    let mut spec = spec.clone();
    let kind = Kind::named(&spec.filter.name)?;
    let filter = std::mem::replace(&mut spec.filter.name, kind.stand_in().to_owned());
    let open: Vec<String> = spec
        .sensors
        .iter()
        .filter(|(name, sensor)| {
            let asked = |u: &Unknown| matches!(u, Unknown::Sensor(other, _) if other == *name);
            sensor.robust.is_none() && unknown.iter().any(asked)
        })
        .map(|(name, _)| name.clone())
        .collect();
    let reach = kind.has_particles().then(|| reach_of(spec.filter.particles, spec.dimensions));
    let learnt = |mut spec: TrackerSpec| -> Result<(TrackerSpec, Vec<f64>, f64)> {
        let (log_evidence, logs) = search(&spec, unknown, &chosen, reach)?;
        set(&mut spec, unknown, &logs);
        spec.filter.name.clone_from(&filter);
        Ok((spec, logs, log_evidence))
    };
    let (mut best, mut logs, log_evidence) = learnt(spec.clone())?;
    if !log_evidence.is_finite() {
        let text = "the recording tells nothing of the noises: measurements of a target must follow each other within \
                    max_gap, and where none gives a position its start needs position_m and position_sd_m; or give \
                    the noises";
        return Err(Error::Unsupported(text.to_owned()));
    }
    let mut heavy_tails = None;
    if !open.is_empty() {
        for name in &open {
            spec.sensors.entry(name.clone()).or_default().robust = Some(HEAVY_TAILS);
        }
        let (heavy, heavy_logs, _) = learnt(spec)?;
        let gain = trial(&heavy, &chosen) - trial(&best, &chosen);
        if gain > CLEARLY {
            heavy_tails = Some((open, gain));
            (best, logs) = (heavy, heavy_logs);
        }
    }
    let values = logs.iter().map(|&log| rounded(exp(log))).collect();
    Ok(Learnt { spec: best, values, plots: count, targets: chosen.len(), heavy_tails })
}

/// Log-evidence of the plots under the unscented filter, with modes if the filter has them (one of the Kalman
/// family with modes stands for itself); -inf where it refuses the models. A restart counts as much as a
/// measurement that is all but impossible. Not under particles: where the noise of the motion is small they
/// collapse, and what they then make of a measurement says nothing of the law of its errors.
fn trial(spec: &TrackerSpec, targets: &[Vec<&Plot>]) -> f64 {
    const RESTART: f64 = -100.0;
    // What a gate refuses has no evidence that could be compared: both sides take every measurement.
    let mut spec = spec.clone();
    match Kind::named(&spec.filter.name) {
        Ok(kind) if !kind.modes => spec.filter.name = "ukf".to_owned(),
        Ok(kind) if kind.form != Form::Gaussian => spec.filter.name = "imm-ukf".to_owned(),
        _ => {}
    }
    spec.sensors.values_mut().for_each(|sensor| sensor.gate = None);
    let Ok(mut tracker) = spec.build(Engine::default()) else { return f64::NEG_INFINITY };
    let mut total = 0.0;
    for plot in targets.iter().flatten() {
        match tracker.push(plot) {
            Err(_) => return f64::NEG_INFINITY,
            Ok(row) => {
                let evidence = row.update.map_or(0.0, |update| update.log_evidence);
                let lost = matches!(row.event, Event::Degenerate | Event::Restarted);
                total += if lost || !evidence.is_finite() { RESTART } else { evidence };
            }
        }
    }
    total
}

/// The highest evidence and the logarithms of the unknown where it is.
fn search(
    spec: &TrackerSpec,
    unknown: &[Unknown],
    targets: &[Vec<&Plot>],
    reach: Option<f64>,
) -> Result<(f64, Vec<f64>)> {
    if has_modes(&spec.filter.name) {
        return search_modes(spec, unknown, targets, reach);
    }
    let evidence = |logs: &[f64]| evidence_of(spec, unknown, logs, targets, reach);
    let start = sizes(unknown);
    let mut best = (f64::NEG_INFINITY, start.clone());
    // Steps of a factor of four; without one of the two kinds its axis is walked once.
    let idle = |is_motion: bool| !unknown.iter().any(|u| (*u == Unknown::Motion) == is_motion);
    for sensors in -3..=3 {
        for motion in -3..=3 {
            if (idle(true) && motion != 0) || (idle(false) && sensors != 0) {
                continue;
            }
            let moved = |u: &Unknown| f64::from(if *u == Unknown::Motion { motion } else { sensors });
            let logs: Vec<f64> = start.iter().zip(unknown).map(|(s, u)| s + moved(u) * ln(4.0)).collect();
            let value = evidence(&logs)?;
            if value > best.0 {
                best = (value, logs);
            }
        }
    }
    climb_from(&best.1, &start, &evidence)
}

/// The same for a filter with modes.
fn search_modes(
    spec: &TrackerSpec,
    unknown: &[Unknown],
    targets: &[Vec<&Plot>],
    reach: Option<f64>,
) -> Result<(f64, Vec<f64>)> {
    let evidence = |logs: &[f64]| evidence_of(spec, unknown, logs, targets, reach);
    let start = sizes(unknown);
    // Without modes first: that is quick, and its noises are near those sought.
    let mut plain = spec.clone();
    plain.filter.name = "ekf".to_owned();
    let of_plain: Vec<Unknown> = unknown.iter().filter(|u| !u.is_of_modes()).cloned().collect();
    let (_, plain_logs) =
        if of_plain.is_empty() { (0.0, Vec::new()) } else { search(&plain, &of_plain, targets, None)? };
    let mut known = plain_logs.into_iter();
    let near: Vec<f64> = unknown
        .iter()
        .zip(&start)
        .map(|(u, &size)| if u.is_of_modes() { size } else { known.next().unwrap_or(size) })
        .collect();
    let mut best = (f64::NEG_INFINITY, near.clone());
    for (quiet, stay, rate) in [1.0, 0.3, 0.1]
        .into_iter()
        .flat_map(|q| [0.5, 2.0].map(|s| (q, s)))
        .flat_map(|(q, s)| [0.3, 1.0, 3.0].map(|r| (q, s, r)))
    {
        let factor = |u: &Unknown| match u {
            Unknown::Motion => quiet,
            Unknown::Stay => stay,
            Unknown::TurnRate => rate,
            _ => 1.0,
        };
        let logs: Vec<f64> = near.iter().zip(unknown).map(|(log, u)| log + ln(factor(u))).collect();
        let value = evidence(&logs)?;
        if value > best.0 {
            best = (value, logs);
        }
    }
    climb_from(&best.1, &start, &evidence)
}

/// Where the search starts.
fn sizes(unknown: &[Unknown]) -> Vec<f64> {
    unknown.iter().map(|u| ln(typical(u))).collect()
}

fn evidence_of(
    spec: &TrackerSpec,
    unknown: &[Unknown],
    logs: &[f64],
    targets: &[Vec<&Plot>],
    reach: Option<f64>,
) -> Result<f64> {
    let mut candidate = spec.clone();
    set(&mut candidate, unknown, logs);
    let work = Evidence { spec: &candidate, targets, reach };
    let jumping = has_modes(&candidate.filter.name);
    with_motion(&candidate.motion, candidate.dimensions, jumping, work)
}

/// The highest evidence near `from`, not too far from the sizes of the things.
fn climb_from(
    from: &[f64],
    sizes: &[f64],
    evidence: &dyn Fn(&[f64]) -> Result<f64>,
) -> Result<(f64, Vec<f64>)> {
    // Numbers without any scatter (made ones) would drive the noises to zero.
    let far = |logs: &[f64]| logs.iter().zip(sizes).any(|(log, size)| (log - size).abs() > WIDEST);
    let search = Search { first: 0.5, close: CLOSE, turns: MOST_TURNS };
    let summit = climb(from, search, |logs| {
        Ok(if far(logs) { f64::NEG_INFINITY } else { evidence(logs).unwrap_or(f64::NEG_INFINITY) })
    })?;
    Ok((summit.height, summit.at))
}

/// Three digits: more are not known, and fewer are easier to read and to write down.
fn rounded(value: f64) -> f64 {
    let text = format!("{value:.2e}");
    text.parse().unwrap_or(value)
}

fn set(spec: &mut TrackerSpec, unknown: &[Unknown], logs: &[f64]) {
    for (unknown, &log) in unknown.iter().zip(logs) {
        let value = rounded(exp(log));
        match unknown {
            Unknown::Motion => spec.motion.set_wander(value),
            Unknown::Stay => spec.motion.modes.stay_s = Some(value),
            Unknown::TurnRate => spec.motion.modes.turn_rate_rad_s = Some(value),
            Unknown::Manoeuvre => spec.motion.modes.manoeuvre_factor = Some(value),
            Unknown::Sensor(name, noise) => {
                *spec.sensors.entry(name.clone()).or_default().sd_mut(*noise) = Some(value);
            }
        }
    }
}

/// Where the search starts: the size of the thing, not its value.
fn typical(unknown: &Unknown) -> f64 {
    match unknown {
        Unknown::Motion => 1.0,
        Unknown::Stay => ModeSpec::STAY_S,
        Unknown::TurnRate => ModeSpec::TURN_RATE_RAD_S,
        Unknown::Manoeuvre => ModeSpec::MANOEUVRE_FACTOR,
        Unknown::Sensor(_, Noise::Position) => 10.0,
        Unknown::Sensor(_, Noise::Range) => 10.0,
        Unknown::Sensor(_, Noise::Bearing | Noise::Elevation) => 0.01,
        Unknown::Sensor(_, Noise::RangeRate) => 1.0,
        Unknown::Sensor(_, Noise::Size) => 5.0,
        Unknown::Sensor(_, Noise::Orientation) => 0.1,
    }
}

/// The plots that count, by target: those that are measured most, each with as many of its first plots.
fn choose(plots: &[Plot]) -> Vec<Vec<&Plot>> {
    let mut by_target: BTreeMap<Option<&str>, Vec<&Plot>> = BTreeMap::new();
    for plot in plots {
        by_target.entry(plot.id.as_deref()).or_default().push(plot);
    }
    let mut targets: Vec<_> = by_target.into_values().filter(|plots| plots.len() > 1).collect();
    // A stable sort: equals stay in the order of their names.
    targets.sort_by_key(|plots| std::cmp::Reverse(plots.len()));
    targets.truncate(MOST_TARGETS);
    let each = MOST_PLOTS / targets.len().max(1);
    targets.iter_mut().for_each(|plots| plots.truncate(each));
    targets
}

/// Total log-evidence of the plots.
struct Evidence<'a> {
    spec: &'a TrackerSpec,
    targets: &'a [Vec<&'a Plot>],
    /// How many standard deviations of what is foretold the particles cover; `None` without particles.
    reach: Option<f64>,
}

/// How far n particles reach: the largest of m normal numbers is near sqrt(2 ln m), and spread over d dimensions of
/// a position there are m = n^(1/d) along each.
fn reach_of(particles: usize, dimensions: usize) -> f64 {
    (2.0 * ln(particles.max(2) as f64) / dimensions.max(1) as f64).sqrt()
}

/// Log-evidence that particles lose on an innovation beyond their reach. With `share` of the innovation's variance
/// being noise, the state that a normal law finds most likely lies (1 - share) of the way; where no particle is so
/// far out, the outermost has to explain the rest by noise.
fn shortfall(nis: f64, share: f64, reach: f64) -> f64 {
    let (distance, cover) = (nis.sqrt(), reach * (1.0 - share).max(0.0).sqrt());
    if distance * (1.0 - share) <= cover {
        return 0.0;
    }
    let beyond = distance - cover;
    0.5 * (reach * reach + beyond * beyond / share - nis)
}

/// Log-evidence that particles lose on a plot that `belief`, predicted to its time where it has modes,
/// foretold so: each mode has particles of its own, which reach as far as its law says.
fn beyond_reach<A, F, const N: usize, const W: usize, const D: usize>(
    rules: &Rules<A, F, N, W, D>,
    belief: &Belief<N>,
    plot: &Plot,
    foretold: &Foretold,
    reach: f64,
) -> Result<f64>
where
    A: Motion<N, W> + Clone + 'static,
    F: Frame<N, D>,
{
    let lost = |innovation: &Innovation| shortfall(innovation.nis, innovation.noise_share, reach);
    let Some(modes) = belief.by_mode()? else { return Ok(lost(&foretold.innovation)) };
    // Relative to the density that all of them have together: no evidence is too small for it.
    let (mut without, mut with) = (0.0, 0.0);
    for (j, probability) in modes.probabilities().iter().enumerate().filter(|(_, p)| **p > 0.0) {
        let Some(alone) = rules.innovation(modes.mode(j), plot.time, plot)? else { continue };
        let weight = ln(*probability) + alone.log_density - foretold.log_density;
        without += exp(weight);
        with += exp(weight - lost(&alone.innovation));
    }
    let loss = ln(without) - ln(with);
    Ok(if loss.is_finite() { loss } else { lost(&foretold.innovation) })
}

impl WithMotion for Evidence<'_> {
    type Out = f64;
    fn with<A, F, const N: usize, const W: usize, const D: usize>(self, moves: Moves<A>) -> Result<f64>
    where
        A: Motion<N, W> + Clone + 'static,
        F: Frame<N, D>,
    {
        let rules = Rules::<A, F, N, W, D>::new(self.spec, moves, Engine::default())?;
        let (mut total, mut shares, mut count) = (0.0, 0.0, 0.0);
        for plots in self.targets {
            let mut belief: Option<Belief<N>> = None;
            for plot in plots {
                let silent =
                    |b: &Belief<N>| plot.time - b.time() > self.spec.life.max_gap || plot.time < b.time();
                let Some(current) = belief.as_mut().filter(|b| !silent(b)) else {
                    let formed = |(law, _)| rules.form(rules.stream_of("", 1), plot.time, law, 0);
                    belief = rules.begin(plot)?.map(formed).transpose()?;
                    continue;
                };
                if matches!(current, Belief::Modal(_)) {
                    // An update after a prediction is the step; so it is predicted once, not twice.
                    rules.step(current, plot, false)?;
                }
                let Some(foretold) = rules.foretold(current, plot)? else { continue };
                (shares, count) = (shares + foretold.least_share, count + 1.0);
                let beyond_reach = match self.reach.filter(|_| rules.sensors.of(plot).is_normal()) {
                    Some(reach) => beyond_reach(&rules, current, plot, &foretold, reach)?,
                    None => 0.0,
                };
                let update = rules.step(current, plot, true)?;
                // What cannot be held in numbers counts as what it would be under the normal law.
                total += match update.outcome {
                    Outcome::Degenerate => foretold.log_density,
                    _ => update.log_evidence,
                };
                total -= beyond_reach;
            }
        }
        if count == 0.0 {
            return Ok(f64::NEG_INFINITY);
        }
        // A wall that the simplex can climb along: it costs more than any evidence gains.
        let lacking = (ln(LEAST_SHARE) - ln(shares / count)).max(0.0);
        let total = total - 10.0 * count * lacking * lacking;
        Ok(if total.is_finite() { total } else { f64::NEG_INFINITY })
    }
}

/// Logarithm of the largest factor between a noise and the size that is typical of it: 2.4e7.
const WIDEST: f64 = 17.0;
/// Turns that the simplex takes at most.
const MOST_TURNS: usize = 60;
/// Logarithms closer than this differ by less than one per cent: nothing that can be known.
const CLOSE: f64 = 0.01;
