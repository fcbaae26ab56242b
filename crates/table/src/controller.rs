//! The complete law of one axis in a table: everything beside the hysteresis, whose inverse the table's own fields hold.

use crate::check::refuse;
use crate::{Family, Table, TableError, short};
use hysteron_core::biquad::Biquad;
use hysteron_core::effects::coupling::Coupling;
use hysteron_core::effects::creep::CreepInverse;
use hysteron_core::effects::lag::{HeldLagInverse, Lag, LagGrowth};
use hysteron_core::error::ParamError;
use hysteron_core::law_numbers::{
    AdaptationNumbers, CreepNumbers, FeedbackNumbers, HumNumbers, InverseNumbers, LARGEST_CROSS, LawNumbers,
    TrustNumbers,
};
use hysteron_core::preview::Preview;
use hysteron_core::surroundings::{HARMONICS, SensorInverse};
use hysteron_core::tracking_law::{CREEP_DIVIDER, CREEP_FAST, CREEP_SLOW, PLAYS, TAPS};
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

/// Time constant of learning: a change is gone to a hundredth after five, and a period of 10 Hz is a tenth of it.
const ADAPTATION_S: f64 = 1.0;
/// What is taken for noise, of the stroke: the noise of a good sensor averaged over a millisecond.
const DEAD_SHARE: f64 = 1e-4;

/// Gain and zero that a [`Controller`] learns while it runs, and how far it may.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adaptation {
    /// Most that the gain may change, a share: 0.0001 to 0.2.
    pub gain_bound: f64,
    /// Most that the zero may change.
    pub zero_bound_um: f64,
    /// Time constant of learning, 0.1 to 1000.
    pub time_s: f64,
    /// What of a miss is taken for noise.
    pub dead_um: f64,
    /// Motion of the stage for a volt.
    pub um_per_v: f64,
}

impl Adaptation {
    /// Of a stage that moves by `stroke_um` over `range_v`: up to a share of its gain, and as much of the stroke in its zero.
    pub fn within(gain_bound: f64, stroke_um: f64, range_v: f64) -> Self {
        Self {
            gain_bound,
            zero_bound_um: gain_bound * stroke_um,
            time_s: ADAPTATION_S,
            dead_um: DEAD_SHARE * stroke_um,
            um_per_v: stroke_um / range_v,
        }
    }

