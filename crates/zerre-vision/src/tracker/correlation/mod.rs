//! The tracker that `zerre video` uses unless told otherwise: a particle filter whose likelihood is a background-aware
//! correlation filter, with the filter of the first frame as a second opinion, a model of colours, and a scale.
//!
//! In every frame a window about the last place is described by gradients and colours in cells of four pixels. The
//! responses of two filters, one that follows the object's looks and one that keeps those of the first frame, and of the
//! colours make a map, and the map is the likelihood of the particles: one window serves them all. How high and how
//! prominent its peak is says whether the object is there: a Markov chain between *seen* and *lost* is filtered along.
//! While the object is lost nothing is learnt, the cloud widens, and windows at particles and all over the frame are
//! searched until it shows again.

mod colour;
mod features;
mod filter;
mod fourier;
mod scale;
mod settings;
mod surface;
mod visibility;

pub use settings::CorrelationSettings;
pub use visibility::Signs;

use super::{Estimate, Particle, Tracker};
use crate::{Error, Frame, Rect, Result};
use colour::ColourModel;
use features::{Cell, Features};
use filter::{Trainer, respond};
use fourier::{CHANNELS, Fourier, LANES, Spectrum};
use scale::ScaleFilter;
use std::f64::consts::TAU;
use surface::{Map, Responses, Wander};
use visibility::Visibility;
use zerre::Time;
use zerre::belief::{Cloud, Gaussian, MovedCloud};
use zerre::filter::{Filter, ParticleFilter, Settings, Tempered};
use zerre::kernels::Threads;
use zerre::math::Real;
use zerre::moves::Move;
use zerre::rng::{Purpose, Stream};

/// How small and how large the object may become, of what it was.
const SCALES: (f64, f64) = (0.2, 5.0);
/// A peak that is further from the window's middle than this share of the object's size is looked at again, from there.
const FAR: f64 = 0.05;
/// Evidence that another window needs before a lost object is believed to be there.
const RETURN: f64 = 0.5;
/// Evidence below which the peak of a lost object is not followed.
const HOPELESS: f64 = -4.0;
/// Evidence below which nothing is learnt, and above which all is. An object that turns looks lost for a while: what it
/// looks like then must be learnt, or it stays lost.
const DOUBT: (f64, f64) = (-3.0, -1.0);
/// Response of a filter to what it was trained with, at least: a picture of one colour has none.
const LEAST_RESPONSE: f32 = 1e-6;
/// Standard deviation of the first particles, in sizes of the object: the first box is as good as drawn by hand.
const START_SD: f64 = 0.01;

/// Runs `f` compiled for the widest registers of this processor. Nothing in it may depend on their width.
#[inline(always)]
fn wide<R>(f: impl FnOnce() -> R) -> R {
    use fearless_simd::{Level, Simd, dispatch};
    dispatch!(Level::new(), simd => simd.vectorize(f))
}

/// The tracker.
pub struct CorrelationTracker {
    settings: CorrelationSettings,
    stream: Stream,
    /// Columns and rows of a frame.
    frame: (usize, usize),
    /// Width and height of the box in the first frame.
    first_box: (f64, f64),
    /// What they are multiplied with now.
    scale: f64,
    centre: [f64; 2],
    looks: Looks,
    sizes: ScaleFilter,
    visibility: Visibility,
    filter: Settings,
    belief: MovedCloud<2>,
    maps: Vec<Map>,
    signs: Signs,
    /// Frames since the first.
    steps: u64,
    /// Frames since the object was seen.
    unseen: u64,
}

/// What the object looks like, and the memory to compare it with frames.
struct Looks {
    side: usize,
    rate: f32,
    first_share: f64,
    colour_share: f64,
    fourier: Fourier,
    trainer: Trainer,
    features: Features,
    cells: Vec<Cell>,
    /// Weights of the cells: a window that goes down to zero at its border.
    taper: Vec<f32>,
    seen: Spectrum,
    /// What it looks like, of late.
    model: Spectrum,
    filter: Spectrum,
    /// The filter of the first frame.
    first: Spectrum,
    answers: Spectrum,
    /// Responses of the two filters to what they were trained with.
    own: [f32; 2],
    colours: ColourModel,
    colour_map: Vec<f32>,
}

