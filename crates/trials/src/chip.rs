//! Images of controllers on the firmware in the emulator, and the references that they follow there.

use crate::adapted::adapted;
use crate::error::TrialError;
use crate::on_board::{AFTER_MOVE_S, HOLD_S, along, held, peak_percent};
use hysteron_board::host::{complete, hello, parameters};
use hysteron_board::two_axes::TwoAxisSession;
use hysteron_board::upload::Upload;
use hysteron_board::{
    BoardError, FALL_TICKS, Fault, Hello, Law, Machine, Mode, Parameters, Player, Request, Session, Setup, Shape,
    Summary, image,
};
use hysteron_control::adapted::Adapted;
use hysteron_control::design::Controller;
use hysteron_control::export::{Bench, RAMP_RANGES_PER_S, SLEW_RANGES_PER_S, StageEnds, export, top};
use hysteron_plant::{Stage, StageConfig};
use hysteron_table::{FORMAT, Table, TableError};
use hysteron_tracking::ends::ends_of;
use hysteron_tracking::rehearsal::BESIDE_HZ;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Sample rate of the boards' tables, hertz.
pub(crate) const RATE_HZ: f64 = 50e3;
/// Closed loops of up to so many ticks are exchanged tick by tick at the sample clock; all else is worked out ahead. 3 s of wall time.
const LIVE_TICKS: u32 = 15_000;
/// Ticks for the rise to a reference's first value: the whole range takes 20 ms at the inverse's mean slope, which its steepest may
/// be three times.
pub(crate) const RISE_TICKS: u32 = 3_000;
/// An emulator that has not ended by then is ended.
const PATIENCE: Duration = Duration::from_secs(900);

/// Where the board's images come from and go.
pub struct Chip {
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
pub(crate) struct Reached {
    /// Rms of the error of the true position, percent of the references' range, by reference.
    pub percent: BTreeMap<String, f64>,
    /// What the law had learned at the end of each of these runs; empty where it does not learn.
    pub adapted: BTreeMap<String, Adapted>,
    /// Ticks that ran at the sample clock.
    pub clocked_ticks: u32,
    /// Of these the late and the lost ones.
    pub late_ticks: u32,
}

/// A reference to follow.
pub(crate) struct Follow {
    pub name: &'static str,
    pub shape: Shape,
    pub frequency_hz: f64,
    /// Lowest and highest position, micrometres.
    pub range_um: [f64; 2],
    /// What its error is a share of, micrometres.
    pub stroke_um: f64,
    /// Time before it is judged, seconds.
    pub settling_s: f64,
    pub judged_s: f64,
}

/// An image that runs, and the table in it.
pub(crate) struct Running {
    image: Image,
    pub table: Table,
}

/// An image of both axes that runs, and the tables in it.
pub(crate) struct Axes {
    pub session: TwoAxisSession,
    pub tables: [Table; 2],
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
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn new(machine: Machine, firmware: &Path, folder: Option<PathBuf>) -> Result<Self, TrialError> {
        let folder = match folder {
            Some(folder) => {
                std::fs::create_dir_all(&folder).map_err(|source| TrialError::Write {
                    path: folder.clone(),
                    source,
                })?;
                Folder::Kept(folder)
            }
            None => Folder::Passing(tempfile::tempdir().map_err(TrialError::Passing)?),
        };
        Ok(Self {
            machine,
            firmware: firmware.to_owned(),
            folder,
        })
    }

    /// The machine's name.
    pub fn name(&self) -> &'static str {
        self.machine.name()
    }

    /// Exports a controller, builds its image and starts it.
    pub(crate) fn start_law(
        &self,
        name: &str,
        controller: &Controller,
        stage: &StageConfig,
    ) -> Result<Running, TrialError> {
        let table = export(controller, &bench(stage))?.table;
        self.start(name, table, stage)
    }

