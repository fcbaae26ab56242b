//! Records and runs of a rehearsal on the firmware in the emulator.

use super::programme::{Piece, RATE_HZ, programme};
use super::rows::{Hold, Kept};
use crate::commands::export;
use crate::error::CliError;
use crate::progress;
use hysteron_board::host::{complete, hello, parameters};
use hysteron_board::two_axes::TwoAxisSession;
use hysteron_board::{
    BoardError, FALL_TICKS, Hello, Law, Machine, Mode, Parameters, Player, Request, Session, Setup, Shape, Summary,
    image,
};
use hysteron_data::{Dataset, Known};
use hysteron_plant::{Converter, Stage, StageConfig};
use hysteron_table::{FORMAT, Table, TableError};
use hysteron_tracking::design::Controller;
use hysteron_tracking::rehearsal::Rehearsal;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Closed loops of up to so many ticks are exchanged tick by tick at the sample clock; all else is worked out ahead. 3 s of wall time.
const LIVE_TICKS: u32 = 15_000;
/// Ticks for the rise to a reference's first value: the whole range takes 20 ms at the inverse's mean slope, which its steepest may
/// be three times.
const RISE_TICKS: u32 = 3_000;
/// What the other axis does while references are followed, turns a second.
const BESIDE_HZ: f64 = 17.0;
/// An emulator that has not ended by then is ended.
const PATIENCE: Duration = Duration::from_secs(900);

/// Where the board's images come from and go.
pub(super) struct Chip {
    machine: Machine,
    firmware: PathBuf,
    folder: Folder,
}

/// Where tables and images are.
enum Folder {
    Kept(PathBuf),
    Passing(tempfile::TempDir),
}

impl Folder {
    fn path(&self) -> &Path {
        match self {
            Self::Kept(path) => path,
            Self::Passing(folder) => folder.path(),
        }
    }
}

/// What a controller reached.
#[derive(Default)]
pub(super) struct Reached {
    /// Rms of the error of the true position, percent of the references' range, by reference.
    pub percent: BTreeMap<String, f64>,
    /// Ticks that ran at the sample clock.
    pub clocked_ticks: u32,
    /// Of these the late and the lost ones.
    pub late_ticks: u32,
}

/// An image that runs, and the table in it.
struct Running {
    image: Image,
    table: Table,
}

/// Of one axis, or of both.
enum Image {
    One(Session),
    /// The other axis follows its reference by a straight line.
    Both {
        session: TwoAxisSession,
        other: Box<StageConfig>,
        table: Box<Table>,
    },
}

impl Chip {
    /// Builds from the sources in a folder; tables and images go to another, or to one that does not stay.
    pub(super) fn new(machine: Machine, firmware: &Path, folder: Option<PathBuf>) -> Result<Self, CliError> {
        let folder = match folder {
            Some(folder) => {
                std::fs::create_dir_all(&folder).map_err(|source| CliError::Write {
                    path: folder.clone(),
                    source,
                })?;
                Folder::Kept(folder)
            }
            None => Folder::Passing(tempfile::tempdir()?),
        };
        Ok(Self {
            machine,
            firmware: firmware.to_owned(),
            folder,
        })
    }

