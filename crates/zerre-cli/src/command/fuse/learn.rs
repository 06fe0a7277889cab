//! What sources are like, learnt on a recording on which people have marked the points.

use super::ears::{Ears, Heard};
use super::marks::{Mark, Marks};
use super::open::{FuseConfig, Learnt, Opened};
use super::refused;
use crate::args::Fuse;
use crate::config::{filled, starter};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Progress, interrupted};
use serde::Serialize;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;
use zerre_lab::otb::luck;
use zerre_lab::report::study::{Grid, Shown};
use zerre_vision::rgbd::background::Background;
use zerre_vision::rgbd::calibrate::{Marked, calibrate};
use zerre_vision::rgbd::fusion::Source;
use zerre_vision::rgbd::recording::{Recording, RecordingOptions};
use zerre_vision::rgbd::tracker::TrackerSettings;
use zerre_vision::rgbd::{Intrinsics, Reading, RgbdFrame};
use zerre_vision::{Error, Result as VisionResult};

/// How often the recording is gone through, each time with what is known by then.
const ROUNDS: usize = 3;
/// Marks below which nothing can be learnt, and below which little can.
const FEW: [usize; 2] = [10, 30];
/// The stream of random numbers of learning; that of following is another one.
const STREAM: u64 = 1;

/// What was learnt of a source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Known {
    pub source: String,
    /// Pixels.
    pub sd: f64,
    pub outlier: f64,
    pub offset: [f64; 2],
    /// Millimetres, where the marks have depth.
    pub depth_sd: Option<f64>,
    pub depth_offset: Option<f64>,
    /// Marked frames in which it was asked.
    pub frames: usize,
}

/// What was learnt.
pub(super) struct Lesson {
    pub known: Vec<Known>,
    /// The covariances' least standard deviation, pixels.
    pub floor: f64,
    /// Frames with marks, by their place in the recording.
    pub frames: BTreeSet<usize>,
    /// A configuration file.
    pub toml: String,
    /// Few marks, perhaps.
    pub notes: Vec<String>,
}

/// A frame without its pictures.
struct Moment {
    index: usize,
    size: (usize, usize),
    heard: Heard,
    marks: BTreeMap<String, Mark>,
}

