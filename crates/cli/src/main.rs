//! `hysteron`: from recordings of a piezo stage to a fitted model and an honest comparison.
//!
//! The only crate that prints or exits. Exit codes: see [`exit`].
#![forbid(unsafe_code)]

mod args;
mod commands;
mod error;
mod exit;
mod output;
mod progress;

use args::{Args, Command};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(refusal) => return exit::usage(&refusal),
    };
    let done = match args.command {
        Command::Import(args) => commands::import::run(&args),
        Command::Simulate(args) => commands::simulate::run(&args),
        Command::Fit(args) => commands::fit::run(&args),
        Command::Compare(args) => commands::compare::run(&args),
        Command::Predict(args) => commands::predict::run(&args),
        Command::Diagnose(args) => commands::diagnose::run(&args),
        Command::Add(args) => commands::add::run(&args),
        Command::Ladder(args) => commands::ladder::run(&args),
        Command::Learn(args) => commands::learn::run(&args),
        Command::Lab(args) => commands::lab::run(&args),
        Command::Report(args) => commands::report::run(&args),
        Command::Explain(args) => commands::explain::run(&args),
        Command::Challenge(args) => commands::challenge::run(&args),
        Command::Campaign(args) => commands::control::record::run(&args),
        Command::Design(args) => commands::control::design::run(&args),
        Command::Track(args) => commands::control::track::run(&args),
        Command::Drive(args) => commands::control::drive::run(&args),
        Command::Rehearse(args) => commands::control::rehearse::run(&args),
        Command::Paper(args) => commands::paper::run(&args),
        Command::Export(args) => commands::export::run(&args),
        Command::Board(args) => commands::board::run(&args),
        Command::Example(args) => commands::example::run(&args),
        Command::Demo(args) => commands::demo::run(&args),
    };
    exit::code(done)
}
