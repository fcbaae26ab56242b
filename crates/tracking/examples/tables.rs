//! The tables of tracking errors in the book: simulated stages, each identified from records alone, its controller designed and run.
//!
//! ```sh
//! cargo run --release -p hysteron-tracking --example tables -- 5    # seeds
//! ```
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example prints its tables")]

use hysteron_control::design::source::{Source, Wishes, design};
use hysteron_control::design::{Controller, ReferenceKind};
use hysteron_control::reference::SHAPES;
use hysteron_plant::{StageConfig, preset};
use hysteron_tracking::bench::{Bench, ControllerFigures, TrackReport, compare};
use hysteron_tracking::campaign::campaign;
use hysteron_tracking::learning::learn_references;
use hysteron_tracking::robustness::{RobustnessRow, robustness};
use std::error::Error;

/// The stages, by their first mode.
const STAGES: [&str; 3] = ["8k", "2.5k", "739"];
/// Most corrections of a reference that is learned.
const ITERATIONS: usize = 12;
/// What is missing in a table.
const NONE: &str = "-";

/// What one seed of a stage gave.
struct Trial {
    report: TrackReport,
    /// The same with a reference that is not known ahead, and further tables; of the first seed alone.
    further: Option<Further>,
}

struct Further {
    live: TrackReport,
    changed: Vec<RobustnessRow>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).as_deref().unwrap_or("5").parse()?;
    let mut all = Vec::new();
    for name in STAGES {
        let stage = preset::named(name).ok_or("no such stage")?;
        let trials: Result<Vec<Trial>, Box<dyn Error>> = (1..=seeds).map(|seed| trial(name, &stage, seed)).collect();
        all.push((name, trials?));
    }
    errors(&all);
    steps(&all);
    bands(&all);
    rivals(&all);
    scans(&all);
    learned(&all);
    changed(&all);
    live(&all);
    Ok(())
}

/// Records, identifies, designs and tracks with one seed.
fn trial(name: &str, stage: &StageConfig, seed: u64) -> Result<Trial, Box<dyn Error>> {
    eprintln!("> {name}, seed {seed}");
    let records = campaign(name, stage, seed, &|_| ())?.records;
    let designed = |reference: ReferenceKind| {
        let wishes = Wishes {
            reference,
            ..Wishes::default()
        };
        design(&Source::Records(&records), &wishes).map(|designed| designed.controller)
    };
    let controller = designed(ReferenceKind::Previewed)?;
    let stroke_um = stage.hysteresis.stroke_um;
    let bench = |controller: &Controller| Bench {
        stage,
        // Records and runs must not share their noise.
        seed: !seed,
        range_um: [0.15 * stroke_um, 0.65 * stroke_um],
        first_mode_hz: controller.model.linear.modes.first().map(|mode| mode.frequency_hz),
    };
    let first = seed == 1;
    let report = TrackReport {
        learned: if first {
            learn_references(&bench(&controller), &controller, ITERATIONS)?
        } else {
            Vec::new()
        },
        ..compare(name, &bench(&controller), &controller, first && name == STAGES[0])?
    };
    let further = if first {
        let live = designed(ReferenceKind::Live)?;
        Some(Further {
            live: compare(name, &bench(&live), &live, false)?,
            changed: robustness(&bench(&controller), &controller)?,
        })
    } else {
        None
    };
    Ok(Trial { report, further })
}

/// The complete law in open loop or closed, of every seed.
fn complete<'a>(trials: &'a [Trial], loop_kind: &str) -> Vec<&'a ControllerFigures> {
    let of = |trial: &'a Trial| {
        let mut each = trial.report.controllers.iter();
        each.find(|c| c.loop_kind == loop_kind && c.name.starts_with("complete"))
    };
    trials.iter().filter_map(of).collect()
}

/// Rows of a table, one for each stage and loop that has a controller.
fn rows(all: &[(&str, Vec<Trial>)], row: impl Fn(&[&ControllerFigures]) -> Vec<String>) {
    for (name, trials) in all {
        for loop_kind in ["open", "closed"] {
            let figures = complete(trials, loop_kind);
            if !figures.is_empty() {
                println!("| `{name}`, {loop_kind} | {} |", row(&figures).join(" | "));
            }
        }
    }
    println!();
}

/// The largest of some values; none where one of them is missing.
fn largest(mut values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values.try_fold(f64::NEG_INFINITY, |largest, value| Some(largest.max(value?)))
}

fn smallest(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    largest(values.map(|value| Some(-value?))).map(|value| -value)
}

fn cell(value: Option<f64>, digits: usize) -> String {
    value.map_or(NONE.to_owned(), |value| format!("{value:.digits$}"))
}

/// Errors on each reference.
fn percents(controller: &ControllerFigures) -> Vec<String> {
    let of = |shape: &str| cell(controller.rms_percent.get(shape).copied(), 3);
    SHAPES.iter().map(|(shape, _)| of(shape)).collect()
}

fn heading(first: &str, columns: &[String]) {
    println!("| {first} | {} |", columns.join(" | "));
    println!("|---|{}", "---|".repeat(columns.len()));
}

/// Names of the references, with a unit.
fn references() -> Vec<String> {
    let spelled = |name: &str| match name.strip_suffix("-100") {
        Some(shape) => format!("{} 100", shape.replace('-', " ")),
        None => format!("{name} Hz"),
    };
    SHAPES.iter().map(|(name, _)| spelled(name)).collect()
}