impl Looks {
    /// Fills `seen` with the window's description.
    fn look(&mut self, frame: &Frame, window: Rect) {
        let n = self.side;
        self.features.describe(frame, window, (n, n), true, &mut self.cells);
        for ((cell, weight), point) in self.cells.iter().zip(&self.taper).zip(self.fourier.grid()) {
            for l in 0..LANES {
                point.re[l] = cell[l] * weight;
                point.im[l] = cell[l + LANES] * weight;
            }
        }
        self.fourier.forward(0..n, &mut self.seen);
    }

    /// Learns from a window with the object in its middle, `size` cells large, with a share of the usual rate.
    fn learn(&mut self, frame: &Frame, window: Rect, size: (f64, f64), share: f32) {
        self.look(frame, window);
        if self.model.is_empty() {
            self.model.clone_from(&self.seen);
        } else {
            let rate = self.rate * share;
            wide(
                #[inline(always)]
                || {
                    for (model, seen) in self.model.iter_mut().zip(&self.seen) {
                        for c in 0..CHANNELS {
                            model.re[c] += rate * (seen.re[c] - model.re[c]);
                            model.im[c] += rate * (seen.im[c] - model.im[c]);
                        }
                    }
                },
            );
        }
        self.trainer.train(&mut self.fourier, &self.model, &mut self.filter);
        respond(&[(&self.filter, &self.model)], &mut self.answers);
        let half = self.fourier.half();
        let response_at_origin: f32 = (self.answers.iter().enumerate())
            .map(|(i, bin)| {
                let alone = i % half == 0 || 2 * (i % half) == self.side;
                bin.re[0] * if alone { 1.0 } else { 2.0 }
            })
            .sum();
        self.own[0] = (response_at_origin / (self.side * self.side) as f32).max(LEAST_RESPONSE);
        if self.first.is_empty() {
            self.first.clone_from(&self.filter);
            self.own[1] = self.own[0];
        }
        self.colours.learn(frame, window, self.side, size, share);
    }

    /// The responses over a window, and what their peak is like.
    fn respond(&mut self, frame: &Frame, window: Rect, size: (f64, f64)) -> (Map, Signs) {
        let n = self.side;
        self.look(frame, window);
        respond(&[(&self.filter, &self.seen), (&self.first, &self.seen)], &mut self.answers);
        self.fourier.inverse(&self.answers, 0..n);
        self.colours.respond(frame, window, n, size, &mut self.colour_map);
        let weight = self.colour_share as f32 * self.colours.contrast();
        let first_share = self.first_share as f32;
        let mut signs = Signs { followed: f64::MIN, first: f64::MIN, ..Signs::default() };
        let mut values = Vec::with_capacity(n * n);
        let grid = self.fourier.grid();
        for y in 0..n {
            for x in 0..n {
                // Shifts are counted from the origin, round the border; the map has its origin in the middle.
                let point = &grid[(y + n - n / 2) % n * n + (x + n - n / 2) % n];
                let (followed, first) = (point.re[0] / self.own[0], point.re[1] / self.own[1]);
                signs.followed = signs.followed.max(f64::from(followed));
                signs.first = signs.first.max(f64::from(first));
                let filters = (1.0 - first_share) * followed + first_share * first;
                values.push(filters + weight * self.colour_map[y * n + x]);
            }
        }
        let map = Map { window, side: n, values };
        let reach = (size.0.min(size.1) / 2.0).ceil() as usize;
        signs.prominence = map.prominence(reach);
        (map, signs)
    }
}

