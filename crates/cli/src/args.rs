//! The commands; each has its arguments and its help in its own file.

use crate::commands::{
    add::AddArgs, board::BoardArgs, challenge::ChallengeArgs, compare::CompareArgs, control::design::DesignArgs,
    control::drive::DriveArgs, control::record::CampaignArgs, control::rehearse::RehearseArgs,
    control::track::TrackArgs, demo::DemoArgs, diagnose::DiagnoseArgs, example::ExampleArgs, explain::ExplainArgs,
    export::ExportArgs, fit::FitArgs, import::ImportArgs, lab::LabArgs, ladder::LadderArgs, learn::LearnArgs,
    paper::PaperArgs, predict::PredictArgs, report::ReportArgs, simulate::SimulateArgs,
};
use clap::{Parser, Subcommand};

/// Model a piezo stage's hysteresis, compare it with measurements, see where it fails.
#[derive(Parser)]
#[command(name = "hysteron", version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "Start with `hysteron demo`, or with your own recordings:\n  \
    hysteron import scope.csv -o stage\n  hysteron fit stage --model mrpi -o model.toml\n  \
    hysteron compare stage model.toml -o page.html\n\n\
    Exit codes: 0 an answer was given; 1 a limit asked for is exceeded; 2 bad input.")]
pub(crate) struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Turn recordings (CSV of any dialect, TDMS, MATLAB, HDF5, NumPy, Excel, ...) into a dataset
    Import(ImportArgs),
    /// Record the built-in simulated stage as a dataset
    Simulate(SimulateArgs),
    /// Identify a model from the records with role `identify`
    Fit(FitArgs),
    /// Compare a model with every record: how far off, and where
    Compare(CompareArgs),
    /// Write what a model says of every record, sample by sample: CSV, NumPy or Parquet
    Predict(PredictArgs),
    /// Name the physical effect that a model lacks, and the record that would tell more
    Diagnose(DiagnoseArgs),
    /// Add an effect to a model and fit everything anew: the error before and after, on every record
    Add(AddArgs),
    /// Show how the error of a model fell, step by step, down to the noise floor
    Ladder(LadderArgs),
    /// Fit, diagnose and add by itself until nothing more is missing or nothing more can be told
    Learn(LearnArgs),
    /// Open the workbench: the whole way in a browser, from recordings to the model and its controller
    Lab(LabArgs),
    /// Freeze comparison, diagnosis and ladder of a model into one page to send to a colleague
    Report(ReportArgs),
    /// Explain a physical effect, with pictures, on your own records where given; or list all
    Explain(ExplainArgs),
    /// Make a dataset with a sealed effect, answer what it is, see the truth
    Challenge(ChallengeArgs),
    /// Record on a stage what a controller has to be designed from
    Campaign(CampaignArgs),
    /// Design the complete controller from the records of a campaign
    Design(DesignArgs),
    /// Track references with a controller and with the paper's, side by side
    Track(TrackArgs),
    /// Write a controller's commands along a reference of your own: a table for another program
    Drive(DriveArgs),
    /// Rehearse the whole way on a stage with a hidden effect: record, learn, design, track; the error before and after
    Rehearse(RehearseArgs),
    /// Redo the paper on the simulated stages, its figures beside ours
    Paper(PaperArgs),
    /// Turn a direct inverse into the table that is compiled into the firmware
    Export(ExportArgs),
    /// Run the firmware and record what it does
    Board(BoardArgs),
    /// Make a small dataset that every command runs on, or list them
    Example(ExampleArgs),
    /// Run the main job on the simulated stage and leave a page with pictures
    Demo(DemoArgs),
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use hysteron_control::message::Setting;
    use std::collections::BTreeSet;

    /// What a message tells a person to give, a command takes: each word of it that is an option.
    #[test]
    fn val_every_setting_has_an_option_that_is_there() {
        let args = Args::command();
        let commands = args.get_subcommands();
        let there: BTreeSet<String> = commands
            .flat_map(|command| command.get_arguments().filter_map(clap::Arg::get_long))
            .map(|long| format!("--{long}"))
            .collect();
        let mut found = 0;
        for setting in Setting::ALL {
            let words = hysteron_report::option(setting).split([' ', '`']);
            for option in words.filter(|word| word.starts_with("--")) {
                assert!(there.contains(option), "{setting:?}: {option}");
                found += 1;
            }
        }
        // Two that have no option, two that have two.
        assert!(found >= Setting::ALL.len() - 2, "{found}");
    }
}
