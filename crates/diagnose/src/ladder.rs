//! How the error of a model fell, step by step, down to the noise floor.

use crate::investigation::Investigation;
use crate::noise::noise_floor;
use hysteron_acquisition::NoiseFloor;
use hysteron_data::{Dataset, Role};
use hysteron_identify::effects::{UserEffect, find};
use hysteron_identify::search::Thinned;
use hysteron_identify::{
    Added, Adding, Change, EffectId, EffectName, IdentifyError, MOVED_BY_HAND, Model, RecordError, Step,
    check_own_effect,
};
use serde::Serialize;

/// A model's history, measured against the noise floor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ladder {
    /// Family of the hysteresis as it is now.
    pub model: String,
    /// The effects around it, in the order of the chain.
    pub effects: Vec<EffectName>,
    /// What it was fitted on.
    pub dataset: String,
    /// Noise floor, micrometres rms.
    pub noise_rms_um: Option<f64>,
    /// What it is worth and rests on.
    pub noise: Option<NoiseFloor>,
    /// The error that the noise alone would leave on the records it was fitted to, percent of peak to peak.
    pub noise_identify_percent: Option<f64>,
    /// The same on validation records.
    pub noise_validate_percent: Option<f64>,
    /// The steps in their order.
    pub steps: Vec<Rung>,
}

/// One step of a ladder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rung {
    /// What was done, and the errors it left.
    #[serde(flatten)]
    pub step: Step,
    /// Its error over that of the step before: on validation records, else on those it was fitted to.
    pub of_before: Option<f64>,
    /// Its error over the noise floor, on the same records.
    pub times_noise: Option<f64>,
}

impl Rung {
    /// The error that counts: on validation records, else on those it was fitted to, percent of peak to peak.
    pub fn percent(&self) -> Option<f64> {
        percent(&self.step)
    }

    /// The step in a few characters: `mpi`, `+ delay`, `- delay`.
    pub fn name(&self) -> String {
        match self.step.change {
            Change::Fitted => self.step.what.to_string(),
            Change::Added => format!("+ {}", self.step.what),
            Change::Removed => format!("- {}", self.step.what),
            Change::Moved => MOVED_BY_HAND.to_owned(),
        }
    }
}

impl Ladder {
    /// The error that the noise alone would leave, on the records that count.
    pub fn noise_percent(&self) -> Option<f64> {
        self.noise_validate_percent.or(self.noise_identify_percent)
    }
}

/// Adds an effect to a model, as [`hysteron_identify::add()`] does, reckoning with the noise floor of the records.
///
/// # Errors
/// As [`hysteron_identify::add()`].
pub fn add(
    dataset: &Dataset,
    model: &Model,
    effect: EffectId,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    let noise = noise_floor(dataset);
    let adding = reckoning_with(&noise);
    let mut added = hysteron_identify::add(dataset, model, &find(effect), adding, progress)?;
    if effect == EffectId::Resonance
        && let Some(seen) = rings_elsewhere(dataset, model, &added.model, noise.rms_um)
    {
        let held = [("frequency", seen[0]), ("damping", seen[1])];
        added = hysteron_identify::add_held(dataset, model, &find(effect), &held, adding, progress)?;
    }
    added.model.fitted_on.noise = Some(noise);
    Ok(added)
}

/// A ring further off than this share of its frequency is another mode than the fitted one.
const ELSEWHERE: f64 = 0.1;

