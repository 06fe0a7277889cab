//! `zerre balls`: several balls through a video.

mod follow;

use super::video::open::{file, of_pictures};
use super::video::overlay::{self, Overlay};
use super::video::write_film;
use crate::Exit;
use crate::args::{Balls, Global, Preset};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, EstimatesDigest, Folder, Input, Progress, Record, State, interrupted, listen};
use follow::{Followed, Follower, chosen_reading, settings};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use zerre_lab::balls::{BallScene, BallScores, TruthTable, Watched, page, points_csv, score};
use zerre_lab::otb::luck;
use zerre_lab::report::overlay::Film;
use zerre_lab::report::study::render;
use zerre_vision::Frame;
use zerre_vision::balls::{Detector, DetectorSettings, GroundFrom};
use zerre_vision::frames::Frames;
use zerre_vision::frames::folder::{Pictures, frame as picture};

const COMMAND: &str = "balls";
/// Frames of a video that ground and threshold are found from.
const SAMPLES: usize = 15;

fn refused(error: impl std::fmt::Display) -> Diagnostic {
    Diagnostic::new(error.to_string())
}

pub(super) fn run(args: &Balls, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    let simd = super::simd(options)?;
    if args.preset == Preset::Default && args.reading.is_some() {
        return Err(Diagnostic::usage("--reading is a way to read the thesis").help("add --preset thesis"));
    }
    if let Some(path) = &args.overlay {
        overlay::check(path, options.force)?;
    }
    let truth = args.truth.as_deref().map(read_truth).transpose()?;
    let path = Path::new(&args.input);
    let mut read = vec![path.to_owned()];
    let mut frames = Frames::open(&args.input).map_err(refused)?;
    let mut inputs = input(args, path, &mut read)?;
    inputs.extend(args.truth.as_deref().map(super::input).transpose()?);
    listen()?;
    let samples = samples(args, &mut frames)?;
    let detector = Detector::new(&detection(args)?, &samples).map_err(refused)?;
    let size = detector.ground().picture().size();
    drop(samples);
    let mut follower = Follower::new(args, simd, size, luck(options.seed, 0))?;
    let mut record = Record::new(COMMAND, options.seed, config(args, simd, &detector)?);
    record.input = inputs;
    if options.explain {
        explain(&record.config, console)?;
    }
    let destination =
        Destination::of(options, COMMAND, Some(path)).reading(read.iter().map(PathBuf::as_path));
    let mut folder = Folder::open(&destination, COMMAND)?;

    let (expected, rate) = (frames.expected(), frames.rate());
    let mut film = Film::default();
    let mut overlay = args.overlay.as_ref().map(|path| Overlay::new(path, rate, expected));
    let (mut failed, mut notes, mut count, mut unread) = (None, Vec::new(), 0, 0_u64);
    let mut progress = Progress::new(console, "frames", expected.map(|count| count as u64)).with_rate();
    for shot in frames.by_ref() {
        if interrupted() {
            record.state = State::Interrupted;
            break;
        }
        count = shot.index + 1;
        progress.advance(1);
        let taken = shot.frame.and_then(|frame| follower.step(shot.index, &frame, &detector).map(|()| frame));
        let frame = match taken {
            Ok(frame) => frame,
            Err(error) => {
                unread += 1;
                if unread <= 10 {
                    notes.push(format!("{}: left out: {error}", shot.name));
                }
                continue;
            }
        };
        let balls = follower.shown();
        let known = truth.as_ref().map_or(&[][..], |truth| truth.of_frame(shot.index));
        let scene = BallScene { frame: &frame, index: shot.index, balls: &balls, truth: known };
        let drawn = film.see(&scene).map_err(refused);
        let drawn = drawn.and_then(|()| overlay.as_mut().map_or(Ok(()), |overlay| overlay.push(&scene)));
        if let Err(error) = drawn {
            // The picture is lost, the balls go on.
            overlay = None;
            failed.get_or_insert(error);
        }
    }
    drop(progress);
    if let Some(overlay) = overlay {
        notes.extend(overlay.finish()?);
    }
    if let Some(complaint) = frames.complaint().filter(|_| record.state == State::Complete) {
        record.outcome("video ended early or is damaged", "what was read of it was followed");
        notes.push(format!("{}: {complaint}", args.input));
    }
    notes.iter().for_each(|note| console.warn(note));
    let followed = follower.finish();
    let scores = match &truth {
        Some(truth) => Some(score(&followed.rows, truth, count).map_err(refused)?),
        None => None,
    };
    let numbers = followed.rows.iter().map(|row| row.ball).max().unwrap_or(0);
    let digest = digest(&followed);
    folder.write("points.csv", |file| file.write_all(points_csv(&followed.rows).as_bytes()))?;
    let film = write_film(&film, &mut folder)?;
    let mut page = page(Watched {
        title: format!("Balls in {}", args.input),
        facts: facts(args, options.seed, count, numbers, &detector),
        rows: &followed.rows,
        scores,
        film,
        notes,
    });
    page.command = command_line(args, options);
    page.digest.clone_from(&digest);
    folder.write("report.html", |file| file.write_all(render(&page).as_bytes()))?;

    count_outcomes(&mut record, &followed, (count as u64, unread), frames.ignored());
    if record.state == State::Interrupted {
        console.warn(format_args!("stopped after {count} frames"));
    }
    record.estimates_digest = Some(digest.clone());
    record.seconds = since.elapsed().as_secs_f64();
    let path = folder.finish(&record)?;
    if console.json() {
        console.document(&json!({
            "balls": numbers, "rows": followed.rows.len(), "frames": count, "unreadable": unread,
            "scores": scores, "estimates_digest": digest, "state": record.state,
        }))?;
    }
    let swaps = scores.map(|scores: BallScores| {
        format!(", {} identity swaps, held {} of {}", scores.swaps, scores.held, scores.visible)
    });
    console.info(format_args!(
        "{count} frames, {numbers} balls{} in {:.1} s: {}",
        swaps.unwrap_or_default(),
        record.seconds,
        path.join("report.html").display()
    ));
    if let Some(error) = failed {
        return Err(error);
    }
    let degraded = numbers == 0 || scores.is_some_and(|scores| scores.swaps > 0);
    Ok(if record.state == State::Interrupted {
        Exit::CouldNot
    } else if args.strict && degraded {
        Exit::Degraded
    } else {
        Exit::Done
    })
}

