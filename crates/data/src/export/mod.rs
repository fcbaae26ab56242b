//! Tables for other programs: CSV, NumPy's `.npz`, Parquet.

mod columnar;
mod numpy;

use std::io::{self, Write};
use std::path::Path;

use crate::error::DataError;
use crate::native::Pending;

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name, with the unit at the end: `model_um`.
    pub name: String,
    /// Its rows.
    pub values: Values,
}

/// The rows of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers.
    Numbers(Vec<f64>),
    /// Words out of a list, each row's by its place there.
    Words {
        /// The words.
        list: Vec<String>,
        /// The place of each row's.
        rows: Vec<u32>,
    },
}

impl Values {
    /// The word of a row.
    fn word(list: &[String], row: u32) -> &str {
        list.get(row as usize).map_or("", String::as_str)
    }
}

/// A kind of table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// Text, a row a line.
    Csv,
    /// NumPy's archive, an array a column.
    Npz,
    /// Parquet.
    Parquet,
}

impl TableFormat {
    /// The kind that a file's name says.
    ///
    /// # Errors
    /// [`DataError::Choice`] for another ending than `.csv`, `.npz` or `.parquet`.
    pub fn of(path: &Path) -> Result<TableFormat, DataError> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("csv") => Ok(TableFormat::Csv),
            Some("npz") => Ok(TableFormat::Npz),
            Some("parquet") => Ok(TableFormat::Parquet),
            _ => Err(DataError::Choice {
                found: format!("{}: the ending does not say what to write", path.display()),
                allowed: "give it one of .csv, .npz and .parquet".into(),
            }),
        }
    }
}

/// Writes a table, the file whole or not at all; numbers to their last bit.
///
/// # Errors
/// [`DataError::Unwritable`] for columns of different lengths; [`DataError::Io`].
///
/// # Example
/// ```
/// use hysteron_data::export::{Column, TableFormat, Values, write_table};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("out.csv");
/// let column = |name: &str, values: [f64; 2]| Column { name: name.into(), values: Values::Numbers(values.to_vec()) };
/// write_table(&path, TableFormat::of(&path)?, &[column("time_s", [0.0, 0.1]), column("model_um", [1.5, 1.75])])?;
/// assert_eq!(std::fs::read_to_string(&path)?, "time_s,model_um\n0,1.5\n0.1,1.75\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_table(path: &Path, format: TableFormat, columns: &[Column]) -> Result<(), DataError> {
    let rows = |column: &Column| match &column.values {
        Values::Numbers(values) => values.len(),
        Values::Words { rows, .. } => rows.len(),
    };
    let count = columns.first().map_or(0, rows);
    if let Some(other) = columns.iter().find(|column| rows(column) != count) {
        return Err(DataError::Unwritable {
            file: path.display().to_string(),
            found: format!(
                "column {} has {} rows, {} has {count}",
                other.name,
                rows(other),
                columns[0].name
            ),
            allowed: "all columns of a table have one length",
        });
    }
    let pending = Pending::write(path, |out| match format {
        TableFormat::Csv => csv(columns, count, out),
        TableFormat::Npz => numpy::write(columns, out),
        TableFormat::Parquet => columnar::write(columns, out),
    })?;
    pending.commit()
}

fn csv(columns: &[Column], rows: usize, out: &mut impl Write) -> io::Result<()> {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    writeln!(out, "{}", names.join(","))?;
    let mut line = Vec::with_capacity(256);
    for row in 0..rows {
        line.clear();
        for (index, column) in columns.iter().enumerate() {
            if index > 0 {
                line.push(b',');
            }
            match &column.values {
                Values::Numbers(values) => write!(line, "{}", values[row])?,
                Values::Words { list, rows } => line.extend(quoted(Values::word(list, rows[row])).bytes()),
            }
        }
        line.push(b'\n');
        out.write_all(&line)?;
    }
    Ok(())
}

/// A cell of text as RFC 4180 writes it.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
