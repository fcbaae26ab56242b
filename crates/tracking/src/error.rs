//! What can go wrong when a loop is run on the simulated stage.

use hysteron_control::ControlError;
use hysteron_control::message::Naming;
use hysteron_core::error::ParamError;
use hysteron_identify::IdentifyError;
use hysteron_plant::StageError;

/// An error of a run on the simulated stage.
#[derive(Debug, thiserror::Error)]
pub enum TrackingError {
    /// The simulated stage refuses its configuration or its command.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A controller that cannot be designed or run.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A model that cannot be fitted or run.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A law of the paper that the core refuses.
    #[error("the control law cannot be built: {0}")]
    Law(#[from] ParamError),
}

impl TrackingError {
    /// What it says, with settings in a front end's names.
    pub fn worded(&self, name: Naming) -> String {
        match self {
            Self::Control(error) => error.worded(name),
            Self::Stage(_) | Self::Identify(_) | Self::Law(_) => self.to_string(),
        }
    }
}
