//! The page.

use super::contenders::{Algorithm, Cell, Reading, Wsms};
use super::printed::Number;
use super::scenarios::{Flying, SCENARIOS, Scenario};
use super::settings::{CHOICE_SEED, NOISES, Setting};
use super::tables::{Results, grid_cell};
use super::{Asked, Outcome};
use crate::report::study::{Figure, Grid, Section, Series, Shown, StudyReport};
use crate::study::interval::Estimate;
use crate::study::table::{Entry, Table};

/// The noise of figures that show one: the second, at which selection fires on a quarter of the steps.
const SHOWN_NOISE: usize = 1;

/// Filters in figures over time, at the main particle count: those of the thesis, then the others.
const SHOWN: [(Algorithm, Wsms, Setting); 8] = [
    (Algorithm::Alg1, Wsms::None, Setting::Reference),
    (Algorithm::Alg2, Wsms::None, Setting::Reference),
    (Algorithm::Alg3, Wsms::None, Setting::Reference),
    (Algorithm::Alg2Wsms, Wsms::SemiDynamic, Setting::Reference),
    (Algorithm::Alg3Wsms, Wsms::SemiDynamic, Setting::Reference),
    (Algorithm::ImmPf, Wsms::None, Setting::Reference),
    (Algorithm::ImmUkf, Wsms::None, Setting::Default),
    (Algorithm::KnownModeUkf, Wsms::None, Setting::Matched),
];

