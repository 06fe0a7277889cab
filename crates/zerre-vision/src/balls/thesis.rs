//! The multi-ball example as the thesis has it: balls are told apart by sorting areas, particles start about the
//! middle of the picture, and weights fall with the normalised distance.
//!
//! Sizes of noises and thresholds were lost with the equations of the text; a [`Reading`] fills them in. None of them
//! is a law of measurements: normalised distances depend on the particles themselves. They stand here to be compared.

use super::belief::{BallMotion, Known};
use super::detector::Seen;
use super::tracker::BallRow;
use crate::{Error, Result};
use zerre::math::exp;
use zerre::resample::{Resampler, Resampling};
use zerre::rng::{Purpose, Stream};

/// What is taken for the estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimate {
    /// The particle of the largest weight.
    Best,
    /// The plain mean of the particles after resampling, as the text says.
    Mean,
}

/// One way to read the thesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// The motion.
    pub motion: BallMotion,
    /// Standard deviation of its noise in a frame, px (of the first ball), on place and velocity alike.
    pub process_sd: f64,
    /// Standard deviation of the noise that is added to detected places, px.
    pub added_sd: f64,
    /// Distances are divided by the largest one.
    pub normalised: bool,
    /// Variance of the likelihood, px^2 or of the normalised distance.
    pub variance: f64,
    /// The estimate.
    pub estimate: Estimate,
    /// Frames at the start that are left out of the error.
    pub burn_in: usize,
    /// The error is the mean of squared distances, not of distances.
    pub squared: bool,
    /// The distance that the printed table is read as is the one to the noisy measurement, not to the detection.
    pub to_measurement: bool,
}

const A: Reading = Reading {
    name: "a",
    about: "random walk of 5 px, best particle, distances in px; mean distance after frame 20",
    motion: BallMotion::RandomWalk,
    process_sd: 5.0,
    added_sd: 0.0,
    normalised: false,
    variance: 25.0,
    estimate: Estimate::Best,
    burn_in: 20,
    squared: false,
    to_measurement: false,
};

/// All readings, the one that explains the printed table best first.
pub const READINGS: &[Reading] = &[
    A,
    Reading {
        name: "b",
        about: "as a, distances by the largest one, noise of 3 px added to what is measured, which errors are held against",
        added_sd: 3.0,
        normalised: true,
        variance: 0.01,
        to_measurement: true,
        ..A
    },
    Reading {
        name: "c",
        about: "random walk of 10 px, distances by the largest one, narrow likelihood, mean of the particles",
        process_sd: 10.0,
        normalised: true,
        variance: 0.001,
        estimate: Estimate::Mean,
        ..A
    },
    Reading {
        name: "d",
        about: "as c, but squared errors from the first frame on: what the table is called",
        process_sd: 10.0,
        normalised: true,
        variance: 0.001,
        estimate: Estimate::Mean,
        burn_in: 0,
        squared: true,
        ..A
    },
];

/// The reading of that name.
pub fn reading(name: &str) -> Option<&'static Reading> {
    READINGS.iter().find(|reading| reading.name == name)
}

/// Noises of further balls relative to the first, for which the text says only that all differ: the ratios of the
/// printed errors. Beyond the third they are that of the first.
pub const RATIOS: [f64; 3] = [1.0, 1.8, 0.9];
/// First particles spread about the middle of the picture by this share of its height, times the ball's ratio.
const START: f64 = 0.1;
/// Effective numbers of particles below this share of all make the filter resample ("2/3", by the suffix of the
/// lost number).
const RESAMPLE_BELOW: f64 = 2.0 / 3.0;

/// The filter of one ball.
#[derive(Clone, Debug)]
pub struct ThesisFilter {
    reading: Reading,
    ratio: f64,
    stream: Stream,
    step: u64,
    /// x, y, u, v of each particle.
    states: Vec<[f64; 4]>,
    spare: Vec<[f64; 4]>,
    weights: Vec<f64>,
    ancestors: Vec<u32>,
    resampler: Resampler,
}

