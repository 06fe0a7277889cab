//! Recordings of colour and depth, frame by frame: folders of pictures and, with the feature `mcap`, MCAP
//! files; videos, cameras and streams have colours alone.

mod cameras;
mod folders;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(all(test, feature = "mcap"))]
mod mcap_tests;
#[cfg(feature = "mcap")]
mod message;
#[cfg(test)]
mod tests;
mod video;

pub use cameras::CameraFile;

use super::{Camera, Depth, NO_DEPTH, Registration, RgbdFrame};
use crate::frames::folder;
use crate::{Error, Frame, Image, Result};
use folders::Entry;
use std::path::{Path, PathBuf};

/// What is read, each with a line about it.
pub const KINDS: &[(&str, &str)] = &[
    (
        "folder",
        "folders rgb and depth with pictures of the same numbers; times.csv, camera.json, background_*.png",
    ),
    ("tum", "a folder as the TUM RGB-D benchmark has it: rgb.txt, depth.txt or associations.txt"),
    #[cfg(feature = "mcap")]
    ("mcap", "MCAP files with pictures of ROS 2 or Foxglove, one topic of colours and one of depth"),
    #[cfg(not(feature = "mcap"))]
    ("mcap", "MCAP files; this program is built without them (cargo build --features mcap)"),
    ("video", "what the program ffmpeg reads: colours alone"),
    (
        "camera",
        "/dev/video0 or the address of a stream, by ffmpeg: colours alone, frames are dropped rather than late",
    ),
];

/// How a recording is read.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingOptions {
    /// The cameras; without it `camera.json` in the folder or in the one above it, if there is one.
    pub camera: Option<PathBuf>,
    /// Frames per second, where no times are kept.
    pub rate_hz: f64,
    /// Metres per unit of depth; without it what the camera file says, else what the layout means.
    pub depth_scale: Option<f64>,
    /// What stands where nothing was measured; without it what the camera file says, else 0.
    pub invalid: Option<u16>,
    /// Longest time between a picture of colours and one of depth that belong together, seconds.
    pub apart_s: f64,
    /// Topics of colours and of depth in an MCAP file; without them the first ones, of depth that has `depth`
    /// in its name.
    pub topics: [Option<String>; 2],
}

impl Default for RecordingOptions {
    fn default() -> RecordingOptions {
        RecordingOptions {
            camera: None,
            rate_hz: 30.0,
            depth_scale: None,
            invalid: None,
            apart_s: 0.02,
            topics: [None, None],
        }
    }
}

/// What became of the frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcomes {
    /// Frames that were handed out.
    pub read: usize,
    /// Of these, those without a depth picture: their depth is unknown everywhere.
    pub without_depth: usize,
    /// Of these, those whose depth picture cannot be read or is of another size: likewise.
    pub unreadable_depth: usize,
    /// Frames whose colours are missing or cannot be read.
    pub unreadable: usize,
    /// Depth pictures that belong to no frame.
    pub depth_alone: usize,
}

/// The frames of a recording, with depth in the pixels of the colours, one by one. Only the frame that is
/// handed out is in memory. An error stands for its frame alone: the next one may be good.
#[derive(Debug)]
pub struct Recording {
    entries: Entries,
    expected: Option<usize>,
    next: usize,
    camera: Option<Camera>,
    register: bool,
    registration: Option<Registration>,
    scale: f64,
    invalid: u16,
    size: Option<(usize, usize)>,
    outcomes: Outcomes,
    /// Pictures of the empty room.
    room: Option<[PathBuf; 2]>,
}

#[derive(Debug)]
enum Entries {
    Files(std::vec::IntoIter<Entry>),
    Video(Box<video::Video>),
    #[cfg(feature = "mcap")]
    Mcap(Box<mcap::Messages>),
}

/// Where a picture is.
#[derive(Clone, Debug, PartialEq)]
enum Source {
    File(PathBuf),
    /// Here.
    Picture(Frame),
    #[cfg(feature = "mcap")]
    Message(message::Message),
}

impl Source {
    fn frame(self) -> Result<Frame> {
        match self {
            Source::File(path) => folder::frame(&path),
            Source::Picture(frame) => Ok(frame),
            #[cfg(feature = "mcap")]
            Source::Message(message) => message.frame().map_err(in_message),
        }
    }

    /// In units of so many metres.
    fn depth(&self, scale: f64, invalid: u16) -> Result<Depth> {
        #[cfg(not(feature = "mcap"))]
        let _ = (scale, invalid);
        match self {
            Source::File(path) => folder::depth(path),
            Source::Picture(_) => {
                let problem = "it has no depth".to_owned();
                Err(Error::Input { input: "video".to_owned(), problem })
            }
            #[cfg(feature = "mcap")]
            Source::Message(message) => message.depth(scale, invalid).map_err(in_message),
        }
    }
}

