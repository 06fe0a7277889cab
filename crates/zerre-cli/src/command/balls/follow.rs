//! Both ways to tell balls apart, behind one face.

use crate::args::{Balls, Preset};
use crate::diagnostic::Diagnostic;
use zerre::filter::Settings;
use zerre::kernels::Simd;
use zerre::resample::Resampling;
use zerre::rng::Stream;
use zerre_lab::balls::ShownBall;
use zerre_vision::Frame;
use zerre_vision::balls::thesis::{ByArea, READINGS, Reading, reading};
use zerre_vision::balls::{BallMotion, BallRow, Counted, Detector, Tracker, TrackerSettings};

/// Particles that are drawn of each ball.
const DRAWN: usize = 200;

pub(super) enum Follower {
    Assigned(Box<Tracker>),
    ByArea(Box<ByArea>),
}

/// What came of it.
pub(super) struct Followed {
    pub rows: Vec<BallRow>,
    pub counted: Counted,
    /// Balls of a fixed number that a frame did not show.
    pub missing: usize,
}

/// The reading of the thesis that the options name.
pub(super) fn chosen_reading(args: &Balls) -> Result<Reading, Diagnostic> {
    let name = args.reading.as_deref().unwrap_or(READINGS[0].name);
    let names: Vec<_> = READINGS.iter().map(|reading| reading.name).collect();
    let mut reading = *reading(name).ok_or_else(|| super::super::unknown("reading", name, &names))?;
    if let Some(motion) = args.motion {
        reading.motion = motion.into();
    }
    if let Some(sd) = args.process_noise {
        if !(sd.is_finite() && sd > 0.0) {
            return Err(Diagnostic::usage(format!(
                "the process noise is {sd}: a number above zero is needed"
            )));
        }
        reading.process_sd = sd;
    }
    Ok(reading)
}

/// The settings of the default tracker.
pub(super) fn settings(args: &Balls, simd: Simd) -> TrackerSettings {
    let motion = args.motion.map_or_else(BallMotion::default, Into::into);
    let defaults = TrackerSettings::of(motion);
    TrackerSettings {
        process_sd: args.process_noise.unwrap_or(defaults.process_sd),
        measurement_sd: args.measurement_noise,
        count: args.count.map(usize::from),
        filter: Settings {
            particles: args.particles.get() as usize,
            resampling: args.resampling.map_or_else(Resampling::default, Into::into),
            simd,
            ..defaults.filter
        },
        ..defaults
    }
}

impl Follower {
    /// Balls of the thesis where none are counted.
    pub const COUNT: usize = 3;

    pub(super) fn new(
        args: &Balls,
        simd: Simd,
        size: (usize, usize),
        stream: Stream,
    ) -> Result<Follower, Diagnostic> {
        let refused = |error: zerre_vision::Error| Diagnostic::new(error.to_string());
        Ok(match args.preset {
            Preset::Default => {
                Follower::Assigned(Box::new(Tracker::new(settings(args, simd), stream).map_err(refused)?))
            }
            Preset::Thesis => {
                let count = args.count.map_or(Self::COUNT, usize::from);
                let scheme = args.resampling.map_or(Resampling::Multinomial, Into::into);
                let particles = (args.particles.get() as usize, scheme);
                let reading = chosen_reading(args)?;
                let by_area = ByArea::new(&reading, count, size, particles, stream).map_err(refused)?;
                Follower::ByArea(Box::new(by_area))
            }
        })
    }

    pub(super) fn step(
        &mut self,
        index: usize,
        frame: &Frame,
        detector: &Detector,
    ) -> zerre_vision::Result<()> {
        match self {
            Follower::Assigned(tracker) => tracker.step(index, frame, detector),
            Follower::ByArea(balls) => balls.take(index, &detector.see(frame)?),
        }
    }

    /// The balls of the last frame, as they are drawn.
    pub(super) fn shown(&self) -> Vec<ShownBall> {
        match self {
            Follower::Assigned(tracker) => tracker
                .balls()
                .map(|ball| {
                    let particles = ball.belief.particles();
                    let every = particles.len().div_ceil(DRAWN).max(1);
                    ShownBall {
                        number: ball.number,
                        centre: ball.belief.known().centre,
                        radius: ball.radius,
                        detected: ball.detected,
                        particles: particles.into_iter().step_by(every).map(|(place, _)| place).collect(),
                    }
                })
                .collect(),
            Follower::ByArea(balls) => balls
                .balls()
                .map(|(row, radius, filter)| ShownBall {
                    number: row.ball,
                    centre: row.known.centre,
                    radius,
                    detected: row.detected.is_some(),
                    particles: filter.particles().take(DRAWN).collect(),
                })
                .collect(),
        }
    }

    pub(super) fn finish(self) -> Followed {
        match self {
            Follower::Assigned(tracker) => {
                let (rows, counted) = tracker.finish();
                Followed { rows, counted, missing: 0 }
            }
            Follower::ByArea(balls) => {
                let (rows, missing) = balls.finish();
                Followed { rows, counted: Counted::default(), missing }
            }
        }
    }
}
