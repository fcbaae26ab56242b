//! What a controller will reach and what limits it, before it runs.

use super::{Controller, ReferenceKind};
use crate::error::ControlError;
use hysteron_core::tracking_law::FADING;
use hysteron_identify::control::HeldOut;
use hysteron_identify::control::model::{CREEP_FAST, PLAYS};
use hysteron_identify::covered::Beyond;
use serde::Serialize;

/// The frequencies that errors are predicted at, hertz.
pub const PREDICTED_HZ: [f64; 4] = [10.0, 100.0, 500.0, 1000.0];

/// The error of a sine over the whole range at one frequency, percent of peak to peak.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reckoned {
    /// In open loop.
    pub open_percent: f64,
    /// With feedback; none without.
    pub closed_percent: Option<f64>,
    /// What most of it comes from.
    pub limited_by: &'static str,
}

/// What is expected at one frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Predicted {
    /// Frequency, hertz.
    pub frequency_hz: f64,
    /// The error; none beyond the records.
    #[serde(flatten)]
    pub error: Option<Reckoned>,
    /// How far beyond the records it lies; none within.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond: Option<Beyond>,
}

/// Multiply-adds (or compares, which cost as much) of one block a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// The block.
    pub block: &'static str,
    /// Its operations.
    pub operations: usize,
}

/// Peak to peak of a reference over the whole range of a controller's inverse, micrometres.
pub fn whole_stroke_um(controller: &Controller) -> f64 {
    controller.model.inverse.input_max_um - controller.model.inverse.input_min_um
}

/// Predicts the error of a controller along sines of so many micrometres peak to peak, as far as its records go: above the frequencies at
/// which they show the stage, nothing is known.
///
/// `model_percent` is the error of the model itself on records it was not fitted to, where it is known.
///
/// # Errors
/// Modes that the core refuses.
pub fn predict(
    controller: &Controller,
    stroke_um: f64,
    model_percent: Option<f64>,
) -> Result<Vec<Predicted>, ControlError> {
    let envelope = controller.model.covered.frequency_hz(stroke_um);
    PREDICTED_HZ
        .into_iter()
        .map(|frequency_hz| {
            let beyond = envelope.and_then(|envelope| envelope.left_by(&[frequency_hz]));
            let error = match beyond {
                Some(_) => None,
                None => Some(expect(controller, frequency_hz, stroke_um, model_percent)?),
            };
            Ok(Predicted {
                frequency_hz,
                error,
                beyond,
            })
        })
        .collect()
}

/// What the last pass of a campaign came to at a frequency, where there is one; else what the numbers say.
fn expect(
    controller: &Controller,
    frequency_hz: f64,
    stroke_um: f64,
    model_percent: Option<f64>,
) -> Result<Reckoned, ControlError> {
    let model = &controller.model;
    let shown = |left: &dyn Fn(f64) -> f64| shown_percent(&model.held_out, [frequency_hz, stroke_um], left);
    let Some(open_percent) = shown(&|_| 1.0) else {
        return reckon(controller, frequency_hz, model_percent);
    };
    // Its references were known ahead; one that is not, meets another filter.
    let filter_percent = match controller.reference {
        ReferenceKind::Previewed => 0.0,
        ReferenceKind::Live => filter_percent(controller, frequency_hz)?,
    };
    let closed_percent = controller.feedback.as_ref().and_then(|design| {
        let left = |hz: f64| super::feedback::sensitivity(model, Some(design), std::f64::consts::TAU * hz).norm();
        let shown_percent = shown(&|hz: f64| if hz > 0.0 { left(hz) } else { 0.0 })?;
        Some(shown_percent.hypot(left(frequency_hz) * filter_percent))
    });
    Ok(Reckoned {
        open_percent: open_percent.hypot(filter_percent),
        closed_percent,
        limited_by: if filter_percent > open_percent {
            FILTER
        } else {
            "the last pass, before it was fitted"
        },
    })
}

