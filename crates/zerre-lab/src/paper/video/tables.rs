//! Rows and tables from the runs.

use super::settings::TOLERANCE;
use super::{Cell, OTHERS, Outcome, PAPER, Timing, VideoTrackers};
use crate::metric::wilson_interval;
use crate::study::interval::{Estimate, mean_interval};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use std::collections::BTreeMap;
use zerre_vision::tracker::TRACKERS;

/// What stands where a sequence is not on disk.
pub const NOT_AVAILABLE: &str = "not available";

/// A number, or why there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number.
    Number(f64),
    /// [`NOT_AVAILABLE`].
    Missing(&'static str),
}

/// One number of one tracker on one sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The sequence.
    pub sequence: String,
    /// The tracker.
    pub tracker: String,
    /// The frame up to which the error is taken (tables 1 and 2); `None` for the whole sequence.
    pub frame: Option<usize>,
    /// `rmse_px`, `precision20`, `success_auc`, `iou`, `lost_share`, `coverage95`, `fps`.
    pub metric: &'static str,
    /// `mean` over runs; `mean-kept` over those that kept the object to the end.
    pub statistic: &'static str,
    /// The number.
    pub value: Value,
    /// Lower end of its 95 % interval over runs (Student's t).
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// The error that the paper prints.
    pub paper_value: Option<f64>,
    /// Runs behind it.
    pub runs: usize,
}

impl Row {
    /// Value and interval, where there are numbers.
    pub(super) fn numbers(&self) -> Option<[f64; 3]> {
        let Value::Number(value) = self.value else { return None };
        Some([value, self.low?, self.high?])
    }

    /// Value and interval as one.
    pub(super) fn estimate(&self) -> Option<Estimate> {
        self.numbers().map(|[value, low, high]| Estimate { value, low, high })
    }
}

/// Over which runs a mean is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Over {
    All,
    Kept,
}

/// What is measured over whole sequences, in the order of rows.
const METRICS: [(&str, Over); 7] = [
    ("rmse_px", Over::All),
    ("rmse_px", Over::Kept),
    ("precision20", Over::All),
    ("success_auc", Over::All),
    ("iou", Over::All),
    ("lost_share", Over::All),
    ("coverage95", Over::All),
];

/// Everything that was computed, ready to be shown.
#[derive(Debug)]
pub struct Results<'a> {
    pub(super) experiment: &'a VideoTrackers,
    /// Runs of each sequence and tracker.
    runs: BTreeMap<(usize, usize), Vec<&'a Outcome>>,
    timing: Option<&'a Timing>,
}

