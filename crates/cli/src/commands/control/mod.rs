//! From records to a controller that tracks: `campaign`, `design`, `track`, `drive`; `rehearse` all of it.

mod changed;
pub(crate) mod design;
pub(crate) mod drive;
mod learning;
pub(crate) mod offered;
mod on_board;
mod on_model;
mod on_process;
mod own_stage;
mod page;
pub(crate) mod record;
pub(crate) mod rehearse;
pub(crate) mod track;

use crate::error::CliError;
use hysteron_plant::{StageConfig, preset};

/// A range that was given as two numbers.
pub(crate) fn range_um(given: Option<&[f64]>) -> Result<Option<[f64; 2]>, CliError> {
    match given {
        None => Ok(None),
        Some(&[low, high]) if low.is_finite() && high.is_finite() && low < high => Ok(Some([low, high])),
        Some(given) => Err(CliError::Option(format!(
            "--range {given:?}: two positions in micrometres, the lower first, such as 3,13"
        ))),
    }
}

/// The preset with a name.
pub(crate) fn stage(name: &str) -> Result<StageConfig, CliError> {
    preset::named(name).ok_or_else(|| {
        CliError::Option(format!(
            "there is no stage `{name}`; the simulated ones are {}",
            preset::NAMES.join(", ")
        ))
    })
}
