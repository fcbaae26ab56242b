//! Recordings of the firmware as datasets: of a real board, or of an image in the emulator at simulated stages.

use crate::adapted::adapted;
use crate::error::TrialError;
use hysteron_board::capture::{Start, Wish, capture};
use hysteron_board::telemetry::{Capture, hex};
use hysteron_board::two_axes::{TwoAxisRig, run_both};
use hysteron_board::upload::Upload;
use hysteron_board::{BoardError, Change, Fault, Hello, Machine, Mode, Outcome, Recording, Request, budget};
use hysteron_control::adapted::Adapted;
use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_plant::{Stage, StageConfig};
use hysteron_table::short;
use serde::Serialize;
use std::path::Path;
use std::time::Duration;

/// What was recorded.
#[derive(Debug, Clone, Serialize)]
pub struct Counted {
    /// The board's name; empty where it has none.
    pub board: String,
    /// Of the tables that ran, in their order.
    pub tables_sha256: Vec<String>,
    /// Of the board's time.
    pub seconds: f64,
    /// Samples that came.
    pub samples: u64,
    /// Ticks whose samples did not come.
    pub lost: u64,
    /// Recordings without a gap.
    pub pieces: usize,
    /// Samples between two gaps, which are left out.
    pub alone: u64,
    /// Samples from before anybody listened, which are left out.
    pub unheard: u64,
    /// Bytes that belong to no packet.
    pub foreign_bytes: u64,
    /// Times that the board began anew.
    pub restarts: u64,
    /// Computed of the board; none where it is not known.
    pub known_delay_s: Option<f64>,
    /// Number of the first fault.
    pub fault: Option<u8>,
    /// What the law has learned by the end; none where it does not learn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adapted: Option<Adapted>,
}

/// A recording of a real board.
pub struct Recorded {
    /// What came.
    pub counted: Counted,
    /// Tick and kind of the first fault.
    pub fault: Option<(u32, Fault)>,
    /// The records, one a piece without a gap.
    pub dataset: Dataset,
}

/// Records an axis of a board, the first being 0, for so many seconds of the board's time; the other's command goes into the records as
/// well. Progress gets the share done, 0 to 1.
///
/// # Errors
/// A board that does not answer or sends no samples, a second axis of a board with one.
pub fn record(
    from: &str,
    seconds: f64,
    start: Start<'_>,
    axis: usize,
    progress: &dyn Fn(f64),
) -> Result<Recorded, TrialError> {
    recorded(capture(from, seconds, start, &mut |share| progress(share))?, axis)
}

/// What was captured of all axes, as the recording of one.
///
/// # Errors
/// An axis that there is not.
pub fn recorded(mut captured: Vec<Capture>, axis: usize) -> Result<Recorded, TrialError> {
    if axis >= captured.len() {
        return Err(BoardError::OneAxis.into());
    }
    let own = captured.swap_remove(axis);
    let counted = counted(&own);
    let fault = first_fault(own.pieces.iter().map(|piece| &piece.recording));
    Ok(Recorded {
        dataset: dataset_of_board(own, captured.first(), &counted),
        counted,
        fault,
    })
}

/// How an axis followed its reference, over the later half of the ticks on which the loop ran.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Followed {
    /// Root mean square of reference less position, micrometres.
    pub rms_um: f64,
    /// From the lowest to the highest reference, micrometres.
    pub span_um: f64,
}

/// As the longest piece without a gap shows it; none where the loop did not run.
pub fn followed(captured: &Capture) -> Option<Followed> {
    let longest = captured
        .pieces
        .iter()
        .max_by_key(|piece| piece.recording.frames.len())?;
    let ran = longest
        .recording
        .frames
        .iter()
        .filter(|frame| frame.mode() == Mode::Running);
    let [low, high] = ran.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], frame| {
        let um = f64::from(frame.reference_um);
        [low.min(um), high.max(um)]
    });
    (low <= high).then(|| Followed {
        rms_um: longest.recording.rms_um(),
        span_um: high - low,
    })
}

/// Tick and kind of the first fault.
fn first_fault<'a>(recordings: impl IntoIterator<Item = &'a Recording>) -> Option<(u32, Fault)> {
    let mut frames = recordings.into_iter().flat_map(|recording| &recording.frames);
    frames.find_map(|frame| Some((frame.number, frame.fault()?)))
}

