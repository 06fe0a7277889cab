//! Balls that come, meet and go: one particle filter each, told apart by where they were going.
//!
//! In every frame the balls' places are predicted. A part of the picture that several balls claim is their discs
//! together: [`disc::fit`](super::disc::fit) finds them by their rims. Detections and balls are then paired at the
//! least cost of distance from the prediction, area and colour; what is left over is a new ball.

use super::belief::{BallBelief, BallModel, BallMotion, Known, Spot};
use super::detector::{Blob, Detector, ROUND, Seen};
use super::disc::{Disc, Fitted, circle, fit, inscribed};
use crate::{Error, Frame, Result};
use zerre::Time;
use zerre::filter::Settings;
use zerre::math::assignment::assign;
use zerre::math::{Cholesky, Matrix, ln};
use zerre::rng::Stream;

/// How balls are followed.
#[derive(Clone, Debug)]
pub struct TrackerSettings {
    /// The motion.
    pub motion: BallMotion,
    /// Process noise after a frame; see [`BallModel::process_sd`].
    pub process_sd: f64,
    /// Standard deviation of a whole ball's detected place, px.
    pub measurement_sd: f64,
    /// Most balls at a time; no limit by default.
    pub count: Option<usize>,
    /// Detections after which a ball is believed.
    pub confirm: usize,
    /// Frames without a detection after which it is given up.
    pub patience: usize,
    /// Particles, resampling and so on.
    pub filter: Settings,
}

impl TrackerSettings {
    /// The defaults of a motion: velocities change by 1.5 px per frame, places by 8 px. Particles are resampled
    /// and moved with the detection in view, which is exact here and leaves their weights equal (full adaptation:
    /// Pitt and Shephard, Journal of the American Statistical Association 94, 1999).
    pub fn of(motion: BallMotion) -> TrackerSettings {
        let process_sd = match motion {
            BallMotion::ConstantVelocity => 1.5,
            BallMotion::RandomWalk => 8.0,
        };
        TrackerSettings {
            motion,
            process_sd,
            measurement_sd: 0.5,
            count: None,
            confirm: 4,
            patience: 10,
            filter: Settings { lookahead: Some(1.0), ..Settings::default() },
        }
    }
}

impl Default for TrackerSettings {
    fn default() -> Self {
        TrackerSettings::of(BallMotion::default())
    }
}

/// A ball in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct BallRow {
    /// The frame, from 0.
    pub frame: usize,
    /// The ball's number, from 1.
    pub ball: usize,
    /// What is known of it.
    pub known: Known,
    /// Its area when it was last seen whole and alone, px; NaN before.
    pub area: f64,
    /// Where it was detected in this frame, if it was.
    pub detected: Option<[f64; 2]>,
}

/// What did not go as planned, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// Filters that were started again because a ball was not where any of their particles were: bounces.
    pub restarts: usize,
    /// Parts of the picture that were the discs of several balls.
    pub shared: usize,
    /// Parts that were too large for a ball.
    pub too_large: usize,
    /// Tracks that were too short to be believed.
    pub short: usize,
}

/// A detection: a place and what it may be compared by.
#[derive(Clone, Copy, Debug)]
struct Detection {
    spot: Spot,
    radius: f64,
    /// Area and colour, where the ball is seen whole and alone.
    look: Option<(f64, [f64; 3])>,
}

#[derive(Clone, Debug)]
struct Track {
    number: usize,
    belief: BallBelief,
    radius: f64,
    look: Option<(f64, [f64; 3])>,
    first: [f64; 2],
    last: ([f64; 2], usize),
    hits: usize,
    missed: usize,
    believed: bool,
}

/// Follows balls from frame to frame.
#[derive(Clone, Debug)]
pub struct Tracker {
    settings: TrackerSettings,
    model: BallModel,
    stream: Stream,
    tracks: Vec<Track>,
    started: usize,
    restarts: u64,
    rows: Vec<BallRow>,
    believed: Vec<usize>,
    counted: Counted,
}

