//! `hysteron track --process`: a controller on a stage of the user's own that runs as a process.

use crate::commands::control::on_model::answer;
use crate::commands::control::track::TrackArgs;
use crate::error::CliError;
use crate::exit::Done;
use crate::progress;
use hysteron_control::design::{Controller, beyond};
use hysteron_control::expected::half_the_stroke;
use hysteron_control::process::{ProcessStage, on_process};
use std::time::Duration;

/// Longest time that a process may be given for an answer, seconds: an hour.
const LONGEST_S: f64 = 3600.0;

/// Runs the controller along the references that repeat.
pub(super) fn track(
    args: &TrackArgs,
    command: &str,
    given_um: Option<[f64; 2]>,
    controller: &Controller,
) -> Result<Done, CliError> {
    let range_um = given_um.unwrap_or_else(|| half_the_stroke(controller));
    // Behind a process there may be a stage.
    let programme = beyond::real(controller, range_um, args.beyond_records)?;
    let stage = stage(command, args.timeout)?;
    let bar = progress::bar("on the process");
    let report = on_process(&stage, controller, range_um, &programme, &|share| {
        progress::advance(&bar, share)
    })?;
    bar.finish_and_clear();
    answer(args, &format!("PROCESS {command}"), (&report, &programme.granted))
}

/// A stage in a process as options name it.
pub(super) fn stage(command: &str, timeout_s: f64) -> Result<ProcessStage, CliError> {
    // A NaN fails both comparisons.
    if !(timeout_s > 0.0 && timeout_s <= LONGEST_S) {
        return Err(CliError::Option(format!(
            "--timeout {timeout_s}: give seconds above 0, up to {LONGEST_S}"
        )));
    }
    Ok(ProcessStage {
        command: command.to_owned(),
        timeout: Duration::from_secs_f64(timeout_s),
    })
}
