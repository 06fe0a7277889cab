//! The page.

use super::pictures::Painted;
use super::settings::{CALIBRATION_CLIPS, CHOSEN, CONDITIONS, SWEEP_RUNS};
use super::tables::{FLOOR, FRAMES, IN_TIME, Results, Row};
use super::{ERRORS, SWEEPS};
use crate::report::study::{Figure, Grid, Section, Series, Shown, StudyReport};
use zerre_vision::rgbd::scene::{Condition, SCENES};

/// The sources in the order of the page, as far as they are there.
const SOURCES: [&str; 8] =
    ["device", "color", "depth", "fused", "thesis-color", "thesis-depth", "thesis", "operators"];

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end; `more` stands before the times.
    pub(super) fn page(&self, interrupted: bool, more: Vec<Section>) -> StudyReport {
        let experiment = self.experiment;
        let facts = [
            ("Clips per condition", experiment.request.clips.to_string()),
            ("Particles", CHOSEN.to_string()),
            ("Seed", experiment.seed.to_string()),
            (
                "Sources learnt from",
                format!("{CALIBRATION_CLIPS} drawn calibration clips of the same seed, no value of which is in the others"),
            ),
            (
                "Settings chosen on",
                "drawn clips of the same kind with seeds 1000 to 1007 (the cues' constants; with calibration clips 9000 to \
                 9011 how the covariance's floor is learnt and when colours are); the thesis's thresholds on calibration \
                 clips 9000 to 9002; that a first place is believed where no source could correct it, on seed 1"
                    .to_owned(),
            ),
        ];
        let rows = self.rows();
        let mut sections = Vec::new();
        if experiment.is_drawn() {
            sections.extend([verdict(&rows), how_to_read(interrupted)]);
        }
        if experiment.request.tables.contains(ERRORS) {
            sections.push(Section { figures: self.in_time_figure(), ..errors(&rows) });
        }
        if experiment.request.tables.contains(SWEEPS) {
            sections.push(self.sweep(&rows));
        }
        sections.extend(more);
        if experiment.is_drawn() {
            sections.push(latency(&rows));
        }
        StudyReport {
            title: "A hand in colour and depth: fusion of three sources".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }

    /// Errors of the first clip frame by frame, above what the reference itself may be off.
    fn in_time_figure(&self) -> Vec<Figure> {
        let floor = self.in_time(FLOOR);
        if floor.is_empty() {
            return Vec::new();
        }
        let line = |name: &str, source: &str| Series {
            name: name.to_owned(),
            points: self.in_time(source),
            ..Series::default()
        };
        let names = ["device", "colour cue", "depth cue", "fused", "thesis"];
        let mut series: Vec<Series> =
            names.into_iter().zip(IN_TIME).map(|(name, source)| line(name, source)).collect();
        series.push(Series { reference: true, ..line("noise floor of the operators' mean", FLOOR) });
        vec![Figure {
            title: "Distance from the truth, first clip, light".to_owned(),
            x: "frame".to_owned(),
            y: "px".to_owned(),
            logarithmic: true,
            series,
            ..Figure::default()
        }]
    }

    /// The thesis's chapter 5.
    fn sweep(&self, rows: &[Row]) -> Section {
        let counts: Vec<usize> = self.sweeps.keys().copied().collect();
        // The sweep's rows stand behind those of the conditions.
        let row = |n: usize, source: &str, metric: &str| {
            let there = |row: &&Row| {
                row.condition == CONDITIONS[0].name
                    && row.frames == "all"
                    && (row.particles, row.source.as_str(), row.metric) == (n, source, metric)
            };
            rows.iter().rfind(there)
        };
        let series = |name: &str, source: &str, metric: &str| {
            let found: Vec<(f64, &Row)> =
                counts.iter().filter_map(|n| Some((*n as f64, row(*n, source, metric)?))).collect();
            let band = found.iter().map(|(_, row)| [row.low, row.high]);
            Series {
                name: name.to_owned(),
                points: found.iter().map(|(n, row)| [*n, row.value]).collect(),
                band: if metric == "best_count" { Vec::new() } else { band.collect() },
                dots: metric == "rmse_px",
                reference: false,
            }
        };
        let over = |title: &str, y: &str, series: Vec<Series>| Figure {
            title: title.to_owned(),
            x: "particles".to_owned(),
            y: y.to_owned(),
            logarithmic_x: true,
            series,
            ..Figure::default()
        };
        let best = [
            ("device", "device"),
            ("colour", "thesis-color"),
            ("depth", "thesis-depth"),
            ("the thesis's filter", "thesis"),
        ];
        let mut figures = vec![
            Figure {
                logarithmic: true,
                ..over(
                    "Error against the number of particles",
                    "RMSE, px",
                    vec![
                        series("the thesis's filter", "thesis", "rmse_px"),
                        series("sound filter", "fused", "rmse_px"),
                    ],
                )
            },
            over(
                "Frames in which each source is nearest",
                "frames of all clips",
                best.map(|(name, source)| series(name, source, "best_count")).to_vec(),
            ),
            over(
                "By what share the thesis's filter is nearer than the device",
                "1 - RMSE / RMSE of the device",
                vec![series("the thesis's filter", "thesis", "improvement")],
            ),
        ];
        if let Some(curves) = self.curves(CHOSEN) {
            let names = ["device", "colour", "depth", "filter"];
            figures.push(Figure {
                title: format!(
                    "The thesis's figure: normalised cumulative errors, {CHOSEN} particles, first clip"
                ),
                x: "frame".to_owned(),
                y: "share of the worst".to_owned(),
                series: names
                    .into_iter()
                    .zip(curves)
                    .map(|(name, curve)| Series {
                        name: name.to_owned(),
                        points: steps(&curve),
                        ..Series::default()
                    })
                    .collect(),
                ..Figure::default()
            });
        }
        figures.extend(self.welch(CHOSEN).map(|curve| {
            let level = [[1.0, curve.level], [curve.mean.len() as f64, curve.level]];
            let band = [curve.level - curve.band, curve.level + curve.band];
            Figure {
                title: format!("Welch's procedure: squared error of the filter, {CHOSEN} particles"),
                x: "frame".to_owned(),
                y: "px²".to_owned(),
                series: vec![
                    Series {
                        name: "mean of runs and clips".to_owned(),
                        points: steps(&curve.mean),
                        ..Series::default()
                    },
                    Series {
                        name: format!("moving average over {} frames", 2 * curve.window + 1),
                        points: steps(&curve.smooth),
                        ..Series::default()
                    },
                    Series {
                        name: "level and what it may be off".to_owned(),
                        points: level.to_vec(),
                        band: vec![band; 2],
                        reference: true,
                        ..Series::default()
                    },
                ],
                ..Figure::default()
            }
        }));
        let head =
            ["particles", "best: device", "colour", "depth", "filter", "warm-up", "MSER-5", "improvement"];
        let table = counts
            .iter()
            .map(|n| {
                let value = |source: &str, metric: &str| {
                    row(*n, source, metric).map_or_else(Shown::default, |row| Shown::from(row.value))
                };
                let counted = |source: &str| value(source, "best_count");
                vec![
                    Shown::from(n.to_string().as_str()),
                    counted("device"),
                    counted("thesis-color"),
                    counted("thesis-depth"),
                    counted("thesis"),
                    row(*n, "thesis", "warm_up").map_or("none".into(), |row| Shown::from(row.value)),
                    value("thesis", "warm_up_mser5"),
                    shown(row(*n, "thesis", "improvement")),
                ]
            })
            .collect();
        let never = counts.iter().filter(|n| row(**n, "thesis", "warm_up").is_none()).count();
        let mut paragraphs = vec![format!(
            "Against the mean of seven simulated operators, as the thesis has it; {SWEEP_RUNS} runs of its filter for \
             each number of particles. Normalising each frame hides how large errors are: a source that is off by 3 px \
             counts as the worst where the others are off by 1. More particles do not help it: three normal \
             likelihoods of one width multiplied are the average of three places, however many particles there are."
        )];
        paragraphs.push(settling(never, counts.len()));
        Section {
            title: "The thesis's chapter 5, on clips whose truth is known".to_owned(),
            paragraphs,
            figures,
            tables: vec![Grid {
                caption: "Frames in which each source is nearest, frames until it has settled (Welch; MSER-5), and by what \
                          share the filter's RMSE is less than the device's."
                    .to_owned(),
                head: head.map(str::to_owned).to_vec(),
                rows: table,
            }],
            ..Section::default()
        }
    }
}

