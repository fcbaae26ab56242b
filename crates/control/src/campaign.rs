//! The experiment protocol: the commands whose records a stage is identified for control from, and those records taken on a stage in a
//! process.

use crate::commands::commands;
use crate::design::{Controller, ReferenceKind};
use crate::error::ControlError;
use crate::plan::Purpose;
use crate::process::{self, ProcessStage};
use crate::reference::{Reference, Shape, noise};
use crate::usable::usable;
use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_excitation::{BandNoise, Excitation, Multisine, Sine, with_rise};
use hysteron_identify::control::{self, ControlModel};
use hysteron_table::short;

/// Passes of training: records along references that the last inverse was asked to follow.
pub const TRAINING_PASSES: usize = 2;
/// Periods of the small multisine that its record has.
pub(crate) const PERIODS_KEPT: usize = 8;
/// Rise from 0 V to where an excitation starts, seconds.
const RISE_S: f64 = 0.02;
/// Sample period of the holds, seconds, or as near to it as a whole number of samples comes: creep needs decades of time, not samples.
const HOLD_PERIOD_S: f64 = 1e-3;
/// Length of each hold, seconds: three decades beyond the ringing.
const HOLD_S: f64 = 12.0;

/// What was recorded, and the chain identified from it.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// All records.
    pub records: Dataset,
    /// The chain.
    pub model: ControlModel,
}

/// Plays the protocol on a stage in a process, which each command starts anew; what comes back is checked before it is used.
///
/// `latency_s` is what the process lets pass between a command and its effect because a controller would; the half sample for which a
/// command is held on average is added to it.
///
/// # Errors
/// A process that cannot be started, falls silent, ends or answers with anything but a number; positions that are of no use, each with its
/// reason; records from which the stage cannot be identified.
///
/// # Cost
/// At 50 kHz 0.8 million answers of the process; three identifications of about a second each.
pub fn on_process(
    stage: &ProcessStage,
    protocol: &Protocol,
    known: Known,
    progress: &dyn Fn(f64),
) -> Result<Campaign, ControlError> {
    let records = Dataset {
        name: "process".to_owned(),
        description: format!(
            "campaign for control on the process `{}`, seed {}",
            stage.command, protocol.seed
        ),
        known: Known {
            voltage_min_v: Some(0.0),
            voltage_max_v: Some(protocol.top_v),
            ..known
        },
        ..Dataset::default()
    };
    let play = |commands: Vec<Command>, progress: &dyn Fn(f64)| -> Result<Vec<Record>, ControlError> {
        let total = commands.len() as f64;
        let (mut records, mut wrong) = (Vec::new(), Vec::new());
        // One after the other: behind the process there may be a stage that is there once.
        for (number, command) in (1..).zip(&commands) {
            match usable(command, &command.on_process(stage)?) {
                Ok(record) => records.push(record),
                Err(reason) => wrong.push(reason.behind(format!("{}: ", command.file))),
            }
            progress(f64::from(number) / total);
        }
        if !wrong.is_empty() {
            let asked = commands.len();
            return Err(ControlError::Unusable { wrong, asked });
        }
        Ok(records)
    };
    protocol.play(records, &play, progress)
}

/// Takes the records of commands, and says how far it is.
pub type Play<'a, E> = dyn Fn(Vec<Command>, &dyn Fn(f64)) -> Result<Vec<Record>, E> + 'a;

/// A command, to be played to a stage that was cycled and rests at 0 V.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Name of its record's file.
    pub file: String,
    /// What it is, for a person.
    pub words: String,
    /// What its record is for.
    pub purpose: Purpose,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Volts at the actuator.
    pub voltage_v: Vec<f64>,
    /// Samples at its beginning that are played and are no part of the record.
    pub skip: usize,
    /// What it is to bring the position to, micrometres, over the record.
    pub reference_um: Option<Vec<f64>>,
    /// Seed of a simulated stage's noise.
    pub seed: u64,
}

impl Command {
    /// What a process answers to all of it: beside each command the reading of the instant at which it goes out.
    fn on_process(&self, stage: &ProcessStage) -> Result<Record, ControlError> {
        Ok(Record {
            file: self.file.clone(),
            role: Role::Identify,
            excitation: self.words.clone(),
            start_s: 0.0,
            period_s: self.period_s,
            voltage_v: self.voltage_v.clone(),
            position_um: process::readings(stage, self.period_s, &self.voltage_v)?,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        })
    }
}

