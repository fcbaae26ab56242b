//! What a stage can hide, in forms of its own, and how strong.

use super::elements::{Bend, Element};
use super::rig::Rig;
use super::stage::Relaxing;
use rand::RngExt;
use rand_pcg::Pcg64;
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// An effect of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Effect {
    /// Dead time.
    Delay,
    /// A lag, constant or rising with the voltage, in the amplifier or the sensor.
    Lag,
    /// Creep by a power of time.
    Creep,
    /// A mode, whole or in part.
    Resonance,
    /// A slew limit with unequal rates.
    Slew,
    /// Drift of position or gain with temperature.
    ThermalDrift,
    /// A sensor's bend.
    Bend,
    /// Mains with harmonics.
    Hum,
    /// The other axis, through its own dynamics.
    Coupling,
    /// An amplifier's rail or a spring stop.
    Saturation,
    /// Lost motion.
    Backlash,
    /// Domains that relax.
    RateDependence,
}

impl Effect {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Delay,
        Self::Lag,
        Self::Creep,
        Self::Resonance,
        Self::Slew,
        Self::ThermalDrift,
        Self::Bend,
        Self::Hum,
        Self::Coupling,
        Self::Saturation,
        Self::Backlash,
        Self::RateDependence,
    ];

    /// The catalogue's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay => "delay",
            Self::Lag => "first-order-lag",
            Self::Creep => "creep",
            Self::Resonance => "resonance",
            Self::Slew => "slew-limit",
            Self::ThermalDrift => "thermal-drift",
            Self::Bend => "sensor-nonlinearity",
            Self::Hum => "mains-hum",
            Self::Coupling => "cross-coupling",
            Self::Saturation => "saturation",
            Self::Backlash => "backlash",
            Self::RateDependence => "rate-dependence",
        }
    }
}

/// Something that the catalogue does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Outside {
    /// A gain that ripples with position.
    Ripple,
    /// Jitter of the sample clock.
    Jitter,
    /// A jump of the mount.
    Slip,
    /// A gain that falls from record to record.
    Ageing,
    /// A line above half the sample rate.
    Pwm,
    /// The command in the sensor's cable.
    Feedthrough,
    /// A bit of the converter that is stuck.
    StuckBit,
}

impl Outside {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Ripple,
        Self::Jitter,
        Self::Slip,
        Self::Ageing,
        Self::Pwm,
        Self::Feedthrough,
        Self::StuckBit,
    ];

    /// A name for the tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ripple => "position-ripple",
            Self::Jitter => "jitter",
            Self::Slip => "slip",
            Self::Ageing => "ageing",
            Self::Pwm => "aliased-line",
            Self::Feedthrough => "feedthrough",
            Self::StuckBit => "stuck-bit",
        }
    }
}

/// Either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Hidden {
    /// Of the catalogue.
    Effect(Effect),
    /// Not of the catalogue.
    Outside(Outside),
}

impl Hidden {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Effect(effect) => effect.name(),
            Self::Outside(outside) => outside.name(),
        }
    }
}

/// What the programme says of the size of things.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    /// Highest rate of the drives that do not jump, volts per second.
    pub(crate) rate_v_per_s: f64,
    /// Fastest period of a drive, seconds.
    pub(crate) fastest_s: f64,
    /// Length of all records with their pauses, seconds.
    pub(crate) length_s: f64,
    /// Shortest sample period, seconds.
    pub(crate) sample_s: f64,
    /// Kelvin from the first record to the last.
    pub(crate) warming_k: f64,
    /// Voltage range of the other axis.
    pub(crate) other_v: f64,
    /// Whether the voltage is recorded behind the amplifier.
    pub(crate) monitor: bool,
}

/// An effect with everything chosen but its strength.
#[derive(Debug, Clone)]
pub(crate) struct Form {
    /// What it is.
    pub(crate) hidden: Hidden,
    /// In which form, in words.
    pub(crate) words: &'static str,
    /// Numbers from 0 to 1 that the form is made of.
    pick: [f64; 6],
    scale: Scale,
}

