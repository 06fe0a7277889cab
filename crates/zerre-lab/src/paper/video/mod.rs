//! Tracking by structural similarity: the paper's tables beside ours, run many times, and all other trackers
//! beside.
//!
//! A [`Request`] names tables; each [`Cell`] is one run of one tracker on one sequence, and [`VideoTrackers`]
//! is all of it as an [`Experiment`]. Sequences are not part of the program: those of a folder are used, and
//! what is printed of others stands there without a number of ours.

mod pictures;
pub mod printed;
mod report;
pub mod settings;
mod tables;
#[cfg(test)]
mod tests;

pub use tables::{NOT_AVAILABLE, Results, Row, Value};

use super::Paper;
use crate::otb::{Doubts, Followed, Scores, follow, luck};
use crate::study::experiment::{Experiment, Finished, Mishap, SettingsFile};
use printed::Printed;
use serde::{Deserialize, Serialize};
use settings::{QUICK_RUNS, RUNS, TIMED_FRAMES};
use std::collections::{BTreeMap, BTreeSet};
use zerre_vision::Rect;
use zerre_vision::frames::Frames;
use zerre_vision::sequence::Sequence;
use zerre_vision::tracker::{Kind, TRACKERS};

/// The table of sequences that the paper does not have.
const OTHERS: &str = "others";

/// What lists say.
pub const PAPER: Paper = Paper {
    name: "video",
    about: "particle filters that follow a box by colour or structural similarity, beside all other trackers",
    source: "Dilmen and Talu, a particle filter by structural similarity, 2017: tables 1 to 3",
    tables: &["1", "2", "3", OTHERS],
    on_request: &[],
};

/// The file of settings.
pub const SETTINGS: SettingsFile =
    SettingsFile { path: "crates/zerre-lab/src/paper/video/settings.rs", text: settings::SOURCE };

/// What to compute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Tables, of those in [`PAPER`].
    pub tables: BTreeSet<&'static str>,
    /// Runs of each tracker on each sequence.
    pub runs: usize,
}

impl Request {
    /// All tables, or all of them with fewer runs.
    pub fn new(quick: bool) -> Request {
        let runs = if quick { QUICK_RUNS } else { RUNS };
        Request { tables: PAPER.tables.iter().copied().collect(), runs }
    }
}

/// One run. The order is that of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// Place of the sequence.
    pub sequence: usize,
    /// Place in [`TRACKERS`].
    pub tracker: usize,
    /// Which run, from 0.
    pub run: usize,
}

/// What became of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Its scores over the whole sequence; `None` where it could not begin.
    pub scores: Option<Scores>,
    /// What the tracker's doubts were worth.
    pub doubts: Doubts,
    /// Error up to each frame that the paper gives one for, px.
    pub rmse_at: Vec<(usize, f64)>,
    /// Frames that could not be read.
    pub unread: usize,
    /// Why the run did not begin, or ended early.
    pub refusal: Option<String>,
}

/// The experiment under one seed.
#[derive(Clone, Debug)]
pub struct VideoTrackers {
    request: Request,
    sequences: Vec<Sequence>,
    printed: Printed,
    seed: u64,
}

impl VideoTrackers {
    /// What `request` asks for, on these sequences as far as its tables have them.
    ///
    /// # Errors
    /// Damaged data that came with the program.
    pub fn new(
        request: Request,
        mut sequences: Vec<Sequence>,
        seed: u64,
    ) -> Result<VideoTrackers, Box<dyn std::error::Error>> {
        let printed = Printed::read()?;
        let wanted = |name: &str| {
            let tables_of =
                |tables: &[&str]| tables.iter().any(|table| printed.sequences(table).contains(&name));
            let asked: Vec<&str> = request.tables.iter().copied().collect();
            tables_of(&asked) || (asked.contains(&OTHERS) && !tables_of(PAPER.tables))
        };
        sequences.retain(|sequence| wanted(&sequence.name));
        sequences.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(VideoTrackers { request, sequences, printed, seed })
    }

    /// Names of the sequences that are used.
    pub fn sequences(&self) -> Vec<&str> {
        self.sequences.iter().map(|sequence| sequence.name.as_str()).collect()
    }

    /// Frames, annotation and first box of a sequence, of at most so many frames.
    fn open(&self, sequence: usize, most: usize) -> zerre::Result<(Frames, &[Option<Rect>], Rect)> {
        let sequence = &self.sequences[sequence];
        let (first, bounds) = sequence
            .start()
            .ok_or_else(|| zerre::Error::Unsupported(format!("{} has no box", sequence.name)))?;
        let truth = &sequence.truth[first..];
        let truth = &truth[..truth.len().min(most)];
        Ok((Frames::of_pictures(sequence.pictures.part(first, truth.len())), truth, bounds))
    }

