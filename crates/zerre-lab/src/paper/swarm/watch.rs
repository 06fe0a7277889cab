//! Filters step by step beside the exact posterior.

use super::methods::{Entrant, How};
use super::settings::COVERAGE;
use crate::study::drive::{Driven, drive};
use crate::study::marginal::{Marginal, Marginals};
use crate::study::world::{Problem, Record};
use serde::{Deserialize, Serialize};
use zerre::belief::{Cloud, GridBelief, MovedCloud, Pull, SwarmBelief};
use zerre::filter::{
    Filter, Grid, Kernel, ParticleFilter, Rejuvenation, ResampleMove, Settings, SigmaPoints, SwarmFilter,
    SwarmImportance, Tangent, Tempered, Update,
};
use zerre::model::{GaussianMeasurement, Measurement, Motion};
use zerre::proposal::Guided;
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::{Result, Time};

/// A record to go through by models that are those of the record, or not.
#[derive(Debug)]
pub struct Task<'a, A, H> {
    /// What filters are told.
    pub told: &'a Problem<A, H, 1>,
    /// What there is.
    pub record: &'a Record<1, 1>,
    /// Random numbers of the filter.
    pub stream: Stream,
}

/// The exact posterior after one step.
#[derive(Clone, Debug, PartialEq)]
pub struct Exact {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Its central 90 % interval.
    pub band: [f64; 2],
    law: Marginal,
}

/// What one step of a filter came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What the filter says where the state is.
    pub estimate: f64,
    /// The central 90 % interval, where it was asked for.
    pub band: Option<[f64; 2]>,
    /// Score of the law.
    pub crps: f64,
    /// Whether the central 90 % interval holds the truth.
    pub inside: bool,
    /// 1-Wasserstein distance to the exact posterior.
    pub w1: Option<f64>,
    /// Shift of the mean by the move, in standard deviations of the exact posterior.
    pub pull: Option<f64>,
    /// Standard deviations of the particles before the move and after.
    pub spread: Option<[f64; 2]>,
    /// Normalised innovation squared.
    pub nis: Option<f64>,
    /// Effective sample size of the weights as a share of the particles.
    pub ess: Option<f64>,
    /// Evaluations of the likelihood.
    pub evaluations: usize,
}

impl Step {
    fn of(law: &mut Marginal, estimate: f64, truth: f64) -> Step {
        Step {
            estimate,
            band: None,
            crps: law.crps(truth),
            inside: law.covers(truth, COVERAGE),
            w1: None,
            pull: None,
            spread: None,
            nis: None,
            ess: None,
            evaluations: 0,
        }
    }
}

/// A filter's way through a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Followed {
    /// What it saw, as far as it came.
    pub steps: Vec<Step>,
    /// Steps whose measurement had no likelihood anywhere.
    pub degenerate: usize,
    /// Processor time, s.
    pub seconds: f64,
}

impl<T> From<(Vec<Step>, &Driven<T>)> for Followed {
    fn from((steps, driven): (Vec<Step>, &Driven<T>)) -> Followed {
        Followed { steps, degenerate: driven.degenerate, seconds: driven.seconds }
    }
}

/// What can be seen of a belief.
trait Watched: Marginals {
    /// What it says where the state is, if that is not its mean.
    fn estimate(&self) -> Option<f64> {
        None
    }

    /// What the last move did.
    fn pull(&self) -> Option<Pull<1>> {
        None
    }

    /// The ends of the central interval.
    fn band(&self, levels: [f64; 2]) -> Result<[f64; 2]>;

    /// The particles as predicted, where the weights are those of the last measurement alone.
    fn predicted(&self) -> Option<&[f64]> {
        None
    }
}

impl Watched for Cloud<1> {
    fn band(&self, levels: [f64; 2]) -> Result<[f64; 2]> {
        self.quantiles(0, levels)
    }

    fn predicted(&self) -> Option<&[f64]> {
        Some(self.column(0))
    }
}

impl Watched for MovedCloud<1> {
    fn pull(&self) -> Option<Pull<1>> {
        MovedCloud::pull(self)
    }

