//! The chain of segments: which bytes are the numbers of which channel.

use std::collections::HashMap;
use std::fmt;

use super::foreign;
use super::properties::{Properties, stored};
use crate::import::arrays::{Fault, MOST_ARRAYS, broken};
use crate::import::numbers::{Bytes, Ends, Stored};

// what a segment has
const METADATA: u32 = 1 << 1;
const NEW_LIST: u32 = 1 << 2;
const RAW_DATA: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;
const DAQMX: u32 = 1 << 7;

/// The most pieces that the samples of all channels may be cut into: a file of a gigabyte streamed sample by sample
/// has more, and is refused rather than read for minutes.
const MOST_PIECES: usize = 1 << 24;

/// What the numbers of a channel are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Number(Stored),
    /// Seconds since 1904 and their fraction.
    Time,
    Text,
    Complex(u64),
    Extended,
}

impl Kind {
    fn of(code: u32) -> Option<Kind> {
        Some(match code {
            0x20 => Kind::Text,
            0x44 => Kind::Time,
            0x0008_000c => Kind::Complex(8),
            0x0010_000d => Kind::Complex(16),
            11 | 0x1b => Kind::Extended,
            code => Kind::Number(stored(code)?),
        })
    }

    /// Bytes of a value; none where they differ.
    fn width(self) -> Option<u64> {
        match self {
            Kind::Number(stored) => Some(stored.width() as u64),
            Kind::Time | Kind::Extended => Some(16),
            Kind::Complex(width) => Some(width),
            Kind::Text => None,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Kind::Number(_) => "numbers",
            Kind::Time => "times",
            Kind::Text => "text",
            Kind::Complex(_) => "complex",
            Kind::Extended => "numbers of extended precision",
        })
    }
}

/// A stretch of bytes in which values lie at equal distances.
#[derive(Debug, Clone, Copy)]
struct Piece<'a> {
    bytes: &'a [u8],
    count: usize,
    stride: usize,
    width: usize,
    big_endian: bool,
}

/// A file, group or channel.
#[derive(Debug, Default)]
pub(super) struct Object<'a> {
    pub(super) path: String,
    pub(super) properties: Properties,
    pub(super) kind: Option<Kind>,
    pieces: Vec<Piece<'a>>,
    samples: u64,
    /// How its numbers lie in a segment: values a chunk, bytes of them.
    index: Option<(u64, u64)>,
}

impl<'a> Object<'a> {
    /// How many values there are.
    pub(super) fn samples(&self) -> u64 {
        self.samples
    }

    /// The bytes of each value, and whether their big end is first.
    pub(super) fn pieces(&self) -> impl Iterator<Item = (&'a [u8], bool)> {
        self.pieces.iter().flat_map(|piece| {
            let Piece {
                bytes,
                count,
                stride,
                width,
                big_endian,
            } = *piece;
            (0..count).map(move |row| (&bytes[row * stride..row * stride + width], big_endian))
        })
    }
}

/// Seconds of times since the first of them.
pub(super) fn since_first<'a>(pieces: impl Iterator<Item = (&'a [u8], bool)>) -> impl Iterator<Item = f64> {
    let mut first = None;
    pieces.map(move |(bytes, big_endian)| {
        let mut bytes = Bytes::new(bytes, big_endian);
        let (first_word, second) = (bytes.u64().unwrap_or(0), bytes.u64().unwrap_or(0));
        let (fraction, seconds) = if big_endian {
            (second, first_word)
        } else {
            (first_word, second)
        };
        let now = (i128::from(seconds as i64) << 64) + i128::from(fraction);
        now.saturating_sub(*first.get_or_insert(now)) as f64 / 2f64.powi(64)
    })
}

