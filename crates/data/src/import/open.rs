//! A file whose layout is known and whose samples are still to be read.

use std::io::{self, Read};

use super::arrays::{self, Channels};
use super::columns::{Chosen, Offer};
use super::decode::{Decoded, Encoding};
use super::dialect::{self, Dialect};
use super::finish::Part;
use super::kinds::{self, FileKind};
use super::options::{Decimal, ImportOptions, Separator};
use super::preview::Kind;
use super::{feather, gcs, hdf5, json, lvm, mat4, mat5, npy, parquet, scopes, sheet, table, tdms, zipped};
use crate::clock::Clock;
use crate::error::DataError;
use crate::lines::Lines;
use crate::native::line_error;
use crate::place::Place;

/// Bytes of a file in which its kind and layout must show: preambles of instruments have a few kilobytes.
const HEAD: u64 = 256 * 1024;

/// What a table of text is.
pub(crate) enum Layout {
    Table,
    Gcs,
    /// A sheet of a workbook, and the names of the others.
    Sheet(String, Vec<String>),
}

/// An opened file.
pub(crate) enum Opened<'a> {
    /// A table of text: its rows are read when the columns are chosen.
    Text {
        dialect: Dialect,
        encoding: Encoding,
        layout: Layout,
        rest: Box<dyn Read + 'a>,
        file: &'a str,
    },
    /// Named arrays: read already.
    Arrays { channels: Channels, file: &'a str },
}

/// Opens a file of any kind.
pub(crate) fn open<'a>(
    mut source: Box<dyn Read + 'a>,
    file: &'a str,
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Opened<'a>, DataError> {
    let mut head = Vec::new();
    source
        .by_ref()
        .take(HEAD)
        .read_to_end(&mut head)
        .map_err(DataError::io(file, "read it"))?;
    let complete = (head.len() as u64) < HEAD;
    let kind = kinds::kind(&head, file)?;
    let whole: Box<dyn Read + 'a> = Box::new(io::Cursor::new(head.clone()).chain(source));
    let format = match kind {
        FileKind::Text => return text(head, complete, whole, file, options),
        FileKind::Gzip => return zipped::gzip(whole, file, options, progress),
        FileKind::Zip => return zipped::zip(whole, file, options, progress),
        FileKind::Mat5 => &mat5::FORMAT,
        FileKind::Mat4 => &mat4::FORMAT,
        FileKind::Mat73 => &hdf5::MATLAB,
        FileKind::Hdf5 => &hdf5::FORMAT,
        FileKind::Parquet => &parquet::FORMAT,
        FileKind::Feather => &feather::FORMAT,
        FileKind::Npy => &npy::FORMAT,
        FileKind::Tdms => &tdms::FORMAT,
        FileKind::Lvm => &lvm::FORMAT,
        FileKind::Json => &json::FORMAT,
    };
    let channels = arrays::read(format, whole, file, progress)?;
    Ok(Opened::Arrays { channels, file })
}

/// Opens a table of text.
fn text<'a>(
    head: Vec<u8>,
    complete: bool,
    whole: Box<dyn Read + 'a>,
    file: &'a str,
    options: &ImportOptions,
) -> Result<Opened<'a>, DataError> {
    let encoding = Encoding::of(&head);
    let lines = head_lines(&head, encoding, complete, file)?;
    let mut layout = Layout::Table;
    let dialect = if gcs::is_header(&lines) {
        layout = Layout::Gcs;
        gcs::find(&lines, file)?
    } else if let Some(dialect) = scopes::find(&lines, encoding, file, options)? {
        dialect
    } else {
        dialect::find(&lines, encoding, file, options)?
    };
    Ok(Opened::Text {
        dialect,
        encoding,
        layout,
        rest: whole,
        file,
    })
}

