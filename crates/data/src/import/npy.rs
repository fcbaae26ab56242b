//! NumPy's arrays: `.npy`, and those in `.npz`.
//!
//! Own code because the libraries for it (npyz 0.9, ndarray-npy 0.10) bring a parser generator for a header of three
//! keys, and lay memory out for whatever size the header claims.
//!
//! # Reference
//! NumPy Enhancement Proposal 1, "A Simple File Format for NumPy Arrays", versions 1 to 3.

use std::io::Read;

use super::arrays::{self, Array, Budget, Contents, Fault, Format, broken};
use super::literal::{self, Literal};
use super::numbers::{Bytes, Ends, Stored};

/// NumPy's `.npy`.
pub(crate) const FORMAT: Format = Format {
    what: "NumPy file",
    noun: "array",
    again: "write it again with `numpy.save` or `numpy.savez`",
    read,
};

/// What every file begins with.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// The longest header that is read.
const LONGEST_HEADER: u64 = 1 << 16;

/// The most fields of a structured array.
const MOST_FIELDS: usize = 256;

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let bytes = arrays::bytes(source, progress)?;
    let mut contents = Contents::default();
    array(&bytes, "array", &mut contents, &mut Budget::of(bytes.len()))?;
    Ok(contents)
}

/// What the numbers of an array are.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Type {
    stored: Stored,
    big_endian: bool,
    /// The unit of a time, whose numbers are taken from the first on.
    time: Option<&'static str>,
}

/// A field of a row: its name (empty if the row is one number), type and place.
struct Field {
    name: String,
    kind: Result<Type, String>,
    offset: usize,
}

/// Reads one array.
pub(crate) fn array(bytes: &[u8], name: &str, contents: &mut Contents, budget: &mut Budget) -> Result<(), Fault> {
    let mut bytes = Bytes::new(bytes, false);
    let header = header(&mut bytes).map_err(|Ends| Fault::Broken(format!("{name}: the header ends early")))?;
    let header = literal::parse(header).ok_or_else(|| Fault::Broken(format!("{name}: the header is no dictionary")))?;
    let (Some(descr), Some(shape), Some(Literal::Bool(fortran))) =
        (header.get("descr"), header.get("shape"), header.get("fortran_order"))
    else {
        return broken(format!("{name}: the header lacks `descr`, `shape` or `fortran_order`"));
    };
    let size = shape
        .sizes()
        .ok_or_else(|| Fault::Broken(format!("{name}: its shape cannot be")))?;
    let count = size
        .iter()
        .try_fold(1u64, |count, &side| count.checked_mul(side as u64))
        .unwrap_or(u64::MAX);
    let (fields, width) = fields(descr, name)?;
    let data = count
        .checked_mul(width as u64)
        .ok_or(Ends)
        .and_then(|length| bytes.take(length))
        .map_err(|Ends| Fault::Broken(format!("{name} claims {count} numbers, the file ends before")))?;
    for field in fields {
        let name = match (field.name.as_str(), name) {
            ("", name) => name.to_owned(),
            (field, "array") => field.to_owned(),
            (field, name) => format!("{name}.{field}"),
        };
        let kind = match field.kind {
            Ok(kind) => kind,
            Err(what) => {
                contents.skipped.push(format!("{name}: {what}"));
                continue;
            }
        };
        budget.take(count, &name)?;
        let end = field.offset + kind.stored.width();
        let rows = data.chunks_exact(width.max(1)).map(|row| &row[field.offset..end]);
        let values = match kind.time {
            Some(_) => since_first(rows, kind.big_endian),
            None => rows.map(|bytes| kind.stored.number(bytes, kind.big_endian)).collect(),
        };
        contents.arrays.push(Array {
            size: size.clone(),
            last_fastest: !fortran,
            single: matches!(kind.stored, Stored::Half | Stored::Single),
            unit: kind.time.unwrap_or_default().to_owned(),
            ..Array::vector(name, values)
        });
    }
    Ok(())
}

/// The text of the header.
fn header<'a>(bytes: &mut Bytes<'a>) -> Result<&'a [u8], Ends> {
    if bytes.take(MAGIC.len() as u64)? != MAGIC {
        return Err(Ends);
    }
    let version = bytes.take(2)?[0];
    let length = match version {
        1 => bytes
            .take(2)
            .map(|two| u64::from(u16::from_le_bytes([two[0], two[1]])))?,
        _ => u64::from(bytes.u32()?),
    };
    if length > LONGEST_HEADER {
        return Err(Ends);
    }
    bytes.take(length)
}

