//! The constants of the compiled-in parameter table; made and checked by the build script.
#![expect(
    missing_docs,
    reason = "generated: each constant is the field of its name of hysteron_table::Table"
)]

use crate::monitor::Scales;
use crate::parameters::Parameters;
use hysteron_core::codes::Converter;
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;

include!(concat!(env!("OUT_DIR"), "/table.rs"));

/// The table as the controller takes it.
///
/// # Errors
/// What the core refuses; the build has run the same constructors on the same numbers, so it refuses nothing here.
pub fn parameters() -> Result<Parameters<Law>, ParamError> {
    Ok(Parameters {
        law: law()?,
        ramp: Limiter::new(OUTPUT_MIN_V, OUTPUT_MAX_V, RAMP_V_PER_S, SAMPLE_RATE_HZ)?,
        rise_um: RAMP_V_PER_S / SAMPLE_RATE_HZ / SLOPES_V_PER_UM[1],
        scales: Scales {
            range_um: INPUT_MAX_UM - INPUT_MIN_UM,
            um_per_code: (ADC_TOP_UM - ADC_MIN_UM) / 65_535.0,
            slopes_v_per_um: SLOPES_V_PER_UM,
            span_v: SPAN_V,
            change_v: SLEW_V_PER_S / SAMPLE_RATE_HZ,
        },
        dac: Converter::new(DAC_MIN_V, DAC_TOP_V)?,
        adc: Converter::new(ADC_MIN_UM, ADC_TOP_UM)?,
        range_um: [INPUT_MIN_UM, INPUT_MAX_UM],
        sample_rate_hz: SAMPLE_RATE_HZ,
        feedback_up_to_hz: FEEDBACK_UP_TO_HZ,
        safe_v: SAFE_V,
    })
}