fn read_truth(path: &Path) -> Result<TruthTable, Diagnostic> {
    let text = std::fs::read_to_string(path).map_err(|error| Diagnostic::io("read", path, &error))?;
    TruthTable::read(&text).map_err(|problem| Diagnostic::new(format!("{}, {problem}", path.display())))
}

/// What is read, digested; `read` gets a file of each folder.
fn input(args: &Balls, path: &Path, read: &mut Vec<PathBuf>) -> Result<Vec<Input>, Diagnostic> {
    if path.is_dir() {
        let pictures = Pictures::open(path).map_err(refused)?;
        read.extend(pictures.places().iter().find_map(file));
        return Ok(vec![of_pictures(&args.input, &pictures)?]);
    }
    if path.is_file() { Ok(vec![super::input(path)?]) } else { Ok(Vec::new()) }
}

/// Frames spread over the video; of a stream, which cannot be read twice, its first one.
fn samples(args: &Balls, frames: &mut Frames) -> Result<Vec<Frame>, Diagnostic> {
    let path = Path::new(&args.input);
    let mut samples: Vec<Frame> = Vec::new();
    if path.is_dir() || path.is_file() {
        let again = Frames::open(&args.input).map_err(refused)?;
        let every = again.expected().unwrap_or(SAMPLES).div_ceil(SAMPLES).max(1);
        let good = again.step_by(every).take(4 * SAMPLES).filter_map(|shot| shot.frame.ok());
        samples.extend(good);
    } else if let Some(Ok(frame)) = frames.peek().map(|shot| &shot.frame) {
        samples.push(frame.clone());
    }
    if samples.is_empty() {
        let what = format!("{}: none of the frames that were looked at can be read", args.input);
        return Err(Diagnostic::new(what));
    }
    Ok(samples)
}

fn detection(args: &Balls) -> Result<DetectorSettings, Diagnostic> {
    let ground = match args.ground.as_str() {
        "plain" => GroundFrom::Plain,
        "median" => GroundFrom::Median,
        path => GroundFrom::Picture(picture(Path::new(path)).map_err(|error| {
            Diagnostic::new(error.to_string()).help("the ground is plain, median, or a picture of it")
        })?),
    };
    let DetectorSettings { level, least_area, most_area, .. } = DetectorSettings::default();
    Ok(DetectorSettings {
        ground,
        level: args.threshold.or(level),
        least_area: args.min_area.or(least_area),
        most_area: args.max_area.or(most_area),
    })
}

