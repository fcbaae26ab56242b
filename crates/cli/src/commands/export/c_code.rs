//! The law of a table as C.

use super::{ExportArgs, Table, write};
use crate::error::CliError;
use crate::exit::Done;
use crate::output;

/// Writes source and header of a table whose file is `text`; `said` is what the table's making said.
pub(super) fn write_both(table: &Table, text: &str, args: &ExportArgs, said: &str) -> Result<Done, CliError> {
    let path = &args.output;
    if path.extension().is_none_or(|extension| extension != "c") {
        return Err(CliError::Option(format!(
            "-o {}: the name of a C file must end in .c; its header goes beside it",
            path.display()
        )));
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().replace('-', "_");
    let code = table.c_code(text, &name).map_err(|source| CliError::Table {
        path: args.model.clone(),
        source,
    })?;
    // The source includes its header by that name.
    let header = path.with_file_name(format!("{name}.h"));
    write(path, &code.source)?;
    write(&header, &code.header)?;
    output::print(&format!(
        "{said}written to {} and {}; call {name}_step once a sample\n",
        path.display(),
        header.display()
    ))?;
    Ok(Done::Answered)
}
