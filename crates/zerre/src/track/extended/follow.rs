//! Filters of extended targets at work.

use super::begin::{Begin, about, mean};
use super::{Body, ExtendedFilter, ExtendedRow, ExtendedSpec, Interval, Rotation, Scan};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::extended::Shape;
use crate::extended::centre::{AlongVelocity, Centre, FirstTwo};
use crate::extended::inverse_wishart::{InverseWishart, SemiAxis};
use crate::extended::random_matrix::{RandomMatrix, RandomMatrixBelief, RandomMatrixSettings, Rule};
use crate::extended::window::{ExtendedBelief, WindowVb};
use crate::filter::Filter;
use crate::math::{Cholesky, Matrix, ln};
use crate::model::motion::ConstantVelocity;
use crate::rng::Stream;
use crate::time::Time;
use crate::track::row::{Event, Innovation, Row};
use crate::track::tracker::{stable_hash, track_name};
use std::sync::Arc;

/// Probability of the intervals of a shape.
const LEVEL: f64 = 0.95;

/// What a belief says, whatever the filter.
struct Told {
    time: Time,
    state: Gaussian<4>,
    /// Where the centre is.
    at: [f64; 2],
    /// About the centre, as it lies in the plane.
    shape: Shape,
    intervals: Vec<[Interval; 2]>,
    /// Covariance of the middle of the shape about the centre, m^2.
    middle: Matrix<2, 2>,
    rate: f64,
    clutter_rate: Option<f64>,
}

/// A filter whose beliefs say all that rows need.
trait Tells: Filter<Measurement = Vec<[f64; 2]>> {
    fn told(&self, belief: &Self::Belief) -> Result<Told>;
}

fn bounds(axes: [SemiAxis; 2]) -> [Interval; 2] {
    axes.map(|axis| axis.interval)
}

impl<C: Centre<4>> Tells for WindowVb<ConstantVelocity<2>, C, 4, 4> {
    fn told(&self, belief: &ExtendedBelief<4>) -> Result<Told> {
        let (at, shape) = self.placed(belief);
        // The mean of so many points.
        let points = belief.sums().iter().map(|sums| sums.count).sum::<f64>().max(1.0);
        let intervals = self.extents(belief)?.into_iter().map(|extent| Ok(bounds(extent.semi_axes(LEVEL)?)));
        Ok(Told {
            time: belief.time(),
            state: *belief.state(),
            at,
            middle: shape.covariance() * (1.0 / points),
            shape,
            intervals: intervals.collect::<Result<_>>()?,
            rate: belief.rate().mean(),
            clutter_rate: belief.clutter().map(|clutter| clutter.rate.mean()),
        })
    }
}

impl Tells for RandomMatrix<ConstantVelocity<2>, FirstTwo, 4, 4> {
    fn told(&self, belief: &RandomMatrixBelief<4>) -> Result<Told> {
        let [x, y, ..] = *belief.state.mean();
        Ok(Told {
            time: belief.time,
            state: belief.state,
            at: [x, y],
            shape: belief.shape()?,
            // The centre is the middle.
            middle: Matrix::ZERO,
            intervals: vec![bounds(belief.extent.semi_axes(LEVEL)?)],
            rate: belief.rate.mean(),
            clutter_rate: None,
        })
    }
}

/// A track: takes scans in, whatever the filter.
trait Track {
    fn push(&mut self, scan: &Scan) -> Result<ExtendedRow>;
}

struct Tracked<'a, F: Filter> {
    spec: &'a ExtendedSpec,
    id: Arc<str>,
    filter: F,
    belief: F::Belief,
    origin: [f64; 2],
    started: bool,
}

impl<F: Tells> Track for Tracked<'_, F> {
    fn push(&mut self, (to, points): &Scan) -> Result<ExtendedRow> {
        let points = about(points, self.origin);
        self.filter.step(&mut self.belief, *to, None)?;
        let ahead = self.filter.told(&self.belief)?;
        let innovation = if self.started { self.innovation(&ahead, &points)? } else { None };
        let mut update = self.filter.step(&mut self.belief, *to, Some(&points))?;
        // The filter weighs clutter against the target's points; a density of a point counts both together.
        if let Some(clutter) = ahead.clutter_rate {
            update.log_evidence -= points.len() as f64 * ln(1.0 + clutter / ahead.rate);
        }
        let event = if self.started { Event::Updated } else { Event::Started };
        self.started = true;
        let told = self.filter.told(&self.belief)?;
        // The centre of the body and the offsets of its ellipses move against each other unseen; their mean does not.
        let middle = told.shape.centroid();
        let mut mean = told.state.mean().to_vec();
        for k in 0..2 {
            mean[k] = told.at[k] + middle[k] + self.origin[k];
        }
        let covariance = Matrix::<4, 4>::from_entries(|i, j| {
            let of_shape = if i < 2 && j < 2 { told.middle.0[i][j] } else { 0.0 };
            told.state.covariance().0[i][j] + of_shape
        });
        let row = Row {
            id: Arc::clone(&self.id),
            time: told.time,
            event,
            update: Some(update),
            mean,
            covariance: covariance.0.iter().flatten().copied().collect(),
            modes: Vec::new(),
            innovation,
        };
        let shape = told.shape.about(middle);
        let body =
            Body { shape, intervals: told.intervals, rate: told.rate, clutter_rate: told.clutter_rate };
        Ok(ExtendedRow { row, body })
    }
}

