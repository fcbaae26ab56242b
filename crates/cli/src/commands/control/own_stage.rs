//! `hysteron campaign` on a stage of the user's own by files: the plan, and what came back of it.

use crate::commands::control::record::{CampaignArgs, listed, misses, overwrite};
use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use hysteron_acquisition::{Finding, Kind};
use hysteron_control::ControlError;
use hysteron_control::campaign::{Protocol, TRAINING_PASSES};
use hysteron_control::plan::doubts::{Doubt, Doubts, doubts};
use hysteron_control::plan::drift::{Drift, drifts};
use hysteron_control::plan::matching::{Returned, matched};
use hysteron_control::plan::skew::Skew;
use hysteron_control::plan::{self, Plan};
use hysteron_data::{Dataset, Record, write_dataset};
use hysteron_identify::control::{ControlModel, identify};
use hysteron_table::short;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The folder that the plan is looked for in.
const USUAL: &str = "plan";

/// The commands to begin with, as files.
pub(super) fn write_plan(args: &CampaignArgs, protocol: &Protocol, rate_hz: f64) -> Result<Done, CliError> {
    let file = args.output.join(plan::FILE);
    if file.exists() && !args.overwrite {
        return Err(CliError::Option(format!(
            "{}: there is a plan already, which recordings may be of; choose another place, or give --overwrite",
            file.display()
        )));
    }
    let plan = Plan::new(protocol, rate_hz, args.latency_us)?;
    let text = write_pass(&plan, 0, &args.output)?;
    let plan_option = match args.output.as_path() == Path::new(USUAL) {
        true => String::new(),
        false => format!(" --plan {}", args.output.display()),
    };
    let latency = args.latency_us.map_or(" --latency-us US", |_| "");
    let sensor = sensor_option(args);
    output::print(&format!(
        "{text}\nnext: hysteron campaign{plan_option} --recorded BACK{latency}{sensor} -o records\n"
    ))?;
    Ok(Done::Answered)
}

/// The sensor's bandwidth, where it was given, to be given again.
fn sensor_option(args: &CampaignArgs) -> String {
    let bandwidth_hz = args.sensor_bandwidth_hz;
    bandwidth_hz.map_or(String::new(), |hz| format!(" --sensor-bandwidth-hz {hz}"))
}

/// The files of a pass, then the plan; what was written, in words.
fn write_pass(plan: &Plan, number: usize, folder: &Path) -> Result<String, CliError> {
    let mut list = String::new();
    let Some(pass) = plan.passes.get(number) else {
        return Ok(list);
    };
    for record in &pass.records {
        let path = folder.join(&record.file);
        output::write_file(&path, &plan::csv(record))?;
        // Writing to a String does not fail.
        let _ = writeln!(
            list,
            "{:<40} {:>8} samples  {:>7.3} s  after {:>2} s of rest  {}",
            path.display(),
            record.samples,
            record.duration_s(),
            record.rest_before_s,
            record.excitation
        );
    }
    let path = folder.join(&pass.sequence);
    output::write_file(&path, &plan::sequence_csv(plan, pass))?;
    let file = folder.join(plan::FILE);
    output::write_file(&file, &plan.to_toml()?)?;
    let cycle = match number {
        0 => format!(
            "cycle the stage to {} V and back to {} V, then ",
            short(plan.cycle_to_v),
            short(plan.rest_v)
        ),
        _ => String::new(),
    };
    let _ = write!(
        list,
        "\n{cycle}play each after its rest at {} V, and record voltage and position from its first sample on; names are free\n\
         or all of it at once, rests and all: {}, {} samples at {} Hz, {:.1} s\n\
         {} knows them by their voltages\n",
        short(plan.rest_v),
        path.display(),
        pass.samples,
        short(plan.rate_hz),
        pass.samples as f64 / plan.rate_hz,
        file.display()
    );
    Ok(list)
}

