//! Rows and tables from the clips.

use super::evaluation::{Blocks, Errors, Statistic, best_counts, cumulative};
use super::settings::{CHOSEN, CONDITIONS};
use super::welch::{Welch, mser5, welch};
use super::{Cell, ClipOutcome, ERRORS, Outcome, RgbdFusion, SWEEPS, SweepOutcome, Timed, Timing};
use crate::study::interval::{Estimate, quantile};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use std::collections::BTreeMap;
use zerre::rng::Stream;

/// One number of one source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// One of [`CONDITIONS`].
    pub condition: &'static str,
    /// `all`, `occluded` (the hand is before the body), `free`; `hidden` (none of it can be seen).
    pub frames: &'static str,
    /// `device`, `color`, `depth`, `fused`, `thesis`, ...
    pub source: String,
    /// Particles of the filter.
    pub particles: usize,
    /// `rmse_px`, `median_px`, `p95_px`, `share20`, `coverage95`, `lost_share`, `best_count`, `improvement`,
    /// `ms_per_frame`, ...
    pub metric: &'static str,
    /// `pooled` over the frames of all clips; times are `median` and `p99`.
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Lower end of its 95 % interval over blocks of frames; the number itself where there is none.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// The thesis prints none of these numbers in its text.
    pub paper_value: Option<f64>,
}

impl Row {
    /// Value and interval.
    pub(super) fn numbers(&self) -> [f64; 3] {
        [self.value, self.low, self.high]
    }
}

/// Which frames of a clip count.
pub(super) const FRAMES: [&str; 3] = ["all", "occluded", "free"];

/// Sources that are drawn frame by frame.
pub(super) const IN_TIME: [&str; 5] = ["device", "color", "depth", "fused", "thesis"];
/// The frame of the first error, counted from 1: filters begin on the one before.
const FIRST: usize = 2;
/// The operators' mean's own error.
pub(super) const FLOOR: &str = "noise_floor";

/// Everything that was computed, ready to be shown.
pub struct Results<'a> {
    pub(super) experiment: &'a RgbdFusion,
    /// By condition.
    pub(super) clips: BTreeMap<usize, Vec<&'a ClipOutcome>>,
    /// By number of particles.
    pub(super) sweeps: BTreeMap<usize, Vec<&'a SweepOutcome>>,
    pub(super) timing: Option<&'a Timing>,
}

/// What a number is of, in a [`Row`].
struct Of<'a> {
    condition: &'static str,
    frames: &'static str,
    source: &'a str,
    particles: usize,
}

impl Of<'_> {
    fn row(&self, (metric, statistic): (&'static str, &'static str), found: Estimate) -> Row {
        Row {
            condition: self.condition,
            frames: self.frames,
            source: self.source.to_owned(),
            particles: self.particles,
            metric,
            statistic,
            value: found.value,
            low: found.low,
            high: found.high,
            paper_value: None,
        }
    }
}

fn exact(value: f64) -> Estimate {
    Estimate { value, low: value, high: value }
}

/// Whether a frame counts.
fn counts(clip: &ClipOutcome, frame: usize, which: &str) -> bool {
    match which {
        "occluded" => clip.overlap[frame],
        "free" => !clip.overlap[frame] && clip.visible[frame] > 0.0,
        "hidden" => clip.visible[frame] <= 0.0,
        _ => true,
    }
}

