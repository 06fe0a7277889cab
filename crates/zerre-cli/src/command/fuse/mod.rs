//! `zerre fuse`: points of a body through a recording of colour and depth, or before a camera.

mod ears;
mod feed;
mod learn;
mod marks;
mod open;
mod outcome;
mod room;
mod tables;

pub(crate) use open::FuseConfig;

use super::video::overlay::{self, Overlay};
use super::video::write_film;
use crate::Exit;
use crate::args::{Fuse, FusePreset, Global, RoomFrom};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, Folder, Progress, Record, State, interrupted, listen};
use ears::{Ears, Heard};
use feed::{Feed, Given};
use open::open;
use outcome::{Outcome, Scores};
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;
use zerre_lab::fusion::{Clock, Follow, PointScene, Preset, Row, Rules, ShownPoint, Stopwatch};
use zerre_lab::otb::luck;
use zerre_lab::report::overlay::Film;
use zerre_vision::frames::folder::png;
use zerre_vision::rgbd::background::Background;
use zerre_vision::rgbd::fusion::Source;
use zerre_vision::rgbd::recording::{Recording, RecordingOptions};
use zerre_vision::rgbd::thesis::{Picture, Show};
use zerre_vision::rgbd::{Intrinsics, Reading, RgbdFrame};

const COMMAND: &str = "fuse";
/// Particles of a point that are drawn.
const DRAWN: usize = 200;
/// Complaints of one kind that are told; the rest is counted.
const TOLD: usize = 10;
/// Focal length of a camera that nobody describes, in widths of its picture: that of common depth cameras.
const FOCAL: f64 = 0.82;

fn refused(error: impl std::fmt::Display) -> Diagnostic {
    Diagnostic::new(error.to_string())
}

