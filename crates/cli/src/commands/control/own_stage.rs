//! `hysteron campaign` on a stage of the user's own by files: the plan, and what came back of it.

use crate::commands::control::record::{CampaignArgs, overwrite};
use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use hysteron_control::plan::came_back::{Checked, Given, refuse_to_replace};
use hysteron_control::plan::{self, Plan};
use hysteron_data::write_dataset;
use hysteron_report::{came_back_text, option};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The folder that the plan is looked for in.
const USUAL: &str = "plan";

/// The commands to begin with, as files.
pub(super) fn write_plan(args: &CampaignArgs, given: &Given) -> Result<Done, CliError> {
    refuse_to_replace(&args.output, args.overwrite)?;
    let plan = given.plan()?;
    write_pass(&plan, 0, &args.output)?;
    let plan_option = match args.output.as_path() == Path::new(USUAL) {
        true => String::new(),
        false => format!(" --plan {}", args.output.display()),
    };
    let latency = args.latency_us.map_or(" --latency-us US", |_| "");
    let sensor = sensor_option(args);
    output::print(&format!(
        "{}\nnext: hysteron campaign{plan_option} --recorded BACK{latency}{sensor} -o records\n",
        plan.words(0, &args.output)
    ))?;
    Ok(Done::Answered)
}

/// The sensor's bandwidth, where it was given, to be given again.
fn sensor_option(args: &CampaignArgs) -> String {
    let bandwidth_hz = args.sensor_bandwidth_hz;
    bandwidth_hz.map_or(String::new(), |hz| format!(" --sensor-bandwidth-hz {hz}"))
}

/// The files of a pass, then the plan.
fn write_pass(plan: &Plan, number: usize, folder: &Path) -> Result<(), CliError> {
    for (name, text) in plan.files(number)? {
        output::write_file(&folder.join(name), &text)?;
    }
    Ok(())
}

/// Checks what came back, identifies, and asks for the next pass until both are there.
pub(super) fn came_back(args: &CampaignArgs, given: &Given, recorded: &Path) -> Result<Done, CliError> {
    let folder = args.plan.clone().unwrap_or_else(|| PathBuf::from(USUAL));
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let plan = Plan::read(&folder)?;
    let recorded = load::unchecked(recorded)?;
    let checked = Checked::new(plan, given, &folder.join(plan::FILE), &recorded)?;
    for remark in checked.remarks() {
        output::note(remark);
    }
    if checked.is_wrong() {
        load::warn(&recorded);
    }
    let complete = checked.complete()?;
    for warning in complete.warnings() {
        output::warn(warning.worded(option));
    }
    let came = complete.identify()?;
    if let Some(skew) = &came.skew {
        output::warn(skew);
    }
    write_dataset(&came.dataset, &args.output, overwrite(args))?;
    let mut text = came_back_text(&came);
    let to = args.output.display();
    // Writing to a String does not fail.
    let _ = match came.next {
        Some(number) => {
            write_pass(&came.plan, number, &folder)?;
            let list = came.plan.words(number, &folder);
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
