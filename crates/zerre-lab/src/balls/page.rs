//! Balls as a table, and on one page.

use super::score::BallScores;
use crate::report::study::{Figure, Grid, Picture, Section, Series, Shown, StudyReport};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use zerre_vision::balls::BallRow;

/// What there is to show.
pub struct Watched<'a> {
    /// Head of the page.
    pub title: String,
    /// Names and values at the top.
    pub facts: Vec<(String, String)>,
    /// All rows.
    pub rows: &'a [BallRow],
    /// Scores, where there is truth.
    pub scores: Option<BallScores>,
    /// The filmstrip.
    pub film: Option<Picture>,
    /// What else is to be said.
    pub notes: Vec<String>,
}

/// The rows as CSV: places and velocities in px and px per frame, variances in px^2, areas in px; empty where nothing
/// is known. Frames are from 0, balls from 1.
pub fn points_csv(rows: &[BallRow]) -> String {
    let mut text = "frame,ball,x,y,vx,vy,var_x,var_y,cov_xy,area,detected,detected_x,detected_y\n".to_owned();
    let cell = |value: f64| if value.is_finite() { format!("{value:?}") } else { String::new() };
    for BallRow { frame, ball, known, area, detected } in rows {
        let ([x, y], [u, v], [[xx, xy], [_, yy]]) = (known.centre, known.velocity, known.covariance);
        let [p, q] = detected.unwrap_or([f64::NAN; 2]);
        // Writing to a string cannot fail.
        let _ = write!(text, "{frame},{ball}");
        for value in [x, y, u, v, xx, yy, xy, *area] {
            let _ = write!(text, ",{}", cell(value));
        }
        let _ = writeln!(text, ",{},{},{}", u8::from(detected.is_some()), cell(p), cell(q));
    }
    text
}

/// The page, still without its command line and digest.
pub fn page(watched: Watched) -> StudyReport {
    let mut balls: BTreeMap<usize, Vec<&BallRow>> = BTreeMap::new();
    watched.rows.iter().for_each(|row| balls.entry(row.ball).or_default().push(row));
    let mut sections = Vec::new();
    if let Some(film) = watched.film {
        let words = "Rims solid where a ball was detected, dashed where it is only predicted; dots are particles; the \
                     truth, where there is such, thin and green.";
        sections.push(Section {
            title: "Film".to_owned(),
            paragraphs: vec![words.to_owned()],
            pictures: vec![film],
            ..Section::default()
        });
    }
    if let Some(scores) = watched.scores {
        let rows: [(&str, Shown); 6] = [
            ("frames with truth", scores.frames.to_string().as_str().into()),
            ("balls at least half visible, over frames", scores.visible.to_string().as_str().into()),
            ("of these held", scores.held.to_string().as_str().into()),
            ("identity swaps", scores.swaps.to_string().as_str().into()),
            ("RMSE of held balls (px)", scores.rmse_px.into()),
            ("mean GOSPA, cut-off 20 px (px)", scores.gospa_px.into()),
        ];
        sections.push(Section {
            title: "Against the truth".to_owned(),
            tables: vec![Grid {
                caption: "Scores".to_owned(),
                head: vec!["score".to_owned(), "value".to_owned()],
                rows: rows.map(|(name, value)| vec![name.into(), value]).to_vec(),
            }],
            ..Section::default()
        });
    }
    let line = |(number, rows): (&usize, &Vec<&BallRow>)| -> Option<Vec<Shown>> {
        let (first, last) = (rows.first()?, rows.last()?);
        let seen = rows.iter().filter(|row| row.detected.is_some()).count();
        let text = |count: usize| Shown::from(count.to_string().as_str());
        let area = rows.iter().rev().map(|row| row.area).find(|area| area.is_finite());
        Some(vec![text(*number), text(first.frame), text(last.frame), text(seen), area.into()])
    };
    let ways = |(number, rows): (&usize, &Vec<&BallRow>)| Series {
        name: format!("ball {number}"),
        points: rows.iter().map(|row| [row.known.centre[0], -row.known.centre[1]]).collect(),
        ..Series::default()
    };
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    watched.rows.iter().for_each(|row| *counts.entry(row.frame).or_default() += 1);
    let points = counts.iter().map(|(frame, count)| [*frame as f64, *count as f64]).collect();
    let figures = vec![
        Figure {
            title: "Ways".to_owned(),
            x: "x (px)".to_owned(),
            y: "-y (px)".to_owned(),
            map: true,
            series: balls.iter().map(ways).collect(),
            ..Figure::default()
        },
        Figure {
            title: "Balls that are followed".to_owned(),
            x: "frame".to_owned(),
            y: "balls".to_owned(),
            series: vec![Series { name: "balls".to_owned(), points, dots: true, ..Series::default() }],
            ..Figure::default()
        },
    ];
    let head = ["ball", "first frame", "last frame", "detected in", "area (px)"];
    sections.push(Section {
        title: "Balls".to_owned(),
        figures: if balls.is_empty() { Vec::new() } else { figures },
        tables: vec![Grid {
            caption: "From its first detection to its last".to_owned(),
            head: head.map(str::to_owned).to_vec(),
            rows: balls.iter().filter_map(line).collect(),
        }],
        ..Section::default()
    });
    if !watched.notes.is_empty() {
        sections.push(Section { title: "Notes".to_owned(), points: watched.notes, ..Section::default() });
    }
    StudyReport { title: watched.title, facts: watched.facts, sections, ..StudyReport::default() }
}
