//! The command line. Names are a contract: none changes without an entry in the changelog.

mod balls;
mod fuse;

pub use balls::{Balls, Motion as BallMotion, Preset, Resampling as BallResampling};
pub use fuse::{Fuse, FusePreset, RoomFrom};

use crate::config::Format;
use clap::{ArgAction, Parser, Subcommand, ValueEnum};
use serde::Serialize;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;
use std::str::FromStr;
use zerre_vision::Rect;

const EXAMPLES: &str = "\
Examples:
  zerre catalog                         what there is to choose from
  zerre init track > track.toml         a commented starter configuration
  zerre track ships.csv --explain       follow every identified target; explain each setting
  zerre schema track > track.json       lets an editor check the configuration

Results go to standard output and --out, everything else to standard error.
Exit codes: 0 done; 1 could not, or stopped before the end; 2 wrong usage; 3 done but degraded, with --strict.";

/// Particle filters and their relatives: track, simulate, compare, reproduce, study, bench.
#[derive(Clone, Debug, Parser)]
#[command(name = "zerre", version, after_help = EXAMPLES, max_term_width = 110)]
#[command(disable_help_subcommand = true, disable_help_flag = true)]
pub struct Args {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// Options that stand before or after the command.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Options of every command")]
pub struct Global {
    /// Seed of all random numbers: the same seed gives the same bits
    // What looks like a number is a value, so that the complaint is about the value.
    #[arg(long, global = true, value_name = "N", default_value_t = 1)]
    #[arg(allow_negative_numbers = true, value_parser = seed)]
    pub seed: u64,
    /// Threads [default: all cores]; never changes results
    #[arg(long, global = true, value_name = "N")]
    #[arg(allow_negative_numbers = true, value_parser = at_least_one::<NonZeroUsize>)]
    pub threads: Option<NonZeroUsize>,
    /// SIMD level, for tests; never changes results
    #[arg(long, global = true, value_name = "LEVEL", default_value = "auto")]
    pub simd: Simd,
    /// Folder for outputs [default: out/COMMAND-INPUT, replaced when an earlier run made it]
    #[arg(long, global = true, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write into a folder that is not empty: files of an earlier run and of the same names are replaced
    #[arg(long, global = true)]
    pub force: bool,
    /// Continue in the folder of an interrupted run; commands that start anew each time refuse it
    #[arg(long, global = true)]
    pub resume: bool,
    /// Print the effective configuration with the reason for each value
    #[arg(long, global = true)]
    pub explain: bool,
    /// Print exactly one JSON document on standard output
    #[arg(long, global = true)]
    pub json: bool,
    /// Print errors only
    #[arg(long, global = true)]
    pub quiet: bool,
    /// How much to say on standard error
    #[arg(long, global = true, value_name = "LEVEL", default_value = "info")]
    pub log: Level,
    /// Print help
    // One form of help: the long one of clap spends a screen on lists of words.
    #[arg(short, long, global = true, action = ArgAction::HelpShort)]
    pub help: Option<bool>,
}

fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("a whole number from 0 to {} is needed", u64::MAX))
}

/// A count that cannot be zero; the standard library's own words are for programmers.
fn at_least_one<T: FromStr>(text: &str) -> Result<T, String> {
    text.parse().map_err(|_| "a whole number of at least 1 is needed".to_owned())
}

/// How much is said; each level includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Level {
    /// Errors.
    Error,
    /// What makes results doubtful.
    Warn,
    /// What was done.
    Info,
    /// What only the hunter of a fault wants.
    Debug,
}

/// SIMD levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Simd {
    /// The best that the processor has.
    Auto,
    /// None.
    Scalar,
    /// 256 bits on x86-64.
    Avx2,
    /// 512 bits on x86-64.
    Avx512,
    /// 128 bits on ARM.
    Neon,
}

