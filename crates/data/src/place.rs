//! Where in a file something is: file, line and column, counted from 1 as editors and spreadsheets do.

use std::fmt;

/// A place in a file, as an error names it: `run.csv, line 17, column 3 (position_um)`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file, as the user named it.
    pub file: String,
    /// Line, the first is 1.
    pub line: Option<u64>,
    /// Column, the first is 1, and its name (empty where it has none). Boxed to keep results small.
    pub column: Option<Box<(usize, String)>>,
}

impl Place {
    /// The file as a whole.
    pub fn file(file: &str) -> Place {
        Place {
            file: file.to_owned(),
            line: None,
            column: None,
        }
    }

    /// A line of a file.
    pub fn line(file: &str, line: u64) -> Place {
        Place {
            line: Some(line),
            ..Place::file(file)
        }
    }

    /// A cell of a table; `column` counts from 0.
    pub fn cell(file: &str, line: u64, column: usize, name: &str) -> Place {
        Place {
            column: Some(Box::new((column + 1, name.to_owned()))),
            ..Place::line(file, line)
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(out, ", line {line}")?;
        }
        match self.column.as_deref() {
            Some((column, name)) if name.is_empty() => write!(out, ", column {column}"),
            Some((column, name)) => write!(out, ", column {column} ({name})"),
            None => Ok(()),
        }
    }
}

/// A number to six digits, for an error message or a notice.
pub(crate) fn brief(value: f64) -> String {
    format!("{value:.5e}")
        .parse::<f64>()
        .map_or_else(|_| value.to_string(), |rounded| format!("{rounded:?}"))
}

/// The longest piece of a file that an error repeats.
const SHOWN_CHARS: usize = 40;

/// What was found in a file, in backquotes, shortened and without control characters, for an error message.
pub(crate) fn shown(found: &[u8]) -> String {
    let text = String::from_utf8_lossy(&found[..found.len().min(4 * SHOWN_CHARS)]);
    let mut out = String::from("`");
    for (count, character) in text.chars().enumerate() {
        if count == SHOWN_CHARS {
            out.push_str("...");
            break;
        }
        match character {
            '\t' => out.push_str("\\t"),
            c if c.is_control() => out.extend(c.escape_default()),
            c => out.push(c),
        }
    }
    out.push('`');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_places_read_as_an_editor_counts() {
        for (place, expect) in [
            (Place::file("a.csv"), "a.csv"),
            (Place::line("a.csv", 3), "a.csv, line 3"),
            (Place::cell("a.csv", 3, 0, "time_s"), "a.csv, line 3, column 1 (time_s)"),
            (Place::cell("a.csv", 3, 2, ""), "a.csv, line 3, column 3"),
        ] {
            assert_eq!(place.to_string(), expect);
        }
    }

    #[test]
    fn golden_found_text_is_shortened_and_printable() {
        assert_eq!(shown(b"1,5"), "`1,5`");
        assert_eq!(shown(b"a\tb\x00"), "`a\\tb\\u{0}`");
        assert_eq!(shown(&[b'x'; 100]), format!("`{}...`", "x".repeat(40)));
    }
}
