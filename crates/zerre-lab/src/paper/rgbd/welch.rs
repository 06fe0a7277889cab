//! How long a curve of errors takes to settle.

/// Share of its range that a curve may leave its level by when it has settled, however well its mean is
/// known.
const SETTLED: f64 = 0.05;
/// A curve is smooth whose ups and downs add up to so many times its range at most: once down, and once up
/// and down.
const SMOOTH: f64 = 3.0;
/// Standard errors that a mean may be off by.
const ERRORS: f64 = 1.96;

/// What Welch's procedure says.
#[derive(Clone, Debug, PartialEq)]
pub struct Welch {
    /// Frames on both sides of the moving average.
    pub window: usize,
    /// Mean over the replications, of every frame.
    pub mean: Vec<f64>,
    /// Its moving average; shorter by `window`, as the book has it: the last frames have too few behind them.
    pub smooth: Vec<f64>,
    /// Mean of the second half of that.
    pub level: f64,
    /// What it may be off that.
    pub band: f64,
    /// Frames until it stays there; `None` where it does not do so in its first half, or cannot be told.
    pub settled: Option<usize>,
}

/// The moving average, narrower at the beginning so that it stays about its frame, without the last frames.
fn smoothed(values: &[f64], window: usize) -> Vec<f64> {
    let average = |k: usize| {
        let reach = window.min(k);
        values[k - reach..=k + reach].iter().sum::<f64>() / (2 * reach + 1) as f64
    };
    (0..values.len() - window).map(average).collect()
}

fn range(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    high - low
}

/// Welch's procedure (Law, Simulation Modeling and Analysis, section 9.5.1) on independent replications: the
/// mean over them is smoothed by a moving average, the narrowest with which it is smooth, of at most a
/// quarter of its frames. The book then looks where the curve is level. Here it is so from the frame on from
/// which it stays within the larger of 5 % of its range and 1.96 standard errors of its own, over the
/// replications, about the mean of its second half. `None` of fewer than eight frames.
pub fn welch(replications: &[&[f64]]) -> Option<Welch> {
    let frames = replications.iter().map(|one| one.len()).min().filter(|frames| *frames >= 8)?;
    let n = replications.len() as f64;
    let mean: Vec<f64> =
        (0..frames).map(|k| replications.iter().map(|one| one[k]).sum::<f64>() / n).collect();
    let is_smooth = |window: &usize| {
        let curve = smoothed(&mean, *window);
        curve.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>() <= SMOOTH * range(&curve)
    };
    let window = (1..frames / 4).find(is_smooth).unwrap_or(frames / 4);
    let smooth = smoothed(&mean, window);
    let half = smooth.len() / 2;
    let level = smooth[half..].iter().sum::<f64>() / (smooth.len() - half) as f64;
    let mut square = 0.0;
    if replications.len() > 1 {
        let curves: Vec<Vec<f64>> = replications.iter().map(|one| smoothed(&one[..frames], window)).collect();
        for k in half..smooth.len() {
            let off = curves.iter().map(|curve| (curve[k] - smooth[k]).powi(2)).sum::<f64>();
            square += off / (n * (n - 1.0) * (smooth.len() - half) as f64);
        }
    }
    let band = (SETTLED * range(&smooth)).max(ERRORS * square.sqrt());
    let settled = smooth.iter().rposition(|v| (v - level).abs() > band).map_or(0, |last| last + 1);
    Some(Welch { window, mean, smooth, level, band, settled: (settled <= half).then_some(settled) })
}

/// The number of leading frames to leave out that makes the standard error of the mean of the rest least, in
/// steps of five (MSER-5; White, Cobb and Spratt 2000); at most half of them.
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
    use zerre::rng::{Purpose, Stream};

    /// A curve that falls for 20 frames and is level then.
    #[test]
    fn curves_settle_where_they_are_level() {
        let run: Vec<f64> = (0..100).map(|k| (20.0 - k as f64).max(0.0)).collect();
        let found = welch(&[&run, &run]).unwrap();
        // Already smooth: the narrowest window is taken, and a twentieth of 20 is left one frame before.
        assert_eq!((found.window, found.settled), (1, Some(19)));
        assert_eq!(found.smooth.len(), 99);
        assert_eq!(mser5(&run), 20);
        assert_eq!((welch(&[]), mser5(&[])), (None, 0));
        assert_eq!(welch(&[&[1.0; 30]]).unwrap().settled, Some(0));
    }

    /// Errors that resemble their neighbours have no transient: what is left after smoothing is within what
    /// chance makes of five replications. A band by the range alone has such curves settle with their last
    /// frame.
    #[test]
    fn chance_is_not_taken_for_a_transient() {
        let settled = (0..20)
            .filter(|seed| {
                let runs: Vec<Vec<f64>> = (0..5)
                    .map(|run| {
                        let mut draws = Stream::new(*seed).draws(Purpose::Other, run, 0);
                        let mut value = draws.normal();
                        let mut next = || {
                            // Correlation 0.8 and variance 1.
                            value = 0.8 * value + 0.6 * draws.normal();
                            10.0 + value
                        };
                        (0..110).map(|_| next()).collect()
                    })
                    .collect();
                let runs: Vec<&[f64]> = runs.iter().map(Vec::as_slice).collect();
                welch(&runs).unwrap().settled.is_some()
            })
            .count();
        // The second half has some five independent stretches of 10 frames, each within the band with 95 % or
        // a little less (the errors are those of five runs): three quarters settle. Fewer than 9 of 20 have
        // less than 2 %.
        assert!(settled >= 9, "{settled}");
    }

    /// What grows to the end has not settled.
    #[test]
    fn what_never_settles_is_said_so() {
        let rising: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(welch(&[&rising, &rising]).unwrap().settled, None);
    }
}