/// Cost above which a detection is not a ball's: squared standard deviations.
const GATE: f64 = 25.0;
/// Surprise of a filter, squared standard deviations, from which on it is started again.
const SURPRISE: f64 = 20.0;
/// Slack of the pairing for bounces, in radii.
const SLACK: f64 = 0.35;
/// Standard deviations of the logarithm of an area, and of a channel's mean, between frames.
const AREA_SD: f64 = 0.2;
const COLOUR_SD: f64 = 25.0;
/// A part larger than this many times what it should be is not one ball.
const LARGER: f64 = 1.35;
/// Least share of the rim that a place is believed of.
const LEAST_ARC: f64 = 0.12;
/// Speed of what is seen for the first time, as a share of the picture's diagonal per frame.
const NEW_SPEED: f64 = 0.03;
/// Most balls in one part.
const MOST_TOGETHER: usize = 8;
/// Frames without a detection after which an unbelieved track is given up.
const SHORT_PATIENCE: usize = 2;

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt()
}

impl Tracker {
    /// A tracker that has seen nothing yet.
    ///
    /// # Errors
    /// Settings that are not finite or out of range.
    pub fn new(settings: TrackerSettings, stream: Stream) -> Result<Tracker> {
        for (what, value) in [
            ("process noise of a ball", settings.process_sd),
            ("standard deviation of a ball's detected place", settings.measurement_sd),
        ] {
            zerre::Error::positive(what, value)?;
        }
        if settings.count == Some(0) || settings.confirm == 0 {
            let (what, needs) = ("number of balls or of detections to believe one", "at least one is needed");
            return Err(Error::OutOfRange { what, value: 0.0, needs });
        }
        let TrackerSettings { motion, process_sd, ref filter, .. } = settings;
        let model = BallModel { motion, process_sd, filter: filter.clone() };
        // What the filter refuses is refused now.
        let spot = Spot { at: [0.0; 2], sd: settings.measurement_sd };
        model.start(Time::ZERO, spot, ([0.0; 2], 1.0), stream)?;
        Ok(Tracker {
            settings,
            model,
            stream,
            tracks: Vec::new(),
            started: 0,
            restarts: 0,
            rows: Vec::new(),
            believed: Vec::new(),
            counted: Counted::default(),
        })
    }

    /// Takes in the next frame, whose number is `index`; numbers rise.
    ///
    /// # Errors
    /// A frame of another size than the ground.
    pub fn step(&mut self, index: usize, frame: &Frame, detector: &Detector) -> Result<()> {
        let seen = detector.see(frame)?;
        self.take(index, &seen, detector)
    }

    /// [`Tracker::step`] of what a detector saw. A frame that could not be read may be left out: the next one is
    /// predicted for over the gap.
    ///
    /// # Errors
    /// An index that does not rise.
    pub fn take(&mut self, index: usize, seen: &Seen, detector: &Detector) -> Result<()> {
        self.counted.too_large += seen.too_large;
        let at = frame_time(index);
        let foretold: Vec<Known> =
            self.tracks.iter().map(|track| self.model.foretell(&track.belief)).collect();
        let detections = self.detections(&seen.blobs, &foretold, detector.typical_area() as f64);
        let pairs = self.pair(&detections, &foretold)?;
        let mut free = vec![true; detections.len()];
        for (place, paired) in pairs.into_iter().enumerate() {
            match paired.and_then(|d| detections.get(d).map(|detection| (d, *detection))) {
                Some((d, detection)) => {
                    free[d] = false;
                    self.hit(place, (index, at), &detection, &foretold[place])?;
                }
                None => {
                    self.tracks[place].belief.step(at, None)?;
                    self.tracks[place].missed += 1;
                }
            }
        }
        let alive = |track: &Track| {
            let patience = if track.believed { self.settings.patience } else { SHORT_PATIENCE };
            track.missed <= patience
                && (track.missed == 0 || detector.ground().holds(track.belief.known().centre))
        };
        self.tracks.retain(alive);
        let size = detector.ground().picture().size();
        for (detection, _) in detections.iter().zip(&free).filter(|(_, free)| **free) {
            self.begin((index, at), detection, size)?;
        }
        for track in &self.tracks {
            self.rows.push(BallRow {
                frame: index,
                ball: track.number,
                known: track.belief.known(),
                area: track.look.map_or(f64::NAN, |(area, _)| area),
                detected: (track.missed == 0).then_some(track.last.0),
            });
        }
        Ok(())
    }

