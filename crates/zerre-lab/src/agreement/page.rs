//! The agreement of a job on one page.

use super::{Agreement, Job};
use crate::number;
use crate::report::study::{Figure, Grid, Mark, Section, Series, Shown, StudyReport};

/// Frames to look at again that the page lists; all are in the table beside it.
const LISTED: usize = 40;

/// The page, still without its command line and digest.
pub fn page(title: String, facts: Vec<(String, String)>, job: &Job, agreements: &[Agreement]) -> StudyReport {
    let mut sections: Vec<Section> = Vec::new();
    for (point, agreement) in job.points.iter().zip(agreements) {
        sections.push(of_point(point, job, agreement));
    }
    sections.push(Section {
        title: "How to read this".to_owned(),
        points: [
            "The reference of a frame is the geometric median of the marks; an operator is compared with the reference \
             of the others only. Bias is the mean of mark less reference with a 95 % interval, spread the standard \
             deviation about it, both in pixels.",
            "se is the standard error of the reference along an axis, from the mean distance of the marks and the \
             asymptotic efficiency of the median. No error of a tracker below it can be measured. What all operators \
             have in common is in no standard error.",
            "ICC(A,1) is the share of a mark's variance that is the object's and not the operator's. An object that \
             moves far makes it almost 1 whatever the operators do: look at the deviation in pixels.",
            "A frame is to be looked at again where a mark is further from the others than all marks of a job without \
             slips would be in 95 of 100 jobs, or where operators disagree whether the point can be seen.",
        ]
        .map(str::to_owned)
        .to_vec(),
        ..Section::default()
    });
    StudyReport { title, facts, sections, ..StudyReport::default() }
}

fn of_point(point: &str, job: &Job, agreement: &Agreement) -> Section {
    let mut paragraphs = Vec::new();
    let px = |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), |v| format!("{} px", number(v)));
    let axis = |pair: Option<[f64; 2]>, k: usize| px(pair.map(|pair| pair[k]));
    paragraphs.push(format!(
        "Deviation between operators: {} across, {} down. Standard error of the reference: {} (root mean square over \
         frames).",
        axis(agreement.deviation, 0),
        axis(agreement.deviation, 1),
        px(agreement.floor)
    ));
    if job.operators.len() < 2 {
        paragraphs.push("One operator alone agrees with nobody: there is nothing to compare.".to_owned());
    }
    let [raters, frames] = agreement.correlated;
    let correlation = Grid {
        caption: format!("ICC(A,1) of {raters} operators in the {frames} frames that all of them marked"),
        head: ["axis", "ICC(A,1), 95 % interval"].map(str::to_owned).to_vec(),
        rows: ["across", "down"]
            .into_iter()
            .zip(agreement.correlation)
            .map(|(name, icc)| vec![name.into(), icc.into()])
            .collect(),
    };
    Section {
        title: format!("Point {point}"),
        paragraphs,
        figures: figures(job, agreement),
        tables: vec![operators(job, agreement), correlation, again(job, agreement)],
        ..Section::default()
    }
}

fn operators(job: &Job, agreement: &Agreement) -> Grid {
    let rows = job.operators.iter().zip(&agreement.operators).map(|(who, operator)| {
        let bias = |axis: usize| Shown::from(operator.bias.map(|bias| bias[axis]));
        let spread = |axis: usize| Shown::from(operator.spread.map(|spread| spread[axis]));
        let distance = |at: usize| Shown::from(operator.distance.map(|distance| distance[at]));
        let count = |count: usize| Shown::from(count.to_string().as_str());
        vec![
            who.as_str().into(),
            count(operator.answered),
            count(operator.compared),
            bias(0),
            bias(1),
            spread(0),
            spread(1),
            distance(0),
            distance(1),
            distance(2),
            operator.same_visibility.into(),
        ]
    });
    Grid {
        caption: "Operators against the reference of the others, px".to_owned(),
        head: [
            "operator",
            "answers",
            "compared",
            "bias x",
            "bias y",
            "spread x",
            "spread y",
            "mean distance",
            "median",
            "95th percentile",
            "same visibility",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: rows.collect(),
    }
}

fn again(job: &Job, agreement: &Agreement) -> Grid {
    let limit = agreement.limit.map_or_else(String::new, |limit| format!(" (beyond {} px)", number(limit)));
    let total = agreement.again.len();
    let caption = match total {
        0 => "Frames to look at again: none".to_owned(),
        _ if total > LISTED => {
            format!("Frames to look at again{limit}: the first {LISTED} of {total}, all are in again.csv")
        }
        _ => format!("Frames to look at again{limit}"),
    };
    let rows = agreement.again.iter().take(LISTED).map(|again| {
        let name = job.frames.get(again.frame).map_or("", String::as_str);
        let who = again.far.and_then(|(_, k)| job.operators.get(k)).map_or("–", String::as_str);
        let [seen, hidden] = again.split;
        let split =
            if seen + hidden > 0 { format!("{seen} see it, {hidden} do not") } else { "–".to_owned() };
        vec![name.into(), again.far.map(|(far, _)| far).into(), who.into(), split.as_str().into()]
    });
    Grid {
        caption,
        head: ["frame", "largest distance (px)", "operator", "visible?"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
    }
}

fn figures(job: &Job, agreement: &Agreement) -> Vec<Figure> {
    let last = job.frames.len().saturating_sub(1) as f64;
    let line = |name: &str, values: &mut dyn Iterator<Item = Option<f64>>| Series {
        name: name.to_owned(),
        points: values.enumerate().map(|(k, v)| [k as f64, v.unwrap_or(f64::NAN)]).collect(),
        ..Series::default()
    };
    let mut series: Vec<Series> = job
        .operators
        .iter()
        .zip(&agreement.distances)
        .map(|(who, distances)| line(who, &mut distances.iter().copied()))
        .collect();
    series.extend(agreement.limit.map(|limit| Series {
        name: "look again".to_owned(),
        points: vec![[0.0, limit], [last, limit]],
        reference: true,
        ..Series::default()
    }));
    let figure = |title: &str, y: &str, series: Vec<Series>| Figure {
        title: title.to_owned(),
        x: "frame".to_owned(),
        y: y.to_owned(),
        series,
        ..Figure::default()
    };
    let errors = agreement.reference.iter().map(|r| r.as_ref().and_then(|r| r.error));
    let mut figures = vec![
        figure("Distance from the others", "px", series),
        figure("Standard error of the reference", "px", vec![line("se", &mut errors.into_iter())]),
    ];
    let marks: Vec<Mark> = job
        .operators
        .iter()
        .zip(&agreement.operators)
        .filter_map(|(who, operator)| {
            let at = operator.bias?.map(|bias| bias.value);
            // Down is down, as in the pictures.
            Some(Mark { at: [at[0], -at[1]], name: who.clone(), labelled: true })
        })
        .collect();
    if !marks.is_empty() {
        let origin = Series { points: vec![[0.0; 2]], dots: true, reference: true, ..Series::default() };
        figures.push(Figure {
            title: "Bias of each operator".to_owned(),
            x: "to the right, px".to_owned(),
            y: "upwards, px".to_owned(),
            map: true,
            series: vec![Series { name: "no bias".to_owned(), ..origin }],
            marks,
            ..Figure::default()
        });
    }
    figures
}
