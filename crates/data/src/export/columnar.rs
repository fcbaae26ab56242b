//! Parquet: a required column each, packed by snappy.

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::{Column, Values};

pub(super) fn write(columns: &[Column], out: &mut (impl Write + Send)) -> io::Result<()> {
    table(columns, out).map_err(io::Error::other)
}

fn table(columns: &[Column], out: &mut (impl Write + Send)) -> Result<(), ParquetError> {
    let fields: Result<Vec<_>, _> = columns.iter().map(|column| field(column).map(Arc::new)).collect();
    let schema = Type::group_type_builder("schema").with_fields(fields?).build()?;
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut writer = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for column in columns {
        let Some(mut out) = group.next_column()? else { break };
        match &column.values {
            Values::Numbers(values) => {
                out.typed::<DoubleType>().write_batch(values, None, None)?;
            }
            Values::Words { list, rows } => {
                let words: Vec<ByteArray> = rows
                    .iter()
                    .map(|&row| ByteArray::from(Values::word(list, row)))
                    .collect();
                out.typed::<ByteArrayType>().write_batch(&words, None, None)?;
            }
        }
        out.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}

fn field(column: &Column) -> Result<Type, ParquetError> {
    let (physical, converted) = match column.values {
        Values::Numbers(_) => (Physical::DOUBLE, ConvertedType::NONE),
        Values::Words { .. } => (Physical::BYTE_ARRAY, ConvertedType::UTF8),
    };
    Type::primitive_type_builder(&column.name, physical)
        .with_repetition(Repetition::REQUIRED)
        .with_converted_type(converted)
        .build()
}