/// What there is to say of the warm-up, where so many of the numbers of particles never settle.
fn settling(never: usize, all: usize) -> String {
    let mut text =
        "Warm-up by Welch's procedure: squared errors are averaged over the runs and the clips and smoothed by the \
         narrowest moving average, of at most a quarter of the frames, that makes the curve smooth; it has settled \
         where it stays about the mean of its second half, by no more than 5 % of its range or 1.96 of its own \
         standard errors over the clips. A filter begins where the hand is: there is no transient to cut off, and what \
         the curve follows is where the hand is in these clips and what the device says of it there, with a burst \
         here and there. A warm-up that is found is to be read as the end of such a burst."
            .to_owned();
    if never > 0 {
        text += &format!(
            " For {never} of {all} numbers of particles the curve never settles in its first half; MSER-5 stands in."
        );
    }
    text
}

/// Values against their steps, from 1.
fn steps(values: &[f64]) -> Vec<[f64; 2]> {
    values.iter().enumerate().map(|(k, v)| [(k + 1) as f64, *v]).collect()
}

/// Steps and particles on frames.
pub(super) fn pictures(painted: &[Painted]) -> Section {
    Section {
        title: "The steps, and particles on frames".to_owned(),
        paragraphs: vec![
            "Left to right and down the steps of both pipelines in the window about the device's joint. Below, the part of \
             a frame about the hand with 10 to 5000 particles (at most 500 are drawn): above the thesis's filter with the \
             same particles as its estimate, orange with the 95 % ellipse of its weights; below the sound one; the truth \
             green."
                .to_owned(),
        ],
        pictures: painted.iter().map(|(picture, _)| picture.clone()).collect(),
        ..Section::default()
    }
}

