//! `hysteron track --board`: the references of the table by a real board, judged by its own sensor.

use crate::commands::control::learning;
use crate::commands::control::track::{TrackArgs, cells, first_mode, heads, hertz, not_played, scan_rows, unsaid};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use hysteron_control::design::Controller;
use hysteron_control::expected::half_the_stroke;
use hysteron_report::beyond_text;
use hysteron_tracking::scans::LINES_HZ;
use hysteron_trials::on_board::{self, Asked, BoardReport, HOLD_S};
use std::fmt::Write;

/// Runs the controller on the board, and prints what came out.
pub(super) fn track(
    args: &TrackArgs,
    from: &str,
    given_um: Option<[f64; 2]>,
    controller: &Controller,
) -> Result<Done, CliError> {
    let asked = Asked {
        from,
        bank: args.bank,
        range_um: given_um.unwrap_or_else(|| half_the_stroke(controller)),
        beyond_records: args.beyond_records,
        iterations: args.iterations.map(|most| most as usize),
    };
    let bar = progress::bar("on the board");
    let report = on_board::track(controller, &asked, &|what, share| progress::show(&bar, what, share));
    bar.finish_and_clear();
    let report = report?;
    if let Some(folder) = &args.keep {
        learning::keep(folder, &report.learned, asked.range_um)?;
    }
    if args.json {
        output::print_json(&report)?;
    } else {
        output::print(&text(&report))?;
    }
    Ok(Done::Answered)
}

fn text(report: &BoardReport) -> String {
    let mode = first_mode(report.first_mode_hz);
    let mut text = format!(
        "BOARD {}, table {}; {mode} as identified; stroke {:.4} um\n\
         errors against the reference at the same instant, {} position; rms, % of peak to peak; creep: largest error from 5 ms after a\n\
         move, over {HOLD_S} s, averaged over 1 ms; bandwidths by a small multisine; noise at rest as the sensor has it\n\n\
         {:<6}{} {:>7} {:>9} {:>9} {:>6}\n",
        report.stage,
        report.table_sha256,
        report.stroke_um,
        report.position,
        "loop",
        heads(),
        "creep",
        "30 deg Hz",
        "-3 dB Hz",
        "nm"
    );
    for controller in &report.controllers {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<6}{} {:>7.3} {:>9} {:>9} {:>6.2}",
            controller.loop_kind,
            cells(&controller.rms_percent),
            controller.creep_peak_percent,
            hertz(controller.lag30_hz),
            hertz(controller.minus3db_hz),
            controller.noise_nm.unwrap_or(f64::NAN)
        );
    }
    if !report.scans.is_empty() {
        text += &format!(
            "\nSCANS of both axes at {LINES_HZ} lines a second, by the sensors of both: error of each axis at the same instant, distance from\n\
             the path (late along it is none)\n\n"
        );
        text.push_str(&scan_rows(&report.scans));
    }
    text.push_str(&unsaid(report.adaptation.as_ref()));
    text.push_str(&learning::text(&report.learned, " on the board"));
    let _ = writeln!(text, "\n{} ticks lost", report.lost);
    text.push_str(&not_played(&report.not_played));
    text.push_str(&beyond_text(&report.beyond));
    text
}
