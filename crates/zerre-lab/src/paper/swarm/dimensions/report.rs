//! Numbers and page.

use super::filters::COMPETITORS;
use super::settings::{BUDGETS, CHOICE_SEED, DIMENSIONS, LEVEL, SHARPNESS, STEPS};
use super::{Bout, Cell, Scene, World};
use crate::report::study::{Figure, Grid, Section, Series, Shown, StudyReport};
use crate::study::interval::{Bootstraps, Estimate, holm, mean, mean_interval, paired};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use std::collections::BTreeMap;

/// One number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What is seen: `places` or `ranges`.
    pub world: &'static str,
    /// Measurements of a run.
    pub steps: usize,
    /// Components of the state.
    pub dimension: usize,
    /// Standard deviation of the measurement, in those of the state.
    pub sharpness: f64,
    /// Likelihood evaluations a step that were to be spent.
    pub budget: usize,
    /// The filter.
    pub algorithm: &'static str,
    /// Whether a swarm moves it.
    pub swarm: bool,
    /// Particles.
    pub particles: usize,
    /// Likelihood evaluations a step, counted.
    pub evaluations: f64,
    /// What was measured.
    pub metric: &'static str,
    /// How it was summed up over runs.
    pub statistic: &'static str,
    /// The number.
    pub value: f64,
    /// Ends of its 95 % interval.
    pub low: f64,
    /// ...
    pub high: f64,
    /// Number of runs.
    pub runs: usize,
}

/// A filter with a budget in a scene, all its runs.
type Fight = (Scene, usize, usize);

/// What a swarm move does in a scene with a budget.
struct Trial {
    scene: Scene,
    budget: usize,
    swarm: usize,
    /// The rival that is best on average.
    rival: usize,
    /// Error of the swarm move as a multiple of that rival's, geometric mean over runs.
    ratio: Estimate,
    /// The rival that is least told from it, and in how many of all runs the swarm move is nearer than that one.
    doubt: usize,
    nearer: (usize, usize),
    /// Probability of so much or more if some rival were as good, corrected for the number of trials.
    pays: f64,
    /// Probability of so much less or more if it were as good as the best rival, likewise.
    costs: f64,
}

/// All that was measured.
pub struct Results {
    fights: BTreeMap<Fight, Bout>,
    bootstraps: Bootstraps,
    trials: Vec<Trial>,
}

impl Results {
    /// Of the cells that are done.
    pub fn new(outcomes: &BTreeMap<Cell, Vec<Bout>>, seed: u64) -> Results {
        let mut fights: BTreeMap<Fight, Bout> = BTreeMap::new();
        for (cell, bouts) in outcomes {
            for bout in bouts {
                fights
                    .entry((cell.scene, bout.budget, bout.filter))
                    .and_modify(|all| all.scores.extend(&bout.scores))
                    .or_insert_with(|| bout.clone());
            }
        }
        let bootstraps = Bootstraps::new(fights.values().map(|bout| bout.scores.len()), seed);
        let mut results = Results { fights, bootstraps, trials: Vec::new() };
        results.trials = results.judge();
        results
    }

    fn errors(&self, fight: &Fight) -> Vec<f64> {
        self.fights
            .get(fight)
            .map_or(Vec::new(), |bout| bout.scores.iter().map(|s| s.posterior_error).collect())
    }

    /// ln of the error of one filter over that of another, run by run.
    fn log_ratios(&self, a: &Fight, b: &Fight) -> Vec<f64> {
        self.errors(a).iter().zip(self.errors(b)).map(|(a, b)| (a / b).ln()).collect()
    }

