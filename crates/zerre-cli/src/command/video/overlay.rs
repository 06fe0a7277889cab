//! The film of a run: GIF by ourselves, MP4 by `ffmpeg`.

use crate::diagnostic::Diagnostic;
use std::path::{Path, PathBuf};
use zerre_io::write_atomically;
use zerre_lab::report::animation::Animation;
use zerre_lab::report::overlay::{Drawn, shown};
use zerre_vision::frames::encode::Encoder;
use zerre_vision::frames::ffmpeg;

/// A GIF grows in memory: of longer videos it shows every so many-th frame, of endless ones the beginning.
const MOST_FRAMES: usize = 400;
/// Frames per second where the input does not say: those of most cameras.
const RATE: f64 = 30.0;
/// Widths of the film, px.
const LEAST: u16 = 320;
const MOST_GIF: u16 = 480;
const MOST_MP4: u16 = 1920;

pub(in crate::command) struct Overlay {
    path: PathBuf,
    rate: f64,
    every: usize,
    seen: usize,
    film: Film,
}

enum Film {
    None,
    Gif(Animation),
    Mp4(Encoder),
}

fn is_gif(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gif"))
}

/// Refuses what cannot be written before anything is computed.
pub(in crate::command) fn check(path: &Path, force: bool) -> Result<(), Diagnostic> {
    let is_mp4 = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mp4"));
    if !is_gif(path) && !is_mp4 {
        return Err(Diagnostic::usage(format!("the overlay {} is neither .mp4 nor .gif", path.display())));
    }
    if is_mp4 {
        ffmpeg::installed(&path.display().to_string()).map_err(|error| {
            Diagnostic::new(error.to_string()).help("an overlay that ends with .gif needs no other program")
        })?;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        return Err(Diagnostic::new(format!("there is no folder {} for the overlay", folder.display())));
    }
    if path.exists() && !force {
        let what = format!("the overlay {} is there already", path.display());
        return Err(Diagnostic::new(what).help("--force replaces it"));
    }
    Ok(())
}

impl Overlay {
    pub(in crate::command) fn new(path: &Path, rate: Option<f64>, expected: Option<usize>) -> Overlay {
        let every = if is_gif(path) { expected.unwrap_or(1).div_ceil(MOST_FRAMES).max(1) } else { 1 };
        let rate = rate.unwrap_or(RATE);
        Overlay { path: path.to_owned(), rate, every, seen: 0, film: Film::None }
    }

    fn refused(&self, error: impl std::fmt::Display) -> Diagnostic {
        Diagnostic::new(format!("the overlay {} cannot be written: {error}", self.path.display()))
    }

    pub(in crate::command) fn push(&mut self, scene: &impl Drawn) -> Result<(), Diagnostic> {
        let turn = self.seen.is_multiple_of(self.every);
        self.seen += 1;
        let gif = is_gif(&self.path);
        if !turn || (gif && self.seen / self.every > MOST_FRAMES) {
            return Ok(());
        }
        let size = shown(scene.size(), LEAST, if gif { MOST_GIF } else { MOST_MP4 });
        let drawn = scene.draw(size).map_err(|error| self.refused(error))?;
        if matches!(self.film, Film::None) {
            self.film = if gif {
                Film::Gif(Animation::new(size).map_err(|error| self.refused(error))?)
            } else {
                let sides = size.map(usize::from);
                Film::Mp4(Encoder::start(&self.path, sides, self.rate).map_err(|error| self.refused(error))?)
            };
        }
        let hundredths = (100.0 * self.every as f64 / self.rate).round().clamp(2.0, 65535.0) as u16;
        match &mut self.film {
            Film::None => Ok(()),
            Film::Gif(animation) => animation.push(&drawn, hundredths).map_err(|error| self.refused(error)),
            Film::Mp4(encoder) => {
                encoder.push(drawn.rgb().as_flattened()).map_err(|error| self.refused(error))
            }
        }
    }

    /// Completes the file; says what of the video is not in it.
    pub(in crate::command) fn finish(mut self) -> Result<Option<String>, Diagnostic> {
        let film = std::mem::replace(&mut self.film, Film::None);
        match film {
            Film::None => return Ok(None),
            Film::Gif(animation) => {
                let bytes = animation.finish().map_err(|error| self.refused(error))?;
                write_atomically(&self.path, |file| std::io::Write::write_all(file, &bytes))
                    .map_err(|error| Diagnostic::new(error.to_string()))?;
            }
            Film::Mp4(encoder) => encoder.finish().map_err(|error| self.refused(error))?,
        }
        let (every, path) = (self.every, self.path.display());
        Ok(if every > 1 {
            Some(format!("{path} shows one frame of {every}; an overlay that ends with .mp4 has all"))
        } else if is_gif(&self.path) && self.seen > MOST_FRAMES {
            Some(format!(
                "{path} shows the first {MOST_FRAMES} frames; an overlay that ends with .mp4 has all"
            ))
        } else {
            None
        })
    }
}
