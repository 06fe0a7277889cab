//! `zerre simulate`: measurements and truth of a scenario.

mod recording;

use crate::Exit;
use crate::args::{Global, Simulate};
use crate::config::{Problem, Source};
use crate::console::Console;
use crate::diagnostic::{Diagnostic, suggest};
use crate::run::{Destination, Folder, Progress, Record, State, interrupted, listen};
use serde_json::json;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;
use std::time::Instant;
use zerre_lab::scenario::{self, Invalid, Measured, Measures, Run, SCENARIOS, Scenario, Target, TruePoint};
use zerre_vision::Frame;
use zerre_vision::balls::{SCENES, Scene, TrueBall};
use zerre_vision::clip::{CLIPS, Clip, Named};
use zerre_vision::frames::folder::png;
use zerre_vision::rgbd::scene as rgbd;

const COMMAND: &str = "simulate";

pub(super) fn run(args: &Simulate, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    if let Some(scene) = SCENES.iter().find(|scene| scene.name == args.scenario) {
        let drawn = Scene::new((scene.settings)(), options.seed);
        let paint = |k: usize| {
            let mut lines = String::new();
            for TrueBall { ball, centre: [x, y], radius, visible } in drawn.truth(k) {
                // Writing to a string cannot fail.
                let _ = writeln!(lines, "{k},{ball},{x:?},{y:?},{radius:?},{visible:?}");
            }
            (drawn.frame(k), lines, !drawn.truth(k).is_empty())
        };
        let head = "frame,ball,x,y,radius,visible\n";
        let pictures = Pictures { name: scene.name, frames: drawn.len(), truth: ("truth.csv", head), paint };
        return draw(pictures, args, options, console);
    }
    if let Some(clip) = CLIPS.iter().find(|clip| clip.name == args.scenario) {
        return draw_clip(clip, args, options, console);
    }
    if let Some(scene) = rgbd::SCENES.iter().find(|scene| scene.name == args.scenario) {
        return recording::draw(scene, args, options, console);
    }
    let since = Instant::now();
    let scenario = find(&args.scenario)?;
    let runs = args.runs.get();
    let config = json!({ "scenario": scenario, "runs": runs });
    if options.explain {
        console.info(&pretty(&config)?);
    }
    listen()?;
    let name = Path::new(&args.scenario);
    let destination = Destination::of(options, COMMAND, Some(name))
        .reading(scenario::find(&args.scenario).is_none().then_some(name));
    let mut folder = Folder::open(&destination, COMMAND)?;
    let mut record = Record::new(COMMAND, options.seed, config);
    let mut progress = Progress::new(console, "runs", Some(u64::from(runs)));
    let (mut made, mut points, mut measured) = (0_u32, 0, 0);
    if scenario.trackable() {
        folder.write("track.toml", |file| file.write_all(track_config(&scenario).as_bytes()))?;
    }
    while made < runs && !interrupted() {
        let drawn = scenario
            .draw(options.seed, made)
            .map_err(|error| Diagnostic::new(format!("run {}: {error}", made + 1)))?;
        made += 1;
        let name =
            |table: &str| if runs == 1 { format!("{table}.csv") } else { format!("{table}-{made:04}.csv") };
        folder.write(&name("truth"), |file| write_truth(file, &scenario, &drawn))?;
        folder.write(&name("measurements"), |file| write_measurements(file, &scenario, &drawn))?;
        points += drawn.truth.len();
        measured += drawn.measurements.len();
        progress.advance(1);
    }
    drop(progress);
    if made < runs {
        record.state = State::Interrupted;
        console.warn(format_args!("stopped after {made} of {runs} runs; these are complete"));
    }
    record.seconds = since.elapsed().as_secs_f64();
    let path = folder.finish(&record)?;
    if console.json() {
        console.document(&json!({
            "scenario": args.scenario, "state": record.state, "runs": made, "targets": scenario.target.len(),
            "true_points": points, "measurements": measured, "out": path.display().to_string(),
        }))?;
    }
    let s = if made == 1 { "" } else { "s" };
    console.info(format_args!(
        "{made} run{s}: {measured} measurements of {points} true states in {}",
        path.display()
    ));
    if !scenario.trackable() {
        console.info(
            "they are numbers on one axis, for filters of the library: `zerre track` has no sensor for them",
        );
    }
    Ok(if made < runs { Exit::CouldNot } else { Exit::Done })
}

/// Frames of a drawn clip.
const CLIP_FRAMES: usize = 200;
/// Share of the object that must be seen for its box to be told.
const SEEN: f64 = 0.5;

/// Pictures to draw, and what is known of them.
struct Pictures<P> {
    name: &'static str,
    frames: usize,
    /// File of the truth, and its head.
    truth: (&'static str, &'static str),
    /// The picture of a frame, its lines of the truth, and whether an object is to be seen.
    paint: P,
}

