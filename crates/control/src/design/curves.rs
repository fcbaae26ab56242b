//! The loop over frequency: what a picture of its margins shows.

use super::Controller;
use super::feedback::{GAIN_FACTORS, MODE_FACTORS, around};
use hysteron_identify::control::ControlModel;
use realfft::num_complex::Complex64;
use serde::Serialize;
use std::f64::consts::TAU;

/// Points of a curve.
const POINTS: usize = 400;
/// Its lowest frequency, hertz.
const FROM_HZ: f64 = 1.0;
/// Its highest, as a share of half the rate, where the loop ends.
const TO_SHARE: f64 = 0.98;

/// A loop over frequency.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopCurves {
    /// Frequency, hertz.
    pub frequency_hz: Vec<f64>,
    /// Size of the loop's gain.
    pub gain: Vec<f64>,
    /// Its phase, degrees, without jumps.
    pub phase_deg: Vec<f64>,
    /// What is left of a disturbance.
    pub sensitivity: Vec<f64>,
    /// The most that is left over modes +-10 % and loop gain 0.6 to 1.3.
    pub worst_sensitivity: Vec<f64>,
}

impl LoopCurves {
    /// Of a controller; none without feedback.
    pub fn of(controller: &Controller) -> Option<Self> {
        let (design, model) = (controller.feedback.as_ref()?, &controller.model);
        let to_hz = TO_SHARE * 0.5 / model.sample_period_s;
        let at = |k: usize| FROM_HZ * (to_hz / FROM_HZ).powf(k as f64 / (POINTS - 1) as f64);
        let frequency_hz: Vec<f64> = (0..POINTS).map(at).collect();
        let over = |model: &ControlModel| -> Vec<Complex64> {
            frequency_hz.iter().map(|hz| around(model, design, TAU * hz)).collect()
        };
        let nominal = over(model);
        let mut worst_sensitivity = vec![0.0; POINTS];
        for factor in MODE_FACTORS {
            let mut changed = model.clone();
            for mode in &mut changed.linear.modes {
                mode.frequency_hz *= factor;
            }
            for (worst, once) in worst_sensitivity.iter_mut().zip(over(&changed)) {
                *worst = GAIN_FACTORS.iter().map(|gain| left(gain * once)).fold(*worst, f64::max);
            }
        }
        Some(Self {
            gain: nominal.iter().map(|once| once.norm()).collect(),
            phase_deg: unwrapped(&nominal),
            sensitivity: nominal.iter().map(|once| left(*once)).collect(),
            worst_sensitivity,
            frequency_hz,
        })
    }
}

/// Share of a disturbance that is left.
fn left(around: Complex64) -> f64 {
    1.0 / (1.0 + around).norm()
}

/// Phases, each within half a turn of the one before.
fn unwrapped(responses: &[Complex64]) -> Vec<f64> {
    let mut before = Complex64::new(1.0, 0.0);
    let mut phase = 0.0;
    responses
        .iter()
        .map(|now| {
            phase += (now / before).arg();
            before = *now;
            phase.to_degrees()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::feedback::FeedbackDesign;
    use crate::design::{FORMAT, ReferenceKind};

    /// Off by default; asked for, the law has it, and the file says so.
    #[test]
    fn val_adaptation_is_off_until_it_is_asked_for() {
        let plain = Controller::design(&crate::design::stands::tests::rigid(), ReferenceKind::Previewed).unwrap();
        assert_eq!(plain.adaptation, None);
        assert!(!plain.to_toml().unwrap().contains("adaptation"));
        let adapting = plain.adapting(0.05);
        let part = adapting.adaptation.clone().unwrap().numbers();
        // A twentieth of the stroke of 20 um.
        assert!(
            part.gain_bound == 0.05 && (part.zero_bound_um - 1.0).abs() < 1e-9,
            "{part:?}"
        );
        assert!(adapting.to_toml().unwrap().contains("gain_bound = 0.05"));
        let asked = crate::design::source::Wishes {
            adapt_percent: Some(50.0),
            ..crate::design::source::Wishes::default()
        };
        assert!(
            asked
                .check()
                .unwrap_err()
                .to_string()
                .starts_with("`adapt_percent` 50: 0.01 to 20 percent")
        );
    }

    /// An integral behind a latency: `|L| = K / w`, its phase `-90 degrees - w T`, and `1 / |1 + g L|` is what is left. The sum of samples
    /// leads the integral by half of one.
    #[test]
    fn val_an_integral_behind_a_latency_has_the_curves_of_its_closed_form() {
        let mut model = crate::design::stands::tests::rigid();
        model.latency_s = 500e-6;
        let per_s = 1.0 / model.latency_s;
        let through = [1.0, 0.0, 0.0, 0.0, 0.0];
        let mut controller = Controller {
            format: FORMAT,
            reference: ReferenceKind::Live,
            samples_ahead: 0,
            preview: Vec::new(),
            feedback: None,
            open_loop: None,
            adaptation: None,
            model,
        };
        assert_eq!(LoopCurves::of(&controller), None);
        controller.feedback = Some(FeedbackDesign {
            structure: "integral".to_owned(),
            // A gain of 0.1 um/V.
            integral_v_per_um_s: per_s / 0.1,
            series: [through; 2],
            damping: [0.0; 5],
            peak_sensitivity: 2.0,
            rejection_hz: 100.0,
            helps_to_hz: 150.0,
            told_to_hz: 1000.0,
            noise_nm: 0.1,
        });
        let curves = LoopCurves::of(&controller).unwrap();
        let lag_s = controller.model.latency_s - 0.5 * controller.model.sample_period_s;
        for (k, hz) in curves.frequency_hz.iter().enumerate() {
            let omega = TAU * hz;
            let lag = std::f64::consts::FRAC_PI_2 + omega * lag_s;
            let once = |gain: f64| Complex64::from_polar(gain * per_s / omega, -lag);
            let near = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 1e-9;
            assert!(
                near(curves.gain[k], once(1.0).norm()),
                "{hz} Hz: gain {}",
                curves.gain[k]
            );
            assert!(
                near(curves.phase_deg[k], -lag.to_degrees()),
                "{hz} Hz: phase {}",
                curves.phase_deg[k]
            );
            let worst = GAIN_FACTORS.map(|gain| left(once(gain)));
            let worst = worst.into_iter().fold(0.0, f64::max);
            let found = [curves.sensitivity[k], curves.worst_sensitivity[k]];
            assert!(
                near(found[0], left(once(1.0))) && near(found[1], worst),
                "{hz} Hz: {found:?}"
            );
        }
    }
}
