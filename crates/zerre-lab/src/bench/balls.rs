//! Three balls in frames of 640 x 480 pixels: the detector, and the filters behind it.

use super::{Options, Row, repeat, row};
use cpu_time::ThreadTime;
use zerre::filter::Settings;
use zerre::kernels::NoiseSource;
use zerre::rng::Stream;
use zerre::{Error, Result};
use zerre_vision::Frame;
use zerre_vision::balls::{Detector, DetectorSettings, Scene, SceneSettings, Seen, Tracker, TrackerSettings};

/// Frames behind a time.
const FRAMES: usize = 60;
/// Particles of each ball.
const PARTICLES: usize = 1000;

fn refused(error: zerre_vision::Error) -> Error {
    Error::Unsupported(error.to_string())
}

fn clip() -> Result<(Vec<Frame>, Detector)> {
    let scene = Scene::new(SceneSettings { frames: FRAMES, ..SceneSettings::default() }, 1);
    let frames: Vec<Frame> = (0..FRAMES).map(|k| scene.frame(k)).collect();
    let detector = Detector::new(&DetectorSettings::default(), &frames[..1]).map_err(refused)?;
    Ok((frames, detector))
}

/// The detector; a frame counts as one particle.
pub(super) fn detector(workload: &'static str, options: &Options) -> Result<Row> {
    let (frames, detector) = clip()?;
    let spent = repeat(options.budget, 3, || {
        let cpu = ThreadTime::now();
        for frame in &frames {
            std::hint::black_box(detector.see(frame).map_err(refused)?);
        }
        Ok(cpu.elapsed())
    })?;
    Ok(row(workload, NoiseSource::default(), options, 1, &spent, FRAMES as f64))
}

/// Prediction, pairing and three filters of 1 000 particles; a frame counts as one particle.
pub(super) fn filters(workload: &'static str, options: &Options) -> Result<Row> {
    let (frames, detector) = clip()?;
    let seen =
        frames.iter().map(|frame| detector.see(frame).map_err(refused)).collect::<Result<Vec<Seen>>>()?;
    let defaults = TrackerSettings::default();
    let filter = Settings { particles: PARTICLES, simd: options.simd, ..defaults.filter.clone() };
    let settings = TrackerSettings { filter, ..defaults };
    let spent = repeat(options.budget, 3, || {
        let mut tracker = Tracker::new(settings.clone(), Stream::new(1)).map_err(refused)?;
        let cpu = ThreadTime::now();
        for (k, seen) in seen.iter().enumerate() {
            tracker.take(k, seen, &detector).map_err(refused)?;
        }
        let spent = cpu.elapsed();
        std::hint::black_box(tracker);
        Ok(spent)
    })?;
    Ok(row(workload, NoiseSource::default(), options, PARTICLES, &spent, FRAMES as f64))
}
