//! What boxes are worth against an annotation, as the Object Tracking Benchmark counts it (Y. Wu, J. Lim,
//! M.-H. Yang, Object tracking benchmark, IEEE TPAMI 37(9), 1834-1848, 2015).

use serde::{Deserialize, Serialize};
use zerre_vision::Rect;
use zerre_vision::tracker::Estimate;

/// Thresholds of the centre's error: 0, 1, ..., 50 px; an error counts when it does not exceed its threshold.
pub const PRECISION_THRESHOLDS: usize = 51;
/// The threshold of the single number.
pub const PRECISION_AT: usize = 20;
/// Thresholds of the overlap: 0, 0.05, ..., 1; an overlap counts when it exceeds its threshold.
pub const SUCCESS_THRESHOLDS: usize = 21;
/// A box whose overlap with the truth does not exceed this is not on the object (the threshold of failure of
/// the VOT challenges since 2020).
pub const OFF_OBJECT: f64 = 0.1;
/// A run is lost when the box is not on the object in any of its last annotated frames, which are so many.
pub const LOST_FRAMES: usize = 10;
/// Squared Mahalanobis distance within which 95 % of a normal law of two dimensions lie: -2 ln 0.05.
const NINETY_FIVE: f64 = 5.991_464_547_107_979;
/// Bins of the probability of being lost.
const BINS: usize = 10;

/// Counts over annotated frames; those of several runs add up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Annotated frames.
    pub frames: usize,
    /// Those of them without a box: misses at every threshold, left out of the error of the centre.
    pub missed: usize,
    /// Sum of the squared distances of the centres, square pixels.
    pub square_errors: f64,
    /// Sum of the overlaps.
    pub overlaps: f64,
    /// Frames whose error does not exceed 0, 1, ..., 50 px.
    pub precise: Vec<usize>,
    /// Frames whose overlap exceeds 0, 0.05, ..., 1.
    pub successes: Vec<usize>,
    /// Runs behind these numbers, ...
    pub runs: usize,
    /// ... and those of them that were lost at their end.
    pub lost: usize,
}

impl Scores {
    /// Scores a run: `boxes` and `truth` side by side, from the first frame on. Frames without truth are left
    /// out. The first annotated frame counts as exact: there the tracker is put, by every protocol of the
    /// benchmark.
    pub fn of(boxes: &[Option<Rect>], truth: &[Option<Rect>]) -> Scores {
        let mut scores = Scores {
            precise: vec![0; PRECISION_THRESHOLDS],
            successes: vec![0; SUCCESS_THRESHOLDS],
            runs: 1,
            ..Scores::default()
        };
        let mut off = 0;
        for (at, truth) in truth.iter().enumerate().filter_map(|(at, truth)| Some((at, (*truth)?))) {
            let found = if scores.frames == 0 { Some(truth) } else { boxes.get(at).copied().flatten() };
            let overlap = found.map_or(0.0, |found| found.iou(&truth));
            scores.frames += 1;
            scores.overlaps += overlap;
            off = if overlap > OFF_OBJECT { 0 } else { off + 1 };
            for (k, count) in scores.successes.iter_mut().enumerate() {
                *count += usize::from(overlap > k as f64 / (SUCCESS_THRESHOLDS - 1) as f64);
            }
            let Some(found) = found else {
                scores.missed += 1;
                continue;
            };
            let error = found.distance(&truth);
            scores.square_errors += error * error;
            for (k, count) in scores.precise.iter_mut().enumerate() {
                *count += usize::from(error <= k as f64);
            }
        }
        scores.lost = usize::from(off >= LOST_FRAMES.min(scores.frames.saturating_sub(1)).max(1));
        scores
    }

    /// Adds the counts of other frames.
    pub fn add(&mut self, other: &Scores) {
        let sum = |into: &mut Vec<usize>, from: &[usize]| {
            into.resize(into.len().max(from.len()), 0);
            into.iter_mut().zip(from).for_each(|(into, from)| *into += from);
        };
        self.frames += other.frames;
        self.missed += other.missed;
        self.square_errors += other.square_errors;
        self.overlaps += other.overlaps;
        sum(&mut self.precise, &other.precise);
        sum(&mut self.successes, &other.successes);
        self.runs += other.runs;
        self.lost += other.lost;
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / self.frames as f64
    }

    /// Root mean square distance of the centres, px; NaN without a box.
    pub fn rmse_px(&self) -> f64 {
        (self.square_errors / (self.frames - self.missed) as f64).sqrt()
    }

    /// Mean overlap: intersection over union.
    pub fn iou(&self) -> f64 {
        self.overlaps / self.frames as f64
    }

    /// Share of frames whose centre is within each threshold.
    pub fn precision(&self) -> Vec<f64> {
        self.precise.iter().map(|count| self.share(*count)).collect()
    }

