//! A controller on the user's own identified model: what its design expects, beside what comes out.

use crate::adapted::Adapted;
use crate::commands::{commands, usual_temperature_c};
use crate::design::linear_stage::LinearStage;
use crate::design::{Controller, DesignedLaw};
use crate::error::ControlError;
use crate::expected::{Plan, Played, Report, Row};
use crate::reference::{Reference, SHAPES};
use hysteron_core::surroundings::LoopInput;
use hysteron_identify::{EffectId, EffectName, IdentifyError, InitialState, Model};
use rayon::prelude::*;

/// Times that a closed loop's run is repeated with the model's answer to its own commands.
const REPEATS: usize = 12;
/// Change of the position from one repeat to the next at which a run stands, as a share of the range: a tenth of what errors are printed to.
const STANDS: f64 = 1e-5;
/// Gain of the linear stage between repeats, as a share of the mean one: the middle of the slopes after a turn and in mid-branch.
const GAIN: f64 = 0.8;
/// Runs a controller, open and closed, on a model along the references that repeat.
///
/// # Errors
/// A model that cannot be run, a law that the core refuses.
///
/// # Cost
/// A second or so of samples for each reference, times a dozen in closed loop.
pub fn on_model(model: &Model, controller: &Controller, range_um: [f64; 2]) -> Result<Report, ControlError> {
    let (model, left_out) = determined(model)?;
    let plan = Plan::new(controller, range_um)?;
    let rows: Result<Vec<Row>, ControlError> = plan
        .runs(&SHAPES)
        .into_par_iter()
        .map(|run| {
            plan.row(run, &mut |closed, reference| {
                play(&model, controller, closed, reference)
            })
        })
        .collect();
    Ok(Report {
        range_um,
        left_out,
        adaptation: controller.adaptation.clone(),
        rows: rows?,
        not_played: Vec::new(),
    })
}

/// The model without the effects that a command alone does not determine, and their names.
pub(crate) fn determined(model: &Model) -> Result<(Model, Vec<EffectName>), ControlError> {
    let mut left = model.clone();
    let mut names = Vec::new();
    loop {
        match left.simulate_input(&[0.0; 2], 1e-3, InitialState::REST) {
            Ok(_) => return Ok((left, names)),
            Err(IdentifyError::EffectNeedsRecord { effect }) => {
                left.effects.retain(|fitted| fitted.name != effect);
                names.push(effect);
            }
            Err(error) => return Err(error.into()),
        }
    }
}

/// When a command arrives that is held for a sample, where the model has no delay that says so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Held {
    /// A delay was learned, and the hold with it.
    InTheModel,
    /// A lag or a mode averages over the sample: half of it.
    Half,
    /// Nothing averages, and the position at a sample is that of the command before.
    Whole,
}

impl Held {
    fn of(model: &Model, controller: &Controller) -> Self {
        let linear = &controller.model.linear;
        if model
            .effects
            .iter()
            .any(|fitted| fitted.name.id() == Some(EffectId::Delay))
        {
            Self::InTheModel
        } else if linear.modes.is_empty() && linear.lag_s == 0.0 {
            Self::Whole
        } else {
            Self::Half
        }
    }

    fn arrived(self, command_v: &[f64]) -> Vec<f64> {
        let before = std::iter::once(0.0).chain(command_v.iter().copied());
        let share = match self {
            Self::InTheModel => 0.0,
            Self::Half => 0.5,
            Self::Whole => 1.0,
        };
        command_v
            .iter()
            .zip(before)
            .map(|(now, before)| now + share * (before - now))
            .collect()
    }
}

/// One run from rest at 0 V, from the first sample that is known on.
///
/// A model answers whole commands. A law that reads the position, since it has feedback or learns, is run on the answer to its last
/// commands, with a linear stage for what it commands otherwise this time; where nothing changes any more that has no part in it.
pub(crate) fn play(
    model: &Model,
    controller: &Controller,
    closed: bool,
    reference: &Reference,
) -> Result<Played, ControlError> {
    let period_s = controller.model.sample_period_s;
    let held = Held::of(model, controller);
    let answer = |command_v: &[f64]| model.simulate_input(&held.arrived(command_v), period_s, InitialState::REST);
    let open = controller.without_feedback().law::<f64>()?;
    let mut played = Played {
        command_v: commands(&open, reference),
        position_um: Vec::new(),
        adapted: None,
    };
    played.position_um = answer(&played.command_v)?;
    if !closed && controller.adaptation.is_none() {
        return Ok(played);
    }
    let law = if closed { controller.law::<f64>()? } else { open };
    let (low_um, high_um) = hysteron_identify::family::range(reference.samples_um.iter().copied());
    for _ in 0..REPEATS {
        let (seen_um, again) = repeated(&law, controller, reference, &played);
        played = again;
        played.position_um = answer(&played.command_v)?;
        let changes = played
            .position_um
            .iter()
            .zip(&seen_um)
            .map(|(now, seen)| (now - seen).abs());
        if changes.fold(0.0, f64::max) < STANDS * (high_um - low_um) {
            break;
        }
    }
    Ok(played)
}

/// The law on the answer to its last commands: what it has read, and what it commands and has learned; the answer to that is still to come.
fn repeated(
    law: &DesignedLaw<f64>,
    controller: &Controller,
    reference: &Reference,
    before: &Played,
) -> (Vec<f64>, Played) {
    let temperature_c = usual_temperature_c(law);
    let mut state = law.rest(temperature_c);
    let mut linear = LinearStage::of(&controller.model, &controller.model.linear, GAIN);
    let mut beside_um = 0.0;
    let mut seen_um = Vec::with_capacity(before.command_v.len());
    let mut command_v = Vec::with_capacity(before.command_v.len());
    for (k, (&before_v, &answered_um)) in before.command_v.iter().zip(&before.position_um).enumerate() {
        let measured = answered_um + beside_um;
        let now_v = law.step(
            &mut state,
            LoopInput {
                reference_ahead: reference.at(k),
                measured,
                temperature_c,
                ..LoopInput::default()
            },
        );
        beside_um = linear.step(now_v - before_v);
        seen_um.push(measured);
        command_v.push(now_v);
    }
    let again = Played {
        command_v,
        position_um: Vec::new(),
        adapted: Adapted::of(law, &state, controller.model.sample_period_s),
    };
    (seen_um, again)
}
