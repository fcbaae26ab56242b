//! A comparison in words and tables.

use super::role;
use hysteron_diagnose::{Comparison, Pooled};
use std::fmt::Write;

/// The answer in words and a table.
pub fn comparison_text(comparison: &Comparison) -> String {
    let unit = comparison.output_unit;
    let mut text = String::new();
    // Writing to a String does not fail.
    let _ = writeln!(text, "noise floor {}\n", comparison.noise_in_words());
    let error = format!("error % p-p   fit %   rms {unit}   max {unit}   x noise");
    let widest = comparison
        .records
        .iter()
        .map(|record| record.file.chars().count())
        .max()
        .unwrap_or(0)
        .max(24);
    let _ = writeln!(text, "{:<9} {:<widest$} {error}", "role", "record");
    for record in &comparison.records {
        let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
        let _ = writeln!(
            text,
            "{:<9} {:<widest$} {:>11} {:>7} {:>8.4} {:>8.4} {:>9.1}",
            role(record.role),
            record.file,
            percent(record.nrmse_percent),
            percent(record.fit_percent),
            record.rms_um,
            record.max_um,
            record.noise_ratio
        );
    }
    text.push('\n');
    for (name, pooled) in [("identify", comparison.identify), ("validate", comparison.validate)] {
        if let Some(Pooled {
            nrmse_percent,
            fit_percent,
            rms_um,
            records,
        }) = pooled
        {
            let _ = writeln!(
                text,
                "pooled over {records} {name} records: {nrmse_percent:.2} % of peak to peak, fit {fit_percent:.2} %, \
                 {rms_um:.4} {unit} rms, {:.1} times the noise floor",
                rms_um / comparison.noise_rms_um
            );
        }
    }
    if let Some(sentence) = comparison.beside_a_straight_line() {
        let _ = writeln!(text, "{sentence}");
    }
    text.push_str("\nwhere the error is:\n");
    for breakdown in &comparison.r#where {
        let _ = writeln!(text, "  by {:<12} {}", breakdown.by, breakdown.finding);
    }
    for notice in &comparison.notices {
        let _ = write!(text, "\nnote: {notice}");
    }
    if !comparison.notices.is_empty() {
        text.push('\n');
    }
    text
}
