//! `hysteron design`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::{Args, ValueEnum};
use hysteron_control::design::ReferenceKind;
use hysteron_control::design::feedback::LARGEST_SENSITIVITY;
use hysteron_control::design::prediction::{cost, predict, whole_stroke_um};
use hysteron_control::design::source::{Designed, Source, Wishes, design};
use hysteron_identify::Model;
use hysteron_plant::preset;
use hysteron_report::design_text;
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron design records -o controller.toml\n  hysteron design model.toml --volts 0,200 -o controller.toml\n  \
    hysteron design model.toml --adapt 5 -o controller.toml          # gain, zero and lag follow it\n\n\
    From the records of `hysteron campaign`, or from a model that `fit`, `add` and `learn` wrote. Every effect brings its\n\
    compensator: latency and modes a filter over the reference ahead, creep and hysteresis their inverses, the amplifier's lag a\n\
    lead, another axis, mains, heat and the sensor's curve their own; feedback on what is left. What has none is named.\n\n\
    The inverse of a model is as good as the model. Slow records along references of the kind that is to be followed, each from\n\
    rest at 0 V, make it several times better where they went:\n  \
    hysteron campaign --board localhost:9090 --training -o slow    # by a board that has the first controller's table\n  \
    hysteron design model.toml --along slow -o better.toml"
)]
pub(crate) struct DesignArgs {
    /// Dataset folder of a campaign, or model.toml
    pub source: PathBuf,
    /// When the reference is known
    #[arg(long, value_enum, default_value_t = ReferenceName::Previewed)]
    pub reference: ReferenceName,
    /// Limits of the command, volts; from a model without them the range of its records
    #[arg(long, value_name = "LOW,HIGH", value_delimiter = ',', num_args = 1)]
    pub volts: Option<Vec<f64>>,
    /// Rate that the controller runs at, hertz; from a model without it the highest of its records
    #[arg(long, value_name = "HZ")]
    pub rate_hz: Option<f64>,
    /// With a model: slow records from rest at 0 V, to whose positions and commands the inverse is fitted as well; may be given several times
    #[arg(long, value_name = "DATASET")]
    pub along: Vec<PathBuf>,
    /// Largest peak of the sensitivity over modes +-10 % and loop gain 0.6 to 1.3, 1.2 to 4: less is more robust and rejects less
    #[arg(long, value_name = "PEAK", default_value_t = LARGEST_SENSITIVITY, conflicts_with = "open")]
    pub margin: f64,
    /// Your word that the stage has no mode below this but those of the model: feedback may go by it where no record of small signals tells
    #[arg(long, value_name = "HZ", conflicts_with = "open")]
    pub rigid: Option<f64>,
    /// Leave what the records cover; the controller remembers it
    #[arg(long)]
    pub beyond_records: bool,
    /// Without feedback
    #[arg(long)]
    pub open: bool,
    /// Let gain, zero and lag follow the stage while the controller runs: the gain by this much at most, percent, such as 5; not without
    #[arg(long, value_name = "PERCENT")]
    pub adapt: Option<f64>,
    /// Where to write the controller
    #[arg(short, long, default_value = "controller.toml")]
    pub output: PathBuf,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReferenceName {
    /// Known 16 samples before it is due: scans, trajectories
    Previewed,
    /// Not known before it is due; smooth and digital, never a measurement
    Live,
}

impl From<ReferenceName> for ReferenceKind {
    fn from(name: ReferenceName) -> Self {
        match name {
            ReferenceName::Previewed => Self::Previewed,
            ReferenceName::Live => Self::Live,
        }
    }
}

/// What a controller is run on next.
enum TrackedOn {
    /// The model that it is designed from.
    Model(PathBuf),
    /// The simulated stage that its records come from.
    Preset(String),
    /// The stage itself.
    Board,
}

pub(crate) fn run(args: &DesignArgs) -> Result<Done, CliError> {
    let wishes = Wishes {
        reference: args.reference.into(),
        volts: volts(args)?,
        rate_hz: args.rate_hz,
        margin: args.margin,
        rigid_hz: args.rigid,
        beyond_records: args.beyond_records,
        open: args.open,
        adapt_percent: args.adapt,
    };
    // Before a file is read: what is wrong with the options is said whatever the file is.
    wishes.check()?;
    let (designed, tracked_on) = if args.source.extension().is_some_and(|ending| ending == "toml") {
        from_model(args, &wishes)?
    } else {
        from_records(args, &wishes)?
    };
    output::write_file(&args.output, &designed.controller.to_toml()?)?;
    if args.json {
        output::print_json(&json(args, &designed)?)?;
    } else {
        output::print(&(design_text(&designed, args.margin)? + &next(args, &tracked_on)))?;
    }
    Ok(Done::Answered)
}

fn volts(args: &DesignArgs) -> Result<Option<[f64; 2]>, CliError> {
    match args.volts.as_deref() {
        Some(&[low, high]) if low.is_finite() && high.is_finite() && low < high => Ok(Some([low, high])),
        Some(given) => Err(CliError::Option(format!(
            "--volts {given:?}: two voltages, the lower first, such as 0,200"
        ))),
        None => Ok(None),
    }
}

fn from_records(args: &DesignArgs, wishes: &Wishes) -> Result<(Designed, TrackedOn), CliError> {
    if !args.along.is_empty() {
        return Err(CliError::Option(
            "--along: a campaign has its own records along references; leave the option out, or design from a model.toml".to_owned(),
        ));
    }
    let dataset = load::dataset(&args.source)?;
    let designed = design(&Source::Records(&dataset), wishes)?;
    let tracked_on = match preset::named(&dataset.name) {
        Some(_) => TrackedOn::Preset(dataset.name),
        None => TrackedOn::Board,
    };
    Ok((designed, tracked_on))
}

fn from_model(args: &DesignArgs, wishes: &Wishes) -> Result<(Designed, TrackedOn), CliError> {
    let model = Model::read(&args.source)?;
    let mut along = Vec::new();
    for path in &args.along {
        along.extend(load::dataset(path)?.records);
    }
    let source = Source::Model {
        model: &model,
        along: &along,
    };
    Ok((design(&source, wishes)?, TrackedOn::Model(args.source.clone())))
}

fn json(args: &DesignArgs, source: &Designed) -> Result<serde_json::Value, CliError> {
    let controller = &source.controller;
    let quality = controller.preview_quality()?;
    let undone: Vec<_> = source
        .undone
        .iter()
        .map(|u| serde_json::json!({"effect": u.part.to_string(), "by": u.by, "note": u.note}))
        .collect();
    let drifts: Vec<_> = source
        .drifts
        .iter()
        .map(|drift| {
            serde_json::json!({
                "record": drift.name,
                "gain_percent": drift.gain_percent.value,
                "zero_um": drift.zero_um.value,
                "warnings": drift.warnings(),
            })
        })
        .collect();
    Ok(serde_json::json!({
        "file": args.output,
        "effects": undone,
        "model_percent": source.model_percent,
        "model_error_um": controller.model.model_error_um,
        "inverse_misfit_percent": controller.model.misfit_percent,
        "samples_ahead": controller.samples_ahead,
        "bandwidth_hz": quality.bandwidth_hz,
        "predicted": predict(controller, whole_stroke_um(controller), source.model_percent)?,
        "feedback": controller.feedback,
        "open_loop": controller.open_loop,
        "covered": controller.model.covered,
        "drifts": drifts,
        "cost": cost(controller),
    }))
}

/// Where the controller is, and what to do with it.
fn next(args: &DesignArgs, tracked_on: &TrackedOn) -> String {
    let path = args.output.display();
    let on = match tracked_on {
        TrackedOn::Model(model) => format!("--model {}", model.display()),
        TrackedOn::Preset(name) => format!("--stage {name}"),
        TrackedOn::Board => "--board HOST:PORT".to_owned(),
    };
    format!("written to {path}\nnext: hysteron track {path} {on}\n")
}
