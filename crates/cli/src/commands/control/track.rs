//! `hysteron track`.

use crate::commands::board::EmulatorName;
use crate::commands::control::{changed, learning, on_board, on_model, on_process, page, range_um, stage};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_control::adapted::Adapted;
use hysteron_control::design::Controller;
use hysteron_control::design::beyond::{self, NotPlayed};
use hysteron_control::reference::SHAPES;
use hysteron_identify::covered::Beyond;
use hysteron_plant::StageConfig;
use hysteron_report::{Runs, adapted_text, beyond_text, reference_name};
use hysteron_table::short;
use hysteron_tracking::bench::{Bench, ControllerFigures, STAIRCASE, TrackReport, compare};
use hysteron_tracking::learning::learn_references;
use hysteron_tracking::scans::{LINES_HZ, ScanFigures};
use hysteron_trials::on_chip::{self, OnChip};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron track controller.toml --stage 8k --json\n  \
    hysteron track controller.toml --stage 8k --alone --emulator mps2-an386    # and on the chip\n  \
    hysteron track controller.toml --model model.toml                          # on your own identified model\n  \
    hysteron track controller.toml --process 'python3 stage.py'                 # on a stage of your own, as a process\n  \
    hysteron track controller.toml --board localhost:9090 --range 3,13         # on a board that has its table\n\n\
    Errors are rms of reference minus true position over whole periods after settling, percent of the reference's\n\
    peak to peak, the mean included. Position k is compared with reference k: nothing is shifted.")]
pub(crate) struct TrackArgs {
    /// Controller file of `hysteron design`
    pub controller: PathBuf,
    /// The simulated stage: paper-rate, paper-delay, 8k, 2.5k or 739
    #[arg(long, value_name = "PRESET", required_unless_present_any = ["board", "model", "process"])]
    pub stage: Option<String>,
    /// Your own identified model instead, model.toml: what the design expects beside what comes out on it
    #[arg(
        long,
        value_name = "MODEL",
        conflicts_with_all = ["stage", "board", "output", "robustness", "alone", "iterations", "emulator"]
    )]
    pub model: Option<PathBuf>,
    /// A stage of your own in any language instead: a program, with its arguments, that reads volts and writes positions, a line each; see
    /// docs/reference/process.md
    #[arg(
        long,
        value_name = "COMMAND",
        conflicts_with_all = ["stage", "board", "model", "output", "robustness", "alone", "iterations", "emulator"]
    )]
    pub process: Option<String>,
    /// Longest wait for an answer of the process, seconds
    #[arg(long, value_name = "S", default_value_t = 10.0, requires = "process")]
    pub timeout: f64,
    /// A real board with the controller's table instead: udp://HOST:PORT on a cable, or HOST:PORT of a server of its RTT channel 1; measured position; scans as well
    /// where it has both axes
    #[arg(
        long,
        value_name = "HOST:PORT",
        conflicts_with_all = ["stage", "output", "robustness", "alone", "emulator"]
    )]
    pub board: Option<String>,
    /// Which of the board's tables runs, from 0 on
    #[arg(long, default_value_t = 0, requires = "board")]
    pub bank: u8,
    /// Lowest and highest reference, micrometres; without it half the stroke about two fifths of it
    #[arg(long, value_name = "LOW,HIGH", value_delimiter = ',', num_args = 1)]
    pub range: Option<Vec<f64>>,
    /// References beyond the positions that the records cover and, where a real stage may be, faster ones, left out otherwise
    #[arg(long)]
    pub beyond_records: bool,
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html")]
    pub output: Option<PathBuf>,
    /// The same controller on changed stages instead: gain +-10 %, mass +-20 %, one more sample of delay, 30 % Bouc-Wen
    #[arg(long, conflicts_with_all = ["output", "alone"])]
    pub robustness: bool,
    /// Leave the paper's controllers out
    #[arg(long)]
    pub alone: bool,
    /// Also learn references that repeat, run by run, with at most so many corrections: 1 to 50; on a board and with an emulator there,
    /// in 256 points
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=50), conflicts_with = "robustness")]
    pub iterations: Option<u32>,
    /// Folder for what was learned, 256 positions a reference, as `board run --trajectory` takes them
    #[arg(long, value_name = "FOLDER", requires = "iterations")]
    pub keep: Option<PathBuf>,
    /// Also run the controller as firmware in QEMU at the same stage: an image is built for each loop
    #[arg(long, value_enum, conflicts_with = "robustness")]
    pub emulator: Option<EmulatorName>,
    /// The firmware's sources
    #[arg(long, value_name = "FOLDER", default_value = "firmware", requires = "emulator")]
    pub firmware: PathBuf,
    /// Seed of the sensor noise
    #[arg(long, default_value_t = SEED)]
    pub seed: u64,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// Seed of the sensor noise where nobody gives another.
