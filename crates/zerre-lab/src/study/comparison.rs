//! Filters compared in worlds: a grid of cells, each a chunk of the runs of one filter in one world.

use super::contender::{Contender, Fate, Run, Scores, contend, dimensions, evaluations, evaluations_of};
use super::experiment::{Experiment, Finished, Mishap};
use super::front::front;
use super::interval::{Estimate, holm, mean_interval, median, paired};
use super::spec::Metric;
use super::table::{Entry as Field, Table};
use super::world::Place;
use serde::Serialize;
use std::collections::BTreeMap;
use zerre::resample::Trigger;

/// A filter in a world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Which of the worlds.
    pub place: usize,
    /// The filter.
    pub contender: Contender,
}

/// Runs of a chunk: what an interruption loses, and what threads share.
const CHUNK: usize = 50;

/// A study.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    pub(super) runs: usize,
    pub(super) metrics: Vec<Metric>,
    pub(super) places: Vec<Place>,
    pub(super) entries: Vec<Entry>,
    pub(super) seed: u64,
}

/// One number of one filter in one world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The world and its noises.
    #[serde(flatten)]
    pub place: Place,
    /// The filter.
    pub filter: &'static str,
    /// Its particles; 0 for filters without.
    pub particles: usize,
    /// How they are resampled.
    pub resampling: Option<String>,
    /// When they are: below this share of their number, `always` or `never`.
    pub trigger: Option<String>,
    /// Likelihood evaluations a step.
    pub evaluations: usize,
    /// `rmse`, `crps`, `coverage90`, `log_evidence`, `failures` (share of runs with a measurement of no
    /// likelihood, or a refusal), `microseconds_per_step`.
    pub metric: &'static str,
    /// `mean`, or `median` (of times).
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Lower end of its 95 % interval; absent of times and of a single run.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Runs.
    pub runs: usize,
}

/// What is known of an entry.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Measured<'a> {
    pub entry: usize,
    pub runs: Vec<&'a Run>,
    /// Why there are none.
    pub refusal: Option<&'a str>,
    pub evaluations: usize,
    /// The error that ranks.
    pub loss: Option<Estimate>,
    pub microseconds: f64,
    /// Probability, corrected by Holm, of being so much worse than the first by chance.
    pub p_holm: Option<f64>,
}

impl Comparison {
    /// Filters `entries` in `places`; `metrics` begins with the one that ranks.
    pub(super) fn new(
        runs: usize,
        metrics: Vec<Metric>,
        places: Vec<Place>,
        entries: Vec<Entry>,
        seed: u64,
    ) -> Comparison {
        Comparison { runs, metrics, places, entries, seed }
    }

    fn chunk(&self, number: usize) -> std::ops::Range<usize> {
        number * CHUNK..((number + 1) * CHUNK).min(self.runs)
    }

    fn scores(&self) -> Scores {
        Scores {
            crps: self.metrics.contains(&Metric::Crps),
            coverage: self.metrics.contains(&Metric::Coverage90),
        }
    }

    /// Name and value of a metric in a run.
    pub(super) fn metric(metric: Metric) -> (&'static str, fn(&Run) -> Option<f64>) {
        match metric {
            Metric::Rmse => ("rmse", |run| Some(run.rmse)),
            Metric::Crps => ("crps", |run| run.crps),
            Metric::Coverage90 => ("coverage90", |run| run.coverage90),
            Metric::Evidence => ("log_evidence", |run| run.log_evidence),
        }
    }

    /// The number of a run by which filters are ranked.
    fn loss(&self) -> fn(&Run) -> Option<f64> {
        Comparison::metric(self.metrics.first().copied().unwrap_or(Metric::Rmse)).1
    }

