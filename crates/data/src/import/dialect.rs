//! How a text file is laid out: separator, decimal sign, lines of names and units, first sample.
//!
//! Every separator and decimal sign is tried on the head of the file. The layout is the one under which the most cells
//! are numbers in rows of equal length; the names are in the line before them that has as many cells.

use std::cmp::Reverse;

use super::cells::{self, Cell, Numerals};
use super::decode::{self, Encoding};
use super::open::Layout;
use super::options::{Decimal, ImportOptions, Separator};
use super::preview::Kind;
use super::spelling;
use crate::error::DataError;
use crate::place::{Place, shown};

/// How a text file is laid out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Dialect {
    pub(crate) separator: Separator,
    pub(crate) numerals: Numerals,
    pub(crate) header_line: Option<u64>,
    pub(crate) units_line: Option<u64>,
    pub(crate) first_sample: u64,
    /// Names of the columns, empty where there is none.
    pub(crate) names: Vec<String>,
    /// Units from a line of their own, empty where there is none.
    pub(crate) units: Vec<String>,
    /// Sample period, seconds, where the file's head gives it.
    pub(crate) period_s: Option<f64>,
    /// Number of samples, where the file's head gives it.
    pub(crate) samples: Option<u64>,
}

impl Dialect {
    /// The kind of the file, for the preview.
    pub(crate) fn kind(&self, encoding: Encoding, layout: &Layout) -> Kind {
        match layout {
            Layout::Gcs => Kind::Gcs {
                first_sample_line: self.first_sample,
            },
            Layout::Sheet(name, _) => Kind::Sheet {
                name: name.clone(),
                header_row: self.header_line,
                units_row: self.units_line,
                first_sample_row: self.first_sample,
            },
            Layout::Table => Kind::Text {
                encoding,
                separator: self.separator,
                decimal: self.numerals.decimal,
                header_line: self.header_line,
                units_line: self.units_line,
                first_sample_line: self.first_sample,
            },
        }
    }
}

/// Layouts in the order in which they win when equal: a blank also splits what a tab splits, integers look the same with
/// both decimal signs, and `1,500` is a decimal comma unless another cell says that it is not.
const LAYOUTS: [(Separator, Decimal, bool); 12] = [
    (Separator::Tab, Decimal::Point, false),
    (Separator::Tab, Decimal::Comma, false),
    (Separator::Semicolon, Decimal::Point, false),
    (Separator::Semicolon, Decimal::Comma, false),
    (Separator::Comma, Decimal::Point, false),
    (Separator::Blank, Decimal::Point, false),
    (Separator::Blank, Decimal::Comma, false),
    (Separator::Tab, Decimal::Point, true),
    (Separator::Tab, Decimal::Comma, true),
    (Separator::Semicolon, Decimal::Point, true),
    (Separator::Semicolon, Decimal::Comma, true),
    (Separator::Comma, Decimal::Point, true),
];

/// Rows of equal length by which the table begins, if the file has so many.
const ROWS_TO_BEGIN: usize = 3;

/// The rows of numbers under one layout.
struct Rows {
    /// Index of the line of the first.
    first: usize,
    columns: usize,
    count: usize,
    /// Columns of text among them.
    texts: usize,
}

impl Rows {
    /// Cells that are numbers (or missing); among equals, fewest columns of text.
    fn score(&self) -> (usize, Reverse<usize>) {
        (self.count * (self.columns - self.texts), Reverse(self.texts))
    }
}

