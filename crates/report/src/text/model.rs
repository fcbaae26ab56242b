//! A fitted model as a table.

use hysteron_identify::Model;
use std::fmt::Write;

/// The parameters of the hysteresis with their standard errors, and what the user should know of the fit.
pub fn model_text(model: &Model) -> String {
    let records = model.fitted_on.records.len();
    let samples: usize = model.fitted_on.records.iter().map(|record| record.samples).sum();
    let mut text = format!(
        "{} with {} plays, {}, fitted to {records} record{} ({samples} samples)\n\n",
        model.family,
        model.thresholds.len(),
        model.direction.name(),
        if records == 1 { "" } else { "s" }
    );
    // Writing to a String does not fail.
    let _ = writeln!(
        text,
        "  {:<22} {:>13}  {:>11}  unit",
        "parameter", "value", "std. error"
    );
    for parameter in model.parameters() {
        let error = parameter
            .standard_error
            .map_or_else(|| "undetermined".to_owned(), |e| format!("{e:.2e}"));
        let _ = writeln!(
            text,
            "  {:<22} {:>13.5e}  {error:>11}  {}",
            parameter.name, parameter.value, parameter.unit
        );
    }
    for notice in &model.notices {
        let _ = write!(text, "\nnote: {notice}");
    }
    text.push('\n');
    text
}
