//! A stage of the user's own as a process: volts go to its standard input, positions come back, a line each; see `process.md` in the book.

use crate::adapted::Adapted;
use crate::commands::usual_temperature_c;
use crate::design::Controller;
use crate::design::beyond::Programme;
use crate::error::ControlError;
use crate::expected::{Plan, Played, Report, Row};
use crate::message::{Naming, Setting};
use crate::reference::Reference;
use hysteron_core::surroundings::LoopInput;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// First word and version of the first line.
const GREETING: &str = "hysteron-process 1";
/// Longest answer, bytes: a number has less than thirty.
const LONGEST_ANSWER: usize = 256;
/// Answers that may wait: one is asked for at a time, and a second one is an error.
const WAITING: usize = 2;
/// How long a process that has closed its output may take to end, before its exit status is not waited for.
const ENDING: Duration = Duration::from_secs(1);

/// What can go wrong with a process.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// It cannot be started.
    #[error(
        "process `{command}` cannot be started: {source}; give a program and its arguments with blanks between them"
    )]
    Start {
        /// The command.
        command: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// No answer in time.
    #[error("{}", silent(command, *line, *seconds, Setting::field))]
    Silent {
        /// The command.
        command: String,
        /// The line, the first is 1.
        line: u64,
        /// How long was waited.
        seconds: f64,
    },
    /// It ended, or closed its output.
    #[error("process `{command}` {how} before it answered line {line}; what it wrote to standard error says why")]
    Ended {
        /// The command.
        command: String,
        /// How it ended.
        how: String,
        /// The line, the first is 1.
        line: u64,
    },
    /// An answer that is none.
    #[error(
        "process `{command}` answered line {line} with `{found}`; allowed is one finite number, the position in micrometres"
    )]
    Answer {
        /// The command.
        command: String,
        /// The line, the first is 1.
        line: u64,
        /// What it wrote.
        found: String,
    },
    /// A line too many.
    #[error(
        "process `{command}` wrote `{found}` that nobody asked for, after line {line}; it must write one line for each line that it reads"
    )]
    Unasked {
        /// The command.
        command: String,
        /// The last line that was answered, the first is 1.
        line: u64,
        /// What it wrote.
        found: String,
    },
}

impl ProcessError {
    /// What it says, with settings in a front end's names.
    pub fn worded(&self, name: Naming) -> String {
        match self {
            Self::Silent { command, line, seconds } => silent(command, *line, *seconds, name),
            _ => self.to_string(),
        }
    }
}

fn silent(command: &str, line: u64, seconds: f64, name: Naming) -> String {
    format!(
        "process `{command}` gave no answer to line {line} within {seconds} s; it must write a line for each line that it reads and flush it \
         at once; {} gives it longer",
        name(Setting::Timeout)
    )
}

/// How a stage is started as a process.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessStage {
    /// Program and arguments, blanks between them; no shell.
    pub command: String,
    /// Longest wait for an answer.
    pub timeout: Duration,
}

/// A running process; it is ended where it is dropped.
struct Process<'a> {
    stage: &'a ProcessStage,
    child: Child,
    input: Option<ChildStdin>,
    answers: Receiver<String>,
    /// Lines written.
    lines: u64,
}

/// Passes a process's lines on until one of both ends. What is too long, or no text, is passed on as it is: as an answer it is refused.
fn listen(output: ChildStdout, to: &SyncSender<String>) {
    let mut output = BufReader::new(output);
    loop {
        let mut line = Vec::new();
        match output.by_ref().take(LONGEST_ANSWER as u64).read_until(b'\n', &mut line) {
            Err(_) => return,
            // Its end, or half a number before it.
            Ok(_) if line.len() < LONGEST_ANSWER && !line.ends_with(b"\n") => return,
            Ok(_) => {
                let text = String::from_utf8_lossy(&line).trim().to_owned();
                if to.send(text).is_err() {
                    return;
                }
            }
        }
    }
}

impl<'a> Process<'a> {
    /// Starts it; its first position is that at rest at 0 V, micrometres.
    fn start(stage: &'a ProcessStage, period_s: f64) -> Result<(Self, f64), ProcessError> {
        let refused = |source: std::io::Error| ProcessError::Start {
            command: stage.command.clone(),
            source,
        };
        let mut words = stage.command.split_whitespace();
        let program = words
            .next()
            .ok_or_else(|| refused(std::io::ErrorKind::InvalidInput.into()))?;
        let mut child = Command::new(program)
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(refused)?;
        let (to, answers) = sync_channel(WAITING);
        if let Some(output) = child.stdout.take() {
            std::thread::spawn(move || listen(output, &to));
        }
        let input = child.stdin.take();
        let mut process = Self {
            stage,
            child,
            input,
            answers,
            lines: 0,
        };
        let at_rest_um = process.ask(&format!("{GREETING} {period_s:?}"))?;
        Ok((process, at_rest_um))
    }

    /// A command, volts, held for a sample; the position after it, micrometres.
    fn step(&mut self, voltage_v: f64) -> Result<f64, ProcessError> {
        self.ask(&format!("{voltage_v:?}"))
    }

