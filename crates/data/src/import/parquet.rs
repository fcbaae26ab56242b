//! Parquet: flat columns of numbers and times, row group by row group.

use std::io::Read;

use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::arrays::{self, Array, Budget, Contents, Fault, Format, MOST_ARRAYS, broken};

/// Parquet.
pub(crate) const FORMAT: Format = Format {
    what: "Parquet file",
    noun: "column",
    again: "write it again, as in `python -c \"import pandas; pandas.read_parquet('F').to_parquet('G')\"`",
    read,
};

/// What every file begins with.
pub(crate) const MAGIC: &[u8] = b"PAR1";

/// Rows that are read at once.
const ROWS: usize = 16 * 1024;

fn fault(error: ParquetError) -> Fault {
    Fault::Broken(format!("Parquet: {error}"))
}

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let bytes = arrays::bytes(source, progress)?;
    let mut budget = Budget::of(bytes.len());
    let file = SerializedFileReader::new(Bytes::from(bytes)).map_err(fault)?;
    let schema = file.metadata().file_metadata().schema_descr_ptr();
    if schema.num_columns() > MOST_ARRAYS {
        return broken(format!("more than {MOST_ARRAYS} columns"));
    }
    let mut contents = Contents::default();
    for (index, column) in schema.columns().iter().enumerate() {
        let name = column.path().string();
        let unit = time_unit(column);
        let mut found = Found {
            values: Vec::new(),
            first: None,
            is_time: unit.is_some(),
        };
        if column.max_rep_level() > 0 {
            contents.skipped.push(format!("{name}: lists"));
            continue;
        }
        let mut what = None;
        for group in 0..file.num_row_groups() {
            let group = file.get_row_group(group).map_err(fault)?;
            refuse_packing(group.metadata().column(index).compression())?;
            let reader = group.get_column_reader(index).map_err(fault)?;
            what = found.read(reader, column.max_def_level(), &name, &mut budget)?;
        }
        match what {
            Some(what) => contents.skipped.push(format!("{name}: {what}")),
            None => contents.arrays.push(Array {
                label: column.name().to_owned(),
                unit: unit.unwrap_or_default().to_owned(),
                single: column.physical_type() == parquet::basic::Type::FLOAT,
                ..Array::vector(name, found.values)
            }),
        }
    }
    Ok(contents)
}

/// Packings that are not built in, as they need code in C.
fn refuse_packing(packing: Compression) -> Result<(), Fault> {
    let name = match packing {
        Compression::ZSTD(_) => "zstd",
        Compression::BROTLI(_) => "brotli",
        Compression::LZO => "lzo",
        _ => return Ok(()),
    };
    Err(Fault::Foreign(
        format!("this Parquet file is packed by {name}, which is not read"),
        "this packs it otherwise: python -c \"import pandas; pandas.read_parquet('F').to_parquet('G', \
         compression='snappy')\""
            .into(),
    ))
}

/// The unit of a column of times.
fn time_unit(column: &ColumnDescriptor) -> Option<&'static str> {
    let of = |unit: &TimeUnit| match unit {
        TimeUnit::MILLIS => "ms",
        TimeUnit::MICROS => "us",
        TimeUnit::NANOS => "ns",
    };
    if let Some(LogicalType::Timestamp(time) | LogicalType::Time(time)) = column.logical_type_ref() {
        return Some(of(&time.unit));
    }
    match column.converted_type() {
        ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS => Some("ms"),
        ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS => Some("us"),
        _ => None,
    }
}

/// A column while it is read.
struct Found {
    values: Vec<f64>,
    /// The first of times, which the others are counted from: they have more digits than a number here.
    first: Option<i64>,
    is_time: bool,
}

impl Found {
    /// Reads a row group; gives what it is if it is no numbers.
    fn read(
        &mut self,
        reader: ColumnReader,
        levels: i16,
        name: &str,
        budget: &mut Budget,
    ) -> Result<Option<&'static str>, Fault> {
        let (is_time, mut first) = (self.is_time, self.first);
        match reader {
            ColumnReader::DoubleColumnReader(reader) => self.take(reader, levels, name, budget, |value| value)?,
            ColumnReader::FloatColumnReader(reader) => self.take(reader, levels, name, budget, f64::from)?,
            ColumnReader::Int32ColumnReader(reader) => self.take(reader, levels, name, budget, f64::from)?,
            ColumnReader::BoolColumnReader(reader) => {
                self.take(reader, levels, name, budget, |value| f64::from(u8::from(value)))?;
            }
            ColumnReader::Int64ColumnReader(reader) => {
                self.take(reader, levels, name, budget, |value: i64| match is_time {
                    true => value.saturating_sub(*first.get_or_insert(value)) as f64,
                    false => value as f64,
                })?;
                self.first = first;
            }
            ColumnReader::Int96ColumnReader(_) => return Ok(Some("times of 96 bits")),
            ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
                return Ok(Some("text or bytes"));
            }
        }
        Ok(None)
    }

    fn take<T: DataType>(
        &mut self,
        mut reader: ColumnReaderImpl<T>,
        levels: i16,
        name: &str,
        budget: &mut Budget,
        mut number: impl FnMut(T::T) -> f64,
    ) -> Result<(), Fault> {
        let mut values: Vec<T::T> = Vec::new();
        let mut defined: Vec<i16> = Vec::new();
        loop {
            values.clear();
            defined.clear();
            let (records, _, read) = reader
                .read_records(ROWS, Some(&mut defined), None, &mut values)
                .map_err(fault)?;
            if records == 0 && read == 0 {
                return Ok(());
            }
            budget.take(records as u64, &format!("column {name}"))?;
            let mut here = values.drain(..);
            if levels == 0 {
                self.values.extend(here.map(&mut number));
                continue;
            }
            // a row without a value has a lower level
            for &level in &defined {
                self.values.push(match level == levels {
                    true => here.next().map_or(f64::NAN, &mut number),
                    false => f64::NAN,
                });
            }
        }
    }
}