impl Form {
    /// Draws a form.
    pub(crate) fn draw(hidden: Hidden, scale: Scale, rng: &mut Pcg64) -> Self {
        let pick: [f64; 6] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
        let first = pick[0] < 0.5;
        let words = match hidden {
            Hidden::Effect(Effect::Lag) if scale.monitor || pick[0] < 0.35 => "in the sensor",
            Hidden::Effect(Effect::Lag) if pick[0] < 0.7 => "in the amplifier, longer at high voltage",
            Hidden::Effect(Effect::Lag) => "in the amplifier",
            Hidden::Effect(Effect::Creep) => "a power of time",
            Hidden::Effect(Effect::Resonance) if pick[1] < 0.3 => "of a part of the motion",
            Hidden::Effect(Effect::Resonance) => "of the whole motion",
            Hidden::Effect(Effect::Slew) => "unequal rates",
            Hidden::Effect(Effect::ThermalDrift) if first => "of the position, behind a time constant",
            Hidden::Effect(Effect::ThermalDrift) => "of the gain",
            Hidden::Effect(Effect::Bend) => match bend(pick[0]) {
                Bend::Quadratic => "parabola",
                Bend::Cubic => "S",
                Bend::Sine => "sine over the range",
                Bend::Corner => "two straight pieces",
                Bend::Flattening => "flattening",
            },
            Hidden::Effect(Effect::Hum) => "mains with harmonics",
            Hidden::Effect(Effect::Coupling) => "through a mode",
            Hidden::Effect(Effect::Saturation) if first && !scale.monitor => "rail of the amplifier",
            Hidden::Effect(Effect::Saturation) => "spring stop",
            Hidden::Effect(Effect::RateDependence) => "relaxing domains",
            _ => "",
        };
        Self {
            hidden,
            words,
            pick,
            scale,
        }
    }

    /// Puts it into a rig, with a strength from 0 to 1 of the largest that makes sense.
    pub(crate) fn install(&self, strength: f64, rig: &mut Rig) {
        match self.hidden {
            Hidden::Effect(effect) => self.install_effect(effect, strength, rig),
            Hidden::Outside(outside) => self.install_outside(outside, strength, rig),
        }
    }