/// What a pass showed of a sine of a frequency (Hz) and peak to peak (um): between two sines a straight line of logarithms, beyond the first
/// and the last theirs; at least what any other reference showed of what is slower. None where there was no sine.
fn shown_percent(held_out: &[HeldOut], [hz, stroke_um]: [f64; 2], left: &dyn Fn(f64) -> f64) -> Option<f64> {
    let rms_um = |held_out: &HeldOut| held_out.rms_um(hz, stroke_um, left).max(f64::MIN_POSITIVE);
    let mut sines: Vec<(f64, f64)> = held_out
        .iter()
        .filter_map(|held_out| Some((held_out.sine_hz?, rms_um(held_out))))
        .collect();
    sines.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Of sines of one frequency the largest error.
    sines.dedup_by(|next, kept| {
        let same = next.0 <= (1.0 + SAME) * kept.0;
        if same {
            kept.1 = kept.1.max(next.1);
        }
        same
    });
    let above = sines.partition_point(|(sine_hz, _)| *sine_hz < hz);
    let before = above.checked_sub(1).and_then(|before| sines.get(before));
    let along_sines_um = match (before, sines.get(above)) {
        (Some(&(before_hz, before_um)), Some(&(next_hz, next_um))) => {
            let share = (hz / before_hz).ln() / (next_hz / before_hz).ln();
            (before_um.ln() * (1.0 - share) + next_um.ln() * share).exp()
        }
        (Some(&(_, um)), None) | (None, Some(&(_, um))) => um,
        (None, None) => return None,
    };
    let others = held_out.iter().filter(|held_out| held_out.sine_hz.is_none());
    let largest_um = others.map(rms_um).fold(along_sines_um, f64::max);
    Some(100.0 * largest_um / stroke_um)
}

/// Frequencies that differ by this share are the same.
const SAME: f64 = 0.01;

/// Of a peak to peak an error of share s of the amplitude is s / (2 sqrt 2) rms.
fn filter_percent(controller: &Controller, frequency_hz: f64) -> Result<f64, ControlError> {
    Ok(100.0 * controller.preview_error_at(frequency_hz)? / 8_f64.sqrt())
}

const FILTER: &str = "the preview filter";

/// What the numbers of a controller say of a frequency, whether its records go so far or not.
///
/// The three parts (model, table that inverts it, preview filter) are taken as independent; feedback lets through `|S|` of them.
pub(crate) fn reckon(
    controller: &Controller,
    frequency_hz: f64,
    model_percent: Option<f64>,
) -> Result<Reckoned, ControlError> {
    let model = &controller.model;
    let parts = [
        ("the model's own error on records", model_percent.unwrap_or(0.0)),
        ("the table that inverts the model", model.misfit_percent),
        (FILTER, filter_percent(controller, frequency_hz)?),
    ];
    let open_percent = parts.iter().map(|(_, part)| part * part).sum::<f64>().sqrt();
    let omega = std::f64::consts::TAU * frequency_hz;
    let closed_percent = controller
        .feedback
        .as_ref()
        .map(|design| open_percent * super::feedback::sensitivity(model, Some(design), omega).norm());
    let largest = parts.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    Ok(Reckoned {
        open_percent,
        closed_percent,
        limited_by: largest.map_or("", |(name, _)| name),
    })
}

/// Two steps of the elements and two slopes; a division is as long as 14 multiply-adds.
const FADING_COST: usize = 2 * (17 * FADING + 8) + 2 * 7 * FADING + DIVISION * 2 * (FADING + 1);
/// Cycles of a division on a Cortex-M4F, where a multiply-add takes one.
const DIVISION: usize = 14;