    fn band(&self, levels: [f64; 2]) -> Result<[f64; 2]> {
        self.cloud().quantiles(0, levels)
    }
}

impl Watched for SwarmBelief<1> {
    fn estimate(&self) -> Option<f64> {
        Some(SwarmBelief::estimate(self)[0])
    }

    fn pull(&self) -> Option<Pull<1>> {
        SwarmBelief::pull(self)
    }

    fn band(&self, levels: [f64; 2]) -> Result<[f64; 2]> {
        self.cloud().quantiles(0, levels)
    }
}

impl Watched for GridBelief<1> {
    fn band(&self, levels: [f64; 2]) -> Result<[f64; 2]> {
        self.quantiles(0, levels)
    }
}

/// The levels of the central interval.
const LEVELS: [f64; 2] = [0.5 * (1.0 - COVERAGE), 0.5 * (1.0 + COVERAGE)];

impl<A, H> Task<'_, A, H>
where
    A: Motion<1, 1> + Clone,
    H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone,
{
    fn seen(&self) -> impl Iterator<Item = (Time, &[f64; 1])> {
        self.record.times.iter().copied().zip(&self.record.measured)
    }

    /// The exact posterior of what filters are told, and its own way through the record.
    ///
    /// # Errors
    /// A motion without a density; a grid that lost the law.
    pub fn exact(&self, nodes: usize) -> Result<(Vec<Exact>, Followed)> {
        let Problem { prior, motion, sensor, .. } = self.told.clone();
        let grid = Grid::new(prior, motion, sensor)?.with_nodes(nodes)?;
        let mut steps = Vec::with_capacity(self.record.truth.len());
        let see = |belief: &GridBelief<1>, _: &Update| {
            let mut law = Marginal::default();
            belief.marginal(0, &mut law);
            let (mean, sd, band) = (law.mean(), law.sd(), belief.band(LEVELS)?);
            let [truth] = self.record.truth[steps.len()];
            let evaluations = belief.evaluations();
            steps.push(Step { band: Some(band), evaluations, ..Step::of(&mut law, mean, truth) });
            Ok(Some(Exact { mean, sd, band, law }))
        };
        let mut driven = drive(&grid, self.seen(), self.stream, see)?;
        match driven.refusal.take() {
            Some(error) => Err(error),
            None => Ok((std::mem::take(&mut driven.seen), (steps, &driven).into())),
        }
    }

    /// Lets `entrant` go through the record beside the exact posterior, where that is known.
    ///
    /// # Errors
    /// What the library refuses.
    pub fn follow(&self, entrant: &Entrant, beside: Beside<'_>) -> Result<Followed> {
        let Problem { prior, motion, sensor, .. } = self.told.clone();
        let settings = Settings { particles: entrant.particles, ..Settings::default() };
        let every = Settings { trigger: Trigger::Always, ..settings.clone() };
        match entrant.how {
            How::Exact => self.exact(entrant.particles).map(|(_, followed)| followed),
            How::EveryStep => {
                let beside = Beside { innovations: true, ..beside };
                self.through(&ParticleFilter::new(prior, motion, sensor, every)?, beside)
            }
            How::Bootstrap => self.through(&ParticleFilter::new(prior, motion, sensor, settings)?, beside),
            How::Auxiliary => {
                let settings = Settings { lookahead: Some(1.0), ..settings };
                self.through(&ParticleFilter::new(prior, motion, sensor, settings)?, beside)
            }
            How::Regularised => {
                let rejuvenation = Rejuvenation::Regularise { kernel: Kernel::Gaussian, shrink: true };
                let settings = Settings { rejuvenation, ..settings };
                self.through(&ParticleFilter::new(prior, motion, sensor, settings)?, beside)
            }
            How::EkfGuided => {
                let proposal = Guided::new(Tangent);
                self.through(&ParticleFilter::guided(prior, motion, sensor, proposal, settings)?, beside)
            }
            How::UkfGuided => {
                let proposal = Guided::new(SigmaPoints::default());
                self.through(&ParticleFilter::guided(prior, motion, sensor, proposal, settings)?, beside)
            }
            How::Swarm(swarm, readings) => {
                let inside = ParticleFilter::new(prior, motion, sensor, every)?;
                self.through(&SwarmFilter::new(inside, swarm, readings)?, beside)
            }
            How::Moves(kernel, sweeps) => {
                let inside = ParticleFilter::new(prior, motion, sensor, every)?;
                self.through(&ResampleMove::new(inside, kernel, sweeps)?, beside)
            }
            How::Tempered(kernel, sweeps) => {
                let inside = ParticleFilter::new(prior, motion, sensor, settings)?;
                self.through(&Tempered::new(inside, kernel, sweeps)?, beside)
            }
            How::Importance(swarm) => {
                let inside = ParticleFilter::new(prior, motion, sensor, settings)?;
                self.through(&SwarmImportance::new(inside, swarm)?, beside)
            }
        }
    }

    fn through<F>(&self, filter: &F, beside: Beside<'_>) -> Result<Followed>
    where
        F: Filter<Measurement = [f64; 1]>,
        F::Belief: Watched,
    {
        let Beside { mut exact, bands, innovations } = beside;
        let mut law = Marginal::default();
        let mut at = 0;
        let see = |belief: &F::Belief, update: &Update| {
            belief.marginal(0, &mut law);
            let mean = law.mean();
            let estimate = belief.estimate().unwrap_or(mean);
            // What is lost has no law that could be scored.
            if !(mean.is_finite() && estimate.is_finite()) {
                return Ok(None);
            }
            let [truth] = self.record.truth[at];
            let mut step = Step::of(&mut law, estimate, truth);
            let moved = belief.pull();
            step.spread = moved.as_ref().map(|pull| [pull.sd[0][0], pull.sd[1][0]]);
            if let Some(exact) = exact.as_deref_mut().and_then(|all| all.get_mut(at)) {
                step.w1 = law.wasserstein(&mut exact.law);
                step.pull = moved.map(|pull| (pull.mean[1][0] - pull.mean[0][0]) / exact.sd);
            }
            if bands {
                step.band = Some(belief.band(LEVELS)?);
            }
            if innovations {
                step.nis = belief.predicted().map(|states| self.innovation(at, states));
            }
            if let Some(particles) = update.particles {
                step.ess = Some(particles.ess / particles.particles.max(1) as f64);
                step.evaluations = particles.evaluations;
            }
            at += 1;
            Ok(step.crps.is_finite().then_some(step))
        };
        let mut driven = drive(filter, self.seen(), self.stream, see)?;
        Ok((std::mem::take(&mut driven.seen), &driven).into())
    }

    /// (z - m)^2 / (s^2 + R), m and s^2 being mean and variance of what these states would measure.
    fn innovation(&self, at: usize, states: &[f64]) -> f64 {
        let sensor = &self.told.sensor;
        let [noise] = sensor.covariance()[0];
        let seen = |x: &f64| sensor.predict(self.record.times[at], [*x])[0];
        let count = states.len() as f64;
        let mean = states.iter().map(seen).sum::<f64>() / count;
        let variance = states.iter().map(|x| (seen(x) - mean).powi(2)).sum::<f64>() / count;
        let [z] = self.record.measured[at];
        (z - mean).powi(2) / (variance + noise)
    }
}

/// What is looked at beside the filter itself.
#[derive(Debug, Default)]
pub struct Beside<'a> {
    /// The exact posterior.
    pub exact: Option<&'a mut [Exact]>,
    /// The filter's own intervals.
    pub bands: bool,
    /// Innovations, of filters that resample in every step.
    pub innovations: bool,
}