    /// Which ball claims which part: the one that its prediction is in, or nearest to.
    fn claims(&self, blobs: &[Blob], foretold: &[Known]) -> Vec<Vec<usize>> {
        let mut claims = vec![Vec::new(); blobs.len()];
        for (place, (track, known)) in self.tracks.iter().zip(foretold).enumerate() {
            let [[xx, _], [_, yy]] = known.covariance;
            let reach = track.radius + 3.0 * xx.max(yy).sqrt();
            let far = |blob: &Blob| {
                if blob.covers(known.centre) {
                    0.0
                } else {
                    (distance(blob.centroid, known.centre) - blob.radius()).max(1e-3)
                }
            };
            let nearest = blobs.iter().map(far).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((blob, _)) = nearest.filter(|(_, far)| *far <= reach) {
                claims[blob].push(place);
            }
        }
        claims
    }

    fn detections(&mut self, blobs: &[Blob], foretold: &[Known], typical: f64) -> Vec<Detection> {
        let claims = self.claims(blobs, foretold);
        let mut all = Vec::new();
        for (blob, claims) in blobs.iter().zip(&claims) {
            let outline = blob.outline();
            let claimed: Vec<Disc> = claims
                .iter()
                .map(|at| Disc { centre: foretold[*at].centre, radius: self.tracks[*at].radius })
                .collect();
            let areas = || claims.iter().map(|at| self.tracks[*at].look.map(|(area, _)| area));
            let largest = areas().flatten().fold(0.0, f64::max);
            // Of balls that were never seen whole, and of a new one, the radius is not known yet.
            let explained = areas().map(|area| area.unwrap_or(typical)).sum::<f64>().max(typical);
            let is_round = circle(&outline).is_some_and(|(_, residual)| residual < ROUND);
            let fits = largest == 0.0 || (blob.area as f64) < LARGER * largest;
            if !(is_round && fits) {
                let found = self.apart(blob, &outline, (claimed, explained));
                if found.len() > 1 {
                    self.counted.shared += 1;
                    let sd = 3.0 * self.settings.measurement_sd;
                    let of = |one: &Fitted| Detection {
                        spot: Spot { at: one.disc.centre, sd },
                        radius: one.disc.radius,
                        look: None,
                    };
                    all.extend(found.iter().map(of));
                    continue;
                }
            }
            let whole = !blob.clipped && (is_round || fits);
            all.push(self.alone((blob, whole), &outline, claims, foretold));
        }
        all
    }

    /// The discs that a part is made of: those of the balls that claim it, and those that lie in it beside them
    /// where these explain too few of its pixels.
    fn apart(
        &self,
        blob: &Blob,
        outline: &[[f64; 2]],
        (mut starts, explained): (Vec<Disc>, f64),
    ) -> Vec<Fitted> {
        let (width, height) = blob.mask.size();
        let inside: Vec<[f64; 2]> = (0..height)
            .step_by(2)
            .flat_map(|y| (0..width).step_by(2).map(move |x| (x, y)))
            .filter(|(x, y)| blob.mask.row(*y)[*x] != 0)
            .map(|(x, y)| [(blob.corner[0] + x) as f64 - 0.5, (blob.corner[1] + y) as f64 - 0.5])
            .collect();
        if (blob.area as f64) > LARGER * explained {
            for disc in inscribed(&inside, outline, MOST_TOGETHER) {
                let beside = |other: &Disc| distance(other.centre, disc.centre) > other.radius;
                if starts.len() < MOST_TOGETHER && starts.iter().all(beside) {
                    starts.push(disc);
                }
            }
        }
        let mut found = fit(outline, &starts);
        found.retain(|one| {
            one.arc >= LEAST_ARC && one.residual < 1.5 * ROUND && {
                let near = |p: &[f64; 2]| distance(*p, one.disc.centre) < 0.5 * one.disc.radius;
                inside.iter().any(near) || blob.clipped
            }
        });
        found
    }