    /// Share of frames whose centre is within 20 px.
    pub fn precision20(&self) -> f64 {
        self.precise.get(PRECISION_AT).map_or(f64::NAN, |count| self.share(*count))
    }

    /// Share of frames whose overlap exceeds each threshold.
    pub fn success(&self) -> Vec<f64> {
        self.successes.iter().map(|count| self.share(*count)).collect()
    }

    /// Area under the success curve: its mean over the thresholds.
    pub fn success_auc(&self) -> f64 {
        let success = self.success();
        success.iter().sum::<f64>() / success.len() as f64
    }

    /// Share of the runs that were lost at their end.
    pub fn lost_share(&self) -> f64 {
        self.lost as f64 / self.runs as f64
    }
}

/// What a tracker's own doubts are worth. Counts; those of several runs add up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Doubts {
    /// Frames that were not flagged as lost, ...
    pub unflagged: usize,
    /// ... and those of them in which the truth's centre lies in the 95 % ellipse.
    pub covered: usize,
    /// For each tenth of the probability of being lost: frames, sum of the probabilities, frames off the
    /// object.
    pub bins: [(usize, f64, usize); BINS],
    /// Frames flagged as lost and off the object, flagged and on it, off it without a flag.
    pub flags: [usize; 3],
}

impl Doubts {
    /// Over the annotated frames behind the first one. Where no object is to be seen, no box is on it.
    pub fn of(estimates: &[Estimate], truth: &[Option<Rect>]) -> Doubts {
        let mut doubts = Doubts::default();
        let first = truth.iter().position(Option::is_some).unwrap_or(truth.len());
        for (estimate, truth) in estimates.iter().zip(truth).skip(first + 1) {
            let off = truth.is_none_or(|truth| estimate.bounds.iou(&truth) <= OFF_OBJECT);
            let bin = ((estimate.p_lost * BINS as f64) as usize).min(BINS - 1);
            let (frames, probabilities, lost) = &mut doubts.bins[bin];
            *frames += 1;
            *probabilities += estimate.p_lost;
            *lost += usize::from(off);
            match (estimate.is_lost(), off) {
                (true, true) => doubts.flags[0] += 1,
                (true, false) => doubts.flags[1] += 1,
                (false, true) => doubts.flags[2] += 1,
                (false, false) => (),
            }
            if let Some(truth) = truth.filter(|_| !estimate.is_lost()) {
                doubts.unflagged += 1;
                let within = mahalanobis(estimate, &truth).is_some_and(|d| d <= NINETY_FIVE);
                doubts.covered += usize::from(within);
            }
        }
        doubts
    }

    /// Adds the counts of other frames.
    pub fn add(&mut self, other: &Doubts) {
        self.unflagged += other.unflagged;
        self.covered += other.covered;
        for (into, from) in self.bins.iter_mut().zip(other.bins) {
            *into = (into.0 + from.0, into.1 + from.1, into.2 + from.2);
        }
        self.flags.iter_mut().zip(other.flags).for_each(|(into, from)| *into += from);
    }

    /// Share of the frames without a flag in which the 95 % ellipse covers the truth; NaN without such
    /// frames.
    pub fn coverage95(&self) -> f64 {
        self.covered as f64 / self.unflagged as f64
    }

    /// Share of the flags that are right, and share of the frames off the object that are flagged.
    pub fn flag_precision_recall(&self) -> [f64; 2] {
        let [right, wrong, missed] = self.flags.map(|count| count as f64);
        [right / (right + wrong), right / (right + missed)]
    }
}