impl CorrelationTracker {
    /// A tracker of what is in `bounds` on `frame`. One stream gives the same answers for any number of threads.
    ///
    /// # Errors
    /// A setting out of its range; a box that no object can be in.
    pub fn start(
        frame: &Frame,
        bounds: Rect,
        mut settings: CorrelationSettings,
        (stream, threads): (Stream, Threads),
    ) -> Result<CorrelationTracker> {
        settings.checked()?;
        let bounds = bounds.on_frame(frame.size())?;
        // A window beyond the frame shows nothing but its border, and makes the cells coarser.
        let room = ((frame.width() * frame.height()) as f64 / bounds.area()).sqrt();
        settings.padding = settings.padding.min(room).max(1.5);
        let n = settings.side;
        let mut fourier = Fourier::new(n);
        let cells_per_pixel = n as f64 / (settings.padding * bounds.area().sqrt());
        let size = (bounds.width * cells_per_pixel, bounds.height * cells_per_pixel);
        let whole = |v: f64| (v.round() as usize).clamp(1, n);
        let sd = settings.label_sd * (size.0 * size.1).sqrt();
        let trainer = Trainer::new(&mut fourier, (whole(size.0), whole(size.1)), sd, settings.turns);
        let ramp: Vec<f32> =
            (0..n).map(|i| (0.5 - 0.5 * Real::sin_cos(TAU * (i as f64 + 0.5) / n as f64).1) as f32).collect();
        let looks = Looks {
            side: n,
            rate: settings.rate as f32,
            first_share: settings.first_share,
            colour_share: settings.colour_share,
            fourier,
            trainer,
            features: Features::default(),
            cells: Vec::new(),
            taper: (0..n * n).map(|i| ramp[i % n] * ramp[i / n]).collect(),
            seen: Spectrum::new(),
            model: Spectrum::new(),
            filter: Spectrum::new(),
            first: Spectrum::new(),
            answers: Spectrum::new(),
            own: [1.0; 2],
            colours: ColourModel::new(settings.colour_rate),
            colour_map: Vec::new(),
        };
        let filter = Settings { particles: settings.particles, threads, ..Settings::default() };
        let sd = START_SD * bounds.area().sqrt();
        let rules = rules(bounds.centre(), sd, Responses { sharpness: 0.0 }, &filter)?;
        let belief = rules.start(Time::ZERO, stream)?;
        let mut tracker = CorrelationTracker {
            stream,
            frame: frame.size(),
            first_box: (bounds.width, bounds.height),
            scale: 1.0,
            centre: bounds.centre(),
            looks,
            sizes: ScaleFilter::new(bounds.width, bounds.height, settings.scale_rate),
            visibility: Visibility::default(),
            filter,
            belief,
            maps: Vec::new(),
            signs: Signs::default(),
            steps: 0,
            unseen: 0,
            settings,
        };
        tracker.learn(frame, 1.0);
        Ok(tracker)
    }

    /// What the last frame's best window was like.
    pub fn signs(&self) -> Signs {
        self.signs
    }

    fn bounds_about(&self, centre: [f64; 2]) -> Rect {
        Rect::about(centre, self.first_box.0 * self.scale, self.first_box.1 * self.scale)
    }

    /// Root of the box's area, pixels.
    fn size(&self) -> f64 {
        self.scale * (self.first_box.0 * self.first_box.1).sqrt()
    }

    fn window(&self, centre: [f64; 2]) -> Rect {
        let side = self.settings.padding * self.size();
        Rect::about(centre, side, side)
    }

    /// Width and height of the box in cells.
    fn cells(&self) -> (f64, f64) {
        let per_pixel = self.settings.side as f64 / (self.settings.padding * self.size());
        (self.first_box.0 * self.scale * per_pixel, self.first_box.1 * self.scale * per_pixel)
    }

    fn learn(&mut self, frame: &Frame, share: f64) {
        let (window, size, bounds) = (self.window(self.centre), self.cells(), self.bounds_about(self.centre));
        self.looks.learn(frame, window, size, share as f32);
        self.sizes.learn(frame, bounds, share as f32);
    }

    /// The window about a place; where its peak is far from the middle, the window about that.
    fn search(&mut self, frame: &Frame, centre: [f64; 2]) -> (Map, Signs) {
        let (window, size) = (self.window(centre), self.cells());
        let mut found = self.looks.respond(frame, window, size);
        let (_, [x, y]) = found.0.peak();
        if (x - centre[0]).hypot(y - centre[1]) >= FAR * self.size() {
            let window = self.window(self.on_frame([x, y]));
            found = self.looks.respond(frame, window, size);
        }
        self.visibility.compare(&mut found.1);
        found
    }

    fn on_frame(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x.clamp(0.0, self.frame.0 as f64), y.clamp(0.0, self.frame.1 as f64)]
    }

    fn cloud(&self) -> &Cloud<2> {
        self.belief.cloud()
    }

    /// Places besides the last one where a lost object may show: of a particle, and of a raster over the frame.
    fn elsewhere(&self) -> Vec<[f64; 2]> {
        let spacing = 0.5 * self.settings.padding * self.size();
        let columns = ((self.frame.0 as f64 / spacing).ceil() as u64).max(1);
        let rows = ((self.frame.1 as f64 / spacing).ceil() as u64).max(1);
        let mut draws = self.stream.draws(Purpose::Other, self.steps, 0);
        (0..self.settings.searches as u64)
            .map(|k| {
                if k % 2 == 0 {
                    let i = (draws.uniform() * self.cloud().len() as f64) as usize;
                    return self.on_frame(self.cloud().particle(i.min(self.cloud().len() - 1)));
                }
                let cell = (self.unseen * (self.settings.searches as u64 / 2) + k / 2) % (columns * rows);
                [
                    (cell % columns) as f64 * spacing + spacing / 2.0,
                    (cell / columns) as f64 * spacing + spacing / 2.0,
                ]
            })
            .collect()
    }
}