    /// The detection of a part that is one ball.
    fn alone(
        &self,
        (blob, whole): (&Blob, bool),
        outline: &[[f64; 2]],
        claims: &[usize],
        foretold: &[Known],
    ) -> Detection {
        let sd = self.settings.measurement_sd;
        if whole {
            let look = Some((blob.area as f64, blob.colour));
            return Detection { spot: Spot { at: blob.centroid, sd }, radius: blob.radius(), look };
        }
        if let [only] = claims
            && self.tracks[*only].look.is_some()
        {
            let start = Disc { centre: foretold[*only].centre, radius: self.tracks[*only].radius };
            if let [found] = fit(outline, &[start])[..]
                && found.arc >= LEAST_ARC
                && found.residual < ROUND
            {
                let spot = Spot { at: found.disc.centre, sd: 3.0 * sd };
                return Detection { spot, radius: start.radius, look: None };
            }
        }
        // The middle of what is seen is not that of the ball.
        let radius = blob.radius();
        Detection { spot: Spot { at: blob.centroid, sd: sd + 0.3 * radius }, radius, look: None }
    }

    /// The detection of each track, by the least sum of costs; what costs more than the gate stays alone.
    fn pair(&self, detections: &[Detection], foretold: &[Known]) -> Result<Vec<Option<usize>>> {
        let (rows, columns) = (self.tracks.len(), detections.len() + self.tracks.len());
        let mut cost = vec![GATE; rows * columns];
        for (r, (track, known)) in self.tracks.iter().zip(foretold).enumerate() {
            for (c, detection) in detections.iter().enumerate() {
                let slack = SLACK * track.radius.max(detection.radius);
                let off = surprise(known, &detection.spot, slack)?;
                let look = match (track.look, detection.look) {
                    (Some((a, colour)), Some((b, other))) => {
                        let colours: f64 = (0..3).map(|k| (colour[k] - other[k]).powi(2)).sum();
                        (ln(a / b) / AREA_SD).powi(2) + colours / (3.0 * COLOUR_SD * COLOUR_SD)
                    }
                    _ => 0.0,
                };
                // What is beyond the gate may not win by leaving others out of it.
                cost[r * columns + c] = if off + look < GATE { off + look } else { 1e3 * GATE };
            }
        }
        let found = assign(&cost, rows, columns)?.column_of_row;
        Ok(found.into_iter().map(|column| column.filter(|c| *c < detections.len())).collect())
    }

    fn hit(
        &mut self,
        place: usize,
        (index, at): (usize, Time),
        detection: &Detection,
        known: &Known,
    ) -> Result<()> {
        let track = &mut self.tracks[place];
        let since = (index - track.last.1).max(1) as f64;
        let surprised = surprise(known, &detection.spot, 0.0)? > SURPRISE;
        let mut starts_again = track.hits == 1 || surprised;
        if !starts_again {
            starts_again = !track.belief.step(at, Some(&detection.spot))?;
        }
        if starts_again {
            // Two places say how fast it goes.
            let moved = [0, 1].map(|k| (detection.spot.at[k] - track.last.0[k]) / since);
            let sd =
                (2.0 * detection.spot.sd.powi(2) / (since * since) + self.model.process_sd.powi(2)).sqrt();
            self.restarts += 1;
            let stream = self.stream.fork(track.number as u64).fork(self.restarts);
            track.belief = self.model.start(at, detection.spot, (moved, sd), stream)?;
            self.counted.restarts += usize::from(track.hits > 1);
        }
        track.hits += 1;
        track.missed = 0;
        track.last = (detection.spot.at, index);
        if let Some((area, colour)) = detection.look {
            track.radius = detection.radius;
            track.look = Some((area, colour));
        } else if track.look.is_none() {
            track.radius = track.radius.max(detection.radius);
        }
        // What is cut off by the border and never moves is no ball: pockets of a table are such.
        let rolls = track.look.is_some() || distance(track.first, detection.spot.at) > track.radius;
        if !track.believed && track.hits >= self.settings.confirm && rolls {
            track.believed = true;
            self.believed.push(track.number);
        }
        Ok(())
    }

