//! `hysteron rehearse`: the whole way on a stage with something hidden in it, the tracking error before and after.

mod chip;
mod rows;
mod text;

use crate::commands::board::EmulatorName;
use crate::commands::control::chip::{Chip, Reached};
use crate::commands::fit::ModelName;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_control::design::{Controller, ReferenceKind};
use hysteron_data::{Dataset, Overwrite, Record, write_dataset};
use hysteron_diagnose::{Learned, learn_with};
use hysteron_identify::control::{ControlModel, RecordedHold, chain_of, refine};
use hysteron_identify::{EffectName, FitOptions, Model, fit, present_step};
use hysteron_plant::StageConfig;
use hysteron_tracking::rehearsal::{Hidden, Rehearsal};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron rehearse resonance --seed 7 -o rehearsal\n  \
    hysteron rehearse delay --emulator mps2-an386 -o rehearsal\n\n\
    A stage is drawn from the seed and the effect is hidden in it. It is recorded, a model is learned from the records alone\n\
    (stage and model share no code), a controller is designed from the model of each step and tracks references on the stage:\n\
    errors of the true position, rms, % of the references' range, nothing shifted. The last one plays slow references of its own\n\
    (7 s), and its inverse is fitted to what came back as well: `trained`. Then the truth is revealed.")]
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
    #[arg(long, default_value_t = 16)]
    pub plays: usize,
    /// Record and track with the firmware in QEMU instead of on the host: a plain image plays the records, and an image is built for
    /// each controller
    #[arg(long, value_enum)]
    pub emulator: Option<EmulatorName>,
    /// The firmware's sources
    #[arg(long, value_name = "FOLDER", default_value = "firmware", requires = "emulator")]
    pub firmware: PathBuf,
    /// Folder for records, slow records, model.toml and controller.toml; with an emulator for tables and images, too
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// A step of the ladder from both sides.
#[derive(Serialize)]
struct Rung {
    effects: Vec<EffectName>,
    /// Whether the inverse was fitted to records along references as well.
    trained: bool,
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
    /// The machine that recorded and tracked; none on the host.
    emulator: Option<&'static str>,
    named: bool,
    rungs: Vec<Rung>,
    /// The last controller with the compensator of the hidden effect left out, open loop.
    without_compensator_percent: Option<BTreeMap<String, f64>>,
    /// The same with the feedback that is designed without it, on the host; more than 100 % is a loop that swings.
    without_compensator_closed_percent: Option<BTreeMap<String, f64>>,
    /// The first model's kind of controller, trained, on the same stage with nothing hidden in it.
    without_effect_percent: Option<BTreeMap<String, f64>>,
    /// Beside an emulator: the last controller, open loop, by the host's law in `f64`.
    host_percent: Option<BTreeMap<String, f64>>,
    /// Ticks of an emulator at the sample clock; the others were worked out ahead and compared bit by bit.
    clocked_ticks: u32,
    /// Of these the late and lost ones.
    late_ticks: u32,
    truth: String,
}

/// Where records and runs are made.
enum Ground {
    /// The law in `f64` at the simulated stage.
    Host,
    /// The firmware in QEMU at the simulated stage.
    Board(Box<Chip>),
}

impl Ground {
    fn records(&self, rehearsal: &Rehearsal) -> Result<Dataset, CliError> {
        match self {
            Self::Host => Ok(rehearsal.records(&rehearsal.stage)?),
            Self::Board(chip) => chip::records(chip, rehearsal),
        }
    }

    fn training(&self, rehearsal: &Rehearsal, controller: &Controller) -> Result<Vec<Record>, CliError> {
        match self {
            Self::Host => Ok(rehearsal.training(&rehearsal.stage, controller)?),
            Self::Board(chip) => chip::training(chip, rehearsal, controller),
        }
    }

