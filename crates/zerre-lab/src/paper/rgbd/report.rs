//! The page.

use super::settings::{CALIBRATION_CLIPS, CHOSEN, CONDITIONS, SWEEP_RUNS};
use super::tables::{FRAMES, Results, Row};
use super::{ERRORS, SWEEPS};
use crate::report::study::{Figure, Grid, Section, Series, Shown, StudyReport};
use zerre_vision::rgbd::scene::{Condition, SCENES};

/// The sources in the order of the page, as far as they are there.
const SOURCES: [&str; 8] =
    ["device", "color", "depth", "fused", "thesis-color", "thesis-depth", "thesis", "operators"];

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end.
    pub(super) fn page(&self, interrupted: bool) -> StudyReport {
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
                "drawn clips of the same kind with seeds 1000 to 1007 (the cues' constants); the thesis's thresholds on \
                 calibration clips with seeds 9000 to 9002"
                    .to_owned(),
            ),
        ];
        let rows = self.rows();
        let mut sections = vec![verdict(&rows), how_to_read(interrupted)];
        if experiment.request.tables.contains(ERRORS) {
            sections.push(errors(&rows));
        }
        if experiment.request.tables.contains(SWEEPS) {
            sections.push(self.sweep(&rows));
        }
        sections.push(latency(&rows));
        StudyReport {
            title: "A hand in colour and depth: fusion of three sources".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }

    /// The thesis's chapter 5.
    fn sweep(&self, rows: &[Row]) -> Section {
        let counts: Vec<usize> = self.sweeps.keys().copied().collect();
        let series = |name: &str, source: &str| {
            let of = |n: &usize| {
                let there = |row: &&Row| {
                    row.particles == *n
                        && row.source == source
                        && row.metric == "rmse_px"
                        && row.frames == "all"
                };
                // The sweep's rows stand behind those of the conditions.
                rows.iter().rfind(there).map(|row| (*n as f64, row))
            };
            let found: Vec<(f64, &Row)> = counts.iter().filter_map(of).collect();
            Series {
                name: name.to_owned(),
                points: found.iter().map(|(n, row)| [*n, row.value]).collect(),
                band: found.iter().map(|(_, row)| [row.low, row.high]).collect(),
                dots: true,
                reference: false,
            }
        };
        let sizes = Figure {
            title: "Error against the number of particles".to_owned(),
            x: "particles".to_owned(),
            y: "RMSE, px".to_owned(),
            logarithmic: true,
            logarithmic_x: true,
            series: vec![series("the thesis's filter", "thesis"), series("sound filter", "fused")],
            ..Figure::default()
        };
        let mut figures = vec![sizes];
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
                        points: curve.iter().enumerate().map(|(k, v)| [(k + 1) as f64, *v]).collect(),
                        ..Series::default()
                    })
                    .collect(),
                ..Figure::default()
            });
        }
        let head =
            ["particles", "best: device", "colour", "depth", "filter", "warm-up", "MSER-5", "improvement"];
        let table = counts
            .iter()
            .map(|n| {
                let value = |source: &str, metric: &str| {
                    let there =
                        |row: &&Row| row.particles == *n && row.source == source && row.metric == metric;
                    rows.iter().rfind(there).map_or_else(Shown::default, |row| Shown::from(row.value))
                };
                let counted = |source: &str| value(source, "best_count");
                vec![
                    Shown::from(n.to_string().as_str()),
                    counted("device"),
                    counted("thesis-color"),
                    counted("thesis-depth"),
                    counted("thesis"),
                    value("thesis", "warm_up"),
                    value("thesis", "warm_up_mser5"),
                    value("thesis", "improvement"),
                ]
            })
            .collect();
        Section {
            title: "The thesis's chapter 5, on clips whose truth is known".to_owned(),
            paragraphs: vec![format!(
                "Against the mean of seven simulated operators, as the thesis has it; {SWEEP_RUNS} runs of its filter for \
                 each number of particles. Normalising each frame hides how large errors are: a source that is off by 3 px \
                 counts as the worst where the others are off by 1. More particles do not help it: three normal \
                 likelihoods of one width multiplied are the average of three places, however many particles there are."
            )],
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
            "One thread, 640 x 480, depth already registered; `fused` is the sum of its stages, `thesis` its two cues in the \
             window and its filter."
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
