//! MATLAB files of version 4 (`save -v4`, `scipy.io.savemat(format='4')`, Octave, many data loggers).
//!
//! A variable is five words (type, rows, columns, whether complex, length of the name), the name, and the numbers by
//! columns. The digits of the type are M O P T: byte order, nothing, precision, and whether numbers, text or sparse.
//!
//! # Reference
//! MathWorks, "MAT-File Format", Level 4.

use std::io::Read;

use super::arrays::{self, Array, Budget, Contents, Fault, Format, MOST_ARRAYS, broken};
use super::numbers::{Bytes, Ends, Stored};

/// MATLAB's files of version 4.
pub(crate) const FORMAT: Format = Format {
    what: "MATLAB file of version 4",
    noun: "variable",
    again: "save it again with `save('file.mat','-v7')`",
    read,
};

/// The longest name that is believed.
const LONGEST_NAME: u32 = 256;

/// What comes before a variable's name.
struct Head {
    big_endian: bool,
    precision: u32,
    class: u32,
    rows: u32,
    columns: u32,
    complex: bool,
    name: u32,
}

impl Head {
    /// Reads it, if the words can be one.
    fn of(bytes: &mut Bytes) -> Result<Option<Head>, Ends> {
        let mut words = [0; 5];
        for word in &mut words {
            *word = bytes.u32()?;
        }
        let big_endian = words[0] > 0xffff;
        if big_endian {
            words = words.map(u32::swap_bytes);
        }
        let [kind, rows, columns, complex, name] = words;
        let order = if big_endian { 1 } else { 0 };
        let (precision, class) = (kind / 10 % 10, kind % 10);
        let fits = kind / 1000 == order
            && kind / 100 % 10 == 0
            && precision <= 5
            && class <= 2
            && complex <= 1
            && (1..=LONGEST_NAME).contains(&name);
        Ok(fits.then_some(Head {
            big_endian,
            precision,
            class,
            rows,
            columns,
            complex: complex == 1,
            name,
        }))
    }

    fn stored(&self) -> Stored {
        match self.precision {
            0 => Stored::Double,
            1 => Stored::Single,
            2 => Stored::Signed(4),
            3 => Stored::Signed(2),
            4 => Stored::Unsigned(2),
            _ => Stored::Unsigned(1),
        }
    }
}

/// Whether a file begins as one of these.
pub(crate) fn is_one(head: &[u8]) -> bool {
    let mut bytes = Bytes::new(head, false);
    let Ok(Some(found)) = Head::of(&mut bytes) else {
        return false;
    };
    let Ok(name) = bytes.take(u64::from(found.name)) else {
        return false;
    };
    let Some((0, name)) = name.split_last() else {
        return false;
    };
    !name.is_empty() && name.iter().all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_')
}

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let bytes = arrays::bytes(source, progress)?;
    let mut budget = Budget::of(bytes.len());
    let mut bytes = Bytes::new(&bytes, false);
    let mut contents = Contents::default();
    while bytes.left() > 0 {
        if contents.arrays.len() + contents.skipped.len() >= MOST_ARRAYS {
            return broken(format!("more than {MOST_ARRAYS} variables"));
        }
        variable(&mut bytes, &mut contents, &mut budget)?;
    }
    Ok(contents)
}

fn variable(bytes: &mut Bytes, contents: &mut Contents, budget: &mut Budget) -> Result<(), Fault> {
    let ends = |_| Fault::Broken("the file ends in the middle of a variable".into());
    let Some(head) = Head::of(bytes).map_err(ends)? else {
        return broken("a variable's type cannot be");
    };
    let name = bytes.take(u64::from(head.name)).map_err(ends)?;
    let name = name.split(|&byte| byte == 0).next().unwrap_or_default();
    let name = String::from_utf8_lossy(name).into_owned();
    let count = u64::from(head.rows) * u64::from(head.columns);
    let stored = head.stored();
    let parts = if head.complex { 2 } else { 1 };
    let data = count
        .checked_mul(stored.width() as u64 * parts)
        .ok_or(Ends)
        .and_then(|length| bytes.take(length))
        .map_err(|_| Fault::Broken(format!("variable {name} claims {count} numbers, the file ends before")))?;
    let left_out = match head.class {
        1 => Some("text"),
        2 => Some("a sparse array"),
        _ if head.complex => Some("complex"),
        _ => None,
    };
    if let Some(what) = left_out {
        contents.skipped.push(format!("{name}: {what}"));
        return Ok(());
    }
    budget.take(count, &format!("variable {name}"))?;
    contents.arrays.push(Array {
        size: vec![head.rows as usize, head.columns as usize],
        single: stored == Stored::Single,
        ..Array::vector(name, stored.numbers(data, head.big_endian).collect())
    });
    Ok(())
}
