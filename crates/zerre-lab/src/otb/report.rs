//! Tables and the page.

use super::score::PRECISION_THRESHOLDS;
use super::summary::{Line, Row, lines, rows};
use super::{Cell, Doubts, LOST_FRAMES, OFF_OBJECT, Otb, Outcome, Protocol, boxes_csv};
use crate::report::study::{Figure, Grid, Section, Series, Shown, StudyReport};
use crate::study::experiment::{Finished, Mishap};
use crate::study::interval::Estimate;
use crate::study::table::{Entry, Table};
use std::collections::BTreeMap;

/// What the outcomes say.
pub fn finish(otb: &Otb, outcomes: &BTreeMap<Cell, Outcome>) -> Finished<Row> {
    let rows = rows(otb, outcomes);
    let lines = lines(&rows);
    let mut files = Vec::new();
    let mut estimates = Vec::new();
    for (cell, outcome) in outcomes {
        if let Some(scores) = &outcome.scores {
            estimates.extend([scores.square_errors, scores.overlaps]);
        }
        estimates.extend(outcome.estimates.iter().flat_map(|estimate| {
            let [[xx, xy], [_, yy]] = estimate.covariance;
            let bounds = estimate.bounds;
            [bounds.x, bounds.y, bounds.width, bounds.height, xx, xy, yy, estimate.p_lost]
        }));
        if !outcome.estimates.is_empty() {
            let name = |text: &str| text.replace(|c: char| !(c.is_alphanumeric() || "-_.".contains(c)), "_");
            let (sequence, tracker) = (&otb.sequences[cell.sequence].name, otb.trackers[cell.tracker].name);
            let file = format!("boxes-{}-{}.csv", name(tracker), name(sequence));
            files.push((file, boxes_csv(&outcome.estimates, cell.start.frame).into_bytes()));
        }
    }
    let count = |which: &dyn Fn(&Outcome) -> usize| outcomes.values().map(which).sum();
    let mishaps = vec![
        Mishap {
            what: "frame that could not be read",
            action: "the box before stood",
            count: count(&|outcome| outcome.unread),
        },
        Mishap {
            what: "run that could not begin",
            action: "it is not scored",
            count: count(&|outcome| usize::from(outcome.scores.is_none())),
        },
        Mishap {
            what: "tracker gave up",
            action: "its last box stood to the end",
            count: count(&|outcome| usize::from(outcome.scores.is_some() && outcome.refusal.is_some())),
        },
    ];
    Finished {
        tables: vec![scores(&rows), summary(&lines)],
        files,
        page: page(otb, &rows, &lines, outcomes),
        mishaps,
        estimates,
        rows,
    }
}

fn scores(rows: &[Row]) -> Table {
    let head = [
        "sequence",
        "tracker",
        "protocol",
        "repeat",
        "frames",
        "rmse_px",
        "precision20",
        "success_auc",
        "iou",
        "coverage95",
        "lost_share",
        "fps",
    ];
    let entries = |row: &Row| {
        vec![
            row.sequence.clone().into(),
            row.tracker.clone().into(),
            row.protocol.name().into(),
            row.repeat.into(),
            row.frames.into(),
            row.rmse_px.into(),
            row.precision20.into(),
            row.success_auc.into(),
            row.iou.into(),
            row.coverage95.into(),
            row.lost_share.into(),
            row.fps.into(),
        ]
    };
    Table::new("scores", "one row per repetition", &head, rows.iter().map(entries).collect())
}

/// The head of a statistic with an interval.
const MEASURED: [&str; 5] = ["rmse_px", "precision20", "success_auc", "iou", "coverage95"];

fn measured(line: &Line) -> [Option<Estimate>; 5] {
    [line.rmse_px, line.precision20, line.success_auc, line.iou, line.coverage95]
}

