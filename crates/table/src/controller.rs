//! The complete law of one axis in a table: everything beside the hysteresis, whose inverse the table's own fields hold.

use crate::{Family, Table};
use hysteron_core::adaptation::AdaptationNumbers;
use hysteron_core::law_numbers::{FeedbackNumbers, HumNumbers, LawNumbers, TrustNumbers};
use hysteron_core::surroundings::HARMONICS;
use serde::{Deserialize, Serialize};

/// The `[controller]` part of a table.
///
/// # Units
/// In the names; sections are b0, b1, b2, a1, a2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Samples that the reference comes before it is due.
    pub samples_ahead: usize,
    /// Lowest position, before creep and above the rest, that the inverse was identified on.
    pub inverse_min_um: f64,
    /// Highest such position.
    pub inverse_max_um: f64,
    /// Position at rest at 0 V.
    pub rest_um: f64,
    /// The amplifier's lag.
    pub lag_s: f64,
    /// The voltage at which it is that (V), and how much it grows with it (1/V).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag_growth: Option<[f64; 2]>,
    /// The sensor's lag; 0 for none.
    pub sensor_lag_s: f64,
    /// Coefficients of the preview filter, the newest sample's first.
    pub preview: Vec<f64>,
    /// What undoes the second mode and the antiresonance below it.
    pub second_mode: [f64; 5],
    /// Displacement still to come over the one that came at once, for each element of creep.
    pub creep_shares: Vec<f64>,
    /// Their time constants, ascending.
    pub creep_tau_s: Vec<f64>,
    /// The other axis: gain (um/V), lead (um s/V), weight (um/V) and threshold (V) of its play.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coupling: Option<[f64; 4]>,
    /// Share of the other axis' motion that reaches this one, where both are controlled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cross_um_per_um: Option<f64>,
    /// The sensor's curve: middle (um), quadratic (1/um), cubic (1/um^2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<[f64; 3]>,
    /// Heat: reference (degC), time constant (s), shift (um/K), gain (1/K); only for code in C, since boards have no thermometer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heat: Option<[f64; 4]>,
    /// Largest rms error of the model on a record of its own; in open loop the board allows four times that, see
    /// [`Table::open_loop_departure_um`]. Without it nothing is known of the model's error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_error_um: Option<f64>,
    /// Feedback; none in open loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedback: Option<Feedback>,
    /// The mains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hum: Option<Hum>,
    /// What is learned of gain and zero while the law runs; nothing without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
}

/// Feedback of a [`Controller`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feedback {
    /// Integral gain.
    pub integral_v_per_um_s: f64,
    /// Sections in series with the integral.
    pub series: [[f64; 5]; 2],
    /// Section beside it.
    pub damping: [f64; 5],
    /// How far the feedback may take the platform from where the feedforward has it, whatever the sensor says; unbounded without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trust: Option<Trust>,
}

impl Feedback {
    /// As the core takes them.
    pub(crate) fn numbers(&self) -> FeedbackNumbers {
        FeedbackNumbers {
            integral_v_per_um_s: self.integral_v_per_um_s,
            series: self.series,
            damping: self.damping,
            trust: self.trust.as_ref().map(Trust::numbers),
        }
    }
}

/// How far a sensor is trusted: bounds of the feedback about the feedforward, in size and rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trust {
    /// Most that the correction may differ from its slow part.
    pub quick_v: f64,
    /// Most of its slow part.
    pub slow_v: f64,
    /// How fast the slow part goes.
    pub slow_v_per_s: f64,
}

/// Of what the feedback may move the platform, the quick part's share.
const QUICK_SHARE: f64 = 0.4;
/// Rate of the slow part, of the whole bound a second: creep and warmth are slower, and a sensor that drifts faster shows.
const SLOW_SHARE_PER_S: f64 = 0.4;

