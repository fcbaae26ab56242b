//! The exit codes, all in one place.
//!
//! - 0: an answer was given, whatever it says
//! - 1: a limit that was asked for is exceeded (`--fail-above`), or a loop that was run is unstable (`track`)
//! - 2: bad input; standard error says what, which value, what is allowed, what to do

use crate::error::CliError;
use std::error::Error;
use std::fmt;
use std::io::Write;
use std::process::ExitCode;

/// What a command ended with.
pub(crate) enum Done {
    /// An answer was given.
    Answered,
    /// A limit that was asked for is exceeded.
    LimitExceeded,
    /// A loop that was run does not come to rest.
    Unstable,
}

/// The exit code of a command; errors are printed.
pub(crate) fn code(result: Result<Done, CliError>) -> ExitCode {
    match result {
        Ok(Done::Answered) => ExitCode::SUCCESS,
        Ok(Done::LimitExceeded | Done::Unstable) => ExitCode::from(1),
        // The reader of our output has gone (`hysteron .. | head`): it has what it wanted.
        Err(CliError::Output(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            // Nothing is left to say it on if standard error is gone, too.
            let _ = writeln!(std::io::stderr(), "{:?}", miette::Report::new(Said::of(&error)));
            ExitCode::from(2)
        }
    }
}

/// An error as it is said: every message of its causes once, though an error repeats what its cause says.
#[derive(Debug)]
struct Said {
    text: String,
    help: Option<String>,
}

impl Said {
    fn of(error: &CliError) -> Self {
        let mut text = error.worded();
        let mut cause = error.source();
        while let Some(inner) = cause {
            let words = inner.to_string();
            if !text.contains(&words) {
                text = format!("{text}: {words}");
            }
            cause = inner.source();
        }
        let help = miette::Diagnostic::help(error).map(|help| help.to_string());
        let help = error.option_to_give().or(help);
        Self { text, help }
    }
}

impl fmt::Display for Said {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.text)
    }
}

impl Error for Said {}

impl miette::Diagnostic for Said {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
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