/// Checks what came back, identifies, and asks for the next pass until both are there.
pub(super) fn came_back(args: &CampaignArgs, recorded: &Path) -> Result<Done, CliError> {
    let folder = args.plan.clone().unwrap_or_else(|| PathBuf::from(USUAL));
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let mut plan = Plan::read(&folder)?;
    agrees(args, &plan, &folder)?;
    let recorded = load::unchecked(recorded)?;
    let mut dataset = known(args, &plan, &recorded)?;
    let mut returned = matched(&plan, &recorded.records);
    for remark in &returned.remarks {
        output::note(remark);
    }
    if !returned.wrong.is_empty() {
        load::warn(&recorded);
        return Err(unusable(&returned.wrong));
    }
    let doubts = doubts(&plan, &returned);
    let drifts = drifts(&plan, &returned);
    let unrested: Vec<&Doubt> = doubts.doubts.iter().filter(|doubt| doubt.is_a_short_rest()).collect();
    if !unrested.is_empty() && !args.short_rests {
        return Err(unusable(&unrested));
    }
    warn(&doubts, &drifts);
    if !doubts.signs.is_empty() {
        return Err(unusable(&doubts.signs.iter().map(turned).collect::<Vec<_>>()));
    }
    if !unrested.is_empty() {
        let begun = format!(
            "; {} began before the stage was at rest, granted by --short-rests",
            unrested.len()
        );
        dataset.description.push_str(&begun);
    }
    let zero_um = doubts.zero_um.unwrap_or(0.0);
    returned.count_from(zero_um);
    // The converter's ends count from the same zero.
    dataset.known.adc_um = dataset
        .known
        .adc_um
        .map(|ends_um| ends_um.map(|end_um| end_um - zero_um));
    let (model, next) = passes(&mut dataset, &plan, &returned)?;
    if let Some(skew) = Skew::of(&model) {
        output::warn(skew);
    }
    write_dataset(&dataset, &args.output, overwrite(args))?;
    let mut text = listed(&dataset.records) + &rig(&doubts, &drifts) + &misses(model.misfit_percent);
    let to = args.output.display();
    // Writing to a String does not fail.
    let _ = match next {
        Some((number, commands)) => {
            plan.latency_us = args.latency_us.or(plan.latency_us);
            plan.set_pass(number, commands);
            let list = write_pass(&plan, number, &folder)?;
            writeln!(
                text,
                "\nwritten to {to}; record these as well, made with what is known so far:\n\n{list}\n\
                 next: import all recordings so far, then {} --overwrite",
                again(args)
            )
        }
        None => writeln!(text, "\nwritten to {to}\nnext: hysteron design {to} -o controller.toml"),
    };
    output::print(&text)?;
    Ok(Done::Answered)
}

fn unusable(reasons: &[impl ToString]) -> CliError {
    let wrong = reasons.iter().map(ToString::to_string).collect();
    ControlError::Recordings { wrong }.into()
}

/// A sign of which no controller can be made: its loop would run away.
fn turned(finding: &Finding) -> String {
    match finding.kind {
        Kind::NegativeGain => format!(
            "the position falls where the voltage rises, by {:.4} um/V: turn the sensor's sign, or import it with --column \
             position=NAME:um*-1",
            finding.figure.value.abs()
        ),
        _ => finding.to_string(),
    }
}

/// The same command again.
fn again(args: &CampaignArgs) -> String {
    let plan = args
        .plan
        .as_ref()
        .map_or(String::new(), |plan| format!(" --plan {}", plan.display()));
    let latency = args
        .latency_us
        .map_or(String::new(), |us| format!(" --latency-us {us}"));
    let sensor = sensor_option(args);
    let rests = if args.short_rests { " --short-rests" } else { "" };
    format!(
        "hysteron campaign{plan} --recorded ALL{latency}{sensor}{rests} -o {}",
        args.output.display()
    )
}

/// Options that say otherwise than the plan are an error.
fn agrees(args: &CampaignArgs, plan: &Plan, folder: &Path) -> Result<(), CliError> {
    let file = folder.join(plan::FILE);
    let check = |option: &str, given: Option<String>, planned: Option<String>, unit: &str| match (given, planned) {
        (Some(given), Some(planned)) if given != planned => Err(CliError::Option(format!(
            "{option} {given}, and {} has {planned}{unit}: leave the option out, or name the plan that was recorded with --plan",
            file.display()
        ))),
        _ => Ok(()),
    };
    let text = |value: Option<f64>| value.map(|value| value.to_string());
    check("--top-v", text(args.top_v), text(Some(plan.top_v)), " V")?;
    check("--rate-hz", text(args.rate_hz), text(Some(plan.rate_hz)), " Hz")?;
    check(
        "--seed",
        args.seed.map(|seed| seed.to_string()),
        Some(plan.seed.to_string()),
        "",
    )?;
    check("--latency-us", text(args.latency_us), text(plan.latency_us), " us")
}