    /// The machine's name.
    pub(super) fn name(&self) -> &'static str {
        self.machine.name()
    }

    /// Builds the image of a table and starts it; of two, where another axis couples into this one.
    fn start(&self, name: &str, table: Table, stage: &StageConfig) -> Result<Running, CliError> {
        let (path, said) = self.write(name, &table)?;
        let image = self.folder.path().join(name);
        let Some(other) = other_axis(stage) else {
            image::build(&self.firmware, self.machine, (&path, None), &image)?;
            let session = Session::start(self.machine, &image, PATIENCE)?;
            if *session.hello() != said {
                return Err(BoardError::OtherVersion.into());
            }
            let image = Image::One(session);
            return Ok(Running { image, table });
        };
        let beside = straight_line(&other);
        let (path_y, said_y) = self.write("other-axis", &beside)?;
        image::build(&self.firmware, self.machine, (&path, Some(&path_y)), &image)?;
        let session = TwoAxisSession::start(self.machine, &image, PATIENCE)?;
        if *session.banks() != [vec![said], vec![said_y]] {
            return Err(BoardError::OtherVersion.into());
        }
        let image = Image::Both {
            session,
            other: Box::new(other),
            table: Box::new(beside),
        };
        Ok(Running { image, table })
    }

    /// Writes a table: where to, and what an image says of it.
    fn write(&self, name: &str, table: &Table) -> Result<(PathBuf, Hello), CliError> {
        let path = self.folder.path().join(format!("{name}.toml"));
        let text = table.to_toml().map_err(|source| CliError::Table {
            path: path.clone(),
            source,
        })?;
        std::fs::write(&path, &text).map_err(|source| CliError::Write {
            path: path.clone(),
            source,
        })?;
        let said = hello(table, &text);
        Ok((path, said))
    }

    /// The records: the board plays them with a straight line for a law; commands are what its frames say.
    pub(super) fn records(&self, rehearsal: &Rehearsal) -> Result<Dataset, CliError> {
        let stage = &rehearsal.stage;
        let mut running = self.start("plain", straight_line(stage), stage)?;
        let pieces = programme(rehearsal.seed)?;
        let bar = progress::bar("recording on the board");
        let mut played = Vec::new();
        for (number, piece) in pieces.iter().enumerate() {
            bar.set_message(format!("recording {}", piece.name));
            let rested = Stage::new(stage, rehearsal.noise_seed(number as u64))?;
            // Whole cycles of a rate of its own over the record.
            let cycles = [7.0, 11.0, 13.0, 17.0, 19.0][number % 5];
            let player = running.play(piece, rested, cycles / piece.kept_s)?;
            played.push(Kept::of(piece, &player));
            progress::advance(&bar, (number + 1) as f64 / pieces.len() as f64);
        }
        bar.finish_and_clear();
        let multisine = played.iter().zip(&pieces).find(|(_, piece)| piece.name == "multisine");
        let hold = multisine.map_or(Hold::Smoothed, |(kept, _)| Hold::of(kept));
        Ok(Dataset {
            name: format!("rehearsal-{}-board", rehearsal.seed),
            description: format!(
                "{} in QEMU at a simulated stage with something hidden, seed {}; voltages as a straight-line hold would have them",
                self.machine.name(),
                rehearsal.seed
            ),
            known: Known {
                voltage_min_v: Some(stage.amplifier.min_v),
                voltage_max_v: Some(stage.amplifier.max_v),
                ..Known::default()
            },
            records: pieces
                .iter()
                .zip(&played)
                .map(|(piece, kept)| kept.record(piece, hold, stage.cross_coupling.is_some()))
                .collect(),
            ..Dataset::default()
        })
    }

    /// Exports a controller, builds its image, and runs that along every reference, its loop closed where it has feedback.
    pub(super) fn errors(
        &self,
        rehearsal: &Rehearsal,
        controller: &Controller,
        name: &str,
    ) -> Result<Reached, CliError> {
        let table = export::law_table(controller, &options(&rehearsal.stage))?;
        let mut running = self.start(name, table, &rehearsal.stage)?;
        running.track(rehearsal, controller.feedback.is_some())
    }
}

impl Running {
    fn hello(&self) -> &Hello {
        match &self.image {
            Image::One(session) => session.hello(),
            Image::Both { session, .. } => &session.banks()[0][0],
        }
    }

    fn setup(&self, request: &Request, ticks: u32) -> Result<Setup, CliError> {
        let setup = request.setup(self.hello())?;
        Ok(Setup { ticks, ..setup })
    }

    /// The other axis' stage; none without one.
    fn other_stage(&self, seed: u64) -> Result<Option<Stage>, CliError> {
        match &self.image {
            Image::One(_) => Ok(None),
            Image::Both { other, .. } => Ok(Some(Stage::new(other, seed)?)),
        }
    }

    /// What the other axis is asked for: up and down four fifths of the whole.
    fn setup_beside(&self, session: &TwoAxisSession, hz: f64, ticks: u32) -> Result<Setup, CliError> {
        let hello = &session.banks()[1][0];
        let request = Request {
            shape: Shape::Sine,
            frequency_hz: hz,
            range_um: Some([0.0, 0.8 * f64::from(hello.input_max_um)]),
            seconds: 1.0,
            feedforward: true,
            feedback: false,
        };
        Ok(Setup {
            ticks,
            ..request.setup(hello)?
        })
    }