    fn outcome(&self, cell: &Cell, mut followed: Followed, truth: &[Option<Rect>]) -> Outcome {
        if let Some(last) = followed.estimates.last().copied() {
            // Where the tracker has given up, its last box stands to the end.
            followed.estimates.resize(truth.len(), last);
        }
        let boxes: Vec<Option<Rect>> = followed.estimates.iter().map(|e| Some(e.bounds)).collect();
        let name = &self.sequences[cell.sequence].name;
        let frames = PAPER.tables.iter().flat_map(|table| self.printed.frames(table, name));
        let up_to = |frame: usize| {
            let (boxes, truth) = (boxes.get(..frame)?, truth.get(..frame)?);
            Some((frame, Scores::of(boxes, truth).rmse_px())).filter(|(_, rmse)| rmse.is_finite())
        };
        Outcome {
            rmse_at: frames.filter_map(up_to).collect(),
            scores: Some(Scores::of(&boxes, truth)),
            doubts: Doubts::of(&followed.estimates, truth),
            unread: followed.unread.len(),
            refusal: followed.refusal,
        }
    }
}

/// A tracker of the list.
fn kind(cell: &Cell) -> &'static Kind {
    &TRACKERS[cell.tracker]
}

/// Frames per second of processor time, of each sequence and tracker.
pub type Timing = BTreeMap<(usize, usize), f64>;

impl Experiment for VideoTrackers {
    type Cell = Cell;
    type Outcome = Outcome;
    type Timing = Timing;
    type Row = Row;

    const UNIT: &'static str = "frames";

    fn cells(&self) -> Vec<Cell> {
        let runs = |sequence, tracker| (0..self.request.runs).map(move |run| Cell { sequence, tracker, run });
        let trackers = |sequence| (0..TRACKERS.len()).flat_map(move |tracker| runs(sequence, tracker));
        (0..self.sequences.len()).flat_map(trackers).collect()
    }

    fn key(&self, cell: &Cell) -> String {
        format!("{} {} {}", self.sequences[cell.sequence].name, kind(cell).name, cell.run + 1)
    }

    fn cost(&self, cell: &Cell) -> u64 {
        self.sequences[cell.sequence].truth.len() as u64
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        let (mut frames, truth, bounds) = self.open(cell.sequence, usize::MAX)?;
        let stream = luck(self.seed, cell.run as u64);
        Ok(match follow(kind(cell), &mut frames, |_| bounds, stream, |_| !stop()) {
            Ok(followed) if followed.stopped => None,
            Ok(followed) => Some(self.outcome(cell, followed, truth)),
            Err(error) => Some(Outcome { refusal: Some(error.to_string()), ..Outcome::default() }),
        })
    }

    fn rounds(&self) -> u64 {
        (self.sequences.len() * TRACKERS.len()) as u64
    }

    fn time(&self, stop: &dyn Fn() -> bool, done: &mut dyn FnMut()) -> zerre::Result<Option<Timing>> {
        let mut timing = Timing::new();
        for sequence in 0..self.sequences.len() {
            for (tracker, kind) in TRACKERS.iter().enumerate() {
                let (mut frames, _, bounds) = self.open(sequence, TIMED_FRAMES)?;
                let stream = luck(self.seed, 0);
                if let Ok(followed) = follow(kind, &mut frames, |_| bounds, stream, |_| !stop()) {
                    if followed.stopped {
                        return Ok(None);
                    }
                    timing.extend(followed.fps().map(|fps| ((sequence, tracker), fps)));
                }
                done();
            }
        }
        Ok(Some(timing))
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Outcome>,
        timing: Option<&Timing>,
    ) -> Result<Finished<Row>, Box<dyn std::error::Error>> {
        let interrupted = outcomes.len() < self.cells().len() || timing.is_none();
        let results = Results::new(self, outcomes, timing);
        let rows = results.rows();
        let estimates = rows.iter().filter(|row| row.metric != "fps").filter_map(Row::numbers).flatten();
        let painted = self.pictures()?;
        let pictures = painted.iter().map(|one| one.picture.clone()).collect();
        Ok(Finished {
            estimates: estimates.collect(),
            tables: results.tables(),
            files: painted.into_iter().map(|one| (one.picture.file, one.bytes)).collect(),
            page: results.page(pictures, interrupted),
            mishaps: vec![
                Mishap {
                    what: "frame could not be read",
                    action: "the estimate before stood",
                    count: outcomes.values().map(|outcome| outcome.unread).sum(),
                },
                Mishap {
                    what: "tracker refused a sequence or a frame",
                    action: "its last box stood to the end; without a first one the run is left out",
                    count: outcomes.values().filter(|outcome| outcome.refusal.is_some()).count(),
                },
            ],
            rows,
        })
    }
}