/// Reads the chain.
pub(super) fn read(mut bytes: Bytes<'_>) -> Result<Vec<Object<'_>>, Fault> {
    let mut objects: Vec<Object<'_>> = Vec::new();
    let mut by_path: HashMap<String, usize> = HashMap::new();
    let mut active: Vec<usize> = Vec::new();
    let mut pieces = 0;
    while bytes.left() >= 28 {
        let (flags, mut metadata, raw) = lead_in(&mut bytes)?;
        metadata.big_endian = flags & BIG_ENDIAN != 0;
        if flags & NEW_LIST != 0 {
            active.clear();
        }
        if flags & METADATA != 0 {
            list(&mut metadata, flags, &mut objects, &mut by_path, &mut active)?;
        }
        if flags & RAW_DATA != 0 {
            if flags & DAQMX != 0 {
                return Err(foreign(
                    "a TDMS file with the raw numbers of a DAQmx task (DAQmx raw data)",
                ));
            }
            samples(raw, flags, &mut objects, &active, &mut pieces)?;
        }
    }
    if bytes.left() > 0 {
        return broken("the file ends in the head of a segment");
    }
    Ok(objects)
}

/// The head of a segment: what it has, its metadata and its samples.
fn lead_in<'a>(bytes: &mut Bytes<'a>) -> Result<(u32, Bytes<'a>, &'a [u8]), Fault> {
    let ends = |_: Ends| Fault::Broken("the file ends in the head of a segment".into());
    if bytes.take(4).map_err(ends)? != super::MAGIC {
        return broken("a segment does not begin with TDSm");
    }
    let flags = bytes.u32().map_err(ends)?;
    let mut head = Bytes::new(bytes.take(20).map_err(ends)?, flags & BIG_ENDIAN != 0);
    let version = head.u32().map_err(ends)?;
    if !(4712..=4713).contains(&version) {
        return broken(format!("a segment of version {version}"));
    }
    let (next, raw) = (head.u64().map_err(ends)?, head.u64().map_err(ends)?);
    // a program that was ended while it wrote leaves the length open: then the segment is the rest of the file
    let left = bytes.left() as u64;
    let length = if next == u64::MAX { left } else { next };
    if length > left || raw > length {
        return broken("a segment is longer than the file: it was cut short");
    }
    let body = bytes.take(length).map_err(ends)?;
    let (metadata, data) = body.split_at(raw as usize);
    Ok((flags, Bytes::new(metadata, false), data))
}

/// The objects that a segment lists, and how their numbers lie.
fn list(
    bytes: &mut Bytes,
    flags: u32,
    objects: &mut Vec<Object<'_>>,
    by_path: &mut HashMap<String, usize>,
    active: &mut Vec<usize>,
) -> Result<(), Fault> {
    let ends = |_: Ends| Fault::Broken("the list of channels of a segment ends early".into());
    let count = bytes.u32().map_err(ends)?;
    for _ in 0..count {
        let path = bytes.text().map_err(ends)?;
        let place = *by_path.entry(path.clone()).or_insert(objects.len());
        if place == objects.len() {
            if objects.len() >= MOST_ARRAYS {
                return broken(format!("more than {MOST_ARRAYS} channels"));
            }
            objects.push(Object {
                path,
                ..Object::default()
            });
        }
        let object = &mut objects[place];
        let has_data = match bytes.u32().map_err(ends)? {
            u32::MAX => false,
            0 if object.index.is_some() => true,
            0 => return broken(format!("{} is to lie as before, and did not before", object.path)),
            0x1269 | 0x126a | 0x1369 => {
                return Err(foreign(
                    "a TDMS file with the raw numbers of a DAQmx task (DAQmx raw data)",
                ));
            }
            _ => {
                index(bytes, object)?;
                true
            }
        };
        let listed = active.contains(&place);
        if has_data && !listed {
            active.push(place);
        } else if !has_data && listed && flags & NEW_LIST == 0 {
            active.retain(|&other| other != place);
        }
        object.properties.read(bytes)?;
    }
    Ok(())
}

