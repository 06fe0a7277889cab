//! Particle filters that swarms move: the paper's table again, and the same filters held against the exact
//! posterior.
//!
//! The paper lets a particle swarm or a colony of bees carry resampled particles to where the likelihood is
//! largest. A [`Request`] names tables; they are made of [`Scene`]s, in each of which many filters see the
//! same records, and [`SwarmFilters`] is all of it as an [`Experiment`]. A scene is done in blocks of runs,
//! the [`Cell`]s, so that the exact posterior of a run is computed once and shared by all filters.

pub mod dimensions;
mod methods;
mod pictures;
pub mod printed;
mod reading;
mod report;
pub mod settings;
mod tables;
mod watch;
mod words;

pub use reading::{Noise, Reading, Variance};
pub use tables::{Results, Row};
pub use watch::Run;

use super::Paper;
use crate::study::experiment::{Experiment, Finished, Mishap, SettingsFile};
use crate::study::world::{Place, Problem, Record, VisitScalar, label, with_growth};
use methods::{Entrant, How};
use printed::Printed;
use settings::{MAIN, MISFIT, QUICK_RUNS, READINGS, RUNS, STEPS, TIMED, TOGETHER, VARIANCES, WORLDS, World};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use watch::{Beside, Task};
use zerre::model::{GaussianMeasurement, Measurement, Motion};
use zerre::rng::Stream;

/// What lists say.
pub const PAPER: Paper = Paper {
    name: "swarm",
    about: "swarm and bee-colony particle filters: the paper's table, all of them beside the exact posterior",
    source: "Turkish article on a particle filter based on the artificial bee colony algorithm, 2025: table 1, \
             figures 2 to 6",
    tables: &["1", "honest", "misfit"],
    on_request: &[
        "variants",
        "reading-a",
        "reading-b",
        "reading-c",
        "reading-d",
        "reading-f",
        "reading-h",
        "reading-i",
        "reading-k",
        "reading-o",
        "reading-p",
        "reading-s",
        // An experiment of its own.
        "dimensions",
    ],
};

/// The file of settings.
pub const SETTINGS: SettingsFile =
    SettingsFile { path: "crates/zerre-lab/src/paper/swarm/settings.rs", text: settings::SOURCE };

/// What to compute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Tables, of those in [`PAPER`].
    pub tables: BTreeSet<&'static str>,
    /// Runs of each scene.
    pub runs: usize,
}

impl Request {
    /// All tables but those on request, or these with fewer runs.
    pub fn new(quick: bool) -> Request {
        let runs = if quick { QUICK_RUNS } else { RUNS };
        Request { tables: PAPER.tables.iter().copied().collect(), runs }
    }

    /// The table of that name, on request or not.
    pub fn table(name: &str) -> Option<&'static str> {
        PAPER.tables.iter().chain(PAPER.on_request).copied().find(|table| *table == name)
    }
}

/// What many filters are compared in. The order is that of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scene {
    /// The paper's model.
    Paper {
        /// Place in [`READINGS`].
        reading: usize,
        /// Length of a run.
        steps: usize,
        /// The variance Q.
        q: u32,
        /// Variants of the paper's filters instead of these.
        variants: bool,
    },
    /// A world whose models filters know, with the exact posterior: a place in [`WORLDS`].
    World(usize),
}

impl Scene {
    /// The scenes of a table.
    pub fn of_table(table: &str) -> Vec<Scene> {
        let paper = |reading: &str, steps: &[usize], variants: bool| -> Vec<Scene> {
            let Some(reading) = Reading::place(reading) else { return Vec::new() };
            let of = |steps: &usize| VARIANCES.map(|q| Scene::Paper { reading, steps: *steps, q, variants });
            steps.iter().flat_map(of).collect()
        };
        match table {
            "1" => paper(MAIN, &STEPS, false),
            "variants" => paper(MAIN, &STEPS, true),
            "misfit" => MISFIT.iter().flat_map(|reading| paper(reading, &STEPS[..1], false)).collect(),
            "honest" => (0..WORLDS.len()).map(Scene::World).collect(),
            other => paper(other.strip_prefix("reading-").unwrap_or_default(), &STEPS, false),
        }
    }

    /// The filters, in the order of rows.
    fn entrants(&self) -> Vec<Entrant> {
        match self {
            Scene::Paper { variants: false, .. } => methods::of_the_paper(),
            Scene::Paper { variants: true, .. } => methods::variants(),
            Scene::World(at) => methods::honest(&WORLDS[*at]),
        }
    }

