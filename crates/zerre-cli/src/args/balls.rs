//! `zerre balls`.

use clap::ValueEnum;
use serde::Serialize;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;
use zerre::resample::Resampling as Scheme;

const BALLS: &str = "\
Examples:
  zerre balls rolling/                              every ball that comes, meets others and leaves
  zerre balls clip.mp4 --overlay seen.gif
  zerre balls clip.mp4 --count 3 --motion random-walk --resampling residual
  zerre balls table/ --ground first.png             a picture of the empty ground
  zerre simulate balls-touch --out made && zerre balls made --truth made/truth.csv
  zerre balls clip.mp4 --preset thesis --reading c  told apart by area, as in the thesis

Balls are what differs from the ground. Plain ground is found by itself, also under uneven light; ground with a pattern
needs --ground median (the median of frames) or a picture.
Outputs in --out: points.csv (frame,ball,x,y,vx,vy,var_x,var_y,cov_xy,area,detected,detected_x,detected_y; frames from
0, lengths in px, velocities in px per frame), report.html with film.png, run.json. A ball has rows from its first
detection to its last; where it was hidden in between, it is predicted and `detected` is 0.";

/// Follow several balls on plain ground
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = BALLS)]
pub struct Balls {
    /// Folder of pictures, video file, camera or address of a stream
    pub input: String,
    /// Number of balls [default: as many as come; 3 with --preset thesis]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = super::at_least_one::<NonZeroUsize>)]
    pub count: Option<NonZeroUsize>,
    /// How balls are told apart and followed
    #[arg(long, value_name = "NAME", default_value = "default")]
    pub preset: Preset,
    /// How the thesis is read: a, b, c or d (`zerre reproduce multi-ball` compares them) [default: a]
    #[arg(long, value_name = "NAME")]
    pub reading: Option<String>,
    /// How balls move [default: constant-velocity, or the reading's]
    #[arg(long, value_name = "NAME")]
    pub motion: Option<Motion>,
    /// How particles are resampled [default: systematic; multinomial with --preset thesis]
    #[arg(long, value_name = "NAME")]
    pub resampling: Option<Resampling>,
    /// Particles of each ball
    #[arg(long, value_name = "N", default_value = "1000")]
    #[arg(allow_negative_numbers = true, value_parser = super::at_least_one::<NonZeroU32>)]
    pub particles: NonZeroU32,
    /// Process noise after a frame: of velocities, px per frame, or of places, px [default: 1.5, or 8]
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    pub process_noise: Option<f64>,
    /// Standard deviation of the detected place of a whole ball, px
    #[arg(long, value_name = "PX", default_value = "0.5", allow_negative_numbers = true)]
    pub measurement_noise: f64,
    /// The ground: plain, median, or a picture of it
    #[arg(long, value_name = "plain|median|FILE", default_value = "plain")]
    pub ground: String,
    /// Level of difference from the ground above which a pixel is of a ball, 0 to 255 [default: Otsu's]
    #[arg(long, value_name = "LEVEL")]
    pub threshold: Option<u8>,
    /// Least area of a ball, px [default: an eighth of a typical one]
    #[arg(long, value_name = "PX")]
    pub min_area: Option<usize>,
    /// Largest area of balls that touch, px [default: a quarter of the ground]
    #[arg(long, value_name = "PX")]
    pub max_area: Option<usize>,
    /// Truth to score against: frame,ball,x,y,radius,visible
    #[arg(long, value_name = "F.csv")]
    pub truth: Option<PathBuf>,
    /// Film of balls and particles; MP4 needs the program ffmpeg
    #[arg(long, value_name = "F.mp4|F.gif")]
    pub overlay: Option<PathBuf>,
    /// End with exit code 3 when no ball was found, or when an identity changed against --truth
    #[arg(long)]
    pub strict: bool,
}

/// How balls are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// By where they were going, their areas and colours.
    Default,
    /// By sorting areas, a fixed number of balls.
    Thesis,
}

/// Motions of balls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// They go on as they went.
    ConstantVelocity,
    /// Their places wander.
    RandomWalk,
}

impl From<Motion> for zerre_vision::balls::BallMotion {
    fn from(motion: Motion) -> Self {
        match motion {
            Motion::ConstantVelocity => Self::ConstantVelocity,
            Motion::RandomWalk => Self::RandomWalk,
        }
    }
}

/// Resampling schemes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resampling {
    /// Independent draws.
    Multinomial,
    /// Whole copies for sure, the rest by independent draws.
    Residual,
    /// A draw in each of equal strata.
    Stratified,
    /// The same place in each of equal strata.
    Systematic,
}

impl From<Resampling> for Scheme {
    fn from(scheme: Resampling) -> Scheme {
        match scheme {
            Resampling::Multinomial => Scheme::Multinomial,
            Resampling::Residual => Scheme::Residual,
            Resampling::Stratified => Scheme::Stratified,
            Resampling::Systematic => Scheme::Systematic,
        }
    }
}
