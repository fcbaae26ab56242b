//! Reads one native CSV.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::header::{self, Header, Holds};
use crate::clock::{self, Clock, ClockFault, Printed};
use crate::error::DataError;
use crate::lines::{LONGEST_LINE, LineFault, Lines};
use crate::place::{Place, brief, shown};
use crate::record::{Notice, Record, Reference, Role};
use crate::units::{Quantity, Unit};

/// Samples between two calls of the progress function: some ten thousand calls a gigabyte.
const SAMPLES_A_CALL: usize = 4096;

/// Reads one native CSV as a record with role `identify`, with what the reader did that the user should know.
///
/// # Errors
/// [`DataError`] with file, line and column: a column missing or twice, an unknown unit, a cell that is no finite
/// number, time stamps that are not uniform, fewer than two samples.
///
/// # Cost
/// One pass; memory is the columns that are kept, the time stamps and a buffer of 256 kB.
///
/// # Example
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("run.csv");
/// std::fs::write(&path, "time_ms,voltage_v,position_um\n0,0,0.01\n0.2,1,0.25\n0.4,2,0.51\n")?;
/// let (record, notices) = hysteron_data::read_record(&path)?;
/// assert_eq!((record.len(), record.period_s), (3, 0.0002));
/// assert_eq!(notices[0].text, "column 1 (time_ms): converted from ms to s");
///
/// std::fs::write(&path, "time_s,voltage_v,position_um\n0,0,0.01\n0.2,,0.25\n")?;
/// let error = hysteron_data::read_record(&path).unwrap_err().to_string();
/// assert!(error.ends_with("run.csv, line 3, column 2 (voltage_v): found ``; allowed is a finite number with `.` as \
///     decimal sign (`hysteron import` can close gaps and reads other spellings)"), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_record(path: &Path) -> Result<(Record, Vec<Notice>), DataError> {
    let file = path.display().to_string();
    let (mut record, notices) = read_file(path, &file, &mut |_| {})?;
    record.file = path
        .file_name()
        .map_or_else(|| file.clone(), |name| name.to_string_lossy().into_owned());
    Ok((record, notices))
}

/// Reads one native CSV from any source; `file` is its name in errors, notices and the record.
///
/// # Errors
/// As [`read_record`].
pub fn read_record_from(source: impl Read, file: &str) -> Result<(Record, Vec<Notice>), DataError> {
    read(source, file, 0, Holds::Record, &mut |_| {})
}

/// Reads a reference to follow, a CSV with the header `time_s,reference_um`; other columns are left out, as the notices say.
///
/// # Errors
/// As [`read_record`].
///
/// # Example
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("scan.csv");
/// std::fs::write(&path, "time_ms,reference_nm\n0,0\n0.02,5\n0.04,10\n")?;
/// let (reference, _) = hysteron_data::read_reference(&path)?;
/// assert_eq!((reference.period_s, reference.reference_um), (20e-6, vec![0.0, 0.005, 0.01]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_reference(path: &Path) -> Result<(Reference, Vec<Notice>), DataError> {
    let file = path.display().to_string();
    let source = File::open(path).map_err(DataError::io(&file, "open it"))?;
    let (record, notices) = read(source, &file, 0, Holds::Reference, &mut |_| {})?;
    let reference = Reference {
        start_s: record.start_s,
        period_s: record.period_s,
        reference_um: record.reference_um.unwrap_or_default(),
    };
    Ok((reference, notices))
}

/// Reads one native CSV; `progress` gets the bytes read so far.
pub(super) fn read_file(
    path: &Path,
    file: &str,
    progress: &mut dyn FnMut(u64),
) -> Result<(Record, Vec<Notice>), DataError> {
    let source = File::open(path).map_err(DataError::io(file, "open it"))?;
    let bytes = source.metadata().map_err(DataError::io(file, "open it"))?.len();
    read(source, file, bytes, Holds::Record, progress)
}

/// A column while it is read.
struct Filling {
    index: usize,
    unit: Unit,
    quantity: Quantity,
    values: Vec<f64>,
}