/// What the commands are made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Protocol {
    /// Sample period of the controller, seconds.
    pub period_s: f64,
    /// Highest voltage that is used; the lowest is 0 V.
    pub top_v: f64,
    /// Seed of what is random.
    pub seed: u64,
}

impl Protocol {
    /// What is played before anything is known, then the passes of training, each with the inverse identified so far.
    ///
    /// # Errors
    /// Those of the one who plays; records from which the stage cannot be identified.
    pub fn play<E: From<ControlError>>(
        &self,
        mut records: Dataset,
        play: &Play<'_, E>,
        progress: &dyn Fn(f64),
    ) -> Result<Campaign, E> {
        const FIRST: f64 = 0.3;
        records
            .records
            .extend(play(self.first()?, &|share| progress(FIRST * share))?);
        progress(FIRST);
        let mut model = control::identify(&records).map_err(ControlError::from)?;
        for pass in 1..=TRAINING_PASSES {
            let so_far = |share: f64| FIRST + (1.0 - FIRST) * (pass as f64 - 1.0 + share) / TRAINING_PASSES as f64;
            let commands = self.training(&model, pass)?;
            records
                .records
                .extend(play(commands, &|share| progress(so_far(share)))?);
            model = control::identify(&records).map_err(ControlError::from)?;
            progress(so_far(1.0));
        }
        Ok(Campaign { records, model })
    }

    /// A seed of its own for each record.
    fn seed_of(&self, number: u64) -> u64 {
        seed_of(self.seed, number)
    }

    /// What is played before anything is known: small multisine, holds, large signals.
    ///
    /// # Errors
    /// A rate or a voltage that cannot be played.
    pub fn first(&self) -> Result<Vec<Command>, ControlError> {
        let mut commands = vec![self.small_multisine()?, self.holds()];
        commands.extend(self.large_signals()?);
        Ok(commands)
    }

    /// 1.5 % of the range about 40 % of it, up to a quarter of the sample rate, nine periods of 0.4 s of which eight count.
    fn small_multisine(&self) -> Result<Command, ControlError> {
        let period_s = self.period_s;
        let multisine = Multisine {
            low_hz: 20.0,
            high_hz: 0.24 / period_s,
            period_s: 20_000.0 * period_s,
            periods: PERIODS_KEPT as u32 + 1,
            bias_v: 0.4 * self.top_v,
            peak_v: 0.015 * self.top_v,
            seed: self.seed_of(0),
        };
        let voltage_v = with_rise(&multisine.samples(period_s)?, RISE_S, period_s)?;
        Ok(Command {
            file: "frf-small.csv".to_owned(),
            words: multisine.description(),
            purpose: Purpose::SmallSignals,
            period_s,
            // The rise and the first period, in which creep and ringing settle, are left out.
            skip: voltage_v.len() - PERIODS_KEPT * 20_000,
            voltage_v,
            reference_um: None,
            seed: self.seed_of(0),
        })
    }

    /// Half the range, then a fifth of it, 12 s each, after 50 ms at rest; moves of half a cosine in 20 ms, which hardly ring.
    fn holds(&self) -> Command {
        // A whole number of the controller's samples, so that a record of all commands has it as well.
        let period_s = (HOLD_PERIOD_S / self.period_s).round().max(1.0) * self.period_s;
        let samples = |time_s: f64| (time_s / period_s).round() as usize;
        let levels = [0.0, 0.5 * self.top_v, 0.2 * self.top_v];
        let mut voltage_v = vec![0.0; samples(0.05)];
        for pair in levels.windows(2) {
            let ramp = samples(0.02);
            let share = |k: usize| 0.5 * (1.0 - (std::f64::consts::PI * k as f64 / ramp as f64).cos());
            voltage_v.extend((1..ramp).map(|k| pair[0] + (pair[1] - pair[0]) * share(k)));
            voltage_v.extend(std::iter::repeat_n(pair[1], samples(HOLD_S)));
        }
        Command {
            file: "hold.csv".to_owned(),
            words: format!(
                "{} V and {} V held for {HOLD_S} s each",
                short(levels[1]),
                short(levels[2])
            ),
            purpose: Purpose::Creep,
            period_s,
            voltage_v,
            skip: 0,
            reference_um: None,
            seed: self.seed_of(1),
        }
    }

