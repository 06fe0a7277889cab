//! Tables of a labelling job for machines.

use super::{Agreement, Answer};
use crate::study::interval::Estimate;
use crate::study::table::{Entry, Table};

/// A labelling job: who marked what where.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Names of the frames.
    pub frames: Vec<String>,
    /// Names of the points.
    pub points: Vec<String>,
    /// Names of the operators.
    pub operators: Vec<String>,
    /// Answers by point, then by operator, then by frame.
    pub answers: Vec<Vec<Vec<Option<Answer>>>>,
}

impl Job {
    /// The same without operators who have answered nothing.
    #[must_use]
    pub fn of_those_who_answered(&self) -> Job {
        let has = |k: usize| self.answers.iter().any(|point| point[k].iter().any(Option::is_some));
        let kept: Vec<usize> = (0..self.operators.len()).filter(|k| has(*k)).collect();
        Job {
            frames: self.frames.clone(),
            points: self.points.clone(),
            operators: kept.iter().map(|k| self.operators[*k].clone()).collect(),
            answers: self
                .answers
                .iter()
                .map(|point| kept.iter().map(|k| point[*k].clone()).collect())
                .collect(),
        }
    }

    /// Every answer, by frame, operator and point: `frame,operator,point,x,y,visible`.
    pub fn labels(&self) -> Table {
        let mut rows = Vec::new();
        for (frame, name) in self.frames.iter().enumerate() {
            for (operator, who) in self.operators.iter().enumerate() {
                for (point, what) in self.points.iter().enumerate() {
                    let Some(answer) = self.answers[point][operator][frame] else { continue };
                    let place = answer.place();
                    let mut row: Vec<Entry> =
                        vec![name.as_str().into(), who.as_str().into(), what.as_str().into()];
                    row.extend(pair(place));
                    row.push(usize::from(place.is_some()).into());
                    rows.push(row);
                }
            }
        }
        let about = "Every answer of every operator; px, visible 1 or 0";
        Table::new("labels", about, &["frame", "operator", "point", "x", "y", "visible"], rows)
    }

    /// The reference by frame and point: `frame,point,x,y,se,operators`. A frame that nobody has answered has
    /// no row; one in which the point is not visible has no place.
    pub fn reference(&self, agreements: &[Agreement]) -> Table {
        let mut rows = Vec::new();
        for (frame, name) in self.frames.iter().enumerate() {
            for (point, agreement) in self.points.iter().zip(agreements) {
                let Some(found) = agreement.reference.get(frame).copied().flatten() else { continue };
                let mut row: Vec<Entry> = vec![name.as_str().into(), point.as_str().into()];
                row.extend(pair(found.place));
                row.extend([found.error.into(), found.seen.into()]);
                rows.push(row);
            }
        }
        let about = "Geometric median of the marks with its standard error along an axis, px, and how many marks it is of";
        Table::new("reference", about, &["frame", "point", "x", "y", "se", "operators"], rows)
    }

    /// Frames to look at again, point by point, the worst first.
    pub fn again(&self, agreements: &[Agreement]) -> Table {
        let mut rows = Vec::new();
        for (point, agreement) in self.points.iter().zip(agreements) {
            for again in &agreement.again {
                let who = again.far.and_then(|(_, operator)| self.operators.get(operator));
                rows.push(vec![
                    self.frames.get(again.frame).map_or(Entry::Missing, |name| name.as_str().into()),
                    point.as_str().into(),
                    again.far.map(|(far, _)| far).into(),
                    who.map_or(Entry::Missing, |who| who.as_str().into()),
                    again.split[0].into(),
                    again.split[1].into(),
                ]);
            }
        }
        let head = ["frame", "point", "distance_px", "operator", "visible", "not_visible"];
        Table::new("again", "Frames in which operators differ, the worst first", &head, rows)
    }
}

fn pair(place: Option<[f64; 2]>) -> [Entry; 2] {
    [0, 1].map(|k| place.map(|place| place[k]).into())
}

/// All statistics in long form: `point,operator,statistic,value,low,high`; without an operator they are of
/// all.
pub fn statistics(job: &Job, agreements: &[Agreement]) -> Table {
    let mut rows = Vec::new();
    for (point, agreement) in job.points.iter().zip(agreements) {
        let mut add = |who: &str, statistic: &str, value: Entry, ends: Option<[f64; 2]>| {
            let [low, high] = [0, 1].map(|k| ends.map(|ends| ends[k]).into());
            rows.push(vec![point.as_str().into(), who.into(), statistic.into(), value, low, high]);
        };
        let estimate = |e: Option<Estimate>| (e.map(|e| e.value).into(), e.map(|e| [e.low, e.high]));
        for (who, operator) in job.operators.iter().zip(&agreement.operators) {
            add(who, "answered", operator.answered.into(), None);
            add(who, "visible", operator.seen.into(), None);
            add(who, "compared", operator.compared.into(), None);
            for (axis, name) in ["x", "y"].into_iter().enumerate() {
                let (value, ends) = estimate(operator.bias.map(|bias| bias[axis]));
                add(who, &format!("bias_{name}_px"), value, ends);
                let spread = operator.spread.map(|spread| spread[axis]);
                add(who, &format!("spread_{name}_px"), spread.into(), None);
            }
            for (at, name) in ["mean", "median", "p95"].into_iter().enumerate() {
                let distance = operator.distance.map(|distance| distance[at]);
                add(who, &format!("distance_{name}_px"), distance.into(), None);
            }
            add(who, "same_visibility", operator.same_visibility.into(), None);
        }
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            let (value, ends) = estimate(agreement.correlation[axis]);
            add("", &format!("icc_{name}"), value, ends);
            let deviation = agreement.deviation.map(|deviation| deviation[axis]);
            add("", &format!("deviation_{name}_px"), deviation.into(), None);
        }
        add("", "icc_operators", agreement.correlated[0].into(), None);
        add("", "icc_frames", agreement.correlated[1].into(), None);
        add("", "reference_se_px", agreement.floor.into(), None);
        add("", "limit_px", agreement.limit.into(), None);
    }
    let head = ["point", "operator", "statistic", "value", "low", "high"];
    Table::new("agreement", "How well the operators agree; low and high are a 95 % interval", &head, rows)
}