pub(super) const SEED: u64 = 1;

/// The paper's own figures at 500 Hz on its hardware, percent: open-loop MPI and MRPI, PI alone and with each.
pub(super) const PUBLISHED_500_HZ: [(&str, f64); 5] = [
    ("paper's MPI", 11.0),
    ("paper's MRPI", 1.6),
    ("paper's PI", 37.0),
    ("paper's PI + MPI", 12.3),
    ("paper's PI + MRPI", 2.3),
];

#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    report: &'a TrackReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    board: &'a Option<OnChip>,
    /// What of the references leaves the records.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    beyond: &'a [Beyond],
}

pub(crate) fn run(args: &TrackArgs) -> Result<Done, CliError> {
    let controller = Controller::read(&args.controller)?;
    let given_um = range_um(args.range.as_deref())?;
    if let Some(command) = &args.process {
        return on_process::track(args, command, given_um, &controller);
    }
    match (&args.stage, &args.board, &args.model) {
        (_, Some(from), _) => on_board::track(args, from, given_um, &controller),
        (_, None, Some(path)) => on_model::track(args, path, given_um, &controller),
        (Some(name), None, None) => on_stage(args, name, given_um, &controller),
        (None, None, None) => Err(CliError::Option(
            "give --model MODEL, --process COMMAND, --stage PRESET or --board HOST:PORT".to_owned(),
        )),
    }
}

fn on_stage(
    args: &TrackArgs,
    name: &str,
    given_um: Option<[f64; 2]>,
    controller: &Controller,
) -> Result<Done, CliError> {
    let stage = stage(name)?;
    let range_um = given_um.unwrap_or(usual_um(&stage));
    let beyond = beyond::simulated(controller, range_um, args.beyond_records)?;
    let bench = bench(&stage, args.seed, range_um, controller);
    if args.robustness {
        return changed::stages(args, (name, &bench), controller, &beyond);
    }
    // Refused first where it cannot be: the rest takes its time.
    let learned = args
        .iterations
        .map(|most| learn_references(&bench, controller, most as usize));
    let learned = learned.transpose()?.unwrap_or_default();
    let report = TrackReport {
        learned,
        ..compare(name, &bench, controller, !args.alone)?
    };
    let board = args
        .emulator
        .map(|emulator| on_chip(args, emulator, &bench, controller, report.measured_shares))
        .transpose()?;
    if let Some(folder) = &args.keep {
        let on_chip = board.as_ref().map(|board| &board.learned);
        learning::keep(folder, on_chip.unwrap_or(&report.learned), bench.range_um)?;
    }
    if let Some(path) = &args.output {
        output::write_file(path, &page::page(&report, board.as_ref(), controller, args))?;
    }
    if args.json {
        output::print_json(&Answer {
            report: &report,
            board: &board,
            beyond: &beyond,
        })?;
    } else {
        output::print(&(text(&report) + &board.as_ref().map_or_else(String::new, board_text) + &beyond_text(&beyond)))?;
    }
    Ok(ended(&report))
}

/// The references' range where nobody gives another, micrometres.
pub(super) fn usual_um(stage: &StageConfig) -> [f64; 2] {
    [0.15, 0.65].map(|share| share * stage.hysteresis.stroke_um)
}

/// A stage with its references and its noise.
pub(super) fn bench<'a>(stage: &'a StageConfig, seed: u64, range_um: [f64; 2], controller: &Controller) -> Bench<'a> {
    Bench {
        stage,
        // Records and runs must not share their noise.
        seed: !seed,
        range_um,
        first_mode_hz: controller.model.linear.modes.first().map(|mode| mode.frequency_hz),
    }
}

/// How a run ends: the paper's own controllers are for comparison.
fn ended(report: &TrackReport) -> Done {
    let mut own = report.controllers.iter().filter(|controller| is_own(controller));
    if own.all(|controller| controller.stable) {
        Done::Answered
    } else {
        Done::Unstable
    }
}

