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

    /// A statistic of the values that `value` gives for a clip and a frame, with its interval over draws of whole blocks.
    /// `None` where there is no value.
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

/// The thesis's curves of one clip: of every source the mean of the squared errors over the runs, divided frame by frame so
/// that the largest is 1 and the smallest 0, and the mean of that up to each frame. `squares[source][frame]`.
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

/// Frames after which a curve has settled by Welch's method (Law, Simulation Modeling and Analysis, section 9.5.1): the
/// mean over replications is smoothed by a moving average, and from the answer on it stays within `share` of its range
/// about the mean of its second half.
pub fn warm_up(replications: &[Vec<f64>], window: usize, share: f64) -> usize {
    let frames = replications.iter().map(Vec::len).min().unwrap_or(0);
    if frames == 0 {
        return 0;
    }
    let n = replications.len() as f64;
    let mean: Vec<f64> =
        (0..frames).map(|k| replications.iter().map(|run| run[k]).sum::<f64>() / n).collect();
    let smooth: Vec<f64> = (0..frames)
        .map(|k| {
            // Narrower towards both ends, so that it stays about its frame.
            let reach = window.min(k).min(frames - 1 - k);
            mean[k - reach..=k + reach].iter().sum::<f64>() / (2 * reach + 1) as f64
        })
        .collect();
    let half = &smooth[frames / 2..];
    let level = half.iter().sum::<f64>() / half.len() as f64;
    let (low, high) = smooth.iter().fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    let band = share * (high - low);
    smooth.iter().rposition(|v| (v - level).abs() > band).map_or(0, |last| last + 1)
}

/// The number of leading frames to leave out that makes the standard error of the mean of the rest least, in steps of five
/// (MSER-5; White, Cobb and Spratt 2000); at most half of them.
pub fn mser5(values: &[f64]) -> usize {
    let batches: Vec<f64> = values.chunks_exact(5).map(|five| five.iter().sum::<f64>() / 5.0).collect();
    let score = |from: usize| {
        let rest = &batches[from..];
        let n = rest.len() as f64;
        let mean = rest.iter().sum::<f64>() / n;
        rest.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * n)
    };
    let best =
        (0..=batches.len() / 2).filter(|&k| k < batches.len()).min_by(|&a, &b| score(a).total_cmp(&score(b)));
    5 * best.unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_are_those_of_their_names() {
        let distances = [3.0, 4.0, 0.0, 25.0];
        assert_eq!(Statistic::Rmse.of(&distances), (650.0_f64 / 4.0).sqrt());
        assert_eq!(Statistic::Median.of(&distances), 3.0);
        assert_eq!(Statistic::Quantile95.of(&distances), 25.0);
        assert_eq!(Statistic::ShareFar.of(&distances), 0.25);
        assert!(Statistic::Rmse.of(&[]).is_nan());
    }

    /// Blocks of equal errors: the interval is that of means of so many draws of blocks, wider than that of frames.
    #[test]
    fn intervals_are_over_blocks() {
        let blocks = Blocks::new(&[200, 195], Stream::new(1));
        let value = |clip: usize, frame: usize| Some(f64::from((clip + frame / BLOCK) % 2 == 0));
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

    /// A curve that falls for 20 frames and is level then.
    #[test]
    fn curves_settle_where_they_are_level() {
        let run: Vec<f64> = (0..100).map(|k| (20.0 - k as f64).max(0.0)).collect();
        let settled = warm_up(&[run.clone(), run.clone()], 5, 0.05);
        assert!((15..=25).contains(&settled), "{settled}");
        assert_eq!(mser5(&run), 20);
        assert_eq!((warm_up(&[], 5, 0.1), mser5(&[])), (0, 0));
        assert_eq!(warm_up(&[vec![1.0; 30]], 5, 0.05), 0);
    }
}
