//! Rows and tables from the outcomes of cells.

use super::settings::{LOST_NATS, LOST_SDS, WORLDS};
use super::{Cell, Request, place_of};
use crate::study::contender::{Fate, Run, evaluations_of};
use crate::study::interval::{Bootstraps, Estimate, mean, median};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use std::collections::BTreeMap;

/// One number of one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// World.
    pub world: &'static str,
    /// Filter.
    pub filter: &'static str,
    /// Likelihood evaluations a step.
    pub evaluations: usize,
    /// Particles; 0 for filters without.
    pub particles: usize,
    /// `default`: filters are as the library makes them.
    pub setting: &'static str,
    /// Whether the others are measured against this filter.
    pub truth: bool,
    /// `rmse`, `rmse_ratio` and `crps_ratio` (to the truth, on the same runs), `crps`, `coverage90`,
    /// `evidence_error` (of the log-evidence of a whole run), `failures` (share of runs),
    /// `microseconds_per_step`.
    pub metric: &'static str,
    /// `mean` or `median` over runs, or `pooled` over runs and steps.
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Lower end of its 95 % bootstrap interval over runs.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Nothing: the tables of the thesis hold words.
    pub paper_value: Option<f64>,
    /// Runs.
    pub runs: usize,
}

/// Everything that was computed, ready to be shown.
#[derive(Debug)]
pub struct Results<'a> {
    pub(super) request: &'a Request,
    pub(super) cells: &'a BTreeMap<Cell, usize>,
    pub(super) outcomes: &'a BTreeMap<Cell, Fate>,
    pub(super) timing: Option<&'a BTreeMap<Cell, Vec<f64>>>,
    measured: BTreeMap<Cell, Measured>,
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measured {
    pub rmse: Option<Estimate>,
    pub pooled: Option<Estimate>,
    pub rmse_ratio: Option<Estimate>,
    pub crps: Option<Estimate>,
    pub crps_ratio: Option<Estimate>,
    pub coverage: Option<Estimate>,
    pub evidence_error: Option<Estimate>,
    pub failures: Option<Estimate>,
    pub microseconds: Option<Estimate>,
}

