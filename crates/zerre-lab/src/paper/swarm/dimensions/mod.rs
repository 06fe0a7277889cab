//! Where swarms might earn their keep: states of many components, narrow likelihoods, a motion that costs little and a
//! measurement that costs much. Every sound swarm move against bootstrap, guided and tempered filters at equal likelihood
//! evaluations, in worlds whose posterior is known.

mod filters;
mod report;
pub mod settings;
mod world;

pub use report::Row;

use crate::study::experiment::{Experiment, Finished, Mishap, SettingsFile};
use filters::{COMPETITORS, Score};
use report::Results;
use serde::{Deserialize, Serialize};
use settings::{BUDGETS, CHOICE_SEED, DIMENSIONS, PILOTS, QUICK_RUNS, RUNS, SHARPNESS, TOGETHER};
use std::collections::BTreeMap;
use world::{Exact, Exponentials, Ranges, draw};
use zerre::Result;
use zerre::model::measurement::Position;
use zerre::model::{GaussianMeasurement, Measurement};
use zerre::rng::Stream;

/// The file of settings.
pub const SETTINGS: SettingsFile =
    SettingsFile { path: "crates/zerre-lab/src/paper/swarm/dimensions/settings.rs", text: settings::SOURCE };

/// What is seen of the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum World {
    /// Every component: the posterior is normal.
    Places,
    /// The exponential of every component: the posterior has one mode, and no tangent is near to it.
    Exponentials,
    /// A distance in each plane: the posterior is an arc in each.
    Ranges,
}

impl World {
    /// All of them.
    pub const ALL: [World; 3] = [World::Places, World::Exponentials, World::Ranges];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            World::Places => "places",
            World::Exponentials => "exponentials",
            World::Ranges => "ranges",
        }
    }
}

/// Runs of all filters in one world: places in [`DIMENSIONS`] and [`SHARPNESS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Scene {
    /// What is seen.
    pub world: World,
    /// How many components.
    pub dimension: usize,
    /// How well.
    pub sharpness: usize,
}

/// Some runs of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// Which scene.
    pub scene: Scene,
    /// Number of the first run.
    pub first: usize,
}

/// One filter with one budget in the runs of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bout {
    /// Place in the list of filters.
    pub filter: usize,
    /// Place in [`BUDGETS`].
    pub budget: usize,
    /// Particles that the budget bought.
    pub particles: usize,
    scores: Vec<Score>,
}

/// The comparison under one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimensions {
    runs: usize,
    seed: u64,
}

impl Dimensions {
    /// So many runs of each cell; `None` for those that the settings have, or the fewer of the short version.
    pub fn new(runs: Option<usize>, quick: bool, seed: u64) -> Dimensions {
        Dimensions { runs: runs.unwrap_or(if quick { QUICK_RUNS } else { RUNS }), seed }
    }

