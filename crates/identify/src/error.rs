//! What can go wrong when a model is fitted, read or run.

use crate::family::Family;
use hysteron_effects::{EffectError, EffectName, UnknownEffect};

/// An error of identification.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// No record to fit to.
    #[error("the dataset has no record with role `identify`; give at least one record that role in dataset.toml")]
    NothingToFit,
    /// The model's input stands still in every record.
    #[error(
        "the {input} stands still in every record with role `identify`; a hysteresis model needs records that move"
    )]
    NoExcitation {
        /// `voltage` or `position`
        input: &'static str,
    },
    /// Number of plays out of range.
    #[error("{plays} plays asked for; allowed are 1 to {max}")]
    Plays {
        /// What was asked for.
        plays: usize,
        /// The largest number allowed.
        max: usize,
    },
    /// Fewer samples than parameters.
    #[error("{samples} samples cannot determine {parameters} parameters; take fewer plays or longer records")]
    TooFewSamples {
        /// Samples in the records with role `identify`.
        samples: usize,
        /// Parameters of the model.
        parameters: usize,
    },
    /// A particle swarm has a family without parameters for it.
    #[error("the method mpso fits pi, mpi, wrpi and mrpi as the paper does; for `{family}` use the method separable")]
    NoSwarm {
        /// The family.
        family: &'static str,
    },
    /// A family that runs from voltage to position alone.
    #[error(
        "`{family}` runs from voltage to position alone: its elements fade along the voltage's path; fit it forward, and \
         design a controller, which makes the inverse"
    )]
    ForwardOnly {
        /// The family.
        family: Family,
    },
    /// An effect that is not in the catalogue, or an effect file that is refused.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// An effect that these records or this model cannot have.
    #[error("cannot add `{effect}`: {reason}")]
    EffectRefused {
        /// The effect.
        effect: EffectName,
        /// Why, and what to do.
        reason: String,
    },
    /// An effect that is to be taken out of a model that does not have it.
    #[error(
        "the model's chain has no `{effect}` to take out; a change of the hysteresis family is made by fitting anew"
    )]
    EffectNotThere {
        /// The effect.
        effect: EffectName,
    },
    /// A model with effects where the hysteresis alone can run.
    #[error(
        "the control table has the hysteresis alone, the model has {effects} around it; build the table from the model \
         before they were added, and put their compensators beside it"
    )]
    CoreEffects {
        /// The effects.
        effects: String,
    },
    /// An effect that a voltage alone does not determine.
    #[error("`{effect}` needs more than a voltage (other columns, or phases of a record); simulate a whole record")]
    EffectNeedsRecord {
        /// The effect.
        effect: EffectName,
    },
    /// A model with another number of plays than the table it is to fill.
    #[error("the model has {plays} plays, the control table has {wanted}; fit with {wanted} plays")]
    CorePlays {
        /// Plays of the model.
        plays: usize,
        /// Plays of the table.
        wanted: usize,
    },
    /// A model that the core refuses.
    #[error("the model cannot run as a control table: {0}")]
    Core(#[from] hysteron_core::error::ParamError),
    /// Records that do not tell what a controller needs to know.
    #[error("cannot identify for control: {reason}")]
    Control {
        /// What is missing, and what to do.
        reason: String,
    },
    /// Parameters that cannot be moved by hand in this way.
    #[error("{0}")]
    Moved(String),
    /// A model file that cannot be read.
    #[error("{file}: {reason}")]
    ModelFile {
        /// The file.
        file: String,
        /// What is wrong, with line and what is allowed.
        reason: String,
    },
    /// A model file that cannot be opened or written.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
}

impl From<UnknownEffect> for IdentifyError {
    fn from(unknown: UnknownEffect) -> Self {
        Self::Effect(unknown.into())
    }
}
