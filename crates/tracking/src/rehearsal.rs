//! A stage with something hidden in it, to be learned and compensated: drawn from a seed, recorded, and tracked with what was
//! designed from the records alone.

use crate::complete::track_beside;
use crate::design::Controller;
use crate::error::TrackingError;
use crate::reference::Reference;
use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_plant::excitation::{
    BandNoise, DecayingTriangle, Excitation, MultiHarmonic, Multisine, Sine, Steps, with_rise,
};
use hysteron_plant::hysteresis::{Family, MaxwellSlip, Preisach, SigmoidPlays};
use hysteron_plant::{
    Amplifier, Converter, Creep, CrossCoupling, Hold, Hysteresis, Initial, MainsHum, Mode, Sensor, Stage, StageConfig,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// What can be hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hidden {
    /// Everything comes late: 60 to 200 us.
    Delay,
    /// The amplifier's lag: 80 to 300 us.
    FirstOrderLag,
    /// A mode at 600 to 1500 Hz, damping ratio 0.01 to 0.04.
    Resonance,
    /// 2 to 4 % a decade.
    Creep,
    /// 3 to 8 % of another axis' motion.
    CrossCoupling,
    /// 0.5 to 1.5 % of the stroke at 50 or 60 Hz, and harmonics.
    MainsHum,
}

impl Hidden {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Delay,
        Self::FirstOrderLag,
        Self::Resonance,
        Self::Creep,
        Self::CrossCoupling,
        Self::MainsHum,
    ];

    /// The name that a model's effect has.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay => "delay",
            Self::FirstOrderLag => "first-order-lag",
            Self::Resonance => "resonance",
            Self::Creep => "creep",
            Self::CrossCoupling => "cross-coupling",
            Self::MainsHum => "mains-hum",
        }
    }

    /// The one of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|hidden| hidden.name() == name)
    }
}

/// A drawn stage.
#[derive(Debug, Clone)]
pub struct Rehearsal {
    /// What is hidden in it.
    pub hidden: Hidden,
    /// The stage.
    pub stage: StageConfig,
    /// The same without what is hidden.
    pub bare: StageConfig,
    /// What is hidden, in numbers.
    pub truth: String,
    /// The seed.
    pub seed: u64,
}

/// An operator of one of three families; a loop opening that its thresholds cannot reach is drawn anew, with them.
fn draw_hysteresis(which: usize, [stroke_um, full_v]: [f64; 2], rng: &mut Pcg64) -> Hysteresis {
    const DRAWS: usize = 50;
    let mut once = || Hysteresis {
        stroke_um,
        reference_v: full_v,
        initial: Initial::Conditioned,
        family: match which {
            0 => Family::Preisach(Preisach::random(rng, full_v)),
            1 => Family::SigmoidPlays(SigmoidPlays::random(rng, full_v)),
            _ => Family::MaxwellSlip(MaxwellSlip::random(rng, full_v)),
        },
    };
    let mut drawn = once();
    for _ in 1..DRAWS {
        if Stage::new(&StageConfig::bare(drawn.clone()), 0).is_ok() {
            break;
        }
        drawn = once();
    }
    drawn
}

/// Sample period of controller and fast records, seconds.
const PERIOD_S: f64 = 20e-6;

impl Rehearsal {
    /// Draws stage and effect from a seed: 8 to 20 um at 100 to 200 V, a hysteresis of a family that no model here has, 16-bit
    /// converters, 1 nm of noise.
    pub fn draw(hidden: Hidden, seed: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let full_v = rng.random_range(100.0..200.0_f64).round();
        let stroke_um = rng.random_range(8.0..20.0);
        let which = rng.random_range(0..3_usize);
        let hysteresis = draw_hysteresis(which, [stroke_um, full_v], &mut rng);
        let other = draw_hysteresis(2, [stroke_um, full_v], &mut rng);
        let bare = StageConfig {
            sample_period_s: PERIOD_S,
            dac: Some(Converter::UNIPOLAR_16_BIT),
            hold: Hold::Zero,
            amplifier: Amplifier::default(),
            sensor: Sensor {
                noise_rms_um: 1e-3,
                ..Sensor::default()
            },
            ..StageConfig::bare(hysteresis)
        };
        let mut stage = bare.clone();
        let truth = hide(hidden, &mut stage, other, &mut rng);
        Self {
            hidden,
            stage,
            bare,
            truth,
            seed,
        }
    }

