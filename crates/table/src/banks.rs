//! Several tables in one image: what they must have in common, and their constants.

use crate::check::refuse;
use crate::{MOST_PLAYS, Table, TableError};
use hysteron_slot::Image;
use std::fmt::Write;

/// Most tables in an image: a frame of the firmware has three bits for the one that is in force.
pub const MOST_BANKS: usize = 8;

/// All tables of an image, for a host that changes from one to the other at the safe level.
const ALL: &str = "
pub fn hellos() -> [crate::wire::Hello; BANKS] {
    [HELLOS]
}
#[inline(always)]
pub fn banks() -> Result<[crate::parameters::Parameters<Law>; BANKS], hysteron_core::error::ParamError> {
    Ok([PARAMETERS])
}
const _: () = assert!(BANKS <= crate::wire::MOST_BANKS);
";

impl Table {
    /// Whether an image that holds `first` can hold this table, too: one control law, of one size, at one rate, with one set of limits
    /// and converters. References, gains and what the inverse is made of are each table's own.
    ///
    /// # Errors
    /// The first field that differs in `f32`.
    ///
    /// # Example
    /// ```
    /// # use hysteron_table::Table;
    /// # let text = include_str!("../../../firmware/tables/paper-rate-mrpi.toml");
    /// let first = Table::parse(text).unwrap();
    /// let other = Table { dac_top_v: 210.0, ..first.clone() };
    /// assert_eq!(
    ///     other.fits(&first).unwrap_err().to_string(),
    ///     "dac_top_v = 210: must be 199.993896484375 as in the image's first table"
    /// );
    /// ```
    pub fn fits(&self, first: &Self) -> Result<(), TableError> {
        let image = Image::of(&first.numbers::<MOST_PLAYS>());
        Ok(image.holds(&self.numbers::<MOST_PLAYS>())?)
    }
}

/// The constants of all tables of an image, in the order of their banks: the first's as [`Table::constants`] has them, each further
/// one's in a module `bank_1`, `bank_2`, ..., and functions for all of them.
///
/// # Errors
/// As [`Table::check`] and [`Table::fits`], by the table's place; no table or more than [`MOST_BANKS`].
pub fn constants_of_banks(tables: &[(Table, &str)]) -> Result<String, (usize, TableError)> {
    let [(first, text), others @ ..] = tables else {
        return Err((0, refuse("tables", "0", "give one")));
    };
    if tables.len() > MOST_BANKS {
        let reason = format!("an image has room for {MOST_BANKS}");
        return Err((MOST_BANKS, refuse("tables", tables.len(), reason)));
    }
    let mut source = first.constants(text).map_err(|error| (0, error))?;
    let (mut hellos, mut parameters) = ("hello()".to_owned(), "parameters()?".to_owned());
    // Writing to a String does not fail.
    let _ = writeln!(
        source,
        "pub const BANK: u8 = 0;\npub const BANKS: usize = {};",
        tables.len()
    );
    for (k, (table, text)) in (1..).zip(others) {
        table.fits(first).map_err(|error| (k, error))?;
        let constants = table.constants(text).map_err(|error| (k, error))?;
        let _ = writeln!(
            source,
            "pub mod bank_{k} {{\npub use super::BANKS;\npub const BANK: u8 = {k};\n{constants}}}"
        );
        let _ = write!(hellos, ", bank_{k}::hello()");
        let _ = write!(parameters, ", bank_{k}::parameters()?");
    }
    source += &ALL.replace("HELLOS", &hellos).replace("PARAMETERS", &parameters);
    Ok(source)
}
