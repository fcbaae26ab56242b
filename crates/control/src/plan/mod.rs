//! The plan of a campaign on a stage of the user's own: the commands as files, and `campaign.toml`, by which what comes back is known.
//!
//! Every command begins with a rest of [`LEAD_S`] at [`Plan::rest_v`], so that each record tells the sensor's zero and whether the stage
//! rested. The commands of a pass are there one by one, and one after the other as its [`Pass::sequence`]. Each pass ends with the
//! campaign's first command again: what differs between the two has drifted.

pub mod came_back;
mod cutting;
pub mod doubts;
pub mod drift;
mod files;
mod likeness;
pub mod matching;
mod sequence;
pub mod skew;
pub mod told;

pub use files::{csv, sequence_csv};

use crate::campaign::{Command, Protocol};
use crate::error::ControlError;
use serde::{Deserialize, Serialize};

/// Name of the plan's file.
pub const FILE: &str = "campaign.toml";
/// Version of it that is written and read.
const FORMAT: i64 = 1;

/// Rest at the beginning of each command, seconds: whole periods of 50 and 60 Hz, so that hum moves no mean.
pub const LEAD_S: f64 = 0.1;
/// Rest before a record as a share of the one before it: creep that goes on for as long as it was fed is then half over.
const REST_SHARE: f64 = 0.5;
/// Shortest and longest rest before a record, seconds.
const REST_S: [f64; 2] = [4.0, 10.0];

/// Rest at the end of a sequence, seconds.
const AFTER_S: f64 = 1.0;

/// Share of the peak to peak that a position may stand off at rest, or creep over a record, by what was before it: creep that is compensated
/// leaves half a percent, and rests of seconds leave the zero of a stage with 1.5 % a decade good to 0.15 %.
const ZERO_MATTERS: f64 = 5e-3;

/// What a record is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// A small multisine.
    SmallSignals,
    /// Holds.
    Creep,
    /// Noise and sines over most of the range.
    LargeSignals,
    /// A command along a reference, by what is known so far.
    Training,
    /// The first command again.
    Drift,
}

impl Purpose {
    /// Whether its command is a small multisine.
    pub fn is_small(self) -> bool {
        matches!(self, Self::SmallSignals | Self::Drift)
    }

    /// What is read from it, for a person.
    pub fn tells(self) -> &'static str {
        match self {
            Self::SmallSignals => "modes, and a first guess of the lag",
            Self::Creep => "creep",
            Self::LargeSignals => "hysteresis and lag",
            Self::Training => "hysteresis and lag, where references go",
            Self::Drift => "what has changed since the first record, whose command this is",
        }
    }
}

/// A planned record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Planned {
    /// Name of the record.
    pub name: String,
    /// Its command, relative to the plan's folder.
    pub file: String,
    /// What it is for.
    pub role: Purpose,
    /// The same in words; for people, never parsed.
    pub tells: String,
    /// The excitation in words; for people, never parsed.
    pub excitation: String,
    /// Samples of the command, the rest at its beginning included.
    pub samples: usize,
    /// Sample rate that it is played and recorded at, hertz.
    pub rate_hz: f64,
    /// Rest before it, seconds.
    pub rest_before_s: f64,
    /// Samples at its beginning that are no part of the record.
    pub counts_from: usize,
    /// Lowest and highest voltage, volts at the actuator.
    pub range_v: [f64; 2],
    /// Of its voltages, FNV-1a over microvolts: whether the file still has them.
    pub check: String,
    /// Sample of the pass's sequence at which it begins.
    pub begins_at: usize,
    /// The command itself, volts at the actuator; in its file.
    #[serde(skip)]
    pub voltage_v: Vec<f64>,
}

impl Planned {
    /// Sample period, seconds.
    pub fn period_s(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// Duration, seconds.
    pub fn duration_s(&self) -> f64 {
        self.samples as f64 / self.rate_hz
    }

    /// Samples of rest at its beginning.
    pub fn lead(&self) -> usize {
        lead(self.rate_hz)
    }

    /// The command to be compared with what came back.
    pub(crate) fn command(&self) -> Command {
        Command {
            file: format!("{}.csv", self.name),
            words: self.excitation.clone(),
            purpose: self.role,
            period_s: self.period_s(),
            voltage_v: self.voltage_v.clone(),
            skip: self.counts_from,
            reference_um: None,
            seed: 0,
        }
    }
}

fn lead(rate_hz: f64) -> usize {
    (LEAD_S * rate_hz).round() as usize
}

/// Commands that are played before the next ones are made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pass {
    /// All its commands one after the other, with the rests between them, relative to the plan's folder.
    pub sequence: String,
    /// Samples of the sequence, at the plan's rate.
    pub samples: usize,
    /// Its records, in the order in which they are played.
    #[serde(rename = "record")]
    pub records: Vec<Planned>,
}

