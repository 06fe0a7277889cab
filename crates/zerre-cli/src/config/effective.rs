//! The configuration that a run really uses, with the reason for each value.

use super::source::{Source, dotted};
use crate::catalog::Entry;
use crate::diagnostic::{Diagnostic, suggest};
use serde::Serialize;
use serde_json::{Map, Value};
use std::fmt;

/// Why a value is what it is.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// The user said so; where.
    Given(String),
    /// Nobody said anything; why this value is a good guess.
    Default(String),
    /// Chosen for this recording among several; what decided.
    Chosen(String),
    /// Estimated from the recording; how.
    Learnt(String),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::Given(place) => write!(f, "given: {place}"),
            Reason::Default(why) => write!(f, "default: {why}"),
            Reason::Chosen(why) => write!(f, "chosen: {why}"),
            Reason::Learnt(how) => write!(f, "learnt: {how}"),
        }
    }
}

/// One value with its reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Keys from the top of the configuration.
    pub path: Vec<String>,
    /// The value.
    pub value: Value,
    /// Its reason.
    pub reason: Reason,
}

/// The values that a run uses, in the order in which they were settled: what `--explain` prints and what
/// `run.json` keeps as `config`.
#[derive(Clone, Debug, Default)]
pub struct Effective {
    source: Option<Source>,
    flags: Vec<(Vec<String>, String)>,
    rows: Vec<Row>,
}

impl Effective {
    /// Nothing settled yet; `source` is the configuration file that given values come from.
    pub fn new(source: Option<Source>) -> Effective {
        Effective { source, ..Effective::default() }
    }

    /// Remembers that an option of the command line (`"--filter"`) gives the value of a key.
    pub fn from_flag(&mut self, path: &[&str], flag: &str) {
        self.flags.push((owned(path), flag.to_owned()));
    }

    /// The given value, or `default` because `why`.
    pub fn settle<T: Clone + Serialize>(
        &mut self,
        path: &[&str],
        given: &Option<T>,
        default: T,
        why: &str,
    ) -> T {
        match given {
            Some(value) => {
                self.put(path, value, self.given(path));
                value.clone()
            }
            None => {
                self.put(path, &default, Reason::Default(why.to_owned()));
                default
            }
        }
    }

    /// The given value, where there is one: the others are not part of the configuration, or are put later.
    pub fn settle_given<T: Clone + Serialize>(&mut self, path: &[&str], given: &Option<T>) -> Option<T> {
        let value = given.as_ref()?;
        self.put(path, value, self.given(path));
        Some(value.clone())
    }

    /// Sets a value, in place of an earlier one of the same key.
    pub fn put(&mut self, path: &[&str], value: impl Serialize, reason: Reason) {
        // Numbers, words and lists of them always have a JSON form.
        let value = serde_json::to_value(value).unwrap_or(Value::Null);
        let row = Row { path: owned(path), value, reason };
        match self.rows.iter_mut().find(|old| old.path == row.path) {
            Some(old) => *old = row,
            None => self.rows.push(row),
        }
    }

    /// The values.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Refuses a `name` that is not in the `kind` of the catalogue, pointing at the line that gave it. `what` is
    /// the kind in the singular.
    ///
    /// # Errors
    /// The refusal.
    pub fn check_name(
        &self,
        path: &[&str],
        what: &str,
        name: &str,
        catalog: &[Entry],
        kind: &str,
    ) -> Result<(), Diagnostic> {
        let known = crate::catalog::names(catalog, kind);
        if known.contains(&name) {
            return Ok(());
        }
        let by_flag = self.flags.iter().any(|(given, _)| given == path);
        let text = format!("there is no {what} `{name}`");
        // A wrong option is wrong usage; a wrong file is a file like any other that cannot be used.
        let diagnostic =
            if by_flag { Diagnostic::usage(text) } else { self.at_value(path, Diagnostic::new(text)) };
        Err(suggest(diagnostic, name, &known).help(format!("`zerre catalog {kind}` says what each is")))
    }

    /// Points the complaint at the value of a key, where a file gives it.
    pub fn at_value(&self, path: &[&str], diagnostic: Diagnostic) -> Diagnostic {
        match self.source.as_ref().and_then(|source| source.locate(path)) {
            Some(place) => diagnostic.at(place),
            None => diagnostic,
        }
    }

    /// Points the complaint at a key itself, where a file gives it.
    pub fn at_key(&self, path: &[&str], diagnostic: Diagnostic) -> Diagnostic {
        match self.source.as_ref().and_then(|source| source.locate_key(path)) {
            Some(place) => diagnostic.at(place),
            None => diagnostic,
        }
    }

