//! Tables, and what devices and pose estimators say in one.

use crate::diagnostic::Diagnostic;
use std::collections::BTreeMap;
use std::path::Path;
use zerre::Time;
use zerre_vision::rgbd::Reading;

/// When something was said.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum When {
    Time(Time),
    /// Number or name of a frame.
    Frame(String),
}

/// A row of a joint file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct JointRow {
    pub when: When,
    pub joint: String,
    pub source: String,
    pub reading: Reading,
}

/// Rows, and the complaints about those that were left out.
#[derive(Default)]
pub(super) struct Joints {
    pub rows: Vec<JointRow>,
    pub rejected: Vec<String>,
    /// Rows that say that nothing was found.
    pub missing: usize,
}

/// Where a reading is from, unless a column says.
pub(super) const DEVICE: &str = "device";
/// Share of bad rows beyond which the file is no joint file.
const MOST_REJECTED: f64 = 0.5;

/// Cells of a row by the name of their column; nothing of an empty one.
pub(super) type Cell<'a> = dyn Fn(&str) -> Option<String> + 'a;

/// A table with a header, row by row.
pub(super) struct Table<'a> {
    path: &'a Path,
    columns: BTreeMap<String, usize>,
    reader: csv::Reader<std::fs::File>,
}

impl<'a> Table<'a> {
    pub(super) fn open(path: &'a Path) -> Result<Table<'a>, Diagnostic> {
        let file = std::fs::File::open(path).map_err(|error| Diagnostic::io("read", path, &error))?;
        let mut reader = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(file);
        let header = reader.headers().map_err(|error| refused(path, &error))?;
        let columns = header.iter().enumerate().map(|(i, name)| (name.to_lowercase(), i)).collect();
        Ok(Table { path, columns, reader })
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.columns.contains_key(name)
    }

    /// Refuses a table without these columns.
    pub(super) fn needs(&self, names: &[&str]) -> Result<(), Diagnostic> {
        match names.iter().find(|name| !self.has(name)) {
            None => Ok(()),
            Some(missing) => {
                let has: Vec<&str> = self.columns.keys().map(String::as_str).collect();
                let what = format!("{}: there is no column `{missing}`", self.path.display());
                Err(Diagnostic::new(what).help(format!("its columns are {}", has.join(", "))))
            }
        }
    }

    /// Every row with its line, as something that gives cells by their column's name.
    pub(super) fn rows(mut self, mut each: impl FnMut(u64, &Cell<'_>)) -> Result<(), Diagnostic> {
        let mut record = csv::StringRecord::new();
        loop {
            match self.reader.read_record(&mut record) {
                Ok(true) => {}
                Ok(false) => return Ok(()),
                Err(error) => return Err(refused(self.path, &error)),
            }
            let line = record.position().map_or(0, csv::Position::line);
            let cell = |name: &str| {
                let text = record.get(*self.columns.get(name)?)?;
                (!text.is_empty()).then(|| text.to_owned())
            };
            each(line, &cell);
        }
    }
}

fn refused(path: &Path, error: &csv::Error) -> Diagnostic {
    Diagnostic::new(format!("{}: it is no table: {error}", path.display()))
}

/// A number of a cell that must be finite.
pub(super) fn number(cell: &Cell<'_>, name: &str) -> Result<f64, String> {
    let text = cell(name).ok_or_else(|| format!("column {name} is empty"))?;
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("column {name} has `{text}`: a finite number is needed")),
    }
}

/// What devices and pose estimators say.
pub(super) fn joints(path: &Path) -> Result<Joints, Diagnostic> {
    let table = Table::open(path)?;
    table.needs(&["joint", "x", "y"])?;
    let timed = table.has("time_s");
    if !timed {
        table.needs(&["frame"]).map_err(|error| error.help("or `time_s`, seconds"))?;
    }
    let mut joints = Joints::default();
    let row = |cell: &Cell<'_>| -> Result<JointRow, String> {
        let when = if timed {
            let text = cell("time_s").ok_or("column time_s is empty")?;
            let time = Time::parse_secs(&text);
            When::Time(time.map_err(|error| format!("column time_s has `{text}`: {error}"))?)
        } else {
            When::Frame(cell("frame").ok_or("column frame is empty")?)
        };
        let depth_mm = cell("z").map(|_| number(cell, "z")).transpose()?;
        let confidence = cell("confidence").map_or(Ok(1.0), |_| number(cell, "confidence"))?;
        if !(0.0..=1.0).contains(&confidence) {
            return Err(format!("column confidence has {confidence}: it must be from 0 to 1"));
        }
        Ok(JointRow {
            when,
            joint: cell("joint").ok_or("column joint is empty")?,
            source: cell("source").unwrap_or_else(|| DEVICE.to_owned()),
            reading: Reading { at: [number(cell, "x")?, number(cell, "y")?], depth_mm, confidence },
        })
    };
    table.rows(|line, cell| match row(cell) {
        // Estimators write a row without a place where they find nothing.
        _ if cell("x").is_none() && cell("y").is_none() => joints.missing += 1,
        Ok(row) => joints.rows.push(row),
        Err(problem) => joints.rejected.push(format!("{}, line {line}: {problem}", path.display())),
    })?;
    let Joints { rows, rejected, missing } = &joints;
    let all = rows.len() + rejected.len() + missing;
    if rejected.len() as f64 > MOST_REJECTED * all as f64 {
        let first = rejected.first().cloned().unwrap_or_default();
        let what = format!("{} of {all} rows of {} are bad", rejected.len(), path.display());
        return Err(Diagnostic::new(what).help(format!("the first: {first}")));
    }
    Ok(joints)
}
