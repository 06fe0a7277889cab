//! Multiple-model particle filters and weighted statistical model selection: the experiments of M. B. Uçar's thesis
//! (Başkent University), with filters that came before and after beside them.
//!
//! A [`Request`] names tables; from it follow [`Cell`]s, the work of one filter in one place of the grid. Each gives an
//! [`Outcome`], which depends on the cell, the number of runs and the seed alone. [`Results`] makes rows, tables and
//! the report of them. [`MultipleModel`] is all of that as an [`Experiment`].

pub mod contenders;
mod printed;
mod report;
pub mod scenarios;
pub mod settings;
mod tables;

pub use contenders::{Algorithm, Cell, Reading, Wsms};
pub use printed::Damaged;
pub use tables::{Results, Row};

use super::Paper;
use crate::study::experiment::{Experiment, Finished, Mishap, SettingsFile};
use contenders::{Run, contend};
use scenarios::{SCENARIOS, STEPS};
use serde::{Deserialize, Serialize};
use settings::{MAIN_PARTICLES, NOISES, PAIRED_RUNS, PARTICLES, QUICK_RUNS, RUNS, Setting};
use std::collections::BTreeMap;

/// What lists say.
pub const PAPER: Paper = Paper {
    name: "multiple-model",
    about: "multiple-model particle filters, selection of one model (WSMS), IMM and Rao-Blackwellised filters",
    source: "M. B. Uçar, master's thesis, Başkent University, Ankara: tables 6.1 to 6.13",
    tables: &[
        "6.1", "6.2", "6.3", "6.4", "6.5", "6.6", "6.7", "6.8", "6.9", "6.10", "6.11", "6.12", "6.13",
        "readings", "beyond", "paired", "saving",
    ],
    on_request: &[],
};

/// A table that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Asked {
    /// 6.1 to 6.3 and 6.7 to 6.9, and what follows from them: a scenario with one way to adapt the selection.
    Grid(usize, Wsms),
    /// 6.13: IMM filters.
    Imm,
    /// The readings of the weights after resampling.
    Readings,
    /// Filters that the thesis does not have.
    Beyond,
    /// Rao-Blackwellised particles against IMM filters, run by run.
    Paired,
    /// Time and error against algorithm 1, one after the other.
    Saving,
}

impl Asked {
    /// The table called `name` in [`PAPER`]; derived tables need what they are derived from.
    pub fn named(name: &str) -> Option<Asked> {
        Some(match name {
            "readings" => Asked::Readings,
            "beyond" => Asked::Beyond,
            "paired" => Asked::Paired,
            "saving" => Asked::Saving,
            "6.13" => Asked::Imm,
            _ => {
                let number: usize = name.strip_prefix("6.")?.parse().ok()?;
                let at = number.checked_sub(1)?;
                match at / 3 {
                    0 | 1 => Asked::Grid(at % 3, Wsms::SemiDynamic),
                    2 | 3 => Asked::Grid(at % 3, Wsms::Dynamic),
                    _ => return None,
                }
            }
        })
    }

    fn all() -> Vec<Asked> {
        let mut all: Vec<Asked> = PAPER.tables.iter().filter_map(|name| Asked::named(name)).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// What to compute.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Tables, sorted.
    pub tables: Vec<Asked>,
    /// Runs of each cell.
    pub runs: usize,
    /// Runs of each cell of the paired comparison.
    pub paired_runs: usize,
    /// Particle counts of the grid, ascending.
    pub particles: Vec<usize>,
}

impl Request {
    /// Everything, or its short version: the smallest and the main particle count, and fewer runs.
    pub fn new(quick: bool) -> Request {
        let (runs, paired_runs) = if quick { (QUICK_RUNS, QUICK_RUNS) } else { (RUNS, PAIRED_RUNS) };
        let particles = if quick { vec![PARTICLES[0], MAIN_PARTICLES] } else { PARTICLES.to_vec() };
        Request { tables: Asked::all(), runs, paired_runs, particles }
    }

    /// The particle count that stands for all where one is shown.
    pub fn main_particles(&self) -> usize {
        let last = self.particles.last().copied().unwrap_or(MAIN_PARTICLES);
        if self.particles.contains(&MAIN_PARTICLES) { MAIN_PARTICLES } else { last }
    }

