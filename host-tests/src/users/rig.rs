//! How a stage is driven and recorded: instruments, pauses, closed loop, the other axis, the room.

use super::elements::At;
use super::stage::{Seen, Stage};
use hysteron_data::{Record, Role};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// What drives a record.
#[derive(Debug, Clone)]
pub(crate) enum Command {
    /// Voltages, one a sample, straight between them.
    Voltage(Vec<f64>),
    /// A reference that a PI loop on the sensor follows: positions, gain per second over the stage's own gain.
    ClosedLoop(Vec<f64>, f64),
}

impl Command {
    fn len(&self) -> usize {
        match self {
            Self::Voltage(values) | Self::ClosedLoop(values, _) => values.len(),
        }
    }
}

/// A record to be taken.
#[derive(Debug, Clone)]
pub(crate) struct Drive {
    /// File name.
    pub(crate) file: String,
    /// The excitation in words.
    pub(crate) excitation: String,
    /// What the user has it for.
    pub(crate) role: Role,
    /// Sample period, seconds.
    pub(crate) period_s: f64,
    /// What is played.
    pub(crate) command: Command,
    /// Voltages of the other axis, one a sample, where it moves.
    pub(crate) other_v: Option<Vec<f64>>,
    /// Samples that are played before the recording begins.
    pub(crate) lead_in: usize,
    /// Seconds at rest before it.
    pub(crate) pause_s: f64,
    /// Whether it jumps: its rate says nothing of the programme's.
    pub(crate) jumps: bool,
}

/// What stands between the stage and the file.
#[derive(Debug, Clone)]
pub(crate) struct Instrument {
    /// Noise of the sensor, micrometres rms.
    pub(crate) noise_um: f64,
    /// Step of the sensor's converter, micrometres.
    pub(crate) position_step_um: f64,
    /// Step of the voltage's converter, volts.
    pub(crate) voltage_step_v: f64,
    /// The monitor of the amplifier instead of the command: gain, offset and noise in volts.
    pub(crate) monitor: Option<[f64; 3]>,
    /// Position late against voltage, seconds; negative where it leads.
    pub(crate) skew_s: f64,
    /// Outside the catalogue: jitter of the sample clock, seconds rms.
    pub(crate) jitter_s: f64,
    /// Outside the catalogue: a bit of the converter that is always set.
    pub(crate) stuck_bit: Option<u32>,
    /// Whether the position falls while the voltage rises: the sensor looks from the other side.
    pub(crate) reversed: bool,
    /// Whether there is a column of the stage's temperature.
    pub(crate) temperature_column: bool,
}

/// The room: a ramp and a slow wave.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Room {
    /// Kelvin per second.
    pub(crate) ramp: f64,
    /// Kelvin.
    pub(crate) wave: f64,
    /// Seconds.
    pub(crate) wave_period_s: f64,
}

impl Room {
    /// Kelvin above the start.
    pub(crate) fn warmer_k(&self, t_s: f64) -> f64 {
        self.ramp * t_s + self.wave * (TAU * t_s / self.wave_period_s).sin()
    }
}

/// A stage on its rig, with all that happened to it so far.
#[derive(Debug, Clone)]
pub(crate) struct Rig {
    /// The stage.
    pub(crate) stage: Stage,
    /// How it is recorded.
    pub(crate) instrument: Instrument,
    /// The room.
    pub(crate) room: Room,
    seed: u64,
    now_s: f64,
    records: usize,
    command_v: f64,
    other_v: f64,
}

/// A record, and what was played before it.
#[derive(Debug, Clone)]
pub(crate) struct Played {
    /// The record.
    pub(crate) record: Record,
    /// The command at the sample times, from the lead-in on, as the stage got it.
    pub(crate) command_v: Vec<f64>,
    /// How many of these are before the record.
    pub(crate) lead_in: usize,
}

/// Steps of the simulation are no longer than this where the record's own are not far longer.
const STEP_S: f64 = 5e-6;

