//! From columns to records: missing cells, the clock, units, names.

use std::path::Path;

use super::Imported;
use super::clean;
use super::columns;
use super::options::ImportOptions;
use super::preview::{Kind, Preview, ReadColumn};
use super::stamps::{self, Stretch};
use super::table::Table;
use crate::clock::{self, Clock};
use crate::error::DataError;
use crate::place::Place;
use crate::record::Record;
use crate::units::{Quantity, Unit};

/// Samples that are one run, with the clock that the file gives besides a column of time, in seconds.
pub(crate) struct Part {
    pub(crate) table: Table,
    pub(crate) clock_s: Option<Clock>,
}

/// Makes records of parts: missing cells, clock, units.
pub(crate) fn finish(
    parts: Vec<Part>,
    kind: Kind,
    file: &str,
    options: &ImportOptions,
    mut notices: Vec<String>,
) -> Result<Imported, DataError> {
    let mut runs = Vec::with_capacity(parts.len());
    for part in parts {
        let (table, clock_s) = (part.table, part.clock_s);
        runs.push(on_clock(table, clock_s, file, options, &mut notices)?);
    }
    let columns = runs
        .first()
        .map_or(Vec::new(), |(table, _)| table.chosen.iter().map(read_column).collect());
    if let Some((table, _)) = runs.first() {
        notices.extend(conversions(table));
    }
    let count = runs.iter().map(|(_, stretches)| stretches.len()).sum();
    let mut records = Vec::with_capacity(count);
    for (table, stretches) in &runs {
        for stretch in stretches {
            let name = record_name(file, (count > 1).then_some(records.len() + 1));
            let mut record = record(table, stretch, name, file, options)?;
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
    }
    let preview = Preview {
        file: file.to_owned(),
        kind,
        columns,
        rates_hz: records.iter().map(Record::rate_hz).collect(),
        samples: records.iter().map(Record::len).collect(),
        notices,
    };
    Ok(Imported { records, preview })
}

/// A run's rows without those that are missing, and their clocks.
pub(super) fn on_clock(
    mut table: Table,
    clock_s: Option<Clock>,
    file: &str,
    options: &ImportOptions,
    notices: &mut Vec<String>,
) -> Result<(Table, Vec<Stretch>), DataError> {
    notices.extend(clean::missing(&mut table, options.missing, file)?);
    let told = options.rate_hz.map(|rate| Clock {
        start: 0.0,
        period: 1.0 / rate,
    });
    let stretches = match (told.or(clock_s), table.column(Quantity::Time)) {
        (Some(clock), None) => vec![Stretch {
            rows: 0..table.rows(),
            clock,
            resample: false,
        }],
        (_, Some(column)) => stamps::stretches(&mut table, column, file, options, notices)?,
        (None, None) => Vec::new(), // columns::choose has refused this
    };
    if stretches.is_empty() || table.rows() < 2 {
        return Err(DataError::TooShort {
            at: Place::file(file),
            samples: table.rows(),
            least: 2,
        });
    }
    Ok((table, stretches))
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
        offset: column.offset,
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
        let chosen = &table.chosen[column];
        let values: Vec<f64> = resampled.into_iter().map(|value| chosen.to_base(value)).collect();
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
pub(super) fn clock_s(table: &Table, stretch: &Stretch) -> (f64, f64) {
    let clock = stretch.clock;
    match table.column(Quantity::Time) {
        None => (clock.start, clock.period),
        Some(column) => {
            let chosen = &table.chosen[column];
            let unit: Unit = chosen.unit;
            (
                chosen.to_base(clock.start),
                unit.difference_to_base(clock.period * chosen.factor),
            )
        }
    }
}
