//! A table as the application takes it, in this process: what the image of that table does, without the image.

use hysteron_core::codes::Converter;
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;
use hysteron_core::pi_controller::PiController;
use hysteron_firmware::law::{Complete, Paper};
use hysteron_firmware::monitor::Scales;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::wire::Hello;
use hysteron_table::{Inverse, Table, TableError, hash};

/// Plays that there is room for; a table may have fewer.
pub const PLAYS: usize = 10;

/// What `firmware/app` makes of the constants of a table with a complete law.
///
/// # Errors
/// As [`Table::check`]; a table without one.
pub fn complete(table: &Table) -> Result<Parameters<Complete>, TableError> {
    match table.law_numbers()? {
        Some(numbers) => {
            let v_per_um = table.sweep()?.slopes_v_per_um[0] as f32;
            with_law(table, Complete::new(numbers.law()?, v_per_um))
        }
        None => Err(TableError::Field {
            field: "controller".to_owned(),
            value: "none".to_owned(),
            reason: "the table has the paper's law".to_owned(),
        }),
    }
}

/// What `firmware/app` makes of the constants of a table with the paper's law.
///
/// # Errors
/// As [`Table::check`]; a table of more than [`PLAYS`] plays.
pub fn parameters(table: &Table) -> Result<Parameters<Paper<Inverse<PLAYS>>>, TableError> {
    if table.thresholds_um.len() > PLAYS {
        return Err(TableError::Field {
            field: "thresholds_um".to_owned(),
            value: format!("{} values", table.thresholds_um.len()),
            reason: format!("runs here with at most {PLAYS}"),
        });
    }
    let rate_hz = table.sample_rate_hz as f32;
    let feedback = PiController::new(
        table.proportional_v_per_um as f32,
        table.integral_v_per_um_s as f32,
        rate_hz,
    )?;
    let law = Paper::new(table.inverse(false)?.1, feedback, limiter(table, table.slew_v_per_s)?);
    with_law(table, law)
}

fn limiter(table: &Table, slew_v_per_s: f64) -> Result<Limiter<f32>, ParamError> {
    let (output_min_v, output_max_v) = (table.output_min_v as f32, table.output_max_v as f32);
    Limiter::new(
        output_min_v,
        output_max_v,
        slew_v_per_s as f32,
        table.sample_rate_hz as f32,
    )
}

fn with_law<L>(table: &Table, law: L) -> Result<Parameters<L>, TableError> {
    let sweep = table.sweep()?;
    let rate_hz = table.sample_rate_hz as f32;
    let (adc_min_um, adc_top_um) = (table.adc_min_um as f32, table.adc_top_um as f32);
    Ok(Parameters {
        law,
        ramp: limiter(table, table.ramp_v_per_s)?,
        rise_um: table.ramp_v_per_s as f32 / rate_hz / sweep.slopes_v_per_um[1] as f32,
        scales: Scales {
            range_um: table.input_max_um as f32 - table.input_min_um as f32,
            um_per_code: (adc_top_um - adc_min_um) / 65_535.0,
            slopes_v_per_um: sweep.slopes_v_per_um.map(|slope| slope as f32),
            span_v: sweep.span_v as f32,
            departure_v: table.departure_v(&sweep) as f32,
            overshoot: table.overshoot() as f32,
        },
        dac: Converter::new(table.dac_min_v as f32, table.dac_top_v as f32)?,
        adc: Converter::new(adc_min_um, adc_top_um)?,
        range_um: [table.input_min_um as f32, table.input_max_um as f32],
        sample_rate_hz: rate_hz,
        feedback_up_to_hz: table.feedback_up_to_hz as f32,
        safe_v: table.safe_v as f32,
    })
}

/// What an image of one axis with no other table says of the table of a file.
pub fn hello(table: &Table, text: &str) -> Hello {
    Hello {
        hash: hash(text),
        sample_rate_hz: table.sample_rate_hz as f32,
        input_min_um: table.input_min_um as f32,
        input_max_um: table.input_max_um as f32,
        bank: 0,
        banks: 1,
        axes: 1,
        complete: table.controller.is_some(),
    }
}