fn summary(lines: &[Line]) -> Table {
    let mut head: Vec<String> =
        ["protocol", "sequence", "tracker", "sequences", "repeats"].map(str::to_owned).to_vec();
    head.extend(MEASURED.iter().flat_map(|name| ["", "_low", "_high"].map(|end| format!("{name}{end}"))));
    head.extend(["lost_share", "fps"].map(str::to_owned));
    let entries = |line: &Line| {
        let mut row: Vec<Entry> = vec![
            line.protocol.name().into(),
            line.sequence.as_deref().unwrap_or("all").into(),
            line.tracker.as_str().into(),
            line.sequences.into(),
            line.repeats.into(),
        ];
        for estimate in measured(line) {
            // A single repetition has no interval.
            let ends = estimate.filter(|_| line.repeats > 1);
            row.push(estimate.map(|e| e.value).into());
            row.extend([ends.map(|e| e.low), ends.map(|e| e.high)].map(Entry::from));
        }
        row.extend([Entry::from(line.lost_share), line.fps.into()]);
        row
    };
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let about = "means over repetitions with 95 % intervals; `all` is the mean over the sequences";
    Table::new("summary", about, &head, lines.iter().map(entries).collect())
}

fn shown(estimate: Option<Estimate>, repeats: usize) -> Shown {
    if repeats > 1 { estimate.into() } else { estimate.map(|e| e.value).into() }
}

fn page(otb: &Otb, rows: &[Row], lines: &[Line], outcomes: &BTreeMap<Cell, Outcome>) -> StudyReport {
    let frames: usize = otb.sequences.iter().map(|sequence| sequence.truth.len()).sum();
    let mut sections: Vec<Section> =
        Protocol::ALL.iter().filter_map(|protocol| of_protocol(*protocol, lines)).collect();
    sections.extend(doubts(rows));
    sections.push(how(otb, outcomes));
    StudyReport {
        title: "Trackers on annotated sequences".to_owned(),
        facts: vec![
            ("Sequences".to_owned(), format!("{}, {frames} frames", otb.sequences.len())),
            ("Repetitions".to_owned(), otb.repeats.to_string()),
            ("Seed".to_owned(), otb.seed.to_string()),
        ],
        sections,
        ..StudyReport::default()
    }
}