fn config(args: &Balls, simd: zerre::kernels::Simd, detector: &Detector) -> Result<Value, Diagnostic> {
    let (least, most) = detector.areas();
    let mut config = json!({
        "input": args.input, "preset": args.preset, "count": args.count, "particles": args.particles,
        "ground": args.ground, "threshold": detector.level(), "min_area": least, "max_area": most,
        "truth": args.truth.as_ref().map(|path| path.display().to_string()),
    });
    match args.preset {
        Preset::Default => {
            let settings = settings(args, simd);
            config["motion"] = json!(settings.motion);
            config["resampling"] = json!(settings.filter.resampling);
            config["process_noise"] = settings.process_sd.into();
            config["measurement_noise"] = settings.measurement_sd.into();
            config["confirm"] = settings.confirm.into();
            config["patience"] = settings.patience.into();
        }
        Preset::Thesis => {
            let reading = chosen_reading(args)?;
            config["count"] = args.count.map_or(Follower::COUNT, usize::from).into();
            config["reading"] = reading.name.into();
            config["motion"] = json!(reading.motion);
            let scheme = args.resampling.map_or(zerre::resample::Resampling::Multinomial, Into::into);
            config["resampling"] = json!(scheme);
            config["process_noise"] = reading.process_sd.into();
        }
    }
    Ok(config)
}

fn explain(config: &Value, console: &Console) -> Result<(), Diagnostic> {
    let text = serde_json::to_string_pretty(config).map_err(refused)?;
    console.info(format_args!(
        "{text}\nthreshold: Otsu's level of the differences from the ground in {SAMPLES} frames, unless given\n\
         min_area: an eighth of a typical ball, so that slivers of rims are none\n\
         max_area: a quarter of the ground, so that a hand is no ball\n\
         confirm: detections after which a ball is believed; patience: frames that it may be hidden"
    ));
    Ok(())
}

fn digest(followed: &Followed) -> String {
    let mut digest = EstimatesDigest::default();
    for row in &followed.rows {
        let ([x, y], [u, v], [[xx, xy], [_, yy]]) =
            (row.known.centre, row.known.velocity, row.known.covariance);
        digest.push(&[row.frame as f64, row.ball as f64, x, y, u, v, xx, xy, yy]);
    }
    digest.finish()
}

fn facts(args: &Balls, seed: u64, frames: usize, balls: usize, detector: &Detector) -> Vec<(String, String)> {
    let (least, most) = detector.areas();
    let preset = match args.preset {
        Preset::Default => "by predicted place, area and colour",
        Preset::Thesis => "by sorting areas, as in the thesis",
    };
    [
        ("Input", args.input.clone()),
        ("Told apart", preset.to_owned()),
        ("Seed", seed.to_string()),
        ("Particles of each ball", args.particles.to_string()),
        ("Frames", frames.to_string()),
        ("Balls", balls.to_string()),
        ("Threshold", detector.level().to_string()),
        ("Areas (px)", format!("{least} to {most}")),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}

fn count_outcomes(record: &mut Record, followed: &Followed, (read, unread): (u64, u64), ignored: usize) {
    record.counts.read = read;
    record.counts.used = read - unread.min(read);
    for (name, count, into) in [
        ("unreadable frame", unread, &mut record.counts.rejected),
        ("file that is no picture", ignored as u64, &mut record.counts.left_out),
    ] {
        if count > 0 {
            into.insert(name.to_owned(), count);
        }
    }
    let counted = followed.counted;
    for (name, action, count) in [
        ("ball bounced away from its particles", "its filter was started anew there", counted.restarts),
        ("several balls in one part of the picture", "they were told apart by their rims", counted.shared),
        ("part of the picture too large for a ball", "it was left out", counted.too_large),
        ("track too short to be believed", "it was left out", counted.short),
        ("ball without a part of the picture", "it was predicted", followed.missing),
    ] {
        if count > 0 {
            record.outcomes_of(name, action, count as u64);
        }
    }
    if followed.rows.is_empty() {
        record.outcome("no ball was found", "the tables are empty");
    }
}

/// The command line that gives this run again.
fn command_line(args: &Balls, options: &Global) -> String {
    let mut line = format!("zerre balls {}", args.input);
    let mut option = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            line += &format!(" --{name} {value}");
        }
    };
    let word = |value: Value| value.as_str().map(str::to_owned);
    option("count", args.count.map(|count| count.to_string()));
    option("preset", (args.preset == Preset::Thesis).then(|| "thesis".to_owned()));
    option("reading", args.reading.clone());
    option("motion", args.motion.and_then(|motion| word(json!(motion))));
    option("resampling", args.resampling.and_then(|scheme| word(json!(scheme))));
    option("particles", Some(args.particles.to_string()));
    option("process-noise", args.process_noise.map(|sd| sd.to_string()));
    option("measurement-noise", Some(args.measurement_noise.to_string()));
    option("ground", Some(args.ground.clone()));
    option("threshold", args.threshold.map(|level| level.to_string()));
    option("min-area", args.min_area.map(|area| area.to_string()));
    option("max-area", args.max_area.map(|area| area.to_string()));
    option("truth", args.truth.as_ref().map(|path| path.display().to_string()));
    option("overlay", args.overlay.as_ref().map(|path| path.display().to_string()));
    option("seed", Some(options.seed.to_string()));
    line
}