    /// Voltages before any inverse is known: noise and sines over most of the range.
    fn large_signals(&self) -> Result<Vec<Command>, ControlError> {
        let (period_s, top_v) = (self.period_s, self.top_v);
        let sine = |frequency_hz: f64, low: f64, high: f64, seconds: f64| -> Box<dyn Excitation> {
            Box::new(Sine {
                frequency_hz,
                low_v: low * top_v,
                high_v: high * top_v,
                periods: (seconds * frequency_hz).round(),
            })
        };
        let random = BandNoise {
            bandwidth_hz: 400.0,
            duration_s: 1.5,
            rms_v: 0.15 * top_v,
            low_v: 0.1 * top_v,
            high_v: 0.75 * top_v,
            seed: self.seed_of(2),
        };
        let plan: [(&str, Box<dyn Excitation>); 5] = [
            ("large-noise", Box::new(random)),
            ("large-007hz", sine(7.0, 0.0, 0.75, 0.572)),
            ("large-023hz", sine(23.0, 0.1, 0.72, 0.261)),
            ("large-097hz", sine(97.0, 0.1, 0.72, 0.2)),
            ("large-403hz", sine(403.0, 0.12, 0.7, 0.15)),
        ];
        let command = |(number, (file, excitation)): (u64, (&str, Box<dyn Excitation>))| {
            Ok(Command {
                file: format!("{file}.csv"),
                words: excitation.description(),
                purpose: Purpose::LargeSignals,
                period_s,
                voltage_v: with_rise(&excitation.samples(period_s)?, RISE_S, period_s)?,
                skip: 0,
                reference_um: None,
                seed: self.seed_of(10 + number),
            })
        };
        (0..).zip(plan).map(command).collect()
    }

    /// References along which the inverse is asked to go, over the middle and lower part of the stroke: its commands for them.
    ///
    /// # Errors
    /// A model that has no controller.
    pub fn training(&self, model: &ControlModel, pass: usize) -> Result<Vec<Command>, ControlError> {
        let controller = Controller::design(model, ReferenceKind::Previewed)?;
        let period_s = self.period_s;
        let top_um = controller.model.inverse.input_max_um;
        let range = |low: f64, high: f64| [low * top_um, high * top_um];
        let sine = |frequency_hz: f64, ends: [f64; 2]| Shape::Sine { frequency_hz }.reference(ends, period_s);
        let wide = range(0.15, 0.92);
        let random = |bandwidth_hz: f64, seconds: f64, ends: [f64; 2], stream: u64| {
            let seed = self.seed_of(100 * pass as u64 + stream);
            noise(ends, 0.25 * (ends[1] - ends[0]), bandwidth_hz, seconds, seed, period_s)
        };
        let plan: [(&str, Reference); 10] = [
            ("noise", random(500.0, 1.5, wide, 50)?),
            ("fast-noise", random(1200.0, 0.4, range(0.2, 0.85), 51)?),
            ("023hz", sine(23.0, wide)),
            ("097hz", sine(97.0, range(0.2, 0.9))),
            ("097hz-small", sine(97.0, range(0.35, 0.75))),
            ("061hz-low", sine(61.0, range(0.1, 0.55))),
            ("403hz", sine(403.0, range(0.2, 0.85))),
            ("907hz", sine(907.0, range(0.25, 0.8))),
            (
                "triangle-061hz",
                Shape::Triangle { frequency_hz: 61.0 }.reference(range(0.2, 0.9), period_s),
            ),
            (
                "harmonics-079hz",
                Shape::ComplexHarmonic { frequency_hz: 79.0 }.reference(range(0.15, 0.85), period_s),
            ),
        ];
        let law = controller.law::<f64>()?;
        let command = |(number, (file, reference)): (usize, (&str, Reference))| Command {
            file: format!("training{pass}-{file}.csv"),
            words: format!("open loop along {file}, pass {pass}"),
            purpose: Purpose::Training,
            period_s,
            voltage_v: commands(&law, &reference),
            skip: law.ahead(),
            reference_um: Some(reference.samples_um),
            seed: self.seed_of(100 * pass as u64 + number as u64),
        };
        Ok(plan.into_iter().enumerate().map(command).collect())
    }
}

/// A seed of its own for each record or run: the golden-ratio increment of splitmix64 keeps streams apart.
pub fn seed_of(seed: u64, number: u64) -> u64 {
    seed.wrapping_add((number + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15))
}
