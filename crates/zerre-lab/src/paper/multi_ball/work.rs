//! Single runs.

use super::settings::{
    ACCELERATION, BALLS, BURN_IN, FRAMES, MEASUREMENT_SD, MEETING_PARTICLES, MEETINGS, SCENE, SPEED,
    START_SD, VELOCITY_SD, WALK_SD,
};
use super::{FILTERS, MultiBall, Outcome, Part};
use crate::balls::{TruthTable, score};
use crate::study::world::{Problem, Record};
use cpu_time::ThreadTime;
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Filter, Kalman, Linear, Outcome as Fate, ParticleFilter, Settings};
use zerre::model::Motion;
use zerre::model::measurement::Position;
use zerre::model::motion::{ConstantVelocity, RandomWalk};
use zerre::model::{GaussianMeasurement, Measurement};
use zerre::proposal::{Bootstrap, Guided, Proposal};
use zerre::resample::Resampling;
use zerre::rng::Stream;
use zerre::{Error, Time};
use zerre_vision::Frame;
use zerre_vision::balls::thesis::{ByArea, READINGS, Reading, ThesisFilter, by_area};
use zerre_vision::balls::{
    BallRow, Detector, DetectorSettings, SCENES, Scene, SceneSettings, Tracker, TrackerSettings,
};

/// Frames between those that the detector learns from.
const SAMPLED: usize = 15;

/// A clip as its detector saw it.
pub(super) struct Clip {
    pub scene: Scene,
    /// Of each frame and ball, the largest first, the detected place.
    pub detected: Vec<Vec<Option<[f64; 2]>>>,
    /// Processor time of the detector, s.
    pub seconds: f64,
}

/// Of one filter per ball: estimates and what they were given.
pub(super) struct Followed {
    /// Of each frame and ball.
    pub estimates: Vec<Vec<[f64; 2]>>,
    /// The detections with the noise that was added.
    pub measured: Vec<Vec<Option<[f64; 2]>>>,
}

fn refused(error: zerre_vision::Error) -> Error {
    match error {
        zerre_vision::Error::Filter(error) => error,
        error => Error::Unsupported(error.to_string()),
    }
}

fn named(name: &str) -> zerre::Result<SceneSettings> {
    let named = SCENES.iter().find(|named| named.name == name);
    let named = named.ok_or_else(|| Error::Unsupported(format!("there is no scene `{name}`")))?;
    Ok((named.settings)())
}

pub(super) fn detector(scene: &Scene) -> zerre::Result<Detector> {
    let samples: Vec<Frame> = (0..scene.len()).step_by(SAMPLED).map(|k| scene.frame(k)).collect();
    Detector::new(&DetectorSettings::default(), &samples).map_err(refused)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt()
}

/// A filter of the thesis for each ball of a clip.
pub(super) fn follow(
    clip: &Clip,
    reading: &Reading,
    particles: usize,
    luck: Stream,
) -> zerre::Result<Followed> {
    let size = clip.scene.settings().size;
    let luck = luck.fork(particles as u64);
    let filter = |ball| {
        let settings = (particles, Resampling::Multinomial);
        ThesisFilter::new(reading, ball, size, settings, luck.fork(ball as u64)).map_err(refused)
    };
    let mut filters = (0..BALLS.len()).map(filter).collect::<zerre::Result<Vec<_>>>()?;
    let (mut estimates, mut measured) = (Vec::new(), Vec::new());
    for detected in &clip.detected {
        let (mut places, mut given) = (Vec::new(), Vec::new());
        for (filter, detected) in filters.iter_mut().zip(detected) {
            let noisy = detected.map(|place| filter.measured(place));
            places.push(filter.step(noisy).map_err(refused)?);
            given.push(noisy);
        }
        estimates.push(places);
        measured.push(given);
    }
    Ok(Followed { estimates, measured })
}

