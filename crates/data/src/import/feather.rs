//! Feather of version 2, which is a file of Arrow's columns: batch by batch.
//!
//! The library lays out what a block or a packed buffer claims; so both are held against the file first.

use std::io::Read;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array as _, ArrayRef};
use arrow_buffer::Buffer;
use arrow_ipc::convert::try_fb_to_schema;
use arrow_ipc::reader::{FileDecoder, read_footer_length};
use arrow_ipc::{Block, CompressionType, root_as_footer, root_as_message};
use arrow_schema::{ArrowError, DataType, TimeUnit};

use super::arrays::{self, Array, Budget, Contents, Fault, Format, MOST_ARRAYS, MOST_NUMBERS, broken};

/// Feather.
pub(crate) const FORMAT: Format = Format {
    what: "Feather file",
    noun: "column",
    again: "write it again, as in `python -c \"import pandas; pandas.read_feather('F').to_feather('G')\"`",
    read,
};

/// What every file begins with, and ends in.
pub(crate) const MAGIC: &[u8] = b"ARROW1";

fn fault(error: ArrowError) -> Fault {
    Fault::Broken(format!("Feather: {error}"))
}

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let bytes = Buffer::from_vec(arrays::bytes(source, progress)?);
    let Some((rest, tail)) = bytes.split_last_chunk::<10>() else {
        return broken("the file is cut short");
    };
    let footer = read_footer_length(*tail).map_err(fault)?;
    let Some(from) = rest.len().checked_sub(footer) else {
        return broken("the file's list of columns is longer than the file");
    };
    let footer = root_as_footer(&rest[from..]).map_err(|error| Fault::Broken(format!("Feather: {error}")))?;
    let Some(schema) = footer.schema() else {
        return broken("the file has no list of columns");
    };
    let schema = Arc::new(try_fb_to_schema(schema).map_err(fault)?);
    if schema.fields().len() > MOST_ARRAYS {
        return broken(format!("more than {MOST_ARRAYS} columns"));
    }
    let kinds: Vec<Result<&'static str, String>> =
        schema.fields().iter().map(|field| unit(field.data_type())).collect();
    let read: Vec<usize> = (0..kinds.len()).filter(|&index| kinds[index].is_ok()).collect();
    let decoder = FileDecoder::new(schema.clone(), footer.version()).with_projection(read.clone());
    let mut columns: Vec<Column> = read.iter().map(|_| Column::default()).collect();
    let mut budget = Budget::of(bytes.len());
    for block in footer.recordBatches().iter().flatten() {
        let data = block_data(block, &bytes)?;
        check_sizes(&data, block, MOST_NUMBERS.min(1100 * bytes.len() as u64))?;
        let Some(batch) = decoder.read_record_batch(block, &data).map_err(fault)? else {
            continue;
        };
        for (column, array) in columns.iter_mut().zip(batch.columns()) {
            budget.take(array.len() as u64, "the file")?;
            column.take(array)?;
        }
    }
    let mut contents = Contents::default();
    for (field, kind) in schema.fields().iter().zip(&kinds) {
        if let Err(what) = kind {
            contents.skipped.push(format!("{}: {what}", field.name()));
        }
    }
    for (column, index) in columns.into_iter().zip(read) {
        let field = schema.field(index);
        contents.arrays.push(Array {
            unit: kinds[index].as_ref().map_or("", |unit| unit).to_owned(),
            single: matches!(field.data_type(), DataType::Float32 | DataType::Float16),
            ..Array::vector(field.name().as_str(), column.values)
        });
    }
    Ok(contents)
}

/// The bytes of a block, if they are in the file.
fn block_data(block: &Block, bytes: &Buffer) -> Result<Buffer, Fault> {
    let size = |value: i64| usize::try_from(value).ok();
    let metadata = usize::try_from(block.metaDataLength()).ok();
    let end = size(block.offset())
        .zip(metadata)
        .zip(size(block.bodyLength()))
        .and_then(|((offset, metadata), body)| offset.checked_add(metadata)?.checked_add(body));
    match (end, size(block.offset())) {
        (Some(end), Some(offset)) if end <= bytes.len() && block.metaDataLength() >= 8 => {
            Ok(bytes.slice_with_length(offset, end - offset))
        }
        _ => broken("a batch of rows lies outside the file"),
    }
}

