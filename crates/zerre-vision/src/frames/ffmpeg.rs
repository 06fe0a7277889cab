//! Video files, cameras and streams, read by the program `ffmpeg` over a pipe.

use crate::{Error, Frame, Image, Result};
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// Lines of the program's complaints that are kept.
const KEPT_LINES: usize = 4;

/// Longest side of a frame that is believed, pixels.
const LONGEST: usize = 1 << 16;

/// How the program is to be had.
pub const HOW_TO_INSTALL: &str = "install it (Debian and Ubuntu: `apt install ffmpeg`, macOS: `brew install ffmpeg`, \
                                  Windows: `winget install ffmpeg`), or give a folder of pictures";

/// The frames of a video while `ffmpeg` decodes it. The program is stopped when this is dropped.
#[derive(Debug)]
pub struct Video {
    input: String,
    program: Child,
    pixels: BufReader<ChildStdout>,
    said: Listener,
    claimed: Option<usize>,
    rate: Option<f64>,
    first: Option<Frame>,
    decoded: usize,
    ended: bool,
    complaint: Option<String>,
}

impl Video {
    /// Starts to decode a video file, a camera (`/dev/video...`) or the address of a stream.
    ///
    /// # Errors
    /// No program `ffmpeg`; an input without a single frame, with what the program says of it.
    pub fn open(input: &str) -> Result<Video> {
        let refuse = |problem: String| Error::Input { input: input.to_owned(), problem };
        let mut command = Command::new("ffmpeg");
        command.args(["-nostdin", "-hide_banner", "-loglevel", "error"]);
        let (claimed, rate) = if input.contains("://") {
            if input.starts_with("rtsp") {
                // Over datagrams lost packets would be smeared over the frames that follow.
                command.args(["-rtsp_transport", "tcp"]);
            }
            command.args(["-i", input]);
            (None, None)
        } else if is_camera(Path::new(input)) {
            command.args(["-f", "v4l2", "-i", input]);
            (None, None)
        } else {
            // Without the word before it, a name with a colon would be taken for a protocol.
            let file = format!("file:{input}");
            command.args(["-i", &file]);
            header(&file)
        };
        // Each frame as it is stored: none doubled, none dropped. Every picture comes with its own size
        // before it.
        command.args(["-map", "0:v:0"]).args(passthrough()?);
        command.args(["-f", "image2pipe", "-c:v", "ppm", "-pix_fmt", "rgb24", "pipe:1"]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        apart(&mut command);
        let mut program = command.spawn().map_err(|error| absent(input, &error))?;
        let said = Listener::new(program.stderr.take());
        let Some(stdout) = program.stdout.take() else {
            return Err(refuse("ffmpeg cannot be listened to".to_owned()));
        };
        let mut video = Video {
            input: input.to_owned(),
            program,
            pixels: BufReader::with_capacity(1 << 16, stdout),
            said,
            claimed,
            rate,
            first: None,
            decoded: 0,
            ended: false,
            complaint: None,
        };
        video.first = match video.decode() {
            Some(frame) => Some(frame?),
            None => {
                let why =
                    video.complaint.take().unwrap_or_else(|| "it ends before its first frame".to_owned());
                return Err(refuse(format!("there is no video in it: {why}")));
            }
        };
        Ok(video)
    }

    /// Number of frames that the file's header claims.
    pub fn claimed(&self) -> Option<usize> {
        self.claimed
    }

    /// Frames per second by the file's header.
    pub fn rate(&self) -> Option<f64> {
        self.rate
    }

    /// After the last frame: what went wrong.
    pub fn complaint(&self) -> Option<&str> {
        self.complaint.as_deref()
    }

    /// The next frame; `None` after the last one.
    #[expect(clippy::should_implement_trait, reason = "the iterator is `Frames`")]
    pub fn next(&mut self) -> Option<Result<Frame>> {
        match self.first.take() {
            Some(first) => Some(Ok(first)),
            None => self.decode(),
        }
    }

    fn decode(&mut self) -> Option<Result<Frame>> {
        if self.ended {
            return None;
        }
        match picture(&mut self.pixels) {
            Ok(Some(frame)) => {
                self.decoded += 1;
                return Some(frame);
            }
            Ok(None) => self.end(None),
            Err(error) => self.end(Some(error)),
        }
        None
    }

    /// Waits for the program, and puts together what it says.
    fn end(&mut self, broken: Option<std::io::Error>) {
        self.ended = true;
        let _ = std::io::copy(&mut self.pixels, &mut std::io::sink());
        let status = self.program.wait();
        let said = self.said.finish();
        let mut parts = Vec::new();
        if let Some(claimed) = self.claimed.filter(|claimed| (1..*claimed).contains(&self.decoded)) {
            parts.push(format!(
                "it ends after {} of the {claimed} frames that its header claims",
                self.decoded
            ));
        }
        if !said.is_empty() {
            let words = said.join("; ").replace(&format!("file:{}: ", self.input), "");
            parts.push(format!("ffmpeg reports: {words}"));
        }
        if let Some(error) = broken {
            parts.push(format!("its last frame is cut off ({error})"));
        }
        match status {
            Ok(status) if status.success() => (),
            Ok(status) => parts.push(format!("ffmpeg stopped with {status}")),
            Err(error) => parts.push(format!("ffmpeg is gone: {error}")),
        }
        self.complaint = (!parts.is_empty()).then(|| parts.join("; "));
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        if !self.ended {
            let _ = self.program.kill();
            let _ = self.program.wait();
        }
    }
}

/// Keeps what a program complains of, so that its pipe is never full.
#[derive(Debug)]
pub(super) struct Listener {
    said: Arc<Mutex<Vec<String>>>,
    thread: Option<JoinHandle<()>>,
}

impl Listener {
    pub(super) fn new(pipe: Option<ChildStderr>) -> Listener {
        let said = Arc::new(Mutex::new(Vec::new()));
        let notes = Arc::clone(&said);
        let listen = |pipe| {
            std::thread::spawn(move || {
                for line in BufReader::new(pipe).lines().map_while(|line| line.ok()) {
                    let Ok(mut notes) = notes.lock() else { return };
                    // The first words name the cause; later ones are its consequences.
                    if notes.len() < KEPT_LINES && !notes.contains(&line) {
                        notes.push(line);
                    }
                }
            })
        };
        Listener { said, thread: pipe.map(listen) }
    }

