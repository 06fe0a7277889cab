//! What commands that compute experiments share: work that goes on where it stopped, a folder, a record, a
//! page.

use super::{simd, threads};
use crate::Exit;
use crate::args::Global;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{
    Destination, EstimatesDigest, Folder, Input, Progress, Record, State, interrupted, listen, text_digest,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Write};
use std::process::Command;
use std::time::{Duration, Instant};
use zerre_lab::report::study::render;
use zerre_lab::study;
use zerre_lab::study::experiment::{Experiment, Finished, SettingsFile};

/// What is done, for `--resume`.
const PROGRESS: &str = "progress.json";
/// How often it is written.
const INTERVAL: Duration = Duration::from_secs(5);

/// What is to be known of an experiment beside the experiment.
pub(super) struct Order<'a> {
    /// The subcommand.
    pub command: &'static str,
    /// The command line that gives this run again.
    pub line: String,
    /// The whole effective configuration.
    pub config: Value,
    /// What `--explain` says below it.
    pub explanation: &'a str,
    /// Files that were read.
    pub inputs: Vec<Input>,
    /// Where results go.
    pub destination: Destination,
    /// Settings that were compiled in.
    pub settings: Option<SettingsFile>,
    /// What the document of `--json` says beside rows, digest and state.
    pub document: Map<String, Value>,
}

/// What is done so far.
#[derive(Serialize, Deserialize)]
struct Done<O> {
    config_digest: String,
    /// By the key of the cell.
    cells: BTreeMap<String, O>,
}

/// Computes `experiment` and writes all that it gives; `more` writes what is not a table of text.
pub(super) fn conduct<E: Experiment>(
    experiment: &E,
    order: Order<'_>,
    options: &Global,
    console: &Console,
    more: impl FnOnce(&Finished<E::Row>, &mut Folder) -> Result<(), Diagnostic>,
) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    // The level never changes results; asking for one that is not there is refused as everywhere.
    simd(options)?;
    let mut record = Record::new(order.command, options.seed, order.config);
    record.input = order.inputs;
    if options.explain {
        let text =
            serde_json::to_string_pretty(&record.config).map_err(|e| Diagnostic::new(e.to_string()))?;
        console.info(format_args!("{text}\n{}", order.explanation));
    }
    listen()?;
    let (mut folder, mut done) =
        open::<E>(&order.destination, order.command, options, &record.config_digest)?;

    compute(experiment, &mut done, &mut folder, options, console)?;
    let cells = experiment.cells();
    let mut outcomes = BTreeMap::new();
    for cell in &cells {
        if let Some(outcome) = done.cells.remove(&experiment.key(cell)) {
            outcomes.insert(cell.clone(), outcome);
        }
    }
    let mut complete = outcomes.len() == cells.len();
    let timing = if complete && experiment.rounds() > 0 {
        let timing = take_turns(experiment, console)?;
        complete = timing.is_some();
        timing
    } else {
        None
    };

    let mut finished =
        experiment.finish(&outcomes, timing.as_ref()).map_err(|error| Diagnostic::new(error.to_string()))?;
    let mut digest = EstimatesDigest::default();
    digest.push(&finished.estimates);
    let digest = digest.finish();
    for table in &finished.tables {
        folder.write(&format!("{}.csv", table.name), |file| file.write_all(table.csv().as_bytes()))?;
    }
    for (name, bytes) in &finished.files {
        folder.write(name, |file| file.write_all(bytes))?;
    }
    more(&finished, &mut folder)?;
    finished.page.command = order.line;
    finished.page.digest.clone_from(&digest);
    if let Some(settings) = order.settings {
        let commit = commit(&settings).unwrap_or_else(|| "unknown".to_owned());
        let facts =
            [("Commit of the settings", commit), ("SHA-256 of the settings", text_digest(settings.text))];
        finished.page.facts.extend(facts.map(|(name, value)| (name.to_owned(), value)));
    }
    folder.write("report.html", |file| file.write_all(render(&finished.page).as_bytes()))?;
    for mishap in finished.mishaps.iter().filter(|mishap| mishap.count > 0) {
        record.outcomes_of(mishap.what, mishap.action, mishap.count as u64);
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
        let mut document = order.document;
        document.insert("seed".to_owned(), json!(options.seed));
        document.insert("rows".to_owned(), json!(finished.rows));
        document.insert("estimates_digest".to_owned(), json!(digest));
        document.insert("state".to_owned(), json!(record.state));
        console.document(&document)?;
    }
    console.info(format_args!(
        "{} tables in {:.1} s: {}",
        finished.tables.len(),
        record.seconds,
        path.join("report.html").display()
    ));
    Ok(if complete { Exit::Done } else { Exit::CouldNot })
}

