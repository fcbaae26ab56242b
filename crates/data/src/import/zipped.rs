//! Files inside others: `.csv.gz`, NumPy's `.npz`, and a zip of one recording.

use std::io::{self, Cursor, Read};

use flate2::read::MultiGzDecoder;

use super::arrays::{self, Budget, Contents, Fault, Format};
use super::npy;
use super::open::{self, Opened};
use super::options::ImportOptions;
use crate::error::DataError;

/// The most bytes that are unpacked: a text file of that size has half as many numbers as are read from binary ones.
const MOST_UNPACKED: u64 = 1 << 30;

/// The most files in a zip.
const MOST_FILES: usize = 4096;

/// NumPy's `.npz`.
const NPZ: Format = Format {
    what: "NumPy archive",
    noun: "array",
    again: "write it again with `numpy.savez`",
    read: npz,
};

/// Gives the bytes of a source up to a limit, and an error beyond it.
struct Limited<R> {
    source: R,
    left: u64,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(buffer)?;
        match self.left.checked_sub(count as u64) {
            Some(left) => self.left = left,
            None => {
                let limit = MOST_UNPACKED >> 20;
                return Err(io::Error::other(format!(
                    "it unpacks to more than {limit} MB, which is not read"
                )));
            }
        }
        Ok(count)
    }
}

/// Opens what a gzip file holds.
pub(crate) fn gzip<'a>(
    source: Box<dyn Read + 'a>,
    file: &'a str,
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Opened<'a>, DataError> {
    let unpacked = Limited {
        source: MultiGzDecoder::new(source),
        left: MOST_UNPACKED,
    };
    inner(Box::new(unpacked), file, options, progress)
}

/// Opens a file out of another, unless that is packed again.
fn inner<'a>(
    mut source: Box<dyn Read + 'a>,
    file: &'a str,
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Opened<'a>, DataError> {
    let mut head = [0; 4];
    let mut filled = 0;
    while filled < head.len() {
        match source
            .read(&mut head[filled..])
            .map_err(DataError::io(file, "unpack it"))?
        {
            0 => break,
            count => filled += count,
        }
    }
    let head = head[..filled].to_vec();
    if head.starts_with(b"\x1f\x8b") || head.starts_with(b"PK\x03\x04") {
        return Err(DataError::Format {
            file: file.to_owned(),
            found: "this is packed twice".into(),
            what_to_do: "unpack it once".into(),
        });
    }
    open::open(Box::new(Cursor::new(head).chain(source)), file, options, progress)
}

/// Opens what a zip file holds: arrays of NumPy, or one recording.
pub(crate) fn zip<'a>(
    mut source: Box<dyn Read + 'a>,
    file: &'a str,
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Opened<'a>, DataError> {
    let refuse = |found: String, what_to_do: &str| DataError::Format {
        file: file.to_owned(),
        found,
        what_to_do: what_to_do.to_owned(),
    };
    let broken = |found: String| refuse(found, "the file is damaged or no zip file; pack it again");
    let bytes = arrays::bytes(&mut source, progress).map_err(|fault| match fault {
        Fault::Foreign(found, what_to_do) => refuse(found, &what_to_do),
        Fault::Broken(found) => broken(found),
        Fault::Io(source) => DataError::Io {
            file: file.to_owned(),
            action: "read it",
            source,
        },
    })?;
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes.as_slice())).map_err(|error| broken(error.to_string()))?;
    let names: Vec<String> = archive
        .file_names()
        .take(MOST_FILES)
        .filter_map(|name| Some(name.ok()?.into_owned()))
        .collect();
    if names.iter().any(|name| name.ends_with(".npy")) {
        let channels = arrays::read(&NPZ, Box::new(bytes.as_slice()), file, progress)?;
        return Ok(Opened::Arrays { channels, file });
    }
    if names.iter().any(|name| name == "xl/workbook.xml") {
        let unpacked =
            (0..archive.len().min(MOST_FILES)).map(|index| archive.by_index(index).map_or(0, |entry| entry.size()));
        if unpacked.fold(0, u64::saturating_add) > MOST_UNPACKED {
            return Err(refuse("the workbook is too large".into(), "save the sheet as CSV"));
        }
        return open::workbook(&bytes, file, options);
    }
    if names.iter().any(|name| name == "content.xml") {
        return Err(refuse(
            "this is an OpenDocument sheet".into(),
            "this makes a table of it that can be imported: soffice --headless --convert-to csv F.ods",
        ));
    }
    let files: Vec<&String> = names
        .iter()
        .filter(|name| !name.ends_with('/') && !name.starts_with("__MACOSX/"))
        .collect();
    let [only] = files.as_slice() else {
        return Err(refuse(
            format!("this is a zip file of {} files", files.len()),
            "a zip of one recording is read; unpack it and import its files, as in `unzip F.zip -d F` and `hysteron \
             import F/*.csv -o stage`",
        ));
    };
    let mut unpacked = Vec::new();
    archive
        .by_name(only)
        .map_err(|error| broken(error.to_string()))?
        .take(MOST_UNPACKED)
        .read_to_end(&mut unpacked)
        .map_err(|error| broken(format!("{only} cannot be unpacked: {error}")))?;
    inner(Box::new(Cursor::new(unpacked)), file, options, progress)
}

/// Reads the arrays of an `.npz`.
fn npz(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let bytes = arrays::bytes(source, progress)?;
    let broken = |error: zip::result::ZipError| Fault::Broken(error.to_string());
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes.as_slice())).map_err(broken)?;
    let mut contents = Contents::default();
    let mut budget = Budget::of(bytes.len());
    let mut left = MOST_UNPACKED;
    for index in 0..archive.len().min(MOST_FILES) {
        let entry = archive.by_index(index).map_err(broken)?;
        let name = entry.name().map_err(broken)?.into_owned();
        let Some(array) = name.strip_suffix(".npy") else {
            contents.skipped.push(format!("{name}: no array of NumPy"));
            continue;
        };
        let mut unpacked = Vec::new();
        entry.take(left).read_to_end(&mut unpacked)?;
        left -= unpacked.len() as u64;
        npy::array(&unpacked, array, &mut contents, &mut budget)?;
    }
    Ok(contents)
}
