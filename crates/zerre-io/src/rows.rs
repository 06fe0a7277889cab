//! Rows of a table, one line at a time: checked, in SI units, counted.

use crate::columns::{Quantity, Role};
use crate::error::{Error, Result};
use crate::formats::{self, Format, Frame, Frames};
use crate::geo::{Geodetic, LocalFrame};
use crate::header::{Ignored, Layout, Purpose, shorten};
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::io::{BufRead, ErrorKind};
use std::sync::Arc;
use zerre::Time;

/// The longest line that is read, in bytes: what a stream without line ends can cost.
pub const MAX_LINE_BYTES: usize = 1 << 20;

/// How many rejections are kept word for word.
const KEPT_REJECTIONS: usize = 100;

/// How to read a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Options {
    /// Whose table it is.
    pub format: Format,
    /// From names in the header to names of [`COLUMNS`](crate::COLUMNS), or to [`IGNORE`](crate::IGNORE).
    pub columns: BTreeMap<String, String>,
    /// Sizes of bodies are measurements too; otherwise their columns are not read.
    pub sizes: bool,
    /// Positions with their heights; otherwise heights are read and left out.
    pub three_d: bool,
    /// Origin of the local frame of geographic positions; the first position by default.
    pub origin: Option<Geodetic>,
    /// The share of rows, from 0 to 1, that may be rejected.
    pub max_rejected: f64,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            format: Format::Auto,
            columns: BTreeMap::new(),
            sizes: false,
            three_d: false,
            origin: None,
            max_rejected: 0.01,
        }
    }
}

/// What became of the rows: `read` is the sum of `used`, `rejected` and `left_out`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Rows with any text, the header apart.
    pub read: u64,
    /// Rows that gave a measurement.
    pub used: u64,
    /// Rows with a bad value, by reason.
    pub rejected: BTreeMap<&'static str, u64>,
    /// Sound rows that give no new measurement, by reason.
    pub left_out: BTreeMap<&'static str, u64>,
    /// Empty cells in columns of measurements, in rows that are not rejected.
    pub missing: u64,
}

/// A row that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Rejection {
    /// Its line in the input, from 1.
    pub line: u64,
    /// The column with the bad value, where it is one.
    pub column: Option<String>,
    /// The value as written, shortened.
    pub value: String,
    /// Why it is bad; a key of [`Counts::rejected`].
    pub reason: &'static str,
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.column {
            Some(column) => write!(f, "line {}, {column} {:?}: {}", self.line, self.value, self.reason),
            None => write!(f, "line {}: {}", self.line, self.reason),
        }
    }
}

/// What a reader says when it is done.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// What the table was read as; never [`Format::Auto`].
    pub format: Format,
    /// What became of the rows.
    pub counts: Counts,
    /// The first 100 rejections.
    pub rejections: Vec<Rejection>,
    /// Columns that were not read.
    pub ignored: Vec<Ignored>,
    /// Where positions are on Earth, if that is known.
    pub frame: Option<LocalFrame>,
    /// Whether the rows say what is there, not what was measured.
    pub labels: bool,
    /// Whether the table itself says where its positions are on Earth: by latitudes, or by a known reference point.
    pub geographic: bool,
}

/// A sound row.
pub(crate) struct Row {
    pub line: u64,
    pub time: Time,
    pub id: Option<Arc<str>>,
    pub sensor: Option<Arc<str>>,
    pub scan: Option<u64>,
    /// x, y and z in the local frame; z is zero unless heights are asked for.
    pub position: Option<[f64; 3]>,
    values: [Option<f64>; Quantity::NUMBERS],
}

impl Row {
    /// The number in SI units and radians, if the row has it.
    pub fn value(&self, quantity: Quantity) -> Option<f64> {
        self.values[quantity as usize]
    }
}

/// Why a row is passed over.
enum Passed<'a> {
    /// It is sound, but no measurement.
    LeftOut(&'static str),
    /// It is bad: the cell at fault, its text and the reason.
    Bad { cell: Option<usize>, value: &'a str, reason: &'static str },
}

