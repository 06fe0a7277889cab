//! The page.

use super::super::sentence;
use super::settings::{AS_GOOD, AS_HONEST, BROKEN, CHOICE_SEED, LOST_NATS, LOST_SDS, TRUTHS, WORLDS};
use super::tables::{CLAIMS, Measured, Results};
use super::{Cell, place_of};
use crate::report::study::{Figure, Grid, Mark, Section, Shown, StudyReport};
use crate::study::contender::CONTENDERS;
use crate::study::front::front;
use crate::study::interval::Estimate;
use crate::study::world;

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end.
    pub fn page(&self, seed: u64, interrupted: bool) -> StudyReport {
        let facts = [
            ("Runs per cell", self.request.runs.to_string()),
            ("Likelihood evaluations a step", join(self.request.budgets.iter().map(usize::to_string))),
            ("Seed", seed.to_string()),
            ("Seed on which settings are chosen", CHOICE_SEED.to_string()),
            ("Data", "simulated here".to_owned()),
        ];
        let mut sections = vec![introduction(interrupted), self.advice()];
        sections.extend(self.request.worlds.iter().map(|world| self.world(*world)));
        sections.push(self.thesis());
        StudyReport {
            title: "The Bayesian family, measured".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }

    /// The cells of a world that have runs, the truth left out unless it is spent no more than the budgets.
    fn entrants(&self, world: usize) -> Vec<(Cell, Measured)> {
        let cells = self.cells.keys().filter(|cell| cell.world == world && self.is_affordable(cell));
        cells.map(|cell| (*cell, self.measured(cell))).filter(|(_, found)| found.rmse.is_some()).collect()
    }

    /// Whether a filter is as good as the truth of its world, by the settings.
    fn is_as_good(&self, cell: &Cell, found: &Measured) -> bool {
        let truth = Cell::truth(cell.world).map(|truth| self.measured(&truth)).unwrap_or_default();
        let within = |ratio: Option<Estimate>| ratio.is_some_and(|e| e.value <= AS_GOOD);
        let honest = found
            .coverage
            .zip(truth.coverage)
            .is_some_and(|(ours, exact)| (ours.value - exact.value).abs() <= AS_HONEST);
        within(found.rmse_ratio) && within(found.crps_ratio) && honest && !is_broken(found)
    }

    /// Which filter to take when, in words that follow from the numbers.
    fn advice(&self) -> Section {
        let mut points: Vec<String> = self.request.worlds.iter().map(|at| self.advice_on(*at)).collect();
        points.extend(self.verdicts());
        let paragraphs = vec![format!(
            "A filter counts as being as good as the best possible answer where its error and its score are at most {} % above \
             those of that answer, and its 90 % intervals hold the truth as often, to {} percentage points. It is not to be \
             taken where {} % of the runs or more fail.",
            percent(AS_GOOD - 1.0),
            percent(AS_HONEST),
            percent(BROKEN)
        )];
        Section { title: "Which filter to take".to_owned(), paragraphs, points, ..Section::default() }
    }

    fn advice_on(&self, at: usize) -> String {
        let entrants = self.entrants(at);
        let about =
            world::WORLDS.iter().find(|world| world.name == WORLDS[at]).map_or("", |world| world.about);
        let time = |found: &Measured| found.microseconds.map_or(f64::INFINITY, |e| e.value);
        let ratio = |found: &Measured| found.rmse_ratio.map_or(f64::INFINITY, |e| e.value);
        let mut good: Vec<&(Cell, Measured)> =
            entrants.iter().filter(|(cell, found)| self.is_as_good(cell, found)).collect();
        good.sort_by(|a, b| time(&a.1).total_cmp(&time(&b.1)).then(a.0.cmp(&b.0)));
        let mut text = format!("{} ({about}): ", WORLDS[at]);
        if let Some((cell, found)) = good.first() {
            text +=
                &format!("take {}, {}, as good as the best possible answer", self.named(cell), priced(found));
            let others: Vec<String> = good[1..].iter().map(|(cell, _)| self.named(cell)).collect();
            if !others.is_empty() {
                text += &format!("; so {} {}", if others.len() == 1 { "is" } else { "are" }, join(others));
            }
            text.push('.');
        } else if let Some((cell, found)) =
            entrants.iter().min_by(|a, b| ratio(&a.1).total_cmp(&ratio(&b.1)).then(a.0.cmp(&b.0)))
        {
            text += &format!(
                "none here is as good as the best possible answer; the least error has {}, {}, {} times that answer's.",
                self.named(cell),
                priced(found),
                Shown::from(ratio(found)).text
            );
        } else {
            text += "nothing is measured yet.";
        }
        let broken: Vec<String> = entrants
            .iter()
            .filter(|(_, found)| is_broken(found))
            .map(|(cell, found)| {
                format!(
                    "{} ({} % of the runs)",
                    self.named(cell),
                    percent(found.failures.map_or(0.0, |e| e.value))
                )
            })
            .collect();
        if !broken.is_empty() {
            text += &format!(" Not to be taken: {}.", join(broken));
        }
        text
    }

    /// What each filter is good for, over all worlds, at its largest budget.
    fn verdicts(&self) -> Vec<String> {
        let verdict = |(filter, info): (usize, &crate::study::contender::ContenderInfo)| {
            let (mut good, mut broken, mut never, mut seen) = (Vec::new(), Vec::new(), Vec::new(), 0);
            for &at in &self.request.worlds {
                let Some(cell) = self.largest(filter, at) else { continue };
                let found = self.measured(&cell);
                if self.refusal(&cell).is_some() {
                    never.push(WORLDS[at]);
                } else if found.rmse.is_some() {
                    seen += 1;
                    if self.is_as_good(&cell, &found) {
                        good.push(WORLDS[at]);
                    } else if is_broken(&found) {
                        broken.push(WORLDS[at]);
                    }
                }
            }
            let listed =
                |list: &[&str]| if list.is_empty() { "nowhere".to_owned() } else { join(list.iter()) };
            let mut text = format!(
                "{}: as good as the best possible answer in {} of {seen} worlds ({})",
                info.name,
                good.len(),
                listed(&good)
            );
            if !broken.is_empty() {
                text += &format!("; fails in {}", join(broken.iter()));
            }
            if !never.is_empty() {
                text += &format!("; does not apply in {}", join(never.iter()));
            }
            text + "."
        };
        CONTENDERS.iter().enumerate().map(verdict).collect()
    }

    fn named(&self, cell: &Cell) -> String {
        let name = cell.info().name;
        if cell.particles == 0 { name.to_owned() } else { format!("{name} with {}", cell.particles) }
    }

    fn world(&self, at: usize) -> Section {
        let info = world::WORLDS.iter().find(|world| world.name == WORLDS[at]);
        let truth = Cell::truth(at);
        let mut paragraphs: Vec<String> = info
            .map(|info| format!("{}. Source: {}.", sentence(info.about), info.source))
            .into_iter()
            .collect();
        if let Some((_, filter, particles)) = TRUTHS.iter().find(|(name, ..)| *name == WORLDS[at]) {
            paragraphs.push(match *particles {
                0 => format!("Measured against {filter}, which is exact here."),
                n => format!(
                    "Measured against {filter} with {n}, as near to the exact answer as can be had here."
                ),
            });
        }
        if let Some(cell) = Cell::check(at) {
            let found = self.measured(&cell);
            if let Some((ratio, nats)) = found.rmse_ratio.zip(found.evidence_error) {
                paragraphs.push(format!(
                    "{}, beyond the budgets too, tells how well that answer is known: its error is {:.3} times that answer's \
                     ({:.3} to {:.3}), its log-evidence {:.2} nats off on average.",
                    sentence(&self.named(&cell)),
                    ratio.value,
                    ratio.low,
                    ratio.high,
                    nats.value
                ));
            }
        }
        let head = [
            "filter",
            "evaluations",
            "RMSE",
            "ratio to the truth",
            "CRPS",
            "ratio to the truth",
            "in the 90 % interval",
            "error of log-evidence",
            "failed runs",
            "µs a step",
        ];
        let rows = self.cells.keys().filter(|cell| cell.world == at).map(|cell| {
            let found = self.measured(cell);
            let mut name = Shown::from(self.named(cell).as_str());
            if truth == Some(*cell) {
                name.aside = "the truth".to_owned();
            }
            if let Some(reason) = self.refusal(cell) {
                name.aside = "does not apply".to_owned();
                name.doubt = Some(reason.to_owned());
            }
            let mut row = vec![name, self.evaluations(cell).to_string().as_str().into()];
            row.extend(
                [
                    found.rmse,
                    found.rmse_ratio,
                    found.crps,
                    found.crps_ratio,
                    found.coverage,
                    found.evidence_error,
                    found.failures,
                    found.microseconds,
                ]
                .map(Shown::from),
            );
            row
        });
        let grid = Grid {
            caption: format!("{}: means over runs with 95 % bootstrap intervals", WORLDS[at]),
            head: head.map(str::to_owned).to_vec(),
            rows: rows.collect(),
        };
        Section {
            title: format!("World: {}", WORLDS[at]),
            paragraphs,
            figures: vec![
                self.price(at, "time of a step (µs)", &|_, found| found.microseconds.map(|e| e.value)),
                {
                    let evaluations = |cell: &Cell, _: &Measured| Some(self.evaluations(cell) as f64);
                    self.price(at, "likelihood evaluations a step", &evaluations)
                },
            ]
            .into_iter()
            .filter(|figure| !figure.marks.is_empty())
            .collect(),
            tables: vec![grid],
            ..Section::default()
        }
    }

    /// Error against cost; those that no other beats in both have their names beside them.
    fn price(&self, at: usize, unit: &str, cost: &dyn Fn(&Cell, &Measured) -> Option<f64>) -> Figure {
        let found: Vec<(Cell, [f64; 2])> = self
            .entrants(at)
            .into_iter()
            .filter_map(|(cell, found)| Some((cell, [cost(&cell, &found)?, found.rmse_ratio?.value])))
            .collect();
        let points: Vec<[f64; 2]> = found.iter().map(|(_, point)| *point).collect();
        let best = front(&points);
        let marks = found.iter().zip(best).map(|((cell, at), labelled)| {
            let name = self.named(cell);
            Mark { at: *at, name, labelled }
        });
        Figure {
            title: "Error as a multiple of the truth's, by cost".to_owned(),
            x: unit.to_owned(),
            y: "ratio".to_owned(),
            logarithmic: true,
            logarithmic_x: true,
            marks: marks.collect(),
            ..Figure::default()
        }
    }

    /// Tables 2.1 and 2.2 of the thesis.
    fn thesis(&self) -> Section {
        let head = ["filter", "transition", "noise", "solution", "kind"].map(str::to_owned).to_vec();
        let rows = CLAIMS.iter().map(|claim| {
            let mut row = vec![Shown::from(claim.name)];
            row.extend(claim.reading.map(Shown::from));
            row
        });
        let first = Grid {
            caption: "Table 2.1. The check marks are lost: a reading of sections 2.5.1 to 2.5.6".to_owned(),
            head,
            rows: rows.collect(),
        };
        let mut head = ["filter", "constraint", "advantage"].map(str::to_owned).to_vec();
        head.extend(self.request.worlds.iter().map(|world| WORLDS[*world].to_owned()));
        let rows = CLAIMS.iter().map(|claim| {
            let mut name = Shown::from(claim.name);
            name.aside = format!(
                "here {}{}",
                claim.filter,
                if place_of(claim.filter).is_none() { ", which is not measured" } else { "" }
            );
            let mut row = vec![name, claim.constraint.into(), claim.advantage.into()];
            row.extend(self.request.worlds.iter().map(|world| Shown::from(&self.beside(claim, *world))));
            row
        });
        let second = Grid {
            caption:
                "Table 2.2, translated, and the measured error as a multiple of the truth's, largest budget"
                    .to_owned(),
            head,
            rows: rows.collect(),
        };
        Section {
            title: "What the thesis says, and what was measured".to_owned(),
            tables: vec![first, second],
            ..Section::default()
        }
    }
}

