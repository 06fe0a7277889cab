//! Errors of sources: as the thesis has them, and so that they can be read.

use crate::study::interval::{Bootstrap, Estimate, quantile};
use zerre::rng::Stream;

/// Distances of a source from the reference, frame by frame, pixels; `None` where it said nothing.
pub type Errors = Vec<Option<f64>>;

/// Frames that are drawn together: errors of neighbours are alike.
pub const BLOCK: usize = 10;
/// An error beyond which a source has lost the point, pixels.
pub const FAR: f64 = 20.0;

/// A statistic of distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Statistic {
    /// Root of the mean square.
    Rmse,
    /// The middle one.
    Median,
    /// What 95 of 100 do not exceed.
    Quantile95,
    /// Share beyond [`FAR`].
    ShareFar,
}

impl Statistic {
    /// All of them.
    pub const ALL: [Statistic; 4] =
        [Statistic::Rmse, Statistic::Median, Statistic::Quantile95, Statistic::ShareFar];

    /// Its name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Statistic::Rmse => "rmse_px",
            Statistic::Median => "median_px",
            Statistic::Quantile95 => "p95_px",
            Statistic::ShareFar => "share20",
        }
    }

    /// Of these distances; NaN of none.
    pub fn of(self, distances: &[f64]) -> f64 {
        let n = distances.len() as f64;
        let all: Vec<usize> = (0..distances.len()).collect();
        match self {
            Statistic::Rmse => (distances.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
            Statistic::Median => quantile(distances, &all, 0.5),
            Statistic::Quantile95 => quantile(distances, &all, 0.95),
            Statistic::ShareFar => distances.iter().filter(|d| **d > FAR).count() as f64 / n,
        }
    }
}

/// Frames of several clips in blocks, of which some are chosen.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Clip and frames.
    all: Vec<(usize, std::ops::Range<usize>)>,
    bootstrap: Bootstrap,
}

impl Blocks {
    /// Of clips of these numbers of frames.
    pub fn new(clips: &[usize], stream: Stream) -> Blocks {
        let cut = |(clip, &frames): (usize, &usize)| {
            (0..frames.div_ceil(BLOCK)).map(move |k| (clip, k * BLOCK..((k + 1) * BLOCK).min(frames)))
        };
        let all: Vec<_> = clips.iter().enumerate().flat_map(cut).collect();
        Blocks { bootstrap: Bootstrap::new(all.len(), stream), all }
    }

    /// A statistic of the values that `value` gives for a clip and a frame, with its interval over draws of
    /// whole blocks. `None` where there is no value.
    pub fn estimate<T>(
        &self,
        value: impl Fn(usize, usize) -> Option<T>,
        statistic: impl Fn(&[T]) -> f64,
    ) -> Option<Estimate>
    where
        T: Copy,
    {
        let values: Vec<Vec<T>> = (self.all.iter())
            .map(|(clip, frames)| frames.clone().filter_map(|frame| value(*clip, frame)).collect())
            .collect();
        self.bootstrap.estimate(|picked| {
            let drawn: Vec<T> = picked.iter().flat_map(|&k| values[k].iter().copied()).collect();
            statistic(&drawn)
        })
    }
}

/// The thesis's curves of one clip: of every source the mean of the squared errors over the runs, divided
/// frame by frame so that the largest is 1 and the smallest 0, and the mean of that up to each frame.
/// `squares[source][frame]`.
pub fn cumulative(squares: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let frames = squares.iter().map(Vec::len).min().unwrap_or(0);
    let mut curves = vec![Vec::with_capacity(frames); squares.len()];
    let mut sums = vec![0.0; squares.len()];
    for k in 0..frames {
        let here = squares.iter().map(|source| source[k]);
        let (low, high) = here.clone().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        for (s, value) in here.enumerate() {
            sums[s] += if high > low { (value - low) / (high - low) } else { 0.0 };
            curves[s].push(sums[s] / (k + 1) as f64);
        }
    }
    curves
}

/// In how many frames each source is nearest; where several are, each of them. `None` never is.
pub fn best_counts(errors: &[&Errors]) -> Vec<usize> {
    let frames = errors.iter().map(|source| source.len()).min().unwrap_or(0);
    let mut counts = vec![0; errors.len()];
    for k in 0..frames {
        let best = errors.iter().filter_map(|source| source[k]).fold(f64::INFINITY, f64::min);
        for (count, source) in counts.iter_mut().zip(errors) {
            *count += usize::from(source[k] == Some(best));
        }
    }
    counts
}