/// Room temperature at the start, degrees Celsius.
const ROOM_C: f64 = 22.0;

impl Rig {
    /// A stage on its rig, at its lowest voltage.
    pub(crate) fn new(stage: Stage, instrument: Instrument, room: Room, seed: u64) -> Self {
        let command_v = stage.range_v[0];
        Self {
            stage,
            instrument,
            room,
            seed,
            now_s: 0.0,
            records: 0,
            command_v,
            other_v: 0.0,
        }
    }

    /// The stage as it is after full cycles and a long rest.
    pub(crate) fn settle(&mut self) {
        self.stage.loops.condition();
        let at = self.at(0.0);
        self.stage.rest(&at);
    }

    /// Takes a record after those before.
    pub(crate) fn play(&mut self, drive: &Drive) -> Played {
        let mut rng = Pcg64::seed_from_u64(self.seed.wrapping_mul(1_000_003).wrapping_add(self.records as u64));
        let fine = (drive.period_s / STEP_S).round().clamp(2.0, 10.0) as usize;
        let course = self.run(drive, fine, &mut rng);
        let record = self.record(drive, &course, fine, &mut rng);
        self.records += 1;
        Played {
            record,
            command_v: course.command_v.iter().step_by(fine).copied().collect(),
            lead_in: drive.lead_in,
        }
    }

    /// What moves the stage, step by step, from its rest before the record to the record's end.
    fn run(&mut self, drive: &Drive, fine: usize, rng: &mut Pcg64) -> Course {
        let n = drive.command.len();
        let h = drive.period_s / fine as f64;
        let between = |values: &[f64], i: usize| {
            let (k, part) = (i / fine, (i % fine) as f64 / fine as f64);
            values[k] + part * (values[(k + 1).min(n - 1)] - values[k])
        };
        let other = |i: usize| drive.other_v.as_ref().map_or(0.0, |values| between(values, i));
        let mut course = Course::default();
        let mut integral = 0.0;
        if let Command::ClosedLoop(reference, _) = &drive.command {
            integral = self.voltage_for(reference[0]);
        }
        let start_v = match &drive.command {
            Command::Voltage(values) => self.converted(values[0]),
            Command::ClosedLoop(..) => integral,
        };
        let mut seen = self.pause(start_v, other(0), drive.pause_s);
        for i in 0..(n - 1) * fine + 1 {
            self.command_v = match &drive.command {
                Command::Voltage(values) => self.converted(between(values, i)),
                Command::ClosedLoop(reference, gain) => {
                    let noise = self.instrument.noise_um * gaussian(rng);
                    let error = between(reference, i) - seen.reading_um - noise;
                    let per_um = self.volts_per_um();
                    let span = self.stage.range_v;
                    integral = (integral + error * per_um * gain * h).clamp(span[0], span[1]);
                    (integral + 0.05 * per_um * error).clamp(span[0], span[1])
                }
            };
            self.other_v = other(i);
            let dt_s = if i == 0 { 0.0 } else { h };
            self.now_s += dt_s;
            seen = self.stage.step(&self.at(dt_s));
            course.command_v.push(self.command_v);
            course.amplifier_v.push(seen.amplifier_v);
            course.reading_um.push(seen.reading_um);
            course.other_v.push(self.other_v);
            course.warmer_k.push(self.room.warmer_k(self.now_s));
        }
        course
    }

    /// Goes to a voltage within 50 ms and rests there, in steps that lengthen.
    fn pause(&mut self, to_v: f64, other_v: f64, pause_s: f64) -> Seen {
        let (from, other_from, ramp) = (self.command_v, self.other_v, 400);
        for k in 1..=ramp {
            let part = f64::from(k) / f64::from(ramp);
            self.command_v = from + part * (to_v - from);
            self.other_v = other_from + part * (other_v - other_from);
            self.now_s += 0.05 / f64::from(ramp);
            self.stage.step(&self.at(0.05 / f64::from(ramp)));
        }
        let mut left_s = pause_s;
        let mut dt_s = 1e-4;
        loop {
            let dt = f64::min(dt_s, left_s);
            self.now_s += dt;
            left_s -= dt;
            dt_s *= 1.2;
            let seen = self.stage.step(&self.at(dt));
            if left_s <= 0.0 {
                return seen;
            }
        }
    }

