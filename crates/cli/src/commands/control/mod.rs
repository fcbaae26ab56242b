//! From records to a controller that tracks: `campaign`, `design`, `track`; `rehearse` all of it.

mod chip;
pub(crate) mod design;
mod on_board;
mod page;
pub(crate) mod record;
pub(crate) mod rehearse;
pub(crate) mod track;

use crate::error::CliError;
use hysteron_plant::{StageConfig, preset};

/// The preset with a name.
pub(crate) fn stage(name: &str) -> Result<StageConfig, CliError> {
    preset::named(name).ok_or_else(|| {
        CliError::Option(format!(
            "there is no stage `{name}`; the simulated ones are {}",
            preset::NAMES.join(", ")
        ))
    })
}