    fn full_v(&self) -> f64 {
        self.stage.hysteresis.reference_v
    }

    /// Lowest and highest reference, micrometres: half the stroke about two fifths of it.
    pub fn range_um(&self) -> [f64; 2] {
        let stroke_um = self.stage.hysteresis.stroke_um;
        [0.15 * stroke_um, 0.65 * stroke_um]
    }

    /// The records of a user: sines from 1 to 503 Hz, minor loops, a multisine, holds, a rest, and others to judge by; the other
    /// axis moves where there is one.
    ///
    /// # Errors
    /// A stage that cannot be simulated.
    pub fn records(&self, stage: &StageConfig) -> Result<Dataset, TrackingError> {
        let records: Result<Vec<Record>, TrackingError> = self
            .programme()
            .into_par_iter()
            .enumerate()
            .map(|(number, planned)| self.take(stage, number, &planned))
            .collect();
        Ok(Dataset {
            name: format!("rehearsal-{}", self.seed),
            description: format!("simulated stage with something hidden, seed {}", self.seed),
            known: Known {
                voltage_min_v: Some(stage.amplifier.min_v),
                voltage_max_v: Some(stage.amplifier.max_v),
                ..Known::default()
            },
            records: records?,
            ..Dataset::default()
        })
    }

    fn programme(&self) -> Vec<Planned> {
        let full_v = self.full_v();
        let sine = |name, role, frequency_hz: f64, high: f64, periods: f64, period_s| Planned {
            name,
            role,
            periodic: true,
            period_s,
            excitation: Box::new(Sine {
                frequency_hz,
                low_v: 0.0,
                high_v: high * full_v,
                periods,
            }),
        };
        let other = |name, role, period_s, excitation: Box<dyn Excitation + Send + Sync>| Planned {
            name,
            role,
            periodic: false,
            period_s,
            excitation,
        };
        let seed = self.seed;
        let multisine = |seed: u64| Multisine {
            low_hz: 20.0,
            high_hz: 4000.0,
            period_s: 0.05,
            periods: 6,
            bias_v: 0.5 * full_v,
            peak_v: 0.15 * full_v,
            seed,
        };
        let noise = BandNoise {
            bandwidth_hz: 400.0,
            duration_s: 0.5,
            rms_v: 0.14 * full_v,
            low_v: 0.02 * full_v,
            high_v: 0.98 * full_v,
            seed,
        };
        let steps = |levels: &[f64], hold_s: f64| Steps {
            levels_v: levels.iter().map(|level| level * full_v).collect(),
            hold_s,
            transition_s: 0.03,
        };
        let minor = DecayingTriangle {
            high_v: full_v,
            centre_v: 0.53 * full_v,
            decay: 0.88,
            turns: 24,
            slope_v_per_s: 3.0 * full_v,
        };
        let harmonic = MultiHarmonic {
            frequency_hz: 13.0,
            full_v,
            periods: 6.0,
        };
        use Role::{Identify, Validate};
        vec![
            sine("sine-001hz", Identify, 1.0, 1.0, 4.0, 1e-3),
            sine("sine-011hz", Identify, 11.0, 1.0, 6.0, 2e-4),
            sine("sine-011hz-small", Identify, 11.0, 0.4, 5.0, 2e-4),
            sine("sine-047hz", Validate, 47.0, 1.0, 8.0, 1e-4),
            sine("sine-097hz", Identify, 97.0, 1.0, 10.0, 5e-5),
            sine("sine-097hz-small", Validate, 97.0, 0.4, 10.0, 5e-5),
            sine("sine-193hz", Validate, 193.0, 1.0, 12.0, 4e-5),
            sine("sine-503hz", Identify, 503.0, 1.0, 25.0, PERIOD_S),
            other("minor-loops", Identify, 5e-4, Box::new(minor)),
            other("multisine", Identify, 4e-5, Box::new(multisine(seed ^ 1))),
            other("noise", Validate, 1e-4, Box::new(noise)),
            other("complex-harmonic", Validate, 1e-4, Box::new(harmonic)),
            other("holds", Identify, 5e-3, Box::new(steps(&[0.0, 0.6, 0.9, 0.3], 12.0))),
            other("hold", Validate, 5e-3, Box::new(steps(&[0.0, 0.7], 20.0))),
            other("rest", Identify, 2e-4, Box::new(steps(&[0.0], 1.0))),
        ]
    }