    fn between(&self, n: usize, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.pick[n])
    }

    fn install_effect(&self, effect: Effect, strength: f64, rig: &mut Rig) {
        let scale = &self.scale;
        let stage = &mut rig.stage;
        let (stroke, [low, high]) = (stage.stroke_um, stage.range_v);
        let span = high - low;
        let before = &mut stage.before;
        match effect {
            Effect::Delay => {
                let delay = Element::Delay {
                    delay_s: 0.06 * strength * scale.fastest_s,
                    past: VecDeque::new(),
                };
                if scale.monitor {
                    stage.sensor.push(delay)
                } else {
                    before.push(delay)
                }
            }
            Effect::Lag => {
                let tau_s = 0.1 * strength * scale.fastest_s;
                let lean = if self.words.contains("longer") {
                    [0.7, high.max(-low)]
                } else {
                    [0.0, 1.0]
                };
                let lag = Element::Lag {
                    tau_s,
                    lean,
                    state: 0.0,
                };
                if self.words == "in the sensor" {
                    stage.sensor.push(lag)
                } else {
                    before.push(lag)
                }
            }
            Effect::Slew => {
                let up = scale.rate_v_per_s * (1.0 - 0.7 * strength);
                let down = up * self.between(0, 0.75, 1.4);
                before.push(Element::Slew { up, down, state: low });
            }
            Effect::Saturation if self.words == "rail of the amplifier" => {
                before.push(Element::Clip {
                    high: high - 0.3 * strength * span,
                });
            }
            Effect::Saturation => stage.after.push(Element::SoftStop {
                level: stroke * (1.0 - 0.3 * strength),
                passes: self.between(1, 0.05, 0.4),
                knee: stroke * self.between(2, 0.001, 0.02),
            }),
            Effect::Creep => stage.after.push(self.creep(strength)),
            Effect::Resonance => stage.after.push(Element::Mode {
                // Down to a little above twice the fastest sine, and where samples still show it.
                frequency_hz: (2.2 / scale.fastest_s).min(0.12 / scale.sample_s) / strength.sqrt(),
                zeta: self.between(2, 0.008, 0.04),
                share: if self.words == "of the whole motion" {
                    1.0
                } else {
                    self.between(3, 0.3, 0.8)
                },
                state: [0.0; 2],
                last: 0.0,
            }),
            Effect::Backlash => stage.after.push(Element::Backlash {
                width: 0.12 * strength * stroke,
                state: 0.0,
            }),
            Effect::Coupling => stage.after.push(Element::Coupling {
                per_v: 0.25 * strength * stroke / scale.other_v.max(1e-9) * if self.pick[0] < 0.5 { -1.0 } else { 1.0 },
                frequency_hz: self.between(1, 60.0, 900.0),
                zeta: self.between(2, 0.05, 0.6),
                state: [0.0; 2],
            }),
            Effect::ThermalDrift => {
                let per_k =
                    0.3 * strength / scale.warming_k.abs().max(1e-9) * if self.pick[1] < 0.5 { -1.0 } else { 1.0 };
                stage.after.push(if self.words == "of the gain" {
                    Element::ThermalGain { per_k }
                } else {
                    let tau_s = scale.length_s * self.between(2, 0.02, 0.3);
                    Element::ThermalShift {
                        per_k: per_k * stroke,
                        tau_s,
                        state: 0.0,
                    }
                });
            }
            Effect::Bend => {
                let range = [stage.zero_um, stage.zero_um + stroke];
                let sign = if self.pick[1] < 0.5 { -1.0 } else { 1.0 };
                // No reading may fall while the position rises.
                stage.sensor.push(Element::Bend {
                    kind: bend(self.pick[0]),
                    size: sign * 0.12 * strength * stroke,
                    range,
                });
            }
            Effect::Hum => {
                let of = |k: f64, share: f64, phase: f64| [k, 0.08 * strength * stroke * share, TAU * phase];
                stage.sensor.push(Element::Hum {
                    mains_hz: if self.pick[0] < 0.3 { 59.96 } else { 50.0 } + 0.08 * (self.pick[1] - 0.5),
                    harmonics: vec![
                        of(1.0, 1.0, self.pick[2]),
                        of(2.0, 0.3 * self.pick[3], self.pick[4]),
                        of(3.0, 0.4 * self.pick[4], self.pick[5]),
                    ],
                });
            }
            Effect::RateDependence => {
                let middle = scale.fastest_s * self.between(0, 0.05, 0.3);
                let taus_s = vec![0.2 * middle, middle, 5.0 * middle];
                stage.relaxing = Some(Relaxing {
                    share: 0.9 * strength,
                    states: vec![0.0; 3],
                    taus_s,
                });
            }
        }
    }

    fn creep(&self, strength: f64) -> Element {
        let power = self.between(0, 0.06, 0.3);
        // From a thousandth of the whole to ten times as long, three a decade.
        let taus_s: Vec<f64> = (0..13)
            .map(|k| self.scale.length_s * 1e-3 * 10f64.powf(f64::from(k) / 3.0))
            .collect();
        let whole: f64 = taus_s.iter().map(|tau| tau.powf(power)).sum();
        let shares = taus_s
            .iter()
            .map(|tau| 0.8 * strength * tau.powf(power) / whole)
            .collect();
        Element::PowerCreep {
            states: vec![0.0; taus_s.len()],
            shares,
            taus_s,
        }
    }

    fn install_outside(&self, outside: Outside, strength: f64, rig: &mut Rig) {
        let scale = &self.scale;
        let stage = &mut rig.stage;
        let (stroke, span) = (stage.stroke_um, stage.range_v[1] - stage.range_v[0]);
        match outside {
            Outside::Ripple => stage.sensor.push(Element::Ripple {
                size: 0.05 * strength * stroke,
                pitch: stroke * self.between(0, 0.06, 0.2),
                phase: TAU * self.pick[1],
            }),
            Outside::Jitter => rig.instrument.jitter_s = 0.15 * strength * scale.fastest_s,
            Outside::Slip => stage.after.push(Element::Slip {
                at_s: scale.length_s * (0.2 + 0.6 * self.pick[0]),
                by: 0.15 * strength * stroke,
            }),
            Outside::Ageing => stage.after.push(Element::Ageing {
                per_record: 0.08 * strength,
            }),
            Outside::Pwm => stage.sensor.push(Element::Pwm {
                hz: (0.5 + self.pick[0]) * 1.7 / scale.sample_s,
                size: 0.08 * strength * stroke,
            }),
            Outside::Feedthrough => stage.sensor.push(Element::Feedthrough {
                seconds: 0.1 * strength * scale.fastest_s,
                per_v: -stroke / span,
                last: 0.0,
            }),
            Outside::StuckBit => {
                // The bit whose weight is nearest to the size that is asked for.
                let weight = 0.08 * strength * stroke / rig.instrument.position_step_um;
                rig.instrument.stuck_bit = Some(weight.log2().round().clamp(0.0, 14.0) as u32);
            }
        }
    }
}

fn bend(pick: f64) -> Bend {
    Bend::ALL[(pick * Bend::ALL.len() as f64) as usize % Bend::ALL.len()]
}
