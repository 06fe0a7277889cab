//! `zerre compare`: estimates against truth.

use crate::Exit;
use crate::args::{Compare, Global};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, Folder, Hashing, Input, Record};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::Instant;
use zerre::Span;
use zerre_io::{Options, Trajectories};
use zerre_lab::metric::METRICS;
use zerre_lab::number;
use zerre_lab::score::{Point, Rules, Score, Way, Ways, score};

const COMMAND: &str = "compare";
const SINGULAR: &str = "the covariances are not positive definite: no nees, no coverage";

pub(super) fn run(args: &Compare, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    let known: Vec<_> = METRICS.iter().map(|metric| metric.name).collect();
    if let Some(name) = args.metric.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(super::unknown("metric", name, &known));
    }
    for (option, value) in [("--cutoff-m", args.cutoff_m), ("--max-gap-s", args.max_gap_s)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Diagnostic::usage(format!("{option} is {value}; a number above zero is needed")));
        }
    }
    if args.metric.iter().any(|name| name == "nis") {
        return Err(Diagnostic::new("nis compares innovations with their covariance, which no table holds")
            .help("`zerre track` prints it; choose another metric here"));
    }
    let (estimates, of_estimates) = read(&args.estimates, &Options::default())?;
    let origin = estimates.summary.frame.as_ref().map(|frame| frame.origin());
    let (truth, of_truth) = read(&args.truth, &Options { origin, ..Options::default() })?;
    if estimates.summary.frame.is_some() != truth.summary.frame.is_some() {
        let what = "one table has positions on Earth and the other in metres: they have no common frame";
        return Err(Diagnostic::new(what).help("`zerre track --truth` scores in the frame of the recording"));
    }
    let rules =
        Rules { cutoff_m: args.cutoff_m, max_gap: Span::from_secs(args.max_gap_s), ..Rules::default() };
    let refused = |error: zerre_lab::Error| Diagnostic::new(error.to_string());
    let found = score(&ways(&estimates), &ways(&truth), &rules).map_err(refused)?;
    if found.scores.is_empty() {
        let help = "are times of one epoch, ids the same, and is --max-gap-s or --cutoff-m too small?";
        return Err(Diagnostic::new("no estimate meets any truth").help(help));
    }
    let told = |name: &str| found.scores.iter().any(|score| score.metric == name);
    if let Some(name) = args.metric.iter().find(|name| !told(name)) {
        let why = if told("crps") { SINGULAR.to_owned() } else { no_covariance(&args.estimates) };
        return Err(Diagnostic::new(why).help(format!("leave {name} out")));
    }
    let wanted =
        |score: &&Score| args.metric.is_empty() || args.metric.iter().any(|name| name == score.metric);
    let scores: Vec<&Score> = found.scores.iter().filter(wanted).collect();
    if args.metric.is_empty() && !told("crps") {
        console.info(no_covariance(&args.estimates));
    } else if args.metric.is_empty() && !told("nees") {
        console.warn(SINGULAR);
    }

    let config = json!({
        "metric": args.metric, "cutoff_m": args.cutoff_m, "order": rules.order, "max_gap_s": args.max_gap_s,
    });
    let destination = Destination::of(options, COMMAND, Some(&args.estimates))
        .reading([args.estimates.as_path(), args.truth.as_path()]);
    let folder = Folder::open(&destination, COMMAND)?;
    let mut record = Record::new(COMMAND, options.seed, config);
    record.input = vec![of_estimates, of_truth];
    for table in [&estimates, &truth] {
        let counts = &table.summary.counts;
        record.counts.read += counts.read;
        record.counts.used += counts.used;
        record.counts.missing += counts.missing;
        for (reason, count) in &counts.rejected {
            *record.counts.rejected.entry((*reason).to_owned()).or_default() += count;
        }
    }
    record.seconds = since.elapsed().as_secs_f64();
    folder.finish(&record)?;

    if console.json() {
        let keys: Map<String, Value> =
            scores.iter().map(|score| (score.key.to_owned(), json!(score.value))).collect();
        console.document(&json!({
            "association": found.association, "instants": found.instants, "scores": keys,
            "offsets": found.offsets, "without_offsets": found.centred,
        }))?;
    } else {
        console.info(found.sentence());
        if let Some(text) = found.against_truth(false).filter(|_| args.metric.is_empty()) {
            console.info(text);
        }
        console.result(&table(&scores))?;
    }
    Ok(Exit::Done)
}

fn no_covariance(file: &Path) -> String {
    let columns = "var_x_m2, cov_xy_m2 and var_y_m2";
    format!("{} has no columns {columns}: crps, nees and coverage need them", file.display())
}

/// Reads a table, and digests the bytes along.
fn read(path: &Path, options: &Options) -> Result<(Trajectories, Input), Diagnostic> {
    let name = path.display().to_string();
    let unreadable = |error| Diagnostic::io("read", path, &error);
    let mut input = BufReader::new(Hashing::new(File::open(path).map_err(unreadable)?));
    let table =
        Trajectories::read(&name, &mut input, options).map_err(|error| Diagnostic::new(error.to_string()))?;
    Ok((table, input.into_inner().finish(&name).map_err(unreadable)?))
}

/// What is scored of a table.
pub(super) fn ways(table: &Trajectories) -> Ways {
    let point = |p: &zerre_io::TrajectoryPoint| Point {
        time: p.time,
        position: [p.position[0], p.position[1]],
        covariance: p.covariance,
    };
    let way = |points: &[zerre_io::TrajectoryPoint]| Way::new(points.iter().map(point).collect());
    table.by_id.iter().map(|(id, trajectory)| (id.clone(), way(trajectory.points()))).collect()
}

/// One line per score.
fn table(scores: &[&Score]) -> String {
    let mut text = String::new();
    for Score { key, value, unit, note, .. } in scores {
        let line = format!("{key:<20} {:>12} {unit:<2} {note}", number(*value));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}