fn find<'a>(rows: &'a [Row], condition: &str, frames: &str, source: &str, metric: &str) -> Option<&'a Row> {
    rows.iter().find(|row| {
        row.condition == condition
            && row.frames == frames
            && row.source == source
            && row.metric == metric
            && row.particles == CHOSEN
    })
}

/// A number with its interval.
fn shown(row: Option<&Row>) -> Shown {
    let Some(row) = row else { return Shown::default() };
    let aside = format!("{} – {}", Shown::from(row.low).text, Shown::from(row.high).text);
    Shown { aside, ..Shown::from(row.value) }
}

/// What holds and what does not, in words.
fn verdict(rows: &[Row]) -> Section {
    let mut points = Vec::new();
    for under in &CONDITIONS {
        let value = |frames: &str, source: &str, metric: &str| {
            find(rows, under.name, frames, source, metric).map(|row| row.value)
        };
        let (Some(fused), Some(device)) =
            (value("all", "fused", "rmse_px"), value("all", "device", "rmse_px"))
        else {
            continue;
        };
        let text = |v: f64| Shown::from(v).text;
        let best =
            ["color", "depth"].iter().filter_map(|s| value("all", s, "rmse_px")).fold(device, f64::min);
        let mut line = format!(
            "{}: {} px, {} times the device's {} px and {} times the best single source's",
            under.name,
            text(fused),
            text(fused / device),
            text(device),
            text(fused / best)
        );
        if let Some(thesis) = value("all", "thesis", "rmse_px") {
            line += &format!("; the thesis's filter {} px", text(thesis));
        }
        if let Some(held) = value("all", "fused", "coverage95") {
            line += &format!("; the 95 % ellipse holds the hand in {} % of the frames", text(100.0 * held));
        }
        if let (Some(lost), Some(held)) =
            (value("hidden", "fused", "lost_share"), value("hidden", "fused", "coverage95"))
        {
            line += &format!(
                "; while the hand is hidden it is flagged as lost in {} % and the ellipse holds it in {} %",
                text(100.0 * lost),
                text(100.0 * held)
            );
        }
        points.push(line + ".");
    }
    Section {
        title: "What comes out".to_owned(),
        paragraphs: vec![
            "The thesis's recording is not to be had, and most of its numbers are lost in its text: what is reproduced is its \
             method, on drawn recordings whose truth is known."
                .to_owned(),
        ],
        points,
        ..Section::default()
    }
}

