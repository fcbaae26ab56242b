//! What an import found out about a file, so that a person can check it.

use std::fmt;

use super::decode::Encoding;
use super::options::{Decimal, Separator};
use crate::place::brief;
use crate::units::{Quantity, Unit};

/// What was found out about a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Preview {
    /// The file, as the user named it.
    pub file: String,
    /// Its kind.
    pub kind: Kind,
    /// The columns that are read.
    pub columns: Vec<ReadColumn>,
    /// Sample rates of the records, hertz.
    pub rates_hz: Vec<f64>,
    /// Samples of the records.
    pub samples: Vec<usize>,
    /// What was done that the user should know.
    pub notices: Vec<String>,
}

/// The kind of a file.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// A table of text.
    Text {
        /// How it is encoded.
        encoding: Encoding,
        /// Where columns end.
        separator: Separator,
        /// Decimal sign.
        decimal: Decimal,
        /// Line of the column names, from 1.
        header_line: Option<u64>,
        /// Line of the units, from 1.
        units_line: Option<u64>,
        /// Line of the first sample, from 1.
        first_sample_line: u64,
    },
    /// A sheet of a workbook.
    Sheet {
        /// Its name.
        name: String,
        /// Row of the column names, from 1.
        header_row: Option<u64>,
        /// Row of the units, from 1.
        units_row: Option<u64>,
        /// Row of the first sample, from 1.
        first_sample_row: u64,
    },
    /// A GCS array of a PI controller.
    Gcs {
        /// Line of the first sample, from 1.
        first_sample_line: u64,
    },
    /// Named arrays: MATLAB, TDMS, NumPy and their like.
    Arrays {
        /// What the file is called.
        what: &'static str,
        /// What its arrays are called: `variable`, `channel`.
        noun: &'static str,
        /// The numeric arrays and their sizes.
        arrays: Vec<(String, Vec<usize>)>,
    },
    /// Files of a channel each, joined on their clocks.
    Joined {
        /// The files and what each is.
        files: Vec<(String, Kind)>,
    },
}

/// A column that is read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadColumn {
    /// What it is.
    pub quantity: Quantity,
    /// Its number, the first is 1.
    pub number: usize,
    /// Its name in the file.
    pub name: String,
    /// Its unit in the file.
    pub unit: Unit,
    /// What its numbers are multiplied by first.
    pub factor: f64,
    /// What is added then.
    pub offset: f64,
    /// Whether the user said so (else it was found by its name).
    pub told: bool,
}

impl Kind {
    /// Writes what kind of file it is; gives what its columns are called.
    fn fmt_kind(&self, file: &str, out: &mut fmt::Formatter<'_>) -> Result<&'static str, fmt::Error> {
        match self {
            Kind::Text {
                encoding,
                separator,
                decimal,
                header_line,
                units_line,
                first_sample_line,
            } => {
                let sign = if *decimal == Decimal::Comma { ',' } else { '.' };
                let names = header_line.map_or("no names".to_owned(), |line| format!("names in line {line}"));
                let units = units_line.map_or(String::new(), |line| format!(", units in line {line}"));
                let (encoding, separator) = (encoding.name(), separator.name());
                writeln!(
                    out,
                    "{file}: table, {encoding}, separator {separator}, decimal sign `{sign}`"
                )?;
                writeln!(out, "  {names}{units}, samples from line {first_sample_line}")?;
                Ok("column")
            }
            Kind::Sheet {
                name,
                header_row,
                units_row,
                first_sample_row,
            } => {
                let names = header_row.map_or("no names".to_owned(), |row| format!("names in row {row}"));
                let units = units_row.map_or(String::new(), |row| format!(", units in row {row}"));
                writeln!(out, "{file}: workbook, sheet `{name}`")?;
                writeln!(out, "  {names}{units}, samples from row {first_sample_row}")?;
                Ok("column")
            }
            Kind::Gcs { first_sample_line } => {
                writeln!(out, "{file}: PI GCS array, samples from line {first_sample_line}")?;
                Ok("column")
            }
            Kind::Arrays { what, noun, arrays } => {
                const MOST: usize = 20;
                let sizes = |size: &[usize]| size.iter().map(usize::to_string).collect::<Vec<_>>().join("x");
                let mut listed: Vec<String> = arrays
                    .iter()
                    .take(MOST)
                    .map(|(name, size)| format!("{name} {}", sizes(size)))
                    .collect();
                if arrays.len() > MOST {
                    listed.push(format!("and {} more", arrays.len() - MOST));
                }
                writeln!(out, "{file}: {what}: {}", listed.join(", "))?;
                Ok(noun)
            }
            Kind::Joined { files } => {
                let mut noun = "column";
                for (file, kind) in files {
                    noun = kind.fmt_kind(file, out)?;
                }
                writeln!(out, "joined on their clocks:")?;
                Ok(noun)
            }
        }
    }
}

impl fmt::Display for Preview {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let noun = self.kind.fmt_kind(&self.file, out)?;
        for column in &self.columns {
            let mut factor = String::new();
            if column.factor != 1.0 {
                factor = format!(" times {}", column.factor);
            }
            if column.offset != 0.0 {
                let sign = if column.offset < 0.0 { "minus" } else { "plus" };
                factor += &format!(" {sign} {}", column.offset.abs());
            }
            let told = if column.told { "as told" } else { "by its name" };
            writeln!(
                out,
                "  {:<11} {noun} {} `{}` in {}{factor}, {told}",
                column.quantity.name(),
                column.number,
                column.name,
                column.unit.symbol
            )?;
        }
        for (rate, samples) in self.rates_hz.iter().zip(&self.samples) {
            writeln!(
                out,
                "  {samples} samples at {} Hz, {} s",
                brief(*rate),
                brief(samples.saturating_sub(1) as f64 / rate)
            )?;
        }
        self.notices
            .iter()
            .try_for_each(|notice| writeln!(out, "  note: {notice}"))
    }
}
