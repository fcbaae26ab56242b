//! A model whose parameters a person moves, against one record: the numbers of a comparison, fast enough to follow a hand.

use crate::compare::Errors;
use hysteron_data::{Dataset, Record};
use hysteron_identify::family::peak_to_peak;
use hysteron_identify::objective::clipped;
use hysteron_identify::{IdentifyError, InitialState, Knob, Model};

/// A fitted model and what of it can be moved, on a dataset.
#[derive(Debug, Clone)]
pub struct ByHand {
    model: Model,
    knobs: Vec<Knob>,
    clipped: Vec<f64>,
}

/// What the moved model makes of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Played {
    /// Modelled output, the model's output unit.
    pub modelled: Vec<f64>,
    /// Error over peak to peak (eq. 19), percent; none where the record does not move.
    pub nrmse_percent: Option<f64>,
}

/// How the start of a record is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start {
    /// Chosen anew for the moved model: the answer of a comparison, some 25 runs where the record does not begin periodically.
    Chosen,
    /// As it was found before: one run.
    Known(InitialState),
}

impl ByHand {
    /// A model on the dataset that it was fitted on.
    pub fn new(dataset: &Dataset, model: Model) -> Self {
        Self {
            knobs: model.knobs(dataset),
            clipped: clipped(dataset, model.direction),
            model,
        }
    }

    /// What can be moved.
    pub fn knobs(&self) -> &[Knob] {
        &self.knobs
    }

    /// The measured series that the model is held against.
    pub fn measured<'a>(&self, record: &'a Record) -> &'a [f64] {
        self.model.direction.output(record)
    }

    /// The start that the fitted model finds for a record.
    pub fn start(&self, record: &Record) -> InitialState {
        self.model.simulate(record).initial
    }

    /// Runs the model with its parameters at these values over a record.
    ///
    /// # Errors
    /// Another number of values, or one outside its bounds.
    pub fn play(&self, record: &Record, values: &[f64], start: Start) -> Result<Played, IdentifyError> {
        let model = self.model.moved(&self.knobs, values)?;
        let mut modelled = match start {
            Start::Chosen => model.simulate(record).output,
            Start::Known(initial) => model.simulate_starting(record, initial),
        };
        let measured = self.measured(record);
        for (modelled, y) in modelled.iter_mut().zip(measured) {
            if self.clipped.contains(y) {
                *modelled = *y;
            }
        }
        let moves = peak_to_peak(&record.voltage_v) > 0.0;
        let errors = Errors::new((measured, &self.clipped), modelled.iter().copied(), moves);
        Ok(Played {
            nrmse_percent: errors.nrmse_percent(),
            modelled,
        })
    }
}
