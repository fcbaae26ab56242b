//! Ten programmes of recordings, as users make them.

use super::hidden::{Effect, Outside};
use super::rig::{Command, Drive, Room};
use super::signals;
use hysteron_data::Role::{self, Identify, Validate};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// A programme.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Programme {
    /// Three sines, as the paper has them.
    ThreeSines,
    /// A decaying triangle and a step.
    TriangleStep,
    /// Captures of an oscilloscope: few periods from mid-cycle, 8 to 12 bits.
    Scope,
    /// A raster scan, the other axis recorded.
    Raster,
    /// 1 kHz over minutes, with the temperature.
    Minutes,
    /// The drive comes from a loop on the sensor.
    ClosedLoop,
    /// Voltage and position from two instruments.
    Skewed,
    /// The amplifier's monitor instead of the command.
    Monitor,
    /// One sine ten times.
    Repeats,
    /// Fifteen records at other rates and amplitudes.
    Fifteen,
}

impl Programme {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::ThreeSines,
        Self::TriangleStep,
        Self::Scope,
        Self::Raster,
        Self::Minutes,
        Self::ClosedLoop,
        Self::Skewed,
        Self::Monitor,
        Self::Repeats,
        Self::Fifteen,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::ThreeSines => "three-sines",
            Self::TriangleStep => "triangle-step",
            Self::Scope => "scope",
            Self::Raster => "raster",
            Self::Minutes => "minutes-1khz",
            Self::ClosedLoop => "closed-loop",
            Self::Skewed => "skewed",
            Self::Monitor => "monitor",
            Self::Repeats => "one-sine-repeated",
            Self::Fifteen => "fifteen",
        }
    }

    /// Effects that such records can contain.
    pub fn effects(self) -> &'static [Effect] {
        use Effect::{
            Backlash, Bend, Coupling, Creep, Delay, Hum, Lag, RateDependence, Resonance, Saturation, Slew, ThermalDrift,
        };
        match self {
            Self::ThreeSines => &[
                Delay,
                Lag,
                Resonance,
                Slew,
                RateDependence,
                Saturation,
                Backlash,
                Bend,
                Hum,
            ],
            Self::TriangleStep => &[Creep, Resonance, Saturation, Backlash, Bend, Hum],
            Self::Scope => &[Lag, Delay, Hum, Resonance, Slew, Saturation, Backlash, Bend],
            Self::Raster => &[Coupling, Delay, Lag, Resonance, Hum, RateDependence, Creep],
            Self::Minutes => &[ThermalDrift, Creep, Backlash, Bend, Hum, Saturation],
            Self::ClosedLoop => &[Lag, Saturation, Delay, Resonance, Coupling, Hum, RateDependence],
            Self::Skewed => &[Resonance, Slew, RateDependence, Hum, Backlash, Saturation, Bend],
            Self::Monitor => &[
                Resonance,
                RateDependence,
                Backlash,
                Bend,
                Hum,
                Saturation,
                Creep,
                Lag,
                Delay,
            ],
            Self::Repeats => &[
                Backlash,
                ThermalDrift,
                Creep,
                Hum,
                Coupling,
                Delay,
                Lag,
                Bend,
                Saturation,
            ],
            Self::Fifteen => &Effect::ALL,
        }
    }

    /// What else may spoil such records.
    pub fn outside(self) -> &'static [Outside] {
        use Outside::{Ageing, Feedthrough, Jitter, Pwm, Ripple, Slip, StuckBit};
        match self {
            Self::ThreeSines | Self::Scope | Self::Skewed => &[Ripple, Jitter, Pwm, Feedthrough, StuckBit],
            Self::TriangleStep | Self::Minutes => &[Ripple, Slip, StuckBit],
            Self::Raster | Self::ClosedLoop => &[Ripple, Pwm, Feedthrough, Slip],
            Self::Monitor => &[Ripple, Jitter, Feedthrough, StuckBit],
            Self::Repeats => &[Ageing, Slip, Ripple, Jitter],
            Self::Fifteen => &Outside::ALL,
        }
    }
}

/// What there is of a stage and its rig before anything is hidden.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setting {
    /// Voltage range.
    pub(crate) range_v: [f64; 2],
    /// Stroke over it, micrometres.
    pub(crate) stroke_um: f64,
    /// Whether the other axis is to move.
    pub(crate) other_axis: bool,
}

