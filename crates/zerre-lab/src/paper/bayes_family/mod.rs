//! The Bayesian family compared: every filter in worlds from linear to heavy-tailed, at the same budgets.
//!
//! The thesis on sensor fusion (chapters 2 and 3) describes the family in two tables of words. This measures what
//! they say. A [`Request`] names worlds; each of its [`Cell`]s is one filter at one budget in
//! one world, and [`BayesFamily`] is all of it as an [`Experiment`].

mod report;
pub mod settings;
mod tables;

pub use tables::{Results, Row};

use super::Paper;
use crate::study::contender::{CONTENDERS, ContenderInfo, Fate, Scores, contend, dimensions, evaluations};
use crate::study::experiment::{Experiment, Finished, Mishap, SettingsFile};
use crate::study::world::Place;
use settings::{ALSO, BUDGETS, CHECKS, QUICK_RUNS, RUNS, TIMED, TRUTHS, WORLDS};
use std::collections::{BTreeMap, BTreeSet};

/// What lists say.
pub const PAPER: Paper = Paper {
    name: "bayes-family",
    about: "the Bayesian family on eight worlds: error, score, honesty, evidence, failures, cost",
    source: "Turkish doctoral thesis, Real-time motion tracking using sensor-fusion based particle filter: \
             tables 2.1 and 2.2, with measured rows",
    tables: &[
        "linear",
        "growth-q1",
        "growth-q3",
        "growth-q6",
        "ungm",
        "upf",
        "bearings-only",
        "outliers",
        "2.1",
        "2.2",
    ],
    on_request: &[],
};

/// The file of settings.
pub const SETTINGS: SettingsFile =
    SettingsFile { path: "crates/zerre-lab/src/paper/bayes_family/settings.rs", text: settings::SOURCE };

/// What to compute.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Places in [`WORLDS`], ascending.
    pub worlds: Vec<usize>,
    /// Runs of each cell.
    pub runs: usize,
    /// Likelihood evaluations a step, ascending.
    pub budgets: Vec<usize>,
}

impl Request {
    /// Everything, or everything with fewer runs.
    pub fn new(quick: bool) -> Request {
        let runs = if quick { QUICK_RUNS } else { RUNS };
        Request { worlds: (0..WORLDS.len()).collect(), runs, budgets: BUDGETS.to_vec() }
    }

    /// The worlds that the table called `name` in [`PAPER`] is made of: tables 2.1 and 2.2 take all.
    pub fn worlds_of(name: &str) -> Option<Vec<usize>> {
        match name {
            "2.1" | "2.2" => Some((0..WORLDS.len()).collect()),
            _ => WORLDS.iter().position(|world| *world == name).map(|at| vec![at]),
        }
    }
}

/// One filter at one budget in one world. The order is that of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// Place in [`WORLDS`].
    pub world: usize,
    /// Place in [`CONTENDERS`].
    pub filter: usize,
    /// Particles; 0 for filters without.
    pub particles: usize,
}

impl Cell {
    /// The filter.
    pub fn info(&self) -> &'static ContenderInfo {
        &CONTENDERS[self.filter]
    }

    /// The truth of a world.
    pub fn truth(world: usize) -> Option<Cell> {
        Cell::listed(&TRUTHS, world)
    }

    /// What the truth of a world is checked by.
    fn check(world: usize) -> Option<Cell> {
        Cell::listed(&CHECKS, world)
    }

    fn listed(list: &[(&str, &str, usize)], world: usize) -> Option<Cell> {
        let (_, filter, particles) = list.iter().find(|(name, ..)| *name == WORLDS[world])?;
        Some(Cell { world, filter: place_of(filter)?, particles: *particles })
    }

    fn place(&self) -> zerre::Result<Place> {
        let name = WORLDS[self.world];
        Place::named(name).ok_or_else(|| zerre::Error::Unsupported(format!("there is no world `{name}`")))
    }
}

fn place_of(filter: &str) -> Option<usize> {
    CONTENDERS.iter().position(|info| info.name == filter)
}

/// The comparison under one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct BayesFamily {
    request: Request,
    seed: u64,
    /// The cells with their evaluations a step.
    cells: BTreeMap<Cell, usize>,
}