    /// Builds the image of a table and starts it; of two, where another axis couples into this one.
    pub(crate) fn start(&self, name: &str, table: Table, stage: &StageConfig) -> Result<Running, TrialError> {
        let Some(other) = other_axis(stage) else {
            let (path, said) = self.write(name, &table)?;
            let image = self.folder.path().join(name);
            image::build(
                &self.firmware,
                image::Board::Emulated(self.machine),
                (&path, None),
                &image,
                &mut |_| {},
            )?;
            let session = Session::start(self.machine, &image, PATIENCE)?;
            if *session.hello() != said {
                return Err(BoardError::OtherVersion.into());
            }
            let image = Image::One(session);
            return Ok(Running { image, table });
        };
        let beside = straight_line(&other);
        let session = self.start_both(name, (name, &table), ("other-axis", &beside))?;
        let image = Image::Both {
            session,
            other: Box::new(other),
            table: Box::new(beside),
        };
        Ok(Running { image, table })
    }

    /// Exports a controller for both axes of a stage, each with the share of the other's motion that reaches it, builds their image and
    /// starts it.
    pub(crate) fn start_axes(
        &self,
        name: &str,
        controller: &Controller,
        stage: &StageConfig,
        shares: [f64; 2],
    ) -> Result<Axes, TrialError> {
        let table = |share: f64| {
            let crossed = Bench {
                cross_um_per_um: Some(share),
                ..bench(stage)
            };
            export(controller, &crossed).map(|exported| exported.table)
        };
        let tables = [table(shares[0])?, table(shares[1])?];
        let [x, y] = ["x", "y"].map(|axis| format!("{name}-{axis}"));
        let session = self.start_both(name, (&x, &tables[0]), (&y, &tables[1]))?;
        Ok(Axes { session, tables })
    }

    /// Builds the image of two axes from their tables, each by its file's name, and starts it.
    fn start_both(&self, name: &str, x: (&str, &Table), y: (&str, &Table)) -> Result<TwoAxisSession, TrialError> {
        let (path_x, said_x) = self.write(x.0, x.1)?;
        let (path_y, said_y) = self.write(y.0, y.1)?;
        let image = self.folder.path().join(name);
        image::build(
            &self.firmware,
            image::Board::Emulated(self.machine),
            (&path_x, Some(&path_y)),
            &image,
            &mut |_| {},
        )?;
        let session = TwoAxisSession::start(self.machine, &image, PATIENCE)?;
        let complete = said_x.complete || said_y.complete;
        if *session.banks() != [said_x, said_y].map(|said| vec![said.of_both(complete)]) {
            return Err(BoardError::OtherVersion.into());
        }
        Ok(session)
    }

    /// Writes a table: where to, and what an image says of it.
    fn write(&self, name: &str, table: &Table) -> Result<(PathBuf, Hello), TrialError> {
        let path = self.folder.path().join(format!("{name}.toml"));
        let text = table.to_toml()?;
        std::fs::write(&path, &text).map_err(|source| TrialError::Write {
            path: path.clone(),
            source,
        })?;
        let said = hello(table, &text);
        Ok((path, said))
    }
}

impl Running {
    pub(crate) fn hello(&self) -> &Hello {
        match &self.image {
            Image::One(session) => session.hello(),
            Image::Both { session, .. } => &session.banks()[0][0],
        }
    }

    pub(crate) fn setup(&self, request: &Request, ticks: u32) -> Result<Setup, TrialError> {
        let setup = request.setup(self.hello())?;
        Ok(Setup { ticks, ..setup })
    }

    /// The other axis' stage; none without one. It runs without feedback: its noise reaches no command.
    pub(crate) fn other_stage(&self) -> Result<Option<Stage>, TrialError> {
        match &self.image {
            Image::One(_) => Ok(None),
            Image::Both { other, .. } => Ok(Some(Stage::new(other, 0)?)),
        }
    }