impl Trust {
    /// Bounds that move the platform by `bound_um` at most, where the inverse is as steep as `v_per_um`.
    pub fn within(bound_um: f64, v_per_um: f64) -> Self {
        let all_v = bound_um * v_per_um;
        Self {
            quick_v: QUICK_SHARE * all_v,
            slow_v: (1.0 - QUICK_SHARE) * all_v,
            slow_v_per_s: SLOW_SHARE_PER_S * all_v,
        }
    }

    fn numbers(&self) -> TrustNumbers {
        TrustNumbers {
            quick_v: self.quick_v,
            slow_v: self.slow_v,
            slow_v_per_s: self.slow_v_per_s,
        }
    }
}

/// Hum that a [`Controller`] learns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hum {
    /// Frequency of the line.
    pub frequency_hz: f64,
    /// Time constant of learning.
    pub learning_s: f64,
    /// Most that is learned of a harmonic.
    pub largest_um: f64,
    /// Sensitivity of the loop at each harmonic, real and imaginary part; zeros leave it alone.
    pub sensitivity: [[f64; 2]; HARMONICS],
}

impl Hum {
    /// As the core takes them.
    pub(crate) fn numbers(&self) -> HumNumbers {
        HumNumbers {
            frequency_hz: self.frequency_hz,
            sensitivity: self.sensitivity,
            learning_s: self.learning_s,
            largest_um: self.largest_um,
        }
    }
}

/// Time constant of learning: a change is gone to a hundredth after five, and a period of 10 Hz is a tenth of it.
const ADAPTATION_S: f64 = 1.0;
/// What is taken for noise, of the stroke: the noise of a good sensor averaged over a millisecond.
const DEAD_SHARE: f64 = 1e-4;

/// Largest lag that may be learned: a stage that is later by more is another one.
const LARGEST_LAG_S: f64 = 1e-3;
/// Of the highest frequency of the records, where the lag begins to be learned: what a hysteresis misses below it is no lag.
const LAG_FROM: f64 = 0.5;

/// Gain, zero and lag that a [`Controller`] learns while it runs, and how far it may.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adaptation {
    /// Most that the gain may change, a share: 0.0001 to 0.2.
    pub gain_bound: f64,
    /// Most that the zero may change.
    pub zero_bound_um: f64,
    /// Most that the lag may change, 0 to 0.001; 0 learns none.
    #[serde(default)]
    pub lag_bound_s: f64,
    /// Slowest sine that the lag is learned from.
    #[serde(default)]
    pub lag_from_hz: f64,
    /// Fastest motion that the lag is learned from and undone of.
    #[serde(default)]
    pub lag_up_to_um_per_s: f64,
    /// Time constant of learning, 0.1 to 1000.
    pub time_s: f64,
    /// What of a miss is taken for noise.
    pub dead_um: f64,
    /// Motion of the stage for a volt.
    pub um_per_v: f64,
}

impl Adaptation {
    /// Of a stage that moves by `stroke_um` over `range_v`, recorded up to swings of `swing_hz`: up to a share of its gain, as much of the
    /// stroke in its zero, and a lag that makes as much of a sine at `swing_hz`. Where that is not known, no lag.
    pub fn within(gain_bound: f64, stroke_um: f64, range_v: f64, swing_hz: Option<f64>) -> Self {
        let fastest_hz = swing_hz.filter(|hz| *hz > 0.0);
        let lag_s = fastest_hz.map_or(0.0, |hz| gain_bound / (std::f64::consts::TAU * hz));
        Self {
            gain_bound,
            zero_bound_um: gain_bound * stroke_um,
            lag_bound_s: lag_s.min(LARGEST_LAG_S),
            lag_from_hz: LAG_FROM * fastest_hz.unwrap_or(0.0),
            lag_up_to_um_per_s: std::f64::consts::PI * stroke_um * fastest_hz.unwrap_or(0.0),
            time_s: ADAPTATION_S,
            dead_um: DEAD_SHARE * stroke_um,
            um_per_v: stroke_um / range_v,
        }
    }

