//! A file that is there whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::DataError;

/// A file written under a temporary name beside its own; [`commit`](Pending::commit) gives it its name, dropping it
/// without that leaves nothing behind.
pub(crate) struct Pending {
    temporary: PathBuf,
    target: PathBuf,
    committed: bool,
}

impl Pending {
    /// Writes a file under its temporary name, down to the disk.
    pub(crate) fn write(
        target: &Path,
        content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<Pending, DataError> {
        let mut name = std::ffi::OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(format!(".{}.tmp", std::process::id()));
        let temporary = target.with_file_name(name);
        let shown = target.display().to_string();
        let file = OpenOptions::new().write(true).create_new(true).open(&temporary);
        let file = file.map_err(DataError::io(&shown, "create it"))?;
        let pending = Pending {
            temporary,
            target: target.to_owned(),
            committed: false,
        };
        let mut out = BufWriter::with_capacity(1 << 16, file);
        content(&mut out)
            .and_then(|()| out.flush())
            .and_then(|()| out.get_ref().sync_all())
            .map_err(DataError::io(&shown, "write it"))?;
        Ok(pending)
    }

    /// Gives the file its name.
    pub(crate) fn commit(mut self) -> Result<(), DataError> {
        let shown = self.target.display().to_string();
        fs::rename(&self.temporary, &self.target).map_err(DataError::io(&shown, "write it"))?;
        self.committed = true;
        Ok(())
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if !self.committed {
            let _ = fs::remove_file(&self.temporary); // nothing more can be done about it here
        }
    }
}