impl ThesisFilter {
    /// A filter of ball number `ball`, from 0, on a picture of that size.
    ///
    /// # Errors
    /// No particles.
    pub fn new(
        reading: &Reading,
        ball: usize,
        (width, height): (usize, usize),
        (particles, scheme): (usize, Resampling),
        stream: Stream,
    ) -> Result<ThesisFilter> {
        if particles == 0 || particles > zerre::belief::MAX_PARTICLES {
            let (what, value) = ("number of particles", particles as f64);
            return Err(Error::OutOfRange { what, value, needs: "from 1 to 2^26 are needed" });
        }
        let ratio = RATIOS.get(ball).copied().unwrap_or(1.0);
        let sd = START * height as f64 * ratio;
        let mut draws = stream.draws(Purpose::Prior, 0, 0);
        let middle = [0.5 * width as f64, 0.5 * height as f64];
        let states: Vec<[f64; 4]> = (0..particles)
            .map(|_| {
                let [x, y] = middle.map(|at| at + sd * draws.normal());
                [x, y, 0.0, 0.0]
            })
            .collect();
        Ok(ThesisFilter {
            reading: *reading,
            ratio,
            stream,
            step: 0,
            spare: states.clone(),
            weights: vec![1.0; particles],
            ancestors: vec![0; particles],
            resampler: Resampler::new(scheme),
            states,
        })
    }

    /// A detected place with the noise that the thesis adds to it.
    pub fn measured(&self, detected: [f64; 2]) -> [f64; 2] {
        let mut draws = self.stream.draws(Purpose::Measurement, self.step + 1, 0);
        detected.map(|at| at + self.reading.added_sd * self.ratio * draws.normal())
    }

    /// Moves the particles by a frame, weighs them by `measured` (see [`ThesisFilter::measured`]) if there is such,
    /// and says the estimate.
    ///
    /// # Errors
    /// A place that is not finite.
    pub fn step(&mut self, measured: Option<[f64; 2]>) -> Result<[f64; 2]> {
        for value in measured.iter().flatten() {
            zerre::Error::finite("measured place of a ball", *value)?;
        }
        self.step += 1;
        let Reading { motion, process_sd, normalised, estimate, .. } = self.reading;
        let sd = process_sd * self.ratio;
        let mut draws = self.stream.draws(Purpose::Motion, self.step, 0);
        for [x, y, u, v] in &mut self.states {
            if motion == BallMotion::ConstantVelocity {
                (*x, *y) = (*x + *u, *y + *v);
                (*u, *v) = (*u + sd * draws.normal(), *v + sd * draws.normal());
            }
            (*x, *y) = (*x + sd * draws.normal(), *y + sd * draws.normal());
        }
        let Some([zx, zy]) = measured else { return Ok(self.mean()) };
        let square = |s: &[f64; 4]| (s[0] - zx).powi(2) + (s[1] - zy).powi(2);
        let unit = if normalised {
            self.states.iter().map(square).fold(f64::MIN_POSITIVE, f64::max)
        } else {
            self.ratio * self.ratio
        };
        let per = 1.0 / (unit * self.reading.variance);
        // Relative to the nearest particle, so that not all weights vanish far from the ball.
        let least = self.states.iter().map(square).fold(f64::INFINITY, f64::min);
        for (weight, state) in self.weights.iter_mut().zip(&self.states) {
            *weight *= exp(-0.5 * (square(state) - least) * per);
        }
        let largest = self.weights.iter().copied().fold(0.0, f64::max);
        if largest > 0.0 {
            self.weights.iter_mut().for_each(|weight| *weight /= largest);
        } else {
            self.weights.fill(1.0);
        }
        let best = || {
            let at = (0..self.weights.len()).max_by(|a, b| self.weights[*a].total_cmp(&self.weights[*b]));
            at.map_or([f64::NAN; 2], |at| [self.states[at][0], self.states[at][1]])
        };
        let best = if estimate == Estimate::Best { Some(best()) } else { None };
        let (sum, squares) = self.weights.iter().fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
        if sum * sum / squares < RESAMPLE_BELOW * self.weights.len() as f64 {
            self.resampler.ancestors(&self.weights, self.stream, self.step, &mut self.ancestors)?;
            for (state, ancestor) in self.spare.iter_mut().zip(&self.ancestors) {
                *state = self.states[*ancestor as usize];
            }
            std::mem::swap(&mut self.states, &mut self.spare);
            self.weights.fill(1.0);
        }
        Ok(best.unwrap_or_else(|| self.mean()))
    }