/// The records to take, those to hold out, and the surroundings.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// What the user has.
    pub(crate) drives: Vec<Drive>,
    /// Records for the judgement alone.
    pub(crate) held_out: Vec<Drive>,
    /// The room.
    pub(crate) room: Room,
    /// Whether the stage's temperature is recorded.
    pub(crate) temperature_column: bool,
    /// Fastest period of a drive, seconds.
    pub(crate) fastest_s: f64,
}

/// The other axis' share of its range while it moves.
pub(crate) const OTHER_RANGE_V: f64 = 100.0;

struct Maker<'a> {
    setting: &'a Setting,
    rng: &'a mut Pcg64,
    drives: Vec<Drive>,
    /// Share of the range that is used.
    reach: f64,
}

impl Maker<'_> {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.rng.random_range(low..high)
    }

    fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.rng.random_range(0..of.len())]
    }

    fn volts(&self, signal: Vec<f64>) -> Vec<f64> {
        let [low, high] = self.setting.range_v;
        signal
            .into_iter()
            .map(|x| low + 0.5 * (high - low) * self.reach * (x + 1.0))
            .collect()
    }

    fn add(&mut self, file: &str, role: Role, period_s: f64, signal: Vec<f64>) -> &mut Drive {
        let other_v = self.setting.other_axis.then(|| self.other_axis(period_s, signal.len()));
        let command = Command::Voltage(self.volts(signal));
        let pause_s = self.between(0.5, 2.0);
        let n = self.drives.len();
        self.drives.push(Drive {
            file: format!("{file}.csv"),
            excitation: file.to_owned(),
            role,
            period_s,
            command,
            other_v,
            lead_in: 0,
            pause_s,
            jumps: false,
        });
        &mut self.drives[n]
    }

    /// The other axis at work of its own: a triangle whose frequency has nothing to do with this axis.
    fn other_axis(&mut self, period_s: f64, samples: usize) -> Vec<f64> {
        let length_s = period_s * samples as f64;
        let hz = self.between(2.3, 6.7) / length_s;
        let still = self.between(0.0, 1.0) < 0.2;
        let wave = signals::triangle(hz, 0.0, if still { 0.0 } else { 1.0 });
        (0..samples)
            .map(|k| 0.5 * OTHER_RANGE_V * (1.0 + wave(k as f64 * period_s)))
            .collect()
    }
}

/// Draws what is taken.
pub(crate) fn plan(programme: Programme, setting: &Setting, rng: &mut Pcg64) -> Plan {
    let mut maker = Maker {
        setting,
        rng,
        drives: Vec::new(),
        reach: 1.0,
    };
    maker.reach = maker.between(0.8, 1.0);
    let mut room = Room {
        ramp: 0.0,
        wave: 0.05,
        wave_period_s: 600.0,
    };
    let mut temperature_column = false;
    // Sample period, length and fastest sine of the held-out records.
    let held = match programme {
        Programme::ThreeSines => three_sines(&mut maker),
        Programme::TriangleStep => triangle_step(&mut maker),
        Programme::Scope => scope(&mut maker),
        Programme::Raster => raster(&mut maker),
        Programme::Minutes => {
            temperature_column = true;
            room = Room {
                ramp: maker.between(-0.01, 0.025),
                wave: 0.3,
                wave_period_s: 140.0,
            };
            minutes(&mut maker)
        }
        Programme::ClosedLoop => closed_loop(&mut maker),
        Programme::Skewed => skewed(&mut maker),
        Programme::Monitor => monitor(&mut maker),
        Programme::Repeats => {
            temperature_column = maker.between(0.0, 1.0) < 0.6;
            room = Room {
                ramp: maker.between(0.005, 0.05),
                wave: 0.1,
                wave_period_s: 300.0,
            };
            repeats(&mut maker)
        }
        Programme::Fifteen => {
            temperature_column = maker.between(0.0, 1.0) < 0.7;
            room = Room {
                ramp: maker.between(-0.02, 0.05),
                wave: 0.1,
                wave_period_s: 200.0,
            };
            fifteen(&mut maker)
        }
    };
    let taken = std::mem::take(&mut maker.drives);
    hold_out(&mut maker, held);
    let held_out = maker.drives;
    Plan {
        drives: taken,
        held_out,
        room,
        temperature_column,
        fastest_s: held[2],
    }
}