fn how_to_read(interrupted: bool) -> Section {
    let mut paragraphs = vec![
        "Distances are from the truth, the middle of the right palm, in pixels of 640 x 480. Occluded are frames in which the \
         hand is before or behind the body; free the others in which it can be seen. A cue's own answer is the candidate \
         that is nearest to where the filter made it look. Intervals are of a bootstrap over blocks of ten frames: few clips \
         of drawn people, so they say how sure the number is for such clips, not for the world."
            .to_owned(),
    ];
    if interrupted {
        paragraphs.push("The run was interrupted: some numbers are missing.".to_owned());
    }
    Section { title: "How to read this".to_owned(), paragraphs, ..Section::default() }
}

/// Errors by condition and source.
fn errors(rows: &[Row]) -> Section {
    let mut tables = Vec::new();
    for under in &CONDITIONS {
        let mut grid = Vec::new();
        for source in SOURCES {
            let cell = |frames: &str, metric: &str| shown(find(rows, under.name, frames, source, metric));
            if find(rows, under.name, "all", source, "rmse_px").is_none() {
                continue;
            }
            let mut row = vec![Shown::from(source)];
            row.extend(FRAMES.map(|frames| cell(frames, "rmse_px")));
            row.extend(
                ["median_px", "p95_px", "share20", "silent_share", "best_count"].map(|m| cell("all", m)),
            );
            grid.push(row);
        }
        if grid.is_empty() {
            continue;
        }
        let head = [
            "source",
            "RMSE, px",
            "occluded",
            "free",
            "median",
            "95th percentile",
            "beyond 20 px",
            "silent",
            "nearest in frames",
        ];
        tables.push(Grid {
            caption: format!("{}: {}.", under.name, about(under.scene)),
            head: head.map(str::to_owned).to_vec(),
            rows: grid,
        });
    }
    Section { title: "Errors".to_owned(), tables, ..Section::default() }
}

/// What the clips of a condition show.
fn about(condition: Condition) -> &'static str {
    SCENES.iter().find(|scene| scene.condition == Some(condition)).map_or("", |scene| scene.about)
}

fn latency(rows: &[Row]) -> Section {
    let mut grid = Vec::new();
    for row in rows.iter().filter(|row| row.metric == "ms_per_frame" && row.statistic == "median") {
        let worst = rows.iter().find(|other| {
            other.metric == row.metric
                && other.statistic == "p99"
                && other.source == row.source
                && other.particles == row.particles
        });
        grid.push(vec![
            Shown::from(row.source.as_str()),
            Shown::from(row.particles.to_string().as_str()),
            Shown::from(row.value),
            worst.map_or_else(Shown::default, |worst| Shown::from(worst.value)),
        ]);
    }
    let head = ["stage", "particles", "median, ms", "99th percentile, ms"];
    Section {
        title: "Processor time per frame".to_owned(),
        paragraphs: vec![
            "One thread, 640 x 480; `fused` is the sum of its stages, `thesis` its two cues in the window and its filter; \
             neither has in it the registration of depth to the colours' pixels, which stands by itself. Single steps of \
             the thesis are with the copy of their picture, and the first of each way with cutting out the window."
                .to_owned(),
        ],
        tables: vec![Grid {
            caption: String::new(),
            head: head.map(str::to_owned).to_vec(),
            rows: grid,
        }],
        ..Section::default()
    }
}
