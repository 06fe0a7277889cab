//! Rows and tables from the runs.

use super::methods::{Entrant, How};
use super::printed::Printed;
use super::settings::{MAIN, READINGS, STEPS, WORLDS};
use super::{Cell, Request, Run, Scene, Timing};
use crate::study::interval::{Bootstraps, Estimate, mean, median, quantile};
use crate::study::table::{Entry, Table};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// One number of one filter in one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// `paper`, or a world of the honest table: `growth`, `ungm`, `upf`.
    pub world: &'static str,
    /// Length of a run.
    pub steps: usize,
    /// Variance Q of the measurement.
    #[serde(serialize_with = "whole")]
    pub q: f64,
    /// Filter.
    pub algorithm: &'static str,
    /// How the paper is read; `default` where filters are told the world's own models.
    pub reading: &'static str,
    /// Evaluations of the likelihood a step, as counted.
    pub evaluations: usize,
    /// `rmse`, `crps`, `coverage90`; in the honest table `rmse_ratio` and `crps_ratio` (to the exact filter
    /// on the same runs), `posterior_error`, `w1`, `pull`, `spread`, `straight_error`, `ess`,
    /// `microseconds_per_step`; `nis`.
    pub metric: &'static str,
    /// `mean` or `median` over runs; `p5` and `p95` of single runs.
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Lower end of its 95 % bootstrap interval over runs.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// The error that the paper prints for its single run.
    pub paper_value: Option<f64>,
    /// Runs.
    pub runs: usize,
    /// Particles; 0 for the exact filter.
    pub particles: usize,
}

/// Whole numbers as such.
fn whole<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.fract() == 0.0 {
        serializer.serialize_u64(*value as u64)
    } else {
        serializer.serialize_f64(*value)
    }
}

/// What is measured of a filter, and the statistic over runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Metric {
    pub name: &'static str,
    pub statistic: &'static str,
}

const fn mean_of(name: &'static str) -> Metric {
    Metric { name, statistic: "mean" }
}

pub(super) const RMSE: Metric = mean_of("rmse");
pub(super) const P5: Metric = Metric { name: "rmse", statistic: "p5" };
pub(super) const P95: Metric = Metric { name: "rmse", statistic: "p95" };
pub(super) const RMSE_RATIO: Metric = mean_of("rmse_ratio");
pub(super) const CRPS: Metric = mean_of("crps");
pub(super) const CRPS_RATIO: Metric = mean_of("crps_ratio");
pub(super) const COVERAGE: Metric = mean_of("coverage90");
pub(super) const POSTERIOR_ERROR: Metric = mean_of("posterior_error");
pub(super) const W1: Metric = mean_of("w1");
pub(super) const PULL: Metric = mean_of("pull");
pub(super) const SPREAD: Metric = Metric { name: "spread", statistic: "median" };
pub(super) const STRAIGHT_ERROR: Metric = mean_of("straight_error");
pub(super) const NIS: Metric = mean_of("nis");
pub(super) const ESS: Metric = mean_of("ess");
pub(super) const MICROSECONDS: Metric = Metric { name: "microseconds_per_step", statistic: "median" };

/// What is measured in the paper's model, in the order of rows, ...
const OF_THE_PAPER: [Metric; 7] = [RMSE, P5, P95, CRPS, COVERAGE, NIS, ESS];
/// ... and beside the exact posterior.
const OF_WORLDS: [Metric; 13] = [
    RMSE,
    RMSE_RATIO,
    CRPS,
    CRPS_RATIO,
    COVERAGE,
    POSTERIOR_ERROR,
    W1,
    PULL,
    SPREAD,
    STRAIGHT_ERROR,
    ESS,
    NIS,
    MICROSECONDS,
];

/// A filter in a scene: its place among the entrants.
pub(super) type Place = (Scene, usize);

/// Everything that was computed, ready to be shown.
#[derive(Debug)]
pub struct Results<'a> {
    pub(super) request: &'a Request,
    /// Of each scene its filters with their runs, as far as they are done.
    pub(super) scenes: BTreeMap<Scene, Vec<(Entrant, Vec<Run>)>>,
    pub(super) printed: Printed,
    timing: Option<&'a Timing>,
    measured: BTreeMap<(Place, Metric), Estimate>,
}

impl Scene {
    pub(super) fn metrics(&self) -> &'static [Metric] {
        match self {
            Scene::Paper { .. } => &OF_THE_PAPER,
            Scene::World(_) => &OF_WORLDS,
        }
    }

    /// World, reading and Q as rows have them.
    pub(super) fn names(&self) -> (&'static str, &'static str, f64) {
        match *self {
            Scene::Paper { reading, q, .. } => ("paper", READINGS[reading].name, f64::from(q)),
            Scene::World(at) => (WORLDS[at].row, "default", WORLDS[at].q),
        }
    }
}

