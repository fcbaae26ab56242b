//! Splits a line into cells and reads numbers in them.

use super::options::{Decimal, Separator};

/// What a cell is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Cell {
    /// A finite number.
    Number(f64),
    /// Empty, or one of the spellings of "no number".
    Missing,
    /// Anything else.
    Text,
}

/// Spellings of "no number", in lower case.
const MISSING: &[&str] = &[
    "",
    "nan",
    "-nan",
    "+nan",
    "na",
    "n/a",
    "#n/a",
    "null",
    "none",
    "-",
    "--",
    "---",
    "inf",
    "-inf",
    "+inf",
    "infinity",
    "-infinity",
    "1.#qnan",
    "-1.#ind",
    "1.#inf",
    "-1.#inf",
    "overload",
    "ovl",
];

/// Calls `each` with every cell of a line and its index, left to right; gives the number of cells.
pub(crate) fn split<'a>(line: &'a [u8], separator: Separator, mut each: impl FnMut(usize, &'a [u8])) -> usize {
    let single = match separator {
        Separator::Comma => b',',
        Separator::Semicolon => b';',
        Separator::Tab => b'\t',
        Separator::Blank => return split_blanks(line, each),
    };
    let mut count = 0;
    let (mut begin, mut quoted) = (0, false);
    for (at, &byte) in line.iter().enumerate() {
        if byte == b'"' {
            quoted = !quoted;
        } else if byte == single && !quoted {
            each(count, unquoted(&line[begin..at]));
            count += 1;
            begin = at + 1;
        }
    }
    each(count, unquoted(&line[begin..]));
    count + 1
}

fn split_blanks<'a>(line: &'a [u8], mut each: impl FnMut(usize, &'a [u8])) -> usize {
    let cells = line
        .split(|byte| byte.is_ascii_whitespace())
        .filter(|cell| !cell.is_empty());
    let mut count = 0;
    for (index, cell) in cells.enumerate() {
        each(index, unquoted(cell));
        count = index + 1;
    }
    count
}

/// A cell without blanks and quotes around it.
fn unquoted(cell: &[u8]) -> &[u8] {
    let cell = cell.trim_ascii();
    let inside = cell.strip_prefix(b"\"").and_then(|cell| cell.strip_suffix(b"\""));
    inside.map_or(cell, <[u8]>::trim_ascii)
}

/// All cells of a line.
pub(crate) fn all(line: &[u8], separator: Separator) -> Vec<&[u8]> {
    let mut cells = Vec::new();
    split(line, separator, |_, cell| cells.push(cell));
    cells
}

/// The longest cell that can be a number: a subnormal in full has some 1100 digits, real ones below 30.
const LONGEST_NUMBER: usize = 64;

/// How numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Numerals {
    pub(crate) decimal: Decimal,
    /// Whether digits before the decimal sign may stand in groups of three: `1,234.5`, `1.234,5`, `1'234.5`.
    pub(crate) grouped: bool,
}

impl Numerals {
    /// Without groups.
    pub(crate) const fn plain(decimal: Decimal) -> Numerals {
        Numerals {
            decimal,
            grouped: false,
        }
    }
}

/// Reads a cell.
pub(crate) fn read(cell: &[u8], numerals: Numerals) -> Cell {
    match read_plain(cell, numerals.decimal) {
        Cell::Text if numerals.grouped => match without_groups(cell, numerals.decimal) {
            Some((bytes, length)) => read_plain(&bytes[..length], numerals.decimal),
            None => Cell::Text,
        },
        found => found,
    }
}

/// A number without the signs between its groups of three digits, which must all be there and all the same.
fn without_groups(cell: &[u8], decimal: Decimal) -> Option<([u8; LONGEST_NUMBER], usize)> {
    let point = if decimal == Decimal::Comma { b',' } else { b'.' };
    if cell.len() > LONGEST_NUMBER {
        return None;
    }
    let signed = usize::from(matches!(cell.first(), Some(b'+' | b'-')));
    let end = cell.iter().position(|&byte| byte == point).unwrap_or(cell.len());
    let (sign, whole, rest) = (&cell[..signed], cell.get(signed..end)?, &cell[end..]);
    let lead = whole.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let after = &whole[lead..];
    let mark_end = after.iter().position(u8::is_ascii_digit)?;
    let mark = &after[..mark_end];
    // a comma or a point (the one that is not the decimal sign), an apostrophe, a blank that does not break lines
    let other = if decimal == Decimal::Comma { b"." } else { b"," };
    let known: [&[u8]; 8] = [
        other,
        b"'",
        b" ",
        b"\xa0",
        "\u{2019}".as_bytes(),
        "\u{a0}".as_bytes(),
        "\u{202f}".as_bytes(),
        "\u{2009}".as_bytes(),
    ];
    if !(1..=3).contains(&lead) || whole[0] == b'0' || !known.contains(&mark) {
        return None;
    }
    let mut out = [0; LONGEST_NUMBER];
    let mut length = 0;
    let mut push = |bytes: &[u8]| {
        for &byte in bytes {
            out[length] = byte;
            length += 1;
        }
    };
    push(sign);
    push(&whole[..lead]);
    let mut groups = after;
    while !groups.is_empty() {
        let group = groups.strip_prefix(mark)?.get(..3)?;
        if !group.iter().all(u8::is_ascii_digit) {
            return None;
        }
        push(group);
        groups = &groups[mark.len() + 3..];
    }
    push(rest);
    Some((out, length))
}