/// Frequency and damping of the ring after a step, where no mode of the fitted model is what rings there.
fn rings_elsewhere(dataset: &Dataset, model: &Model, fitted: &Model, noise_um: f64) -> Option<[f64; 2]> {
    let thinned = Thinned::of(dataset, noise_um);
    let investigation = Investigation::new(&thinned, model, &[], noise_um, &[]).ok()?;
    let ring = investigation.ring(&investigation.residuals())?;
    let seen = ["frequency", "damping_ratio"].map(|name| ring.parameters.iter().find(|p| p.name == name));
    let [Some(frequency), Some(damping)] = seen else {
        return None;
    };
    let modes = fitted.effects.iter().filter(|link| link.name == EffectId::Resonance);
    let near = |hz: f64| (hz / frequency.value - 1.0).abs() < ELSEWHERE;
    let mut frequencies = modes.flat_map(|link| &link.parameters).filter(|p| p.unit == "Hz");
    (!frequencies.any(|p| near(p.value))).then_some([frequency.value, damping.value])
}

/// The same with an effect of the user's own.
///
/// # Errors
/// As [`hysteron_identify::add()`]; records without a column that its equations need.
pub fn add_own(
    dataset: &Dataset,
    model: &Model,
    effect: UserEffect,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    check_own_effect(effect, dataset)?;
    let noise = noise_floor(dataset);
    let mut added = hysteron_identify::add(dataset, model, &effect.effect(), reckoning_with(&noise), progress)?;
    added.model.fitted_on.noise = Some(noise);
    Ok(added)
}

fn reckoning_with(noise: &NoiseFloor) -> Adding {
    Adding {
        noise_um: noise.rms_um,
        keep_family: false,
    }
}

/// The ladder of a model; `None` where it has no history, because nothing was ever added to it.
///
/// # Example
/// ```
/// # fn show(dataset: &hysteron_data::Dataset, model: &hysteron_identify::Model) -> Result<(), hysteron_identify::IdentifyError> {
/// let added = hysteron_diagnose::add(dataset, model, hysteron_identify::EffectId::Delay, &|_| ())?;
/// let ladder = hysteron_diagnose::ladder(&added.model).expect("a step was just added");
/// assert_eq!(ladder.steps[1].name(), "+ delay");
/// # Ok(())
/// # }
/// ```
pub fn ladder(model: &Model) -> Option<Ladder> {
    let last = model.history.last()?;
    let left = last.records.iter().map(|record| record.rms).filter(|&rms| rms > 0.0);
    let least_left = left.fold(f64::INFINITY, f64::min);
    let noise = model.fitted_on.noise.map(|floor| floor.at_most(least_left));
    let noise_rms_um = noise.map(|floor| floor.rms_um);
    let noise_of = |role| noise_rms_um.and_then(|noise_um| noise_percent(&last.records, role, noise_um));
    let (identify, validate) = (noise_of(Role::Identify), noise_of(Role::Validate));
    let floor = validate.or(identify);
    let mut before = None;
    let steps = model.history.iter().map(|step| {
        let here = percent(step);
        let rung = Rung {
            step: step.clone(),
            of_before: ratio(here, before),
            times_noise: ratio(here, floor),
        };
        before = here;
        rung
    });
    let steps = steps.collect();
    Some(Ladder {
        model: model.family.name().to_owned(),
        effects: model.effects.iter().map(|effect| effect.name.clone()).collect(),
        dataset: model.fitted_on.dataset.clone(),
        noise_rms_um,
        noise,
        noise_identify_percent: identify,
        noise_validate_percent: validate,
        steps,
    })
}

/// The error of a step that counts: on validation records, else on those it was fitted to.
pub(crate) fn percent(step: &Step) -> Option<f64> {
    step.validate_percent.or(step.identify_percent)
}

fn ratio(here: Option<f64>, to: Option<f64>) -> Option<f64> {
    here.zip(to).filter(|&(_, to)| to > 0.0).map(|(here, to)| here / to)
}

/// The noise floor in percent of each record's peak to peak, pooled like the errors.
fn noise_percent(records: &[RecordError], role: Role, noise_um: f64) -> Option<f64> {
    let squares: Vec<f64> = records
        .iter()
        .filter(|record| record.role == role && record.rms > 0.0)
        .filter_map(|record| record.percent.map(|percent| (percent * noise_um / record.rms).powi(2)))
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}
