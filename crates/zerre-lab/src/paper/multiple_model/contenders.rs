//! The filters that are compared, by the names of the tables, and one run of one of them.

use super::scenarios::{SCENARIOS, Scenario, World, times};
use super::settings::{NOISES, Setting};
use crate::study::drive::drive;
use serde::{Deserialize, Serialize};
use zerre::Result;
use zerre::belief::ModalGaussian;
use zerre::filter::{
    AfterResampling, Filter, ImmExtended, ImmParticle, ImmUnscented, ModalSettings, MultipleModel, Output,
    RaoBlackwell, Rule, ScaledResidual, SigmaPoints, Tangent, Unscented, Wsms as Selection,
};
use zerre::model::jump::MAX_MODES;
use zerre::resample::Resampling;
use zerre::rng::Stream;

/// A filter, by its name in the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub enum Algorithm {
    /// Every particle under every model; the mean of the survivors.
    #[serde(rename = "alg1")]
    Alg1,
    /// The same particles; the weighted mean of all before they are reduced.
    #[serde(rename = "alg2")]
    Alg2,
    /// The same particles; the mean of the model that erred least on the measurement before.
    #[serde(rename = "alg3")]
    Alg3,
    /// Algorithm 2 with one model alone while the errors are small.
    #[serde(rename = "alg2+wsms")]
    Alg2Wsms,
    /// Algorithm 3 with one model alone while the errors are small.
    #[serde(rename = "alg3+wsms")]
    Alg3Wsms,
    /// Interacting multiple models, unscented members.
    #[serde(rename = "imm-ukf")]
    ImmUkf,
    /// Interacting multiple models, extended members.
    #[serde(rename = "imm-ekf")]
    ImmEkf,
    /// Interacting multiple models of particles: as many in all as others have for each model.
    #[serde(rename = "imm-pf")]
    ImmPf,
    /// Particles of modes, each with a Gaussian.
    #[serde(rename = "rb-mmpf")]
    RbMmpf,
    /// An unscented filter that is told the mode: what knowing it is worth.
    #[serde(rename = "known-mode-ukf")]
    KnownModeUkf,
}

impl Algorithm {
    /// All of them, in the order of the tables.
    pub const ALL: [Algorithm; 10] = [
        Algorithm::Alg1,
        Algorithm::Alg2,
        Algorithm::Alg3,
        Algorithm::Alg2Wsms,
        Algorithm::Alg3Wsms,
        Algorithm::ImmUkf,
        Algorithm::ImmEkf,
        Algorithm::ImmPf,
        Algorithm::RbMmpf,
        Algorithm::KnownModeUkf,
    ];

    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Algorithm::Alg1 => "alg1",
            Algorithm::Alg2 => "alg2",
            Algorithm::Alg3 => "alg3",
            Algorithm::Alg2Wsms => "alg2+wsms",
            Algorithm::Alg3Wsms => "alg3+wsms",
            Algorithm::ImmUkf => "imm-ukf",
            Algorithm::ImmEkf => "imm-ekf",
            Algorithm::ImmPf => "imm-pf",
            Algorithm::RbMmpf => "rb-mmpf",
            Algorithm::KnownModeUkf => "known-mode-ukf",
        }
    }

    /// Which random numbers it uses: algorithms 1 to 3 of the thesis are one particle system with three outputs.
    fn family(self) -> u64 {
        match self {
            Algorithm::Alg1 | Algorithm::Alg2 | Algorithm::Alg3 => 1,
            Algorithm::Alg2Wsms => 2,
            Algorithm::Alg3Wsms => 3,
            Algorithm::ImmPf => 4,
            Algorithm::RbMmpf => 5,
            Algorithm::ImmUkf | Algorithm::ImmEkf | Algorithm::KnownModeUkf => 6,
        }
    }
}

/// How the selection of a single model adapts its window and its threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wsms {
    /// No selection: all models at every step.
    None,
    /// By constant factors.
    SemiDynamic,
    /// By the size of the error.
    Dynamic,
}

impl Wsms {
    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Wsms::None => "none",
            Wsms::SemiDynamic => "semi-dynamic",
            Wsms::Dynamic => "dynamic",
        }
    }
}

/// What the survivors of resampling weigh in the output of algorithm 1 (thesis, section 2.5.3.2, step 5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reading {
    /// The same: plain multinomial resampling.
    Equal,
    /// Their likelihood once more, in the output of the step.
    Recomputed,
    /// Their likelihood once more, in the output and in the weights of the next step.
    RecomputedKept,
}

