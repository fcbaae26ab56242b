//! `hysteron export`.

mod c_code;
mod fmu;

use crate::commands::simulate::StageName;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::{Args, ValueEnum};
use hysteron_control::design::Controller;
use hysteron_control::export::{Bench, Ends, RAMP_RANGES_PER_S, export, top};
use hysteron_identify::{Direction, IdentifyError, Model};
use hysteron_plant::StageConfig;
use hysteron_report::{law_table_text, option};
use hysteron_table::gains::{Design, LoopData, design};
use hysteron_table::{FORMAT, Family, Table, TableError, short};
use hysteron_tracking::ends::ends_of;
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron fit stage --model mrpi --direction inverse -o inverse.toml\n  \
    hysteron export inverse.toml -o firmware/tables/mine.toml --dac 0,200 --adc=-25,25 --mode 8000 --damping 0.02 --latency-us 30\n  \
    hysteron export inverse.toml -o firmware/tables/paper-rate-mrpi.toml --stage paper-rate\n  \
    hysteron export controller.toml -o firmware/tables/tracking-8k.toml --stage 8k\n  \
    hysteron export controller.toml --stage 8k --format c -o law.c      # and law.h; a table does as well\n  \
    hysteron export controller.toml --stage 8k --format fmu -o law.fmu  # the same law as a unit of FMI 3.0\n  \
    hysteron export model.toml --format fmu -o stage.fmu                # and the identified stage\n\n\
    A controller of `hysteron design` becomes a table with its complete law: preview, creep, lead, modes, mains, sensor, feedback.\n\
    Of a model the integral gain is designed for a phase margin of 60 degrees at the latency and a gain margin of 2 at the first mode,\n\
    and is 0 where neither is given. Converters and amplifier are those of --stage, of the options, or of the dataset's [known];\n\
    where none of these has them, they are asked for. Each is printed with where it comes from."
)]
pub(crate) struct ExportArgs {
    /// A direct inverse (`hysteron fit --direction inverse`) without effects, or a controller (`hysteron design`); with `--format c` or `fmu`
    /// also a table, with `fmu` also a model of the stage
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// A built-in stage: converters, amplifier, latency and first mode are its own
    #[arg(long, value_enum, conflicts_with_all = ["mode", "damping", "latency_us", "amplifier", "dac", "adc", "rate"])]
    pub stage: Option<StageName>,
    /// Rate of the control loop, hertz; by default the highest of the records, and a controller has its own
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Lowest reference, micrometres; by default the lowest position the model was fitted on
    #[arg(long, value_name = "UM", allow_negative_numbers = true)]
    pub input_min: Option<f64>,
    /// Highest reference, micrometres; by default the highest position the model was fitted on
    #[arg(long, value_name = "UM", allow_negative_numbers = true)]
    pub input_max: Option<f64>,
    /// Lowest and highest volts that the stack may be given; by default what `[known]` of the dataset says, and of a controller its own
    #[arg(long, value_name = "LOW,HIGH", value_parser = range, allow_hyphen_values = true)]
    pub amplifier: Option<[f64; 2]>,
    /// Volts at the stack of the DAC's lowest code and of full scale (one step above its highest); by default `dac_v` of `[known]`
    #[arg(long, value_name = "LOW,HIGH", value_parser = range, allow_hyphen_values = true)]
    pub dac: Option<[f64; 2]>,
    /// Micrometres of the ADC's lowest code and of full scale (one step above its highest); by default `adc_um` of `[known]`
    #[arg(long, value_name = "LOW,HIGH", value_parser = range, allow_hyphen_values = true)]
    pub adc: Option<[f64; 2]>,
    /// First mode of the stage, hertz
    #[arg(long, value_name = "HZ", requires = "damping")]
    pub mode: Option<f64>,
    /// Its damping ratio
    #[arg(long, value_name = "RATIO", requires = "mode")]
    pub damping: Option<f64>,
    /// Latency of your controller, microseconds: from the instant of a reading to the edge of the command that is computed from it, without the
    /// half sample of hold; with the lags of amplifier and sensor, where you know them
    #[arg(long, value_name = "US")]
    pub latency_us: Option<f64>,
    /// Proportional gain, volts per micrometre
    #[arg(long, default_value_t = 0.0)]
    pub proportional: f64,
    /// Integral gain, volts per micrometre and second; by default the designed one
    #[arg(long)]
    pub integral: Option<f64>,
    /// Feedback is whole up to this frequency of the reference and none from twice it, hertz; by default 400, and of a controller where its
    /// feedback helps up to
    #[arg(long, value_name = "HZ")]
    pub feedback_up_to: Option<f64>,
    /// Of a controller: how far its feedback may take the platform from where the feedforward has it, whatever the sensor says; by
    /// default four times the rms error that the design predicts for the feedforward alone, and at least 2.5 % of the range
    #[arg(long, value_name = "UM")]
    pub feedback_bound_um: Option<f64>,
    /// Of a controller beside that of another axis: what of the other's motion reaches this one, um/um; move the other axis and read this
    /// axis' sensor
    #[arg(long, value_name = "RATIO", allow_negative_numbers = true)]
    pub cross: Option<f64>,
    /// Leave what the records cover; the table remembers it
    #[arg(long)]
    pub beyond_records: bool,
    /// What is written
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// The table; or the C file, whose name begins the names in it and whose header goes beside it; or the unit, FILE.fmu
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// What an export is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// The table that the firmware's build takes
    Table,
    /// The law as one C99 file and its header: for a Simulink S-function, dSPACE, LabVIEW, another microcontroller
    C,
    /// The law, or of a model the stage itself, as a co-simulation unit of FMI 3.0, compiled by `cc` for this machine
    Fmu,
}

