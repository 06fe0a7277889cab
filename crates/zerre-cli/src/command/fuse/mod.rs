//! `zerre fuse`: points of a body through a recording of colour and depth.

mod tables;

use super::video::overlay::{self, Overlay};
use super::video::write_film;
use crate::Exit;
use crate::args::{Fuse, FusePreset, Global, RoomFrom};
use crate::config::Source as ConfigSource;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, EstimatesDigest, Folder, Progress, Record, State, interrupted, listen};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tables::{JointRow, When};
use zerre_lab::fusion::{Follow, PointScene, Preset, Row, Rules, ShownPoint, Watched, page, points_csv};
use zerre_lab::otb::luck;
use zerre_lab::report::overlay::Film;
use zerre_lab::report::study::render;
use zerre_vision::frames::folder::png;
use zerre_vision::rgbd::background::{Background, MedianRoom, RunningSettings};
use zerre_vision::rgbd::fusion::Source;
use zerre_vision::rgbd::recording::{Recording, RecordingOptions};
use zerre_vision::rgbd::thesis::{Picture, ThesisSettings};
use zerre_vision::rgbd::tracker::TrackerSettings;
use zerre_vision::rgbd::{Intrinsics, Reading, RgbdFrame};

const COMMAND: &str = "fuse";
/// Frames that the median of a room is taken of.
const MEDIAN_OF: usize = 31;
/// Particles of a point that are drawn.
const DRAWN: usize = 200;
/// Name of a point that is shown by hand.
const POINT: &str = "point";
/// Focal length of a camera that nobody describes, in widths of its picture: that of common depth cameras.
const FOCAL: f64 = 0.82;

/// What a configuration file may set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct FuseConfig {
    /// The sound filter.
    pub tracker: TrackerSettings,
    /// The thesis's.
    pub thesis: ThesisSettings,
}

fn refused(error: impl std::fmt::Display) -> Diagnostic {
    Diagnostic::new(error.to_string())
}

/// What is read before the first frame.
struct Opened {
    config: FuseConfig,
    joints: Vec<JointRow>,
    names: Vec<String>,
    rejected: Vec<String>,
    truth: BTreeMap<String, [f64; 2]>,
    read: Vec<PathBuf>,
}

fn open(args: &Fuse) -> Result<Opened, Diagnostic> {
    let mut read = Vec::new();
    let mut config = FuseConfig::default();
    if let Some(path) = &args.config {
        config = ConfigSource::read(path)?.parse()?;
        read.push(path.clone());
    }
    if let Some(particles) = args.particles {
        config.tracker.fusion.particles = particles.get() as usize;
        config.thesis.particles = particles.get() as usize;
    }
    let beside = args.recording.join("joints.csv");
    let file = args.joints.clone().or_else(|| beside.is_file().then_some(beside));
    let (mut joints, mut rejected) = (Vec::new(), Vec::new());
    if let Some(path) = &file {
        let table = tables::joints(path)?;
        (joints, rejected) = (table.rows, table.rejected);
        read.push(path.clone());
    }
    let mut names: Vec<String> = joints.iter().map(|row| row.joint.clone()).collect();
    names.sort();
    names.dedup();
    if !args.joint.is_empty() {
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        if let Some(missing) = args.joint.iter().find(|name| !known.contains(&name.as_str())) {
            return Err(super::unknown("joint", missing, &known));
        }
        names.retain(|name| args.joint.contains(name));
        names.sort_by_key(|name| args.joint.iter().position(|asked| asked == name));
    }
    if args.start.is_some() {
        names = vec![args.joint.first().cloned().unwrap_or_else(|| POINT.to_owned())];
    }
    if names.is_empty() {
        let what = "nothing says where the point is";
        return Err(Diagnostic::new(what)
            .help("give a table of joints with --joints, or its first place with --start x,y"));
    }
    joints.retain(|row| names.contains(&row.joint));
    let has =
        |config: &FuseConfig, name: &str| config.tracker.sources.iter().any(|source| source.name == name);
    let usual = TrackerSettings::default().sources.into_iter().next();
    for row in &joints {
        if !has(&config, &row.source)
            && let Some(usual) = &usual
        {
            config.tracker.sources.push(Source { name: row.source.clone(), ..usual.clone() });
        }
    }
    if args.preset == FusePreset::Thesis && !args.without.is_empty() {
        return Err(Diagnostic::usage("the thesis's filter has all its sources").help("leave --without out"));
    }
    for name in &args.without {
        let tracker = &mut config.tracker;
        let known: Vec<String> = tracker.all_sources().map(|source| source.name.clone()).collect();
        let known: Vec<&str> = known.iter().map(String::as_str).collect();
        if !known.contains(&name.as_str()) {
            return Err(super::unknown("source", name, &known));
        }
        tracker.sources.retain(|source| source.name != *name);
        for cue in [&mut tracker.colour, &mut tracker.depth] {
            cue.take_if(|source| source.name == *name);
        }
    }
    let truth = match &args.truth {
        Some(path) => {
            read.push(path.clone());
            tables::truth(path, &names[0])?
        }
        None => BTreeMap::new(),
    };
    Ok(Opened { config, joints, names, rejected, truth, read })
}

