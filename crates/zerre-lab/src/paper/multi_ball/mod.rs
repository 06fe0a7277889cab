//! The multi-ball example: the table's layout with both references, the same filters on the linear-Gaussian version
//! beside the Kalman filter, and what becomes of identities where balls meet.
//!
//! A [`Cell`] is one run of a [`Part`]: a drawn clip for all readings and sizes, a draw of the linear model for all
//! motions, resamplers and sizes, or clips of balls that meet. [`MultiBall`] is all of it as an [`Experiment`].

mod pictures;
pub mod printed;
mod report;
pub mod settings;
mod tables;
#[cfg(test)]
mod tests;
mod work;

pub use tables::{Results, Row};

use super::Paper;
use crate::study::experiment::{Experiment, Finished, Mishap, SettingsFile};
use crate::study::world::label;
use cpu_time::ThreadTime;
use printed::Printed;
use serde::{Deserialize, Serialize};
use settings::{FLOOR_RUNS, QUICK_PARTICLES, RUNS};
use std::collections::{BTreeMap, BTreeSet};
use zerre::resample::Resampling;
use zerre::rng::{Purpose, Stream};
use zerre_vision::balls::thesis::READINGS;

/// What lists say.
pub const PAPER: Paper = Paper {
    name: "multi-ball",
    about: "three balls by a particle filter each: the thesis' table, the Kalman floor, identities where balls meet",
    source: "Turkish thesis on sensor fusion by particle filters, section 3.4: table 3.1, figures 3.2 to 3.5",
    tables: &["3.1", "floor", "identity"],
    on_request: &[],
};

/// The file of settings.
pub const SETTINGS: SettingsFile =
    SettingsFile { path: "crates/zerre-lab/src/paper/multi_ball/settings.rs", text: settings::SOURCE };

/// What to compute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Tables, of those in [`PAPER`].
    pub tables: BTreeSet<&'static str>,
    /// Runs of each cell; the linear model has [`FLOOR_RUNS`] times as many.
    pub runs: usize,
    /// Numbers of particles; those of the printed table where empty.
    pub particles: Vec<usize>,
}

impl Request {
    /// All tables at all sizes, or at a few.
    pub fn new(quick: bool) -> Request {
        let particles = if quick { QUICK_PARTICLES.to_vec() } else { Vec::new() };
        Request { tables: PAPER.tables.iter().copied().collect(), runs: RUNS, particles }
    }
}

/// A part of the comparison. The order is that of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The printed table.
    Table,
    /// The linear-Gaussian version.
    Floor,
    /// Identities.
    Identity,
}

impl Part {
    const ALL: [Part; 3] = [Part::Table, Part::Floor, Part::Identity];

    /// Its table.
    pub fn table(self) -> &'static str {
        match self {
            Part::Table => "3.1",
            Part::Floor => "floor",
            Part::Identity => "identity",
        }
    }
}

/// One run of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// The part.
    pub part: Part,
    /// Which run, from 0.
    pub run: usize,
}

/// What became of a run: numbers in the order of the loops of `work`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The numbers.
    pub values: Vec<f64>,
    /// Measurements that no particle could explain, and balls that a frame did not show.
    pub mishaps: usize,
}

/// Seconds of a clip: in the detector, and in the filters of each size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timing {
    detector: f64,
    filters: Vec<f64>,
}

/// The filters of the linear model, in the order of rows: blind ones, as the thesis has them, with each
/// resampler, and one that looks at the measurement: the locally optimal proposal with full adaptation, what
/// `zerre balls` follows with.
const FILTERS: [(&str, Resampling, bool); 5] = [
    ("multinomial", Resampling::Multinomial, false),
    ("residual", Resampling::Residual, false),
    ("stratified", Resampling::Stratified, false),
    ("systematic", Resampling::Systematic, false),
    ("adapted", Resampling::Systematic, true),
];
/// The motions of the linear model.
const MOTIONS: [&str; 2] = ["random-walk", "constant-velocity"];
/// What errors are held against.
const REFERENCES: [&str; 2] = ["detection", "truth"];
/// How balls are told apart.
const METHODS: [&str; 2] = ["area", "assignment"];

/// The comparison under one seed.
#[derive(Clone, Debug)]
pub struct MultiBall {
    request: Request,
    printed: Printed,
    seed: u64,
}

