//! A stage for control whose every law is of this crate alone, with the instant of each step of the converter.

use crate::users::elements::{At, Element};
use crate::users::loops::{Family, Loops};
use crate::users::rig::gaussian;
use crate::users::stage::Stage;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::VecDeque;

/// Sample period of the controller, seconds.
pub const PERIOD_S: f64 = 20e-6;

/// Longest step of the simulation, seconds.
const STEP_S: f64 = 5e-6;

/// The latency that the user states, seconds, from a reading to the converter's change.
pub const STATED_LATENCY_S: f64 = 30e-6;

/// Bandwidth of a sensor that has a filter, hertz.
const SENSOR_HZ: f64 = 20e3;

/// Creep, share of the motion a decade of time.
const CREEP_A_DECADE: f64 = 0.015;

/// Decades over which it creeps, seconds.
const CREEP_DECADES: [i32; 2] = [-2, 3];

/// What a stage has that nobody told the campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Untold {
    /// Nothing but its physics.
    Nothing,
    /// The sensor reads 3 um at rest.
    Zero,
    /// The sensor ends at [`SENSOR_HZ`], as its data sheet says.
    Filter,
    /// The converter changes a sample later than stated.
    Later,
    /// The converter changes a sample earlier than stated.
    Earlier,
    /// The gain is 1 % larger than while it was recorded.
    Gain,
}

impl Untold {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Nothing,
        Self::Zero,
        Self::Filter,
        Self::Later,
        Self::Earlier,
        Self::Gain,
    ];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Zero => "zero of the sensor, 3 um",
            Self::Filter => "nothing; the sensor's bandwidth of 20 kHz is told",
            Self::Later => "a sample later",
            Self::Earlier => "a sample earlier",
            Self::Gain => "gain, 1 % after the campaign",
        }
    }
}

/// A stage with its amplifier, converters and sensor.
#[derive(Debug, Clone)]
pub struct Foreign {
    /// Its hysteresis.
    pub family: Family,
    /// What is untold of it.
    pub untold: Untold,
    /// Its mode, hertz.
    pub mode_hz: f64,
    /// Highest voltage; the lowest is 0 V.
    pub top_v: f64,
    stage: Stage,
    latency_s: f64,
}

impl Foreign {
    /// A stage of a seed: its hysteresis and what is untold go by turns, the rest is drawn.
    pub fn new(seed: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed);
        let families = [Family::SkewedEverett, Family::ColemanHodgdon, Family::RambergOsgood];
        let family = families[seed as usize % families.len()];
        let untold = Untold::ALL[seed as usize % Untold::ALL.len()];
        let opening = rng.random_range(0.08..0.14);
        let loops = Loops::draw(family, opening, &mut rng);
        let mut between = |low: f64, high: f64| rng.random_range(low..high);
        let top_v = between(90.0, 160.0);
        let mode_hz = between(2500.0, 9000.0);
        let lag = Element::Lag {
            tau_s: between(15e-6, 40e-6),
            lean: [between(0.1, 0.4), top_v],
            state: 0.0,
        };
        let mode = Element::Mode {
            frequency_hz: mode_hz,
            zeta: between(0.01, 0.03),
            share: 1.0,
            state: [0.0; 2],
            last: 0.0,
        };
        let stage = Stage {
            range_v: [0.0, top_v],
            stroke_um: between(8.0, 20.0),
            loops,
            zero_um: if untold == Untold::Zero { 3.0 } else { 0.0 },
            before: vec![lag],
            relaxing: None,
            after: vec![creep(), mode, Element::ThermalGain { per_k: 1.0 }],
            sensor: Vec::new(),
        };
        Self {
            family,
            untold,
            mode_hz,
            top_v,
            stage,
            latency_s: match untold {
                Untold::Later => STATED_LATENCY_S + PERIOD_S,
                Untold::Earlier => STATED_LATENCY_S - PERIOD_S,
                _ => STATED_LATENCY_S,
            },
        }
    }

    /// Bandwidth of the sensor as its data sheet says it, hertz; none of one that is faster than matters.
    pub fn sensor_bandwidth_hz(&self) -> Option<f64> {
        (self.untold == Untold::Filter).then_some(SENSOR_HZ)
    }

    /// The same stage with more latency.
    #[must_use]
    pub fn later(self, by_s: f64) -> Self {
        Self {
            latency_s: self.latency_s + by_s,
            ..self
        }
    }

    /// The stage cycled, at rest at 0 V, to be stepped at a period; `later` is what changes after the campaign.
    pub fn at_rest(&self, period_s: f64, later: bool, seed: u64) -> Running {
        let gain = if later && self.untold == Untold::Gain {
            0.01
        } else {
            0.0
        };
        let steps = (period_s / STEP_S).round().clamp(1.0, 20.0) as usize;
        let mut running = Running {
            stage: self.stage.clone(),
            filter: None,
            noise: Pcg64::seed_from_u64(seed),
            at: At {
                t_s: 0.0,
                dt_s: period_s / steps as f64,
                command_v: 0.0,
                other_v: 0.0,
                warmer_k: gain,
                record: 0,
            },
            steps,
            waiting: VecDeque::new(),
            later_by: (self.latency_s / (period_s / steps as f64)).round() as usize,
            top_v: self.top_v,
            true_um: 0.0,
            read_um: 0.0,
        };
        running.stage.loops.condition();
        running.true_um = running.stage.rest(&running.at).reading_um;
        running.read_um = running.true_um;
        running.filter = self.sensor_bandwidth_hz().map(|_| Filter {
            at_um: running.true_um,
            last_um: running.true_um,
        });
        running
    }
}

