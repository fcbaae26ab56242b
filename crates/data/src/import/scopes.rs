//! Tables of oscilloscopes that are laid out as no other: Tektronix' TDS with its settings beside the samples, Rigol with
//! the clock in its second line or behind the names.

use super::cells::{self, Cell, Numerals};
use super::decode::{self, Encoding};
use super::dialect::Dialect;
use super::options::{Decimal, ImportOptions, Separator};
use crate::error::DataError;
use crate::place::{Place, shown};

/// The most columns that are believed.
const MOST_COLUMNS: usize = 64;

const POINT: Numerals = Numerals::plain(Decimal::Point);

/// The layout, if the head is one of these and the user does not say otherwise.
pub(crate) fn find(
    lines: &[Vec<u8>],
    encoding: Encoding,
    file: &str,
    options: &ImportOptions,
) -> Result<Option<Dialect>, DataError> {
    if options.separator.is_some() || options.decimal.is_some() || options.header_line.is_some() {
        return Ok(None);
    }
    let Some(first) = lines.first() else { return Ok(None) };
    let first = first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first);
    let cells: Vec<String> = texts(first, encoding);
    if cells.len() > MOST_COLUMNS {
        return Ok(None);
    }
    if cells[0].trim() == "Record Length" && cells.len() >= 5 {
        return Ok(Some(tektronix(lines, encoding)));
    }
    let is = |name: &str| cells.iter().any(|cell| cell.trim().eq_ignore_ascii_case(name));
    if cells[0].trim() == "X" && is("Start") && is("Increment") {
        return rigol_two_lines(&cells, lines, encoding, file).map(Some);
    }
    if cells.iter().any(|cell| setting(cell, "tinc").is_some()) {
        return rigol_one_line(&cells, first, file).map(Some);
    }
    Ok(None)
}

fn texts(line: &[u8], encoding: Encoding) -> Vec<String> {
    cells::all(line, Separator::Comma)
        .into_iter()
        .map(|cell| decode::text(cell, encoding))
        .collect()
}

fn dialect(names: Vec<String>, units: Vec<String>, header_line: Option<u64>, first_sample: u64) -> Dialect {
    Dialect {
        separator: Separator::Comma,
        numerals: POINT,
        header_line,
        units_line: None,
        first_sample,
        names,
        units,
        period_s: None,
        samples: None,
    }
}

/// Tektronix TDS 1000/2000: three columns of settings, `Source,CH1,` among them, and beside them time and one channel.
fn tektronix(lines: &[Vec<u8>], encoding: Encoding) -> Dialect {
    const SETTINGS: usize = 24;
    let setting = |name: &str| {
        let mut rows = lines.iter().take(SETTINGS).map(|line| texts(line, encoding));
        let row = rows.find(|row| row[0].trim().eq_ignore_ascii_case(name));
        row.and_then(|row| row.get(1).map(|value| value.trim().to_owned()))
            .unwrap_or_default()
    };
    let none = String::new;
    let columns = lines.first().map_or(5, |line| {
        cells::all(line, Separator::Comma).len().clamp(5, MOST_COLUMNS)
    });
    let mut names = vec![none(), none(), none(), "Time".to_owned(), setting("Source")];
    let mut units = vec![
        none(),
        none(),
        none(),
        setting("Horizontal Units"),
        setting("Vertical Units"),
    ];
    names.resize(columns, none());
    units.resize(columns, none());
    dialect(names, units, None, 1)
}

/// Rigol DS1000: `X,CH1,CH2,Start,Increment` and below it `Sequence,Volt,Volt,-6e-3,1e-5`; then rows of a number and the
/// channels.
fn rigol_two_lines(cells: &[String], lines: &[Vec<u8>], encoding: Encoding, file: &str) -> Result<Dialect, DataError> {
    let channels = cells
        .iter()
        .skip(1)
        .take_while(|cell| !cell.trim().eq_ignore_ascii_case("start"))
        .count();
    let second = lines.get(1).map_or(&[][..], Vec::as_slice);
    let units = texts(second, encoding);
    let increment = units.get(channels + 2).and_then(|cell| period(cell));
    let Some(period_s) = increment else {
        return Err(DataError::NoHeader {
            at: Place::line(file, 2),
            found: format!("found {} below Rigol's line of names", shown(second)),
            allowed: "it gives the units, the start and the increment, as in `Sequence,Volt,Volt,-6.0e-03,1.0e-05`"
                .into(),
        });
    };
    let mut names: Vec<String> = cells[..=channels].iter().map(|name| name.trim().to_owned()).collect();
    names[0] = "sample".into(); // not a time
    let mut units = units;
    units.truncate(channels + 1);
    units[0].clear();
    Ok(Dialect {
        units_line: Some(2),
        period_s: Some(period_s),
        ..dialect(names, units, Some(1), 3)
    })
}

/// Rigol DHO and MSO: `Time(s),CH1(V),CH2(V),t0 = -2.5e-3,tInc = 1e-6,` and rows of time and channels.
fn rigol_one_line(cells: &[String], line: &[u8], file: &str) -> Result<Dialect, DataError> {
    let columns = cells
        .iter()
        .take_while(|cell| setting(cell, "t0").is_none() && setting(cell, "tinc").is_none())
        .count();
    let increment = cells
        .iter()
        .find_map(|cell| setting(cell, "tinc"))
        .and_then(|text| period(&text));
    let (Some(period_s), true) = (increment, columns >= 2) else {
        return Err(DataError::NoHeader {
            at: Place::line(file, 1),
            found: format!("found {} as Rigol's line of names", shown(line)),
            allowed: "it ends in the start and the increment, as in `t0 = -2.5e-03,tInc = 1.0e-06`".into(),
        });
    };
    let names = cells[..columns].iter().map(|name| name.trim().to_owned()).collect();
    let mut dialect = dialect(names, vec![String::new(); columns], Some(1), 2);
    dialect.period_s = Some(period_s);
    Ok(dialect)
}

/// The value of `name = value`.
fn setting(cell: &str, name: &str) -> Option<String> {
    let (found, value) = cell.split_once('=')?;
    found.trim().eq_ignore_ascii_case(name).then(|| value.trim().to_owned())
}

/// A positive number, with or without an `s` behind it.
fn period(cell: &str) -> Option<f64> {
    match cells::read(cell.trim().trim_end_matches('s').trim().as_bytes(), POINT) {
        Cell::Number(period) if period > 0.0 => Some(period),
        _ => None,
    }
}