fn errors(all: &[(&str, Vec<Trial>)]) {
    let seeds = all.first().map_or(0, |(_, trials)| trials.len());
    println!("**Rms error of the true position, percent of the range; worst of {seeds} seeds**\n");
    let mut columns = references();
    columns.extend([
        "creep, 10 s holds".into(),
        "noise at rest, nm".into(),
        "unstable".into(),
    ]);
    heading("stage, loop", &columns);
    rows(all, |figures| {
        let rms = SHAPES.iter().map(|(shape, _)| {
            let worst = largest(figures.iter().map(|f| f.rms_percent.get(*shape).copied()));
            cell(worst, 3)
        });
        let mut cells: Vec<String> = rms.collect();
        cells.push(cell(largest(figures.iter().map(|f| f.creep_peak_percent)), 3));
        cells.push(cell(largest(figures.iter().map(|f| Some(f.noise_nm))), 2));
        cells.push(figures.iter().filter(|f| !f.stable).count().to_string());
        cells
    });
}

fn steps(all: &[(&str, Vec<Trial>)]) {
    println!("**A jump of a tenth of the range; worst of the seeds**\n");
    heading(
        "stage, loop",
        &["settled to 1 %, ms".into(), "overshoot, % of the step".into()],
    );
    rows(all, |figures| {
        vec![
            cell(largest(figures.iter().map(|f| f.step_settling_ms)), 1),
            cell(largest(figures.iter().map(|f| Some(f.step_overshoot_percent))), 0),
        ]
    });
}

fn bands(all: &[(&str, Vec<Trial>)]) {
    println!("**Small-signal bandwidth, Hz; least of the seeds**\n");
    heading("stage, loop", &["lag of 30 degrees".into(), "gain of -3 dB".into()]);
    rows(all, |figures| {
        vec![
            cell(smallest(figures.iter().map(|f| f.lag30_hz)), 0),
            cell(smallest(figures.iter().map(|f| f.minus3db_hz)), 0),
        ]
    });
}

fn rivals(all: &[(&str, Vec<Trial>)]) {
    let Some((name, trials)) = all.first() else { return };
    println!("**The paper's controllers on `{name}`, seed 1, rms error, percent of the range**\n");
    heading("controller", &references());
    let controllers = trials.iter().take(1).flat_map(|trial| &trial.report.controllers);
    for controller in controllers.filter(|c| !c.name.starts_with("complete")) {
        println!("| {} | {} |", controller.name, percents(controller).join(" | "));
    }
    println!();
}

fn scans(all: &[(&str, Vec<Trial>)]) {
    println!(
        "**Scans at 100 lines a second, seed 1: rms error of axis 1 / axis 2 / distance from the path, percent of the range**\n"
    );
    heading("stage, scan, controller, loop", &["error".into()]);
    for (name, trials) in all {
        for scan in trials.iter().take(1).flat_map(|trial| &trial.report.scans) {
            println!(
                "| `{name}`, {}, {}, {} | {:.3} / {:.3} / {:.3} |",
                scan.scan, scan.name, scan.loop_kind, scan.x_percent, scan.y_percent, scan.path_percent
            );
        }
    }
    println!();
}

fn learned(all: &[(&str, Vec<Trial>)]) {
    println!("**References learned run by run, open loop, seed 1: error before / kept, percent of the range**\n");
    heading("stage, reference", &["error".into(), "runs".into()]);
    for (name, trials) in all {
        for learned in trials.iter().take(1).flat_map(|trial| &trial.report.learned) {
            let error = |number: usize| learned.iterations.get(number).and_then(|i| i.true_percent);
            println!(
                "| `{name}`, {} | {} / {} | {} |",
                learned.name,
                cell(error(0), 3),
                cell(error(learned.kept), 3),
                learned.iterations.len()
            );
        }
    }
    println!();
}

fn changed(all: &[(&str, Vec<Trial>)]) {
    println!("**The same controller on changed stages, seed 1: open / closed, percent of the range**\n");
    let mut columns = references();
    columns.push("stable".into());
    heading("stage, change", &columns);
    for (name, trials) in all {
        let rows: Vec<&RobustnessRow> = trials
            .iter()
            .filter_map(|t| t.further.as_ref())
            .flat_map(|f| &f.changed)
            .collect();
        for open in rows.iter().filter(|row| row.loop_kind == "open") {
            let closed = rows
                .iter()
                .find(|row| row.change == open.change && row.loop_kind == "closed");
            let of = |row: &RobustnessRow, shape: &str| row.rms_percent.get(shape).copied();
            let pair = |shape: &str| {
                format!(
                    "{} / {}",
                    cell(of(open, shape), 3),
                    cell(closed.and_then(|row| of(row, shape)), 3)
                )
            };
            let mut cells: Vec<String> = SHAPES.iter().map(|(shape, _)| pair(shape)).collect();
            let stable = open.stable && closed.is_none_or(|row| row.stable);
            cells.push(if stable { "yes" } else { "no" }.to_owned());
            println!("| `{name}`, {} | {} |", open.change, cells.join(" | "));
        }
    }
    println!();
}

fn live(all: &[(&str, Vec<Trial>)]) {
    println!("**A reference that is not known ahead, seed 1, rms error, percent of the range**\n");
    let mut columns = references();
    columns.push("30 degrees, Hz".into());
    heading("stage, loop", &columns);
    for (name, trials) in all {
        let live = trials
            .iter()
            .filter_map(|trial| trial.further.as_ref())
            .flat_map(|f| &f.live.controllers);
        for controller in live {
            let mut cells = percents(controller);
            cells.push(cell(controller.lag30_hz, 0));
            println!("| `{name}`, {} | {} |", controller.loop_kind, cells.join(" | "));
        }
    }
    println!();
}
