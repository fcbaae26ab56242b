//! What is wrong in an effect file, and at which line and column of its text.

use crate::error::InText;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A field of an effect file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Spot {
    /// Of the effect.
    Effect(&'static str),
    /// Of the parameter with this number, from 0.
    Parameter(usize, &'static str),
    /// Of the state with this number, from 0.
    State(usize, &'static str),
}

/// What is wrong in a field.
#[derive(Debug)]
pub(super) struct Fault {
    spot: Spot,
    /// The field with its value, where an expression is wrong.
    what: Option<String>,
    misread: Misread,
}

impl Spot {
    pub(super) fn fault(self, why: impl Into<String>) -> Fault {
        Fault {
            spot: self,
            what: None,
            misread: Misread {
                character: None,
                why: why.into(),
            },
        }
    }

    /// A fault in an expression, `what` before it.
    pub(super) fn in_expression(self, what: String, misread: Misread) -> Fault {
        Fault {
            spot: self,
            what: Some(what),
            misread,
        }
    }
}

/// What is wrong in an expression.
#[derive(Debug)]
pub(super) struct Misread {
    /// The character that it is at, from 1.
    pub character: Option<usize>,
    pub why: String,
}

impl std::fmt::Display for Misread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.character {
            Some(character) => write!(f, "column {character}: {}", self.why),
            None => f.write_str(&self.why),
        }
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(what) = &self.what {
            write!(f, "{what}: ")?;
        }
        self.misread.fmt(f)
    }
}

impl Fault {
    /// The same with the line and the column of a file's text; none where the field is not in it.
    pub(super) fn in_text(&self, text: &str) -> Option<InText> {
        let table = DeTable::parse(text).ok()?;
        let byte = self.byte(text, table.get_ref())?;
        Some(InText::at(text, byte, self.misread.why.clone()))
    }

    /// The byte of the text that the fault is at.
    fn byte(&self, text: &str, table: &DeTable<'_>) -> Option<usize> {
        let field = match self.spot {
            Spot::Effect(name) => table.get(name)?,
            Spot::Parameter(number, name) => entry(table, ("parameter", number), name)?,
            Spot::State(number, name) => entry(table, ("state", number), name)?,
        };
        let span = field.span();
        let within = self.misread.character.zip(field.get_ref().as_str());
        let within = within.and_then(|(character, value)| inside(text.get(span.clone())?, value, character));
        Some(span.start + within.unwrap_or(0))
    }
}

/// A field of an entry of a list; the entry itself where it lacks the field.
fn entry<'a>(table: &'a DeTable<'a>, (list, number): (&str, usize), name: &str) -> Option<&'a Spanned<DeValue<'a>>> {
    let entry = table.get(list)?.get_ref().as_array()?.get(number)?;
    Some(entry.get_ref().as_table()?.get(name).unwrap_or(entry))
}

/// How many bytes into a string as it is written a character of its value is; none where escapes make the two differ.
fn inside(written: &str, value: &str, character: usize) -> Option<usize> {
    let long = written.starts_with("\"\"\"") || written.starts_with("'''");
    let marks = if long { 3 } else { 1 };
    let bare = written.get(marks..written.len().checked_sub(marks)?)?;
    // A line end right behind the marks is not of the value.
    let skipped = if bare.starts_with("\r\n") && !value.starts_with('\r') {
        2
    } else {
        usize::from(bare.starts_with('\n') && bare != value)
    };
    if bare.get(skipped..)? != value {
        return None;
    }
    let bytes = value.char_indices().nth(character.saturating_sub(1));
    Some(marks + skipped + bytes.map_or(value.len(), |(byte, _)| byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(text: &str, fault: &Fault) -> Option<(usize, usize)> {
        fault.in_text(text).map(|found| (found.line, found.column))
    }

    #[test]
    fn val_a_fault_is_at_its_character_however_the_string_is_written() {
        let third = |text: &str| {
            let misread = Misread {
                character: Some(3),
                why: "wrong".to_owned(),
            };
            place(text, &Spot::Effect("output").in_expression(String::new(), misread))
        };
        assert_eq!(third("name = 'µ'\noutput = \"a+b\"\n"), Some((2, 13)));
        assert_eq!(third("output = 'a+b'"), Some((1, 13)));
        assert_eq!(third("  output = \"µ+b\""), Some((1, 15)), "characters, not bytes");
        assert_eq!(third("output = \"\"\"\na+b\"\"\""), Some((2, 3)));
        assert_eq!(third("output = '''a\n+b'''"), Some((2, 1)));
        assert_eq!(
            third("output = \"a\\u002bb\""),
            Some((1, 10)),
            "where escapes are, its beginning"
        );
        assert_eq!(third("output = \"a\""), Some((1, 12)), "it ends too early");
        assert_eq!(third("name = \"a\""), None);
    }

    #[test]
    fn val_a_fault_of_an_entry_is_at_its_field_or_at_the_entry() {
        let text = "[[state]]\nname = \"a\"\n\n[[state]]\nname = \"b\"\nrate = \"u\"\n";
        assert_eq!(place(text, &Spot::State(1, "rate").fault("wrong")), Some((6, 8)));
        assert_eq!(place(text, &Spot::State(1, "next").fault("wrong")), Some((4, 1)));
        assert_eq!(place(text, &Spot::State(2, "name").fault("wrong")), None);
        assert_eq!(place(text, &Spot::Parameter(0, "min").fault("wrong")), None);
    }
}
