//! From what a user has, a campaign's records or a model, and from wishes, to a controller.

use super::beyond::{Asked, granted};
use super::feedback::{Effort, LARGEST_SENSITIVITY};
use super::{Controller, ReferenceKind};
use crate::error::ControlError;
use crate::message::{Message, Setting};
use crate::plan::drift::{self, Drift};
use hysteron_data::{Dataset, Record};
use hysteron_identify::Model;
use hysteron_identify::control::{ControlModel, RecordedHold, Undone, chain_of, identify, refine};

/// What a controller is designed from.
pub enum Source<'a> {
    /// Records of a campaign.
    Records(&'a Dataset),
    /// A fitted model.
    Model {
        /// The model.
        model: &'a Model,
        /// Slow records from rest at 0 V, to whose positions and commands the inverse is fitted as well.
        along: &'a [Record],
    },
}

/// What is wished for beside it.
pub struct Wishes {
    /// When the reference is known.
    pub reference: ReferenceKind,
    /// Limits of the command, volts; from a model without them the range of its records.
    pub volts: Option<[f64; 2]>,
    /// Rate that the controller runs at, hertz; from a model without it the highest of its records.
    pub rate_hz: Option<f64>,
    /// Largest peak of the sensitivity, 1.2 to 4.
    pub margin: f64,
    /// The user's word that the stage has no mode below this but those of the model, hertz.
    pub rigid_hz: Option<f64>,
    /// Whether what the records cover may be left; the controller remembers it.
    pub beyond_records: bool,
    /// Without feedback.
    pub open: bool,
    /// By how much the gain may be learned while the law runs, percent; it is not learned without.
    pub adapt_percent: Option<f64>,
}

impl Default for Wishes {
    fn default() -> Self {
        Self {
            reference: ReferenceKind::Previewed,
            volts: None,
            rate_hz: None,
            margin: LARGEST_SENSITIVITY,
            rigid_hz: None,
            beyond_records: false,
            open: false,
            adapt_percent: None,
        }
    }
}

impl Wishes {
    /// Refuses what makes no sense whatever the source is.
    ///
    /// # Errors
    /// [`ControlError::Wish`] for a margin or an adaptation outside of its range.
    pub fn check(&self) -> Result<(), ControlError> {
        if let Some(percent) = self.adapt_percent.filter(|percent| !(0.01..=20.0).contains(percent)) {
            return Err(ControlError::Wish(Message::from(Setting::AdaptPercent).and(format!(
                " {percent}: 0.01 to 20 percent of the gain; a stage whose gain changes by more is to be recorded again"
            ))));
        }
        let margin = self.margin;
        if (1.2..=4.0).contains(&margin) {
            return Ok(());
        }
        Err(ControlError::Wish(Message::from(Setting::Margin).and(format!(
            " {margin}: a peak of the sensitivity from 1.2 (hardly any feedback) to 4 (a quarter of its size from instability)"
        ))))
    }
}

/// A controller, and what is known beside its numbers.
pub struct Designed {
    /// The controller.
    pub controller: Controller,
    /// What undoes each effect of the model; empty from records.
    pub undone: Vec<Undone>,
    /// The model's error on records, percent of peak to peak.
    pub model_percent: Option<f64>,
    /// What changed while a campaign was recorded, where its first command came again; empty from a model.
    pub drifts: Vec<Drift>,
}

/// Where a first mode may be at the lowest, hertz: a loop against it would help with nothing.
const LOWEST_RIGID_HZ: f64 = 10.0;

