//! From runs to rows: repetitions, and their means with intervals.

use super::{Cell, Doubts, Otb, Outcome, Protocol, Scores};
use crate::study::experiment::Experiment;
use crate::study::interval::{Estimate, mean_interval};
use serde::Serialize;
use std::collections::BTreeMap;

/// One repetition of one tracker on one sequence; in the robustness evaluations over all starts, frame by
/// frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The sequence.
    pub sequence: String,
    /// The tracker.
    pub tracker: String,
    /// How it was run.
    pub protocol: Protocol,
    /// Which repetition, from 1.
    pub repeat: usize,
    /// Annotated frames.
    pub frames: usize,
    /// Root mean square distance of the centres, px.
    pub rmse_px: Option<f64>,
    /// Share of frames within 20 px.
    pub precision20: f64,
    /// Area under the success curve.
    pub success_auc: f64,
    /// Mean overlap.
    pub iou: f64,
    /// Share of the frames not flagged as lost in which the 95 % ellipse covers the truth's centre.
    pub coverage95: Option<f64>,
    /// Share of the runs that were lost at their end.
    pub lost_share: f64,
    /// Frames per second of processor time.
    pub fps: Option<f64>,
    /// The curves and counts behind it.
    #[serde(skip)]
    pub scores: Scores,
    /// What the tracker's doubts were worth.
    #[serde(skip)]
    pub doubts: Doubts,
}

impl Row {
    fn new(name: [&str; 2], protocol: Protocol, repeat: usize, scores: Scores) -> Row {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let [sequence, tracker] = name.map(str::to_owned);
        Row {
            sequence,
            tracker,
            protocol,
            repeat: repeat + 1,
            frames: scores.frames,
            rmse_px: finite(scores.rmse_px()),
            precision20: scores.precision20(),
            success_auc: scores.success_auc(),
            iou: scores.iou(),
            coverage95: None,
            lost_share: scores.lost_share(),
            fps: None,
            scores,
            doubts: Doubts::default(),
        }
    }
}

/// The rows of all repetitions whose runs are all there, then those of other programs.
pub fn rows(otb: &Otb, outcomes: &BTreeMap<Cell, Outcome>) -> Vec<Row> {
    let mut groups: BTreeMap<_, (usize, Vec<&Outcome>)> = BTreeMap::new();
    for cell in otb.cells() {
        let key = (cell.protocol, cell.sequence, cell.tracker, cell.repeat);
        let (expected, found) = groups.entry(key).or_default();
        *expected += 1;
        found.extend(outcomes.get(&cell));
    }
    let mut rows = Vec::new();
    for ((protocol, sequence, tracker, repeat), (expected, found)) in groups {
        let mut scores = Scores::default();
        let mut sum = Outcome::default();
        for outcome in found.iter().filter(|outcome| outcome.scores.is_some()) {
            outcome.scores.iter().for_each(|of| scores.add(of));
            sum.doubts.add(&outcome.doubts);
            sum.steps += outcome.steps;
            sum.seconds += outcome.seconds;
        }
        if found.len() < expected || scores.frames == 0 {
            continue;
        }
        let name = [otb.sequences[sequence].name.as_str(), otb.trackers[tracker].name];
        let coverage = sum.doubts.coverage95();
        rows.push(Row {
            fps: sum.fps(),
            coverage95: Some(coverage).filter(|coverage| coverage.is_finite()),
            doubts: sum.doubts,
            ..Row::new(name, protocol, repeat, scores)
        });
    }
    for other in &otb.others {
        for (sequence, boxes) in otb.sequences.iter().zip(&other.boxes) {
            let Some(boxes) = boxes else { continue };
            let name = [sequence.name.as_str(), other.tracker.as_str()];
            rows.push(Row::new(name, Protocol::OnePass, 0, Scores::of(boxes, &sequence.truth)));
        }
    }
    rows
}