fn of_protocol(protocol: Protocol, lines: &[Line]) -> Option<Section> {
    let mut overall: Vec<&Line> =
        lines.iter().filter(|line| line.protocol == protocol && line.sequence.is_none()).collect();
    let auc = |line: &Line| line.success_auc.map_or(f64::NEG_INFINITY, |auc| auc.value);
    overall.sort_by(|a, b| auc(b).total_cmp(&auc(a)));
    overall.first()?;
    let (title, paragraph) = match protocol {
        Protocol::OnePass => {
            ("One-pass evaluation", "From the first annotated frame, with its box, to the end.")
        }
        Protocol::Temporal => (
            "Temporal robustness",
            "From up to 20 frames spread over the sequence, each with its box, to the end; all frames of all runs count \
             alike.",
        ),
        Protocol::Spatial => (
            "Spatial robustness",
            "From the first annotated frame with 12 wrong boxes: moved by a tenth of the size, one corner moved, scaled by \
             0.8 to 1.2; all frames of all runs count alike.",
        ),
    };
    type Curve = (f64, Vec<[f64; 2]>);
    let curve = |value: &dyn Fn(&Line) -> Curve| -> Vec<Series> {
        let series = |line: &&Line| {
            let (number, points) = value(line);
            Series { name: format!("{} [{number:.3}]", line.tracker), points, ..Series::default() }
        };
        overall.iter().map(series).collect()
    };
    let success = |line: &Line| {
        let last = line.success.len().saturating_sub(1).max(1) as f64;
        let points = line.success.iter().enumerate().map(|(k, share)| [k as f64 / last, *share]).collect();
        (line.success_auc.map_or(f64::NAN, |auc| auc.value), points)
    };
    let precision = |line: &Line| {
        let points = line.precision.iter().enumerate().map(|(k, share)| [k as f64, *share]).collect();
        (line.precision20.map_or(f64::NAN, |precision| precision.value), points)
    };
    let figures = vec![
        Figure {
            title: "Success [area under the curve]".to_owned(),
            x: "overlap above (intersection over union)".to_owned(),
            y: "share of frames".to_owned(),
            series: curve(&success),
            ..Figure::default()
        },
        Figure {
            title: "Precision [at 20 px]".to_owned(),
            x: format!("error of the centre up to (px, 0 to {})", PRECISION_THRESHOLDS - 1),
            y: "share of frames".to_owned(),
            series: curve(&precision),
            ..Figure::default()
        },
    ];
    let row = |line: &&Line| {
        let mut row: Vec<Shown> =
            vec![line.tracker.as_str().into(), line.sequences.to_string().as_str().into()];
        row.extend(measured(line).map(|estimate| shown(estimate, line.repeats)));
        row.extend([Shown::from(line.lost_share), line.fps.into()]);
        row
    };
    let head = [
        "tracker",
        "sequences",
        "RMSE of the centre (px)",
        "precision at 20 px",
        "success AUC",
        "IoU",
        "coverage of 95 % ellipse",
        "lost runs",
        "frames/s",
    ];
    let mut tables = vec![Grid {
        caption: "Mean over sequences, with 95 % intervals over repetitions where there are several"
            .to_owned(),
        head: head.map(str::to_owned).to_vec(),
        rows: overall.iter().map(row).collect(),
    }];
    type Value = fn(&Line) -> Option<Estimate>;
    let parts: [(&str, Value); 3] = [
        ("Success AUC", |line| line.success_auc),
        ("Precision at 20 px", |line| line.precision20),
        ("RMSE of the centre (px)", |line| line.rmse_px),
    ];
    for (caption, value) in parts {
        tables.push(by_sequence(caption, value, &overall, lines));
    }
    Some(Section {
        title: title.to_owned(),
        paragraphs: vec![paragraph.to_owned()],
        figures,
        tables,
        ..Section::default()
    })
}

/// Sequences down, trackers across.
fn by_sequence(
    caption: &str,
    value: fn(&Line) -> Option<Estimate>,
    overall: &[&Line],
    lines: &[Line],
) -> Grid {
    let protocol = overall[0].protocol;
    let mut sequences: Vec<&str> = Vec::new();
    for line in lines.iter().filter(|line| line.protocol == protocol) {
        sequences.extend(line.sequence.as_deref().filter(|name| !sequences.contains(name)));
    }
    let entry = |sequence: &str, tracker: &str| {
        let found = lines.iter().find(|line| {
            line.protocol == protocol && line.tracker == tracker && line.sequence.as_deref() == Some(sequence)
        });
        found.map_or_else(|| None::<f64>.into(), |line| shown(value(line), line.repeats))
    };
    let row = |sequence: &&str| {
        let cells = overall.iter().map(|line| entry(sequence, &line.tracker));
        std::iter::once(Shown::from(*sequence)).chain(cells).collect()
    };
    Grid {
        caption: caption.to_owned(),
        head: std::iter::once("sequence".to_owned())
            .chain(overall.iter().map(|line| line.tracker.clone()))
            .collect(),
        rows: sequences.iter().map(row).collect(),
    }
}