impl<'a> Results<'a> {
    /// Results of the cells that are done.
    pub fn new(
        request: &'a Request,
        cells: &'a BTreeMap<Cell, usize>,
        outcomes: &'a BTreeMap<Cell, Fate>,
        timing: Option<&'a BTreeMap<Cell, Vec<f64>>>,
        seed: u64,
    ) -> Results<'a> {
        let mut results = Results { request, cells, outcomes, timing, measured: BTreeMap::new() };
        let timed = timing.into_iter().flat_map(BTreeMap::values).map(Vec::len);
        // Evidence is missing of runs that had a step without any.
        let evidence = cells.keys().map(|cell| results.evidence_errors(cell).len());
        let bootstraps = Bootstraps::new(timed.chain(evidence).chain([request.runs]), seed);
        results.measured = cells.keys().map(|cell| (*cell, results.measure(cell, &bootstraps))).collect();
        results
    }

    /// The runs of a cell, in order; none where it is not done or does not apply.
    pub(super) fn runs(&self, cell: &Cell) -> &'a [Run] {
        self.outcomes.get(cell).map_or(&[], Fate::runs)
    }

    /// Likelihood evaluations a step of a cell.
    pub(super) fn evaluations(&self, cell: &Cell) -> usize {
        let planned = self.cells.get(cell).copied().unwrap_or_default();
        evaluations_of(cell.info().name, planned, self.runs(cell).iter())
    }

    /// Why a filter has no runs.
    pub(super) fn refusal(&self, cell: &Cell) -> Option<&'a str> {
        self.outcomes.get(cell)?.refusal()
    }

    /// The runs of the truth of a cell.
    fn truths(&self, cell: &Cell) -> &'a [Run] {
        Cell::truth(cell.world).map_or(&[], |truth| self.runs(&truth))
    }

    /// By how much the log-evidence of each run is off, of those that have one.
    fn evidence_errors(&self, cell: &Cell) -> Vec<f64> {
        let pairs = self.runs(cell).iter().zip(self.truths(cell));
        pairs.filter_map(|(run, truth)| Some((run.log_evidence? - truth.log_evidence?).abs())).collect()
    }

    /// Every statistic of a cell.
    pub(super) fn measured(&self, cell: &Cell) -> Measured {
        self.measured.get(cell).copied().unwrap_or_default()
    }

    fn measure(&self, cell: &Cell, bootstraps: &Bootstraps) -> Measured {
        let (runs, truth) = (self.runs(cell), self.truths(cell));
        let column = |runs: &[Run], of: fn(&Run) -> Option<f64>| -> Vec<f64> {
            runs.iter().map(|run| of(run).unwrap_or(f64::NAN)).collect()
        };
        let average = |values: &[f64]| bootstraps.estimate(values.len(), |picked| mean(values, picked));
        let ratio = |of: fn(&Run) -> Option<f64>| {
            let (ours, exact) = (column(runs, of), column(truth, of));
            let same = ours.len() == exact.len();
            same.then(|| bootstraps.estimate(ours.len(), |p| mean(&ours, p) / mean(&exact, p))).flatten()
        };
        let squares = column(runs, |run| Some(run.rmse * run.rmse));
        let failed: Vec<f64> =
            runs.iter().zip(truth).map(|(run, truth)| f64::from(u8::from(has_failed(run, truth)))).collect();
        let timed = self.timing.and_then(|timing| timing.get(cell));
        Measured {
            rmse: average(&column(runs, |run| Some(run.rmse))),
            pooled: bootstraps.estimate(squares.len(), |picked| mean(&squares, picked).sqrt()),
            rmse_ratio: ratio(|run| Some(run.rmse)),
            crps: average(&column(runs, |run| run.crps)),
            crps_ratio: ratio(|run| run.crps),
            coverage: average(&column(runs, |run| run.coverage90)),
            evidence_error: average(&self.evidence_errors(cell)),
            failures: average(&failed),
            microseconds: timed
                .and_then(|times| bootstraps.estimate(times.len(), |picked| median(times, picked))),
        }
    }

    /// Every number of every cell, in the order of the cells.
    pub fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for cell in self.cells.keys() {
            let truth = Cell::truth(cell.world) == Some(*cell);
            let found = self.measured(cell);
            let runs = self.runs(cell).len();
            let timed = self.timing.and_then(|timing| timing.get(cell)).map_or(0, Vec::len);
            for (metric, statistic, estimate, runs) in [
                ("rmse", "mean", found.rmse, runs),
                ("rmse", "pooled", found.pooled, runs),
                ("rmse_ratio", "mean", found.rmse_ratio, runs),
                ("crps", "mean", found.crps, runs),
                ("crps_ratio", "mean", found.crps_ratio, runs),
                ("coverage90", "mean", found.coverage, runs),
                ("evidence_error", "mean", found.evidence_error, runs),
                ("failures", "mean", found.failures, runs),
                ("microseconds_per_step", "median", found.microseconds, timed),
            ] {
                let Some(Estimate { value, low, high }) = estimate else { continue };
                rows.push(Row {
                    world: WORLDS[cell.world],
                    filter: cell.info().name,
                    evaluations: self.evaluations(cell),
                    particles: cell.particles,
                    setting: "default",
                    truth,
                    metric,
                    statistic,
                    value,
                    low,
                    high,
                    paper_value: None,
                    runs,
                });
            }
        }
        rows
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = vec![self.all_rows()];
        tables.extend(self.request.worlds.iter().map(|world| self.world_table(*world)));
        tables.extend([table_2_1(), self.table_2_2()]);
        tables
    }

    fn all_rows(&self) -> Table {
        let head = [
            "world",
            "filter",
            "evaluations",
            "metric",
            "statistic",
            "value",
            "low",
            "high",
            "paper_value",
            "particles",
            "setting",
            "truth",
            "runs",
        ];
        let row = |row: Row| -> Vec<Entry> {
            vec![
                row.world.into(),
                row.filter.into(),
                row.evaluations.into(),
                row.metric.into(),
                row.statistic.into(),
                row.value.into(),
                row.low.into(),
                row.high.into(),
                row.paper_value.into(),
                row.particles.into(),
                row.setting.into(),
                if row.truth { "yes" } else { "no" }.into(),
                row.runs.into(),
            ]
        };
        Table::new("rows", "Every number of every cell", &head, self.rows().into_iter().map(row).collect())
    }

    /// A row per filter and budget.
    fn world_table(&self, world: usize) -> Table {
        let columns = [
            "rmse",
            "rmse_ratio",
            "crps",
            "crps_ratio",
            "coverage90",
            "evidence_error",
            "failures",
            "microseconds_per_step",
        ];
        let mut head =
            ["filter", "evaluations", "particles", "truth", "does_not_apply"].map(str::to_owned).to_vec();
        for name in columns {
            head.extend([name.to_owned(), format!("{name}_low"), format!("{name}_high")]);
        }
        let rows = self.cells.keys().filter(|cell| cell.world == world).map(|cell| {
            let found = self.measured(cell);
            let truth = Cell::truth(world) == Some(*cell);
            let mut row: Vec<Entry> = vec![
                cell.info().name.into(),
                self.evaluations(cell).into(),
                cell.particles.into(),
                if truth { "yes" } else { "no" }.into(),
                self.refusal(cell).map_or(Entry::Missing, Entry::from),
            ];
            for estimate in [
                found.rmse,
                found.rmse_ratio,
                found.crps,
                found.crps_ratio,
                found.coverage,
                found.evidence_error,
                found.failures,
                found.microseconds,
            ] {
                row.extend([
                    estimate.map(|e| e.value).into(),
                    estimate.map(|e| e.low).into(),
                    Entry::from(estimate.map(|e| e.high)),
                ]);
            }
            row
        });
        let rows = rows.collect();
        let about = format!("Filters in the world {}", WORLDS[world]);
        Table { name: format!("table-{}", WORLDS[world]), about, head, rows }
    }

    /// A filter in a world with the most that the budgets buy.
    pub(super) fn largest(&self, filter: usize, world: usize) -> Option<Cell> {
        let of = |cell: &&Cell| (cell.world, cell.filter) == (world, filter);
        let mut all = self.cells.keys().filter(of);
        let affordable = all.clone().rfind(|cell| self.is_affordable(cell));
        affordable.or_else(|| all.next_back()).copied()
    }

    /// Whether a cell keeps to the budgets: the truth and what checks it may not.
    pub(super) fn is_affordable(&self, cell: &Cell) -> bool {
        self.request.budgets.iter().any(|budget| cell.particles <= *budget)
    }

    /// The claims of table 2.2 with the measured ratios beside them.
    fn table_2_2(&self) -> Table {
        let mut head = ["filter", "constraint", "advantage", "measured_as"].map(str::to_owned).to_vec();
        head.extend(self.request.worlds.iter().map(|world| format!("rmse_ratio_{}", WORLDS[*world])));
        let rows = CLAIMS.iter().map(|claim| {
            let mut row: Vec<Entry> =
                vec![claim.name.into(), claim.constraint.into(), claim.advantage.into(), claim.filter.into()];
            row.extend(self.request.worlds.iter().map(|world| self.beside(claim, *world)));
            row
        });
        let rows = rows.collect();
        let about = "What the thesis says of each filter (translated), and the error as a multiple of the truth's that was \
                     measured at the largest budget"
            .to_owned();
        Table { name: "table-2.2".to_owned(), about, head, rows }
    }

    /// What was measured of a claim's filter in a world.
    pub(super) fn beside(&self, claim: &Claim, world: usize) -> Entry {
        let Some(cell) = place_of(claim.filter).and_then(|filter| self.largest(filter, world)) else {
            return "not here".into();
        };
        match self.refusal(&cell) {
            Some(_) => "does not apply".into(),
            None => self.measured(&cell).rmse_ratio.map(|e| e.value).into(),
        }
    }

    /// Steps without likelihood, and runs whose filter refused to go on.
    pub fn mishaps(&self) -> (usize, usize) {
        let runs = || self.outcomes.values().flat_map(Fate::runs);
        (runs().map(|run| run.degenerate).sum(), runs().filter(|run| run.lost > 0).count())
    }
}

