//! Plots from tables: row by row, or a whole recording in order of time.

use crate::columns::Quantity;
use crate::error::{Error, Result};
use crate::formats::Format;
use crate::geo::LocalFrame;
use crate::header::{Ignored, Purpose};
use crate::rows::{Counts, Options, Row, Rows, Summary};
use std::collections::{HashMap, VecDeque};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use zerre::Time;
use zerre::track::{Plot, Reading};

/// Plots in the order of the file, as soon as their line is complete. A row gives one plot for each independent
/// reading: the position, then range and bearing, then range rate, then size; they share their time and
/// [`line`](Plot::line).
///
/// The iterator ends after its first error. Rows with bad values are counted and skipped; whether there were too
/// many is said by [`finish`](TableReader::finish).
pub struct TableReader<R> {
    rows: Rows<R>,
    three_d: bool,
    waiting: VecDeque<Plot>,
}

impl<R: BufRead> TableReader<R> {
    /// Reads the header; `file` is the name for messages.
    ///
    /// # Errors
    /// Whatever makes this no table of measurements.
    pub fn new(file: &str, input: R, options: &Options) -> Result<TableReader<R>> {
        let rows = Rows::open(file, input, options, Purpose::Measurements)?;
        Ok(TableReader { rows, three_d: options.three_d, waiting: VecDeque::new() })
    }

    /// What the table is read as; never [`Format::Auto`].
    pub fn format(&self) -> Format {
        self.rows.format()
    }

    /// Columns that are not read.
    pub fn ignored(&self) -> &[Ignored] {
        self.rows.ignored()
    }

    /// Where positions are on Earth; of geographic positions once the first was read.
    pub fn frame(&self) -> Option<&LocalFrame> {
        self.rows.frame()
    }

    /// What became of the rows so far.
    pub fn counts(&self) -> &Counts {
        self.rows.counts()
    }

    /// Closes the books on the rows read so far.
    ///
    /// # Errors
    /// [`Error::TooManyRejected`] if more than the share [`Options::max_rejected`] was rejected.
    pub fn finish(self) -> Result<Summary> {
        self.rows.finish()
    }
}

impl<R: BufRead> Iterator for TableReader<R> {
    type Item = Result<Plot>;

    fn next(&mut self) -> Option<Result<Plot>> {
        while self.waiting.is_empty() {
            let row = match self.rows.next().transpose()? {
                Ok(row) => row,
                Err(error) => return Some(Err(error)),
            };
            let plot = |reading| Plot {
                time: row.time,
                id: row.id.clone(),
                sensor: row.sensor.clone(),
                scan: row.scan,
                line: row.line,
                reading,
            };
            self.waiting.extend(readings(&row, self.three_d).into_iter().flatten().map(plot));
            self.rows.count(!self.waiting.is_empty());
        }
        self.waiting.pop_front().map(Ok)
    }
}

/// The independent readings of a row. An elevation belongs to the reading of its range even in two dimensions:
/// a slant range without it would be taken for one in the plane. In three dimensions a range and a bearing whose
/// elevation is missing are two readings, which hold for any height.
fn readings(row: &Row, three_d: bool) -> [Option<Reading>; 5] {
    let of = |q| row.value(q);
    let position = row
        .position
        .map(|[x, y, z]| if three_d { Reading::Position3([x, y, z]) } else { Reading::Position2([x, y]) });
    let (range, bearing) = match (of(Quantity::Range), of(Quantity::Bearing), of(Quantity::Elevation)) {
        (Some(r), Some(b), Some(e)) => (Some(Reading::RangeBearingElevation([r, b, e])), None),
        (Some(r), Some(b), None) if !three_d => (Some(Reading::RangeBearing([r, b])), None),
        (r, b, _) => (r.map(Reading::Range), b.map(Reading::Bearing)),
    };
    let size = of(Quantity::Length).zip(of(Quantity::Width)).zip(of(Quantity::Orientation));
    let size = size.map(|((length, width), orientation)| Reading::Size([length, width, orientation]));
    [position, range, bearing, of(Quantity::RangeRate).map(Reading::RangeRate), size]
}

/// A whole recording in order of time; plots of one time keep the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The plots.
    pub plots: Vec<Plot>,
    /// Rows that were earlier than a row before them.
    pub out_of_order: u64,
    /// Rows of the same target, sensor and time as a row before them.
    pub repeated: u64,
    /// What the reader says.
    pub summary: Summary,
}

impl Recording {
    /// Reads all of `input`; `file` is the name for messages. Any bytes give a recording or an error.
    ///
    /// # Errors
    /// Those of [`TableReader::new`], of its rows, and of [`TableReader::finish`].
    pub fn read(file: &str, input: impl BufRead, options: &Options) -> Result<Recording> {
        let mut reader = TableReader::new(file, input, options)?;
        let mut plots: Vec<Plot> = Vec::new();
        let (mut out_of_order, mut latest, mut line) = (0, None::<Time>, 0);
        for plot in &mut reader {
            let plot = plot?;
            if plot.line != line {
                line = plot.line;
                out_of_order += u64::from(latest.is_some_and(|t| plot.time < t));
                latest = latest.max(Some(plot.time));
            }
            plots.push(plot);
        }
        plots.sort_by_key(|p| p.time);
        let repeated = repeated(&plots);
        Ok(Recording { plots, out_of_order, repeated, summary: reader.finish()? })
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// [`Error::Read`] if it cannot be opened, and those of [`Recording::read`].
    pub fn open(path: &Path, options: &Options) -> Result<Recording> {
        let file = path.display().to_string();
        match File::open(path) {
            Ok(input) => Recording::read(&file, BufReader::new(input), options),
            Err(source) => Err(Error::Read { file, source }),
        }
    }
}

/// Rows of the same target, sensor and time as an earlier one, in plots that are in order of time.
fn repeated(plots: &[Plot]) -> u64 {
    let mut last = HashMap::new();
    let mut count = 0;
    for p in plots {
        let now = (p.time, p.line);
        let before = last.insert((p.id.as_deref(), p.sensor.as_deref()), now);
        count += u64::from(before.is_some_and(|(time, line)| time == p.time && line != p.line));
    }
    count
}