fn read(
    source: impl Read,
    file: &str,
    bytes: u64,
    holds: Holds,
    progress: &mut dyn FnMut(u64),
) -> Result<(Record, Vec<Notice>), DataError> {
    let mut lines = Lines::new(source);
    let Some((number, line)) = lines.next_line().map_err(|fault| line_error(fault, file))? else {
        return Err(DataError::NoHeader {
            at: Place::file(file),
            found: "the file is empty".into(),
            allowed: holds.layout().into(),
        });
    };
    let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
    refuse_other_encodings(line, file)?;
    let header = header::parse(line, number, file, holds)?;
    let mut columns: Vec<Filling> = header
        .columns
        .iter()
        .map(|column| Filling {
            index: column.index,
            unit: column.unit,
            quantity: column.quantity,
            values: Vec::new(),
        })
        .collect();
    let mut printed = Printed::NONE;
    let mut samples = 0;
    let mut empty_line = None;
    while let Some((number, line)) = lines.next_line().map_err(|fault| line_error(fault, file))? {
        if line.trim_ascii().is_empty() {
            empty_line.get_or_insert(number);
            continue;
        }
        if let Some(empty) = empty_line {
            return Err(DataError::EmptyLine {
                at: Place::line(file, empty),
            });
        }
        if samples == 0 {
            let expected = bytes / (line.len() as u64 + 1) + 1;
            columns
                .iter_mut()
                .for_each(|column| column.values.reserve(usize::try_from(expected).unwrap_or(0)));
        }
        read_row(line, number, file, &header, &mut columns, &mut printed)?;
        samples += 1;
        if usize::is_multiple_of(samples, SAMPLES_A_CALL) {
            progress(lines.bytes());
        }
    }
    progress(lines.bytes());
    let record = assemble(columns, &header, printed, file)?;
    Ok((record, header.notices))
}

/// Reads the cells of one line into the columns.
fn read_row(
    line: &[u8],
    number: u64,
    file: &str,
    header: &Header,
    columns: &mut [Filling],
    printed: &mut Printed,
) -> Result<(), DataError> {
    let mut cells = line.split(|&byte| byte == b',');
    let mut at = 0;
    for column in columns {
        let Some(cell) = cells.nth(column.index - at) else {
            return Err(wrong_count(line, number, file, header));
        };
        at = column.index + 1;
        let cell = cell.trim_ascii();
        let value = std::str::from_utf8(cell)
            .ok()
            .and_then(|text| text.parse::<f64>().ok())
            .filter(|v| v.is_finite());
        let Some(value) = value else {
            if line.split(|&byte| byte == b',').count() != header.names.len() {
                return Err(wrong_count(line, number, file, header));
            }
            return Err(DataError::Cell {
                at: Place::cell(file, number, column.index, &header.names[column.index]),
                found: shown(cell),
                allowed: "allowed is a finite number with `.` as decimal sign (`hysteron import` can close gaps and \
                          reads other spellings)"
                    .into(),
            });
        };
        if column.quantity == Quantity::Time {
            printed.observe(cell, false);
            column.values.push(value); // converted with the clock, so that its rounding is that of the file
        } else {
            column.values.push(column.unit.to_base(value));
        }
    }
    if at + cells.count() != header.names.len() {
        return Err(wrong_count(line, number, file, header));
    }
    Ok(())
}

fn wrong_count(line: &[u8], number: u64, file: &str, header: &Header) -> DataError {
    DataError::Columns {
        at: Place::line(file, number),
        found: line.split(|&byte| byte == b',').count(),
        expected: header.names.len(),
        what_to_do: "columns are separated by `,` and the decimal sign is `.`; for other spellings use \
                     `hysteron import`",
    }
}

/// Makes a record of the columns.
fn assemble(columns: Vec<Filling>, header: &Header, printed: Printed, file: &str) -> Result<Record, DataError> {
    let mut clock = Clock {
        start: 0.0,
        period: 0.0,
    };
    let mut record = Record::new(file.to_owned(), Role::Identify, 0.0, Vec::new(), Vec::new());
    for Filling {
        index,
        unit,
        quantity,
        mut values,
    } in columns
    {
        if quantity == Quantity::Time {
            let at = |row: usize| Place::cell(file, row as u64 + 2, index, &header.names[index]);
            clock = clock::infer(&values, printed)
                .map_err(|fault| clock_error(fault, &values, unit.symbol, Place::file(file), &at))?;
            clock = Clock {
                start: unit.to_base(clock.start),
                period: unit.difference_to_base(clock.period),
            };
            continue;
        }
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            return Err(DataError::Cell {
                at: Place::cell(file, row as u64 + 2, index, &header.names[index]),
                found: "a number too large for its unit".into(),
                allowed: "allowed is a number that stays finite when converted".into(),
            });
        }
        values.shrink_to_fit();
        match quantity {
            Quantity::Time => {}
            Quantity::Voltage => record.voltage_v = values,
            Quantity::Position => record.position_um = values,
            Quantity::Reference => record.reference_um = Some(values),
            Quantity::Temperature => record.temperature_c = Some(values),
            Quantity::Voltage2 => record.voltage2_v = Some(values),
        }
    }
    record.start_s = clock.start;
    record.period_s = clock.period;
    Ok(record)
}

