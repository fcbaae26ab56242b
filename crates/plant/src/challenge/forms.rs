//! How a hidden effect looks in one case: drawn from the seed but for its size, which the strength decides.

use rand::RngExt;
use rand_pcg::Pcg64;

use super::case::Parameter;
use super::effect::Effect;
use super::laboratory::{Laboratory, log_uniform, sign};
use super::outside::Outside;
use super::programme::Planned;
use super::readout::Setup;
use crate::amplifier::CurrentLimit;
use crate::asymmetry::Asymmetry;
use crate::contact::{Backlash, EndStop};
use crate::coupling::CrossCoupling;
use crate::creep::{Creep, KelvinVoigtElement};
use crate::hum::MainsHum;
use crate::hysteresis::{AmplitudeGain, Family};
use crate::rate::RateDependence;
use crate::sensor::SensorNonlinearity;
use crate::structure::Mode;
use crate::thermal::ThermalDrift;

/// An effect whose size is open. Its contribution grows with the size.
#[derive(Debug, Clone)]
pub(super) struct Form {
    kind: Kind,
    /// Size to try first.
    pub(super) start: f64,
    /// Largest size.
    pub(super) most: f64,
}

#[derive(Debug, Clone)]
enum Kind {
    /// Size: fraction of the stroke.
    Bend { quadratic: f64, cubic: f64 },
    /// Size: alpha, seconds.
    Envelope { beta_over_alpha: f64 },
    /// Size: shift at the rate of a full sine of 100 Hz, a fraction of the full voltage.
    VelocityPower { exponent: f64 },
    /// Size: relative growth of the thresholds a decade of the rate.
    LogThreshold,
    /// Size: percent a decade.
    LogCreep { from_s: f64, to_s: f64 },
    /// Size: what the elements add after a long time, a fraction.
    KelvinVoigt { shares: [f64; 3], times_s: [f64; 3] },
    /// Size: (1 kHz / first frequency)^2, the compliance of the first mode.
    Modes {
        damping: [f64; 2],
        ratio: f64,
        second_share: f64,
    },
    /// Size: seconds.
    AmplifierLag,
    /// Size: seconds.
    SensorLag,
    /// Size: the programme's largest rate over the slew rate.
    Slew { peak_v_per_s: f64 },
    /// Size: seconds.
    Delay,
    /// Size: change a kelvin, a fraction of the stroke (position) or of the gain.
    Thermal { position: f64, gain: f64, lag_s: f64 },
    /// Size: fraction of the stroke.
    Curve { quadratic: f64, cubic: f64 },
    /// Size: amplitude of the largest line, a fraction of the stroke.
    Hum { line_hz: f64, harmonics: Vec<f64> },
    /// Size: share of the other axis' motion.
    Coupling { sign: f64, mode: Option<Mode> },
    /// Size: fraction of the full voltage that is missing.
    Rail,
    /// Size: fraction of the stroke that is missing.
    Stop,
    /// Size: width, a fraction of the stroke.
    LostMotion,
    /// Size: addition to the gain at a full cycle.
    Rayleigh,
    /// An effect outside of the catalogue, with its own size.
    Outside(Outside),
}

const CAPACITANCE_UF: f64 = 1.8;