/// Finds the layout from the first lines of a file (all of them if `complete`).
pub(crate) fn find(
    lines: &[Vec<u8>],
    encoding: Encoding,
    file: &str,
    options: &ImportOptions,
) -> Result<Dialect, DataError> {
    let after = options
        .header_line
        .map_or(0, |line| usize::try_from(line).unwrap_or(usize::MAX));
    let mut best: Option<(Rows, Separator, Numerals)> = None;
    for (separator, decimal, grouped) in LAYOUTS {
        let told = |told: Option<Separator>, found| told.is_none_or(|told| told == found);
        if !told(options.separator, separator) || options.decimal.is_some_and(|told| told != decimal) {
            continue;
        }
        let numerals = Numerals { decimal, grouped };
        if let Some(rows) = rows(lines, after, separator, numerals)
            && best.as_ref().is_none_or(|(other, ..)| rows.score() > other.score())
        {
            best = Some((rows, separator, numerals));
        }
    }
    let Some((rows, separator, numerals)) = best else {
        return Err(no_table(lines, file));
    };
    let mut dialect = Dialect {
        separator,
        numerals,
        header_line: None,
        units_line: None,
        first_sample: rows.first as u64 + 1,
        names: vec![String::new(); rows.columns],
        units: vec![String::new(); rows.columns],
        period_s: None,
        samples: None,
    };
    match options.header_line {
        Some(0) => {}
        Some(line) => told_header(&mut dialect, lines, line, encoding, file)?,
        None => find_header(&mut dialect, lines, encoding, file)?,
    }
    if separator == Separator::Comma && options.separator.is_none() {
        refuse_decimal_commas(lines, &rows, file)?;
    }
    Ok(dialect)
}

/// The first block of rows under a layout.
fn rows(lines: &[Vec<u8>], after: usize, separator: Separator, numerals: Numerals) -> Option<Rows> {
    let mut first = after;
    while first < lines.len() {
        let Some(kinds) = kinds_of_row(&lines[first], separator, numerals) else {
            first += 1;
            continue;
        };
        let following = || lines[first..].iter().filter(|line| !line.trim_ascii().is_empty());
        let run = following()
            .take_while(|line| is_like(line, &kinds, separator, numerals))
            .count();
        // the line of names says where the table begins, though a cell in its first rows is damaged
        if run >= ROWS_TO_BEGIN || run == following().count() || follows_names(&lines[..first], separator, kinds.len())
        {
            let texts = kinds.iter().filter(|kind| **kind == Cell::Text).count();
            return Some(Rows {
                first,
                columns: kinds.len(),
                count: run,
                texts,
            });
        }
        first += 1;
    }
    None
}

/// Whether the line before is one of names, one a column, of which two are different quantities: `Vertical Units,V,V` of an
/// instrument's settings are none.
fn follows_names(before: &[Vec<u8>], separator: Separator, columns: usize) -> bool {
    let Some(line) = before.iter().rfind(|line| !line.trim_ascii().is_empty()) else {
        return false;
    };
    let Some(names) = names(line, separator, Encoding::of(line), columns) else {
        return false;
    };
    let mut quantities = names.iter().filter_map(|name| spelling::read(name).quantity);
    let first = quantities.next();
    quantities.any(|quantity| Some(quantity) != first)
}

/// The cells of a row: at least two that are numbers, or none that is text and one that is not just empty.
fn kinds_of_row(line: &[u8], separator: Separator, numerals: Numerals) -> Option<Vec<Cell>> {
    let mut kinds = Vec::new();
    let (mut numbers, mut spelled, mut texts) = (0, 0, 0);
    cells::split(line, separator, |_, cell| {
        let kind = cells::read(cell, numerals);
        numbers += usize::from(matches!(kind, Cell::Number(_)));
        spelled += usize::from(kind == Cell::Missing && !cell.is_empty());
        texts += usize::from(kind == Cell::Text);
        kinds.push(kind);
    });
    let is_row = numbers >= 2 || (texts == 0 && numbers + spelled >= 1);
    (is_row && kinds.len() >= 2).then_some(kinds)
}

/// Whether a line has as many cells as a row, and no text where the row has a number.
fn is_like(line: &[u8], kinds: &[Cell], separator: Separator, numerals: Numerals) -> bool {
    let mut alike = true;
    let count = cells::split(line, separator, |index, cell| {
        let text = || cells::read(cell, numerals) == Cell::Text;
        alike &= kinds.get(index).is_some_and(|kind| *kind == Cell::Text || !text());
    });
    alike && count == kinds.len()
}

fn no_table(lines: &[Vec<u8>], file: &str) -> DataError {
    let first = lines.iter().position(|line| !line.trim_ascii().is_empty());
    DataError::NoHeader {
        at: Place::line(file, first.map_or(1, |index| index as u64 + 1)),
        found: match first {
            Some(index) => format!(
                "no table of numbers found at or after {}",
                shown(lines[index].trim_ascii())
            ),
            None => "the file is empty".into(),
        },
        allowed: "a table has at least two columns of numbers separated by `,`, `;`, tab or blanks, as many in every \
                  line; decimal commas cannot be told from separating commas: save the file with `;` between columns"
            .into(),
    }
}