    /// What both axes are asked for, the other one up and down four fifths of its range; the same twice without one.
    fn setups(&self, setup: &Setup, beside_hz: f64) -> Result<[Setup; 2], TrialError> {
        let Image::Both { session, .. } = &self.image else {
            return Ok([*setup; 2]);
        };
        let hello = &session.banks()[1][0];
        let request = Request {
            shape: Shape::Sine,
            frequency_hz: beside_hz,
            range_um: Some([0.0, 0.8 * f64::from(hello.input_max_um)]),
            seconds: 1.0,
            feedforward: true,
            feedback: false,
        };
        let beside = request.setup(hello)?;
        Ok([
            *setup,
            Setup {
                ticks: setup.ticks,
                ..beside
            },
        ])
    }

    /// Runs a law ahead, the other axis at `beside_hz` where there is one.
    pub(crate) fn run_ahead<L: Law>(
        &mut self,
        setup: &Setup,
        law: Result<Parameters<L>, TableError>,
        player: &mut Player,
        beside_hz: f64,
    ) -> Result<(), TrialError> {
        let law = law?;
        let setups = self.setups(setup, beside_hz)?;
        match &mut self.image {
            Image::One(session) => session.run_ahead(setup, law, player)?,
            Image::Both { session, table, .. } => {
                let beside = parameters(table)?;
                session.run_ahead(&setups, (law, beside), player)?;
            }
        }
        no_fault(player)
    }

    /// Along uploaded points at a stage at rest, so many ticks from the start on; worked out ahead.
    pub(crate) fn along(
        &mut self,
        request: &Request,
        points: &Upload,
        (stage, seed): (&StageConfig, u64),
        ticks: u32,
    ) -> Result<Player, TrialError> {
        let player = Player::new(Stage::new(stage, seed)?, Some(points.shares()), ticks);
        self.play(request, complete(&self.table), (player, ticks), BESIDE_HZ)
    }

    /// Lets a player send what it has to and start a run of so many ticks, the other axis at `beside_hz` where there is one; worked out
    /// ahead.
    pub(crate) fn play<L: Law>(
        &mut self,
        request: &Request,
        law: Result<Parameters<L>, TableError>,
        (player, ticks): (Player, u32),
        beside_hz: f64,
    ) -> Result<Player, TrialError> {
        let mut player = player.beside(self.other_stage()?);
        let setup = self.setup(request, player.ticks_before() + ticks + FALL_TICKS)?;
        self.run_ahead(&setup, law, &mut player, beside_hz)?;
        Ok(player)
    }

    /// Largest error of a hold at the upper end of a range, percent of it; worked out ahead.
    pub(crate) fn hold(
        &mut self,
        stage: &StageConfig,
        range_um: [f64; 2],
        feedback: bool,
        seed: u64,
    ) -> Result<f64, TrialError> {
        let points = held(range_um);
        let request = along(&points, 1.0, 1.0, feedback);
        let ticks = (HOLD_S * RATE_HZ) as u32;
        let player = self.along(&request, &points, (stage, seed), ticks + RISE_TICKS)?;
        let from = player.begun().unwrap_or(0) + (AFTER_MOVE_S * RATE_HZ) as usize;
        let judged = player.played.iter().skip(from);
        let judged = judged
            .filter(|tick| tick.frame.mode() == Mode::Running)
            .take(ticks as usize);
        let errors: Vec<f64> = judged
            .map(|tick| f64::from(tick.frame.reference_um) - tick.true_um)
            .collect();
        Ok(peak_percent(&errors, RATE_HZ, range_um))
    }

    /// Tick by tick at the sample clock.
    fn run_live(&mut self, setup: &Setup, player: &mut Player) -> Result<Summary, TrialError> {
        let setups = self.setups(setup, BESIDE_HZ)?;
        let summary = match &mut self.image {
            Image::One(session) => session.run(setup, player, &mut |_| {})?,
            Image::Both { session, .. } => session.run(&setups, player, &mut |_| {})?,
        };
        no_fault(player)?;
        Ok(summary)
    }

