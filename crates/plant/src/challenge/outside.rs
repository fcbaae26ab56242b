//! Effects that no catalogue has, applied to the noise-free reading of each record.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::case::Parameter;
use super::effect::Effect;
use super::laboratory::{Laboratory, log_uniform};
use super::waves;

/// A record's reading before noise and converter, with what happened when.
#[derive(Debug, Clone)]
pub(super) struct Reading<'a> {
    /// Place in the programme, from 0, and the programme's length.
    pub(super) place: (usize, usize),
    /// Since the stage was switched on, seconds.
    pub(super) start_s: f64,
    pub(super) period_s: f64,
    pub(super) voltage_v: &'a [f64],
    pub(super) position_um: Vec<f64>,
}

/// An effect outside of the catalogue, its size left open.
#[derive(Debug, Clone)]
pub(super) struct Outside {
    kind: Kind,
    stroke_um: f64,
    full_v: f64,
    seed: u64,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// Size: half the jump, a fraction of the stroke.
    Telegraph { per_s: f64 },
    /// Size: rms, seconds.
    ClockJitter,
    /// Size: loss from the first record to the last, a fraction of the gain.
    Ageing,
    /// Size: depth, a fraction of the stroke.
    DropOut { every: usize, samples: usize },
    /// Size: amplitude, a fraction of the stroke.
    ScaleRipple { pitch_um: f64, phase_rad: f64 },
    /// Size: lag at full stroke, minus the lag at rest, seconds.
    BiasLag,
    /// Size: gain of the plays that forget.
    MemoryLeak { time_s: f64 },
    /// Size: loss after very many cycles, a fraction of the gain.
    Fatigue { cycles: f64 },
    /// Size: amplitude, a fraction of the stroke.
    Vibration { frequency_hz: f64, phase_rad: f64 },
}

impl Outside {
    /// Draws one, with the size to try first and the largest.
    pub(super) fn draw(effect: Effect, laboratory: &Laboratory, rng: &mut Pcg64) -> (Self, f64, f64) {
        let (kind, start, most) = match effect {
            Effect::ClockJitter => (Kind::ClockJitter, 10e-6, 2e-3),
            Effect::Ageing => (Kind::Ageing, 0.02, 0.8),
            Effect::DropOut => {
                let kind = Kind::DropOut {
                    every: rng.random_range(150..500),
                    samples: rng.random_range(2..=8),
                };
                (kind, 0.1, 2.0)
            }
            Effect::ScaleRipple => {
                let pitch_um = laboratory.stroke_um / rng.random_range(6.0..12.0);
                let kind = Kind::ScaleRipple {
                    pitch_um,
                    phase_rad: rng.random_range(0.0..std::f64::consts::TAU),
                };
                (kind, 0.005, 0.3)
            }
            Effect::BiasLag => (Kind::BiasLag, 50e-6, 2e-3),
            Effect::MemoryLeak => (
                Kind::MemoryLeak {
                    time_s: log_uniform(rng, 0.02, 1.0),
                },
                0.1,
                10.0,
            ),
            Effect::Fatigue => (
                Kind::Fatigue {
                    cycles: rng.random_range(3.0..10.0),
                },
                0.05,
                0.9,
            ),
            Effect::Vibration => {
                let kind = Kind::Vibration {
                    frequency_hz: off_the_line_hz(rng),
                    phase_rad: rng.random_range(0.0..std::f64::consts::TAU),
                };
                (kind, 0.01, 1.0)
            }
            // Telegraph, and nothing else: effects of the catalogue have forms of their own.
            _ => (
                Kind::Telegraph {
                    per_s: log_uniform(rng, 0.5, 3.0),
                },
                0.005,
                1.0,
            ),
        };
        let (stroke_um, full_v) = (laboratory.stroke_um, laboratory.full_v);
        (
            Self {
                kind,
                stroke_um,
                full_v,
                seed: rng.random(),
            },
            start,
            most,
        )
    }

