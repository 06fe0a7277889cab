//! The list of trackers: what the command line, the reports and the tests know.

use super::{AppearanceSettings, AppearanceTracker, CorrelationSettings, CorrelationTracker, Still, Tracker};
use crate::{Frame, Rect, Result};
use zerre::kernels::Threads;
use zerre::rng::Stream;

/// A tracker that can be chosen by its name.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// What it does, in a line.
    pub about: &'static str,
    /// Where it is from.
    pub source: &'static str,
    /// Starts it with the settings that it has unless told otherwise.
    start: fn(&Frame, Rect, Stream) -> Result<Box<dyn Tracker>>,
}

impl Kind {
    /// Starts on `bounds` in the first frame. Two streams of one seed give two repetitions of the same
    /// experiment.
    ///
    /// # Errors
    /// A box that no object can be in.
    pub fn start(&self, frame: &Frame, bounds: Rect, stream: Stream) -> Result<Box<dyn Tracker>> {
        (self.start)(frame, bounds.on_frame(frame.size())?, stream)
    }
}

/// All trackers; the first one is the default.
pub const TRACKERS: &[Kind] = &[
    Kind {
        name: "zerre",
        about: "particles over the response of correlation filters, with colours, scale, and a search when lost",
        source: "the filters of Galoogahi et al. 2017, Danelljan et al. 2014, Bertinetto et al. 2016",
        start: |frame, bounds, stream| {
            let settings = CorrelationSettings::default();
            Ok(Box::new(CorrelationTracker::start(frame, bounds, settings, (stream, Threads::Serial))?))
        },
    },
    Kind {
        name: "still",
        about: "the box stays where it is put: the floor of every table",
        source: "a baseline",
        start: |frame, bounds, _| Ok(Box::new(Still::new(frame, bounds))),
    },
    Kind {
        name: "rt",
        about: "particles weighed by colour histograms",
        source: DILMEN_TALU,
        start: |frame, bounds, stream| by_appearance(frame, bounds, stream, &AppearanceSettings::rt()),
    },
    Kind {
        name: "frt",
        about: "particles weighed by colour histograms of the smoothed frame",
        source: DILMEN_TALU,
        start: |frame, bounds, stream| by_appearance(frame, bounds, stream, &AppearanceSettings::frt()),
    },
    Kind {
        name: "ssim",
        about: "particles weighed by structural similarity, led by optical flow",
        source: DILMEN_TALU,
        start: |frame, bounds, stream| by_appearance(frame, bounds, stream, &AppearanceSettings::ssim()),
    },
    Kind {
        name: "ssimfahe",
        about: "structural similarity of the smoothed and adaptively equalised frame",
        source: DILMEN_TALU,
        start: |frame, bounds, stream| by_appearance(frame, bounds, stream, &AppearanceSettings::ssimfahe()),
    },
    Kind {
        name: "massimahe",
        about: "the same with boxes whose middle counts more",
        source: DILMEN_TALU,
        start: |frame, bounds, stream| by_appearance(frame, bounds, stream, &AppearanceSettings::massimahe()),
    },
];

const DILMEN_TALU: &str = "Dilmen and Talu 2017, with the readings of `AppearanceSettings`";

fn by_appearance(
    frame: &Frame,
    bounds: Rect,
    stream: Stream,
    settings: &AppearanceSettings,
) -> Result<Box<dyn Tracker>> {
    let tracker = AppearanceTracker::start(frame, bounds, settings, (stream, Threads::Serial))?;
    Ok(Box::new(tracker))
}

/// The tracker of this name.
pub fn find(name: &str) -> Option<&'static Kind> {
    TRACKERS.iter().find(|kind| kind.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tracker_starts_on_its_box_and_refuses_bad_ones() {
        let frame = Frame::from_fn(64, 48, |x, y| [(7 * x) as u8, (11 * y) as u8, (x * y) as u8]);
        let bounds = Rect { x: 20.0, y: 12.0, width: 16.0, height: 14.0 };
        let stream = || Stream::new(1);
        for kind in TRACKERS {
            assert_eq!(find(kind.name).map(|found| found.name), Some(kind.name));
            let mut tracker = kind.start(&frame, bounds, stream()).unwrap();
            let estimate = tracker.step(&frame).unwrap();
            assert!(estimate.bounds.iou(&bounds) > 0.3, "{}: {}", kind.name, estimate.bounds);
            assert!((0.0..=1.0).contains(&estimate.p_lost) && estimate.score.is_finite(), "{}", kind.name);
            let weights: f64 = tracker.particles().iter().map(|particle| particle.weight).sum();
            assert!(
                tracker.particles().is_empty() || (weights - 1.0).abs() < 1e-9,
                "{}: {weights}",
                kind.name
            );
            assert!(tracker.step(&Frame::filled(8, 8, [0; 3])).is_err(), "{}", kind.name);
            assert!(kind.start(&frame, Rect { width: 1.0, ..bounds }, stream()).is_err(), "{}", kind.name);
            assert!(kind.start(&frame, Rect { x: 64.0, ..bounds }, stream()).is_err(), "{}", kind.name);
        }
    }
}
