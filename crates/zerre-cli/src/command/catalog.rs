//! `zerre catalog`: what there is to choose from.

use crate::Exit;
use crate::catalog::{Kinds, all, by_kind};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use std::fmt::Write;

pub(super) fn run(kind: Option<&str>, console: &Console) -> Result<Exit, Diagnostic> {
    let entries = all();
    let mut kinds = by_kind(&entries);
    if let Some(kind) = kind {
        if !kinds.contains_key(kind) {
            let known: Vec<_> = kinds.keys().copied().collect();
            return Err(super::unknown("list", kind, &known));
        }
        kinds.retain(|other, _| *other == kind);
    }
    if console.json() {
        console.document(&kinds)?
    } else {
        console.result(&table(&kinds))?
    };
    Ok(Exit::Done)
}

/// One line per entry, names and descriptions in columns.
fn table(kinds: &Kinds<'_>) -> String {
    let entries = || kinds.values().flatten();
    let width = entries().map(|entry| entry.name.chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for (kind, entries) in kinds {
        let gap = if text.is_empty() { "" } else { "\n" };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{gap}{kind}");
        for entry in entries {
            let source = if entry.source.is_empty() { String::new() } else { format!(" [{}]", entry.source) };
            let _ = writeln!(text, "  {:width$}  {}{source}", entry.name, entry.about);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::Entry;

    #[test]
    fn columns_line_up_over_all_kinds() {
        let entry = |kind, name, source| Entry { kind, name, about: "about", source };
        let entries = [entry("b", "long-name", "Kalman 1960"), entry("a", "x", "")];
        let text = "a\n  x          about\n\nb\n  long-name  about [Kalman 1960]\n";
        assert_eq!(table(&by_kind(&entries)), text);
    }
}
