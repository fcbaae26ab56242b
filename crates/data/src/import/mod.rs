//! Import of what users have: tables of text in any dialect, MATLAB files, GCS arrays of PI controllers.
//!
//! Whatever the file does not say and is not told by [`ImportOptions`] is refused, never guessed: a unit that is not
//! given, a comma that may be a decimal sign or a separator, a gap in time. What was found out is in the [`Preview`].

mod cells;
mod clean;
mod columns;
mod decode;
mod dialect;
mod gcs;
mod mat;
mod mat5;
mod options;
mod preview;
mod spelling;
mod stamps;
mod table;

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::clock::{self, Clock};
use crate::error::DataError;
use crate::lines::Lines;
use crate::native::line_error;
use crate::place::Place;
use crate::record::{Notice, Record};
use crate::units::{Quantity, Unit};

use columns::Offer;
use decode::{Decoded, Encoding as TextEncoding};
use stamps::Stretch;
use table::Table;

pub use decode::Encoding;
pub use options::{ColumnChoice, Decimal, Gaps, ImportOptions, Jitter, Missing, Separator, Source};
pub use preview::{Kind, Preview, ReadColumn};

/// What an import gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The records: one, or one for each part between gaps.
    pub records: Vec<Record>,
    /// What was found out about the file.
    pub preview: Preview,
}

impl Imported {
    /// The preview's notices as those of a dataset.
    pub fn notices(&self) -> impl Iterator<Item = Notice> {
        let file = &self.preview.file;
        self.preview.notices.iter().map(|text| Notice {
            file: file.clone(),
            text: text.clone(),
        })
    }
}

/// Bytes of a file in which its kind and layout must show: preambles of instruments have a few kilobytes.
const HEAD: u64 = 256 * 1024;

/// Imports a recording of another program; `progress` gets the bytes read so far and in all.
///
/// # Errors
/// [`DataError`] with file, line and column, and what to do: no table found, columns or units that are not clear,
/// cells that are no numbers, time that is not uniform, kinds of file that cannot be read.
///
/// # Cost
/// One pass over a text file, memory for the columns that are read; a `.mat` file's numeric variables are all read.
///
/// # Example
/// ```
/// use hysteron_data::import::{ImportOptions, import};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("scope.csv");
/// std::fs::write(&path, "Rig 3\nZeit [ms];Spannung [V];Weg [nm]\n0,0;1,5;250\n0,2;2,5;500\n")?;
/// let found = import(&path, &ImportOptions::default(), &mut |_, _| {})?;
/// assert_eq!(found.records[0].period_s, 0.0002);
/// assert_eq!(found.records[0].voltage_v, [1.5, 2.5]);
/// assert_eq!(found.records[0].position_um, [0.25, 0.5]);
///
/// std::fs::write(&path, "t,u,y\n0,1.5,250\n0.2,2.5,500\n")?;
/// let error = import(&path, &ImportOptions::default(), &mut |_, _| {}).unwrap_err().to_string();
/// assert!(error.ends_with("line 1, column 2 (u): no unit given for voltage; known are V, mV, µV, kV; say which it is, \
///     as in `--column voltage=2:V` (with a factor: `V*20`)"), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn import(path: &Path, options: &ImportOptions, progress: &mut dyn FnMut(u64, u64)) -> Result<Imported, DataError> {
    let file = path.display().to_string();
    let source = File::open(path).map_err(DataError::io(&file, "open it"))?;
    let total = source.metadata().map_err(DataError::io(&file, "open it"))?.len();
    import_from(source, &file, options, &mut |bytes| progress(bytes, total))
}

