//! A configuration file with the places of its keys.

use crate::diagnostic::{Diagnostic, Place, suggest};
use serde::de::DeserializeOwned;
use std::io::Read;
use std::path::Path;
use toml::de::{DeTable, DeValue};

/// The text of a configuration, kept so that a later complaint can point at the line.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    name: String,
    text: String,
}

/// A value that is well formed and has no meaning: where it stands (`["sensor", "north", "range_sd_m"]`) and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Keys from the top of the file.
    pub path: Vec<String>,
    /// The complaint, as a sentence without its full stop.
    pub what: String,
}

impl Source {
    /// No configuration is larger; a recording given by mistake mostly is.
    const MAX_BYTES: u64 = 1 << 20;

    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, is larger than a mebibyte or is not UTF-8.
    pub fn read(path: &Path) -> Result<Source, Diagnostic> {
        let unreadable = |error| Diagnostic::io("read", path, &error);
        let mut bytes = Vec::new();
        let file = std::fs::File::open(path).map_err(unreadable)?;
        file.take(Source::MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        let name = path.display().to_string();
        if bytes.len() as u64 > Source::MAX_BYTES {
            return Err(Diagnostic::new(format!("{name} is larger than a mebibyte: it is no configuration"))
                .help("--config takes a TOML file; recordings stand without an option"));
        }
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Source::new(name, text)),
            Err(error) => {
                let line = 1 + error.as_bytes()[..error.utf8_error().valid_up_to()]
                    .iter()
                    .filter(|b| **b == b'\n')
                    .count();
                Err(Diagnostic::new(format!("{name}, line {line}: the text is not UTF-8"))
                    .help("save the file as UTF-8"))
            }
        }
    }

    /// A text that is already there; `name` stands for the file in diagnostics.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Source {
        Source { name: name.into(), text: text.into() }
    }

    /// The file as the user named it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The values of the file.
    ///
    /// # Errors
    /// Broken TOML, unknown keys and values of the wrong type, each with its place.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, Diagnostic> {
        toml::from_str(&self.text).map_err(|error| {
            let diagnostic = match unknown_name(error.message()) {
                Some((what, name, known)) => suggest(Diagnostic::new(what), name, &known),
                None => Diagnostic::new(plainly(error.message())),
            };
            match error.span() {
                Some(span) => diagnostic.at(Place::new(&self.name, &self.text, span)),
                None => diagnostic,
            }
        })
    }

    /// The complaint about a value, pointing at it.
    pub fn diagnose(&self, problem: &Problem) -> Diagnostic {
        let diagnostic = Diagnostic::new(format!("{}: {}", dotted(&problem.path), problem.what));
        match self.locate(&problem.path) {
            Some(place) => diagnostic.at(place),
            None => diagnostic,
        }
    }

    /// Where the value of a key stands, or the nearest value above it that does. A number leads into a list, from 0.
    pub fn locate<S: AsRef<str>>(&self, path: &[S]) -> Option<Place> {
        let document = DeTable::parse(&self.text).ok()?;
        let (first, rest) = path.split_first()?;
        let mut value = document.get_ref().get(first.as_ref())?;
        for key in rest {
            let inner = match value.get_ref() {
                DeValue::Table(table) => table.get(key.as_ref()),
                DeValue::Array(list) => key.as_ref().parse().ok().and_then(|at: usize| list.get(at)),
                _ => None,
            };
            match inner {
                Some(inner) => value = inner,
                None => break,
            }
        }
        Some(Place::new(&self.name, &self.text, value.span()))
    }

    /// Where a key itself stands: for complaints about its being there, not about its value.
    pub fn locate_key<S: AsRef<str>>(&self, path: &[S]) -> Option<Place> {
        let document = DeTable::parse(&self.text).ok()?;
        let (last, above) = path.split_last()?;
        let (key, _) = table_at(document.get_ref(), above)?.get_key_value(last.as_ref())?;
        Some(Place::new(&self.name, &self.text, key.span()))
    }

    /// Where the value of a key stands, if the file gives it.
    pub fn line<S: AsRef<str>>(&self, path: &[S]) -> Option<usize> {
        let document = DeTable::parse(&self.text).ok()?;
        let (last, above) = path.split_last()?;
        let value = table_at(document.get_ref(), above)?.get(last.as_ref())?;
        Some(Place::new(&self.name, &self.text, value.span()).line)
    }
}

/// The table that these keys lead to.
fn table_at<'t, 'i, S: AsRef<str>>(top: &'t DeTable<'i>, path: &[S]) -> Option<&'t DeTable<'i>> {
    path.iter().try_fold(top, |table, key| match table.get(key.as_ref())?.get_ref() {
        DeValue::Table(inner) => Some(inner),
        _ => None,
    })
}