impl<'a> Results<'a> {
    /// Results of the cells that are done.
    pub(super) fn new(
        request: &'a Request,
        outcomes: &BTreeMap<Cell, Vec<Vec<Run>>>,
        timing: Option<&'a Timing>,
        (printed, seed): (Printed, u64),
    ) -> Results<'a> {
        let mut scenes: BTreeMap<Scene, Vec<(Entrant, Vec<Run>)>> = BTreeMap::new();
        for (cell, found) in outcomes {
            let all = scenes.entry(cell.scene).or_insert_with(|| {
                cell.scene.entrants().into_iter().map(|entrant| (entrant, Vec::new())).collect()
            });
            for ((_, runs), more) in all.iter_mut().zip(found) {
                runs.extend(more);
            }
        }
        let mut results = Results { request, scenes, printed, timing, measured: BTreeMap::new() };
        let places: Vec<Place> =
            results.scenes.iter().flat_map(|(scene, all)| (0..all.len()).map(|at| (*scene, at))).collect();
        let pairs = || places.iter().flat_map(|p| p.0.metrics().iter().map(|metric| (*p, *metric)));
        let counts = pairs().map(|(place, metric)| results.values(place, metric).len());
        let bootstraps = Bootstraps::new(counts, seed);
        let measure = |(place, metric)| Some(((place, metric), results.measure(place, metric, &bootstraps)?));
        results.measured = pairs().filter_map(measure).collect();
        results
    }

    /// A filter and its runs, in order.
    pub(super) fn runs(&self, (scene, at): Place) -> (&Entrant, &[Run]) {
        let (entrant, runs) = &self.scenes[&scene][at];
        (entrant, runs)
    }

    /// The filters of a scene, as far as it is done.
    pub(super) fn places(&self, scene: Scene) -> impl Iterator<Item = Place> + use<'_> {
        let count = self.scenes.get(&scene).map_or(0, Vec::len);
        (0..count).map(move |at| (scene, at))
    }

    /// The filter of that name in a scene; the one with the most particles, or with so many.
    pub(super) fn named(&self, scene: Scene, name: &str, particles: Option<usize>) -> Option<Place> {
        let is = |place: &Place| {
            let entrant = self.runs(*place).0;
            entrant.name == name && particles.is_none_or(|n| n == entrant.particles)
        };
        self.places(scene).filter(is).max_by_key(|place| self.runs(*place).0.particles)
    }

    /// A statistic of a filter.
    pub(super) fn measured(&self, place: Place, metric: Metric) -> Option<Estimate> {
        self.measured.get(&(place, metric)).copied()
    }

    /// The values of single runs behind a statistic: of those that have one.
    fn values(&self, (scene, at): Place, metric: Metric) -> Vec<f64> {
        if metric == MICROSECONDS {
            let times = self.timing.and_then(|timing| timing.get(&scene)?.get(at));
            return times.cloned().unwrap_or_default();
        }
        let of = |run: &Run| match metric.name {
            "rmse" | "rmse_ratio" => Some(run.rmse),
            "crps" | "crps_ratio" => Some(run.crps),
            "coverage90" => Some(run.coverage90),
            "posterior_error" => run.posterior_error,
            "w1" => run.w1,
            "pull" => run.pull,
            "spread" => run.spread,
            "straight_error" => run.straight_error,
            "nis" => run.nis,
            _ => run.ess,
        };
        self.runs((scene, at)).1.iter().filter_map(of).collect()
    }

    fn measure(&self, place: Place, metric: Metric, bootstraps: &Bootstraps) -> Option<Estimate> {
        let values = self.values(place, metric);
        let estimate = |of: &dyn Fn(&[usize]) -> f64| bootstraps.estimate(values.len(), of);
        if metric == RMSE_RATIO || metric == CRPS_RATIO {
            let exact = self.places(place.0).find(|place| self.runs(*place).0.how == How::Exact)?;
            let exact = self.values(exact, metric);
            return estimate(&|picked| mean(&values, picked) / mean(&exact, picked));
        }
        match metric.statistic {
            "p5" => estimate(&|picked| quantile(&values, picked, 0.05)),
            "p95" => estimate(&|picked| quantile(&values, picked, 0.95)),
            "median" => estimate(&|picked| median(&values, picked)),
            _ => estimate(&|picked| mean(&values, picked)),
        }
    }

    /// Evaluations of the likelihood a step, as counted.
    pub(super) fn evaluations(&self, place: Place) -> usize {
        let runs = self.runs(place).1;
        (runs.iter().map(|run| run.evaluations).sum::<f64>() / runs.len().max(1) as f64).round() as usize
    }

    /// What the paper prints of a filter in its model, whatever the reading.
    pub(super) fn printed(&self, (scene, at): Place) -> Option<f64> {
        let Scene::Paper { steps, q, .. } = scene else { return None };
        self.printed.rmse(steps, q, self.runs((scene, at)).0.name)
    }

    /// Every number of every filter, in the order of the scenes.
    pub fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for scene in self.scenes.keys() {
            let (world, reading, q) = scene.names();
            for place in self.places(*scene) {
                let entrant = self.runs(place).0;
                for metric in scene.metrics() {
                    let Some(Estimate { value, low, high }) = self.measured(place, *metric) else { continue };
                    rows.push(Row {
                        world,
                        steps: scene.steps(),
                        q,
                        algorithm: entrant.name,
                        reading,
                        evaluations: self.evaluations(place),
                        metric: metric.name,
                        statistic: metric.statistic,
                        value,
                        low,
                        high,
                        paper_value: self.printed(place).filter(|_| *metric == RMSE),
                        runs: self.values(place, *metric).len(),
                        particles: entrant.particles,
                    });
                }
            }
        }
        rows
    }

    /// The scenes of a table that are begun.
    pub(super) fn of_table(&self, table: &str) -> Vec<Scene> {
        Scene::of_table(table).into_iter().filter(|scene| self.scenes.contains_key(scene)).collect()
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let asked = self.request.tables.iter().map(|table| self.table(table));
        std::iter::once(self.all_rows()).chain(asked).collect()
    }

    fn all_rows(&self) -> Table {
        let head = [
            "world",
            "steps",
            "q",
            "algorithm",
            "reading",
            "evaluations",
            "metric",
            "statistic",
            "value",
            "low",
            "high",
            "paper_value",
            "runs",
            "particles",
        ];
        let row = |row: Row| -> Vec<Entry> {
            vec![
                row.world.into(),
                row.steps.into(),
                row.q.into(),
                row.algorithm.into(),
                row.reading.into(),
                row.evaluations.into(),
                row.metric.into(),
                row.statistic.into(),
                row.value.into(),
                row.low.into(),
                row.high.into(),
                row.paper_value.into(),
                row.runs.into(),
                row.particles.into(),
            ]
        };
        Table::new("rows", "Every number of every cell", &head, self.rows().into_iter().map(row).collect())
    }

    /// A row per scene and filter.
    fn table(&self, table: &str) -> Table {
        let scenes = self.of_table(table);
        let metrics = scenes.first().map_or(&[][..], Scene::metrics);
        let mut head =
            ["world", "steps", "q", "reading", "algorithm", "evaluations", "particles", "paper_value"]
                .map(str::to_owned)
                .to_vec();
        for Metric { name, statistic } in metrics {
            let name =
                if statistic.starts_with('p') { format!("{name}_{statistic}") } else { (*name).to_owned() };
            head.extend([name.clone(), format!("{name}_low"), format!("{name}_high")]);
        }
        let row = |place: Place| {
            let (world, reading, q) = place.0.names();
            let entrant = self.runs(place).0;
            let mut row: Vec<Entry> = vec![
                world.into(),
                place.0.steps().into(),
                q.into(),
                reading.into(),
                entrant.name.into(),
                self.evaluations(place).into(),
                entrant.particles.into(),
                self.printed(place).into(),
            ];
            for metric in metrics {
                let found = self.measured(place, *metric);
                row.extend([
                    found.map(|e| e.value).into(),
                    found.map(|e| e.low).into(),
                    Entry::from(found.map(|e| e.high)),
                ]);
            }
            row
        };
        Table {
            name: format!("table-{table}"),
            about: title(table),
            head,
            rows: scenes.iter().flat_map(|scene| self.places(*scene)).map(row).collect(),
        }
    }

    /// Steps without likelihood, and runs whose filter refused to go on.
    pub fn mishaps(&self) -> (usize, usize) {
        let runs = || self.scenes.values().flatten().flat_map(|(_, runs)| runs);
        (runs().map(|run| run.degenerate).sum(), runs().filter(|run| run.lost > 0).count())
    }
}

/// What a table shows.
pub(super) fn title(table: &str) -> String {
    match table {
        "1" => format!("Table 1 of the paper, reading {MAIN}"),
        "honest" => "The filters beside the exact posterior, told the world's own models".to_owned(),
        "misfit" => {
            format!(
                "The paper's filters told the truth, a wrong motion and too much noise, {} steps",
                STEPS[0]
            )
        }
        "variants" => {
            format!("The paper's filters with what it leaves open decided otherwise, reading {MAIN}")
        }
        other => format!("Table 1 of the paper, {}", other.replace('-', " ")),
    }
}