fn introduction(interrupted: bool) -> Section {
    let mut paragraphs = vec![format!(
        "Every filter sees the same measurements; its own random numbers are its own. Numbers are means over runs with 95 % \
         bootstrap intervals. RMSE is the root mean square error of a run, over the position where there is one; CRPS is the \
         mean score of each component, in the same unit. A run has failed if a measurement had no likelihood anywhere, if \
         the filter refused to go on, if one step in ten erred by more than {LOST_SDS} standard deviations of the best \
         possible answer, or if its log-evidence lies more than {LOST_NATS} nats below the best. Times are processor times of a step, each filter in its own turn in one thread."
    )];
    if interrupted {
        paragraphs.push(
            "This run was stopped before its end: cells that are missing were not computed.".to_owned(),
        );
    }
    Section { title: "How to read this".to_owned(), paragraphs, ..Section::default() }
}

fn is_broken(found: &Measured) -> bool {
    found.failures.is_some_and(|share| share.value >= BROKEN)
}

fn priced(found: &Measured) -> String {
    found
        .microseconds
        .map_or_else(|| "not timed".to_owned(), |e| format!("{} µs a step", Shown::from(e.value).text))
}

fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent < 10.0 { format!("{percent:.1}") } else { format!("{percent:.0}") }
}

fn join<T: ToString>(words: impl IntoIterator<Item = T>) -> String {
    words.into_iter().map(|word| word.to_string()).collect::<Vec<_>>().join(", ")
}
