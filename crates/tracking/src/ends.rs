//! What a table for a simulated stage runs on.

use hysteron_control::export::StageEnds;
use hysteron_plant::{Converter, StageConfig};

/// Converters and amplifier of a simulated stage, in volts at the stack and micrometres.
pub fn ends_of(stage: &StageConfig) -> StageEnds {
    let scaled = |converter: Option<Converter>, factor: f64| {
        let converter = converter.unwrap_or(Converter::BIPOLAR_16_BIT);
        [converter.min_v * factor, converter.max_v * factor]
    };
    let amplifier = &stage.amplifier;
    StageEnds {
        amplifier_v: [amplifier.min_v, amplifier.max_v],
        dac_v: scaled(stage.dac, amplifier.gain),
        adc_um: scaled(stage.sensor.adc, stage.sensor.um_per_v),
    }
}
