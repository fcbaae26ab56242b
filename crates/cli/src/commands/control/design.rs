//! `hysteron design`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::{Args, ValueEnum};
use hysteron_control::design::feedback::LARGEST_SENSITIVITY;
use hysteron_control::design::prediction::{cost, predict};
use hysteron_control::design::source::{Designed, Source, Wishes, design};
use hysteron_control::design::{Controller, OpenLoop, ReferenceKind};
use hysteron_identify::control::ControlModel;
use hysteron_identify::covered::ToldBy;
use hysteron_identify::{Covered, Model};
use hysteron_plant::preset;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron design records -o controller.toml\n  hysteron design model.toml --volts 0,200 -o controller.toml\n\n\
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
        output::print(&text(args, &designed, &tracked_on)?)?;
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
    Ok(serde_json::json!({
        "file": args.output,
        "effects": undone,
        "model_percent": source.model_percent,
        "model_error_um": controller.model.model_error_um,
        "inverse_misfit_percent": controller.model.misfit_percent,
        "samples_ahead": controller.samples_ahead,
        "bandwidth_hz": quality.bandwidth_hz,
        "predicted": predict(controller, source.model_percent)?,
        "feedback": controller.feedback,
        "open_loop": controller.open_loop,
        "covered": controller.model.covered,
        "cost": cost(controller),
    }))
}

fn text(args: &DesignArgs, source: &Designed, tracked_on: &TrackedOn) -> Result<String, CliError> {
    let controller = &source.controller;
    let model = &controller.model;
    let mut text = String::new();
    // Writing to a String does not fail.
    effects(&mut text, source);
    let _ = writeln!(text, "IDENTIFIED");
    let _ = writeln!(text, "  latency                    {:8.2} us", 1e6 * model.latency_s);
    let _ = writeln!(text, "  amplifier's lag            {:8.2} us", 1e6 * model.linear.lag_s);
    for (i, mode) in model.linear.modes.iter().enumerate() {
        let _ = writeln!(
            text,
            "  mode {}                     {:8.1} Hz, damping ratio {:.4}, share {:.3}",
            i + 1,
            mode.frequency_hz,
            mode.damping,
            mode.share
        );
    }
    let shares = &model.creep.shares;
    let mean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
    let decades =
        (model.creep.tau_s.last().copied().unwrap_or(1.0) / model.creep.tau_s.first().copied().unwrap_or(1.0)).log10()
            / (shares.len().max(2) - 1) as f64;
    if mean > 0.0 && source.undone.is_empty() {
        let _ = writeln!(
            text,
            "  creep                      {:8.2} % a decade",
            100.0 * mean / decades
        );
    } else if mean > 0.0 {
        let sum = shares.iter().sum::<f64>();
        let _ = writeln!(
            text,
            "  creep                      {:8.2} % in the long run",
            100.0 * sum
        );
    }
    let _ = writeln!(
        text,
        "  inverse of the hysteresis  {:8.3} % of the command's range missed on the records",
        model.misfit_percent
    );
    let quality = controller.preview_quality()?;
    let _ = writeln!(text, "FEEDFORWARD");
    let _ = writeln!(
        text,
        "  reference {} samples ahead; latency and modes undone within {:.2} % to 500 Hz, {:.2} % to 1 kHz; 3 dB and 30 degrees to {:.0} Hz",
        controller.samples_ahead,
        100.0 * quality.worst_to_500_hz,
        100.0 * quality.worst_to_1_khz,
        quality.bandwidth_hz
    );
    if controller.samples_ahead == 0 {
        let latency_s = model.latency_s;
        let _ = writeln!(
            text,
            "  known no earlier than due, a reference is {:.0} us late: 30 degrees at {:.0} Hz; smooth ones are extrapolated by as much,\n  \
             corners and noise are amplified",
            1e6 * latency_s,
            1.0 / (12.0 * latency_s)
        );
    }
    let _ = writeln!(text, "FEEDBACK");
    match &controller.feedback {
        Some(feedback) => {
            let _ = writeln!(
                text,
                "  integral and {}, {:.0} V/um/s; peak sensitivity {:.2} over modes +-10 %, loop gain 0.6 to 1.3 and a mode wherever\n  \
                 nothing is told: above {:.0} Hz, by {}; run in time on each of these, it comes to rest\n  \
                 disturbances below -3 dB to {:.0} Hz, helps to {:.0} Hz; {:.2} nm at rest for 1 nm of white sensor noise",
                feedback.structure,
                feedback.integral_v_per_um_s,
                feedback.peak_sensitivity,
                feedback.told_to_hz,
                told_by(&model.covered),
                feedback.rejection_hz,
                feedback.helps_to_hz,
                feedback.noise_nm
            );
        }
        None => text.push_str(&without_feedback(args, controller)),
    }
    expected(&mut text, source, controller)?;
    covered(&mut text, &model.covered);
    let path = args.output.display();
    let on = match tracked_on {
        TrackedOn::Model(model) => format!("--model {}", model.display()),
        TrackedOn::Preset(name) => format!("--stage {name}"),
        TrackedOn::Board => "--board HOST:PORT".to_owned(),
    };
    let _ = writeln!(text, "written to {path}\nnext: hysteron track {path} {on}");
    Ok(text)
}

