//! How a controller undoes an effect.

/// A mode of the structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageMode {
    /// Frequency, undamped, hertz.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Its part of the static displacement.
    pub share: f64,
}

/// An element of creep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CreepElement {
    /// Time constant, seconds.
    pub tau_s: f64,
    /// Displacement still to come over the one that came at once.
    pub share: f64,
}

/// The part of a controller that undoes an effect, with the effect's numbers.
#[derive(Debug, Clone, PartialEq)]
pub enum Compensator {
    /// The reference ahead of time.
    Delay {
        /// How late the effect is, seconds.
        delay_s: f64,
    },
    /// A lead, and the reference through the sensor's lag.
    Lead {
        /// Time constant of the amplifier, seconds; 0 for none.
        amplifier_s: f64,
        /// Voltage from which the amplifier's grows (V), and growth (s/V); none where it is the same everywhere.
        growth: Option<[f64; 2]>,
        /// Time constant of the sensor, seconds; 0 for none.
        sensor_s: f64,
    },
    /// The inverse of the structure, one mode or two, ascending in frequency.
    Modes(Vec<StageMode>),
    /// The inverse of creep, elements ascending in time.
    Creep(Vec<CreepElement>),
    /// What the other axis does, taken off.
    Coupling {
        /// Gain, micrometres per volt.
        gain_um_per_v: f64,
        /// Lead, micrometre seconds per volt.
        lead_um_s_per_v: f64,
        /// Weight of the other axis' play, micrometres per volt.
        weight_um_per_v: f64,
        /// Its threshold, volts.
        threshold_v: f64,
    },
    /// Lines whose phases are learned in the loop.
    Hum {
        /// Frequency of the line, hertz.
        frequency_hz: f64,
        /// Amplitudes of the harmonics, micrometres.
        amplitudes_um: Vec<f64>,
    },
    /// The sensor's curve undone.
    SensorCurve {
        /// Position about which it bends, micrometres.
        middle_um: f64,
        /// Quadratic part, 1/um.
        quadratic_per_um: f64,
        /// Cubic part, 1/um^2.
        cubic_per_um2: f64,
    },
    /// Heat undone by the temperature.
    ThermalGain {
        /// Reference temperature, degrees Celsius.
        reference_c: f64,
        /// Time the body takes to follow, seconds.
        tau_s: f64,
        /// Shift, micrometres per kelvin.
        shift_um_per_k: f64,
        /// Change of the gain, 1/K.
        gain_per_k: f64,
    },
    /// Part of the hysteresis, and of the table that is inverted; static.
    HysteresisInverse,
    /// It is left to the feedback, or out.
    None,
}

impl Compensator {
    /// In words; `None` where it is left out.
    pub fn name(&self) -> Option<&'static str> {
        match self {
            Self::Delay { .. } => Some("preview"),
            Self::Lead {
                amplifier_s,
                growth,
                sensor_s,
            } => Some(match (*amplifier_s > 0.0, growth, *sensor_s > 0.0) {
                (_, None, false) => "lead",
                (_, Some(_), false) => "lead that grows with the voltage",
                (false, None, true) => "reference through the same lag",
                (true, None, true) => "lead, and reference through the sensor's lag",
                (_, Some(_), true) => "lead that grows with the voltage, and reference through the sensor's lag",
            }),
            Self::Modes(_) => Some("resonance inverse"),
            Self::Creep(_) => Some("creep inverse"),
            Self::Coupling { .. } => Some("decoupling"),
            Self::Hum { .. } => Some("hum learned in the loop"),
            Self::SensorCurve { .. } => Some("sensor polynomial"),
            Self::ThermalGain { .. } => Some("thermal gain"),
            Self::HysteresisInverse => Some("hysteresis inverse"),
            Self::None => None,
        }
    }
}

/// A compensator, and a sentence about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Compensation {
    /// The compensator.
    pub by: Compensator,
    /// What limits it; why there is none.
    pub note: &'static str,
}

impl Compensation {
    /// A compensator with what limits it.
    pub(crate) fn new(by: Compensator, note: &'static str) -> Self {
        Self { by, note }
    }

    /// None, and why.
    pub(crate) fn none(why: &'static str) -> Self {
        Self::new(Compensator::None, why)
    }
}
