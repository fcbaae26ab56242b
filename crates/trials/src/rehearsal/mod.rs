//! The whole way on a stage with something hidden in it: recorded, learned, tracked before and after, on the host or by the firmware.

mod chip;
mod rows;

use crate::chip::{Chip, Reached};
use crate::error::TrialError;
use hysteron_control::design::beyond::frequencies;
use hysteron_control::design::{Controller, ReferenceKind};
use hysteron_data::{Dataset, Record};
use hysteron_diagnose::{Learned, learn_with};
use hysteron_identify::control::{ControlModel, RecordedHold, chain_of, refine};
use hysteron_identify::covered::Beyond;
use hysteron_identify::{EffectName, FitOptions, Model, fit, present_step};
use hysteron_plant::StageConfig;
use hysteron_tracking::rehearsal::Rehearsal;
use serde::Serialize;
use std::collections::BTreeMap;

/// A step of the ladder from both sides.
#[derive(Debug, Clone, Serialize)]
pub struct Rung {
    /// Effects of the model.
    pub effects: Vec<EffectName>,
    /// Whether the inverse was fitted to records along references as well.
    pub trained: bool,
    /// Error of the model on records it was not fitted to, percent of peak to peak.
    pub model_percent: Option<f64>,
    /// `open` or `closed`.
    #[serde(rename = "loop")]
    pub loop_kind: &'static str,
    /// Error of the true position, percent of the references' range; none where the model has no inverse.
    pub tracking_percent: Option<BTreeMap<String, f64>>,
    /// Why it has none.
    pub refused: Option<String>,
}

/// What a rehearsal comes to.
#[derive(Debug, Clone, Serialize)]
pub struct Rehearsed {
    /// What was hidden.
    pub effect: &'static str,
    /// Seed of stage, effect and noise.
    pub seed: u64,
    /// The machine that recorded and tracked; none on the host.
    pub emulator: Option<&'static str>,
    /// Whether the model has what was hidden.
    pub named: bool,
    /// A controller from the model of each step, then the trained one.
    pub rungs: Vec<Rung>,
    /// The last controller with the compensator of the hidden effect left out, open loop.
    pub without_compensator_percent: Option<BTreeMap<String, f64>>,
    /// The same with the feedback that is designed without it, on the host; more than 100 % is a loop that swings.
    pub without_compensator_closed_percent: Option<BTreeMap<String, f64>>,
    /// The first model's kind of controller, trained, on the same stage with nothing hidden in it.
    pub without_effect_percent: Option<BTreeMap<String, f64>>,
    /// Beside an emulator: the last controller, open loop, by the host's law in `f64`.
    pub host_percent: Option<BTreeMap<String, f64>>,
    /// Ticks of an emulator at the sample clock; the others were worked out ahead and compared bit by bit.
    pub clocked_ticks: u32,
    /// Of these the late and lost ones.
    pub late_ticks: u32,
    /// What of the references leaves the records of the last model: nothing is known there.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beyond: Vec<Beyond>,
    /// What was hidden, in numbers.
    pub truth: String,
}

/// Where records and runs are made.
pub enum Ground {
    /// The law in `f64` at the simulated stage.
    Host,
    /// The firmware in QEMU at the simulated stage.
    Board(Box<Chip>),
}

impl Ground {
    fn records(&self, rehearsal: &Rehearsal, progress: &dyn Fn(&str, f64)) -> Result<Dataset, TrialError> {
        match self {
            Self::Host => Ok(rehearsal.records(&rehearsal.stage)?),
            Self::Board(chip) => chip::records(chip, rehearsal, progress),
        }
    }

    fn training(&self, rehearsal: &Rehearsal, controller: &Controller) -> Result<Vec<Record>, TrialError> {
        match self {
            Self::Host => Ok(rehearsal.training(&rehearsal.stage, controller)?),
            Self::Board(chip) => chip::training(chip, rehearsal, controller),
        }
    }

    fn errors(&self, rehearsal: &Rehearsal, controller: &Controller, name: &str) -> Result<Reached, TrialError> {
        match self {
            Self::Host => Ok(Reached {
                percent: rehearsal.errors(&rehearsal.stage, controller)?,
                ..Reached::default()
            }),
            Self::Board(chip) => chip::errors(chip, rehearsal, controller, name),
        }
    }
}

