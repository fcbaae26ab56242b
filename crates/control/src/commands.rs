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
pub(crate) mod tests {
    use super::*;
    use crate::design::Controller;
    use crate::design::source::{Source, Wishes, design};
    use crate::reference::Shape;
    use hysteron_data::{Dataset, Record, Role};
    use hysteron_identify::{Family, FitOptions, fit};
    use std::f64::consts::TAU;

    /// Of a stage of one play, 5 V wide, and its answer to 60 V at 5 Hz.
    pub(crate) fn controller(adapt_percent: Option<f64>) -> Controller {
        let voltage_v: Vec<f64> = (0..2000)
            .map(|k| 30.0 - 30.0 * (TAU * f64::from(k) / 400.0).cos())
            .collect();
        let mut play = 0.0_f64;
        let mut position = |v: f64| {
            play = play.clamp(v - 5.0, v + 5.0);
            0.08 * v + 0.02 * play
        };
        let position_um = voltage_v.iter().map(|v| position(*v)).collect();
        let dataset = Dataset {
            records: vec![Record::new("sine.csv", Role::Identify, 5e-4, voltage_v, position_um)],
            ..Dataset::default()
        };
        let model = fit(&dataset, &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
        let source = Source::Model {
            model: &model,
            along: &[],
        };
        let wishes = Wishes {
            open: true,
            adapt_percent,
            ..Wishes::default()
        };
        design(&source, &wishes).unwrap().controller
    }

    /// Nothing is read, so nothing is learned: half a second at 10 Hz is commanded alike to the last bit.
    #[test]
    fn val_a_law_that_learns_commands_as_one_that_does_not() {
        let reference = Shape::Sine { frequency_hz: 10.0 }.reference([1.0, 4.0], 5e-4);
        let of = |adapt_percent: Option<f64>| commands(&controller(adapt_percent).law().unwrap(), &reference);
        let plain = of(None);
        assert!(plain.iter().any(|v| *v > 35.0), "{plain:?}");
        assert_eq!(of(Some(5.0)), plain);
    }
}