    fn take(&self, stage: &StageConfig, number: usize, planned: &Planned) -> Result<Record, TrackingError> {
        let period_s = planned.period_s;
        let command_v = planned.excitation.samples(period_s)?;
        let (lead_in, voltage_v) = if planned.periodic {
            // 0.1 s and a whole record: ringing and filters are over, the first loop is closed.
            let times = 1.0 + (0.1 / (period_s * command_v.len() as f64)).ceil();
            (command_v.repeat(times as usize), command_v)
        } else {
            (
                Vec::new(),
                with_rise(&command_v, 0.02_f64.max(4.0 * period_s), period_s)?,
            )
        };
        let drive_v: Vec<f64> = lead_in.iter().chain(&voltage_v).copied().collect();
        // Whole cycles of a rate of its own over the record, from rest to rest.
        let cycles = [7.0, 11.0, 13.0, 17.0, 19.0][number % 5];
        let length = voltage_v.len();
        let beside = |k: usize| {
            let turn = TAU * cycles * k.saturating_sub(lead_in.len()) as f64 / (length - 1).max(1) as f64;
            0.4 * self.full_v() * (1.0 - turn.cos())
        };
        let couples = stage.cross_coupling.is_some();
        let voltage2_v: Vec<f64> = (0..drive_v.len())
            .map(|k| if couples { beside(k) } else { 0.0 })
            .collect();
        let mut run =
            Stage::new(stage, self.noise_seed(number as u64))?.run_two_axes(&drive_v, &voltage2_v, period_s)?;
        let skip = lead_in.len();
        Ok(Record {
            file: format!("{}.csv", planned.name),
            role: planned.role,
            excitation: planned.excitation.description(),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um.split_off(skip),
            reference_um: None,
            temperature_c: None,
            voltage2_v: couples.then(|| voltage2_v[skip..].to_vec()),
        })
    }