    /// Nodes of the exact filter, where there is one.
    fn nodes(&self) -> Option<usize> {
        match self {
            Scene::Paper { .. } => None,
            Scene::World(at) => Some(WORLDS[*at].nodes),
        }
    }

    fn place(at: usize) -> zerre::Result<Place> {
        let World { name, steps, .. } = WORLDS[at];
        let place = Place::named(name).map(|place| Place { steps: Some(steps), ..place });
        place.ok_or_else(|| zerre::Error::Unsupported(format!("there is no world `{name}`")))
    }

    /// Length of a run.
    fn steps(&self) -> usize {
        match self {
            Scene::Paper { steps, .. } => *steps,
            Scene::World(at) => WORLDS[*at].steps,
        }
    }
}

/// Some runs of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// Where they are.
    pub scene: Scene,
    /// The first of them.
    pub first: usize,
}

/// The comparison under one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct SwarmFilters {
    request: Request,
    seed: u64,
    scenes: BTreeSet<Scene>,
}

/// About how many evaluations of a likelihood a step of the exact filter takes as long as, ...
const EXACT_COST: usize = 50_000;
/// ... and a step of any filter with its scores.
const STEP_COST: usize = 300;

impl SwarmFilters {
    /// What `request` asks for.
    pub fn new(request: Request, seed: u64) -> SwarmFilters {
        let scenes = request.tables.iter().flat_map(|table| Scene::of_table(table)).collect();
        SwarmFilters { request, seed, scenes }
    }

    fn runs(&self, cell: &Cell) -> Range<usize> {
        cell.first..(cell.first + TOGETHER).min(self.request.runs)
    }

    /// The runs `which` of every filter of a scene; `None` if `stop` says so meanwhile.
    fn compete(
        &self,
        scene: Scene,
        which: Range<usize>,
        stop: &dyn Fn() -> bool,
    ) -> zerre::Result<Option<Vec<Vec<Run>>>> {
        let contest = Contest { scene, which, seed: self.seed, stop };
        match scene {
            Scene::Paper { reading, steps, q, .. } => {
                let [drawn, told] = READINGS[reading].problems(f64::from(q), steps)?;
                contest.between(&drawn, &told)
            }
            Scene::World(at) => with_growth(&Scene::place(at)?, contest),
        }
    }

    fn timed_runs(&self) -> usize {
        self.request.runs.min(TIMED)
    }

    fn timed_scenes(&self) -> impl Iterator<Item = Scene> {
        self.scenes.iter().copied().filter(|scene| matches!(scene, Scene::World(_)))
    }
}

/// Runs of every filter of a scene.
struct Contest<'a> {
    scene: Scene,
    which: Range<usize>,
    seed: u64,
    stop: &'a dyn Fn() -> bool,
}

impl VisitScalar for Contest<'_> {
    type Out = Option<Vec<Vec<Run>>>;

    fn visit<A, H>(self, problem: &Problem<A, H, 1>) -> zerre::Result<Self::Out>
    where
        A: Motion<1, 1> + Clone,
        H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone,
    {
        self.between(problem, problem)
    }
}

/// The random numbers of run number `run` of a scene: truth and measurements of all variances and readings
/// come from the same draws.
fn luck(scene: Scene, seed: u64, run: usize) -> zerre::Result<Stream> {
    Ok(match scene {
        Scene::Paper { .. } => Stream::new(seed).fork(label(PAPER.name)).fork(run as u64),
        Scene::World(at) => Scene::place(at)?.luck(seed, run),
    })
}

/// Random numbers of a filter.
fn chance(luck: Stream, entrant: &Entrant) -> Stream {
    luck.fork(label(entrant.name)).fork(entrant.particles as u64)
}