    fn of(numbers: &AdaptationNumbers) -> Self {
        let &AdaptationNumbers {
            gain_bound,
            zero_bound_um,
            time_s,
            dead_um,
            um_per_v,
        } = numbers;
        Self {
            gain_bound,
            zero_bound_um,
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
            time_s,
            dead_um,
            um_per_v,
        } = self;
        AdaptationNumbers {
            gain_bound,
            zero_bound_um,
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

    /// The numbers of the complete law; `None` in a table without one.
    ///
    /// # Errors
    /// Lists of other lengths than the law's, by their fields.
    pub fn law_numbers(&self) -> Result<Option<LawNumbers>, TableError> {
        let Some(part) = &self.controller else {
            return Ok(None);
        };
        let creep = |name, values: &[f64]| -> Result<([f64; CREEP_FAST], [f64; CREEP_SLOW]), TableError> {
            let all: [f64; CREEP_FAST + CREEP_SLOW] = exactly(name, values)?;
            let (fast, slow) = all.split_at(CREEP_FAST);
            Ok((exactly(name, fast)?, exactly(name, slow)?))
        };
        let (fast_shares, slow_shares) = creep("controller.creep_shares", &part.creep_shares)?;
        let (fast_tau_s, slow_tau_s) = creep("controller.creep_tau_s", &part.creep_tau_s)?;
        Ok(Some(LawNumbers {
            sample_rate_hz: self.sample_rate_hz,
            samples_ahead: part.samples_ahead,
            preview: exactly::<TAPS>("controller.preview", &part.preview)?,
            second_mode: part.second_mode,
            creep_fast: CreepNumbers {
                shares: fast_shares,
                tau_s: fast_tau_s,
            },
            creep_slow: CreepNumbers {
                shares: slow_shares,
                tau_s: slow_tau_s,
            },
            inverse: self.inverse_numbers(part)?,
            lag_s: part.lag_s,
            lag_growth: part.lag_growth,
            feedback: part.feedback.as_ref().map(|feedback| FeedbackNumbers {
                integral_v_per_um_s: feedback.integral_v_per_um_s,
                series: feedback.series,
                damping: feedback.damping,
                trust: feedback.trust.as_ref().map(Trust::numbers),
            }),
            command_min_v: self.output_min_v,
            command_max_v: self.output_max_v,
            slew_v_per_s: self.slew_v_per_s,
            rest_um: part.rest_um,
            sensor_lag_s: part.sensor_lag_s,
            coupling: part.coupling,
            cross_um_per_um: part.cross_um_per_um,
            hum: part.hum.as_ref().map(|hum| HumNumbers {
                frequency_hz: hum.frequency_hz,
                sensitivity: hum.sensitivity,
                learning_s: hum.learning_s,
                largest_um: hum.largest_um,
            }),
            heat: part.heat,
            sensor: part.sensor,
            adaptation: part.adaptation.as_ref().map(Adaptation::numbers),
        }))
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

    fn inverse_numbers(&self, part: &Controller) -> Result<InverseNumbers, TableError> {
        Ok(InverseNumbers {
            min_um: part.inverse_min_um,
            max_um: part.inverse_max_um,
            thresholds_um: exactly::<PLAYS>("thresholds_um", &self.thresholds_um)?,
            offset_v: self.offset_v,
            input_function: self.input_function(),
            linear: exactly("weights_v_per_um", &self.weights_v_per_um)?,
            quadratic: exactly("weights_quadratic_v_per_um2", &self.weights_quadratic_v_per_um2)?,
            cubic: exactly("weights_cubic_v_per_um3", &self.weights_cubic_v_per_um3)?,
        })
    }

    /// What a table with a complete law must hold beside what every table must.
    pub(crate) fn check_controller(&self, part: &Controller) -> Result<(), TableError> {
        if self.family != Family::PlayPolynomial {
            let reason = "the inverse of a complete law is a play-polynomial";
            return Err(refuse("family", self.family.name(), reason));
        }
        for (field, value) in [
            ("proportional_v_per_um", self.proportional_v_per_um),
            ("integral_v_per_um_s", self.integral_v_per_um_s),
        ] {
            if value != 0.0 {
                let reason = "must be 0 in a table with a [controller]: its gains stand in [controller.feedback]";
                return Err(refuse(field, value, reason));
            }
        }
        if self.safe_v != 0.0 {
            let reason = "must be 0 in a table with a [controller]: its law begins where the stage rests at 0 V";
            return Err(refuse("safe_v", self.safe_v, reason));
        }
        part.finite()?;
        let range = [self.input_min_um - part.rest_um, self.input_max_um - part.rest_um];
        for (field, value) in [("input_min_um", range[0]), ("input_max_um", range[1])] {
            if !(part.inverse_min_um..=part.inverse_max_um).contains(&value) {
                let reason = format!(
                    "lies {} um above the rest, outside controller.inverse_min_um to controller.inverse_max_um, {} to {} um; \
                     narrow the range with --input-min and --input-max",
                    short(value),
                    short(part.inverse_min_um),
                    short(part.inverse_max_um)
                );
                return Err(refuse(field, value + part.rest_um, reason));
            }
        }
        match self.law_numbers()? {
            Some(numbers) => part.buildable(&numbers),
            None => Ok(()),
        }
    }
}

/// A field, where the core refuses what is made of it.
fn named<T>(field: &str, built: Result<T, ParamError>) -> Result<(), TableError> {
    built.map(|_| ()).map_err(|error| {
        let reason = format!("the core refuses it in f32: {error}");
        refuse(field, "as given", reason)
    })
}

impl Controller {
    /// Runs the core's own constructors, each over the fields that its block is made of, then that of the whole law.
    fn buildable(&self, numbers: &LawNumbers) -> Result<(), TableError> {
        let rate_hz = numbers.sample_rate_hz;
        let section = |[b0, b1, b2, a1, a2]: [f64; 5]| Biquad::<f32>::new([b0, b1, b2], [a1, a2]);
        let preview = Preview::<f32, TAPS>::new(numbers.preview, numbers.samples_ahead);
        named("controller.preview, controller.samples_ahead", preview)?;
        named("controller.second_mode", section(self.second_mode))?;
        let (fast, slow) = (&numbers.creep_fast, &numbers.creep_slow);
        let creep = CreepInverse::<f32, CREEP_FAST, CREEP_SLOW>::new(
            [fast.shares, fast.tau_s],
            [slow.shares, slow.tau_s],
            rate_hz,
            CREEP_DIVIDER,
        );
        named("controller.creep_shares, controller.creep_tau_s", creep)?;
        named(
            "controller.lag_s",
            HeldLagInverse::<f32>::new(self.lag_s, None, rate_hz),
        )?;
        let growth = self.lag_growth.map(|[about_v, per_v]| LagGrowth { about_v, per_v });
        named(
            "controller.lag_growth",
            HeldLagInverse::<f32>::new(self.lag_s, growth, rate_hz),
        )?;
        named("controller.sensor_lag_s", Lag::<f32>::new(self.sensor_lag_s, rate_hz))?;
        if let Some(feedback) = &self.feedback {
            named("controller.feedback.series[1]", section(feedback.series[0]))?;
            named("controller.feedback.series[2]", section(feedback.series[1]))?;
            named("controller.feedback.damping", section(feedback.damping))?;
            if let Some(Trust {
                quick_v,
                slow_v,
                slow_v_per_s,
            }) = feedback.trust
            {
                let trust = hysteron_core::trust::Trust::<f32>::new(quick_v, slow_v, slow_v_per_s, rate_hz);
                named("controller.feedback.trust", trust)?;
            }
        }
        if let Some([g, d, p, r]) = self.coupling {
            named("controller.coupling", Coupling::<f32>::new(g, d, p, r, rate_hz))?;
        }
        if let Some([middle, c2, c3]) = self.sensor {
            named("controller.sensor", SensorInverse::<f32>::new(middle, c2, c3))?;
        }
        if let Some(part) = &self.adaptation {
            named("controller.adaptation", part.numbers().adaptation::<f32>(rate_hz))?;
        }
        if let Some(share) = self.cross_um_per_um.filter(|share| share.abs() > LARGEST_CROSS) {
            let reason = format!("must lie in -{LARGEST_CROSS} to {LARGEST_CROSS}");
            return Err(refuse("controller.cross_um_per_um", share, reason));
        }
        if let Some(rms_um) = self.model_error_um.filter(|rms_um| *rms_um < 0.0) {
            return Err(refuse(
                "controller.model_error_um",
                rms_um,
                "must not be negative: an rms error",
            ));
        }
        let whole = numbers.law::<f32>();
        let left = if self.hum.is_some() {
            "controller.hum, controller.feedback"
        } else {
            "controller.feedback"
        };
        named(left, whole)
    }

    fn finite(&self) -> Result<(), TableError> {
        let mut all = vec![
            ("inverse_min_um".to_owned(), self.inverse_min_um),
            ("inverse_max_um".to_owned(), self.inverse_max_um),
            ("rest_um".to_owned(), self.rest_um),
            ("lag_s".to_owned(), self.lag_s),
            ("sensor_lag_s".to_owned(), self.sensor_lag_s),
        ];
        all.extend(self.cross_um_per_um.map(|share| ("cross_um_per_um".to_owned(), share)));
        all.extend(self.model_error_um.map(|rms_um| ("model_error_um".to_owned(), rms_um)));
        let mut list = |name: &str, values: &[f64]| {
            all.extend(
                values
                    .iter()
                    .enumerate()
                    .map(|(i, &value)| (format!("{name}[{}]", i + 1), value)),
            );
        };
        list("preview", &self.preview);
        list("second_mode", &self.second_mode);
        list("creep_shares", &self.creep_shares);
        list("creep_tau_s", &self.creep_tau_s);
        list("lag_growth", &self.lag_growth.unwrap_or_default());
        list("coupling", &self.coupling.unwrap_or_default());
        list("sensor", &self.sensor.unwrap_or_default());
        list("heat", &self.heat.unwrap_or_default());
        if let Some(feedback) = &self.feedback {
            list("feedback.integral_v_per_um_s", &[feedback.integral_v_per_um_s]);
            list("feedback.series", feedback.series.as_flattened());
            list("feedback.damping", &feedback.damping);
            if let Some(trust) = &feedback.trust {
                list("feedback.trust.quick_v", &[trust.quick_v]);
                list("feedback.trust.slow_v", &[trust.slow_v]);
                list("feedback.trust.slow_v_per_s", &[trust.slow_v_per_s]);
            }
        }
        if let Some(hum) = &self.hum {
            list("hum.frequency_hz", &[hum.frequency_hz]);
            list("hum.learning_s", &[hum.learning_s]);
            list("hum.largest_um", &[hum.largest_um]);
            list("hum.sensitivity", hum.sensitivity.as_flattened());
        }
        let wrong = all.into_iter().find(|(_, value)| !(*value as f32).is_finite());
        wrong.map_or(Ok(()), |(name, value)| {
            Err(refuse(&format!("controller.{name}"), value, "must be finite in f32"))
        })
    }
}

fn exactly<const N: usize>(field: &str, values: &[f64]) -> Result<[f64; N], TableError> {
    values.try_into().map_err(|_| {
        refuse(
            field,
            format!("{} values", values.len()),
            format!("a complete law has {N}; export the controller again"),
        )
    })
}
