//! Points as a table, and on one page.

use super::follow::{Clock, Follow, Row};
use crate::report::study::{Figure, Grid, Picture, Section, Series, Shown, StudyReport};
use std::fmt::Write as _;

/// What there is to show.
pub struct Watched<'a> {
    /// Head of the page.
    pub title: String,
    /// Names and values at the top.
    pub facts: Vec<(String, String)>,
    /// All that was found.
    pub follow: &'a Follow,
    /// Distances from the truth, where it is known.
    pub scores: Vec<Score>,
    /// What a source was learnt to be like: names of the columns, and a row per source.
    pub learnt: Option<Grid>,
    /// The filmstrip.
    pub film: Option<Picture>,
    /// What else is to be said.
    pub notes: Vec<String>,
}

/// How far a point was off.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Which point.
    pub joint: String,
    /// Distances from the truth, pixels, by frame.
    pub errors: Vec<(usize, f64)>,
    /// Standard error of the truth along an axis, pixels, where it is known.
    pub floor: Option<f64>,
    /// What is to be said of the truth, as sentences.
    pub about: String,
}

impl Score {
    /// Root of the mean square distance, pixels; `None` of no frames.
    pub fn rmse(&self) -> Option<f64> {
        let squares: f64 = self.errors.iter().map(|(_, error)| error * error).sum();
        (!self.errors.is_empty()).then(|| (squares / self.errors.len() as f64).sqrt())
    }
}

/// The rows as CSV: pixels, square pixels, millimetres in the colour camera's frame; empty where nothing is
/// known.
pub fn points_csv(follow: &Follow) -> String {
    let mut text = "frame,name,time_s,joint,x,y,var_x,var_y,cov_xy,x_mm,y_mm,z_mm,p_lost".to_owned();
    for source in follow.sources() {
        // Writing to a string cannot fail.
        let _ = write!(text, ",trust_{source}");
    }
    text.push('\n');
    let cell = |value: Option<f64>| {
        value.filter(|v| v.is_finite()).map_or_else(String::new, |value| format!("{value:?}"))
    };
    for row in &follow.rows {
        let ([x, y], [[xx, xy], [_, yy]]) = (row.at, row.covariance);
        let _ = write!(text, "{},{},{},{}", row.frame, row.name, row.time, row.joint);
        let mm = row.point_mm.map_or([None; 3], |point| point.map(Some));
        let known = [x, y, xx, yy, xy].map(Some).into_iter().chain(mm).chain([row.p_lost]);
        for value in known.chain(row.trust.iter().copied()) {
            let _ = write!(text, ",{}", cell(value));
        }
        text.push('\n');
    }
    text
}

/// The page, still without its command line and digest.
pub fn page(watched: Watched) -> StudyReport {
    let follow = watched.follow;
    let mut joints: Vec<&str> = follow.rows.iter().map(|row| row.joint.as_str()).collect();
    joints.sort_unstable();
    joints.dedup();
    let mut sections = Vec::new();
    if let Some(film) = watched.film {
        let words = "A cross at the posterior mean with its 95 % ellipse, red and dashed where the point is flagged as \
                     lost; dots are particles; the truth, where there is such, green.";
        sections.push(Section {
            title: "Film".to_owned(),
            paragraphs: vec![words.to_owned()],
            pictures: vec![film],
            ..Section::default()
        });
    }
    sections.extend(watched.scores.iter().filter_map(against));
    if let Some(grid) = watched.learnt {
        let words = "Standard deviations in pixels and millimetres where a source means the point, the probability that it \
                     means something else, and how far it is off on average.";
        sections.push(Section {
            title: "What was learnt of the sources".to_owned(),
            paragraphs: vec![words.to_owned()],
            tables: vec![grid],
            ..Section::default()
        });
    }
    for joint in joints {
        sections.push(of_joint(follow, joint));
    }
    sections.push(latency(follow));
    if !watched.notes.is_empty() {
        sections.push(Section {
            title: "What else there is to know".to_owned(),
            points: watched.notes,
            ..Section::default()
        });
    }
    StudyReport { title: watched.title, facts: watched.facts, sections, ..StudyReport::default() }
}