type Held = [f64; 3];

/// Two records within what the programme reached: a triangle about the middle, and noise.
fn hold_out(maker: &mut Maker<'_>, [period_s, length_s, fastest_s]: Held) {
    let hz = 0.4 / fastest_s;
    let triangle = signals::triangle(
        hz.max(2.2 / length_s),
        maker.between(-0.15, 0.15),
        maker.between(0.6, 0.8),
    );
    maker.add(
        "held-out-triangle",
        Validate,
        period_s,
        signals::of(length_s, period_s, triangle),
    );
    let noise = signals::noise(0.1 * hz + 0.5 / length_s, 1.5 * hz, 0.9, 0.15 * length_s, maker.rng);
    maker.add(
        "held-out-noise",
        Validate,
        period_s,
        signals::of(length_s, period_s, noise),
    );
}

fn three_sines(maker: &mut Maker<'_>) -> Held {
    let set = maker.one_of(&[
        [10.0, 100.0, 500.0],
        [11.0, 97.0, 503.0],
        [5.0, 50.0, 250.0],
        [20.0, 200.0, 700.0],
    ]);
    let period_s = maker.one_of(&[2e-5, 4e-5, 5e-5]);
    let validates = maker.between(0.0, 1.0) < 0.35;
    for (n, hz) in set.into_iter().enumerate() {
        let cycles = [3.0, 8.0, 20.0][n];
        let role = if validates && n == 1 { Validate } else { Identify };
        maker.add(
            &format!("sine{hz:.0}"),
            role,
            period_s,
            signals::of(cycles / hz, period_s, signals::sine(hz, 0.0, 1.0)),
        );
    }
    [5e-5, 0.25, 1.0 / set[2]]
}

fn triangle_step(maker: &mut Maker<'_>) -> Held {
    let (period_s, hz) = (maker.one_of(&[5e-4, 1e-3]), maker.between(0.4, 1.2));
    let ratio = maker.between(0.05, 0.3);
    maker.add(
        "triangle",
        Identify,
        period_s,
        signals::of(20.0, period_s, signals::decaying(hz, 20.0, ratio)),
    );
    let (level, back) = (maker.between(0.0, 0.8), maker.between(-0.8, -0.2));
    let levels = vec![-1.0, level, level, back];
    let role = if maker.between(0.0, 1.0) < 0.6 {
        Validate
    } else {
        Identify
    };
    let step = signals::of(12.0, period_s, signals::steps(levels, 3.0, 2e-3));
    maker.add("step", role, period_s, step).jumps = true;
    [period_s, 8.0, 1.0 / hz]
}

fn scope(maker: &mut Maker<'_>) -> Held {
    let captures = maker.rng.random_range(2..=5);
    let mut fastest: f64 = 0.0;
    let validates = maker.between(0.0, 1.0) < 0.6;
    let top = maker.one_of(&[120.0, 300.0, 800.0]);
    for n in 0..captures {
        let hz = top * 0.25f64.powi(n) * maker.between(0.9, 1.1);
        fastest = fastest.max(hz);
        let points = maker.one_of(&[5000, 5000, 10000]);
        let cycles = maker.between(2.3, 5.6);
        // The time base is one of the instrument's, no whole number of periods.
        let period_s = cycles / hz / f64::from(points);
        let before = maker.between(1.2, 3.0) / hz;
        let amplitude = if n == 1 { maker.between(0.4, 0.7) } else { 1.0 };
        let signal = signals::of(
            before + cycles / hz,
            period_s,
            signals::sine(hz, amplitude - 1.0, amplitude),
        );
        let role = if validates && n == captures - 1 {
            Validate
        } else {
            Identify
        };
        let lead_in = signal.len() - points as usize;
        maker.add(&format!("scope{n}"), role, period_s, signal).lead_in = lead_in;
    }
    [5e-5, 0.25, 1.0 / fastest]
}

