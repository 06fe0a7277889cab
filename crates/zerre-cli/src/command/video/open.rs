//! What is followed: frames, the truth of them, and the first box.

use super::choose;
use crate::args::Video;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Hashing, Input};
use std::fs::File;
use std::io::{Read, Result as IoResult};
use std::path::{Path, PathBuf};
use zerre_vision::Rect;
use zerre_vision::frames::Frames;
use zerre_vision::frames::folder::{Pictures, Place};
use zerre_vision::sequence::{Sequence, origin, read_boxes};

pub(super) struct Opened {
    /// The frames from the first box on.
    pub frames: Frames,
    /// Truth by the number of the frame, as far as it is known.
    pub truth: Vec<Option<Rect>>,
    /// The file with it.
    pub source: Option<PathBuf>,
    pub bounds: Rect,
    /// Number of the frame that the box is of.
    pub first: usize,
    pub inputs: Vec<Input>,
    /// A file of each folder that is read: outputs must not go there.
    pub read: Vec<PathBuf>,
    pub notes: Vec<String>,
}

fn refused(error: zerre_vision::Error) -> Diagnostic {
    Diagnostic::new(error.to_string())
}

pub(super) fn open(args: &Video, console: &Console) -> Result<Opened, Diagnostic> {
    let path = Path::new(&args.input);
    let mut truth = match &args.truth {
        Some(file) => Some((read_boxes(file, origin(file)).map_err(refused)?, file.clone())),
        None => None,
    };
    let mut notes = Vec::new();
    let mut inputs = Vec::new();
    let mut read = vec![path.to_owned()];
    let mut frames = if path.is_dir() {
        let mut pictures = Pictures::open(path).map_err(refused)?;
        if let Some(sequence) = sequence(args, path)? {
            notes.extend(sequence.notes);
            pictures = sequence.pictures;
            truth = Some((sequence.truth, sequence.source));
        }
        read.extend(pictures.places().iter().find_map(file));
        inputs.push(of_pictures(&args.input, &pictures)?);
        Frames::of_pictures(pictures)
    } else {
        if path.is_file() {
            inputs.push(super::super::input(path)?);
        }
        Frames::open(&args.input).map_err(refused)?
    };
    if frames.ignored() > 0 {
        console.info(format_args!("{} files that are no pictures are left out", frames.ignored()));
    }
    let (truth, source) = truth.map_or_else(Default::default, |(truth, source)| (truth, Some(source)));
    inputs.extend(source.as_deref().map(super::super::input).transpose()?);
    read.extend(source.clone());
    let start = truth.iter().enumerate().find_map(|(at, bounds)| Some((at, (*bounds)?)));
    let (first, bounds) = match (args.bounds, start) {
        (Some(bounds), _) => (0, bounds),
        (None, Some(start)) => start,
        (None, None) if source.is_some() => {
            let what = "the truth has no box to start from";
            return Err(Diagnostic::new(what).help("say where the object is with --box x,y,w,h"));
        }
        (None, None) => (0, chosen(&mut frames, console)?),
    };
    for _ in 0..first {
        frames.next();
    }
    Ok(Opened { frames, truth, source, bounds, first, inputs, read, notes })
}

/// The annotated sequence in a folder: the only one, or the one whose annotation is named as the truth.
fn sequence(args: &Video, folder: &Path) -> Result<Option<Sequence>, Diagnostic> {
    if !Sequence::is_in(folder) {
        return Ok(None);
    }
    let mut found = Sequence::open(folder).map_err(refused)?;
    if let Some(truth) = &args.truth {
        let same =
            |source: &Path| truth.canonicalize().is_ok_and(|t| source.canonicalize().is_ok_and(|s| s == t));
        return Ok(found.into_iter().find(|sequence| same(&sequence.source)));
    }
    if found.len() > 1 && args.bounds.is_none() {
        let files: Vec<String> = found.iter().map(|s| format!("--truth {}", s.source.display())).collect();
        let what = format!("{} has {} targets", folder.display(), found.len());
        return Err(Diagnostic::new(what).help(format!("choose one: {}", files.join(", or "))));
    }
    Ok(if found.len() == 1 { found.pop() } else { None })
}

/// The box that somebody draws on the first frame; without a display, what to do.
fn chosen(frames: &mut Frames, console: &Console) -> Result<Rect, Diagnostic> {
    let size = match frames.peek().map(|shot| &shot.frame) {
        Some(Ok(frame)) if crate::browser::has_display() => return choose::ask(frame, console),
        Some(Ok(frame)) => format!(", which has {} x {}", frame.width(), frame.height()),
        Some(Err(error)) => return Err(Diagnostic::new(error.to_string())),
        None => String::new(),
    };
    Err(Diagnostic::new("there is no box: which object shall be followed?")
        .help(format!(
            "give --box x,y,w,h in pixels of the first frame{size}: x and y of the upper left corner, width, height"
        ))
        .help("or --truth with a box a line, the first of which is taken; with a display it can be drawn by hand"))
}

/// All pictures of a folder as one input, one after the other.
pub(in crate::command) fn of_pictures(name: &str, pictures: &Pictures) -> Result<Input, Diagnostic> {
    let files: Vec<PathBuf> = pictures.places().iter().filter_map(file).collect();
    let chain = Chain { files: files.into_iter(), open: None };
    let unreadable = |error| Diagnostic::io("read", pictures.folder(), &error);
    Hashing::new(chain).finish(name).map_err(unreadable)
}

pub(in crate::command) fn file(place: &Place) -> Option<PathBuf> {
    match place {
        Place::File(path) => Some(path.clone()),
        Place::Missing(_) => None,
    }
}

/// Files one after the other.
struct Chain {
    files: std::vec::IntoIter<PathBuf>,
    open: Option<File>,
}

impl Read for Chain {
    fn read(&mut self, into: &mut [u8]) -> IoResult<usize> {
        loop {
            if let Some(file) = &mut self.open {
                let count = file.read(into)?;
                if count > 0 {
                    return Ok(count);
                }
            }
            // A file that cannot be opened is told when its turn as a frame comes.
            match self.files.next() {
                Some(path) => self.open = File::open(path).ok(),
                None => return Ok(0),
            }
        }
    }
}
