//! Spreadsheets, `.xlsx`: the sheet is taken as the table of text that a person would save it as, so that names, units
//! and remarks above them are found in the same way.

use std::fmt::Write;
use std::io::Cursor;

use calamine::{DataRef, Reader, Xlsx};

use crate::error::DataError;

/// The most cells of a sheet.
const MOST_CELLS: usize = 1 << 25;

/// The most columns and rows: those of Excel, but for columns that no record has.
const MOST_COLUMNS: u32 = 512;
const MOST_ROWS: u32 = 1 << 20;

/// A day in seconds.
const DAY_S: f64 = 86_400.0;

/// A sheet as text, columns separated by tabs, a row a line.
pub(crate) struct Sheet {
    pub(crate) name: String,
    pub(crate) text: String,
}

/// The sheets of a workbook that have rows of numbers.
///
/// # Errors
/// A workbook that cannot be read.
pub(crate) fn sheets(bytes: &[u8], file: &str) -> Result<Vec<Sheet>, DataError> {
    let broken = |found: String| DataError::Format {
        file: file.to_owned(),
        found,
        what_to_do: "the file is damaged or no workbook; save the sheet as CSV".into(),
    };
    let mut book: Xlsx<_> = calamine::open_workbook_from_rs(Cursor::new(bytes))
        .map_err(|error: calamine::XlsxError| broken(format!("workbook: {error}")))?;
    let mut found = Vec::new();
    for name in book.sheet_names() {
        // sheets of charts alone have no cells
        let Ok(mut cells) = book.worksheet_cells_reader(&name) else {
            continue;
        };
        let mut rows = Rows::default();
        while let Some(cell) = cells
            .next_cell()
            .map_err(|error| broken(format!("sheet `{name}`: {error}")))?
        {
            let (row, column) = cell.get_position();
            rows.put(row, column, cell.get_value())
                .map_err(|what| DataError::Format {
                    file: file.to_owned(),
                    found: format!("sheet `{name}` has {what}"),
                    what_to_do: "save the columns of the record as a CSV".into(),
                })?;
        }
        if rows.numbers >= 4 {
            found.push(Sheet {
                name,
                text: rows.finish(),
            });
        }
    }
    Ok(found)
}

/// The rows of a sheet while they are written.
#[derive(Default)]
struct Rows {
    text: String,
    row: u32,
    column: u32,
    /// The last column that any row has.
    widest: u32,
    cells: usize,
    numbers: usize,
    /// The day of the first date, which the others are counted from.
    day: Option<f64>,
}

impl Rows {
    /// Writes a cell; they come row by row.
    fn put(&mut self, row: u32, column: u32, value: &DataRef) -> Result<(), &'static str> {
        self.cells += 1;
        if self.cells > MOST_CELLS || row >= MOST_ROWS || row < self.row {
            return Err("too many cells, or cells out of order");
        }
        if column >= MOST_COLUMNS || matches!(value, DataRef::Empty) {
            return Ok(());
        }
        while self.row < row {
            self.text.push('\n');
            self.row += 1;
            self.column = 0;
        }
        if column < self.column {
            return Err("cells out of order");
        }
        while self.column < column {
            self.text.push('\t');
            self.column += 1;
        }
        self.widest = self.widest.max(column);
        let number = match value {
            DataRef::Int(value) => Some(*value as f64),
            DataRef::Float(value) => Some(*value),
            DataRef::Bool(value) => Some(f64::from(u8::from(*value))),
            // days; of seconds, microseconds are left
            DataRef::DateTime(date) => {
                let days = date.as_f64();
                let day = *self.day.get_or_insert(days.floor());
                Some(((days - day) * DAY_S * 1e6).round() / 1e6)
            }
            _ => None,
        };
        match (number, value) {
            (Some(number), _) => {
                self.numbers += 1;
                let _ = write!(self.text, "{number}"); // writing to a String does not fail
            }
            (None, DataRef::String(text) | DataRef::DateTimeIso(text) | DataRef::DurationIso(text)) => self.words(text),
            (None, DataRef::SharedString(text)) => self.words(text),
            (None, DataRef::Error(_)) => self.text.push_str("#N/A"),
            _ => {}
        }
        Ok(())
    }

    /// Writes a text on one line.
    fn words(&mut self, text: &str) {
        const LONGEST: usize = 200;
        let plain = |c: char| if c.is_control() || c == '"' { ' ' } else { c };
        self.text.extend(text.chars().take(LONGEST).map(plain));
    }

    /// The text, every row that is not empty as long as the longest.
    fn finish(self) -> String {
        let widest = self.widest as usize;
        let mut text = String::with_capacity(self.text.len());
        for line in self.text.lines() {
            text.push_str(line);
            let tabs = line.matches('\t').count();
            if !line.is_empty() {
                text.extend(std::iter::repeat_n('\t', widest.saturating_sub(tabs)));
            }
            text.push('\n');
        }
        text
    }
}