/// The plan of a campaign.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of the form.
    pub format: i64,
    /// Highest voltage that is used, volts at the actuator.
    pub top_v: f64,
    /// Sample rate of the controller, hertz.
    pub rate_hz: f64,
    /// Latency of the controller from reading to command, microseconds, without the half sample of hold; none where it is not known yet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency_us: Option<f64>,
    /// Seed of excitations that are random.
    pub seed: u64,
    /// Voltage of the rests, volts.
    pub rest_v: f64,
    /// Voltage up to which the stage is cycled once before the first record, volts: the highest of any record.
    pub cycle_to_v: f64,
    /// What is played before anything is known, then the passes of training.
    #[serde(rename = "pass")]
    pub passes: Vec<Pass>,
}

impl Plan {
    /// What is played before anything is known.
    ///
    /// # Errors
    /// A rate or a voltage that cannot be played.
    pub fn new(protocol: &Protocol, rate_hz: f64, latency_us: Option<f64>) -> Result<Self, ControlError> {
        let mut plan = Self {
            format: FORMAT,
            top_v: protocol.top_v,
            rate_hz,
            latency_us,
            seed: protocol.seed,
            rest_v: 0.0,
            cycle_to_v: 0.0,
            passes: Vec::new(),
        };
        let commands = protocol.first()?;
        let highest = |command: &Command| command.voltage_v.iter().copied().fold(0.0, f64::max);
        plan.cycle_to_v = microvolts(commands.iter().map(highest).fold(0.0, f64::max));
        plan.push(commands);
        Ok(plan)
    }

    /// What the commands are made for.
    pub fn protocol(&self) -> Protocol {
        Protocol {
            period_s: 1.0 / self.rate_hz,
            top_v: self.top_v,
            seed: self.seed,
        }
    }

    /// From reading to the mean effect of a command, seconds: the latency and the half sample for which a command is held on average.
    pub fn known_delay_s(&self, latency_us: f64) -> f64 {
        1e-6 * latency_us + 0.5 / self.rate_hz
    }

    /// Puts a pass in its place, and leaves out those that were made after it.
    pub fn set_pass(&mut self, number: usize, commands: Vec<Command>) {
        self.passes.truncate(number);
        self.push(commands);
    }

    /// A further pass: its commands, and the campaign's first one again.
    fn push(&mut self, commands: Vec<Command>) {
        let number = self.passes.len();
        let folder = if number == 0 {
            String::new()
        } else {
            format!("pass{number}/")
        };
        let mut records: Vec<Planned> = commands.into_iter().map(|command| planned(command, &folder)).collect();
        let first = self.passes.first().map_or(&records, |pass| &pass.records).first();
        if let Some(first) = first {
            let name = match number {
                0 => format!("{}-again", first.name),
                _ => format!("{}-after-pass{number}", first.name),
            };
            let again = Planned {
                file: format!("{folder}{name}.csv"),
                name,
                role: Purpose::Drift,
                tells: Purpose::Drift.tells().to_owned(),
                ..first.clone()
            };
            records.push(again);
        }
        let mut before_s = 0.0;
        // The stage is cycled before the first record, which is in no record.
        let mut at = if number == 0 {
            sequence::cycle_samples(self.rate_hz)
        } else {
            0
        };
        for record in &mut records {
            record.rest_before_s = (REST_SHARE * before_s).clamp(REST_S[0], REST_S[1]).ceil();
            at += (record.rest_before_s * self.rate_hz).round() as usize;
            record.begins_at = at;
            at += sequence::samples_of(record, self.rate_hz);
            before_s = record.duration_s();
        }
        self.passes.push(Pass {
            sequence: format!("{folder}all.csv"),
            // A recorder that runs a little longer or shorter still has the last one.
            samples: at + (AFTER_S * self.rate_hz).round() as usize,
            records,
        });
    }
}

/// A command as a planned record, with a rest before it; its place is not known yet.
fn planned(command: Command, folder: &str) -> Planned {
    let rate_hz = (1.0 / command.period_s * 1e6).round() * 1e-6;
    let lead = lead(rate_hz);
    let mut voltage_v = vec![0.0; lead];
    voltage_v.extend(command.voltage_v.iter().map(|v| microvolts(*v)));
    let name = command.file.trim_end_matches(".csv").to_owned();
    Planned {
        file: format!("{folder}{}", command.file),
        name,
        role: command.purpose,
        tells: command.purpose.tells().to_owned(),
        excitation: command.words,
        samples: voltage_v.len(),
        rate_hz,
        rest_before_s: 0.0,
        counts_from: lead + command.skip,
        range_v: hysteron_identify::family::range(voltage_v.iter().copied()).into(),
        check: check(&voltage_v),
        begins_at: 0,
        voltage_v,
    }
}

/// As a file has it.
fn microvolts(v: f64) -> f64 {
    (1e6 * v).round() / 1e6
}

/// FNV-1a, 64 bits, over microvolts.
///
/// # Reference
/// Fowler, Noll, Vo, Eastlake, The FNV Non-Cryptographic Hash Algorithm (2012).
fn check(voltage_v: &[f64]) -> String {
    let bytes = voltage_v.iter().flat_map(|v| ((1e6 * v).round() as i64).to_le_bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("{hash:016x}")
}
