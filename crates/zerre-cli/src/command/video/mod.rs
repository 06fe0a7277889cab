//! `zerre video`: one object through a video.

mod choose;
pub(super) mod open;
mod overlay;

use crate::Exit;
use crate::args::{Global, Video};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, EstimatesDigest, Folder, Progress, Record, State, interrupted, listen};
use open::{Opened, open};
use overlay::Overlay;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use zerre_lab::otb::{self, Followed, Moment, Watched, boxes_csv, follow, luck};
use zerre_lab::report::overlay::{Film, Scene};
use zerre_lab::report::study::{Picture, render};
use zerre_vision::frames::folder::png;
use zerre_vision::{Image, Rect};

const COMMAND: &str = "video";
const FILM: &str = "film.png";

pub(super) fn run(args: &Video, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    let kind = super::tracker(args.tracker.as_deref())?;
    if let Some(path) = &args.overlay {
        overlay::check(path, options.force)?;
    }
    let mut opened = open(args, console)?;
    let config = json!({
        "input": args.input, "box": opened.bounds.to_string(), "first_frame": opened.first,
        "tracker": kind.name, "truth": opened.source.as_ref().map(|source| source.display().to_string()),
    });
    let mut record = Record::new(COMMAND, options.seed, config);
    record.input = std::mem::take(&mut opened.inputs);
    if options.explain {
        let text =
            serde_json::to_string_pretty(&record.config).map_err(|e| Diagnostic::new(e.to_string()))?;
        console.info(format_args!("{text}\nthe tracker has the settings that it is listed with"));
    }
    let destination = Destination::of(options, COMMAND, Some(Path::new(&args.input)))
        .reading(opened.read.iter().map(PathBuf::as_path));
    let mut folder = Folder::open(&destination, COMMAND)?;
    listen()?;

    let Opened { mut frames, truth, bounds, first, notes, .. } = opened;
    let (expected, rate) = (frames.expected(), frames.rate());
    let left = expected.map(|count| count.saturating_sub(first));
    let mut film = Film::default();
    let mut overlay = args.overlay.as_ref().map(|path| Overlay::new(path, rate, left));
    let mut failed = None;
    let mut progress = Progress::new(console, "frames", left.map(|count| count as u64)).with_rate();
    let see = |moment: &Moment| {
        progress.advance(1);
        let Some(frame) = moment.frame else { return !interrupted() };
        let particles = moment.tracker.particles();
        let truth = truth.get(moment.index).copied().flatten();
        let scene =
            Scene { frame, index: moment.index, truth, estimate: moment.estimate, particles: &particles };
        let drawn = film.see(&scene).map_err(|error| Diagnostic::new(error.to_string()));
        let drawn = drawn.and_then(|()| overlay.as_mut().map_or(Ok(()), |overlay| overlay.push(&scene)));
        if let Err(error) = drawn {
            // The picture is lost, the boxes go on.
            overlay = None;
            failed.get_or_insert(error);
        }
        !interrupted()
    };
    let followed = follow(kind, &mut frames, |_| bounds, luck(options.seed, 0), see)
        .map_err(|error| Diagnostic::new(error.to_string()))?;
    drop(progress);
    let mut notes = notes;
    if let Some(overlay) = overlay {
        notes.extend(overlay.finish()?);
    }
    if let Some(complaint) = frames.complaint().filter(|_| !followed.stopped) {
        record.outcome("video ended early or is damaged", "what was read of it was followed");
        notes.push(format!("{}: {complaint}", args.input));
    }
    notes.extend(followed.refusal.iter().map(|refusal| format!("the tracker gave up at {refusal}")));
    notes.extend(followed.unread.iter().take(10).map(|unread| format!("the box before stood: {unread}")));
    notes.iter().for_each(|note| console.warn(note));

    // Truth of the frames that were followed.
    let known = truth.get(first..).unwrap_or_default();
    let known = &known[..known.len().min(followed.estimates.len())];
    let digest = digest(&followed);
    folder.write("boxes.csv", |file| file.write_all(boxes_csv(&followed.estimates, first).as_bytes()))?;
    let picture = write_film(&film, &mut folder)?;
    let fps = followed.fps();
    let mut page = otb::page(Watched {
        title: format!("Video {}", args.input),
        facts: facts(args, kind.name, options.seed, bounds, &followed),
        followed: &followed,
        first,
        truth: known,
        film: picture,
        notes,
    });
    page.command = command_line(args, options);
    page.digest.clone_from(&digest);
    folder.write("report.html", |file| file.write_all(render(&page).as_bytes()))?;

    let unread = followed.unread.len() as u64;
    record.counts.read = followed.estimates.len() as u64;
    record.counts.used = record.counts.read - unread;
    for (name, count, into) in [
        ("unreadable frame", unread, &mut record.counts.rejected),
        ("file that is no picture", frames.ignored() as u64, &mut record.counts.left_out),
    ] {
        if count > 0 {
            into.insert(name.to_owned(), count);
        }
    }
    let lost = followed.estimates.iter().filter(|estimate| estimate.is_lost()).count();
    if lost > 0 {
        record.outcomes_of("object lost", "the frame is flagged", lost as u64);
    }
    if followed.refusal.is_some() {
        record.outcome("tracker gave up", "what it had followed is written");
    }
    if followed.stopped {
        record.state = State::Interrupted;
        console.warn(format_args!("stopped after {} frames", followed.estimates.len()));
    }
    record.estimates_digest = Some(digest.clone());
    record.seconds = since.elapsed().as_secs_f64();
    let path = folder.finish(&record)?;
    if console.json() {
        let scores = otb::scores(&followed, known).map(|(scores, doubts)| {
            json!({
                "frames": scores.frames, "rmse_px": scores.rmse_px(), "precision20": scores.precision20(),
                "success_auc": scores.success_auc(), "iou": scores.iou(), "coverage95": doubts.coverage95(),
                "lost": scores.lost > 0,
            })
        });
        console.document(&json!({
            "tracker": kind.name, "box": bounds, "first_frame": first, "frames": followed.estimates.len(),
            "unreadable": unread, "lost_frames": lost, "fps": fps, "scores": scores,
            "estimates_digest": digest, "state": record.state,
        }))?;
    }
    let speed = fps.map(|fps| format!(", {} frames/s of the tracker's own time", zerre_lab::number(fps)));
    console.info(format_args!(
        "{} frames, {lost} flagged as lost, in {:.1} s{}: {}",
        followed.estimates.len(),
        record.seconds,
        speed.unwrap_or_default(),
        path.join("report.html").display()
    ));
    if let Some(error) = failed {
        return Err(error);
    }
    let lost_at_last = followed.estimates.last().is_some_and(|estimate| estimate.is_lost());
    Ok(if followed.stopped || followed.refusal.is_some() {
        Exit::CouldNot
    } else if args.strict && lost_at_last {
        Exit::Degraded
    } else {
        Exit::Done
    })
}

