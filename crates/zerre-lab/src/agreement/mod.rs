//! How well several operators agree who marked the same points in the same frames, and what to take as the
//! reference.
//!
//! Places are pixels, x to the right and y downwards; pixel (x, y) covers [x, x + 1) by [y, y + 1). The
//! reference of a frame is the geometric median of those who see the point: one operator's slip moves it
//! little. An operator is compared with the reference of the others, so that nobody agrees with oneself.

mod correlation;
mod median;
mod page;
mod table;

pub use correlation::Variance;
pub use median::{geometric_median, radius95, standard_error};
pub use page::page;
pub use table::{Job, statistics};

use crate::study::interval::{Estimate, mean_interval, median as middle, quantile};
use median::distance;

/// What an operator says of a point in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// It is there, px.
    Seen([f64; 2]),
    /// It cannot be seen.
    Hidden,
}

impl Answer {
    /// Where it is seen.
    pub fn place(self) -> Option<[f64; 2]> {
        match self {
            Answer::Seen(place) => Some(place),
            Answer::Hidden => None,
        }
    }
}

/// The answers on one point: by operator, then by frame; `None` where an operator has not answered.
pub type Answers = [Vec<Option<Answer>>];

/// The reference of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Where the point is; `None` where more of those who answered do not see it than do.
    pub place: Option<[f64; 2]>,
    /// Standard error along an axis, px; `None` of fewer than two marks.
    pub error: Option<f64>,
    /// Operators who see the point.
    pub seen: usize,
    /// Operators who say that it cannot be seen.
    pub hidden: usize,
}

/// How an operator stands to the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Operator {
    /// Frames with an answer.
    pub answered: usize,
    /// Frames in which the point was marked.
    pub seen: usize,
    /// Frames with a mark of the operator and a reference of the others.
    pub compared: usize,
    /// Mean of mark less reference of the others along each axis, px, with its 95 % interval by Student's t.
    pub bias: Option<[Estimate; 2]>,
    /// Standard deviation of the same along each axis, px; it holds the noise of the others' reference, too.
    pub spread: Option<[f64; 2]>,
    /// Mean, median and 95th percentile of the distance, px.
    pub distance: Option<[f64; 3]>,
    /// Share of the frames with answers of others in which "visible or not" is what most of them say (a tie
    /// is agreement).
    pub same_visibility: Option<f64>,
}

/// A frame that somebody should look at again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Again {
    /// Number of the frame.
    pub frame: usize,
    /// Largest distance of a mark from the reference of the others, px, and whose it is; `None` where
    /// nobody's is beyond the limit.
    pub far: Option<(f64, usize)>,
    /// Operators who see the point and who do not, where they disagree; else zeros.
    pub split: [usize; 2],
}

/// Agreement on one point.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// Per frame; `None` where nobody has answered.
    pub reference: Vec<Option<Reference>>,
    /// Per operator.
    pub operators: Vec<Operator>,
    /// Distance of each operator's mark from the reference of the others, by operator, then by frame, px.
    pub distances: Vec<Vec<Option<f64>>>,
    /// ICC(A,1) along each axis with its 95 % interval.
    pub correlation: [Option<Estimate>; 2],
    /// Operators and frames that the correlation is of: operators with at least half as many marks as the
    /// busiest, frames that all of them have marked.
    pub correlated: [usize; 2],
    /// Standard deviation between operators within a frame along each axis, px: biases and noise together.
    pub deviation: Option<[f64; 2]>,
    /// Root of the mean square of the reference's standard errors, px: no error below it can be measured.
    pub floor: Option<f64>,
    /// Distance from the others beyond which a frame is to be looked at again, px.
    pub limit: Option<f64>,
    /// Frames to look at again, the worst first.
    pub again: Vec<Again>,
}

/// Probability that a job without a slip has any mark beyond [`Agreement::limit`], if distances are Rayleigh.
const FALSE_ALARM: f64 = 0.05;

