//! How the track of an extended target begins: a law of its state and a first shape, from its first scans alone.

use super::{ExtendedSpec, Rotation, Scan};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::extended::centre::FirstTwo;
use crate::extended::rate::Rate;
use crate::extended::start::{Fit, Search, fits};
use crate::extended::statistics::floored;
use crate::extended::window::{Clutter, Number, WindowSettings, WindowVb};
use crate::extended::{MStep, Shape};
use crate::math::{Matrix, atan2};
use crate::model::motion::ConstantVelocity;
use crate::rng::Stream;
use crate::time::Time;

/// More points say little more of the first shape, and cost time in each of some hundred turns.
const MOST_POINTS: usize = 1500;

/// What the first scans say of the first state, where that has to be known: with variances larger by this factor, because
/// the same scans are used again.
const DOUBT: f64 = 4.0;

/// What a track starts from. Places are from `origin` on: sums of squares of large numbers would lose the shape.
pub(super) struct Begin {
    pub at: Time,
    /// Mean of the first points, m.
    pub origin: [f64; 2],
    pub prior: Gaussian<4>,
    pub shape: Shape,
    /// Covariance of points about the means of their scans, m^2.
    pub pooled: Matrix<2, 2>,
    /// Median time between scans, s; 0 for a single one.
    pub interval: f64,
}

/// The window filter for targets that do not turn.
type Window = WindowVb<ConstantVelocity<2>, FirstTwo, 4, 4>;

/// About `most` of the points, evenly spread over the list.
pub(super) fn thinned(points: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
    points.iter().copied().step_by(points.len().div_ceil(most.max(1)).max(1)).collect()
}

/// The points of a scan about a place.
pub(super) fn about(points: &[[f64; 2]], [x, y]: [f64; 2]) -> Vec<[f64; 2]> {
    points.iter().map(|p| [p[0] - x, p[1] - y]).collect()
}

/// Mean of points, from the first one on: nothing is lost far from zero.
pub(super) fn mean(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let first = *points.first()?;
    let n = points.len() as f64;
    let sum = points.iter().fold([0.0; 2], |s, p| [s[0] + (p[0] - first[0]), s[1] + (p[1] - first[1])]);
    Some([first[0] + sum[0] / n, first[1] + sum[1] / n])
}

impl ExtendedSpec {
    /// # Errors
    /// No points, points that are not finite.
    pub(super) fn begin(&self, scans: &[Scan], stream: Stream) -> Result<Begin> {
        let with_points = scans.iter().position(|(_, points)| !points.is_empty());
        let Some(origin) = with_points.and_then(|first| mean(&scans[first].1)) else {
            return Err(Error::Unsupported(
                "a target without any point has no place and no shape".to_owned(),
            ));
        };
        for value in scans.iter().flat_map(|(_, points)| points.iter().flatten()) {
            Error::finite("point of a scan", *value)?;
        }
        let at = scans.first().map_or(Time::ZERO, |(time, _)| *time);
        let few = &scans[..scans.len().min(self.first_scans)];
        let each = MOST_POINTS / few.len().max(1);
        let few: Vec<Scan> =
            few.iter().map(|(time, points)| (*time, about(&thinned(points, each), origin))).collect();
        let mut steps: Vec<f64> = scans.windows(2).map(|pair| (pair[1].0 - pair[0].0).secs()).collect();
        steps.sort_unstable_by(f64::total_cmp);
        let interval = steps.get(steps.len() / 2).copied().unwrap_or(0.0);

        let pooled = self.pooled(&few);
        // As far as a point lies from the middle: the first points may be of one side of the target. Along both axes
        // alike, as Koch's rule needs it.
        let place = (0.5 * (pooled.0[0][0] + pooled.0[1][1])).sqrt();
        let (place, speed) = (place.max(self.position_sd_m), self.speed_sd_mps);
        let mut prior = Gaussian::independent([0.0; 4], [place, place, speed, speed])?;
        let one = Shape::ellipse(pooled)?;
        if self.filter != super::ExtendedFilter::WindowVb {
            return Ok(Begin { at, origin, prior, shape: one, pooled, interval });
        }
        let settings = self.settings()?;
        let search = Search { floor: self.least_sd_m * self.least_sd_m, ..Search::default() };
        if settings.clutter.is_some() {
            // As long as the velocity is not known, the points of the next scan are taken for clutter rather than for
            // the target's. So the path comes first, all points being the target's.
            let all = WindowSettings { clutter: None, ..settings.clone() };
            let path = Window::new(self.motion()?, FirstTwo, prior, one.clone(), all)?;
            if let Some(first) = path.smoothed(at, &few, search.turns)?.states.first() {
                prior = Gaussian::new(*first.mean(), *first.covariance() * DOUBT)?;
            }
        }
        let window = Window::new(self.motion()?, FirstTwo, prior, one, settings)?;
        let points = few.iter().map(|(_, points)| points.len()).sum();
        let found = fits(&window, at, &few, self.counts(points), &search, stream)?;
        let better = |best: Fit<4>, fit: Fit<4>| if fit.bic < best.bic { fit } else { best };
        let best = found.into_iter().reduce(better);
        let best = best.ok_or_else(|| Error::Unsupported("no number of ellipses was tried".to_owned()))?;
        let mut shape = best.smoothed.shape;
        if self.rotation == Rotation::Velocity {
            // The shape was fitted as it lies in the plane; its axes are those of the body from now on. The heading
            // comes from the velocity, and is nowhere as long as nothing is known of that.
            let states = &best.smoothed.states;
            if let (Some(first), Some(middle)) = (states.first(), states.get(states.len() / 2)) {
                let [.., vx, vy] = *middle.mean();
                shape = shape.turned(-atan2(vy, vx));
                prior = Gaussian::new(*first.mean(), *first.covariance() * DOUBT)?;
            }
        }
        Ok(Begin { at, origin, prior, shape, pooled, interval })
    }

