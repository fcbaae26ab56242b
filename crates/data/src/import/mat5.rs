//! MATLAB files of version 5 (`save -v6` and `-v7`): the numeric arrays in them, also those in structures.
//!
//! Own code because the library for this format (matfile 0.5) loses a whole file for one array of int32, prints to
//! stdout, overflows on hostile sizes, follows nested compression without end and leaves structures out; the part of
//! the format that holds numbers is small.
//!
//! Elements are a tag (type, bytes) and data padded to 8 bytes. Sizes in the file are claims: numbers are taken as they
//! arrive and no memory is laid out for more, at most [`MOST_NUMBERS`](super::arrays::MOST_NUMBERS) in all.
//!
//! # Reference
//! MathWorks, "MAT-File Format", Level 5.

use std::io::{self, Read};

use flate2::read::ZlibDecoder;

use super::arrays::{Array, Budget, Contents, Fault, Format, MOST_ARRAYS, broken};

/// MATLAB's files of version 5 to 7.
pub(crate) const FORMAT: Format = Format {
    what: "MATLAB file",
    noun: "variable",
    again: "save it again with `save('file.mat','-v7')`",
    read,
};

/// How deep structures may be nested.
const DEEPEST: usize = 8;

/// Bytes of the file's head.
const HEAD: usize = 128;

// types of elements
const INT8: u32 = 1;
const UINT8: u32 = 2;
const INT16: u32 = 3;
const UINT16: u32 = 4;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const SINGLE: u32 = 7;
const DOUBLE: u32 = 9;
const INT64: u32 = 12;
const UINT64: u32 = 13;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

// classes of arrays
const STRUCT_CLASS: u32 = 2;
const SINGLE_CLASS: u32 = 7;
const NUMERIC_CLASSES: std::ops::RangeInclusive<u32> = 6..=15;

/// Reads a file; `progress` gets the bytes read so far.
fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let mut source = source;
    let mut head = [0; HEAD];
    source.read_exact(&mut head)?;
    let big_endian = &head[126..128] == b"MI";
    let mut contents = Contents::default();
    let mut budget = Budget::new();
    let mut done = HEAD as u64;
    loop {
        let mut tag = [0; 8];
        if !fill_or_end(&mut source, &mut tag)? {
            return Ok(contents);
        }
        let (kind, bytes) = (
            number32(&tag[..4], big_endian),
            u64::from(number32(&tag[4..], big_endian)),
        );
        let mut element = (&mut source).take(bytes);
        match kind {
            MATRIX => Elements::new(&mut element, bytes, big_endian).matrix("", 0, &mut contents, &mut budget)?,
            COMPRESSED => {
                let mut inside = ZlibDecoder::new(&mut element);
                let mut tag = [0; 8];
                inside.read_exact(&mut tag)?;
                if number32(&tag[..4], big_endian) != MATRIX {
                    return broken("a compressed variable is no array");
                }
                let bytes = u64::from(number32(&tag[4..], big_endian));
                Elements::new(&mut inside, bytes, big_endian).matrix("", 0, &mut contents, &mut budget)?;
            }
            _ => {} // other elements hold no variables
        }
        let left = element.limit();
        if io::copy(&mut element, &mut io::sink())? < left {
            return broken("the file ends in the middle of a variable");
        }
        let padding = if kind == COMPRESSED {
            0
        } else {
            bytes.wrapping_neg() % 8
        };
        io::copy(&mut (&mut source).take(padding), &mut io::sink())?;
        done += 8 + bytes + padding;
        progress(done);
    }
}

/// Fills the buffer, or finds the end of the file at its beginning.
fn fill_or_end(source: &mut dyn Read, buffer: &mut [u8]) -> Result<bool, Fault> {
    let mut filled = 0;
    while filled < buffer.len() {
        match source.read(&mut buffer[filled..]) {
            Ok(0) if filled == 0 => return Ok(false),
            Ok(0) => return broken("the file ends in the middle of a tag"),
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(true)
}

fn number32(bytes: &[u8], big_endian: bool) -> u32 {
    let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
    if big_endian {
        u32::from_be_bytes(bytes)
    } else {
        u32::from_le_bytes(bytes)
    }
}

/// What a variable is that is left out; complex if it is numeric.
fn name_of_class(class: u32) -> Result<&'static str, Fault> {
    Ok(match class {
        1 => "a cell array",
        STRUCT_CLASS => "a structure array",
        3 | 16..=18 => "an object",
        4 => "text",
        5 => "a sparse array",
        class if NUMERIC_CLASSES.contains(&class) => "complex",
        _ => return broken(format!("a variable of class {class}")),
    })
}

/// The elements in an array's element.
struct Elements<'a> {
    source: &'a mut dyn Read,
    /// Bytes left in the array's element.
    left: u64,
    big_endian: bool,
}

