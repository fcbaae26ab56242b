//! `hysteron track --model`: a controller on the user's own identified model.

use crate::commands::control::track::{TrackArgs, within_records};
use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use hysteron_control::design::Controller;
use hysteron_control::expected::{Report, Row};
use hysteron_control::on_model::on_model;
use hysteron_control::reference::SHAPES;
use std::fmt::Write;
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
    within_records(args, range_um, controller)?;
    let report = on_model(&model, controller, range_um)?;
    answer(args, &format!("MODEL {}", path.display()), &report)
}

/// Prints what was expected beside what was found.
pub(super) fn answer(args: &TrackArgs, title: &str, report: &Report) -> Result<Done, CliError> {
    if args.json {
        output::print_json(report)?;
    } else {
        output::print(&text(title, report))?;
    }
    Ok(if report.rows.iter().all(|row| row.stable) {
        Done::Answered
    } else {
        Done::Unstable
    })
}

/// Half of the stroke that the inverse covers, about two fifths of it.
pub(super) fn half_the_stroke(controller: &Controller) -> [f64; 2] {
    let (inverse, rest_um) = (&controller.model.inverse, controller.model.around.rest_um);
    let low_um = inverse.input_min_um.max(0.0);
    [0.15, 0.65].map(|share| rest_um + low_um + share * (inverse.input_max_um - low_um))
}

fn text(title: &str, report: &Report) -> String {
    let [low_um, high_um] = report.range_um;
    let mut text = format!(
        "{title}, references from {low_um:.3} to {high_um:.3} um; errors against the reference at the same instant\n\
         expected: what the design reckons with, but for the model's own error, of a sine; found: of the run, rms, % of peak to peak\n\n\
         {:<22} {:<6} {:>9} {:>9}\n",
        "reference", "loop", "expected", "found"
    );
    for (key, _) in SHAPES {
        for row in report.rows.iter().filter(|row| row.reference == key) {
            text.push_str(&line(row));
        }
    }
    for effect in &report.left_out {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{effect} is not in the runs: a command alone does not determine it"
        );
    }
    text
}

fn line(row: &Row) -> String {
    let name = match row.reference.parse::<f64>() {
        Ok(hz) => format!("sine {hz} Hz"),
        Err(_) => format!("{} Hz", row.reference.replace('-', " ")),
    };
    let expected = row
        .expected_percent
        .map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}"));
    let unstable = if row.stable {
        ""
    } else {
        "  UNSTABLE: do not run it; design it with a smaller --margin, or --open"
    };
    format!(
        "{name:<22} {:<6} {expected:>9} {:>9.3}{unstable}\n",
        row.loop_kind, row.found_percent
    )
}