    fn given(&self, path: &[&str]) -> Reason {
        if let Some((_, flag)) = self.flags.iter().find(|(given, _)| given == path) {
            return Reason::Given(flag.clone());
        }
        // The short form `filter = "particle"` stands one level higher than its key `filter.name`.
        let line = |source: &Source| {
            let line = source.line(path).or_else(|| source.line(path.split_last()?.1))?;
            Some(format!("{}, line {line}", source.name()))
        };
        Reason::Given(self.source.as_ref().and_then(line).unwrap_or_else(|| "by the caller".to_owned()))
    }

    /// The values as one nested object, keys sorted: the same text for the same values on every machine.
    pub fn to_json(&self) -> Value {
        let mut top = Map::new();
        for row in &self.rows {
            insert(&mut top, &row.path, &row.value);
        }
        Value::Object(top)
    }
}

fn owned(path: &[&str]) -> Vec<String> {
    path.iter().map(|key| (*key).to_owned()).collect()
}

fn insert(table: &mut Map<String, Value>, path: &[String], value: &Value) {
    match path {
        [] => {}
        [key] => {
            table.insert(key.clone(), value.clone());
        }
        [key, rest @ ..] => {
            if let Value::Object(inner) =
                table.entry(key.clone()).or_insert_with(|| Value::Object(Map::new()))
            {
                insert(inner, rest, value);
            }
        }
    }
}

/// Lines of TOML, each with its reason as a comment.
impl fmt::Display for Effective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<_> =
            self.rows.iter().map(|row| format!("{} = {}", dotted(&row.path), row.value)).collect();
        let width = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0);
        for (line, row) in lines.iter().zip(&self.rows) {
            writeln!(f, "{line:width$}  # {}", row.reason)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Exit;

    #[test]
    fn every_value_carries_its_reason() {
        let source = Source::new("f.toml", "filter = \"particle\"\n[track]\nmax_gap_s = 60\n");
        let mut effective = Effective::new(Some(source));
        effective.from_flag(&["motion", "model"], "--motion");
        let name = effective.settle(&["filter", "name"], &Some("particle".to_owned()), "auto".to_owned(), "");
        let model = effective.settle_given(&["motion", "model"], &Some("singer"));
        let gap = effective.settle(&["track", "max_gap_s"], &Some(60.0), 300.0, "");
        let rejected = effective.settle(&["input", "max_rejected"], &None, 0.01, "one bad row in a hundred");
        assert_eq!((name.as_str(), model, gap, rejected), ("particle", Some("singer"), 60.0, 0.01));
        assert_eq!(effective.settle_given::<f64>(&["sensor", "a b", "range_sd_m"], &None), None);
        effective.put(
            &["sensor", "a b", "range_sd_m"],
            25.0,
            Reason::Learnt("maximum likelihood".to_owned()),
        );
        assert_eq!(
            effective.to_string(),
            "filter.name = \"particle\"        # given: f.toml, line 1\n\
             motion.model = \"singer\"         # given: --motion\n\
             track.max_gap_s = 60.0          # given: f.toml, line 3\n\
             input.max_rejected = 0.01       # default: one bad row in a hundred\n\
             sensor.\"a b\".range_sd_m = 25.0  # learnt: maximum likelihood\n"
        );
        toml::from_str::<toml::Table>(&effective.to_string()).unwrap();
        assert_eq!(
            effective.to_json().to_string(),
            r#"{"filter":{"name":"particle"},"input":{"max_rejected":0.01},"motion":{"model":"singer"},"#
                .to_owned()
                + r#""sensor":{"a b":{"range_sd_m":25.0}},"track":{"max_gap_s":60.0}}"#
        );
    }

    #[test]
    fn a_later_value_takes_the_place_of_the_earlier() {
        let mut effective = Effective::default();
        effective.put(&["filter", "name"], "auto", Reason::Default("x".to_owned()));
        effective.put(&["filter", "name"], "kalman", Reason::Chosen("linear".to_owned()));
        assert_eq!(effective.to_string(), "filter.name = \"kalman\"  # chosen: linear\n");
    }

    #[test]
    fn unknown_names_point_at_the_line_or_at_the_option() {
        let catalog = [Entry { kind: "filters", name: "particle", about: "", source: "" }];
        let mut effective = Effective::new(Some(Source::new("f.toml", "\nfilter = \"partcle\"\n")));
        let check = |effective: &Effective| {
            effective.check_name(&["filter", "name"], "filter", "partcle", &catalog, "filters").unwrap_err()
        };
        let refused = check(&effective);
        let text = refused.to_string();
        assert!(text.contains("f.toml:2:10") && text.contains("did you mean `particle`?"), "{text}");
        assert_eq!(refused.exit_code(), Exit::CouldNot);
        effective.from_flag(&["filter", "name"], "--filter");
        let refused = check(&effective);
        assert!(!refused.to_string().contains("f.toml"));
        assert_eq!(refused.exit_code(), Exit::Usage);
    }
}
