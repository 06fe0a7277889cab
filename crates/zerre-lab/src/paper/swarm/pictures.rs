//! What runs look like: the state and what filters make of it, their intervals, the pull of their moves.

use super::methods::Entrant;
use super::settings::{MAIN, PICTURED, PICTURED_VARIANCE, READINGS, STEPS, WORLDS};
use super::tables::Results;
use super::watch::{Beside, Exact, Step, Task};
use super::{Scene, chance, luck, reading::Reading};
use crate::report::study::{Figure, Section, Series};
use crate::study::world::{Problem, Record, VisitScalar, with_growth};
use zerre::model::{GaussianMeasurement, Measurement, Motion};

/// Filters that are pictured in the paper's model.
const OF_THE_PAPER: [(&str, usize); 3] = [("pf", 10), ("pso-pf", 10), ("abc-pf", 10)];
/// Filters that are pictured beside the exact posterior, by name and particles: swarms, then sound moves.
const OF_WORLDS: [(&str, usize); 4] =
    [("pso-pf-40-personal-best", 10), ("abc-pf-40", 10), ("resample-move", 100), ("stretch-move", 100)];
/// The world that they are pictured in.
const PICTURED_WORLD: usize = 0;

/// One run of some filters.
struct Portrait {
    scene: Scene,
    /// Times, s, and true states.
    truth: Vec<[f64; 2]>,
    exact: Vec<Exact>,
    ways: Vec<(Entrant, Vec<Step>)>,
}

/// Draws a [`Portrait`].
struct Sitting {
    scene: Scene,
    named: &'static [(&'static str, usize)],
    seed: u64,
}

impl VisitScalar for Sitting {
    type Out = Portrait;

    fn visit<A, H>(self, problem: &Problem<A, H, 1>) -> zerre::Result<Portrait>
    where
        A: Motion<1, 1> + Clone,
        H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone,
    {
        self.of(problem, problem)
    }
}

impl Sitting {
    fn of<A, H>(&self, drawn: &Problem<A, H, 1>, told: &Problem<A, H, 1>) -> zerre::Result<Portrait>
    where
        A: Motion<1, 1> + Clone,
        H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone,
    {
        let Sitting { scene, named, seed } = *self;
        let luck = luck(scene, seed, PICTURED)?;
        let record: Record<1, 1> = drawn.record(luck)?;
        // Nothing here is random but the filters.
        let nodes = scene.nodes().unwrap_or(WORLDS[PICTURED_WORLD].nodes);
        let (mut exact, _) = Task { told, record: &record, stream: luck }.exact(nodes)?;
        let mut ways = Vec::new();
        let is_named = |entrant: &Entrant| named.contains(&(entrant.name, entrant.particles));
        for entrant in scene.entrants().into_iter().filter(is_named) {
            let task = Task { told, record: &record, stream: chance(luck, &entrant) };
            let beside = Beside { exact: Some(&mut exact), bands: true, ..Beside::default() };
            ways.push((entrant, task.follow(&entrant, beside)?.steps));
        }
        let truth = record.times.iter().zip(&record.truth).map(|(at, [x])| [at.secs(), *x]).collect();
        Ok(Portrait { scene, truth, exact, ways })
    }
}

impl Portrait {
    fn line(&self, name: &str, values: impl Iterator<Item = f64>) -> Series {
        let points = self.truth.iter().zip(values).map(|([t, _], v)| [*t, v]).collect();
        Series { name: name.to_owned(), points, ..Series::default() }
    }

    fn state(&self) -> Series {
        Series { points: self.truth.clone(), reference: true, name: "state".to_owned(), ..Series::default() }
    }

    fn title(&self, what: &str) -> String {
        match self.scene {
            Scene::Paper { steps, q, .. } => format!("{what}, T = {steps}, Q = {q}"),
            Scene::World(at) => format!("{what}, {}", WORLDS[at].name),
        }
    }

    fn figure(&self, what: &str, y: &str, series: Vec<Series>) -> Figure {
        Figure {
            title: self.title(what),
            x: "time (s)".to_owned(),
            y: y.to_owned(),
            series,
            ..Figure::default()
        }
    }