fn of_joint(follow: &Follow, joint: &str) -> Section {
    let rows: Vec<&Row> = follow.rows.iter().filter(|row| row.joint == joint).collect();
    let series = |name: &str, value: &dyn Fn(&Row) -> Option<f64>| Series {
        name: name.to_owned(),
        points: rows.iter().filter_map(|row| Some([row.frame as f64, value(row)?])).collect(),
        ..Series::default()
    };
    let figure = |title: &str, y: &str, series: Vec<Series>| Figure {
        title: title.to_owned(),
        x: "frame".to_owned(),
        y: y.to_owned(),
        series,
        ..Figure::default()
    };
    let mut figures = vec![
        figure("Place", "px", vec![series("x", &|row| Some(row.at[0])), series("y", &|row| Some(row.at[1]))]),
        figure(
            "Standard deviation",
            "px",
            vec![
                series("x", &|row| Some(row.covariance[0][0].max(0.0).sqrt())),
                series("y", &|row| Some(row.covariance[1][1].max(0.0).sqrt())),
            ],
        ),
    ];
    if rows.iter().any(|row| row.point_mm.is_some()) {
        let depth = series("z", &|row| row.point_mm.map(|point| point[2]));
        figures.push(figure("Depth", "mm", vec![depth]));
    }
    if rows.iter().any(|row| row.p_lost.is_some()) {
        let mut all = vec![series("hidden", &|row| row.p_lost)];
        for (k, source) in follow.sources().iter().enumerate() {
            all.push(series(source, &|row| row.trust.get(k).copied().flatten()));
        }
        figures.push(figure("Probability that it is hidden, and that a source is right", "", all));
    }
    let lost = rows.iter().filter(|row| row.p_lost.is_some_and(|p| p > 0.5)).count();
    Section {
        title: format!("Point {joint}"),
        paragraphs: vec![format!("{} frames, flagged as lost in {lost}.", rows.len())],
        figures,
        ..Section::default()
    }
}

/// The score of a point; `None` where no frame has a truth.
fn against(score: &Score) -> Option<Section> {
    let rmse = Shown::from(score.rmse()?).text;
    let points: Vec<[f64; 2]> = score.errors.iter().map(|(frame, error)| [*frame as f64, *error]).collect();
    let ends = [points.first(), points.last()].into_iter().flatten().map(|point| point[0]);
    // The squared distance between truth and reference has twice the square of the standard error as its
    // mean.
    let floor = score.floor.map(|floor| {
        let name = "what the reference itself is off".to_owned();
        let points = ends.map(|frame| [frame, std::f64::consts::SQRT_2 * floor]).collect();
        Series { name, points, ..Series::default() }
    });
    let distance = Series { name: "distance".to_owned(), points, ..Series::default() };
    Some(Section {
        title: format!("{} against the truth", score.joint),
        paragraphs: vec![format!("RMSE {rmse} px over {} frames. {}", score.errors.len(), score.about)],
        figures: vec![Figure {
            title: "Distance from the truth".to_owned(),
            x: "frame".to_owned(),
            y: "px".to_owned(),
            series: [distance].into_iter().chain(floor).collect(),
            ..Figure::default()
        }],
        ..Section::default()
    })
}

fn latency(follow: &Follow) -> Section {
    let line = |(stage, times): (&'static str, [f64; 3])| {
        [Shown::from(stage)].into_iter().chain(times.map(Shown::from)).collect()
    };
    let head = ["stage", "median, ms", "99th percentile, ms", "longest, ms"];
    let silent =
        follow.silent.iter().map(|(source, count)| format!("{source} said nothing in {count} frames."));
    let (title, caption) = match follow.clock() {
        Clock::Processor => {
            ("Processor time per frame and point", "Reading is with unpacking and registering.")
        }
        Clock::Wall => (
            "Latency per frame and point",
            "From a frame's arrival here on; what the camera and the way to here take is not in it.",
        ),
    };
    Section {
        title: title.to_owned(),
        points: silent.collect(),
        tables: vec![Grid {
            caption: caption.to_owned(),
            head: head.map(str::to_owned).to_vec(),
            rows: follow.latency().into_iter().map(line).collect(),
        }],
        ..Section::default()
    }
}
