//! The unit of an identified stage.

use crate::pack::Fmu;
use crate::{FmuError, Variable, model_c};
use hysteron_identify::Model;

impl Fmu {
    /// The stage that a model describes: command in, position out, from rest at 0 V.
    ///
    /// # Errors
    /// An inverse model; an effect that a command does not determine; a rate outside 1 Hz to 10 MHz; a name that is none in C.
    pub fn of_stage(model: &Model, name: &str, rate_hz: f64) -> Result<Self, FmuError> {
        check_name(name)?;
        let code = model_c::code(model, name, rate_hz)?;
        let variables = vec![
            Variable::input("voltage_v", "V", "Command at the actuator, held over the step"),
            Variable::output("position_um", "um", "Position at the end of the step"),
        ];
        let unit = format!(
            "typedef {name}_state unit_state;\n\n\
             static void unit_reset(unit_state *state, double *values) {{ values[2] = {name}_reset(state); }}\n\n\
             static void unit_step(unit_state *state, double *values) {{ values[2] = {name}_step(state, values[1]); }}\n"
        );
        Ok(Self {
            name: name.to_owned(),
            words: format!(
                "Identified piezo stage, {} with {} {}",
                model.family,
                model.thresholds.len(),
                model.family.elements()
            ),
            period_s: 1.0 / rate_hz,
            variables,
            unit,
            code,
        })
    }
}

/// A name that C, files and XML take alike; the table's C asks for the same.
fn check_name(name: &str) -> Result<(), FmuError> {
    let starts = name.starts_with(|c: char| c.is_ascii_alphabetic());
    let word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if starts && word && name.len() <= 18 {
        return Ok(());
    }
    Err(FmuError::Value {
        field: "name",
        value: name.to_owned(),
        allowed: "a letter and up to 17 letters, digits or underscores: names in C begin with it",
    })
}