/// What a rehearsal does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Records are taken.
    Recording,
    /// A model is learned from them.
    Learning,
    /// Controllers track.
    Tracking,
}

/// Everything that a rehearsal leaves.
pub struct Rehearsing {
    /// What it comes to.
    pub rehearsed: Rehearsed,
    /// The records.
    pub records: Dataset,
    /// What was learned from them.
    pub model: Model,
    /// Of the last step; none where its model has no inverse.
    pub trained: Option<Trained>,
}

/// Records the drawn stage, learns from the records, and tracks with a controller of each step. Progress gets the phase, what runs, and
/// the phase's share done, 0 to 1.
///
/// # Errors
/// A stage, model or controller that cannot be run, an image that cannot be built.
pub fn rehearse(
    ground: &Ground,
    rehearsal: &Rehearsal,
    options: &FitOptions,
    progress: &(dyn Fn(Phase, &str, f64) + Sync),
) -> Result<Rehearsing, TrialError> {
    let records = ground.records(rehearsal, &|what, share| progress(Phase::Recording, what, share))?;
    let learned = learn_with(&records, options, &[], &|what, share| {
        progress(Phase::Learning, what, share);
    })?;
    let tracking = |share| progress(Phase::Tracking, "tracking", share);
    let (rehearsed, trained) = rehearsed(ground, rehearsal, (&records, &learned), &tracking)?;
    Ok(Rehearsing {
        rehearsed,
        records,
        model: learned.model,
        trained,
    })
}

fn chain(stage: &StageConfig, model: &Model) -> Result<ControlModel, TrialError> {
    let limits = [stage.amplifier.min_v, stage.amplifier.max_v];
    let (chain, _) = chain_of(model, stage.sample_period_s, limits, RecordedHold::AccountedFor)?;
    Ok(chain)
}

/// The model with a history: one that nothing was added to has none yet, and is measured on the records.
fn told(records: &Dataset, model: &Model) -> Model {
    let mut told = model.clone();
    if told.history.is_empty() {
        told.history.push(present_step(records, model));
    }
    told
}

fn design(chain: &ControlModel) -> Result<Controller, TrialError> {
    Ok(Controller::design(chain, ReferenceKind::Previewed)?)
}

/// A controller from the model of each step, open loop; the last one trained, open loop and closed, and without the compensator.
/// With that one, where there is one.
fn rehearsed(
    ground: &Ground,
    rehearsal: &Rehearsal,
    (records, learned): (&Dataset, &Learned),
    progress: &dyn Fn(f64),
) -> Result<(Rehearsed, Option<Trained>), TrialError> {
    let hidden = rehearsal.hidden.effect();
    let mut rehearsed = Rehearsed {
        effect: hidden.name(),
        seed: rehearsal.seed,
        emulator: match ground {
            Ground::Host => None,
            Ground::Board(chip) => Some(chip.name()),
        },
        named: learned.model.effects.iter().any(|effect| effect.name == hidden),
        rungs: Vec::new(),
        without_compensator_percent: None,
        without_compensator_closed_percent: None,
        without_effect_percent: floor(rehearsal, &learned.model)?,
        host_percent: None,
        clocked_ticks: 0,
        late_ticks: 0,
        beyond: Vec::new(),
        truth: rehearsal.truth.clone(),
    };
    let rungs = learned.rungs.iter().enumerate();
    let model_percent = |model: &Model| model.history.last().and_then(|step| step.validate_percent);
    let steps = (learned.rungs.len() + 3) as f64;
    for (i, model) in rungs {
        let model = &told(records, model);
        let open = chain(&rehearsal.stage, model).and_then(|chain| design(&chain));
        rehearsed.climb(
            ground,
            rehearsal,
            open.as_ref().map_err(ToString::to_string),
            Climbed {
                model,
                model_percent: model_percent(model),
                name: format!("step-{i}-open"),
                trained: false,
            },
        )?;
        progress((i + 1) as f64 / steps);
    }
    let model = &told(records, &learned.model);
    let Ok(mut trained) = chain(&rehearsal.stage, model) else {
        return Ok((rehearsed, None));
    };
    let last = design(&trained)?;
    let slow = ground.training(rehearsal, &last)?;
    refine(&mut trained, model, &slow)?;
    let open = design(&trained)?;
    let closed = open.clone().with_feedback()?;
    for (controller, name) in [(&open, "trained-open"), (&closed, "trained-closed")] {
        rehearsed.climb(
            ground,
            rehearsal,
            Ok(controller),
            Climbed {
                model,
                model_percent: model_percent(model),
                name: name.to_owned(),
                trained: true,
            },
        )?;
    }
    progress(1.0 - 1.0 / steps);
    let tracked = rehearsed.rungs.last().and_then(|rung| rung.tracking_percent.as_ref());
    let left = frequencies(&closed, rehearsal.range_um()).into_iter();
    let left = left.filter(|(name, _)| tracked.is_some_and(|tracked| tracked.contains_key(*name)));
    rehearsed.beyond = left.map(|(_, beyond)| beyond).collect();
    if rehearsed.emulator.is_some() {
        rehearsed.host_percent = Some(rehearsal.errors(&rehearsal.stage, &open)?);
    }
    // The same hysteresis and the same other effects, this one not undone.
    let mut without = model.clone();
    without.effects.retain(|effect| effect.name != hidden);
    // Its loop may go as far as its own records tell, not as those of the whole model.
    without.cover(records);
    // What it misses on them is its own, too.
    without.history.clear();
    let without = told(records, &without);
    if let Ok(mut without) = chain(&rehearsal.stage, &without) {
        without.inverse = trained.inverse;
        let controller = design(&without)?;
        rehearsed.without_compensator_percent = Some(ground.errors(rehearsal, &controller, "without")?.percent);
        if rehearsed.emulator.is_none() {
            let closed = controller.with_feedback()?;
            rehearsed.without_compensator_closed_percent = Some(rehearsal.errors(&rehearsal.stage, &closed)?);
        }
    }
    let trained = Trained {
        controller: closed,
        records: slow,
    };
    Ok((rehearsed, Some(trained)))
}

