//! A controller's runs on a stage of the user's own, as a table.

use super::adapted::{Runs, adapted_text};
use hysteron_control::design::beyond::unknown;
use hysteron_control::expected::{Report, Row};
use hysteron_control::reference::SHAPES;
use hysteron_identify::covered::Beyond;
use std::fmt::Write;

/// What a design expects beside what a run on a model or a process came to.
pub fn tracked_text(title: &str, report: &Report) -> String {
    let [low_um, high_um] = report.range_um;
    let mut text = format!(
        "{title}, references from {low_um:.3} to {high_um:.3} um; errors against the reference at the same instant\n\
         expected: what the design reckons with, but for the model's own error, of a sine; found: of the run, rms, % of peak to peak\n\n\
         {:<23} {:<6} {:>9} {:>9}\n",
        "reference", "loop", "expected", "found"
    );
    for (key, _) in SHAPES {
        for row in report.rows.iter().filter(|row| row.reference == key) {
            text.push_str(&line(row));
        }
    }
    let learned = report.rows.iter();
    let learned = learned.filter_map(|row| Some((row.reference, row.loop_kind, row.adapted?)));
    text.push_str(&adapted_text(report.adaptation.as_ref(), Runs::Alone, learned));
    for effect in &report.left_out {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{effect} is not in the runs: a command alone does not determine it"
        );
    }
    text
}

/// What of the references leaves the records, a line each.
pub fn beyond_text(left: &[Beyond]) -> String {
    left.iter()
        .map(|left| format!("beyond the records: {}\n", unknown(left)))
        .collect()
}

/// A reference, as tables and files name it, in words.
pub fn reference_name(key: &str) -> String {
    match key.parse::<f64>() {
        Ok(hz) => format!("sine {hz} Hz"),
        Err(_) if key.ends_with(|last: char| last.is_ascii_digit()) => format!("{} Hz", key.replace('-', " ")),
        Err(_) => key.to_owned(),
    }
}

fn line(row: &Row) -> String {
    let name = reference_name(row.reference);
    let expected = row
        .expected_percent
        .map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}"));
    let unstable = if row.stable {
        ""
    } else {
        "  UNSTABLE: do not run it; design it with a smaller --margin, or --open"
    };
    format!(
        "{name:<23} {:<6} {expected:>9} {:>9.3}{unstable}\n",
        row.loop_kind, row.found_percent
    )
}
