//! A law or a stage as a co-simulation unit.

use super::{ExportArgs, StageName, Table};
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use hysteron_control::design::beyond::{self, Asked};
use hysteron_control::message::Setting;
use hysteron_fmu::{Fmu, FmuError};
use hysteron_identify::Model;
use hysteron_table::short;

/// Writes the law of a table whose file is `text`; `said` is what the table's making said.
pub(super) fn write_law(table: &Table, text: &str, args: &ExportArgs, said: &str) -> Result<Done, CliError> {
    let unit = Fmu::of_law(table, text, &name(args)?);
    write(unit, args, said)
}

/// Writes the stage that a model describes, at the rate of the records where no other is asked for.
pub(super) fn write_stage(model: &Model, args: &ExportArgs) -> Result<Done, CliError> {
    let of_stage = args.stage.map(|stage: StageName| 1.0 / stage.config().sample_period_s);
    let Some(rate_hz) = args.rate.or(of_stage).or(model.covered.sample_rate_hz) else {
        return Err(CliError::Option(format!(
            "{}: the model does not say at what rate its records were taken; give the rate of the unit: --rate HZ",
            args.model.display()
        )));
    };
    beyond::granted(
        &mut model.covered.clone(),
        &[Asked::rate(rate_hz, Setting::TableRate)],
        args.beyond_records,
    )?;
    let unit = Fmu::of_stage(model, &name(args)?, rate_hz);
    let said = format!(
        "{} with {} {} and {} effects at {} Hz, from rest at 0 V\n",
        model.family,
        model.thresholds.len(),
        model.family.elements(),
        model.effects.len(),
        short(rate_hz)
    );
    write(unit, args, &said)
}

fn write(unit: Result<Fmu, FmuError>, args: &ExportArgs, said: &str) -> Result<Done, CliError> {
    let packed = unit.and_then(|unit| unit.pack()).map_err(|source| CliError::Fmu {
        path: args.model.clone(),
        source,
    })?;
    output::write_bytes(&args.output, &packed)?;
    output::print(&format!("{said}written to {}\n", args.output.display()))?;
    Ok(Done::Answered)
}

/// The unit's name, which is that of its file.
fn name(args: &ExportArgs) -> Result<String, CliError> {
    let path = &args.output;
    if path.extension().is_none_or(|extension| extension != "fmu") {
        return Err(CliError::Option(format!(
            "-o {}: the name of a co-simulation unit must end in .fmu",
            path.display()
        )));
    }
    Ok(path.file_stem().unwrap_or_default().to_string_lossy().replace('-', "_"))
}