const READINGS: [&str; 14] = [
    "Noise. The labels 0.01, 0.1, 0.15 and 0.2 are called variances. Here they are STANDARD DEVIATIONS, in kilometres \
     of range and in radians of bearing: the printed errors double from 0.1 to 0.2, as they do with a deviation, and the \
     printed savings of the selection follow the deviation too.",
    "Start, speed, turn rate, observer. None is printed. The tracks here have the printed sequence of manoeuvres and \
     the printed area of the bounding box; turns are at 4.5 degrees per second, which the filters know; the target \
     moves without noise. Absolute errors therefore show consistency with the thesis, no more.",
    "Process noise, transition matrix, prior. None is printed. The setting \"reference\" has disturbances of 20 m/s², \
     the size of a turn, because with less the selection loses the target; a mode stays with probability 0.9. The prior \
     mean is drawn around the truth in each run (50 m, 10 m/s); modes are equally likely at the start.",
    "Accelerated legs begin with 10 m/s² along the track. In every other mode the acceleration of a particle is drawn \
     afresh with 11 m/s².",
    "Importance density: the transition itself. Likelihoods are kept in logarithms.",
    "Algorithms 2 and 3 are printed with N estimates; there is one per model. Their average divides weighted sums by \
     weights. All three reduce X N particles to N.",
    "Algorithm 3 changes the output only. After a step of one model, that model is the one with the least error.",
    "The error of the selection adds kilometres and radians, as printed; its threshold of 0.07 is in that unit. Steps \
     of one model have no factor of the Markov chain, and the particles take that model's label.",
    "The equations of the dynamic window (5.1, 5.2) are unreadable: P - round(e/tau) and P + round(e/tau). The \
     window stays between 3 and 20, the threshold between 0.035 and 0.07; factors are 1.1.",
    "The window and the threshold of a step are changed after it was judged by them.",
    "Step 5 of the thesis's resampling weighs the survivors by the measurement once more. That counts each measurement \
     twice; it is the reading \"recomputed\" (of the output) and \"recomputed-kept\" (of the next step too), beside plain \
     multinomial resampling, \"equal\".",
    "RMSE. Equation 6.1 is printed for one run, its text says at every step, 6.2 pools. Tables show the pooled error; \
     rows.csv has the mean of the errors of single runs too, rmse-per-step.csv the error at each step.",
    "IMM in table 6.13. Its printed errors are the same in all scenarios, which range and bearing cannot give: that \
     filter saw Cartesian positions. The numbers stand beside ours and are not comparable.",
    "Times. The thesis's are MATLAB's in 2012 with a resampling quadratic in N for algorithm 1. Ours are processor \
     times of a run, each algorithm in its own run; while other runs share the caches they are a few per cent longer.",
];

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end.
    pub fn page(&self, seed: u64, interrupted: bool) -> StudyReport {
        let facts = [
            ("Runs per cell", self.request.runs.to_string()),
            ("Runs of the paired comparison", self.request.paired_runs.to_string()),
            ("Seed", seed.to_string()),
            ("Seed on which our default was chosen", CHOICE_SEED.to_string()),
            ("Data", "simulated here; nothing but the printed tables comes from the thesis".to_owned()),
        ];
        let mut sections = vec![self.introduction(interrupted)];
        for (at, scenario) in SCENARIOS.iter().enumerate() {
            let ways: Vec<Wsms> = [Wsms::SemiDynamic, Wsms::Dynamic]
                .into_iter()
                .filter(|wsms| self.request.tables.contains(&Asked::Grid(at, *wsms)))
                .collect();
            if self.outcomes.keys().any(|cell| cell.scenario == at) {
                sections.push(self.scenario(at, scenario, &ways));
            }
        }
        sections.extend(self.others());
        sections.push(Section {
            title: "What the thesis does not say, and how it is read".to_owned(),
            points: READINGS.iter().map(|text| (*text).to_owned()).collect(),
            ..Section::default()
        });
        sections.push(Section {
            title: "Printed cells that cannot be right".to_owned(),
            points: self.thesis.suspects().iter().map(|doubt| format!("{doubt}.")).collect(),
            ..Section::default()
        });
        StudyReport {
            title: "Multiple-model particle filters and the selection of models".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }

    fn introduction(&self, interrupted: bool) -> Section {
        let mut paragraphs = vec![
            "Our numbers stand first, with a 95 % bootstrap interval over runs; behind them what the thesis prints. A \
             mark says that a printed number cannot be right or cannot be compared, and the reason stands below the \
             table. Errors are in kilometres. How each open question of the thesis is read stands at the end."
                .to_owned(),
        ];
        if interrupted {
            paragraphs.push(
                "This run was stopped before its end: cells that are missing were not computed.".to_owned(),
            );
        }
        let (degenerate, lost) = self.mishaps();
        paragraphs.push(format!(
            "Steps whose measurement had no likelihood anywhere, so that the prediction stood: {degenerate}. Runs whose \
             filter refused to go on, so that its last estimate stood to the end: {lost}."
        ));
        Section { title: "How to read this".to_owned(), paragraphs, ..Section::default() }
    }

    fn scenario(&self, at: usize, scenario: &Scenario, ways: &[Wsms]) -> Section {
        let mut figures = vec![self.map(at, scenario), self.error_over_time(at)];
        let seconds = |cell: &Cell| self.seconds(cell);
        let error = |cell: &Cell| self.error(cell);
        for (title, unit, statistic) in
            [("Error", "km", &error as &dyn Fn(&Cell) -> Option<Estimate>), ("Time of a run", "s", &seconds)]
        {
            figures.push(self.over_particles(at, title, unit, statistic));
            figures.push(self.over_noise(at, title, unit, statistic));
        }
        for (algorithm, setting) in
            [(Algorithm::Alg2, Setting::Reference), (Algorithm::ImmUkf, Setting::Default)]
        {
            figures
                .extend(self.modes(&self.shown(at, (algorithm, Wsms::None, setting), SHOWN_NOISE), scenario));
        }
        figures.retain(|figure| !figure.series.is_empty());
        let mut tables = Vec::new();
        for wsms in ways {
            tables.extend([self.errors(at, *wsms), self.times(at, *wsms), self.percent(at, *wsms)]);
        }
        Section { title: format!("Scenario {}", at + 1), figures, tables, ..Section::default() }
    }

    /// The cell of a filter that figures show.
    fn shown(
        &self,
        scenario: usize,
        (algorithm, wsms, setting): (Algorithm, Wsms, Setting),
        noise: usize,
    ) -> Cell {
        let none = matches!(algorithm, Algorithm::ImmUkf | Algorithm::ImmEkf | Algorithm::KnownModeUkf);
        let particles = if none { 0 } else { self.request.main_particles() };
        Cell { scenario, algorithm, wsms, setting, reading: Reading::Equal, particles, noise }
    }

    fn shown_outcomes(&self, at: usize) -> impl Iterator<Item = (String, &Outcome)> {
        SHOWN.iter().filter_map(move |filter| {
            Some((name(filter), self.outcomes.get(&self.shown(at, *filter, SHOWN_NOISE))?))
        })
    }

    fn map(&self, at: usize, scenario: &Scenario) -> Figure {
        let truth = scenario.truth().iter().map(|state| [state[0] * 1e-3, state[1] * 1e-3]).collect();
        let observer = vec![scenario.observer.map(|p| p * 1e-3)];
        let mut series: Vec<Series> = self
            .shown_outcomes(at)
            .map(|(name, outcome)| Series { name, points: outcome.track.clone(), ..Series::default() })
            .collect();
        series.push(Series { name: "target".into(), points: truth, reference: true, ..Series::default() });
        series.push(Series {
            name: "observer".into(),
            points: observer,
            dots: true,
            reference: true,
            ..Series::default()
        });
        Figure {
            title: format!("Target and tracks of the first run, noise {}", NOISES[SHOWN_NOISE]),
            x: "x (km)".into(),
            y: "y (km)".into(),
            map: true,
            series,
            ..Figure::default()
        }
    }

    fn error_over_time(&self, at: usize) -> Figure {
        let series = self.shown_outcomes(at).map(|(name, outcome)| {
            let points =
                (1..).zip(&outcome.step_mse).map(|(step, mse)| [f64::from(step), mse.sqrt()]).collect();
            Series { name, points, ..Series::default() }
        });
        Figure {
            title: format!("Error at each step over the runs, noise {}", NOISES[SHOWN_NOISE]),
            x: "time (s)".into(),
            y: "km".into(),
            series: series.collect(),
            ..Figure::default()
        }
    }

    fn over_particles(
        &self,
        at: usize,
        title: &str,
        unit: &str,
        statistic: &dyn Fn(&Cell) -> Option<Estimate>,
    ) -> Figure {
        let line = |filter: &(Algorithm, Wsms, Setting)| {
            let cell = self.shown(at, *filter, SHOWN_NOISE);
            let point = |particles: usize| {
                let found = statistic(&Cell { particles, ..cell })?;
                Some([particles as f64, found.value])
            };
            let points: Vec<_> = self.request.particles.iter().filter_map(|n| point(*n)).collect();
            (!points.is_empty()).then(|| Series { name: name(filter), points, ..Series::default() })
        };
        Figure {
            title: format!("{title} by number of particles, noise {}", NOISES[SHOWN_NOISE]),
            x: "particles".into(),
            y: unit.into(),
            series: SHOWN.iter().filter_map(line).collect(),
            ..Figure::default()
        }
    }

    fn over_noise(
        &self,
        at: usize,
        title: &str,
        unit: &str,
        statistic: &dyn Fn(&Cell) -> Option<Estimate>,
    ) -> Figure {
        let line = |filter: &(Algorithm, Wsms, Setting)| {
            let point =
                |noise: usize| Some([NOISES[noise], statistic(&self.shown(at, *filter, noise))?.value]);
            let points: Vec<_> = (0..NOISES.len()).filter_map(point).collect();
            (!points.is_empty()).then(|| Series { name: name(filter), points, ..Series::default() })
        };
        Figure {
            title: format!("{title} by noise, {} particles", self.request.main_particles()),
            x: "noise".into(),
            y: unit.into(),
            logarithmic: unit == "s",
            series: SHOWN.iter().filter_map(line).collect(),
            ..Figure::default()
        }
    }

    /// Probabilities of the modes over time, averaged over runs.
    fn modes(&self, cell: &Cell, scenario: &Scenario) -> Option<Figure> {
        let outcome = self.outcomes.get(cell).filter(|outcome| !outcome.modes.is_empty())?;
        let line = |(mode, flying): (usize, &Flying)| {
            let points = (1..)
                .zip(&outcome.modes)
                .map(|(step, law)| [f64::from(step), law.get(mode).copied().unwrap_or(f64::NAN)]);
            Series { name: flying.name().to_owned(), points: points.collect(), ..Series::default() }
        };
        let filter = (cell.algorithm, cell.wsms, cell.setting);
        Some(Figure {
            title: format!("Probabilities of the modes, {}, noise {}", name(&filter), NOISES[cell.noise]),
            x: "time (s)".into(),
            series: scenario.modes.iter().enumerate().map(line).collect(),
            ..Figure::default()
        })
    }

    /// Tables 6.1 to 6.3 and 6.7 to 6.9: errors.
    fn errors(&self, at: usize, wsms: Wsms) -> Grid {
        self.grid(at, wsms, "RMSE (km), pooled over runs and steps", &|cell| {
            let printed = self.thesis.printed(cell).map(|p| &p.rmse);
            with_printed(self.error(cell), printed)
        })
    }

    /// The same tables: times and shares.
    fn times(&self, at: usize, wsms: Wsms) -> Grid {
        self.grid(at, wsms, "processor time of a run (s); share of the steps with one model", &|cell| {
            let printed = self.thesis.printed(cell).map(|p| &p.seconds);
            let mut shown = with_printed(self.seconds(cell), printed);
            let outcome = self.outcomes.get(cell).filter(|_| cell.wsms != Wsms::None);
            if let Some(outcome) = outcome {
                let share = outcome.single.iter().sum::<f64>() / outcome.single.len() as f64;
                shown.aside = format!("share {share:.2} · {}", shown.aside);
            }
            shown
        })
    }

    fn grid(&self, at: usize, wsms: Wsms, what: &str, show: &dyn Fn(&Cell) -> Shown) -> Grid {
        let mut head = vec!["algorithm".to_owned(), "noise".to_owned()];
        head.extend(self.request.particles.iter().map(|n| format!("N = {n}")));
        let mut rows = Vec::new();
        for algorithm in &Algorithm::ALL[..5] {
            for noise in 0..NOISES.len() {
                let cells = self.request.particles.iter().map(|n| grid_cell(at, *algorithm, wsms, *n, noise));
                let mut row = vec![algorithm.name().into(), Shown::from(NOISES[noise].to_string().as_str())];
                row.extend(cells.map(|cell| show(&cell)));
                rows.push(row);
            }
        }
        let table = at + if wsms == Wsms::Dynamic { 7 } else { 1 };
        Grid { caption: format!("Table 6.{table}, {} selection: {what}", wsms.name()), head, rows }
    }

    /// Tables 6.4 to 6.6 and 6.10 to 6.12.
    fn percent(&self, at: usize, wsms: Wsms) -> Grid {
        let table = self.percentages(at, wsms);
        let mut head = ["A → B", "noise"].map(str::to_owned).to_vec();
        head.extend(self.request.particles.iter().map(|n| format!("N = {n}: error %, time %")));
        let number = |entry: &Entry| {
            if let Entry::Number(value) = entry { format!("{value:.1}") } else { "–".into() }
        };
        let text = |entry: &Entry| if let Entry::Text(text) = entry { text.clone() } else { String::new() };
        let rows = table.rows.iter().map(|row| {
            let pair = format!("{} → {}", text(&row[0]), text(&row[1]));
            let mut shown: Vec<Shown> = vec![pair.as_str().into(), Shown::from(&row[2])];
            shown.extend(row[3..].chunks(6).map(|cell| Shown {
                text: format!("{}, {}", number(&cell[0]), number(&cell[4])),
                aside: format!("thesis {}, {}", number(&cell[3]), number(&cell[5])),
                doubt: None,
            }));
            shown
        });
        let rows = rows.collect();
        Grid { caption: format!("{}. {}", table.name.replace("table-", "Table "), table.about), head, rows }
    }

    /// Tables that are not of one scenario.
    fn others(&self) -> Vec<Section> {
        let asked = |asked: &&Asked| self.request.tables.contains(asked);
        let listed = [
            (Asked::Imm, "Table 6.13: IMM filters"),
            (Asked::Readings, "Readings of the weights after resampling"),
            (Asked::Beyond, "Filters that the thesis does not have"),
        ];
        let mut sections: Vec<Section> = listed
            .iter()
            .filter(|(table, _)| asked(&table))
            .map(|(table, title)| Section {
                title: (*title).to_owned(),
                tables: vec![self.list(*table)],
                ..Section::default()
            })
            .collect();
        if asked(&&Asked::Paired) {
            sections.push(whole("Rao-Blackwellised particles against IMM filters", &self.paired()));
        }
        if let Some(saving) = self.saving_table() {
            sections.push(whole("What a saving is worth", &saving));
        }
        sections
    }

    fn list(&self, asked: Asked) -> Grid {
        let mut head = ["scenario", "filter", "setting", "reading", "particles"].map(str::to_owned).to_vec();
        head.extend(NOISES.map(|noise| format!("noise {noise}")));
        let rows = self.listed(asked).map(|cell| {
            let count = cell.particles.to_string();
            let number = (cell.scenario + 1).to_string();
            let words = [&number, cell.algorithm.name(), cell.setting.name(), cell.reading.name(), &count];
            let mut row: Vec<Shown> = words.map(Shown::from).to_vec();
            row.extend((0..NOISES.len()).map(|noise| {
                let cell = Cell { noise, ..*cell };
                let mut shown = with_printed(self.error(&cell), self.thesis.printed(&cell).map(|p| &p.rmse));
                if let Some(time) = self.seconds(&cell) {
                    shown.aside = format!("{} · {:.1} ms", shown.aside, 1e3 * time.value);
                }
                shown
            }));
            row
        });
        let rows = rows.collect();
        Grid { caption: "RMSE (km), its interval, the thesis's value, time of a run".to_owned(), head, rows }
    }
}

