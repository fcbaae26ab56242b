//! The columns of a file while they are imported: raw numbers, NaN where a cell is missing.

use std::io::Read;

use super::cells::{self, Cell};
use super::columns::Chosen;
use super::decode::Encoding;
use super::dialect::Dialect;
use super::options::{Decimal, Missing, Separator};
use crate::clock::Printed;
use crate::error::DataError;
use crate::lines::Lines;
use crate::native::line_error;
use crate::place::{Place, shown};
use crate::units::Quantity;

/// The columns that are read.
pub(crate) struct Table {
    pub(crate) chosen: Vec<Chosen>,
    /// One a column, all of one length; in the unit of the file, NaN where missing.
    pub(crate) values: Vec<Vec<f64>>,
    /// How exactly the time is given.
    pub(crate) printed: Printed,
    /// Line of the first row, where the file has lines.
    pub(crate) first_line: Option<u64>,
    /// Rows that were left out later, in the numbering before that.
    pub(crate) dropped: Vec<usize>,
}

impl Table {
    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.values.first().map_or(0, Vec::len)
    }

    /// The place of a cell.
    pub(crate) fn place(&self, file: &str, row: usize, column: usize) -> Place {
        let chosen = &self.chosen[column];
        let row = self
            .dropped
            .iter()
            .fold(row, |row, &dropped| row + usize::from(dropped <= row));
        match self.first_line {
            Some(first) => Place::cell(file, first + row as u64, chosen.index, &chosen.name),
            None => Place {
                file: format!("{file}, {}({})", chosen.name, row + 1),
                line: None,
                column: None,
            },
        }
    }

    /// The column of a quantity.
    pub(crate) fn column(&self, quantity: Quantity) -> Option<usize> {
        self.chosen.iter().position(|chosen| chosen.quantity == quantity)
    }

    /// Leaves out some rows (in order), once.
    pub(crate) fn drop_rows(&mut self, rows: Vec<usize>) {
        self.retain(|row| rows.binary_search(&row).is_err());
        self.dropped = rows;
    }

    /// Keeps only the rows for which `keep` says so.
    pub(crate) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        for values in &mut self.values {
            let mut row = 0;
            values.retain(|_| {
                row += 1;
                keep(row - 1)
            });
        }
    }
}

/// Samples between two calls of the progress function.
const SAMPLES_A_CALL: usize = 4096;

/// Reads the rows of a text file, `source` decoded and from its first line.
pub(crate) fn read(
    source: impl Read,
    file: &str,
    dialect: &Dialect,
    encoding: Encoding,
    chosen: Vec<Chosen>,
    missing: Missing,
    progress: &mut dyn FnMut(u64),
) -> Result<Table, DataError> {
    let mut lines = Lines::new(source);
    let mut table = Table {
        values: vec![Vec::new(); chosen.len()],
        chosen,
        printed: Printed::NONE,
        first_line: Some(dialect.first_sample),
        dropped: Vec::new(),
    };
    let mut slots = vec![None; dialect.names.len()];
    for (slot, chosen) in table.chosen.iter().enumerate() {
        slots[chosen.index] = Some(slot);
    }
    // UTF-16 has (nearly always) two bytes for each byte that is decoded
    let width = if matches!(encoding, Encoding::Utf16Be | Encoding::Utf16Le) {
        2
    } else {
        1
    };
    let mut empty_line = None;
    while let Some((number, line)) = lines.next_line().map_err(|fault| line_error(fault, file))? {
        if number < dialect.first_sample {
            continue;
        }
        if line.trim_ascii().is_empty() {
            empty_line.get_or_insert(number);
            continue;
        }
        if let Some(empty) = empty_line {
            return Err(DataError::EmptyLine {
                at: Place::line(file, empty),
            });
        }
        row(line, number, file, dialect, &slots, &mut table, missing)?;
        if table.rows().is_multiple_of(SAMPLES_A_CALL) {
            progress(width * lines.bytes());
        }
    }
    progress(width * lines.bytes());
    match dialect.samples {
        Some(samples) if samples != table.rows() as u64 => Err(DataError::Format {
            file: file.to_owned(),
            found: format!("the header says NDATA = {samples}, the file has {} rows", table.rows()),
            what_to_do: "the file is cut short or was edited: read it from the controller again, or correct NDATA"
                .into(),
        }),
        _ => Ok(table),
    }
}

/// Reads one row.
fn row(
    line: &[u8],
    number: u64,
    file: &str,
    dialect: &Dialect,
    slots: &[Option<usize>],
    table: &mut Table,
    missing: Missing,
) -> Result<(), DataError> {
    let mut fault = None;
    let Table {
        chosen,
        values,
        printed,
        ..
    } = table;
    let mut surplus = false;
    let count = cells::split(line, dialect.separator, |index, cell| {
        surplus |= index >= slots.len() && !cell.is_empty();
        let Some(slot) = slots.get(index).copied().flatten() else {
            return;
        };
        let value = match cells::read(cell, dialect.numerals) {
            Cell::Number(value) => value,
            Cell::Missing if missing != Missing::Refuse => f64::NAN,
            found => {
                fault.get_or_insert((index, shown(cell), found));
                return;
            }
        };
        if chosen[slot].quantity == Quantity::Time && value.is_finite() {
            printed.observe(cell, dialect.numerals.decimal == Decimal::Comma);
        }
        values[slot].push(value);
    });
    if count < slots.len() || surplus {
        return Err(DataError::Columns {
            at: Place::line(file, number),
            found: count,
            expected: slots.len(),
            what_to_do: "every sample has one cell a column; if commas are decimal signs, save the file with `;` \
                         between columns",
        });
    }
    match fault {
        None => Ok(()),
        Some((index, found, cell)) => Err(DataError::Cell {
            at: Place::cell(file, number, index, &dialect.names[index]),
            found,
            allowed: match slots[index].map(|slot| chosen[slot].quantity) {
                Some(Quantity::Time) if cell == Cell::Text => format!(
                    "{}; for dates and times of day give the rate with `--rate HZ`",
                    allowed(dialect, cell)
                ),
                _ => allowed(dialect, cell).to_owned(),
            },
        }),
    }
}

fn allowed(dialect: &Dialect, cell: Cell) -> &'static str {
    match (cell, dialect.numerals.decimal, dialect.separator) {
        (Cell::Missing, ..) => {
            "samples must not be missing; `--missing trim` leaves out such lines at both ends, `--missing interpolate` \
             also closes single gaps"
        }
        (_, Decimal::Comma, _) => "allowed is a number with `,` as decimal sign; `--decimal point` reads points",
        (_, Decimal::Point, Separator::Comma) => "allowed is a number with `.` as decimal sign",
        (_, Decimal::Point, _) => "allowed is a number with `.` as decimal sign; `--decimal comma` reads commas",
    }
}
