//! Fusion of a device's joint, colour and depth: the thesis's filter as it stands, and a sound one beside it,
//! on drawn recordings whose truth is known.
//!
//! The thesis's own clip is not to be had, so none of its numbers can be met or missed: what is reproduced is
//! what it does and how it judges, under conditions of which all is known. A [`Request`] names tables;
//! [`RgbdFusion`] is all of it as an [`Experiment`].

pub mod evaluation;
mod pictures;
mod recorded;
mod report;
mod run;
pub mod settings;
mod tables;
mod timing;
pub mod welch;

pub use recorded::Recordings;
pub use run::{ClipOutcome, SweepOutcome};
pub use tables::{Results, Row};
pub use timing::Timed;

use super::Paper;
use crate::study::experiment::{Experiment, Finished, Mishap, SettingsFile};
use serde::{Deserialize, Serialize};
use settings::{CHOSEN, CLIPS, CONDITIONS, QUICK_CLIPS, RUNS, SWEEP, TIMED_FRAMES};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};
use zerre::rng::Stream;
use zerre_vision::rgbd::fusion::FusionSettings;
use zerre_vision::rgbd::scene::Scene;
use zerre_vision::rgbd::thesis::ThesisSettings;
use zerre_vision::rgbd::tracker::TrackerSettings;

/// The table of errors under all conditions.
const ERRORS: &str = "errors";
/// The table of the thesis's chapter 5.
const SWEEPS: &str = "thesis";

/// The table of recordings of a real camera.
const RECORDED: &str = "recorded";

/// What lists say.
pub const PAPER: Paper = Paper {
    name: "rgbd",
    about: "a hand followed in colour and depth by the fusion of three sources, the thesis's way and a sound one",
    source: "a thesis on particle filters that fuse sensors to follow human motion: chapters 4 and 5",
    tables: &[ERRORS, SWEEPS, RECORDED],
    on_request: &[],
};

/// The file of settings.
pub const SETTINGS: SettingsFile =
    SettingsFile { path: "crates/zerre-lab/src/paper/rgbd/settings.rs", text: settings::SOURCE };

/// What to compute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Tables, of those in [`PAPER`].
    pub tables: BTreeSet<&'static str>,
    /// Clips of each condition.
    pub clips: usize,
    /// Numbers of particles of the sweep.
    pub particles: Vec<usize>,
}

impl Request {
    /// All tables, or all of them with fewer clips and the smallest, the chosen and the largest number of
    /// particles.
    pub fn new(quick: bool) -> Request {
        let mut particles = SWEEP.to_vec();
        if quick {
            particles = vec![SWEEP[0], SWEEP[SWEEP.len() - 1]];
        }
        particles.push(CHOSEN);
        particles.sort_unstable();
        let clips = if quick { QUICK_CLIPS } else { CLIPS };
        Request { tables: PAPER.tables.iter().copied().collect(), clips, particles }
    }
}

/// A piece of the work. The order is that of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cell {
    /// All filters on a clip under a condition.
    Clip {
        /// Place in [`CONDITIONS`].
        condition: usize,
        /// Which clip.
        clip: usize,
    },
    /// A number of particles on a clip.
    Sweep {
        /// How many.
        particles: usize,
        /// Which clip.
        clip: usize,
    },
}

/// What became of a piece of the work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// Of a clip.
    Clip(ClipOutcome),
    /// Of a number of particles.
    Sweep(SweepOutcome),
}

/// The experiment under one seed.
#[derive(Debug)]
pub struct RgbdFusion {
    request: Request,
    recordings: Recordings,
    seed: u64,
    /// Settings learnt without a source; each is learnt once, by whoever needs it first.
    learnt: Mutex<BTreeMap<Option<&'static str>, TrackerSettings>>,
}

impl RgbdFusion {
    /// What `request` asks for; real recordings are those that are there.
    pub fn new(request: Request, recordings: Recordings, seed: u64) -> RgbdFusion {
        RgbdFusion { request, recordings, seed, learnt: Mutex::default() }
    }