/// A tag: type and bytes of an element, and whether its data is in the tag itself.
struct Tag {
    kind: u32,
    bytes: u64,
    small: bool,
}

impl<'a> Elements<'a> {
    fn new(source: &'a mut dyn Read, bytes: u64, big_endian: bool) -> Elements<'a> {
        Elements {
            source,
            left: bytes,
            big_endian,
        }
    }

    fn take(&mut self, buffer: &mut [u8]) -> Result<(), Fault> {
        let Some(left) = self.left.checked_sub(buffer.len() as u64) else {
            return broken("an element is longer than the variable it is in");
        };
        self.left = left;
        Ok(self.source.read_exact(buffer)?)
    }

    fn skip(&mut self, bytes: u64) -> Result<(), Fault> {
        let Some(left) = self.left.checked_sub(bytes) else {
            return broken("an element is longer than the variable it is in");
        };
        self.left = left;
        if io::copy(&mut self.source.take(bytes), &mut io::sink())? < bytes {
            return broken("the file ends in the middle of a variable");
        }
        Ok(())
    }

    fn tag(&mut self) -> Result<Tag, Fault> {
        let mut word = [0; 4];
        self.take(&mut word)?;
        let first = number32(&word, self.big_endian);
        if first >> 16 != 0 {
            let bytes = u64::from(first >> 16);
            if bytes > 4 {
                return broken(format!("a small element of {bytes} bytes, allowed are 4"));
            }
            return Ok(Tag {
                kind: first & 0xffff,
                bytes,
                small: true,
            });
        }
        self.take(&mut word)?;
        Ok(Tag {
            kind: first,
            bytes: u64::from(number32(&word, self.big_endian)),
            small: false,
        })
    }

    /// Skips the padding after an element's data.
    fn pad(&mut self, tag: &Tag) -> Result<(), Fault> {
        let padding = if tag.small {
            4 - tag.bytes
        } else {
            tag.bytes.wrapping_neg() % 8
        };
        self.skip(padding.min(self.left))
    }

    /// An element of a few bytes.
    fn short(&mut self, kind: u32, most: u64, what: &str) -> Result<Vec<u8>, Fault> {
        let tag = self.tag()?;
        if tag.kind != kind || tag.bytes > most {
            return broken(format!(
                "the {what} of a variable has type {} and {} bytes",
                tag.kind, tag.bytes
            ));
        }
        let mut data = vec![0; tag.bytes as usize];
        self.take(&mut data)?;
        self.pad(&tag)?;
        Ok(data)
    }

    /// An array: numbers, a structure, or something that is left out.
    fn matrix(&mut self, outer: &str, depth: usize, contents: &mut Contents, budget: &mut Budget) -> Result<(), Fault> {
        if self.left == 0 {
            return Ok(()); // an empty field
        }
        if contents.arrays.len() + contents.skipped.len() >= MOST_ARRAYS {
            return broken(format!("more than {MOST_ARRAYS} variables and fields"));
        }
        let flags = self.short(UINT32, 8, "flags")?;
        if flags.len() != 8 {
            return broken("the flags of a variable are cut short");
        }
        let flags = number32(&flags, self.big_endian);
        let (class, complex) = (flags & 0xff, flags & 0x0800 != 0);
        let name_of_class = name_of_class(class)?;
        if class > *NUMERIC_CLASSES.end() {
            let which = if outer.is_empty() { "a variable" } else { outer };
            contents.skipped.push(format!("{which}: {name_of_class}"));
            return Ok(());
        }
        let size = self.short(INT32, 4 * 32, "size")?;
        let size: Vec<usize> = size
            .chunks_exact(4)
            .map(|word| number32(word, self.big_endian) as usize)
            .collect();
        let own = self.short(INT8, 256, "name")?;
        let name = format!("{outer}{}", String::from_utf8_lossy(&own));
        let count = size
            .iter()
            .try_fold(1u64, |count, &side| count.checked_mul(side as u64))
            .unwrap_or(u64::MAX);
        if class == STRUCT_CLASS && count == 1 && depth < DEEPEST {
            return self.fields(&name, depth, contents, budget);
        }
        if !NUMERIC_CLASSES.contains(&class) || complex || size.len() < 2 {
            contents.skipped.push(format!("{name}: {name_of_class}"));
            return Ok(());
        }
        budget.take(count, &format!("variable {name}"))?;
        let tag = self.tag()?;
        let values = self.numbers(&tag, count, &name)?;
        contents.arrays.push(Array {
            size,
            single: class == SINGLE_CLASS,
            ..Array::vector(name, values)
        });
        Ok(())
    }

    /// The fields of a structure.
    fn fields(&mut self, name: &str, depth: usize, contents: &mut Contents, budget: &mut Budget) -> Result<(), Fault> {
        let length = self.short(INT32, 4, "length of field names")?;
        if length.len() != 4 {
            return broken("the length of field names is cut short");
        }
        let length = number32(&length, self.big_endian) as usize;
        let names = self.short(INT8, 64 * MOST_ARRAYS as u64, "field names")?;
        if length == 0 || names.len() % length != 0 {
            return broken(format!("field names of {} bytes in pieces of {length}", names.len()));
        }
        for field in names.chunks_exact(length) {
            let field = field.split(|&byte| byte == 0).next().unwrap_or_default();
            let tag = self.tag()?;
            if tag.kind != MATRIX || tag.small {
                return broken(format!("a field of {name} is no array"));
            }
            let Some(left) = self.left.checked_sub(tag.bytes) else {
                return broken("an element is longer than the variable it is in");
            };
            let outer = format!("{name}.{}", String::from_utf8_lossy(field));
            let mut inside = Elements::new(&mut *self.source, tag.bytes, self.big_endian);
            inside.matrix(&outer, depth + 1, contents, budget)?;
            let rest = inside.left;
            inside.skip(rest)?;
            self.left = left;
        }
        Ok(())
    }

    /// The numbers of an array, whatever type they are packed as.
    fn numbers(&mut self, tag: &Tag, count: u64, name: &str) -> Result<Vec<f64>, Fault> {
        let width = match tag.kind {
            INT8 | UINT8 => 1,
            INT16 | UINT16 => 2,
            INT32 | UINT32 | SINGLE => 4,
            DOUBLE | INT64 | UINT64 => 8,
            kind => return broken(format!("the numbers of variable {name} have type {kind}")),
        };
        if tag.bytes != count * width {
            return broken(format!(
                "variable {name} claims {count} numbers and has {} bytes of them",
                tag.bytes
            ));
        }
        let mut values = Vec::new();
        let mut buffer = [0; 8 * 1024];
        let mut left = tag.bytes;
        while left > 0 {
            let piece = left.min(buffer.len() as u64) as usize;
            self.take(&mut buffer[..piece])?;
            left -= piece as u64;
            let big = self.big_endian;
            values.extend(
                buffer[..piece]
                    .chunks_exact(width as usize)
                    .map(|bytes| number(bytes, tag.kind, big)),
            );
        }
        self.pad(tag)?;
        Ok(values)
    }
}

/// A number of a type.
fn number(bytes: &[u8], kind: u32, big_endian: bool) -> f64 {
    let mut word = [0; 8];
    // as little-endian bytes, the first `width` of the word
    for (to, from) in word.iter_mut().zip(0..bytes.len()) {
        *to = if big_endian {
            bytes[bytes.len() - 1 - from]
        } else {
            bytes[from]
        };
    }
    let bits = u64::from_le_bytes(word);
    match kind {
        INT8 => f64::from(bits as u8 as i8),
        UINT8 => f64::from(bits as u8),
        INT16 => f64::from(bits as u16 as i16),
        UINT16 => f64::from(bits as u16),
        INT32 => f64::from(bits as u32 as i32),
        UINT32 => f64::from(bits as u32),
        SINGLE => f64::from(f32::from_bits(bits as u32)),
        INT64 => bits as i64 as f64,
        UINT64 => bits as f64,
        _ => f64::from_bits(bits),
    }
}