/// The commands.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Follow targets in recorded measurements
    Track(Track),
    /// Make measurements and truth of a scenario
    Simulate(Simulate),
    /// Score estimates against truth
    Compare(Compare),
    /// Do the experiments of a paper again; without a paper, list them
    Reproduce(Reproduce),
    /// Compare filters over a grid of worlds and settings
    Study(Study),
    /// Follow one object in an image folder, a video, a camera or a stream
    Video(Video),
    /// Score trackers on annotated sequences
    Otb(Otb),
    /// Follow several balls on plain ground
    Balls(Balls),
    /// Follow points of a body in colour and depth
    Fuse(Fuse),
    /// Open the page on which people mark reference points in frames
    Label(Label),
    /// Measure the speed of this machine
    #[command(after_help = BENCH)]
    Bench {
        /// These workloads only, as `W1` or `deadline` (100 s, left out unless it is named)
        workloads: Vec<String>,
        /// A tenth of a second per workload instead of two seconds (20 of `deadline`): coarse figures
        #[arg(long)]
        quick: bool,
    },
    /// List what there is to choose from, with one line each
    #[command(after_help = CATALOG)]
    Catalog {
        /// One list only, as `filters` or `formats`
        kind: Option<String>,
    },
    /// Print the JSON Schema of a configuration file
    #[command(after_help = SCHEMA)]
    Schema {
        /// Kind of configuration: track, scenario, study, fuse
        kind: String,
    },
    /// Print a commented starter configuration
    #[command(after_help = INIT)]
    Init {
        /// Kind of configuration: track, scenario, study, fuse
        #[arg(default_value = "track")]
        kind: String,
    },
}

const TRACK: &str = "\
Examples:
  zerre track ships.csv
  zerre track radar.csv --config track.toml --explain
  zerre track plots.csv --truth truth.csv --json
  zerre track fixes.csv --single --filter particle --motion constant-velocity
  zerre track points.csv --config extended.toml        many points a scan: learn the shape, too
  zerre track radar_0400_*.csv --config extended.toml  frames of nuScenes, with boxes.csv beside them
  zerre track smr.csv --motion constant-velocity-box   length, width and orientation, too
  zcat day.csv.gz | zerre track - > rows.csv

Input is a table with a header whose names carry units: time_s or time (RFC 3339), then
x_m y_m | range_m bearing_deg | lat_deg lon_deg ..., and id where targets are identified.
A configuration with the section [extended] makes rows of one id and one time the points of one scan.
Outputs in --out: tracks.csv, tracks.parquet, shapes.csv (extended targets), tracks.geojson
(geographic input), report.html, plan.svg, run.json. Standard input without --json gives rows on standard output and run.json;
noises that nobody gives are learnt from its first 200 measurements, and no row leaves before.";

/// Follow targets in recorded measurements
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = TRACK)]
pub struct Track {
    /// Recordings; - is standard input and writes a row per measurement
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// Configuration (`zerre init track` writes one)
    #[arg(long, value_name = "F.toml")]
    pub config: Option<PathBuf>,
    /// Format of the recordings [default: auto, or the configuration's]
    #[arg(long)]
    pub format: Option<Format>,
    /// Truth to score the tracks against
    #[arg(long, value_name = "F")]
    pub truth: Option<PathBuf>,
    /// Take all measurements as of one target
    #[arg(long)]
    pub single: bool,
    /// End with exit code 3 when the outcome is degraded (track lost, filter inconsistent)
    #[arg(long)]
    pub strict: bool,
    /// Filter, a name of `zerre catalog filters` [default: auto, or the configuration's]
    #[arg(long, value_name = "NAME")]
    pub filter: Option<String>,
    /// Motion model, a name of `zerre catalog motions` [default: auto, or the configuration's]
    #[arg(long, value_name = "NAME")]
    pub motion: Option<String>,
}

const SIMULATE: &str = "\
Examples:
  zerre catalog scenarios
  zerre simulate radar-cv --seed 7 --out made
  zerre simulate two-crossing --runs 100
  zerre init scenario > mine.toml && zerre simulate mine.toml
  zerre simulate clip-hidden --out clip && zerre otb clip
  zerre simulate rgbd-clutter --out room

