//! Datasets and models from disk, with a progress bar and the reader's notices.

use crate::error::CliError;
use crate::progress;
use hysteron_data::{Dataset, read_dataset_with_progress};
use std::io::Write;
use std::path::Path;

/// Reads a dataset; what the reader converted or ignored is said on standard error.
pub(crate) fn dataset(path: &Path) -> Result<Dataset, CliError> {
    let bar = progress::bar("reading");
    let dataset = read_dataset_with_progress(path, &mut |done, all| {
        progress::advance(&bar, done as f64 / all.max(1) as f64);
    })?;
    bar.finish_and_clear();
    for notice in &dataset.notices {
        // A closed standard error loses a remark, not the answer.
        let _ = writeln!(std::io::stderr(), "note: {}: {}", notice.file, notice.text);
    }
    Ok(dataset)
}