/// The sound rows of a table, and the books on all of them.
pub(crate) struct Rows<R> {
    lines: Lines<R>,
    cells: Cells,
    layout: Layout,
    options: Options,
    frame: Option<LocalFrame>,
    /// What all rows are of, where the file is one of several frames.
    of: Option<Frame>,
    names: HashMap<Box<str>, Arc<str>>,
    /// Time and position of the last report of each target, where repeats are dropped.
    last: HashMap<Option<Arc<str>>, (Time, [f64; 3])>,
    counts: Counts,
    rejections: Vec<Rejection>,
    done: bool,
}

impl<R: BufRead> Rows<R> {
    /// Reads the header.
    pub fn open(file: &str, input: R, options: &Options, purpose: Purpose) -> Result<Rows<R>> {
        let mut lines = Lines { input, file: file.to_owned(), line: 0, start: 0, end: 0, bytes: Vec::new() };
        let mut cells = Cells::new();
        if !lines.advance()? {
            return Err(Error::Empty { file: file.to_owned() });
        }
        let text = lines.text()?;
        // A header with an open quote is kept as one name: the message about missing columns shows it.
        let header = match cells.split(text) {
            Ok(()) => (0..cells.len()).map(|i| cells.get(i).to_owned()).collect(),
            Err(_) => vec![text.trim().to_owned()],
        };
        let layout = Layout::new(file, lines.line, header, options, purpose)?;
        let of = match layout.dialect.frames.filter(|_| layout.times.is_empty()) {
            Some(Frames::Name) => Some(Frame::of_file(file)?),
            _ => None,
        };
        let origin = options.origin.or(layout.dialect.origin);
        Ok(Rows {
            lines,
            cells,
            layout,
            options: options.clone(),
            frame: origin.map(LocalFrame::new),
            of,
            names: HashMap::new(),
            last: HashMap::new(),
            counts: Counts::default(),
            rejections: Vec::new(),
            done: false,
        })
    }

    /// The next sound row; after an error or the end, always `None`.
    pub fn next(&mut self) -> Result<Option<Row>> {
        if self.done {
            return Ok(None);
        }
        let row = self.next_sound();
        self.done = !matches!(row, Ok(Some(_)));
        row
    }

    fn next_sound(&mut self) -> Result<Option<Row>> {
        while self.lines.advance()? {
            let line = self.lines.line;
            let text = self.lines.text()?;
            self.counts.read += 1;
            let missing = self.counts.missing;
            let parsed = match self.cells.split(text) {
                Ok(()) => parse(
                    &self.layout,
                    &self.cells,
                    (&self.options, self.of.as_ref()),
                    &mut self.frame,
                    &mut self.names,
                    &mut self.counts.missing,
                ),
                Err(reason) => Err(Passed::Bad { cell: None, value: text.trim(), reason }),
            };
            match parsed {
                Ok(mut row) => {
                    row.line = line;
                    if self.repeats(&row) {
                        *self.counts.left_out.entry("repeated report").or_default() += 1;
                    } else {
                        return Ok(Some(row));
                    }
                }
                Err(Passed::LeftOut(reason)) => *self.counts.left_out.entry(reason).or_default() += 1,
                Err(Passed::Bad { cell, value, reason }) => {
                    self.counts.missing = missing;
                    *self.counts.rejected.entry(reason).or_default() += 1;
                    if self.rejections.len() < KEPT_REJECTIONS {
                        let column = cell.map(|i| shorten(&self.layout.header[i]));
                        self.rejections.push(Rejection { line, column, value: shorten(value), reason });
                    }
                }
            }
        }
        Ok(None)
    }

    /// Counts a row that was returned as used, or as one without a measurement.
    pub fn count(&mut self, used: bool) {
        if used {
            self.counts.used += 1;
        } else {
            *self.counts.left_out.entry("no measurement").or_default() += 1;
        }
    }

    fn repeats(&mut self, row: &Row) -> bool {
        let (true, Some(position)) = (self.layout.dialect.drop_repeats, row.position) else { return false };
        let report = (row.time, position);
        self.last.insert(row.id.clone(), report) == Some(report)
    }

    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    pub fn frame(&self) -> Option<&LocalFrame> {
        self.frame.as_ref()
    }

    pub fn ignored(&self) -> &[Ignored] {
        &self.layout.ignored
    }

    pub fn format(&self) -> Format {
        self.layout.dialect.format
    }