/// The cells of a line of names, without a comment sign before them.
fn names(line: &[u8], separator: Separator, encoding: Encoding, columns: usize) -> Option<Vec<String>> {
    let mut line = line.trim_ascii_end();
    line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
    for sign in [b"#".as_slice(), b"%", b"//", b"!"] {
        line = line.strip_prefix(sign).unwrap_or(line);
    }
    let as_text = |cells: Vec<&[u8]>| {
        cells
            .into_iter()
            .map(|cell| decode::text(cell, encoding))
            .collect::<Vec<_>>()
    };
    let mut found = as_text(cells::all(line, separator));
    if separator == Separator::Blank && found.len() != columns {
        // names of several words: two blanks or a tab between columns
        let text = decode::text(line, encoding).replace('\t', "  ");
        found = text
            .split("  ")
            .map(str::trim)
            .filter(|name| !name.is_empty())
            .map(str::to_owned)
            .collect();
    }
    while found.len() > columns && found.last().is_some_and(String::is_empty) {
        found.pop();
    }
    if found.len() + 1 == columns {
        found.push(String::new()); // rows that end in a separator
    }
    (found.len() == columns && found.iter().any(|name| !name.is_empty())).then_some(found)
}

fn is_units(cells: &[String]) -> bool {
    cells.iter().all(|cell| is_no_unit(cell) || spelling::is_unit(cell)) && !cells.iter().all(|cell| is_dash(cell))
}

/// An empty cell, or the dash that stands for a pure number.
fn is_no_unit(cell: &str) -> bool {
    cell.is_empty() || is_dash(cell)
}

fn is_dash(cell: &str) -> bool {
    ["-", "[-]", "(-)", "–"].contains(&cell.trim())
}

fn bare_units(cells: Vec<String>) -> Vec<String> {
    cells
        .into_iter()
        .map(|cell| match spelling::unbracketed(&cell) {
            _ if is_dash(&cell) => String::new(),
            Some(unit) => unit.to_owned(),
            None => cell,
        })
        .collect()
}

/// Finds names, and units in a line of their own, before the first row.
fn find_header(dialect: &mut Dialect, lines: &[Vec<u8>], encoding: Encoding, file: &str) -> Result<(), DataError> {
    let columns = dialect.names.len();
    let first = dialect.first_sample as usize - 1;
    let mut before = (0..first).rev().filter(|&index| !lines[index].trim_ascii().is_empty());
    let Some(nearest) = before.next() else { return Ok(()) };
    let Some(found) = names(&lines[nearest], dialect.separator, encoding, columns) else {
        return refuse_other_count(dialect, &lines[nearest], nearest, file);
    };
    if !is_units(&found) {
        dialect.header_line = Some(nearest as u64 + 1);
        dialect.names = found;
        return Ok(());
    }
    dialect.units_line = Some(nearest as u64 + 1);
    dialect.units = bare_units(found);
    if let Some(index) = before.next()
        && let Some(found) = names(&lines[index], dialect.separator, encoding, columns)
    {
        dialect.header_line = Some(index as u64 + 1);
        dialect.names = found;
    }
    Ok(())
}

/// A line of names that has another number of cells than the rows: most likely commas that mean two things.
fn refuse_other_count(dialect: &Dialect, line: &[u8], index: usize, file: &str) -> Result<(), DataError> {
    let cells = cells::all(line, dialect.separator);
    let known = cells
        .iter()
        .filter(|cell| spelling::read(&String::from_utf8_lossy(cell)).quantity.is_some())
        .count();
    if known < 2 {
        return Ok(()); // a remark, no names
    }
    Err(DataError::Ambiguous {
        at: Place::line(file, index as u64 + 1),
        found: format!(
            "{} names, but the rows have {} cells separated by {}",
            cells.len(),
            dialect.names.len(),
            dialect.separator.name()
        ),
        what_to_do: "if commas are decimal signs, save the file with `;` between columns; if this is not the line of \
                     names, give it with `--header-line`"
            .into(),
    })
}

