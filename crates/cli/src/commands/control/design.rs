//! `hysteron design`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::{Args, ValueEnum};
use hysteron_identify::control::identify;
use hysteron_tracking::design::{Controller, ReferenceKind};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron design records -o controller.toml\n\n\
    The dataset is one of `hysteron campaign`. Every effect that is identified gets its compensator: latency and modes a\n\
    filter over the reference ahead, creep and hysteresis their inverses, the amplifier's lag a lead; feedback on what is left.")]
pub(crate) struct DesignArgs {
    /// Dataset folder of a campaign
    pub data: PathBuf,
    /// When the reference is known
    #[arg(long, value_enum, default_value_t = ReferenceName::Previewed)]
    pub reference: ReferenceName,
    /// Where to write the controller
    #[arg(short, long, default_value = "controller.toml")]
    pub output: PathBuf,
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

pub(crate) fn run(args: &DesignArgs) -> Result<Done, CliError> {
    if args.data.extension().is_some_and(|ending| ending == "toml") {
        return Err(CliError::Option(format!(
            "{}: a controller is designed from the records of a campaign, not from a model file, which lacks the linear part; \
             give the folder that `hysteron campaign` wrote",
            args.data.display()
        )));
    }
    let dataset = load::dataset(&args.data)?;
    let model = identify(&dataset)?;
    let controller = Controller::design(&model, args.reference.into())?.with_feedback();
    output::write_file(&args.output, &controller.to_toml()?)?;
    output::print(&text(args, &controller)?)?;
    Ok(Done::Answered)
}

fn text(args: &DesignArgs, controller: &Controller) -> Result<String, CliError> {
    let model = &controller.model;
    let mut text = String::new();
    // Writing to a String does not fail.
    let _ = writeln!(text, "IDENTIFIED");
    let _ = writeln!(
        text,
        "  latency of the controller  {:8.2} us (known)",
        1e6 * model.latency_s
    );
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
    let _ = writeln!(
        text,
        "  creep                      {:8.2} % a decade",
        100.0 * mean / decades
    );
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
    let _ = writeln!(text, "FEEDBACK");
    match &controller.feedback {
        Some(feedback) => {
            let _ = writeln!(
                text,
                "  integral and {}, {:.0} V/um/s; peak sensitivity {:.2} over modes +-10 % and loop gain 0.6 to 1.3\n  \
                 disturbances below -3 dB to {:.0} Hz, helps to {:.0} Hz; {:.2} nm at rest for 1 nm of white sensor noise",
                feedback.structure,
                feedback.integral_v_per_um_s,
                feedback.peak_sensitivity,
                feedback.rejection_hz,
                feedback.helps_to_hz,
                feedback.noise_nm
            );
        }
        None => text.push_str(
            "  none: no loop keeps its peak sensitivity below 2 over modes +-10 % and loop gain 0.6 to 1.3\n",
        ),
    }
    let path = args.output.display();
    let _ = writeln!(text, "written to {path}\nnext: hysteron track {path} --stage PRESET");
    Ok(text)
}
