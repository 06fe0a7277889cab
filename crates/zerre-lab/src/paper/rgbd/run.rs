//! One clip under one condition: what every source said, how far each was off, and what the filters made of it.

use super::evaluation::{Errors, mean_error};
use super::settings::{CALIBRATION_CLIPS, CALIBRATION_ROUNDS, SWEEP_RUNS, Under};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use zerre::rng::{Purpose, Stream};
use zerre_vision::Result;
use zerre_vision::rgbd::Reading;
use zerre_vision::rgbd::calibrate::{Marked, WITHIN_95, calibrate};
use zerre_vision::rgbd::scene::{Scene, SceneSettings};
use zerre_vision::rgbd::thesis::{Thesis, ThesisSettings};
use zerre_vision::rgbd::tracker::{PointTracker, TrackerSettings};

/// What became of a clip.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClipOutcome {
    /// Distance from the truth by source, of every frame but the first; those of filters are of their first run.
    pub errors: BTreeMap<String, Errors>,
    /// The same for further runs of the sound filter.
    pub further: Vec<Errors>,
    /// Whether the hand is before the body.
    pub overlap: Vec<bool>,
    /// Share of the hand that can be seen.
    pub visible: Vec<f64>,
    /// By run and frame: whether it was flagged as lost, and whether its 95 % ellipse holds the truth.
    pub flags: Vec<Vec<(bool, bool)>>,
    /// What the operators' mean is off by their scatter alone, as that tells, pixels: nothing below it can be measured.
    #[serde(default)]
    pub floor: Errors,
}

/// What became of a number of particles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SweepOutcome {
    /// By source (device, colour, depth of the thesis, its filter) and frame: squared distance from the operators' mean,
    /// the filter's averaged over its runs, px².
    pub squares: Vec<Vec<f64>>,
    /// Squared distances of the runs of the thesis's filter from the operators' mean, px².
    pub runs: Vec<Vec<f64>>,
    /// Distance of one run of the thesis's filter, and of the sound one, from the truth, px.
    pub thesis: Errors,
    /// Of the sound filter.
    pub fused: Errors,
}

/// The seed of a clip: calibration clips are counted from the other end.
fn scene(settings: SceneSettings, seed: u64, clip: u64) -> Result<Scene> {
    let mut draws = Stream::new(seed).fork(clip).draws(Purpose::Other, 0, 0);
    Scene::new(settings, draws.next_u64())
}

/// A clip of a condition.
pub(super) fn clip(under: &Under, seed: u64, clip: usize) -> Result<Scene> {
    scene(SceneSettings::condition(under.scene), seed, clip as u64)
}

/// The hand's first place: what the device says first.
pub(super) fn first(scene: &Scene) -> Reading {
    let said = (0..scene.len()).find_map(|k| scene.device(k));
    said.unwrap_or(Reading { at: scene.truth(0).hand, depth_mm: None, confidence: 1.0 })
}

/// What the device says in a frame, as a tracker takes it.
pub(super) fn device(scene: &Scene, k: usize) -> Vec<(usize, Vec<Reading>)> {
    scene.device(k).map(|reading| (0, vec![reading])).into_iter().collect()
}

