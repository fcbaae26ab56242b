//! The unit of a controller: the C of its table, in `f32` as on the chip.

use crate::pack::Fmu;
use crate::{FmuError, Variable};
use hysteron_table::Table;
use std::fmt::Write;

impl Fmu {
    /// The law of a table: reference ahead and reading in, command out. `text` is the table's file.
    ///
    /// # Errors
    /// As [`Table::c_code`].
    pub fn of_law(table: &Table, text: &str, name: &str) -> Result<Self, FmuError> {
        let code = table.c_code(text, name)?;
        let part = table.controller.as_ref();
        let ahead = "Reference, as many samples before it is due as the description says";
        let mut variables = vec![
            Variable::input("reference_um", "um", ahead),
            Variable::input("measured_um", "um", "Reading of the sensor"),
        ];
        if part.is_some_and(|part| part.coupling.is_some()) {
            variables.push(Variable::input(
                "voltage2_v",
                "V",
                "Command of the other axis, as many samples ahead",
            ));
        }
        if part.is_some_and(|part| part.cross_um_per_um.is_some()) {
            let words = "Reference of the other axis less its rest, as many samples ahead";
            variables.push(Variable::input("motion2_um", "um", words));
        }
        if part.is_some_and(|part| part.heat.is_some()) {
            variables.push(Variable::input("temperature_c", "degC", "Temperature of the stage"));
        }
        let mut unit = format!(
            "typedef {name}_state unit_state;\n\n\
             static {name}_input taken_in(const double *values) {{\n    {name}_input now;\n"
        );
        for (place, variable) in (1..).zip(&variables) {
            // Writing to a String does not fail.
            let _ = writeln!(unit, "    now.{} = (float)values[{place}];", variable.name);
        }
        let command = variables.len() + 1;
        let due = command + 1;
        let _ = write!(
            unit,
            "    return now;\n}}\n\n\
             static void unit_reset(unit_state *state, double *values) {{\n    {name}_input now = taken_in(values);\n    \
             {name}_reset(state, &now);\n    values[{command}] = (double){}_SAFE_V;\n    \
             values[{due}] = (double){name}_due_um(state);\n}}\n\n\
             static void unit_step(unit_state *state, double *values) {{\n    {name}_input now = taken_in(values);\n    \
             values[{command}] = (double){name}_step(state, &now);\n    values[{due}] = (double){name}_due_um(state);\n}}\n",
            name.to_ascii_uppercase()
        );
        variables.push(Variable::output("voltage_v", "V", "Command at the actuator"));
        variables.push(Variable::output(
            "due_um",
            "um",
            "Reference that is due, which the reading was compared with",
        ));
        let samples_ahead = part.map_or(0, |part| part.samples_ahead);
        Ok(Self {
            name: name.to_owned(),
            words: format!(
                "Control law of a piezo stage in 32-bit numbers; the reference comes {samples_ahead} samples ahead"
            ),
            period_s: 1.0 / table.sample_rate_hz,
            variables,
            unit,
            code,
        })
    }
}
