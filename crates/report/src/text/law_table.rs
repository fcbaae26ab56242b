//! The firmware's table of a controller, in words.

use crate::options::option;
use hysteron_control::design::Controller;
use hysteron_control::export::Exported;
use hysteron_table::Table;
use std::fmt::Write;

/// How far the feedback may go, in words.
fn bound_said(table: &Table) -> String {
    let trust = table
        .controller
        .as_ref()
        .and_then(|part| part.feedback.as_ref()?.trust.as_ref());
    trust.map_or_else(String::new, |trust| {
        format!(
            ";\nit moves the command by {:.2} V at once and {:.2} V in all, whatever the sensor says; --feedback-bound-um changes that",
            2.0 * trust.quick_v,
            trust.quick_v + trust.slow_v
        )
    })
}

/// How far an open loop may be off, in words.
fn departure_said(table: &Table) -> String {
    let Some(departure_um) = table.open_loop_departure_um() else {
        return String::new();
    };
    let missed_um = table.controller.as_ref().and_then(|part| part.model_error_um);
    let known = missed_um.map_or_else(
        || "the model does not say what it misses on its records".to_owned(),
        |rms_um| format!("the model misses its records by up to {rms_um:.4} um rms"),
    );
    format!(";\n{known}: {departure_um:.4} um off are another stage or sensor, and the board stops")
}

/// A controller's table: its law, its feedback, and where its ends come from.
pub fn law_table_text(controller: &Controller, exported: &Exported) -> String {
    let table = &exported.table;
    let mut text = format!(
        "complete law: {} plays, {} preview coefficients, reference {} samples ahead, {:.4} to {:.4} um\n",
        table.thresholds_um.len(),
        controller.preview.len(),
        controller.samples_ahead,
        table.input_min_um,
        table.input_max_um
    );
    // Writing to a String does not fail.
    let _ = match &controller.feedback {
        Some(feedback) => writeln!(
            text,
            "feedback {}: integral gain {:.0} V/(um s), on for references up to {:.0} Hz{}",
            feedback.structure,
            feedback.integral_v_per_um_s,
            table.feedback_up_to_hz,
            bound_said(table)
        ),
        None => writeln!(
            text,
            "open loop: the controller has no feedback{}",
            departure_said(table)
        ),
    };
    let taken = table.controller.as_ref().is_some_and(|part| part.heat.is_some());
    if controller.model.around.heat.is_some() && !taken {
        text.push_str("heat is left out: boards have no thermometer; the feedback takes what it can of it\n");
    }
    for line in &exported.told {
        let _ = writeln!(text, "{}", line.worded(option));
    }
    text
}