/// Squared distance of the centres in terms of the covariance; `None` where that is not positive definite.
fn mahalanobis(estimate: &Estimate, truth: &Rect) -> Option<f64> {
    let [[a, b], [_, c]] = estimate.covariance;
    let determinant = a * c - b * b;
    let ([x, y], [u, v]) = (estimate.bounds.centre(), truth.centre());
    let (x, y) = (u - x, v - y);
    let distance = (c * x * x - 2.0 * b * x * y + a * y * y) / determinant;
    (a > 0.0 && determinant > 0.0 && distance.is_finite()).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, width: f64, height: f64) -> Option<Rect> {
        Some(Rect { x, y, width, height })
    }

    /// Frames: exact; 4 px to the right (error 4, overlap 6 x 10 / 140); 20 px off; without truth; without a
    /// box.
    #[test]
    fn scores_are_those_of_the_hand() {
        let truth = [at(0.0, 0.0, 10.0, 10.0), at(0.0, 0.0, 10.0, 10.0), at(5.0, 5.0, 10.0, 10.0), None];
        let truth = [&truth[..], &[at(5.0, 5.0, 10.0, 10.0)]].concat();
        // The first box is not looked at.
        let boxes =
            [None, at(4.0, 0.0, 10.0, 10.0), at(17.0, 21.0, 10.0, 10.0), at(0.0, 0.0, 9.0, 9.0), None];
        let scores = Scores::of(&boxes, &truth);
        assert_eq!((scores.frames, scores.missed), (4, 1));
        assert!((scores.rmse_px() - ((0.0 + 16.0 + 400.0) / 3.0_f64).sqrt()).abs() < 1e-12);
        let overlap = 60.0 / 140.0;
        assert!((scores.iou() - (1.0 + overlap) / 4.0).abs() < 1e-12);
        let precision = scores.precision();
        assert_eq!((precision[3], precision[4], precision[19], precision[20]), (0.25, 0.5, 0.5, 0.75));
        assert_eq!(scores.precision20(), 0.75);
        // 60 / 140 = 0.4286 exceeds the thresholds 0, 0.05, ..., 0.40, which are nine; 1 exceeds all but the
        // last.
        let success = scores.success();
        assert_eq!(
            (success[0], success[8], success[9], success[19], success[20]),
            (0.5, 0.5, 0.25, 0.25, 0.0)
        );
        assert!((scores.success_auc() - (9.0 + 20.0) / 4.0 / 21.0).abs() < 1e-12);
    }

    /// An overlap that equals its threshold does not count, an error that does so counts.
    #[test]
    fn thresholds_are_strict_for_overlaps_only() {
        let truth = [at(0.0, 0.0, 10.0, 10.0); 2];
        let scores = Scores::of(&[None, at(0.0, 0.0, 10.0, 5.0)], &truth);
        assert_eq!((scores.successes[9], scores.successes[10]), (2, 1));
        let scores = Scores::of(&[None, at(50.0, 0.0, 10.0, 10.0)], &truth);
        assert_eq!((scores.precise[49], scores.precise[50]), (1, 2));
    }

    #[test]
    fn a_run_is_lost_by_its_last_ten_frames() {
        let truth = vec![at(0.0, 0.0, 10.0, 10.0); 30];
        let away = |frames: std::ops::Range<usize>| -> Vec<Option<Rect>> {
            (0..30).map(|k| at(if frames.contains(&k) { 9.5 } else { 0.0 }, 0.0, 10.0, 10.0)).collect()
        };
        assert_eq!(Scores::of(&away(20..30), &truth).lost, 1);
        assert_eq!(Scores::of(&away(21..30), &truth).lost, 0);
        assert_eq!(Scores::of(&away(5..29), &truth).lost, 0);
        // Of three frames, the two behind the first one are all there are.
        assert_eq!(Scores::of(&away(1..3), &truth[..3]).lost, 1);
        assert_eq!(Scores::of(&away(0..0), &truth[..1]).lost, 0);
    }

    #[test]
    fn scores_of_runs_add_up() {
        let truth = vec![at(0.0, 0.0, 10.0, 10.0); 4];
        let run = |x: f64| Scores::of(&[at(x, 0.0, 10.0, 10.0); 4], &truth);
        let mut sum = Scores::default();
        sum.add(&run(3.0));
        sum.add(&run(30.0));
        assert_eq!((sum.frames, sum.runs, sum.lost), (8, 2, 1));
        assert_eq!(sum.precision20(), 5.0 / 8.0);
        assert_eq!(sum.lost_share(), 0.5);
        assert_eq!(sum.rmse_px(), ((3.0 * 9.0 + 3.0 * 900.0) / 8.0_f64).sqrt());
    }

    #[test]
    fn doubts_are_counted_against_the_truth() {
        let truth = [at(0.0, 0.0, 10.0, 10.0), at(0.0, 0.0, 10.0, 10.0), at(0.0, 0.0, 10.0, 10.0), None];
        let estimate = |x: f64, p_lost: f64| Estimate {
            bounds: Rect { x, y: 0.0, width: 10.0, height: 10.0 },
            covariance: [[4.0, 0.0], [0.0, 1.0]],
            score: 0.0,
            p_lost,
        };
        // 4.8 px are 2.4 standard deviations: 5.76, within 5.99; 5 px are 6.25.
        let doubts = |x: f64| {
            Doubts::of(
                &[estimate(50.0, 1.0), estimate(x, 0.02), estimate(0.0, 0.7), estimate(0.0, 1.0)],
                &truth,
            )
        };
        assert_eq!((doubts(4.8).unflagged, doubts(4.8).covered, doubts(5.0).covered), (1, 1, 0));
        assert_eq!(doubts(0.0).bins[0], (1, 0.02, 0));
        assert_eq!(doubts(20.0).bins[0], (1, 0.02, 1));
        assert_eq!((doubts(0.0).bins[7].0, doubts(0.0).bins[9]), (1, (1, 1.0, 1)));
        // Frame 3 is flagged and right there, frame 4 is flagged and gone, frame 2 is off without a flag.
        assert_eq!(doubts(20.0).flags, [1, 1, 1]);
        assert_eq!(doubts(20.0).flag_precision_recall(), [0.5, 0.5]);
    }
}
