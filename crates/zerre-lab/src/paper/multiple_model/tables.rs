//! Rows and tables from the outcomes of cells.

use super::contenders::{Algorithm, Cell, Reading, Wsms};
use super::printed::{Damaged, Number, Thesis};
use super::scenarios::SCENARIOS;
use super::settings::{NOISES, Setting};
use super::{Asked, IMM, Outcome, PAIRED_WITH, RB_MANY, Request, Saving};
use crate::study::interval::{Bootstraps, Estimate, holm, mean, median, paired};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use std::collections::BTreeMap;

/// One number of one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Scenario, from 1.
    pub scenario: usize,
    /// Filter.
    pub algorithm: Algorithm,
    /// Selection of a single model.
    pub wsms: Wsms,
    /// Particles; 0 for filters without.
    pub particles: usize,
    /// Noise label of the thesis, taken as the standard deviation in kilometres and radians.
    pub noise: f64,
    /// Settings.
    pub setting: Setting,
    /// Reading of the thesis.
    pub reading: Reading,
    /// `rmse_km`, `one_model_share`, `model_evaluations` (over the steps of a run), `seconds` (of a run).
    pub metric: &'static str,
    /// `pooled` (over runs and steps, equation 6.2), `mean` (over runs; of the error of equation 6.1) or `median`.
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Lower end of its 95 % bootstrap interval over runs.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// What the thesis prints; MATLAB on a computer of 2012 where it is a time.
    pub paper_value: Option<f64>,
    /// Why the printed number cannot be right, or cannot be compared.
    pub suspect: Option<String>,
    /// Runs.
    pub runs: usize,
}

/// Everything that was computed, ready to be shown.
#[derive(Debug)]
pub struct Results<'a> {
    pub(super) request: &'a Request,
    pub(super) outcomes: &'a BTreeMap<Cell, Outcome>,
    pub(super) saving: Option<&'a Saving>,
    pub(super) thesis: Thesis,
    bootstraps: Bootstraps,
}

/// Pairs (A, B) of tables 6.4 to 6.6 and 6.10 to 6.12, as algorithm and whether it selects.
const PAIRS: [[Algorithm; 2]; 6] = [
    [Algorithm::Alg2, Algorithm::Alg2Wsms],
    [Algorithm::Alg2, Algorithm::Alg3],
    [Algorithm::Alg3, Algorithm::Alg3Wsms],
    [Algorithm::Alg2Wsms, Algorithm::Alg3Wsms],
    [Algorithm::Alg2, Algorithm::Alg3Wsms],
    [Algorithm::Alg2Wsms, Algorithm::Alg3],
];

/// Equation 6.3: by how many per cent `b` is below `a`.
fn percent(a: f64, b: f64) -> f64 {
    100.0 * (a - b) / a
}

fn rmse(mse: &[f64], picked: &[usize]) -> f64 {
    mean(mse, picked).sqrt()
}