/// Compares the operators. Frames are as many as the longest list has.
pub fn agreement(answers: &Answers) -> Agreement {
    let frames = answers.iter().map(Vec::len).max().unwrap_or(0);
    let at = |operator: usize, frame: usize| answers[operator].get(frame).copied().flatten();
    let others = |operator: usize, frame: usize| -> Vec<Answer> {
        (0..answers.len()).filter(|k| *k != operator).filter_map(|k| at(k, frame)).collect()
    };
    let all = |frame: usize| -> Vec<Answer> { (0..answers.len()).filter_map(|k| at(k, frame)).collect() };
    let reference: Vec<Option<Reference>> = (0..frames).map(|frame| refer(&all(frame))).collect();

    let mut distances = vec![vec![None; frames]; answers.len()];
    let mut operators = Vec::with_capacity(answers.len());
    for (operator, distances) in distances.iter_mut().enumerate() {
        let mut off: [Vec<f64>; 2] = Default::default();
        let (mut same, mut judged) = (0_usize, 0_usize);
        let own: Vec<Option<Answer>> = (0..frames).map(|frame| at(operator, frame)).collect();
        for (frame, answer) in own.iter().enumerate() {
            let (Some(answer), Some(rest)) = (answer, refer(&others(operator, frame))) else { continue };
            judged += 1;
            let fits = match answer {
                Answer::Seen(_) => rest.seen >= rest.hidden,
                Answer::Hidden => rest.hidden >= rest.seen,
            };
            same += usize::from(fits);
            if let (Some(mark), Some(place)) = (answer.place(), rest.place) {
                distances[frame] = Some(distance(mark, place));
                off.iter_mut().zip(mark.iter().zip(place)).for_each(|(off, (m, p))| off.push(m - p));
            }
        }
        let sizes: Vec<f64> = distances.iter().flatten().copied().collect();
        let picked: Vec<usize> = (0..sizes.len()).collect();
        let mean = mean_interval(&sizes).map(|mean| mean.value);
        operators.push(Operator {
            answered: own.iter().flatten().count(),
            seen: own.iter().flatten().filter(|answer| answer.place().is_some()).count(),
            compared: sizes.len(),
            bias: mean_interval(&off[0]).zip(mean_interval(&off[1])).map(|(x, y)| [x, y]),
            spread: deviation(&off[0]).zip(deviation(&off[1])).map(|(x, y)| [x, y]),
            distance: mean.map(|mean| [mean, middle(&sizes, &picked), quantile(&sizes, &picked, 0.95)]),
            same_visibility: (judged > 0).then(|| same as f64 / judged as f64),
        });
    }

    let full = full_table(answers, frames);
    let correlation = [0, 1].map(|axis| {
        let rows: Vec<Vec<f64>> =
            full.iter().map(|row| row.iter().map(|place| place[axis]).collect()).collect();
        Variance::of(&rows)?.absolute_agreement()
    });
    let errors: Vec<f64> = reference.iter().flatten().filter_map(|r| r.error).collect();
    let limit = limit(&distances);
    Agreement {
        correlation,
        correlated: [full.first().map_or(0, Vec::len), full.len()],
        deviation: within(answers, frames),
        floor: mean_interval(&errors.iter().map(|e| e * e).collect::<Vec<_>>()).map(|mean| mean.value.sqrt()),
        again: again(&reference, &distances, limit),
        limit,
        reference,
        operators,
        distances,
    }
}

/// The reference that these answers make; `None` of none.
fn refer(answers: &[Answer]) -> Option<Reference> {
    let marks: Vec<[f64; 2]> = answers.iter().filter_map(|answer| answer.place()).collect();
    let (seen, hidden) = (marks.len(), answers.len() - marks.len());
    if answers.is_empty() {
        return None;
    }
    let place = if seen >= hidden { geometric_median(&marks) } else { None };
    Some(Reference { place, error: place.and_then(|at| standard_error(&marks, at)), seen, hidden })
}