Outputs in --out: measurements.csv, truth.csv, run.json, and track.toml, which tells `zerre track` where the
sensors stand and how well they measure. With --runs above 1 the tables are measurements-0001.csv,
truth-0001.csv and so on; the first run is that of --runs 1.

The scenarios `clip-...` are pictures, for `zerre video` and `zerre otb`: 200 frames 0001.png, 0002.png, ... of
320 x 240 pixels, and groundtruth.txt with a box x,y,width,height per frame, NaN where less than half of the object can
be seen. Another --seed draws another object on another way.

The scenarios `rgbd-...` are recordings of colour and depth: 111 frames rgb/0001.png and depth/0001.png (16 bits, mm, seen
from the depth camera), camera.json, the empty room (background_rgb.png, background_depth.png), truth.csv, joints.csv
(what a device reports: pixels, mm) and labels.csv (what seven people have marked).

The scenarios `balls-...` are pictures of several balls, for `zerre balls`: 640 x 480 pixels, and truth.csv with
frame,ball,x,y,radius,visible.";

/// Make measurements and truth of a scenario
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = SIMULATE)]
pub struct Simulate {
    /// A name of `zerre catalog scenarios`, or a scenario file
    pub scenario: String,
    /// Independent repetitions
    #[arg(long, value_name = "N", default_value = "1")]
    #[arg(allow_negative_numbers = true, value_parser = at_least_one::<NonZeroU32>)]
    pub runs: NonZeroU32,
}

const COMPARE: &str = "\
Examples:
  zerre compare out/track-plots/tracks.csv truth.csv
  zerre compare tracks.csv truth.csv --metric gospa nees --json

Targets are compared by id where ids agree; otherwise each instant pairs estimates and truth by GOSPA.
Positions are compared in the plane, in metres; truth is taken on the straight line between its points.
`zerre track --truth` scores in the same way, with the defaults of these options.
`zerre catalog metrics` lists the metrics with their units.";

/// Score estimates against truth
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = COMPARE)]
pub struct Compare {
    /// Estimates
    #[arg(value_name = "A.csv")]
    pub estimates: PathBuf,
    /// Truth
    #[arg(value_name = "B.csv")]
    pub truth: PathBuf,
    /// Metrics, names of `zerre catalog metrics` [default: all that the tables allow]
    #[arg(long, value_name = "NAME", num_args = 1..)]
    pub metric: Vec<String>,
    /// Distance from which on an estimate and a true object do not belong together, m (GOSPA, OSPA)
    #[arg(long, value_name = "METRES", default_value = "100", allow_negative_numbers = true)]
    pub cutoff_m: f64,
    /// Longest gap between two points of a trajectory that is bridged by a straight line, s
    #[arg(long, value_name = "SECONDS", default_value = "10", allow_negative_numbers = true)]
    pub max_gap_s: f64,
}

const REPRODUCE: &str = "\
Examples:
  zerre reproduce                                   the papers
  zerre reproduce multiple-model --quick            a short version
  zerre reproduce multiple-model --table 6.1 --table 6.13
  zerre reproduce bayes-family --table ungm         one world
  zerre reproduce extended-target --runs 200        narrower intervals
  zerre reproduce swarm --table variants            a table that is computed only on request
  zerre reproduce video --data otb --quick          sequences of a folder (`otb` in it, if there is one)
  zerre reproduce rgbd --table recorded --data DIR  real recordings (`rgbd_asus` in it, if there is one)
  zerre reproduce multi-ball --particles 50,1000    some sizes only
  zerre reproduce multiple-model --resume           go on where an interrupted run stopped

Outputs in --out: one table-*.csv per table, rows.csv with every number and its interval,
rmse-per-step.csv (multiple-model), report.html, run.json, and progress.json, which holds what is
done and what --resume goes on from.";

