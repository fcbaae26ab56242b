//! Every controller on every reference, in the emulator and on the host: one table, and whether each frame is the same.
//!
//! `cargo xtask firmware compare` builds the images, one a table, and runs this. For each preset of the paper: the straight line
//! alone (open loop), PI alone, and PI with the inverse of each family. For stages to be tracked with: the complete law, open and
//! closed. Each cell is the rms of reference less sensor over the later
//! half of 0.2 s, in percent of peak to peak. The image gets the codes that the stage gave the host; as long as it answers with the
//! host's codes, they are those that the stage gives it. Its ticks do not wait for the sample clock; those of the tests do.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example of the command line"
)]

use hysteron_board::host::{complete, hello, parameters};
use hysteron_board::{Bench, Machine, Request, Rig, Session, Shape, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Law;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::wire::{Frame, Input, Setup};
use hysteron_plant::{Stage, StageConfig, preset};
use hysteron_table::Table;
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

/// Name in the table, the table's family, whether its inverse and whether the PI controller runs.
const CONTROLLERS: [(&str, &str, bool, bool); 6] = [
    ("open loop", "linear", true, false),
    ("PI", "mrpi", false, true),
    ("PI + MPI", "mpi", true, true),
    ("PI + WRPI", "wrpi", true, true),
    ("PI + MRPI", "mrpi", true, true),
    ("PI + play-polynomial", "play-polynomial", true, true),
];

/// Half the stroke about two fifths of it, as `hysteron track` takes it.
const COMPLETE_UM: [f64; 2] = [3.0, 13.0];

/// Stages with a table of a complete law.
const COMPLETE: [(&str, &str); 2] = [("8k", "tracking-8k"), ("739", "tracking-739")];

/// Two periods of the slowest reference.
const SECONDS: f64 = 0.2;

type Reference = (&'static str, Shape, f64);

const REFERENCES: [Reference; 8] = [
    ("10 Hz", Shape::Sine, 10.0),
    ("50 Hz", Shape::Sine, 50.0),
    ("100 Hz", Shape::Sine, 100.0),
    ("200 Hz", Shape::Sine, 200.0),
    ("300 Hz", Shape::Sine, 300.0),
    ("400 Hz", Shape::Sine, 400.0),
    ("500 Hz", Shape::Sine, 500.0),
    ("complex", Shape::ComplexHarmonic, 100.0),
];

const COMPLETE_REFERENCES: [Reference; 5] = [
    ("10 Hz", Shape::Sine, 10.0),
    ("100 Hz", Shape::Sine, 100.0),
    ("500 Hz", Shape::Sine, 500.0),
    ("complex", Shape::ComplexHarmonic, 100.0),
    ("triangle", Shape::Triangle, 100.0),
];

const PATIENCE: Duration = Duration::from_secs(300);
const SEED: u64 = 7;

fn main() -> ExitCode {
    match table() {
        Ok(0) => ExitCode::SUCCESS,
        Ok(different) => {
            eprintln!("{different} frames differ between the emulator and the host");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints the table; how many frames differ.
fn table() -> Result<usize, Box<dyn Error>> {
    let mut different = 0;
    for (name, config) in [
        ("paper-rate", preset::paper_rate()),
        ("paper-delay", preset::paper_delay()),
    ] {
        head(name, &REFERENCES);
        for (controller, family, feedforward, feedback) in CONTROLLERS {
            let mut image = Image::start(&format!("{name}-{family}"))?;
            let parameters = parameters(&image.table)?;
            let parts = (None, [feedforward, feedback]);
            different += image.row(controller, parameters, &config, &REFERENCES, parts)?;
        }
        println!("{}", Image::start(&format!("{name}-mrpi"))?.timing(&config)?);
    }
    for (name, table) in COMPLETE {
        let config = preset::named(name).ok_or("no such stage")?;
        head(name, &COMPLETE_REFERENCES);
        let mut image = Image::start(table)?;
        let parameters = complete(&image.table)?;
        for (controller, feedback) in [("complete, open loop", false), ("complete, closed", true)] {
            let parts = (Some(COMPLETE_UM), [true, feedback]);
            different += image.row(controller, parameters, &config, &COMPLETE_REFERENCES, parts)?;
        }
        println!("{}", image.timing(&config)?);
    }
    Ok(different)
}

fn head(name: &str, references: &[Reference]) {
    let heads: Vec<String> = references
        .iter()
        .map(|reference| format!("{:>9}", reference.0))
        .collect();
    println!(
        "\n{name}: rms error in % of peak to peak, {}\n{:<22}{}   frames equal",
        Machine::Mps2An386.name(),
        "",
        heads.concat()
    );
}

/// An image in the emulator, and the table in it.
struct Image {
    session: Session,
    table: Table,
}

impl Image {
    fn start(name: &str) -> Result<Self, Box<dyn Error>> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware");
        let text = std::fs::read_to_string(root.join("tables").join(format!("{name}.toml")))?;
        let image = root.join("target/images/tables").join(name);
        let session = Session::start(Machine::Mps2An386, &image, PATIENCE)?;
        let table = Table::parse(&text)?;
        if session.hello() != &hello(&table, &text) {
            return Err(format!("{}: has another table than {name}.toml", image.display()).into());
        }
        Ok(Self { session, table })
    }

    /// A row of the table; how many of its frames differ.
    fn row<L: Law>(
        &mut self,
        controller: &str,
        parameters: Parameters<L>,
        config: &StageConfig,
        references: &[Reference],
        (range_um, [feedforward, feedback]): (Option<[f64; 2]>, [bool; 2]),
    ) -> Result<usize, Box<dyn Error>> {
        let (mut cells, mut equal, mut frames) = (String::new(), 0, 0);
        for &(_, shape, frequency_hz) in references {
            let request = Request {
                shape,
                frequency_hz,
                range_um,
                seconds: SECONDS,
                feedforward,
                feedback,
            };
            let compared = compare(&mut self.session, parameters, config, &request)?;
            cells += &format!("{:>9.3}", compared.rms_percent);
            equal += compared.equal;
            frames += compared.frames;
        }
        println!("{controller:<22}{cells}   {equal} of {frames}");
        Ok(frames - equal)
    }
}

/// Instructions in a count of the sample timer: 40 ns of 8 ns each.
const INSTRUCTIONS_A_COUNT: u32 = 5;

impl Image {
    /// One run by the sample clock, tick by tick against the stage, at 500 Hz in closed loop: what the board's timers saw.
    fn timing(&mut self, config: &StageConfig) -> Result<String, Box<dyn Error>> {
        let request = Request {
            shape: Shape::Sine,
            frequency_hz: 500.0,
            range_um: None,
            seconds: 0.04,
            feedforward: true,
            feedback: true,
        };
        let setup = request.setup(self.session.hello())?;
        let mut rig = Rig::new(Stage::new(config, SEED)?, request.seconds);
        let timing = self.session.run(&setup, &mut rig, &mut |_| {})?;
        Ok(format!(
            "by the sample clock: {} ticks, {} overruns, {} edges lost, latency {} to {} instructions, tick with monitor and \
             reference {} to {}",
            setup.ticks,
            timing.overruns,
            timing.lost,
            INSTRUCTIONS_A_COUNT * timing.latency_min,
            INSTRUCTIONS_A_COUNT * timing.latency_max,
            INSTRUCTIONS_A_COUNT * timing.tick_min,
            INSTRUCTIONS_A_COUNT * timing.tick_max
        ))
    }
}

struct Compared {
    rms_percent: f64,
    equal: usize,
    frames: usize,
}

fn compare<L: Law>(
    session: &mut Session,
    parameters: Parameters<L>,
    config: &StageConfig,
    request: &Request,
) -> Result<Compared, Box<dyn Error>> {
    let setup = request.setup(session.hello())?;
    let mut bench = Remembering {
        rig: Rig::new(Stage::new(config, SEED)?, request.seconds),
        inputs: Vec::new(),
    };
    let mut controller = Controller::new(parameters, &setup);
    drive_here(&mut controller, setup.ticks, &mut bench);
    let setup = Setup {
        clocked: false,
        ..setup
    };
    let (frames, _) = session.replay(&setup, &bench.inputs)?;
    let host = &bench.rig.recording.frames;
    let equal = frames
        .iter()
        .zip(host)
        .filter(|(board, host)| board.to_bytes() == host.to_bytes())
        .count();
    let mut recording = bench.rig.recording.clone();
    recording.frames = frames;
    let range_um = f64::from(setup.high_um - setup.low_um);
    Ok(Compared {
        rms_percent: 100.0 * recording.rms_um() / range_um,
        equal,
        frames: recording.frames.len(),
    })
}

/// A rig that remembers what it gave.
struct Remembering {
    rig: Rig,
    inputs: Vec<Input>,
}

impl Bench for Remembering {
    fn sample_rate_hz(&self) -> f64 {
        self.rig.sample_rate_hz()
    }

    fn input(&mut self, number: u32) -> Input {
        let input = self.rig.input(number);
        self.inputs.push(input);
        input
    }

    fn output(&mut self, frame: &Frame) {
        self.rig.output(frame);
    }
}
