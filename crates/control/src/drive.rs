//! The commands of a law along a reference of the user's own, and where a model of the stage goes by them.

use crate::commands::commands;
use crate::design::Controller;
use crate::error::ControlError;
use crate::expected::{Played, SWINGS_PERCENT};
use crate::on_model::{determined, play};
use crate::reference::{RISE_S, Reference};
use hysteron_identify::{EffectName, Model};
use std::f64::consts::PI;

/// Distance from rest, as a share of the inverse's range, from which on a rise leads to the first sample of a reference.
const AT_REST: f64 = 1e-3;

/// A law's commands along a reference, one row a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// Rows before the first sample of the reference is due: the law's preview, and the rise.
    pub before: usize,
    /// Rows of them in which the reference rises from rest to its first sample; 0 where it begins at rest.
    pub rise: usize,
    /// The reference that is due, micrometres.
    pub due_um: Vec<f64>,
    /// Commands, volts at the actuator.
    pub command_v: Vec<f64>,
    /// The model.
    pub modelled: Option<Modelled>,
}

/// Where a model goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Modelled {
    /// Its position in each row, micrometres.
    pub position_um: Vec<f64>,
    /// Rms of reference minus position from the first sample of the reference on, micrometres.
    pub error_um: f64,
    /// Whether the loop swings no further than it is asked to.
    pub stable: bool,
    /// Effects of the model that a command alone does not determine: they are not in the run.
    pub left_out: Vec<EffectName>,
}

/// The feedforward of a controller along a reference, sampled at the controller's rate, from rest at 0 V; with a model the loop on it, closed
/// where the controller has feedback.
///
/// Other axis and temperature stand still.
///
/// # Errors
/// A model that cannot be run, a law that the core refuses.
///
/// # Cost
/// A run of the law; in closed loop a dozen of them, and of the model.
pub fn drive(controller: &Controller, samples_um: &[f64], model: Option<&Model>) -> Result<Driven, ControlError> {
    let rest_um = controller.model.around.rest_um;
    let mut from_rest_um = rise(controller, samples_um.first().copied().unwrap_or(rest_um));
    let rise = from_rest_um.len();
    from_rest_um.extend_from_slice(samples_um);
    let ahead = controller.samples_ahead;
    let mut due_um = vec![rest_um; ahead];
    due_um.extend_from_slice(&from_rest_um);
    let reference = Reference {
        samples_um: from_rest_um,
        ..Reference::default()
    };
    let before = ahead + rise;
    let (command_v, modelled) = match model {
        None => (commands(&controller.without_feedback().law()?, &reference), None),
        Some(model) => {
            let (model, left_out) = determined(model)?;
            let Played {
                command_v, position_um, ..
            } = play(&model, controller, controller.feedback.is_some(), &reference)?;
            let error_um = rms(due_um.iter().zip(&position_um).skip(before));
            let (low, high) = hysteron_identify::family::range(due_um.iter().copied());
            let modelled = Modelled {
                position_um,
                error_um,
                stable: 100.0 * error_um < SWINGS_PERCENT * (high - low).max(f64::MIN_POSITIVE),
                left_out,
            };
            (command_v, Some(modelled))
        }
    };
    Ok(Driven {
        before,
        rise,
        due_um,
        command_v,
        modelled,
    })
}

/// Half a cosine from rest to the first sample; nothing where that is at rest.
fn rise(controller: &Controller, first_um: f64) -> Vec<f64> {
    let model = &controller.model;
    let (rest_um, inverse) = (model.around.rest_um, &model.inverse);
    if (first_um - rest_um).abs() <= AT_REST * (inverse.input_max_um - inverse.input_min_um) {
        return Vec::new();
    }
    let rows = (RISE_S / model.sample_period_s).round() as usize;
    let share = |k: usize| 0.5 * (1.0 - (PI * k as f64 / rows as f64).cos());
    (0..rows).map(|k| rest_um + (first_um - rest_um) * share(k)).collect()
}

fn rms<'a>(pairs: impl Iterator<Item = (&'a f64, &'a f64)>) -> f64 {
    let (sum, count) = pairs.fold((0.0, 0_usize), |(sum, count), (due, found)| {
        (sum + (due - found).powi(2), count + 1)
    });
    (sum / count.max(1) as f64).sqrt()
}