    fn errors(&self, rehearsal: &Rehearsal, controller: &Controller, name: &str) -> Result<Reached, CliError> {
        match self {
            Self::Host => Ok(Reached {
                percent: rehearsal.errors(&rehearsal.stage, controller)?,
                ..Reached::default()
            }),
            Self::Board(chip) => chip::errors(chip, rehearsal, controller, name),
        }
    }
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
    let ground = match args.emulator {
        None => Ground::Host,
        Some(emulator) => {
            let folder = args.output.as_ref().map(|folder| folder.join("board"));
            let chip = Chip::new(emulator.machine(), &args.firmware, folder)?;
            Ground::Board(Box::new(chip))
        }
    };
    let options = FitOptions {
        plays: args.plays,
        ..FitOptions::new(args.model.into())
    };
    let records = ground.records(&rehearsal)?;
    let bar = progress::bar("learning");
    let learned = learn_with(&records, &options, &[], &|what, share| {
        if bar.message() != what {
            bar.set_message(what.to_owned());
        }
        progress::advance(&bar, share);
    })?;
    bar.finish_and_clear();
    let (rehearsed, trained) = rehearsed(&ground, &rehearsal, &records, &learned)?;
    if let Some(folder) = &args.output {
        write_dataset(&records, &folder.join("records"), Overwrite::Allow)?;
        learned.model.write(&folder.join("model.toml"))?;
        // The table says why there is none.
        if let Some(trained) = trained {
            output::write_file(&folder.join("controller.toml"), &trained.controller.to_toml()?)?;
            let slow = Dataset {
                name: format!("{}-slow", records.name),
                records: trained.records,
                ..records
            };
            write_dataset(&slow, &folder.join("slow"), Overwrite::Allow)?;
        }
    }
    if args.json {
        output::print_json(&rehearsed)?;
    } else {
        output::print(&text::text(&rehearsed))?;
    }
    Ok(Done::Answered)
}

fn chain(stage: &StageConfig, model: &Model) -> Result<ControlModel, CliError> {
    let limits = [stage.amplifier.min_v, stage.amplifier.max_v];
    let (chain, _) = chain_of(model, stage.sample_period_s, limits, RecordedHold::AccountedFor)?;
    Ok(chain)
}

/// The model with a history: one that nothing was added to has none yet, and is measured on the records.
fn told(records: &Dataset, model: &Model) -> Model {
    let mut told = model.clone();
    if told.history.is_empty() {
        told.history.push(present_step(records, model));
    }
    told
}

fn design(chain: &ControlModel) -> Result<Controller, CliError> {
    Ok(Controller::design(chain, ReferenceKind::Previewed)?)
}

