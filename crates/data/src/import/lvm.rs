//! LabVIEW's measurement files, `.lvm`: text with a head of its own, and sections with heads of theirs.
//!
//! ```text (tabs between the cells)
//! LabVIEW Measurement
//! Separator  Tab
//! Decimal_Separator  ,
//! X_Columns  One
//! ***End_of_Header***
//!
//! Channels  2
//! Y_Unit_Label  V  um
//! X0  0,0  0,0
//! Delta_X  0,001  0,001
//! ***End_of_Header***
//! X_Value  Voltage  Position  Comment
//! 0,0  1,5  0,25
//! ```
//!
//! A section is a run of its own. `X_Columns` says whether the time stands once, before each channel, or nowhere: then it
//! follows from `X0` and `Delta_X`.
//!
//! # Reference
//! National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".

use std::io::Read;

use super::arrays::{Array, Budget, Contents, Fault, Format, broken};
use super::cells::{self, Cell, Numerals};
use super::decode::{self, Decoded, Encoding};
use super::options::{Decimal, Separator};
use crate::clock::Clock;
use crate::lines::{LineFault, Lines};
use crate::place::shown;

/// LabVIEW's `.lvm`.
pub(crate) const FORMAT: Format = Format {
    what: "LabVIEW measurement file",
    noun: "column",
    again: "write it again with LabVIEW's Write Measurement File",
    read,
};

/// What every file begins with.
pub(crate) const MAGIC: &[u8] = b"LabVIEW Measurement";

const END: &[u8] = b"***End_of_Header***";

/// The most sections of a file.
const MOST_SECTIONS: usize = 4096;

/// How the file is written.
struct Style {
    separator: Separator,
    numerals: Numerals,
    x: XColumns,
}

/// Where the time stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum XColumns {
    No,
    One,
    Multi,
}

/// A section while it is read.
#[derive(Default)]
struct Section {
    units: Vec<String>,
    start: Vec<f64>,
    period: Vec<f64>,
    /// Names of all columns, the comment's too.
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let mut lines = Lines::new(Decoded::new(source, Encoding::Utf8));
    let mut style = Style {
        separator: Separator::Tab,
        numerals: Numerals::plain(Decimal::Point),
        x: XColumns::One,
    };
    let mut budget = Budget::new();
    let mut sections: Vec<Section> = Vec::new();
    let mut section = Section::default();
    let mut in_head = true;
    let mut done = 0;
    loop {
        let bytes = lines.bytes();
        let Some((number, line)) = lines.next_line().map_err(line_fault)? else {
            break;
        };
        if number == 1 {
            style.separator = if line.contains(&b',') {
                Separator::Comma
            } else {
                Separator::Tab
            };
        }
        if bytes > done + (1 << 20) {
            done = bytes;
            progress(bytes);
        }
        if line.trim_ascii().is_empty() {
            close(&mut section, &mut sections)?;
            continue;
        }
        let cells = cells::all(line, style.separator);
        if in_head {
            in_head = cells[0] != END;
            style.take(&cells)?;
        } else if section.names.is_empty() {
            section.head(&cells, &style);
        } else if cells[0].starts_with(MAGIC) {
            close(&mut section, &mut sections)?; // files put one after the other
            in_head = true;
        } else if cells[0] == b"Channels" {
            close(&mut section, &mut sections)?;
            section.head(&cells, &style);
        } else {
            section.row(&cells, number, &style, &mut budget)?;
        }
    }
    close(&mut section, &mut sections)?;
    progress(lines.bytes());
    let mut runs = sections.into_iter().map(|section| section.arrays(style.x));
    Ok(Contents {
        arrays: runs.next().unwrap_or_default(),
        later: runs.collect(),
        skipped: Vec::new(),
    })
}

fn line_fault(fault: LineFault) -> Fault {
    match fault {
        LineFault::Io(error) => Fault::Io(error),
        LineFault::TooLong { line } => Fault::Broken(format!("line {line} has no end")),
    }
}

/// Puts a section that has samples to the others.
fn close(section: &mut Section, sections: &mut Vec<Section>) -> Result<(), Fault> {
    if section.columns.iter().any(|column| !column.is_empty()) {
        if sections.len() >= MOST_SECTIONS {
            return broken(format!("more than {MOST_SECTIONS} sections"));
        }
        sections.push(std::mem::take(section));
    }
    Ok(())
}