fn counted(captured: &Capture) -> Counted {
    let about = &captured.about;
    let counts = captured.counts;
    let mut frames = captured.pieces.iter().flat_map(|piece| &piece.recording.frames);
    let mut tables: Vec<String> = captured.pieces.iter().map(|piece| hex(&piece.table.hash)).collect();
    tables.dedup();
    Counted {
        board: about.board().to_owned(),
        tables_sha256: tables,
        seconds: (counts.samples + counts.lost) as f64 / f64::from(about.hello.sample_rate_hz),
        samples: counts.samples,
        lost: counts.lost,
        pieces: captured.pieces.len(),
        alone: counts.alone,
        unheard: counts.unheard,
        foreign_bytes: counts.foreign_bytes,
        restarts: counts.restarts,
        known_delay_s: budget::known_delay_s(about),
        adapted: adapted(captured.learned(), about.hello.sample_rate_hz),
        fault: frames.find_map(|frame| frame.fault()).map(|fault| fault as u8),
    }
}

/// A record a piece; with the command of the axis beside it where that came with every sample.
fn dataset_of_board(captured: Capture, beside: Option<&Capture>, counted: &Counted) -> Dataset {
    let period_s = 1.0 / f64::from(captured.about.hello.sample_rate_hz);
    let several = counted.tables_sha256.len() > 1;
    let pieces = captured.pieces.into_iter().enumerate().map(|(i, piece)| {
        let references = piece.recording.frames.iter().map(|frame| frame.reference_um);
        let [low, high] = references.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], um| {
            [low.min(um), high.max(um)]
        });
        let numbers = piece.recording.frames.iter().map(|frame| frame.number);
        let voltage2_v = beside.and_then(|beside| beside.commands_v(numbers));
        let record = row(Piece {
            file: format!("run-{:03}.csv", i + 1),
            excitation: format!(
                "reference of the board, {} to {} um{}",
                short(low.into()),
                short(high.into()),
                match several {
                    true => format!(", bank {}, table {}", piece.table.bank, hex(&piece.table.hash)),
                    false => String::new(),
                }
            ),
            start_s: piece.start_tick as f64 * period_s,
            period_s,
            recording: piece.recording,
        });
        Record { voltage2_v, ..record }
    });
    Dataset {
        name: format!("{}-recording", name(&counted.board)),
        description: format!(
            "recorded from {}{}: {} samples, {} lost, {}",
            name(&counted.board),
            match (beside, captured.about.axis) {
                (None, _) => "",
                (Some(_), 0) => ", the first axis",
                (Some(_), _) => ", the second axis",
            },
            counted.samples,
            counted.lost,
            tables(counted)
        ),
        known: Known {
            delay_s: counted.known_delay_s,
            ..Known::default()
        },
        records: pieces.collect(),
        notices: Vec::new(),
    }
}

/// The tables in words.
pub fn tables(counted: &Counted) -> String {
    let plural = if counted.tables_sha256.len() > 1 { "s" } else { "" };
    format!("table{plural} {}", counted.tables_sha256.join(", then "))
}

/// A board's name, or a word for one without.
pub fn name(board: &str) -> &str {
    if board.is_empty() { "board" } else { board }
}

/// A recording without gaps, and what the dataset says of it.
struct Piece {
    file: String,
    excitation: String,
    start_s: f64,
    period_s: f64,
    recording: Recording,
}

/// The record of a recording: the loop's reference, the DAC's voltage, the sensor's position.
fn row(piece: Piece) -> Record {
    let Recording {
        frames,
        position_um,
        voltage_v,
        ..
    } = piece.recording;
    Record {
        file: piece.file,
        role: Role::Validate,
        excitation: piece.excitation,
        start_s: piece.start_s,
        period_s: piece.period_s,
        reference_um: Some(frames.iter().map(|frame| f64::from(frame.reference_um)).collect()),
        voltage_v,
        position_um,
        temperature_c: None,
        voltage2_v: None,
    }
}

/// An image in the emulator.
#[derive(Debug, Clone, Copy)]
pub struct Emulated<'a> {
    /// What it plays.
    pub machine: Machine,
    /// The firmware's image.
    pub image: &'a Path,
    /// Seed of the stages' noise.
    pub seed: u64,
    /// The emulator is ended so long after its start.
    pub patience: Duration,
}

/// The simulated stage of an axis.
#[derive(Debug, Clone)]
pub struct On {
    /// Its name.
    pub name: &'static str,
    /// The stage.
    pub stage: StageConfig,
    /// What it is driven with, in words.
    pub excitation: String,
}