fn digest(followed: &Followed) -> String {
    let mut digest = EstimatesDigest::default();
    for estimate in &followed.estimates {
        let [[xx, xy], [_, yy]] = estimate.covariance;
        let Rect { x, y, width, height } = estimate.bounds;
        digest.push(&[x, y, width, height, xx, xy, yy, estimate.score, estimate.p_lost]);
    }
    digest.finish()
}

/// Writes the filmstrip, and says what the page needs of it.
fn write_film(film: &Film, folder: &mut Folder) -> Result<Option<Picture>, Diagnostic> {
    let strip = film.strip().map_err(|error| Diagnostic::new(error.to_string()))?;
    let Some(strip) = strip else { return Ok(None) };
    let [width, height] = strip.size();
    let bytes = Image::new(width, height, strip.rgb())
        .and_then(|picture| png(&picture))
        .map_err(|error| Diagnostic::new(error.to_string()))?;
    folder.write(FILM, |file| file.write_all(&bytes))?;
    let side = |side: usize| u16::try_from(side).unwrap_or(u16::MAX);
    let title = "A dozen frames, evenly spaced".to_owned();
    Ok(Some(Picture { title, file: FILM.to_owned(), size: [side(width), side(height)] }))
}

fn facts(args: &Video, tracker: &str, seed: u64, bounds: Rect, followed: &Followed) -> Vec<(String, String)> {
    let speed = followed.fps().map_or_else(|| "too fast to tell".to_owned(), zerre_lab::number);
    let frames = followed.estimates.len();
    [
        ("Input", args.input.clone()),
        ("Tracker", tracker.to_owned()),
        ("Seed", seed.to_string()),
        ("Box in the first frame", format!("{bounds} px")),
        ("Frames", format!("{frames}, {} of them unreadable", followed.unread.len())),
        ("Frames per second of the tracker's processor time", speed),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec()
}

/// The command line that gives this run again.
fn command_line(args: &Video, options: &Global) -> String {
    let mut line = format!("zerre video {}", args.input);
    let mut option = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            line += &format!(" --{name} {value}");
        }
    };
    let path = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    option("box", args.bounds.map(|bounds| bounds.to_string()));
    option("tracker", args.tracker.clone());
    option("truth", path(&args.truth));
    option("overlay", path(&args.overlay));
    option("seed", Some(options.seed.to_string()));
    line
}