/// Learns from the marks; `config` has what was learnt behind it.
pub(super) fn learn(
    (args, options, seed): (&Fuse, &RecordingOptions, u64),
    (room, lens): (&Background, Intrinsics),
    (opened, marks): (&Opened, &Marks),
    config: &mut FuseConfig,
    console: &Console,
) -> Result<Lesson, Diagnostic> {
    let moments = moments(args, options, opened, marks)?;
    let clips: Vec<(&str, &[Moment])> = (opened.names.iter())
        .filter_map(|joint| Some((joint.as_str(), clip(joint, &moments, args)?)))
        .collect();
    let marked = |(joint, clip): &(&str, &[Moment])| {
        // The first frame starts the tracker, and is compared with nothing.
        clip[1..].iter().filter(|moment| moment.marks.contains_key(*joint)).count()
    };
    let count: usize = clips.iter().map(marked).sum();
    if count < FEW[0] {
        let what = format!("{} marks {count} frames in which a point is followed", marks.path.display());
        return Err(Diagnostic::new(what).help(format!(
            "{} at least are needed to learn from, {} are better: `zerre label` lets people mark them",
            FEW[0], FEW[1]
        )));
    }
    let frames = clips.iter().map(|(_, clip)| clip.len()).sum::<usize>();
    let progress = RefCell::new(Progress::new(console, "frames learnt from", Some((ROUNDS * frames) as u64)));
    let replay = RefCell::new(Replay { path: &args.recording, options, open: None });
    let frame = |moment: &Moment| {
        progress.borrow_mut().advance(1);
        replay.borrow_mut().frame(moment.index)
    };
    let closures: Vec<_> = clips
        .iter()
        .map(|&(joint, clip)| {
            (
                move |k: usize| frame(clip.get(k).ok_or_else(|| gone(k))?),
                move |k: usize| heard(clip, k, joint).to_vec(),
                move |k: usize| clip.get(k)?.marks.get(joint).map(|mark| (mark.at, mark.mm)),
            )
        })
        .collect();
    let told: Vec<Marked<'_>> = (clips.iter().zip(&closures))
        .filter_map(|(&(joint, clip), (frame, others, truth))| {
            Some(Marked {
                room: (room.colour().clone(), room.depth().clone()),
                lens,
                first: first(clip.first()?, joint, args, &config.tracker.sources)?,
                frames: clip.len(),
                frame,
                others,
                truth,
            })
        })
        .collect();
    let settings = calibrate(&config.tracker, &told, ROUNDS, luck(seed, STREAM)).map_err(refused)?;
    config.tracker = rounded(settings);

    let deep = moments.iter().any(|moment| moment.marks.values().any(|mark| mark.mm.is_some()));
    let others = config.tracker.sources.len();
    let asked = |number: usize| -> usize {
        let of = |(joint, clip): &(&str, &[Moment])| {
            let spoke = |k: &usize| {
                number >= others || heard(clip, *k, joint).iter().any(|(source, _)| *source == number)
            };
            (1..clip.len()).filter(|k| clip[*k].marks.contains_key(*joint)).filter(spoke).count()
        };
        clips.iter().map(of).sum()
    };
    let known = |(number, source): (usize, &Source)| Known {
        source: source.name.clone(),
        sd: source.sd,
        outlier: source.outlier,
        offset: source.offset,
        depth_sd: deep.then_some(source.depth_sd),
        depth_offset: deep.then_some(source.depth_offset),
        frames: asked(number),
    };
    let known = config.tracker.all_sources().enumerate().map(known).collect();
    config.learnt = Some(Learnt {
        recording: args.recording.display().to_string(),
        marks_sha256: super::super::input(&marks.path)?.sha256,
        frames: count,
    });
    let few = (count < FEW[1])
        .then(|| format!("{count} marked frames are few to learn from: {} are better", FEW[1]));
    let mut lesson = Lesson {
        known,
        floor: config.tracker.reference_sd,
        frames: moments.iter().filter(|moment| !moment.marks.is_empty()).map(|moment| moment.index).collect(),
        toml: String::new(),
        notes: few.into_iter().collect(),
    };
    lesson.toml = lesson.configuration(config)?;
    Ok(lesson)
}

/// Every frame that can be read, with what is said and known of it.
fn moments(
    args: &Fuse,
    options: &RecordingOptions,
    opened: &Opened,
    marks: &Marks,
) -> Result<Vec<Moment>, Diagnostic> {
    let mut ears = Ears::new(opened.joints.rows.clone(), &opened.config.tracker.sources);
    let mut moments = Vec::new();
    for frame in Recording::open(&args.recording, options).map_err(refused)?.flatten() {
        if interrupted() {
            return Err(refused(stopped()));
        }
        let of_joint = |(joint, of): (&String, &super::marks::Marked)| Some((joint.clone(), of.of(&frame)?));
        let marks = marks.joints.iter().filter_map(of_joint).collect();
        moments.push(Moment {
            index: frame.index,
            size: frame.colour.size(),
            heard: ears.hear(&frame),
            marks,
        });
    }
    Ok(moments)
}

/// From the first frame in which somebody says where the point is to the last one with a mark.
fn clip<'a>(joint: &str, moments: &'a [Moment], args: &Fuse) -> Option<&'a [Moment]> {
    let begin = moments.iter().position(|moment| first(moment, joint, args, &[]).is_some())?;
    let end = moments.iter().rposition(|moment| moment.marks.contains_key(joint))?;
    (begin < end).then(|| &moments[begin..=end])
}

fn first(moment: &Moment, joint: &str, args: &Fuse, sources: &[Source]) -> Option<Reading> {
    let by_hand = args.start.map(|at| Reading { at, depth_mm: None, confidence: 1.0 });
    by_hand.or_else(|| super::first(&moment.heard, joint, moment.size, sources))
}

fn heard<'a>(clip: &'a [Moment], k: usize, joint: &str) -> &'a [(usize, Vec<Reading>)] {
    clip.get(k).and_then(|moment| moment.heard.get(joint)).map_or(&[], Vec::as_slice)
}

fn gone(k: usize) -> Error {
    Error::Input { input: format!("frame {k}"), problem: "it was there before and is gone".to_owned() }
}

fn stopped() -> Error {
    Error::Input { input: "learning".to_owned(), problem: "stopped: nothing was written".to_owned() }
}

