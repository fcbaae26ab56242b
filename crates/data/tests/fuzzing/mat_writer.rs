//! A small writer of MATLAB files of version 5, after the same document as the reader but without a line of it.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;

/// An element: tag, data, padding to 8 bytes.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut out = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    out.extend(data);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A small element: at most 4 bytes, in the tag.
fn small(kind: u16, data: &[u8]) -> Vec<u8> {
    let mut out = [kind.to_le_bytes(), (data.len() as u16).to_le_bytes()].concat();
    out.extend(data);
    out.resize(8, 0);
    out
}

/// The numbers of an array: type of element and its data.
pub(crate) fn doubles(values: &[f64]) -> (u32, Vec<u8>) {
    (9, values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// The same in single precision.
pub(crate) fn singles(values: &[f32]) -> (u32, Vec<u8>) {
    (7, values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// Integers of 16 bits, as MATLAB packs doubles that are whole numbers.
pub(crate) fn int16s(values: &[i16]) -> (u32, Vec<u8>) {
    (3, values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// Integers of 32 bits.
pub(crate) fn int32s(values: &[i32]) -> (u32, Vec<u8>) {
    (5, values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// The head of an array: flags, size, name.
fn array_head(class: u32, size: &[i32], name: &str) -> Vec<u8> {
    let size: Vec<u8> = size.iter().flat_map(|side| side.to_le_bytes()).collect();
    let name = if (1..=4).contains(&name.len()) {
        small(1, name.as_bytes())
    } else {
        element(1, name.as_bytes())
    };
    [
        element(6, &[class.to_le_bytes(), [0; 4]].concat()),
        element(5, &size),
        name,
    ]
    .concat()
}

/// An array of numbers; `class` 6 is double, 7 single, 12 int32.
pub(crate) fn array(class: u32, size: &[i32], name: &str, (kind, data): (u32, Vec<u8>)) -> Vec<u8> {
    let data = if (1..=4).contains(&data.len()) {
        small(kind as u16, &data)
    } else {
        element(kind, &data)
    };
    element(14, &[array_head(class, size, name), data].concat())
}

/// A column of doubles.
pub(crate) fn column(name: &str, values: &[f64]) -> Vec<u8> {
    array(6, &[values.len() as i32, 1], name, doubles(values))
}

/// A structure of one element; the fields are arrays without names.
pub(crate) fn structure(name: &str, fields: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut names = Vec::new();
    for (field, _) in fields {
        let mut padded = field.as_bytes().to_vec();
        padded.resize(32, 0);
        names.extend(padded);
    }
    let mut out = [
        array_head(2, &[1, 1], name),
        small(5, &32i32.to_le_bytes()),
        element(1, &names),
    ]
    .concat();
    fields.iter().for_each(|(_, array)| out.extend(array));
    element(14, &out)
}

/// Text, which is left out by the reader.
pub(crate) fn text(name: &str, text: &str) -> Vec<u8> {
    let data: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    element(
        14,
        &[array_head(4, &[1, text.len() as i32], name), element(4, &data)].concat(),
    )
}

/// A variable, compressed.
pub(crate) fn compressed(variable: &[u8]) -> Vec<u8> {
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::default());
    packed.write_all(variable).unwrap();
    let data = packed.finish().unwrap();
    [&15u32.to_le_bytes()[..], &(data.len() as u32).to_le_bytes(), &data].concat()
}

/// A file of variables.
pub(crate) fn mat(variables: &[Vec<u8>]) -> Vec<u8> {
    let mut out = b"MATLAB 5.0 MAT-file, made for a test".to_vec();
    out.resize(116, b' ');
    out.resize(124, 0);
    out.extend([0x00, 0x01, b'I', b'M']);
    variables.iter().for_each(|variable| out.extend(variable));
    out
}
