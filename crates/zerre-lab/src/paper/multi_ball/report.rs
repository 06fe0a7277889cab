//! The page.

use super::settings::{
    BALLS, BURN_IN, FLOOR_RUNS, FRAMES, LEAST_COMPARED, MEASUREMENT_SD, MEETINGS, PICTURED_FRAMES, SCENE,
    SPEED, TOLERANCE, VELOCITY_SD, WALK_SD,
};
use super::tables::{Results, Row, title};
use super::{FILTERS, METHODS, MOTIONS, Part};
use crate::report::study::{Figure, Grid, Picture, Section, Series, Shown, StudyReport};
use crate::study::interval::Estimate;
use zerre_vision::balls::thesis::{RATIOS, READINGS};

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end.
    pub(super) fn page(
        &self,
        (figures, pictures): (Vec<Figure>, Vec<Picture>),
        interrupted: bool,
    ) -> StudyReport {
        let experiment = self.experiment;
        let facts = [
            (
                "Runs per cell",
                format!("{}; of the linear model {FLOOR_RUNS} times as many", experiment.request.runs),
            ),
            ("Seed", experiment.seed.to_string()),
            (
                "Clip",
                format!(
                    "{SCENE} at {SPEED} px per frame, chosen for the green column; another one for each run"
                ),
            ),
        ];
        let mut sections = vec![how_to_read(interrupted)];
        if experiment.asks(Part::Table) {
            sections.push(self.verdict());
            sections.push(self.table());
            if !figures.is_empty() {
                let title = "Trajectories, as in figures 3.3 to 3.5".to_owned();
                sections.push(Section { title, figures, ..Section::default() });
            }
            if !pictures.is_empty() {
                let numbers = PICTURED_FRAMES.map(|frame| frame.to_string()).join(", ");
                sections.push(Section {
                    title: "Particles, as in figure 3.2".to_owned(),
                    paragraphs: vec![format!(
                        "Frames {numbers} of the first clip: they start about the middle."
                    )],
                    pictures,
                    ..Section::default()
                });
            }
        }
        if experiment.asks(Part::Floor) {
            sections.push(self.floor_section());
        }
        if experiment.asks(Part::Identity) {
            sections.push(self.identity_section());
        }
        StudyReport {
            title: "Several balls by a particle filter each".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }

    /// What reproduces, counted.
    fn verdict(&self) -> Section {
        let rows = self.of_part(Part::Table);
        let mut points = Vec::new();
        for reading in READINGS {
            for ball in BALLS {
                let beside: Vec<(&Row, f64)> = rows
                    .iter()
                    .filter(|row| (row.reading, row.ball) == (reading.name, ball) && row.metric != "seconds")
                    .filter(|row| row.particles >= LEAST_COMPARED)
                    .filter_map(|row| Some((row, row.paper_value?)))
                    .collect();
                let off = |(row, printed): &(&Row, f64)| row.value / printed - 1.0;
                let near = beside.iter().filter(|one| off(one).abs() <= TOLERANCE).count();
                let Some(worst) = beside.iter().map(off).max_by(|a, b| a.abs().total_cmp(&b.abs())) else {
                    continue;
                };
                points.push(format!(
                    "Reading {}, {ball}: {near} of {} sizes from {LEAST_COMPARED} particles on are within {:.0} % of the \
                     printed error; the farthest is off by {:+.0} %.",
                    reading.name,
                    beside.len(),
                    100.0 * TOLERANCE,
                    100.0 * worst
                ));
            }
        }
        Section { title: "What reproduces".to_owned(), points, ..Section::default() }
    }

    fn table(&self) -> Section {
        let rows = self.of_part(Part::Table);
        let mut grids = Vec::new();
        for reading in READINGS {
            let unit = if reading.squared { "px^2" } else { "px" };
            let mut head = vec!["particles".to_owned()];
            for ball in BALLS {
                head.extend(["printed", "to detection", "to truth"].map(|what| format!("{ball}, {what}")));
            }
            if reading.name == READINGS[0].name {
                head.extend(["seconds, printed".to_owned(), "seconds".to_owned()]);
            }
            let line = |particles: &usize| -> Vec<Shown> {
                let of = |ball: &str, reference: &str| {
                    rows.iter().find(|row| {
                        (row.particles, row.reading, row.ball, row.reference)
                            == (*particles, reading.name, ball, reference)
                    })
                };
                let mut line: Vec<Shown> = vec![particles.to_string().as_str().into()];
                for ball in BALLS {
                    let detection = of(ball, "detection");
                    line.push(detection.and_then(|row| row.paper_value).into());
                    line.push(detection.map(Row::estimate).into());
                    line.push(of(ball, "truth").map(Row::estimate).into());
                }
                if reading.name == READINGS[0].name {
                    let seconds = of("all", "");
                    line.push(seconds.and_then(|row| row.paper_value).into());
                    line.push(seconds.map(|row| row.value).into());
                }
                line
            };
            grids.push(Grid {
                caption: format!(
                    "Reading {}: {}. Means over runs, {unit}, with 95 % intervals (Student's t)",
                    reading.name, reading.about
                ),
                head,
                rows: self.experiment.particles().iter().map(line).collect(),
            });
        }
        let mut series: Vec<Series> = READINGS
            .iter()
            .filter(|reading| !reading.squared)
            .map(|reading| {
                let of = |row: &&Row| {
                    (row.reading, row.ball, row.reference) == (reading.name, BALLS[0], "detection")
                };
                let chosen: Vec<&Row> = rows.iter().filter(of).collect();
                Series {
                    name: format!("reading {}", reading.name),
                    points: chosen.iter().map(|row| [row.particles as f64, row.value]).collect(),
                    band: chosen.iter().map(|row| [row.low, row.high]).collect(),
                    ..Series::default()
                }
            })
            .collect();
        let printed = &self.experiment.printed;
        let points =
            printed.particles().into_iter().filter_map(|n| Some([n as f64, printed.error(n, BALLS[0])?]));
        series.push(Series {
            name: "printed".to_owned(),
            points: points.collect(),
            reference: true,
            ..Series::default()
        });
        Section {
            title: title(Part::Table).to_owned(),
            paragraphs: vec![
                "The printed column is called a mean squared error. It falls as the root of the number of particles \
                 and has no floor, which squared errors against a truth seen through noise cannot do: it is read as a \
                 distance to what was detected. Which noises, which estimate and which clip is not printed; readings \
                 are ways to fill that in, and one that fits explains the column without proving itself."
                    .to_owned(),
                format!(
                    "Noises of the three balls are as {} : {} : {}, the ratios of the printed errors, since the text says \
                     only that they differ. Seconds are processor time of detector and filters over a clip; the \
                     thesis' include decoding in MATLAB.",
                    RATIOS[0], RATIOS[1], RATIOS[2]
                ),
            ],
            figures: vec![Figure {
                title: format!("Distance of the {} ball's estimate to the detection", BALLS[0]),
                x: "particles".to_owned(),
                y: "px".to_owned(),
                logarithmic: true,
                logarithmic_x: true,
                series,
                ..Figure::default()
            }],
            tables: grids,
            ..Section::default()
        }
    }

    fn floor_section(&self) -> Section {
        let rows = self.of_part(Part::Floor);
        let runs = self.experiment.runs(Part::Floor);
        let mut grids = Vec::new();
        for motion in MOTIONS {
            let of = |filter: &str, particles: usize, metric: &str| {
                let is = |row: &&Row| {
                    (row.motion, row.filter, row.particles, row.metric) == (motion, filter, particles, metric)
                };
                rows.iter().find(is).map(Row::estimate)
            };
            let mut lines: Vec<Vec<Shown>> = Vec::new();
            for particles in self.experiment.particles() {
                let mut line: Vec<Shown> = vec![particles.to_string().as_str().into()];
                line.extend(FILTERS.map(|(name, ..)| ratio(of(name, *particles, "kalman_ratio"))));
                lines.push(line);
            }
            let mut head = vec!["particles".to_owned()];
            head.extend(FILTERS.map(
                |(name, _, adapted)| {
                    if adapted { name.to_owned() } else { format!("blind, {name}") }
                },
            ));
            let px = |filter: &str| Shown::from(of(filter, 0, "error_px").map(|e| e.value)).text;
            grids.push(Grid {
                caption: format!(
                    "{motion}: error as a multiple of the Kalman filter's, which is {} px; the measurements' own is {} px. \
                     Pooled over runs, 95 % intervals by the bootstrap over runs, paired",
                    px("kalman"),
                    px("measurement")
                ),
                head,
                rows: lines,
            });
        }
        Section {
            title: title(Part::Floor).to_owned(),
            paragraphs: vec![
                format!(
                    "{runs} draws of three balls, {FRAMES} frames, errors against the truth after frame {BURN_IN}; measurements with \
                 {MEASUREMENT_SD} px of noise on each axis, random walk of {WALK_SD} px or velocities that change by \
                 {VELOCITY_SD} px per frame. Filters know the model: no estimate has a smaller expected error than the \
                 Kalman filter's, and what is above 1 is the price of particles. Estimates are weighted means."
                ),
                blind_or_adapted(),
            ],
            tables: grids,
            ..Section::default()
        }
    }

    fn identity_section(&self) -> Section {
        let rows = self.of_part(Part::Identity);
        let line = |(scene, method): (&str, &str)| -> Vec<Shown> {
            let of = |metric: &str| {
                let is = |row: &&Row| (row.scene, row.method, row.metric) == (scene, method, metric);
                rows.iter().find(is).map(Row::estimate)
            };
            vec![scene.into(), method.into(), of("swaps").into(), of("held_share").into()]
        };
        let keys = MEETINGS.iter().flat_map(|scene| METHODS.map(|method| (*scene, method)));
        Section {
            title: title(Part::Identity).to_owned(),
            paragraphs: vec![
                "A swap is counted whenever the track nearest to a true ball, within its radius, is another one than \
                 before. Sorting areas, as the thesis does, gives one label to two balls that touch, and has nothing to \
                 tell balls of one size apart by. The default pairs tracks with detections by predicted place, area and \
                 colour, and separates discs that touch by their rims."
                    .to_owned(),
            ],
            tables: vec![Grid {
                caption: "Means over clips with 95 % intervals (Student's t)".to_owned(),
                head: ["scene", "told apart by", "swaps per clip", "visible balls held"].map(str::to_owned).to_vec(),
                rows: keys.map(line).collect(),
            }],
            ..Section::default()
        }
    }
}

/// Ratios near 1 differ in their thousandths.
fn ratio(estimate: Option<Estimate>) -> Shown {
    let Some(Estimate { value, low, high }) = estimate else { return None::<f64>.into() };
    Shown { aside: format!("{low:.3} to {high:.3}"), ..format!("{value:.3}").as_str().into() }
}

fn blind_or_adapted() -> String {
    "Blind filters are the thesis': particles move by the motion alone and are resampled where fewer than half of them \
     are effective. With constant velocity a measurement of places says little of velocities, and blind particles pay \
     for it under every scheme of resampling. The adapted filter is what zerre balls follows with: particles are resampled by how \
     well they foretell the measurement, then moved with it in view, both exact in this model (Pitt and Shephard 1999)."
        .to_owned()
}

fn how_to_read(interrupted: bool) -> Section {
    let mut paragraphs = vec![
        "Balls are drawn, so that their places are known: errors are given against what the detector found, as in the \
         thesis, and against the truth."
            .to_owned(),
    ];
    if interrupted {
        paragraphs.push(
            "This run was stopped before its end: cells that are missing were not computed.".to_owned(),
        );
    }
    Section { title: "How to read this".to_owned(), paragraphs, ..Section::default() }
}
