//! A comparison in words and tables.

use super::amounts::prefixed;
use crate::headline::{OUT_OF_PROPORTION, direction, pooled_over_noise, range, tells};
use hysteron_data::Role;
use hysteron_diagnose::{Bin, Breakdown, Comparison, Pooled};
use std::fmt::Write;

/// The answer in words and a table.
pub fn comparison_text(comparison: &Comparison) -> String {
    let largest = comparison
        .records
        .iter()
        .map(|record| record.max_um)
        .fold(0.0, f64::max);
    let (factor, unit) = prefixed(comparison.output_unit, largest);
    let decimals = if factor > 1.0 { 1 } else { 4 };
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
            "{:<9} {:<widest$} {:>11} {:>7} {:>8.decimals$} {:>8.decimals$} {:>9.1}",
            record.role.name(),
            record.file,
            percent(record.nrmse_percent),
            percent(record.fit_percent),
            factor * record.rms_um,
            factor * record.max_um,
            record.noise_ratio
        );
    }
    text.push('\n');
    for (role_of, pooled) in [
        (Role::Identify, comparison.identify),
        (Role::Validate, comparison.validate),
    ] {
        let name = role_of.name();
        if let Some(all) = pooled {
            let Pooled {
                nrmse_percent,
                fit_percent,
                rms_um,
                records,
            } = all;
            let _ = writeln!(
                text,
                "pooled over {records} {name} record{}: {nrmse_percent:.2} % of peak to peak, fit {fit_percent:.2} %, \
                 {:.decimals$} {unit} rms, {:.1} times the noise floor",
                if records == 1 { "" } else { "s" },
                factor * rms_um,
                pooled_over_noise(comparison, &all, role_of)
            );
        }
    }
    if let Some(sentence) = comparison.beside_a_straight_line() {
        let _ = writeln!(text, "{sentence}");
    }
    where_it_is(&mut text, &comparison.r#where);
    for notice in &comparison.notices {
        let _ = write!(text, "\nnote: {notice}");
    }
    if !comparison.notices.is_empty() {
        text.push('\n');
    }
    text
}

/// Share of the squared error from which a place is named, percent.
const NAMED: f64 = 20.0;

/// The places that hold the error out of proportion, a line for each quantity that has one.
fn where_it_is(text: &mut String, breakdowns: &[Breakdown]) {
    let found: Vec<(&Breakdown, &Bin)> = breakdowns
        .iter()
        .filter(|breakdown| tells(breakdown))
        .filter_map(|breakdown| {
            let out = breakdown.bins.iter().filter(|bin| {
                bin.share_percent >= NAMED && bin.share_percent > OUT_OF_PROPORTION * bin.samples_percent
            });
            let most = out.max_by(|a, b| a.share_percent.total_cmp(&b.share_percent))?;
            Some((breakdown, most))
        })
        .collect();
    if breakdowns.is_empty() {
        return;
    }
    if found.is_empty() {
        text.push_str(
            "\nwhere the error is: spread as the samples are; no frequency, position, speed or time stands out\n",
        );
        return;
    }
    text.push_str("\nwhere the error is, out of proportion:\n");
    for (breakdown, bin) in found {
        let at = if breakdown.by == "direction" {
            direction(bin.from, bin.to).to_owned()
        } else {
            // ASCII, as everything else in a terminal
            range(bin.from, bin.to, breakdown.unit).replace('µ', "u")
        };
        let presence = if breakdown.by == "frequency" {
            "of the motion's power"
        } else {
            "of the samples"
        };
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "  by {:<12} {at}: {:.0} % of the squared error, {:.0} % {presence}",
            breakdown.by, bin.share_percent, bin.samples_percent
        );
    }
}