    fn judge(&self) -> Vec<Trial> {
        let mut trials = Vec::new();
        for &(scene, budget, swarm) in
            self.fights.keys().filter(|(_, _, filter)| COMPETITORS[*filter].is_swarm)
        {
            let rivals: Vec<usize> = (0..COMPETITORS.len())
                .filter(|at| !COMPETITORS[*at].is_swarm && self.fights.contains_key(&(scene, budget, *at)))
                .collect();
            let average = |at: &usize| mean_of(&self.errors(&(scene, budget, *at)));
            let Some(&rival) = rivals.iter().min_by(|a, b| average(a).total_cmp(&average(b))) else {
                continue;
            };
            let own = (scene, budget, swarm);
            let against = |at: usize| self.log_ratios(&own, &(scene, budget, at));
            let greater = |differences: &[f64]| paired(differences).map_or(1.0, |test| test.p_greater);
            let negated = |differences: Vec<f64>| differences.into_iter().map(|d| -d).collect::<Vec<_>>();
            // It pays where it beats every one of them: the weakest of the tests decides.
            let (doubt, pays) = rivals
                .iter()
                .map(|at| (*at, greater(&negated(against(*at)))))
                .fold((rival, 0.0), |weakest, next| if next.1 > weakest.1 { next } else { weakest });
            let doubted = against(doubt);
            let nearer = (doubted.iter().filter(|log| **log < 0.0).count(), doubted.len());
            let costs = greater(&against(rival));
            let Some(log) = mean_interval(&against(rival)) else { continue };
            let ratio = Estimate { value: log.value.exp(), low: log.low.exp(), high: log.high.exp() };
            trials.push(Trial { scene, budget, swarm, rival, ratio, doubt, nearer, pays, costs });
        }
        let pays = holm(&trials.iter().map(|trial| trial.pays).collect::<Vec<_>>());
        let costs = holm(&trials.iter().map(|trial| trial.costs).collect::<Vec<_>>());
        for ((trial, pays), costs) in trials.iter_mut().zip(pays).zip(costs) {
            (trial.pays, trial.costs) = (pays, costs);
        }
        trials
    }