/// Half decades of relaxations with the same share.
fn creep() -> Element {
    let [from, to] = CREEP_DECADES;
    let taus_s: Vec<f64> = (2 * from..=2 * to)
        .map(|half| 10f64.powf(0.5 * f64::from(half)))
        .collect();
    Element::PowerCreep {
        shares: vec![0.5 * CREEP_A_DECADE; taus_s.len()],
        states: vec![0.0; taus_s.len()],
        taus_s,
    }
}

/// The sensor's filter of first order.
struct Filter {
    at_um: f64,
    last_um: f64,
}

impl Filter {
    /// After a step on which the position goes on evenly. Taken as held, it would be half a step, a third of the filter's time constant, off.
    fn step(&mut self, true_um: f64, dt_s: f64) -> f64 {
        let steps = std::f64::consts::TAU * SENSOR_HZ * dt_s;
        let decay = (-steps).exp();
        let of_the_last = (1.0 - decay) / steps - decay;
        self.at_um = decay * self.at_um + of_the_last * self.last_um + (1.0 - decay - of_the_last) * true_um;
        self.last_um = true_um;
        self.at_um
    }
}

/// A stage while it runs.
pub struct Running {
    stage: Stage,
    filter: Option<Filter>,
    noise: Pcg64,
    at: At,
    steps: usize,
    /// Commands on their way, with the step at which each acts.
    waiting: VecDeque<(usize, f64)>,
    later_by: usize,
    top_v: f64,
    true_um: f64,
    read_um: f64,
}

/// Noise of the sensor, micrometres rms.
const NOISE_UM: f64 = 1e-3;

impl Running {
    /// The platform's position on the sensor's scale, and the reading: 1 nm of noise, 16 bits over 50 um.
    pub fn sample(&mut self) -> (f64, f64) {
        let code_um = 50.0 / 65536.0;
        let read_um = self.read_um + NOISE_UM * gaussian(&mut self.noise);
        (self.true_um, (read_um / code_um).round() * code_um)
    }

    /// A command goes out, 16 bits over 200 V, and a sample period passes.
    pub fn step(&mut self, command_v: f64) {
        let code_v = 200.0 / 65536.0;
        let rounded_v = ((command_v / code_v).round() * code_v)
            .clamp(0.0, 200.0)
            .min(self.top_v * 1.05);
        self.waiting.push_back((self.later_by, rounded_v));
        for _ in 0..self.steps {
            for (left, _) in &mut self.waiting {
                *left = left.saturating_sub(1);
            }
            while let Some((0, volts)) = self.waiting.front() {
                self.at.command_v = *volts;
                self.waiting.pop_front();
            }
            self.at.t_s += self.at.dt_s;
            self.true_um = self.stage.step(&self.at).reading_um;
            self.read_um = match &mut self.filter {
                Some(filter) => filter.step(self.true_um, self.at.dt_s),
                None => self.true_um,
            };
        }
    }
}