/// A fresh folder, or the one of an earlier run with what that run has done.
fn open<E: Experiment>(
    destination: &Destination,
    command: &str,
    options: &Global,
    config_digest: &str,
) -> Result<(Folder, Done<E::Outcome>), Diagnostic> {
    let fresh = Done { config_digest: config_digest.to_owned(), cells: BTreeMap::new() };
    if !options.resume {
        return Ok((Folder::open(destination, command)?, fresh));
    }
    let folder = Folder::reopen(destination, command)?;
    let path = folder.path().join(PROGRESS);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok((folder, fresh)),
        Err(error) => return Err(Diagnostic::io("read", &path, &error)),
    };
    let begin_anew = "leave --resume out to begin anew";
    let done: Done<E::Outcome> = serde_json::from_slice(&text).map_err(|error| {
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
fn compute<E: Experiment>(
    experiment: &E,
    done: &mut Done<E::Outcome>,
    folder: &mut Folder,
    options: &Global,
    console: &Console,
) -> Result<(), Diagnostic> {
    let mut jobs = experiment.cells();
    jobs.retain(|cell| !done.cells.contains_key(&experiment.key(cell)));
    jobs.sort_by_key(|cell| std::cmp::Reverse(experiment.cost(cell)));
    let total: u64 = jobs.iter().map(|cell| experiment.cost(cell)).sum();
    let mut progress = Progress::new(console, E::UNIT, Some(total));
    let mut written: Option<Instant> = None;
    let save = |done: &Done<E::Outcome>, folder: &mut Folder| {
        folder.write(PROGRESS, |file| serde_json::to_writer(file, done).map_err(std::io::Error::from))
    };
    let one = |cell: &E::Cell| {
        experiment
            .work(cell, &interrupted)
            .map_err(|error| Diagnostic::new(format!("{}: {error}", experiment.key(cell))))
    };
    study::run(&jobs, threads(options), one, |cell, outcome| {
        done.cells.insert(experiment.key(cell), outcome);
        progress.advance(experiment.cost(cell));
        if written.is_none_or(|last| last.elapsed() > INTERVAL) {
            save(done, folder)?;
            written = Some(Instant::now());
        }
        Ok(())
    })?;
    save(done, folder)
}

/// Times in turn, when nothing else runs any more.
fn take_turns<E: Experiment>(experiment: &E, console: &Console) -> Result<Option<E::Timing>, Diagnostic> {
    let mut progress = Progress::new(console, "rounds of timing", Some(experiment.rounds()));
    experiment
        .time(&interrupted, &mut || progress.advance(1))
        .map_err(|error| Diagnostic::new(format!("timing: {error}")))
}

/// The commit of zerre's repository that holds the settings of this program, where it is run inside it.
fn commit(settings: &SettingsFile) -> Option<String> {
    let git = |words: &[&str]| {
        let output = Command::new("git").args(words).output().ok()?;
        output.status.success().then_some(output.stdout)
    };
    let held = git(&["show", &format!("HEAD:{}", settings.path)])?;
    let head = git(&["rev-parse", "HEAD"])?;
    (held == settings.text.as_bytes()).then(|| String::from_utf8_lossy(&head).trim().to_owned())
}