/// Designs a controller.
///
/// # Errors
/// [`ControlError::Wish`] for a wish that makes no sense or leaves the records; a chain that cannot be undone.
///
/// # Example
/// ```
/// use hysteron_data::{Dataset, Record, Role};
/// // A stage of one play, 5 V wide, at 0.1 um/V, and its answer to 60 V at 5 Hz.
/// let voltage_v: Vec<f64> = (0..2000).map(|k| 30.0 - 30.0 * (std::f64::consts::TAU * f64::from(k) / 400.0).cos()).collect();
/// let mut play = 0.0_f64;
/// let position_um = voltage_v.iter().map(|&v| { play = play.clamp(v - 5.0, v + 5.0); 0.08 * v + 0.02 * play }).collect();
/// let record = Record::new("sine.csv", Role::Identify, 5e-4, voltage_v, position_um);
/// let dataset = Dataset { records: vec![record], ..Dataset::default() };
///
/// use hysteron_control::design::source::{Source, Wishes, design};
/// use hysteron_control::drive::drive;
/// let model = hysteron_identify::fit(&dataset, &hysteron_identify::FitOptions::new(hysteron_identify::Family::Mpi), &|_| ())?.model;
/// let source = Source::Model { model: &model, along: &[] };
/// let controller = design(&source, &Wishes { open: true, ..Wishes::default() })?.controller; // no record of small signals: no loop
/// let driven = drive(&controller, &[2.0; 200], Some(&model))?; // rises to 2 um and stays
/// assert!(driven.modelled.is_some_and(|run| run.error_um < 0.05));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn design(source: &Source<'_>, wishes: &Wishes) -> Result<Designed, ControlError> {
    wishes.check()?;
    let (mut chain, undone) = match source {
        Source::Records(dataset) => (from_records(dataset, wishes)?, Vec::new()),
        Source::Model { model, along } => from_model(model, along, wishes)?,
    };
    let asked = [
        Asked::voltage(&[chain.voltage_min_v, chain.voltage_max_v], Setting::Volts),
        Asked::rate(1.0 / chain.sample_period_s, Setting::RateHz),
    ];
    granted(&mut chain.covered, &asked, wishes.beyond_records)?;
    chain.covered.rigid_to_hz = rigid_hz(wishes, &chain)?;
    let controller = Controller::design(&chain, wishes.reference)?;
    let controller = if wishes.open {
        controller
    } else {
        controller.with_feedback_within(wishes.margin, Effort::Whole)?
    };
    let controller = match wishes.adapt_percent {
        Some(percent) => controller.adapting(percent / 100.0),
        None => controller,
    };
    let drifts = match source {
        Source::Records(dataset) => drift::among(dataset),
        Source::Model { .. } => Vec::new(),
    };
    let last = match source {
        Source::Model { model, .. } => model.history.last(),
        Source::Records(_) => None,
    };
    Ok(Designed {
        controller,
        undone,
        model_percent: last.and_then(|step| step.validate_percent.or(step.identify_percent)),
        drifts,
    })
}

/// What the user vouches for.
fn rigid_hz(wishes: &Wishes, chain: &ControlModel) -> Result<Option<f64>, ControlError> {
    let half_rate_hz = 0.5 / chain.sample_period_s;
    match wishes.rigid_hz {
        Some(hz) if !(hz >= LOWEST_RIGID_HZ && hz <= half_rate_hz) => {
            Err(ControlError::Wish(Message::from(Setting::RigidHz).and(format!(
                " {hz}: {LOWEST_RIGID_HZ} Hz to half the controller's rate, {half_rate_hz:.0} Hz; give the frequency below which \
                 the stage surely has no mode but those of the model"
            ))))
        }
        given => Ok(given),
    }
}

fn from_records(dataset: &Dataset, wishes: &Wishes) -> Result<ControlModel, ControlError> {
    let mut chain = identify(dataset)?;
    if wishes.rate_hz.is_some() {
        return Err(ControlError::Wish(
            Message::from(Setting::RateHz).and(": a campaign is recorded at the controller's own rate; leave it out"),
        ));
    }
    if let Some([low, high]) = wishes.volts {
        (chain.voltage_min_v, chain.voltage_max_v) = (low, high);
    }
    Ok(chain)
}

/// Limits of the command where nobody gives others: those of a model's records, volts.
pub fn usual_volts(model: &Model) -> [f64; 2] {
    [model.input_min, model.input_max]
}

/// The controller's rate where nobody gives another: the highest of a model's records, hertz.
pub fn usual_rate_hz(model: &Model) -> Option<f64> {
    let rates = model.fitted_on.records.iter().map(|record| record.sample_rate_hz);
    Some(rates.fold(0.0, f64::max)).filter(|highest| *highest > 0.0)
}

fn from_model(model: &Model, along: &[Record], wishes: &Wishes) -> Result<(ControlModel, Vec<Undone>), ControlError> {
    let rate_hz = match wishes.rate_hz {
        Some(hz) if (1.0..=1e7).contains(&hz) => hz,
        Some(hz) => {
            let allowed = format!(" {hz}: 1 to 10000000 hertz");
            return Err(ControlError::Wish(Message::from(Setting::RateHz).and(allowed)));
        }
        None => usual_rate_hz(model).ok_or_else(|| {
            ControlError::Wish(
                Message::from(
                    "the model does not say at what rate its records were taken; give the controller's with ",
                )
                .naming(Setting::RateHz)
                .and(", such as 50000"),
            )
        })?,
    };
    let volts = wishes.volts.unwrap_or(usual_volts(model));
    let (mut chain, undone) = chain_of(model, 1.0 / rate_hz, volts, RecordedHold::InRecords)?;
    if !along.is_empty() {
        refine(&mut chain, model, along)?;
    }
    Ok((chain, undone))
}