fn raster(maker: &mut Maker<'_>) -> Held {
    let period_s = maker.one_of(&[1e-4, 5e-5]);
    let hz = maker.between(8.0, 40.0);
    let records = if maker.between(0.0, 1.0) < 0.3 { 1 } else { 2 };
    for n in 0..records {
        let (rate, lines) = (hz * [1.0, 0.6][n], 24.0);
        let samples = signals::of(lines / rate, period_s, signals::triangle(rate, 0.0, 1.0));
        // The slow axis climbs at the end of every line, within a twentieth of it.
        let staircase = |t: f64| {
            let line = (t * rate).floor();
            (line + ((t * rate - line - 0.95) / 0.05).max(0.0)) / lines
        };
        let slow = signals::of(lines / rate, period_s, |t| OTHER_RANGE_V * staircase(t));
        let role = if n == 1 { Validate } else { Identify };
        maker.add(&format!("scan{n}"), role, period_s, samples).other_v = Some(slow);
    }
    [period_s, 0.25, 1.0 / hz]
}

fn minutes(maker: &mut Maker<'_>) -> Held {
    let period_s = 1e-3;
    let validates = maker.between(0.0, 1.0) < 0.3;
    for n in 0..4 {
        let role = if validates && n == 3 { Validate } else { Identify };
        let signal = match n {
            0 => signals::of(20.0, period_s, signals::sine(0.5, 0.0, 1.0)),
            1 => signals::of(20.0, period_s, signals::triangle(0.25, -0.3, 0.7)),
            2 => {
                let levels = (0..8)
                    .map(|k| if k == 0 { -1.0 } else { maker.between(-0.9, 0.9) })
                    .collect();
                signals::of(20.0, period_s, signals::steps(levels, 2.5, 0.02))
            }
            _ => signals::of(20.0, period_s, signals::noise(0.05, 1.5, 0.95, 2.0, maker.rng)),
        };
        let drive = maker.add(&format!("run{n}"), role, period_s, signal);
        drive.jumps = n == 2;
        drive.pause_s = 10.0;
    }
    [1e-3, 8.0, 2.0]
}

fn closed_loop(maker: &mut Maker<'_>) -> Held {
    let period_s = maker.one_of(&[5e-5, 1e-4]);
    let top = maker.between(30.0, 90.0);
    // The loop's bandwidth is a few times its fastest reference.
    let gain = TAU * 4.0 * top;
    let (stroke, reach) = (maker.setting.stroke_um, maker.reach);
    let position = move |signal: Vec<f64>, zero: f64| -> Vec<f64> {
        signal
            .into_iter()
            .map(|x| zero + stroke * (0.04 + 0.92 * 0.5 * reach * (x + 1.0)))
            .collect()
    };
    for (n, share) in [1.0, 0.3, 0.6].into_iter().enumerate() {
        let hz = top * share;
        let signal = match n {
            0 => signals::of(0.5, period_s, signals::sine(hz, 0.0, 1.0)),
            1 => signals::of(0.3, period_s, signals::triangle(hz, 0.0, 1.0)),
            _ => signals::of(0.4, period_s, signals::noise(0.2 * hz, hz, 0.9, 0.05, maker.rng)),
        };
        let role = if n == 2 { Validate } else { Identify };
        // The sensor's zero is added where the rig is known.
        let reference = position(signal.clone(), 0.0);
        maker.add(&format!("loop{n}"), role, period_s, signal).command = Command::ClosedLoop(reference, gain);
    }
    [period_s, 0.25, 1.0 / top]
}

fn skewed(maker: &mut Maker<'_>) -> Held {
    let period_s = 2e-5;
    for (n, hz) in [11.0, 97.0, 503.0, 97.0].into_iter().enumerate() {
        let cycles = [4.0, 10.0, 25.0, 10.0][n];
        let (amplitude, role) = if n == 3 { (0.6, Validate) } else { (1.0, Identify) };
        let signal = signals::of(cycles / hz, period_s, signals::sine(hz, amplitude - 1.0, amplitude));
        maker.add(&format!("sine{hz:.0}-{n}"), role, period_s, signal);
    }
    let noise = signals::noise(20.0, 400.0, 0.95, 0.02, maker.rng);
    maker.add("noise", Identify, period_s, signals::of(0.2, period_s, noise));
    [5e-5, 0.25, 1.0 / 503.0]
}

