//! Tracks as tables: CSV and Parquet here, GeoJSON beside.

mod geojson;

use crate::error::{Error, Result};
use parquet::basic::{ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use std::fmt;
use std::io::{self, Write};
use std::sync::Arc;
use zerre::Time;

/// A unit as powers of metre, radian and second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Power of the metre.
    pub metre: i8,
    /// Power of the radian.
    pub radian: i8,
    /// Power of the second.
    pub second: i8,
}

impl Unit {
    /// A pure number.
    pub const ONE: Unit = Unit { metre: 0, radian: 0, second: 0 };
    /// Metre.
    pub const M: Unit = Unit { metre: 1, ..Unit::ONE };
    /// Metre per second.
    pub const MPS: Unit = Unit { second: -1, ..Unit::M };
    /// Metre per second squared.
    pub const MPS2: Unit = Unit { second: -2, ..Unit::M };
    /// Radian.
    pub const RAD: Unit = Unit { radian: 1, ..Unit::ONE };
    /// Radian per second.
    pub const RADPS: Unit = Unit { second: -1, ..Unit::RAD };

    fn times(self, other: Unit) -> Unit {
        Unit {
            metre: self.metre + other.metre,
            radian: self.radian + other.radian,
            second: self.second + other.second,
        }
    }
}

/// The ending of a column's name: `m`, `m2`, `mps`, `m2ps2`, `m_rad`, `radps`; empty for a pure number.
impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let power = |f: &mut fmt::Formatter<'_>, symbol: &str, power: i8| match power {
            0 => Ok(()),
            1 => f.write_str(symbol),
            n => write!(f, "{symbol}{n}"),
        };
        power(f, "m", self.metre)?;
        if self.metre != 0 && self.radian != 0 {
            f.write_str("_")?; // `mrad` would be a thousandth of a radian
        }
        power(f, "rad", self.radian)?;
        if self.second < 0 {
            f.write_str("p")?;
        }
        power(f, "s", self.second.abs())
    }
}

/// A component of the state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Component {
    /// Its name, such as `x` or `vx`.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
}

impl Component {
    /// A component.
    pub fn new(name: &str, unit: Unit) -> Component {
        Component { name: name.to_owned(), unit }
    }
}

/// The estimate of one target at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackRow {
    /// Identity of the track.
    pub id: Arc<str>,
    /// When.
    pub time: Time,
    /// The mean, one number per component.
    pub mean: Vec<f64>,
    /// The covariance, row by row.
    pub covariance: Vec<f64>,
    /// Logarithm of the evidence of the measurement of this instant; `None` without one.
    pub log_evidence: Option<f64>,
    /// What became of the update, in a word.
    pub outcome: String,
    /// How the target most probably moves, where the filter tells ways to move apart.
    pub mode: Option<LikelyMode>,
}

/// The most probable of several ways to move.
#[derive(Clone, Debug, PartialEq)]
pub struct LikelyMode {
    /// Its name.
    pub name: String,
    /// Its probability.
    pub probability: f64,
}

/// Estimates with the names and units of their components. Every row fits: n means, n x n covariances, all finite.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackTable {
    components: Vec<Component>,
    modes: bool,
    rows: Vec<TrackRow>,
}

impl TrackTable {
    /// An empty table.
    pub fn new(components: Vec<Component>) -> TrackTable {
        TrackTable { components, modes: false, rows: Vec::new() }
    }

    /// An empty table with columns for the most probable mode.
    pub fn with_modes(components: Vec<Component>) -> TrackTable {
        TrackTable { modes: true, ..TrackTable::new(components) }
    }

    /// The components of the state.
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// The rows, in the order in which they were pushed.
    pub fn rows(&self) -> &[TrackRow] {
        &self.rows
    }

    /// Appends a row.
    ///
    /// # Errors
    /// [`Error::BadTrackRow`] if it does not fit the columns or holds a number that is not finite.
    pub fn push(&mut self, row: TrackRow) -> Result<()> {
        check(&self.components, self.modes, &row)?;
        self.rows.push(row);
        Ok(())
    }