    /// The sound filter's settings without a source, learnt from the calibration clips.
    fn learnt(&self, without: Option<&'static str>) -> zerre::Result<TrackerSettings> {
        // Others wait meanwhile: most need the same.
        let mut all = self.learnt.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = all.get(&without) {
            return Ok(known.clone());
        }
        let settings = run::learnt(without, self.seed).map_err(refused)?;
        all.insert(without, settings.clone());
        Ok(settings)
    }

    /// Whether drawn clips are asked for; real recordings have their times in a table of their own.
    fn is_drawn(&self) -> bool {
        [ERRORS, SWEEPS].iter().any(|table| self.request.tables.contains(table))
    }

    /// The first clip with a frame in which both ways of the thesis go through to their last step, and the
    /// frame; where there is none, the middle of the first clip.
    fn shown(&self, thesis: &ThesisSettings) -> zerre::Result<(usize, Scene, usize)> {
        let clip = |clip| run::clip(&CONDITIONS[0], self.seed, clip).map_err(refused);
        for k in 0..self.request.clips {
            let scene = clip(k)?;
            if let Some(frame) = pictures::complete(&scene, thesis).map_err(refused)? {
                return Ok((k, scene, frame));
            }
        }
        let scene = clip(0)?;
        let middle = scene.len() / 2;
        Ok((0, scene, middle))
    }

    fn stream(&self, clip: usize) -> Stream {
        Stream::new(self.seed).fork(0x7267_6264).fork(clip as u64)
    }
}

fn refused(error: zerre_vision::Error) -> zerre::Error {
    match error {
        zerre_vision::Error::Filter(error) => error,
        other => zerre::Error::Unsupported(other.to_string()),
    }
}

/// Processor time per frame by stage: of the chosen and of the largest number of particles, and of what both
/// share.
pub type Timing = Vec<Timed>;

impl Experiment for RgbdFusion {
    type Cell = Cell;
    type Outcome = Outcome;
    type Timing = Timing;
    type Row = Row;

    const UNIT: &'static str = "clips";

    fn cells(&self) -> Vec<Cell> {
        let clips = 0..self.request.clips;
        let mut cells = Vec::new();
        if self.request.tables.contains(ERRORS) {
            for condition in 0..CONDITIONS.len() {
                cells.extend(clips.clone().map(|clip| Cell::Clip { condition, clip }));
            }
        }
        if self.request.tables.contains(SWEEPS) {
            for &particles in &self.request.particles {
                cells.extend(clips.clone().map(|clip| Cell::Sweep { particles, clip }));
            }
        }
        cells
    }

    fn key(&self, cell: &Cell) -> String {
        match cell {
            Cell::Clip { condition, clip } => format!("{} {}", CONDITIONS[*condition].name, clip + 1),
            Cell::Sweep { particles, clip } => format!("{particles} particles {}", clip + 1),
        }
    }

    fn cost(&self, _: &Cell) -> u64 {
        1
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        if stop() {
            return Ok(None);
        }
        let thesis = ThesisSettings::default();
        Ok(Some(match *cell {
            Cell::Clip { condition, clip } => {
                let under = &CONDITIONS[condition];
                let settings = self.learnt(under.without)?;
                let scene = run::clip(under, self.seed, clip).map_err(refused)?;
                let runs = (RUNS, self.stream(clip));
                Outcome::Clip(run::compare(&scene, &settings, &thesis, runs).map_err(refused)?)
            }
            Cell::Sweep { particles, clip } => {
                let mut settings = self.learnt(None)?;
                settings.fusion = FusionSettings { particles, ..settings.fusion };
                let thesis = ThesisSettings { particles, ..thesis };
                let scene = run::clip(&CONDITIONS[0], self.seed, clip).map_err(refused)?;
                let stream = self.stream(clip);
                Outcome::Sweep(run::sweep(&scene, &settings, &thesis, stream).map_err(refused)?)
            }
        }))
    }

