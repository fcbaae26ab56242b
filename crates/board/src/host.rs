//! A table as the application takes it, in this process: what the image of that table does, without the image.

use hysteron_core::codes::Converter;
use hysteron_core::limiter::Limiter;
use hysteron_core::pi_controller::PiController;
use hysteron_firmware::monitor::Scales;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::wire::Hello;
use hysteron_table::{Inverse, Table, TableError, hash};

/// Plays that there is room for; a table may have fewer.
pub const PLAYS: usize = 10;

/// What `firmware/app` makes of the constants of a table.
///
/// # Errors
/// As [`Table::check`]; a table of more than [`PLAYS`] plays.
pub fn parameters(table: &Table) -> Result<Parameters<Inverse<PLAYS>>, TableError> {
    let sweep = table.sweep()?;
    if table.thresholds_um.len() > PLAYS {
        return Err(TableError::Field {
            field: "thresholds_um".to_owned(),
            value: format!("{} values", table.thresholds_um.len()),
            reason: format!("runs here with at most {PLAYS}"),
        });
    }
    let rate_hz = table.sample_rate_hz as f32;
    let (output_min_v, output_max_v) = (table.output_min_v as f32, table.output_max_v as f32);
    let limiter = |slew_v_per_s: f64| Limiter::new(output_min_v, output_max_v, slew_v_per_s as f32, rate_hz);
    let (adc_min_um, adc_top_um) = (table.adc_min_um as f32, table.adc_top_um as f32);
    Ok(Parameters {
        inverse: table.inverse(false)?.1,
        feedback: PiController::new(
            table.proportional_v_per_um as f32,
            table.integral_v_per_um_s as f32,
            rate_hz,
        )?,
        limiter: limiter(table.slew_v_per_s)?,
        ramp: limiter(table.ramp_v_per_s)?,
        scales: Scales {
            range_um: table.input_max_um as f32 - table.input_min_um as f32,
            um_per_code: (adc_top_um - adc_min_um) / 65_535.0,
            slopes_v_per_um: sweep.slopes_v_per_um.map(|slope| slope as f32),
            span_v: sweep.span_v as f32,
            change_v: table.slew_v_per_s as f32 / rate_hz,
        },
        dac: Converter::new(table.dac_min_v as f32, table.dac_top_v as f32)?,
        adc: Converter::new(adc_min_um, adc_top_um)?,
        range_um: [table.input_min_um as f32, table.input_max_um as f32],
        sample_rate_hz: rate_hz,
        feedback_up_to_hz: table.feedback_up_to_hz as f32,
        safe_v: table.safe_v as f32,
    })
}

/// What an image says of the table of a file.
pub fn hello(table: &Table, text: &str) -> Hello {
    Hello {
        hash: hash(text),
        sample_rate_hz: table.sample_rate_hz as f32,
        input_min_um: table.input_min_um as f32,
        input_max_um: table.input_max_um as f32,
    }
}
