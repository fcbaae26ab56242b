//! `hysteron rehearse`: the whole way on a stage with something hidden in it, the tracking error before and after.

use crate::commands::fit::ModelName;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::{Overwrite, write_dataset};
use hysteron_diagnose::{Learned, learn_with};
use hysteron_identify::control::{RecordedHold, chain_of};
use hysteron_identify::{FitOptions, Model, fit};
use hysteron_plant::StageConfig;
use hysteron_tracking::design::{Controller, ReferenceKind};
use hysteron_tracking::rehearsal::{Hidden, Rehearsal};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron rehearse resonance --seed 7 -o rehearsal\n\n\
    A stage is drawn from the seed and the effect is hidden in it. It is recorded, a model is learned from the records alone\n\
    (stage and model share no code), a controller is designed from the model of each step and tracks references on the stage:\n\
    errors of the true position, rms, % of the references' range, nothing shifted. Then the truth is revealed.")]
pub(crate) struct RehearseArgs {
    /// delay, first-order-lag, resonance, creep, cross-coupling or mains-hum
    pub effect: String,
    /// Seed of stage, effect and noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The hysteresis model to start from; mpi leaves 1 to 4 % of the range where a stage's loops change with the bias
    #[arg(long, value_enum, default_value_t = ModelName::PlayPolynomial)]
    pub model: ModelName,
    /// Number of play operators, 1 to 64
    #[arg(long, default_value_t = 12)]
    pub plays: usize,
    /// Folder for records, model.toml and controller.toml
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// A step of the ladder from both sides.
#[derive(Serialize)]
struct Rung {
    effects: Vec<String>,
    /// Error of the model on records it was not fitted to, percent of peak to peak.
    model_percent: Option<f64>,
    #[serde(rename = "loop")]
    loop_kind: &'static str,
    /// Error of the true position, percent of the references' range; none where the model has no inverse.
    tracking_percent: Option<BTreeMap<String, f64>>,
    /// Why it has none.
    refused: Option<String>,
}

#[derive(Serialize)]
struct Rehearsed {
    effect: &'static str,
    seed: u64,
    named: bool,
    rungs: Vec<Rung>,
    /// The last model with the compensator of the hidden effect left out, open loop.
    without_compensator_percent: Option<BTreeMap<String, f64>>,
    /// The first model's kind of controller on the same stage with nothing hidden in it.
    without_effect_percent: Option<BTreeMap<String, f64>>,
    truth: String,
}

pub(crate) fn run(args: &RehearseArgs) -> Result<Done, CliError> {
    let hidden = Hidden::named(&args.effect).ok_or_else(|| {
        CliError::Option(format!(
            "there is no effect `{}` to hide; there are {}",
            args.effect,
            Hidden::ALL.map(Hidden::name).join(", ")
        ))
    })?;
    let rehearsal = Rehearsal::draw(hidden, args.seed)?;
    let options = FitOptions {
        plays: args.plays,
        ..FitOptions::new(args.model.into())
    };
    let records = rehearsal.records(&rehearsal.stage)?;
    let bar = progress::bar("learning");
    let learned = learn_with(&records, &options, &[], &|what, share| {
        if bar.message() != what {
            bar.set_message(what.to_owned());
        }
        progress::advance(&bar, share);
    })?;
    bar.finish_and_clear();
    let rehearsed = Rehearsed {
        effect: hidden.name(),
        seed: args.seed,
        named: learned.model.effects.iter().any(|effect| effect.name == hidden.name()),
        rungs: rungs(&rehearsal, &learned)?,
        without_compensator_percent: without_compensator(&rehearsal, &learned.model)?,
        without_effect_percent: floor(&rehearsal, &learned.model)?,
        truth: rehearsal.truth.clone(),
    };
    if let Some(folder) = &args.output {
        write_dataset(&records, &folder.join("records"), Overwrite::Allow)?;
        learned.model.write(&folder.join("model.toml"))?;
        // The table says why there is none.
        if let Ok(controller) = design(&rehearsal.stage, &learned.model) {
            output::write_file(&folder.join("controller.toml"), &controller.with_feedback().to_toml()?)?;
        }
    }
    if args.json {
        output::print_json(&rehearsed)?;
    } else {
        output::print(&text(&rehearsed))?;
    }
    Ok(Done::Answered)
}

fn design(stage: &StageConfig, model: &Model) -> Result<Controller, CliError> {
    let limits = [stage.amplifier.min_v, stage.amplifier.max_v];
    let (chain, _) = chain_of(model, stage.sample_period_s, limits, RecordedHold::AccountedFor)?;
    Ok(Controller::design(&chain, ReferenceKind::Previewed)?)
}

/// A controller from the model of each step, open loop; from the first and the last with feedback, too.
fn rungs(rehearsal: &Rehearsal, learned: &Learned) -> Result<Vec<Rung>, CliError> {
    let last = learned.rungs.len().saturating_sub(1);
    let mut rungs = Vec::new();
    for (i, model) in learned.rungs.iter().enumerate() {
        // The first model has no history yet: it stands as the first step in that of the last.
        let step = learned.model.history.first().filter(|_| i == 0);
        let mut rung = |loop_kind, controller: Result<Controller, String>| -> Result<(), CliError> {
            let (tracking_percent, refused) = match controller {
                Ok(controller) => (Some(rehearsal.errors(&rehearsal.stage, &controller)?), None),
                Err(reason) => (None, Some(reason)),
            };
            rungs.push(Rung {
                effects: model.effects.iter().map(|effect| effect.name.clone()).collect(),
                model_percent: step.or(model.history.last()).and_then(|step| step.validate_percent),
                loop_kind,
                tracking_percent,
                refused,
            });
            Ok(())
        };
        let open = design(&rehearsal.stage, model).map_err(|refusal| refusal.to_string());
        rung("open", open.clone())?;
        if i == last {
            rung("closed", open.map(Controller::with_feedback))?;
        }
    }
    Ok(rungs)
}

/// The same hysteresis and the same other effects, this one not undone.
fn without_compensator(rehearsal: &Rehearsal, model: &Model) -> Result<Option<BTreeMap<String, f64>>, CliError> {
    let mut without = model.clone();
    without.effects.retain(|effect| effect.name != rehearsal.hidden.name());
    match design(&rehearsal.stage, &without) {
        Ok(controller) => Ok(Some(rehearsal.errors(&rehearsal.stage, &controller)?)),
        Err(_) => Ok(None),
    }
}

/// What a controller of the hysteresis alone leaves where nothing is hidden: the effect dominates where it leaves many times more.
fn floor(rehearsal: &Rehearsal, model: &Model) -> Result<Option<BTreeMap<String, f64>>, CliError> {
    let records = rehearsal.records(&rehearsal.bare)?;
    let options = FitOptions {
        plays: model.thresholds.len(),
        ..FitOptions::new(model.family)
    };
    let model = fit(&records, &options, &|_| ())?.model;
    match design(&rehearsal.bare, &model) {
        Ok(controller) => Ok(Some(rehearsal.errors(&rehearsal.bare, &controller)?)),
        Err(_) => Ok(None),
    }
}

fn text(rehearsed: &Rehearsed) -> String {
    const KEYS: [&str; 4] = ["10", "100", "500", "hold"];
    let mut text = format!(
        "a stage drawn from seed {}, one effect hidden; error of the model on records it was not fitted to, of the true position\n\
         against the reference, %\n\n{:<44} {:<6} {:>8}",
        rehearsed.seed, "model", "loop", "model"
    );
    for key in KEYS {
        // Writing to a String does not fail.
        let _ = write!(text, " {key:>8}");
    }
    text.push('\n');
    let mut line =
        |name: &str, kind: &str, model: Option<f64>, errors: Option<&BTreeMap<String, f64>>, refused: &str| {
            let model = model.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}"));
            let _ = write!(text, "{name:<44} {kind:<6} {model:>8}");
            match errors {
                Some(errors) => KEYS.iter().for_each(|key| {
                    let _ = write!(text, " {:>8.3}", errors.get(*key).copied().unwrap_or(f64::NAN));
                }),
                None => text.push_str(&format!(" {refused}")),
            }
            text.push('\n');
        };
    for rung in &rehearsed.rungs {
        let name = if rung.effects.is_empty() {
            "hysteresis".to_owned()
        } else {
            format!("+ {}", rung.effects.join(", "))
        };
        let refused = rung.refused.as_deref().unwrap_or("");
        line(
            &name,
            rung.loop_kind,
            rung.model_percent,
            rung.tracking_percent.as_ref(),
            refused,
        );
    }
    let others: [(&str, &Option<BTreeMap<String, f64>>); 2] = [
        (
            "last model, this compensator left out",
            &rehearsed.without_compensator_percent,
        ),
        (
            "(hysteresis, nothing hidden in the stage)",
            &rehearsed.without_effect_percent,
        ),
    ];
    for (name, errors) in others {
        line(name, "open", None, errors.as_ref(), "the hysteresis has no inverse");
    }
    let _ = writeln!(
        text,
        "\nhidden was: {} ({}); {}",
        rehearsed.effect,
        rehearsed.truth,
        if rehearsed.named { "named" } else { "NOT NAMED" }
    );
    text
}