    fn rounds(&self) -> u64 {
        if self.is_drawn() { 3 } else { 0 }
    }

    fn time(&self, stop: &dyn Fn() -> bool, done: &mut dyn FnMut()) -> zerre::Result<Option<Timing>> {
        let thesis = ThesisSettings::default();
        let (_, shown, _) = self.shown(&thesis)?;
        let mut timing = timing::steps(&shown, &thesis, TIMED_FRAMES).map_err(refused)?;
        let scene = run::clip(&CONDITIONS[0], self.seed, 0).map_err(refused)?;
        done();
        for particles in [CHOSEN, SWEEP[SWEEP.len() - 1]] {
            if stop() {
                return Ok(None);
            }
            let mut settings = self.learnt(None)?;
            settings.fusion.particles = particles;
            let thesis = ThesisSettings { particles, ..thesis.clone() };
            timing.extend(timing::filters(&scene, &settings, &thesis, TIMED_FRAMES).map_err(refused)?);
            done();
        }
        Ok(Some(timing))
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Outcome>,
        timing: Option<&Timing>,
    ) -> Result<Finished<Row>, Box<dyn std::error::Error>> {
        let interrupted = outcomes.len() < self.cells().len() || (timing.is_none() && self.is_drawn());
        let results = Results::new(self, outcomes, timing);
        let asked = &self.request.tables;
        let (thesis, stream) = (ThesisSettings::default(), self.stream(0));
        let (mut rows, mut tables) = (results.rows(), results.tables());
        let mut sections = Vec::new();
        let mut painted = Vec::new();
        if asked.contains(SWEEPS) && !interrupted {
            let scene = run::clip(&CONDITIONS[0], self.seed, 0).map_err(refused)?;
            let (clip, shown, frame) = self.shown(&thesis)?;
            painted.extend(pictures::steps(&shown, &thesis, (clip, frame))?);
            painted.extend(pictures::overlays(&scene, &self.learnt(None)?, &thesis, stream)?);
            sections.push(report::pictures(&painted));
        }
        let mut recorded = Vec::new();
        if asked.contains(RECORDED) && !interrupted {
            // Without recordings nothing needs to be learnt.
            if !self.recordings.names().is_empty() {
                let settings = self.learnt(Some("device"))?;
                recorded =
                    recorded::judge(&self.recordings, (&settings, &thesis), stream).map_err(refused)?;
            }
            rows.extend(recorded.iter().flat_map(recorded::Judged::rows));
            tables.push(recorded::table(&recorded));
            sections.push(recorded::section(&recorded));
            painted.extend(recorded.iter().filter_map(|judged| judged.film.clone()));
        }
        let estimates = rows.iter().filter(|row| row.metric != "ms_per_frame").flat_map(Row::numbers);
        let places = recorded.iter().flat_map(recorded::Judged::estimates);
        let without = |name: &str| {
            let clips = outcomes.values().filter_map(|outcome| match outcome {
                Outcome::Clip(clip) => clip.errors.get(name),
                Outcome::Sweep(_) => None,
            });
            clips.flatten().filter(|error| error.is_none()).count()
        };
        Ok(Finished {
            estimates: estimates.chain(places).collect(),
            tables,
            files: painted.into_iter().map(|(picture, bytes)| (picture.file, bytes)).collect(),
            page: results.page(interrupted, sections),
            mishaps: ["device", "color", "depth", "thesis-color", "thesis-depth"]
                .map(|name| Mishap {
                    what: match name {
                        "device" => "frame without a joint of the device",
                        "color" => "frame without a candidate of the colour cue",
                        "depth" => "frame without a candidate of the depth cue",
                        "thesis-color" => "frame in which the thesis's colour steps left nothing",
                        _ => "frame in which the thesis's depth steps left nothing",
                    },
                    action: "the filters went on without that source",
                    count: without(name),
                })
                .to_vec(),
            rows,
        })
    }
}
