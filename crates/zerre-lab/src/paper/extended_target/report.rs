//! The page.

use super::methods::{Estimate, METHODS};
use super::scenario::{ClutterModel, Record, near, truth};
use super::settings::{CLUTTER_SCANS, FAILED_CENTROID, FAILED_IOU, OUTLINE, RATE, SCANS};
use super::tables::{Results, is_pictured};
use super::{Cell, PAPER, printed};
use crate::metric::{Region, wilson_interval};
use crate::report::study::{Figure, Grid, Section, Series, Shown, StudyReport};
use crate::study::interval;
use std::error::Error;
use zerre::extended::Shape;

type Fallible<T> = Result<T, Box<dyn Error>>;

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end; `first` gives the first recording of a cell.
    ///
    /// # Errors
    /// None with the settings as they are.
    pub fn page(
        &self,
        seed: u64,
        interrupted: bool,
        first: &dyn Fn(&Cell) -> zerre::Result<Record>,
    ) -> Fallible<StudyReport> {
        let facts = [
            ("Runs per cell", self.request.runs.to_string()),
            ("Particles, where there are any", self.request.particles.to_string()),
            ("Seed", seed.to_string()),
            ("Data", "simulated here".to_owned()),
        ];
        let mut sections = vec![introduction(interrupted), self.chances()?];
        let asked = PAPER.tables.iter().filter(|table| self.request.tables.contains(**table));
        sections.extend(asked.map(|table| self.scores(table)));
        sections.push(self.pictures(first)?);
        Ok(StudyReport {
            title: "An extended target and its shape".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        })
    }

    /// How likely the printed run is.
    fn chances(&self) -> Fallible<Section> {
        let truth = truth()?;
        let printed = printed::errors(&truth)?;
        let paragraph = format!(
            "The paper prints the shape of a single run of {} scans. Its error is {:.3}, its mean Gauss-Wasserstein \
             distance {:.2} m, and its centre is {:.2} m off, which is taken off before. A run is as good where its shape \
             error is no larger. Shares of runs have 95 % intervals by Wilson.",
            SCANS[0],
            printed.extent,
            printed.gauss_wasserstein,
            printed.gauge[0].hypot(printed.gauge[1]),
        );
        let mut points = Vec::new();
        for cell in self.cells.iter().filter(|cell| cell.clutter == 0) {
            let runs = self.runs(cell);
            if !runs.iter().any(|run| run.shape_error.is_some()) {
                continue;
            }
            let good = runs.iter().filter(|run| self.is_as_good(run)).count();
            let (low, high) = wilson_interval(good, runs.len(), 0.95)?;
            points.push(format!(
                "{}, {} scans, start {}, {} points a scan: {good} of {} runs are as good as the printed one, {} % ({} to {} %).",
                cell.info().name,
                cell.scans,
                cell.start.name(),
                cell.rate,
                runs.len(),
                percent(good as f64 / runs.len() as f64),
                percent(low),
                percent(high),
            ));
        }
        Ok(Section {
            title: "How likely the printed numbers are".to_owned(),
            paragraphs: vec![paragraph],
            points,
            ..Section::default()
        })
    }

    /// A table.
    fn scores(&self, table: &str) -> Section {
        let head = [
            "method",
            "scans",
            "start",
            "clutter",
            "points a scan",
            "shape error",
            "GW (m)",
            "IoU",
            "failed runs",
            "centroid RMSE (m)",
            "MW (m)",
            "Hausdorff (m)",
            "as good as printed",
        ];
        let row = |cell: &Cell| {
            let clutter = match cell.model {
                ClutterModel::None => cell.clutter.to_string(),
                model => format!("{}, {}", cell.clutter, model.name()),
            };
            let names = [cell.info().name.to_owned(), cell.scans.to_string(), cell.start.name().to_owned()];
            let mut row: Vec<Shown> = names.iter().map(|name| Shown::from(name.as_str())).collect();
            row.extend([clutter, cell.rate.to_string()].iter().map(|name| Shown::from(name.as_str())));
            let metrics = [
                "shape_error",
                "gw",
                "iou",
                "fail",
                "centroid_rmse",
                "mixture_wasserstein",
                "hausdorff",
                "as_good",
            ];
            row.extend(metrics.map(|metric| shown(self.measured(cell, metric))));
            row
        };
        let (title, caption) = match table {
            "scene" => {
                ("The paper's scene", "Medians over runs, and shares of runs, with 95 % bootstrap intervals")
            }
            "clutter" => ("Clutter", "The same with clutter, told to the method or ignored by it"),
            _ => (
                "The other reading of the rate",
                "The same with so many points for each of the three ellipses",
            ),
        };
        let grid = Grid {
            caption: caption.to_owned(),
            head: head.map(str::to_owned).to_vec(),
            rows: self.of_table(table).iter().map(row).collect(),
        };
        Section { title: title.to_owned(), tables: vec![grid], ..Section::default() }
    }

    /// What the first run looks like.
    fn pictures(&self, first: &dyn Fn(&Cell) -> zerre::Result<Record>) -> Fallible<Section> {
        let mut figures = vec![compared(&truth()?, &near()?, &printed::estimate()?)];
        for (method, info) in METHODS.iter().enumerate() {
            let of = |scans: usize| {
                let wanted = |cell: &&Cell| cell.method == method && cell.scans == scans && is_pictured(cell);
                let cell = self.cells.iter().find(wanted)?;
                let estimates = &self.outcomes.get(cell)?.pictured;
                (!estimates.is_empty()).then_some((cell, estimates))
            };
            if let Some((cell, estimates)) = of(SCANS[0]) {
                figures.push(along_the_path(info.name, &first(cell)?, estimates)?);
            }
            if let Some((cell, estimates)) = of(CLUTTER_SCANS) {
                figures.push(learnt(info.name, &first(cell)?, estimates)?);
            }
        }
        let paragraph = format!(
            "Outlines are drawn at {OUTLINE} standard deviations. All pictures are of the first run, whatever it came to, \
             from the start near and with {RATE} points a scan."
        );
        Ok(Section {
            title: "Pictures".to_owned(),
            paragraphs: vec![paragraph],
            figures,
            ..Section::default()
        })
    }
}