/// Takes the names from the line the user gives, and units from a line between it and the first row.
fn told_header(
    dialect: &mut Dialect,
    lines: &[Vec<u8>],
    line: u64,
    encoding: Encoding,
    file: &str,
) -> Result<(), DataError> {
    let columns = dialect.names.len();
    let index = line as usize - 1;
    let Some(found) = lines
        .get(index)
        .and_then(|text| names(text, dialect.separator, encoding, columns))
    else {
        let text = lines.get(index).map_or(&[][..], Vec::as_slice);
        return Err(DataError::NoHeader {
            at: Place::line(file, line),
            found: format!("found {} as names for {columns} columns", shown(text)),
            allowed: format!(
                "the line of names has one name a column, separated by {}",
                dialect.separator.name()
            ),
        });
    };
    dialect.header_line = Some(line);
    dialect.names = found;
    let before_samples = &lines[..dialect.first_sample as usize - 1];
    for (between, text) in before_samples.iter().enumerate().skip(index + 1) {
        if let Some(found) = names(text, dialect.separator, encoding, columns).filter(|found| is_units(found)) {
            dialect.units_line = Some(between as u64 + 1);
            dialect.units = bare_units(found);
        }
    }
    Ok(())
}

/// Refuses a table of comma-separated integers some of which begin with a zero: `0,05,1,25` is a decimal comma.
fn refuse_decimal_commas(lines: &[Vec<u8>], rows: &Rows, file: &str) -> Result<(), DataError> {
    let mut zero_led = None;
    for (index, line) in lines.iter().enumerate().skip(rows.first).take(rows.count) {
        if line.iter().any(|byte| b".eE".contains(byte)) {
            return Ok(());
        }
        let led = |cell: &[u8]| cell.len() > 1 && cell[0] == b'0' && cell.iter().all(u8::is_ascii_digit);
        cells::split(line, Separator::Comma, |_, cell| {
            if zero_led.is_none() && led(cell) {
                zero_led = Some((index, shown(line)));
            }
        });
    }
    match zero_led {
        Some((index, line)) => Err(DataError::Ambiguous {
            at: Place::line(file, index as u64 + 1),
            found: format!("{line} looks like decimal commas between separating commas"),
            what_to_do: "save the file with `;` between columns, or say `--separator comma` if these are integers"
                .into(),
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<Vec<u8>> {
        text.lines().map(|line| line.as_bytes().to_vec()).collect()
    }

    /// separator, decimal sign, line of names, line of units, line of the first sample, names
    type Expect<'a> = (Separator, Decimal, Option<u64>, Option<u64>, u64, &'a [&'a str]);

    fn check(text: &str, expect: Expect) {
        let found = find(&lines(text), Encoding::Utf8, "a.csv", &ImportOptions::default());
        let found = found.unwrap_or_else(|error| panic!("{text:?}: {error}"));
        let names: Vec<&str> = found.names.iter().map(String::as_str).collect();
        let found = (
            found.separator,
            found.numerals.decimal,
            found.header_line,
            found.units_line,
            found.first_sample,
            &*names,
        );
        assert_eq!(found, expect, "{text:?}");
    }

    #[test]
    fn val_layouts_of_usual_programs() {
        use Decimal::{Comma as DC, Point as DP};
        use Separator::{Blank, Comma, Semicolon, Tab};
        check(
            "t,u,y\n0,1.5,2\n1,2.5,3\n",
            (Comma, DP, Some(1), None, 2, &["t", "u", "y"]),
        );
        check(
            "t;u;y\n0;1,5;2\n1;2,5;3\n",
            (Semicolon, DC, Some(1), None, 2, &["t", "u", "y"]),
        );
        check(
            "t;u;y\n0;1.5;2\n1;2.5;3\n",
            (Semicolon, DP, Some(1), None, 2, &["t", "u", "y"]),
        );
        check(
            "t\tu\ty\n0,0\t1,5\t2\n1,0\t2,5\t3\n",
            (Tab, DC, Some(1), None, 2, &["t", "u", "y"]),
        );
        check(
            "t u y\n0.0 1.5 2\n1.0 2.5  3\n",
            (Blank, DP, Some(1), None, 2, &["t", "u", "y"]),
        );
        check("  0,0  1,5\n  1,0  2,5\n", (Blank, DC, None, None, 1, &["", ""]));
        check(
            "# time, voltage\n0, 1.5\n1, 2.5\n",
            (Comma, DP, Some(1), None, 2, &["time", "voltage"]),
        );
        check("% t  u\n1e-3 2\n2e-3 3\n", (Blank, DP, Some(1), None, 2, &["t", "u"]));
        check(
            "Time (s)  Drive voltage (V)\n0 1\n1 2\n",
            (Blank, DP, Some(1), None, 2, &["Time (s)", "Drive voltage (V)"]),
        );
        // PicoScope: names, units in brackets, an empty line
        check(
            "Time,Channel A\n(ms),(V)\n\n0,1.5\n1,2.5\n",
            (Comma, DP, Some(1), Some(2), 4, &["Time", "Channel A"]),
        );
        // a dash where a quantity has no unit
        check(
            "Zeit;Spannung;Weg;Trigger\nms;V;nm;-\n0;1,5;2;0\n1;2,5;3;0\n",
            (
                Semicolon,
                DC,
                Some(1),
                Some(2),
                3,
                &["Zeit", "Spannung", "Weg", "Trigger"],
            ),
        );
        // Keysight
        check(
            "x-axis,1,2\nsecond,Volt,Volt\n-1E-3,1,2\n0E-3,3,4\n",
            (Comma, DP, Some(1), Some(2), 3, &["x-axis", "1", "2"]),
        );
        // LabVIEW: a preamble with rows of its own
        check(
            "LabVIEW Measurement\t\nSamples\t2\t2\n***End_of_Header***\t\nX_Value\tU\tComment\n0,0\t1,5\t\n0,1\t2,5\t\n",
            (Tab, DC, Some(4), None, 5, &["X_Value", "U", "Comment"]),
        );
        check(
            "Date: 2026-11-21\nRate: 5000\n\nt,u\n0,1.5\n1,2\n2,3\n",
            (Comma, DP, Some(4), None, 5, &["t", "u"]),
        );
        // An oscilloscope: a line of settings for two channels is no line of names, the next one no first row
        check(
            "Model,DSO,\nVertical Units,V,V\nProbe Attenuation,1,1\n,,\nTIME,CH1,CH2\n-1e-3,0.5,0.1\n0,0.6,0.2\n1e-3,0.7,0.3\n",
            (Comma, DP, Some(5), None, 6, &["TIME", "CH1", "CH2"]),
        );
        check("t;u;\n0;1;\n1;2;\n", (Semicolon, DP, Some(1), None, 2, &["t", "u", ""]));
        check(
            "\"t\",\"Position, um\"\n\"0\",\"1.5\"\n\"1\",\"2\"\n",
            (Comma, DP, Some(1), None, 2, &["t", "Position, um"]),
        );
    }

    #[test]
    fn refuse_layouts_that_can_be_read_in_two_ways() {
        const SEMICOLON: &str = "save the file with `;` between columns";
        let no_table = format!(
            "a table has at least two columns of numbers separated by `,`, `;`, tab or blanks, as many in every line; \
             decimal commas cannot be told from separating commas: {SEMICOLON}"
        );
        for (text, expect) in [
            ("", "a.csv, line 1: the file is empty; ".to_owned() + &no_table),
            (
                "hello\nworld\n",
                "a.csv, line 1: no table of numbers found at or after `hello`; ".to_owned() + &no_table,
            ),
            (
                "1\n2\n",
                "a.csv, line 1: no table of numbers found at or after `1`; ".to_owned() + &no_table,
            ),
            (
                "time,voltage,position\n0,001,1,5,2,25\n0,002,1,6,2,35\n",
                format!(
                    "a.csv, line 1: 3 names, but the rows have 6 cells separated by `,`; if commas are decimal signs, \
                     {SEMICOLON}; if this is not the line of names, give it with `--header-line`"
                ),
            ),
            (
                "0,001,1,5\n0,002,1,6\n",
                format!(
                    "a.csv, line 1: `0,001,1,5` looks like decimal commas between separating commas; {SEMICOLON}, or \
                     say `--separator comma` if these are integers"
                ),
            ),
        ] {
            let found = find(&lines(text), Encoding::Utf8, "a.csv", &ImportOptions::default());
            assert_eq!(found.unwrap_err().to_string(), expect, "{text:?}");
        }
    }
}