fn range(text: &str) -> Result<[f64; 2], String> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    match text.split_once(',').map(|(low, high)| (number(low), number(high))) {
        Some((Some(low), Some(high))) if low < high => Ok([low, high]),
        _ => Err("give two ascending numbers with a comma, such as 0,200".to_owned()),
    }
}

pub(crate) fn run(args: &ExportArgs) -> Result<Done, CliError> {
    let refused = |source| CliError::Table {
        path: args.model.clone(),
        source,
    };
    if args.format != Format::Table && Table::is_one(&read(&args.model)?) {
        let text = read(&args.model)?;
        return written(&Table::parse(&text).map_err(refused)?, &text, args, "");
    }
    if args.format == Format::Fmu && !Controller::is_one(&args.model) {
        let model = Model::read(&args.model)?;
        if model.direction == Direction::Forward {
            return fmu::write_stage(&model, args);
        }
    }
    let (table, said) = if Controller::is_one(&args.model) {
        let designed = Controller::read(&args.model)?;
        its_own(args)?;
        let exported = export(&designed, &bench(args))?;
        let said = law_table_text(&designed, &exported);
        (exported.table, said)
    } else {
        let (table, designed, ends) = table(&Model::read(&args.model)?, args, &refused)?;
        let said = said(&table, designed.as_ref(), args, &ends);
        (table, said)
    };
    let text = table.to_toml().map_err(refused)?;
    written(&table, &text, args, &said)
}

/// Writes a table whose file is `text` as what was asked for; `said` is what the table's making said.
fn written(table: &Table, text: &str, args: &ExportArgs, said: &str) -> Result<Done, CliError> {
    match args.format {
        Format::C => c_code::write_both(table, text, args, said),
        Format::Fmu => fmu::write_law(table, text, args, said),
        Format::Table => {
            write(&args.output, text)?;
            output::print(&format!("{said}written to {}\n", args.output.display()))?;
            Ok(Done::Answered)
        }
    }
}

fn read(path: &Path) -> Result<String, CliError> {
    std::fs::read_to_string(path).map_err(|source| CliError::Read {
        path: path.to_owned(),
        source,
    })
}

fn write(path: &Path, text: &str) -> Result<(), CliError> {
    std::fs::write(path, text).map_err(|source| CliError::Write {
        path: path.to_owned(),
        source,
    })
}

/// Refuses options for what a controller has of its own.
fn its_own(args: &ExportArgs) -> Result<(), CliError> {
    for (option, given) in [
        ("--mode and --damping", args.mode.is_some()),
        ("--latency-us", args.latency_us.is_some()),
        ("--rate", args.rate.is_some()),
        ("--integral", args.integral.is_some()),
        ("--proportional", args.proportional != 0.0),
    ] {
        if given {
            return Err(CliError::Option(format!(
                "{option}: the controller has its own rate, latency, modes and feedback; leave the option out, or design again"
            )));
        }
    }
    Ok(())
}

/// The bench that the options name.
fn bench(args: &ExportArgs) -> Bench {
    Bench {
        source: args.model.display().to_string(),
        stage: args.stage.map(|stage| ends_of(&stage.config())),
        amplifier_v: args.amplifier,
        dac_v: args.dac,
        adc_um: args.adc,
        input_min_um: args.input_min,
        input_max_um: args.input_max,
        feedback_up_to_hz: args.feedback_up_to,
        feedback_bound_um: args.feedback_bound_um,
        cross_um_per_um: args.cross,
        beyond_records: args.beyond_records,
        // Where C runs there may be one.
        thermometer: args.format == Format::C,
    }
}

