//! `zerre study`: filters compared over a grid of worlds and settings.

use super::experiment::{Order, conduct};
use crate::Exit;
use crate::args::{Global, Study};
use crate::config::{Problem, Source};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::Destination;
use serde_json::json;
use zerre_io::{Values, write_results};
use zerre_lab::scenario::Invalid;
use zerre_lab::study::comparison::RESULTS;
use zerre_lab::study::spec::Spec;
use zerre_lab::study::table::{Entry, Table};

const COMMAND: &str = "study";

pub(super) fn run(args: &Study, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let path = args.file.as_path();
    let source = Source::read(path)?;
    let mut spec: Spec = source.parse()?;
    if let Some(runs) = args.runs {
        spec.runs = runs.get();
    }
    let diagnose = |Invalid { path, what }| source.diagnose(&Problem { path, what });
    let comparison = spec.comparison(options.seed).map_err(diagnose)?;
    let mut line = format!("zerre study {}", path.display());
    if let Some(runs) = args.runs {
        line += &format!(" --runs {runs}");
    }
    let order = Order {
        command: COMMAND,
        line: format!("{line} --seed {}", options.seed),
        config: json!({ "study": spec }),
        explanation: "what is absent is as `zerre catalog worlds` and `zerre catalog contenders` have it",
        inputs: vec![super::input(path)?],
        destination: Destination::of(options, COMMAND, Some(path)).reading([path]),
        settings: None,
        document: [
            ("study".to_owned(), path.display().to_string().into()),
            ("runs".to_owned(), spec.runs.into()),
        ]
        .into_iter()
        .collect(),
    };
    conduct(&comparison, order, options, console, |finished, folder| {
        let Some(table) = finished.tables.iter().find(|table| table.name == RESULTS) else { return Ok(()) };
        folder.write(&format!("{RESULTS}.parquet"), |file| write_results(file, &columns(table)))
    })
}

/// A table in columns of one kind each: text where any entry is, else numbers where any is, else counts.
fn columns(table: &Table) -> Vec<(String, Values)> {
    let column = |at: usize| table.rows.iter().map(move |row| row.get(at).unwrap_or(&Entry::Missing));
    let values = |at: usize| {
        if column(at).any(|entry| matches!(entry, Entry::Text(_))) {
            let text = |entry: &Entry| match entry {
                Entry::Text(text) => Some(text.clone()),
                _ => None,
            };
            Values::Text(column(at).map(text).collect())
        } else if column(at).any(|entry| matches!(entry, Entry::Count(_))) {
            let count = |entry: &Entry| match entry {
                Entry::Count(count) => i64::try_from(*count).ok(),
                _ => None,
            };
            Values::Count(column(at).map(count).collect())
        } else {
            let number = |entry: &Entry| match entry {
                Entry::Number(number) => Some(*number),
                _ => None,
            };
            Values::Number(column(at).map(number).collect())
        }
    };
    table.head.iter().enumerate().map(|(at, name)| (name.clone(), values(at))).collect()
}
