//! The exit codes, all in one place.
//!
//! - 0: an answer was given, whatever it says
//! - 1: a limit that was asked for is exceeded (`--fail-above`)
//! - 2: bad input; standard error says what, which value, what is allowed, what to do

use crate::error::CliError;
use std::io::Write;
use std::process::ExitCode;

/// What a command ended with.
pub(crate) enum Done {
    /// An answer was given.
    Answered,
    /// A limit that was asked for is exceeded.
    LimitExceeded,
}

/// The exit code of a command; errors are printed.
pub(crate) fn code(result: Result<Done, CliError>) -> ExitCode {
    match result {
        Ok(Done::Answered) => ExitCode::SUCCESS,
        Ok(Done::LimitExceeded) => ExitCode::from(1),
        // The reader of our output has gone (`hysteron .. | head`): it has what it wanted.
        Err(CliError::Output(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            // Nothing is left to say it on if standard error is gone, too.
            let _ = writeln!(std::io::stderr(), "{:?}", miette::Report::new(error));
            ExitCode::from(2)
        }
    }
}

/// Help and version are answers; everything else clap refuses is bad input.
pub(crate) fn usage(refusal: &clap::Error) -> ExitCode {
    let _ = refusal.print();
    if refusal.use_stderr() {
        ExitCode::from(2)
    } else {
        ExitCode::SUCCESS
    }
}