    /// The cells with their numbers of runs.
    pub fn cells(&self) -> BTreeMap<Cell, usize> {
        let mut cells = BTreeMap::new();
        let shown = [self.particles.first().copied().unwrap_or(MAIN_PARTICLES), self.main_particles()];
        for asked in &self.tables {
            let runs = if *asked == Asked::Paired { self.paired_runs } else { self.runs };
            for (scenario, column) in asked.columns(&self.particles, shown) {
                for noise in 0..NOISES.len() {
                    let Column { algorithm, wsms, setting, reading, particles } = column;
                    let cell = Cell { scenario, algorithm, wsms, setting, reading, particles, noise };
                    let most = cells.entry(cell).or_insert(runs);
                    *most = runs.max(*most);
                }
            }
        }
        cells
    }
}

/// A cell without its scenario and noise.
#[derive(Clone, Copy)]
struct Column {
    algorithm: Algorithm,
    wsms: Wsms,
    setting: Setting,
    reading: Reading,
    particles: usize,
}

impl Column {
    fn new(algorithm: Algorithm, setting: Setting, particles: usize) -> Column {
        Column { algorithm, wsms: Wsms::None, setting, reading: Reading::Equal, particles }
    }
}

/// Hypotheses of the Rao-Blackwellised filter: those at which it equals Algorithm 2 under the reference settings, and
/// those of the comparison with IMM filters.
pub const RB_FEW: usize = 20;
/// See [`RB_FEW`].
pub const RB_MANY: usize = 100;

/// What the Rao-Blackwellised filter is compared with.
const PAIRED_WITH: [Setting; 2] = [Setting::Matched, Setting::Tuned];

/// IMM filters of table 6.13.
const IMM: [(Algorithm, Setting); 5] = [
    (Algorithm::ImmUkf, Setting::Reference),
    (Algorithm::ImmUkf, Setting::Tuned),
    (Algorithm::ImmUkf, Setting::Default),
    (Algorithm::ImmEkf, Setting::Reference),
    (Algorithm::ImmEkf, Setting::Tuned),
];

impl Asked {
    fn columns(self, grid: &[usize], shown: [usize; 2]) -> Vec<(usize, Column)> {
        use Setting::{Matched, Reference};
        let everywhere = |columns: Vec<Column>| {
            (0..SCENARIOS.len())
                .flat_map(|s| columns.iter().map(move |c| (s, *c)).collect::<Vec<_>>())
                .collect()
        };
        match self {
            Asked::Grid(scenario, wsms) => {
                let mut columns = Vec::new();
                for &particles in grid {
                    for algorithm in [Algorithm::Alg1, Algorithm::Alg2, Algorithm::Alg3] {
                        columns.push((scenario, Column::new(algorithm, Reference, particles)));
                    }
                    for algorithm in [Algorithm::Alg2Wsms, Algorithm::Alg3Wsms] {
                        columns.push((
                            scenario,
                            Column { wsms, ..Column::new(algorithm, Reference, particles) },
                        ));
                    }
                }
                columns
            }
            Asked::Imm => everywhere(IMM.iter().map(|(a, s)| Column::new(*a, *s, 0)).collect()),
            Asked::Readings => {
                let readings = [Reading::Equal, Reading::Recomputed, Reading::RecomputedKept];
                let of = |reading, particles| Column {
                    reading,
                    ..Column::new(Algorithm::Alg1, Reference, particles)
                };
                everywhere(shown.iter().flat_map(|n| readings.map(|reading| of(reading, *n))).collect())
            }
            Asked::Beyond => {
                let mut columns: Vec<Column> =
                    grid.iter().map(|n| Column::new(Algorithm::ImmPf, Reference, *n)).collect();
                columns.extend(shown.map(|n| Column::new(Algorithm::ImmPf, Matched, n)));
                columns.extend([RB_FEW, RB_MANY].map(|n| Column::new(Algorithm::RbMmpf, Reference, n)));
                columns.extend([RB_FEW, RB_MANY].map(|n| Column::new(Algorithm::RbMmpf, Matched, n)));
                columns.extend([Reference, Matched].map(|s| Column::new(Algorithm::KnownModeUkf, s, 0)));
                columns.push(Column::new(Algorithm::ImmUkf, Matched, 0));
                everywhere(columns)
            }
            Asked::Paired => {
                let mut columns = vec![Column::new(Algorithm::RbMmpf, Matched, RB_MANY)];
                columns.extend(PAIRED_WITH.map(|s| Column::new(Algorithm::ImmUkf, s, 0)));
                everywhere(columns)
            }
            Asked::Saving => Vec::new(),
        }
    }
}

/// What the runs of a cell gave, in the order of the runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Mean square error of each run over its steps, km^2.
    pub mse: Vec<f64>,
    /// Share of the steps on which one model of several was computed.
    pub single: Vec<f64>,
    /// States or Gaussians moved by a model.
    pub evaluations: Vec<f64>,
    /// Processor time, s.
    pub seconds: Vec<f64>,
    /// Mean square error of each step over the runs, km^2.
    pub step_mse: Vec<f64>,
    /// Mean probabilities of the modes at each step; empty where the filter has none.
    pub modes: Vec<Vec<f64>>,
    /// Estimated positions of the first run, km.
    pub track: Vec<[f64; 2]>,
    /// Steps, over all runs, whose measurement had no likelihood anywhere.
    pub degenerate: usize,
    /// Runs whose filter refused to go on; the last estimate stood to the end.
    pub lost: usize,
}