    /// Runs a law ahead, the other axis at `beside_hz` where there is one.
    fn run_ahead<L: Law>(
        &mut self,
        setup: &Setup,
        law: Result<Parameters<L>, TableError>,
        player: &mut Player,
        beside_hz: f64,
    ) -> Result<(), CliError> {
        let refused = |source| CliError::Table {
            path: PathBuf::from("controller.toml"),
            source,
        };
        let law = law.map_err(refused)?;
        let setups = match &self.image {
            Image::One(_) => [*setup; 2],
            Image::Both { session, .. } => [*setup, self.setup_beside(session, beside_hz, setup.ticks)?],
        };
        match &mut self.image {
            Image::One(session) => session.run_ahead(setup, law, player)?,
            Image::Both { session, table, .. } => {
                let beside = parameters(table).map_err(refused)?;
                session.run_ahead(&setups, (law, beside), player)?;
            }
        }
        no_fault(player)
    }

    fn request(&self, shape: Shape, frequency_hz: f64, range: [f64; 2]) -> Request {
        let top_um = f64::from(self.hello().input_max_um);
        Request {
            shape,
            frequency_hz,
            range_um: Some(range.map(|share| share * top_um)),
            seconds: 1.0,
            feedforward: true,
            feedback: false,
        }
    }

    /// Tick by tick at the sample clock.
    fn run_live(&mut self, setup: &Setup, player: &mut Player) -> Result<Summary, CliError> {
        let beside = match &self.image {
            Image::One(_) => None,
            Image::Both { session, .. } => Some(self.setup_beside(session, BESIDE_HZ, setup.ticks)?),
        };
        let summary = match (&mut self.image, beside) {
            (Image::One(session), _) => session.run(setup, player, &mut |_| {})?,
            (Image::Both { session, .. }, beside) => session.run(&[*setup, beside.unwrap_or(*setup)], player)?,
        };
        no_fault(player)?;
        Ok(summary)
    }

    fn play(&mut self, piece: &Piece, stage: Stage, beside_hz: f64) -> Result<Player, CliError> {
        let ticks = (piece.kept_s * RATE_HZ).ceil() as u32;
        let [low, high] = piece.range;
        let moves = low < high;
        let request = self.request(piece.shape, piece.frequency_hz, [low, if moves { high } else { 1.0 }]);
        let ticks = ticks + RISE_TICKS;
        let player = Player::new(stage, piece.points.as_ref(), if moves { ticks } else { 0 });
        let mut player = player.beside(self.other_stage(u64::from(ticks))?);
        let setup = self.setup(&request, player.ticks_before() + ticks + FALL_TICKS)?;
        self.run_ahead(&setup, parameters(&self.table), &mut player, beside_hz)?;
        Ok(player)
    }

    /// Along the references of the rehearsal.
    fn track(&mut self, rehearsal: &Rehearsal, feedback: bool) -> Result<Reached, CliError> {
        let [low_um, high_um] = rehearsal.range_um();
        let top_um = f64::from(self.hello().input_max_um);
        let settling_s = rehearsal.settling_s();
        // Shape, range, frequency, seconds of settling and seconds that are judged. Points that were never uploaded are all the lowest.
        let sine = |hz: f64| {
            let (settling, judged) = ((settling_s * hz).ceil().max(2.0), (0.1 * hz).ceil().max(2.0));
            (Shape::Sine, [low_um, high_um], hz, settling / hz, judged / hz)
        };
        let references = [
            ("10", sine(10.0)),
            ("100", sine(100.0)),
            ("500", sine(500.0)),
            (
                "hold",
                (Shape::Table, [high_um, top_um], 1.0, settling_s, 4.0 - settling_s),
            ),
        ];
        let mut reached = Reached::default();
        for (number, (name, (shape, range_um, frequency_hz, settling_s, judged_s))) in
            references.into_iter().enumerate()
        {
            let request = Request {
                shape,
                frequency_hz,
                range_um: Some(range_um),
                seconds: 1.0,
                feedforward: true,
                feedback,
            };
            let ticks = ((settling_s + judged_s) * RATE_HZ) as u32 + RISE_TICKS;
            let setup = self.setup(&request, ticks + FALL_TICKS)?;
            let seed = !rehearsal.noise_seed(number as u64);
            let player = Player::new(Stage::new(&rehearsal.stage, seed)?, None, ticks);
            let mut player = player.beside(self.other_stage(!seed)?);
            if feedback && setup.ticks <= LIVE_TICKS {
                let summary = self.run_live(&setup, &mut player)?;
                reached.clocked_ticks += setup.ticks;
                reached.late_ticks += summary.overruns + summary.lost;
            } else {
                self.run_ahead(&setup, complete(&self.table), &mut player, BESIDE_HZ)?;
            }
            let from = player.begun().unwrap_or(0) + (settling_s * RATE_HZ).round() as usize;
            let judged = player
                .played
                .iter()
                .skip(from)
                .take((judged_s * RATE_HZ).round() as usize);
            // A rise that took longer leaves fewer of them.
            let judged = judged.filter(|tick| tick.frame.mode() == Mode::Running);
            let errors = judged.map(|tick| f64::from(tick.frame.reference_um) - tick.true_um);
            let (count, squares) = errors.fold((0.0, 0.0), |(n, sum), error| (n + 1.0, sum + error * error));
            let rms_um = (squares / f64::max(count, 1.0)).sqrt();
            reached
                .percent
                .insert(name.to_owned(), 100.0 * rms_um / (high_um - low_um));
        }
        Ok(reached)
    }
}

