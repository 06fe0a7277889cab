//! Rows and tables from the outcomes of cells.

use super::printed;
use super::scenario::truth;
use super::{Cell, Outcome, PAPER, RECORDED, Request, Run, recorded};
use crate::metric::wilson_interval;
use crate::study::interval::{Bootstraps, Estimate, median};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// One number of one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Method.
    pub method: &'static str,
    /// Length of the recording.
    pub scans: usize,
    /// `near`, `data` or `truth`.
    pub start: &'static str,
    /// Points of clutter in a scan, on average.
    pub clutter: usize,
    /// `none` without clutter; its rate `known` to the method, `learnt`, or clutter `ignored`.
    pub clutter_model: &'static str,
    /// Points of the target in a scan, on average.
    pub rate: usize,
    /// `shape_error`, `gw`, `iou`, `fail`, `centroid_rmse`, `mixture_wasserstein`, `hausdorff`, `clutter_error` where
    /// its rate is learnt, or `as_good`, the share of runs with a shape error not above that of the printed estimate.
    pub metric: Cow<'static, str>,
    /// `median` over runs, or `mean` of shares.
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Lower end of its 95 % interval: bootstrap over runs for medians, Wilson's for shares.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// That of the printed estimate, in the paper's scene.
    pub paper_value: Option<f64>,
    /// Runs.
    pub runs: usize,
    /// Of a recording: which, runs being its scans or objects.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
}

impl From<&recorded::Row> for Row {
    fn from(row: &recorded::Row) -> Row {
        let recorded::Row { recording, method, metric, value, low, high, count } = row;
        Row {
            method,
            scans: *count,
            start: "data",
            clutter: 0,
            clutter_model: "none",
            rate: 0,
            metric: metric.clone().into(),
            statistic: "mean",
            value: *value,
            low: *low,
            high: *high,
            paper_value: None,
            runs: *count,
            recording: Some(recording.clone()),
        }
    }
}

/// Metrics of rows with their statistics.
pub(super) const METRICS: [(&str, &str); 9] = [
    ("shape_error", "median"),
    ("gw", "median"),
    ("iou", "median"),
    ("fail", "mean"),
    ("centroid_rmse", "median"),
    ("mixture_wasserstein", "median"),
    ("hausdorff", "median"),
    ("clutter_error", "median"),
    ("as_good", "mean"),
];

/// Everything that was computed, ready to be shown.
#[derive(Debug)]
pub struct Results<'a> {
    pub(super) request: &'a Request,
    pub(super) cells: &'a BTreeSet<Cell>,
    pub(super) outcomes: &'a BTreeMap<Cell, Outcome>,
    /// Shape error and Gauss-Wasserstein distance of the printed estimate.
    pub(super) printed: [f64; 2],
    measured: BTreeMap<Cell, [Option<Estimate>; METRICS.len()]>,
}