/// Who tells the stage up to the highest frequency.
fn told_by(covered: &Covered) -> String {
    match covered.told_by() {
        Some(ToldBy::Record(file)) => format!("the record {file}"),
        Some(ToldBy::User) | None => "--rigid, your word".to_owned(),
    }
}

/// Why there is no feedback, and what would allow it.
fn without_feedback(args: &DesignArgs, controller: &Controller) -> String {
    let margin = args.margin;
    match controller.open_loop {
        Some(OpenLoop::NotAsked) | None => "  none: not asked for\n".to_owned(),
        Some(OpenLoop::NotTold) => format!(
            "  none: no record of small signals tells up to where the stage does what the model says; a mode may be anywhere, and a\n  \
             loop makes it swing. Record one beside the others and fit again, such as\n    {}\n  \
             or give your word that there is no mode below HZ but those of the model: --rigid HZ\n",
            small_multisine(&controller.model)
        ),
        Some(OpenLoop::NoneRobust) => format!(
            "  none: no loop keeps its peak sensitivity below {margin} over modes +-10 %, loop gain 0.6 to 1.3 and a mode above\n  \
             {:.0} Hz, where nothing is told; a larger --margin, or a record of small signals to higher frequencies, may allow one\n",
            controller.model.covered.told_to_hz().unwrap_or(f64::NAN)
        ),
        Some(OpenLoop::Swings) => "  none: every loop that was designed swings when it is run in time on the model with modes +-10 % and loop gain \
             0.6 to 1.3;\n  a smaller --margin may give one that holds\n"
            .to_owned(),
    }
}

/// The record that would allow a loop, as an excitation: 3 % of the range about its middle, to an eighth of the controller's rate.
fn small_multisine(model: &ControlModel) -> String {
    let [low_v, high_v] = model
        .covered
        .voltage_v
        .unwrap_or([model.voltage_min_v, model.voltage_max_v]);
    format!(
        "multisine:low_hz=20,high_hz={:.0},period_s=0.1,periods=8,bias_v={:.4},peak_v={:.3}",
        0.125 / model.sample_period_s,
        0.5 * (low_v + high_v),
        0.03 * (high_v - low_v)
    )
}

/// What the records cover, and what leaves them.
fn covered(text: &mut String, covered: &Covered) {
    let pair = |ends: Option<[f64; 2]>, unit: &str| {
        ends.map_or_else(
            || "not known".to_owned(),
            |[low, high]| format!("{low:.4} to {high:.4} {unit}"),
        )
    };
    let one = |value: Option<f64>, unit: &str| {
        value.map_or_else(|| "not known".to_owned(), |value| format!("{value:.0} {unit}"))
    };
    // Writing to a String does not fail.
    let _ = writeln!(
        text,
        "COVERED by the records: {}, {}; slew to {}, rate {}, small signals to {}",
        pair(covered.voltage_v, "V"),
        pair(covered.position_um, "um"),
        one(covered.slew_v_per_s, "V/s"),
        one(covered.sample_rate_hz, "Hz"),
        one(covered.small_signal.as_ref().map(|band| band.up_to_hz), "Hz")
    );
    for beyond in &covered.beyond {
        let _ = writeln!(text, "  BEYOND THE RECORDS: {beyond}");
    }
}

/// Each effect of the model with its compensator, or why it has none.
fn effects(text: &mut String, source: &Designed) {
    if source.undone.is_empty() {
        return;
    }
    text.push_str("EFFECTS\n");
    for undone in &source.undone {
        let by = undone.by.unwrap_or("LEFT OUT");
        let _ = writeln!(text, "  {:<26} {by}: {}", undone.part, undone.note);
    }
}

/// What the controller will reach, what limits it, and what it costs.
fn expected(text: &mut String, source: &Designed, controller: &Controller) -> Result<(), CliError> {
    text.push_str("EXPECTED, sine over the whole range, % of peak to peak\n");
    for p in predict(controller, source.model_percent)? {
        let closed = p
            .closed_percent
            .map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}"));
        let _ = writeln!(
            text,
            "  {:>5} Hz  open {:.3}, closed {closed}; most of it from {}",
            p.frequency_hz, p.open_percent, p.limited_by
        );
    }
    if let (None, Some(rms_um)) = (&controller.feedback, controller.model.model_error_um) {
        let _ = writeln!(
            text,
            "  the model misses its records by up to {rms_um:.4} um rms, which a board allows for before it takes the stage for another"
        );
    }
    if source.model_percent.is_none() {
        text.push_str(
            "  the model's own error is not in the file and not counted; hysteron compare or add measures it\n",
        );
    }
    let costs = cost(controller);
    let total: usize = costs.iter().map(|cost| cost.operations).sum();
    let _ = writeln!(text, "COST A TICK  {total} multiply-adds and compares");
    for cost in &costs {
        let _ = writeln!(text, "  {:<36} {:>4}", cost.block, cost.operations);
    }
    Ok(())
}