fn is_own(controller: &ControllerFigures) -> bool {
    !controller.name.starts_with("paper's")
}

/// The same controller as firmware.
fn on_chip(
    args: &TrackArgs,
    emulator: EmulatorName,
    bench: &Bench<'_>,
    controller: &Controller,
    measured_shares: [f64; 2],
) -> Result<OnChip, CliError> {
    let asked = on_chip::Asked {
        machine: emulator.machine(),
        firmware: &args.firmware,
        beyond_records: args.beyond_records,
        iterations: args.iterations.map(|most| most as usize),
        measured_shares,
    };
    let bar = progress::bar("on the chip");
    let report = on_chip::track(controller, bench, &asked, &|what, share| {
        progress::show(&bar, what, share)
    });
    bar.finish_and_clear();
    Ok(report?)
}

/// What a loop had learned at the end of its runs, in their order.
pub(super) fn in_order<'a>(
    loop_kind: &'a str,
    adapted: &'a BTreeMap<String, Adapted>,
) -> impl Iterator<Item = (&'a str, &'a str, Adapted)> {
    references().filter_map(move |key| Some((key, loop_kind, *adapted.get(key)?)))
}

fn board_text(board: &OnChip) -> String {
    let mut text = format!(
        "\nON THE CHIP: the controller as firmware in {}, an image for each loop; the same references, true position, %; creep:\n\
         largest error of a hold of 10 s, from 5 ms after the move\n\n{:<6}{} {:>7}\n",
        board.machine,
        "loop",
        heads(),
        "creep"
    );
    for controller in &board.controllers {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<6}{} {:>7.3}",
            controller.loop_kind,
            cells(&controller.rms_percent),
            controller.creep_peak_percent
        );
    }
    let _ = writeln!(
        text,
        "{} ticks by the sample clock, {} of them late or lost; the others worked out ahead, every frame compared with the host's",
        board.clocked_ticks, board.late_ticks
    );
    let learned = board.controllers.iter();
    let learned = learned.flat_map(|controller| in_order(controller.loop_kind, &controller.adapted));
    text.push_str(&adapted_text(board.adaptation.as_ref(), Runs::Alone, learned));
    text.push_str(&learning::text(&board.learned, " on the chip"));
    text.push_str("\nSCANS of both axes by one image: figures as of the scans above\n\n");
    text + &scan_rows(&board.scans)
}

/// The first mode in words.
pub(super) fn first_mode(hz: Option<f64>) -> String {
    hz.map_or("rigid".to_owned(), |hz| format!("first mode {hz:.0} Hz"))
}

/// Heads of the columns of [`SHAPES`].
const COLUMNS: [&str; 7] = ["10 Hz", "100", "500", "503", "1000", "complex", "triangle"];

/// The columns' heads in a line.
pub(super) fn heads() -> String {
    COLUMNS.iter().map(|column| format!(" {column:>8}")).collect()
}

/// A bandwidth; none where it lies beyond what was looked at.
pub(super) fn hertz(value: Option<f64>) -> String {
    value.map_or("none".to_owned(), |hz| format!("{hz:.0}"))
}

/// Errors by reference under them.
pub(super) fn cells(rms_percent: &BTreeMap<String, f64>) -> String {
    let cell = |(key, _): &(&str, _)| match rms_percent.get(*key) {
        Some(percent) => format!(" {percent:>8.3}"),
        None => format!(" {:>8}", "-"),
    };
    SHAPES.iter().map(cell).collect()
}

/// References that were left out, why, and what would play them.
pub(super) fn not_played(left: &[NotPlayed]) -> String {
    let Some(NotPlayed { beyond, .. }) = left.first() else {
        return String::new();
    };
    let names: Vec<String> = left.iter().map(|left| reference_name(left.reference)).collect();
    // All of them leave the same ends.
    let [low, high] = beyond.covered;
    format!(
        "not played: {}; the records cover references of {low:.0} to {high:.0} Hz. To play them, {}, or give --beyond-records\n",
        names.join(", "),
        beyond.field.widen()
    )
}

/// Names of the references of which it is known what was learned on them.
pub(super) fn references() -> impl Iterator<Item = &'static str> {
    SHAPES.iter().map(|(key, _)| *key).chain([STAIRCASE])
}