#[cfg(feature = "mcap")]
fn in_message(problem: String) -> Error {
    Error::Input { input: "message".to_owned(), problem }
}

/// Pictures of the empty room: colours, and depth.
const ROOM: [&[&str]; 2] = [&["background_rgb.png", "background_rgb.jpg"], &["background_depth.png"]];

impl Recording {
    /// Opens a folder: with folders `rgb` and `depth` whose pictures have the same numbers (and `times.csv`,
    /// if there is one), or as the TUM benchmark has it (`rgb.txt`, `depth.txt`, `associations.txt`); or,
    /// with the feature `mcap`, a file of pictures as Foxglove or ROS 2 have them. What else the program
    /// `ffmpeg` reads (a video file, a camera such as `/dev/video0`, the address of a stream) has colours
    /// alone.
    ///
    /// # Errors
    /// Nothing under this name, another layout, a camera file that is none, pictures of different sizes
    /// without cameras, a video without the program `ffmpeg`.
    pub fn open(path: &Path, options: &RecordingOptions) -> Result<Recording> {
        let refuse =
            |problem: &str| Error::Input { input: path.display().to_string(), problem: problem.to_owned() };
        if !(options.rate_hz > 0.0 && options.rate_hz.is_finite()) {
            let needs = "it must be positive, frames per second";
            return Err(Error::OutOfRange { what: "rate_hz", value: options.rate_hz, needs });
        }
        let files = path.is_dir();
        let (entries, expected, alone, usual) = if files {
            let listed = folders::list(path, options.rate_hz, options.apart_s)?;
            let expected = listed.entries.len();
            (Entries::Files(listed.entries.into_iter()), Some(expected), listed.alone, listed.scale)
        } else if path.extension().is_none_or(|ending| ending != "mcap") {
            let video = video::Video::open(path, options.rate_hz)?;
            let expected = video.expected();
            (Entries::Video(Box::new(video)), expected, 0, 0.001)
        } else if !path.is_file() {
            return Err(refuse("there is no such file"));
        } else {
            #[cfg(feature = "mcap")]
            {
                let messages = mcap::Messages::open(path, &options.topics, options.apart_s)?;
                (Entries::Mcap(Box::new(messages)), None, 0, 0.001)
            }
            #[cfg(not(feature = "mcap"))]
            return Err(refuse(
                "this program is built without MCAP: build it with the feature mcap (cargo build --features mcap), or \
                 give a folder of pictures",
            ));
        };
        let mut beside = [files.then_some(path), path.parent()]
            .into_iter()
            .flatten()
            .map(|folder| folder.join("camera.json"));
        let file = options.camera.clone().or_else(|| beside.find(|file| file.is_file()));
        let cameras = file.as_deref().map(CameraFile::read).transpose()?;
        let of_file = |read: fn(&CameraFile) -> Option<f64>| cameras.as_ref().and_then(read);
        let scale = options.depth_scale.or(of_file(|file| file.depth_scale)).unwrap_or(usual);
        if !(scale > 0.0 && scale.is_finite()) {
            let needs = "it must be positive, metres per unit";
            return Err(Error::OutOfRange { what: "depth_scale", value: scale, needs });
        }
        let invalid = options.invalid.or(cameras.and_then(|file| file.invalid)).unwrap_or(NO_DEPTH);
        let camera = cameras.map(|file| Camera { depth_scale: scale, invalid, ..file.camera });
        let register = cameras.is_some_and(|file| !file.is_registered());
        if let (false, Entries::Files(entries)) = (register, &entries) {
            same_size(path, entries.as_slice())?;
        }
        Ok(Recording {
            expected,
            entries,
            next: 0,
            camera,
            register,
            registration: None,
            scale,
            invalid,
            size: None,
            room: room(path),
            outcomes: Outcomes { depth_alone: alone, ..Outcomes::default() },
        })
    }

    /// The cameras, where a file says what they are. The depth of the frames is that of its colour camera.
    pub fn camera(&self) -> Option<Camera> {
        self.camera
    }

    /// The empty room: colours, and depth in their pixels, of a folder that has pictures of it
    /// (`background_rgb.png` or `.jpg`, and `background_depth.png`).
    ///
    /// # Errors
    /// Pictures that cannot be read or are of different sizes.
    pub fn room(&mut self) -> Option<Result<(Frame, Depth)>> {
        let [colour, depth] = self.room.clone()?;
        Some(folder::frame(&colour).and_then(|colour| {
            let depth = self.depth(&Source::File(depth), colour.size())?;
            Ok((colour, depth))
        }))
    }

    /// Whether the frames come by themselves, as those of a camera or a stream do.
    pub fn is_live(&self) -> bool {
        matches!(&self.entries, Entries::Video(video) if video.is_live())
    }

