//! GCS arrays: the text that the data recorders of PI controllers and PI's software write.
//!
//! ```text
//! # REM E-753
//! # VERSION = 1
//! # TYPE = 1
//! # SEPARATOR = 32
//! # DIM = 2
//! # SAMPLE_TIME = 0.000040
//! # NDATA = 1024
//! # NAME0 = Target Position of axis 1
//! # NAME1 = Actual Position of axis 1
//! # END_HEADER
//! 0.0 0.0012
//! ```
//!
//! `SEPARATOR` is the character's code, `SAMPLE_TIME` is in seconds, `NDATA` counts rows. Units are not in the file.

use super::dialect::Dialect;
use super::options::{Decimal, Separator};
use crate::error::DataError;
use crate::place::{Place, shown};

/// The most columns a header may claim: far above what controllers record at once.
const MOST_COLUMNS: usize = 256;

/// Whether the first lines of a file are a GCS header.
pub(crate) fn is_header(lines: &[Vec<u8>]) -> bool {
    let marked = lines
        .iter()
        .take_while(|line| line.trim_ascii_start().starts_with(b"#") || line.trim_ascii().is_empty());
    let text = |line: &Vec<u8>| String::from_utf8_lossy(line).to_ascii_uppercase();
    marked
        .map(text)
        .any(|line| line.contains("END_HEADER") || line.contains("SAMPLE_TIME") || line.contains("NDATA"))
}

/// Reads the header.
pub(crate) fn find(lines: &[Vec<u8>], file: &str) -> Result<Dialect, DataError> {
    let mut dialect = Dialect {
        separator: Separator::Blank,
        decimal: Decimal::Point,
        header_line: None,
        units_line: None,
        first_sample: 0,
        names: Vec::new(),
        units: Vec::new(),
        period_s: None,
        samples: None,
    };
    let mut names: Vec<(usize, String)> = Vec::new();
    let mut columns = None;
    for (index, line) in lines.iter().enumerate() {
        let number = index as u64 + 1;
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        let text = String::from_utf8_lossy(line);
        let text = text.trim().trim_start_matches('#').trim();
        if text.eq_ignore_ascii_case("END_HEADER") {
            dialect.first_sample = number + 1;
            break;
        }
        let Some((key, value)) = text.split_once('=') else {
            continue;
        };
        let (key, value) = (key.trim().to_ascii_uppercase(), value.trim());
        match key.as_str() {
            "VERSION" if value != "1" => return Err(refuse(file, number, line, "VERSION = 1 is read")),
            "TYPE" if value != "1" => return Err(refuse(file, number, line, "TYPE = 1 (a table of text) is read")),
            "SEPARATOR" => {
                dialect.separator = separator(value).ok_or_else(|| {
                    refuse(
                        file,
                        number,
                        line,
                        "the separator is 32 (blank), 9 (tab), 44 (`,`) or 59 (`;`)",
                    )
                })?
            }
            "DIM" => {
                let dim = value.parse().ok().filter(|dim| (1..=MOST_COLUMNS).contains(dim));
                columns = Some(dim.ok_or_else(|| refuse(file, number, line, "DIM is a whole number from 1 to 256"))?);
            }
            "NDATA" => {
                let samples = value.parse().ok();
                dialect.samples = Some(samples.ok_or_else(|| refuse(file, number, line, "NDATA is a whole number"))?);
            }
            "SAMPLE_TIME" => {
                let period = value
                    .parse()
                    .ok()
                    .filter(|period: &f64| *period > 0.0 && period.is_finite());
                let allowed = "SAMPLE_TIME is a positive number of seconds";
                dialect.period_s = Some(period.ok_or_else(|| refuse(file, number, line, allowed))?);
            }
            _ => {
                if let Some(column) = key.strip_prefix("NAME").and_then(|column| column.parse().ok()) {
                    names.push((column, value.to_owned()));
                }
            }
        }
    }
    if dialect.first_sample == 0 {
        let at = Place::line(file, lines.len() as u64);
        return Err(DataError::NoHeader {
            at,
            found: "the GCS header has no end".into(),
            allowed: "it ends in a line `# END_HEADER`".into(),
        });
    }
    let Some(columns) = columns else {
        let at = Place::line(file, dialect.first_sample - 1);
        return Err(DataError::NoHeader {
            at,
            found: "the GCS header has no DIM".into(),
            allowed: "`# DIM = 2` says how many columns there are".into(),
        });
    };
    dialect.names = vec![String::new(); columns];
    dialect.units = dialect.names.clone();
    for (column, name) in names {
        if let Some(slot) = dialect.names.get_mut(column) {
            *slot = name;
        }
    }
    Ok(dialect)
}

fn separator(code: &str) -> Option<Separator> {
    match code {
        "32" => Some(Separator::Blank),
        "9" => Some(Separator::Tab),
        "44" => Some(Separator::Comma),
        "59" => Some(Separator::Semicolon),
        _ => None,
    }
}

fn refuse(file: &str, number: u64, line: &[u8], allowed: &str) -> DataError {
    DataError::NoHeader {
        at: Place::line(file, number),
        found: format!("found {} in the GCS header", shown(line)),
        allowed: allowed.to_owned(),
    }
}