    fn record(&self, drive: &Drive, course: &Course, fine: usize, rng: &mut Pcg64) -> Record {
        let h = drive.period_s / fine as f64;
        let samples = drive.lead_in..drive.command.len();
        let last = course.reading_um.len() - 1;
        let position_um = samples.clone().map(|k| {
            let late_s = self.instrument.jitter_s * gaussian(rng) - self.instrument.skew_s;
            let at = ((k * fine) as f64 + late_s / h).clamp(0.0, last as f64);
            let (i, part) = (at as usize, at.fract());
            let next = course.reading_um[(i + 1).min(last)];
            let reading = course.reading_um[i] + part * (next - course.reading_um[i]);
            self.digitised(reading + self.instrument.noise_um * gaussian(rng))
        });
        let position_um: Vec<f64> = position_um.collect();
        let voltage = |k: usize, rng: &mut Pcg64| match self.instrument.monitor {
            Some([gain, offset, noise]) => {
                self.converted(gain * course.amplifier_v[k * fine] + offset + noise * gaussian(rng))
            }
            None => self.converted(course.command_v[k * fine]),
        };
        let voltage_v = samples.clone().map(|k| voltage(k, rng)).collect();
        let temperature_c = self.instrument.temperature_column.then(|| {
            let reading = |k: usize| ROOM_C + course.warmer_k[k * fine] + 0.01 * gaussian(rng);
            samples.clone().map(reading).collect()
        });
        Record {
            file: drive.file.clone(),
            role: drive.role,
            excitation: drive.excitation.clone(),
            start_s: 0.0,
            period_s: drive.period_s,
            voltage_v,
            position_um,
            reference_um: match &drive.command {
                Command::ClosedLoop(reference, _) => Some(reference[samples.clone()].to_vec()),
                Command::Voltage(_) => None,
            },
            temperature_c,
            voltage2_v: drive
                .other_v
                .as_ref()
                .map(|_| samples.map(|k| course.other_v[k * fine]).collect()),
        }
    }

    fn at(&self, dt_s: f64) -> At {
        At {
            t_s: self.now_s,
            dt_s,
            command_v: self.command_v,
            other_v: self.other_v,
            warmer_k: self.room.warmer_k(self.now_s),
            record: self.records,
        }
    }

    fn volts_per_um(&self) -> f64 {
        (self.stage.range_v[1] - self.stage.range_v[0]) / self.stage.stroke_um
    }

    fn voltage_for(&self, position_um: f64) -> f64 {
        let [low, high] = self.stage.range_v;
        (low + (position_um - self.stage.zero_um) * self.volts_per_um()).clamp(low, high)
    }

    fn converted(&self, volts: f64) -> f64 {
        let step = self.instrument.voltage_step_v;
        (volts / step).round() * step
    }

    fn digitised(&self, position_um: f64) -> f64 {
        let step = self.instrument.position_step_um;
        let code = (position_um / step).round() * if self.instrument.reversed { -1.0 } else { 1.0 };
        match self.instrument.stuck_bit {
            Some(bit) => ((code as i64) | (1_i64 << bit)) as f64 * step,
            None => code * step,
        }
    }
}

/// The signals of a run at the simulation's own rate.
#[derive(Default)]
struct Course {
    command_v: Vec<f64>,
    amplifier_v: Vec<f64>,
    reading_um: Vec<f64>,
    other_v: Vec<f64>,
    warmer_k: Vec<f64>,
}

/// A normal number after Box and Muller.
pub(crate) fn gaussian(rng: &mut Pcg64) -> f64 {
    let (a, b): (f64, f64) = (rng.random_range(f64::MIN_POSITIVE..1.0), rng.random_range(0.0..1.0));
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}