/// Opens the first sheet of a workbook in which there is a table.
pub(crate) fn workbook<'a>(bytes: &[u8], file: &'a str, options: &ImportOptions) -> Result<Opened<'a>, DataError> {
    let sheets = sheet::sheets(bytes, file)?;
    let mut fault = None;
    for (index, sheet) in sheets.iter().enumerate() {
        let head = &sheet.text.as_bytes()[..sheet.text.len().min(HEAD as usize)];
        let lines = head_lines(head, Encoding::Utf8, head.len() == sheet.text.len(), file)?;
        let options = ImportOptions {
            separator: Some(Separator::Tab),
            decimal: Some(Decimal::Point),
            ..options.clone()
        };
        match dialect::find(&lines, Encoding::Utf8, file, &options) {
            Ok(dialect) => {
                let others = sheets.iter().enumerate().filter(|(other, _)| *other != index);
                let others = others.map(|(_, sheet)| sheet.name.clone()).collect();
                return Ok(Opened::Text {
                    dialect,
                    encoding: Encoding::Utf8,
                    layout: Layout::Sheet(sheet.name.clone(), others),
                    rest: Box::new(io::Cursor::new(sheet.text.clone().into_bytes())),
                    file,
                });
            }
            Err(error) => fault = fault.or(Some(error)),
        }
    }
    Err(fault.unwrap_or_else(|| DataError::Format {
        file: file.to_owned(),
        found: "no sheet of the workbook has rows of numbers".into(),
        what_to_do: "the columns of a record stand side by side, their names above them".into(),
    }))
}

impl Opened<'_> {
    /// What there is to choose from.
    pub(crate) fn offer(&self, options: &ImportOptions) -> Offer<'_> {
        match self {
            Opened::Text { dialect, file, .. } => Offer {
                noun: "column",
                names: &dialect.names,
                labels: &dialect.names,
                units: &dialect.units,
                at: dialect
                    .header_line
                    .map_or_else(|| Place::file(file), |line| Place::line(file, line)),
                has_clock: options.rate_hz.is_some() || dialect.period_s.is_some(),
            },
            Opened::Arrays { channels, file } => channels.offer(file, options),
        }
    }

    /// What the file is.
    pub(crate) fn kind(&self) -> Kind {
        match self {
            Opened::Text {
                dialect,
                encoding,
                layout,
                ..
            } => dialect.kind(*encoding, layout),
            Opened::Arrays { channels, .. } => channels.kind(),
        }
    }

    /// What was found when it was opened that the user should know.
    pub(crate) fn notices(&self) -> Vec<String> {
        match self {
            Opened::Text { encoding, .. } if *encoding == Encoding::Latin1 => {
                vec!["the names are not UTF-8, read as Latin-1".into()]
            }
            Opened::Text {
                layout: Layout::Sheet(_, others),
                ..
            } if !others.is_empty() => vec![format!("sheets ignored: {}", others.join(", "))],
            Opened::Text { .. } => Vec::new(),
            Opened::Arrays { channels, .. } => channels.notices(),
        }
    }

    /// Reads the chosen columns, of each run of the file.
    pub(crate) fn read(
        self,
        chosen: Vec<Chosen>,
        options: &ImportOptions,
        notices: &mut Vec<String>,
        progress: &mut dyn FnMut(u64),
    ) -> Result<Vec<Part>, DataError> {
        match self {
            Opened::Text {
                dialect,
                encoding,
                rest,
                file,
                ..
            } => {
                let whole = Decoded::new(rest, encoding);
                let table = table::read(whole, file, &dialect, encoding, chosen, options.missing, progress)?;
                let clock_s = dialect.period_s.map(|period| Clock { start: 0.0, period });
                Ok(vec![Part { table, clock_s }])
            }
            Opened::Arrays { channels, file } => channels.parts(chosen, file, options, notices),
        }
    }
}

/// The lines of a file's head; the last one only if the file ends there.
fn head_lines(head: &[u8], encoding: Encoding, complete: bool, file: &str) -> Result<Vec<Vec<u8>>, DataError> {
    let mut source = Lines::new(Decoded::new(head, encoding));
    let mut lines = Vec::new();
    loop {
        match source.next_line() {
            Ok(Some((_, line))) => lines.push(line.to_vec()),
            Ok(None) => break,
            Err(fault) => return Err(line_error(fault, file)),
        }
    }
    if !complete {
        lines.pop();
    }
    Ok(lines)
}