    /// Writes CSV: `id`, `time_s` (exact decimal text), means, the upper triangle of the covariance, the
    /// log-evidence (empty without a measurement), the outcome and, in a table that has them, `mode` and
    /// `mode_probability`.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_csv(&self, out: impl Write) -> io::Result<()> {
        let mut csv = TrackCsv::of(out, &self.components, self.modes)?;
        for row in &self.rows {
            csv.put(row)?;
        }
        csv.out.flush()
    }

    /// Writes Parquet with the columns of the CSV, but `time_ns` as 64-bit integers; numbers are doubles, texts are
    /// UTF-8.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_parquet(&self, out: impl Write + Send) -> io::Result<()> {
        self.parquet(out).map_err(refused)
    }

    fn parquet(&self, out: impl Write + Send) -> ParquetResult<()> {
        /// Rows per group: what is held in memory twice.
        const GROUP: usize = 1 << 16;
        let numbers = number_columns(&self.components);
        let text = |name: &str| leaf(name, Physical::BYTE_ARRAY, ConvertedType::UTF8, Repetition::REQUIRED);
        let double = |name: &str, repetition| leaf(name, Physical::DOUBLE, ConvertedType::NONE, repetition);
        let mut fields =
            vec![text("id")?, leaf("time_ns", Physical::INT64, ConvertedType::NONE, Repetition::REQUIRED)?];
        for (name, _) in &numbers {
            fields.push(double(name, Repetition::REQUIRED)?);
        }
        fields.push(double("log_evidence", Repetition::OPTIONAL)?);
        fields.push(text("outcome")?);
        if self.modes {
            let optional = Repetition::OPTIONAL;
            fields.push(leaf("mode", Physical::BYTE_ARRAY, ConvertedType::UTF8, optional)?);
            fields.push(double("mode_probability", optional)?);
        }
        let schema = Arc::new(Type::group_type_builder("tracks").with_fields(fields).build()?);
        let mut writer =
            SerializedFileWriter::new(out, schema, Arc::new(WriterProperties::builder().build()))?;
        for rows in self.rows.chunks(GROUP) {
            let mut group = writer.next_row_group()?;
            let bytes = |text: &str| ByteArray::from(text.as_bytes().to_vec());
            column::<ByteArrayType, _>(&mut group, rows.iter().map(|r| bytes(&r.id)).collect(), None)?;
            column::<Int64Type, _>(&mut group, rows.iter().map(|r| r.time.nanos()).collect(), None)?;
            for (_, number) in &numbers {
                column::<DoubleType, _>(&mut group, rows.iter().map(|r| number.of(r)).collect(), None)?;
            }
            let present = rows.iter().map(|r| i16::from(r.log_evidence.is_some())).collect();
            column::<DoubleType, _>(
                &mut group,
                rows.iter().filter_map(|r| r.log_evidence).collect(),
                Some(present),
            )?;
            column::<ByteArrayType, _>(&mut group, rows.iter().map(|r| bytes(&r.outcome)).collect(), None)?;
            if self.modes {
                let modes = || rows.iter().filter_map(|r| r.mode.as_ref());
                let present: Vec<_> = rows.iter().map(|r| i16::from(r.mode.is_some())).collect();
                let names = modes().map(|mode| bytes(&mode.name)).collect();
                column::<ByteArrayType, _>(&mut group, names, Some(present.clone()))?;
                let probabilities = modes().map(|mode| mode.probability).collect();
                column::<DoubleType, _>(&mut group, probabilities, Some(present))?;
            }
            group.close()?;
        }
        writer.close()?;
        Ok(())
    }
}

/// Writes tracks as CSV row by row, for streams.
pub struct TrackCsv<W: Write> {
    out: csv::Writer<W>,
    components: Vec<Component>,
    modes: bool,
    numbers: Vec<(String, Number)>,
}