/// The room before the first frame.
fn room(
    args: &Fuse,
    options: &RecordingOptions,
    recording: &mut Recording,
) -> Result<(Background, RoomFrom), Diagnostic> {
    let pictures = recording.room().transpose().map_err(refused)?;
    let from = args.room.unwrap_or(if pictures.is_some() { RoomFrom::Pictures } else { RoomFrom::Median });
    let room = match (from, pictures) {
        (RoomFrom::Pictures, Some((colour, depth))) => Background::still(colour, depth),
        (RoomFrom::Pictures, None) => {
            let what = format!("{} has no pictures of the empty room", args.recording.display());
            let help = "save them as background_rgb.png and background_depth.png, or use --room median";
            return Err(Diagnostic::new(what).help(help));
        }
        (RoomFrom::Median, _) => {
            let mut median = MedianRoom::new(MEDIAN_OF);
            for frame in Recording::open(&args.recording, options).map_err(refused)?.flatten() {
                median.add(&frame).map_err(refused)?;
            }
            median.finish()
        }
        (RoomFrom::Running, _) => {
            let again = Recording::open(&args.recording, options).map_err(refused)?;
            let Some(first) = again.flatten().next() else {
                return Err(Diagnostic::new(format!("{}: no frame can be read", args.recording.display())));
            };
            Background::running(first.colour, first.depth, RunningSettings::default())
        }
    };
    Ok((room.map_err(refused)?, from))
}

/// What is said of each joint by a frame; rows are used up in the order of their times.
struct Ears {
    rows: Vec<JointRow>,
    next: usize,
    sources: Vec<String>,
}

/// Times that differ by less are the same.
const SLACK: i64 = 1_000_000;

impl Ears {
    fn new(mut rows: Vec<JointRow>, sources: &[Source]) -> Ears {
        // Rows that name frames are looked up, those with times are used in their order.
        rows.sort_by_key(|row| match &row.when {
            When::Time(time) => time.nanos(),
            When::Frame(_) => 0,
        });
        Ears { rows, next: 0, sources: sources.iter().map(|source| source.name.clone()).collect() }
    }

    /// The number of a source; `None` of one that is left out.
    fn number(&self, name: &str) -> Option<usize> {
        self.sources.iter().position(|source| source == name)
    }

    /// The last reading of every joint and source since the frame before.
    fn hear(&mut self, frame: &RgbdFrame) -> BTreeMap<String, Vec<(usize, Vec<Reading>)>> {
        let mut last: BTreeMap<(String, usize), Reading> = BTreeMap::new();
        while let Some(row) = self.rows.get(self.next) {
            let When::Time(time) = &row.when else { break };
            if time.nanos() > frame.time.nanos().saturating_add(SLACK) {
                break;
            }
            if let Some(source) = self.number(&row.source) {
                last.insert((row.joint.clone(), source), row.reading);
            }
            self.next += 1;
        }
        let number = frame.index.to_string();
        for row in &self.rows {
            if matches!(&row.when, When::Frame(name) if *name == frame.name || *name == number)
                && let Some(source) = self.number(&row.source)
            {
                last.insert((row.joint.clone(), source), row.reading);
            }
        }
        let mut heard: BTreeMap<String, Vec<(usize, Vec<Reading>)>> = BTreeMap::new();
        for ((joint, source), reading) in last {
            heard.entry(joint).or_default().push((source, vec![reading]));
        }
        heard
    }
}

