//! What a law commands along a reference by itself.

use crate::design::CompleteLaw;
use crate::reference::Reference;
use hysteron_core::surroundings::LoopInput;

/// What a law without feedback commands along a reference, with what it commands before the first sample is due.
///
/// Nothing is read: hum, gain and zero are not learned, and heat moves nothing.
pub fn commands(law: &CompleteLaw<f64>, reference: &Reference) -> Vec<f64> {
    let samples_um = &reference.samples_um;
    let mut law = *law;
    law.surroundings.hum = None;
    law.surroundings.adaptation = None;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Controller, ReferenceKind};
    use crate::reference::Shape;

    /// Nothing is read, so nothing is learned: a second at 10 Hz is commanded alike to the last bit.
    #[test]
    fn val_a_law_that_learns_commands_as_one_that_does_not() {
        let plain = Controller::design(&crate::design::stands::tests::rigid(), ReferenceKind::Previewed).unwrap();
        let reference = Shape::Sine { frequency_hz: 10.0 }.reference([3.0, 13.0], 20e-6);
        let of = |controller: &Controller| commands(&controller.law().unwrap(), &reference);
        let expected = of(&plain);
        assert!(expected.iter().any(|v| *v > 100.0));
        assert_eq!(of(&plain.adapting(0.05)), expected);
    }
}
