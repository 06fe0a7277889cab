//! A table of results, once for machines and once for readers.

use std::fmt::Write as _;

/// One entry of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A name.
    Text(String),
    /// A count.
    Count(u64),
    /// A number.
    Number(f64),
    /// Nothing is known here.
    Missing,
}

impl From<&str> for Entry {
    fn from(text: &str) -> Entry {
        Entry::Text(text.to_owned())
    }
}

impl From<String> for Entry {
    fn from(text: String) -> Entry {
        Entry::Text(text)
    }
}

impl From<f64> for Entry {
    fn from(value: f64) -> Entry {
        if value.is_finite() { Entry::Number(value) } else { Entry::Missing }
    }
}

impl From<Option<f64>> for Entry {
    fn from(value: Option<f64>) -> Entry {
        value.map_or(Entry::Missing, Entry::from)
    }
}

impl From<usize> for Entry {
    fn from(count: usize) -> Entry {
        Entry::Count(count as u64)
    }
}

/// A table with a name and a head.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Stem of its file, as `table-6.1`.
    pub name: String,
    /// What it shows, as a sentence.
    pub about: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Rows, as long as the head.
    pub rows: Vec<Vec<Entry>>,
}

impl Table {
    /// A table from its parts.
    pub fn new(name: &str, about: &str, head: &[&str], rows: Vec<Vec<Entry>>) -> Table {
        Table {
            name: name.to_owned(),
            about: about.to_owned(),
            head: head.iter().map(|name| (*name).to_owned()).collect(),
            rows,
        }
    }

    /// The table as CSV (RFC 4180): numbers so that they read back to the same bits, nothing where nothing is known.
    pub fn csv(&self) -> String {
        let mut out = String::new();
        let mut line = |fields: &mut dyn Iterator<Item = String>| {
            let fields: Vec<String> = fields.collect();
            out.push_str(&fields.join(","));
            out.push('\n');
        };
        line(&mut self.head.iter().map(|name| quoted(name)));
        for row in &self.rows {
            line(&mut row.iter().map(field));
        }
        out
    }
}

fn field(entry: &Entry) -> String {
    match entry {
        Entry::Text(text) => quoted(text),
        Entry::Count(count) => count.to_string(),
        Entry::Number(value) => format!("{value:?}"),
        Entry::Missing => String::new(),
    }
}

fn quoted(text: &str) -> String {
    if !text.contains([',', '"', '\n', '\r']) {
        return text.to_owned();
    }
    let mut out = String::from("\"");
    for c in text.chars() {
        // Writing to a string cannot fail.
        let _ = if c == '"' { out.write_str("\"\"") } else { out.write_char(c) };
    }
    out + "\""
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_csv() {
        let table = Table {
            head: vec!["name".into(), "a, b".into()],
            rows: vec![
                vec!["say \"x\"".into(), 0.1.into()],
                vec![Entry::Missing, 3_usize.into()],
                vec!["plain".into(), f64::NAN.into()],
            ],
            ..Table::default()
        };
        assert_eq!(table.csv(), "name,\"a, b\"\n\"say \"\"x\"\"\",0.1\n,3\nplain,\n");
    }
}