pub(super) fn run(args: &Fuse, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    if let Some(path) = &args.overlay {
        overlay::check(path, options.force)?;
    }
    if !args.steps.is_empty() && args.preset == FusePreset::Sound {
        return Err(Diagnostic::usage("--steps shows the steps of the thesis").help("add --preset thesis"));
    }
    let opened = open(args)?;
    let reading = RecordingOptions { camera: args.camera.clone(), ..RecordingOptions::default() };
    let mut recording = Recording::open(&args.recording, &reading).map_err(refused)?;
    listen()?;
    let (mut empty, from) = room(args, &reading, &mut recording)?;
    let lens = recording.camera().map_or_else(|| usual_lens(empty.colour().size()), |camera| camera.colour);
    let rules = Rules {
        preset: if args.preset == FusePreset::Sound { Preset::Sound } else { Preset::Thesis },
        tracker: opened.config.tracker.clone(),
        thesis: opened.config.thesis.clone(),
    };
    let mut follow = Follow::new(rules, lens, luck(options.seed, 0));
    follow.checked().map_err(refused)?;
    let config = json!({
        "recording": args.recording.display().to_string(), "preset": args.preset, "room": from,
        "joints": opened.names, "lens": lens, "settings": opened.config,
        "truth": args.truth.as_ref().map(|path| path.display().to_string()),
    });
    let mut record = Record::new(COMMAND, options.seed, config);
    if options.explain {
        let text = serde_json::to_string_pretty(&record.config).map_err(refused)?;
        console.info(format_args!(
            "{text}\nsd, outlier, offset: what is learnt of a source from marked clips, or its usual values\n\
             room: pictures of the empty room where there are such, else the median of frames"
        ));
    }
    let destination = Destination::of(options, COMMAND, Some(&args.recording))
        .reading(opened.read.iter().map(PathBuf::as_path).chain([args.recording.as_path()]));
    let mut folder = Folder::open(&destination, COMMAND)?;
    record.input = opened.read.iter().map(|path| super::input(path)).collect::<Result<_, _>>()?;

    let expected = recording.expected();
    let mut ears = Ears::new(opened.joints, &opened.config.tracker.sources);
    let mut film = Film::default();
    let mut overlay = args.overlay.as_ref().map(|path| Overlay::new(path, None, expected));
    let (mut failed, mut notes, mut count, mut left_out) = (None, opened.rejected.clone(), 0_u64, 0_u64);
    let mut errors = Vec::new();
    let mut progress = Progress::new(console, "frames", expected.map(|count| count as u64)).with_rate();
    for frame in recording.by_ref() {
        if interrupted() {
            record.state = State::Interrupted;
            break;
        }
        progress.advance(1);
        count += 1;
        let mut shown: [Vec<(&'static str, Picture)>; 2] = Default::default();
        let taken = frame.and_then(|frame| {
            let heard = ears.hear(&frame);
            if from == RoomFrom::Running {
                empty.update(&frame, None)?;
            }
            let [colour, depth] = &mut shown;
            let wanted = args.steps.contains(&(frame.index + 1));
            let mut keep_colour = |name, picture| colour.push((name, picture));
            let mut keep_depth = |name, picture| depth.push((name, picture));
            let show: [Option<zerre_vision::rgbd::thesis::Show<'_>>; 2] =
                if wanted { [Some(&mut keep_colour), Some(&mut keep_depth)] } else { [None, None] };
            follow.step(&frame, &empty, &heard, show)?;
            for joint in &opened.names {
                if follow.has(joint) {
                    continue;
                }
                let said = heard.get(joint).and_then(|said| said.first()?.1.first().copied());
                let by_hand = args.start.map(|at| Reading { at, depth_mm: None, confidence: 1.0 });
                if let Some(first) = by_hand.or(said) {
                    follow.start(joint, &frame, &empty, first)?;
                }
            }
            Ok(frame)
        });
        let frame = match taken {
            Ok(frame) => frame,
            Err(error) => {
                left_out += 1;
                if left_out <= 10 {
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
        let here = truth_of(&opened.truth, &frame);
        let rows = follow.last();
        let current = rows.first().is_some_and(|row| row.frame == frame.index);
        if let (Some(truth), Some(row), true) = (here, rows.first(), current) {
            errors.push((frame.index, (row.at[0] - truth[0]).hypot(row.at[1] - truth[1])));
        }
        let points = if current { shown_points(rows, &follow) } else { Vec::new() };
        let truth: Vec<[f64; 2]> = here.into_iter().collect();
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
    if let Some(overlay) = overlay {
        notes.extend(overlay.finish()?);
    }
    let missing = opened.names.iter().filter(|name| !follow.has(name));
    notes.extend(missing.map(|name| format!("no frame says where {name} is: it was not followed")));
    notes.iter().for_each(|note| console.warn(note));

    let digest = digest(&follow);
    folder.write("points.csv", |file| file.write_all(points_csv(&follow).as_bytes()))?;
    let film = write_film(&film, &mut folder)?;
    let lost = follow.rows.iter().filter(|row| row.p_lost.is_some_and(|p| p > 0.5)).count();
    let rmse = (!errors.is_empty())
        .then(|| (errors.iter().map(|(_, e)| e * e).sum::<f64>() / errors.len() as f64).sqrt());
    let mut page = page(Watched {
        title: format!("Colour and depth: {}", args.recording.display()),
        facts: facts(args, options.seed, count, from, &opened.names),
        follow: &follow,
        errors,
        film,
        notes,
    });
    page.command = command_line(args, options);
    page.digest.clone_from(&digest);
    folder.write("report.html", |file| file.write_all(render(&page).as_bytes()))?;

    record.counts.read = count;
    record.counts.used = count - left_out;
    let outcomes = recording.outcomes();
    for (name, number) in
        [("frame that was left out", left_out as usize), ("row of joints", opened.rejected.len())]
    {
        if number > 0 {
            record.counts.rejected.insert(name.to_owned(), number as u64);
        }
    }
    if outcomes.depth_alone > 0 {
        record
            .counts
            .left_out
            .insert("depth picture without a frame".to_owned(), outcomes.depth_alone as u64);
    }
    for (name, action, number) in [
        ("frame without depth", "colour alone was used", outcomes.without_depth),
        ("depth picture that cannot be read", "colour alone was used", outcomes.unreadable_depth),
        ("point hidden", "it is flagged", lost),
    ] {
        if number > 0 {
            record.outcomes_of(name, action, number as u64);
        }
    }
    if record.state == State::Interrupted {
        console.warn(format_args!("stopped after {count} frames"));
    }
    record.estimates_digest = Some(digest.clone());
    record.seconds = since.elapsed().as_secs_f64();
    let path = folder.finish(&record)?;
    if console.json() {
        console.document(&json!({
            "joints": opened.names, "frames": count, "left_out": left_out, "lost_frames": lost, "rmse_px": rmse,
            "estimates_digest": digest, "state": record.state,
        }))?;
    }
    let score = rmse.map_or_else(String::new, |rmse| format!(", RMSE {} px", zerre_lab::number(rmse)));
    console.info(format_args!(
        "{count} frames, {} points, flagged as lost {lost} times{score} in {:.1} s: {}",
        opened.names.len(),
        record.seconds,
        path.join("report.html").display()
    ));
    if let Some(error) = failed {
        return Err(error);
    }
    let lost_at_last = follow.last().iter().any(|row| row.p_lost.is_some_and(|p| p > 0.5));
    Ok(if record.state == State::Interrupted || follow.rows.is_empty() {
        Exit::CouldNot
    } else if args.strict && lost_at_last {
        Exit::Degraded
    } else {
        Exit::Done
    })
}

fn usual_lens((width, height): (usize, usize)) -> Intrinsics {
    let focal = FOCAL * width as f64;
    Intrinsics { focal: [focal; 2], principal: [width as f64 / 2.0 - 0.5, height as f64 / 2.0 - 0.5] }
}

fn truth_of(truth: &BTreeMap<String, [f64; 2]>, frame: &RgbdFrame) -> Option<[f64; 2]> {
    truth.get(&frame.name).or_else(|| truth.get(&frame.index.to_string())).copied()
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

fn digest(follow: &Follow) -> String {
    let mut digest = EstimatesDigest::default();
    for row in &follow.rows {
        let [[xx, xy], [_, yy]] = row.covariance;
        digest.push(&[row.frame as f64, row.at[0], row.at[1], xx, xy, yy, row.p_lost.unwrap_or(0.0)]);
    }
    digest.finish()
}

fn facts(args: &Fuse, seed: u64, frames: u64, room: RoomFrom, joints: &[String]) -> Vec<(String, String)> {
    let room = match room {
        RoomFrom::Pictures => "its own pictures",
        RoomFrom::Median => "the median of frames",
        RoomFrom::Running => "learnt frame by frame",
    };
    let filter = match args.preset {
        FusePreset::Sound => "mixtures with outliers (sound)",
        FusePreset::Thesis => "as in the thesis",
    };
    [
        ("Recording", args.recording.display().to_string()),
        ("Filter", filter.to_owned()),
        ("Empty room", room.to_owned()),
        ("Points", joints.join(", ")),
        ("Frames", frames.to_string()),
        ("Seed", seed.to_string()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}

/// The command line that gives this run again.
fn command_line(args: &Fuse, options: &Global) -> String {
    let mut line = format!("zerre fuse {}", args.recording.display());
    let mut option = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            line += &format!(" --{name} {value}");
        }
    };
    let path = |path: &Option<PathBuf>| path.as_deref().map(Path::display).map(|path| path.to_string());
    option("config", path(&args.config));
    option("joints", path(&args.joints));
    args.joint.iter().for_each(|joint| option("joint", Some(joint.clone())));
    option("start", args.start.map(|[x, y]| format!("{x},{y}")));
    args.without.iter().for_each(|name| option("without", Some(name.clone())));
    option("preset", (args.preset == FusePreset::Thesis).then(|| "thesis".to_owned()));
    option("room", args.room.and_then(|room| json!(room).as_str().map(str::to_owned)));
    option("camera", path(&args.camera));
    option("particles", args.particles.map(|particles| particles.to_string()));
    option("truth", path(&args.truth));
    option("overlay", path(&args.overlay));
    let steps: Vec<String> = args.steps.iter().map(ToString::to_string).collect();
    option("steps", (!steps.is_empty()).then(|| steps.join(",")));
    option("seed", Some(options.seed.to_string()));
    line
}
