//! The pictures that are marked, in any order.

use crate::command::video::open::{file, of_pictures};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Input, Progress, interrupted};
use std::collections::HashMap;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use zerre_vision::frames::folder::{Pictures, png};
use zerre_vision::frames::{Frames, Shot};
use zerre_web::label::{Job, Picture};

/// Folder with the frames of a video.
const DECODED: &str = "frames";
/// Frames that cannot be read and are named; the rest is counted.
const NAMED: usize = 10;

/// A recording.
pub(super) struct Source {
    path: PathBuf,
    every: usize,
    /// Nothing for a video.
    pictures: Option<Pictures>,
}

/// The encoded picture of a frame.
type Show = Box<dyn Fn(usize) -> Result<Picture, String> + Send + Sync>;

/// What can be marked.
pub(super) struct Found {
    pub job: Job,
    pub picture: Show,
    /// Frames that are left out because they cannot be read.
    pub rejected: u64,
}

fn refused(error: zerre_vision::Error) -> Diagnostic {
    Diagnostic::new(error.to_string())
}

impl Source {
    pub(super) fn open(path: &Path, every: NonZeroUsize) -> Result<Source, Diagnostic> {
        let pictures = if path.is_dir() {
            Some(Pictures::open(path).map_err(refused)?)
        } else if path.is_file() {
            None
        } else {
            let what = format!("{} is neither a folder of pictures nor a video file", path.display());
            return Err(
                Diagnostic::new(what).help("cameras and streams are recorded first: people take their time")
            );
        };
        Ok(Source { path: path.to_owned(), every: every.get(), pictures })
    }

    pub(super) fn input(&self) -> Result<Input, Diagnostic> {
        match &self.pictures {
            Some(pictures) => of_pictures(&self.path.display().to_string(), pictures),
            None => crate::command::input(&self.path),
        }
    }

    /// A file of each folder that is read: outputs must not go there.
    pub(super) fn reads(&self) -> Vec<PathBuf> {
        let first = self.pictures.iter().find_map(|pictures| pictures.places().iter().find_map(file));
        first.into_iter().chain([self.path.clone()]).collect()
    }

    /// Looks at every frame once, so that nobody meets one that cannot be read; frames of a video are kept in
    /// `out`.
    pub(super) fn check(
        self,
        input: String,
        points: Vec<String>,
        out: &Path,
        console: &Console,
    ) -> Result<Found, Diagnostic> {
        let mut frames = self.frames()?;
        let mut keep = self.pictures.is_none().then(|| Keep::begin(out)).transpose()?;
        let total = frames.expected().map(|count| count as u64);
        let mut progress = Progress::new(console, "frames", total);
        let (mut names, mut size, mut rejected) = (Vec::new(), None, 0);
        for Shot { index, name, frame } in &mut frames {
            if interrupted() {
                return Err(Diagnostic::new(
                    "stopped before all frames were looked at: nothing was to be marked yet",
                ));
            }
            progress.advance(1);
            if index % self.every != 0 {
                continue;
            }
            match frame {
                Ok(frame) => {
                    if let Some(keep) = &mut keep {
                        keep.push(&frame)?;
                    }
                    let (width, height) = frame.size();
                    size.get_or_insert([width, height]);
                    names.push(name);
                }
                Err(error) => {
                    rejected += 1;
                    if rejected <= NAMED as u64 {
                        console.warn(format_args!("left out: {error}"));
                    }
                }
            }
        }
        drop(progress);
        if let Some(complaint) = frames.complaint() {
            console.warn(format_args!("{}: {complaint}", self.path.display()));
        }
        let Some(size) = size else {
            return Err(Diagnostic::new(format!("{} has no frame that can be read", self.path.display())));
        };
        if let Some(keep) = keep {
            keep.finish()?;
        }
        let title = self.path.file_name().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned();
        let job = Job { title, input, points, frames: names, size };
        let picture = self.show(&job, out)?;
        Ok(Found { job, picture, rejected })
    }

