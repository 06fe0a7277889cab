//! What went wrong, where, and how to mend it.

use crate::Exit;
use serde::Serialize;
use std::fmt;
use std::ops::Range;
use std::path::Path;

/// An error as people read it; with `--json` the same as a JSON object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnostic {
    #[serde(rename = "error")]
    what: String,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    place: Option<Box<Place>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    help: Vec<String>,
    #[serde(skip)]
    usage: bool,
}

/// A place in a text file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Place {
    /// The file as the user named it.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The line itself, without control characters.
    #[serde(skip)]
    pub excerpt: String,
    /// How many characters of it are meant, at least 1.
    #[serde(skip)]
    pub width: usize,
}

impl Place {
    /// The place of the bytes `span` in `text`. A span over several lines keeps its first; one outside the text
    /// or inside a character is moved to the nearest place that exists.
    pub fn new(file: &str, text: &str, span: Range<usize>) -> Place {
        let start = boundary(text, span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
        let rest = &text[line_start..];
        let line = rest.split('\n').next().unwrap_or(rest).trim_end_matches('\r');
        let end = boundary(text, span.end).clamp(start, (line_start + line.len()).max(start));
        Place {
            file: file.to_owned(),
            line: text[..line_start].matches('\n').count() + 1,
            column: text[line_start..start].chars().count() + 1,
            excerpt: line.chars().map(|c| if c.is_control() { ' ' } else { c }).collect(),
            width: text[start..end].chars().count().max(1),
        }
    }
}

/// The last character boundary that is not behind `at`.
fn boundary(text: &str, at: usize) -> usize {
    (0..=at.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

impl Diagnostic {
    /// A refusal; `what` is a sentence without its full stop. Names in it may come from a stranger's file, so
    /// characters that would command the terminal are replaced.
    pub fn new(what: impl Into<String>) -> Diagnostic {
        let harmless = |c: char| if c.is_control() && c != '\n' { char::REPLACEMENT_CHARACTER } else { c };
        let what = what.into().chars().map(harmless).collect();
        Diagnostic { what, place: None, help: Vec::new(), usage: false }
    }

    /// A command line that has no meaning: exit code 2.
    pub fn usage(what: impl Into<String>) -> Diagnostic {
        Diagnostic { usage: true, ..Diagnostic::new(what) }
    }

    /// A refusal by the system: "cannot read flights.csv: no such file or directory". `action` is the verb.
    pub fn io(action: &str, path: &Path, error: &std::io::Error) -> Diagnostic {
        let text = error.to_string();
        let reason = text.split(" (os error").next().unwrap_or_default();
        let mut letters = reason.chars();
        let reason: String = letters.next().into_iter().flat_map(char::to_lowercase).chain(letters).collect();
        Diagnostic::new(format!("cannot {action} {}: {reason}", path.display()))
    }

    /// Says where.
    #[must_use]
    pub fn at(mut self, place: Place) -> Diagnostic {
        self.place = Some(Box::new(place));
        self
    }

    /// Says how to mend it; may be called more than once.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.help.push(help.into());
        self
    }

    /// 2 for wrong usage, else 1.
    pub fn exit_code(&self) -> Exit {
        if self.usage { Exit::Usage } else { Exit::CouldNot }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.what)?;
        if let Some(place) = &self.place {
            let number = place.line.to_string();
            let margin = " ".repeat(number.len());
            write!(f, "\n{margin}--> {place}\n{margin} |\n{number} | {}", place.excerpt)?;
            write!(f, "\n{margin} | {}{}", " ".repeat(place.column - 1), "^".repeat(place.width))?;
        }
        self.help.iter().try_for_each(|help| write!(f, "\nhelp: {help}"))
    }
}

impl std::error::Error for Diagnostic {}

/// Refuses a name that is not in `known`, with the likely one: "there is no filter `partcle`".
/// `kind` is what the name stands for, in the singular.
///
/// # Errors
/// The refusal.
pub fn known_name(kind: &str, name: &str, known: &[&str]) -> Result<(), Diagnostic> {
    if known.contains(&name) {
        return Ok(());
    }
    let diagnostic = Diagnostic::new(format!("there is no {kind} `{name}`"));
    Err(suggest(diagnostic, name, known))
}

/// Adds "did you mean" where a known name is near, and what there is.
pub fn suggest(diagnostic: Diagnostic, name: &str, known: &[&str]) -> Diagnostic {
    // One edit for every three letters: "sytematic" finds "systematic", "abc" does not find "imm".
    let near = |other: &&str| strsim::damerau_levenshtein(name, other) <= 1.max(name.chars().count() / 3);
    let nearest =
        known.iter().filter(|other| near(other)).min_by_key(|other| strsim::damerau_levenshtein(name, other));
    let diagnostic = match nearest {
        Some(nearest) => diagnostic.help(format!("did you mean `{nearest}`?")),
        None => diagnostic,
    };
    if known.is_empty() { diagnostic } else { diagnostic.help(format!("known: {}", known.join(", "))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_counts_lines_and_characters_from_one() {
        let text = "a = 1\r\nµé = -3\r\n";
        let at = text.find("-3").unwrap();
        let place = Place::new("f.toml", text, at..at + 2);
        assert_eq!((place.line, place.column, place.width), (2, 6, 2));
        assert_eq!(place.excerpt, "µé = -3");
        let shown = Diagnostic::new("no").at(place).help("so").to_string();
        assert_eq!(shown, "error: no\n --> f.toml:2:6\n  |\n2 | µé = -3\n  |      ^^\nhelp: so");
    }

    #[test]
    fn a_place_exists_for_every_span() {
        for text in ["", "\n", "é\n\u{1b}[2Jx\n", "no end"] {
            for start in 0..10 {
                for end in 0..10 {
                    let place = Place::new("f", text, start..end);
                    assert!(place.line >= 1 && place.column >= 1 && place.width >= 1);
                    assert!(!place.excerpt.contains('\u{1b}'));
                }
            }
        }
    }

    #[test]
    fn near_names_are_offered_and_far_ones_are_not() {
        let known = ["systematic", "stratified", "imm"];
        let text = known_name("resampling", "sytematic", &known).unwrap_err().to_string();
        assert!(text.contains("did you mean `systematic`?"), "{text}");
        let text = known_name("resampling", "abc", &known).unwrap_err().to_string();
        assert!(
            !text.contains("did you mean") && text.contains("known: systematic, stratified, imm"),
            "{text}"
        );
        assert_eq!(known_name("resampling", "imm", &known), Ok(()));
    }

    #[test]
    fn a_diagnostic_cannot_command_the_terminal() {
        let text = known_name("sensor", "\u{1b}[2Jx", &["radar"]).unwrap_err().to_string();
        assert!(text.contains("`\u{fffd}[2Jx`"), "{text:?}");
    }

    #[test]
    fn system_errors_read_as_sentences() {
        let error = std::fs::read("no/such/file").unwrap_err();
        let text = Diagnostic::io("read", Path::new("no/such/file"), &error).to_string();
        assert_eq!(text, "error: cannot read no/such/file: no such file or directory");
    }
}