/// Do the experiments of a paper again; without a paper, list them
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = REPRODUCE)]
pub struct Reproduce {
    /// A name of `zerre catalog papers`
    pub paper: Option<String>,
    /// Only these tables, and what they need [default: all but those on request]
    #[arg(long, value_name = "T", requires = "paper")]
    pub table: Vec<String>,
    /// Runs of each cell [default: the paper's; 20 with --quick, video: 3]
    #[arg(long, value_name = "N", requires = "paper")]
    #[arg(allow_negative_numbers = true, value_parser = at_least_one::<NonZeroU32>)]
    pub runs: Option<NonZeroU32>,
    /// Numbers of particles (bayes-family: of likelihood evaluations a step) instead of the paper's,
    /// separated by commas; one for extended-target, none for swarm and video
    #[arg(long, value_name = "N", requires = "paper", value_delimiter = ',')]
    #[arg(allow_negative_numbers = true, value_parser = at_least_one::<NonZeroU32>)]
    pub particles: Vec<NonZeroU32>,
    /// Folder of recordings, for tables that need them (extended-target, rgbd: recorded; video: annotated
    /// sequences) [default: $ZERRE_DATA]
    #[arg(long, value_name = "DIR", requires = "paper")]
    pub data: Option<PathBuf>,
    /// Every scenario, noise and method, but the smallest and the main number of particles only, and fewer runs
    #[arg(long, requires = "paper")]
    pub quick: bool,
}

const STUDY: &str = "\
Examples:
  zerre init study > study.toml && zerre study study.toml
  zerre study study.toml --runs 20                  a short version
  zerre study study.toml --resume                   go on where an interrupted run stopped
  zerre catalog worlds
  zerre catalog contenders

Outputs in --out: results.csv and results.parquet with every run of every cell, ranking.csv,
report.html with the ranking and error against cost, run.json, and progress.json, which holds what is
done and what --resume goes on from.";

/// Compare filters over a grid of worlds and settings
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = STUDY)]
pub struct Study {
    /// What to compare (`zerre init study` writes one)
    #[arg(value_name = "F.toml")]
    pub file: PathBuf,
    /// Runs of each cell instead of the file's
    #[arg(long, value_name = "N")]
    #[arg(allow_negative_numbers = true, value_parser = at_least_one::<NonZeroU32>)]
    pub runs: Option<NonZeroU32>,
}

const VIDEO: &str = "\
Examples:
  zerre video clip.mp4 --box 120,80,40,60                 x, y, width, height in pixels of the first frame
  zerre video frames/ --box 120,80,40,60 --overlay seen.gif
  zerre video otb/Girl                                    an annotated sequence brings its box and its truth
  zerre video clip.mp4                                    with a display: a page opens to draw the box on
  zerre video clip.mp4 --truth boxes.txt --overlay seen.mp4
  zerre video /dev/video0 --box 200,120,80,80             a camera, until Ctrl-C
  zerre video rtsp://host/stream --box 200,120,80,80
  zerre catalog trackers

x goes to the right, y downwards, 0,0 is the upper left corner. Folders hold JPEG or PNG pictures with numbers in their
names; everything else is read by the program ffmpeg, if it is installed.
Outputs in --out: boxes.csv (frame,x,y,w,h,p_lost,var_x,var_y; frames from 0, var_x and var_y of the centre),
report.html with film.png, run.json. p_lost is the probability that the box is not on the object.";

/// Follow one object in an image folder, a video, a camera or a stream
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = VIDEO)]
pub struct Video {
    /// Folder of pictures, annotated sequence, video file, camera or address of a stream
    pub input: String,
    /// Where the object is in the first frame, px [default: the first box of the truth, or drawn by hand]
    #[arg(long = "box", value_name = "x,y,w,h", allow_hyphen_values = true, value_parser = bounds)]
    pub bounds: Option<Rect>,
    /// Tracker, a name of `zerre catalog trackers` [default: the first of them]
    #[arg(long, value_name = "NAME")]
    pub tracker: Option<String>,
    /// Where the object is: a box a line, from the first frame on
    #[arg(long, value_name = "F")]
    pub truth: Option<PathBuf>,
    /// Film of truth, box and particles; MP4 needs the program ffmpeg
    #[arg(long, value_name = "F.mp4|F.gif")]
    pub overlay: Option<PathBuf>,
    /// End with exit code 3 when the object is lost in the last frame
    #[arg(long)]
    pub strict: bool,
}