/// What each block of a controller costs a tick; see the cost notes of the core's blocks.
pub fn cost(controller: &Controller) -> Vec<Cost> {
    let around = &controller.model.around;
    let mut blocks = vec![
        ("latency and modes (preview filter)", super::preview::TAPS),
        ("creep inverse", 2 * CREEP_FAST + 4),
        if controller.model.fading.is_some() {
            ("hysteresis inverse (fading elements)", FADING_COST)
        } else {
            // Powers of the input, two cubics of a bound, and a look at every play at worst.
            ("hysteresis inverse", 5 + 6 + PLAYS)
        },
        ("amplifier's lead", 2),
    ];
    let mut add = |there: bool, name, operations| {
        if there {
            blocks.push((name, operations));
        }
    };
    add(controller.model.linear.antiresonance().is_some(), "second mode", 5);
    add(around.coupling.is_some(), "decoupling", 5);
    add(around.hum.is_some(), "hum", 6 * hysteron_core::surroundings::HARMONICS);
    add(around.heat.is_some(), "thermal gain", 18);
    add(around.sensor.is_some(), "sensor polynomial", 60);
    add(around.sensor_lag_s > 0.0, "sensor's lag", 4);
    add(controller.feedback.is_some(), "feedback", 22);
    blocks
        .into_iter()
        .map(|(block, operations)| Cost { block, operations })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::tests::controller;
    use hysteron_identify::covered::Field;

    /// Records of 5 Hz tell nothing of 10 Hz; records that swing to 100 Hz tell what they did before, and nothing above.
    #[test]
    fn bva_nothing_is_expected_beyond_the_records() {
        let mut of = controller(None);
        let stroke_um = whole_stroke_um(&of);
        let told = |of: &Controller| -> Vec<bool> {
            let predicted = predict(of, stroke_um, None).unwrap();
            assert!(predicted.iter().all(|at| at.error.is_some() != at.beyond.is_some()));
            predicted.iter().map(|at| at.error.is_some()).collect()
        };
        let swing_hz = of.model.covered.swing_hz.unwrap();
        assert!((swing_hz / 5.0 - 1.0).abs() < 1e-3, "{swing_hz}");
        assert_eq!(told(&of), [false; 4]);
        of.model.covered.swing_hz = Some(100.0);
        assert_eq!(told(&of), [true, true, false, false]);
        let beyond = predict(&of, stroke_um, None).unwrap()[2].beyond.unwrap();
        assert_eq!(
            (beyond.field, beyond.value, beyond.covered),
            (Field::Frequency, 500.0, [0.0, 100.0])
        );
        of.model.covered.swing_hz = None;
        assert_eq!(told(&of), [true; 4]);
        let reckoned = reckon(&of, 100.0, None).unwrap();
        assert_eq!(predict(&of, stroke_um, None).unwrap()[1].error, Some(reckoned));
    }

    /// What a pass showed at 10 and at 1000 Hz is expected there, between them the middle of the logarithms, and above 1000 Hz the same; of
    /// half the stroke it is twice the share, and another reference that left more of what is slower has the last word.
    #[test]
    fn val_what_the_last_pass_showed_is_expected() {
        let mut of = controller(None);
        of.model.covered.swing_hz = None;
        let sine = |sine_hz: f64, stroke_um: f64, um: f64| HeldOut {
            sine_hz: Some(sine_hz),
            stroke_um,
            errors_um: vec![[0.0, 0.6 * um], [3.0 * sine_hz, 0.8 * um]],
        };
        of.model.held_out = vec![
            sine(1000.0, 10.0, 0.02),
            sine(10.0, 10.0, 0.002),
            sine(10.01, 5.0, 0.001),
        ];
        let open =
            |of: &Controller, hz: f64, stroke_um: f64| expect(of, hz, stroke_um, Some(9.0)).unwrap().open_percent;
        for (hz, percent) in [
            (5.0, 0.02),
            (10.0, 0.02),
            (100.0, 0.02 * 10.0_f64.sqrt()),
            (1000.0, 0.2),
            (2000.0, 0.2),
        ] {
            let found = open(&of, hz, 10.0);
            assert!((found / percent - 1.0).abs() < 1e-9, "{hz} Hz: {found}");
            assert!((open(&of, hz, 5.0) / (2.0 * percent) - 1.0).abs() < 1e-9);
        }
        // A loop that lets nothing of the mean through, and all of the rest, leaves the rest.
        let rest = shown_percent(&of.model.held_out, [10.0, 10.0], &|hz: f64| f64::from(hz > 0.0));
        assert!((rest.unwrap() / 0.016 - 1.0).abs() < 1e-9);
        let mut noisy = of.clone();
        noisy.model.held_out.push(HeldOut {
            sine_hz: None,
            stroke_um: 10.0,
            errors_um: vec![[0.0, 3e-3], [40.0, 4e-3], [300.0, 1.0]],
        });
        for (hz, percent) in [(10.0, 0.03), (50.0, 0.05), (200.0, open(&of, 200.0, 10.0))] {
            assert!((open(&noisy, hz, 10.0) / percent - 1.0).abs() < 1e-9, "{hz} Hz");
        }
        // A reference that is not known ahead meets another filter.
        of.reference = ReferenceKind::Live;
        let expected = open(&of, 100.0, 10.0);
        let filter = filter_percent(&of, 100.0).unwrap();
        assert!((expected - filter.hypot(0.02 * 10.0_f64.sqrt())).abs() < 1e-9);
        assert_eq!(shown_percent(&[], [10.0, 10.0], &|_| 1.0), None);
    }
}