/// Times since the first, exactly: nanoseconds since 1970 have more digits than a number here.
fn since_first<'a>(rows: impl Iterator<Item = &'a [u8]>, big_endian: bool) -> Vec<f64> {
    let whole = |bytes: &[u8]| {
        let bytes: [u8; 8] = bytes.try_into().unwrap_or_default();
        if big_endian {
            i64::from_be_bytes(bytes)
        } else {
            i64::from_le_bytes(bytes)
        }
    };
    let mut first = None;
    rows.map(|bytes| {
        let now = whole(bytes);
        if now == i64::MIN {
            return f64::NAN; // NumPy's "not a time"
        }
        now.saturating_sub(*first.get_or_insert(now)) as f64
    })
    .collect()
}

/// The fields of a row and its bytes.
fn fields(descr: &Literal, name: &str) -> Result<(Vec<Field>, usize), Fault> {
    let unknown = || Fault::Broken(format!("{name}: its type is not one of NumPy's"));
    if let Literal::Text(code) = descr {
        let (kind, width) = kind(code).ok_or_else(unknown)?;
        let field = Field {
            name: String::new(),
            kind,
            offset: 0,
        };
        return Ok((vec![field], width));
    }
    let Literal::List(list) = descr else {
        return Err(unknown());
    };
    let (mut fields, mut width) = (Vec::new(), 0usize);
    for entry in list.iter().take(MOST_FIELDS) {
        let Literal::List(entry) = entry else {
            return Err(unknown());
        };
        let [Literal::Text(name), Literal::Text(code), more @ ..] = entry.as_slice() else {
            return Err(unknown());
        };
        let (mut kind, mut bytes) = kind(code).ok_or_else(unknown)?;
        if let [shape] = more {
            let many = shape
                .sizes()
                .ok_or_else(unknown)?
                .iter()
                .try_fold(1usize, |all, &side| all.checked_mul(side));
            bytes = many.and_then(|many| many.checked_mul(bytes)).ok_or_else(unknown)?;
            kind = Err("an array in each row".into());
        }
        fields.push(Field {
            name: name.clone(),
            kind,
            offset: width,
        });
        width = width
            .checked_add(bytes)
            .filter(|&width| width <= 1 << 20)
            .ok_or_else(unknown)?;
    }
    Ok((fields, width))
}

/// The type that a code says (or what it is, if it is none that is read) and its bytes.
fn kind(code: &str) -> Option<(Result<Type, String>, usize)> {
    let (order, rest) = code.split_at_checked(1)?;
    let big_endian = order == ">";
    if !matches!(order, "<" | ">" | "|" | "=") {
        return None;
    }
    let (letter, size) = rest.split_at_checked(1)?;
    let digits = size.find(|c: char| !c.is_ascii_digit()).unwrap_or(size.len());
    let (size, unit) = size.split_at(digits);
    let width: usize = size.parse().ok().filter(|&width| width <= 1 << 16)?;
    let plain = |stored| {
        Ok(Type {
            stored,
            big_endian,
            time: None,
        })
    };
    Some(match (letter, width) {
        ("f", 2) => (plain(Stored::Half), 2),
        ("f", 4) => (plain(Stored::Single), 4),
        ("f", 8) => (plain(Stored::Double), 8),
        ("i", 1 | 2 | 4 | 8) => (plain(Stored::Signed(width)), width),
        ("u", 1 | 2 | 4 | 8) => (plain(Stored::Unsigned(width)), width),
        ("b", 1) => (plain(Stored::Unsigned(1)), 1),
        ("M" | "m", 8) => {
            let time = ["s", "ms", "us", "ns"]
                .into_iter()
                .find(|known| format!("[{known}]") == unit);
            let kind = time.map(|unit| Type {
                stored: Stored::Signed(8),
                big_endian,
                time: Some(unit),
            });
            (kind.ok_or_else(|| format!("times in {unit}")), 8)
        }
        ("U", _) => (Err("text".into()), 4 * width),
        ("S" | "V", _) => (Err("text or bytes".into()), width),
        ("c", _) => (Err("complex".into()), width),
        ("f", _) => (Err(format!("numbers of {width} bytes")), width),
        ("O", _) => (Err("Python objects".into()), width),
        _ => return None,
    })
}
