//! The examples: what is simulated, and what is true of it.

use super::scope;
use crate::commands::campaign::{default_campaign, record};
use crate::error::CliError;
use clap::ValueEnum;
use hysteron_data::Dataset;
use hysteron_plant::challenge::{Asked, Effect, Spec, StageFamily, Strength, Truth, generate};
use hysteron_plant::{StageConfig, preset};
use std::fmt::Write;

/// Seed of every example: stage, programme and noise.
const SEED: u64 = 1;

/// The datasets that `hysteron example` makes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum ExampleName {
    /// The stage of the paper: hysteresis whose loops widen with the frequency
    PaperStage,
    /// A stage that goes on moving for seconds after each step
    HiddenCreep,
    /// A stage whose position arrives late
    HiddenDelay,
    /// A stage that rings
    HiddenResonance,
    /// A stage that rings and creeps
    TwoEffects,
    /// A stage with hysteresis and nothing else
    NothingHidden,
    /// A stage shaken by its surroundings, which no effect of the catalogue describes
    OutsideCatalogue,
    /// A slow, lightly damped stage: first mode at 739 Hz, creep, 16-bit converters
    #[value(name = "stage-739hz")]
    Stage739hz,
    /// Three noisy captures of an oscilloscope as CSV files with its header, for `import`
    Scope,
}

/// What an example consists of.
pub(super) enum Made {
    /// A dataset of ours.
    Dataset {
        dataset: Box<Dataset>,
        /// What was simulated, in words.
        truth: String,
    },
    /// Files as an instrument writes them: name and text.
    Files {
        files: Vec<(String, String)>,
        truth: String,
    },
}

impl ExampleName {
    /// Its name on the command line.
    pub(crate) fn name(self) -> &'static str {
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
    pub(super) fn about(self) -> &'static str {
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
    pub(super) fn make(self, progress: &dyn Fn(f64)) -> Result<Made, CliError> {
        match self {
            Self::PaperStage => Ok(Made::Dataset {
                dataset: Box::new(paper_stage(progress)?),
                truth: "rate-dependent hysteresis, amplifier lag of 20 us, mode at 8 kHz, 0.8 nm of noise".to_owned(),
            }),
            Self::Stage739hz => Ok(Made::Dataset {
                dataset: Box::new(of_preset(self, &preset::tracking_739(), progress)?),
                truth: "amplifier lag of 60 us, creep of 1.5 % a decade, modes at 739 Hz and 2.29 kHz, 1 nm of noise"
                    .to_owned(),
            }),
            Self::HiddenCreep => hidden(self, &[Effect::Creep]),
            Self::HiddenDelay => hidden(self, &[Effect::Delay]),
            Self::HiddenResonance => hidden(self, &[Effect::Resonance]),
            Self::TwoEffects => hidden(self, &[Effect::Resonance, Effect::Creep]),
            Self::NothingHidden => hidden(self, &[]),
            Self::OutsideCatalogue => hidden(self, &[Effect::Vibration]),
            Self::Scope => Ok(Made::Files {
                files: scope::captures(SEED, progress)?,
                truth: scope::TRUTH.to_owned(),
            }),
        }
    }
}

/// The dataset of [`ExampleName::PaperStage`]; the workbench begins with it as well.
pub(crate) fn paper_stage(progress: &dyn Fn(f64)) -> Result<Dataset, CliError> {
    of_preset(ExampleName::PaperStage, &preset::paper_rate(), progress)
}

fn of_preset(example: ExampleName, stage: &StageConfig, progress: &dyn Fn(f64)) -> Result<Dataset, CliError> {
    let plan = default_campaign(stage.hysteresis.reference_v, SEED);
    record(example.name(), stage, &plan, stage.sample_period_s, SEED, progress)
}

/// A stage of the challenges with these effects, strong, in plays with sigmoid outputs, which no model here has.
fn hidden(example: ExampleName, effects: &[Effect]) -> Result<Made, CliError> {
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
        dataset: Box::new(hysteron_challenge::dataset(case, example.name())),
        truth: in_words(&truth),
    })
}

/// The hidden effects with their parameters.
fn in_words(truth: &Truth) -> String {
    let mut text = format!(
        "{:.1} um at {:.0} V, {:.1} nm of noise",
        truth.stroke_um,
        truth.full_v,
        1e3 * truth.noise_rms_um
    );
    for hidden in &truth.hidden {
        let parameters: Vec<String> = hidden
            .parameters
            .iter()
            .map(|p| format!("{} {} {}", p.name, hysteron_report::significant(p.value), p.unit))
            .collect();
        // Writing to a String does not fail.
        let _ = write!(
            text,
            "; {} ({}), which alone adds {:.1} % of peak to peak to the error",
            hidden.effect.name(),
            parameters.join(", "),
            hidden.contribution_percent
        );
    }
    if truth.hidden.is_empty() {
        text.push_str("; nothing is hidden");
    }
    text
}