/// What an axis did, and what ran it.
pub struct Ran {
    /// The stage that it ran on.
    pub on: On,
    /// What the emulator ended with.
    pub outcome: Outcome,
    /// What was recorded.
    pub recording: Recording,
}

impl Emulated<'_> {
    /// Runs an image of one axis. Progress gets the share done, 0 to 1.
    ///
    /// # Errors
    /// No image or emulator, a stage of another rate than the table's, an exchange that breaks off.
    pub fn one(&self, on: On, wish: &Wish, progress: &dyn Fn(f64)) -> Result<Ran, TrialError> {
        let stage = Stage::new(&on.stage, self.seed)?;
        // An image begins with bank 0.
        let mut changes = Vec::from_iter((wish.bank > 0).then_some(Change::Bank(wish.bank)));
        changes.extend(wish.upload.iter().flat_map(Upload::changes));
        let (outcome, recording) = hysteron_board::run(
            self.machine,
            self.image,
            stage,
            (&wish.request, &changes[..]),
            self.patience,
            &mut |share| progress(share),
        )?;
        Ok(Ran { on, outcome, recording })
    }

    /// Runs an image of both axes; `shares` of the second's motion reach the first, and of the first's the second. The second one follows
    /// a sine of so many hertz, or stands still.
    ///
    /// # Errors
    /// As [`Self::one`].
    pub fn both(
        &self,
        on: [On; 2],
        shares: [f64; 2],
        (request, beside_hz): (&Request, Option<f64>),
        progress: &dyn Fn(f64),
    ) -> Result<Vec<Ran>, TrialError> {
        let stages = on.each_ref().map(|on| &on.stage);
        let mut rig = TwoAxisRig::new(stages, shares, self.seed, request.seconds)?;
        let outcomes = run_both(
            self.machine,
            self.image,
            &mut rig,
            (request, beside_hz),
            self.patience,
            &mut |share| progress(share),
        )?;
        let axes = on.into_iter().zip(outcomes).zip(rig.recordings);
        let ran = axes.map(|((on, outcome), recording)| Ran { on, outcome, recording });
        Ok(ran.collect())
    }
}

impl Ran {
    /// Tick and kind of the first fault.
    pub fn fault(&self) -> Option<(u32, Fault)> {
        first_fault([&self.recording])
    }

    /// What the law has learned by the end; none where it does not learn.
    pub fn adapted(&self) -> Option<Adapted> {
        adapted(self.recording.learned(), self.outcome.hello.sample_rate_hz)
    }

    /// Which table ran, in words.
    pub fn table(&self) -> String {
        let Hello { hash, bank, banks, .. } = &self.outcome.hello;
        match banks {
            1 => format!("table {}", hex(hash)),
            _ => format!("bank {bank} of {banks}, table {}", hex(hash)),
        }
    }

    /// The dataset of an axis that a machine ran with a seed; with the command of the one beside it where there is one.
    pub fn dataset(self, (machine, seed): (Machine, u64), beside: Option<Self>) -> Dataset {
        let stage = &self.on.stage;
        let setup = self.outcome.setup;
        let of_the_other = beside.as_ref().map_or(String::new(), |beside| {
            format!("; the other axis, {}: {}", beside.on.name, beside.on.excitation)
        });
        let description = format!(
            "{} in QEMU at the simulated stage {}, seed {seed}, {}",
            machine.name(),
            self.on.name,
            self.table()
        );
        let record = row(Piece {
            file: "run.csv".to_owned(),
            excitation: format!(
                "reference {}, {} to {} um{of_the_other}",
                self.on.excitation,
                short(setup.low_um.into()),
                short(setup.high_um.into())
            ),
            start_s: 0.0,
            period_s: stage.sample_period_s,
            recording: self.recording,
        });
        Dataset {
            name: format!("{}-board", self.on.name),
            description,
            known: Known {
                delay_s: Some(stage.known_delay_s()),
                sensor_noise_um: None,
                sensor_bandwidth_hz: None,
                voltage_min_v: Some(stage.amplifier.min_v),
                voltage_max_v: Some(stage.amplifier.max_v),
                dac_v: stage.dac_v(),
                adc_um: stage.adc_um(),
            },
            records: vec![Record {
                voltage2_v: beside.map(|beside| beside.recording.voltage_v),
                ..record
            }],
            notices: Vec::new(),
        }
    }
}