/// The last controller, and the slow records that its inverse was fitted to.
pub struct Trained {
    /// Closed loop where the records allow it.
    pub controller: Controller,
    /// Along slow references.
    pub records: Vec<Record>,
}

/// What a rung of the ladder stands for.
struct Climbed<'a> {
    model: &'a Model,
    model_percent: Option<f64>,
    /// Of its image.
    name: String,
    trained: bool,
}

impl Rehearsed {
    /// Tracks with a controller, or says why there is none.
    fn climb(
        &mut self,
        ground: &Ground,
        rehearsal: &Rehearsal,
        controller: Result<&Controller, String>,
        climbed: Climbed<'_>,
    ) -> Result<(), TrialError> {
        let closed = controller
            .as_ref()
            .is_ok_and(|controller| controller.feedback.is_some());
        let (tracking_percent, refused) = match controller {
            Ok(controller) => {
                let reached = ground.errors(rehearsal, controller, &climbed.name)?;
                self.clocked_ticks += reached.clocked_ticks;
                self.late_ticks += reached.late_ticks;
                (Some(reached.percent), None)
            }
            Err(reason) => (None, Some(reason)),
        };
        self.rungs.push(Rung {
            effects: climbed.model.effects.iter().map(|effect| effect.name.clone()).collect(),
            trained: climbed.trained,
            model_percent: climbed.model_percent,
            loop_kind: if closed { "closed" } else { "open" },
            tracking_percent,
            refused,
        });
        Ok(())
    }
}

/// What a trained controller of the hysteresis alone leaves on the host where nothing is hidden: the effect dominates where it leaves
/// many times more.
fn floor(rehearsal: &Rehearsal, model: &Model) -> Result<Option<BTreeMap<String, f64>>, TrialError> {
    let records = rehearsal.records(&rehearsal.bare)?;
    let options = FitOptions {
        plays: model.thresholds.len(),
        ..FitOptions::new(model.family)
    };
    let model = fit(&records, &options, &|_| ())?.model;
    let Ok(mut trained) = chain(&rehearsal.bare, &model) else {
        return Ok(None);
    };
    let records = rehearsal.training(&rehearsal.bare, &design(&trained)?)?;
    refine(&mut trained, &model, &records)?;
    Ok(Some(rehearsal.errors(&rehearsal.bare, &design(&trained)?)?))
}
