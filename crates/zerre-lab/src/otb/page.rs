//! One video on one page.

use super::{Doubts, Followed, LOST_FRAMES, OFF_OBJECT, Scores};
use crate::report::study::{Figure, Grid, Picture, Section, Series, Shown, StudyReport};
use zerre_vision::Rect;
use zerre_vision::tracker::Estimate;

/// Most points of a line.
const POINTS: usize = 1500;

/// What there is to show.
pub struct Watched<'a> {
    /// Head of the page.
    pub title: String,
    /// Names and values at the top.
    pub facts: Vec<(String, String)>,
    /// What the tracker did.
    pub followed: &'a Followed,
    /// Number of the first frame.
    pub first: usize,
    /// Truth of each of its frames, as far as it is known.
    pub truth: &'a [Option<Rect>],
    /// The filmstrip.
    pub film: Option<Picture>,
    /// What else is to be said.
    pub notes: Vec<String>,
}

/// The page, still without its command line and digest.
pub fn page(watched: Watched) -> StudyReport {
    let estimates = &watched.followed.estimates;
    let every = estimates.len().div_ceil(POINTS).max(1);
    let mut sections = Vec::new();
    if let Some(film) = watched.film {
        let words = "Box orange, red and dashed when it is more likely lost than not; truth green and dashed; particles \
                     from dark to bright by weight; the number of the frame and the probability of being lost above.";
        let paragraphs = vec![words.to_owned()];
        sections.push(Section {
            title: "Film".to_owned(),
            paragraphs,
            pictures: vec![film],
            ..Section::default()
        });
    }
    // What is told of the first frame is not the tracker's own.
    let own = |value: &dyn Fn(&Estimate) -> f64| -> Vec<f64> {
        estimates.iter().enumerate().map(|(k, e)| if k > 0 { value(e) } else { f64::NAN }).collect()
    };
    let known = || estimates.iter().zip(watched.truth);
    let figure = |title: &str, y: &str, lines: Vec<(&str, Vec<f64>)>, level: Option<(f64, &str)>| {
        let line = |(name, values): (&str, Vec<f64>)| {
            let points = values.into_iter().enumerate().step_by(every);
            let points = points.map(|(k, value)| [(watched.first + k) as f64, value]).collect();
            Series { name: name.to_owned(), points, ..Series::default() }
        };
        let mut series: Vec<Series> = lines.into_iter().map(line).collect();
        series.extend(level.map(|(value, name)| {
            let ends = [watched.first, watched.first + estimates.len().saturating_sub(1)];
            let points = ends.map(|frame| [frame as f64, value]).to_vec();
            Series { name: name.to_owned(), points, reference: true, ..Series::default() }
        }));
        Figure {
            title: title.to_owned(),
            x: "frame".to_owned(),
            y: y.to_owned(),
            series,
            ..Figure::default()
        }
    };
    let deviation = |k: usize| own(&|e| e.covariance[k][k].sqrt());
    let mut figures = vec![
        figure(
            "Probability of being lost",
            "probability",
            vec![("lost", own(&|e| e.p_lost))],
            Some((0.5, "flag")),
        ),
        figure("Score", "score", vec![("score", own(&|e| e.score))], None),
        figure(
            "Standard deviation of the centre",
            "px",
            vec![("across", deviation(0)), ("down", deviation(1))],
            None,
        ),
    ];
    if watched.truth.iter().any(Option::is_some) {
        let against = |value: &dyn Fn(&Rect, &Rect) -> f64| -> Vec<f64> {
            known().map(|(e, truth)| truth.map_or(f64::NAN, |truth| value(&e.bounds, &truth))).collect()
        };
        let errors = against(&|found, truth| found.distance(truth));
        figures.push(figure("Error of the centre", "px", vec![("error", errors)], Some((20.0, "20 px"))));
        let overlaps = against(&|found, truth| found.iou(truth));
        let off = Some((OFF_OBJECT, "off the object"));
        figures.push(figure(
            "Overlap with the truth",
            "intersection over union",
            vec![("overlap", overlaps)],
            off,
        ));
    }
    sections.push(Section { title: "Over time".to_owned(), figures, ..Section::default() });
    sections.extend(against_truth(watched.followed, watched.truth));
    if !watched.notes.is_empty() {
        sections.push(Section { title: "Notes".to_owned(), points: watched.notes, ..Section::default() });
    }
    StudyReport { title: watched.title, facts: watched.facts, sections, ..StudyReport::default() }
}

/// Scores of a followed video against the truth of its frames; nothing where none is known.
pub fn scores(followed: &Followed, truth: &[Option<Rect>]) -> Option<(Scores, Doubts)> {
    let truth = &truth[..truth.len().min(followed.estimates.len())];
    truth.iter().any(Option::is_some).then(|| {
        let boxes: Vec<_> = followed.estimates.iter().map(|e| Some(e.bounds)).collect();
        (Scores::of(&boxes, truth), Doubts::of(&followed.estimates, truth))
    })
}

fn against_truth(followed: &Followed, truth: &[Option<Rect>]) -> Option<Section> {
    let (scores, doubts) = scores(followed, truth)?;
    let [precision, recall] = doubts.flag_precision_recall();
    let rows: [(&str, Shown); 8] = [
        ("annotated frames", scores.frames.to_string().as_str().into()),
        ("RMSE of the centre (px)", scores.rmse_px().into()),
        ("precision at 20 px", scores.precision20().into()),
        ("success AUC", scores.success_auc().into()),
        ("mean IoU", scores.iou().into()),
        ("coverage of the 95 % ellipse, without flag", doubts.coverage95().into()),
        ("flags \"lost\" that are right", precision.into()),
        ("frames off the object that are flagged", recall.into()),
    ];
    let lost = if scores.lost > 0 { "lost" } else { "not lost" };
    Some(Section {
        title: "Against the truth".to_owned(),
        paragraphs: vec![format!(
            "At its end the run is {lost}: so it is called when the overlap is at most {OFF_OBJECT} in each of the last \
             {LOST_FRAMES} annotated frames. The first frame counts as exact."
        )],
        tables: vec![Grid {
            caption: "Scores".to_owned(),
            head: vec!["score".to_owned(), "value".to_owned()],
            rows: rows.map(|(name, value)| vec![name.into(), value]).to_vec(),
        }],
        ..Section::default()
    })
}