    /// The frames of a job that was begun before.
    pub(super) fn again(self, job: Job, out: &Path, console: &Console) -> Result<Found, Diagnostic> {
        if self.pictures.is_none() && !decoded(out, job.frames.len().saturating_sub(1)).is_file() {
            console.info("the frames of the video are decoded once more");
            let known = job.clone();
            let Found { job, picture, rejected } = self.check(job.input, job.points, out, console)?;
            if job.frames != known.frames {
                let what = "the video has other frames than when the job was begun";
                return Err(
                    Diagnostic::new(what).help("it is read by another ffmpeg, perhaps: use the same one")
                );
            }
            return Ok(Found { job, picture, rejected });
        }
        let picture = self.show(&job, out)?;
        Ok(Found { job, picture, rejected: 0 })
    }

    fn frames(&self) -> Result<Frames, Diagnostic> {
        match &self.pictures {
            Some(pictures) => Ok(Frames::of_pictures(pictures.clone())),
            None => Frames::open(&self.path.to_string_lossy()).map_err(refused),
        }
    }

    fn show(&self, job: &Job, out: &Path) -> Result<Show, Diagnostic> {
        let files: Vec<PathBuf> = match &self.pictures {
            None => (0..job.frames.len()).map(|number| decoded(out, number)).collect(),
            Some(pictures) => {
                let named = |path: PathBuf| Some((path.file_name()?.to_string_lossy().into_owned(), path));
                let by_name: HashMap<String, PathBuf> =
                    pictures.places().iter().filter_map(file).filter_map(named).collect();
                let found: Option<Vec<PathBuf>> =
                    job.frames.iter().map(|name| by_name.get(name).cloned()).collect();
                found
                    .ok_or_else(|| Diagnostic::new(format!("pictures of {} are gone", self.path.display())))?
            }
        };
        Ok(Box::new(move |number| {
            let path = files.get(number).ok_or("there is no such frame")?;
            let data = fs::read(path).map_err(|error| Diagnostic::io("read", path, &error).to_string())?;
            Ok((if data.starts_with(b"\x89PNG") { "image/png" } else { "image/jpeg" }, data))
        }))
    }
}

fn decoded(out: &Path, number: usize) -> PathBuf {
    out.join(DECODED).join(format!("{number:06}.png"))
}

/// Frames of a video on their way to the disk: the folder takes its name when it is complete.
struct Keep {
    folder: PathBuf,
    aside: PathBuf,
    count: usize,
}

impl Keep {
    fn begin(out: &Path) -> Result<Keep, Diagnostic> {
        let (folder, aside) = (out.join(DECODED), out.join(format!(".{DECODED}.partial")));
        for path in [&folder, &aside] {
            if path.exists() {
                fs::remove_dir_all(path).map_err(|error| Diagnostic::io("replace", path, &error))?;
            }
        }
        fs::create_dir_all(&aside).map_err(|error| Diagnostic::io("make the folder", &aside, &error))?;
        Ok(Keep { folder, aside, count: 0 })
    }

    fn push(&mut self, frame: &zerre_vision::Frame) -> Result<(), Diagnostic> {
        let path = self.aside.join(format!("{:06}.png", self.count));
        self.count += 1;
        let bytes = png(frame).map_err(refused)?;
        fs::write(&path, bytes).map_err(|error| {
            Diagnostic::io("write", &path, &error)
                .help("every frame is kept as a picture; --every N takes fewer")
        })
    }

    fn finish(self) -> Result<(), Diagnostic> {
        fs::rename(&self.aside, &self.folder).map_err(|error| Diagnostic::io("write", &self.folder, &error))
    }
}

impl Drop for Keep {
    fn drop(&mut self) {
        // After `finish` nothing is there any more.
        let _ = fs::remove_dir_all(&self.aside);
    }
}