    /// What was said, once the program has ended.
    pub(super) fn finish(&mut self) -> Vec<String> {
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.said.lock().map(|said| said.clone()).unwrap_or_default()
    }
}

/// Keeps Ctrl-C at the terminal from the program: who runs it decides when it ends.
pub(super) fn apart(command: &mut Command) {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(not(unix))]
    let _ = command;
}

/// Whether `ffmpeg` can be run.
///
/// # Errors
/// It is not installed, or does not run; the message says what to do.
pub fn installed(input: &str) -> Result<()> {
    version().map(|_| ()).map_err(|error| absent(input, &error))
}

pub(super) fn absent(input: &str, error: &std::io::Error) -> Error {
    let problem = if error.kind() == ErrorKind::NotFound {
        format!(
            "videos, cameras and streams need the program ffmpeg, which is not installed: {HOW_TO_INSTALL}"
        )
    } else {
        format!("the program ffmpeg cannot be started: {error}")
    };
    Error::Input { input: input.to_owned(), problem }
}

fn version() -> std::io::Result<String> {
    let output = Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).output()?;
    Ok(String::from_utf8_lossy(&output.stdout).lines().next().unwrap_or_default().to_owned())
}

/// The option that keeps frames as they are, which got another name in version 5.1.
fn passthrough() -> Result<[&'static str; 2]> {
    let version = version().map_err(|error| absent("video", &error))?;
    Ok(if is_old(&version) { ["-vsync", "passthrough"] } else { ["-fps_mode", "passthrough"] })
}