impl<W: Write> TrackCsv<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, components: &[Component]) -> io::Result<TrackCsv<W>> {
        TrackCsv::of(out, components, false)
    }

    /// The same with columns for the most probable mode.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn with_modes(out: W, components: &[Component]) -> io::Result<TrackCsv<W>> {
        TrackCsv::of(out, components, true)
    }

    fn of(out: W, components: &[Component], modes: bool) -> io::Result<TrackCsv<W>> {
        let numbers = number_columns(components);
        let mut out = csv::Writer::from_writer(out);
        let names = numbers.iter().map(|(name, _)| name.as_str());
        let of_modes: &[&str] = if modes { &["mode", "mode_probability"] } else { &[] };
        let last = ["log_evidence", "outcome"].iter().chain(of_modes).copied();
        out.write_record(["id", "time_s"].into_iter().chain(names).chain(last))?;
        Ok(TrackCsv { out, components: components.to_vec(), modes, numbers })
    }

    /// Writes a row and hands it on at once.
    ///
    /// # Errors
    /// [`Error::BadTrackRow`] if it does not fit the columns, [`Error::Write`] of a file named `-` if the
    /// stream refuses.
    pub fn write(&mut self, row: &TrackRow) -> Result<()> {
        check(&self.components, self.modes, row)?;
        let written = self.put(row).and_then(|()| self.out.flush());
        written.map_err(|source| Error::Write { path: "-".into(), source })
    }

    fn put(&mut self, row: &TrackRow) -> io::Result<()> {
        self.out.write_field(row.id.as_bytes())?;
        self.out.write_field(row.time.to_string())?;
        for (_, number) in &self.numbers {
            // The shortest text that reads back to the same bits.
            self.out.write_field(format!("{:?}", number.of(row)))?;
        }
        self.out.write_field(row.log_evidence.map_or(String::new(), |l| format!("{l:?}")))?;
        self.out.write_field(&row.outcome)?;
        if self.modes {
            let mode = row.mode.as_ref();
            self.out.write_field(mode.map_or("", |mode| &mode.name))?;
            self.out.write_field(mode.map_or(String::new(), |mode| format!("{:?}", mode.probability)))?;
        }
        self.out.write_record(None::<&[u8]>)?;
        Ok(())
    }
}

/// Which number of a row a column holds.
enum Number {
    Mean(usize),
    /// Index into the covariance, row by row.
    Covariance(usize),
}

impl Number {
    fn of(&self, row: &TrackRow) -> f64 {
        match *self {
            Number::Mean(i) => row.mean[i],
            Number::Covariance(i) => row.covariance[i],
        }
    }
}

/// Names and places of the columns of numbers: means, then the upper triangle of the covariance.
fn number_columns(components: &[Component]) -> Vec<(String, Number)> {
    let n = components.len();
    let name = |stem: String, unit: Unit| match unit.to_string() {
        suffix if suffix.is_empty() => stem,
        suffix => format!("{stem}_{suffix}"),
    };
    let mut columns: Vec<_> =
        components.iter().enumerate().map(|(i, c)| (name(c.name.clone(), c.unit), Number::Mean(i))).collect();
    for (i, a) in components.iter().enumerate() {
        for (j, b) in components.iter().enumerate().skip(i) {
            let stem = match (i == j, a.name.len() == 1 && b.name.len() == 1) {
                (true, _) => format!("var_{}", a.name),
                (false, true) => format!("cov_{}{}", a.name, b.name),
                (false, false) => format!("cov_{}_{}", a.name, b.name),
            };
            columns.push((name(stem, a.unit.times(b.unit)), Number::Covariance(i * n + j)));
        }
    }
    columns
}