/// One tracker on one sequence, or on all of them, over its repetitions.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// How it was run.
    pub protocol: Protocol,
    /// The sequence; `None` stands for the mean over all that the tracker was scored on.
    pub sequence: Option<String>,
    /// The tracker.
    pub tracker: String,
    /// Sequences behind it.
    pub sequences: usize,
    /// Repetitions behind it.
    pub repeats: usize,
    /// Root mean square distance of the centres, px.
    pub rmse_px: Option<Estimate>,
    /// Share of frames within 20 px.
    pub precision20: Option<Estimate>,
    /// Area under the success curve.
    pub success_auc: Option<Estimate>,
    /// Mean overlap.
    pub iou: Option<Estimate>,
    /// Coverage of the 95 % ellipse.
    pub coverage95: Option<Estimate>,
    /// Share of lost runs: a mean, without interval.
    pub lost_share: f64,
    /// Frames per second of processor time: a mean, without interval.
    pub fps: Option<f64>,
    /// Mean share of frames whose overlap exceeds each threshold.
    pub success: Vec<f64>,
    /// Mean share of frames whose error does not exceed each threshold.
    pub precision: Vec<f64>,
}

/// Lines of each protocol and tracker: the mean over sequences first, then each sequence.
pub fn lines(rows: &[Row]) -> Vec<Line> {
    let mut names: Vec<(Protocol, &str)> = Vec::new();
    for row in rows {
        if !names.contains(&(row.protocol, &row.tracker)) {
            names.push((row.protocol, &row.tracker));
        }
    }
    names.sort_by_key(|(protocol, _)| *protocol);
    let mut lines = Vec::new();
    for (protocol, tracker) in names {
        let of: Vec<&Row> =
            rows.iter().filter(|row| row.protocol == protocol && row.tracker == tracker).collect();
        let mut sequences: Vec<&str> = Vec::new();
        for row in &of {
            if !sequences.contains(&row.sequence.as_str()) {
                sequences.push(&row.sequence);
            }
        }
        lines.push(line(&of, None));
        lines.extend(sequences.into_iter().map(|sequence| {
            let of: Vec<&Row> = of.iter().filter(|row| row.sequence == sequence).copied().collect();
            line(&of, Some(sequence))
        }));
    }
    lines
}

/// A line over rows of one tracker and protocol, at least one.
fn line(of: &[&Row], sequence: Option<&str>) -> Line {
    let mut repeats: BTreeMap<usize, Vec<&Row>> = BTreeMap::new();
    of.iter().for_each(|row| repeats.entry(row.repeat).or_default().push(row));
    let sequences = repeats.values().map(Vec::len).max().unwrap_or(0);
    // A repetition that an interruption cut short has fewer sequences: its mean is over others.
    repeats.retain(|_, rows| rows.len() == sequences);
    let mean = |rows: &[&Row], value: &dyn Fn(&Row) -> Option<f64>| {
        let values: Vec<f64> = rows.iter().filter_map(|row| value(row)).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let over_repeats = |value: &dyn Fn(&Row) -> Option<f64>| {
        let means: Vec<f64> =
            repeats.values().map(|rows| mean(rows, value)).filter(|v| v.is_finite()).collect();
        mean_interval(&means)
    };
    let whole: Vec<&Row> = repeats.values().flatten().copied().collect();
    let curve = |of: &dyn Fn(&Scores) -> Vec<f64>| {
        let curves: Vec<Vec<f64>> = whole.iter().map(|row| of(&row.scores)).collect();
        let points = curves.iter().map(Vec::len).max().unwrap_or(0);
        let at = |k: usize| curves.iter().filter_map(|curve| curve.get(k)).sum::<f64>() / curves.len() as f64;
        (0..points).map(at).collect()
    };
    Line {
        protocol: of[0].protocol,
        sequence: sequence.map(str::to_owned),
        tracker: of[0].tracker.clone(),
        sequences,
        repeats: repeats.len(),
        rmse_px: over_repeats(&|row| row.rmse_px),
        precision20: over_repeats(&|row| Some(row.precision20)),
        success_auc: over_repeats(&|row| Some(row.success_auc)),
        iou: over_repeats(&|row| Some(row.iou)),
        coverage95: over_repeats(&|row| row.coverage95),
        lost_share: mean(&whole, &|row| Some(row.lost_share)),
        fps: Some(mean(&whole, &|row| row.fps)).filter(|fps| fps.is_finite()),
        success: curve(&Scores::success),
        precision: curve(&Scores::precision),
    }
}