impl<'a> Results<'a> {
    /// Results of the cells that are done.
    ///
    /// # Errors
    /// None with the settings as they are.
    pub fn new(
        request: &'a Request,
        cells: &'a BTreeSet<Cell>,
        outcomes: &'a BTreeMap<Cell, Outcome>,
        seed: u64,
    ) -> Result<Results<'a>, Box<dyn std::error::Error>> {
        let errors = printed::errors(&truth()?)?;
        let printed = [errors.extent, errors.gauss_wasserstein];
        let mut results = Results { request, cells, outcomes, printed, measured: BTreeMap::new() };
        let bootstraps = Bootstraps::new([request.runs], seed);
        results.measured = cells.iter().map(|cell| (*cell, results.measure(cell, &bootstraps))).collect();
        Ok(results)
    }

    /// The runs of a cell, in order; none where it is not done.
    pub(super) fn runs(&self, cell: &Cell) -> &'a [Run] {
        self.outcomes.get(cell).map_or(&[], |outcome| &outcome.runs)
    }

    /// Runs whose method gave up.
    pub fn lost(&self) -> usize {
        self.outcomes.values().flat_map(|outcome| &outcome.runs).filter(|run| run.lost).count()
    }

    /// A statistic of a cell.
    pub(super) fn measured(&self, cell: &Cell, metric: &str) -> Option<Estimate> {
        let at = METRICS.iter().position(|(name, _)| *name == metric)?;
        self.measured.get(cell)?[at]
    }

    /// Whether a run is as good as the printed one.
    fn is_as_good(&self, run: &Run) -> bool {
        run.shape_error.is_some_and(|error| error <= self.printed[0])
    }

    fn measure(&self, cell: &Cell, bootstraps: &Bootstraps) -> [Option<Estimate>; METRICS.len()] {
        let runs = self.runs(cell);
        // What a lost run does not have is the worst there can be; what no run has, the method does not give.
        let median_of = |of: &dyn Fn(&Run) -> Option<f64>, worst: f64| {
            let kept = |run: &Run| if run.lost { None } else { of(run) };
            runs.iter().find_map(kept)?;
            let values: Vec<f64> = runs.iter().map(|run| kept(run).unwrap_or(worst)).collect();
            bootstraps.estimate(values.len(), |picked| median(&values, picked))
        };
        let share = |is: &dyn Fn(&Run) -> bool| {
            let count = runs.iter().filter(|run| is(run)).count();
            let (low, high) = wilson_interval(count, runs.len(), 0.95).ok()?;
            Some(Estimate { value: count as f64 / runs.len() as f64, low, high })
        };
        METRICS.map(|(metric, _)| match metric {
            "shape_error" => median_of(&|run| run.shape_error, f64::INFINITY),
            "gw" => median_of(&|run| run.gw, f64::INFINITY),
            "iou" => median_of(&|run| Some(run.iou), 0.0),
            "centroid_rmse" => median_of(&|run| Some(run.centroid_rmse), f64::INFINITY),
            "mixture_wasserstein" => median_of(&|run| run.mixture_wasserstein, f64::INFINITY),
            "hausdorff" => median_of(&|run| Some(run.hausdorff), f64::INFINITY),
            "clutter_error" => median_of(&|run| run.clutter_error, f64::INFINITY),
            "fail" => share(&Run::has_failed),
            _ => {
                runs.iter().find_map(|run| run.shape_error)?;
                share(&|run| self.is_as_good(run))
            }
        })
    }

    /// Every number of every cell, in the order of the cells.
    pub fn rows(&self) -> Vec<Row> {
        let row = |cell: &Cell, (metric, statistic): (&'static str, &'static str)| {
            let Estimate { value, low, high } = self.measured(cell, metric)?;
            let printed = match metric {
                "shape_error" => Some(self.printed[0]),
                "gw" => Some(self.printed[1]),
                _ => None,
            };
            Some(Row {
                method: cell.info().name,
                scans: cell.scans,
                start: cell.start.name(),
                clutter: cell.clutter,
                clutter_model: cell.model.name(),
                rate: cell.rate,
                metric: metric.into(),
                statistic,
                value,
                low,
                high,
                paper_value: printed.filter(|_| cell.is_printed()),
                runs: self.runs(cell).len(),
                recording: None,
            })
        };
        self.cells
            .iter()
            .flat_map(|cell| METRICS.iter().filter_map(move |metric| row(cell, *metric)))
            .collect()
    }

    /// The cells of a table, in order.
    pub(super) fn of_table(&self, table: &str) -> Vec<Cell> {
        let of = |cell: &&Cell| Cell::of_table(table, cell.method).contains(cell);
        self.cells.iter().filter(of).copied().collect()
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let asked = PAPER.tables.iter().filter(|t| self.request.tables.contains(**t) && **t != RECORDED);
        std::iter::once(self.all_rows()).chain(asked.map(|table| self.table(table))).collect()
    }

    fn all_rows(&self) -> Table {
        let head = [
            "method",
            "scans",
            "start",
            "clutter",
            "clutter_model",
            "rate",
            "metric",
            "statistic",
            "value",
            "low",
            "high",
            "paper_value",
            "runs",
        ];
        let row = |row: Row| -> Vec<Entry> {
            vec![
                row.method.into(),
                row.scans.into(),
                row.start.into(),
                row.clutter.into(),
                row.clutter_model.into(),
                row.rate.into(),
                row.metric.as_ref().into(),
                row.statistic.into(),
                row.value.into(),
                row.low.into(),
                row.high.into(),
                row.paper_value.into(),
                row.runs.into(),
            ]
        };
        Table::new("rows", "Every number of every cell", &head, self.rows().into_iter().map(row).collect())
    }

    /// A row per cell.
    fn table(&self, table: &str) -> Table {
        let mut head =
            ["method", "scans", "start", "clutter", "clutter_model", "rate"].map(str::to_owned).to_vec();
        for (metric, _) in METRICS {
            head.extend([metric.to_owned(), format!("{metric}_low"), format!("{metric}_high")]);
        }
        let row = |cell: &Cell| {
            let mut row: Vec<Entry> = vec![
                cell.info().name.into(),
                cell.scans.into(),
                cell.start.name().into(),
                cell.clutter.into(),
                cell.model.name().into(),
                cell.rate.into(),
            ];
            for (metric, _) in METRICS {
                let found = self.measured(cell, metric);
                let ends = [found.map(|e| e.value), found.map(|e| e.low), found.map(|e| e.high)];
                row.extend(ends.map(Entry::from));
            }
            row
        };
        let about = match table {
            "scene" => "Methods in the paper's scene, at more lengths and from other first shapes",
            "clutter" => "Methods with clutter, told of it or not",
            _ => "Methods at the other reading of the rate: so many points for each ellipse",
        };
        let rows = self.of_table(table).iter().map(row).collect();
        Table { name: format!("table-{table}"), about: about.to_owned(), head, rows }
    }
}
