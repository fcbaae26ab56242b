//! `hysteron track --robustness`: a controller on changed stages.

use crate::commands::control::track::{TrackArgs, cells, heads};
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use hysteron_control::design::Controller;
use hysteron_identify::covered::Beyond;
use hysteron_report::beyond_text;
use hysteron_table::short;
use hysteron_tracking::bench::Bench;
use hysteron_tracking::robustness::{RobustnessRow, robustness};
use std::fmt::Write;

/// The controller on the stage and on each change of it.
pub(super) fn stages(
    args: &TrackArgs,
    (name, bench): (&str, &Bench<'_>),
    controller: &Controller,
    beyond: &[Beyond],
) -> Result<Done, CliError> {
    let rows = robustness(bench, controller)?;
    let stroke_um = bench.range_um[1] - bench.range_um[0];
    if args.json {
        output::print_json(&serde_json::json!({
            "stage": name,
            "stroke_um": stroke_um,
            "position": "true",
            "rows": rows,
            "beyond": beyond,
        }))?;
    } else {
        output::print(&(robustness_text(name, stroke_um, &rows) + &beyond_text(beyond)))?;
    }
    Ok(Done::Answered)
}

fn robustness_text(stage: &str, stroke_um: f64, rows: &[RobustnessRow]) -> String {
    let mut text = format!(
        "STAGE {} (simulated), changed; the controller is the one designed for it unchanged; stroke {} um\n\
         rms against the reference at the same instant, true position, mean included, % of peak to peak\n\n{:<26} {:<6}{}  at rest\n",
        stage,
        short(stroke_um),
        "",
        "loop",
        heads()
    );
    for row in rows {
        let verdict = if row.stable { "stable" } else { "NOT STABLE" };
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<26} {:<6}{}  {:.2} nm, {verdict}",
            row.change,
            row.loop_kind,
            cells(&row.rms_percent),
            row.rest_nm
        );
    }
    text
}
