//! Writes one native CSV, so that reading it gives the same bits.

use std::io::{self, Write};
use std::path::Path;

use super::atomic::Pending;
use crate::clock;
use crate::error::DataError;
use crate::record::Record;

/// Whether something that is already there may be replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Overwrite {
    /// What is there stays: an error.
    #[default]
    Refuse,
    /// What is there may be replaced.
    Allow,
}

/// Writes a record as a native CSV; the file is there whole or not at all.
///
/// Values come back bit for bit (shortest decimal that reads as the same number). So does the clock where the record
/// starts at 0 or its period and start have at most [`FIXED_DECIMALS`] decimals; elsewhere the period comes back to
/// within the floating-point rounding of the stamps.
///
/// # Errors
/// [`DataError::Unwritable`] for columns of different length, fewer than two samples, values that are not finite, or
/// a clock that stamps cannot represent; [`DataError::Exists`]; [`DataError::Io`].
///
/// # Example
/// ```
/// # use hysteron_data::{Overwrite, Record, Role, read_record, write_record_csv};
/// let folder = tempfile::tempdir()?;
/// let record = Record {
///     file: "run.csv".into(), role: Role::Identify, excitation: String::new(),
///     start_s: 0.0, period_s: 1.0 / 3.0,
///     voltage_v: vec![0.0, 0.1, 0.2], position_um: vec![0.0, 1e-9, 1.0 / 3.0],
///     reference_um: None, temperature_c: None, voltage2_v: None,
/// };
/// let path = folder.path().join("run.csv");
/// write_record_csv(&record, &path, Overwrite::Refuse)?;
/// assert_eq!(read_record(&path)?.0, record);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_record_csv(record: &Record, path: &Path, overwrite: Overwrite) -> Result<(), DataError> {
    validate_record(record)?;
    if overwrite == Overwrite::Refuse && path.exists() {
        return Err(DataError::Exists {
            file: path.display().to_string(),
        });
    }
    Pending::write(path, |out| write_rows(record, out))?.commit()
}

/// Writes a record as a native CSV anywhere.
///
/// # Errors
/// As [`write_record_csv`].
pub fn write_record_to(record: &Record, out: &mut impl Write) -> Result<(), DataError> {
    validate_record(record)?;
    write_rows(record, out).map_err(DataError::io(&record.file, "write it"))
}

/// Decimals up to which stamps are printed with a fixed number of them.
pub const FIXED_DECIMALS: usize = 12;

/// How the stamps are printed.
#[derive(Clone, Copy)]
enum Stamps {
    /// With this many decimals, exactly as a person would.
    Fixed(usize),
    /// Shortest decimal that reads as the same number.
    Shortest,
}

impl Stamps {
    fn of(record: &Record) -> Stamps {
        let decimals = decimals(record.period_s).max(decimals(record.start_s));
        let largest = record.start_s.abs().max((record.start_s + record.duration_s()).abs());
        // start + i * period is off by less than 2^-51 of the largest stamp: far less than half of the last decimal
        let exact = decimals <= FIXED_DECIMALS && largest * 10f64.powi(decimals as i32) < 2f64.powi(49);
        if exact {
            Stamps::Fixed(decimals)
        } else {
            Stamps::Shortest
        }
    }
}

/// Decimals of the shortest spelling of a number.
fn decimals(value: f64) -> usize {
    let text = format!("{value}");
    text.split_once('.').map_or(0, |(_, fraction)| fraction.len())
}

pub(super) fn write_rows(record: &Record, out: &mut impl Write) -> io::Result<()> {
    let optional = [
        ("reference_um", &record.reference_um),
        ("temperature_c", &record.temperature_c),
        ("voltage2_v", &record.voltage2_v),
    ];
    let mut columns: Vec<&[f64]> = vec![&record.voltage_v, &record.position_um];
    out.write_all(b"time_s,voltage_v,position_um")?;
    for (name, values) in optional {
        if let Some(values) = values {
            write!(out, ",{name}")?;
            columns.push(values);
        }
    }
    out.write_all(b"\n")?;
    let stamps = Stamps::of(record);
    let mut line = Vec::with_capacity(256);
    for index in 0..record.len() {
        line.clear();
        // the first as it is: -0 + 0 is 0
        let stamp = if index == 0 {
            record.start_s
        } else {
            record.start_s + index as f64 * record.period_s
        };
        match stamps {
            Stamps::Fixed(decimals) => write!(line, "{stamp:.decimals$}")?,
            Stamps::Shortest => write!(line, "{stamp:?}")?,
        }
        for values in &columns {
            write!(line, ",{:?}", values[index])?;
        }
        line.push(b'\n');
        out.write_all(&line)?;
    }
    Ok(())
}

/// Refuses a record that could not be read back.
///
/// # Errors
/// As [`write_record_csv`], but for files.
pub fn validate_record(record: &Record) -> Result<(), DataError> {
    let refuse = |found: String, allowed| {
        Err(DataError::Unwritable {
            file: record.file.clone(),
            found,
            allowed,
        })
    };
    let samples = record.len();
    if samples < 2 {
        return refuse(format!("{samples} sample(s)"), "a record needs at least 2");
    }
    let columns = [
        ("voltage_v", Some(&record.voltage_v)),
        ("position_um", Some(&record.position_um)),
        ("reference_um", record.reference_um.as_ref()),
        ("temperature_c", record.temperature_c.as_ref()),
        ("voltage2_v", record.voltage2_v.as_ref()),
    ];
    for (name, values) in columns {
        let Some(values) = values else { continue };
        if values.len() != samples {
            let found = format!("{name} has {} samples, voltage_v has {samples}", values.len());
            return refuse(found, "all columns have the same length");
        }
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return refuse(format!("{name}[{index}] = {}", values[index]), "values are finite");
        }
    }
    let (start, period) = (record.start_s, record.period_s);
    if !(period > 0.0 && period.is_finite() && start.is_finite()) {
        return refuse(
            format!("start_s = {start:?}, period_s = {period:?}"),
            "the period is positive and finite, the start finite",
        );
    }
    let largest = start.abs().max((start + record.duration_s()).abs());
    if !clock::is_representable(largest, period) {
        return refuse(
            format!("stamps up to {largest:.1e} s cannot tell samples {period:e} s apart"),
            "let the record start near 0 s",
        );
    }
    Ok(())
}
