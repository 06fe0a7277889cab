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

    /// The complaint of the parser of arguments: a paragraph on what is wrong, then paragraphs that help.
    pub fn misused(text: &str) -> Diagnostic {
        let mut paragraphs = text.trim().split("\n\n").map(|paragraph| {
            paragraph.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
        });
        let what = paragraphs.next().unwrap_or_default();
        let what = what.strip_prefix("error: ").unwrap_or(&what);
        paragraphs.fold(Diagnostic::usage(what), Diagnostic::help)
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

/// Adds "did you mean" where known names are near, and what there is.
pub fn suggest(diagnostic: Diagnostic, name: &str, known: &[&str]) -> Diagnostic {
    let quoted: Vec<_> = likely(name, known).iter().map(|name| format!("`{name}`")).collect();
    let diagnostic = match quoted.split_last() {
        None => diagnostic,
        Some((only, [])) => diagnostic.help(format!("did you mean {only}?")),
        Some((last, others)) => diagnostic.help(format!("did you mean {} or {last}?", others.join(", "))),
    };
    /// More names are for `zerre catalog` or the recording itself to tell.
    const SHOWN: usize = 24;
    let more = if known.len() > SHOWN { ", ..." } else { "" };
    match &known[..known.len().min(SHOWN)] {
        [] => diagnostic,
        shown => diagnostic.help(format!("known: {}{more}", shown.join(", "))),
    }
}

/// The known names that `name` may stand for: the one that a slip of the keyboard turns into it, else those that
/// begin with it or are its beginning, else those that hold it or are held by it. Case is no difference.
fn likely<'a>(name: &str, known: &[&'a str]) -> Vec<&'a str> {
    /// More than so many are a list, not a guess.
    const MOST: usize = 4;
    /// So short a part is in everything.
    const LEAST: usize = 3;
    let name = name.to_lowercase();
    // One edit for every three letters: "sytematic" finds "systematic", "abc" does not find "imm".
    let allowed = 1.max(name.chars().count() / 3);
    let distance = |other: &str| strsim::damerau_levenshtein(&name, &other.to_lowercase());
    let slip = known.iter().copied().min_by_key(|other| distance(other));
    if let Some(other) = slip.filter(|other| distance(other) <= allowed) {
        return vec![other];
    }
    let matching = |holds: &dyn Fn(&str, &str) -> bool| -> Vec<&'a str> {
        let other_way = |a: &str, b: &str| b.len() >= LEAST && holds(a, b);
        let either = |other: &&str| {
            let other = other.to_lowercase();
            other_way(&other, &name) || other_way(&name, &other)
        };
        known.iter().copied().filter(either).collect()
    };
    let beginnings = matching(&|whole, part| whole.starts_with(part));
    let found =
        if beginnings.is_empty() { matching(&|whole, part| whole.contains(part)) } else { beginnings };
    if found.len() > MOST { Vec::new() } else { found }
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
    fn parts_of_names_find_the_whole() {
        let motions = ["random-walk", "coordinated-turn", "manoeuvre-turn", "wiener-turn", "singer"];
        let filters = ["kalman", "ekf", "ukf", "particle", "sir", "sis"];
        for (name, known, expected) in [
            ("radar", ["radar-cv", "turn", "bearings-only"].as_slice(), ["radar-cv"].as_slice()),
            ("turn", &motions, &motions[1..4]),
            ("Singer", &motions, &["singer"]),
            ("SINGER-MODEL", &motions, &["singer"]),
            ("particle-filter", &filters, &["particle"]),
            // A slip is likelier than a part.
            ("ekff", &filters, &["ekf"]),
            ("walk", &motions, &["random-walk"]),
            ("", &motions, &[]),
            ("k", &filters, &[]),
            ("abc", &filters, &[]),
            // What would name everything names nothing.
            ("abc", &["abc-1", "abc-2", "abc-3", "abc-4", "abc-5"], &[]),
        ] {
            assert_eq!(likely(name, known), expected, "{name}");
        }
        let text = known_name("motion", "turn", &motions).unwrap_err().to_string();
        assert!(
            text.contains("did you mean `coordinated-turn`, `manoeuvre-turn` or `wiener-turn`?"),
            "{text}"
        );
    }

    #[test]
    fn what_the_parser_says_becomes_an_error_with_help() {
        let text =
            "error: the following were not provided:\n  <INPUT>...\n\n  tip: so\n\nUsage: zerre track\n";
        let value = serde_json::to_value(Diagnostic::misused(text)).unwrap();
        assert_eq!(value["error"], "the following were not provided: <INPUT>...");
        assert_eq!(value["help"], serde_json::json!(["tip: so", "Usage: zerre track"]));
        assert_eq!(Diagnostic::misused(text).exit_code(), Exit::Usage);
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
