//! `zerre label`: people mark reference points in frames, and how well they agree.

mod frames;
mod outcome;

use crate::Exit;
use crate::args::{Global, Label};
use crate::browser::{browse, has_display};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, Folder, Record, State, interrupted, listen};
use frames::{Found, Source};
use outcome::Outcome;
use serde_json::json;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use zerre_lab::agreement;
use zerre_web::label::{Desk, Job, Store, name};

const COMMAND: &str = "label";
/// The file with the marks. It is not among the files of the run, which another run may replace.
const MARKS: &str = "labels.sqlite";
const POINT: &str = "hand";

pub(super) fn run(args: &Label, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    let points = points(&args.point)?;
    let source = Source::open(&args.input, args.every)?;
    let config = json!({
        "input": args.input.display().to_string(), "points": points, "every": args.every,
    });
    let mut record = Record::new(COMMAND, options.seed, config);
    record.input.push(source.input()?);
    if options.explain {
        let text =
            serde_json::to_string_pretty(&record.config).map_err(|e| Diagnostic::new(e.to_string()))?;
        let port = args
            .port
            .map_or_else(|| "the one of last time, else any that is free".to_owned(), |p| p.to_string());
        console.info(format_args!(
            "{text}\npoints: one, `{POINT}`, unless --point names others\nevery: all frames are marked unless told\n\
             port: {port}; it changes no result"
        ));
    }
    let read = source.reads();
    let destination =
        Destination::of(options, COMMAND, Some(&args.input)).reading(read.iter().map(PathBuf::as_path));
    let mut folder = Folder::go_on(&destination, COMMAND)?;
    listen()?;
    let path = folder.path().join(MARKS);
    if !path.exists() {
        let nothing = outcome::nothing(&points).labels().csv();
        let table = folder.path().join("labels.csv");
        if std::fs::read(&table).is_ok_and(|text| text != nothing.as_bytes()) && !options.force {
            let what = format!("{} has marks whose file {MARKS} is gone", table.display());
            return Err(
                Diagnostic::new(what).help("name another folder with --out; --force replaces the table")
            );
        }
        // The folder is known as ours before the marks are in it.
        outcome::write(&mut folder, "labels.csv", &nothing)?;
    }
    let mut store = Store::open(&path).map_err(|error| refused(&error))?;
    let input = record.input.iter().map(|input| input.sha256.clone()).collect::<String>();
    let input = format!("sha256 {input}, every {}", args.every);
    let known = store.job().map_err(|error| refused(&error))?;
    let found = match known {
        Some(known) => {
            let asked = Job { input, points, ..known.clone() };
            store.begin(&asked).map_err(|error| refused(&error))?;
            source.again(known, folder.path(), console)?
        }
        None => source.check(input, points, folder.path(), console)?,
    };
    let Found { job, picture, rejected } = found;
    if rejected > 0 {
        record.counts.rejected.insert("unreadable frame".to_owned(), rejected);
    }
    record.counts.used = job.frames.len() as u64;
    record.counts.read = record.counts.used + rejected;

    store.begin(&job).map_err(|error| refused(&error))?;
    let store = Arc::new(Mutex::new(store));
    let teller = *console;
    let desk = Desk::new(job.clone(), Arc::clone(&store), picture, move |text: &str| teller.info(text))
        .and_then(|desk| desk.open(args.port))
        .map_err(|error| refused(&error))?;
    let text = format!(
        "{} frames of {} to be marked ({}) on {}\nCtrl-C closes the job and writes the tables; the same command goes on",
        job.frames.len(),
        job.title,
        job.points.join(", "),
        desk.address
    );
    console.page(&desk.address, text);
    if has_display() {
        browse(&desk.address);
    }
    desk.serve(interrupted).map_err(|error| refused(&error))?;

    let answers = store.lock().unwrap_or_else(PoisonError::into_inner).answers(&job);
    let answers = answers.map_err(|error| refused(&error))?;
    let outcome = Outcome::of(&job, answers);
    let safe = |error: Diagnostic| {
        error.help(format!("every mark is in {}: the same command goes on", path.display()))
    };
    outcome.write(args, &mut record, &mut folder).map_err(safe)?;
    if !outcome.is_whole() {
        record.state = State::Interrupted;
    }
    record.seconds = since.elapsed().as_secs_f64();
    let state = record.state;
    let out = folder.finish(&record).map_err(safe)?;
    outcome.warnings().iter().for_each(|warning| console.warn(warning));
    if console.json() {
        console.document(&outcome.document(&out, state, record.estimates_digest.as_deref()))?;
    } else {
        console.result(&outcome.table())?;
    }
    console.info(format_args!(
        "labels.csv, reference.csv, agreement.csv, again.csv and report.html are in {}",
        out.display()
    ));
    Ok(Exit::Done)
}

/// Names of the points, which stand in tables like names of operators.
fn points(given: &[String]) -> Result<Vec<String>, Diagnostic> {
    let mut points: Vec<String> = Vec::new();
    for text in given {
        let point = name(text).map_err(|problem| {
            Diagnostic::usage(format!(
                "`{text}` cannot be the name of a point: {}",
                problem.trim_end_matches('.')
            ))
        })?;
        if points.contains(&point) {
            return Err(Diagnostic::usage(format!("the point {point} is named twice")));
        }
        points.push(point);
    }
    if points.is_empty() {
        points.push(POINT.to_owned());
    }
    Ok(points)
}

fn refused(error: &zerre_web::Error) -> Diagnostic {
    let diagnostic = Diagnostic::new(error.to_string());
    match error {
        zerre_web::Error::Port { .. } => {
            diagnostic.help("another program has it, or may not be asked for: name another one with --port")
        }
        zerre_web::Error::OtherJob { .. } => {
            diagnostic.help("the marks in it are safe; name another folder with --out for this job")
        }
        zerre_web::Error::Store { .. } => diagnostic.help("name another folder with --out, or mend the file"),
        _ => diagnostic,
    }
}

/// What the statistics call an answer.
fn answer(of: zerre_web::label::Answer) -> agreement::Answer {
    of.map_or(agreement::Answer::Hidden, agreement::Answer::Seen)
}
