//! `zerre fuse`.

use clap::ValueEnum;
use serde::Serialize;
use std::num::NonZeroU32;
use std::path::PathBuf;

const FUSE: &str = "\
Examples:
  zerre simulate rgbd-light --out made && zerre fuse made --truth made/truth.csv
  zerre fuse recording/ --joints pose.csv --joint hand_right --joint hand_left
  zerre fuse recording/ --start 312,240 --room median      no joint file: the point is shown once
  zerre fuse recording/ --calibrate labels.csv --out mine  learn what the sources are like from marked frames ...
  zerre fuse another/ --config mine/fuse.toml              ... and use it
  zerre fuse bag.mcap --start 312,240                      pictures of ROS 2 and Foxglove (with the feature mcap)
  zerre fuse /dev/video0 --start 312,240                   a camera: colours alone, frames are dropped rather than late
  zerre fuse made --without color                          what the rest is worth
  zerre fuse made --preset thesis --steps 1,81             the pictures of its steps
  zerre init fuse > fuse.toml && zerre fuse made --config fuse.toml

A recording is a folder: rgb/ and depth/ with the same numbers, or as the TUM benchmark has it (rgb.txt, depth.txt);
or an MCAP file, where this program is built with the feature mcap. A video file, a camera (/dev/video0) or the address
of a stream has colours alone, and needs ffmpeg.
camera.json in it or above it says how depth is seen from the colour camera. Depth is millimetres unless the camera says.
Joints: a table with time_s (or frame: the name of its picture, or its place from 0), joint, x, y (px), z (mm, may be
empty), confidence (0 to 1), and source where there are several; joints.csv in the recording unless --joints names another.
Of rows between two frames the last one counts.
Marks (--truth, --calibrate): frame,x,y, and point where there are several, or labels of several operators, whose geometric
median is taken, as `zerre label` writes both; what is not visible is no truth. --truth is used for scores alone.
Outputs in --out: points.csv (px, px^2, mm in the colour camera's frame), report.html with film.png, fuse.toml with
--calibrate, step-*.png with --steps, run.json.";

/// Follow points of a body in colour and depth
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = FUSE)]
pub struct Fuse {
    /// Folder or MCAP file of a recording of colour and depth; a video, a camera or a stream of colours alone
    pub recording: PathBuf,
    /// Settings (`zerre init fuse` writes them)
    #[arg(long, value_name = "F.toml")]
    pub config: Option<PathBuf>,
    /// What devices and pose estimators say [default: joints.csv in the recording]
    #[arg(long, value_name = "F.csv")]
    pub joints: Option<PathBuf>,
    /// Which joints to follow [default: all in the file]
    #[arg(long, value_name = "NAME")]
    pub joint: Vec<String>,
    /// Where the point is in the first frame, px, without a joint file
    #[arg(long, value_name = "x,y", allow_hyphen_values = true, value_parser = place)]
    pub start: Option<[f64; 2]>,
    /// Leave a source out: color, depth, or one of the joint file
    #[arg(long, value_name = "NAME")]
    pub without: Vec<String>,
    /// Which filter
    #[arg(long, value_name = "NAME", default_value = "sound")]
    pub preset: FusePreset,
    /// What the empty room looks like [default: its pictures in the recording, else the median of frames;
    /// running before a camera]
    #[arg(long, value_name = "NAME")]
    pub room: Option<RoomFrom>,
    /// Cameras [default: camera.json]
    #[arg(long, value_name = "F.json")]
    pub camera: Option<PathBuf>,
    /// Particles of each point [default: 150, or the configuration's]
    #[arg(long, value_name = "N")]
    #[arg(allow_negative_numbers = true, value_parser = super::at_least_one::<NonZeroU32>)]
    pub particles: Option<NonZeroU32>,
    /// Where the points are, for scores
    #[arg(long, value_name = "F.csv")]
    pub truth: Option<PathBuf>,
    /// Where the points are, to learn what the sources are like; writes fuse.toml and follows with it
    #[arg(long, value_name = "F.csv")]
    pub calibrate: Option<PathBuf>,
    /// Film of points, ellipses and particles; MP4 needs the program ffmpeg
    #[arg(long, value_name = "F.mp4|F.gif")]
    pub overlay: Option<PathBuf>,
    /// Frames whose steps are written as pictures (with --preset thesis), from 1
    #[arg(long, value_name = "K,...", value_delimiter = ',')]
    pub steps: Vec<usize>,
    /// End with exit code 3 when a point is lost in the last frame
    #[arg(long)]
    pub strict: bool,
}

/// Filters of `zerre fuse`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FusePreset {
    /// Cues as mixtures with outliers, learnt; what is missing is missing.
    Sound,
    /// As the thesis has it.
    Thesis,
}

/// Where the empty room is known from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RoomFrom {
    /// background_rgb.png and background_depth.png in the recording.
    Pictures,
    /// The median of frames over the whole recording.
    Median,
    /// Learnt frame by frame, from the first one on.
    Running,
}

/// A place from its two numbers.
fn place(text: &str) -> Result<[f64; 2], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y]) if x.is_finite() && y.is_finite() => Ok([x, y]),
        _ => Err("two numbers are needed, as 312,240: x and y in pixels".to_owned()),
    }
}