/// The true shape, the first one and the printed estimate.
fn compared(truth: &Shape, near: &Shape, printed: &Shape) -> Figure {
    let of = |name: &str, shape: &Shape, reference: bool| Series {
        name: name.to_owned(),
        points: joined(&Region::of_shape(shape, [0.0; 2], OUTLINE)),
        reference,
        ..Series::default()
    };
    Figure {
        title: "Shapes about the centre: true, first, printed".to_owned(),
        x: "x (m)".to_owned(),
        y: "y (m)".to_owned(),
        map: true,
        series: vec![
            of("truth", truth, true),
            of("start near", near, false),
            of("printed estimate of the paper, offset included", printed, false),
        ],
        ..Figure::default()
    }
}

/// Points and outlines in their places.
fn along_the_path(name: &str, record: &Record, estimates: &[Estimate]) -> Fallible<Figure> {
    let truth = truth()?;
    let true_outlines =
        record.path.iter().flat_map(|x| joined(&Region::of_shape(&truth, [x[0], x[1]], OUTLINE)));
    let outlines = estimates.iter().flat_map(|e| joined(&e.region(OUTLINE, [0.0; 2])));
    let series = vec![
        Series {
            name: "points".to_owned(),
            points: record.scans.iter().flatten().copied().collect(),
            dots: true,
            ..Series::default()
        },
        Series {
            name: "true outlines".to_owned(),
            points: true_outlines.collect(),
            reference: true,
            ..Series::default()
        },
        Series { name: name.to_owned(), points: outlines.collect(), ..Series::default() },
        Series {
            name: "its centroid".to_owned(),
            points: estimates.iter().map(Estimate::centroid).collect(),
            ..Series::default()
        },
    ];
    Ok(Figure {
        title: format!("{name}: {} scans along the path", estimates.len()),
        x: "x (m)".to_owned(),
        y: "y (m)".to_owned(),
        map: true,
        series,
        ..Figure::default()
    })
}

/// The outline about the true centre, scan after scan.
fn learnt(name: &str, record: &Record, estimates: &[Estimate]) -> Fallible<Figure> {
    let places: Vec<[f64; 2]> = record.path.iter().map(|x| [x[0], x[1]]).collect();
    let points = places.iter().zip(&record.scans);
    let seen = points.map(|(at, scan)| scan.iter().map(|y| [y[0] - at[0], y[1] - at[1]]).collect());
    let outlines = places.iter().zip(estimates).map(|(at, e)| joined(&e.region(OUTLINE, *at)));
    let series = vec![
        Series {
            name: "points of the scan".to_owned(),
            frames: seen.collect(),
            dots: true,
            ..Series::default()
        },
        Series {
            name: "true outline".to_owned(),
            points: joined(&Region::of_shape(&truth()?, [0.0; 2], OUTLINE)),
            reference: true,
            ..Series::default()
        },
        Series { name: name.to_owned(), frames: outlines.collect(), ..Series::default() },
    ];
    Ok(Figure {
        title: format!("{name}: the shape as it is learnt, {} scans", estimates.len()),
        x: "x from the true centre (m)".to_owned(),
        y: "y (m)".to_owned(),
        map: true,
        series,
        ..Figure::default()
    })
}

/// The lines around a region as one, interrupted between its parts.
fn joined(region: &Region) -> Vec<[f64; 2]> {
    region.lines().into_iter().flat_map(|line| line.into_iter().chain([[f64::NAN; 2]])).collect()
}

fn introduction(interrupted: bool) -> Section {
    let mut paragraphs = vec![format!(
        "Every method sees the same recordings. The shape error is the mean over the ellipses of the error of an extent \
         relative to it (Frobenius), GW their mean Gauss-Wasserstein distance, both for the best assignment of ellipses \
         and with the common offset taken off, against which the centre moves unseen; methods with another number of \
         ellipses have neither. MW is the Wasserstein distance of the mixtures, IoU the intersection over union and \
         Hausdorff the distance of the outlines at {OUTLINE} standard deviations, all three in their places and after the \
         last scan. The centroid is the mean of a point; its error is taken over all scans. A run has failed where the \
         last IoU is below {FAILED_IOU}, where the last centroid is more than {FAILED_CENTROID} m off, or where the \
         method gave up."
    )];
    paragraphs.push(format!(
        "The start near is the paper's; data is made of the first scans alone; truth is the true shape. Where the paper \
         says {RATE} points a scan it can mean the target or each of its ellipses: the first reading is the main one."
    ));
    let methods = METHODS.iter().map(|method| format!("{}: {}.", method.name, method.about));
    if interrupted {
        paragraphs.push(
            "This run was stopped before its end: cells that are missing were not computed.".to_owned(),
        );
    }
    Section {
        title: "How to read this".to_owned(),
        paragraphs,
        points: methods.collect(),
        ..Section::default()
    }
}

fn shown(estimate: Option<interval::Estimate>) -> Shown {
    let Some(interval::Estimate { value, low, high }) = estimate else { return None.into() };
    let aside = format!("{} to {}", Shown::from(low).text, Shown::from(high).text);
    Shown { aside, ..Shown::from(value) }
}

fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent < 10.0 { format!("{percent:.1}") } else { format!("{percent:.0}") }
}
