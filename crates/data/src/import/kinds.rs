//! What a file is, by its first bytes; and of those that are not read, what it is and how it becomes one that is.

use super::{feather, hdf5, json, lvm, mat4, npy, parquet, tdms};
use crate::error::DataError;

/// A kind of file that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileKind {
    Text,
    Gzip,
    Zip,
    Mat5,
    Mat4,
    Mat73,
    Hdf5,
    Parquet,
    Feather,
    Npy,
    Tdms,
    Lvm,
    Json,
}

/// Kinds that are known and not read: where their mark stands, the mark, what it is, and the line that converts it.
const FOREIGN: &[(usize, &[u8], &str, &str)] = &[
    (
        0,
        b"FEA1",
        "a Feather file of version 1",
        "python -c \"import pandas; pandas.read_feather('F').to_csv('F.csv')\"",
    ),
    (
        0,
        b"ORC",
        "an ORC file",
        "python -c \"import pandas; pandas.read_orc('F').to_csv('F.csv')\"",
    ),
    (
        0,
        b"MDF     ",
        "an ASAM MDF file (.mf4, .mdf)",
        "python -c \"import asammdf; asammdf.MDF('F').export('csv', 'F.csv')\"",
    ),
    (
        0,
        b"SQLite format 3",
        "an SQLite database",
        "sqlite3 -header -csv F 'select * from TABLE' > F.csv",
    ),
    (0, b"BZh", "packed by bzip2", "bunzip2 F"),
    (0, b"\xfd7zXZ\0", "packed by xz", "unxz F"),
    (0, b"\x28\xb5\x2f\xfd", "packed by zstd", "unzstd F"),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive", "7z x F"),
    (
        8,
        b"WAVE",
        "a WAV sound file",
        "python -c \"import scipy.io.wavfile as w, numpy; r, d = w.read('F.wav'); print(r, 'Hz'); numpy.savetxt('F.csv', d, delimiter=',')\"",
    ),
    (
        0,
        b"CDF\x01",
        "a NetCDF file of version 3",
        "ncdump F.nc > F.txt, or python -c \"import xarray; xarray.open_dataset('F.nc').to_dataframe().to_csv('F.csv')\"",
    ),
    (
        0,
        b"CDF\x02",
        "a NetCDF file of version 3",
        "python -c \"import xarray; xarray.open_dataset('F.nc').to_dataframe().to_csv('F.csv')\"",
    ),
    (
        0,
        b":WFM",
        "a Tektronix waveform (.isf)",
        "save it as CSV on the oscilloscope (Save, Spreadsheet), or python -c \"import isfreader\"",
    ),
    (
        2,
        b":WFM#",
        "a Tektronix waveform (.wfm)",
        "save it as CSV on the oscilloscope (Save, Spreadsheet file format)",
    ),
    (
        0,
        b"AG01",
        "a Keysight binary waveform (.bin)",
        "save it as CSV on the oscilloscope (Save, Format: CSV)",
    ),
    (
        0,
        b"AG03",
        "a Keysight binary waveform (.bin)",
        "save it as CSV on the oscilloscope (Save, Format: CSV)",
    ),
    (
        0,
        b"AG10",
        "a Keysight binary waveform (.bin)",
        "save it as CSV on the oscilloscope (Save, Format: CSV)",
    ),
    (
        0,
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "an old Excel workbook (.xls)",
        "soffice --headless --convert-to csv F.xls",
    ),
    (0, b"\x89PNG", "a picture", "save the samples instead of the screen"),
    (0, b"%PDF", "a PDF", "save the samples as CSV where they were recorded"),
];

