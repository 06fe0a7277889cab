//! Videos, written by the program `ffmpeg` over a pipe.

use super::ffmpeg::{Listener, absent, apart};
use crate::{Error, Result};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

/// An MP4 file in the making: it takes its name when it is complete, and leaves nothing otherwise.
#[derive(Debug)]
pub struct Encoder {
    output: PathBuf,
    aside: PathBuf,
    program: Child,
    pixels: Option<ChildStdin>,
    said: Listener,
    size: [usize; 2],
}

impl Encoder {
    /// Starts a file of frames of `size`, across and down, of which `rate` are shown in a second.
    ///
    /// # Errors
    /// No program `ffmpeg`.
    pub fn start(output: &Path, size: [usize; 2], rate: f64) -> Result<Encoder> {
        let name = output.file_name().unwrap_or_default().to_string_lossy();
        let aside = output.with_file_name(format!(".{name}.partial"));
        let mut command = Command::new("ffmpeg");
        command.args(["-y", "-hide_banner", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]);
        command.args(["-s", &format!("{}x{}", size[0], size[1]), "-r", &rate.to_string(), "-i", "pipe:0"]);
        // Players want halved colour planes, and these want even sides.
        command.args([
            "-vf",
            "pad=ceil(iw/2)*2:ceil(ih/2)*2",
            "-pix_fmt",
            "yuv420p",
            "-movflags",
            "+faststart",
        ]);
        command.args(["-f", "mp4"]).arg(format!("file:{}", aside.display()));
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        apart(&mut command);
        let mut program = command.spawn().map_err(|error| absent(&output.to_string_lossy(), &error))?;
        let pixels = program.stdin.take();
        let said = Listener::new(program.stderr.take());
        Ok(Encoder { output: output.to_owned(), aside, program, pixels, said, size })
    }

    /// Adds a frame: red, green and blue of each pixel, row after row.
    ///
    /// # Errors
    /// Another number of bytes than the size needs; a program that has ended.
    pub fn push(&mut self, rgb: &[u8]) -> Result<()> {
        let [width, height] = self.size;
        if rgb.len() != 3 * width * height {
            return Err(Error::Pixels { found: rgb.len() / 3, width, height });
        }
        let written = self.pixels.as_mut().map(|pixels| pixels.write_all(rgb));
        match written {
            Some(Ok(())) => Ok(()),
            _ => {
                self.pixels = None;
                Err(self.refused("it takes no more frames"))
            }
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// What the program says.
    pub fn finish(mut self) -> Result<()> {
        self.pixels = None;
        let done = self.program.wait().is_ok_and(|status| status.success());
        if !done {
            return Err(self.refused("the file is not complete"));
        }
        fs::rename(&self.aside, &self.output)
            .map_err(|error| Error::Picture { path: self.output.clone(), problem: error.to_string() })
    }

    fn refused(&mut self, what: &str) -> Error {
        let _ = self.program.wait();
        let said = self.said.finish().join("; ");
        Error::Picture {
            path: self.output.clone(),
            problem: format!("ffmpeg cannot write it, {what}: {said}"),
        }
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        self.pixels = None;
        let _ = self.program.kill();
        let _ = self.program.wait();
        // After `finish` nothing is there any more.
        let _ = fs::remove_file(&self.aside);
    }
}
