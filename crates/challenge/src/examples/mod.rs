//! The examples: what is simulated, and what is true of it. Made from a fixed seed: the same records on every machine.

mod campaign;
mod scope;

use crate::ChallengeError;
pub use campaign::{Planned, default_campaign, record};
use hysteron_data::Dataset;
use hysteron_plant::challenge::{Asked, Effect, Spec, StageFamily, Strength, Truth, generate};
use hysteron_plant::{StageConfig, StageError, preset};
pub use scope::import_command;

/// Seed of every example: stage, programme and noise.
const SEED: u64 = 1;

/// The datasets that `hysteron example` makes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Example {
    /// The stage of the paper: hysteresis whose loops widen with the frequency.
    PaperStage,
    /// A stage that goes on moving for seconds after each step.
    HiddenCreep,
    /// A stage whose position arrives late.
    HiddenDelay,
    /// A stage that rings.
    HiddenResonance,
    /// A stage that rings and creeps.
    TwoEffects,
    /// A stage with hysteresis and nothing else.
    NothingHidden,
    /// A stage shaken by its surroundings, which no effect of the catalogue describes.
    OutsideCatalogue,
    /// A slow, lightly damped stage: first mode at 739 Hz, creep, 16-bit converters.
    Stage739hz,
    /// Three noisy captures of an oscilloscope as CSV files with its header, for `import`.
    Scope,
}

/// What an example consists of.
pub enum Made {
    /// A dataset of ours.
    Dataset {
        /// The records.
        dataset: Box<Dataset>,
        /// What was simulated.
        truth: ExampleTruth,
    },
    /// Files as an instrument writes them.
    Files {
        /// Name and text of each.
        files: Vec<(String, String)>,
        /// What was simulated.
        truth: ExampleTruth,
    },
}

/// What is true of an example.
pub enum ExampleTruth {
    /// In words.
    Said(&'static str),
    /// A case of the simulated laboratory.
    Case(Box<Truth>),
}

impl Example {
    /// All of them, in the order of the list.
    pub const ALL: [Self; 9] = [
        Self::PaperStage,
        Self::HiddenCreep,
        Self::HiddenDelay,
        Self::HiddenResonance,
        Self::TwoEffects,
        Self::NothingHidden,
        Self::OutsideCatalogue,
        Self::Stage739hz,
        Self::Scope,
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::PaperStage => "paper-stage",
            Self::HiddenCreep => "hidden-creep",
            Self::HiddenDelay => "hidden-delay",
            Self::HiddenResonance => "hidden-resonance",
            Self::TwoEffects => "two-effects",
            Self::NothingHidden => "nothing-hidden",
            Self::OutsideCatalogue => "outside-catalogue",
            Self::Stage739hz => "stage-739hz",
            Self::Scope => "scope",
        }
    }

    /// One line for people.
    pub fn about(self) -> &'static str {
        match self {
            Self::PaperStage => {
                "the paper's stage: 2.6 um at 26 V, loops that open from 16 % at 10 Hz to 46 % at 500 Hz"
            }
            Self::HiddenCreep => "after every step the stage keeps crawling for seconds",
            Self::HiddenDelay => "every motion arrives late, and the loop at 500 Hz swells to an ellipse",
            Self::HiddenResonance => "every corner of the drive leaves the stage ringing",
            Self::TwoEffects => "the stage rings after every corner and crawls after every step",
            Self::NothingHidden => "plain hysteresis down to the noise: the honest answer is `none`",
            Self::OutsideCatalogue => {
                "a vibration from the surroundings shakes the stage: the honest answer is `unknown`"
            }
            Self::Stage739hz => "a slow stage, 20 um at 200 V, that swings at 739 Hz",
            Self::Scope => "noisy 12-bit captures of two monitor outputs, with an oscilloscope's header, for `import`",
        }
    }

    /// Simulates it. `progress` gets the share done.
    ///
    /// # Errors
    /// As the simulated stage; none for the fixed seed.
    pub fn make(self, progress: &dyn Fn(f64)) -> Result<Made, ChallengeError> {
        match self {
            Self::PaperStage => Ok(Made::Dataset {
                dataset: Box::new(paper_stage(progress)?),
                truth: ExampleTruth::Said(
                    "rate-dependent hysteresis, amplifier lag of 20 us, mode at 8 kHz, 0.8 nm of noise",
                ),
            }),
            Self::Stage739hz => Ok(Made::Dataset {
                dataset: Box::new(of_preset(self, &preset::tracking_739(), progress)?),
                truth: ExampleTruth::Said(
                    "amplifier lag of 60 us, creep of 1.5 % a decade, modes at 739 Hz and 2.29 kHz, 1 nm of noise",
                ),
            }),
            Self::HiddenCreep => hidden(self, &[Effect::Creep]),
            Self::HiddenDelay => hidden(self, &[Effect::Delay]),
            Self::HiddenResonance => hidden(self, &[Effect::Resonance]),
            Self::TwoEffects => hidden(self, &[Effect::Resonance, Effect::Creep]),
            Self::NothingHidden => hidden(self, &[]),
            Self::OutsideCatalogue => hidden(self, &[Effect::Vibration]),
            Self::Scope => Ok(Made::Files {
                files: scope::captures(SEED, progress)?,
                truth: ExampleTruth::Said(scope::TRUTH),
            }),
        }
    }
}

/// The dataset of [`Example::PaperStage`]; the workbench begins with it as well.
///
/// # Errors
/// As the simulated stage; none for the fixed seed.
pub fn paper_stage(progress: &dyn Fn(f64)) -> Result<Dataset, StageError> {
    of_preset(Example::PaperStage, &preset::paper_rate(), progress)
}

fn of_preset(example: Example, stage: &StageConfig, progress: &dyn Fn(f64)) -> Result<Dataset, StageError> {
    let plan = default_campaign(stage.hysteresis.reference_v, SEED);
    record(example.name(), stage, &plan, stage.sample_period_s, SEED, progress)
}

/// A stage of the challenges with these effects, strong, in plays with sigmoid outputs, which no model here has.
fn hidden(example: Example, effects: &[Effect]) -> Result<Made, ChallengeError> {
    let strong = |&effect: &Effect| Asked {
        effect,
        strength: Strength::Strong,
    };
    let spec = Spec {
        hidden: effects.iter().map(strong).collect(),
        family: Some(StageFamily::SigmoidPlays),
        noise_seed: 0,
    };
    let (case, truth) = generate(SEED, &spec)?;
    Ok(Made::Dataset {
        dataset: Box::new(crate::dataset(case, example.name())),
        truth: ExampleTruth::Case(Box::new(truth)),
    })
}

impl std::str::FromStr for Example {
    type Err = ChallengeError;

    fn from_str(name: &str) -> Result<Self, ChallengeError> {
        Self::ALL
            .into_iter()
            .find(|example| example.name() == name)
            .ok_or_else(|| {
                let names = Self::ALL.map(Self::name).join(", ");
                ChallengeError::Refused(format!("there is no example `{name}`; there are {names}"))
            })
    }
}