/// The options of `export` for converters and amplifier of a stage.
fn options(stage: &StageConfig) -> Vec<String> {
    let pair = |name: &str, [low, high]: [f64; 2]| format!("--{name}={low},{high}");
    let (dac_v, adc_um) = ends(stage);
    let amplifier = &stage.amplifier;
    vec![
        pair("amplifier", [amplifier.min_v, amplifier.max_v]),
        pair("dac", dac_v),
        pair("adc", adc_um),
    ]
}

/// Full scale of both converters: volts at the stack, micrometres.
fn ends(stage: &StageConfig) -> ([f64; 2], [f64; 2]) {
    let dac = stage.dac.unwrap_or(Converter::BIPOLAR_16_BIT);
    let adc = stage.sensor.adc.unwrap_or(Converter::BIPOLAR_16_BIT);
    let scaled = |converter: Converter, factor: f64| [converter.min_v * factor, converter.max_v * factor];
    (scaled(dac, stage.amplifier.gain), scaled(adc, stage.sensor.um_per_v))
}

/// A law that knows the stage's data sheet only: stroke and voltage.
fn straight_line(stage: &StageConfig) -> Table {
    let (dac_v, adc_um) = ends(stage);
    // Position and voltage of the highest of 65536 codes.
    let top = |[low, full]: [f64; 2]| full - (full - low) / 65_536.0;
    let output_max_v = stage.amplifier.max_v.min(top(dac_v));
    let hysteresis = &stage.hysteresis;
    let v_per_um = hysteresis.reference_v / hysteresis.stroke_um;
    Table {
        format: FORMAT.to_owned(),
        sample_rate_hz: 1.0 / stage.sample_period_s,
        input_min_um: 0.0,
        // Just inside of what the converter reaches, in f32 as well.
        input_max_um: hysteresis.stroke_um.min((1.0 - 1e-6) * output_max_v / v_per_um),
        output_min_v: stage.amplifier.min_v.max(dac_v[0]),
        output_max_v,
        // As `export` sets them for a complete law.
        slew_v_per_s: 1e4 * output_max_v,
        ramp_v_per_s: 50.0 * output_max_v,
        feedback_up_to_hz: 0.5 / stage.sample_period_s,
        dac_min_v: dac_v[0],
        dac_top_v: top(dac_v),
        adc_min_um: adc_um[0],
        adc_top_um: top(adc_um),
        linear_v_per_um: v_per_um,
        // One play without a weight.
        thresholds_um: vec![1.0],
        weights_v_per_um: vec![0.0],
        ..export::empty(hysteron_table::Family::Pi)
    }
}

/// The other axis that a stage's coupling stands for, on its own.
fn other_axis(stage: &StageConfig) -> Option<StageConfig> {
    let hysteresis = stage.cross_coupling.as_ref()?.hysteresis.clone();
    Some(StageConfig {
        hysteresis,
        cross_coupling: None,
        ..stage.clone()
    })
}

fn no_fault(player: &Player) -> Result<(), CliError> {
    let fault = player
        .played
        .iter()
        .find_map(|tick| Some((tick.frame.number, tick.frame.fault()?)));
    match fault {
        None => Ok(()),
        Some((tick, fault)) => Err(CliError::Option(format!(
            "the board stopped at tick {tick} with fault {fault:?}; the stage is not one that this controller can run on"
        ))),
    }
}