/// What the controllers did on a stage.
pub(super) fn text(report: &TrackReport) -> String {
    let mut text = String::new();
    let mode = first_mode(report.first_mode_hz);
    // Writing to a String does not fail.
    let _ = writeln!(
        text,
        "STAGE {} (simulated), {mode}; stroke {} um; errors against the reference at the same instant, {} position\n\
         rms, % of peak to peak; creep: largest error from 5 ms after moves, 10 s holds; step: time until the error after a set-point\n\
         step of a tenth of the range stays below 1 % of it, and overshoot\n",
        report.stage,
        short(report.stroke_um),
        report.position
    );
    let widest = report.controllers.iter().map(|c| c.name.len()).max().unwrap_or(0);
    let _ = writeln!(
        text,
        "{:<widest$} {:<6}{} {:>7} {:>8} {:>5} {:>9} {:>9} {:>6}  paper at 500 Hz",
        "",
        "loop",
        heads(),
        "creep",
        "step ms",
        "over%",
        "30 deg Hz",
        "-3 dB Hz",
        "nm"
    );
    for controller in &report.controllers {
        text.push_str(&line(controller, widest));
    }
    let ran = report.controllers.iter();
    let ran = ran.flat_map(|controller| in_order(controller.loop_kind, &controller.adapted));
    text.push_str(&adapted_text(report.adaptation.as_ref(), Runs::Alone, ran));
    text + &learning::text(&report.learned, "") + &scans_text(report)
}

/// The table of the scans.
fn scans_text(report: &TrackReport) -> String {
    let [x, y] = report.measured_shares;
    let mut text = format!(
        "\nSCANS of both axes at {LINES_HZ} lines a second, the same controller on each; {:.2} and {:.2} % of the other's motion reach\n\
         each axis, as measured first. Error of each axis at the same instant, distance from the path (late along it is none)\n\n",
        100.0 * x,
        100.0 * y
    );
    text.push_str(&scan_rows(&report.scans));
    text
}

/// A line a scan.
pub(super) fn scan_rows(scans: &[ScanFigures]) -> String {
    let mut text = String::new();
    let widest = scans.iter().map(|scan| scan.name.len()).max().unwrap_or(0);
    // Writing to a String does not fail.
    let _ = writeln!(
        text,
        "{:<7} {:<widest$} {:<6} {:>8} {:>8} {:>8} {:>12}",
        "", "", "loop", "x, %", "y, %", "path, %", "largest, nm"
    );
    for scan in scans {
        let _ = writeln!(
            text,
            "{:<7} {:<widest$} {:<6} {:>8.3} {:>8.3} {:>8.3} {:>12.1}",
            scan.scan,
            scan.name,
            scan.loop_kind,
            scan.x_percent,
            scan.y_percent,
            scan.path_percent,
            scan.path_largest_nm
        );
    }
    text
}

fn line(controller: &ControllerFigures, widest: usize) -> String {
    let mut text = format!(
        "{:<widest$} {:<6}{}",
        controller.name,
        controller.loop_kind,
        cells(&controller.rms_percent)
    );
    let creep = controller
        .creep_peak_percent
        .map_or("-".to_owned(), |peak| format!("{peak:.3}"));
    let settling = controller
        .step_settling_ms
        .map_or("-".to_owned(), |settling_ms| format!("{settling_ms:.2}"));
    let published = PUBLISHED_500_HZ
        .iter()
        .find(|(name, _)| *name == controller.name)
        .map_or(String::new(), |(_, percent)| percent.to_string());
    let _ = writeln!(
        text,
        " {creep:>7} {settling:>8} {:>5.1} {:>9} {:>9} {:>6.2}  {published}",
        controller.step_overshoot_percent,
        hertz(controller.lag30_hz),
        hertz(controller.minus3db_hz),
        controller.noise_nm
    );
    if !controller.stable {
        let advice = if is_own(controller) {
            "; do not run it: design it with a smaller --margin, or --open"
        } else {
            ""
        };
        let _ = writeln!(
            text,
            "{:<widest$}        UNSTABLE: it swings by itself, {:.1} nm rms at rest{advice}",
            "", controller.noise_nm
        );
    }
    if !controller.limited_on.is_empty() {
        let _ = writeln!(
            text,
            "{:<widest$}        met the amplifier's limits on {}",
            "",
            controller.limited_on.join(", ")
        );
    }
    text
}