impl<F: Tells> Tracked<'_, F> {
    /// The mean of the points against what the belief, predicted to their time, says of it.
    fn innovation(&self, told: &Told, points: &[[f64; 2]]) -> Result<Option<Innovation>> {
        let Some(seen) = mean(points).filter(|_| self.spec.clutter.is_none()) else { return Ok(None) };
        let middle = told.shape.centroid();
        let apart = [0, 1].map(|k| seen[k] - told.at[k] - middle[k]);
        let state = told.state.covariance().0;
        let place = Matrix([[state[0][0], state[0][1]], [state[1][0], state[1][1]]]);
        let sensor = Matrix::identity() * (self.spec.position_sd_m * self.spec.position_sd_m);
        let noise = (told.shape.covariance() + sensor) * (1.0 / points.len() as f64);
        let Ok(factor) = Cholesky::of("covariance of the innovation", &(place + noise).symmetrised()) else {
            return Ok(None);
        };
        let whitened = factor.whiten(&apart);
        let nis: f64 = whitened.iter().map(|w| w * w).sum();
        let noise_share = factor.solve_matrix(&noise).diagonal().iter().sum::<f64>() / 2.0;
        let finite = nis.is_finite() && noise_share.is_finite();
        Ok(finite.then(|| Innovation { whitened: whitened.to_vec(), nis, noise_share }))
    }
}

/// The rows of a target: tracks one after the other, where silences end them.
pub(super) struct Following<'a> {
    spec: &'a ExtendedSpec,
    identity: Arc<str>,
    scans: &'a [Scan],
    next: usize,
    tracks: u32,
    now: Option<Box<dyn Track + 'a>>,
    failed: bool,
}

impl<'a> Following<'a> {
    pub fn new(spec: &'a ExtendedSpec, identity: &str, scans: &'a [Scan]) -> Following<'a> {
        let identity = Arc::from(identity);
        Following { spec, identity, scans, next: 0, tracks: 0, now: None, failed: false }
    }

    fn row(&mut self, at: usize) -> Result<ExtendedRow> {
        let scans = self.scans;
        let silent = |k: usize| k > 0 && scans[k].0 - scans[k - 1].0 > self.spec.max_gap;
        let track = match self.now.as_mut().filter(|_| !silent(at)) {
            Some(track) => track,
            None => {
                self.tracks += 1;
                let end = (at + 1..scans.len()).find(|&k| silent(k)).unwrap_or(scans.len());
                let id = track_name(Arc::clone(&self.identity), self.tracks);
                let stream = Stream::new(self.spec.seed).fork(stable_hash(&id));
                let begin = self.spec.begin(&scans[at..end], stream)?;
                self.now.insert(self.spec.track(id, begin)?)
            }
        };
        track.push(&scans[at])
    }
}

impl Iterator for Following<'_> {
    type Item = Result<ExtendedRow>;

    fn next(&mut self) -> Option<Result<ExtendedRow>> {
        if self.failed || self.next >= self.scans.len() {
            return None;
        }
        let row = self.row(self.next);
        self.next += 1;
        self.failed = row.is_err();
        Some(row)
    }
}

impl ExtendedSpec {
    /// A track from where it begins.
    fn track<'a>(&'a self, id: Arc<str>, begin: Begin) -> Result<Box<dyn Track + 'a>> {
        let Begin { at, origin, prior, shape, pooled, interval } = begin;
        let motion = self.motion()?;
        match (self.filter, self.rotation) {
            (ExtendedFilter::WindowVb, Rotation::None) => {
                let filter = WindowVb::new(motion, FirstTwo, prior, shape, self.settings()?)?;
                self.boxed(id, filter, at, origin)
            }
            (ExtendedFilter::WindowVb, Rotation::Velocity) => {
                let filter = WindowVb::new(motion, AlongVelocity, prior, shape, self.settings()?)?;
                self.boxed(id, filter, at, origin)
            }
            (ExtendedFilter::RandomMatrixKoch | ExtendedFilter::RandomMatrixFeldmann, _) => {
                // The mean extent is guessed from the points that come next: it counts for one of them more than the
                // fewest with a variance.
                const GUESSED: f64 = 6.0;
                let rule = match self.filter {
                    ExtendedFilter::RandomMatrixKoch => {
                        Rule::Koch { unit: 0.5 * (pooled.0[0][0] + pooled.0[1][1]) }
                    }
                    _ => Rule::Feldmann {
                        noise: Matrix::identity() * (self.position_sd_m * self.position_sd_m),
                    },
                };
                let settings = RandomMatrixSettings {
                    rule,
                    forgetting: self.forgetting(interval)?,
                    floor: self.least_sd_m * self.least_sd_m,
                    ..RandomMatrixSettings::default()
                };
                let extent = InverseWishart::new(pooled, GUESSED)?;
                let filter = RandomMatrix::new(motion, FirstTwo, prior, extent, settings)?;
                self.boxed(id, filter, at, origin)
            }
        }
    }

    fn boxed<'a, F: Tells + 'a>(
        &'a self,
        id: Arc<str>,
        filter: F,
        at: Time,
        origin: [f64; 2],
    ) -> Result<Box<dyn Track + 'a>>
    where
        F::Belief: 'a,
    {
        let belief = filter.start(at, Stream::new(self.seed))?;
        Ok(Box::new(Tracked { spec: self, id, filter, belief, origin, started: false }))
    }

    /// The time constant that keeps as much from scan to scan, s; none for a shape that stays.
    fn forgetting(&self, interval: f64) -> Result<Option<f64>> {
        if self.keep >= 1.0 || interval <= 0.0 {
            return Ok(None);
        }
        let tau = interval / -ln(self.keep.max(1e-9));
        Error::positive("time constant of the shape", tau).map(Some)
    }
}
