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
