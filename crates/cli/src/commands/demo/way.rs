//! What the demo does, step by step, and what is left of it for text and page.

use crate::error::CliError;
use crate::progress;
use hysteron_control::design::{Controller, ReferenceKind};
use hysteron_control::figures::Tracked;
use hysteron_data::Dataset;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_diagnose::{Comparison, Ladder, Learned, Rung, compare, diagnose, ladder, learn_from};
use hysteron_identify::control::{ControlModel, RecordedHold, chain_of};
use hysteron_identify::{Family, FitOptions, Model, fit};
use hysteron_tracking::rehearsal::{Hidden, Rehearsal};
use std::collections::BTreeMap;

/// Plays of the first model: as many as `rehearse` has.
const PLAYS: usize = 16;

/// The whole way.
pub(super) struct Way {
    /// The stage with its hidden effect.
    pub rehearsal: Rehearsal,
    pub records: Dataset,
    /// Hysteresis alone.
    pub first: Model,
    /// It beside every record.
    pub compared: Comparison,
    pub diagnosis: Diagnosis,
    pub learned: Learned,
    ladder: Option<Ladder>,
    /// References tracked in open loop; why not, where the model has no inverse.
    pub tracked: Result<Followed, String>,
}

/// References tracked with the effect's compensator and without.
pub(super) struct Followed {
    with: BTreeMap<String, f64>,
    without: BTreeMap<String, f64>,
    /// A hold of four seconds.
    pub hold_with: Tracked,
    pub hold_without: Tracked,
}

impl Way {
    /// The first model, and the model after each step that was kept.
    pub(super) fn steps(&self) -> &[Rung] {
        self.ladder.as_ref().map_or(&[], |ladder| &ladder.steps)
    }

    /// The error that the noise alone would leave, percent of peak to peak.
    pub(super) fn noise_percent(&self) -> Option<f64> {
        self.ladder.as_ref().and_then(Ladder::noise_percent)
    }

    /// Whether the hidden effect is in the last model.
    pub(super) fn found(&self) -> bool {
        let hidden = self.rehearsal.hidden.effect();
        self.learned.model.effects.iter().any(|effect| effect.name == hidden)
    }
}

impl Followed {
    /// Each reference in words, its error without the compensator and with it, percent of the range.
    pub(super) fn errors(&self) -> Vec<(String, f64, f64)> {
        let words = |name: &str| match name {
            "hold" => "hold of 4 s".to_owned(),
            hertz => format!("sine {hertz} Hz"),
        };
        let with = self.with.iter();
        with.filter_map(|(name, &with)| Some((words(name), *self.without.get(name)?, with)))
            .collect()
    }
}

/// Records a stage, fits, diagnoses, learns, tracks.
pub(super) fn go(hidden: Hidden, seed: u64) -> Result<Way, CliError> {
    let bar = progress::bar("recording the stage");
    let rehearsal = Rehearsal::draw(hidden, seed)?;
    let records = rehearsal.records(&rehearsal.stage)?;
    progress::advance(&bar, 0.05);
    bar.set_message("fitting the first model");
    let options = FitOptions {
        plays: PLAYS,
        ..FitOptions::new(Family::PlayPolynomial)
    };
    let first = fit(&records, &options, &|share| {
        progress::advance(&bar, 0.05 + 0.05 * share)
    })?
    .model;
    let compared = compare(&records, &first, &|_| ());
    bar.set_message("diagnosing");
    let diagnosis = diagnose(&records, &first, &|share, _| progress::advance(&bar, 0.1 + 0.2 * share));
    bar.set_message("learning");
    let learned = learn_from(&records, first.clone(), &|_, share| {
        progress::advance(&bar, 0.3 + 0.4 * share)
    })?;
    bar.set_message("tracking");
    progress::advance(&bar, 0.7);
    let tracked = follow(&rehearsal, &learned.model).map_err(|error| error.to_string());
    bar.finish_and_clear();
    Ok(Way {
        ladder: ladder(&learned.model),
        rehearsal,
        records,
        first,
        compared,
        diagnosis,
        learned,
        tracked,
    })
}

/// Tracks in open loop with every effect of the model undone, and with the hidden one left as it is.
fn follow(rehearsal: &Rehearsal, model: &Model) -> Result<Followed, CliError> {
    let stage = &rehearsal.stage;
    let complete = chain(rehearsal, model)?;
    let mut without = model.clone();
    without
        .effects
        .retain(|effect| effect.name != rehearsal.hidden.effect());
    let mut lacking = chain(rehearsal, &without)?;
    // The same hysteresis: only the compensator differs.
    lacking.inverse = complete.inverse.clone();
    let with = Controller::design(&complete, ReferenceKind::Previewed)?;
    let without = Controller::design(&lacking, ReferenceKind::Previewed)?;
    Ok(Followed {
        with: rehearsal.errors(stage, &with)?,
        without: rehearsal.errors(stage, &without)?,
        hold_with: rehearsal.hold(stage, &with)?,
        hold_without: rehearsal.hold(stage, &without)?,
    })
}

fn chain(rehearsal: &Rehearsal, model: &Model) -> Result<ControlModel, CliError> {
    let stage = &rehearsal.stage;
    let limits = [stage.amplifier.min_v, stage.amplifier.max_v];
    let (chain, _) = chain_of(model, stage.sample_period_s, limits, RecordedHold::AccountedFor)?;
    Ok(chain)
}