/// Sample standard deviation; `None` of fewer than two.
fn deviation(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.len() > 1).then(|| (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}

/// Marks of the busy operators in the frames that all of these have marked, frame by frame.
fn full_table(answers: &Answers, frames: usize) -> Vec<Vec<[f64; 2]>> {
    let mark = |list: &Vec<Option<Answer>>, frame: usize| list.get(frame).copied().flatten()?.place();
    let marks = |list: &Vec<Option<Answer>>| list.iter().flatten().filter_map(|a| a.place()).count();
    let most = answers.iter().map(marks).max().unwrap_or(0);
    let busy: Vec<_> = answers.iter().filter(|list| marks(list) > 0 && 2 * marks(list) >= most).collect();
    if busy.len() < 2 {
        return Vec::new();
    }
    (0..frames).filter_map(|frame| busy.iter().map(|list| mark(list, frame)).collect()).collect()
}

/// Pooled standard deviation of the marks of a frame about their mean, along each axis.
fn within(answers: &Answers, frames: usize) -> Option<[f64; 2]> {
    let (mut squares, mut freedom) = ([0.0; 2], 0.0);
    for frame in 0..frames {
        let marks: Vec<[f64; 2]> =
            answers.iter().filter_map(|list| list.get(frame).copied().flatten()?.place()).collect();
        if marks.len() < 2 {
            continue;
        }
        freedom += (marks.len() - 1) as f64;
        for (axis, squares) in squares.iter_mut().enumerate() {
            let mean = marks.iter().map(|m| m[axis]).sum::<f64>() / marks.len() as f64;
            *squares += marks.iter().map(|m| (m[axis] - mean).powi(2)).sum::<f64>();
        }
    }
    (freedom > 0.0).then(|| squares.map(|squares| (squares / freedom).sqrt()))
}

/// The distance that a job of Rayleigh distances of the same median exceeds anywhere with [`FALSE_ALARM`]:
/// the median of a Rayleigh law is s sqrt(2 ln 2), its tail exp(-d^2 / 2 s^2), and the m distances share the
/// alarm (Bonferroni). A pixel at least: nobody aims better.
fn limit(distances: &[Vec<Option<f64>>]) -> Option<f64> {
    let all: Vec<f64> = distances.iter().flatten().flatten().copied().collect();
    if all.is_empty() {
        return None;
    }
    let picked: Vec<usize> = (0..all.len()).collect();
    let scale = middle(&all, &picked) / (2.0 * 2f64.ln()).sqrt();
    Some((scale * (2.0 * (all.len() as f64 / FALSE_ALARM).ln()).sqrt()).max(1.0))
}

fn again(reference: &[Option<Reference>], distances: &[Vec<Option<f64>>], limit: Option<f64>) -> Vec<Again> {
    let mut found = Vec::new();
    for (frame, reference) in reference.iter().enumerate() {
        let Some(reference) = reference else { continue };
        let of_frame = distances.iter().enumerate().filter_map(|(k, list)| Some((list[frame]?, k)));
        let far = of_frame
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
            .filter(|(far, _)| limit.is_some_and(|limit| *far > limit));
        let divided = reference.seen > 0 && reference.hidden > 0;
        let split = if divided { [reference.seen, reference.hidden] } else { [0; 2] };
        if far.is_some() || divided {
            found.push(Again { frame, far, split });
        }
    }
    let badness = |a: &Again| (a.far.map_or(0.0, |(far, _)| far), a.split[0].min(a.split[1]));
    found.sort_by(|a, b| {
        let (x, y) = (badness(a), badness(b));
        y.0.total_cmp(&x.0).then(y.1.cmp(&x.1)).then(a.frame.cmp(&b.frame))
    });
    found
}

#[cfg(test)]
mod tests;