/// The rules of a step: particles about `centre` with a standard deviation of `sd` pixels to begin with, which wander by
/// as much. Responses are peaked, so they are taken in by degrees.
fn rules(
    centre: [f64; 2],
    sd: f64,
    sensor: Responses,
    settings: &Settings,
) -> Result<Tempered<2, 2, Wander, Responses>> {
    let prior = Gaussian::independent(centre, [sd; 2])?;
    let plain = ParticleFilter::new(prior, Wander { sd }, sensor, settings.clone())?;
    Ok(Tempered::new(plain, Move::RandomWalk { scale: None }, 1)?)
}

impl Tracker for CorrelationTracker {
    fn step(&mut self, frame: &Frame) -> Result<Estimate> {
        if frame.size() != self.frame {
            return Err(Error::Size { found: frame.size(), expected: self.frame });
        }
        self.steps += 1;
        let now = Time::from_nanos(self.steps as i64 * 1_000_000_000);
        let was_lost = self.visibility.is_lost();
        self.maps.clear();
        let (map, mut signs) = self.search(frame, self.centre);
        let mut found = map.peak().1;
        self.maps.push(map);
        if was_lost {
            for place in self.elsewhere() {
                let (map, there) = self.search(frame, place);
                if there.evidence() > signs.evidence().max(RETURN) {
                    (signs, found) = (there, map.peak().1);
                }
                self.maps.push(map);
            }
        }
        let p_lost = self.visibility.update(&signs);
        let lost = self.visibility.is_lost();
        let sd = self.settings.motion_sd * self.size();
        let sensor = Responses { sharpness: if lost { 0.0 } else { self.settings.sharpness } };
        let rules = rules(found, sd, sensor, &self.filter)?;
        if was_lost && !lost {
            // It shows again, and the cloud need not have a particle there.
            let before = self.cloud().time();
            self.belief = rules.start(before, self.stream.fork(self.steps))?;
        }
        rules.step(&mut self.belief, now, Some(&self.maps))?;
        self.signs = signs;
        self.unseen = if lost { self.unseen + 1 } else { 0 };
        if !lost || signs.evidence() > HOPELESS {
            self.centre = self.on_frame(found);
        }
        if !lost {
            let grown = self.sizes.estimate(frame, self.bounds_about(self.centre));
            self.scale = (self.scale * grown).clamp(SCALES.0, SCALES.1);
        }
        let share = ((signs.evidence() - DOUBT.0) / (DOUBT.1 - DOUBT.0)).clamp(0.0, 1.0);
        if share > 0.0 {
            self.learn(frame, share);
        }
        let mut covariance = self.cloud().covariance().0;
        let spread = (self.settings.box_sd * self.size()).square();
        // An object in the frame is at least as well known as one that may be anywhere in it.
        let anywhere = [self.frame.0, self.frame.1].map(|side| (side as f64).square() / 12.0);
        for k in 0..2 {
            covariance[k][k] += spread;
            let shrink = (anywhere[k] / covariance[k][k]).min(1.0).sqrt();
            covariance[k][k] *= shrink * shrink;
            covariance[0][1] *= shrink;
            covariance[1][0] *= shrink;
        }
        // The looks are learnt about the peak, and where the object is said to be is the posterior's mean.
        let centre = if lost { self.centre } else { self.on_frame(self.cloud().mean()) };
        Ok(Estimate { bounds: self.bounds_about(centre), covariance, score: signs.followed, p_lost })
    }

    fn particles(&self) -> Vec<Particle> {
        if self.steps == 0 {
            return Vec::new();
        }
        let cloud = self.cloud();
        let centres = cloud.column(0).iter().zip(cloud.column(1));
        centres.zip(cloud.weights()).map(|((x, y), weight)| Particle { centre: [*x, *y], weight }).collect()
    }
}
