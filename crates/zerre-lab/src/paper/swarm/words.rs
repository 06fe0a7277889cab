//! What the numbers say, in words that follow from them.

use super::methods::How;
use super::reading::Reading;
use super::settings::{BUDGETS, JUDGE, MAIN, MISFIT, MOVED, PARTICLES, STEPS, TINY, VARIANCES, WORLDS};
use super::tables::{
    COVERAGE, ESS, Metric, NIS, P5, P95, PULL, Place, RMSE, RMSE_RATIO, Results, SPREAD, STRAIGHT_ERROR,
};
use super::{Scene, Variance, settings::READINGS};
use crate::report::study::{Section, Shown};

/// The paper's own three.
const THREE: [&str; 3] = ["pf", "pso-pf", "abc-pf"];

impl Results<'_> {
    /// When a swarm helps, when it lies, and what shows it; as far as it was computed.
    pub(super) fn plain_words(&self) -> Section {
        let said =
            [self.in_short(), self.reproduced(), self.helps(), self.lies(), self.shows(), self.sound()];
        Section {
            title: "When a swarm helps, when it lies, and what shows it".to_owned(),
            paragraphs: said.into_iter().flatten().collect(),
            ..Section::default()
        }
    }

    /// A metric of a filter in several scenes, as text: "0.12, 0.34 and 0.56"; `None` where one is missing.
    /// Ratios have three decimals, shares are of a hundred.
    fn list(&self, places: &[Option<Place>], metric: Metric) -> Option<String> {
        let text = |value: f64| match metric {
            RMSE_RATIO => format!("{value:.3}"),
            COVERAGE => format!("{:.2} %", 100.0 * value),
            _ => Shown::from(value).text,
        };
        let values: Option<Vec<String>> = places
            .iter()
            .map(|place| self.measured((*place)?, metric).map(|found| text(found.value)))
            .collect();
        values.filter(|values| !values.is_empty()).map(|values| joined(&values))
    }

    /// A filter in several scenes.
    fn across(&self, scenes: &[Scene], name: &str, particles: Option<usize>) -> Vec<Option<Place>> {
        scenes.iter().map(|scene| self.named(*scene, name, particles)).collect()
    }

    /// A metric of the first filters less than that of the second, in every scene.
    fn is_less(&self, first: &[Option<Place>], second: &[Option<Place>], metric: Metric) -> bool {
        let value =
            |place: &Option<Place>| place.and_then(|place| self.measured(place, metric)).map(|e| e.value);
        first.iter().zip(second).all(|(a, b)| value(a) < value(b))
    }

    /// The whole in a few sentences, each only where the numbers bear it out.
    fn in_short(&self) -> Option<String> {
        let mut text =
            "In short: a swarm drags particles to where the likelihood is greatest, and nothing takes that back.".to_owned();
        let less = |reading: &str| -> Option<bool> {
            let scenes = self.misfit(reading)?;
            let of = |name| self.across(&scenes, name, Some(PARTICLES));
            Some(self.is_less(&of("abc-pf"), &of("pf"), RMSE))
        };
        let [right, motion, noise] = [less(MISFIT[0])?, less(MISFIT[1])?, less(MISFIT[2])?];
        if motion && noise {
            text += " It helps a filter that is told a wrong motion, or far too much noise: then the measurement knows better \
                      than the filter.";
        }
        let growth = self.growth()?;
        let of = |name, particles| self.across(&growth, name, particles);
        let (colony, plain) = (of("abc-pf-40", None), of("bootstrap", Some(PARTICLES)));
        if !right && self.is_less(&plain, &colony, RMSE) && self.is_less(&colony, &plain, COVERAGE) {
            text += " It lies to a filter that is told the truth: the error grows with every cycle, the spread goes, and \
                      intervals no longer hold the state.";
        }
        if self.is_less(&of("stretch-move", Some(MOVED[1])), &colony, PULL) {
            text += " Look at coverage, at the pull of the move and at what it leaves of the spread, and at innovations before \
                      any swarm is switched on; the effective sample size of before the move shows nothing.";
        }
        Some(text)
    }

    /// How the printed numbers compare with ours.
    fn reproduced(&self) -> Option<String> {
        let scenes = self.of_table("1");
        if !self.request.tables.contains("1") || scenes.is_empty() {
            return None;
        }
        let (mut inside, mut all, mut nearer) = (0, 0, 0);
        let (mut gaps, mut widths) = (Vec::new(), Vec::new());
        for scene in &scenes {
            let mut errors = Vec::new();
            for name in THREE {
                let place = self.named(*scene, name, Some(PARTICLES))?;
                let printed = self.printed(place)?;
                let (mean, low, high) =
                    (self.measured(place, RMSE)?, self.measured(place, P5)?, self.measured(place, P95)?);
                all += 1;
                inside += usize::from((low.value..=high.value).contains(&printed));
                nearer += usize::from((mean.low..=mean.high).contains(&printed));
                errors.push(printed);
                widths.push(high.value - low.value);
            }
            gaps.push((errors[1] - errors[2]).abs());
        }
        let average = |values: &[f64]| Shown::from(values.iter().sum::<f64>() / values.len() as f64).text;
        let so = if 2 * inside > all {
            "So most of what is printed can be had this way, but a single run says little"
        } else {
            "So most of what is printed is not had this way, and a single run says little"
        };
        Some(format!(
            "The paper's table, reading {MAIN}: of {all} printed errors, each of one run, {inside} lie between the 5 % and the \
             95 % quantile of single runs of ours, and {nearer} in the 95 % interval of our mean. {so}: the two swarms differ \
             by {} in print, on average, and these ranges of single runs are {} wide. What the reading means: the true \
             variance of the measurement is {TINY:e}, and filters are told Q, {} times as much or more.",
            average(&gaps),
            average(&widths),
            Shown::from(f64::from(VARIANCES[0]) / TINY).text
        ))
    }

    fn misfit(&self, reading: &str) -> Option<[Scene; 3]> {
        let reading = Reading::place(reading)?;
        let scene = |q| Scene::Paper { reading, steps: STEPS[0], q, variants: false };
        let scenes = VARIANCES.map(scene);
        (self.request.tables.contains("misfit") && scenes.iter().all(|s| self.scenes.contains_key(s)))
            .then_some(scenes)
    }

    /// Where moves towards the likelihood lessen the error.
    fn helps(&self) -> Option<String> {
        let mut text = String::new();
        let (mut better, mut worse, mut cheaper) = (Vec::new(), Vec::new(), Vec::new());
        for reading in MISFIT {
            let scenes = self.misfit(reading)?;
            let of = |name, particles| self.across(&scenes, name, Some(particles));
            let (swarm, plain) = (of("abc-pf", PARTICLES), of("pf", PARTICLES));
            let equal = of("bootstrap", BUDGETS[0]);
            let long = of("abc-pf-40", PARTICLES);
            text += &format!(
                " Told {} (reading {reading}), the colony of {PARTICLES} bees errs by {} at Q = {}, after 40 cycles by {}, the \
                 same particles without it by {}, and {} plain particles, which cost no more, by {}.",
                told(reading)?,
                self.list(&swarm, RMSE)?,
                joined(&VARIANCES.map(|q| q.to_string())),
                self.list(&long, RMSE)?,
                self.list(&plain, RMSE)?,
                BUDGETS[0],
                self.list(&equal, RMSE)?
            );
            let error =
                |place: Option<Place>| place.and_then(|place| self.measured(place, RMSE)).map(|e| e.value);
            let wins = |others: &[Option<Place>]| {
                swarm.iter().zip(others).filter(|(a, b)| error(**a) < error(**b)).count()
            };
            match wins(&plain) {
                0 => worse.push(told(reading)?.to_owned()),
                won => better.push(format!("{} ({won} of {})", told(reading)?, VARIANCES.len())),
            }
            let won = wins(&equal);
            if won > 0 {
                cheaper.push(format!("{} ({won} of {})", told(reading)?, VARIANCES.len()));
            }
        }
        let listed = |list: &[String]| if list.is_empty() { "nothing".to_owned() } else { joined(list) };
        Some(format!(
            "When it helps.{text} So dragging particles to the maximum of the likelihood lessens the error of so many particles \
             where filters are told {}, and never where they are told {}. It beats plain particles that cost no more where \
             they are told {}. Where models are wrong, right ones are the better remedy.",
            listed(&better),
            listed(&worse),
            listed(&cheaper)
        ))
    }

    fn growth(&self) -> Option<Vec<Scene>> {
        let scenes: Vec<Scene> = (0..WORLDS.len())
            .filter(|at| WORLDS[*at].row == "growth")
            .map(Scene::World)
            .filter(|scene| self.scenes.contains_key(scene))
            .collect();
        (!scenes.is_empty()).then_some(scenes)
    }

    /// What becomes of a posterior that a swarm has moved.
    fn lies(&self) -> Option<String> {
        let scenes = self.growth()?;
        let of = |name, particles| self.across(&scenes, name, particles);
        let (colony, exact) = (of("abc-pf-40", None), of("grid", None));
        let plain = of("bootstrap", Some(PARTICLES));
        let short = of("abc-pf", None);
        Some(format!(
            "When it lies. Told the truth, in the growth worlds (Q = {}), {PARTICLES} bees after 40 cycles have {} times the \
             exact filter's error, after one cycle {}, and {PARTICLES} plain particles without any move {}. Their 90 % \
             intervals hold the state in {} of the steps (the exact ones in {}): what is left of the particles' spread is {}, \
             and the estimate is that of the last measurement alone, whose error sqrt(Q)/|h'| is 2 sqrt(Q) from the 30th \
             second on; theirs is {} times that.{}",
            joined(&scenes.iter().map(|scene| scene.names().2.to_string()).collect::<Vec<_>>()),
            self.list(&colony, RMSE_RATIO)?,
            self.list(&short, RMSE_RATIO)?,
            self.list(&plain, RMSE_RATIO)?,
            self.list(&colony, COVERAGE)?,
            self.list(&exact, COVERAGE)?,
            self.list(&colony, SPREAD)?,
            self.list(&colony, STRAIGHT_ERROR)?,
            if self.is_less(&short, &colony, RMSE_RATIO) {
                " More cycles make it worse, not better."
            } else {
                ""
            }
        ))
    }

    /// What diagnostics say of both.
    fn shows(&self) -> Option<String> {
        let scenes = self.growth()?;
        let of = |name, particles| self.across(&scenes, name, particles);
        let (colony, stretch) = (of("abc-pf-40", None), of("stretch-move", Some(MOVED[1])));
        let mut text = format!(
            "What shows it. Coverage as above; the pull of the move, {} standard deviations of the exact posterior for the \
             colony of 40 cycles and {} for the stretch move of {} particles, which is the chance of so many particles; and \
             what it leaves of the spread, {} against {}. The effective sample size is computed before the move and says \
             nothing: its share is {} in the collapsed filter",
            self.list(&colony, PULL)?,
            self.list(&stretch, PULL)?,
            MOVED[1],
            self.list(&colony, SPREAD)?,
            self.list(&stretch, SPREAD)?,
            self.list(&colony, ESS)?
        );
        let plain = of("bootstrap", Some(PARTICLES));
        text += &format!(", {} in the plain one.", self.list(&plain, ESS)?);
        let nis = MISFIT.iter().filter_map(|reading| {
            let judges = self.across(&self.misfit(reading)?, "bootstrap", Some(JUDGE));
            Some(format!("{} where filters are told {}", self.list(&judges, NIS)?, told(reading)?))
        });
        let nis: Vec<String> = nis.collect();
        if !nis.is_empty() {
            text += &format!(
                " That models are wrong is seen in innovations before any swarm is switched on: their mean normalised square \
                 (NIS, one where all is right) at Q = {} is {}.",
                joined(&VARIANCES.map(|q| q.to_string())),
                nis.join("; ")
            );
        }
        Some(text)
    }

    /// What the sound versions of the same moves come to.
    fn sound(&self) -> Option<String> {
        let scenes = self.growth()?;
        let of = |name, particles| self.across(&scenes, name, particles);
        let (stretch, most) = (of("stretch-move", Some(MOVED[1])), of("bootstrap", Some(BUDGETS[1])));
        let mut text = format!(
            "What is sound. The same step of a bee, accepted by the rule of Metropolis, leaves the posterior as it is: {} \
             particles that take it have {} times the exact filter's error, and their intervals hold the state in {} of the steps. \
             {} plain particles, at as many evaluations, have {} times that error{}.",
            MOVED[1],
            self.list(&stretch, RMSE_RATIO)?,
            self.list(&stretch, COVERAGE)?,
            BUDGETS[1],
            self.list(&most, RMSE_RATIO)?,
            if self.is_less(&most, &stretch, RMSE_RATIO) {
                ": with one component more particles serve better than moves"
            } else {
                ""
            }
        );
        let best: Vec<String> = (0..WORLDS.len()).filter_map(|at| self.best(Scene::World(at))).collect();
        if !best.is_empty() {
            text += &format!(" Least errors of all sampled filters: {}.", best.join("; "));
        }
        Some(text)
    }

    /// The sampled filter with the least error in a world.
    fn best(&self, scene: Scene) -> Option<String> {
        let Scene::World(at) = scene else { return None };
        let error = |place: &Place| self.measured(*place, RMSE_RATIO).map_or(f64::INFINITY, |e| e.value);
        let sampled = self.places(scene).filter(|place| self.runs(*place).0.how != How::Exact);
        let place = sampled.min_by(|a, b| error(a).total_cmp(&error(b)))?;
        let ratio = self.measured(place, RMSE_RATIO)?;
        Some(format!("{} {} ({:.3} times the exact)", WORLDS[at].name, self.label(place), ratio.value))
    }
}

/// What filters are told in a reading, against what is so.
fn told(reading: &str) -> Option<&'static str> {
    let Reading { drawn, told, .. } = READINGS[Reading::place(reading)?];
    Some(match (drawn.0 == told.0, drawn.1 == told.1) {
        (true, true) => "the truth",
        (false, true) => "a wrong motion",
        (true, false) if drawn.1 == Variance::Tiny => "far too much noise",
        (true, false) => "a wrong noise",
        (false, false) => "a wrong motion and a wrong noise",
    })
}

/// "1, 2 and 3".
fn joined(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