impl Flying {
    /// Name of the mode.
    fn name(self) -> &'static str {
        match self {
            Flying::Straight => "straight",
            Flying::Left => "left turn",
            Flying::Right => "right turn",
            Flying::Accelerating => "accelerating",
        }
    }
}

fn name((algorithm, wsms, setting): &(Algorithm, Wsms, Setting)) -> String {
    let mut name = algorithm.name().to_owned();
    if *wsms != Wsms::None {
        name = format!("{name} {}", wsms.name());
    }
    if *setting != Setting::Reference {
        name = format!("{name} ({})", setting.name());
    }
    name
}

fn with_printed(ours: Option<Estimate>, printed: Option<&Number>) -> Shown {
    let mut shown = Shown::default();
    match ours {
        Some(Estimate { value, low, high }) => {
            shown.text = format!("{value:.4}");
            shown.aside = format!("{low:.4} to {high:.4}");
        }
        None => shown.text = "–".to_owned(),
    }
    if let Some(Number { value, doubt, .. }) = printed {
        shown.aside = format!("{} · thesis {value}", shown.aside);
        shown.doubt.clone_from(doubt);
    }
    shown
}

fn whole(title: &str, table: &Table) -> Section {
    let rows = table.rows.iter().map(|row| row.iter().map(Shown::from).collect()).collect();
    let grid = Grid { caption: table.about.clone(), head: table.head.clone(), rows };
    Section { title: title.to_owned(), tables: vec![grid], ..Section::default() }
}