/// The new dataset without its records: what is known of the measuring chain.
fn known(args: &CampaignArgs, plan: &Plan, recorded: &Dataset) -> Result<Dataset, CliError> {
    let mut known = recorded.known;
    let latency_us = args.latency_us.or(plan.latency_us);
    let delay_s = latency_us.map(|us| plan.known_delay_s(us));
    if let (Some(latency_us), Some(by_option_s), Some(said_s)) = (latency_us, delay_s, known.delay_s)
        // A hundredth of a microsecond is rounding.
        && (by_option_s - said_s).abs() > 1e-8
    {
        return Err(CliError::Option(format!(
            "a latency of {latency_us} us and half a sample of hold are a known delay of {:.2} us, and dataset.toml has delay_s = {said_s} \
             ({:.2} us): correct one of them",
            1e6 * by_option_s,
            1e6 * said_s
        )));
    }
    known.delay_s = delay_s.or(known.delay_s);
    if known.delay_s.is_none() {
        return Err(CliError::Option(
            "the latency of your controller, from reading to command, is not known: give --latency-us, or delay_s under [known] in \
             dataset.toml, which has half a sample of hold in it"
                .to_owned(),
        ));
    }
    if let Some(max_v) = known.voltage_max_v.filter(|max_v| *max_v < plan.cycle_to_v) {
        return Err(CliError::Option(format!(
            "the plan goes to {} V, and dataset.toml has voltage_max_v = {max_v}: correct it, or plan with a lower --top-v",
            short(plan.cycle_to_v)
        )));
    }
    known.sensor_bandwidth_hz = args.sensor_bandwidth_hz.or(known.sensor_bandwidth_hz);
    known.voltage_min_v = known.voltage_min_v.or(Some(plan.rest_v));
    known.voltage_max_v = known.voltage_max_v.or(Some(plan.top_v));
    Ok(Dataset {
        name: recorded.name.clone(),
        description: format!("campaign for control, seed {}", plan.seed),
        known,
        ..Dataset::default()
    })
}

/// The commands of a pass that is to be recorded next, and its number.
type Next = Option<(usize, Vec<hysteron_control::campaign::Command>)>;

/// Identifies from the passes that came back.
fn passes(dataset: &mut Dataset, plan: &Plan, returned: &Returned) -> Result<(ControlModel, Next), CliError> {
    let of = |pass: usize| -> Vec<Record> { returned.of_pass(pass).map(|taken| taken.record.clone()).collect() };
    for pass in 0..returned.passes {
        dataset.records.extend(of(pass));
    }
    let model = identify(dataset)?;
    let next = returned.passes;
    if next > TRAINING_PASSES {
        return Ok((model, None));
    }
    let commands = plan.protocol().training(&model, next)?;
    Ok((model, Some((next, commands))))
}

/// Says on standard error what may spoil the campaign.
fn warn(doubts: &Doubts, drifts: &[Drift]) {
    doubts.mistakes.iter().for_each(output::warn);
    doubts.doubts.iter().for_each(output::warn);
    let drifted = drifts.iter().flat_map(Drift::warnings);
    drifted.for_each(output::warn);
}

/// What is known of the rig, and what its records cannot tell.
fn rig(doubts: &Doubts, drifts: &[Drift]) -> String {
    let mut text = String::new();
    // Writing to a String does not fail.
    for drift in drifts {
        let _ = writeln!(text, "{drift}");
    }
    if let Some(zero_um) = doubts.zero_um {
        let _ = writeln!(
            text,
            "zero: the sensor reads {zero_um:.4} um at rest; positions in the records, of the controller and in adc_um count from there. What of \
             it the stage remembers cannot be told"
        );
    }
    let _ = writeln!(text, "noise {}", doubts.noise);
    if let Some(following) = &doubts.following {
        let _ = writeln!(text, "{following}");
    }
    text
}