/// Pictures of an object that moves, and where it is in them.
fn draw_clip(kind: &Named, args: &Simulate, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let clip = Clip::new(kind.trouble, CLIP_FRAMES, options.seed);
    let paint = |k: usize| {
        let at = clip.truth(k);
        let seen = at.visible >= SEEN;
        let line = if seen { format!("{}\n", at.bounds) } else { "NaN,NaN,NaN,NaN\n".to_owned() };
        (clip.frame(k), line, seen)
    };
    let pictures = Pictures { name: kind.name, frames: CLIP_FRAMES, truth: ("groundtruth.txt", ""), paint };
    draw(pictures, args, options, console)
}

fn draw<P: Fn(usize) -> (Frame, String, bool)>(
    Pictures { name, frames, truth: (file, head), paint }: Pictures<P>,
    args: &Simulate,
    options: &Global,
    console: &Console,
) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    if args.runs.get() > 1 {
        return Err(Diagnostic::usage("a clip is drawn once: its pictures are a folder's".to_owned())
            .help("give each one its own --seed and --out"));
    }
    let config = json!({ "scenario": name, "frames": frames, "runs": 1 });
    if options.explain {
        console.info(&pretty(&config)?);
    }
    listen()?;
    let mut folder = Folder::open(&Destination::of(options, COMMAND, Some(Path::new(name))), COMMAND)?;
    let mut record = Record::new(COMMAND, options.seed, config);
    let mut progress = Progress::new(console, "frames", Some(frames as u64));
    let (mut made, mut seen, mut truth) = (0, 0, head.to_owned());
    while made < frames && !interrupted() {
        let (picture, lines, is_seen) = paint(made);
        let picture = png(&picture).map_err(|error| Diagnostic::new(error.to_string()))?;
        made += 1;
        folder.write(&format!("{made:04}.png"), |file| file.write_all(&picture))?;
        seen += usize::from(is_seen);
        truth += &lines;
        progress.advance(1);
    }
    drop(progress);
    folder.write(file, |out| out.write_all(truth.as_bytes()))?;
    if made < frames {
        record.state = State::Interrupted;
        console.warn(format_args!("stopped after {made} of {frames} frames; these are complete"));
    }
    record.seconds = since.elapsed().as_secs_f64();
    let path = folder.finish(&record)?;
    if console.json() {
        console.document(&json!({
            "scenario": name, "state": record.state, "frames": made, "seen": seen,
            "out": path.display().to_string(),
        }))?;
    }
    console.info(format_args!("{made} frames, an object is seen in {seen}: {}", path.display()));
    Ok(if made < frames { Exit::CouldNot } else { Exit::Done })
}

fn pretty(value: &serde_json::Value) -> Result<String, Diagnostic> {
    serde_json::to_string_pretty(value).map_err(|error| Diagnostic::new(error.to_string()))
}

/// The scenario of that name, or in the file of that name: a path has an ending or a folder.
fn find(name: &str) -> Result<Scenario, Diagnostic> {
    if let Some(scenario) = scenario::find(name) {
        return Ok(scenario);
    }
    let path = Path::new(name);
    if path.extension().is_none() && path.components().count() == 1 && !path.is_file() {
        let balls = SCENES.iter().map(|scene| scene.name);
        let clips = CLIPS.iter().map(|clip| clip.name).chain(balls);
        let clips = clips.chain(rgbd::SCENES.iter().map(|scene| scene.name));
        let known: Vec<_> = SCENARIOS.iter().map(|named| named.name).chain(clips).collect();
        let unknown = Diagnostic::usage(format!("there is no scenario `{name}`"));
        return Err(suggest(unknown, name, &known).help("`zerre init scenario` writes one to change"));
    }
    let source = Source::read(path)?;
    let scenario: Scenario = source.parse()?;
    let diagnose = |Invalid { path, what }| source.diagnose(&Problem { path, what });
    scenario.check().map_err(diagnose)?;
    Ok(scenario)
}

fn write_truth(out: impl Write, scenario: &Scenario, run: &Run) -> csv::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    out.write_record(["time_s", "id"].iter().chain(scenario.motion.columns()))?;
    for TruePoint { time, target, state } in &run.truth {
        let numbers = state.iter().map(|value| format!("{value:?}"));
        let labels = [time.to_string(), scenario.target[*target].id.clone()];
        out.write_record(labels.into_iter().chain(numbers))?;
    }
    Ok(out.flush()?)
}