    fn of(numbers: &AdaptationNumbers) -> Self {
        let &AdaptationNumbers {
            gain_bound,
            zero_bound_um,
            lag_bound_s,
            lag_from_hz,
            lag_up_to_um_per_s,
            time_s,
            dead_um,
            um_per_v,
        } = numbers;
        Self {
            gain_bound,
            zero_bound_um,
            lag_bound_s,
            lag_from_hz,
            lag_up_to_um_per_s,
            time_s,
            dead_um,
            um_per_v,
        }
    }

    /// As the core takes them.
    pub fn numbers(&self) -> AdaptationNumbers {
        let &Self {
            gain_bound,
            zero_bound_um,
            lag_bound_s,
            lag_from_hz,
            lag_up_to_um_per_s,
            time_s,
            dead_um,
            um_per_v,
        } = self;
        AdaptationNumbers {
            gain_bound,
            zero_bound_um,
            lag_bound_s,
            lag_from_hz,
            lag_up_to_um_per_s,
            time_s,
            dead_um,
            um_per_v,
        }
    }
}

impl Table {
    /// The table of a complete law: everything but references, safe level, ramp and converters is taken from its numbers.
    ///
    /// Heat is not taken over: boards have no thermometer.
    #[must_use]
    pub fn with_law(self, law: &LawNumbers) -> Self {
        let [linear, quadratic, cubic, quartic, quintic] = law.inverse.input_function;
        Self {
            family: Family::PlayPolynomial,
            sample_rate_hz: law.sample_rate_hz,
            proportional_v_per_um: 0.0,
            integral_v_per_um_s: 0.0,
            alpha_s: 0.0,
            beta_s: 0.0,
            offset_v: law.inverse.offset_v,
            linear_v_per_um: linear,
            quadratic_v_per_um2: quadratic,
            cubic_v_per_um3: cubic,
            quartic_v_per_um4: quartic,
            quintic_v_per_um5: quintic,
            thresholds_um: law.inverse.thresholds_um.to_vec(),
            weights_v_per_um: law.inverse.linear.to_vec(),
            rate_weights_v_s_per_um2: Vec::new(),
            weights_quadratic_v_per_um2: law.inverse.quadratic.to_vec(),
            weights_cubic_v_per_um3: law.inverse.cubic.to_vec(),
            controller: Some(Controller {
                samples_ahead: law.samples_ahead,
                inverse_min_um: law.inverse.min_um,
                inverse_max_um: law.inverse.max_um,
                rest_um: law.rest_um,
                lag_s: law.lag_s,
                lag_growth: law.lag_growth,
                sensor_lag_s: law.sensor_lag_s,
                preview: law.preview.to_vec(),
                second_mode: law.second_mode,
                creep_shares: [law.creep_fast.shares, law.creep_slow.shares].concat(),
                creep_tau_s: [law.creep_fast.tau_s, law.creep_slow.tau_s].concat(),
                coupling: law.coupling,
                cross_um_per_um: law.cross_um_per_um,
                sensor: law.sensor,
                heat: None,
                model_error_um: None,
                feedback: law.feedback.map(|feedback| Feedback {
                    integral_v_per_um_s: feedback.integral_v_per_um_s,
                    series: feedback.series,
                    damping: feedback.damping,
                    trust: feedback.trust.map(|trust| Trust {
                        quick_v: trust.quick_v,
                        slow_v: trust.slow_v,
                        slow_v_per_s: trust.slow_v_per_s,
                    }),
                }),
                hum: law.hum.map(|hum| Hum {
                    frequency_hz: hum.frequency_hz,
                    learning_s: hum.learning_s,
                    largest_um: hum.largest_um,
                    sensitivity: hum.sensitivity,
                }),
                adaptation: law.adaptation.as_ref().map(Adaptation::of),
            }),
            ..self
        }
    }

    /// Coefficients of the input's powers, from the first on.
    pub(crate) fn input_function(&self) -> [f64; 5] {
        [
            self.linear_v_per_um,
            self.quadratic_v_per_um2,
            self.cubic_v_per_um3,
            self.quartic_v_per_um4,
            self.quintic_v_per_um5,
        ]
    }
}