/// Refuses buffers that lie outside their block, or claim to unpack to more than is read.
fn check_sizes(data: &Buffer, block: &Block, most: u64) -> Result<(), Fault> {
    let metadata = block.metaDataLength() as usize;
    let (head, body) = data.split_at(metadata);
    // a mark of four bytes is before the length where the file is not older than 2020
    let head = head
        .strip_prefix(b"\xff\xff\xff\xff")
        .unwrap_or(head)
        .get(4..)
        .unwrap_or_default();
    let message = root_as_message(head).map_err(|error| Fault::Broken(format!("Feather: {error}")))?;
    let Some(batch) = message.header_as_record_batch() else {
        return Ok(());
    };
    let packed = batch.compression();
    if packed.is_some_and(|packing| packing.codec() == CompressionType::ZSTD) {
        return Err(Fault::Foreign(
            "this Feather file is packed by zstd, which is not read".into(),
            "this packs it otherwise: python -c \"import pandas; pandas.read_feather('F').to_feather('G', \
             compression='lz4')\""
                .into(),
        ));
    }
    let mut unpacked = 0u64;
    for buffer in batch.buffers().iter().flatten() {
        let range = usize::try_from(buffer.offset())
            .ok()
            .zip(usize::try_from(buffer.length()).ok())
            .and_then(|(offset, length)| Some(offset..offset.checked_add(length)?));
        let Some(bytes) = range.and_then(|range| body.get(range)) else {
            return broken("a column lies outside its batch");
        };
        if packed.is_some()
            && let Some(claim) = bytes.first_chunk::<8>()
        {
            unpacked = unpacked.saturating_add(u64::try_from(i64::from_le_bytes(*claim)).unwrap_or(0));
        }
    }
    if unpacked > most.saturating_mul(8) || batch.length() as u64 > most {
        return broken(format!(
            "a batch claims {unpacked} bytes; at most {most} numbers are read from this file"
        ));
    }
    Ok(())
}

/// The unit of a type of number (empty where it is none of a time), or what a type is that is not read.
fn unit(kind: &DataType) -> Result<&'static str, String> {
    Ok(match kind {
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => match unit {
            TimeUnit::Second => "s",
            TimeUnit::Millisecond => "ms",
            TimeUnit::Microsecond => "us",
            TimeUnit::Nanosecond => "ns",
        },
        DataType::Float16
        | DataType::Float32
        | DataType::Float64
        | DataType::Int8
        | DataType::Int16
        | DataType::Int32
        | DataType::Int64
        | DataType::UInt8
        | DataType::UInt16
        | DataType::UInt32
        | DataType::UInt64 => "",
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => return Err("text".into()),
        other => return Err(format!("of type {other}")),
    })
}

/// A column while it is read.
#[derive(Default)]
struct Column {
    values: Vec<f64>,
    /// The first of times, which the others are counted from: they have more digits than a number here.
    first: Option<i64>,
}

impl Column {
    fn take(&mut self, array: &ArrayRef) -> Result<(), Fault> {
        match array.data_type() {
            DataType::Float16 => self.numbers::<Float16Type>(array, f64::from),
            DataType::Float32 => self.numbers::<Float32Type>(array, f64::from),
            DataType::Float64 => self.numbers::<Float64Type>(array, |value| value),
            DataType::Int8 => self.numbers::<Int8Type>(array, f64::from),
            DataType::Int16 => self.numbers::<Int16Type>(array, f64::from),
            DataType::Int32 => self.numbers::<Int32Type>(array, f64::from),
            DataType::Int64 => self.numbers::<Int64Type>(array, |value| value as f64),
            DataType::UInt8 => self.numbers::<UInt8Type>(array, f64::from),
            DataType::UInt16 => self.numbers::<UInt16Type>(array, f64::from),
            DataType::UInt32 => self.numbers::<UInt32Type>(array, f64::from),
            DataType::UInt64 => self.numbers::<UInt64Type>(array, |value| value as f64),
            DataType::Timestamp(..) | DataType::Duration(_) => self.times(array),
            other => return broken(format!("a column changes its type to {other}")),
        }
        Ok(())
    }

    fn numbers<T: ArrowPrimitiveType>(&mut self, array: &ArrayRef, number: impl Fn(T::Native) -> f64) {
        if let Some(array) = array.as_primitive_opt::<T>() {
            self.values
                .extend(array.iter().map(|value| value.map_or(f64::NAN, &number)));
        }
    }

    fn times(&mut self, array: &ArrayRef) {
        let data = array.to_data();
        let all = data
            .buffers()
            .first()
            .map_or(&[][..], |buffer| buffer.typed_data::<i64>());
        for row in 0..array.len() {
            let value = all.get(data.offset() + row).filter(|_| array.is_valid(row));
            self.values.push(match value {
                Some(&value) => value.saturating_sub(*self.first.get_or_insert(value)) as f64,
                None => f64::NAN,
            });
        }
    }
}
