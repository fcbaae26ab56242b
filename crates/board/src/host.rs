//! A table as the application takes it, in this process: what the image of that table does, without the image.

use hysteron_core::tracking_law::PLAYS as LAW_PLAYS;
use hysteron_firmware::law::{Complete, Paper};
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::wire::Hello;
use hysteron_table::{Inverse, Table, TableError, hash};

/// Plays that there is room for; a table may have fewer.
pub const PLAYS: usize = 10;

/// What `firmware/app` makes of a table with a complete law.
///
/// # Errors
/// As [`Table::check`]; a table without one.
pub fn complete(table: &Table) -> Result<Parameters<Complete>, TableError> {
    if table.law_numbers()?.is_none() {
        return Err(TableError::Field {
            field: "controller".to_owned(),
            value: "none".to_owned(),
            reason: "the table has the paper's law".to_owned(),
        });
    }
    let (numbers, sweep) = (table.numbers::<LAW_PLAYS>(), table.sweep()?);
    Ok(Parameters::of(Complete::of(&numbers, &sweep)?, &numbers, &sweep)?)
}

/// What `firmware/app` makes of a table with the paper's law.
///
/// # Errors
/// As [`Table::check`]; a table of more than [`PLAYS`] plays.
pub fn parameters(table: &Table) -> Result<Parameters<Paper<Inverse<PLAYS>>>, TableError> {
    if table.thresholds_um.len() > PLAYS {
        return Err(TableError::Field {
            field: "thresholds_um".to_owned(),
            value: format!("{} values", table.thresholds_um.len()),
            reason: format!("runs here with at most {PLAYS}"),
        });
    }
    let (numbers, sweep) = (table.numbers::<PLAYS>(), table.sweep()?);
    let law = Paper::of(numbers.inverse(false)?.1, &numbers)?;
    Ok(Parameters::of(law, &numbers, &sweep)?)
}

/// What an image of one axis with no other table says of the table of a file.
pub fn hello(table: &Table, text: &str) -> Hello {
    Hello::of(&table.numbers::<LAW_PLAYS>(), hash(text), 0, 1)
}