impl Reading {
    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Reading::Equal => "equal",
            Reading::Recomputed => "recomputed",
            Reading::RecomputedKept => "recomputed-kept",
        }
    }
}

/// One cell of the experiment. The order is that of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cell {
    /// Place in the list of scenarios.
    pub scenario: usize,
    /// The filter.
    pub algorithm: Algorithm,
    /// Its selection of models.
    pub wsms: Wsms,
    /// Its settings.
    pub setting: Setting,
    /// Its reading of the thesis.
    pub reading: Reading,
    /// Its particles (hypotheses of the Rao-Blackwellised filter); 0 where there are none.
    pub particles: usize,
    /// Place in [`NOISES`].
    pub noise: usize,
}

impl Cell {
    /// The cell in words: the key of its results.
    pub fn key(&self) -> String {
        format!(
            "{} {} {} {} {} {} {}",
            self.scenario + 1,
            self.algorithm.name(),
            self.wsms.name(),
            self.setting.name(),
            self.reading.name(),
            self.particles,
            NOISES[self.noise]
        )
    }

    /// About how much work a run is, in particle moves: for the order of the jobs and for the bar.
    pub fn work(&self, models: usize) -> u64 {
        // A Gaussian update costs about a hundred particle moves.
        let (n, models) = (self.particles as u64, models as u64);
        match self.algorithm {
            Algorithm::ImmPf => n,
            Algorithm::RbMmpf => 100 * n * models,
            Algorithm::ImmUkf | Algorithm::ImmEkf => 100 * models,
            Algorithm::KnownModeUkf => 100,
            _ => n * models,
        }
    }
}

/// What one run of a filter gave.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Squared distances of estimate and truth at each step, km^2.
    pub squares: Vec<f64>,
    /// Estimated positions, km.
    pub track: Vec<[f64; 2]>,
    /// Probabilities of the modes at each step; empty where the filter has none.
    pub modes: Vec<Vec<f64>>,
    /// Steps on which a single model was computed, of those of a filter with several.
    pub single: usize,
    /// States or Gaussians moved by a model, over all steps.
    pub evaluations: u64,
    /// Processor time of the thread, s.
    pub seconds: f64,
    /// Steps whose measurement had no likelihood anywhere: the prediction stood.
    pub degenerate: usize,
    /// Steps from which on the filter refused to go on, or had no estimate: the last one stood.
    pub lost: usize,
}

/// What is seen of a belief after a step.
struct Glance {
    /// Estimated position, m.
    place: [f64; 2],
    /// How many modes have a probability.
    models: usize,
    /// Their probabilities.
    modes: [f64; MAX_MODES],
    /// Whether one model of several was computed.
    single: bool,
    /// States or Gaussians moved by a model.
    evaluations: usize,
}

impl Glance {
    fn new(mean: &[f64; 6], evaluations: usize) -> Glance {
        let place = [mean[0], mean[1]];
        Glance { place, models: 0, modes: [0.0; MAX_MODES], single: false, evaluations }
    }

    fn with_modes(mut self, probabilities: impl Iterator<Item = f64>) -> Glance {
        for (mode, p) in self.modes.iter_mut().zip(probabilities) {
            *mode = p;
            self.models += 1;
        }
        self
    }
}

/// Runs `filter` through `world`. A filter that refuses a step is lost: its last estimate stands to the end.
fn follow<F>(
    filter: &F,
    world: &World,
    stream: Stream,
    see: impl Fn(&F::Belief) -> Result<Glance>,
) -> Result<Run>
where
    F: Filter<Measurement = [f64; 2]>,
{
    let record = times().skip(1).zip(&world.measured);
    let driven = drive(filter, record, stream, |belief, _| {
        let glance = see(belief)?;
        Ok(glance.place.iter().all(|p| p.is_finite()).then_some(glance))
    })?;
    let mut run = Run { seconds: driven.seconds, degenerate: driven.degenerate, ..Run::default() };
    let glances = driven.seen;
    run.lost = world.truth.len() - glances.len();
    let start = world.prior.mean();
    let mut place = [start[0], start[1]];
    for (k, truth) in world.truth.iter().enumerate() {
        if let Some(glance) = glances.get(k) {
            place = glance.place;
            run.single += usize::from(glance.single);
            run.evaluations += glance.evaluations as u64;
            if glance.models > 0 {
                run.modes.push(glance.modes[..glance.models].to_vec());
            }
        }
        let off = [0, 1].map(|i| (place[i] - truth[i]) * 1e-3);
        run.squares.push(off[0] * off[0] + off[1] * off[1]);
        run.track.push(place.map(|p| p * 1e-3));
    }
    Ok(run)
}

