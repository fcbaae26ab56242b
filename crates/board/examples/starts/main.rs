//! The boards' images in a processor model: a long run against the host's law, then starts and faults, as one table: of each
//! the milliseconds until the outputs are safe, and their largest step in codes.
//!
//! `cargo xtask firmware starts` builds the images, installs the model and runs this. The model (`processor.py`) is a process of its own
//! with the registers that the images use; stage, converters of the outputs, the host's law and the judgement are here.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example of the command line"
)]

#[allow(dead_code, reason = "some of it is for a cable that loses frames")]
#[path = "../link/cable.rs"]
mod cable;
mod host;
mod judge;
mod processor;
mod rig;
mod scenarios;

use host::Axis;
use hysteron_board::slots::packed;
use hysteron_board::two_axes::coupled;
use hysteron_firmware::chips::{Chip, G474, H743};
use hysteron_plant::{Stage, preset};
use hysteron_table::Table;
use judge::{Row, judge};
use processor::{Failure, Processor};
use rig::Rig;
use scenarios::{SCENARIOS, Scenario, press};
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;
use tempfile::TempDir;

/// An image: its name in the table, its file, the chip, and each axis' table and stage.
#[derive(Clone, Copy)]
struct Image {
    label: &'static str,
    file: &'static str,
    chip: Chip,
    axes: &'static [(&'static str, &'static str)],
    /// Whether a start finds another table than the image's in the first slot of flash.
    stored: bool,
}

/// Those that `cargo xtask firmware boards` builds with complete laws.
const IMAGES: [Image; 5] = [
    Image {
        label: "nucleo-g474re",
        file: "nucleo-g474re-tracking-8k",
        chip: G474,
        axes: &[("tracking-8k", "8k")],
        stored: false,
    },
    Image {
        label: "nucleo-h743zi",
        file: "nucleo-h743zi-tracking-8k",
        chip: H743,
        axes: &[("tracking-8k", "8k")],
        stored: false,
    },
    Image {
        label: "nucleo-h743zi, both axes",
        file: "nucleo-h743zi-tracking-x-y",
        chip: H743,
        axes: &[("tracking-x", "8k"), ("tracking-y", "739")],
        stored: false,
    },
    Image {
        label: "nucleo-g474re, a table in its slot",
        file: "nucleo-g474re-tracking-8k",
        chip: G474,
        axes: &[("tracking-8k", "8k")],
        stored: true,
    },
    Image {
        label: "nucleo-h743zi, a table in its slot",
        file: "nucleo-h743zi-tracking-8k",
        chip: H743,
        axes: &[("tracking-8k", "8k")],
        stored: true,
    },
];
/// What a table in a slot has instead of the image's: another range, whose sine other codes belong to.
const OTHER: (&str, &str) = ("\ninput_max_um = ", "\ninput_max_um = 12.0 # ");
/// What of the other axis' motion reaches each, as the tables have it.
const SHARES: [f64; 2] = [0.01, -0.006];
const SEED: u64 = 7;
/// Ticks of the long run: twenty periods of its reference.
const TICKS: u64 = 100_000;

fn main() -> ExitCode {
    let begun = Instant::now();
    let results: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = IMAGES.iter().map(|image| scope.spawn(|| run(image))).collect();
        threads.into_iter().map(|thread| thread.join()).collect()
    });
    let mut ran = Vec::new();
    for (image, result) in IMAGES.iter().zip(results) {
        match result {
            Ok(Ok(of_image)) => ran.push(of_image),
            Ok(Err(error)) => eprintln!("{}: {error}", image.file),
            Err(_) => eprintln!("{}: its thread has panicked", image.file),
        }
    }
    print(&ran);
    eprintln!("{:.0} s", begun.elapsed().as_secs_f64());
    let is_right = |of_image: &Ran| of_image.is_right && of_image.rows.iter().all(|row| row.is_right);
    if ran.len() == IMAGES.len() && ran.iter().all(is_right) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// What came of one image.
struct Ran {
    label: &'static str,
    /// The long run, as a row of the first table, and whether it is as it must be.
    long: String,
    is_right: bool,
    rows: Vec<Row>,
}