    /// Whether it may have depth: videos, cameras and streams have none.
    pub fn may_have_depth(&self) -> bool {
        !matches!(&self.entries, Entries::Video(_))
    }

    /// After the last frame of a video: why there are no more of them, where there should be.
    pub fn complaint(&self) -> Option<&str> {
        match &self.entries {
            Entries::Video(video) => video.complaint(),
            _ => None,
        }
    }

    /// Number of frames, with those that are missing or cannot be read, where it is known before the end.
    pub fn expected(&self) -> Option<usize> {
        self.expected
    }

    /// What became of the frames so far.
    pub fn outcomes(&self) -> Outcomes {
        #[cfg(feature = "mcap")]
        if let Entries::Mcap(messages) = &self.entries {
            return Outcomes { depth_alone: messages.alone(), ..self.outcomes };
        }
        self.outcomes
    }

    fn colour(&mut self, entry: &mut Entry) -> Result<Frame> {
        let missing =
            || Error::Input { input: entry.name.clone(), problem: "there is no such picture".to_owned() };
        let frame = entry.colour.take().ok_or_else(missing)?.frame()?;
        let expected = *self.size.get_or_insert(frame.size());
        if frame.size() != expected {
            return Err(Error::Size { found: frame.size(), expected });
        }
        Ok(frame)
    }

    /// Depth in mm in the pixels of a picture of colours of this size.
    fn depth(&mut self, source: &Source, size: (usize, usize)) -> Result<Depth> {
        let raw = source.depth(self.scale, self.invalid)?;
        if let (true, Some(camera)) = (self.register, self.camera) {
            if self.registration.is_none() {
                self.registration = Some(Registration::new(camera, raw.size(), size)?);
            }
            if let Some(registration) = &self.registration {
                return registration.register(&raw);
            }
        }
        if raw.size() != size {
            return Err(Error::Size { found: raw.size(), expected: size });
        }
        let (per_unit, invalid) = (1000.0 * self.scale, self.invalid);
        if per_unit == 1.0 && invalid == NO_DEPTH {
            return Ok(raw);
        }
        let mm = |units: &u16| {
            let mm = (f64::from(*units) * per_unit + 0.5) as u16;
            // Farther than 65 m is nothing measured.
            if *units == invalid || mm == u16::MAX { NO_DEPTH } else { mm }
        };
        Ok(raw.map(mm))
    }
}

impl Iterator for Recording {
    type Item = Result<RgbdFrame>;

    fn next(&mut self) -> Option<Result<RgbdFrame>> {
        let entry = match &mut self.entries {
            Entries::Files(entries) => Ok(entries.next()?),
            Entries::Video(video) => video.entry()?,
            #[cfg(feature = "mcap")]
            Entries::Mcap(messages) => messages.entry()?,
        };
        let index = self.next;
        self.next += 1;
        let mut entry: Entry = match entry {
            Ok(entry) => entry,
            Err(error) => {
                self.outcomes.unreadable += 1;
                return Some(Err(error));
            }
        };
        let colour = match self.colour(&mut entry) {
            Ok(colour) => colour,
            Err(error) => {
                self.outcomes.unreadable += 1;
                return Some(Err(error));
            }
        };
        let (width, height) = colour.size();
        let depth = match entry.depth.as_ref().map(|source| self.depth(source, (width, height))) {
            Some(Ok(depth)) => depth,
            other => {
                match other {
                    None => self.outcomes.without_depth += 1,
                    Some(_) => self.outcomes.unreadable_depth += 1,
                }
                Image::filled(width, height, NO_DEPTH)
            }
        };
        self.outcomes.read += 1;
        Some(Ok(RgbdFrame { index, name: entry.name, time: entry.time, colour, depth }))
    }
}

fn room(folder: &Path) -> Option<[PathBuf; 2]> {
    let [colour, depth] =
        ROOM.map(|names| names.iter().map(|name| folder.join(name)).find(|path| path.is_file()));
    Some([colour?, depth?])
}

/// Refuses pictures of different sizes, as far as the first pair that can be read tells.
fn same_size(folder: &Path, entries: &[Entry]) -> Result<()> {
    let sizes = entries.iter().find_map(|entry| match (&entry.colour, &entry.depth) {
        (Some(Source::File(colour)), Some(Source::File(depth))) => {
            Some((folder::size(colour).ok()?, folder::size(depth).ok()?))
        }
        _ => None,
    });
    match sizes {
        Some((colour, depth)) if colour != depth => Err(Error::Input {
            input: folder.display().to_string(),
            problem: format!(
                "its depth pictures have {} x {} pixels and those of colours {} x {}: a camera file (camera.json in the \
                 folder) must say how one is seen from the other",
                depth.0, depth.1, colour.0, colour.1
            ),
        }),
        _ => Ok(()),
    }
}
