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

use super::cells::Numerals;
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

/// What a header says.
#[derive(Default)]
struct Header {
    separator: Option<Separator>,
    columns: Option<usize>,
    period_s: Option<f64>,
    samples: Option<u64>,
    names: Vec<(usize, String)>,
}

impl Header {
    /// Takes a line `KEY = value`; gives what is allowed if the value is not.
    fn take(&mut self, key: &str, value: &str) -> Result<(), &'static str> {
        match key {
            "VERSION" if value != "1" => return Err("VERSION = 1 is read"),
            "TYPE" if value != "1" => return Err("TYPE = 1 (a table of text) is read"),
            "SEPARATOR" => {
                let separator = separator(value);
                self.separator = Some(separator.ok_or("the separator is 32 (blank), 9 (tab), 44 (`,`) or 59 (`;`)")?);
            }
            "DIM" => {
                let columns = value
                    .parse()
                    .ok()
                    .filter(|columns| (1..=MOST_COLUMNS).contains(columns));
                self.columns = Some(columns.ok_or("DIM is a whole number from 1 to 256")?);
            }
            "NDATA" => self.samples = Some(value.parse().map_err(|_| "NDATA is a whole number")?),
            "SAMPLE_TIME" => {
                let period = value
                    .parse()
                    .ok()
                    .filter(|period: &f64| *period > 0.0 && period.is_finite());
                self.period_s = Some(period.ok_or("SAMPLE_TIME is a positive number of seconds")?);
            }
            _ => {
                if let Some(column) = key.strip_prefix("NAME").and_then(|column| column.parse().ok()) {
                    self.names.push((column, value.to_owned()));
                }
            }
        }
        Ok(())
    }
}

/// Reads the header.
pub(crate) fn find(lines: &[Vec<u8>], file: &str) -> Result<Dialect, DataError> {
    let mut header = Header::default();
    let mut end = None;
    for (index, line) in lines.iter().enumerate() {
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        let text = String::from_utf8_lossy(line);
        let text = text.trim().trim_start_matches('#').trim();
        if text.eq_ignore_ascii_case("END_HEADER") {
            end = Some(index as u64 + 1);
            break;
        }
        if let Some((key, value)) = text.split_once('=') {
            let taken = header.take(&key.trim().to_ascii_uppercase(), value.trim());
            taken.map_err(|allowed| DataError::NoHeader {
                at: Place::line(file, index as u64 + 1),
                found: format!("found {} in the GCS header", shown(line)),
                allowed: allowed.to_owned(),
            })?;
        }
    }
    let refuse = |line: u64, found: &str, allowed: &str| DataError::NoHeader {
        at: Place::line(file, line),
        found: found.into(),
        allowed: allowed.into(),
    };
    let end = end.ok_or_else(|| {
        refuse(
            lines.len() as u64,
            "the GCS header has no end",
            "it ends in a line `# END_HEADER`",
        )
    })?;
    let columns = header.columns.ok_or_else(|| {
        refuse(
            end,
            "the GCS header has no DIM",
            "`# DIM = 2` says how many columns there are",
        )
    })?;
    let mut names = vec![String::new(); columns];
    for (column, name) in header.names {
        if let Some(slot) = names.get_mut(column) {
            *slot = name;
        }
    }
    Ok(Dialect {
        separator: header.separator.unwrap_or(Separator::Blank),
        numerals: Numerals::plain(Decimal::Point),
        header_line: None,
        units_line: None,
        first_sample: end + 1,
        units: vec![String::new(); columns],
        names,
        period_s: header.period_s,
        samples: header.samples,
    })
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