impl MultiBall {
    /// What `request` asks for.
    ///
    /// # Errors
    /// Damaged data that came with the program.
    pub fn new(mut request: Request, seed: u64) -> Result<MultiBall, Box<dyn std::error::Error>> {
        let printed = Printed::read()?;
        if request.particles.is_empty() {
            request.particles = printed.particles();
        }
        request.particles.sort_unstable();
        request.particles.dedup();
        Ok(MultiBall { request, printed, seed })
    }

    /// Numbers of particles.
    pub fn particles(&self) -> &[usize] {
        &self.request.particles
    }

    /// Runs of a part.
    fn runs(&self, part: Part) -> usize {
        if part == Part::Floor { FLOOR_RUNS * self.request.runs } else { self.request.runs }
    }

    /// The random numbers of a run.
    fn luck(&self, part: Part, run: usize) -> Stream {
        Stream::new(self.seed).fork(label(PAPER.name)).fork(label(part.table())).fork(run as u64)
    }

    /// The seed of a run's clip.
    fn clip_seed(&self, part: Part, run: usize) -> u64 {
        self.luck(part, run).draws(Purpose::Other, 0, 0).next_u64()
    }

    fn asks(&self, part: Part) -> bool {
        self.request.tables.contains(part.table())
    }
}

impl Experiment for MultiBall {
    type Cell = Cell;
    type Outcome = Outcome;
    type Timing = Timing;
    type Row = Row;

    const UNIT: &'static str = "thousands of particles";

    fn cells(&self) -> Vec<Cell> {
        let parts = Part::ALL.into_iter().filter(|part| self.asks(*part));
        parts.flat_map(|part| (0..self.runs(part)).map(move |run| Cell { part, run })).collect()
    }

    fn key(&self, cell: &Cell) -> String {
        let sizes: Vec<String> = self.request.particles.iter().map(ToString::to_string).collect();
        format!("{} run {} of {}", cell.part.table(), cell.run + 1, sizes.join(" "))
    }

    fn cost(&self, cell: &Cell) -> u64 {
        let particles: usize = self.request.particles.iter().sum();
        let each = match cell.part {
            Part::Table => 2000 + READINGS.len() * particles,
            Part::Floor => FILTERS.len() * MOTIONS.len() * particles,
            Part::Identity => 10_000,
        };
        each as u64 / 1000 + 1
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        match cell.part {
            Part::Table => self.table_run(cell.run, stop),
            Part::Floor => self.floor_run(cell.run, stop),
            Part::Identity => self.identity_run(cell.run, stop),
        }
    }

    fn rounds(&self) -> u64 {
        if self.asks(Part::Table) { self.request.particles.len() as u64 } else { 0 }
    }

    fn time(&self, stop: &dyn Fn() -> bool, done: &mut dyn FnMut()) -> zerre::Result<Option<Timing>> {
        if !self.asks(Part::Table) {
            return Ok(None);
        }
        let Some(clip) = self.clip(0, stop)? else { return Ok(None) };
        let mut timing = Timing { detector: clip.seconds, filters: Vec::new() };
        for particles in &self.request.particles {
            if stop() {
                return Ok(None);
            }
            let since = ThreadTime::now();
            let luck = self.luck(Part::Table, 0);
            std::hint::black_box(work::follow(&clip, &READINGS[0], *particles, luck)?);
            timing.filters.push(since.elapsed().as_secs_f64());
            done();
        }
        Ok(Some(timing))
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Outcome>,
        timing: Option<&Timing>,
    ) -> Result<Finished<Row>, Box<dyn std::error::Error>> {
        let interrupted = outcomes.len() < self.cells().len() || (timing.is_none() && self.asks(Part::Table));
        let results = Results::new(self, outcomes, timing);
        let rows = results.rows();
        let estimates = rows.iter().filter(|row| row.metric != "seconds");
        let (figures, painted) =
            if self.asks(Part::Table) && !interrupted { self.pictures()? } else { Default::default() };
        let pictures = painted.iter().map(|one| one.0.clone()).collect();
        Ok(Finished {
            estimates: estimates.flat_map(|row| [row.value, row.low, row.high]).collect(),
            tables: results.tables(),
            page: results.page((figures, pictures), interrupted),
            files: painted.into_iter().map(|(picture, bytes)| (picture.file, bytes)).collect(),
            mishaps: vec![Mishap {
                what: "ball not seen, or measurement without likelihood",
                action: "the prediction stood",
                count: outcomes.values().map(|outcome| outcome.mishaps).sum(),
            }],
            rows,
        })
    }
}
