//! What is known of sources, learnt from a clip on which people have marked the point.
//!
//! The cues are searched about the filter's own prediction, so they are as good as it is: the clip is gone through with
//! what is known so far, what the sources said is compared with the marks, and both are done again until it settles.

use super::Reading;
use super::fusion::Source;
use zerre::math::Real;

/// What a source said where the point was known to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Its readings.
    pub readings: Vec<Reading>,
    /// Where it looked, square pixels.
    pub area: f64,
    /// Where the point was, pixels.
    pub truth: [f64; 2],
    /// Its depth, millimetres, where known.
    pub truth_mm: Option<f64>,
}

/// Least standard deviation of a source, pixels: a clip of some hundred frames says no more.
const LEAST_SD: f64 = 0.5;
/// The same of its depth, millimetres.
const LEAST_DEPTH_SD: f64 = 5.0;
/// Prior counts of outliers and of others, so that no clip proves a source to be always right.
const PRIOR: [f64; 2] = [1.0, 4.0];
/// Rounds of the algorithm at most.
const ROUNDS: usize = 200;

/// The source's offset, standard deviations and probability of an outlier by expectation and maximisation (Dempster, Laird
/// and Rubin 1977) of the mixture that [`fusion`](super::fusion) uses; what is not said anything of stays as it was.
pub fn learn(before: &Source, all: &[Observed]) -> Source {
    let mut source = before.clone();
    if all.is_empty() {
        return source;
    }
    // Wide enough to see every reading that may be of the point.
    source.sd = source.sd.max(10.0);
    for _ in 0..ROUNDS {
        let last = source.clone();
        let (mut good, mut sum, mut squares) = (0.0, [0.0; 2], 0.0);
        let (mut deep, mut deep_squares) = (0.0, 0.0);
        for Observed { readings, area, truth, truth_mm } in all {
            let share = source.share(readings);
            let off = |r: &Reading| [0, 1].map(|k| r.at[k] - truth[k] - source.offset[k]);
            let weight = |r: &Reading| {
                let [dx, dy] = off(r);
                let variance = source.sd.square();
                let density =
                    Real::exp(-0.5 * (dx * dx + dy * dy) / variance) / (std::f64::consts::TAU * variance);
                share * r.confidence * density * area
            };
            let total: f64 = readings.iter().map(weight).sum::<f64>() + source.wrong(readings);
            for reading in readings {
                let sure = weight(reading) / total;
                let [dx, dy] = off(reading);
                good += sure;
                sum[0] += sure * dx;
                sum[1] += sure * dy;
                squares += sure * (dx * dx + dy * dy);
                if let (Some(z), Some(truth)) = (reading.depth_mm, truth_mm) {
                    deep += sure;
                    deep_squares += sure * (z - truth).square();
                }
            }
        }
        let n = all.len() as f64;
        source.outlier = (n - good + PRIOR[0]) / (n + PRIOR[0] + PRIOR[1]);
        if good > 2.0 {
            let moved = sum.map(|v| v / good);
            for k in 0..2 {
                source.offset[k] += moved[k];
            }
            let rest = squares / good - moved[0].square() - moved[1].square();
            source.sd = (rest / 2.0).max(0.0).sqrt().max(LEAST_SD);
        }
        if deep > 2.0 {
            source.depth_sd = (deep_squares / deep).sqrt().max(LEAST_DEPTH_SD);
        }
        let settled = |a: f64, b: f64| (a - b).abs() < 1e-6;
        if settled(source.sd, last.sd) && settled(source.outlier, last.outlier) {
            break;
        }
    }
    source
}