/// Start and period of the uniform clock behind time stamps in memory, seconds; `name` is theirs in errors.
///
/// # Errors
/// [`DataError::Clock`] for stamps that are no uniform clock, [`DataError::TooShort`] for fewer than 2.
///
/// # Example
/// ```
/// let stamps: Vec<f64> = (0..100).map(|k| f64::from(k) / 12e3).collect();
/// assert_eq!(hysteron_data::clock_of(&stamps, "time_s")?, [0.0, 1.0 / 12e3]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn clock_of(stamps_s: &[f64], name: &str) -> Result<[f64; 2], DataError> {
    let at = |index: usize| Place::file(&format!("{name}[{index}]"));
    let clock = clock::infer(stamps_s, clock::Printed::significant(17))
        .map_err(|fault| clock_error(fault, stamps_s, "s", Place::file(name), &at))?;
    Ok([clock.start, clock.period])
}

/// What is wrong with the time stamps of a file, each of which has its place.
fn clock_error(fault: ClockFault, stamps: &[f64], symbol: &str, file: Place, at: &dyn Fn(usize) -> Place) -> DataError {
    let import = "`hysteron import` can repair this";
    match fault {
        ClockFault::TooFew => DataError::TooShort {
            at: file,
            samples: stamps.len(),
            least: 2,
        },
        ClockFault::NotIncreasing { index } => DataError::Clock {
            at: at(index),
            found: format!(
                "time {:?} {symbol} does not come after {:?} {symbol}",
                stamps[index],
                stamps[index - 1]
            ),
            what_to_do: format!("stamps must increase by one sample period a line; {import}"),
        },
        ClockFault::Uneven {
            index,
            step,
            period,
            allowed,
        } => DataError::Clock {
            at: at(index),
            found: format!(
                "time {:?} {symbol} is {} {symbol} after the stamp before it",
                stamps[index],
                brief(step)
            ),
            what_to_do: format!(
                "the other stamps are {} {symbol} apart and may be off by {} {symbol}: samples are missing, the clock \
                 jitters, or the stamps have too few digits; {import}",
                brief(period),
                brief(allowed)
            ),
        },
        ClockFault::Unrepresentable => DataError::Clock {
            at: at(stamps.len().saturating_sub(1)),
            found: format!(
                "time {:?} {symbol} is too large for the step between stamps",
                stamps[stamps.len() - 1]
            ),
            what_to_do: "let the time begin near 0".into(),
        },
    }
}

/// What is wrong with a line.
pub(crate) fn line_error(fault: LineFault, file: &str) -> DataError {
    match fault {
        LineFault::Io(source) => DataError::Io {
            file: file.to_owned(),
            action: "read it",
            source,
        },
        LineFault::TooLong { line } => DataError::LineTooLong {
            at: Place::line(file, line),
            most: LONGEST_LINE,
        },
    }
}

/// Refuses what is not text in UTF-8, by its first bytes.
fn refuse_other_encodings(line: &[u8], file: &str) -> Result<(), DataError> {
    let refuse = |found: &str, what_to_do: &str| {
        Err(DataError::Format {
            file: file.to_owned(),
            found: found.into(),
            what_to_do: what_to_do.into(),
        })
    };
    if line.starts_with(b"\xff\xfe") || line.starts_with(b"\xfe\xff") {
        return refuse(
            "the text is UTF-16",
            "the native format is UTF-8; `hysteron import` reads UTF-16",
        );
    }
    if line.contains(&b'\r') {
        return refuse(
            "lines end in a carriage return alone",
            "save it with line ends LF or CRLF",
        );
    }
    if line.contains(&0) {
        return refuse(
            "this is a binary file",
            "give a CSV, or make one of it with `hysteron import`",
        );
    }
    Ok(())
}