/// Frames of a recording in their order, again and again.
struct Replay<'a> {
    path: &'a Path,
    options: &'a RecordingOptions,
    /// The recording, and its next frame.
    open: Option<(Recording, usize)>,
}

impl Replay<'_> {
    fn frame(&mut self, index: usize) -> VisionResult<RgbdFrame> {
        if interrupted() {
            return Err(stopped());
        }
        let (mut recording, mut next) = match self.open.take().filter(|(_, next)| *next <= index) {
            Some(open) => open,
            None => (Recording::open(self.path, self.options)?, 0),
        };
        while let Some(frame) = recording.next() {
            next += 1;
            if next == index + 1 {
                self.open = Some((recording, next));
                return frame;
            }
        }
        Err(gone(index))
    }
}

/// Four digits: more are not known, and a file that people read has them all.
fn rounded(mut settings: TrackerSettings) -> TrackerSettings {
    let short = |value: &mut f64| *value = format!("{value:.3e}").parse().unwrap_or(*value);
    for source in settings.sources.iter_mut().chain(&mut settings.colour).chain(&mut settings.depth) {
        let [x, y] = &mut source.offset;
        [&mut source.sd, &mut source.depth_sd, &mut source.outlier, &mut source.depth_offset, x, y]
            .into_iter()
            .for_each(short);
    }
    short(&mut settings.reference_sd);
    settings
}

/// Names of the columns of [`Lesson::rows`].
const HEAD: [&str; 8] =
    ["source", "sd, px", "outlier", "offset x, px", "offset y, px", "sd, mm", "offset, mm", "frames"];

impl Lesson {
    fn rows(&self) -> Vec<[String; 8]> {
        let number = |value: f64| zerre_lab::number(value);
        let known = |known: &Known| {
            let deep = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), number);
            [
                known.source.clone(),
                number(known.sd),
                number(known.outlier),
                number(known.offset[0]),
                number(known.offset[1]),
                deep(known.depth_sd),
                deep(known.depth_offset),
                known.frames.to_string(),
            ]
        };
        self.known.iter().map(known).collect()
    }

    /// For a page.
    pub(super) fn grid(&self) -> Grid {
        let row = |row: [String; 8]| row.iter().map(|cell| Shown::from(cell.as_str())).collect();
        Grid {
            caption: format!(
                "The least standard deviation of a place is {} px.",
                zerre_lab::number(self.floor)
            ),
            head: HEAD.map(str::to_owned).to_vec(),
            rows: self.rows().into_iter().map(row).collect(),
        }
    }

    /// For a terminal, line by line.
    pub(super) fn table(&self) -> Vec<String> {
        let rows: Vec<[String; 8]> = [HEAD.map(str::to_owned)].into_iter().chain(self.rows()).collect();
        let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
        let line = |row: &[String; 8]| {
            let mut line = format!("{:<1$}", row[0], width(0));
            for (k, cell) in row.iter().enumerate().skip(1) {
                // Writing to a string cannot fail.
                let _ = write!(line, "  {cell:>0$}", width(k));
            }
            line
        };
        rows.iter().map(line).collect()
    }

    /// The starter with what was learnt in the place of the usual values.
    fn configuration(&self, config: &FuseConfig) -> Result<String, Diagnostic> {
        let learnt = config.learnt.as_ref();
        let mut text = format!(
            "# Settings of `zerre fuse`, learnt from {} marked frames of {:?}:\n#\n",
            learnt.map_or(0, |learnt| learnt.frames),
            learnt.map_or("", |learnt| learnt.recording.as_str()),
        );
        self.table().iter().for_each(|line| text += &format!("#   {line}\n"));
        text += "#\n# Scores on the same frames are better than on others: keep a recording to test on.\n\n";
        let values = serde_json::to_value(config).map_err(refused)?;
        let starter = starter("fuse").unwrap_or_default();
        let body = starter.split_once("\n\n").map_or(starter, |(_, body)| body);
        text += &filled(body, &values);
        text += "\n# What was learnt from.\n[learnt]\n";
        if let Some(fields) = values.get("learnt").and_then(serde_json::Value::as_object) {
            fields.iter().for_each(|(key, value)| text += &format!("{key} = {value}\n"));
        }
        Ok(text)
    }
}