    fn begin(
        &mut self,
        (index, at): (usize, Time),
        detection: &Detection,
        (width, height): (usize, usize),
    ) -> Result<()> {
        if self.settings.count.is_some_and(|count| self.tracks.len() >= count) {
            return Ok(());
        }
        self.started += 1;
        let diagonal = distance([0.0; 2], [width as f64, height as f64]);
        let stream = self.stream.fork(self.started as u64);
        let belief = self.model.start(at, detection.spot, ([0.0; 2], NEW_SPEED * diagonal), stream)?;
        self.tracks.push(Track {
            number: self.started,
            belief,
            radius: detection.radius,
            look: detection.look,
            first: detection.spot.at,
            last: (detection.spot.at, index),
            hits: 1,
            missed: 0,
            believed: false,
        });
        Ok(())
    }

    /// Balls that are followed now: number, what is known, radius (px), whether it was detected, particles.
    pub fn balls(&self) -> impl Iterator<Item = Ball<'_>> {
        self.tracks.iter().map(|track| Ball {
            number: track.number,
            radius: track.radius,
            believed: track.believed,
            detected: track.missed == 0,
            belief: &track.belief,
        })
    }

    /// What did not go as planned so far.
    pub fn counted(&self) -> Counted {
        self.counted
    }

    /// All balls that were believed, frame by frame, each from its first detection to its last; they are numbered in
    /// the order in which they came.
    pub fn finish(mut self) -> (Vec<BallRow>, Counted) {
        self.believed.sort_unstable();
        let mut last = vec![0; self.started + 1];
        for row in self.rows.iter().filter(|row| row.detected.is_some()) {
            last[row.ball] = row.frame;
        }
        self.counted.short = self.started - self.believed.len();
        let mut rows = self.rows;
        rows.retain_mut(|row| {
            let number = self.believed.binary_search(&row.ball);
            let kept = number.is_ok() && row.frame <= last[row.ball];
            row.ball = number.map_or(row.ball, |number| number + 1);
            kept
        });
        (rows, self.counted)
    }
}

/// A ball that is followed.
#[derive(Clone, Copy, Debug)]
pub struct Ball<'a> {
    /// Its number in the order of first detections; [`Tracker::finish`] leaves out those that were not believed.
    pub number: usize,
    /// Its radius, px.
    pub radius: f64,
    /// Whether it was detected often enough.
    pub believed: bool,
    /// Whether it was detected in the last frame.
    pub detected: bool,
    /// What is known of it.
    pub belief: &'a BallBelief,
}

/// Time of a frame: a second each.
pub(super) fn frame_time(index: usize) -> Time {
    Time::from_nanos(index as i64 * 1_000_000_000)
}

/// Squared distance of a spot from its prediction in standard deviations of both, `slack` px being added to these.
fn surprise(known: &Known, spot: &Spot, slack: f64) -> Result<f64> {
    let mut law = Matrix(known.covariance);
    (0..2).for_each(|k| law.0[k][k] += spot.sd * spot.sd + slack * slack);
    let off = [0, 1].map(|k| spot.at[k] - known.centre[k]);
    Ok(Cholesky::of("covariance of a predicted ball", &law)?.mahalanobis_squared(&off))
}
