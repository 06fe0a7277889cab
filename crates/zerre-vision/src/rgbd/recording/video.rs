//! Videos, cameras and streams: colours alone.

use super::Source;
use super::folders::Entry;
use crate::frames::Frames;
use crate::{Error, Result};
use std::path::Path;
use std::time::Instant;
use zerre::Time;

/// Frames that the program `ffmpeg` gives.
#[derive(Debug)]
pub(super) struct Video {
    frames: Frames,
    rate_hz: f64,
    /// When the first frame came, of a camera or a stream.
    since: Option<Instant>,
    live: bool,
}

impl Video {
    /// Frames of a file are so many per second as its header says, else `rate_hz`; those of a camera or a
    /// stream are of the time at which they come.
    pub(super) fn open(path: &Path, rate_hz: f64) -> Result<Video> {
        let Some(input) = path.to_str() else {
            let problem = "the name is not UTF-8, which ffmpeg needs".to_owned();
            return Err(Error::Input { input: path.display().to_string(), problem });
        };
        let frames = Frames::open(input)?;
        let rate_hz = frames.rate().unwrap_or(rate_hz);
        Ok(Video { frames, rate_hz, since: None, live: Frames::is_live(input) })
    }

    pub(super) fn expected(&self) -> Option<usize> {
        self.frames.expected()
    }

    pub(super) fn is_live(&self) -> bool {
        self.live
    }

    /// After the last frame: why there are no more of them.
    pub(super) fn complaint(&self) -> Option<&str> {
        self.frames.complaint()
    }

    pub(super) fn entry(&mut self) -> Option<Result<Entry>> {
        let shot = self.frames.next()?;
        let time = if self.live {
            let since = *self.since.get_or_insert_with(Instant::now);
            Time::from_nanos(i64::try_from(since.elapsed().as_nanos()).unwrap_or(i64::MAX))
        } else {
            Time::from_secs(shot.index as f64 / self.rate_hz)
        };
        let entry =
            |frame| Entry { name: shot.name, time, colour: Some(Source::Picture(frame)), depth: None };
        Some(shot.frame.map(entry))
    }
}