impl<'a> Results<'a> {
    pub(super) fn new(
        experiment: &'a VideoTrackers,
        outcomes: &'a BTreeMap<Cell, Outcome>,
        timing: Option<&'a Timing>,
    ) -> Results<'a> {
        let mut runs: BTreeMap<_, Vec<&Outcome>> = BTreeMap::new();
        for (cell, outcome) in outcomes {
            runs.entry((cell.sequence, cell.tracker)).or_default().push(outcome);
        }
        Results { experiment, runs, timing }
    }

    /// Mean of what single runs have, with its interval.
    fn mean(
        &self,
        place: (usize, usize),
        over: Over,
        value: impl Fn(&Outcome) -> Option<f64>,
    ) -> Option<(Estimate, usize)> {
        let kept = |o: &&&Outcome| over == Over::All || o.scores.as_ref().is_some_and(|s| s.lost == 0);
        let runs = self.runs.get(&place)?.iter().filter(kept);
        let values: Vec<f64> = runs.filter_map(|run| value(run)).filter(|v| v.is_finite()).collect();
        Some((mean_interval(&values)?, values.len()))
    }

    fn measured(&self, place: (usize, usize), metric: &str, over: Over) -> Option<(Estimate, usize)> {
        if metric == "lost_share" {
            // A share of runs: each is lost or not.
            let runs = self.runs.get(&place)?.iter().filter_map(|run| run.scores.as_ref());
            let lost: Vec<bool> = runs.map(|scores| scores.lost > 0).collect();
            let count = lost.iter().filter(|lost| **lost).count();
            let (low, high) = wilson_interval(count, lost.len(), 0.95).ok()?;
            return Some((Estimate { value: count as f64 / lost.len() as f64, low, high }, lost.len()));
        }
        self.mean(place, over, |outcome| {
            let scores = outcome.scores.as_ref()?;
            Some(match metric {
                "rmse_px" => scores.rmse_px(),
                "precision20" => scores.precision20(),
                "success_auc" => scores.success_auc(),
                "iou" => scores.iou(),
                _ => outcome.doubts.coverage95(),
            })
        })
    }

    /// Places of the sequences that the paper has not.
    fn others(&self) -> impl Iterator<Item = usize> {
        let printed = &self.experiment.printed;
        let of_paper = |name: &str| PAPER.tables.iter().any(|table| printed.sequences(table).contains(&name));
        let names = self.experiment.sequences().into_iter().enumerate();
        let others: Vec<usize> = names.filter(|(_, name)| !of_paper(name)).map(|(at, _)| at).collect();
        others.into_iter()
    }

    /// The rows of a table.
    pub(super) fn of_table(&self, table: &str) -> Vec<Row> {
        let names = self.experiment.sequences();
        if table == OTHERS {
            return self.others().flat_map(|at| self.whole(at, None)).collect();
        }
        let printed = &self.experiment.printed;
        let mut rows = Vec::new();
        for sequence in printed.sequences(table) {
            let Some(at) = names.iter().position(|name| *name == sequence) else {
                rows.extend(printed.of_table(table).filter(|cell| cell.sequence == sequence).map(|cell| {
                    Row {
                        sequence: sequence.to_owned(),
                        tracker: cell.tracker.clone(),
                        frame: cell.frame,
                        metric: "rmse_px",
                        statistic: "mean",
                        value: Value::Missing(NOT_AVAILABLE),
                        low: None,
                        high: None,
                        paper_value: Some(cell.rmse_px),
                        runs: 0,
                    }
                }));
                continue;
            };
            let frames = printed.frames(table, sequence);
            if frames.is_empty() {
                rows.extend(self.whole(at, Some(table)));
                continue;
            }
            for frame in frames {
                for (tracker, kind) in TRACKERS.iter().enumerate() {
                    let error = |o: &Outcome| o.rmse_at.iter().find(|(k, _)| *k == frame).map(|(_, e)| *e);
                    let Some((found, runs)) = self.mean((at, tracker), Over::All, error) else { continue };
                    let paper_value = printed.rmse(table, sequence, Some(frame), kind.name);
                    let row = row(sequence, kind.name, Some(frame), ("rmse_px", "mean"), found, runs);
                    rows.push(Row { paper_value, ..row });
                }
            }
        }
        rows
    }

    /// All numbers of all trackers over a whole sequence.
    fn whole(&self, at: usize, table: Option<&str>) -> Vec<Row> {
        let sequence = self.experiment.sequences()[at];
        let mut rows = Vec::new();
        for (tracker, kind) in TRACKERS.iter().enumerate() {
            for (metric, over) in METRICS {
                let Some((found, runs)) = self.measured((at, tracker), metric, over) else { continue };
                let statistic = if over == Over::Kept { "mean-kept" } else { "mean" };
                let printed = table
                    .filter(|_| metric == "rmse_px")
                    .and_then(|table| self.experiment.printed.rmse(table, sequence, None, kind.name));
                let row = row(sequence, kind.name, None, (metric, statistic), found, runs);
                rows.push(Row { paper_value: printed, ..row });
            }
            if let Some(fps) = self.timing.and_then(|timing| timing.get(&(at, tracker))) {
                let found = Estimate { value: *fps, low: *fps, high: *fps };
                rows.push(row(sequence, kind.name, None, ("fps", "mean"), found, 1));
            }
        }
        rows
    }

    /// Every number, in the order of the tables.
    pub fn rows(&self) -> Vec<Row> {
        self.experiment.request.tables.iter().flat_map(|table| self.of_table(table)).collect()
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let of = |name: &str, about: &str, rows: Vec<Row>| {
            let head = [
                "sequence",
                "tracker",
                "frame",
                "metric",
                "statistic",
                "value",
                "low",
                "high",
                "paper_value",
                "runs",
            ];
            let entries = |row: Row| -> Vec<Entry> {
                vec![
                    row.sequence.into(),
                    row.tracker.into(),
                    row.frame.map_or(Entry::Missing, Entry::from),
                    row.metric.into(),
                    row.statistic.into(),
                    match row.value {
                        Value::Number(value) => value.into(),
                        Value::Missing(why) => why.into(),
                    },
                    row.low.into(),
                    row.high.into(),
                    row.paper_value.into(),
                    row.runs.into(),
                ]
            };
            Table::new(name, about, &head, rows.into_iter().map(entries).collect())
        };
        let mut tables = vec![of("rows", "Every number of every cell", self.rows())];
        for table in &self.experiment.request.tables {
            tables.push(of(&format!("table-{table}"), &title(table), self.of_table(table)));
        }
        tables
    }

    /// Of the printed whole-sequence errors that ours can be held against: tracker, sequence, printed, ours
    /// over all runs and over those that kept the object, share of lost runs.
    pub(super) fn beside(&self) -> Vec<Beside> {
        let rows = self.of_table("3");
        let find = |of: &Row, metric: &str, statistic: &str| {
            let is = |row: &&Row| {
                (row.metric, row.statistic) == (metric, statistic)
                    && (&row.sequence, &row.tracker) == (&of.sequence, &of.tracker)
            };
            rows.iter().find(is).and_then(Row::estimate)
        };
        let printed = rows.iter().filter(|row| row.statistic == "mean" && row.metric == "rmse_px");
        printed
            .filter_map(|row| {
                Some(Beside {
                    sequence: row.sequence.clone(),
                    tracker: row.tracker.clone(),
                    printed: row.paper_value?,
                    all: row.estimate()?,
                    kept: find(row, "rmse_px", "mean-kept"),
                    lost_share: find(row, "lost_share", "mean")?.value,
                })
            })
            .collect()
    }
}

/// A printed error beside ours.
#[derive(Clone, Debug)]
pub(super) struct Beside {
    pub sequence: String,
    pub tracker: String,
    pub printed: f64,
    pub all: Estimate,
    pub kept: Option<Estimate>,
    pub lost_share: f64,
}

impl Beside {
    /// Whether a mean of ours is near the printed one.
    pub fn is_near(&self, ours: Estimate) -> bool {
        (ours.value - self.printed).abs() <= TOLERANCE * self.printed
    }
}

fn row(
    sequence: &str,
    tracker: &str,
    frame: Option<usize>,
    (metric, statistic): (&'static str, &'static str),
    Estimate { value, low, high }: Estimate,
    runs: usize,
) -> Row {
    Row {
        sequence: sequence.to_owned(),
        tracker: tracker.to_owned(),
        frame,
        metric,
        statistic,
        value: Value::Number(value),
        low: Some(low),
        high: Some(high),
        paper_value: None,
        runs,
    }
}

/// What a table shows.
pub(super) fn title(table: &str) -> String {
    match table {
        OTHERS => "Sequences that the paper does not have".to_owned(),
        "3" => "Table 3 of the paper: whole sequences".to_owned(),
        table => format!("Table {table} of the paper: error up to a frame"),
    }
}