    fn ask(&mut self, line: &str) -> Result<f64, ProcessError> {
        if let Ok(found) = self.answers.try_recv() {
            return Err(self.unasked(found));
        }
        self.lines += 1;
        let written = self
            .input
            .as_mut()
            .map(|input| input.write_all(format!("{line}\n").as_bytes()));
        if !matches!(written, Some(Ok(()))) {
            return Err(self.ended());
        }
        let found = match self.answers.recv_timeout(self.stage.timeout) {
            Ok(found) => found,
            Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
            Err(RecvTimeoutError::Timeout) => {
                return Err(ProcessError::Silent {
                    command: self.stage.command.clone(),
                    line: self.lines,
                    seconds: self.stage.timeout.as_secs_f64(),
                });
            }
        };
        let number = found.parse::<f64>().ok();
        let number = number.filter(|value| value.is_finite() && found.len() < LONGEST_ANSWER);
        number.ok_or_else(|| ProcessError::Answer {
            command: self.stage.command.clone(),
            line: self.lines,
            found: shown(&found),
        })
    }

    /// Its input ends: it has nothing more to say.
    fn finish(mut self) -> Result<(), ProcessError> {
        self.input = None;
        match self.answers.recv_timeout(ENDING) {
            Ok(found) => Err(self.unasked(found)),
            // One that goes on without input is ended.
            Err(RecvTimeoutError::Disconnected | RecvTimeoutError::Timeout) => Ok(()),
        }
    }

    fn unasked(&self, found: String) -> ProcessError {
        ProcessError::Unasked {
            command: self.stage.command.clone(),
            line: self.lines,
            found: shown(&found),
        }
    }

    fn ended(&mut self) -> ProcessError {
        let since = Instant::now();
        let mut status = None;
        while status.is_none() && since.elapsed() < ENDING {
            status = self.child.try_wait().ok().flatten();
            std::thread::sleep(Duration::from_millis(5));
        }
        ProcessError::Ended {
            command: self.stage.command.clone(),
            how: status.map_or("closed its output".to_owned(), |status: ExitStatus| {
                format!("ended ({status})")
            }),
            line: self.lines,
        }
    }
}

impl Drop for Process<'_> {
    fn drop(&mut self) {
        // One that has ended already cannot be ended; what is left of it is taken away.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The beginning of what a process wrote, for an error.
fn shown(found: &str) -> String {
    found.chars().take(40).flat_map(char::escape_debug).collect()
}

/// The readings of a stage in a process that rests at 0 V and then gets these commands: each of the instant at which its command goes out.
///
/// # Errors
/// A process that cannot be started, falls silent, ends or answers with anything but a number.
pub(crate) fn readings(stage: &ProcessStage, period_s: f64, voltage_v: &[f64]) -> Result<Vec<f64>, ProcessError> {
    let (mut process, mut measured) = Process::start(stage, period_s)?;
    let mut position_um = Vec::with_capacity(voltage_v.len());
    for &command_v in voltage_v {
        position_um.push(measured);
        measured = process.step(command_v)?;
    }
    process.finish()?;
    Ok(position_um)
}

/// Runs a controller, open and closed, on a stage in a process along the references of a programme; each run starts the process anew.
///
/// # Errors
/// A process that cannot be started, falls silent, ends or answers with anything but a number; a law that the core refuses.
///
/// # Cost
/// For all references 62 000 answers of the process in open loop, and as many in closed loop.
pub fn on_process(
    stage: &ProcessStage,
    controller: &Controller,
    range_um: [f64; 2],
    programme: &Programme,
    progress: &dyn Fn(f64),
) -> Result<Report, ControlError> {
    let plan = Plan::new(controller, range_um)?;
    let runs = plan.runs(&programme.played);
    let mut rows: Vec<Row> = Vec::with_capacity(runs.len());
    // One after the other: behind the process there may be a stage that is there once.
    for run in &runs {
        rows.push(plan.row(*run, &mut |closed, reference| {
            play(stage, controller, closed, reference)
        })?);
        progress(rows.len() as f64 / runs.len() as f64);
    }
    Ok(Report {
        range_um,
        left_out: Vec::new(),
        adaptation: controller.adaptation.clone(),
        rows,
        not_played: programme.not_played.clone(),
    })
}

/// One run from rest at 0 V. As on the simulated stage a position is read, the law computes, and its command is held for a sample.
fn play(
    stage: &ProcessStage,
    controller: &Controller,
    closed: bool,
    reference: &Reference,
) -> Result<Played, ControlError> {
    let law = match closed {
        true => controller.law::<f64>()?,
        false => controller.without_feedback().law()?,
    };
    let temperature_c = usual_temperature_c(&law);
    let mut state = law.rest(temperature_c);
    let (mut process, mut measured) = Process::start(stage, controller.model.sample_period_s)?;
    let rows = reference.samples_um.len() + law.ahead();
    let mut played = Played {
        command_v: Vec::with_capacity(rows),
        position_um: Vec::with_capacity(rows),
        adapted: None,
    };
    for k in 0..rows {
        let input = LoopInput {
            reference_ahead: reference.at(k),
            measured,
            temperature_c,
            ..LoopInput::default()
        };
        let command_v = law.step(&mut state, input);
        played.command_v.push(command_v);
        played.position_um.push(measured);
        measured = process.step(command_v)?;
    }
    process.finish()?;
    played.adapted = Adapted::of(&law, &state, controller.model.sample_period_s);
    Ok(played)
}
