//! `zerre otb`: trackers scored on annotated sequences.

use super::experiment::{Order, conduct};
use crate::Exit;
use crate::args::{self, Global};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::Destination;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use zerre_lab::number;
use zerre_lab::otb::{Answers, Line, Otb, Protocol, Row, lines};
use zerre_vision::frames::folder::Place;
use zerre_vision::sequence::{Sequence, origin, read_boxes};

const COMMAND: &str = "otb";

pub(super) fn run(args: &args::Otb, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let mut trackers = Vec::new();
    if args.tracker.is_empty() {
        trackers.push(super::tracker(None)?);
    }
    for name in &args.tracker {
        let kind = super::tracker(Some(name))?;
        if !trackers.iter().any(|known: &&zerre_vision::tracker::Kind| known.name == kind.name) {
            trackers.push(kind);
        }
    }
    let mut protocols: Vec<Protocol> = args.protocol.iter().map(|protocol| of(*protocol)).collect();
    if protocols.is_empty() {
        protocols.push(Protocol::OnePass);
    }
    protocols.sort_unstable();
    protocols.dedup();
    let sequences = sequences(&args.sequences)?;
    for sequence in &sequences {
        sequence.notes.iter().for_each(|note| console.info(format_args!("{}: {note}", sequence.name)));
    }
    let mut inputs = sequences.iter().map(|s| super::input(&s.source)).collect::<Result<Vec<_>, _>>()?;
    let mut others = Vec::new();
    for path in &args.results {
        let (answers, files) = answers(path, &sequences, console)?;
        others.push(answers);
        inputs.extend(files.iter().map(|file| super::input(file)).collect::<Result<Vec<_>, _>>()?);
    }
    let mut line = "zerre otb".to_owned();
    // Writing to a string cannot fail.
    args.sequences.iter().for_each(|path| {
        let _ = write!(line, " {}", path.display());
    });
    trackers.iter().for_each(|kind| {
        let _ = write!(line, " --tracker {}", kind.name);
    });
    protocols.iter().for_each(|protocol| {
        let _ = write!(line, " --protocol {}", protocol.name());
    });
    args.results.iter().for_each(|path| {
        let _ = write!(line, " --results {}", path.display());
    });
    let _ = write!(line, " --repeat {} --seed {}", args.repeat, options.seed);
    let of_sequence = |s: &Sequence| {
        json!({
            "name": s.name, "annotation": s.source.display().to_string(), "annotated": s.truth.len(),
            "pictures": s.pictures.places().len(),
        })
    };
    let config = json!({
        "sequences": sequences.iter().map(of_sequence).collect::<Vec<_>>(),
        "trackers": trackers.iter().map(|kind| kind.name).collect::<Vec<_>>(),
        "protocols": protocols,
        "repeat": args.repeat,
        "results": others.iter().map(|other| other.tracker.as_str()).collect::<Vec<_>>(),
    });
    let mut read: Vec<PathBuf> = inputs.iter().map(|input| PathBuf::from(&input.path)).collect();
    // Outputs must not go among the pictures either.
    for place in sequences.iter().filter_map(|sequence| sequence.pictures.places().first()) {
        if let Place::File(path) = place {
            read.push(path.clone());
        }
    }
    let first = args.sequences.first().map(PathBuf::as_path);
    let order = Order {
        command: COMMAND,
        line,
        config,
        explanation: "each tracker has the settings that `zerre catalog trackers` names it with",
        inputs,
        destination: Destination::of(options, COMMAND, first).reading(read.iter().map(PathBuf::as_path)),
        settings: None,
        document: serde_json::Map::new(),
    };
    let repeats = args.repeat.get() as usize;
    let otb = Otb { sequences, trackers, others, protocols, repeats, seed: options.seed };
    conduct(&otb, order, options, console, |finished, _| {
        for mishap in finished.mishaps.iter().filter(|mishap| mishap.count > 0) {
            console.warn(format_args!(
                "{}, {} times: {}; report.html says where",
                mishap.what, mishap.count, mishap.action
            ));
        }
        if !console.json() {
            console.result(&table(&finished.rows))?;
        }
        Ok(())
    })
}

fn of(protocol: args::Protocol) -> Protocol {
    match protocol {
        args::Protocol::OnePass => Protocol::OnePass,
        args::Protocol::Temporal => Protocol::Temporal,
        args::Protocol::Spatial => Protocol::Spatial,
    }
}

