//! Processor time per frame.

use super::run::{device, first};
use cpu_time::ThreadTime;
use std::cell::RefCell;
use zerre::rng::Stream;
use zerre_vision::Result;
use zerre_vision::rgbd::scene::Scene;
use zerre_vision::rgbd::thesis::{Thesis, ThesisSettings};
use zerre_vision::rgbd::tracker::{PointTracker, TrackerSettings};
use zerre_vision::rgbd::{Reading, Registration};

/// Times of one stage, frame by frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// Its name in rows.
    pub stage: String,
    /// Particles of the filter that it belongs to.
    pub particles: usize,
    /// Milliseconds.
    pub times: Vec<f64>,
}

/// Takes the times of stages that follow one another.
pub(super) struct Clock {
    particles: usize,
    since: ThreadTime,
    stages: Vec<Timed>,
}

impl Clock {
    pub(super) fn new(particles: usize) -> Clock {
        Clock { particles, since: ThreadTime::now(), stages: Vec::new() }
    }

    /// A stage begins.
    pub(super) fn begin(&mut self) {
        self.since = ThreadTime::now();
    }

    /// It has ended, and the next one begins. Returns what it took.
    pub(super) fn end(&mut self, stage: &str) -> f64 {
        let took = 1000.0 * self.since.elapsed().as_secs_f64();
        self.note(stage, took);
        self.begin();
        took
    }

    pub(super) fn note(&mut self, stage: &str, took: f64) {
        match self.stages.iter_mut().find(|timed| timed.stage == stage) {
            Some(timed) => timed.times.push(took),
            None => self.stages.push(Timed {
                stage: stage.to_owned(),
                particles: self.particles,
                times: vec![took],
            }),
        }
    }

    /// All stages, in the order in which they first ended.
    pub(super) fn stages(self) -> Vec<Timed> {
        self.stages
    }
}

/// The stages of the sound filter and the whole of the thesis's.
pub(super) fn filters(
    scene: &Scene,
    settings: &TrackerSettings,
    thesis: &ThesisSettings,
    frames: usize,
) -> Result<Vec<Timed>> {
    let room = scene.background();
    let lens = scene.camera().colour;
    let start = (&scene.frame(0), first(scene));
    let mut tracker = PointTracker::start(settings.clone(), (room.clone(), lens), start, Stream::new(1))?;
    let mut old = Thesis::start(thesis.clone(), room, first(scene).at, Stream::new(1))?;
    let mut clock = Clock::new(thesis.particles);
    for k in 1..frames.min(scene.len()) {
        let frame = scene.frame(k);
        let said = device(scene, k);
        let said: Vec<(usize, &[Reading])> = said.iter().map(|(s, r)| (*s, r.as_slice())).collect();
        clock.begin();
        let mut sum = 0.0;
        tracker.step(&frame, &said, &mut |stage| sum += clock.end(stage.name()))?;
        clock.note("fused", sum);
        let joint = scene.device(k);
        clock.begin();
        old.step(&frame, joint.as_ref(), [None, None])?;
        clock.end("thesis");
    }
    Ok(clock.stages())
}

/// What does not depend on the number of particles: depth brought to the colours' pixels, and the single
/// steps of the thesis with the copies of their pictures.
pub(super) fn steps(scene: &Scene, thesis: &ThesisSettings, frames: usize) -> Result<Vec<Timed>> {
    let (camera, size) = (scene.camera(), scene.background().0.size());
    let registration = Registration::new(camera, size, size)?;
    let mut shown = Thesis::start(thesis.clone(), scene.background(), first(scene).at, Stream::new(1))?;
    let mut filter = shown.clone();
    let clock = RefCell::new(Clock::new(thesis.particles));
    for k in 1..frames.min(scene.len()) {
        let (raw, frame, joint) = (scene.raw_depth(k), scene.frame(k), scene.device(k));
        clock.borrow_mut().begin();
        registration.register(&raw)?;
        clock.borrow_mut().end("registration");
        let places = {
            let end = |source: &str, step: &str| {
                let mut clock = clock.borrow_mut();
                clock.end(&format!("thesis-{source} {step}"));
            };
            let mut colour = |step: &'static str, _| end("color", step);
            let mut depth = |step: &'static str, _| end("depth", step);
            shown.step(&frame, joint.as_ref(), [Some(&mut colour), Some(&mut depth)])?.places
        };
        clock.borrow_mut().begin();
        filter.fuse(places)?;
        clock.borrow_mut().end("thesis filter");
    }
    Ok(clock.into_inner().stages())
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre_vision::rgbd::scene::SceneSettings;

    /// Every step of the thesis is there once a frame; the last of each way only where something is left.
    #[test]
    fn every_step_is_timed() {
        let settings = SceneSettings { frames: 6, ..SceneSettings::calibration() };
        let scene = Scene::new(settings, 5).unwrap();
        let all = steps(&scene, &ThesisSettings::default(), 100).unwrap();
        let count = |stage: &str| all.iter().find(|timed| timed.stage == stage).map_or(0, |t| t.times.len());
        for stage in
            ["registration", "thesis filter", "thesis-color I1A", "thesis-color I10", "thesis-depth I11"]
        {
            assert_eq!(count(stage), 5, "{stage}");
        }
        assert!(count("thesis-color I11") <= 5 && count("thesis-depth I12") <= 5);
        // Bringing 300 000 pixels elsewhere takes longer than a threshold of 20 000.
        let median = |stage: &str| {
            let mut times = all.iter().find(|timed| timed.stage == stage).unwrap().times.clone();
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        };
        assert!(median("registration") > median("thesis-color I4"));
    }
}
