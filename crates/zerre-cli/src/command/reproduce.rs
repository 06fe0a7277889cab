//! `zerre reproduce`: the experiments of papers, done again.

use super::{simd, threads, unknown};
use crate::Exit;
use crate::args::{Global, Reproduce};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{
    Destination, EstimatesDigest, Folder, Progress, Record, State, interrupted, listen, text_digest,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use zerre_lab::paper::PAPERS;
use zerre_lab::paper::multiple_model::scenarios::SCENARIOS;
use zerre_lab::paper::multiple_model::settings::{NOISES, SOURCE, Setting};
use zerre_lab::paper::multiple_model::{
    self as paper, Asked, Cell, Outcome, PAPER, Provenance, Request, Results, Row, Saving,
};
use zerre_lab::report::study::render;
use zerre_lab::study;

const COMMAND: &str = "reproduce";
/// What is done, for `--resume`.
const PROGRESS: &str = "progress.json";
/// How often it is written.
const INTERVAL: Duration = Duration::from_secs(5);
/// Where the settings stand in the repository of zerre.
const SETTINGS: &str = "crates/zerre-lab/src/paper/multiple_model/settings.rs";

pub(super) fn run(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let Some(name) = &args.paper else { return list(console) };
    let names: Vec<_> = PAPERS.iter().map(|paper| paper.name).collect();
    if !names.contains(&name.as_str()) {
        return Err(unknown("paper", name, &names));
    }
    multiple_model(args, options, console)
}

fn list(console: &Console) -> Result<Exit, Diagnostic> {
    if console.json() {
        let papers = PAPERS
            .iter()
            .map(|p| json!({ "name": p.name, "about": p.about, "source": p.source, "tables": p.tables }));
        console.document(&json!({ "papers": papers.collect::<Vec<_>>() }))?;
        return Ok(Exit::Done);
    }
    let mut text = String::new();
    for paper in PAPERS {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{}  {}\n  {}\n  tables: {}",
            paper.name,
            paper.about,
            paper.source,
            paper.tables.join(" ")
        );
    }
    console.result(&text)?;
    Ok(Exit::Done)
}

fn request(args: &Reproduce) -> Result<Request, Diagnostic> {
    let mut request = Request::new(args.quick);
    if !args.table.is_empty() {
        request.tables = args
            .table
            .iter()
            .map(|name| Asked::named(name).ok_or_else(|| unknown("table", name, PAPER.tables)))
            .collect::<Result<_, _>>()?;
        request.tables.sort_unstable();
        request.tables.dedup();
    }
    if let Some(runs) = args.runs {
        request.runs = runs.get() as usize;
        request.paired_runs = request.paired_runs.max(request.runs);
        if args.quick {
            request.paired_runs = request.runs;
        }
    }
    if !args.particles.is_empty() {
        request.particles = args.particles.iter().map(|n| n.get() as usize).collect();
        request.particles.sort_unstable();
        request.particles.dedup();
    }
    Ok(request)
}

/// What is done so far.
#[derive(Default, Serialize, Deserialize)]
struct Done {
    config_digest: String,
    /// By the key of the cell.
    cells: BTreeMap<String, Outcome>,
}

