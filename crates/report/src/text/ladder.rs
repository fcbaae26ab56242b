//! A ladder as tables.

use super::percent;
use hysteron_diagnose::{Ladder, Rung};
use hysteron_identify::RecordError;
use std::fmt::Write;

/// The steps as a table, and each record's error over the steps.
pub fn ladder_text(ladder: &Ladder) -> String {
    let mut text = format!(
        "how the error on {} fell, percent of peak to peak\n\n{:<22} {:>9} {:>13} {:>12} {:>8}\n",
        ladder.dataset, "step", "fitted to", "not fitted to", "of the last", "x noise"
    );
    for rung in &ladder.steps {
        let of_before = rung
            .of_before
            .map_or_else(|| "-".to_owned(), |v| format!("{:.0} %", 100.0 * v));
        let times = rung.times_noise.map_or_else(|| "-".to_owned(), |v| format!("{v:.1}"));
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<22} {:>9} {:>13} {of_before:>12} {times:>8}",
            rung.name(),
            percent(rung.step.identify_percent),
            percent(rung.step.validate_percent)
        );
    }
    if let Some(noise) = &ladder.noise {
        let _ = writeln!(
            text,
            "{:<22} {:>9} {:>13} {:>12} {:>8}  {noise}",
            "noise floor",
            percent(ladder.noise_identify_percent),
            percent(ladder.noise_validate_percent),
            "",
            "1.0"
        );
    }
    records(
        &mut text,
        ladder,
        "error of each record, % of peak to peak",
        &|record| record.percent,
    );
    text
}

/// The same errors by other measures: percent of the output's rms, over the whole record and over its last period.
pub fn ladder_details(ladder: &Ladder) -> String {
    let mut text = String::new();
    records(
        &mut text,
        ladder,
        "rms of the error, % of the output's rms",
        &|record| record.relative_percent,
    );
    let last_period = |record: &RecordError| record.last_period_percent;
    let title = "the same of the last period of a periodic drive, error and output each about its mean";
    records(&mut text, ladder, title, &last_period);
    text
}

/// A figure of every record, step by step.
fn records(text: &mut String, ladder: &Ladder, title: &str, figure: &dyn Fn(&RecordError) -> Option<f64>) {
    let Some(last) = ladder.steps.last() else { return };
    // Records that stand still, or are not periodic, have no such figure at any step.
    let told = |file: &str| {
        let of = |rung: &Rung| {
            rung.step
                .records
                .iter()
                .any(|record| record.file == file && figure(record).is_some())
        };
        ladder.steps.iter().any(of)
    };
    if !last.step.records.iter().any(|record| told(&record.file)) {
        return;
    }
    let widths: Vec<usize> = ladder
        .steps
        .iter()
        .map(|rung| rung.name().chars().count().max(8))
        .collect();
    let widest = last
        .step
        .records
        .iter()
        .map(|r| r.file.chars().count())
        .max()
        .unwrap_or(0)
        .max(20);
    let _ = write!(text, "\n{title}\n{:<9} {:<widest$}", "role", "record");
    for (rung, &width) in ladder.steps.iter().zip(&widths) {
        let _ = write!(text, "  {:>width$}", rung.name());
    }
    text.push('\n');
    for (i, record) in last.step.records.iter().enumerate().filter(|(_, r)| told(&r.file)) {
        let role = record.role.name();
        let _ = write!(text, "{role:<9} {:<widest$}", record.file);
        for (rung, &width) in ladder.steps.iter().zip(&widths) {
            // Steps on other data have other records.
            let there = rung.step.records.get(i).filter(|r| r.file == record.file);
            let figure = there.and_then(figure);
            let _ = write!(
                text,
                "  {:>width$}",
                figure.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"))
            );
        }
        text.push('\n');
    }
}
