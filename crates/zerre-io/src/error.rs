//! What can go wrong with files, and how to mend it.

use crate::formats::Format;
use std::path::PathBuf;

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A refusal that ends the reading or writing of a file. A bad row is not one: it is a
/// [`Rejection`](crate::Rejection), counted, until there are too many.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused to read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The input.
        file: String,
        /// The refusal.
        source: std::io::Error,
    },
    /// The operating system refused to write (no permission, no space, no such folder).
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file that was to appear.
        path: PathBuf,
        /// The refusal.
        source: std::io::Error,
    },
    /// Nothing but blank lines.
    #[error("{file}: the file is empty; a table starts with a header such as time_s,id,x_m,y_m")]
    Empty {
        /// The input.
        file: String,
    },
    /// The first row is data.
    #[error(
        "{file}, line {line}: there is no header, {value:?} looks like data; put the names of the columns \
         first, such as time_s,id,x_m,y_m"
    )]
    NoHeader {
        /// The input.
        file: String,
        /// Line of the row, from 1.
        line: u64,
        /// The first cell that is a number.
        value: String,
    },
    /// Bytes that are not UTF-8.
    #[error("{file}, line {line}: byte {offset} of the file is not UTF-8 text; save the table as UTF-8")]
    NotUtf8 {
        /// The input.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Offset of the first bad byte in the file, from 0.
        offset: u64,
    },
    /// A byte-order mark of UTF-16.
    #[error("{file}: the file starts with a UTF-16 byte-order mark; save the table as UTF-8")]
    Utf16 {
        /// The input.
        file: String,
    },
    /// A line that would not end.
    #[error("{file}, line {line}: the line is longer than {limit} bytes; this is no table of measurements")]
    LineTooLong {
        /// The input.
        file: String,
        /// Line, from 1.
        line: u64,
        /// The limit in bytes.
        limit: usize,
    },
    /// No column gives the time.
    #[error("{file}: no column gives the time (time_s in seconds or time in RFC 3339); {found}")]
    NoTime {
        /// The input.
        file: String,
        /// What the header holds instead, as a clause.
        found: String,
    },
    /// A frame without a number.
    #[error(
        "{file}: the rows of this table are of one frame, whose number should end the name of the file, such as \
         radar_0400_07.csv"
    )]
    NoFrame {
        /// The input.
        file: String,
    },
    /// No column gives a measurement, or a position where positions are needed.
    #[error("{file}: no column gives a {needed}; {found}")]
    NoMeasurement {
        /// The input.
        file: String,
        /// What was looked for ("measurement such as x_m and y_m").
        needed: &'static str,
        /// What the header holds instead, as a clause.
        found: String,
    },
    /// A known quantity in a unit that is not known.
    #[error(
        "{file}: column {column:?} has an unknown unit; known are {known} (convert it, or map it to \"ignore\")"
    )]
    UnknownUnit {
        /// The input.
        file: String,
        /// The header's name.
        column: String,
        /// The columns that exist for this quantity, joined by commas.
        known: String,
    },
    /// A known name in other letters: names are told apart by case, so nothing is guessed.
    #[error(
        "{file}: column {column:?} is not known, {meant:?} is; did you mean it? (write it so, or map the column \
         to it or to \"ignore\")"
    )]
    WrongCase {
        /// The input.
        file: String,
        /// The header's name.
        column: String,
        /// The known name.
        meant: &'static str,
    },
    /// Two columns for one quantity.
    #[error("{file}: columns {first:?} and {second:?} both give {quantity}; map one of them to \"ignore\"")]
    DuplicateColumn {
        /// The input.
        file: String,
        /// The first column.
        first: String,
        /// The second column.
        second: String,
        /// What both give.
        quantity: &'static str,
    },
    /// A column that means nothing without another.
    #[error("{file}: column {column:?} needs {needs} beside it")]
    Unpaired {
        /// The input.
        file: String,
        /// The lonely column.
        column: String,
        /// What is missing.
        needs: &'static str,
    },
    /// Positions in three dimensions asked of a table without heights.
    #[error("{file}: positions in three dimensions need a column z_m or alt_m")]
    NoHeight {
        /// The input.
        file: String,
    },
    /// A mapping to a column that does not exist.
    #[error("{file}: column {column:?} is mapped to {target:?}, which is no known column{hint}")]
    BadMapping {
        /// The input.
        file: String,
        /// The name in the header.
        column: String,
        /// The name asked for.
        target: String,
        /// A sentence with the nearest known name, or nothing.
        hint: String,
    },
    /// A mapping of a column that the file does not have.
    #[error("{file}: the mapped column {column:?} is not in the header; {found}")]
    NotInHeader {
        /// The input.
        file: String,
        /// The name in the mapping.
        column: String,
        /// What the header holds instead, as a clause.
        found: String,
    },
    /// A format that does not exist.
    #[error("there is no format {name:?}; there are {known}")]
    UnknownFormat {
        /// The name asked for.
        name: String,
        /// The names that exist, joined by commas.
        known: String,
    },
    /// A table that is not of the format asked for.
    #[error("{file}: this is no {format} table, the column {missing:?} is missing; try --format auto")]
    FormatMismatch {
        /// The input.
        file: String,
        /// The format asked for.
        format: Format,
        /// The first column that such a table must have.
        missing: &'static str,
    },
    /// Another origin asked of measurements that are relative to their sensor.
    #[error(
        "{file}: ranges and bearings are relative to their sensor; they cannot be moved to another origin"
    )]
    PolarOrigin {
        /// The input.
        file: String,
    },
    /// A place that is not on Earth.
    #[error(
        "latitude {lat_deg}, longitude {lon_deg}, altitude {alt_m} m is no place: degrees within 90 and 180"
    )]
    BadPlace {
        /// Latitude in degrees.
        lat_deg: f64,
        /// Longitude in degrees.
        lon_deg: f64,
        /// Altitude in metres.
        alt_m: f64,
    },
    /// More bad rows than the caller allows.
    #[error(
        "{file}: {rejected} of {read} rows are rejected, more than the share {max_rejected} allowed by \
         max_rejected; first: {first}"
    )]
    TooManyRejected {
        /// The input.
        file: String,
        /// Rows rejected.
        rejected: u64,
        /// Rows read.
        read: u64,
        /// The share allowed.
        max_rejected: f64,
        /// The first rejection, as a sentence.
        first: String,
    },
    /// A track row that does not fit its table.
    #[error("track {id:?} at {time} s: {problem}")]
    BadTrackRow {
        /// Identity of the track.
        id: String,
        /// Time of the row.
        time: zerre::Time,
        /// What is wrong, as a sentence.
        problem: String,
    },
    /// Tracks that have no place on Earth.
    #[error("tracks without components x and y in metres cannot be written as GeoJSON")]
    NoPosition,
}