    fn noise_seed(&self, number: u64) -> u64 {
        self.seed.wrapping_add((number + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    /// Runs a controller along every reference: rms of reference less true position, percent of the range, by reference.
    ///
    /// # Errors
    /// A stage or controller that cannot be run.
    pub fn errors(&self, stage: &StageConfig, controller: &Controller) -> Result<BTreeMap<String, f64>, TrackingError> {
        let law = controller.law::<f64>()?;
        let [low_um, high_um] = self.range_um();
        REFERENCES
            .into_par_iter()
            .enumerate()
            .map(|(number, (name, kind))| {
                let reference = self.reference(kind);
                let couples = stage.cross_coupling.is_some();
                let beside: Vec<f64> = (0..reference.samples_um.len())
                    .map(|k| 0.4 * self.full_v() * (1.0 - (TAU * 17.0 * k as f64 * PERIOD_S).cos()))
                    .collect();
                let seed = !self.noise_seed(number as u64);
                let run = track_beside(stage, seed, &law, &reference, if couples { &beside } else { &[] })?;
                let judged = run.from(reference.judged_from);
                let squares: f64 = judged
                    .reference_um
                    .iter()
                    .zip(&judged.true_um)
                    .map(|(r, y)| (r - y).powi(2))
                    .sum();
                let rms_um = (squares / judged.true_um.len().max(1) as f64).sqrt();
                Ok((name.to_owned(), 100.0 * rms_um / (high_um - low_um)))
            })
            .collect()
    }

    fn reference(&self, kind: Kind) -> Reference {
        let [low_um, high_um] = self.range_um();
        let samples = |time_s: f64| (time_s / PERIOD_S).round() as usize;
        let move_to = |from: f64, to: f64| {
            let n = samples(0.02);
            (0..n).map(move |k| from + (to - from) * 0.5 * (1.0 - (PI * k as f64 / n as f64).cos()))
        };
        // What is learned in the loop has time constants of 0.3 s: six of them.
        let settling_s = if self.hidden == Hidden::MainsHum { 1.8 } else { 0.1 };
        match kind {
            Kind::Sine(hz) => {
                let settling = (settling_s * hz).ceil().max(2.0);
                let judged = (0.1 * hz).ceil().max(2.0);
                let mut samples_um: Vec<f64> = move_to(0.0, low_um).collect();
                let from = samples_um.len();
                samples_um.extend(
                    (0..samples((settling + judged) / hz))
                        .map(|k| low_um + (high_um - low_um) * 0.5 * (1.0 - (TAU * hz * k as f64 * PERIOD_S).cos())),
                );
                Reference {
                    samples_um,
                    judged_from: from + samples(settling / hz),
                }
            }
            Kind::Hold => {
                let mut samples_um: Vec<f64> = move_to(0.0, high_um).collect();
                samples_um.extend(std::iter::repeat_n(high_um, samples(4.0)));
                let judged_from = if self.hidden == Hidden::MainsHum { 1.8 } else { 0.1 };
                Reference {
                    judged_from: samples(0.02 + judged_from),
                    samples_um,
                }
            }
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Sine(f64),
    /// A move to the top, and 4 s there.
    Hold,
}

/// What controllers are asked to follow.
const REFERENCES: [(&str, Kind); 4] = [
    ("10", Kind::Sine(10.0)),
    ("100", Kind::Sine(100.0)),
    ("500", Kind::Sine(500.0)),
    ("hold", Kind::Hold),
];

struct Planned {
    name: &'static str,
    role: Role,
    /// Whether the record starts in periodic state.
    periodic: bool,
    period_s: f64,
    excitation: Box<dyn Excitation + Send + Sync>,
}

/// Hides an effect; what it is in words.
fn hide(hidden: Hidden, stage: &mut StageConfig, other: Hysteresis, rng: &mut Pcg64) -> String {
    match hidden {
        Hidden::Delay => {
            stage.delay_s = rng.random_range(60e-6..200e-6);
            format!("delay of {:.1} us", 1e6 * stage.delay_s)
        }
        Hidden::FirstOrderLag => {
            stage.amplifier.lag_s = rng.random_range(80e-6..300e-6);
            format!("amplifier's lag of {:.1} us", 1e6 * stage.amplifier.lag_s)
        }
        Hidden::Resonance => {
            let mode = Mode {
                frequency_hz: rng.random_range(600.0..1500.0),
                damping: rng.random_range(0.01..0.04),
                share: 1.0,
            };
            stage.modes = vec![mode];
            format!("mode at {:.1} Hz, damping ratio {:.4}", mode.frequency_hz, mode.damping)
        }
        Hidden::Creep => {
            let percent = rng.random_range(2.0..4.0);
            stage.creep = Some(Creep::Log {
                percent_per_decade: percent,
                from_s: 0.01,
                to_s: 1000.0,
            });
            format!("creep of {percent:.2} % a decade")
        }
        Hidden::CrossCoupling => {
            let ratio = rng.random_range(0.03..0.08) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            stage.cross_coupling = Some(CrossCoupling {
                ratio,
                lag_s: 0.0,
                hysteresis: other,
                mode: None,
            });
            format!("{:.2} % of the other axis", 100.0 * ratio)
        }
        Hidden::MainsHum => {
            let line_hz = if rng.random_bool(0.5) { 50.0 } else { 60.0 };
            let frequency_hz = line_hz + rng.random_range(-0.03..0.03);
            let first = stage.hysteresis.stroke_um * rng.random_range(0.005..0.015);
            let third = first * rng.random_range(0.1..0.4);
            stage.mains_hum = Some(MainsHum {
                frequency_hz,
                amplitudes_um: vec![first, 0.0, third],
            });
            format!(
                "{:.3} um at {frequency_hz:.3} Hz, {third:.3} um at three times that",
                first
            )
        }
    }
}
