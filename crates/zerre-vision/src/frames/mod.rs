//! Where frames come from: folders of pictures, and everything that the program `ffmpeg` can read.

pub mod encode;
pub mod ffmpeg;
pub mod folder;
pub mod newest;

use crate::{Error, Frame, Result};
use ffmpeg::Video;
use folder::{Pictures, Place};
use std::path::Path;

/// A frame on its way to the tracker, or the reason why there is none.
#[derive(Debug)]
pub struct Shot {
    /// Its place in the video, from 0. Frames that cannot be read have one too.
    pub index: usize,
    /// What people know it by: the file's name, or `frame 17` (from 1) in a video.
    pub name: String,
    /// The picture. An error stands for this frame alone: the next one may be good.
    pub frame: Result<Frame>,
}

/// The frames of a folder, a video, a camera or a stream, one by one. Only the frame that is handed out is in
/// memory.
#[derive(Debug)]
pub struct Frames {
    source: Source,
    next: usize,
    size: Option<(usize, usize)>,
    /// A frame that was looked at and not taken.
    peeked: Option<Shot>,
}

#[derive(Debug)]
enum Source {
    Pictures(Pictures),
    Video(Video),
}

impl Frames {
    /// Opens a folder of pictures, a video file, a camera (`/dev/video0`) or the address of a stream
    /// (`rtsp://...`).
    ///
    /// # Errors
    /// Nothing under this name, a folder without a picture, a video without a frame, no program `ffmpeg`.
    pub fn open(input: &str) -> Result<Frames> {
        let path = Path::new(input);
        if path.is_dir() {
            return Ok(Frames::of_pictures(Pictures::open(path)?));
        }
        if !input.contains("://") && !path.exists() {
            let problem = "there is no such file or folder: a folder of pictures, a video file, a camera such \
                           as /dev/video0 or an address such as rtsp://host/stream is needed";
            return Err(Error::Input { input: input.to_owned(), problem: problem.to_owned() });
        }
        Ok(Frames { source: Source::Video(Video::open(input)?), next: 0, size: None, peeked: None })
    }

    /// The frames of a list of pictures.
    pub fn of_pictures(pictures: Pictures) -> Frames {
        Frames { source: Source::Pictures(pictures), next: 0, size: None, peeked: None }
    }

    /// Whether the frames come by themselves, as those of a camera or a stream do.
    pub fn is_live(input: &str) -> bool {
        input.contains("://") || ffmpeg::is_camera(Path::new(input))
    }

    /// The next frame, which stays the next one.
    pub fn peek(&mut self) -> Option<&Shot> {
        if self.peeked.is_none() {
            self.peeked = self.next();
        }
        self.peeked.as_ref()
    }

    /// How many frames there are, where that is known before the end: of videos, what their header claims.
    pub fn expected(&self) -> Option<usize> {
        match &self.source {
            Source::Pictures(pictures) => Some(pictures.places().len()),
            Source::Video(video) => video.claimed(),
        }
    }

    /// Frames per second, where a video's header says it.
    pub fn rate(&self) -> Option<f64> {
        match &self.source {
            Source::Pictures(_) => None,
            Source::Video(video) => video.rate(),
        }
    }

    /// Files of the folder that are no pictures, which are left out.
    pub fn ignored(&self) -> usize {
        match &self.source {
            Source::Pictures(pictures) => pictures.ignored(),
            Source::Video(_) => 0,
        }
    }

    /// After the last frame: why there are no more of them, where there should be, or what was found damaged.
    pub fn complaint(&self) -> Option<&str> {
        match &self.source {
            Source::Pictures(_) => None,
            Source::Video(video) => video.complaint(),
        }
    }
}

impl Iterator for Frames {
    type Item = Shot;

    fn next(&mut self) -> Option<Shot> {
        if let Some(shot) = self.peeked.take() {
            return Some(shot);
        }
        let index = self.next;
        let (name, read) = match &mut self.source {
            Source::Pictures(pictures) => {
                let place = pictures.places().get(index)?;
                (place.name(), pictures.read(place))
            }
            Source::Video(video) => (format!("frame {}", index + 1), video.next()?),
        };
        self.next += 1;
        let frame = read.and_then(|frame| {
            let expected = *self.size.get_or_insert(frame.size());
            if frame.size() == expected {
                return Ok(frame);
            }
            let ((width, height), (w, h)) = (frame.size(), expected);
            Err(Error::Input {
                input: name.clone(),
                problem: format!(
                    "it has {width} x {height} pixels where the frames before it have {w} x {h}; it is left out"
                ),
            })
        });
        Some(Shot { index, name, frame })
    }
}

impl Place {
    fn name(&self) -> String {
        match self {
            Place::File(path) => path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
            Place::Missing(number) => format!("number {number}"),
        }
    }
}