/// How the numbers of a channel lie.
fn index(bytes: &mut Bytes, object: &mut Object) -> Result<(), Fault> {
    let ends = |_: Ends| Fault::Broken("the place of a channel's numbers ends early".into());
    let code = bytes.u32().map_err(ends)?;
    let Some(kind) = Kind::of(code) else {
        return Err(foreign(format!("{} has numbers of type {code:#x}", object.path)));
    };
    if object.kind.is_some_and(|before| before != kind) {
        return broken(format!("{} changes its type", object.path));
    }
    let dimension = bytes.u32().map_err(ends)?;
    if dimension != 1 {
        return broken(format!("{} has {dimension} dimensions, allowed is 1", object.path));
    }
    let values = bytes.u64().map_err(ends)?;
    let length = match kind.width() {
        Some(width) => values.checked_mul(width),
        None => Some(bytes.u64().map_err(ends)?),
    };
    let Some(length) = length else {
        return broken(format!("{} claims {values} values", object.path));
    };
    object.kind = Some(kind);
    object.index = Some((values, length));
    Ok(())
}

/// Hands the bytes of a segment's chunks to their channels.
fn samples<'a>(
    raw: &'a [u8],
    flags: u32,
    objects: &mut [Object<'a>],
    active: &[usize],
    pieces: &mut usize,
) -> Result<(), Fault> {
    let lengths = active
        .iter()
        .map(|&place| objects[place].index.map_or(0, |(_, length)| length));
    let chunk = lengths.fold(0u64, u64::saturating_add);
    if chunk == 0 || raw.is_empty() {
        return Ok(());
    }
    let (big_endian, interleaved) = (flags & BIG_ENDIAN != 0, flags & INTERLEAVED != 0);
    let mut rest = raw;
    while !rest.is_empty() {
        *pieces += active.len();
        if *pieces > MOST_PIECES {
            return Err(foreign("a TDMS file whose samples are in too many pieces"));
        }
        let take = usize::try_from(chunk).unwrap_or(usize::MAX).min(rest.len());
        let (bytes, after) = rest.split_at(take);
        rest = after;
        if interleaved {
            woven(bytes, big_endian, objects, active)?;
        } else {
            side_by_side(bytes, big_endian, objects, active);
        }
    }
    Ok(())
}

/// Channels one after the other; a last chunk that was cut short ends somewhere in one.
fn side_by_side<'a>(bytes: &'a [u8], big_endian: bool, objects: &mut [Object<'a>], active: &[usize]) {
    let mut rest = bytes;
    for &place in active {
        let object = &mut objects[place];
        let Some((values, length)) = object.index else { continue };
        let take = usize::try_from(length).unwrap_or(usize::MAX).min(rest.len());
        let (own, after) = rest.split_at(take);
        rest = after;
        let Some(width) = object.kind.and_then(Kind::width).map(|width| width as usize) else {
            object.samples = object.samples.saturating_add(values); // text: counted, never read
            continue;
        };
        let piece = Piece {
            bytes: own,
            count: own.len() / width,
            stride: width,
            width,
            big_endian,
        };
        object.samples += piece.count as u64;
        object.pieces.push(piece);
    }
}

/// One value of each channel after the other.
fn woven<'a>(bytes: &'a [u8], big_endian: bool, objects: &mut [Object<'a>], active: &[usize]) -> Result<(), Fault> {
    let widths: Option<Vec<usize>> = active
        .iter()
        .map(|&place| objects[place].kind.and_then(Kind::width).map(|width| width as usize))
        .collect();
    let Some(widths) = widths else {
        return broken("text among interleaved channels");
    };
    let stride: usize = widths.iter().sum();
    let count = bytes.len() / stride.max(1);
    let mut offset = 0;
    for (&place, width) in active.iter().zip(widths) {
        let object = &mut objects[place];
        if count > 0 {
            object.pieces.push(Piece {
                bytes: &bytes[offset..],
                count,
                stride,
                width,
                big_endian,
            });
        }
        object.samples += count as u64;
        offset += width;
    }
    Ok(())
}