/// How far the mean of places is off by their scatter alone, root mean square in pixels: the standard error
/// of a mean, over both axes. `None` of fewer than two places.
pub fn mean_error(places: &[[f64; 2]]) -> Option<f64> {
    let n = places.len() as f64;
    let mean = [0, 1].map(|k| places.iter().map(|place| place[k]).sum::<f64>() / n);
    let squares = places.iter().map(|p| (p[0] - mean[0]).powi(2) + (p[1] - mean[1]).powi(2)).sum::<f64>();
    (places.len() > 1).then(|| (squares / (n * (n - 1.0))).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre::rng::Purpose;

    #[test]
    fn statistics_are_those_of_their_names() {
        let distances = [3.0, 4.0, 0.0, 25.0];
        assert_eq!(Statistic::Rmse.of(&distances), (650.0_f64 / 4.0).sqrt());
        assert_eq!(Statistic::Median.of(&distances), 3.0);
        assert_eq!(Statistic::Quantile95.of(&distances), 25.0);
        assert_eq!(Statistic::ShareFar.of(&distances), 0.25);
        assert!(Statistic::Rmse.of(&[]).is_nan());
    }

    /// Blocks of equal errors: the interval is that of means of so many draws of blocks, wider than that of
    /// frames.
    #[test]
    fn intervals_are_over_blocks() {
        let blocks = Blocks::new(&[200, 195], Stream::new(1));
        let value = |clip: usize, frame: usize| Some(f64::from((clip + frame / BLOCK).is_multiple_of(2)));
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let Estimate { value: share, low, high } = blocks.estimate(value, mean).unwrap();
        assert!((share - 0.5).abs() < 0.02);
        // 40 draws of 0 or 1 have a standard error of .079: an interval of 4 of them, give or take a quarter.
        assert!(((high - low) / (3.92 * 0.079) - 1.0).abs() < 0.25, "{low} {high}");
        assert!(blocks.estimate(|_, _| None::<f64>, mean).is_none());
    }

    #[test]
    fn curves_of_the_thesis_are_between_0_and_1() {
        let curves = cumulative(&[vec![1.0, 9.0], vec![3.0, 1.0], vec![2.0, 1.0]]);
        assert_eq!(curves, [vec![0.0, 0.5], vec![1.0, 0.5], vec![0.5, 0.25]]);
        assert_eq!(cumulative(&[vec![2.0], vec![2.0]]), [vec![0.0], vec![0.0]]);
    }

    #[test]
    fn the_best_are_counted() {
        let (a, b) = (vec![Some(1.0), None, Some(2.0)], vec![Some(3.0), Some(9.0), Some(2.0)]);
        assert_eq!(best_counts(&[&a, &b]), [2, 2]);
    }

    /// The mean of n normal draws of standard deviation s is off by s sqrt(2 / n) in the plane.
    #[test]
    fn the_mean_error_is_that_of_the_mean() {
        assert_eq!(mean_error(&[[0.0, 0.0], [2.0, 0.0]]), Some(1.0));
        assert_eq!((mean_error(&[[1.0, 1.0]]), mean_error(&[])), (None, None));
        let (mut said, mut true_squares) = (0.0, 0.0);
        for job in 0..2000 {
            let mut draws = Stream::new(3).draws(Purpose::Other, job, 0);
            let marks: Vec<[f64; 2]> = (0..7).map(|_| [3.0 * draws.normal(), 3.0 * draws.normal()]).collect();
            said += mean_error(&marks).unwrap().powi(2) / 2000.0;
            let mean = [0, 1].map(|k| marks.iter().map(|m| m[k]).sum::<f64>() / 7.0);
            true_squares += (mean[0].powi(2) + mean[1].powi(2)) / 2000.0;
        }
        // Expected 18 / 7; of 2000 jobs the standard error is 0.9 % and 2.2 %: five of them.
        assert!((said * 7.0 / 18.0 - 1.0).abs() < 0.045, "{said}");
        assert!((true_squares * 7.0 / 18.0 - 1.0).abs() < 0.11, "{true_squares}");
    }
}
