//! `hysteron rehearse`: the whole way on a stage with something hidden in it, the tracking error before and after.

mod text;

use crate::commands::board::EmulatorName;
use crate::commands::fit::ModelName;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::{Dataset, Overwrite, write_dataset};
use hysteron_identify::FitOptions;
use hysteron_tracking::rehearsal::{Hidden, Rehearsal};
use hysteron_trials::chip::Chip;
use hysteron_trials::rehearsal::{Ground, Phase, Rehearsing, rehearse};
use indicatif::ProgressBar;
use std::path::PathBuf;
use std::sync::Mutex;

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
    let bars = Bars::default();
    let Rehearsing {
        rehearsed,
        records,
        model,
        trained,
    } = rehearse(&ground, &rehearsal, &options, &|phase, what, share| {
        bars.show(phase, what, share);
    })?;
    bars.clear();
    if let Some(folder) = &args.output {
        write_dataset(&records, &folder.join("records"), Overwrite::Allow)?;
        model.write(&folder.join("model.toml"))?;
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

/// A bar for each phase, one at a time.
#[derive(Default)]
struct Bars(Mutex<Option<(Phase, ProgressBar)>>);

impl Bars {
    fn show(&self, phase: Phase, what: &str, share: f64) {
        // A bar is whole whatever happened to who held it.
        let mut held = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if held.as_ref().is_none_or(|(shown, _)| *shown != phase) {
            let label = match phase {
                Phase::Recording => "recording",
                Phase::Learning => "learning",
                Phase::Tracking => "tracking",
            };
            let before = held.replace((phase, progress::bar(label)));
            before.inspect(|(_, bar)| bar.finish_and_clear());
        }
        if let Some((_, bar)) = held.as_ref() {
            progress::show(bar, what, share);
        }
    }

    fn clear(self) {
        let held = self.0.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        held.inspect(|(_, bar)| bar.finish_and_clear());
    }
}
