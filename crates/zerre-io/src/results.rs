//! Tables of results in Parquet: columns of text, counts and numbers, any of them with gaps.

use crate::tracks::{column, leaf, refused};
use parquet::basic::{ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::Result as ParquetResult;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

/// The values of a column; `None` where nothing is known.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Names.
    Text(Vec<Option<String>>),
    /// Counts.
    Count(Vec<Option<i64>>),
    /// Numbers.
    Number(Vec<Option<f64>>),
}

/// Writes named columns of one length as Parquet: UTF-8, INT64 and DOUBLE, all of them optional.
///
/// # Errors
/// Those of `out`, and columns of different lengths.
pub fn write_results(out: impl Write + Send, columns: &[(String, Values)]) -> io::Result<()> {
    written(out, columns).map_err(refused)
}

fn written(out: impl Write + Send, columns: &[(String, Values)]) -> ParquetResult<()> {
    let field = |(name, values): &(String, Values)| {
        let (physical, converted) = match values {
            Values::Text(_) => (Physical::BYTE_ARRAY, ConvertedType::UTF8),
            Values::Count(_) => (Physical::INT64, ConvertedType::NONE),
            Values::Number(_) => (Physical::DOUBLE, ConvertedType::NONE),
        };
        leaf(name, physical, converted, Repetition::OPTIONAL)
    };
    let fields = columns.iter().map(field).collect::<ParquetResult<Vec<_>>>()?;
    let schema = Arc::new(Type::group_type_builder("results").with_fields(fields).build()?);
    let mut writer = SerializedFileWriter::new(out, schema, Arc::new(WriterProperties::builder().build()))?;
    let mut group = writer.next_row_group()?;
    for (_, values) in columns {
        match values {
            Values::Text(list) => {
                let bytes = |text: &String| ByteArray::from(text.as_bytes().to_vec());
                let known = list.iter().flatten().map(bytes).collect();
                column::<ByteArrayType, _>(&mut group, known, Some(present(list)))?;
            }
            Values::Count(list) => {
                let known = list.iter().flatten().copied().collect();
                column::<Int64Type, _>(&mut group, known, Some(present(list)))?;
            }
            Values::Number(list) => {
                let known = list.iter().flatten().copied().collect();
                column::<DoubleType, _>(&mut group, known, Some(present(list)))?;
            }
        }
    }
    group.close()?;
    writer.close()?;
    Ok(())
}

fn present<T>(list: &[Option<T>]) -> Vec<i16> {
    list.iter().map(|value| i16::from(value.is_some())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    #[test]
    fn every_kind_of_column_reads_back_with_its_gaps() {
        let columns = [
            ("filter".to_owned(), Values::Text(vec![Some("ekf".into()), None])),
            ("run".to_owned(), Values::Count(vec![Some(0), Some(7)])),
            ("rmse".to_owned(), Values::Number(vec![None, Some(0.1)])),
        ];
        let mut file = Vec::new();
        write_results(&mut file, &columns).unwrap();
        let reader = SerializedFileReader::new(Bytes::from(file)).unwrap();
        let rows: Vec<Vec<Field>> = reader
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap().get_column_iter().map(|(_, field)| field.clone()).collect())
            .collect();
        assert_eq!(rows[0], [Field::Str("ekf".into()), Field::Long(0), Field::Null]);
        assert_eq!(rows[1], [Field::Null, Field::Long(7), Field::Double(0.1)]);
        let uneven =
            [("a".to_owned(), Values::Count(vec![Some(1)])), ("b".to_owned(), Values::Count(vec![]))];
        assert!(write_results(Vec::new(), &uneven).is_err());
    }
}