/// The settings of the sound filter under a condition, learnt from the calibration clips of a seed with the same sources.
pub(super) fn learnt(without: Option<&str>, seed: u64) -> Result<TrackerSettings> {
    let mut settings = TrackerSettings::default();
    match without {
        Some("device") => settings.sources.clear(),
        Some("color") => settings.colour = None,
        Some("depth") => settings.depth = None,
        _ => {}
    }
    let scenes = (0..CALIBRATION_CLIPS)
        .map(|k| scene(SceneSettings::calibration(), seed, u64::MAX - k))
        .collect::<Result<Vec<Scene>>>()?;
    let has_device = !settings.sources.is_empty();
    let closures: Vec<_> = scenes
        .iter()
        .map(|scene| {
            (
                move |k| Ok(scene.frame(k)),
                move |k| if has_device { device(scene, k) } else { Vec::new() },
                move |k| {
                    let truth = scene.truth(k);
                    (truth.visible > 0.0).then_some((truth.hand, Some(truth.hand_mm[2])))
                },
            )
        })
        .collect();
    let clips: Vec<Marked<'_>> = (scenes.iter().zip(&closures))
        .map(|(scene, (frame, others, truth))| Marked {
            room: scene.background(),
            lens: scene.camera().colour,
            first: first(scene),
            frames: scene.len(),
            frame,
            others,
            truth,
        })
        .collect();
    calibrate(&settings, &clips, CALIBRATION_ROUNDS, Stream::new(seed).fork(CALIBRATION_CLIPS))
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Whether a normal law's 95 % ellipse holds a point.
fn holds(at: [f64; 2], covariance: [[f64; 2]; 2], truth: [f64; 2]) -> bool {
    let off = [truth[0] - at[0], truth[1] - at[1]];
    let [[a, b], [_, c]] = covariance;
    off[0] * off[0] * c - 2.0 * off[0] * off[1] * b + off[1] * off[1] * a <= WITHIN_95 * (a * c - b * b)
}

/// Mean of what the operators mark, where any does, and how far it is off by their scatter.
fn operators(scene: &Scene, k: usize) -> (Option<[f64; 2]>, Option<f64>) {
    let marks: Vec<[f64; 2]> = scene.operators(k).into_iter().flatten().collect();
    let n = marks.len() as f64;
    let mean = (!marks.is_empty()).then(|| [0, 1].map(|i| marks.iter().map(|m| m[i]).sum::<f64>() / n));
    (mean, mean_error(&marks))
}

/// All filters on a clip.
pub(super) fn compare(
    scene: &Scene,
    settings: &TrackerSettings,
    thesis: &ThesisSettings,
    (runs, stream): (usize, Stream),
) -> Result<ClipOutcome> {
    let room = scene.background();
    let lens = scene.camera().colour;
    let start = scene.frame(0);
    let mut trackers = (0..runs as u64)
        .map(|run| {
            PointTracker::start(
                settings.clone(),
                (room.clone(), lens),
                (&start, first(scene)),
                stream.fork(run),
            )
        })
        .collect::<Result<Vec<_>>>()?;
    let mut old = Thesis::start(thesis.clone(), room, first(scene).at, stream)?;
    let has_device = !settings.sources.is_empty();
    let mut outcome = ClipOutcome { flags: vec![Vec::new(); runs], ..ClipOutcome::default() };
    outcome.further = vec![Vec::new(); runs.saturating_sub(1)];
    let names: Vec<String> = settings.all_sources().map(|source| source.name.clone()).collect();
    let mut note = |name: &str, error: Option<f64>| match outcome.errors.get_mut(name) {
        Some(errors) => errors.push(error),
        None => drop(outcome.errors.insert(name.to_owned(), vec![error])),
    };
    for k in 1..scene.len() {
        let frame = scene.frame(k);
        let truth = scene.truth(k);
        outcome.overlap.push(truth.overlap);
        outcome.visible.push(truth.visible);
        let said = if has_device { device(scene, k) } else { Vec::new() };
        let said: Vec<(usize, &[Reading])> = said.iter().map(|(s, r)| (*s, r.as_slice())).collect();
        for (run, tracker) in trackers.iter_mut().enumerate() {
            let tracked = tracker.step(&frame, &said, &mut |_| ())?;
            let off = distance(tracked.fused.at, truth.hand);
            let held = holds(tracked.fused.at, tracked.fused.covariance, truth.hand);
            outcome.flags[run].push((tracked.fused.is_lost(), held));
            if run > 0 {
                outcome.further[run - 1].push(Some(off));
                continue;
            }
            note("fused", Some(off));
            for (name, said) in names.iter().zip(&tracked.said) {
                // The cue's own answer is the reading that is nearest to where it was told to look.
                let off = |reading: &Reading| distance(reading.at, tracked.search.at);
                let all = said.iter().flat_map(|said| &said.readings);
                let best = all.reduce(|best, next| if off(next) < off(best) { next } else { best });
                note(name, best.map(|reading| distance(reading.at, truth.hand)));
            }
        }
        if !has_device {
            note("device", scene.device(k).map(|reading| distance(reading.at, truth.hand)));
        }
        let step = old.step(&frame, scene.device(k).as_ref(), [None, None])?;
        note("thesis", Some(distance(step.estimate, truth.hand)));
        for (name, place) in ["thesis-color", "thesis-depth"].into_iter().zip(&step.places[1..]) {
            note(name, place.map(|place| distance(place, truth.hand)));
        }
        let (mean, floor) = operators(scene, k);
        note("operators", mean.map(|mean| distance(mean, truth.hand)));
        outcome.floor.push(floor);
    }
    Ok(outcome)
}

/// The thesis's filter with so many particles, often, and the sound one once.
pub(super) fn sweep(
    scene: &Scene,
    settings: &TrackerSettings,
    thesis: &ThesisSettings,
    stream: Stream,
) -> Result<SweepOutcome> {
    let room = scene.background();
    let frame = scene.frame(0);
    let begin = first(scene);
    let lens = scene.camera().colour;
    let mut tracker =
        PointTracker::start(settings.clone(), (room.clone(), lens), (&frame, begin), stream.fork(u64::MAX))?;
    // The places depend on the device alone: they are found once for all runs.
    let mut finder =
        Thesis::start(ThesisSettings { particles: 1, ..thesis.clone() }, room.clone(), begin.at, stream)?;
    let mut filters = (0..SWEEP_RUNS as u64)
        .map(|run| Thesis::start(thesis.clone(), room.clone(), begin.at, stream.fork(run)))
        .collect::<Result<Vec<_>>>()?;
    let mut outcome = SweepOutcome {
        squares: vec![Vec::new(); 4],
        runs: vec![Vec::new(); SWEEP_RUNS],
        ..SweepOutcome::default()
    };
    let mut last = [begin.at; 3];
    for k in 1..scene.len() {
        let frame = scene.frame(k);
        let truth = scene.truth(k).hand;
        let reference = operators(scene, k).0.unwrap_or(truth);
        let places = finder.step(&frame, scene.device(k).as_ref(), [None, None])?.places;
        for s in 0..3 {
            // A source that says nothing stays where it was: the thesis has a place in every frame.
            last[s] = places[s].unwrap_or(last[s]);
            outcome.squares[s].push(distance(last[s], reference).powi(2));
        }
        let mut sum = 0.0;
        for (run, filter) in filters.iter_mut().enumerate() {
            let estimate = filter.fuse(places)?.estimate;
            let square = distance(estimate, reference).powi(2);
            outcome.runs[run].push(square);
            sum += square;
            if run == 0 {
                outcome.thesis.push(Some(distance(estimate, truth)));
            }
        }
        outcome.squares[3].push(sum / SWEEP_RUNS as f64);
        let said = device(scene, k);
        let said: Vec<(usize, &[Reading])> = said.iter().map(|(s, r)| (*s, r.as_slice())).collect();
        let tracked = tracker.step(&frame, &said, &mut |_| ())?;
        outcome.fused.push(Some(distance(tracked.fused.at, truth)));
    }
    Ok(outcome)
}