impl Style {
    /// Takes a line of the file's head.
    fn take(&mut self, cells: &[&[u8]]) -> Result<(), Fault> {
        let Some(value) = cells.get(1) else { return Ok(()) };
        match cells[0] {
            b"Separator" => match *value {
                b"Tab" => self.separator = Separator::Tab,
                b"Comma" => self.separator = Separator::Comma,
                other => return broken(format!("Separator is {}, known are Tab and Comma", shown(other))),
            },
            b"Decimal_Separator" => {
                let comma =
                    *value == b"," || (value.is_empty() && self.separator == Separator::Comma && cells.len() > 2);
                self.numerals = Numerals::plain(if comma { Decimal::Comma } else { Decimal::Point });
            }
            b"X_Columns" => {
                self.x = match *value {
                    b"No" => XColumns::No,
                    b"Multi" => XColumns::Multi,
                    _ => XColumns::One,
                }
            }
            _ => {}
        }
        Ok(())
    }
}

impl Section {
    /// Takes a line of the section's head, or the line of names.
    fn head(&mut self, cells: &[&[u8]], style: &Style) {
        let text = |cell: &&[u8]| decode::text(cell, Encoding::of(cell)).trim().to_owned();
        let numbers = || {
            cells[1..]
                .iter()
                .map_while(|cell| match cells::read(cell, style.numerals) {
                    Cell::Number(value) => Some(value),
                    _ => None,
                })
                .collect()
        };
        match cells[0] {
            b"X_Value" => {
                self.names = cells.iter().map(text).collect();
                self.columns = vec![Vec::new(); self.names.len()];
            }
            b"Y_Unit_Label" => self.units = cells[1..].iter().map(text).collect(),
            b"X0" => self.start = numbers(),
            b"Delta_X" => self.period = numbers(),
            _ => {}
        }
    }

    /// Takes a row.
    fn row(&mut self, cells: &[&[u8]], line: u64, style: &Style, budget: &mut Budget) -> Result<(), Fault> {
        budget.take(self.columns.len() as u64, "the file")?;
        for (index, column) in self.columns.iter_mut().enumerate() {
            let cell = cells.get(index).copied().unwrap_or_default();
            let is_comment = self.names[index] == "Comment";
            match cells::read(cell, style.numerals) {
                Cell::Number(value) => column.push(value),
                Cell::Missing => column.push(f64::NAN),
                Cell::Text if is_comment => column.push(f64::NAN),
                Cell::Text => {
                    return Err(Fault::Foreign(
                        format!(
                            "line {line}, column {} ({}): found {}",
                            index + 1,
                            self.names[index],
                            shown(cell)
                        ),
                        "allowed is a number with the decimal sign that the head of the file gives".into(),
                    ));
                }
            }
        }
        Ok(())
    }

    /// The columns as arrays. The clock is that of `X0` and `Delta_X`, which have all digits, where the times are those;
    /// else the column of times, if there is one for all channels.
    fn arrays(self, x: XColumns) -> Vec<Array> {
        let is_x = |name: &String| name == "X_Value";
        let columns = self.names.iter().zip(&self.columns);
        let times: Vec<&Vec<f64>> = columns
            .filter(|(name, _)| is_x(name))
            .map(|(_, column)| column)
            .collect();
        let follows = times.iter().enumerate().all(|(channel, times)| {
            let clock = self.start.get(channel).zip(self.period.get(channel));
            clock.is_some_and(|(start, period)| {
                let due = |row: usize| start + row as f64 * period;
                *period > 0.0
                    && times
                        .iter()
                        .enumerate()
                        .all(|(row, time)| time.is_nan() || (time - due(row)).abs() < 0.5 * period)
            })
        });
        let one_time = x != XColumns::No && !follows && times.windows(2).all(|pair| pair[0] == pair[1]);
        let mut channel = 0;
        let mut arrays: Vec<Array> = Vec::new();
        for (name, mut values) in self.names.iter().zip(self.columns) {
            if name == "Comment" || name.is_empty() {
                continue;
            }
            if is_x(name) {
                if one_time && !arrays.iter().any(|array| is_x(&array.name)) {
                    arrays.push(Array {
                        unit: "s".into(),
                        ..Array::vector("X_Value", values)
                    });
                }
                continue;
            }
            // a channel with fewer samples than others ends in empty cells
            if x != XColumns::One {
                let end = values
                    .iter()
                    .rposition(|value| !value.is_nan())
                    .map_or(0, |last| last + 1);
                values.truncate(end);
            }
            let period = self.period.get(channel).copied().filter(|period| *period > 0.0);
            let clock_s = period.map(|period| Clock {
                start: self.start.get(channel).copied().unwrap_or(0.0),
                period,
            });
            arrays.push(Array {
                unit: self.units.get(channel).cloned().unwrap_or_default(),
                clock_s: clock_s.filter(|_| follows || x == XColumns::No),
                ..Array::vector(name.as_str(), values)
            });
            channel += 1;
        }
        arrays
    }
}