/// What one run of one filter came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Root mean square error over the steps.
    pub rmse: f64,
    /// Mean score.
    pub crps: f64,
    /// Share of steps whose central 90 % interval held the truth.
    pub coverage90: f64,
    /// Root mean square difference of the estimates from the means of the exact posterior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub posterior_error: Option<f64>,
    /// Mean 1-Wasserstein distance to the exact posterior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub w1: Option<f64>,
    /// Root mean square shift of the mean by the move, in standard deviations of the exact posterior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pull: Option<f64>,
    /// Root mean square spread of the particles after the move over that before, where there is some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<f64>,
    /// Mean normalised innovation squared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nis: Option<f64>,
    /// Mean effective sample size of the weights as a share of the particles, before any move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ess: Option<f64>,
    /// Root mean square error where the measurement is straight, in standard deviations of the estimate of
    /// the state by one measurement alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub straight_error: Option<f64>,
    /// Mean evaluations of the likelihood a step.
    pub evaluations: f64,
    /// Steps whose measurement had no likelihood anywhere.
    pub degenerate: usize,
    /// Steps that the filter did not reach.
    pub lost: usize,
    /// Mean processor time of a step, microseconds.
    pub microseconds: f64,
}

impl Run {
    /// Scores `followed`. A filter that is lost keeps its last estimate, at first `start`, and says no more
    /// how sure it is. `alone` is the standard deviation of the state given one straight measurement, where
    /// there are such.
    pub fn of(
        record: &Record<1, 1>,
        followed: &Followed,
        exact: Option<&[Exact]>,
        (start, alone): (f64, Option<f64>),
    ) -> Run {
        let Followed { steps, degenerate, seconds } = followed;
        let last = steps.last().map_or(start, |step| step.estimate);
        let truths = record.truth.iter().map(|[truth]| *truth);
        let estimates: Vec<f64> =
            (0..record.truth.len()).map(|k| steps.get(k).map_or(last, |step| step.estimate)).collect();
        let errors: Vec<f64> = estimates.iter().zip(truths).map(|(a, b)| (a - b).abs()).collect();
        let all = errors.len() as f64;
        let lost = &errors[steps.len()..];
        let square_mean = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v * v, count + 1));
            (count > 0).then(|| (sum / count as f64).sqrt())
        };
        let mean = |of: &dyn Fn(&Step) -> Option<f64>| {
            let values: Vec<f64> = steps.iter().filter_map(of).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let beside = |exact: &[Exact]| {
            let away = estimates.iter().zip(exact).map(|(estimate, exact)| estimate - exact.mean);
            (away.len() > 0).then(|| square_mean(&mut away.into_iter())).flatten()
        };
        // Where all survivors are copies of one there is no spread to keep.
        let kept = |(step, exact): (&Step, &Exact)| {
            step.spread.filter(|[before, _]| *before > LEAST_SPREAD * exact.sd)
        };
        let spreads = |which: usize| {
            square_mean(&mut steps.iter().zip(exact?).filter_map(kept).map(|spread| spread[which]))
        };
        let straight = record.times.iter().zip(&errors).filter(|(at, _)| at.secs() > STRAIGHT_AFTER);
        Run {
            rmse: square_mean(&mut errors.iter().copied()).unwrap_or_default(),
            crps: (steps.iter().map(|step| step.crps).sum::<f64>() + lost.iter().sum::<f64>()) / all,
            coverage90: steps.iter().filter(|step| step.inside).count() as f64 / all,
            posterior_error: exact.and_then(beside),
            w1: mean(&|step| step.w1),
            pull: square_mean(&mut steps.iter().filter_map(|step| step.pull)),
            spread: spreads(0)
                .zip(spreads(1))
                .map(|(before, after)| after / before)
                .filter(|r| r.is_finite()),
            nis: mean(&|step| step.nis),
            ess: mean(&|step| step.ess),
            straight_error: alone
                .and_then(|alone| square_mean(&mut straight.map(|(_, error)| error / alone))),
            evaluations: mean(&|step| Some(step.evaluations as f64)).unwrap_or_default(),
            degenerate: *degenerate,
            lost: lost.len(),
            microseconds: 1e6 * seconds / all,
        }
    }
}

/// In standard deviations of the exact posterior.
const LEAST_SPREAD: f64 = 1e-3;
/// The benchmark's measurement is a square up to this time, s.
const STRAIGHT_AFTER: f64 = 30.0;