impl BayesFamily {
    /// What `request` asks for.
    ///
    /// # Errors
    /// A world that is not in the list: none of those here.
    pub fn new(request: Request, seed: u64) -> zerre::Result<BayesFamily> {
        let mut cells = BTreeMap::new();
        for &world in &request.worlds {
            let extra = [Cell::truth(world), Cell::check(world), Cell::listed(&ALSO, world)];
            let mut wanted: BTreeSet<Cell> = extra.into_iter().flatten().collect();
            let some = Cell { world, filter: 0, particles: 0 };
            let dimensions = dimensions(&some.place()?)?;
            for (filter, info) in CONTENDERS.iter().enumerate() {
                let particles = |budget: &usize| info.particles(*budget, dimensions.1);
                wanted.extend(request.budgets.iter().map(|b| Cell {
                    filter,
                    particles: particles(b),
                    ..some
                }));
            }
            cells.extend(
                wanted.iter().map(|cell| (*cell, evaluations(&cell.info().with(cell.particles), dimensions))),
            );
        }
        Ok(BayesFamily { request, seed, cells })
    }
}

impl Experiment for BayesFamily {
    type Cell = Cell;
    type Outcome = Fate;
    /// Microseconds a step of each cell, over the timed runs.
    type Timing = BTreeMap<Cell, Vec<f64>>;
    type Row = Row;

    const UNIT: &'static str = "likelihood evaluations";

    fn cells(&self) -> Vec<Cell> {
        self.cells.keys().copied().collect()
    }

    fn key(&self, cell: &Cell) -> String {
        format!("{} {} {}", WORLDS[cell.world], cell.info().name, cell.particles)
    }

    fn cost(&self, cell: &Cell) -> u64 {
        let evaluations = self.cells.get(cell).copied().unwrap_or_default();
        (evaluations * self.request.runs) as u64
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Fate>> {
        let contender = cell.info().with(cell.particles);
        contend(&cell.place()?, &contender, 0..self.request.runs, self.seed, Scores::ALL, stop)
    }

    fn rounds(&self) -> u64 {
        (self.timed_runs() * self.request.worlds.len()) as u64
    }

    fn time(&self, stop: &dyn Fn() -> bool, done: &mut dyn FnMut()) -> zerre::Result<Option<Self::Timing>> {
        let mut timing: Self::Timing = BTreeMap::new();
        for run in 0..self.timed_runs() {
            for world in &self.request.worlds {
                for cell in self.cells.keys().filter(|cell| cell.world == *world) {
                    let contender = cell.info().with(cell.particles);
                    let scores = Scores::default();
                    let fate = contend(&cell.place()?, &contender, run..run + 1, self.seed, scores, stop)?;
                    let Some(fate) = fate else { return Ok(None) };
                    let times = fate.runs().iter().map(|run| run.microseconds);
                    timing.entry(*cell).or_default().extend(times);
                }
                done();
            }
        }
        Ok(Some(timing))
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Fate>,
        timing: Option<&Self::Timing>,
    ) -> Result<Finished<Row>, Box<dyn std::error::Error>> {
        let interrupted = outcomes.len() < self.cells.len() || timing.is_none();
        let results = Results::new(&self.request, &self.cells, outcomes, timing, self.seed);
        let rows = results.rows();
        let estimates = rows.iter().filter(|row| row.metric != "microseconds_per_step");
        let (degenerate, lost) = results.mishaps();
        Ok(Finished {
            estimates: estimates.flat_map(|row| [row.value, row.low, row.high]).collect(),
            tables: results.tables(),
            files: Vec::new(),
            page: results.page(self.seed, interrupted),
            mishaps: vec![Mishap::without_likelihood(degenerate), Mishap::refused(lost)],
            rows,
        })
    }
}

impl BayesFamily {
    fn timed_runs(&self) -> usize {
        self.request.runs.div_ceil(TIMED).max(3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_world_has_its_truth_and_every_filter_a_cell() {
        let family = BayesFamily::new(Request::new(false), 1).unwrap();
        for world in 0..WORLDS.len() {
            let truth = Cell::truth(world).unwrap();
            assert!(family.cells.contains_key(&truth), "{truth:?}");
            for filter in 0..CONTENDERS.len() {
                assert!(family.cells.keys().any(|cell| (cell.world, cell.filter) == (world, filter)));
            }
        }
        // Budgets are kept to, and spent to the last whole particle.
        let beyond = |cell: &Cell| [Cell::truth(cell.world), Cell::check(cell.world)].contains(&Some(*cell));
        for (cell, evaluations) in family.cells.iter().filter(|(cell, _)| !beyond(cell)) {
            assert!(*evaluations <= 820 || !cell.info().is_sampled(), "{cell:?} {evaluations}");
        }
        assert!(PAPER.tables.iter().all(|name| Request::worlds_of(name).is_some()));
        assert!(Request::worlds_of("2.3").is_none());
    }
}
