//! Where frames come from: a recording waits for who reads it, a camera does not.

use crate::run::interrupted;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use zerre_lab::fusion::{Clock, Stopwatch};
use zerre_vision::frames::newest::{Newest, Taken};
use zerre_vision::rgbd::RgbdFrame;
use zerre_vision::rgbd::recording::{Outcomes, Recording};

/// How often somebody who waits for a frame looks whether to stop.
const LOOK: Duration = Duration::from_millis(100);

/// A frame on its way.
pub(super) struct Given {
    pub frame: zerre_vision::Result<RgbdFrame>,
    /// What it took to get it: reading it, or its waiting here, milliseconds.
    pub ms: f64,
    /// When it came, of a camera.
    pub came: Option<Instant>,
}

pub(super) struct Feed {
    source: Source,
    peeked: Option<Given>,
    complaint: Arc<Mutex<Option<String>>>,
    /// Frames of a camera that were read, however they were.
    read: Outcomes,
}

enum Source {
    Recording(Box<Recording>),
    Camera(Newest<zerre_vision::Result<RgbdFrame>>),
}

impl Feed {
    pub(super) fn of(recording: Recording) -> Feed {
        let complaint = Arc::new(Mutex::new(None));
        let source = if recording.is_live() {
            let (mut recording, said) = (recording, Arc::clone(&complaint));
            Source::Camera(Newest::of(std::iter::from_fn(move || {
                let frame = recording.next();
                if frame.is_none() {
                    *said.lock().unwrap_or_else(PoisonError::into_inner) =
                        recording.complaint().map(str::to_owned);
                }
                frame
            })))
        } else {
            Source::Recording(Box::new(recording))
        };
        Feed { source, peeked: None, complaint, read: Outcomes::default() }
    }

    pub(super) fn is_live(&self) -> bool {
        matches!(self.source, Source::Camera(_))
    }

    /// The next frame; `None` behind the last one, and when somebody asked to stop.
    pub(super) fn next(&mut self) -> Option<Given> {
        if self.peeked.is_some() {
            return self.peeked.take();
        }
        match &mut self.source {
            Source::Recording(recording) => {
                let reading = Stopwatch::start(Clock::Processor);
                let frame = recording.next()?;
                Some(Given { frame, ms: reading.ms(), came: None })
            }
            Source::Camera(newest) => loop {
                if interrupted() {
                    return None;
                }
                match newest.take(LOOK) {
                    Taken::Item(frame, came) => {
                        self.read.read += 1;
                        let ms = 1000.0 * came.elapsed().as_secs_f64();
                        return Some(Given { frame, ms, came: Some(came) });
                    }
                    Taken::Late => {}
                    Taken::End => return None,
                }
            },
        }
    }

    /// The first frame that can be read, which stays the next one.
    pub(super) fn peek(&mut self) -> Option<&RgbdFrame> {
        while self.peeked.as_ref().is_none_or(|given| given.frame.is_err()) {
            self.peeked = None;
            self.peeked = Some(self.next()?);
        }
        self.peeked.as_ref()?.frame.as_ref().ok()
    }

    /// Frames of a camera that came while the one before was still at work.
    pub(super) fn dropped(&self) -> usize {
        match &self.source {
            Source::Recording(_) => 0,
            Source::Camera(newest) => newest.dropped(),
        }
    }

    pub(super) fn outcomes(&self) -> Outcomes {
        match &self.source {
            Source::Recording(recording) => recording.outcomes(),
            Source::Camera(_) => self.read,
        }
    }

    /// After the last frame: why there are no more.
    pub(super) fn complaint(&self) -> Option<String> {
        match &self.source {
            Source::Recording(recording) => recording.complaint().map(str::to_owned),
            Source::Camera(_) => self.complaint.lock().unwrap_or_else(PoisonError::into_inner).clone(),
        }
    }
}
