//! `hysteron drive`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::Args;
use hysteron_control::design::Controller;
use hysteron_control::design::beyond::{self, Asked};
use hysteron_control::drive::{Driven, drive};
use hysteron_control::message::Setting;
use hysteron_data::export::{Column, TableFormat, Values, write_table};
use hysteron_data::{Reference, read_reference};
use hysteron_identify::family;
use hysteron_table::short;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron drive controller.toml scan.csv -o volts.csv\n  \
    hysteron drive controller.toml scan.csv --model model.toml -o volts.csv    # and where the model goes\n\n\
    The reference is a CSV with the header time_s,reference_um (or _ms, _nm, ...), sampled at the controller's rate. The stage rests at\n\
    0 V before it; where the reference begins elsewhere, a rise of 20 ms leads there. The table has time_s, reference_um (what is due in\n\
    that row) and voltage_v, at the actuator; its first rows come before the first sample is due, as early as the law knows it.\n\
    Without --model the feedforward alone is written: feedback has nothing to read. With it the loop is run on the model, and its\n\
    position is in model_um. The other axis and the temperature stand still.")]
pub(crate) struct DriveArgs {
    /// Controller file of `hysteron design`
    pub controller: PathBuf,
    /// The reference, a CSV with time_s,reference_um
    pub reference: PathBuf,
    /// The table to write; its ending says the format: .csv, .npz or .parquet
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// An identified model of the stage, model.toml: the loop is closed on it where the controller has feedback
    #[arg(long, value_name = "MODEL")]
    pub model: Option<PathBuf>,
    /// References beyond the positions that the records cover
    #[arg(long)]
    pub beyond_records: bool,
}

pub(crate) fn run(args: &DriveArgs) -> Result<Done, CliError> {
    let format = TableFormat::of(&args.output)?;
    let controller = Controller::read(&args.controller)?;
    let model = args.model.as_deref().map(load::model).transpose()?;
    let (reference, notices) = read_reference(&args.reference)?;
    load::say(&notices);
    same_rate(args, &controller, &reference)?;
    let (low_um, high_um) = family::range(reference.reference_um.iter().copied());
    beyond::granted(
        &mut controller.model.covered.clone(),
        &[Asked::position(&[low_um, high_um], Setting::Reference)],
        args.beyond_records,
    )?;
    let driven = drive(&controller, &reference.reference_um, model.as_ref())?;
    write_table(&args.output, format, &columns(&driven, &reference))?;
    output::print(&text(args, &controller, reference.rate_hz(), &driven))?;
    Ok(match &driven.modelled {
        Some(modelled) if !modelled.stable => Done::Unstable,
        _ => Done::Answered,
    })
}

/// A law's numbers belong to its rate. Stamps of a microsecond's digits give a period of 20 us to a few millionths.
const SAME_RATE: f64 = 1e-5;

fn same_rate(args: &DriveArgs, controller: &Controller, reference: &Reference) -> Result<(), CliError> {
    let (found_s, wanted_s) = (reference.period_s, controller.model.sample_period_s);
    if (found_s / wanted_s - 1.0).abs() <= SAME_RATE {
        return Ok(());
    }
    Err(CliError::Option(format!(
        "{}: sampled at {} Hz, and the controller runs at {} Hz; sample the reference at the controller's rate",
        args.reference.display(),
        short(reference.rate_hz()),
        short(1.0 / wanted_s)
    )))
}

fn columns(driven: &Driven, reference: &Reference) -> Vec<Column> {
    let numbers = |name: &str, values: &[f64]| Column {
        name: name.to_owned(),
        values: Values::Numbers(values.to_vec()),
    };
    let time_s: Vec<f64> = (0..driven.command_v.len())
        .map(|k| reference.start_s + (k as f64 - driven.before as f64) * reference.period_s)
        // To the picosecond: no digits of rounding.
        .map(|time_s| (time_s * 1e12).round() / 1e12)
        .collect();
    let mut columns = vec![
        numbers("time_s", &time_s),
        numbers("reference_um", &driven.due_um),
        numbers("voltage_v", &driven.command_v),
    ];
    if let Some(modelled) = &driven.modelled {
        columns.push(numbers("model_um", &modelled.position_um));
    }
    columns
}

fn text(args: &DriveArgs, controller: &Controller, rate_hz: f64, driven: &Driven) -> String {
    let period_s = controller.model.sample_period_s;
    let (low_v, high_v) = family::range(driven.command_v.iter().copied());
    let mut text = String::new();
    // Writing to a String does not fail.
    let _ = writeln!(
        text,
        "{} rows at {} Hz, the first {:.3} ms before the reference begins; {low_v:.3} to {high_v:.3} V of {:.3} to {:.3} V",
        driven.command_v.len(),
        short(rate_hz),
        1e3 * driven.before as f64 * period_s,
        controller.model.voltage_min_v,
        controller.model.voltage_max_v
    );
    if driven.rise > 0 {
        let _ = writeln!(
            text,
            "the reference begins elsewhere than at rest, {:.4} um: a rise of {:.0} ms leads there",
            controller.model.around.rest_um,
            1e3 * driven.rise as f64 * period_s
        );
    }
    match &driven.modelled {
        None if controller.feedback.is_some() => {
            text.push_str("the feedforward alone: the feedback has nothing to read without --model\n");
        }
        None => {}
        Some(modelled) => {
            let kind = if controller.feedback.is_some() {
                "closed"
            } else {
                "open"
            };
            let _ = writeln!(
                text,
                "{kind} loop on the model: reference minus position {:.4} um rms",
                modelled.error_um
            );
            for effect in &modelled.left_out {
                let _ = writeln!(
                    text,
                    "{effect} is not in the run: a command alone does not determine it"
                );
            }
            if !modelled.stable {
                text.push_str(
                    "UNSTABLE: do not play these commands; design the controller with a smaller --margin, or --open\n",
                );
            }
        }
    }
    let _ = writeln!(text, "written to {}", args.output.display());
    text
}