    /// The entries of a place, the best first; those without runs last.
    pub(super) fn ranked<'a>(
        &self,
        outcomes: &'a BTreeMap<(usize, usize), Fate>,
        place: usize,
    ) -> Vec<Measured<'a>> {
        let loss = self.loss();
        let of_place = self.entries.iter().enumerate().filter(|(_, entry)| entry.place == place);
        let mut all: Vec<Measured<'a>> = of_place
            .map(|(entry, of)| {
                let fates = || outcomes.range((entry, 0)..(entry + 1, 0)).map(|(_, fate)| fate);
                let runs: Vec<&Run> = fates().flat_map(Fate::runs).collect();
                let losses: Vec<f64> = runs.iter().filter_map(|run| loss(run)).collect();
                let times: Vec<f64> = runs.iter().map(|run| run.microseconds).collect();
                let all: Vec<usize> = (0..times.len()).collect();
                let planned = dimensions(&self.places[place]).map_or(0, |d| evaluations(&of.contender, d));
                let filter = of.contender.filter;
                Measured {
                    entry,
                    refusal: fates().find_map(Fate::refusal),
                    evaluations: evaluations_of(filter, planned, runs.iter().copied()),
                    loss: mean_interval(&losses),
                    microseconds: median(&times, &all),
                    p_holm: None,
                    runs,
                }
            })
            .collect();
        let value = |m: &Measured<'_>| m.loss.map_or(f64::INFINITY, |e| e.value);
        all.sort_by(|a, b| value(a).total_cmp(&value(b)).then(a.entry.cmp(&b.entry)));
        let Some((first, others)) = all.split_first_mut() else { return all };
        let rivals: Vec<&mut Measured<'_>> = others
            .iter_mut()
            .filter(|other| other.runs.len() == first.runs.len() && !other.runs.is_empty())
            .collect();
        let p: Vec<f64> = rivals
            .iter()
            .map(|other| {
                let pairs = other.runs.iter().zip(&first.runs);
                let differences: Vec<f64> = pairs.filter_map(|(a, b)| Some(loss(a)? - loss(b)?)).collect();
                // Equal in every run: nothing says that it is worse.
                paired(&differences).map_or(1.0, |found| found.p_greater)
            })
            .collect();
        for (other, p) in rivals.into_iter().zip(holm(&p)) {
            other.p_holm = Some(p);
        }
        all
    }

    fn rows(&self, ranked: &[Vec<Measured<'_>>]) -> Vec<Row> {
        let mut rows = Vec::new();
        for measured in ranked.iter().flatten() {
            let Entry { place, contender } = self.entries[measured.entry];
            let mut row = |metric, statistic, found: Option<Estimate>, bare: bool, runs| {
                let Some(Estimate { value, low, high }) = found else { return };
                rows.push(Row {
                    place: self.places[place],
                    filter: contender.filter,
                    particles: contender.particles,
                    resampling: scheme(&contender),
                    trigger: trigger(&contender),
                    evaluations: measured.evaluations,
                    metric,
                    statistic,
                    value,
                    low: Some(low).filter(|_| !bare),
                    high: Some(high).filter(|_| !bare),
                    runs,
                });
            };
            for metric in &self.metrics {
                let (name, of) = Comparison::metric(*metric);
                let values: Vec<f64> = measured.runs.iter().filter_map(|run| of(run)).collect();
                row(name, "mean", mean_interval(&values), values.len() < 2, values.len());
            }
            let failed = |run: &&Run| f64::from(u8::from(run.degenerate > 0 || run.lost > 0));
            let failures: Vec<f64> = measured.runs.iter().map(failed).collect();
            row("failures", "mean", mean_interval(&failures), failures.len() < 2, failures.len());
            let time = measured.microseconds;
            let time = time.is_finite().then_some(Estimate { value: time, low: time, high: time });
            row("microseconds_per_step", "median", time, true, failures.len());
        }
        rows
    }

    /// The columns that say which cell a row is of.
    fn named(&self, entry: usize, evaluations: usize) -> Vec<Field> {
        let Entry { place, contender } = self.entries[entry];
        let place = &self.places[place];
        let word = |text: Option<String>| text.map_or(Field::Missing, Field::from);
        vec![
            place.world.into(),
            place.measurement_variance.into(),
            place.process_variance.into(),
            place.steps.map_or(Field::Missing, Field::from),
            contender.filter.into(),
            contender.particles.into(),
            word(scheme(&contender)),
            word(trigger(&contender)),
            evaluations.into(),
        ]
    }

    /// A row for every run of every cell.
    fn results(&self, ranked: &[Vec<Measured<'_>>]) -> Table {
        let mut head = NAMED.to_vec();
        head.push("run");
        let metrics: Vec<_> = self.metrics.iter().map(|metric| Comparison::metric(*metric)).collect();
        head.extend(metrics.iter().map(|(name, _)| *name));
        head.extend(["ess_min", "degenerate", "lost", "microseconds_per_step"]);
        let mut rows = Vec::new();
        for measured in ranked.iter().flatten() {
            for (number, run) in measured.runs.iter().enumerate() {
                let mut row = self.named(measured.entry, measured.evaluations);
                row.push(number.into());
                row.extend(metrics.iter().map(|(_, of)| Field::from(of(run))));
                row.extend([run.ess_min.into(), run.degenerate.into(), run.lost.into()]);
                row.push(run.microseconds.into());
                rows.push(row);
            }
        }
        Table::new(RESULTS, "Every run of every cell", &head, rows)
    }

    /// A row for every cell, the best of a world first.
    fn ranking(&self, ranked: &[Vec<Measured<'_>>]) -> Table {
        let mut head = vec!["rank"];
        head.extend(NAMED);
        head.extend([
            "loss",
            "loss_low",
            "loss_high",
            "p_holm",
            "microseconds_per_step",
            "front_by_time",
            "front_by_evaluations",
            "does_not_apply",
        ]);
        let mut rows = Vec::new();
        for all in ranked {
            let (by_time, by_evaluations) = fronts(all);
            for (at, measured) in all.iter().enumerate() {
                let yes = |is: bool| Field::from(if is { "yes" } else { "no" });
                let mut row = vec![if measured.loss.is_some() { (at + 1).into() } else { Field::Missing }];
                row.extend(self.named(measured.entry, measured.evaluations));
                row.extend([
                    measured.loss.map(|e| e.value).into(),
                    measured.loss.map(|e| e.low).into(),
                    measured.loss.map(|e| e.high).into(),
                    measured.p_holm.into(),
                    measured.microseconds.into(),
                    yes(by_time[at]),
                    yes(by_evaluations[at]),
                    measured.refusal.map_or(Field::Missing, Field::from),
                ]);
                rows.push(row);
            }
        }
        Table::new("ranking", "Filters in each world, the best first", &head, rows)
    }
}

/// Name of the table with a row for every run.
pub const RESULTS: &str = "results";

const NAMED: [&str; 9] = [
    "world",
    "measurement_variance",
    "process_variance",
    "steps",
    "filter",
    "particles",
    "resampling",
    "trigger",
    "evaluations",
];

/// Whom no other beats in error and time, and in error and evaluations.
pub(super) fn fronts(all: &[Measured<'_>]) -> (Vec<bool>, Vec<bool>) {
    let points = |cost: fn(&Measured<'_>) -> f64| -> Vec<[f64; 2]> {
        all.iter().map(|m| [cost(m), m.loss.map_or(f64::NAN, |e| e.value)]).collect()
    };
    (front(&points(|m| m.microseconds)), front(&points(|m| m.evaluations as f64)))
}

/// How a filter with particles resamples, as the file writes it.
pub(super) fn scheme(contender: &Contender) -> Option<String> {
    (contender.particles > 0).then(|| format!("{:?}", contender.resampling).to_lowercase())
}

/// When it does.
pub(super) fn trigger(contender: &Contender) -> Option<String> {
    (contender.particles > 0).then(|| match contender.trigger {
        Trigger::Always => "always".to_owned(),
        Trigger::Never => "never".to_owned(),
        Trigger::Below(share) => share.to_string(),
    })
}

impl Experiment for Comparison {
    /// Entry and chunk.
    type Cell = (usize, usize);
    type Outcome = Fate;
    type Timing = ();
    type Row = Row;

    const UNIT: &'static str = "likelihood evaluations";

    fn cells(&self) -> Vec<(usize, usize)> {
        let chunks = self.runs.div_ceil(CHUNK);
        (0..self.entries.len()).flat_map(|entry| (0..chunks).map(move |chunk| (entry, chunk))).collect()
    }

    fn key(&self, &(entry, chunk): &(usize, usize)) -> String {
        let Entry { place, contender } = self.entries[entry];
        let runs = self.chunk(chunk);
        format!(
            "{entry} {} {} runs {} to {}",
            self.places[place].world, contender.filter, runs.start, runs.end
        )
    }

    fn cost(&self, &(entry, chunk): &(usize, usize)) -> u64 {
        let Entry { place, contender } = self.entries[entry];
        let place = &self.places[place];
        let each = dimensions(place).map_or(1, |d| evaluations(&contender, d));
        (each * place.steps.unwrap_or(50) * self.chunk(chunk).len()) as u64
    }

    fn work(&self, &(entry, chunk): &(usize, usize), stop: &dyn Fn() -> bool) -> zerre::Result<Option<Fate>> {
        let Entry { place, contender } = self.entries[entry];
        contend(&self.places[place], &contender, self.chunk(chunk), self.seed, self.scores(), stop)
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<(usize, usize), Fate>,
        _: Option<&()>,
    ) -> Result<Finished<Row>, Box<dyn std::error::Error>> {
        let ranked: Vec<_> = (0..self.places.len()).map(|place| self.ranked(outcomes, place)).collect();
        let rows = self.rows(&ranked);
        let estimates = rows.iter().filter(|row| row.metric != "microseconds_per_step");
        let all = || ranked.iter().flatten().flat_map(|measured| &measured.runs);
        let (degenerate, lost) =
            (all().map(|run| run.degenerate).sum(), all().filter(|run| run.lost > 0).count());
        Ok(Finished {
            estimates: estimates
                .flat_map(|row| [row.value, row.low.unwrap_or(f64::NAN), row.high.unwrap_or(f64::NAN)])
                .collect(),
            tables: vec![self.results(&ranked), self.ranking(&ranked)],
            files: Vec::new(),
            page: self.page(&ranked, outcomes.len() < self.cells().len()),
            mishaps: vec![Mishap::without_likelihood(degenerate), Mishap::refused(lost)],
            rows,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::contender::ContenderInfo;
    use super::*;

    fn comparison(runs: usize) -> Comparison {
        let place = Place { steps: Some(10), ..Place::named("linear").unwrap() };
        let entry = |filter, particles| Entry {
            place: 0,
            contender: ContenderInfo::named(filter).unwrap().with(particles),
        };
        let entries = vec![entry("sis", 10), entry("ekf", 0), entry("kalman", 0), entry("bootstrap", 10)];
        Comparison::new(runs, vec![Metric::Rmse], vec![place], entries, 1)
    }

    fn outcomes(of: &Comparison) -> BTreeMap<(usize, usize), Fate> {
        of.cells().into_iter().map(|cell| (cell, of.work(&cell, &|| false).unwrap().unwrap())).collect()
    }

    #[test]
    fn the_best_comes_first_and_the_worse_are_told_apart() {
        let of = comparison(60);
        assert_eq!(of.cells().len(), 4 * 2);
        let outcomes = outcomes(&of);
        let ranked = of.ranked(&outcomes, 0);
        let names: Vec<_> = ranked.iter().map(|m| of.entries[m.entry].contender.filter).collect();
        assert!(names[..2].contains(&"kalman") && names[..2].contains(&"ekf"), "{names:?}");
        assert_eq!(&names[2..], ["bootstrap", "sis"]);
        assert!(ranked.iter().all(|measured| measured.runs.len() == 60));
        // Equal up to rounding, and ten particles in four dimensions far from it.
        let p: Vec<f64> = ranked[1..].iter().map(|m| m.p_holm.unwrap()).collect();
        assert!(p[0] > 0.01 && p[1] < 0.01 && p[2] < 0.01, "{p:?}");
        assert!(ranked[0].p_holm.is_none());
    }

    /// The order of the runs is that of their numbers, however many are done.
    #[test]
    fn an_interruption_leaves_what_is_done() {
        let of = comparison(60);
        let mut part = outcomes(&of);
        part.remove(&(0, 0));
        part.remove(&(1, 1));
        let finished = of.finish(&part, None).unwrap();
        let results = finished.tables.iter().find(|table| table.name == RESULTS).unwrap();
        assert_eq!(results.rows.len(), 10 + 50 + 60 + 60);
        assert!(finished.page.sections[0].paragraphs.iter().any(|text| text.contains("stopped")));
        let none = of.finish(&BTreeMap::new(), None).unwrap();
        assert!(none.rows.is_empty() && none.page.sections.len() == 2);
    }
}