/// Reads a cell without groups of digits.
fn read_plain(cell: &[u8], decimal: Decimal) -> Cell {
    let parsed = match decimal {
        Decimal::Point => std::str::from_utf8(cell).ok().and_then(|text| text.parse::<f64>().ok()),
        Decimal::Comma => with_point(cell).and_then(|(bytes, length)| {
            std::str::from_utf8(&bytes[..length])
                .ok()
                .and_then(|text| text.parse::<f64>().ok())
        }),
    };
    match parsed {
        Some(value) if value.is_finite() => Cell::Number(value),
        _ if cell.len() < LONGEST_NUMBER
            && std::str::from_utf8(cell).is_ok_and(|text| MISSING.contains(&text.to_ascii_lowercase().as_str())) =>
        {
            Cell::Missing
        }
        _ => Cell::Text,
    }
}

/// A number with its decimal comma made a point; a cell with a point is none, so that `1.234,5` is refused.
fn with_point(cell: &[u8]) -> Option<([u8; LONGEST_NUMBER], usize)> {
    if cell.len() > LONGEST_NUMBER || cell.contains(&b'.') {
        return None;
    }
    let mut out = [0; LONGEST_NUMBER];
    for (to, &from) in out.iter_mut().zip(cell) {
        *to = if from == b',' { b'.' } else { from };
    }
    Some((out, cell.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_lines_split_into_cells() {
        for (line, separator, expect) in [
            ("a,b,,c", Separator::Comma, vec!["a", "b", "", "c"]),
            ("\"a,1\", b ,\"\"", Separator::Comma, vec!["a,1", "b", ""]),
            ("1,5;2;", Separator::Semicolon, vec!["1,5", "2", ""]),
            ("a\t b c\t", Separator::Tab, vec!["a", "b c", ""]),
            ("  1.0   2\t3 ", Separator::Blank, vec!["1.0", "2", "3"]),
            ("", Separator::Comma, vec![""]),
            ("\"a", Separator::Comma, vec!["\"a"]),
        ] {
            let found: Vec<_> = all(line.as_bytes(), separator)
                .into_iter()
                .map(|c| str::from_utf8(c).unwrap())
                .collect();
            assert_eq!(found, expect, "{line}");
        }
    }

    #[test]
    fn val_cells_are_numbers_missing_or_text() {
        for (cell, decimal, expect) in [
            ("1.5", Decimal::Point, Cell::Number(1.5)),
            ("1,5", Decimal::Comma, Cell::Number(1.5)),
            ("-2,5E-3", Decimal::Comma, Cell::Number(-0.0025)),
            ("7", Decimal::Comma, Cell::Number(7.0)),
            ("1,5", Decimal::Point, Cell::Text),
            ("1.5", Decimal::Comma, Cell::Text),
            ("1.234,5", Decimal::Comma, Cell::Text),
            ("1,234.5", Decimal::Point, Cell::Text),
            ("1,2,3", Decimal::Comma, Cell::Text),
            ("", Decimal::Point, Cell::Missing),
            ("NaN", Decimal::Comma, Cell::Missing),
            ("-Inf", Decimal::Point, Cell::Missing),
            ("1e999", Decimal::Point, Cell::Text),
            ("2 V", Decimal::Point, Cell::Text),
        ] {
            assert_eq!(read(cell.as_bytes(), Numerals::plain(decimal)), expect, "{cell}");
        }
    }

    #[test]
    fn val_thousands_in_groups_of_three() {
        for (cell, decimal, expect) in [
            ("1,234.5", Decimal::Point, Cell::Number(1234.5)),
            ("-12,345,678", Decimal::Point, Cell::Number(-12_345_678.0)),
            ("1.234,5", Decimal::Comma, Cell::Number(1234.5)),
            ("1'234.5e-3", Decimal::Point, Cell::Number(1.2345)),
            ("1\u{202f}234,5", Decimal::Comma, Cell::Number(1234.5)),
            ("999.5", Decimal::Point, Cell::Number(999.5)),
            ("1,23.5", Decimal::Point, Cell::Text),
            ("1234,567.5", Decimal::Point, Cell::Text),
            ("0,123", Decimal::Point, Cell::Text),
            ("1,234'567", Decimal::Point, Cell::Text),
            ("1,2345", Decimal::Point, Cell::Text),
            (",234", Decimal::Point, Cell::Text),
            ("1,", Decimal::Point, Cell::Text),
            ("-", Decimal::Point, Cell::Missing),
        ] {
            let numerals = Numerals { decimal, grouped: true };
            assert_eq!(read(cell.as_bytes(), numerals), expect, "{cell}");
        }
    }
}
