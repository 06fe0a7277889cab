//! Points as a table, and on one page.

use super::follow::{Follow, Row};
use crate::report::study::{Figure, Grid, Picture, Section, Series, Shown, StudyReport};
use crate::study::interval::quantile;
use std::fmt::Write as _;

/// What there is to show.
pub struct Watched<'a> {
    /// Head of the page.
    pub title: String,
    /// Names and values at the top.
    pub facts: Vec<(String, String)>,
    /// All that was found.
    pub follow: &'a Follow,
    /// Distances from the truth, pixels, by frame, where it is known.
    pub errors: Vec<(usize, f64)>,
    /// The filmstrip.
    pub film: Option<Picture>,
    /// What else is to be said.
    pub notes: Vec<String>,
}

/// The rows as CSV: pixels, square pixels, millimetres in the colour camera's frame; empty where nothing is known.
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
    if !watched.errors.is_empty() {
        let points = watched.errors.iter().map(|(frame, error)| [*frame as f64, *error]).collect();
        let squares: f64 = watched.errors.iter().map(|(_, error)| error * error).sum();
        let rmse = (squares / watched.errors.len() as f64).sqrt();
        sections.push(Section {
            title: "Against the truth".to_owned(),
            paragraphs: vec![format!(
                "RMSE {} px over {} frames.",
                Shown::from(rmse).text,
                watched.errors.len()
            )],
            figures: vec![Figure {
                title: "Distance from the truth".to_owned(),
                x: "frame".to_owned(),
                y: "px".to_owned(),
                series: vec![Series { name: "distance".to_owned(), points, ..Series::default() }],
                ..Figure::default()
            }],
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

fn latency(follow: &Follow) -> Section {
    let line = |(stage, times): (&&'static str, &Vec<f64>)| {
        let all: Vec<usize> = (0..times.len()).collect();
        let at = |share: f64| Shown::from(quantile(times, &all, share));
        vec![Shown::from(*stage), at(0.5), at(0.99), at(1.0)]
    };
    let head = ["stage", "median, ms", "99th percentile, ms", "longest, ms"];
    let silent =
        follow.silent.iter().map(|(source, count)| format!("{source} said nothing in {count} frames."));
    Section {
        title: "Processor time per frame and point".to_owned(),
        points: silent.collect(),
        tables: vec![Grid {
            caption: "Reading and registering the pictures is not in it.".to_owned(),
            head: head.map(str::to_owned).to_vec(),
            rows: follow.times.iter().map(line).collect(),
        }],
        ..Section::default()
    }
}