impl MultiBall {
    /// The clip of a run; `None` if `stop` says so meanwhile.
    pub(super) fn clip(&self, run: usize, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Clip>> {
        let calm = SceneSettings { speed: SPEED, acceleration: ACCELERATION, ..named(SCENE)? };
        let scene = Scene::new(calm, self.clip_seed(Part::Table, run));
        let detector = detector(&scene)?;
        let (mut detected, mut seconds) = (Vec::new(), 0.0);
        for k in 0..scene.len() {
            if stop() {
                return Ok(None);
            }
            let frame = scene.frame(k);
            let since = ThreadTime::now();
            let seen = detector.see(&frame).map_err(refused)?;
            let found = by_area(&seen, BALLS.len());
            seconds += since.elapsed().as_secs_f64();
            detected.push(found.into_iter().map(|one| one.map(|(place, _)| place)).collect());
        }
        Ok(Some(Clip { scene, detected, seconds }))
    }

    /// Errors by size, reading, ball and reference.
    pub(super) fn table_run(&self, run: usize, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        let Some(clip) = self.clip(run, stop)? else { return Ok(None) };
        let mut values = Vec::new();
        for particles in &self.request.particles {
            for reading in READINGS {
                if stop() {
                    return Ok(None);
                }
                let followed = follow(&clip, reading, *particles, self.luck(Part::Table, run))?;
                for ball in 0..BALLS.len() {
                    let mut sums = [(0.0, 0.0); 2];
                    for k in reading.burn_in..clip.scene.len() {
                        let estimate = followed.estimates[k][ball];
                        let given = if reading.to_measurement { &followed.measured } else { &clip.detected };
                        let truth = clip.scene.truth(k).get(ball).map(|ball| ball.centre);
                        for ((sum, count), reference) in sums.iter_mut().zip([given[k][ball], truth]) {
                            let Some(reference) = reference else { continue };
                            let off = distance(estimate, reference);
                            *sum += if reading.squared { off * off } else { off };
                            *count += 1.0;
                        }
                    }
                    values.extend(sums.map(|(sum, count)| sum / count));
                }
            }
        }
        let mishaps = clip.detected.iter().flatten().filter(|place| place.is_none()).count();
        Ok(Some(Outcome { values, mishaps }))
    }

    /// By motion: mean squares of the measurements and of the Kalman filter, then of particle filters and
    /// sizes.
    pub(super) fn floor_run(&self, run: usize, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        let luck = self.luck(Part::Floor, run);
        let sensor = Position::<2>::new(MEASUREMENT_SD)?;
        let [place, speed] = START_SD;
        let walk = Problem {
            motion: RandomWalk::<2>::new(WALK_SD * WALK_SD)?,
            sensor,
            prior: Gaussian::independent([0.0; 2], [place; 2])?,
            start: None,
            steps: FRAMES,
            shown: 2,
        };
        let velocity = Problem {
            motion: ConstantVelocity::<2>::new(VELOCITY_SD * VELOCITY_SD)?,
            sensor,
            prior: Gaussian::independent([0.0; 4], [place, place, speed, speed])?,
            start: None,
            steps: FRAMES,
            shown: 2,
        };
        let mut outcome = Outcome::default();
        let all = self.errors(&walk, luck.fork(0), &mut outcome, stop)?
            && self.errors(&velocity, luck.fork(1), &mut outcome, stop)?;
        Ok(all.then_some(outcome))
    }

    fn errors<M, const N: usize>(
        &self,
        problem: &Problem<M, Position<2>, N>,
        luck: Stream,
        outcome: &mut Outcome,
        stop: &dyn Fn() -> bool,
    ) -> zerre::Result<bool>
    where
        M: Motion<N, N> + Clone,
        Position<2>: GaussianMeasurement<N, 2> + Measurement<N, Value = [f64; 2]>,
    {
        let records = (0..BALLS.len() as u64)
            .map(|ball| problem.record(luck.fork(ball)))
            .collect::<zerre::Result<Vec<Record<N, 2>>>>()?;
        let steps = (FRAMES - BURN_IN) * records.len();
        let mean = |sum: f64| sum / steps as f64;
        let late = |record: &Record<N, 2>, place: &dyn Fn(usize) -> [f64; 2]| -> f64 {
            let off = |k: usize| distance(place(k), [record.truth[k][0], record.truth[k][1]]).powi(2);
            (BURN_IN..FRAMES).map(off).sum()
        };
        outcome.values.push(mean(records.iter().map(|record| late(record, &|k| record.measured[k])).sum()));
        let kalman = Kalman::new(problem.motion.clone(), problem.sensor, problem.prior)?;
        let mut sum = 0.0;
        for record in &records {
            let mut belief = kalman.start(Time::ZERO, luck)?;
            let mut places = Vec::with_capacity(FRAMES);
            for (at, z) in record.times.iter().zip(&record.measured) {
                kalman.step(&mut belief, *at, Some(z))?;
                let mean = belief.state.mean();
                places.push([mean[0], mean[1]]);
            }
            sum += late(record, &|k| places[k]);
        }
        outcome.values.push(mean(sum));
        for (which, (_, resampling, adapted)) in FILTERS.into_iter().enumerate() {
            for particles in &self.request.particles {
                if stop() {
                    return Ok(false);
                }
                let lookahead = adapted.then_some(1.0);
                let settings =
                    Settings { particles: *particles, resampling, lookahead, ..Settings::default() };
                let luck = luck.fork(1000 + which as u64).fork(*particles as u64);
                let mishaps = &mut outcome.mishaps;
                let all = if adapted {
                    estimates(problem, Guided::<Linear, 2>::new(Linear), settings, &records, luck, mishaps)?
                } else {
                    estimates(problem, Bootstrap, settings, &records, luck, mishaps)?
                };
                let each = records.iter().zip(&all);
                outcome.values.push(mean(each.map(|(record, places)| late(record, &|k| places[k])).sum()));
            }
        }
        Ok(true)
    }

    /// By scene and method: identity swaps, and the share of visible balls that were held.
    pub(super) fn identity_run(&self, run: usize, stop: &dyn Fn() -> bool) -> zerre::Result<Option<Outcome>> {
        let mut outcome = Outcome::default();
        for (at, name) in MEETINGS.iter().enumerate() {
            let luck = self.luck(Part::Identity, run).fork(at as u64);
            let scene = Scene::new(named(name)?, self.clip_seed(Part::Identity, run).wrapping_add(at as u64));
            let detector = detector(&scene)?;
            let count = scene.settings().radii.len();

            let first = &READINGS[0];
            let particles = (MEETING_PARTICLES, Resampling::Multinomial);
            let mut by_area =
                ByArea::new(first, count, scene.settings().size, particles, luck).map_err(refused)?;
            let mut tracker = Tracker::new(TrackerSettings::default(), luck).map_err(refused)?;
            for k in 0..scene.len() {
                if stop() {
                    return Ok(None);
                }
                let seen = detector.see(&scene.frame(k)).map_err(refused)?;
                by_area.take(k, &seen).map_err(refused)?;
                tracker.take(k, &seen, &detector).map_err(refused)?;
            }
            let truth = TruthTable::new((0..scene.len()).map(|k| (k, scene.truth(k).to_vec())));
            let (area_rows, missing) = by_area.finish();
            outcome.mishaps += missing;
            let of = |rows: &[BallRow]| score(rows, &truth, scene.len());
            for rows in [area_rows, tracker.finish().0] {
                let scores = of(&rows).map_err(|error| Error::Unsupported(error.to_string()))?;
                outcome.values.extend([scores.swaps as f64, scores.held as f64 / scores.visible as f64]);
            }
        }
        Ok(Some(outcome))
    }
}

/// Places of each record by a particle filter with a proposal.
fn estimates<M, Q, const N: usize>(
    problem: &Problem<M, Position<2>, N>,
    proposal: Q,
    settings: Settings,
    records: &[Record<N, 2>],
    luck: Stream,
    mishaps: &mut usize,
) -> zerre::Result<Vec<Vec<[f64; 2]>>>
where
    M: Motion<N, N> + Clone,
    Position<2>: Measurement<N, Value = [f64; 2]>,
    Q: Proposal<N, N, M, Position<2>>,
{
    let (prior, motion) = (problem.prior, problem.motion.clone());
    let filter = ParticleFilter::guided(prior, motion, problem.sensor, proposal, settings)?;
    let mut all = Vec::new();
    for (ball, record) in (0..).zip(records) {
        let mut cloud: Cloud<N> = filter.start(Time::ZERO, luck.fork(ball))?;
        let mut places = Vec::with_capacity(FRAMES);
        for (at, z) in record.times.iter().zip(&record.measured) {
            let update = filter.step(&mut cloud, *at, Some(z))?;
            *mishaps += usize::from(update.outcome == Fate::Degenerate);
            let mean = cloud.mean();
            places.push([mean[0], mean[1]]);
        }
        all.push(places);
    }
    Ok(all)
}