impl Form {
    /// Draws one.
    ///
    /// Left out: rate dependence as a gain that falls with log f. Its law is that of creep at other times; which of both names it should get is a matter of words.
    pub(super) fn draw(effect: Effect, laboratory: &Laboratory, programme: &[Planned], rng: &mut Pcg64) -> Self {
        let (kind, start, most) = match effect {
            Effect::Asymmetry => {
                let (quadratic, cubic) = bend(rng);
                (Kind::Bend { quadratic, cubic }, 0.05, 0.5)
            }
            Effect::RateDependence => rate(laboratory, rng),
            Effect::Creep => creep(rng),
            Effect::Resonance => {
                let second = rng.random_bool(0.4);
                let kind = Kind::Modes {
                    damping: [log_uniform(rng, 0.005, 0.05), log_uniform(rng, 0.005, 0.03)],
                    ratio: rng.random_range(1.3..3.0),
                    second_share: if second {
                        sign(rng) * rng.random_range(0.03..0.30)
                    } else {
                        0.0
                    },
                };
                // 300 Hz, a heavily loaded flexure, is the lowest.
                (kind, 0.1, 11.0)
            }
            Effect::FirstOrderLag if rng.random_bool(0.5) => (Kind::AmplifierLag, 30e-6, 5e-3),
            Effect::FirstOrderLag => (Kind::SensorLag, 30e-6, 5e-3),
            Effect::SlewLimit => (
                Kind::Slew {
                    peak_v_per_s: peak_rate(programme),
                },
                1.3,
                40.0,
            ),
            Effect::Delay => (Kind::Delay, 30e-6, 5e-3),
            Effect::ThermalDrift => thermal(rng),
            Effect::SensorNonlinearity => {
                let (quadratic, cubic) = bend(rng);
                // Beyond 0.9 the characteristic would turn back.
                (Kind::Curve { quadratic, cubic }, 0.05, 0.9)
            }
            Effect::MainsHum => (hum(rng), 0.01, 1.0),
            Effect::CrossCoupling => {
                let mode = rng.random_bool(0.5).then(|| Mode {
                    frequency_hz: log_uniform(rng, 500.0, 3000.0),
                    damping: log_uniform(rng, 0.005, 0.05),
                    share: 1.0,
                });
                (Kind::Coupling { sign: sign(rng), mode }, 0.02, 1.0)
            }
            Effect::Saturation if rng.random_bool(0.5) => (Kind::Rail, 0.05, 0.6),
            Effect::Saturation => (Kind::Stop, 0.05, 0.6),
            Effect::Backlash => (Kind::LostMotion, 0.02, 0.5),
            Effect::AmplitudeGain => (Kind::Rayleigh, 0.2, 2.0),
            _ => {
                let (outside, start, most) = Outside::draw(effect, laboratory, rng);
                (Kind::Outside(outside), start, most)
            }
        };
        Self { kind, start, most }
    }

    /// Puts the effect in its place.
    pub(super) fn apply(&self, size: f64, laboratory: &Laboratory, setup: &mut Setup) {
        let (stroke_um, full_v) = (laboratory.stroke_um, laboratory.full_v);
        let config = &mut setup.config;
        match &self.kind {
            Kind::Bend { quadratic, cubic } => {
                config.asymmetry = Some(Asymmetry {
                    quadratic: size * quadratic,
                    cubic: size * cubic,
                });
            }
            Kind::Envelope { beta_over_alpha } => {
                let (alpha_s, beta_s) = (size, size * beta_over_alpha);
                if let Family::Mrpi(mrpi) = &mut config.hysteresis.family {
                    (mrpi.alpha_s, mrpi.beta_s) = (alpha_s, beta_s);
                } else {
                    config.rate_dependence = Some(RateDependence::Envelope { alpha_s, beta_s });
                }
            }
            Kind::VelocityPower { exponent } => {
                config.rate_dependence = Some(RateDependence::VelocityPower {
                    shift_v: size * full_v,
                    reference_v_per_s: std::f64::consts::PI * 100.0 * full_v,
                    exponent: *exponent,
                });
            }
            Kind::LogThreshold => {
                config.rate_dependence = Some(RateDependence::LogThreshold {
                    growth_per_decade: size,
                    reference_v_per_s: std::f64::consts::PI * full_v,
                });
            }
            Kind::LogCreep { from_s, to_s } => {
                config.creep = Some(Creep::Log {
                    percent_per_decade: size,
                    from_s: *from_s,
                    to_s: *to_s,
                });
            }
            Kind::KelvinVoigt { shares, times_s } => {
                let element = |(share, time_constant_s): (&f64, &f64)| KelvinVoigtElement {
                    share: size * share,
                    time_constant_s: *time_constant_s,
                };
                config.creep = Some(Creep::KelvinVoigt {
                    elements: shares.iter().zip(times_s).map(element).collect(),
                });
            }
            Kind::Modes { .. } => config.modes = self.modes(size),
            Kind::AmplifierLag => config.amplifier.lag_s = size,
            Kind::SensorLag => config.sensor.bandwidth_hz = Some(1.0 / (std::f64::consts::TAU * size)),
            Kind::Slew { peak_v_per_s } => {
                let current_a = peak_v_per_s / size * 1e-6 * CAPACITANCE_UF;
                config.amplifier.current_limit = Some(CurrentLimit {
                    current_a,
                    sink_a: None,
                    capacitance_uf: CAPACITANCE_UF,
                });
            }
            Kind::Delay => config.delay_s = size,
            Kind::Thermal { position, gain, lag_s } => {
                config.thermal_drift = Some(ThermalDrift {
                    position_um_per_k: size * position * stroke_um,
                    gain_percent_per_k: 100.0 * size * gain,
                    lag_s: *lag_s,
                });
            }
            Kind::Curve { quadratic, cubic } => {
                setup.curve = Some(SensorNonlinearity {
                    quadratic: size * quadratic,
                    cubic: size * cubic,
                    full_scale_um: stroke_um,
                });
            }
            Kind::Hum { line_hz, harmonics } => {
                let amplitudes_um = harmonics.iter().map(|share| share * size * stroke_um).collect();
                config.mains_hum = Some(MainsHum {
                    frequency_hz: *line_hz,
                    amplitudes_um,
                });
            }
            Kind::Coupling { sign, mode } => {
                config.cross_coupling = Some(CrossCoupling {
                    ratio: sign * size,
                    lag_s: 0.0,
                    hysteresis: laboratory.other_axis.clone(),
                    mode: *mode,
                });
            }
            Kind::Rail => config.amplifier.max_v = (1.0 - size) * full_v,
            Kind::Stop => {
                config.end_stop = Some(EndStop {
                    min_um: -stroke_um,
                    max_um: (1.0 - size) * stroke_um,
                })
            }
            Kind::LostMotion => {
                config.backlash = Some(Backlash {
                    width_um: size * stroke_um,
                })
            }
            Kind::Rayleigh => {
                config.amplitude_gain = Some(AmplitudeGain {
                    gain_at_full_cycle: size,
                })
            }
            Kind::Outside(outside) => setup.outside.push((outside.clone(), size)),
        }
    }

