//! Every controller on every reference, in the emulator and on the host: one table, and whether each frame is the same.
//!
//! `cargo xtask firmware compare` builds the images, one a table, and runs this. For each preset of the paper: the straight line
//! alone (open loop), PI alone, and PI with the inverse of each family. For stages to be tracked with: the complete law, open and
//! closed, and both axes of a stage. Each cell is the rms of reference less sensor over the later
//! half of 0.2 s, in percent of peak to peak. The image gets the codes that the stage gave the host; as long as it answers with the
//! host's codes, they are those that the stage gives it. Its ticks do not wait for the sample clock; those of the tests do.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example of the command line"
)]

use hysteron_board::host::{complete, hello, parameters};
use hysteron_board::two_axes::{TwoAxisRig, TwoAxisSession, drive_both_here};
use hysteron_board::{Machine, Remembering, Request, Rig, Session, Shape, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Law;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::wire::{Frame, Setup};
use hysteron_plant::{Stage, StageConfig, preset};
use hysteron_table::Table;
use std::error::Error;
use std::path::{Path, PathBuf};
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
    Ok(different + two_axes()?)
}

/// Names of the tables of both axes, their stages, and what of the other's motion reaches each stage.
const AXES: [(&str, &str, f64); 2] = [("tracking-x", "8k", 0.01), ("tracking-y", "739", -0.006)];

/// A raster by both axes, tick by tick against the stage with both; how many frames differ.
fn two_axes() -> Result<usize, Box<dyn Error>> {
    let texts = AXES.map(|(table, _, _)| std::fs::read_to_string(root().join("tables").join(format!("{table}.toml"))));
    let [x, y] = texts;
    let texts = [x?, y?];
    let tables = [Table::parse(&texts[0])?, Table::parse(&texts[1])?];
    let stages = AXES.map(|(_, stage, _)| preset::named(stage));
    let [Some(x), Some(y)] = &stages else {
        return Err("no such stage".into());
    };
    let rig = TwoAxisRig::new([x, y], AXES.map(|axis| axis.2), SEED, SECONDS)?;
    let image = root().join("target/images/tables/tracking-xy");
    let mut session = TwoAxisSession::start(Machine::Mps2An386, &image, PATIENCE)?;
    let setup = |axis: usize, shape, frequency_hz| {
        let request = Request {
            shape,
            frequency_hz,
            range_um: Some(COMPLETE_UM),
            seconds: SECONDS,
            feedforward: true,
            feedback: true,
        };
        request.setup(&hello(&tables[axis], &texts[axis]))
    };
    let setups = [setup(0, Shape::Triangle, 100.0)?, setup(1, Shape::Sine, 10.0)?];
    let (mut there, mut here) = (rig.clone(), rig);
    let timing = session.run(&setups, &mut there, &mut |_| {})?;
    let mut axes = TwoAxes::new(
        Controller::new(complete(&tables[0])?, &setups[0]),
        Controller::new(complete(&tables[1])?, &setups[1]),
    );
    drive_both_here(&mut axes, setups[0].ticks, &mut here);
    let pairs = there.recordings.iter().zip(&here.recordings);
    let different: usize = pairs
        .map(|(board, host)| board.frames.len() - equal_frames(&board.frames, &host.frames))
        .sum();
    let [x_percent, y_percent] =
        [0, 1].map(|axis| 100.0 * there.recordings[axis].rms_um() / (COMPLETE_UM[1] - COMPLETE_UM[0]));
    println!(
        "\nboth axes, closed: X a triangle of 100 Hz {x_percent:.3} %, Y a sine of 10 Hz {y_percent:.3} %; {} of {} frames equal; by the sample \
         clock {} overruns, {} edges lost, a tick of both up to {} instructions, {} but for the one that starts",
        2 * setups[0].ticks as usize - different,
        2 * setups[0].ticks,
        timing.overruns,
        timing.lost,
        // Counts of 40 ns, 4 ns an instruction.
        10 * timing.tick_max,
        10 * timing.running_max
    );
    Ok(different)
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware")
}

fn equal_frames(board: &[Frame], host: &[Frame]) -> usize {
    let pairs = board.iter().zip(host);
    pairs
        .filter(|(board, host)| board.to_bytes() == host.to_bytes())
        .count()
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
        let root = root();
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
             reference {} to {}, {} but for the one that starts",
            setup.ticks,
            timing.overruns,
            timing.lost,
            INSTRUCTIONS_A_COUNT * timing.latency_min,
            INSTRUCTIONS_A_COUNT * timing.latency_max,
            INSTRUCTIONS_A_COUNT * timing.tick_min,
            INSTRUCTIONS_A_COUNT * timing.tick_max,
            INSTRUCTIONS_A_COUNT * timing.running_max
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
    let mut bench = Remembering::new(Rig::new(Stage::new(config, SEED)?, request.seconds));
    let mut controller = Controller::new(parameters, &setup);
    drive_here(&mut controller, setup.ticks, &mut bench);
    let setup = Setup {
        clocked: false,
        ..setup
    };
    let (frames, _) = session.replay(&setup, &bench.inputs)?;
    let host = &bench.rig.recording.frames;
    let equal = equal_frames(&frames, host);
    let mut recording = bench.rig.recording.clone();
    recording.frames = frames;
    let range_um = f64::from(setup.high_um - setup.low_um);
    Ok(Compared {
        rms_percent: 100.0 * recording.rms_um() / range_um,
        equal,
        frames: recording.frames.len(),
    })
}