fn check(components: &[Component], modes: bool, row: &TrackRow) -> Result<()> {
    let n = components.len();
    let bad = |problem: String| Err(Error::BadTrackRow { id: row.id.to_string(), time: row.time, problem });
    if row.mean.len() != n || row.covariance.len() != n * n {
        let (means, covariances) = (row.mean.len(), row.covariance.len());
        return bad(format!("{means} means and {covariances} covariances, {n} and {} expected", n * n));
    }
    // The names are made for the message only: this runs for every row.
    if !row.mean.iter().chain(&row.covariance).all(|v| v.is_finite()) {
        let mut numbers = number_columns(components).into_iter().map(|(name, number)| (name, number.of(row)));
        let worst = numbers.find(|(_, value)| !value.is_finite());
        let (name, value) = worst.unwrap_or(("the lower triangle of the covariance".into(), f64::NAN));
        return bad(format!("{name} is {value}, a finite number is needed"));
    }
    match &row.mode {
        Some(_) if !modes => return bad("a mode, for which the table has no column".to_owned()),
        Some(LikelyMode { probability: p, .. }) if !(0.0..=1.0).contains(p) => {
            return bad(format!("mode_probability is {p}, a number from 0 to 1 is needed"));
        }
        _ => {}
    }
    match row.log_evidence {
        Some(l) if !l.is_finite() => bad(format!("log_evidence is {l}, a finite number is needed")),
        _ => Ok(()),
    }
}

/// The error of the system behind one of the format.
pub(crate) fn refused(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}

/// A column of the schema.
pub(crate) fn leaf(
    name: &str,
    physical: Physical,
    converted: ConvertedType,
    repetition: Repetition,
) -> ParquetResult<Arc<Type>> {
    let builder = Type::primitive_type_builder(name, physical);
    builder.with_converted_type(converted).with_repetition(repetition).build().map(Arc::new)
}

