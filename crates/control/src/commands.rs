//! What a law commands along a reference by itself.

use crate::design::CompleteLaw;
use crate::reference::Reference;
use hysteron_core::surroundings::LoopInput;

/// What a law without feedback commands along a reference, with what it commands before the first sample is due.
///
/// Nothing is read: hum is not learned, and heat moves nothing.
pub fn commands(law: &CompleteLaw<f64>, reference: &Reference) -> Vec<f64> {
    let samples_um = &reference.samples_um;
    let mut law = *law;
    law.surroundings.hum = None;
    let temperature_c = usual_temperature_c(&law);
    let mut state = law.rest(temperature_c);
    (0..samples_um.len() + law.ahead())
        .map(|k| {
            let input = LoopInput {
                reference_ahead: reference.at(k),
                temperature_c,
                ..LoopInput::default()
            };
            law.step(&mut state, input)
        })
        .collect()
}

/// The temperature at which heat moves nothing, degrees Celsius.
pub(crate) fn usual_temperature_c(law: &CompleteLaw<f64>) -> f64 {
    let heat = law.surroundings.heat.as_ref();
    heat.map_or(0.0, |heat| {
        let [_, _, reference_c, ..] = heat.coefficients();
        reference_c
    })
}