    /// The summary, or the refusal of too many rejections.
    pub fn finish(self) -> Result<Summary> {
        let rejected: u64 = self.counts.rejected.values().sum();
        let share = rejected as f64 / self.counts.read.max(1) as f64;
        match self.rejections.first() {
            Some(first) if share > self.options.max_rejected => Err(Error::TooManyRejected {
                file: self.lines.file,
                rejected,
                read: self.counts.read,
                max_rejected: self.options.max_rejected,
                first: first.to_string(),
            }),
            _ => Ok(Summary {
                format: self.layout.dialect.format,
                labels: self.layout.dialect.labels,
                geographic: self.layout.geographic() || self.layout.dialect.origin.is_some(),
                counts: self.counts,
                rejections: self.rejections,
                ignored: self.layout.ignored,
                frame: self.frame,
            }),
        }
    }
}

fn parse<'a>(
    layout: &Layout,
    cells: &'a Cells,
    (options, of): (&Options, Option<&Frame>),
    frame: &mut Option<LocalFrame>,
    names: &mut HashMap<Box<str>, Arc<str>>,
    missing: &mut u64,
) -> std::result::Result<Row, Passed<'a>> {
    if cells.len() != layout.header.len() {
        let reason = "another number of cells than the header";
        return Err(Passed::Bad { cell: None, value: "", reason });
    }
    if let Some((cell, text, reason)) = layout.leave_out
        && cells.get(cell) == text
    {
        return Err(Passed::LeftOut(reason));
    }
    let fault = |cell: usize, reason| Passed::Bad { cell: Some(cell), value: cells.get(cell), reason };

    let label = |cell: Option<usize>| cell.map(|i| cells.get(i)).filter(|text| !text.is_empty());
    let scan = match (layout.scan, label(layout.scan)) {
        (Some(cell), Some(text)) => Some(text.parse().map_err(|_| fault(cell, "not a whole number"))?),
        _ => of.map(|frame| frame.number),
    };
    let time = match layout.times.iter().find(|s| !cells.get(s.cell).is_empty()) {
        Some(slot) => {
            let text = cells.get(slot.cell);
            let time = match slot.column.quantity {
                // Why it is no time: plain decimals are refused for their size only.
                Quantity::Seconds => Time::parse_secs(text)
                    .map_err(|_| if decimal(text) { FAR_TIME } else { "not a time in decimal seconds" }),
                _ => calendar(text, layout.dialect.utc),
            };
            time.map_err(|reason| fault(slot.cell, reason))?
        }
        None if layout.times.is_empty() => {
            scan.and_then(formats::frame_time).ok_or_else(|| fault(layout.scan.unwrap_or(0), "no frame"))?
        }
        None => return Err(fault(layout.times.first().map_or(0, |s| s.cell), "no time")),
    };

    let mut values = [None; Quantity::NUMBERS];
    for slot in &layout.numbers {
        let (text, quantity) = (cells.get(slot.cell), slot.column.quantity);
        let code = layout.dialect.absent.iter().find(|(q, _)| *q == quantity).map(|(_, code)| *code);
        if text.is_empty() || code.is_some_and(|code| text.parse() == Ok(code)) {
            *missing += u64::from(quantity.role() == Role::Measurement);
        } else {
            let value = slot.column.number(text).map_err(|reason| fault(slot.cell, reason))?;
            values[quantity as usize] = Some(value);
        }
    }
    let position = position(layout, options, frame, &values).map_err(|reason| {
        let first =
            layout.numbers.iter().find(|s| matches!(s.column.quantity, Quantity::X | Quantity::Latitude));
        fault(first.map_or(0, |s| s.cell), reason)
    })?;
    let mut intern = |text: &str| match names.get(text) {
        Some(name) => Arc::clone(name),
        None => {
            let name: Arc<str> = Arc::from(text);
            names.insert(Box::from(text), Arc::clone(&name));
            name
        }
    };
    let id = match (label(layout.id), of) {
        (Some(id), Some(frame)) => Some(intern(&format!("{}/{id}", frame.name))),
        (id, _) => id.or(layout.dialect.id).map(&mut intern),
    };
    let sensor = label(layout.sensor).map(&mut intern);
    Ok(Row { line: 0, time, id, sensor, scan, position, values })
}