/// Both tables; a scenario is a row, an image a column.
fn print(ran: &[Ran]) {
    println!(
        "| image | ticks | DAC codes other than the host's | latched at | changes beside it | frames of telemetry | other frames | samples by the cable | other samples, missing ticks | lowest and highest code |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    ran.iter().for_each(|of_image| println!("{}", of_image.long));
    let ran: Vec<&Ran> = ran.iter().filter(|of_image| !of_image.rows.is_empty()).collect();
    let labels: Vec<&str> = ran.iter().map(|of_image| of_image.label).collect();
    println!("\n| start or fault | at most | {} | end |", labels.join(" | "));
    println!("|---|---|{}---|", "---|".repeat(ran.len()));
    for scenario in &SCENARIOS {
        let of_image = |of_image: &&Ran| of_image.rows.iter().position(|row| row.name == scenario.name);
        let rows: Vec<Option<&Row>> = ran.iter().map(|all| all.rows.get(of_image(all)?)).collect();
        let at_most = rows.iter().flatten().next().map_or("", |row| row.at_most.as_str());
        let took: Vec<&str> = rows
            .iter()
            .map(|row| row.map_or("-", |row| row.took.as_str()))
            .collect();
        let mut ends: Vec<&str> = rows.iter().flatten().map(|row| row.end.as_str()).collect();
        ends.dedup();
        println!(
            "| {} | {at_most} | {} | {} |",
            scenario.name,
            took.join(" | "),
            ends.join("; ")
        );
    }
}

/// All of one image.
fn run(image: &Image) -> Result<Ran, Failure> {
    let (mut rig, _folder) = rig(image)?;
    let (long, is_right) = long_run(&mut rig, image.label)?;
    // Whichever table runs, the starts are the same.
    let of_board = |scenario: &&Scenario| !image.stored && scenario.board.is_none_or(|board| board == image.chip.board);
    let rows = SCENARIOS
        .iter()
        .filter(of_board)
        .map(|scenario| judge(&mut rig, scenario));
    Ok(Ran {
        label: image.label,
        long,
        is_right,
        rows: rows.collect::<Result<_, _>>()?,
    })
}

/// The folder is what the model reads at its start.
fn rig(image: &Image) -> Result<(Rig, TempDir), Failure> {
    let interpreter = std::env::var("HYSTERON_UNICORN")
        .map_err(|_| "HYSTERON_UNICORN names no Python with unicorn; run cargo xtask firmware starts")?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware");
    let file = root.join("target/images").join(image.file);
    if !file.exists() {
        return Err(format!("no image {}; run cargo xtask firmware starts", file.display()).into());
    }
    let mut axes = Vec::new();
    let mut configs = Vec::new();
    let folder = tempfile::tempdir()?;
    let mut slot = None;
    for (table, stage) in image.axes {
        let path = root.join(format!("tables/{table}.toml"));
        let mut text = std::fs::read_to_string(path)?;
        if image.stored {
            text = text.replacen(OTHER.0, OTHER.1, 1);
            let file = folder.path().join("slot");
            std::fs::write(&file, packed(&Table::parse(&text)?, &text)?)?;
            slot = Some(file);
        }
        axes.push(Axis::new(&text)?);
        configs.push(preset::named(stage).ok_or("no such stage")?);
    }
    let stages = match configs.as_slice() {
        [x, y] => coupled([x, y], SHARES, SEED)?.to_vec(),
        configs => {
            let stages = configs.iter().map(|config| Stage::new(config, SEED));
            stages.collect::<Result<_, _>>()?
        }
    };
    let processor = Processor::start(&interpreter, &file, image.chip.board, slot.as_deref())?;
    Ok((Rig::new(processor, image.chip, axes, stages), folder))
}

/// The closed loop on the stage: every code and every frame is the host's.
fn long_run(rig: &mut Rig, label: &str) -> Result<(String, bool), Failure> {
    rig.power_on()?;
    rig.until("the loop", 5000, Rig::is_looping)?;
    let on_a_cable = label.contains(H743.board);
    if on_a_cable {
        rig.connect()?;
    }
    press(rig)?;
    let mut low = u16::MAX;
    let mut high = 0;
    while u64::from(rig.counts.ticks) < TICKS {
        rig.go(100)?;
        let code = rig.outputs.first().copied().unwrap_or_default();
        (low, high) = (low.min(code), high.max(code));
    }
    rig.disconnect();
    let counts = rig.counts;
    // A run that does not move would agree, too; telemetry that does not come as well.
    let right = counts.different == 0
        && counts.silent == 0
        && counts.beside_latch == 0
        && counts.telemetry_different == 0
        && counts.bites == 0
        && rig.fault().is_none()
        && high - low > 20_000
        && counts.telemetry > 9 * counts.ticks / 10 * rig.axes.len() as u32
        && (counts.by_cable.samples > u64::from(9 * counts.ticks / 10 * rig.axes.len() as u32)) == on_a_cable
        && counts.by_cable.wrong + counts.by_cable.missing == 0;
    let wrong = format!(", WRONG ({:?}, {:?})", rig.mode(), rig.fault());
    let row = format!(
        "| {label}{} | {} | {} | {:.2} us | {} | {} | {} | {} | {}, {} | {low}, {high} |",
        if right { "" } else { wrong.as_str() },
        counts.ticks,
        counts.different,
        1e3 * rig.ms(rig.latch()),
        counts.beside_latch,
        counts.telemetry,
        counts.telemetry_different,
        counts.by_cable.samples,
        counts.by_cable.wrong,
        counts.by_cable.missing,
    );
    Ok((row, right))
}
