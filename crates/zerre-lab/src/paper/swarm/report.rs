//! The page.

use super::super::sentence;
use super::methods::How;
use super::settings::{CHOICE_SEED, MAIN, PARTICLES, READINGS, WORLDS};
use super::tables::{
    COVERAGE, CRPS, CRPS_RATIO, ESS, MICROSECONDS, Metric, NIS, P5, P95, POSTERIOR_ERROR, PULL, Place, RMSE,
    RMSE_RATIO, Results, SPREAD, STRAIGHT_ERROR, W1, title,
};
use super::{PAPER, Scene};
use crate::report::study::{Figure, Grid, Mark, Section, Shown, StudyReport};
use crate::study::front::front;
use crate::study::world;

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end.
    ///
    /// # Errors
    /// None with the settings as they are.
    pub(super) fn page(&self, seed: u64, interrupted: bool) -> zerre::Result<StudyReport> {
        let facts = [
            ("Runs per cell", self.request.runs.to_string()),
            ("Particles of the paper's filters", PARTICLES.to_string()),
            ("Seed", seed.to_string()),
            ("Seed on which settings are chosen", CHOICE_SEED.to_string()),
            ("Data", "simulated here".to_owned()),
        ];
        let mut sections = vec![self.plain_words(), introduction(interrupted)];
        for table in PAPER.tables.iter().chain(PAPER.on_request) {
            if !self.request.tables.contains(table) {
                continue;
            }
            if *table == "honest" {
                sections.extend(self.of_table(table).into_iter().map(|scene| self.world(scene)));
            } else {
                sections.push(self.errors(table));
            }
        }
        sections.extend(self.pictures(seed)?);
        Ok(StudyReport {
            title: "Swarm and bee-colony particle filters, told honestly".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        })
    }

    /// A table of the paper's model.
    fn errors(&self, table: &str) -> Section {
        let places: Vec<Place> =
            self.of_table(table).into_iter().flat_map(|scene| self.places(scene)).collect();
        let head = [
            "reading",
            "T",
            "Q",
            "filter",
            "evaluations",
            "RMSE",
            "one run, 5 to 95 %",
            "printed",
            "runs below",
            "in the 90 % interval",
            "NIS",
            "ESS",
        ];
        let row = |place: &Place| -> Vec<Shown> {
            let (entrant, runs) = self.runs(*place);
            let (_, reading, q) = place.0.names();
            let range = self.measured(*place, P5).zip(self.measured(*place, P95)).map(|(low, high)| {
                format!("{} to {}", Shown::from(low.value).text, Shown::from(high.value).text)
            });
            let printed = self.printed(*place);
            let below = printed.map(|printed| {
                let below = runs.iter().filter(|run| run.rmse < printed).count();
                format!("{:.0} %", 100.0 * below as f64 / runs.len().max(1) as f64)
            });
            let text = |text: Option<String>| text.map_or(Shown::from("–"), |text| text.as_str().into());
            let of = |metric: Metric| Shown::from(self.measured(*place, metric));
            vec![
                reading.into(),
                place.0.steps().to_string().as_str().into(),
                q.to_string().as_str().into(),
                entrant.name.into(),
                self.evaluations(*place).to_string().as_str().into(),
                of(RMSE),
                text(range),
                printed.into(),
                text(below),
                of(COVERAGE),
                of(NIS),
                of(ESS),
            ]
        };
        let grid = Grid {
            caption: "Means over runs with 95 % bootstrap intervals; the range of single runs, and the share of them whose \
                      error is below the printed one"
                .to_owned(),
            head: head.map(str::to_owned).to_vec(),
            rows: places.iter().map(row).collect(),
        };
        let mut readings: Vec<usize> = places
            .iter()
            .filter_map(|(scene, _)| match scene {
                Scene::Paper { reading, .. } => Some(*reading),
                Scene::World(_) => None,
            })
            .collect();
        readings.dedup();
        let paragraphs = readings
            .into_iter()
            .map(|at| format!("Reading {}: {}.", READINGS[at].name, READINGS[at].about()))
            .collect();
        Section { title: title(table), paragraphs, tables: vec![grid], ..Section::default() }
    }

    /// A world of the honest table.
    fn world(&self, scene: Scene) -> Section {
        let name = match scene {
            Scene::World(at) => WORLDS[at].name,
            Scene::Paper { .. } => MAIN,
        };
        let info = world::WORLDS.iter().find(|world| world.name == name);
        let paragraphs = info.map(|info| format!("{}. Source: {}.", sentence(info.about), info.source));
        let columns = [
            ("RMSE", RMSE),
            ("ratio to exact", RMSE_RATIO),
            ("CRPS", CRPS),
            ("ratio to exact", CRPS_RATIO),
            ("in the 90 % interval", COVERAGE),
            ("posterior error", POSTERIOR_ERROR),
            ("W1", W1),
            ("pull", PULL),
            ("spread", SPREAD),
            ("error late", STRAIGHT_ERROR),
            ("ESS", ESS),
            ("µs a step", MICROSECONDS),
        ];
        let row = |place: Place| -> Vec<Shown> {
            let numbers = columns.iter().map(|(_, metric)| Shown::from(self.measured(place, *metric)));
            let first = [
                Shown::from(self.label(place).as_str()),
                self.evaluations(place).to_string().as_str().into(),
            ];
            first.into_iter().chain(numbers).collect()
        };
        let head = ["filter", "evaluations"].into_iter().chain(columns.iter().map(|(name, _)| *name));
        let grid = Grid {
            caption: format!("{name}: means over runs with 95 % bootstrap intervals"),
            head: head.map(str::to_owned).collect(),
            rows: self.places(scene).map(row).collect(),
        };
        Section {
            title: format!("World: {name}"),
            paragraphs: paragraphs.into_iter().collect(),
            figures: vec![self.price(scene)],
            tables: vec![grid],
            ..Section::default()
        }
    }

    /// A filter with its particles.
    pub(super) fn label(&self, place: Place) -> String {
        let entrant = self.runs(place).0;
        match entrant.particles {
            0 => entrant.name.to_owned(),
            n => format!("{} with {n}", entrant.name),
        }
    }

    /// Error against evaluations; those that no other beats in both have their names beside them.
    fn price(&self, scene: Scene) -> Figure {
        let sampled = self.places(scene).filter(|place| self.runs(*place).0.how != How::Exact);
        let found: Vec<(Place, [f64; 2])> = sampled
            .filter_map(|place| {
                Some((place, [self.evaluations(place) as f64, self.measured(place, RMSE_RATIO)?.value]))
            })
            .collect();
        let points: Vec<[f64; 2]> = found.iter().map(|(_, point)| *point).collect();
        let marks = found.iter().zip(front(&points)).map(|((place, at), labelled)| Mark {
            at: *at,
            name: self.label(*place),
            labelled,
        });
        Figure {
            title: "Error as a multiple of the exact filter's, by cost".to_owned(),
            x: "likelihood evaluations a step".to_owned(),
            y: "ratio".to_owned(),
            logarithmic: true,
            logarithmic_x: true,
            marks: marks.collect(),
            ..Figure::default()
        }
    }
}

