//! What is known of sources, learnt from a clip on which people have marked the point.
//!
//! The cues are searched about the filter's own prediction, so they are as good as it is: the clip is gone through with
//! what is known so far, what the sources said is compared with the marks, and both are done again until it settles.

use super::fusion::Source;
use super::tracker::{PointTracker, Said, TrackerSettings};
use super::{Depth, Intrinsics, Reading, RgbdFrame};
use crate::{Frame, Result};
use zerre::math::Real;
use zerre::rng::Stream;

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
/// A tracker whose answer is farther from the marks than this share of its window is astray ...
const ASTRAY: f64 = 0.25;
/// ... and is shown the point again after so many such frames: what a cue says elsewhere is not what is learnt.
const PATIENCE: usize = 5;

/// The source's offset, standard deviations and probability of an outlier by expectation and maximisation (Dempster, Laird
/// and Rubin 1977) of the mixture that [`fusion`](super::fusion) uses; what is not said anything of stays as it was.
pub fn learn(before: &Source, all: &[Observed]) -> Source {
    let mut source = before.clone();
    if all.is_empty() {
        return source;
    }
    // Narrow, so that other things that are often near are not taken for the point's noise.
    source.sd = source.sd.clamp(3.0, 6.0);
    for _ in 0..ROUNDS {
        let last = source.clone();
        let (mut good, mut sum, mut squares) = (0.0, [0.0; 2], 0.0);
        let (mut deep, mut deep_sum, mut deep_squares) = (0.0, 0.0, 0.0);
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
                    let off = z - truth - source.depth_offset;
                    deep += sure;
                    deep_sum += sure * off;
                    deep_squares += sure * off * off;
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
            let moved = deep_sum / deep;
            source.depth_offset += moved;
            source.depth_sd = (deep_squares / deep - moved.square()).max(0.0).sqrt().max(LEAST_DEPTH_SD);
        }
        let settled = |a: f64, b: f64| (a - b).abs() < 1e-6;
        if settled(source.sd, last.sd) && settled(source.outlier, last.outlier) {
            break;
        }
    }
    source
}

/// A clip on which people have marked the point.
pub struct Marked<'a> {
    /// The empty room.
    pub room: (Frame, Depth),
    /// The colour camera.
    pub lens: Intrinsics,
    /// Where the point is in the first frame.
    pub first: Reading,
    /// How many frames there are.
    pub frames: usize,
    /// A frame by its place, from 0.
    pub frame: &'a dyn Fn(usize) -> Result<RgbdFrame>,
    /// What the sources beside the cues say in a frame.
    pub others: &'a dyn Fn(usize) -> Vec<(usize, Vec<Reading>)>,
    /// Where the point is in a frame, pixels, and how deep, millimetres; `None` where it cannot be seen.
    pub truth: &'a dyn Fn(usize) -> Option<([f64; 2], Option<f64>)>,
}

/// Squared distance in standard deviations within which 95 % of a normal law in the plane lie.
pub const WITHIN_95: f64 = 5.991_464_547_107_98;

/// Settings with the sources and the covariance's floor learnt from clips, `rounds` times over.
///
/// # Errors
/// What a tracker refuses, frames that cannot be read.
pub fn calibrate(
    before: &TrackerSettings,
    clips: &[Marked<'_>],
    rounds: usize,
    stream: Stream,
) -> Result<TrackerSettings> {
    let mut settings = before.clone();
    for _ in 0..rounds {
        settings.reference_sd = 0.0;
        let mut observed: Vec<Vec<Observed>> = vec![Vec::new(); settings.all_sources().count()];
        let mut floors = Vec::new();
        let reach = ASTRAY * settings.window as f64;
        for clip in clips {
            let mut misses = Vec::new();
            let start = |frame: &RgbdFrame, at: Reading| {
                let room = (clip.room.clone(), clip.lens);
                PointTracker::start(settings.clone(), room, (frame, at), stream)
            };
            let mut tracker = start(&(clip.frame)(0)?, clip.first)?;
            let mut astray = 0;
            for k in 1..clip.frames {
                let frame = (clip.frame)(k)?;
                let others = (clip.others)(k);
                let others: Vec<(usize, &[Reading])> =
                    others.iter().map(|(s, r)| (*s, r.as_slice())).collect();
                let tracked = tracker.step(&frame, &others, &mut |_| ())?;
                let Some((truth, truth_mm)) = (clip.truth)(k) else { continue };
                let looked = tracked.search.holds(truth, frame.colour.size());
                for ((all, said), source) in observed.iter_mut().zip(tracked.said).zip(settings.all_sources())
                {
                    // A cue that did not look there cannot have found it.
                    if let Some(Said { readings, area }) = said.filter(|_| looked || !source.sees) {
                        all.push(Observed { readings, area, truth, truth_mm });
                    }
                }
                let off = [0, 1].map(|i| tracked.fused.at[i] - truth[i]);
                if !tracked.fused.is_lost() {
                    misses.push((tracked.fused.covariance, off));
                }
                astray = if off[0].hypot(off[1]) > reach { astray + 1 } else { 0 };
                let (width, height) = frame.colour.size();
                let shown =
                    (0.0..=width as f64).contains(&truth[0]) && (0.0..=height as f64).contains(&truth[1]);
                if astray >= PATIENCE && shown {
                    astray = 0;
                    tracker = start(&frame, Reading { at: truth, depth_mm: truth_mm, confidence: 1.0 })?;
                }
            }
            floors.push(floor(&misses));
        }
        let sources = settings.sources.iter_mut().chain(&mut settings.colour).chain(&mut settings.depth);
        for (source, observed) in sources.zip(&observed) {
            *source = learn(source, observed);
        }
        // Their mean: the quantile of all frames together hangs on the worst clip.
        settings.reference_sd = floors.iter().sum::<f64>() / clips.len().max(1) as f64;
    }
    Ok(settings)
}

/// The least standard deviation that, added to the covariances, makes 95 % of the ellipses hold the truth.
fn floor(misses: &[([[f64; 2]; 2], [f64; 2])]) -> f64 {
    let held = |sd: f64| {
        let inside = misses.iter().filter(|(covariance, off)| {
            let [[a, b], [_, c]] = *covariance;
            let (a, c) = (a + sd * sd, c + sd * sd);
            let distance = off[0].square() * c - 2.0 * off[0] * off[1] * b + off[1].square() * a;
            distance <= WITHIN_95 * (a * c - b * b)
        });
        inside.count() as f64 >= 0.95 * misses.len() as f64
    };
    let (mut low, mut high) = (0.0, 100.0);
    if held(low) {
        return low;
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if held(middle) { high = middle } else { low = middle }
    }
    high
}
