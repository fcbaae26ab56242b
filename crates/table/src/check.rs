//! What is checked of a table's file; its numbers are checked by [`Numbers::sweep`], here as on a board.

use crate::{FORMAT, Family, MOST_PLAYS, Table, TableError};
use hysteron_core::tracking_law::{CREEP_FAST, CREEP_SLOW, TAPS};
#[cfg(doc)]
use hysteron_slot::Numbers;
use hysteron_slot::Sweep;

impl Table {
    /// Checks everything that can be known before the table runs.
    ///
    /// # Errors
    /// Another format, lists of different lengths, a text that would end a comment, and what [`Numbers::sweep`] refuses.
    pub fn check(&self) -> Result<(), TableError> {
        self.sweep().map(|_| ())
    }

    /// As [`Table::check`], and what its sweep has seen.
    ///
    /// # Errors
    /// As [`Table::check`].
    pub fn sweep(&self) -> Result<Sweep, TableError> {
        if let Some(covered) = &self.covered {
            covered.check_texts()?;
        }
        if self.format != FORMAT {
            return Err(refuse("format", &self.format, format!("this version reads `{FORMAT}`")));
        }
        // With fewer plays the sweep is quicker; those behind the table's weigh nothing.
        let swept = match self.thresholds_um.len() {
            ..=10 => self.sweep_with::<10>(),
            _ => self.sweep_with::<MOST_PLAYS>(),
        };
        swept?
    }

    fn sweep_with<const N: usize>(&self) -> Result<Result<Sweep, TableError>, TableError> {
        let numbers = self.numbers::<N>();
        numbers.check_terms()?;
        self.check_lists()?;
        Ok(numbers.sweep().map_err(TableError::from))
    }

    /// What the family and the law have must be there, as often as they have it, and nothing else.
    pub(crate) fn check_lists(&self) -> Result<(), TableError> {
        let family = self.family;
        let (polynomial, rate) = (family == Family::PlayPolynomial, family == Family::Wrpi);
        let plays = self.thresholds_um.len();
        let lists = [
            ("weights_v_per_um", &self.weights_v_per_um, true),
            ("rate_weights_v_s_per_um2", &self.rate_weights_v_s_per_um2, rate),
            (
                "weights_quadratic_v_per_um2",
                &self.weights_quadratic_v_per_um2,
                polynomial,
            ),
            ("weights_cubic_v_per_um3", &self.weights_cubic_v_per_um3, polynomial),
        ];
        for (field, values, has) in lists {
            let found = format!("{} values", values.len());
            if has && values.len() != plays {
                return Err(refuse(
                    field,
                    found,
                    format!("there are {plays} thresholds; give each play one weight"),
                ));
            }
            if !has && !values.is_empty() {
                let reason = format!("family {} has no such weights; take the line out", family.name());
                return Err(refuse(field, found, reason));
            }
        }
        let Some(part) = &self.controller else {
            return Ok(());
        };
        let creep = CREEP_FAST + CREEP_SLOW;
        for (field, values, has) in [
            ("controller.preview", &part.preview, TAPS),
            ("controller.creep_shares", &part.creep_shares, creep),
            ("controller.creep_tau_s", &part.creep_tau_s, creep),
        ] {
            if values.len() != has {
                return Err(refuse(
                    field,
                    format!("{} values", values.len()),
                    format!("a complete law has {has}; export the controller again"),
                ));
            }
        }
        Ok(())
    }
}

pub(crate) fn refuse(field: &str, value: impl ToString, reason: impl Into<String>) -> TableError {
    TableError::Field {
        field: field.to_owned(),
        value: value.to_string(),
        reason: reason.into(),
    }
}