impl Outcome {
    fn add(&mut self, run: Run, runs: usize) {
        let share = 1.0 / runs as f64;
        if self.track.is_empty() {
            self.step_mse = vec![0.0; run.squares.len()];
            self.track.clone_from(&run.track);
        }
        self.mse.push(run.squares.iter().sum::<f64>() / run.squares.len() as f64);
        self.single.push(run.single as f64 / STEPS as f64);
        self.evaluations.push(run.evaluations as f64);
        self.seconds.push(run.seconds);
        self.step_mse.iter_mut().zip(&run.squares).for_each(|(sum, square)| *sum += share * square);
        if self.modes.len() < run.modes.len() {
            self.modes.resize_with(run.modes.len(), Vec::new);
        }
        for (sums, law) in self.modes.iter_mut().zip(&run.modes) {
            sums.resize(law.len(), 0.0);
            sums.iter_mut().zip(law).for_each(|(sum, p)| *sum += share * p);
        }
        self.degenerate += run.degenerate;
        self.lost += usize::from(run.lost > 0);
    }
}

/// Times of filters that took turns on the same measurements, in one thread.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Saving {
    /// Filters, by cells without a place in the grid: those of the first scenario and noise of each.
    pub filters: Vec<Cell>,
    /// For each noise and filter: mean square error and processor time of each run, over the scenarios with four
    /// models.
    pub runs: Vec<Vec<Vec<(f64, f64)>>>,
}

/// The scenarios in which filters have four models.
const FOUR_MODELS: [usize; 2] = [1, 2];

/// A quarter of the runs: enough for medians of times.
fn saving_runs(request: &Request) -> usize {
    request.runs.div_ceil(4)
}

/// The file of settings.
pub const SETTINGS: SettingsFile =
    SettingsFile { path: "crates/zerre-lab/src/paper/multiple_model/settings.rs", text: settings::SOURCE };

/// The experiments of the thesis under one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct MultipleModel {
    request: Request,
    seed: u64,
    cells: BTreeMap<Cell, usize>,
}

impl MultipleModel {
    /// What `request` asks for.
    pub fn new(request: Request, seed: u64) -> MultipleModel {
        let cells = request.cells();
        MultipleModel { request, seed, cells }
    }

    fn runs(&self, cell: &Cell) -> usize {
        self.cells.get(cell).copied().unwrap_or_default()
    }
}

impl Experiment for MultipleModel {
    type Cell = Cell;
    type Outcome = Outcome;
    type Timing = Saving;
    type Row = Row;

    const UNIT: &'static str = "particle moves";

    fn cells(&self) -> Vec<Cell> {
        self.cells.keys().copied().collect()
    }

    fn key(&self, cell: &Cell) -> String {
        cell.key()
    }

    fn cost(&self, cell: &Cell) -> u64 {
        cell.work(SCENARIOS[cell.scenario].modes.len()) * self.runs(cell) as u64
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        let runs = self.runs(cell);
        let mut outcome = Outcome::default();
        for run in 0..runs {
            if stop() {
                return Ok(None);
            }
            outcome.add(contend(cell, self.seed, run)?, runs);
        }
        Ok(Some(outcome))
    }

    fn rounds(&self) -> u64 {
        let wanted = self.request.tables.contains(&Asked::Saving);
        if wanted { (saving_runs(&self.request) * FOUR_MODELS.len() * NOISES.len()) as u64 } else { 0 }
    }

    /// Every filter whose time is compared runs on the same measurements, one after the other in turn.
    fn time(&self, stop: &dyn Fn() -> bool, done: &mut dyn FnMut()) -> zerre::Result<Option<Saving>> {
        let particles = self.request.main_particles();
        let of = |algorithm, wsms| {
            let (setting, reading) = (Setting::Reference, Reading::Equal);
            Cell { scenario: FOUR_MODELS[0], algorithm, wsms, setting, reading, particles, noise: 0 }
        };
        let mut filters: Vec<Cell> =
            [Algorithm::Alg1, Algorithm::Alg2, Algorithm::Alg3].map(|a| of(a, Wsms::None)).to_vec();
        for wsms in [Wsms::SemiDynamic, Wsms::Dynamic] {
            filters.extend([Algorithm::Alg2Wsms, Algorithm::Alg3Wsms].map(|a| of(a, wsms)));
        }
        filters.push(of(Algorithm::ImmPf, Wsms::None));
        let mut runs = vec![vec![Vec::new(); filters.len()]; NOISES.len()];
        for run in 0..saving_runs(&self.request) {
            for scenario in FOUR_MODELS {
                for (noise, columns) in runs.iter_mut().enumerate() {
                    for (cell, column) in filters.iter().zip(columns) {
                        if stop() {
                            return Ok(None);
                        }
                        let seen = contend(&Cell { scenario, noise, ..*cell }, self.seed, run)?;
                        let mse = seen.squares.iter().sum::<f64>() / seen.squares.len() as f64;
                        column.push((mse, seen.seconds));
                    }
                    done();
                }
            }
        }
        Ok(Some(Saving { filters, runs }))
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Outcome>,
        saving: Option<&Saving>,
    ) -> Result<Finished<Row>, Box<dyn std::error::Error>> {
        let interrupted = outcomes.len() < self.cells.len()
            || saving.is_some() != self.request.tables.contains(&Asked::Saving);
        let results = Results::new(&self.request, outcomes, saving, self.seed)?;
        let rows = results.rows();
        let estimates = rows.iter().filter(|row| row.metric != "seconds");
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
