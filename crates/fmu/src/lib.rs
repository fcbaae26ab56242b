//! FMI 3.0 co-simulation units: an identified stage, or a controller, as C that is compiled here and packed with its sources.
//!
//! A unit steps in whole sample periods. Its inputs are held over a step, as a converter holds them.
#![forbid(unsafe_code)]

mod description;
mod law;
mod model_c;
mod pack;
mod stage;

pub use pack::Fmu;

use hysteron_identify::EffectName;

/// Why there is no unit.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// A model that runs from position to voltage.
    #[error(
        "the model runs from position to voltage; a unit of a stage is made of a forward model: fit it with --direction forward"
    )]
    Inverse,
    /// An effect that a command alone does not determine, or that is the user's own.
    #[error(
        "the model has `{effect}`, which a unit with the command alone as its input cannot have; take a model without it: learn without \
         the records that show it, or fit and add the other effects"
    )]
    Effect {
        /// The effect.
        effect: EffectName,
    },
    /// A value that cannot be used.
    #[error("{field} = {value}: must be {allowed}")]
    Value {
        /// What it is.
        field: &'static str,
        /// The value.
        value: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Values of a model that the core refuses.
    #[error("the core refuses the model: {0}")]
    Core(#[from] hysteron_core::error::ParamError),
    /// A table that makes no C.
    #[error(transparent)]
    Table(#[from] hysteron_table::TableError),
    /// No compiler.
    #[error("cannot start the C compiler `cc`: {0}; install one (Debian: apt-get install gcc)")]
    Compiler(std::io::Error),
    /// The compiler says no.
    #[error("the C compiler refuses the unit's sources, which is a defect of this program: {0}")]
    Compile(String),
    /// A file of the unit that cannot be written.
    #[error("cannot pack the unit: {0}")]
    Pack(#[from] std::io::Error),
    /// The archive cannot be made.
    #[error("cannot pack the unit: {0}")]
    Zip(#[from] zip::result::ZipError),
}

/// A variable of a unit, a number in `f64`.
#[derive(Debug, Clone, PartialEq)]
struct Variable {
    name: &'static str,
    unit: &'static str,
    input: bool,
    words: &'static str,
}

impl Variable {
    fn input(name: &'static str, unit: &'static str, words: &'static str) -> Self {
        Self {
            name,
            unit,
            input: true,
            words,
        }
    }

    fn output(name: &'static str, unit: &'static str, words: &'static str) -> Self {
        Self {
            input: false,
            ..Self::input(name, unit, words)
        }
    }
}