/// Imports a recording from any source; `file` is its name in messages, and its stem that of the records.
///
/// # Errors
/// As [`import`].
pub fn import_from(
    mut source: impl Read,
    file: &str,
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Imported, DataError> {
    options.validate()?;
    let mut head = Vec::new();
    source
        .by_ref()
        .take(HEAD)
        .read_to_end(&mut head)
        .map_err(DataError::io(file, "read it"))?;
    let complete = (head.len() as u64) < HEAD;
    if let Some(kind) = mat::kind(&head) {
        kind.refuse_others(file)?;
        return mat::import(io::Cursor::new(head).chain(source), file, options, progress);
    }
    refuse_binary(&head, file)?;
    let encoding = TextEncoding::of(&head);
    let lines = head_lines(&head, encoding, complete, file)?;
    let is_gcs = gcs::is_header(&lines);
    let dialect = if is_gcs {
        gcs::find(&lines, file)?
    } else {
        dialect::find(&lines, encoding, file, options)?
    };
    drop(lines);
    let at = dialect
        .header_line
        .map_or_else(|| Place::file(file), |line| Place::line(file, line));
    let has_clock = options.rate_hz.is_some() || dialect.period_s.is_some();
    let offer = Offer {
        noun: "column",
        names: &dialect.names,
        units: &dialect.units,
        at,
        has_clock,
    };
    let (chosen, mut notices) = columns::choose(&offer, options)?;
    if encoding == Encoding::Latin1 {
        notices.push("the names are not UTF-8, read as Latin-1".into());
    }
    let whole = Decoded::new(io::Cursor::new(head).chain(source), encoding);
    let table = table::read(whole, file, &dialect, encoding, chosen, options.missing, progress)?;
    let kind = dialect.kind(encoding, is_gcs);
    finish(table, kind, dialect.period_s, file, options, notices)
}

/// The lines of a file's head; the last one only if the file ends there.
fn head_lines(head: &[u8], encoding: Encoding, complete: bool, file: &str) -> Result<Vec<Vec<u8>>, DataError> {
    let mut source = Lines::new(Decoded::new(head, encoding));
    let mut lines = Vec::new();
    loop {
        match source.next_line() {
            Ok(Some((_, line))) => lines.push(line.to_vec()),
            Ok(None) => break,
            Err(fault) => return Err(line_error(fault, file)),
        }
    }
    if !complete {
        lines.pop();
    }
    Ok(lines)
}

/// Refuses what is no text.
fn refuse_binary(head: &[u8], file: &str) -> Result<(), DataError> {
    let utf16 = head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff");
    let refuse = |found: &str, what_to_do: &str| {
        Err(DataError::Format {
            file: file.to_owned(),
            found: found.into(),
            what_to_do: what_to_do.into(),
        })
    };
    if !utf16 && head.contains(&0) {
        return refuse(
            "this is a binary file of a kind that is not known",
            "tables of text, MATLAB files of version 5 to 7 and PI's GCS arrays are read; export one of them",
        );
    }
    if !utf16 && head.contains(&b'\r') && !head.contains(&b'\n') {
        return refuse(
            "lines end in a carriage return alone",
            "save it with line ends LF or CRLF",
        );
    }
    Ok(())
}

/// Makes records of a table: missing cells, clock, units.
fn finish(
    mut table: Table,
    kind: Kind,
    period_s: Option<f64>,
    file: &str,
    options: &ImportOptions,
    mut notices: Vec<String>,
) -> Result<Imported, DataError> {
    notices.extend(clean::missing(&mut table, options.missing, file)?);
    let time = table.column(Quantity::Time);
    let stretches = match (options.rate_hz.map(|rate| 1.0 / rate).or(period_s), time) {
        (Some(period), None) => vec![Stretch {
            rows: 0..table.rows(),
            clock: Clock { start: 0.0, period },
            resample: false,
        }],
        (_, Some(column)) => stamps::stretches(&mut table, column, file, options, &mut notices)?,
        (None, None) => Vec::new(), // columns::choose has refused this
    };
    if stretches.is_empty() || table.rows() < 2 {
        return Err(DataError::TooShort {
            at: Place::file(file),
            samples: table.rows(),
            least: 2,
        });
    }
    notices.extend(conversions(&table));
    let count = stretches.len();
    let mut records = Vec::with_capacity(count);
    for (part, stretch) in stretches.iter().enumerate() {
        let name = record_name(file, (count > 1).then_some(part + 1));
        let mut record = record(&table, stretch, name, file, options)?;
        let largest = record.start_s.abs().max((record.start_s + record.duration_s()).abs());
        if !clock::is_representable(largest, record.period_s) {
            notices.push(format!(
                "{}: time begins at 0 s instead of {:?} s",
                record.file, record.start_s
            ));
            record.start_s = 0.0;
        }
        records.push(record);
    }
    let preview = Preview {
        file: file.to_owned(),
        kind,
        columns: table.chosen.iter().map(read_column).collect(),
        rates_hz: records.iter().map(|record| 1.0 / record.period_s).collect(),
        samples: records.iter().map(Record::len).collect(),
        notices,
    };
    Ok(Imported { records, preview })
}

/// What is said of the units that were converted.
fn conversions(table: &Table) -> impl Iterator<Item = String> {
    let converted = table
        .chosen
        .iter()
        .filter(|column| !column.unit.is_base() && column.quantity != Quantity::Time);
    converted.map(|column| {
        let (from, to) = (column.unit.symbol, column.quantity.base_unit().symbol);
        format!("{} `{}`: converted from {from} to {to}", column.quantity, column.name)
    })
}

fn read_column(column: &columns::Chosen) -> ReadColumn {
    ReadColumn {
        quantity: column.quantity,
        number: column.index + 1,
        name: column.name.clone(),
        unit: column.unit,
        factor: column.factor,
        told: column.told,
    }
}

/// The name of a record's CSV: that of the file, with the number of the part.
fn record_name(file: &str, part: Option<usize>) -> String {
    let stem = Path::new(file)
        .file_stem()
        .map_or_else(|| "record".into(), |stem| stem.to_string_lossy());
    let unfit = |c: char| c.is_control() || "/\\:*?\"<>|".contains(c);
    let stem: String = stem.chars().map(|c| if unfit(c) { '-' } else { c }).collect();
    part.map_or_else(|| format!("{stem}.csv"), |part| format!("{stem}-{part}.csv"))
}

/// Makes a record of a stretch of rows.
fn record(
    table: &Table,
    stretch: &Stretch,
    name: String,
    file: &str,
    options: &ImportOptions,
) -> Result<Record, DataError> {
    let take = |quantity: Quantity| -> Result<Option<Vec<f64>>, DataError> {
        let Some(column) = table.column(quantity) else {
            return Ok(None);
        };
        let raw = &table.values[column][stretch.rows.clone()];
        let resampled = match table.column(Quantity::Time).filter(|_| stretch.resample) {
            Some(time) => stamps::resample(raw, &table.values[time][stretch.rows.clone()], stretch.clock),
            None => raw.to_vec(),
        };
        let (unit, factor) = (table.chosen[column].unit, table.chosen[column].factor);
        let values: Vec<f64> = resampled
            .into_iter()
            .map(|value| unit.to_base(value * factor))
            .collect();
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(Some(values)),
            Some(row) => Err(DataError::Cell {
                at: table.place(file, stretch.rows.start + row.min(raw.len() - 1), column),
                found: "a number too large for its unit".into(),
                allowed: "allowed is a number that stays finite when converted".into(),
            }),
        }
    };
    let (start_s, period_s) = clock_s(table, stretch);
    let span_s = start_s + period_s * stretch.rows.len() as f64;
    if !(period_s > 0.0 && period_s.is_finite() && start_s.is_finite() && span_s.is_finite()) {
        return Err(DataError::Clock {
            at: Place::file(file),
            found: format!("a start of {start_s:e} s and a sample period of {period_s:e} s"),
            what_to_do: "the period is positive and finite; check the column of time and its unit".into(),
        });
    }
    Ok(Record {
        file: name,
        role: options.role,
        excitation: String::new(),
        start_s,
        period_s,
        voltage_v: take(Quantity::Voltage)?.unwrap_or_default(),
        position_um: take(Quantity::Position)?.unwrap_or_default(),
        reference_um: take(Quantity::Reference)?,
        temperature_c: take(Quantity::Temperature)?,
        voltage2_v: take(Quantity::Voltage2)?,
    })
}

/// Start and period in seconds.
fn clock_s(table: &Table, stretch: &Stretch) -> (f64, f64) {
    let clock = stretch.clock;
    match table.column(Quantity::Time) {
        None => (clock.start, clock.period),
        Some(column) => {
            let unit: Unit = table.chosen[column].unit;
            let factor = table.chosen[column].factor;
            (
                unit.to_base(clock.start * factor),
                unit.difference_to_base(clock.period * factor),
            )
        }
    }
}
