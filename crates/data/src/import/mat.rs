//! Records from MATLAB files: which variable is which quantity.

use std::io::Read;

use super::columns::{self, Chosen, Offer};
use super::mat5::{self, Array, Contents, Fault};
use super::options::ImportOptions;
use super::preview::Kind;
use super::table::Table;
use super::{Imported, finish};
use crate::clock::Printed;
use crate::error::DataError;
use crate::place::Place;
use crate::units::Quantity;

/// Names of numbers that are the sample period in seconds, in lower case.
const PERIODS: &[&str] = &[
    "ts",
    "dt",
    "t_s",
    "tsample",
    "sample_time",
    "sampletime",
    "sampling_time",
    "samplingtime",
];

/// Names of numbers that are the sample rate in hertz, in lower case.
const RATES: &[&str] = &[
    "fs",
    "f_s",
    "rate",
    "sample_rate",
    "samplerate",
    "sampling_rate",
    "samplingrate",
    "fsample",
];

/// A kind of MATLAB file, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MatKind {
    /// Version 5 to 7: read.
    V5,
    /// Version 7.3, or any other HDF5 file.
    Hdf5,
    /// MATLAB says so in the head, but the version is another.
    Other,
}

/// The kind of MATLAB file, if it is one.
pub(crate) fn kind(head: &[u8]) -> Option<MatKind> {
    const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
    if head.starts_with(HDF5) || head.get(512..520) == Some(HDF5) {
        return Some(MatKind::Hdf5);
    }
    match head.get(124..128) {
        Some([0x00, 0x01, b'I', b'M'] | [0x01, 0x00, b'M', b'I']) => Some(MatKind::V5),
        Some([0x00, 0x02, b'I', b'M'] | [0x02, 0x00, b'M', b'I']) => Some(MatKind::Hdf5),
        _ if head.starts_with(b"MATLAB ") && head.contains(&0) => Some(MatKind::Other),
        _ => None,
    }
}

impl MatKind {
    /// Refuses kinds that cannot be read, with the way to one that can.
    pub(crate) fn refuse_others(self, file: &str) -> Result<(), DataError> {
        let found = match self {
            MatKind::V5 => return Ok(()),
            MatKind::Hdf5 => "this is HDF5, as MATLAB's version 7.3",
            MatKind::Other => "this is a MATLAB file of a version that is not known",
        };
        Err(DataError::Format {
            file: file.to_owned(),
            found: found.into(),
            what_to_do: "versions 5 to 7 are read: in MATLAB, load it and say `save('file.mat','-v7')`".into(),
        })
    }
}

/// Imports a MATLAB file.
pub(crate) fn import(
    source: impl Read,
    file: &str,
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Imported, DataError> {
    let Contents { arrays, skipped } = mat5::read(source, progress).map_err(|fault| match fault {
        Fault::Io(source) => DataError::Io {
            file: file.to_owned(),
            action: "read it",
            source,
        },
        Fault::Broken(found) => DataError::Format {
            file: file.to_owned(),
            found,
            what_to_do: "the file is damaged or no MATLAB file; save it again with `save('file.mat','-v7')`".into(),
        },
    })?;
    let kind = Kind::Mat {
        variables: arrays
            .iter()
            .map(|array| (array.name.clone(), array.size.clone()))
            .collect(),
    };
    let mut notices: Vec<String> = skipped.into_iter().map(|what| format!("left out: {what}")).collect();
    let period = period(&arrays, file)?;
    let vectors = vectors(arrays);
    let names: Vec<String> = vectors.iter().map(|(name, ..)| name.clone()).collect();
    if names.is_empty() {
        return Err(DataError::Format {
            file: file.to_owned(),
            found: format!("no vectors of numbers in the file ({})", notices.join("; ")),
            what_to_do: "save time, voltage and position as vectors; of a timeseries save its Time and Data".into(),
        });
    }
    let has_clock = options.rate_hz.is_some() || period.is_some();
    let units = vec![String::new(); names.len()];
    let offer = Offer {
        noun: "variable",
        names: &names,
        units: &units,
        at: Place::file(file),
        has_clock,
    };
    let (chosen, more) = columns::choose(&offer, options)?;
    notices.extend(more);
    let table = table(chosen, vectors, file)?;
    if let (None, None, Some((name, period))) = (options.rate_hz, table.column(Quantity::Time), &period) {
        notices.push(format!("{name}: taken as a sample period of {period} s"));
    }
    finish(table, kind, period.map(|(_, period)| period), file, options, notices)
}

/// The chosen vectors as a table.
fn table(chosen: Vec<Chosen>, mut vectors: Vec<(String, Vec<f64>, bool)>, file: &str) -> Result<Table, DataError> {
    let time = chosen.iter().find(|column| column.quantity == Quantity::Time);
    // decimal digits that single and double precision have
    let digits = if time.is_some_and(|column| vectors[column.index].2) {
        7
    } else {
        17
    };
    let values: Vec<Vec<f64>> = chosen
        .iter()
        .map(|column| std::mem::take(&mut vectors[column.index].1))
        .collect();
    if let Some(other) = values.iter().position(|column| column.len() != values[0].len()) {
        let (first, other) = (
            (&chosen[0].name, values[0].len()),
            (&chosen[other].name, values[other].len()),
        );
        return Err(DataError::Format {
            file: file.to_owned(),
            found: format!("{} has {} numbers, {} has {}", first.0, first.1, other.0, other.1),
            what_to_do: "the variables of a record have one length; choose them with `--column QUANTITY=NAME:UNIT`"
                .into(),
        });
    }
    Ok(Table {
        chosen,
        values,
        printed: Printed::significant(digits),
        first_line: None,
        dropped: Vec::new(),
    })
}

/// The sample period, seconds, where a number has a name that says so.
fn period(arrays: &[Array], file: &str) -> Result<Option<(String, f64)>, DataError> {
    let mut found: Option<(&str, f64)> = None;
    for array in arrays.iter().filter(|array| array.values.len() == 1) {
        let name = array.name.rsplit('.').next().unwrap_or_default().to_lowercase();
        let period = match array.values[0] {
            value if PERIODS.contains(&name.as_str()) => value,
            value if RATES.contains(&name.as_str()) => 1.0 / value,
            _ => continue,
        };
        // a period and its own rate differ by rounding only
        if let Some((other, before)) = found
            && (before - period).abs() > 1e-9 * before.abs()
        {
            return Err(DataError::Ambiguous {
                at: Place::file(file),
                found: format!(
                    "{other} says a sample period of {before} s, {} says {period} s",
                    array.name
                ),
                what_to_do: "give the rate with `--rate HZ`".into(),
            });
        }
        if period > 0.0 && period.is_finite() && found.is_none() {
            found = Some((&array.name, period));
        }
    }
    Ok(found.map(|(name, period)| (name.to_owned(), period)))
}

/// The vectors among the arrays, and the columns of the matrices: name, numbers, whether of single precision.
fn vectors(arrays: Vec<Array>) -> Vec<(String, Vec<f64>, bool)> {
    let mut vectors = Vec::new();
    for Array {
        name,
        size,
        values,
        single,
    } in arrays
    {
        let sides: Vec<usize> = size.iter().copied().filter(|&side| side != 1).collect();
        match sides.as_slice() {
            [_] => vectors.push((name, values, single)),
            [rows, columns] if size.len() == 2 && *rows > 0 && columns < rows && *columns <= 64 => {
                for (index, column) in values.chunks_exact(*rows).enumerate() {
                    vectors.push((format!("{name}[{}]", index + 1), column.to_vec(), single));
                }
            }
            _ => {}
        }
    }
    vectors
}