fn multiple_model(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    // The level never changes results; asking for one that is not there is refused as everywhere.
    simd(options)?;
    let request = request(args)?;
    let cells = request.cells();
    let settings = [Setting::Reference, Setting::Tuned, Setting::Default, Setting::Matched]
        .map(|setting| (setting.name(), setting.assumed()));
    let config = json!({
        "paper": PAPER.name,
        "tables": request.tables.iter().map(|table| format!("{table:?}")).collect::<Vec<_>>(),
        "runs": request.runs,
        "paired_runs": request.paired_runs,
        "particles": request.particles,
        "noises": NOISES,
        "settings": BTreeMap::from(settings),
        "settings_sha256": text_digest(SOURCE),
    });
    let mut record = Record::new(COMMAND, options.seed, config);
    if options.explain {
        console.info(explained(&record.config)?);
    }
    listen()?;
    let destination = Destination::of(options, COMMAND, Some(Path::new(PAPER.name)));
    let (mut folder, mut done) = open(&destination, options.resume, &record.config_digest)?;

    compute(&cells, &mut done, &mut folder, options, console)?;
    let outcomes: BTreeMap<Cell, Outcome> =
        cells.keys().filter_map(|cell| Some((*cell, done.cells.get(&cell.key())?.clone()))).collect();
    let wanted = request.tables.contains(&Asked::Saving) && outcomes.len() == cells.len();
    let saving = if wanted { take_turns(&request, options.seed, console)? } else { None };
    let complete =
        outcomes.len() == cells.len() && saving.is_some() == request.tables.contains(&Asked::Saving);

    let results = Results::new(&request, &outcomes, saving.as_ref(), options.seed)
        .map_err(|error| Diagnostic::new(error.to_string()))?;
    let rows = results.rows();
    let digest = digest(&rows);
    let tables = results.tables();
    for table in &tables {
        folder.write(&format!("{}.csv", table.name), |file| file.write_all(table.csv().as_bytes()))?;
    }
    let page = results.page(&Provenance {
        command: command_line(args, options),
        seed: options.seed,
        commit: commit(),
        settings_sha256: text_digest(SOURCE),
        digest: digest.clone(),
        interrupted: !complete,
    });
    folder.write("report.html", |file| file.write_all(render(&page).as_bytes()))?;
    let (degenerate, lost) = results.mishaps();
    if degenerate > 0 {
        record.outcomes_of("measurement without likelihood", "the prediction stood", degenerate as u64);
    }
    if lost > 0 {
        record.outcomes_of(
            "filter refused a step",
            "its last estimate stood to the end of the run",
            lost as u64,
        );
    }
    if !complete {
        record.state = State::Interrupted;
        let what =
            format!("stopped after {} of {} cells; --resume goes on from there", outcomes.len(), cells.len());
        console.warn(what);
    }
    record.seconds = since.elapsed().as_secs_f64();
    record.estimates_digest = Some(digest.clone());
    let path = folder.finish(&record)?;
    if console.json() {
        console.document(&json!({
            "paper": PAPER.name,
            "seed": options.seed,
            "runs": request.runs,
            "rows": rows,
            "estimates_digest": digest,
            "state": record.state,
        }))?;
    }
    console.info(format_args!(
        "{} tables in {:.1} s: {}",
        tables.len(),
        record.seconds,
        path.join("report.html").display()
    ));
    Ok(if complete { Exit::Done } else { Exit::CouldNot })
}

fn explained(config: &Value) -> Result<String, Diagnostic> {
    let text = serde_json::to_string_pretty(config).map_err(|error| Diagnostic::new(error.to_string()))?;
    Ok(format!("{text}\nthe report says what the thesis leaves open and how it is read"))
}

/// A fresh folder, or the one of an earlier run with what that run has done.
fn open(destination: &Destination, resume: bool, config_digest: &str) -> Result<(Folder, Done), Diagnostic> {
    let fresh = Done { config_digest: config_digest.to_owned(), ..Done::default() };
    if !resume {
        return Ok((Folder::open(destination, COMMAND)?, fresh));
    }
    let folder = Folder::reopen(destination, COMMAND)?;
    let path = folder.path().join(PROGRESS);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok((folder, fresh)),
        Err(error) => return Err(Diagnostic::io("read", &path, &error)),
    };
    let begin_anew = "leave --resume out to begin anew";
    let done: Done = serde_json::from_slice(&text).map_err(|error| {
        Diagnostic::new(format!("{} is damaged: {error}", path.display())).help(begin_anew)
    })?;
    if done.config_digest != config_digest {
        let what = format!("the run in {} had another configuration or seed", folder.path().display());
        return Err(
            Diagnostic::new(what).help("give the same options as then, or leave --resume out to begin anew")
        );
    }
    Ok((folder, done))
}

