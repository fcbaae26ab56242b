//! A controller on a stage of the user's own, a model or a process: what its design expects, beside what comes out.

use crate::adapted::{Adaptation, Adapted};
use crate::design::Controller;
use crate::design::beyond::{NotPlayed, frequencies};
use crate::design::prediction::{Predicted, predict};
use crate::error::ControlError;
use crate::figures::{Tracked, judge};
use crate::reference::{Reference, Shape};
use hysteron_identify::EffectName;
use hysteron_identify::covered::Beyond;
use serde::Serialize;

/// Rms of the error, percent of peak to peak, from which on a loop swings by itself: one that does not move at all has 35 % on a sine, one
/// that moves against the reference 71 %.
pub const SWINGS_PERCENT: f64 = 100.0;

/// One reference in one loop.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The reference, as tables and files name it.
    pub reference: &'static str,
    /// `open` or `closed`.
    #[serde(rename = "loop")]
    pub loop_kind: &'static str,
    /// Rms of the error that the design expects of a sine over the whole range, percent of peak to peak; none for other shapes, nor beyond the
    /// records.
    pub expected_percent: Option<f64>,
    /// How far beyond the records its frequency lies: nothing is known there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond: Option<Beyond>,
    /// Rms of reference minus position over whole periods, percent of peak to peak.
    pub found_percent: f64,
    /// Whether the loop swings no further than it is asked to.
    pub stable: bool,
    /// What the law had learned of gain and zero at the end of the run; none where it does not learn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adapted: Option<Adapted>,
}

/// A controller on something that is not a simulated stage of ours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Lowest and highest reference, micrometres.
    pub range_um: [f64; 2],
    /// Effects of the model that a command alone does not determine: they are not in the runs.
    pub left_out: Vec<EffectName>,
    /// Bounds of what is learned of gain and zero; none where nothing is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// The runs.
    pub rows: Vec<Row>,
    /// References that were left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_played: Vec<NotPlayed>,
}

/// Half of the stroke that the inverse covers, about two fifths of it.
pub fn half_the_stroke(controller: &Controller) -> [f64; 2] {
    let (inverse, rest_um) = (&controller.model.inverse, controller.model.around.rest_um);
    let low_um = inverse.input_min_um.max(0.0);
    [0.15, 0.65].map(|share| rest_um + low_um + share * (inverse.input_max_um - low_um))
}

/// Commands and positions of a run, from the first sample on that the law is told of: as many before the reference is due as the law
/// knows it ahead.
pub(crate) struct Played {
    pub command_v: Vec<f64>,
    pub position_um: Vec<f64>,
    /// What the law had learned at the end.
    pub adapted: Option<Adapted>,
}

/// A reference that repeats, and whether the loop is closed.
pub(crate) type Run = ((&'static str, Shape), bool);

/// What is run, and what the design expects of it.
pub struct Plan<'a> {
    controller: &'a Controller,
    range_um: [f64; 2],
    expected: Vec<Predicted>,
    /// References above the frequencies of the records.
    beyond: Vec<(&'static str, Beyond)>,
}

impl<'a> Plan<'a> {
    /// The references of a range, micrometres.
    ///
    /// # Errors
    /// As [`predict`].
    pub fn new(controller: &'a Controller, range_um: [f64; 2]) -> Result<Self, ControlError> {
        Ok(Self {
            controller,
            range_um,
            expected: predict(controller, range_um[1] - range_um[0], None)?,
            beyond: frequencies(controller, range_um),
        })
    }

    /// Each of these references, open and, where there is feedback, closed.
    pub(crate) fn runs(&self, references: &[(&'static str, Shape)]) -> Vec<Run> {
        let loops: &[bool] = match self.controller.feedback {
            Some(_) => &[false, true],
            None => &[false],
        };
        let of = |shape: &(&'static str, Shape)| {
            let shape = *shape;
            loops.iter().map(move |closed| (shape, *closed))
        };
        references.iter().flat_map(of).collect()
    }

    /// Plays one of them and judges it.
    pub(crate) fn row(
        &self,
        ((key, shape), closed): Run,
        play: &mut dyn FnMut(bool, &Reference) -> Result<Played, ControlError>,
    ) -> Result<Row, ControlError> {
        let period_s = self.controller.model.sample_period_s;
        let reference = shape.reference(self.range_um, period_s);
        let Played {
            command_v,
            position_um,
            adapted,
        } = play(closed, &reference)?;
        let due = |values: &[f64]| values.get(self.controller.samples_ahead..).unwrap_or_default().to_vec();
        let run = Tracked {
            reference_um: reference.samples_um.clone(),
            measured_um: due(&position_um),
            true_um: due(&position_um),
            limited: vec![false; reference.samples_um.len()],
            command_v: due(&command_v),
            adapted,
        };
        let figures = judge(&run.from(reference.judged_from), period_s);
        let found_percent = figures.map_or(f64::NAN, |figures| figures.true_percent);
        Ok(self.beside((key, closed), found_percent, found_percent < SWINGS_PERCENT, adapted))
    }

    /// What was found on a reference in one loop, beside what the design expects of it.
    pub fn beside(
        &self,
        (reference, closed): (&'static str, bool),
        found_percent: f64,
        stable: bool,
        adapted: Option<Adapted>,
    ) -> Row {
        let predicted = self.expected.iter().find(|at| reference.parse() == Ok(at.frequency_hz));
        let reckoned = predicted.and_then(|at| at.error);
        Row {
            reference,
            loop_kind: if closed { "closed" } else { "open" },
            expected_percent: reckoned.and_then(|error| match closed {
                true => error.closed_percent,
                false => Some(error.open_percent),
            }),
            beyond: self
                .beyond
                .iter()
                .find_map(|(left, beyond)| (*left == reference).then_some(*beyond)),
            found_percent,
            stable,
            adapted,
        }
    }
}