    /// Changes one record's reading.
    pub(super) fn apply(&self, size: f64, reading: &mut Reading<'_>) {
        let period_s = reading.period_s;
        let clean = &reading.position_um;
        let time_s = |n: usize| reading.start_s + n as f64 * period_s;
        let stroke_um = self.stroke_um;
        let samples = 0..clean.len();
        let changed: Vec<f64> = match self.kind {
            Kind::Telegraph { per_s } => {
                let mut level = Telegraph::new(per_s, self.seed);
                samples
                    .map(|n| clean[n] + size * stroke_um * level.at(time_s(n)))
                    .collect()
            }
            Kind::ClockJitter => {
                let mut rng = Pcg64::seed_from_u64(self.seed.wrapping_add(reading.place.0 as u64));
                let mut late = || -> f64 { StandardNormal.sample(&mut rng) };
                samples
                    .map(|n| waves::at(clean, n as f64 + size * late() / period_s))
                    .collect()
            }
            Kind::Ageing => {
                let lost = size * reading.place.0 as f64 / (reading.place.1.max(2) - 1) as f64;
                clean.iter().map(|y| (1.0 - lost) * y).collect()
            }
            Kind::DropOut { every, samples: length } => {
                // The counter runs on from record to record.
                let first = (self.seed % every as u64) as usize + 37 * reading.place.0;
                let lost = |n: usize| (n + first) % every < length;
                samples
                    .map(|n| clean[n] - if lost(n) { size * stroke_um } else { 0.0 })
                    .collect()
            }
            Kind::ScaleRipple { pitch_um, phase_rad } => {
                let ripple = |y: &f64| (std::f64::consts::TAU * y / pitch_um + phase_rad).sin();
                clean.iter().map(|y| y + size * stroke_um * ripple(y)).collect()
            }
            Kind::BiasLag => samples
                .map(|n| waves::at(clean, n as f64 - size * (clean[n] / stroke_um - 0.5) / period_s))
                .collect(),
            Kind::MemoryLeak { time_s } => {
                let lost = forgotten_v(reading.voltage_v, self.full_v, period_s / time_s);
                clean
                    .iter()
                    .zip(lost)
                    .map(|(y, lost)| y + size * stroke_um / self.full_v * lost)
                    .collect()
            }
            Kind::Fatigue { cycles } => {
                let mut travel = 0.0;
                let mut before = reading.voltage_v.first().copied().unwrap_or(0.0);
                let tired = |(y, v): (&f64, &f64)| {
                    travel += 0.5 * (v - before).abs() / self.full_v;
                    before = *v;
                    y * (1.0 + size * f64::exp_m1(-travel / cycles))
                };
                clean.iter().zip(reading.voltage_v).map(tired).collect()
            }
            Kind::Vibration {
                frequency_hz,
                phase_rad,
            } => {
                let shake = |n: usize| (std::f64::consts::TAU * frequency_hz * time_s(n) + phase_rad).sin();
                samples.map(|n| clean[n] + size * stroke_um * shake(n)).collect()
            }
        };
        reading.position_um = changed;
    }

    pub(super) fn parameters(&self, size: f64, stroke_um: f64) -> Vec<Parameter> {
        let amplitude = |name| Parameter::new(name, size * stroke_um, "um");
        match self.kind {
            Kind::Telegraph { per_s } => vec![amplitude("half_jump"), Parameter::new("jumps", per_s, "1/s")],
            Kind::ClockJitter => vec![Parameter::new("jitter_rms", size, "s")],
            Kind::Ageing => vec![Parameter::new("loss_first_to_last", size, "of the gain")],
            Kind::DropOut { every, samples } => vec![
                amplitude("depth"),
                Parameter::new("every", every as f64, "samples"),
                Parameter::new("length", samples as f64, "samples"),
            ],
            Kind::ScaleRipple { pitch_um, .. } => vec![amplitude("amplitude"), Parameter::new("pitch", pitch_um, "um")],
            Kind::BiasLag => vec![Parameter::new("lag_at_full_stroke_minus_rest", size, "s")],
            Kind::MemoryLeak { time_s } => vec![
                Parameter::new("gain_of_the_plays_that_forget", size, "of the gain"),
                Parameter::new("time_to_forget", time_s, "s"),
            ],
            Kind::Fatigue { cycles } => {
                vec![
                    Parameter::new("loss", size, "of the gain"),
                    Parameter::new("cycles", cycles, "full cycles"),
                ]
            }
            Kind::Vibration { frequency_hz, .. } => {
                vec![amplitude("amplitude"), Parameter::new("frequency", frequency_hz, "Hz")]
            }
        }
    }
}

/// Two levels, the times between jumps exponentially distributed.
struct Telegraph {
    rng: Pcg64,
    per_s: f64,
    level: f64,
    until_s: f64,
}

impl Telegraph {
    fn new(per_s: f64, seed: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed);
        let level = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        Self {
            rng,
            per_s,
            level,
            until_s: 0.0,
        }
    }

    /// The level at a time that never goes back.
    fn at(&mut self, time_s: f64) -> f64 {
        while time_s >= self.until_s {
            self.until_s -= (1.0 - self.rng.random::<f64>()).ln() / self.per_s;
            self.level = -self.level;
        }
        self.level
    }
}

/// What plays that drift towards the voltage are ahead of plays that keep their place, volts; five thresholds, equal weights.
fn forgotten_v(voltage_v: &[f64], full_v: f64, leak_per_sample: f64) -> Vec<f64> {
    const THRESHOLDS: [f64; 5] = [0.02, 0.05, 0.10, 0.20, 0.30];
    let kept = (-leak_per_sample).exp();
    // Before the record the stage has rested at 0 V after a full cycle: the true plays stand at r, those that forget at 0.
    let mut plays = THRESHOLDS.map(|r| (r * full_v, r * full_v, 0.0_f64));
    let mut advance = |v: f64| {
        let mut sum = 0.0;
        for (r, keeps, forgets) in &mut plays {
            *keeps = keeps.min(v + *r).max(v - *r);
            *forgets = v + kept * (forgets.min(v + *r).max(v - *r) - v);
            sum += *forgets - *keeps;
        }
        sum / THRESHOLDS.len() as f64
    };
    voltage_v.iter().map(|&v| advance(v)).collect()
}

/// 20 to 400 Hz, more than 3 Hz from every harmonic of 50 and 60 Hz.
fn off_the_line_hz(rng: &mut Pcg64) -> f64 {
    loop {
        let frequency_hz = log_uniform(rng, 20.0, 400.0);
        let far = |line_hz: f64| {
            let order = (frequency_hz / line_hz).round().max(1.0);
            (frequency_hz - order * line_hz).abs() > 3.0
        };
        if far(50.0) && far(60.0) {
            return frequency_hz;
        }
    }
}
