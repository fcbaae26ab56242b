//! Properties of a file, a group or a channel.

use crate::import::arrays::Fault;
use crate::import::numbers::{Bytes, Ends, Stored};

/// The most properties of an object.
const MOST: u32 = 65_536;

/// A value that matters here.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Number(f64),
    Text(String),
    /// A time, or a type that no scale or clock is given in.
    Other,
}

/// The properties of an object, the newest value of each.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Properties(Vec<(String, Value)>);

impl Properties {
    pub(super) fn get(&self, name: &str) -> Option<&Value> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    pub(super) fn number(&self, name: &str) -> Option<f64> {
        match self.get(name)? {
            Value::Number(value) => Some(*value),
            _ => None,
        }
    }

    pub(super) fn text(&self, name: &str) -> Option<&str> {
        match self.get(name)? {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Reads what a segment says.
    pub(super) fn read(&mut self, bytes: &mut Bytes) -> Result<(), Fault> {
        let ends = |_: Ends| Fault::Broken("the properties of a channel end early".into());
        let count = bytes.u32().map_err(ends)?;
        if count > MOST {
            return Err(Fault::Broken(format!("a channel claims {count} properties")));
        }
        for _ in 0..count {
            let name = bytes.text().map_err(ends)?;
            let kind = bytes.u32().map_err(ends)?;
            let value = value(bytes, kind).map_err(ends)?;
            let Some(value) = value else {
                return Err(Fault::Broken(format!("property {name} has type {kind:#x}")));
            };
            match self.0.iter_mut().find(|(known, _)| *known == name) {
                Some((_, old)) => *old = value,
                None => self.0.push((name, value)),
            }
        }
        Ok(())
    }
}

/// The type of a number, by its code.
pub(super) fn stored(kind: u32) -> Option<Stored> {
    Some(match kind {
        1 => Stored::Signed(1),
        2 => Stored::Signed(2),
        3 => Stored::Signed(4),
        4 => Stored::Signed(8),
        5 | 0x21 => Stored::Unsigned(1),
        6 => Stored::Unsigned(2),
        7 => Stored::Unsigned(4),
        8 => Stored::Unsigned(8),
        9 | 0x19 => Stored::Single,
        10 | 0x1a => Stored::Double,
        _ => return None,
    })
}

/// A value of a type; none if the type is not known, and with it where the next one begins.
fn value(bytes: &mut Bytes, kind: u32) -> Result<Option<Value>, Ends> {
    if let Some(stored) = stored(kind) {
        let number = bytes.take(stored.width() as u64)?;
        return Ok(Some(Value::Number(stored.number(number, bytes.big_endian))));
    }
    Ok(Some(match kind {
        0x20 => Value::Text(bytes.text()?),
        0x44 | 0x0010_000d => {
            bytes.take(16)?;
            Value::Other
        }
        0x0008_000c => {
            bytes.take(8)?;
            Value::Other
        }
        0 => Value::Other,
        _ => return Ok(None),
    }))
}