fn write_measurements(out: impl Write, scenario: &Scenario, run: &Run) -> csv::Result<()> {
    let mut columns: Vec<&str> = Vec::new();
    for name in scenario.sensor.iter().flat_map(|sensor| sensor.measures.columns()) {
        if !columns.contains(name) {
            columns.push(name);
        }
    }
    let named = scenario.sensor.iter().any(|sensor| !sensor.name.is_empty());
    let labels: &[&str] = if named { &["time_s", "id", "sensor"] } else { &["time_s", "id"] };
    let mut out = csv::Writer::from_writer(out);
    out.write_record(labels.iter().chain(&columns))?;
    for Measured { time, target, sensor, values } in &run.measurements {
        out.write_field(time.to_string())?;
        out.write_field(&scenario.target[*target].id)?;
        let sensor = &scenario.sensor[*sensor];
        if named {
            out.write_field(&sensor.name)?;
        }
        for column in &columns {
            let place = sensor.measures.columns().iter().position(|own| own == column);
            out.write_field(place.map_or(String::new(), |place| format!("{:?}", values[place])))?;
        }
        out.write_record(None::<&[u8]>)?;
    }
    Ok(out.flush()?)
}

/// What `zerre track` must know of the sensors.
fn track_config(scenario: &Scenario) -> String {
    let mut text = String::from("# The sensors of the scenario, for `zerre track --config`.\n");
    for sensor in &scenario.sensor {
        let name = if sensor.name.is_empty() { "default" } else { &sensor.name };
        let lines = match sensor.measures {
            Measures::Position { position_sd_m } => format!("position_sd_m = {position_sd_m:?}\n"),
            Measures::RangeBearing { position_m, range_sd_m, bearing_sd_rad } => format!(
                "position_m = {position_m:?}\nrange_sd_m = {range_sd_m:?}\nbearing_sd_rad = {bearing_sd_rad:?}\n"
            ),
            Measures::Bearing { position_m, bearing_sd_rad } => {
                format!("position_m = {position_m:?}\nbearing_sd_rad = {bearing_sd_rad:?}\n")
            }
            Measures::Range { position_m, range_sd_m } => {
                format!("position_m = {position_m:?}\nrange_sd_m = {range_sd_m:?}\n")
            }
            Measures::Growth { .. } => continue,
        };
        let bare = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        // A string of JSON is one of TOML.
        let key = if bare { name.to_owned() } else { json!(name).to_string() };
        // Writing to a string cannot fail.
        let _ = write!(text, "\n[sensor.{key}]\n{lines}");
    }
    // Without a sensor that gives positions a track needs to be told where to start: around the targets' first places.
    let places = scenario
        .sensor
        .iter()
        .any(|s| matches!(s.measures, Measures::Position { .. } | Measures::RangeBearing { .. }));
    let starts: Vec<_> = scenario.target.iter().filter(|target| target.start.len() >= 4).collect();
    if !places && !starts.is_empty() {
        let mean = |k: usize| starts.iter().map(|t| t.start[k]).sum::<f64>() / starts.len() as f64;
        let spread = |k: usize| {
            let far =
                |t: &&Target| (t.start[k] - mean(k)).abs() + 3.0 * t.start_sd.get(k).copied().unwrap_or(0.0);
            starts.iter().map(far).fold(0.0, f64::max)
        };
        let (x, y, sd) = (mean(0), mean(1), spread(0).max(spread(1)).max(1.0));
        let _ = write!(text, "\n[start]\nposition_m = [{x:?}, {y:?}]\nposition_sd_m = {sd:?}\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::TrackConfig;
    use zerre_io::{Options, Recording, Trajectories};

    #[test]
    fn tables_read_back_to_what_was_drawn() {
        for named in SCENARIOS {
            let scenario = (named.scenario)();
            let drawn = scenario.draw(3, 0).unwrap();
            let (mut truth, mut measurements) = (Vec::new(), Vec::new());
            write_truth(&mut truth, &scenario, &drawn).unwrap();
            write_measurements(&mut measurements, &scenario, &drawn).unwrap();
            let recording = Recording::read("m", measurements.as_slice(), &Options::default());
            if !scenario.trackable() {
                assert!(recording.is_err(), "{}", named.name);
                continue;
            }
            let recording = recording.unwrap();
            assert_eq!(recording.plots.len(), drawn.measurements.len());
            for (plot, m) in recording.plots.iter().zip(&drawn.measurements) {
                assert_eq!((plot.time, plot.reading.values()), (m.time, m.values.as_slice()));
                assert_eq!(plot.id.as_deref(), Some(scenario.target[m.target].id.as_str()));
            }
            let truth = Trajectories::read("t", truth.as_slice(), &Options::default()).unwrap();
            assert_eq!(truth.by_id.len(), scenario.target.len());
            assert!(truth.summary.ignored.is_empty() && recording.summary.ignored.is_empty());
            TrackConfig::from_source(&Source::new("track.toml", track_config(&scenario))).unwrap();
        }
    }

    #[test]
    fn any_name_of_a_sensor_makes_a_configuration() {
        let mut scenario = scenario::find("radar-cv").unwrap();
        scenario.sensor[0].name = "north \"tower\"\n\u{7}".to_owned();
        let source = Source::new("track.toml", track_config(&scenario));
        let config = TrackConfig::from_source(&source).unwrap();
        assert_eq!(config.sensor.keys().next(), Some(&scenario.sensor[0].name));
    }
}