/// A run with a step that had no likelihood anywhere or no estimate, or far from the truth on a tenth of the
/// steps, by the standard deviation of the exact posterior, or with measurements that it thought impossible.
fn has_failed(run: &Run, truth: &Run) -> bool {
    let far = truth.sd.is_some_and(|sd| run.rmse90 > LOST_SDS * sd);
    let surprised =
        run.log_evidence.zip(truth.log_evidence).is_some_and(|(ours, exact)| ours < exact - LOST_NATS);
    run.degenerate > 0 || run.lost > 0 || far || surprised
}

/// A row of table 2.2 of the thesis.
pub(super) struct Claim {
    /// Its name there.
    pub name: &'static str,
    /// What limits the filter, translated.
    pub constraint: &'static str,
    /// What speaks for it, translated.
    pub advantage: &'static str,
    /// What stands for it here.
    pub filter: &'static str,
    /// Columns of table 2.1 as sections 2.5.1 to 2.5.6 read.
    pub reading: [&'static str; 4],
}

/// Tables 2.1 and 2.2. The check marks of table 2.1 are lost from the text that there is; they are read from
/// the sections on each filter.
pub(super) const CLAIMS: [Claim; 7] = [
    Claim {
        name: "KF",
        constraint: "process and noise are assumed linear",
        advantage: "optimal solution",
        filter: "kalman",
        reading: ["linear", "normal", "optimal", "parametric"],
    },
    Claim {
        name: "EKF",
        constraint: "insensitive to processes of high order",
        advantage: "reasonable solution for nonlinear systems",
        filter: "ekf",
        reading: ["nonlinear", "normal", "approximate", "parametric"],
    },
    Claim {
        name: "GSF",
        constraint: "weights of the terms are kept while the uncertainty propagates",
        advantage: "closer solution than the EKF",
        filter: "gaussian-sum",
        reading: ["nonlinear", "arbitrary", "approximate", "parametric"],
    },
    Claim {
        name: "UKF",
        constraint: "approximation by a limited number of points",
        advantage: "better solution than KF, EKF and GSF",
        filter: "ukf",
        reading: ["nonlinear", "normal", "approximate", "sampling"],
    },
    Claim {
        name: "GBF",
        constraint: "a finite number of states is assumed",
        advantage: "reasonable solution for systems of finite states",
        filter: "grid",
        reading: ["nonlinear", "arbitrary", "optimal", "sampling"],
    },
    Claim {
        name: "MCMC",
        constraint: "how near the posterior is approached is unknown",
        advantage: "an approach alternative to the PF",
        filter: "mcmc-mh",
        reading: ["nonlinear", "arbitrary", "approximate", "sampling"],
    },
    Claim {
        name: "PF",
        constraint: "depends on the observation model",
        advantage: "reasonable solution for problems of the real world",
        filter: "bootstrap",
        reading: ["nonlinear", "arbitrary", "approximate", "sampling"],
    },
];

fn table_2_1() -> Table {
    let row = |claim: &Claim| -> Vec<Entry> {
        let mut row = vec![Entry::from(claim.name)];
        row.extend(claim.reading.map(Entry::from));
        row.push("reading".into());
        row
    };
    let head = ["filter", "transition", "noise", "solution", "kind", "origin"];
    let about =
        "The family as the thesis sorts it; its check marks are lost, so these are read from its sections";
    Table::new("table-2.1", about, &head, CLAIMS.iter().map(row).collect())
}