    /// What it is in numbers.
    pub(super) fn parameters(&self, size: f64, laboratory: &Laboratory) -> Vec<Parameter> {
        let (stroke_um, full_v) = (laboratory.stroke_um, laboratory.full_v);
        let one = |name, value, unit| vec![Parameter::new(name, value, unit)];
        match &self.kind {
            Kind::Bend { quadratic, cubic } | Kind::Curve { quadratic, cubic } => vec![
                Parameter::new("quadratic", size * quadratic, "of the stroke"),
                Parameter::new("cubic", size * cubic, "of the stroke"),
            ],
            Kind::Envelope { beta_over_alpha } => {
                vec![
                    Parameter::new("alpha", size, "s"),
                    Parameter::new("beta", size * beta_over_alpha, "s"),
                ]
            }
            Kind::VelocityPower { exponent } => vec![
                Parameter::new("shift_at_full_100_hz", size * full_v, "V"),
                Parameter::new("exponent", *exponent, ""),
            ],
            Kind::LogThreshold => one("threshold_growth", size, "per decade of the rate"),
            Kind::LogCreep { from_s, to_s } => vec![
                Parameter::new("creep", size, "% per decade"),
                Parameter::new("from", *from_s, "s"),
                Parameter::new("to", *to_s, "s"),
            ],
            Kind::KelvinVoigt { shares, times_s } => shares
                .iter()
                .zip(times_s)
                .enumerate()
                .flat_map(|(i, (share, time_s))| {
                    [
                        Parameter::new(&format!("share_{}", i + 1), size * share, "of the displacement"),
                        Parameter::new(&format!("time_constant_{}", i + 1), *time_s, "s"),
                    ]
                })
                .collect(),
            Kind::Modes { .. } => self
                .modes(size)
                .iter()
                .enumerate()
                .flat_map(|(i, mode)| {
                    [
                        Parameter::new(&format!("frequency_{}", i + 1), mode.frequency_hz, "Hz"),
                        Parameter::new(&format!("damping_{}", i + 1), mode.damping, ""),
                        Parameter::new(&format!("share_{}", i + 1), mode.share, "of the displacement"),
                    ]
                })
                .collect(),
            Kind::AmplifierLag => one("amplifier_time_constant", size, "s"),
            Kind::SensorLag => one("sensor_time_constant", size, "s"),
            Kind::Slew { peak_v_per_s } => one("slew_rate", peak_v_per_s / size, "V/s"),
            Kind::Delay => one("delay", size, "s"),
            Kind::Thermal { position, gain, lag_s } => vec![
                Parameter::new("position", size * position * stroke_um, "um/K"),
                Parameter::new("gain", 100.0 * size * gain, "%/K"),
                Parameter::new("lag", *lag_s, "s"),
            ],
            Kind::Hum { line_hz, harmonics } => {
                std::iter::once(Parameter::new("line", *line_hz, "Hz"))
                    .chain(harmonics.iter().enumerate().map(|(k, share)| {
                        Parameter::new(&format!("amplitude_{}", k + 1), share * size * stroke_um, "um")
                    }))
                    .collect()
            }
            Kind::Coupling { sign, .. } => one("ratio", sign * size, "of the other axis' motion"),
            Kind::Rail => one("rail", (1.0 - size) * full_v, "V"),
            Kind::Stop => one("end_stop", (1.0 - size) * stroke_um, "um"),
            Kind::LostMotion => one("width", size * stroke_um, "um"),
            Kind::Rayleigh => one("gain_at_full_cycle", size, "of the gain"),
            Kind::Outside(outside) => outside.parameters(size, stroke_um),
        }
    }