/// Rate of an inverse alone, and where it comes from.
fn rate_hz(stage: Option<&StageConfig>, model: &Model, args: &ExportArgs) -> Result<(f64, &'static str), CliError> {
    let sources = [
        (args.rate, "--rate"),
        (stage.map(|stage| 1.0 / stage.sample_period_s), "--stage"),
        (model.covered.sample_rate_hz, "the records"),
    ];
    let found = sources.into_iter().find_map(|(rate, from)| Some((rate?, from)));
    found.ok_or_else(|| {
        CliError::Option(format!(
            "{}: the model does not say at what rate its records were taken; give the rate of the control loop: --rate HZ",
            args.model.display()
        ))
    })
}

fn said(table: &Table, designed: Option<&Design>, args: &ExportArgs, ends: &Ends) -> String {
    let mut text = format!(
        "{} with {} plays, {:.4} to {:.4} um\n",
        table.family.name(),
        table.thresholds_um.len(),
        table.input_min_um,
        table.input_max_um
    );
    // Writing to a String does not fail.
    let _ = match designed {
        Some(design) => writeln!(
            text,
            "integral gain {:.0} V/(um s): crossover {:.0} Hz, phase margin {:.0} degrees, gain margin {:.1}",
            design.integral_v_per_um_s, design.crossover_hz, design.phase_margin_deg, design.gain_margin
        ),
        None if args.integral.is_none() => writeln!(
            text,
            "feedback off: no gain is safe without the loop's data; give --latency-us, and --mode and --damping unless the stage is rigid"
        ),
        None => Ok(()),
    };
    for line in &ends.told {
        let _ = writeln!(text, "{}", line.worded(option));
    }
    text
}

/// The latency beside the half sample of hold, seconds, and the first mode's frequency, hertz, and damping, where it is known.
type KnownLoop = (f64, Option<[f64; 2]>);

/// The whole range in 1 ms: with 200 V, five times the slope of a 26 V sine at 500 Hz (pi x 500 Hz x 26 V).
const SLEW_RANGES_PER_S: f64 = 1e3;

/// What the loop's gain depends on, where it is known.
fn loop_data(stage: Option<&StageConfig>, args: &ExportArgs) -> Result<Option<KnownLoop>, CliError> {
    if let Some(stage) = stage {
        let filter_s = stage
            .sensor
            .bandwidth_hz
            .map_or(0.0, |bandwidth_hz| 1.0 / (std::f64::consts::TAU * bandwidth_hz));
        let latency_s = stage.controller_delay_s + stage.delay_s + stage.amplifier.lag_s + filter_s;
        // The lowest: modes of presets are in order.
        let mode = stage.modes.first().map(|mode| [mode.frequency_hz, mode.damping]);
        return Ok(Some((latency_s, mode)));
    }
    let positive = |name: &str, value: f64, most: f64| {
        if value > 0.0 && value <= most {
            Ok(value)
        } else {
            Err(CliError::Option(format!(
                "--{name} {value} must lie above 0, up to {most}"
            )))
        }
    };
    let mode = match (args.mode, args.damping) {
        (Some(frequency_hz), Some(damping)) => {
            Some([positive("mode", frequency_hz, 1e6)?, positive("damping", damping, 1.0)?])
        }
        _ => None,
    };
    match args.latency_us {
        Some(0.0) => Ok(Some((0.0, mode))),
        Some(latency_us) => Ok(Some((positive("latency-us", latency_us, 1e5)? * 1e-6, mode))),
        None if mode.is_some() => Err(CliError::Option(
            "--mode needs --latency-us, too: the phase margin is bought with it".to_owned(),
        )),
        None => Ok(None),
    }
}