/// A path as TOML writes it: `sensor."north tower".range_sd_m`.
pub(super) fn dotted<S: AsRef<str>>(path: &[S]) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let part = |key: &S| match key.as_ref() {
        key if !key.is_empty() && key.chars().all(bare) => key.to_owned(),
        key => format!("{key:?}"),
    };
    path.iter().map(part).collect::<Vec<_>>().join(".")
}

/// A message without the names of Rust's types.
fn plainly(message: &str) -> String {
    let message = message.trim().replace('\n', ": ");
    message
        .replace("expected f64", "expected a number")
        .replace("expected u32", "expected a whole number of at least 0")
}

/// Reads serde's "unknown field `x`, expected one of `a`, `b`" (and the same of variants): its only carrier of the
/// names that would have been right. A message of another form is shown as it is.
fn unknown_name(message: &str) -> Option<(String, &str, Vec<&str>)> {
    let message = message.trim();
    let what = if message.starts_with("unknown field `") {
        "key"
    } else if message.starts_with("unknown variant `") {
        "value"
    } else {
        return None;
    };
    let mut quoted = message.split('`').skip(1).step_by(2);
    let name = quoted.next()?;
    Some((format!("there is no {what} `{name}` here"), name, quoted.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_found_where_they_stand() {
        let source = Source::new("f", "a = 1\n[b]\nc = -2\nd = { e = 3 }\n[b.\"x y\"]\nz = 4\n");
        let place = source.locate(&["b", "c"]).unwrap();
        assert_eq!((place.line, place.column, place.width), (3, 5, 2));
        assert_eq!(source.line(&["b", "d", "e"]), Some(4));
        assert_eq!(source.line(&["b", "x y", "z"]), Some(6));
        assert_eq!(source.line(&["b", "absent"]), None);
        assert_eq!(source.locate(&["b", "absent"]).unwrap().line, 2);
        assert_eq!(source.locate(&["absent"]), None);
        let key = |path: &[&str]| source.locate_key(path).map(|at| (at.line, at.column, at.width));
        assert_eq!(key(&["b", "c"]), Some((3, 1, 1)));
        assert_eq!(key(&["b", "x y"]), Some((5, 4, 5)));
        assert_eq!(key(&["b", "d", "e"]), Some((4, 7, 1)));
        assert_eq!(key(&["b", "absent"]), None);
        let list = Source::new("f", "[[a]]\nx = 1\n[[a]]\nx = [2,\n3]\n");
        assert_eq!(list.locate(&["a", "1", "x", "1"]).unwrap().line, 5);
        assert_eq!(list.locate(&["a", "1", "absent"]).unwrap().line, 3);
        assert_eq!(dotted(&["b", "x y", "z"]), "b.\"x y\".z");
    }

    #[test]
    fn what_editors_do_to_line_ends_moves_no_place() {
        let source = Source::new("f", "\u{feff}a = 1\r\n[b]\r\nc = x\r\n");
        let text = source.parse::<toml::Table>().unwrap_err().to_string();
        assert!(text.contains("f:3:5"), "{text}");
        assert!(Source::new("f", "\u{feff}a = 1\r\n").parse::<toml::Table>().is_ok());
    }

    #[test]
    fn files_that_are_no_configuration_are_refused() {
        let path = std::env::temp_dir().join(format!("zerre-source-{}", std::process::id()));
        std::fs::write(&path, b"a = 1\nb = \xff\n").unwrap();
        let text = Source::read(&path).unwrap_err().to_string();
        assert!(text.contains("line 2") && text.contains("not UTF-8"), "{text}");
        std::fs::write(&path, vec![b'#'; Source::MAX_BYTES as usize]).unwrap();
        assert!(Source::read(&path).is_ok());
        std::fs::write(&path, vec![b'#'; Source::MAX_BYTES as usize + 1]).unwrap();
        assert!(Source::read(&path).unwrap_err().to_string().contains("larger than a mebibyte"));
        std::fs::remove_file(&path).unwrap();
        assert!(Source::read(&path).unwrap_err().to_string().contains("no such file"));
    }

    #[test]
    fn the_names_inside_serde_messages_are_read() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Two {
            #[serde(default)]
            alpha: u8,
            #[serde(default)]
            beta: u8,
        }
        let two: Two = Source::new("f", "alpha = 1\nbeta = 2").parse().unwrap();
        assert_eq!((two.alpha, two.beta), (1, 2));
        let text = Source::new("f", "\nalhpa = 1").parse::<Two>().unwrap_err().to_string();
        assert!(text.contains("there is no key `alhpa` here") && text.contains("f:2:1"), "{text}");
        assert!(text.contains("did you mean `alpha`?") && text.contains("known: alpha, beta"), "{text}");
    }
}
