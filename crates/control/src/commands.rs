//! What a law commands along a reference by itself.

use crate::design::DesignedLaw;
use crate::reference::Reference;
use hysteron_core::surroundings::LoopInput;

/// What a law without feedback commands along a reference, with what it commands before the first sample is due.
///
/// Nothing is read: hum, gain and zero are not learned, and heat moves nothing.
pub fn commands(law: &DesignedLaw<f64>, reference: &Reference) -> Vec<f64> {
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
pub(crate) fn usual_temperature_c(law: &DesignedLaw<f64>) -> f64 {
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
    use crate::export::{Bench, export};
    use crate::reference::Shape;
    use hysteron_data::{Dataset, Record, Role};
    use hysteron_identify::control::FadingPart;
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

    /// 0.1 um a volt and one memory of 30 V, which a slow sine between 1 and 4 um is commanded by; the file keeps them, and no table does.
    #[test]
    fn val_fading_elements_stand_in_the_place_of_plays() {
        let mut designed = controller(None);
        designed.model.around.rest_um = 0.0;
        let plays = designed.clone();
        designed.model.fading = Some(FadingPart {
            min_v: 0.0,
            max_v: 100.0,
            offset_um: 5.0,
            input_function_um: [4.0, 0.0, 0.0],
            lengths_v: [10.0, 20.0, 30.0, 80.0],
            curves_um: [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [0.0; 3]],
            rest_um: [0.0, 0.0, -1.0, 0.0],
        });
        let read: Controller = toml::from_str(&designed.to_toml().unwrap()).unwrap();
        assert_eq!(read, designed);
        let reference = Shape::Sine { frequency_hz: 2.0 }.reference([1.0, 4.0], 5e-4);
        let law = read.law().unwrap();
        let commanded = commands(&law, &reference);
        // dz = |dv| ((v - 50) / 50 - z) / 30, and x = 5 + 4 (v - 50) / 50 + z.
        let (mut v, mut z) = (0.0_f64, -1.0_f64);
        let positions_um = commanded.iter().map(|to| {
            let step = (to - v) / 10.0;
            for _ in 0..10 {
                z += step.abs() * ((v + 0.5 * step - 50.0) / 50.0 - z) / 30.0;
                v += step;
            }
            5.0 + 4.0 * (v - 50.0) / 50.0 + z
        });
        let off_um = positions_um
            .skip(law.ahead())
            .zip(&reference.samples_um)
            .skip(reference.judged_from)
            .map(|(x, wanted)| (x - wanted).abs())
            .fold(0.0, f64::max);
        // The sample that a command is held for is 0.01 um at the fastest.
        assert!(off_um < 0.02, "{off_um}");
        let by_plays = commands(&plays.law().unwrap(), &reference);
        assert!(commanded.iter().zip(&by_plays).any(|(a, b)| (a - b).abs() > 2.0));
        let refused = export(&read, &Bench::default()).unwrap_err().to_string();
        assert!(
            refused
                .starts_with("this controller undoes its hysteresis by fading elements, and a table holds plays only"),
            "{refused}"
        );
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