    fn mean(&self) -> [f64; 2] {
        let n = self.states.len() as f64;
        let sum = self.states.iter().fold([0.0; 2], |sum, s| [sum[0] + s[0], sum[1] + s[1]]);
        sum.map(|sum| sum / n)
    }

    /// Variances and covariance of the particles' places, px^2.
    pub fn covariance(&self) -> [[f64; 2]; 2] {
        let (mean, n) = (self.mean(), self.states.len() as f64);
        let mut sums = [[0.0; 2]; 2];
        for state in &self.states {
            for i in 0..2 {
                for j in 0..2 {
                    sums[i][j] += (state[i] - mean[i]) * (state[j] - mean[j]) / n;
                }
            }
        }
        sums
    }

    /// Mean velocity, px per frame.
    pub fn velocity(&self) -> [f64; 2] {
        let n = self.states.len() as f64;
        let sum = self.states.iter().fold([0.0; 2], |sum, s| [sum[0] + s[2], sum[1] + s[3]]);
        sum.map(|sum| sum / n)
    }

    /// Places of the particles, all of one weight.
    pub fn particles(&self) -> impl Iterator<Item = [f64; 2]> {
        self.states.iter().map(|s| [s[0], s[1]])
    }
}

/// The places of `count` balls and their areas: parts sorted by area, the largest is ball 1. Missing where there are
/// fewer.
pub fn by_area(seen: &Seen, count: usize) -> Vec<Option<([f64; 2], usize)>> {
    let mut parts: Vec<_> = seen.blobs.iter().map(|blob| (blob.centroid, blob.area)).collect();
    parts.sort_by_key(|(_, area)| std::cmp::Reverse(*area));
    (0..count).map(|at| parts.get(at).copied()).collect()
}

/// A fixed number of balls, told apart by their areas: the largest is ball 1.
#[derive(Clone, Debug)]
pub struct ByArea {
    filters: Vec<ThesisFilter>,
    shown: Vec<(BallRow, f64)>,
    rows: Vec<BallRow>,
    missing: usize,
}

impl ByArea {
    /// `count` balls on a picture of that size.
    ///
    /// # Errors
    /// No balls, no particles.
    pub fn new(
        reading: &Reading,
        count: usize,
        size: (usize, usize),
        particles: (usize, Resampling),
        stream: Stream,
    ) -> Result<ByArea> {
        if count == 0 || count > MOST_BALLS {
            let (what, value) = ("number of balls", count as f64);
            return Err(Error::OutOfRange { what, value, needs: "from 1 to 1000 are needed" });
        }
        let filter = |ball| ThesisFilter::new(reading, ball, size, particles, stream.fork(ball as u64));
        let filters = (0..count).map(filter).collect::<Result<_>>()?;
        Ok(ByArea { filters, shown: Vec::new(), rows: Vec::new(), missing: 0 })
    }

    /// Takes in what a detector saw in frame `index`.
    ///
    /// # Errors
    /// None in practice: places that are not finite.
    pub fn take(&mut self, index: usize, seen: &Seen) -> Result<()> {
        let found = by_area(seen, self.filters.len());
        self.missing += found.iter().filter(|one| one.is_none()).count();
        self.shown.clear();
        for (at, (filter, found)) in self.filters.iter_mut().zip(found).enumerate() {
            let measured = found.map(|(place, _)| filter.measured(place));
            let centre = filter.step(measured)?;
            let known = Known { centre, velocity: filter.velocity(), covariance: filter.covariance() };
            let area = found.map_or(f64::NAN, |(_, area)| area as f64);
            let detected = found.map(|(place, _)| place);
            let row = BallRow { frame: index, ball: at + 1, known, area, detected };
            self.rows.push(row.clone());
            self.shown.push((row, (area / std::f64::consts::PI).sqrt()));
        }
        Ok(())
    }

    /// The balls of the last frame with their radii (px; NaN where not seen) and filters.
    pub fn balls(&self) -> impl Iterator<Item = (&BallRow, f64, &ThesisFilter)> {
        self.shown.iter().zip(&self.filters).map(|((row, radius), filter)| (row, *radius, filter))
    }

    /// All rows, and how often a ball had no part of the picture.
    pub fn finish(self) -> (Vec<BallRow>, usize) {
        (self.rows, self.missing)
    }
}

/// Most balls that are told apart by area.
const MOST_BALLS: usize = 1000;