    fn modes(&self, size: f64) -> Vec<Mode> {
        let Kind::Modes {
            damping,
            ratio,
            second_share,
        } = &self.kind
        else {
            return Vec::new();
        };
        let first_hz = 1000.0 / size.sqrt();
        let mut modes = vec![Mode {
            frequency_hz: first_hz,
            damping: damping[0],
            share: 1.0 - second_share,
        }];
        if *second_share != 0.0 {
            modes.push(Mode {
                frequency_hz: ratio * first_hz,
                damping: damping[1],
                share: *second_share,
            });
        }
        modes
    }
}

/// Mostly quadratic, mostly cubic, or both.
fn bend(rng: &mut Pcg64) -> (f64, f64) {
    let mix: f64 = rng.random_range(0.0..1.0);
    (sign(rng) * mix, sign(rng) * (1.0 - mix))
}

fn rate(laboratory: &Laboratory, rng: &mut Pcg64) -> (Kind, f64, f64) {
    let envelope = Kind::Envelope {
        beta_over_alpha: rng.random_range(0.6..1.6),
    };
    let power = Kind::VelocityPower {
        exponent: rng.random_range(0.6..1.0),
    };
    let draw: f64 = rng.random();
    match laboratory.config.hysteresis.family {
        Family::SigmoidPlays(_) | Family::MaxwellSlip(_) if draw < 0.3 => (Kind::LogThreshold, 0.1, 2.0),
        Family::Mrpi(_) => (envelope, 30e-6, 5e-3),
        _ if draw < 0.65 => (envelope, 30e-6, 5e-3),
        _ => (power, 0.01, 0.5),
    }
}

fn creep(rng: &mut Pcg64) -> (Kind, f64, f64) {
    if rng.random_bool(0.5) {
        let kind = Kind::LogCreep {
            from_s: log_uniform(rng, 2e-3, 0.1),
            to_s: log_uniform(rng, 100.0, 1000.0),
        };
        return (kind, 2.0, 20.0);
    }
    let shares = [
        rng.random_range(0.2..0.5),
        rng.random_range(0.2..0.5),
        rng.random_range(0.2..0.5),
    ];
    let times_s = [
        log_uniform(rng, 0.2, 1.0),
        log_uniform(rng, 1.0, 5.0),
        log_uniform(rng, 5.0, 30.0),
    ];
    (Kind::KelvinVoigt { shares, times_s }, 0.05, 0.8)
}

fn thermal(rng: &mut Pcg64) -> (Kind, f64, f64) {
    let lag_s = if rng.random_bool(0.5) {
        0.0
    } else {
        log_uniform(rng, 30.0, 600.0)
    };
    let direction = sign(rng);
    // Position in three of four cases. 1 um/K is much for a stroke of 20 um, and so are 5 %/K for a gain: small excursions of the temperature need that much.
    match rng.random_range(0..4) {
        0 => (
            Kind::Thermal {
                position: 0.0,
                gain: direction,
                lag_s,
            },
            0.02,
            0.05,
        ),
        1 => (
            Kind::Thermal {
                position: direction,
                gain: 0.3 * sign(rng),
                lag_s,
            },
            0.02,
            0.15,
        ),
        _ => (
            Kind::Thermal {
                position: direction,
                gain: 0.0,
                lag_s,
            },
            0.02,
            1.0,
        ),
    }
}

fn hum(rng: &mut Pcg64) -> Kind {
    let line_hz = if rng.random_bool(0.5) { 50.0 } else { 60.0 } + rng.random_range(-0.1..0.1);
    let harmonics = std::iter::once(1.0)
        .chain((0..4).map(|_| rng.random_range(0.0..0.4)))
        .collect();
    Kind::Hum { line_hz, harmonics }
}

/// Largest rate of the commands, volts per second.
fn peak_rate(programme: &[Planned]) -> f64 {
    let rates = programme.iter().flat_map(|record| {
        record
            .voltage_v
            .windows(2)
            .map(move |pair| (pair[1] - pair[0]).abs() / record.period_s)
    });
    rates.fold(0.0, f64::max)
}