    /// Numbers of ellipses to try on so many points. Fewer points than numbers to learn say nothing of how many there
    /// are; of a number that is told there may be no more than points.
    fn counts(&self, points: usize) -> std::ops::RangeInclusive<usize> {
        match self.ellipses {
            Some(count) => {
                let count = count.min(points.max(1));
                count..=count
            }
            None => 1..=(points.saturating_sub(1) / 6).clamp(1, Number::default().most),
        }
    }

    /// Covariance of the points about the means of their scans, without the noise of the sensor.
    fn pooled(&self, scans: &[Scan]) -> Matrix<2, 2> {
        let (mut sum, mut free) = (Matrix::ZERO, 0.0);
        for (_, points) in scans {
            let Some(middle) = mean(points) else { continue };
            for d in about(points, middle) {
                sum = sum + Matrix::outer(&d, &d);
            }
            free += points.len() as f64 - 1.0;
        }
        let noise = Matrix::identity() * (self.position_sd_m * self.position_sd_m);
        floored(&(sum * (1.0 / f64::max(free, 1.0)) - noise), self.least_sd_m * self.least_sd_m)
    }

    /// The motion.
    pub(super) fn motion(&self) -> Result<ConstantVelocity<2>> {
        ConstantVelocity::new(self.acceleration_sd_mps2 * self.acceleration_sd_mps2)
    }

    /// The settings of the window filter.
    pub(super) fn settings(&self) -> Result<WindowSettings> {
        // What is unknown of a rate counts like half a scan.
        const LITTLE: f64 = 0.5;
        let clutter = match &self.clutter {
            None => None,
            Some(told) => {
                let rate = match told.rate {
                    // As if it had been counted for ever.
                    Some(rate) => Rate::new(rate, 1e9, 1.0)?,
                    None => Rate::new(1.0, LITTLE, 1.0)?,
                };
                Some(Clutter { area: told.area_m2, rate, learnt: told.rate.is_none() })
            }
        };
        Ok(WindowSettings {
            window: self.window,
            sweeps: self.sweeps,
            m_step: MStep { floor: self.least_sd_m * self.least_sd_m, ..MStep::default() },
            keep: self.keep,
            noise: Matrix::identity() * (self.position_sd_m * self.position_sd_m),
            clutter,
            number: self.ellipses.is_none().then(Number::default),
            ..WindowSettings::default()
        })
    }
}