/// The random numbers of run number `run` of a scenario.
fn luck(seed: u64, scenario: &Scenario, run: usize) -> Stream {
    Stream::new(seed).fork(STREAM).fork(u64::from(scenario.number)).fork(run as u64)
}

/// Labels of the streams: "mmpf" and "filter" in ASCII.
const STREAM: u64 = 0x6d6d_7066;
const FILTER: u64 = 0x6669_6c74_6572;

/// Run number `run` of a cell under `seed`.
///
/// # Errors
/// Settings that the library refuses: none of those here.
pub fn contend(cell: &Cell, seed: u64, run: usize) -> Result<Run> {
    let scenario = &SCENARIOS[cell.scenario];
    let luck = luck(seed, scenario, run);
    let world = scenario.world(NOISES[cell.noise], luck)?;
    let stream = luck.fork(FILTER).fork(cell.algorithm.family()).fork(cell.particles as u64);
    let assumed = cell.setting.assumed();
    let model = assumed.model(scenario)?;
    let models = model.modes().len();
    let points = SigmaPoints::default();
    let World { sensor, prior, .. } = world;
    match cell.algorithm {
        Algorithm::Alg1 | Algorithm::Alg2 | Algorithm::Alg3 | Algorithm::Alg2Wsms | Algorithm::Alg3Wsms => {
            let filter = MultipleModel::new(prior, model, sensor, multinomial(cell.particles))?
                .with_error(ScaledResidual { sensor, scale: THESIS_ERROR })
                .with_output(match cell.algorithm {
                    Algorithm::Alg1 => Output::Survivors,
                    Algorithm::Alg3 | Algorithm::Alg3Wsms => Output::LeastError,
                    _ => Output::Mixture,
                })?
                .with_after_resampling(match cell.reading {
                    Reading::Equal => AfterResampling::Equal,
                    Reading::Recomputed => AfterResampling::Recomputed,
                    Reading::RecomputedKept => AfterResampling::RecomputedKept,
                });
            let filter = match cell.wsms {
                Wsms::None => filter,
                Wsms::SemiDynamic => filter.with_selection(rules(Rule::semi_dynamic()))?,
                Wsms::Dynamic => filter.with_selection(rules(Rule::Dynamic))?,
            };
            follow(&filter, &world, stream, |belief| {
                let computed = belief.models_computed();
                let glance = Glance::new(&belief.estimate(), computed * cell.particles);
                let single = computed == 1 && models > 1;
                Ok(Glance { single, ..glance.with_modes(belief.cloud().probabilities()) })
            })
        }
        Algorithm::ImmUkf => {
            let filter = ImmUnscented::new(points, model, sensor, prior)?;
            follow(&filter, &world, stream, |belief| gaussians(belief, models))
        }
        Algorithm::ImmEkf => {
            let filter = ImmExtended::new(Tangent, model, sensor, prior)?;
            follow(&filter, &world, stream, |belief| gaussians(belief, models))
        }
        Algorithm::RbMmpf => {
            let filter = RaoBlackwell::new(points, model, sensor, prior, cell.particles)?;
            follow(&filter, &world, stream, |belief| {
                let glance = Glance::new(&belief.mean(), belief.len());
                Ok(glance.with_modes((0..models).map(|mode| belief.probability(mode))))
            })
        }
        Algorithm::ImmPf => {
            let filter = ImmParticle::new(prior, model, sensor, multinomial(cell.particles))?;
            follow(&filter, &world, stream, |cloud| {
                Ok(Glance::new(&cloud.mean(), cell.particles).with_modes(cloud.probabilities()))
            })
        }
        Algorithm::KnownModeUkf => {
            let filter = Unscented::new(assumed.script(scenario)?, sensor, prior, points)?;
            follow(&filter, &world, stream, |belief| Ok(Glance::new(belief.state.mean(), 1)))
        }
    }
}

/// Factors that make kilometres of metres and leave radians alone: the error of the thesis adds their squares.
const THESIS_ERROR: [f64; 2] = [1e-3, 1.0];

/// The settings of the thesis's particles: multinomial resampling at every step.
fn multinomial(particles: usize) -> ModalSettings {
    ModalSettings { particles, resampling: Resampling::Multinomial, ..ModalSettings::default() }
}

/// The selection with its default window and threshold.
fn rules(rule: Rule) -> Selection {
    Selection { rule, ..Selection::default() }
}

fn gaussians(belief: &ModalGaussian<6>, models: usize) -> Result<Glance> {
    let glance = Glance::new(belief.combined()?.mean(), models);
    Ok(glance.with_modes(belief.probabilities().iter().copied()))
}