/// A box from its four numbers.
pub fn bounds(text: &str) -> Result<Rect, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) => Ok(Rect { x, y, width, height }),
        _ => Err("four numbers are needed, as 120,80,40,60: x, y, width and height in pixels".to_owned()),
    }
}

const OTB: &str = "\
Examples:
  zerre otb otb/Girl otb/Deer
  zerre otb otb/                                          every sequence in the folder
  zerre otb otb/Girl --tracker still --repeat 5           five seeds, with intervals
  zerre otb otb/Girl --protocol temporal --protocol spatial
  zerre otb otb/ --results results/CSRT --results results/KCF
  zerre otb otb/ --threads 1                              frame rates of an undisturbed processor

A sequence is a folder of pictures (in img/, in color/ or beside the annotation) with groundtruth_rect.txt (OTB: boxes
from pixel 1) or groundtruth.txt (VOT, GOT-10k: boxes or polygons from pixel 0).
Results of another tracker: a folder with its name that holds SEQUENCE.txt or SEQUENCE.csv for each sequence, one box a
line, counted as in the annotation; or such a file where there is one sequence.
Outputs in --out: scores.csv (a row per repetition), summary.csv (means with 95 % intervals), boxes-TRACKER-SEQUENCE.csv
of the first repetition, report.html with success and precision plots, run.json, progress.json for --resume.";

/// Score trackers on annotated sequences
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = OTB)]
pub struct Otb {
    /// Annotated sequences, or folders of them
    #[arg(required = true, value_name = "SEQUENCE_DIR")]
    pub sequences: Vec<PathBuf>,
    /// Tracker, a name of `zerre catalog trackers`; may be given more than once [default: the first of them]
    #[arg(long, value_name = "NAME")]
    pub tracker: Vec<String>,
    /// Runs with other random numbers
    #[arg(long, value_name = "N", default_value = "1")]
    #[arg(allow_negative_numbers = true, value_parser = at_least_one::<NonZeroU32>)]
    pub repeat: NonZeroU32,
    /// Where runs begin; may be given more than once [default: one-pass]
    #[arg(long, value_name = "NAME")]
    pub protocol: Vec<Protocol>,
    /// Boxes of another tracker, to score beside; may be given more than once
    #[arg(long, value_name = "DIR/NAME")]
    pub results: Vec<PathBuf>,
}

/// Protocols of `zerre otb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Protocol {
    /// From the first annotated frame to the end.
    OnePass,
    /// From 20 frames of each sequence to the end.
    Temporal,
    /// From the first annotated frame with 12 wrong boxes.
    Spatial,
}

const LABEL: &str = "\
Examples:
  zerre label frames/                                 one point, called hand
  zerre label clip.mp4 --every 5 --point hand --point elbow
  zerre label frames/ --port 8123 --out labels        the same address each time

The page is served to browsers of this machine only, on an address that nobody can guess; operators at other machines come
through a tunnel (ssh -L 8123:127.0.0.1:8123). Each gives a name, sees the own marks only, and may stop and go on. Every
mark is on the disk before the page shows it as saved; the same command goes on where it stopped, however it stopped.
Ctrl-C closes the job: labels.csv (frame,operator,point,x,y,visible; pixel (x, y) covers [x, x+1) by [y, y+1)),
reference.csv (frame,point,x,y,se,operators: geometric median and its standard error), agreement.csv (bias, spread, distance
from the others, ICC), again.csv (frames to look at again), report.html, run.json. The marks themselves stay in
labels.sqlite, which no option deletes; of a video, its pictures lie in frames/ beside it.";