/// The position in the local frame. The first geographic one makes the frame.
fn position(
    layout: &Layout,
    options: &Options,
    frame: &mut Option<LocalFrame>,
    values: &[Option<f64>; Quantity::NUMBERS],
) -> std::result::Result<Option<[f64; 3]>, &'static str> {
    let of = |q: Quantity| values[q as usize];
    let height = |q: Quantity| if options.three_d { of(q) } else { Some(0.0) };
    let far = "too far from the origin of the local frame";
    if layout.geographic() {
        let (Some(lat_deg), Some(lon_deg), Some(alt_m)) =
            (of(Quantity::Latitude), of(Quantity::Longitude), height(Quantity::Altitude))
        else {
            return Ok(None);
        };
        let place = Geodetic { lat_deg, lon_deg, alt_m };
        let frame = frame.get_or_insert_with(|| LocalFrame::new(place));
        return place_in(frame, place, options.three_d).map(Some).ok_or(far);
    }
    let (Some(x), Some(y), Some(z)) = (of(Quantity::X), of(Quantity::Y), height(Quantity::Z)) else {
        return Ok(None);
    };
    match (layout.dialect.origin.map(LocalFrame::new), frame) {
        (Some(own), Some(frame)) if own.origin() != frame.origin() => {
            let place = if options.three_d { Some(own.geodetic([x, y, z])) } else { own.surface([x, y]) };
            place.and_then(|p| place_in(frame, p, options.three_d)).map(Some).ok_or(far)
        }
        _ => Ok(Some([x, y, z])),
    }
}

fn place_in(frame: &LocalFrame, place: Geodetic, three_d: bool) -> Option<[f64; 3]> {
    let local = if three_d {
        frame.sees(place).then(|| frame.local(place))
    } else {
        frame.east_north(place.lat_deg, place.lon_deg).map(|[e, n]| [e, n, 0.0])
    };
    local.filter(|p| p.iter().all(|v| v.is_finite()))
}

/// What 64 bits of nanoseconds reach.
const FAR_TIME: &str = "a time more than 9223372036 s (292 years) from the epoch; are these seconds?";

/// Whether `text` is a number in decimal digits.
fn decimal(text: &str) -> bool {
    let digits = text.strip_prefix(['-', '+']).unwrap_or(text);
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    digits.len() > 1 && whole.bytes().chain(fraction.bytes()).all(|b| b.is_ascii_digit())
}

/// Date and time of day to nanoseconds since 1970 UTC.
fn calendar(text: &str, utc: bool) -> std::result::Result<Time, &'static str> {
    use chrono::{DateTime, NaiveDateTime};
    let instant = match DateTime::parse_from_rfc3339(text) {
        Ok(t) => t.to_utc(),
        Err(_) => {
            let naive = NaiveDateTime::parse_from_str(text, "%Y-%m-%d %H:%M:%S%.f")
                .or_else(|_| NaiveDateTime::parse_from_str(text, "%Y-%m-%dT%H:%M:%S%.f"))
                .map_err(|_| "not a time in RFC 3339")?;
            if !utc {
                return Err("a time without offset from UTC; append Z");
            }
            naive.and_utc()
        }
    };
    instant.timestamp_nanos_opt().map(Time::from_nanos).ok_or("a time before 1677 or after 2262")
}

/// Lines with text, bounded in length, with their place in the input.
struct Lines<R> {
    input: R,
    file: String,
    /// Number of the current line, from 1.
    line: u64,
    /// Offset of the current line and of the next one.
    start: u64,
    end: u64,
    bytes: Vec<u8>,
}

impl<R: BufRead> Lines<R> {
    /// Goes to the next line that is not blank; `false` at the end.
    fn advance(&mut self) -> Result<bool> {
        loop {
            self.bytes.clear();
            self.line += 1;
            self.start = self.end;
            if !self.fill()? {
                return Ok(false);
            }
            if self.start == 0 {
                if self.bytes.starts_with(&[0xff, 0xfe]) || self.bytes.starts_with(&[0xfe, 0xff]) {
                    return Err(Error::Utf16 { file: self.file.clone() });
                }
                if self.bytes.starts_with("\u{feff}".as_bytes()) {
                    self.bytes.drain(..3);
                    self.start = 3;
                }
            }
            if !self.bytes.trim_ascii().is_empty() {
                return Ok(true);
            }
        }
    }