fn table(
    model: &Model,
    args: &ExportArgs,
    refused: &dyn Fn(TableError) -> CliError,
) -> Result<(Table, Option<Design>, Ends), CliError> {
    let refuse = |what: &str| Err(CliError::Option(format!("{}: {what}", args.model.display())));
    if model.direction != Direction::Inverse {
        return refuse(
            "runs forward; design a controller from it and export that: hysteron design MODEL -o controller.toml; an inverse alone, \
             without effects and without a loop, is what fit --direction inverse makes",
        );
    }
    if args.cross.is_some() {
        return refuse(
            "has no place for --cross: a table of an inverse alone knows no other axis; design a controller and export that",
        );
    }
    if !model.effects.is_empty() {
        return refuse(
            "has effects, which a table of an inverse alone cannot hold; design a controller from a forward model and export that: \
             hysteron design MODEL -o controller.toml",
        );
    }
    let stage = args.stage.map(StageName::config);
    let mut ends = Ends::of(&bench(args), &model.covered, None)?;
    let (dac_top_v, adc_top_um) = (top(ends.dac_v), top(ends.adc_um));
    let output_min_v = ends.amplifier_v[0].max(ends.dac_v[0]);
    let output_max_v = ends.amplifier_v[1].min(dac_top_v);
    let (rate_hz, from) = rate_hz(stage.as_ref(), model, args)?;
    ends.told
        .push(format!("rate {} Hz, from {from}", short(rate_hz)).into());
    let input_min_um = args.input_min.unwrap_or(model.input_min);
    let input_max_um = args.input_max.unwrap_or(model.input_max);
    let covered = ends.covered(
        &model.covered,
        ([output_min_v, output_max_v], [input_min_um, input_max_um], rate_hz),
        args.beyond_records,
    )?;
    let mut table = Table {
        format: FORMAT.to_owned(),
        sample_rate_hz: rate_hz,
        input_min_um,
        input_max_um,
        output_min_v,
        output_max_v,
        safe_v: 0.0_f64.clamp(output_min_v, output_max_v.max(output_min_v)),
        slew_v_per_s: (output_max_v - output_min_v) * SLEW_RANGES_PER_S,
        ramp_v_per_s: (output_max_v - output_min_v) * RAMP_RANGES_PER_S,
        proportional_v_per_um: args.proportional,
        integral_v_per_um_s: args.integral.unwrap_or(0.0),
        feedback_up_to_hz: args.feedback_up_to.unwrap_or(400.0),
        dac_min_v: ends.dac_v[0],
        dac_top_v,
        adc_min_um: ends.adc_um[0],
        adc_top_um,
        covered,
        ..inverse(model)?
    };
    // Before its slopes are used; K_i is no part of them.
    let [smallest, _] = table.sweep().map_err(refused)?.slopes_v_per_um;
    let data = loop_data(stage.as_ref(), args)?;
    let designed = match (data, args.integral) {
        (Some((latency_s, mode)), None) => Some(design(&LoopData {
            gain_um_per_v: 1.0 / smallest,
            latency_s: latency_s + 0.5 / rate_hz,
            mode,
        })),
        _ => None,
    };
    if let Some(design) = &designed {
        table.integral_v_per_um_s = design.integral_v_per_um_s;
    }
    Ok((table, designed, ends))
}

/// A table that has the model's inverse and nothing else.
fn inverse(model: &Model) -> Result<Table, IdentifyError> {
    let parameters = model.parameters();
    let number = |name: &str| {
        let found = parameters.iter().find(|parameter| parameter.name == name);
        found.map_or(0.0, |parameter| parameter.value)
    };
    let list = |name: &str| -> Vec<f64> {
        let of_name = parameters
            .iter()
            .filter(|parameter| parameter.name.split('[').next() == Some(name) && parameter.name.contains('['));
        of_name.map(|parameter| parameter.value).collect()
    };
    let family = match model.family {
        hysteron_identify::Family::Pi => Family::Pi,
        hysteron_identify::Family::Mpi => Family::Mpi,
        hysteron_identify::Family::Wrpi => Family::Wrpi,
        hysteron_identify::Family::Mrpi => Family::Mrpi,
        hysteron_identify::Family::PlayPolynomial => Family::PlayPolynomial,
        family @ hysteron_identify::Family::Duhem => return Err(IdentifyError::ForwardOnly { family }),
    };
    Ok(Table {
        alpha_s: number("alpha"),
        beta_s: number("beta"),
        offset_v: number("offset"),
        linear_v_per_um: number("linear"),
        quadratic_v_per_um2: number("quadratic"),
        cubic_v_per_um3: number("cubic"),
        quartic_v_per_um4: number("power4"),
        quintic_v_per_um5: number("power5"),
        thresholds_um: model.thresholds.clone(),
        weights_v_per_um: list("weight"),
        rate_weights_v_s_per_um2: list("rate_weight"),
        weights_quadratic_v_per_um2: list("weight_quadratic"),
        weights_cubic_v_per_um3: list("weight_cubic"),
        ..Table::empty(family)
    })
}
