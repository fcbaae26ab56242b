//! `hysteron track --board`: the references of the table by a real board, judged by its own sensor.

use crate::commands::control::learning;
use crate::commands::control::track::{TrackArgs, cells, first_mode, heads, hertz, in_order, not_played, scan_rows};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use hysteron_control::design::Controller;
use hysteron_control::expected::half_the_stroke;
use hysteron_report::{Runs, adapted_text, beyond_text};
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
    let mut learned = report.controllers.iter();
    if report.adaptation.is_some() && learned.all(|controller| controller.adapted.is_empty()) {
        text.push_str(
            "\nLEARNED WHILE IT RAN: nothing; the board's table learns nothing, the controller does. Export it anew\n",
        );
    } else {
        let learned = report.controllers.iter();
        let learned = learned.flat_map(|controller| in_order(controller.loop_kind, &controller.adapted));
        text.push_str(&adapted_text(report.adaptation.as_ref(), Runs::InARow, learned));
    }
    text.push_str(&learning::text(&report.learned, " on the board"));
    let _ = writeln!(text, "\n{} ticks lost", report.lost);
    text.push_str(&not_played(&report.not_played));
    text.push_str(&beyond_text(&report.beyond));
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_control::adapted::{Adaptation, Adapted};
    use hysteron_trials::on_board::BoardFigures;
    use std::collections::BTreeMap;

    fn report(adaptation: Option<Adaptation>, adapted: &[(&str, Adapted)]) -> BoardReport {
        let adapted = adapted.iter().map(|(key, learned)| ((*key).to_owned(), *learned));
        BoardReport {
            stage: "nucleo-h743zi".to_owned(),
            table_sha256: "00".to_owned(),
            first_mode_hz: None,
            stroke_um: 10.0,
            position: "measured",
            controllers: vec![BoardFigures {
                name: "complete",
                loop_kind: "open",
                rms_percent: BTreeMap::new(),
                adapted: adapted.collect(),
                creep_peak_percent: 0.1,
                lag30_hz: None,
                minus3db_hz: None,
                noise_nm: None,
            }],
            learned: Vec::new(),
            scans: Vec::new(),
            lost: 0,
            adaptation,
            beyond: Vec::new(),
            not_played: Vec::new(),
        }
    }

    /// A line for each run that said what it had learned; a bound of 3 % is 2.99999993 % in `f32`.
    #[test]
    fn val_what_a_board_has_learned() {
        let learned = Adapted {
            gain_percent: 100.0 * f64::from(0.03_f32),
            zero_um: -0.0125,
            lag_us: 1.5,
        };
        let bounds = Adaptation::within(0.03, 20.0, 200.0, None);
        let said = text(&report(Some(bounds.clone()), &[("10", learned)]));
        assert!(
            said.contains("at the end of each run, going on from the one before: gain within +-3.00 %"),
            "{said}"
        );
        let line = said.lines().find(|line| line.contains("-0.0125")).unwrap_or(&said);
        let cells: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(
            cells[cells.len() - 8..],
            ["open", "+3.000", "-0.0125", "+1.50", "gain", "AT", "ITS", "BOUND"][..],
            "{said}"
        );
        let said = text(&report(Some(bounds), &[]));
        assert!(said.contains("the board's table learns nothing"), "{said}");
        assert!(!text(&report(None, &[])).contains("LEARNED"));
    }
}