fn introduction(interrupted: bool) -> Section {
    let mut paragraphs = vec![
        "Every filter of a scene sees the same measurements; its own random numbers are its own. RMSE is the root mean \
         square error of a run, CRPS the mean score of the law, posterior error the root mean square difference of the \
         estimates from the means of the exact posterior, W1 the mean 1-Wasserstein distance to it. Pull is the root mean \
         square shift of the mean by a move, in standard deviations of the exact posterior; spread is what the move leaves \
         of the particles' standard deviation (the median over runs). The error late is that after the 30th second in units of 2 √Q, what one \
         straight measurement alone would leave. NIS is the mean normalised innovation squared of a filter that predicts \
         by its model, one where the model is right; ESS is the effective share of the weights, before any move. \
         Evaluations are those of the likelihood in a step as counted, times processor times of a step, each filter in \
         its own turn in one thread."
            .to_owned(),
        format!(
            "The paper says neither what its gamma noise is parametrised by, nor which variance its Q is, nor how often the \
             swarm is run, nor what weights moved particles have, nor where particles start, and prints single runs. \
             Reading {MAIN} with one iteration was chosen after the fact, among hundreds of combinations, because it is the \
             nearest to the printed numbers: they are compatible with it, and prove nothing of it. Here particles start \
             from N(1, 0.75) about the true 1, are resampled in every step and weighed once more where the swarm has left \
             them, swarms keep to the paper's bounds, and there are no scouts."
        ),
    ];
    if interrupted {
        paragraphs.push(
            "This run was stopped before its end: cells that are missing were not computed.".to_owned(),
        );
    }
    Section { title: "How to read this".to_owned(), paragraphs, ..Section::default() }
}