/// Does what is not done yet, the longest work first, and keeps what is done.
fn compute(
    cells: &BTreeMap<Cell, usize>,
    done: &mut Done,
    folder: &mut Folder,
    options: &Global,
    console: &Console,
) -> Result<(), Diagnostic> {
    let work = |cell: &Cell, runs: usize| cell.work(SCENARIOS[cell.scenario].modes.len()) * runs as u64;
    let mut jobs: Vec<(Cell, usize)> = cells
        .iter()
        .map(|(cell, runs)| (*cell, *runs))
        .filter(|(cell, _)| !done.cells.contains_key(&cell.key()))
        .collect();
    jobs.sort_by_key(|(cell, runs)| std::cmp::Reverse(work(cell, *runs)));
    let total: u64 = jobs.iter().map(|(cell, runs)| work(cell, *runs)).sum();
    let mut progress = Progress::new(console, "particle moves", Some(total));
    let mut written: Option<Instant> = None;
    let save = |done: &Done, folder: &mut Folder| {
        folder.write(PROGRESS, |file| serde_json::to_writer(file, done).map_err(std::io::Error::from))
    };
    let one = |(cell, runs): &(Cell, usize)| {
        paper::work(cell, *runs, options.seed, interrupted)
            .map_err(|error| Diagnostic::new(format!("{}: {error}", cell.key())))
    };
    study::run(&jobs, threads(options), one, |(cell, runs), outcome| {
        done.cells.insert(cell.key(), outcome);
        progress.advance(work(cell, *runs));
        if written.is_none_or(|last| last.elapsed() > INTERVAL) {
            save(done, folder)?;
            written = Some(Instant::now());
        }
        Ok(())
    })?;
    save(done, folder)
}

/// Times in turn, when nothing else runs any more.
fn take_turns(request: &Request, seed: u64, console: &Console) -> Result<Option<Saving>, Diagnostic> {
    let mut progress = Progress::new(console, "rounds of timing", Some(paper::saving_rounds(request)));
    paper::saving(request, seed, interrupted, |count| progress.advance(count))
        .map_err(|error| Diagnostic::new(format!("timing: {error}")))
}

/// Digest of all numbers but times.
fn digest(rows: &[Row]) -> String {
    let mut digest = EstimatesDigest::default();
    for row in rows.iter().filter(|row| row.metric != "seconds") {
        digest.push(&[row.value, row.low, row.high]);
    }
    digest.finish()
}

/// The command line that gives this run again.
fn command_line(args: &Reproduce, options: &Global) -> String {
    let mut line = format!("zerre reproduce {}", PAPER.name);
    let mut word = |word: String| {
        line.push(' ');
        line.push_str(&word);
    };
    args.table.iter().for_each(|table| word(format!("--table {table}")));
    if let Some(runs) = args.runs {
        word(format!("--runs {runs}"));
    }
    if !args.particles.is_empty() {
        let counts: Vec<_> = args.particles.iter().map(ToString::to_string).collect();
        word(format!("--particles {}", counts.join(",")));
    }
    if args.quick {
        word("--quick".to_owned());
    }
    word(format!("--seed {}", options.seed));
    line
}

/// The commit of zerre's repository that holds the settings of this program, where it is run inside it.
fn commit() -> Option<String> {
    let git = |words: &[&str]| {
        let output = Command::new("git").args(words).output().ok()?;
        output.status.success().then_some(output.stdout)
    };
    let held = git(&["show", &format!("HEAD:{SETTINGS}")])?;
    let head = git(&["rev-parse", "HEAD"])?;
    (held == SOURCE.as_bytes()).then(|| String::from_utf8_lossy(&head).trim().to_owned())
}
