//! Rows and tables from the runs.

use super::settings::{BALLS, MEETINGS};
use super::{Cell, FILTERS, METHODS, MOTIONS, MultiBall, Outcome, Part, REFERENCES, Timing};
use crate::study::interval::{Bootstraps, Estimate, mean, mean_interval};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use std::collections::BTreeMap;
use zerre_vision::balls::thesis::READINGS;

/// One number. Names that do not apply are empty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its table.
    pub table: &'static str,
    /// Particles of each ball; 0 where a row is of no particles.
    pub particles: usize,
    /// `green`, `orange`, `magenta` or `all`.
    pub ball: &'static str,
    /// How the thesis is read.
    pub reading: &'static str,
    /// What the error is held against: `detection` or `truth`.
    pub reference: &'static str,
    /// Motion of the linear model.
    pub motion: &'static str,
    /// Resampling scheme of a blind filter, `adapted`, `kalman` or `measurement`.
    pub filter: &'static str,
    /// Scene of balls that meet.
    pub scene: &'static str,
    /// How balls are told apart there: `area` or `assignment`.
    pub method: &'static str,
    /// `error_px`, `error_px2` (squared), `kalman_ratio`, `swaps`, `held_share`, `seconds`.
    pub metric: &'static str,
    /// `mean` over runs, or `pooled` over all steps of all runs.
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Lower end of its 95 % interval over runs.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// What the thesis prints.
    pub paper_value: Option<f64>,
    /// Runs behind it.
    pub runs: usize,
}

impl Row {
    fn of(part: Part, metric: &'static str, Estimate { value, low, high }: Estimate, runs: usize) -> Row {
        Row {
            table: part.table(),
            particles: 0,
            ball: "all",
            reading: "",
            reference: "truth",
            motion: "",
            filter: "",
            scene: "",
            method: "",
            metric,
            statistic: "mean",
            value,
            low,
            high,
            paper_value: None,
            runs,
        }
    }

    /// Value and interval as one.
    pub(super) fn estimate(&self) -> Estimate {
        Estimate { value: self.value, low: self.low, high: self.high }
    }
}

/// Everything that was computed, ready to be shown.
#[derive(Debug)]
pub struct Results<'a> {
    pub(super) experiment: &'a MultiBall,
    /// Runs of each part.
    runs: BTreeMap<Part, Vec<&'a Outcome>>,
    pub(super) timing: Option<&'a Timing>,
}

