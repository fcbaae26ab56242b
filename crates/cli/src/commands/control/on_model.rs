//! `hysteron track --model`: a controller on the user's own identified model.

use crate::commands::control::track::{TrackArgs, not_played};
use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use hysteron_control::design::{Controller, beyond};
use hysteron_control::expected::{Report, half_the_stroke};
use hysteron_control::on_model::on_model;
use hysteron_identify::covered::Beyond;
use hysteron_report::{beyond_text, tracked_text};
use serde::Serialize;
use std::path::Path;

/// Runs the controller along the references that repeat.
pub(super) fn track(
    args: &TrackArgs,
    path: &Path,
    given_um: Option<[f64; 2]>,
    controller: &Controller,
) -> Result<Done, CliError> {
    let model = load::model(path)?;
    let range_um = given_um.unwrap_or_else(|| half_the_stroke(controller));
    let beyond = beyond::simulated(controller, range_um, args.beyond_records)?;
    let report = on_model(&model, controller, range_um)?;
    answer(args, &format!("MODEL {}", path.display()), (&report, &beyond))
}

#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    report: &'a Report,
    /// What of the references leaves the records.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    beyond: &'a [Beyond],
}

/// Prints what was expected beside what was found.
pub(super) fn answer(args: &TrackArgs, title: &str, (report, beyond): (&Report, &[Beyond])) -> Result<Done, CliError> {
    if args.json {
        output::print_json(&Answer { report, beyond })?;
    } else {
        output::print(&(tracked_text(title, report) + &not_played(&report.not_played) + &beyond_text(beyond)))?;
    }
    Ok(if report.rows.iter().all(|row| row.stable) {
        Done::Answered
    } else {
        Done::Unstable
    })
}