impl<'a> Results<'a> {
    pub(super) fn new(
        experiment: &'a RgbdFusion,
        outcomes: &'a BTreeMap<Cell, Outcome>,
        timing: Option<&'a Timing>,
    ) -> Results<'a> {
        let (mut clips, mut sweeps) = (BTreeMap::<_, Vec<_>>::new(), BTreeMap::<_, Vec<_>>::new());
        for (cell, outcome) in outcomes {
            match (cell, outcome) {
                (Cell::Clip { condition, .. }, Outcome::Clip(clip)) => {
                    clips.entry(*condition).or_default().push(clip);
                }
                (Cell::Sweep { particles, .. }, Outcome::Sweep(sweep)) => {
                    sweeps.entry(*particles).or_default().push(sweep);
                }
                _ => {}
            }
        }
        Results { experiment, clips, sweeps, timing }
    }

    fn blocks(&self, frames: &[usize]) -> Blocks {
        Blocks::new(frames, Stream::new(self.experiment.seed).fork(frames.len() as u64))
    }

    /// The rows of a condition.
    fn under(&self, condition: usize) -> Vec<Row> {
        let Some(clips) = self.clips.get(&condition) else { return Vec::new() };
        let under = &CONDITIONS[condition];
        let lengths: Vec<usize> = clips.iter().map(|clip| clip.overlap.len()).collect();
        let blocks = self.blocks(&lengths);
        let sources: Vec<&String> =
            clips.first().map(|clip| clip.errors.keys().collect()).unwrap_or_default();
        let mut rows = Vec::new();
        let hidden = clips.iter().any(|clip| clip.visible.iter().any(|v| *v <= 0.0));
        for frames in FRAMES.into_iter().chain(hidden.then_some("hidden")) {
            for source in &sources {
                let of = Of { condition: under.name, frames, source, particles: CHOSEN };
                let error = |clip: usize, frame: usize| {
                    let there = counts(clips[clip], frame, frames);
                    clips[clip].errors.get(*source).filter(|_| there)?.get(frame).copied().flatten()
                };
                for statistic in Statistic::ALL {
                    let found = blocks.estimate(error, |drawn| statistic.of(drawn));
                    rows.extend(found.map(|found| of.row((statistic.name(), "pooled"), found)));
                }
                let silent = blocks.estimate(
                    |clip, frame| {
                        let there = counts(clips[clip], frame, frames);
                        let errors = clips[clip].errors.get(*source).filter(|_| there)?;
                        Some(f64::from(errors.get(frame)?.is_none()))
                    },
                    mean,
                );
                rows.extend(silent.map(|found| of.row(("silent_share", "pooled"), found)));
            }
            let of = Of { condition: under.name, frames, source: "fused", particles: CHOSEN };
            for (metric, of_run) in [("coverage95", 0), ("lost_share", 1)] {
                let flag = |clip: usize, frame: usize| {
                    let (lost, holds) = *clips[clip].flags.first()?.get(frame)?;
                    // Where it says that it has lost the hand, its ellipse is judged in the hidden frames.
                    let asked = of_run == 1 || !lost || frames == "hidden";
                    let there = asked && counts(clips[clip], frame, frames);
                    there.then_some(f64::from(if of_run == 1 { lost } else { holds }))
                };
                rows.extend(blocks.estimate(flag, mean).map(|found| of.row((metric, "pooled"), found)));
            }
            let floor = |clip: usize, frame: usize| {
                let there = counts(clips[clip], frame, frames);
                clips[clip].floor.get(frame).copied().flatten().filter(|_| there)
            };
            let found = blocks.estimate(floor, |drawn| Statistic::Rmse.of(drawn));
            let operators = Of { condition: under.name, frames, source: "operators", particles: CHOSEN };
            rows.extend(found.map(|found| operators.row(("noise_floor_px", "pooled"), found)));
            let pair = |clip: usize, frame: usize| {
                let errors = |source: &str| clips[clip].errors.get(source)?.get(frame).copied().flatten();
                let there = counts(clips[clip], frame, frames);
                Some((errors("fused")?, errors("device")?)).filter(|_| there)
            };
            let found = blocks.estimate(pair, improvement);
            rows.extend(found.map(|found| of.row(("improvement", "pooled"), found)));
            let named = ["device", "color", "depth", "fused"];
            let present: Vec<&str> = named.into_iter().filter(|n| sources.iter().any(|s| s == n)).collect();
            let mut best = vec![0; present.len()];
            for clip in clips {
                let chosen = |source: &&str| -> Errors {
                    let errors = clip.errors[*source].iter().enumerate();
                    errors.filter(|(k, _)| counts(clip, *k, frames)).map(|(_, error)| *error).collect()
                };
                let chosen: Vec<Errors> = present.iter().map(chosen).collect();
                let counted = best_counts(&chosen.iter().collect::<Vec<_>>());
                best.iter_mut().zip(counted).for_each(|(sum, count)| *sum += count);
            }
            for (source, count) in present.into_iter().zip(best) {
                let of = Of { condition: under.name, frames, source, particles: CHOSEN };
                rows.push(of.row(("best_count", "pooled"), exact(count as f64)));
            }
        }
        rows
    }

    /// The rows of a number of particles.
    fn of_sweep(&self, particles: usize) -> Vec<Row> {
        let Some(clips) = self.sweeps.get(&particles) else { return Vec::new() };
        let lengths: Vec<usize> = clips.iter().map(|clip| clip.fused.len()).collect();
        let blocks = self.blocks(&lengths);
        let mut rows = Vec::new();
        let names = ["device", "thesis-color", "thesis-depth", "thesis"];
        let of = |source| Of { condition: CONDITIONS[0].name, frames: "all", source, particles };
        for (source, pick) in [("thesis", 0), ("fused", 1)] {
            let error = |clip: usize, frame: usize| {
                let errors = if pick == 0 { &clips[clip].thesis } else { &clips[clip].fused };
                errors.get(frame).copied().flatten()
            };
            let found = blocks.estimate(error, |drawn| Statistic::Rmse.of(drawn));
            rows.extend(found.map(|found| of(source).row(("rmse_px", "pooled"), found)));
        }
        let mut best = [0; 4];
        for clip in clips {
            let errors: Vec<Errors> =
                clip.squares.iter().map(|source| source.iter().map(|v| Some(*v)).collect()).collect();
            let counted = best_counts(&errors.iter().collect::<Vec<_>>());
            best.iter_mut().zip(counted).for_each(|(sum, count)| *sum += count);
        }
        for (source, count) in names.into_iter().zip(best) {
            rows.push(of(source).row(("best_count", "pooled"), exact(f64::from(count as u32))));
        }
        // The thesis's warm-up and improvement: mean over the frames after it of its filter's error over the
        // device's.
        let Some(curve) = self.welch(particles) else { return rows };
        let mser = mser5(&curve.mean);
        let settled =
            curve.settled.map(|frames| of("thesis").row(("warm_up", "pooled"), exact(frames as f64)));
        rows.extend(settled);
        rows.push(of("thesis").row(("warm_up_mser5", "pooled"), exact(mser as f64)));
        let warm = curve.settled.unwrap_or(mser);
        let ratio = |clip: usize, frame: usize| {
            let [ours, device] = [3, 0].map(|source: usize| clips[clip].squares[source].get(frame).copied());
            Some(1.0 - ours? / device?).filter(|v| v.is_finite() && frame >= warm)
        };
        let found = blocks.estimate(ratio, mean);
        rows.extend(found.map(|found| of("thesis").row(("improvement_of_frames", "pooled"), found)));
        let pair = |clip: usize, frame: usize| {
            let [ours, device] = [3, 0].map(|source: usize| clips[clip].squares[source].get(frame).copied());
            Some((ours?.sqrt(), device?.sqrt())).filter(|_| frame >= warm)
        };
        let found = blocks.estimate(pair, improvement);
        rows.extend(found.map(|found| of("thesis").row(("improvement", "pooled"), found)));
        rows
    }

    /// How the thesis's filter settles: its squared error, averaged over its runs, of every clip.
    pub(super) fn welch(&self, particles: usize) -> Option<Welch> {
        let clips = self.sweeps.get(&particles)?;
        welch(&clips.iter().filter_map(|clip| Some(clip.squares.get(3)?.as_slice())).collect::<Vec<_>>())
    }

    fn times(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for Timed { stage, particles, times } in self.timing.into_iter().flatten() {
            let of =
                Of { condition: CONDITIONS[0].name, frames: "all", source: stage, particles: *particles };
            let all: Vec<usize> = (0..times.len()).collect();
            for (statistic, share) in [("median", 0.5), ("p99", 0.99)] {
                let value = quantile(times, &all, share);
                rows.push(of.row(("ms_per_frame", statistic), exact(value)));
            }
        }
        rows
    }

    /// Every number, in the order of the tables.
    pub fn rows(&self) -> Vec<Row> {
        let mut rows: Vec<Row> = (0..CONDITIONS.len()).flat_map(|condition| self.under(condition)).collect();
        rows.extend(self.sweeps.keys().flat_map(|particles| self.of_sweep(*particles)));
        rows.extend(self.times());
        rows
    }

    /// The normalised cumulative errors of the first clip, as the thesis draws them.
    pub(super) fn curves(&self, particles: usize) -> Option<Vec<Vec<f64>>> {
        self.sweeps.get(&particles)?.first().map(|clip| cumulative(&clip.squares))
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let head =
            ["condition", "frames", "source", "particles", "metric", "statistic", "value", "low", "high"];
        let mut tables = Vec::new();
        let asked = &self.experiment.request.tables;
        let mut push = |name: &str, about: &str, rows: Vec<Row>| {
            let entries = |row: Row| -> Vec<Entry> {
                vec![
                    row.condition.into(),
                    row.frames.into(),
                    row.source.into(),
                    row.particles.into(),
                    row.metric.into(),
                    row.statistic.into(),
                    row.value.into(),
                    row.low.into(),
                    row.high.into(),
                ]
            };
            tables.push(Table {
                name: format!("table-{name}"),
                about: about.to_owned(),
                head: head.map(str::to_owned).to_vec(),
                rows: rows.into_iter().map(entries).collect(),
            });
        };
        if asked.contains(ERRORS) {
            let rows = (0..CONDITIONS.len()).flat_map(|condition| self.under(condition)).collect();
            push(ERRORS, "Distances from the truth by condition and source.", rows);
        }
        if asked.contains(SWEEPS) {
            let rows = self.sweeps.keys().flat_map(|particles| self.of_sweep(*particles)).collect();
            push(SWEEPS, "The thesis's chapter 5: numbers of particles.", rows);
        }
        if self.experiment.is_drawn() {
            push("latency", "Processor time per frame.", self.times());
        }
        if asked.contains(ERRORS) {
            tables.push(self.frame_table());
        }
        if asked.contains(SWEEPS) {
            tables.extend([self.curve_table(), self.warm_up_table()]);
        }
        tables
    }

    /// What every source was off by in every frame of the first clip.
    fn frame_table(&self) -> Table {
        let head: Vec<&str> = ["frame"].into_iter().chain(IN_TIME).chain([FLOOR]).collect();
        let frames = self.clips.get(&0).and_then(|clips| clips.first()).map_or(0, |clip| clip.floor.len());
        let all = IN_TIME.into_iter().chain([FLOOR]);
        let lines: Vec<Vec<[f64; 2]>> = all.map(|source| self.in_time(source)).collect();
        let entry = |line: &Vec<[f64; 2]>, k: usize| {
            Entry::from(line.iter().find(|point| point[0] == (k + FIRST) as f64).map(|point| point[1]))
        };
        let row = |k: usize| -> Vec<Entry> {
            std::iter::once((k + FIRST).into()).chain(lines.iter().map(|line| entry(line, k))).collect()
        };
        let about =
            "Distances from the truth in the first clip, and the noise floor of the operators' mean, px.";
        Table::new("table-in-time", about, &head, (0..frames).map(row).collect())
    }

    /// Frame and distance from the truth of a source in the first clip, where it said something; or the noise
    /// floor.
    pub(super) fn in_time(&self, source: &str) -> Vec<[f64; 2]> {
        let Some(clip) = self.clips.get(&0).and_then(|clips| clips.first()) else { return Vec::new() };
        let errors = if source == FLOOR { Some(&clip.floor) } else { clip.errors.get(source) };
        let values = errors.into_iter().flatten().enumerate();
        values.filter_map(|(k, error)| Some([(k + FIRST) as f64, (*error)?])).collect()
    }

    fn warm_up_table(&self) -> Table {
        let mut rows: Vec<Vec<Entry>> = Vec::new();
        for particles in self.sweeps.keys() {
            let Some(curve) = self.welch(*particles) else { continue };
            for (k, mean) in curve.mean.iter().enumerate() {
                rows.push(vec![
                    (*particles).into(),
                    (k + 1).into(),
                    (*mean).into(),
                    curve.smooth.get(k).copied().into(),
                    curve.level.into(),
                    curve.band.into(),
                ]);
            }
        }
        let head = ["particles", "frame", "mean", "smoothed", "level", "band"];
        Table::new(
            "table-warm-up",
            "Squared errors of the thesis's filter by Welch's procedure, px².",
            &head,
            rows,
        )
    }

    fn curve_table(&self) -> Table {
        let mut rows: Vec<Vec<Entry>> = Vec::new();
        for particles in self.sweeps.keys() {
            for (k, frame) in
                self.curves(*particles).map(transposed).unwrap_or_default().into_iter().enumerate()
            {
                let mut row: Vec<Entry> = vec![(*particles).into(), (k + 1).into()];
                row.extend(frame.into_iter().map(Entry::from));
                rows.push(row);
            }
        }
        Table {
            name: "table-curves".to_owned(),
            about: "Normalised cumulative mean squared errors of the first clip.".to_owned(),
            head: ["particles", "frame", "device", "color", "depth", "filter"].map(str::to_owned).to_vec(),
            rows,
        }
    }
}

fn transposed(curves: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let frames = curves.first().map_or(0, Vec::len);
    (0..frames).map(|k| curves.iter().map(|curve| curve[k]).collect()).collect()
}

fn mean(drawn: &[f64]) -> f64 {
    drawn.iter().sum::<f64>() / drawn.len() as f64
}

/// By what share the root mean square of the first is less than that of the second.
fn improvement(drawn: &[(f64, f64)]) -> f64 {
    let sum = |pick: fn(&(f64, f64)) -> f64| drawn.iter().map(|pair| pick(pair).powi(2)).sum::<f64>();
    1.0 - (sum(|pair| pair.0) / sum(|pair| pair.1)).sqrt()
}
