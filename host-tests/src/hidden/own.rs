//! Effects outside of the catalogue, described by effect files as a user who suspects them would write them.

use super::Example;
use hysteron_diagnose::{add_own, diagnose, diagnose_with};
use hysteron_identify::effects::{Effect as _, EffectError, UserEffect};
use hysteron_identify::{Added, FitOptions, IdentifyError, Model, fit};
use hysteron_plant::challenge::Effect;

/// What is suspected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// An encoder's ripple: memoryless, a sine of the position.
    Ripple,
    /// Plays that forget: four states.
    ForgetfulPlays,
}

impl Subject {
    /// What the plant hides.
    pub fn hidden(self) -> Effect {
        match self {
            Self::Ripple => Effect::ScaleRipple,
            Self::ForgetfulPlays => Effect::MemoryLeak,
        }
    }

    /// The worked example of the documentation, with bounds that suit the stage: a user knows stroke and voltage.
    ///
    /// # Errors
    /// As [`UserEffect::from_toml`].
    pub fn file(self, example: &Example) -> Result<UserEffect, EffectError> {
        let (stroke_um, full_v) = (example.truth.stroke_um, example.truth.full_v);
        let text = match self {
            // Lines a twentieth to a quarter of the stroke apart.
            Self::Ripple => include_str!("../../../docs/effects/encoder-ripple.toml")
                .replace("min = 0.5", &format!("min = {}", stroke_um / 20.0))
                .replace("max = 2.0", &format!("max = {}", stroke_um / 4.0)),
            // Of the gain a tenth, as much as ten of it; plays up to six tenths of the voltage.
            Self::ForgetfulPlays => include_str!("../../../docs/effects/forgetful-plays.toml")
                .replace("min = 5.0", &format!("min = {}", 0.05 * full_v))
                .replace("max = 60.0", &format!("max = {}", 0.6 * full_v))
                .replace("min = -0.2", &format!("min = {}", -2.0 * stroke_um / full_v))
                .replace("max = 0.2", &format!("max = {}", 2.0 * stroke_um / full_v)),
        };
        UserEffect::from_toml(&text, "own.toml")
    }
}

/// What the tool says without and with the file.
#[derive(Debug, Clone)]
pub struct Answers {
    /// Verdict without it.
    pub without: String,
    /// Verdict with it.
    pub with: String,
    /// Its place in the ranking, from 0, its statistic, and whether it is significant.
    pub ranked: Option<(usize, f64, f64, bool)>,
    /// Further names.
    pub also: Vec<String>,
    /// Validation error before and after `add`, percent of peak to peak.
    pub error_percent: Option<(f64, f64)>,
    /// What was fitted.
    pub parameters: String,
    /// Seconds for the two diagnoses and `add`.
    pub took_s: [f64; 3],
}

/// The start model of an example.
///
/// # Errors
/// As [`fit()`].
pub fn start(example: &Example) -> Result<Model, IdentifyError> {
    Ok(fit(&example.dataset, &FitOptions::new(example.start), &|_| {})?.model)
}

/// Asks the tool, without the file and with it; adds the effect where asked.
///
/// # Errors
/// As [`fit()`] and [`add_own`].
pub fn answers(example: &Example, subject: Subject, add: bool) -> Result<Answers, IdentifyError> {
    let own = subject.file(example)?;
    let model = start(example)?;
    let clock = std::time::Instant::now();
    let without = diagnose(&example.dataset, &model, &|_, _| {});
    let first_s = clock.elapsed().as_secs_f64();
    let with = diagnose_with(&example.dataset, &model, &[own], &|_, _| {})?;
    let second_s = clock.elapsed().as_secs_f64() - first_s;
    let added: Option<Added> = if add {
        Some(add_own(&example.dataset, &model, own, &|_| {})?)
    } else {
        None
    };
    let third_s = clock.elapsed().as_secs_f64() - first_s - second_s;
    let at = with.ranking.iter().position(|r| r.effect == own.name());
    Ok(Answers {
        without: without.verdict.to_string(),
        with: with.verdict.to_string(),
        ranked: at.map(|at| {
            let entry = &with.ranking[at];
            (at, entry.statistic, entry.share, entry.significant)
        }),
        also: with
            .also_possible
            .iter()
            .chain(&with.further)
            .map(ToString::to_string)
            .collect(),
        error_percent: added
            .as_ref()
            .and_then(|a| a.before.validate_percent.zip(a.after.validate_percent)),
        parameters: format!(
            "{:?} {:?}",
            at.map(|at| with.ranking[at].parameters.iter().map(|p| p.value).collect::<Vec<_>>()),
            added.map(|a| a
                .model
                .effects
                .last()
                .map(|e| e.parameters.iter().map(|p| p.value).collect::<Vec<_>>()))
        ),
        took_s: [first_s, second_s, third_s],
    })
}