    /// Every number.
    pub fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for ((scene, budget, filter), bout) in &self.fights {
            let runs = bout.scores.len();
            let column = |of: fn(&super::Score) -> f64| bout.scores.iter().map(of).collect::<Vec<f64>>();
            for (metric, values) in [
                ("posterior_error", column(|s| s.posterior_error)),
                ("evidence_error", column(|s| s.evidence_error)),
            ] {
                let estimate = self.bootstraps.estimate(runs, |picked| mean(&values, picked));
                let Some(Estimate { value, low, high }) = estimate else { continue };
                rows.push(Row {
                    world: scene.world.name(),
                    steps: STEPS,
                    dimension: DIMENSIONS[scene.dimension],
                    sharpness: SHARPNESS[scene.sharpness],
                    budget: BUDGETS[*budget],
                    algorithm: COMPETITORS[*filter].name,
                    swarm: COMPETITORS[*filter].is_swarm,
                    particles: bout.particles,
                    evaluations: mean_of(&column(|s| s.evaluations)),
                    metric,
                    statistic: "mean",
                    value,
                    low,
                    high,
                    runs,
                });
            }
        }
        rows
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let head = [
            "world",
            "dimension",
            "sharpness",
            "budget",
            "algorithm",
            "swarm",
            "particles",
            "evaluations",
            "metric",
            "statistic",
            "value",
            "low",
            "high",
            "runs",
        ];
        let row = |row: Row| -> Vec<Entry> {
            vec![
                row.world.into(),
                row.dimension.into(),
                row.sharpness.into(),
                row.budget.into(),
                row.algorithm.into(),
                if row.swarm { "yes" } else { "no" }.into(),
                row.particles.into(),
                row.evaluations.into(),
                row.metric.into(),
                row.statistic.into(),
                row.value.into(),
                row.low.into(),
                row.high.into(),
                row.runs.into(),
            ]
        };
        let rows = Table::new(
            "rows",
            "Every number of every filter",
            &head,
            self.rows().into_iter().map(row).collect(),
        );
        let head = [
            "world",
            "dimension",
            "sharpness",
            "budget",
            "swarm",
            "best_rival",
            "error_ratio",
            "low",
            "high",
            "p_pays",
            "p_costs",
        ];
        let trial = |trial: &Trial| -> Vec<Entry> {
            vec![
                trial.scene.world.name().into(),
                DIMENSIONS[trial.scene.dimension].into(),
                SHARPNESS[trial.scene.sharpness].into(),
                BUDGETS[trial.budget].into(),
                COMPETITORS[trial.swarm].name.into(),
                COMPETITORS[trial.rival].name.into(),
                trial.ratio.value.into(),
                trial.ratio.low.into(),
                trial.ratio.high.into(),
                trial.pays.into(),
                trial.costs.into(),
            ]
        };
        let about = "Error of each swarm move as a multiple of the best rival's";
        let trials = Table::new("dimensions", about, &head, self.trials.iter().map(trial).collect());
        vec![rows, trials]
    }

    /// The answer, in words that follow from the numbers.
    fn answer(&self) -> Section {
        let places: std::collections::BTreeSet<(Scene, usize)> =
            self.trials.iter().map(|trial| (trial.scene, trial.budget)).collect();
        let won: Vec<&Trial> = self.trials.iter().filter(|trial| trial.pays <= LEVEL).collect();
        let lost = self.trials.iter().filter(|trial| trial.costs <= LEVEL).count();
        let percent = LEVEL * 100.0;
        let mut paragraphs = vec![format!(
            "In {} places of dimension, sharpness and budget every sound swarm move was held against every other filter, \
             {} trials in all. A move pays where its error is less than that of each rival, by paired tests over the runs \
             at {percent} % after Holm's correction for all trials.",
            places.len(),
            self.trials.len(),
        )];
        paragraphs.push(if won.is_empty() {
            format!(
                "There is no place where a swarm move pays. In {lost} of the trials it is worse than the best rival beyond \
                 doubt; in the others the difference is within the noise."
            )
        } else {
            format!(
                "A swarm move pays in {} of the trials, named below; in {lost} it is worse than the best rival beyond doubt.",
                won.len()
            )
        });
        if let Some(best) = self.trials.iter().min_by(|a, b| a.ratio.value.total_cmp(&b.ratio.value)) {
            paragraphs.push(format!(
                "The place where one comes out best: {}, the rival that is best on average. The rival that is least told \
                 from it is {}: the swarm move is nearer to the truth in {} of {} runs.",
                told(best),
                COMPETITORS[best.doubt].name,
                best.nearer.0,
                best.nearer.1,
            ));
        }
        let points = won.into_iter().map(told).collect();
        let title = "Where swarm moves pay".to_owned();
        Section {
            title,
            paragraphs,
            points,
            figures: self.figures(),
            tables: vec![self.verdicts()],
            ..Section::default()
        }
    }

    /// The best swarm move of each place beside the best rival.
    fn verdicts(&self) -> Grid {
        let mut best: BTreeMap<(Scene, usize), &Trial> = BTreeMap::new();
        for trial in &self.trials {
            let entry = best.entry((trial.scene, trial.budget)).or_insert(trial);
            if trial.ratio.value < entry.ratio.value {
                *entry = trial;
            }
        }
        let row = |(&(scene, budget), trial): (&(Scene, usize), &&Trial)| -> Vec<Shown> {
            let verdict = match (trial.pays <= LEVEL, trial.costs <= LEVEL) {
                (true, _) => "pays",
                (_, true) => "costs",
                _ => "undecided",
            };
            vec![
                scene.world.name().into(),
                (DIMENSIONS[scene.dimension] as f64).into(),
                SHARPNESS[scene.sharpness].into(),
                (BUDGETS[budget] as f64).into(),
                COMPETITORS[trial.swarm].name.into(),
                COMPETITORS[trial.rival].name.into(),
                Some(trial.ratio).into(),
                verdict.into(),
            ]
        };
        Grid {
            caption: "The best swarm move of each place: its error as a multiple of the best rival's, with its 95 % interval"
                .to_owned(),
            head: ["World", "Components", "Sharpness", "Evaluations", "Swarm move", "Best rival", "Error ratio", "It"]
                .map(str::to_owned)
                .to_vec(),
            rows: best.iter().map(row).collect(),
        }
    }

    fn figures(&self) -> Vec<Figure> {
        let mut figures = Vec::new();
        for world in World::ALL {
            for (budget, evaluations) in BUDGETS.iter().enumerate() {
                let mut series = Vec::new();
                for (dimension, components) in DIMENSIONS.iter().enumerate() {
                    let mut points = Vec::new();
                    for (sharpness, sd) in SHARPNESS.iter().enumerate() {
                        let scene = Scene { world, dimension, sharpness };
                        let here = self.trials.iter().filter(|t| (t.scene, t.budget) == (scene, budget));
                        let least = here.map(|t| t.ratio.value).fold(f64::INFINITY, f64::min);
                        if least.is_finite() {
                            points.push([*sd, least]);
                        }
                    }
                    series.push(Series {
                        name: format!("{components} components"),
                        points,
                        ..Series::default()
                    });
                }
                let ends = SHARPNESS.iter().map(|sd| [*sd, 1.0]).collect();
                series.push(Series {
                    name: "no difference".to_owned(),
                    points: ends,
                    reference: true,
                    ..Series::default()
                });
                figures.push(Figure {
                    title: format!(
                        "{}, {evaluations} evaluations: best swarm move over best rival",
                        world.name()
                    ),
                    x: "standard deviation of the measurement, in those of the state".to_owned(),
                    y: "ratio of errors".to_owned(),
                    logarithmic: true,
                    logarithmic_x: true,
                    series,
                    ..Figure::default()
                });
            }
        }
        figures
    }

    /// Errors of all filters in a world.
    fn world(&self, world: World) -> Section {
        let mut head = ["Components", "Sharpness", "Evaluations"].map(str::to_owned).to_vec();
        head.extend(COMPETITORS.iter().map(|filter| filter.name.to_owned()));
        let places: std::collections::BTreeSet<(Scene, usize)> =
            self.fights.keys().filter(|(scene, ..)| scene.world == world).map(|(s, b, _)| (*s, *b)).collect();
        let row = |&(scene, budget): &(Scene, usize)| -> Vec<Shown> {
            let mut row: Vec<Shown> = vec![
                (DIMENSIONS[scene.dimension] as f64).into(),
                SHARPNESS[scene.sharpness].into(),
                (BUDGETS[budget] as f64).into(),
            ];
            row.extend((0..COMPETITORS.len()).map(|filter| -> Shown {
                let errors = self.errors(&(scene, budget, filter));
                self.bootstraps.estimate(errors.len(), |picked| mean(&errors, picked)).into()
            }));
            row
        };
        let about = match world {
            World::Places => {
                "Every component is measured. The posterior is normal, and the guided filter proposes from it as far as one \
                 step can."
            }
            World::Exponentials => {
                "The exponential of every component is measured. The posterior has one mode; a tangent says little of where."
            }
            World::Ranges => {
                "In each plane the distance from a beacon near by is measured. The posterior is an arc in each, and a tangent \
                 says little of it."
            }
        };
        Section {
            title: format!("World: {}", world.name()),
            paragraphs: vec![about.to_owned()],
            tables: vec![Grid {
                caption: "Error of the posterior mean, in standard deviations of the exact posterior"
                    .to_owned(),
                head,
                rows: places.iter().map(row).collect(),
            }],
            ..Section::default()
        }
    }

    /// The whole page, for a run that was `interrupted` or came to its end.
    pub fn page(&self, runs: usize, seed: u64, interrupted: bool) -> StudyReport {
        let facts = [
            ("Runs per cell", runs.to_string()),
            ("Measurements of a run", STEPS.to_string()),
            ("Seed", seed.to_string()),
            ("Seed of the runs that say how many particles a budget buys", CHOICE_SEED.to_string()),
            ("Data", "simulated here".to_owned()),
        ];
        let mut paragraphs = vec![
            "A swarm move might earn its keep where a state has many components and a likelihood is narrow: there the \
             prediction hardly meets it, and particles that learn from each other may find it. The state here returns to \
             zero in each component on its own. It is seen as one, though its posterior falls apart into lines or planes \
             and is therefore known."
                .to_owned(),
            "All filters spend the same number of likelihood evaluations a step. Components, sharpness, budgets and filters \
             were fixed before the reported run."
                .to_owned(),
        ];
        if interrupted {
            paragraphs.push("The run was interrupted: what is missing is not here.".to_owned());
        }
        let points = COMPETITORS.iter().map(|filter| format!("{}: {}", filter.name, filter.about)).collect();
        let start =
            Section { title: "What is compared".to_owned(), paragraphs, points, ..Section::default() };
        let mut sections = vec![self.answer(), start];
        sections.extend(World::ALL.map(|world| self.world(world)));
        StudyReport {
            title: "Where swarms might earn their keep".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }
}

fn told(trial: &Trial) -> String {
    let Estimate { value, low, high } = trial.ratio;
    format!(
        "{} in {} of {} components, sharpness {}, {} evaluations: {value:.2} ({low:.2} to {high:.2}) times the error of {}",
        COMPETITORS[trial.swarm].name,
        trial.scene.world.name(),
        DIMENSIONS[trial.scene.dimension],
        SHARPNESS[trial.scene.sharpness],
        BUDGETS[trial.budget],
        COMPETITORS[trial.rival].name,
    )
}

fn mean_of(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
