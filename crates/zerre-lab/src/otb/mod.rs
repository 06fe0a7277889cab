//! Trackers scored on annotated sequences as the Object Tracking Benchmark does it: protocols, scores, and
//! all of it as an [`Experiment`] whose cells are single runs.

mod follow;
mod page;
mod protocol;
mod report;
mod score;
mod summary;
#[cfg(test)]
mod tests;

pub use follow::{Followed, Moment, follow, luck};
pub use page::{Watched, page, scores};
pub use protocol::{Protocol, STARTS, Shift, Start};
pub use score::{Doubts, LOST_FRAMES, OFF_OBJECT, PRECISION_AT, Scores};
pub use summary::{Line, Row, lines};

use crate::study::experiment::{Experiment, Finished};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use zerre_vision::frames::Frames;
use zerre_vision::sequence::Sequence;
use zerre_vision::tracker::{Estimate, Kind};
use zerre_vision::{Error, Rect, Result};

/// Boxes that another program found.
#[derive(Clone, Debug, PartialEq)]
pub struct Answers {
    /// Name of its tracker.
    pub tracker: String,
    /// For each sequence its boxes, from the first annotated frame on; `None` where it has no file.
    pub boxes: Vec<Option<Vec<Option<Rect>>>>,
}

/// What to score.
#[derive(Clone, Debug)]
pub struct Otb {
    /// The sequences.
    pub sequences: Vec<Sequence>,
    /// The trackers that are run on them.
    pub trackers: Vec<&'static Kind>,
    /// Those that were run by others.
    pub others: Vec<Answers>,
    /// How they are run.
    pub protocols: Vec<Protocol>,
    /// How often each run is repeated with other random numbers.
    pub repeats: usize,
    /// The seed of all of them.
    pub seed: u64,
}

/// One run. The order is that of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// How it is run.
    pub protocol: Protocol,
    /// Place of its sequence.
    pub sequence: usize,
    /// Place of its tracker.
    pub tracker: usize,
    /// Which repetition it is, from 0.
    pub repeat: usize,
    /// Where it begins.
    pub start: Start,
}

/// What became of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Its scores; `None` where it could not begin.
    pub scores: Option<Scores>,
    /// What the tracker's doubts were worth.
    pub doubts: Doubts,
    /// Frames that the tracker looked at, ...
    pub steps: usize,
    /// ... and its processor time for them, s.
    pub seconds: f64,
    /// Frames that could not be read.
    pub unread: usize,
    /// Why the run did not begin, or ended early.
    pub refusal: Option<String>,
    /// The estimates, where they are kept: of the first run of the one-pass evaluation.
    pub estimates: Vec<Estimate>,
}

impl Outcome {
    /// Frames per second of processor time; `None` where there is too little of it to tell.
    pub fn fps(&self) -> Option<f64> {
        Some(self.steps as f64 / self.seconds).filter(|fps| fps.is_finite() && *fps > 0.0)
    }
}

impl Otb {
    /// Runs a cell; `None` if `stop` says so meanwhile.
    fn run(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> Result<Option<Outcome>> {
        let sequence = &self.sequences[cell.sequence];
        let Start { frame, shift } = cell.start;
        let truth = &sequence.truth[frame..];
        let Some(bounds) = truth.first().copied().flatten() else {
            let problem = format!("the first frame of the run, {frame}, has no box");
            return Err(Error::Input { input: sequence.name.clone(), problem });
        };
        let mut frames = Frames::of_pictures(sequence.pictures.part(frame, truth.len()));
        let place = |size| shift.map_or(bounds, |shift| shift.of(bounds, size));
        // Runs that begin elsewhere have other luck; trackers have the same.
        let place_of = |shift| 1 + Shift::ALL.iter().take_while(|other| **other != shift).count() as u64;
        let mut stream = luck(self.seed, cell.repeat as u64);
        if cell.protocol != Protocol::OnePass {
            stream = stream.fork(frame as u64).fork(shift.map_or(0, place_of));
        }
        let followed = follow(self.trackers[cell.tracker], &mut frames, place, stream, |_| !stop())?;
        if followed.stopped && stop() {
            return Ok(None);
        }
        let mut estimates = followed.estimates;
        if let Some(last) = estimates.last().copied() {
            // Where the tracker has given up, its last box stands to the end.
            estimates.resize(truth.len(), Estimate { p_lost: 1.0, ..last });
        }
        let boxes: Vec<Option<Rect>> = estimates.iter().map(|estimate| Some(estimate.bounds)).collect();
        let kept = cell.protocol == Protocol::OnePass && cell.repeat == 0;
        Ok(Some(Outcome {
            scores: Some(Scores::of(&boxes, truth)),
            doubts: Doubts::of(&estimates, truth),
            steps: followed.steps,
            seconds: followed.seconds,
            unread: followed.unread.len(),
            refusal: followed.refusal,
            estimates: if kept { estimates } else { Vec::new() },
        }))
    }
}

impl Experiment for Otb {
    type Cell = Cell;
    type Outcome = Outcome;
    type Timing = ();
    type Row = Row;

    const UNIT: &'static str = "frames";

    fn cells(&self) -> Vec<Cell> {
        let mut cells = Vec::new();
        for protocol in self.protocols.iter().copied() {
            for (sequence, of) in self.sequences.iter().enumerate() {
                let starts = protocol.starts(&of.truth);
                for tracker in 0..self.trackers.len() {
                    for repeat in 0..self.repeats {
                        cells.extend(starts.iter().map(|start| Cell {
                            protocol,
                            sequence,
                            tracker,
                            repeat,
                            start: *start,
                        }));
                    }
                }
            }
        }
        cells.sort();
        cells.dedup();
        cells
    }

    fn key(&self, cell: &Cell) -> String {
        let Cell { protocol, sequence, tracker, repeat, start } = cell;
        let mut key = format!(
            "{} {} {} {} {}",
            protocol.name(),
            self.sequences[*sequence].name,
            self.trackers[*tracker].name,
            repeat + 1,
            start.frame
        );
        if let Some(shift) = start.shift {
            // Writing to a string cannot fail.
            let _ = write!(key, " {shift:?}");
        }
        key
    }

    fn cost(&self, cell: &Cell) -> u64 {
        self.sequences[cell.sequence].truth.len().saturating_sub(cell.start.frame) as u64
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        Ok(self
            .run(cell, stop)
            .unwrap_or_else(|error| Some(Outcome { refusal: Some(error.to_string()), ..Outcome::default() })))
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Outcome>,
        _: Option<&()>,
    ) -> std::result::Result<Finished<Row>, Box<dyn std::error::Error>> {
        Ok(report::finish(self, outcomes))
    }
}

/// Estimates as a table: `frame,x,y,w,h,p_lost,var_x,var_y`, frames counted from `first`, the first pixel
/// being 0.
pub fn boxes_csv(estimates: &[Estimate], first: usize) -> String {
    let mut out = String::from("frame,x,y,w,h,p_lost,var_x,var_y\n");
    for (frame, estimate) in (first..).zip(estimates) {
        let [[var_x, _], [_, var_y]] = estimate.covariance;
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{frame},{},{},{var_x},{var_y}", estimate.bounds, estimate.p_lost);
    }
    out
}