pub(super) fn run(args: &Fuse, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    if let Some(path) = &args.overlay {
        overlay::check(path, options.force)?;
    }
    let opened = open(args)?;
    opened.config.checked(args.preset)?;
    let reading = RecordingOptions { camera: args.camera.clone(), ..RecordingOptions::default() };
    let mut recording = Recording::open(&args.recording, &reading).map_err(refused)?;
    listen()?;
    let (camera, expected) = (recording.camera(), recording.expected());
    let live = recording.is_live();
    let (mut room, from, mut feed) = if live {
        let mut feed = Feed::of(recording);
        let (room, from) = room::of_camera(args, &mut feed)?;
        (room, from, feed)
    } else {
        let (room, from) = room::of_recording(args, &reading, &mut recording)?;
        (room, from, Feed::of(recording))
    };
    let lens = camera.map_or_else(|| usual_lens(room.colour().size()), |camera| camera.colour);
    let (mut config, mut notes) = (opened.config.clone(), Vec::new());
    if args.preset == FusePreset::Sound && !room::has_depth(&room) && config.tracker.depth.take().is_some() {
        notes.push("no depth was measured in the empty room: colours alone are used".to_owned());
    }
    if args.preset == FusePreset::Sound && config.tracker.all_sources().next().is_none() {
        return Err(Diagnostic::new("no source is left that could say where the point is")
            .help("leave out fewer of them: --without, and `without` in the configuration"));
    }
    let mut rules = Rules {
        preset: if args.preset == FusePreset::Sound { Preset::Sound } else { Preset::Thesis },
        tracker: config.tracker.clone(),
        thesis: config.thesis.clone(),
        clock: if live { Clock::Wall } else { Clock::Processor },
    };
    let stream = luck(options.seed, 0);
    let destination = Destination::of(options, COMMAND, Some(&args.recording))
        .reading(opened.read.iter().map(PathBuf::as_path).chain([args.recording.as_path()]));
    let mut folder = Folder::open(&destination, COMMAND)?;
    let lesson = match &opened.lesson {
        Some(marks) => {
            let of = (args, &reading, options.seed);
            let lesson = learn::learn(of, (&room, lens), (&opened, marks), &mut config, console)?;
            lesson.table().iter().for_each(|line| console.info(line));
            folder.write("fuse.toml", |file| file.write_all(lesson.toml.as_bytes()))?;
            notes.extend(lesson.notes.iter().cloned());
            Some(lesson)
        }
        None => None,
    };
    rules.tracker = config.tracker.clone();
    let mut follow = Follow::new(rules, lens, stream);
    let path = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    let shown = json!({
        "recording": args.recording.display().to_string(), "preset": args.preset, "room": from,
        "joints": opened.names, "lens": lens, "settings": config, "truth": path(&args.truth),
        "calibrate": path(&args.calibrate),
    });
    let mut record = Record::new(COMMAND, options.seed, shown);
    if options.explain {
        let text = serde_json::to_string_pretty(&record.config).map_err(refused)?;
        console.info(format_args!(
            "{text}\nsd, outlier, offset: what is learnt of a source from marked clips, or its usual values\n\
             room: pictures of the empty room where there are such, else the median of frames"
        ));
    }
    record.input = opened.read.iter().map(|path| super::input(path)).collect::<Result<_, _>>()?;
    // A file is digested; folders are known by their names.
    if args.recording.is_file() {
        record.input.insert(0, super::input(&args.recording)?);
    }
    let mut scores = Scores::of(&opened, &config, lesson.as_ref(), &record.input);
    let mut ears = Ears::new(opened.joints.rows.clone(), &config.tracker.sources);
    let mut film = Film::default();
    let mut overlay = args.overlay.as_ref().map(|path| Overlay::new(path, None, expected));
    let (mut failed, mut count, mut left_out) = (None, 0_u64, 0_u64);
    let mut progress = Progress::new(console, "frames", expected.map(|count| count as u64)).with_rate();
    while let Some(Given { frame, ms, came }) = feed.next() {
        if interrupted() {
            break;
        }
        progress.advance(1);
        count += 1;
        follow.note(if live { "waiting here" } else { "reading" }, ms);
        let mut shown: [Vec<(&'static str, Picture)>; 2] = Default::default();
        let taken = frame.and_then(|frame| {
            let heard = ears.hear(&frame);
            if from == RoomFrom::Running {
                let learning = Stopwatch::start(follow.clock());
                room.update(&frame, None)?;
                follow.note("room", learning.ms());
            }
            let [colour, depth] = &mut shown;
            let wanted = args.steps.contains(&(frame.index + 1));
            let mut keep_colour = |name, picture| colour.push((name, picture));
            let mut keep_depth = |name, picture| depth.push((name, picture));
            let show: [Option<Show<'_>>; 2] =
                if wanted { [Some(&mut keep_colour), Some(&mut keep_depth)] } else { [None, None] };
            follow.step(&frame, &room, &heard, show)?;
            begin((args, &opened.names), &mut follow, (&frame, &room, &heard), &config.tracker.sources)?;
            Ok(frame)
        });
        if let Some(came) = came {
            follow.note("from arrival to estimate", 1000.0 * came.elapsed().as_secs_f64());
        }
        let frame = match taken {
            Ok(frame) => frame,
            Err(error) => {
                left_out += 1;
                if left_out <= TOLD as u64 {
                    notes.push(format!("frame {count}: left out: {error}"));
                }
                continue;
            }
        };
        for (kind, pictures) in ["colour", "depth"].into_iter().zip(&shown) {
            for (step, picture) in pictures {
                let bytes = png(&picture.frame()).map_err(refused)?;
                let name = format!("step-{:04}-{kind}-{step}.png", frame.index + 1);
                folder.write(&name, |file| file.write_all(&bytes))?;
            }
        }
        let rows = follow.last();
        let current = rows.first().is_some_and(|row| row.frame == frame.index);
        let rows = if current { rows } else { &[] };
        let truth = scores.see(&frame, rows);
        let points = shown_points(rows, &follow);
        let scene = PointScene { frame: &frame.colour, name: &frame.name, points: &points, truth: &truth };
        let drawn = film.see(&scene).map_err(refused);
        let drawn = drawn.and_then(|()| overlay.as_mut().map_or(Ok(()), |overlay| overlay.push(&scene)));
        if let Err(error) = drawn {
            // The picture is lost, the points go on.
            overlay = None;
            failed.get_or_insert(error);
        }
    }
    drop(progress);
    if interrupted() && !live {
        record.state = State::Interrupted;
    }
    if let Some(overlay) = overlay {
        notes.extend(overlay.finish()?);
    }
    let film = write_film(&film, &mut folder)?;
    let outcome =
        Outcome { args, options, opened, follow, scores, lesson, feed, from, film, count, left_out };
    record.seconds = since.elapsed().as_secs_f64();
    let exit = outcome.write((folder, record), (notes, ears.fate()), console)?;
    failed.map_or(Ok(exit), Err)
}

/// Begins to follow the points that somebody has shown and that are not followed yet.
fn begin(
    (args, names): (&Fuse, &[String]),
    follow: &mut Follow,
    (frame, room, heard): (&RgbdFrame, &Background, &Heard),
    sources: &[Source],
) -> zerre_vision::Result<()> {
    for joint in names {
        if follow.has(joint) {
            continue;
        }
        let by_hand = args.start.map(|at| Reading { at, depth_mm: None, confidence: 1.0 });
        if let Some(first) = by_hand.or_else(|| first(heard, joint, frame.colour.size(), sources)) {
            follow.start(joint, frame, room, first)?;
        }
    }
    Ok(())
}

/// Where somebody sees a joint on a frame of this size, to begin with: what the source is known to be off is
/// taken off.
fn first(heard: &Heard, joint: &str, (width, height): (usize, usize), sources: &[Source]) -> Option<Reading> {
    let inside = |reading: &Reading| {
        let [x, y] = reading.at;
        let on = (0.0..=width as f64).contains(&x) && (0.0..=height as f64).contains(&y);
        on && reading.confidence > 0.0
    };
    let right = |(number, reading): (&usize, &Reading)| {
        let (offset, deeper) = sources.get(*number).map_or(([0.0; 2], 0.0), |s| (s.offset, s.depth_offset));
        let at = [0, 1].map(|k| reading.at[k] - offset[k]);
        Reading { at, depth_mm: reading.depth_mm.map(|z| z - deeper), ..*reading }
    };
    let all = heard.get(joint)?.iter().flat_map(|(number, said)| said.iter().map(move |r| (number, r)));
    all.map(right).find(inside)
}

fn usual_lens((width, height): (usize, usize)) -> Intrinsics {
    let focal = FOCAL * width as f64;
    Intrinsics { focal: [focal; 2], principal: [width as f64 / 2.0 - 0.5, height as f64 / 2.0 - 0.5] }
}

fn shown_points(rows: &[Row], follow: &Follow) -> Vec<ShownPoint> {
    let point = |(row, particles): (&Row, Vec<([f64; 2], f64)>)| {
        let every = particles.len().div_ceil(DRAWN).max(1);
        ShownPoint {
            at: row.at,
            covariance: row.covariance,
            lost: row.p_lost.is_some_and(|p| p > 0.5),
            particles: particles.into_iter().step_by(every).map(|(place, _)| place).collect(),
        }
    };
    rows.iter().zip(follow.particles()).map(point).collect()
}
