//! Standard output and files.

use crate::error::CliError;
use hysteron_data::DataError;
use std::io::Write;
use std::path::Path;

/// Prints a text.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()?;
    Ok(())
}

/// Prints a value as JSON, one trailing newline.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), CliError> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Says on standard error what may be wrong.
pub(crate) fn warn(text: impl std::fmt::Display) {
    // A closed standard error loses a warning, not the answer.
    let _ = writeln!(std::io::stderr(), "warning: {text}");
}

/// Says on standard error what should be known.
pub(crate) fn note(text: impl std::fmt::Display) {
    // A closed standard error loses a remark, not the answer.
    let _ = writeln!(std::io::stderr(), "note: {text}");
}

/// Refuses a folder that has a dataset already, before anything is waited for; it is looked at again when it is written.
pub(crate) fn refuse_to_replace(folder: &Path, overwrite: bool) -> Result<(), CliError> {
    let manifest = folder.join("dataset.toml");
    if overwrite || !manifest.exists() {
        return Ok(());
    }
    let file = manifest.display().to_string();
    Err(DataError::Exists { file }.into())
}

/// Writes a file of text as a whole.
pub(crate) fn write_file(path: &Path, text: &str) -> Result<(), CliError> {
    write_bytes(path, text.as_bytes())
}

/// Writes a file as a whole: first beside its place, then into it.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let failed = |source| CliError::Write {
        path: path.to_owned(),
        source,
    };
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    std::fs::write(&beside, bytes).map_err(failed)?;
    std::fs::rename(&beside, path).map_err(failed)
}

/// How the program was started, for commands that it prints: by cargo from its sources, or by its name.
pub(crate) fn program() -> &'static str {
    match std::env::var_os("CARGO_MANIFEST_DIR") {
        None => "hysteron",
        Some(_) => "cargo run --release --",
    }
}

/// Names with commas between them.
pub(crate) fn list<T: std::fmt::Display>(names: &[T]) -> String {
    let names: Vec<String> = names.iter().map(ToString::to_string).collect();
    names.join(", ")
}