    /// Along references on a stage, each run with noise of its own.
    pub(crate) fn follow(
        &mut self,
        stage: &StageConfig,
        references: &[Follow],
        feedback: bool,
        seed: impl Fn(usize) -> u64,
    ) -> Result<Reached, TrialError> {
        let mut reached = Reached::default();
        for (number, follow) in references.iter().enumerate() {
            let request = Request {
                shape: follow.shape,
                frequency_hz: follow.frequency_hz,
                range_um: Some(follow.range_um),
                seconds: 1.0,
                feedforward: true,
                feedback,
            };
            let ticks = ((follow.settling_s + follow.judged_s) * RATE_HZ) as u32 + RISE_TICKS;
            let setup = self.setup(&request, ticks + FALL_TICKS)?;
            let player = Player::new(Stage::new(stage, seed(number))?, None, ticks);
            let mut player = player.beside(self.other_stage()?);
            if feedback && setup.ticks <= LIVE_TICKS {
                let summary = self.run_live(&setup, &mut player)?;
                reached.clocked_ticks += setup.ticks;
                reached.late_ticks += summary.overruns + summary.lost;
            } else {
                self.run_ahead(&setup, complete(&self.table), &mut player, BESIDE_HZ)?;
            }
            let from = player.begun().unwrap_or(0) + (follow.settling_s * RATE_HZ).round() as usize;
            let judged = player
                .played
                .iter()
                .skip(from)
                .take((follow.judged_s * RATE_HZ).round() as usize);
            // A rise that took longer leaves fewer of them.
            let judged = judged.filter(|tick| tick.frame.mode() == Mode::Running);
            let errors = judged.map(|tick| f64::from(tick.frame.reference_um) - tick.true_um);
            let (count, squares) = errors.fold((0.0, 0.0), |(n, sum), error| (n + 1.0, sum + error * error));
            let rms_um = (squares / f64::max(count, 1.0)).sqrt();
            let percent = 100.0 * rms_um / follow.stroke_um;
            reached.percent.insert(follow.name.to_owned(), percent);
            let learned = adapted(player.learned(), self.hello().sample_rate_hz);
            reached
                .adapted
                .extend(learned.map(|learned| (follow.name.to_owned(), learned)));
        }
        Ok(reached)
    }
}

/// The bench of a simulated stage.
fn bench(stage: &StageConfig) -> Bench {
    Bench {
        source: "the controller".to_owned(),
        stage: Some(ends_of(stage)),
        ..Bench::default()
    }
}

/// A law that knows the stage's data sheet only: stroke and voltage.
pub(crate) fn straight_line(stage: &StageConfig) -> Table {
    let StageEnds { dac_v, adc_um, .. } = ends_of(stage);
    let (dac_top_v, adc_top_um) = (top(dac_v), top(adc_um));
    let output_max_v = stage.amplifier.max_v.min(dac_top_v);
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
        slew_v_per_s: SLEW_RANGES_PER_S * output_max_v,
        ramp_v_per_s: RAMP_RANGES_PER_S * output_max_v,
        feedback_up_to_hz: 0.5 / stage.sample_period_s,
        dac_min_v: dac_v[0],
        dac_top_v,
        adc_min_um: adc_um[0],
        adc_top_um,
        linear_v_per_um: v_per_um,
        // One play without a weight.
        thresholds_um: vec![1.0],
        weights_v_per_um: vec![0.0],
        ..Table::empty(hysteron_table::Family::Pi)
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

fn no_fault(player: &Player) -> Result<(), TrialError> {
    let fault = player
        .played
        .iter()
        .find_map(|tick| Some((tick.frame.number, tick.frame.fault()?)));
    match fault {
        None => Ok(()),
        Some((tick, Fault::Disagreement)) => Err(TrialError::Disagreement { tick }),
        Some((tick, fault)) => Err(TrialError::NotThisStage { tick, fault }),
    }
}
