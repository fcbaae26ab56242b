//! A fitted model as a table.

use super::amounts::{Amount, written};
use hysteron_identify::Model;
use std::fmt::Write;

/// The parameters of the hysteresis with their standard errors, and what the user should know of the fit.
pub fn model_text(model: &Model) -> String {
    let records = model.fitted_on.records.len();
    let samples: usize = model.fitted_on.records.iter().map(|record| record.samples).sum();
    let mut text = format!(
        "{} with {} {}, {}, fitted to {records} record{} ({samples} samples)\n\n",
        model.family,
        model.thresholds.len(),
        model.family.elements(),
        model.direction.name(),
        if records == 1 { "" } else { "s" }
    );
    let parameters = model.parameters();
    let amounts: Vec<Amount<'_>> = parameters.iter().map(Amount::from).collect();
    let input = model.direction.input_unit();
    // Writing to a String does not fail.
    let _ = writeln!(
        text,
        "  {:<22} {:>12} {:>11}  {:<10} {}, {input}",
        "parameter",
        "value",
        "std. error",
        "unit",
        model.family.of_an_element()
    );
    for row in written(&amounts) {
        let threshold = play(&row.name).and_then(|i| model.thresholds.get(i)).map_or_else(
            || {
                format!(
                    "  {:<22} {:>12} {:>11}  {}",
                    row.name, row.value, row.standard_error, row.unit
                )
            },
            |threshold| {
                format!(
                    "  {:<22} {:>12} {:>11}  {:<10} {threshold:>8.3}",
                    row.name, row.value, row.standard_error, row.unit
                )
            },
        );
        let _ = writeln!(text, "{threshold}");
    }
    for notice in model
        .notices
        .iter()
        .map(String::as_str)
        .chain(undetermined(model).as_deref())
    {
        let _ = write!(text, "\nnote: {notice}");
    }
    text.push('\n');
    text
}

/// The index of the play that a parameter belongs to: 2 for `weight[3]`.
fn play(name: &str) -> Option<usize> {
    let (_, number) = name.split_once('[')?;
    number.trim_end_matches(']').parse::<usize>().ok()?.checked_sub(1)
}

/// What is said where most weights are lost in their standard errors.
fn undetermined(model: &Model) -> Option<String> {
    let plays = model.thresholds.len();
    let parameters = model.parameters();
    let weights = parameters.iter().filter(|p| p.name.starts_with("weight["));
    let lost = weights.filter(|p| p.standard_error.is_some_and(|error| error > p.value.abs()));
    let lost = lost.count();
    (plays > 1 && 2 * lost > plays).then(|| {
        format!(
            "{lost} of {plays} weights are below their standard error: the records tell their sum, not each; `--plays {}` may say as much",
            plays.div_ceil(2)
        )
    })
}