    /// As the paper's figures: the state and what filters say of it.
    fn estimates(&self) -> Figure {
        let ways = self.ways.iter().map(|(e, steps)| self.line(e.name, steps.iter().map(|s| s.estimate)));
        self.figure("State and estimates", "x", std::iter::once(self.state()).chain(ways).collect())
    }

    /// The exact interval and that of one filter.
    fn bands(&self) -> impl Iterator<Item = Figure> {
        self.ways.iter().map(|(entrant, steps)| {
            let exact = Series {
                band: self.exact.iter().map(|exact| exact.band).collect(),
                ..self.line("exact posterior", self.exact.iter().map(|exact| exact.mean))
            };
            let nothing = [f64::NAN; 2];
            let own = Series {
                band: steps.iter().map(|step| step.band.unwrap_or(nothing)).collect(),
                ..self.line(entrant.name, steps.iter().map(|step| step.estimate))
            };
            self.figure(&format!("90 % intervals: {}", entrant.name), "x", vec![exact, own, self.state()])
        })
    }

    fn pulls(&self) -> [Figure; 2] {
        let lines = |of: &dyn Fn(&Step) -> Option<f64>| -> Vec<Series> {
            let line = |(e, steps): &(Entrant, Vec<Step>)| {
                self.line(e.name, steps.iter().map(|step| of(step).unwrap_or(f64::NAN)))
            };
            let moves = |(_, steps): &&(Entrant, Vec<Step>)| steps.iter().any(|step| step.pull.is_some());
            self.ways.iter().filter(moves).map(line).collect()
        };
        // Copies of one particle have no spread but what rounding leaves of it.
        let rounding = |step: &Step| 1e-9 * (1.0 + step.estimate.abs());
        let ratio = |step: &Step| step.spread.filter(|[a, _]| *a > rounding(step)).map(|[a, b]| b / a);
        [
            self.figure(
                "Shift of the mean by the move",
                "standard deviations of the exact posterior",
                lines(&|step| step.pull),
            ),
            self.figure("Spread after the move over that before", "ratio", lines(&ratio)),
        ]
    }
}

impl Results<'_> {
    /// The pictures of the tables that are asked for.
    ///
    /// # Errors
    /// None with the settings as they are.
    pub(super) fn pictures(&self, seed: u64) -> zerre::Result<Vec<Section>> {
        let mut sections = Vec::new();
        if let (true, Some(reading)) = (self.request.tables.contains("1"), Reading::place(MAIN)) {
            let mut figures = Vec::new();
            for steps in STEPS {
                let scene = Scene::Paper { reading, steps, q: PICTURED_VARIANCE, variants: false };
                let [drawn, told] = READINGS[reading].problems(f64::from(PICTURED_VARIANCE), steps)?;
                let portrait = Sitting { scene, named: &OF_THE_PAPER, seed }.of(&drawn, &told)?;
                figures.push(portrait.estimates());
                figures.extend(portrait.bands());
                figures.extend(portrait.pulls());
            }
            let paragraph = format!(
                "Run {PICTURED} of seed {seed} in reading {MAIN}. The exact posterior is that of the models as filters are \
                 told them: wide where they are told too much noise, though the measurement alone would give the state to \
                 a few thousandths."
            );
            sections.push(Section {
                title: "As the paper's figures 2 to 6, with intervals and pulls".to_owned(),
                paragraphs: vec![paragraph],
                figures,
                ..Section::default()
            });
        }
        if self.request.tables.contains("honest") {
            let scene = Scene::World(PICTURED_WORLD);
            let sitting = Sitting { scene, named: &OF_WORLDS, seed };
            let portrait = with_growth(&Scene::place(PICTURED_WORLD)?, sitting)?;
            let paragraph = format!(
                "Run {PICTURED} of seed {seed} where filters are told the truth. A sound move shifts the mean by chance alone, \
                 the less the more particles there are, and keeps the spread; a swarm shifts it to the maximum of the \
                 likelihood and gathers the particles there."
            );
            sections.push(Section {
                title: "What moves do to the posterior".to_owned(),
                paragraphs: vec![paragraph],
                figures: portrait.pulls().into_iter().chain(portrait.bands()).collect(),
                ..Section::default()
            });
        }
        Ok(sections)
    }
}
