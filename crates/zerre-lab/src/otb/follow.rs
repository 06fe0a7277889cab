//! One tracker through one video.

use cpu_time::ThreadTime;
use std::time::Duration;
use zerre::rng::Stream;
use zerre_vision::frames::Frames;
use zerre_vision::tracker::{Estimate, Kind, Tracker};
use zerre_vision::{Error, Frame, Rect, Result};

/// What a tracker did with a video.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Followed {
    /// What it knew after each frame, from the first one on, which gave it its box.
    pub estimates: Vec<Estimate>,
    /// Frames that it looked at, without the first.
    pub steps: usize,
    /// Processor time of the thread in the tracker itself, s: neither decoding nor the start is in it.
    pub seconds: f64,
    /// Frames that could not be read, with the reason: the estimate before stood.
    pub unread: Vec<String>,
    /// Why the tracker went no further.
    pub refusal: Option<String>,
    /// Whether it was stopped.
    pub stopped: bool,
}

impl Followed {
    /// Frames per second; `None` where the time was too short to be measured.
    pub fn fps(&self) -> Option<f64> {
        Some(self.steps as f64 / self.seconds).filter(|fps| fps.is_finite() && *fps > 0.0)
    }
}

/// A moment on the way.
pub struct Moment<'a> {
    /// The frame's place, from 0.
    pub index: usize,
    /// The frame; `None` where it could not be read.
    pub frame: Option<&'a Frame>,
    /// What is known after it.
    pub estimate: &'a Estimate,
    /// The tracker.
    pub tracker: &'a dyn Tracker,
}

/// The random numbers of a repetition, the first of which is 0: those of `zerre video` and of `zerre otb`
/// alike.
pub fn luck(seed: u64, repeat: u64) -> Stream {
    /// "tracker" in ASCII.
    const LABEL: u64 = 0x0074_7261_636b_6572;
    Stream::new(seed).fork(LABEL).fork(repeat)
}

/// Starts a tracker on the first frame, on the box that `place` gives for its size, and follows to the end or
/// until `see` says no.
///
/// # Errors
/// No first frame, or one that cannot be read; a box that no tracker can start from. Later failures are in what is returned.
pub fn follow(
    kind: &Kind,
    frames: &mut Frames,
    place: impl FnOnce((usize, usize)) -> Rect,
    stream: Stream,
    mut see: impl FnMut(&Moment) -> bool,
) -> Result<Followed> {
    let no_frame = || Error::Input { input: "video".to_owned(), problem: "it has no frame".to_owned() };
    let shot = frames.next().ok_or_else(no_frame)?;
    let first = shot.frame?;
    let bounds = place(first.size());
    let mut tracker = kind.start(&first, bounds, stream)?;
    let mut estimate = Estimate { bounds, covariance: [[0.0; 2]; 2], score: 1.0, p_lost: 0.0 };
    let mut followed = Followed { estimates: vec![estimate], ..Followed::default() };
    let mut spent = Duration::ZERO;
    let moment =
        Moment { index: shot.index, frame: Some(&first), estimate: &estimate, tracker: tracker.as_ref() };
    followed.stopped = !see(&moment);
    drop(first);
    while !followed.stopped {
        let Some(shot) = frames.next() else { break };
        let frame = match shot.frame {
            Ok(frame) => {
                let since = ThreadTime::now();
                let step = tracker.step(&frame);
                spent += since.elapsed();
                match step {
                    Ok(next) => estimate = next,
                    Err(error) => {
                        followed.refusal = Some(format!("{}: {error}", shot.name));
                        break;
                    }
                }
                followed.steps += 1;
                Some(frame)
            }
            Err(error) => {
                followed.unread.push(error.to_string());
                None
            }
        };
        followed.estimates.push(estimate);
        let moment = Moment {
            index: shot.index,
            frame: frame.as_ref(),
            estimate: &estimate,
            tracker: tracker.as_ref(),
        };
        followed.stopped = !see(&moment);
    }
    followed.seconds = spent.as_secs_f64();
    Ok(followed)
}
