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
    /// A GCS array of a PI controller.
    Gcs {
        /// Line of the first sample, from 1.
        first_sample_line: u64,
    },
    /// A MATLAB file, version 5.
    Mat {
        /// The numeric variables and their sizes.
        variables: Vec<(String, Vec<usize>)>,
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
    /// Whether the user said so (else it was found by its name).
    pub told: bool,
}

impl Preview {
    /// Writes what kind of file it is; gives what its columns are called.
    fn fmt_kind(&self, out: &mut fmt::Formatter<'_>) -> Result<&'static str, fmt::Error> {
        let file = &self.file;
        match &self.kind {
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
            Kind::Gcs { first_sample_line } => {
                writeln!(out, "{file}: PI GCS array, samples from line {first_sample_line}")?;
                Ok("column")
            }
            Kind::Mat { variables } => {
                let sizes = |size: &[usize]| size.iter().map(usize::to_string).collect::<Vec<_>>().join("x");
                let listed: Vec<String> = variables
                    .iter()
                    .map(|(name, size)| format!("{name} {}", sizes(size)))
                    .collect();
                writeln!(out, "{file}: MATLAB file: {}", listed.join(", "))?;
                Ok("variable")
            }
        }
    }
}

impl fmt::Display for Preview {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let noun = self.fmt_kind(out)?;
        for column in &self.columns {
            let factor = if column.factor == 1.0 {
                String::new()
            } else {
                format!(" times {}", column.factor)
            };
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