fn is_old(version: &str) -> bool {
    let number = version.split_whitespace().nth(2).unwrap_or_default();
    let mut parts = number.trim_start_matches('n').split(|c: char| !c.is_ascii_digit());
    let mut part = || parts.next().and_then(|part| part.parse::<u32>().ok());
    // Builds from the source's newest state have no number.
    part().is_some_and(|major| major < 5 || (major == 5 && part() == Some(0)))
}

pub(super) fn is_camera(path: &Path) -> bool {
    path.to_string_lossy().starts_with("/dev/video")
}

/// Number of frames and frames per second by the header of a file; nothing where it does not say or the program
/// `ffprobe` is missing.
fn header(file: &str) -> (Option<usize>, Option<f64>) {
    let mut command = Command::new("ffprobe");
    command.args([
        "-v",
        "error",
        "-select_streams",
        "v:0",
        "-show_entries",
        "stream=nb_frames,avg_frame_rate",
    ]);
    let output = command.args(["-of", "default=nw=1", file]).stdin(Stdio::null()).output();
    let Ok(output) = output else { return (None, None) };
    let text = String::from_utf8_lossy(&output.stdout);
    let value = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    let rate = value("avg_frame_rate").and_then(|rate| {
        let (over, under) = rate.split_once('/')?;
        let rate: f64 = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
        (rate.is_finite() && rate > 0.0).then_some(rate)
    });
    (value("nb_frames").and_then(|count| count.parse().ok()), rate)
}

/// The next picture in the portable pixmap format; nothing at the end.
fn picture(from: &mut impl BufRead) -> std::io::Result<Option<Result<Frame>>> {
    let bad = || std::io::Error::new(ErrorKind::InvalidData, "no head of a picture");
    if from.fill_buf()?.is_empty() {
        return Ok(None);
    }
    let mut head = [0; 2];
    from.read_exact(&mut head)?;
    if head != *b"P6" {
        return Err(bad());
    }
    let (width, height, largest) = (number(from)?, number(from)?, number(from)?);
    if !(1..=LONGEST).contains(&width) || !(1..=LONGEST).contains(&height) || largest != 255 {
        return Err(bad());
    }
    let mut pixels = vec![[0_u8; 3]; width * height];
    from.read_exact(pixels.as_flattened_mut())?;
    Ok(Some(Image::new(width, height, pixels)))
}

/// A number between white space, of which one byte behind it is taken too.
fn number(from: &mut impl Read) -> std::io::Result<usize> {
    let (mut value, mut begun) = (0_usize, false);
    loop {
        let mut byte = [0];
        from.read_exact(&mut byte)?;
        match byte[0] {
            digit @ b'0'..=b'9' => {
                value = value.saturating_mul(10).saturating_add(usize::from(digit - b'0'));
                begun = true;
            }
            _ if begun => return Ok(value),
            _ => (),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_follow_each_other_in_a_pipe() {
        let two = b"P6\n2 1\n255\nabcdefP6\n1 1\n255\nxyz";
        let mut from = &two[..];
        let mut next = || picture(&mut from).unwrap().map(|frame| frame.unwrap());
        assert_eq!(next(), Some(Image::new(2, 1, vec![*b"abc", *b"def"]).unwrap()));
        assert_eq!(next().map(|frame| frame.size()), Some((1, 1)));
        assert_eq!(next(), None);
        for bad in [&b"P5\n1 1\n255\nx"[..], b"P6\n2 1\n255\nabc", b"P6\n0 1\n255\n", b"P6\n9999999 9\n255\n"]
        {
            assert!(picture(&mut &*bad).is_err());
        }
    }

    #[test]
    fn the_option_follows_the_version() {
        for (version, old) in [
            ("ffmpeg version 4.4.2-0ubuntu0.22.04.1 Copyright", true),
            ("ffmpeg version 5.0.1 Copyright", true),
            ("ffmpeg version 5.1.9-0+deb12u1 Copyright", false),
            ("ffmpeg version n7.1 Copyright", false),
            ("ffmpeg version N-118000-gabcdef Copyright", false),
        ] {
            assert_eq!(is_old(version), old, "{version}");
        }
    }
}