impl Contest<'_> {
    /// Lets filters that are told `told` follow what is drawn from `drawn`.
    fn between<A, H>(
        &self,
        drawn: &Problem<A, H, 1>,
        told: &Problem<A, H, 1>,
    ) -> zerre::Result<Option<Vec<Vec<Run>>>>
    where
        A: Motion<1, 1> + Clone,
        H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone,
    {
        let entrants = self.scene.entrants();
        let mut runs = vec![Vec::with_capacity(self.which.len()); entrants.len()];
        let [start] = *told.prior.mean();
        let [[variance]] = told.sensor.covariance();
        // The slope of the benchmark's straight measurement is a half.
        let is_benchmark = !matches!(self.scene, Scene::World(at) if !WORLDS[at].is_benchmark);
        let about = (start, is_benchmark.then(|| 2.0 * variance.sqrt()));
        for run in self.which.clone() {
            let luck = luck(self.scene, self.seed, run)?;
            let record: Record<1, 1> = drawn.record(luck)?;
            let task = |entrant| Task { told, record: &record, stream: chance(luck, entrant) };
            let mut exact = None;
            for (entrant, runs) in entrants.iter().zip(&mut runs) {
                if (self.stop)() {
                    return Ok(None);
                }
                let followed = match (entrant.how, self.scene.nodes()) {
                    (How::Exact, Some(nodes)) => {
                        let (laws, followed) = task(entrant).exact(nodes)?;
                        exact = Some(laws);
                        followed
                    }
                    _ => {
                        let beside = Beside { exact: exact.as_deref_mut(), ..Beside::default() };
                        task(entrant).follow(entrant, beside)?
                    }
                };
                let exact = exact.as_deref().filter(|_| entrant.how != How::Exact);
                runs.push(Run::of(&record, &followed, exact, about));
            }
        }
        Ok(Some(runs))
    }
}

/// Microseconds a step of each filter of a scene, run by run.
pub type Timing = BTreeMap<Scene, Vec<Vec<f64>>>;

impl Experiment for SwarmFilters {
    type Cell = Cell;
    /// Of each filter its runs.
    type Outcome = Vec<Vec<Run>>;
    type Timing = Timing;
    type Row = Row;

    const UNIT: &'static str = "thousands of likelihood evaluations";

    fn cells(&self) -> Vec<Cell> {
        let firsts = || (0..self.request.runs).step_by(TOGETHER);
        self.scenes.iter().flat_map(|scene| firsts().map(|first| Cell { scene: *scene, first })).collect()
    }

    fn key(&self, cell: &Cell) -> String {
        let Range { start, end } = self.runs(cell);
        match cell.scene {
            Scene::Paper { reading, steps, q, variants } => {
                let what = if variants { "variants" } else { "filters" };
                format!("{what} reading {} T {steps} Q {q} runs {start}..{end}", READINGS[reading].name)
            }
            Scene::World(at) => format!("{} runs {start}..{end}", WORLDS[at].name),
        }
    }

    fn cost(&self, cell: &Cell) -> u64 {
        let filters: usize = cell.scene.entrants().iter().map(|e| STEP_COST + e.evaluations()).sum();
        let exact = if cell.scene.nodes().is_some() { EXACT_COST } else { 0 };
        (self.runs(cell).len() * cell.scene.steps() * (filters + exact)) as u64 / 1000 + 1
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Vec<Vec<Run>>>> {
        self.compete(cell.scene, self.runs(cell), stop)
    }

    fn rounds(&self) -> u64 {
        (self.timed_runs() * self.timed_scenes().count()) as u64
    }

    fn time(&self, stop: &dyn Fn() -> bool, done: &mut dyn FnMut()) -> zerre::Result<Option<Timing>> {
        let mut timing = Timing::new();
        for run in 0..self.timed_runs() {
            for scene in self.timed_scenes() {
                let Some(found) = self.compete(scene, run..run + 1, stop)? else { return Ok(None) };
                let times = timing.entry(scene).or_insert_with(|| vec![Vec::new(); found.len()]);
                for (times, runs) in times.iter_mut().zip(&found) {
                    times.extend(runs.iter().map(|run| run.microseconds));
                }
                done();
            }
        }
        Ok(Some(timing))
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Vec<Vec<Run>>>,
        timing: Option<&Timing>,
    ) -> Result<Finished<Row>, Box<dyn std::error::Error>> {
        let interrupted =
            outcomes.len() < self.cells().len() || (timing.is_none() && self.timed_scenes().count() > 0);
        let results = Results::new(&self.request, outcomes, timing, (Printed::read()?, self.seed));
        let rows = results.rows();
        let estimates = rows.iter().filter(|row| row.metric != "microseconds_per_step");
        let (degenerate, lost) = results.mishaps();
        Ok(Finished {
            estimates: estimates.flat_map(|row| [row.value, row.low, row.high]).collect(),
            tables: results.tables(),
            files: Vec::new(),
            page: results.page(self.seed, interrupted)?,
            mishaps: vec![Mishap::without_likelihood(degenerate), Mishap::refused(lost)],
            rows,
        })
    }
}

#[cfg(test)]
mod tests;