impl<'a> Results<'a> {
    /// Results of the cells that are done.
    ///
    /// # Errors
    /// Damaged data of the thesis.
    pub fn new(
        request: &'a Request,
        outcomes: &'a BTreeMap<Cell, Outcome>,
        saving: Option<&'a Saving>,
        seed: u64,
    ) -> Result<Results<'a>, Damaged> {
        let counts = outcomes.values().map(|outcome| outcome.mse.len());
        let of_saving = saving.into_iter().flat_map(|s| s.runs.iter().flatten()).map(Vec::len);
        let bootstraps = Bootstraps::new(counts.chain(of_saving), seed);
        Ok(Results { request, outcomes, saving, thesis: Thesis::read()?, bootstraps })
    }

    fn estimate(&self, runs: usize, statistic: impl Fn(&[usize]) -> f64) -> Option<Estimate> {
        self.bootstraps.estimate(runs, statistic)
    }

    /// Pooled error of a cell, equation 6.2.
    pub(super) fn error(&self, cell: &Cell) -> Option<Estimate> {
        let outcome = self.outcomes.get(cell)?;
        self.estimate(outcome.mse.len(), |picked| rmse(&outcome.mse, picked))
    }

    /// Median time of a run of a cell.
    pub(super) fn seconds(&self, cell: &Cell) -> Option<Estimate> {
        let outcome = self.outcomes.get(cell)?;
        self.estimate(outcome.mse.len(), |picked| median(&outcome.seconds, picked))
    }

    /// Every number of every cell, in the order of the cells.
    pub fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for (cell, outcome) in self.outcomes {
            let printed = self.thesis.printed(cell);
            let runs = outcome.mse.len();
            let mut row = |metric, statistic, estimate: Option<Estimate>, printed: Option<&Number>| {
                let Some(Estimate { value, low, high }) = estimate else { return };
                rows.push(Row {
                    scenario: cell.scenario + 1,
                    algorithm: cell.algorithm,
                    wsms: cell.wsms,
                    particles: cell.particles,
                    noise: NOISES[cell.noise],
                    setting: cell.setting,
                    reading: cell.reading,
                    metric,
                    statistic,
                    value,
                    low,
                    high,
                    paper_value: printed.map(|number| number.value),
                    suspect: printed.and_then(|number| number.doubt.clone()),
                    runs,
                });
            };
            row("rmse_km", "pooled", self.error(cell), printed.map(|p| &p.rmse));
            let single: Vec<f64> = outcome.mse.iter().map(|mse| mse.sqrt()).collect();
            row("rmse_km", "mean", self.estimate(runs, |picked| mean(&single, picked)), None);
            let of = |values: &[f64]| self.estimate(runs, |picked| mean(values, picked));
            row("one_model_share", "mean", of(&outcome.single), None);
            row("model_evaluations", "mean", of(&outcome.evaluations), None);
            row("seconds", "median", self.seconds(cell), printed.map(|p| &p.seconds));
        }
        rows
    }

    /// The tables that were asked for, as far as their cells are done.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = vec![self.all_rows(), self.steps()];
        for asked in &self.request.tables {
            match *asked {
                Asked::Grid(scenario, wsms) => {
                    tables.push(self.grid_table(scenario, wsms));
                    tables.push(self.percentages(scenario, wsms));
                }
                Asked::Imm | Asked::Readings | Asked::Beyond => tables.push(self.by_noise(*asked)),
                Asked::Paired => tables.push(self.paired()),
                Asked::Saving => tables.extend(self.saving_table()),
            }
        }
        tables
    }

    fn all_rows(&self) -> Table {
        let head = [
            "scenario",
            "algorithm",
            "wsms",
            "particles",
            "noise",
            "setting",
            "metric",
            "statistic",
            "value",
            "low",
            "high",
            "paper_value",
            "reading",
            "suspect",
            "runs",
        ];
        let row = |row: Row| -> Vec<Entry> {
            vec![
                row.scenario.into(),
                row.algorithm.name().into(),
                row.wsms.name().into(),
                row.particles.into(),
                row.noise.into(),
                row.setting.name().into(),
                row.metric.into(),
                row.statistic.into(),
                row.value.into(),
                row.low.into(),
                row.high.into(),
                row.paper_value.into(),
                row.reading.name().into(),
                row.suspect.map_or(Entry::Missing, Entry::from),
                row.runs.into(),
            ]
        };
        Table::new("rows", "Every number of every cell", &head, self.rows().into_iter().map(row).collect())
    }

    /// Root mean square error at each step over the runs: equation 6.1 as its text has it.
    fn steps(&self) -> Table {
        let head =
            ["scenario", "algorithm", "wsms", "particles", "noise", "setting", "reading", "step", "rmse_km"];
        let mut rows = Vec::new();
        for (cell, outcome) in self.outcomes {
            if ![0, self.request.main_particles()].contains(&cell.particles)
                && cell.algorithm != Algorithm::RbMmpf
            {
                continue;
            }
            for (step, mse) in (1_usize..).zip(&outcome.step_mse) {
                let mut row: Vec<Entry> = vec![(cell.scenario + 1).into()];
                row.extend([cell.algorithm.name(), cell.wsms.name()].map(Entry::from));
                row.extend([cell.particles.into(), NOISES[cell.noise].into()]);
                row.extend([cell.setting.name(), cell.reading.name()].map(Entry::from));
                row.extend([step.into(), mse.sqrt().into()]);
                rows.push(row);
            }
        }
        Table::new("rmse-per-step", "Error at each step over the runs", &head, rows)
    }

    /// Tables 6.1 to 6.3 and 6.7 to 6.9.
    fn grid_table(&self, scenario: usize, wsms: Wsms) -> Table {
        let number = scenario + if wsms == Wsms::Dynamic { 7 } else { 1 };
        let columns = [
            "rmse_km",
            "rmse_km_low",
            "rmse_km_high",
            "paper_rmse_km",
            "seconds",
            "paper_seconds",
            "one_model_share",
            "model_evaluations",
        ];
        let mut head = vec!["algorithm".to_owned(), "noise".to_owned()];
        for n in &self.request.particles {
            head.extend(columns.iter().map(|name| format!("{name}_{n}")));
        }
        let mut rows = Vec::new();
        for algorithm in &Algorithm::ALL[..5] {
            for noise in 0..NOISES.len() {
                let mut row: Vec<Entry> = vec![algorithm.name().into(), NOISES[noise].into()];
                for &particles in &self.request.particles {
                    let cell = grid_cell(scenario, *algorithm, wsms, particles, noise);
                    let (error, printed) = (self.error(&cell), self.thesis.printed(&cell));
                    let all = |of: fn(&Outcome) -> &Vec<f64>| {
                        self.outcomes.get(&cell).map(|o| of(o).iter().sum::<f64>() / of(o).len() as f64)
                    };
                    row.extend([
                        error.map(|e| e.value).into(),
                        error.map(|e| e.low).into(),
                        error.map(|e| e.high).into(),
                        printed.map(|p| p.rmse.value).into(),
                        self.seconds(&cell).map(|e| e.value).into(),
                        printed.map(|p| p.seconds.value).into(),
                        all(|o| &o.single).into(),
                        Entry::from(all(|o| &o.evaluations)),
                    ]);
                }
                rows.push(row);
            }
        }
        let about = format!(
            "Scenario {}, {} selection: error (km) and processor time of a run (s) for each number of particles",
            scenario + 1,
            wsms.name()
        );
        Table { name: format!("table-6.{number}"), about, head, rows }
    }

    /// Tables 6.4 to 6.6 and 6.10 to 6.12: equation 6.3.
    pub(super) fn percentages(&self, scenario: usize, wsms: Wsms) -> Table {
        let number = scenario + if wsms == Wsms::Dynamic { 10 } else { 4 };
        let columns = [
            "rmse_percent",
            "rmse_percent_low",
            "rmse_percent_high",
            "paper_rmse_percent",
            "seconds_percent",
            "paper_seconds_percent",
        ];
        let mut head = ["a", "b", "noise"].map(str::to_owned).to_vec();
        for n in &self.request.particles {
            head.extend(columns.iter().map(|name| format!("{name}_{n}")));
        }
        let mut rows = Vec::new();
        for pair in PAIRS {
            for noise in 0..NOISES.len() {
                let mut row: Vec<Entry> = pair.map(|algorithm| algorithm.name().into()).to_vec();
                row.push(NOISES[noise].into());
                for &particles in &self.request.particles {
                    let cells = pair.map(|algorithm| grid_cell(scenario, algorithm, wsms, particles, noise));
                    row.extend(self.percentage(&cells));
                }
                rows.push(row);
            }
        }
        let about = format!(
            "Scenario {}, {} selection: by how many per cent b is below a (equation 6.3), in error and in time; the \
             thesis's side follows from its own cells, without those that cannot be right",
            scenario + 1,
            wsms.name()
        );
        Table { name: format!("table-6.{number}"), about, head, rows }
    }

    fn percentage(&self, cells: &[Cell; 2]) -> [Entry; 6] {
        let outcomes = cells.map(|cell| self.outcomes.get(&cell));
        let ours = match outcomes {
            [Some(a), Some(b)] => self.estimate(a.mse.len().min(b.mse.len()), |picked| {
                percent(rmse(&a.mse, picked), rmse(&b.mse, picked))
            }),
            _ => None,
        };
        let time = cells.map(|cell| self.seconds(&cell).map(|e| e.value));
        let both = |pair: [Option<f64>; 2]| Some(percent(pair[0]?, pair[1]?));
        let printed = |of: fn(&super::printed::Printed) -> &Number| {
            both(cells.map(|cell| {
                self.thesis.printed(&cell).map(of).filter(|number| number.usable).map(|number| number.value)
            }))
        };
        [
            ours.map(|e| e.value).into(),
            ours.map(|e| e.low).into(),
            ours.map(|e| e.high).into(),
            printed(|p| &p.rmse).into(),
            both(time).into(),
            printed(|p| &p.seconds).into(),
        ]
    }

    /// The filters of a table that has a row per filter and scenario, each at the first noise.
    pub(super) fn listed(&self, asked: Asked) -> impl Iterator<Item = &Cell> {
        use Algorithm::{Alg1, ImmPf, ImmUkf, KnownModeUkf, RbMmpf};
        let read = |cell: &Cell| self.outcomes.contains_key(&Cell { reading: Reading::Recomputed, ..*cell });
        self.outcomes.keys().filter(move |cell| {
            let filter = (cell.algorithm, cell.setting);
            cell.noise == 0
                && match asked {
                    Asked::Imm => IMM.contains(&filter),
                    Asked::Readings => cell.algorithm == Alg1 && read(cell),
                    Asked::Beyond => {
                        let others = matches!(cell.algorithm, ImmPf | RbMmpf | KnownModeUkf);
                        others || filter == (ImmUkf, Setting::Matched)
                    }
                    Asked::Grid(..) | Asked::Paired | Asked::Saving => false,
                }
        })
    }

    /// A row per filter and scenario, columns by noise.
    fn by_noise(&self, asked: Asked) -> Table {
        let (name, about) = match asked {
            Asked::Readings => {
                ("table-readings", "Algorithm 1 under each reading of the weights after resampling")
            }
            Asked::Beyond => ("table-beyond", "Filters that the thesis does not have"),
            _ => ("table-6.13", "IMM filters"),
        };
        let columns = [
            "rmse_km",
            "rmse_km_low",
            "rmse_km_high",
            "paper_rmse_km",
            "seconds",
            "paper_seconds",
            "model_evaluations",
        ];
        let mut head =
            ["scenario", "algorithm", "setting", "reading", "particles"].map(str::to_owned).to_vec();
        for noise in NOISES {
            head.extend(columns.iter().map(|name| format!("{name}_{noise}")));
        }
        let mut rows = Vec::new();
        for cell in self.listed(asked) {
            let mut row: Vec<Entry> = vec![(cell.scenario + 1).into()];
            row.extend([cell.algorithm.name(), cell.setting.name(), cell.reading.name()].map(Entry::from));
            row.push(cell.particles.into());
            for noise in 0..NOISES.len() {
                let cell = Cell { noise, ..*cell };
                let (error, printed) = (self.error(&cell), self.thesis.printed(&cell));
                let evaluations = self
                    .outcomes
                    .get(&cell)
                    .map(|o| o.evaluations.iter().sum::<f64>() / o.evaluations.len() as f64);
                row.extend([
                    Entry::from(error.map(|e| e.value)),
                    error.map(|e| e.low).into(),
                    error.map(|e| e.high).into(),
                    printed.map(|p| p.rmse.value).into(),
                    self.seconds(&cell).map(|e| e.value).into(),
                    printed.map(|p| p.seconds.value).into(),
                    evaluations.into(),
                ]);
            }
            rows.push(row);
        }
        Table { name: name.to_owned(), about: about.to_owned(), head, rows }
    }

    /// Whether Rao-Blackwellised particles are worse than an IMM filter, run by run on the same measurements.
    pub(super) fn paired(&self) -> Table {
        let mut rows = Vec::new();
        for setting in PAIRED_WITH {
            let mut tests = Vec::new();
            for scenario in 0..SCENARIOS.len() {
                for noise in 0..NOISES.len() {
                    let cell = |algorithm, setting, particles| {
                        let (wsms, reading) = (Wsms::None, Reading::Equal);
                        Cell { scenario, algorithm, wsms, setting, reading, particles, noise }
                    };
                    let ours = self.outcomes.get(&cell(Algorithm::RbMmpf, Setting::Matched, RB_MANY));
                    let theirs = self.outcomes.get(&cell(Algorithm::ImmUkf, setting, 0));
                    let (Some(ours), Some(theirs)) = (ours, theirs) else { continue };
                    let differences: Vec<f64> =
                        ours.mse.iter().zip(&theirs.mse).map(|(a, b)| a - b).collect();
                    tests.push((scenario, noise, ours, theirs, differences));
                }
            }
            let found: Vec<_> = tests.iter().map(|(.., differences)| paired(differences)).collect();
            let p: Vec<f64> = found.iter().map(|f| f.map_or(1.0, |f| f.p_greater)).collect();
            for (((scenario, noise, ours, theirs, differences), found), corrected) in
                tests.iter().zip(&found).zip(holm(&p))
            {
                let all: Vec<usize> = (0..differences.len()).collect();
                rows.push(vec![
                    (*scenario + 1).into(),
                    NOISES[*noise].into(),
                    setting.name().into(),
                    differences.len().into(),
                    rmse(&ours.mse, &all).into(),
                    rmse(&theirs.mse, &all).into(),
                    found.map(|f| f.difference).into(),
                    found.map(|f| f.standard_error).into(),
                    found.map(|f| f.p_greater).into(),
                    corrected.into(),
                    if corrected <= 0.01 { "yes" } else { "no" }.into(),
                ]);
            }
        }
        let about = format!(
            "rb-mmpf with {RB_MANY} hypotheses (setting matched) against imm-ukf (setting as given), run by run: mean \
             difference of the mean square errors, one-sided paired t-test that rb-mmpf is worse, corrected by Holm \
             over the twelve cells of each setting; worse at 1 %?"
        );
        let head = [
            "scenario",
            "noise",
            "imm_setting",
            "runs",
            "rb_rmse_km",
            "imm_rmse_km",
            "difference_km2",
            "standard_error_km2",
            "p",
            "p_holm",
            "rb_worse",
        ];
        Table::new("table-paired", &about, &head, rows)
    }

    /// Times and errors of filters that took turns, against algorithm 1.
    pub(super) fn saving_table(&self) -> Option<Table> {
        let saving = self.saving?;
        let mut rows = Vec::new();
        for (at, cell) in saving.filters.iter().enumerate() {
            for noise in (0..NOISES.len()).map(Some).chain([None]) {
                let column = |at: usize| -> Vec<(f64, f64)> {
                    let of = |noise: usize| saving.runs[noise][at].iter().copied();
                    noise
                        .map_or_else(|| (0..NOISES.len()).flat_map(of).collect(), |noise| of(noise).collect())
                };
                let (mse, seconds): (Vec<f64>, Vec<f64>) = column(at).into_iter().unzip();
                let (first_mse, first_seconds): (Vec<f64>, Vec<f64>) = column(0).into_iter().unzip();
                // Pooling over noises would be about the largest alone: the mean of ratios weighs them alike.
                let per = saving.runs[0][at].len();
                let parts = || mse.chunks(per.max(1)).zip(first_mse.chunks(per.max(1)));
                let times = || seconds.chunks(per.max(1)).zip(first_seconds.chunks(per.max(1)));
                let count = (mse.len() / per.max(1)).max(1) as f64;
                let error = self
                    .estimate(per, |p| parts().map(|(a, b)| rmse(a, p) / rmse(b, p)).sum::<f64>() / count);
                let time = self.estimate(per, |p| {
                    times().map(|(a, b)| median(b, p) / median(a, p)).sum::<f64>() / count
                });
                let all: Vec<usize> = (0..seconds.len()).collect();
                rows.push(vec![
                    cell.algorithm.name().into(),
                    cell.wsms.name().into(),
                    cell.particles.into(),
                    noise.map_or(Entry::from("all"), |noise| NOISES[noise].into()),
                    mse.len().into(),
                    median(&seconds, &all).into(),
                    time.map(|e| e.value).into(),
                    time.map(|e| e.low).into(),
                    time.map(|e| e.high).into(),
                    error.map(|e| e.value).into(),
                    error.map(|e| e.low).into(),
                    error.map(|e| e.high).into(),
                ]);
            }
        }
        let about = "Filters that took turns on the same measurements of scenarios 2 and 3 (four models), in one \
                     thread: median processor time of a run, how many times faster than algorithm 1 it is, and its \
                     pooled error as a multiple of algorithm 1's; over all noises the means of the four ratios";
        let head = [
            "algorithm",
            "wsms",
            "particles",
            "noise",
            "runs",
            "seconds",
            "times_faster",
            "times_faster_low",
            "times_faster_high",
            "rmse_ratio",
            "rmse_ratio_low",
            "rmse_ratio_high",
        ];
        Some(Table::new("table-saving", about, &head, rows))
    }

    /// Steps and runs that did not go as planned, over all cells: steps whose measurement had no likelihood
    /// anywhere, and runs whose filter refused to go on.
    pub fn mishaps(&self) -> (usize, usize) {
        let sum = |of: fn(&Outcome) -> usize| self.outcomes.values().map(of).sum();
        (sum(|o| o.degenerate), sum(|o| o.lost))
    }
}

/// The cell of tables 6.1 to 6.3 or 6.7 to 6.9.
pub(super) fn grid_cell(
    scenario: usize,
    algorithm: Algorithm,
    wsms: Wsms,
    particles: usize,
    noise: usize,
) -> Cell {
    let selects = matches!(algorithm, Algorithm::Alg2Wsms | Algorithm::Alg3Wsms);
    let wsms = if selects { wsms } else { Wsms::None };
    let (setting, reading) = (Setting::Reference, Reading::Equal);
    Cell { scenario, algorithm, wsms, setting, reading, particles, noise }
}
