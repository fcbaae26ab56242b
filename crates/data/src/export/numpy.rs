//! NumPy's `.npz`: a zip of arrays.

use std::io::{self, Cursor, Seek, Write};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::{Column, Values};

/// What the header is padded to, so that numbers begin at a multiple of it.
const ALIGNMENT: usize = 64;

pub(super) fn write(columns: &[Column], out: &mut impl Write) -> io::Result<()> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for column in columns {
        match &column.values {
            Values::Numbers(values) => {
                let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
                entry(&mut archive, &column.name, "<f8", values.len(), bytes)?;
            }
            Values::Words { list, rows } => {
                let longest = list.iter().map(|word| word.chars().count()).max().unwrap_or(0).max(1);
                let mut bytes = Vec::with_capacity(4 * longest * rows.len());
                for &row in rows {
                    let word = Values::word(list, row).chars().map(u32::from);
                    let padded = word.chain(std::iter::repeat(0)).take(longest);
                    bytes.extend(padded.flat_map(u32::to_le_bytes));
                }
                entry(&mut archive, &column.name, &format!("<U{longest}"), rows.len(), bytes)?;
            }
        }
    }
    out.write_all(archive.finish()?.get_ref())
}

fn entry<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    name: &str,
    kind: &str,
    rows: usize,
    bytes: Vec<u8>,
) -> io::Result<()> {
    archive.start_file(format!("{name}.npy"), SimpleFileOptions::default())?;
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({rows},), }}");
    let before = crate::import::NPY_MAGIC.len() + 4;
    let padding = ALIGNMENT - (before + header.len() + 1) % ALIGNMENT;
    header.extend(std::iter::repeat_n(' ', padding % ALIGNMENT));
    header.push('\n');
    archive.write_all(crate::import::NPY_MAGIC)?;
    archive.write_all(&[1, 0])?;
    // a header has three keys: far below 64 kB
    archive.write_all(&u16::try_from(header.len()).map_err(io::Error::other)?.to_le_bytes())?;
    archive.write_all(header.as_bytes())?;
    archive.write_all(&bytes)
}