/// What trackers say of their own boxes; of one-pass runs.
fn doubts(rows: &[Row]) -> Option<Section> {
    let mut of: Vec<(&str, Doubts)> = Vec::new();
    for row in rows.iter().filter(|row| row.protocol == Protocol::OnePass) {
        match of.iter_mut().find(|(tracker, _)| *tracker == row.tracker) {
            Some((_, doubts)) => doubts.add(&row.doubts),
            None => of.push((&row.tracker, row.doubts.clone())),
        }
    }
    of.retain(|(_, doubts)| doubts.bins.iter().any(|(frames, ..)| *frames > 0));
    of.first()?;
    let filled = |doubts: &Doubts| {
        doubts.bins.into_iter().filter(|(frames, ..)| *frames > 0).map(|(frames, probabilities, off)| {
            (frames, probabilities / frames as f64, off as f64 / frames as f64)
        })
    };
    let mut series: Vec<Series> = of
        .iter()
        .map(|(tracker, doubts)| Series {
            name: (*tracker).to_owned(),
            points: filled(doubts).map(|(_, said, was)| [said, was]).collect(),
            ..Series::default()
        })
        .collect();
    let diagonal = vec![[0.0, 0.0], [1.0, 1.0]];
    series.push(Series { name: "exact".to_owned(), points: diagonal, reference: true, ..Series::default() });
    let reliability = of.iter().flat_map(|(tracker, doubts)| {
        filled(doubts).map(|(frames, said, was)| {
            vec![Shown::from(*tracker), frames.to_string().as_str().into(), said.into(), was.into()]
        })
    });
    let flags = of.iter().map(|(tracker, doubts)| {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let [precision, recall] = doubts.flag_precision_recall().map(finite);
        vec![Shown::from(*tracker), precision.into(), recall.into(), finite(doubts.coverage95()).into()]
    });
    let words = |head: &[&str]| head.iter().map(|name| (*name).to_owned()).collect();
    Some(Section {
        title: "Do the trackers know when they are wrong?".to_owned(),
        paragraphs: vec![format!(
            "All annotated frames behind the first one, of all repetitions. A box is off the object where its overlap with \
             the truth is at most {OFF_OBJECT}, and where the object is not to be seen."
        )],
        figures: vec![Figure {
            title: "Reliability of the probability of being lost".to_owned(),
            x: "probability, mean of each tenth".to_owned(),
            y: "share of frames off the object".to_owned(),
            series,
            ..Figure::default()
        }],
        tables: vec![
            Grid {
                caption: "Flag \"lost\": probability above one half".to_owned(),
                head: words(&["tracker", "precision", "recall", "coverage of 95 % ellipse without flag"]),
                rows: flags.collect(),
            },
            Grid {
                caption: "Probability of being lost".to_owned(),
                head: words(&["tracker", "frames", "mean probability", "share off the object"]),
                rows: reliability.collect(),
            },
        ],
        ..Section::default()
    })
}

fn how(otb: &Otb, outcomes: &BTreeMap<Cell, Outcome>) -> Section {
    let mut points = vec![
        "Frames without annotation are left out. The first annotated frame counts as exact, as in the benchmark: there \
         the tracker is put."
            .to_owned(),
        "Success counts overlaps strictly above each of 21 thresholds from 0 to 1, precision errors of the centre of at \
         most 0 to 50 px."
            .to_owned(),
        format!(
            "A run is lost when its overlap with the truth is at most {OFF_OBJECT} in each of the last {LOST_FRAMES} \
             annotated frames."
        ),
        "Frames per second are of the processor time of the tracker's thread: decoding and the start are not in it. Runs \
         side by side slow each other down; --threads 1 runs them one by one."
            .to_owned(),
        "Another program's boxes are scored in the one-pass evaluation only; a box that it does not give is a miss, and \
         is left out of its RMSE."
            .to_owned(),
    ];
    for sequence in &otb.sequences {
        points.extend(sequence.notes.iter().map(|note| format!("{}: {note}.", sequence.name)));
    }
    let mut refusals: Vec<&str> =
        outcomes.values().filter_map(|outcome| outcome.refusal.as_deref()).collect();
    refusals.sort_unstable();
    refusals.dedup();
    points.extend(refusals.into_iter().take(10).map(|refusal| format!("A run ended early: {refusal}.")));
    Section { title: "How it was done".to_owned(), points, ..Section::default() }
}