    /// Runs of each cell.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// All filters with all budgets in the runs of a cell.
    fn contest<const D: usize, const M: usize, H>(
        &self,
        cell: &Cell,
        sensor: &H,
        exact: impl Fn(&[[f64; M]]) -> Result<Exact>,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<Bout>>>
    where
        H: GaussianMeasurement<D, M> + Measurement<D, Value = [f64; M]> + Clone,
    {
        let record = |seed: u64, run: usize| -> Result<(Stream, Vec<[f64; M]>, Exact)> {
            let scene = [cell.scene.world as u64, cell.scene.dimension as u64, cell.scene.sharpness as u64];
            let place = scene.into_iter().fold(Stream::new(seed).fork(STREAM), Stream::fork);
            let luck = place.fork(run as u64);
            let measured = draw(sensor, luck)?;
            let exact = exact(&measured)?;
            Ok((luck.fork(FILTERS), measured, exact))
        };
        let pilots = (0..PILOTS).map(|run| record(CHOICE_SEED, run)).collect::<Result<Vec<_>>>()?;
        let last = (cell.first + TOGETHER).min(self.runs);
        let runs = (cell.first..last).map(|run| record(self.seed, run)).collect::<Result<Vec<_>>>()?;
        let mut bouts = Vec::new();
        for (budget, &evaluations) in BUDGETS.iter().enumerate() {
            for (filter, competitor) in COMPETITORS.iter().enumerate() {
                // What a particle costs depends on the measurements, and a little on how many there are. Few to begin
                // with: a proposal by a swarm costs the square of their number in time.
                let mut particles = (evaluations / 100).max(20);
                for _ in 0..2 {
                    let mut cost = 0.0;
                    for (stream, measured, exact) in &pilots {
                        let score = competitor.run(sensor, particles, (measured, exact), *stream)?;
                        cost += score.evaluations / (particles * PILOTS) as f64;
                    }
                    particles = ((evaluations as f64 / cost) as usize).max(2);
                }
                let mut scores = Vec::with_capacity(runs.len());
                for (stream, measured, exact) in &runs {
                    if stop() {
                        return Ok(None);
                    }
                    let stream = stream.fork(filter as u64).fork(budget as u64);
                    scores.push(competitor.run(sensor, particles, (measured, exact), stream)?);
                }
                bouts.push(Bout { filter, budget, particles, scores });
            }
        }
        Ok(Some(bouts))
    }

    fn contest_in<const D: usize, const M: usize>(
        &self,
        cell: &Cell,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<Bout>>> {
        let sd = SHARPNESS[cell.scene.sharpness];
        match cell.scene.world {
            World::Places => {
                let sensor = Position::<D>::new(sd)?;
                self.contest::<D, D, _>(cell, &sensor, |measured| Exact::of_places(sd, measured), stop)
            }
            World::Exponentials => {
                let sensor = Exponentials::<D> { sd };
                self.contest::<D, D, _>(cell, &sensor, |measured| Exact::of_exponentials(sd, measured), stop)
            }
            World::Ranges => {
                let sensor = Ranges::<M> { sd };
                self.contest::<D, M, _>(cell, &sensor, |measured| Exact::of_ranges(sd, measured), stop)
            }
        }
    }
}

/// Label of the streams: "dims" in ASCII.
const STREAM: u64 = 0x6469_6d73;
/// Label of the filters' streams in a run.
const FILTERS: u64 = 2;

impl Experiment for Dimensions {
    type Cell = Cell;
    type Outcome = Vec<Bout>;
    type Timing = ();
    type Row = Row;

    const UNIT: &'static str = "thousand likelihood evaluations";

    fn cells(&self) -> Vec<Cell> {
        let mut cells = Vec::new();
        for world in World::ALL {
            for dimension in 0..DIMENSIONS.len() {
                for sharpness in 0..SHARPNESS.len() {
                    let scene = Scene { world, dimension, sharpness };
                    cells.extend((0..self.runs).step_by(TOGETHER).map(|first| Cell { scene, first }));
                }
            }
        }
        cells
    }

    fn key(&self, cell: &Cell) -> String {
        let Scene { world, dimension, sharpness } = cell.scene;
        let (d, sd) = (DIMENSIONS[dimension], SHARPNESS[sharpness]);
        format!("{} {d} {sd} {} of {}", world.name(), cell.first, self.runs)
    }

    fn cost(&self, cell: &Cell) -> u64 {
        let per_run = BUDGETS.iter().sum::<usize>() * COMPETITORS.len();
        let runs = TOGETHER.min(self.runs - cell.first);
        (per_run * settings::STEPS * runs * DIMENSIONS[cell.scene.dimension]) as u64 / 1000
    }

    fn work(&self, cell: &Cell, stop: &dyn Fn() -> bool) -> Result<Option<Vec<Bout>>> {
        match DIMENSIONS[cell.scene.dimension] {
            4 => self.contest_in::<4, 2>(cell, stop),
            10 => self.contest_in::<10, 5>(cell, stop),
            20 => self.contest_in::<20, 10>(cell, stop),
            other => Err(zerre::Error::Unsupported(format!("no world here has {other} components"))),
        }
    }

    fn finish(
        &self,
        outcomes: &BTreeMap<Cell, Vec<Bout>>,
        _: Option<&()>,
    ) -> std::result::Result<Finished<Row>, Box<dyn std::error::Error>> {
        let results = Results::new(outcomes, self.seed);
        let rows = results.rows();
        let degenerate = outcomes.values().flatten().flat_map(|bout| &bout.scores);
        Ok(Finished {
            estimates: rows.iter().flat_map(|row| [row.value, row.low, row.high]).collect(),
            tables: results.tables(),
            files: Vec::new(),
            page: results.page(self.runs, self.seed, outcomes.len() < self.cells().len()),
            mishaps: vec![Mishap::without_likelihood(degenerate.map(|score| score.degenerate).sum())],
            rows,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A short comparison: every filter keeps to its budget, a tenth more at most where it chooses its powers itself,
    /// and the guided filter, which is exact where everything is normal, is nearest to the truth there.
    #[test]
    fn filters_keep_to_their_budgets() {
        let experiment = Dimensions::new(Some(2), true, 7);
        let scene = Scene { world: World::Places, dimension: 0, sharpness: 2 };
        let bouts = experiment.work(&Cell { scene, first: 0 }, &|| false).unwrap().unwrap();
        let error = |bout: &Bout| bout.scores.iter().map(|s| s.posterior_error).sum::<f64>();
        for bout in &bouts {
            let (name, budget) = (COMPETITORS[bout.filter].name, BUDGETS[bout.budget] as f64);
            for score in &bout.scores {
                assert!(score.evaluations < 1.25 * budget, "{name}: {score:?}");
                assert!(score.evaluations > 0.7 * budget, "{name}: {score:?}");
            }
            let guided =
                bouts.iter().find(|b| COMPETITORS[b.filter].name == "ekf-guided" && b.budget == bout.budget);
            // Sigma points propose the same there, with their own luck.
            assert!(name.ends_with("-guided") || error(bout) > error(guided.unwrap()), "{name}");
        }
        assert_eq!(bouts.len(), 2 * COMPETITORS.len());
    }

    #[test]
    fn every_run_is_in_one_cell_and_has_its_own_luck() {
        let runs = TOGETHER + 2;
        let experiment = Dimensions::new(Some(runs), false, 1);
        let cells = experiment.cells();
        assert_eq!(cells.len(), 3 * DIMENSIONS.len() * SHARPNESS.len() * 2);
        let of = |seed| {
            let cell = Cell { scene: cells[0].scene, first: TOGETHER };
            Dimensions::new(Some(runs), false, seed).work(&cell, &|| false).unwrap().unwrap()
        };
        let (one, again, other) = (of(1), of(1), of(2));
        assert_eq!(one, again);
        assert!(one.iter().zip(&other).all(|(a, b)| a.scores.len() == 2 && a.scores != b.scores));
        assert!(
            one.iter().zip(&other).all(|(a, b)| a.particles == b.particles),
            "budgets are of another seed"
        );
    }
}