/// Writes the next column of the group.
pub(crate) fn column<T: DataType, W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: Vec<T::T>,
    present: Option<Vec<i16>>,
) -> ParquetResult<()> {
    let next = group.next_column()?;
    let mut column = next.ok_or_else(|| ParquetError::General("more columns than the schema has".into()))?;
    column.typed::<T>().write_batch(&values, present.as_deref(), None)?;
    column.close()
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    pub(super) fn table() -> TrackTable {
        let mut table = TrackTable::new(vec![
            Component::new("x", Unit::M),
            Component::new("y", Unit::M),
            Component::new("vx", Unit::MPS),
        ]);
        for (id, nanos, x) in
            [("a,b", 1_626_098_398_996_000_000, 0.1), ("a,b", 1_626_098_399_000_000_001, 1e-9)]
        {
            let row = TrackRow {
                id: Arc::from(id),
                time: Time::from_nanos(nanos),
                mean: vec![x, -2.0, 3.5],
                covariance: vec![1.0, 0.5, 0.25, 0.5, 2.0, 0.125, 0.25, 0.125, 3.0],
                log_evidence: (nanos % 2 == 0).then_some(-1.5),
                outcome: "accepted".into(),
                mode: None,
            };
            table.push(row).unwrap();
        }
        table
    }

    #[test]
    fn csv_says_units_and_exact_times() {
        let mut out = Vec::new();
        table().write_csv(&mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(
            lines[0],
            "id,time_s,x_m,y_m,vx_mps,var_x_m2,cov_xy_m2,cov_x_vx_m2ps,var_y_m2,cov_y_vx_m2ps,var_vx_m2ps2,\
             log_evidence,outcome"
        );
        assert_eq!(lines[1], "\"a,b\",1626098398.996,0.1,-2.0,3.5,1.0,0.5,0.25,2.0,0.125,3.0,-1.5,accepted");
        assert_eq!(
            lines[2],
            "\"a,b\",1626098399.000000001,1e-9,-2.0,3.5,1.0,0.5,0.25,2.0,0.125,3.0,,accepted"
        );
        // What is written can be read as estimates.
        let back =
            crate::Trajectories::read("tracks.csv", text.as_bytes(), &crate::Options::default()).unwrap();
        assert_eq!(back.by_id["a,b"].points()[1].position, [1e-9, -2.0, 0.0]);
        assert_eq!(back.by_id["a,b"].points()[0].covariance, Some([1.0, 0.5, 2.0]));
    }

    #[test]
    fn streams_get_whole_rows() {
        let table = table();
        let mut out = Vec::new();
        let mut csv = TrackCsv::new(&mut out, table.components()).unwrap();
        csv.write(&table.rows()[0]).unwrap();
        let mut bad = table.rows()[0].clone();
        bad.mean[1] = f64::NAN;
        let message = csv.write(&bad).unwrap_err().to_string();
        assert!(message.contains("y_m is NaN") && message.contains("1626098398.996"), "{message}");
        drop(csv);
        assert_eq!(out.iter().filter(|&&b| b == b'\n').count(), 2);
    }

    #[test]
    fn parquet_keeps_every_bit() {
        let mut out = Vec::new();
        table().write_parquet(&mut out).unwrap();
        let reader = SerializedFileReader::new(bytes::Bytes::from(out)).unwrap();
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(|r| r.unwrap()).collect();
        assert_eq!(rows.len(), 2);
        assert_eq!(rows[1].get_string(0).unwrap(), "a,b");
        assert_eq!(rows[1].get_long(1).unwrap(), 1_626_098_399_000_000_001);
        assert_eq!(rows[1].get_double(2).unwrap(), 1e-9);
        assert_eq!(rows[1].get_double(9).unwrap(), 0.125);
        assert_eq!(rows[0].get_double(11).unwrap(), -1.5);
        assert!(rows[1].get_double(11).is_err(), "absent, not a number");
        let names: Vec<_> = rows[0].get_column_iter().map(|(name, _)| name.clone()).collect();
        assert_eq!(names[1..4], ["time_ns", "x_m", "y_m"]);
    }

    #[test]
    fn modes_are_columns_of_tables_that_have_them() {
        let mut with = TrackTable::with_modes(table().components().to_vec());
        for (row, name) in table().rows().iter().zip([None, Some("left")]) {
            let mode = name.map(|name| LikelyMode { name: name.to_owned(), probability: 0.75 });
            with.push(TrackRow { mode, ..row.clone() }).unwrap();
        }
        let mut out = Vec::new();
        with.write_csv(&mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        let ends: Vec<_> =
            text.lines().map(|line| line.rsplitn(4, ',').take(3).collect::<Vec<_>>()).collect();
        assert_eq!(ends[0], ["mode_probability", "mode", "outcome"]);
        assert_eq!(ends[1], ["", "", "accepted"]);
        assert_eq!(ends[2], ["0.75", "left", "accepted"]);
        let back = crate::Trajectories::read("tracks.csv", text.as_bytes(), &crate::Options::default());
        assert_eq!(back.unwrap().by_id["a,b"].points().len(), 2);

        let mut out = Vec::new();
        with.write_parquet(&mut out).unwrap();
        let reader = SerializedFileReader::new(bytes::Bytes::from(out)).unwrap();
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(|r| r.unwrap()).collect();
        assert_eq!(
            (rows[1].get_string(13).unwrap().as_str(), rows[1].get_double(14).unwrap()),
            ("left", 0.75)
        );
        assert!(rows[0].get_string(13).is_err() && rows[0].get_double(14).is_err(), "absent");

        let row = with.rows()[1].clone();
        assert!(table().push(row.clone()).unwrap_err().to_string().contains("no column"));
        let mode = Some(LikelyMode { name: "left".to_owned(), probability: f64::NAN });
        assert!(with.push(TrackRow { mode, ..row }).unwrap_err().to_string().contains("mode_probability"));
    }

    #[test]
    fn a_full_disk_keeps_its_kind() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::Error::from(io::ErrorKind::StorageFull))
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        assert_eq!(table().write_parquet(Full).unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(table().write_csv(Full).unwrap_err().kind(), io::ErrorKind::StorageFull);
    }

    #[test]
    fn rows_must_fit() {
        let mut table = table();
        let mut row = table.rows()[0].clone();
        row.covariance.pop();
        assert!(matches!(table.push(row), Err(Error::BadTrackRow { .. })));
    }
}