fn monitor(maker: &mut Maker<'_>) -> Held {
    let period_s = 2.5e-5;
    let validates = maker.between(0.0, 1.0) < 0.5;
    for (n, hz) in [10.0, 100.0, 300.0].into_iter().enumerate() {
        let cycles = [3.0, 8.0, 20.0][n];
        maker.add(
            &format!("sine{hz:.0}"),
            Identify,
            period_s,
            signals::of(cycles / hz, period_s, signals::sine(hz, 0.0, 1.0)),
        );
    }
    let role = if validates { Validate } else { Identify };
    maker.add(
        "triangle",
        role,
        period_s,
        signals::of(0.25, period_s, signals::triangle(20.0, -0.2, 0.7)),
    );
    let step = signals::of(6.0, 5e-4, signals::steps(vec![-1.0, 0.4, -0.6], 2.0, 1e-3));
    maker.add("step", Identify, 5e-4, step).jumps = true;
    [5e-5, 0.25, 1.0 / 300.0]
}

fn repeats(maker: &mut Maker<'_>) -> Held {
    let hz = maker.one_of(&[1.0, 10.0, 25.0, 50.0, 100.0]);
    let period_s = f64::min(1.0 / hz / 400.0, 2e-3);
    let validates = maker.between(0.0, 1.0) < 0.5;
    for n in 0..10 {
        let role = if validates && n % 5 == 4 { Validate } else { Identify };
        let signal = signals::of(5.0 / hz, period_s, signals::sine(hz, 0.0, 1.0));
        maker.add(&format!("repeat{n:02}"), role, period_s, signal).pause_s = 4.0;
    }
    [period_s, 20.0 / hz, 2.0 / hz]
}

fn fifteen(maker: &mut Maker<'_>) -> Held {
    let scheme = maker.rng.random_range(0..3);
    let fast = maker.one_of(&[2e-5, 4e-5, 5e-5]);
    let top = maker.one_of(&[200.0, 503.0, 700.0]);
    let sines = [
        (1.0, 1.0),
        (5.0, 0.5),
        (10.0, 1.0),
        (31.0, 0.25),
        (0.2 * top, 1.0),
        (0.2 * top, 0.5),
        (0.4 * top, 0.7),
        (top, 1.0),
    ];
    for (n, (hz, amplitude)) in sines.into_iter().enumerate() {
        let period_s = f64::max(fast, 1.0 / hz / 4000.0);
        let cycles = [2.0, 3.0, 4.0, 4.0, 8.0, 8.0, 10.0, 20.0][n];
        let signal = signals::of(cycles / hz, period_s, signals::sine(hz, amplitude - 1.0, amplitude));
        maker.add(&format!("sine{hz:.0}-{n}"), Identify, period_s, signal);
    }
    let triangle = signals::triangle(5.0, 0.4, 0.3);
    maker.add("minor", Identify, 2e-4, signals::of(1.0, 2e-4, triangle));
    maker.add(
        "decay",
        Identify,
        1e-4,
        signals::of(1.0, 1e-4, signals::decaying(12.0, 1.0, 0.05)),
    );
    for (name, to) in [("hold-a", 0.3), ("hold-b", 0.7)] {
        let hold = signals::of(12.0, 1e-3, signals::steps(vec![-1.0, to, -0.5], 5.0, 5e-3));
        maker.add(name, Identify, 1e-3, hold).jumps = true;
    }
    maker.add(
        "multisine",
        Identify,
        fast,
        signals::of(0.5, fast, signals::multisine(4.0, 14, 0.0, 0.1, 0.02)),
    );
    let noise = signals::noise(10.0, 0.5 * top, 0.95, 0.04, maker.rng);
    maker.add("noise", Identify, fast, signals::of(0.4, fast, noise));
    maker.add("quiet", Identify, 2e-4, signals::of(2.0, 2e-4, |_| 0.0));
    for (n, drive) in maker.drives.iter_mut().enumerate() {
        let validates = match scheme {
            0 => false,
            1 => [3, 5, 6, 8, 11, 13].contains(&n),
            _ => [5, 13].contains(&n),
        };
        drive.role = if validates { Validate } else { Identify };
    }
    [5e-5, 0.25, 1.0 / top]
}