/// The kind of a file that is read.
///
/// # Errors
/// Kinds that are not, with what they are and how they become one that is.
pub(crate) fn kind(head: &[u8], file: &str) -> Result<FileKind, DataError> {
    let begins = |mark: &[u8]| head.starts_with(mark);
    if begins(b"\x1f\x8b") {
        return Ok(FileKind::Gzip);
    }
    if begins(b"PK\x03\x04") || begins(b"PK\x05\x06") {
        return Ok(FileKind::Zip);
    }
    if begins(npy::MAGIC) {
        return Ok(FileKind::Npy);
    }
    if begins(tdms::MAGIC) {
        return Ok(FileKind::Tdms);
    }
    if begins(parquet::MAGIC) {
        return Ok(FileKind::Parquet);
    }
    if begins(feather::MAGIC) {
        return Ok(FileKind::Feather);
    }
    if let Some(kind) = matlab(head, file)? {
        return Ok(kind);
    }
    if head
        .strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(head)
        .starts_with(lvm::MAGIC)
    {
        return Ok(FileKind::Lvm);
    }
    foreign(head, file)?;
    refuse_binary(head, file)?;
    if json::is_one(head) {
        return Ok(FileKind::Json);
    }
    Ok(FileKind::Text)
}

/// MATLAB's files by their head of 128 bytes, or of version 4 by their first variable.
fn matlab(head: &[u8], file: &str) -> Result<Option<FileKind>, DataError> {
    let is_hdf5 = |at: usize| head.get(at..at + hdf5::MAGIC.len()) == Some(hdf5::MAGIC);
    // MATLAB puts 512 bytes of its own before HDF5
    if let Some(at) = [0, 512, 1024, 2048].into_iter().find(|at| is_hdf5(*at)) {
        return Ok(Some(if at > 0 && head.starts_with(b"MATLAB ") {
            FileKind::Mat73
        } else {
            FileKind::Hdf5
        }));
    }
    match head.get(124..128) {
        Some([0x00, 0x01, b'I', b'M'] | [0x01, 0x00, b'M', b'I']) => return Ok(Some(FileKind::Mat5)),
        _ if head.starts_with(b"MATLAB ") && head.contains(&0) => {
            return Err(DataError::Format {
                file: file.to_owned(),
                found: "this is a MATLAB file of a version that is not known".into(),
                what_to_do: "in MATLAB, load it and say `save('file.mat','-v7')`".into(),
            });
        }
        _ => {}
    }
    Ok(mat4::is_one(head).then_some(FileKind::Mat4))
}

/// Refuses kinds that are known and not read.
fn foreign(head: &[u8], file: &str) -> Result<(), DataError> {
    let marked = |(at, mark, ..): &&(usize, &[u8], &str, &str)| head.get(*at..at + mark.len()) == Some(mark);
    let pickle = matches!(head, [0x80, 2..=5, ..]);
    let python = "python -c \"import pandas; pandas.read_pickle('F').to_csv('F.csv')\"";
    let (what, line) = match FOREIGN.iter().find(marked) {
        Some((_, _, what, line)) => (*what, *line),
        None if pickle => ("a Python pickle, which is a program and not read", python),
        None => return Ok(()),
    };
    Err(DataError::Format {
        file: file.to_owned(),
        found: format!("this is {what}"),
        what_to_do: format!("this makes a table of it that can be imported: {line}"),
    })
}

/// Refuses what is no text.
fn refuse_binary(head: &[u8], file: &str) -> Result<(), DataError> {
    let utf16 = head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff");
    let refuse = |found: &str, what_to_do: &str| {
        Err(DataError::Format {
            file: file.to_owned(),
            found: found.into(),
            what_to_do: what_to_do.into(),
        })
    };
    if !utf16 && head.contains(&0) {
        return refuse(
            "this is a binary file of a kind that is not known",
            "CSV, TDMS, LVM, MATLAB, HDF5, NumPy, Parquet, Feather, Excel, JSON and PI's GCS are read; export one of them",
        );
    }
    if !utf16 && head.contains(&b'\r') && !head.contains(&b'\n') {
        return refuse(
            "lines end in a carriage return alone",
            "save it with line ends LF or CRLF",
        );
    }
    Ok(())
}