/// A controller from the model of each step, open loop; the last one trained, open loop and closed, and without the compensator.
/// With that one, where there is one.
fn rehearsed(
    ground: &Ground,
    rehearsal: &Rehearsal,
    records: &Dataset,
    learned: &Learned,
) -> Result<(Rehearsed, Option<Trained>), CliError> {
    let hidden = rehearsal.hidden.effect();
    let mut rehearsed = Rehearsed {
        effect: hidden.name(),
        seed: rehearsal.seed,
        emulator: match ground {
            Ground::Host => None,
            Ground::Board(chip) => Some(chip.name()),
        },
        named: learned.model.effects.iter().any(|effect| effect.name == hidden),
        rungs: Vec::new(),
        without_compensator_percent: None,
        without_compensator_closed_percent: None,
        without_effect_percent: floor(rehearsal, &learned.model)?,
        host_percent: None,
        clocked_ticks: 0,
        late_ticks: 0,
        truth: rehearsal.truth.clone(),
    };
    let rungs = learned.rungs.iter().enumerate();
    let model_percent = |model: &Model| model.history.last().and_then(|step| step.validate_percent);
    let bar = progress::bar("tracking");
    let steps = (learned.rungs.len() + 3) as f64;
    for (i, model) in rungs {
        let model = &told(records, model);
        let open = chain(&rehearsal.stage, model).and_then(|chain| design(&chain));
        rehearsed.climb(
            ground,
            rehearsal,
            open.as_ref().map_err(ToString::to_string),
            Climbed {
                model,
                model_percent: model_percent(model),
                name: format!("step-{i}-open"),
                trained: false,
            },
        )?;
        progress::advance(&bar, (i + 1) as f64 / steps);
    }
    let model = &told(records, &learned.model);
    let Ok(mut trained) = chain(&rehearsal.stage, model) else {
        return Ok((rehearsed, None));
    };
    let last = design(&trained)?;
    let slow = ground.training(rehearsal, &last)?;
    refine(&mut trained, model, &slow)?;
    let open = design(&trained)?;
    let closed = open.clone().with_feedback()?;
    for (controller, name) in [(&open, "trained-open"), (&closed, "trained-closed")] {
        rehearsed.climb(
            ground,
            rehearsal,
            Ok(controller),
            Climbed {
                model,
                model_percent: model_percent(model),
                name: name.to_owned(),
                trained: true,
            },
        )?;
    }
    progress::advance(&bar, 1.0 - 1.0 / steps);
    if rehearsed.emulator.is_some() {
        rehearsed.host_percent = Some(rehearsal.errors(&rehearsal.stage, &open)?);
    }
    // The same hysteresis and the same other effects, this one not undone.
    let mut without = model.clone();
    without.effects.retain(|effect| effect.name != hidden);
    // Its loop may go as far as its own records tell, not as those of the whole model.
    without.cover(records);
    // What it misses on them is its own, too.
    without.history.clear();
    let without = told(records, &without);
    if let Ok(mut without) = chain(&rehearsal.stage, &without) {
        without.inverse = trained.inverse;
        let controller = design(&without)?;
        rehearsed.without_compensator_percent = Some(ground.errors(rehearsal, &controller, "without")?.percent);
        if rehearsed.emulator.is_none() {
            let closed = controller.with_feedback()?;
            rehearsed.without_compensator_closed_percent = Some(rehearsal.errors(&rehearsal.stage, &closed)?);
        }
    }
    bar.finish_and_clear();
    let trained = Trained {
        controller: closed,
        records: slow,
    };
    Ok((rehearsed, Some(trained)))
}

/// The last controller, and the slow records that its inverse was fitted to.
struct Trained {
    controller: Controller,
    records: Vec<Record>,
}

/// What a rung of the ladder stands for.
struct Climbed<'a> {
    model: &'a Model,
    model_percent: Option<f64>,
    /// Of its image.
    name: String,
    trained: bool,
}

impl Rehearsed {
    /// Tracks with a controller, or says why there is none.
    fn climb(
        &mut self,
        ground: &Ground,
        rehearsal: &Rehearsal,
        controller: Result<&Controller, String>,
        climbed: Climbed<'_>,
    ) -> Result<(), CliError> {
        let closed = controller
            .as_ref()
            .is_ok_and(|controller| controller.feedback.is_some());
        let (tracking_percent, refused) = match controller {
            Ok(controller) => {
                let reached = ground.errors(rehearsal, controller, &climbed.name)?;
                self.clocked_ticks += reached.clocked_ticks;
                self.late_ticks += reached.late_ticks;
                (Some(reached.percent), None)
            }
            Err(reason) => (None, Some(reason)),
        };
        self.rungs.push(Rung {
            effects: climbed.model.effects.iter().map(|effect| effect.name.clone()).collect(),
            trained: climbed.trained,
            model_percent: climbed.model_percent,
            loop_kind: if closed { "closed" } else { "open" },
            tracking_percent,
            refused,
        });
        Ok(())
    }
}

/// What a trained controller of the hysteresis alone leaves on the host where nothing is hidden: the effect dominates where it leaves
/// many times more.
fn floor(rehearsal: &Rehearsal, model: &Model) -> Result<Option<BTreeMap<String, f64>>, CliError> {
    let records = rehearsal.records(&rehearsal.bare)?;
    let options = FitOptions {
        plays: model.thresholds.len(),
        ..FitOptions::new(model.family)
    };
    let model = fit(&records, &options, &|_| ())?.model;
    let Ok(mut trained) = chain(&rehearsal.bare, &model) else {
        return Ok(None);
    };
    let records = rehearsal.training(&rehearsal.bare, &design(&trained)?)?;
    refine(&mut trained, &model, &records)?;
    Ok(Some(rehearsal.errors(&rehearsal.bare, &design(&trained)?)?))
}