    /// Reads up to the line end, which becomes `\n`; `false` if there is nothing left.
    fn fill(&mut self) -> Result<bool> {
        loop {
            let chunk = match self.input.fill_buf() {
                Ok(chunk) => chunk,
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(source) => return Err(Error::Read { file: self.file.clone(), source }),
            };
            if chunk.is_empty() {
                self.bytes.push(b'\n');
                return Ok(self.end > self.start);
            }
            let newline = chunk.iter().position(|&b| b == b'\n');
            let used = newline.map_or(chunk.len(), |i| i + 1);
            self.bytes.extend_from_slice(&chunk[..newline.unwrap_or(chunk.len())]);
            self.input.consume(used);
            self.end += used as u64;
            if self.bytes.len() > MAX_LINE_BYTES {
                let (file, line) = (self.file.clone(), self.line);
                return Err(Error::LineTooLong { file, line, limit: MAX_LINE_BYTES });
            }
            if newline.is_some() {
                if self.bytes.last() == Some(&b'\r') {
                    self.bytes.pop();
                }
                self.bytes.push(b'\n');
                return Ok(true);
            }
        }
    }

    fn text(&self) -> Result<&str> {
        std::str::from_utf8(&self.bytes).map_err(|e| Error::NotUtf8 {
            file: self.file.clone(),
            line: self.line,
            offset: self.start + e.valid_up_to() as u64,
        })
    }
}

/// The cells of one line. A row is a line: a quote that is left open costs its row, not the rest of the file.
struct Cells {
    parser: csv_core::Reader,
    bytes: Vec<u8>,
    text: String,
    ends: Vec<usize>,
}

impl Cells {
    fn new() -> Cells {
        // `Reader::default()` has no table of states: it must be `new()`.
        Cells { parser: csv_core::Reader::new(), bytes: Vec::new(), text: String::new(), ends: Vec::new() }
    }

    /// Splits a line that ends in `\n`.
    fn split(&mut self, line: &str) -> std::result::Result<(), &'static str> {
        // Unquoting only shortens, and there are at most as many cells as commas and one.
        self.bytes.resize(line.len() + 1, 0);
        self.ends.resize(line.bytes().filter(|&b| b == b',').count() + 2, 0);
        self.parser.reset();
        let (result, read, written, ends) =
            self.parser.read_record(line.as_bytes(), &mut self.bytes, &mut self.ends);
        if result != csv_core::ReadRecordResult::Record || read != line.len() {
            return Err("a quote or a line end inside a cell");
        }
        self.ends.truncate(ends);
        self.text.clear();
        let text = std::str::from_utf8(&self.bytes[..written]);
        self.text.push_str(text.map_err(|_| "a cell that is not text")?);
        Ok(())
    }

    fn len(&self) -> usize {
        self.ends.len()
    }

    /// The cell without blanks around it; empty beyond the last one.
    fn get(&self, i: usize) -> &str {
        let Some(&end) = self.ends.get(i) else { return "" };
        let start = i.checked_sub(1).map_or(0, |before| self.ends[before]);
        self.text.get(start..end).unwrap_or("").trim()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calendar_times_are_exact() {
        let t = |text, utc| calendar(text, utc).map(Time::nanos);
        assert_eq!(t("2021-07-12T14:00:00.123456789Z", false), Ok(1_626_098_400_123_456_789));
        assert_eq!(t("2021-07-12T16:00:00+02:00", false), Ok(1_626_098_400_000_000_000));
        assert_eq!(t("2016-01-12 13:02:11.327", true), Ok(1_452_603_731_327_000_000));
        assert_eq!(t("2016-01-12 13:02:11.327", false), Err("a time without offset from UTC; append Z"));
        assert_eq!(t("1970-01-01T00:00:00.000000001Z", false), Ok(1));
        assert_eq!(t("0001-01-01T00:00:00Z", false), Err("a time before 1677 or after 2262"));
        assert!(t("2021-02-30T00:00:00Z", false).is_err());
    }

    #[test]
    fn cells_are_split_per_line() {
        let mut cells = Cells::new();
        cells.split("1, \"a,b\" ,\"say \"\"x\"\"\",,\n").unwrap();
        let all: Vec<_> = (0..cells.len()).map(|i| cells.get(i)).collect();
        // A quote after a blank is text, as everywhere in CSV.
        assert_eq!(all, ["1", "\"a", "b\"", "say \"x\"", "", ""]);
        assert!(cells.split("1,\"open\n").is_err());
        cells.split("é,2\n").unwrap();
        assert_eq!((cells.get(0), cells.get(1), cells.get(2)), ("é", "2", ""));
    }
}
