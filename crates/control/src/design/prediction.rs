//! What a controller will reach and what limits it, before it runs.

use super::Controller;
use crate::error::ControlError;
use hysteron_identify::control::model::{CREEP_FAST, PLAYS};
use serde::Serialize;

/// The frequencies that errors are predicted at, hertz.
pub const PREDICTED_HZ: [f64; 4] = [10.0, 100.0, 500.0, 1000.0];

/// The error expected at one frequency, sine of full range, percent of peak to peak.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Predicted {
    /// Frequency, hertz.
    pub frequency_hz: f64,
    /// In open loop.
    pub open_percent: f64,
    /// With feedback; none without.
    pub closed_percent: Option<f64>,
    /// What most of it comes from.
    pub limited_by: &'static str,
}

/// Multiply-adds (or compares, which cost as much) of one block a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// The block.
    pub block: &'static str,
    /// Its operations.
    pub operations: usize,
}

/// Predicts the error of a controller.
///
/// `model_percent` is the error of the model itself on records it was not fitted to, where it is known. The three parts (model,
/// table that inverts it, preview filter) are taken as independent; feedback lets through `|S|` of them.
///
/// # Errors
/// Modes that the core refuses.
pub fn predict(controller: &Controller, model_percent: Option<f64>) -> Result<Vec<Predicted>, ControlError> {
    let model = &controller.model;
    PREDICTED_HZ
        .into_iter()
        .map(|frequency_hz| {
            // Of a peak to peak an error of share s of the amplitude is s / (2 sqrt 2) rms.
            let filter = 100.0 * controller.preview_error_at(frequency_hz)? / 8_f64.sqrt();
            let parts = [
                ("the model's own error on records", model_percent.unwrap_or(0.0)),
                ("the table that inverts the model", model.misfit_percent),
                ("the preview filter", filter),
            ];
            let open_percent = parts.iter().map(|(_, part)| part * part).sum::<f64>().sqrt();
            let omega = std::f64::consts::TAU * frequency_hz;
            let closed_percent = controller
                .feedback
                .as_ref()
                .map(|design| open_percent * super::feedback::sensitivity(model, Some(design), omega).norm());
            let largest = parts.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            Ok(Predicted {
                frequency_hz,
                open_percent,
                closed_percent,
                limited_by: largest.map_or("", |(name, _)| name),
            })
        })
        .collect()
}

/// What each block of a controller costs a tick; see the cost notes of the core's blocks.
pub fn cost(controller: &Controller) -> Vec<Cost> {
    let around = &controller.model.around;
    let mut blocks = vec![
        ("latency and modes (preview filter)", super::preview::TAPS),
        ("creep inverse", 2 * CREEP_FAST + 4),
        // Powers of the input, two cubics of a bound, and a look at every play at worst.
        ("hysteresis inverse", 5 + 6 + PLAYS),
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