/// The sequences in the folders, or in folders within them.
pub(super) fn sequences(folders: &[PathBuf]) -> Result<Vec<Sequence>, Diagnostic> {
    let refused = |error: zerre_vision::Error| Diagnostic::new(error.to_string());
    let mut found: Vec<Sequence> = Vec::new();
    for folder in folders {
        let entries = std::fs::read_dir(folder).map_err(|error| Diagnostic::io("read", folder, &error))?;
        let mut within: Vec<PathBuf> = Vec::new();
        if !Sequence::is_in(folder) {
            within = entries.filter_map(|entry| entry.ok()).map(|entry| entry.path()).collect();
            within.retain(|path| Sequence::is_in(path));
            within.sort();
        }
        if within.is_empty() {
            within.push(folder.clone());
        }
        for path in within {
            found.extend(Sequence::open(&path).map_err(refused)?);
        }
    }
    let mut names: Vec<&str> = found.iter().map(|sequence| sequence.name.as_str()).collect();
    names.sort_unstable();
    if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        let what = format!("two sequences have the name {}", pair[0]);
        return Err(Diagnostic::new(what).help("give each of them once, or rename one folder"));
    }
    Ok(found)
}

/// What another program answered, and the files with it.
fn answers(
    path: &Path,
    sequences: &[Sequence],
    console: &Console,
) -> Result<(Answers, Vec<PathBuf>), Diagnostic> {
    let name =
        |part: Option<&std::ffi::OsStr>| part.unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let (tracker, files): (String, Vec<Option<PathBuf>>) = if path.is_dir() {
        let file = |sequence: &Sequence| {
            ["txt", "csv"]
                .iter()
                .map(|end| path.join(format!("{}.{end}", sequence.name)))
                .find(|file| file.is_file())
        };
        (name(path.file_name()), sequences.iter().map(file).collect())
    } else if sequences.len() == 1 {
        (name(path.file_stem()), vec![Some(path.to_owned())])
    } else {
        let what =
            format!("{}: a folder of results is needed where there are several sequences", path.display());
        return Err(Diagnostic::new(what).help("it holds SEQUENCE.txt or SEQUENCE.csv for each of them"));
    };
    let names = |sequences: &mut dyn Iterator<Item = &Sequence>| -> Vec<String> {
        sequences.map(|sequence| sequence.name.clone()).collect()
    };
    let missing = names(&mut sequences.iter().zip(&files).filter(|(_, file)| file.is_none()).map(|(s, _)| s));
    if missing.len() == sequences.len() {
        let what = format!("{} has no results of {}", path.display(), missing.join(", "));
        return Err(Diagnostic::new(what).help("files are named SEQUENCE.txt or SEQUENCE.csv"));
    }
    if !missing.is_empty() {
        console.warn(format_args!("{} has no results of {}", path.display(), missing.join(", ")));
    }
    let mut boxes = Vec::with_capacity(files.len());
    for (sequence, file) in sequences.iter().zip(&files) {
        let Some(file) = file else {
            boxes.push(None);
            continue;
        };
        let found = read_boxes(file, origin(&sequence.source)).map_err(|e| Diagnostic::new(e.to_string()))?;
        let expected = sequence.truth.len();
        if found.len() > expected {
            let what =
                format!("{} has {} boxes for {expected} annotated frames", file.display(), found.len());
            return Err(Diagnostic::new(what).help("one box a line, from the first annotated frame on"));
        }
        if found.len() < expected {
            let text =
                format!("{} has {} boxes for {expected} annotated frames", file.display(), found.len());
            console.warn(format_args!("{text}: the rest counts as missed"));
        }
        boxes.push(Some(found));
    }
    Ok((Answers { tracker, boxes }, files.into_iter().flatten().collect()))
}

/// One line per protocol, sequence and tracker.
fn table(rows: &[Row]) -> String {
    let lines = lines(rows);
    let sequence =
        |line: &Line| line.sequence.clone().unwrap_or_else(|| format!("mean of {}", line.sequences));
    let wide = |name: &dyn Fn(&Line) -> usize| lines.iter().map(name).max().unwrap_or(0).max(8);
    let of_tracker = wide(&|line| line.tracker.chars().count());
    let of_sequence = wide(&|line| sequence(line).chars().count());
    let mut text = format!(
        "{:<8}  {:<of_tracker$}  {:<of_sequence$}  {:>8}  {:>12}  {:>11}  {:>9}  {:>8}\n",
        "protocol", "tracker", "sequence", "rmse_px", "precision20", "success_auc", "lost_runs", "fps"
    );
    for line in &lines {
        let shown = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), number);
        let share = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<8}  {:<of_tracker$}  {:<of_sequence$}  {:>8}  {:>12}  {:>11}  {:>9}  {:>8}",
            line.protocol.name(),
            line.tracker,
            sequence(line),
            shown(line.rmse_px.map(|e| e.value)),
            share(line.precision20.map(|e| e.value)),
            share(line.success_auc.map(|e| e.value)),
            share(Some(line.lost_share)),
            shown(line.fps)
        );
    }
    text
}