impl<'a> Results<'a> {
    pub(super) fn new(
        experiment: &'a MultiBall,
        outcomes: &'a BTreeMap<Cell, Outcome>,
        timing: Option<&'a Timing>,
    ) -> Results<'a> {
        let mut runs: BTreeMap<Part, Vec<&Outcome>> = BTreeMap::new();
        for (cell, outcome) in outcomes {
            runs.entry(cell.part).or_default().push(outcome);
        }
        Results { experiment, runs, timing }
    }

    /// Number `at` of every run of a part.
    fn column(&self, part: Part, at: usize) -> Vec<f64> {
        let runs = self.runs.get(&part).map_or(&[][..], Vec::as_slice);
        runs.iter().filter_map(|run| run.values.get(at).copied()).collect()
    }

    /// The printed table with both references, for every reading.
    fn printed_table(&self) -> Vec<Row> {
        let (mut rows, mut at) = (Vec::new(), 0);
        for particles in self.experiment.particles() {
            for reading in READINGS {
                for ball in BALLS {
                    for reference in REFERENCES {
                        let values = self.column(Part::Table, at);
                        at += 1;
                        let Some(found) = mean_interval(&values) else { continue };
                        let metric = if reading.squared { "error_px2" } else { "error_px" };
                        let printed = self.experiment.printed.error(*particles, ball);
                        rows.push(Row {
                            particles: *particles,
                            ball,
                            reading: reading.name,
                            reference,
                            paper_value: printed.filter(|_| reference == "detection"),
                            ..Row::of(Part::Table, metric, found, values.len())
                        });
                    }
                }
            }
        }
        if let Some(timing) = self.timing {
            for (particles, seconds) in self.experiment.particles().iter().zip(&timing.filters) {
                let value = seconds + timing.detector;
                rows.push(Row {
                    particles: *particles,
                    reading: READINGS[0].name,
                    reference: "",
                    paper_value: self.experiment.printed.seconds(*particles),
                    ..Row::of(Part::Table, "seconds", Estimate { value, low: value, high: value }, 1)
                });
            }
        }
        rows
    }

    /// Errors of the linear model, and their ratios to that of the Kalman filter on the same measurements.
    fn floor(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        let sizes = self.experiment.particles();
        let per_motion = 2 + FILTERS.len() * sizes.len();
        let runs = self.column(Part::Floor, 0).len();
        let bootstraps = Bootstraps::new([runs], self.experiment.seed);
        let estimate = |statistic: &dyn Fn(&[usize]) -> f64| bootstraps.estimate(runs, statistic);
        for (place, motion) in MOTIONS.into_iter().enumerate() {
            let column = |at: usize| self.column(Part::Floor, place * per_motion + at);
            let kalman = column(1);
            let row = |metric: &'static str, found: Estimate| Row {
                motion,
                statistic: "pooled",
                ..Row::of(Part::Floor, metric, found, runs)
            };
            let error = |squares: &[f64]| estimate(&|picked| mean(squares, picked).sqrt());
            for (at, filter) in ["measurement", "kalman"].into_iter().enumerate() {
                rows.extend(error(&column(at)).map(|found| Row { filter, ..row("error_px", found) }));
            }
            for (which, (filter, ..)) in FILTERS.into_iter().enumerate() {
                for (size, particles) in sizes.iter().enumerate() {
                    let squares = column(2 + which * sizes.len() + size);
                    let ratio = estimate(&|picked| (mean(&squares, picked) / mean(&kalman, picked)).sqrt());
                    let with = |row: Row| Row { particles: *particles, filter, ..row };
                    rows.extend(error(&squares).map(|found| with(row("error_px", found))));
                    rows.extend(ratio.map(|found| with(row("kalman_ratio", found))));
                }
            }
        }
        rows
    }

    fn identity(&self) -> Vec<Row> {
        let (mut rows, mut at) = (Vec::new(), 0);
        for scene in MEETINGS {
            for method in METHODS {
                for metric in ["swaps", "held_share"] {
                    let values = self.column(Part::Identity, at);
                    at += 1;
                    let found = mean_interval(&values);
                    let row = |found| Row {
                        scene,
                        method,
                        particles: super::settings::MEETING_PARTICLES,
                        ..Row::of(Part::Identity, metric, found, values.len())
                    };
                    rows.extend(found.map(row));
                }
            }
        }
        rows
    }

    /// The rows of a part.
    pub(super) fn of_part(&self, part: Part) -> Vec<Row> {
        match part {
            Part::Table => self.printed_table(),
            Part::Floor => self.floor(),
            Part::Identity => self.identity(),
        }
    }

    fn parts(&self) -> impl Iterator<Item = Part> {
        Part::ALL.into_iter().filter(|part| self.experiment.asks(*part))
    }

    /// Every number, in the order of the tables.
    pub fn rows(&self) -> Vec<Row> {
        self.parts().flat_map(|part| self.of_part(part)).collect()
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let head = [
            "table",
            "particles",
            "ball",
            "reading",
            "reference",
            "motion",
            "filter",
            "scene",
            "method",
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
                row.table.into(),
                row.particles.into(),
                row.ball.into(),
                row.reading.into(),
                row.reference.into(),
                row.motion.into(),
                row.filter.into(),
                row.scene.into(),
                row.method.into(),
                row.metric.into(),
                row.statistic.into(),
                row.value.into(),
                row.low.into(),
                row.high.into(),
                row.paper_value.into(),
                row.runs.into(),
            ]
        };
        let of = |name: &str, about: &str, rows: Vec<Row>| {
            Table::new(name, about, &head, rows.into_iter().map(entries).collect())
        };
        let mut tables = vec![of("rows", "Every number of every cell", self.rows())];
        for part in self.parts() {
            let name = format!("table-{}", part.table());
            tables.push(of(&name, title(part), self.of_part(part)));
        }
        tables
    }
}

/// What a table shows.
pub(super) fn title(part: Part) -> &'static str {
    match part {
        Part::Table => "Table 3.1 of the thesis beside ours, against the detection and against the truth",
        Part::Floor => "The linear-Gaussian version: particle filters beside the Kalman filter",
        Part::Identity => "Identities where balls meet",
    }
}