/// Open the page on which people mark reference points in frames
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = LABEL)]
pub struct Label {
    /// Folder of pictures or video file
    pub input: PathBuf,
    /// Port of the page [default: the one of last time, else any that is free]
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u16).range(1..))]
    pub port: Option<u16>,
    /// Name of a point to mark in each frame; may be given more than once [default: hand]
    #[arg(long, value_name = "NAME")]
    pub point: Vec<String>,
    /// Mark every N-th frame only, from the first one on
    #[arg(long, value_name = "N", default_value = "1")]
    #[arg(allow_negative_numbers = true, value_parser = at_least_one::<NonZeroUsize>)]
    pub every: NonZeroUsize,
}

const BENCH: &str = "\
Examples:
  zerre bench
  zerre bench --quick
  zerre bench deadline                  how many steps of a millisecond keep their time
  zerre bench --threads 1 --json > bench.json

Times are nanoseconds per particle and step; a quiet machine gives steady ones.";

const CATALOG: &str = "\
Examples:
  zerre catalog
  zerre catalog formats
  zerre catalog --json";

const SCHEMA: &str = "\
Example:
  zerre schema track > track.schema.json";

const INIT: &str = "\
Examples:
  zerre init track > track.toml         print it
  zerre init track --out .              write ./track.toml, unless it is there (--force replaces it)";

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_sound() {
        Args::command().debug_assert();
    }

    #[test]
    fn options_of_every_command_stand_before_or_after_it() {
        for line in [
            ["zerre", "--seed", "7", "--out", "d", "track", "a.csv", "-"].as_slice(),
            &["zerre", "track", "a.csv", "-", "--seed", "7", "--out", "d"],
        ] {
            let args = Args::try_parse_from(line).unwrap();
            assert_eq!((args.global.seed, args.global.out), (7, Some("d".into())));
            let Command::Track(track) = args.command else { panic!("not track") };
            assert_eq!(track.inputs, [PathBuf::from("a.csv"), PathBuf::from("-")]);
        }
    }

    #[test]
    fn every_documented_form_is_taken() {
        for line in [
            "track a --config f --format ais --truth t --single --strict --filter particle --motion singer",
            "simulate s --runs 5",
            "compare a b --metric rmse gospa --metric nees",
            "compare a b --cutoff-m 20 --max-gap-s 5",
            "reproduce",
            "reproduce multiple-model --table 6.1 --table 6.13 --runs 5 --particles 50,60 --quick --resume",
            "bench --json --threads 2 --simd avx512",
            "bench W1 deadline --quick",
            "catalog filters --json --quiet",
            "study f.toml --runs 5 --resume",
            "video f.mp4 --box 1,2,3.5,4 --tracker still --truth t --overlay o.gif --strict",
            "video f --box -3,2,8,8",
            "balls f --count 3 --preset thesis --reading c --motion random-walk --resampling residual --strict",
            "balls f --ground g.png --threshold 60 --min-area 9 --max-area 99 --truth t --overlay o.gif",
            "otb a b --tracker still --tracker still --repeat 3 --results r/A --results r/B --protocol temporal",
            "label clip.mp4 --port 8123 --point hand --point elbow --every 5 --resume",
            "schema scenario",
            "init --log debug",
        ] {
            let words = std::iter::once("zerre").chain(line.split(' '));
            assert!(Args::try_parse_from(words).is_ok(), "{line}");
        }
        for line in [
            "track",
            "compare a",
            "simulate s --runs 0",
            "bench --threads 0",
            "track a --format gpx",
            "reproduce --quick",
            "reproduce multiple-model --runs 0",
            "study",
            "study f --runs 0",
            "video",
            "video f --box 1,2,3",
            "video f --box 1,2,3,x",
            "balls",
            "balls f --count 0",
            "balls f --resampling none",
            "otb",
            "otb a --repeat 0",
            "otb a --protocol all",
            "label",
            "label a --port 0",
            "label a --port 70000",
            "label a --every 0",
        ] {
            let words = std::iter::once("zerre").chain(line.split(' '));
            assert!(Args::try_parse_from(words).is_err(), "{line}");
        }
    }
}
