//! Hysteresis that depends on the rate of the voltage.

use crate::creep::check_states;
use crate::error::{StageError, ordered, within};
use crate::hysteresis::Drive;
use crate::linear::Lag;

/// How the hysteresis depends on the rate. One kind at a time.
#[derive(Debug, Clone, PartialEq)]
pub enum RateDependence {
    /// The irreversible operator sees `v - alpha |v'|` on the way up and `v + beta |v'|` on the way down (the idea of eq. 9, here on any
    /// family): its loop widens in proportion to the rate.
    Envelope {
        /// alpha, seconds.
        alpha_s: f64,
        /// beta, seconds.
        beta_s: f64,
    },
    /// The irreversible operator lags by a voltage that grows as a power of the rate: `v - shift sgn(v') |v' / v'_ref|^m`. Viscous for m = 1, as excess
    /// loss for m = 1/2.
    VelocityPower {
        /// Voltage by which it lags at the reference rate, volts.
        shift_v: f64,
        /// The reference rate, volts per second.
        reference_v_per_s: f64,
        /// m.
        exponent: f64,
    },
    /// The thresholds of play-like operators grow with the logarithm of the rate, `r (1 + g log10(1 + |v'| / v'_ref))`.
    LogThreshold {
        /// g, relative growth for each decade of the rate.
        growth_per_decade: f64,
        /// Rate at which the growth sets in, volts per second.
        reference_v_per_s: f64,
    },
    /// The gain falls evenly with the logarithm of the frequency (as the domains stop following), with the small constant phase that
    /// belongs to it.
    LogGain {
        /// Fall of the gain for each decade, percent.
        percent_per_decade: f64,
        /// Frequency below which the gain is the static one, hertz.
        from_hz: f64,
        /// Frequency above which it falls no further, hertz.
        to_hz: f64,
    },
}

impl RateDependence {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        match *self {
            Self::Envelope { alpha_s, beta_s } => {
                within(
                    "rate_dependence.envelope.alpha_s",
                    alpha_s,
                    0.0,
                    0.01,
                    "alpha is 1e-5 to 5e-4 s",
                )?;
                within(
                    "rate_dependence.envelope.beta_s",
                    beta_s,
                    0.0,
                    0.01,
                    "beta is 1e-5 to 5e-4 s",
                )
            }
            Self::VelocityPower {
                shift_v,
                reference_v_per_s,
                exponent,
            } => {
                within(
                    "rate_dependence.velocity_power.shift_v",
                    shift_v,
                    0.0,
                    1e4,
                    "a few volts at most",
                )?;
                within(
                    "rate_dependence.velocity_power.reference_v_per_s",
                    reference_v_per_s,
                    1e-3,
                    1e9,
                    "rates are positive",
                )?;
                within(
                    "rate_dependence.velocity_power.exponent",
                    exponent,
                    0.1,
                    2.0,
                    "0.5 (excess loss) to 1 (viscous)",
                )
            }
            Self::LogThreshold {
                growth_per_decade,
                reference_v_per_s,
            } => {
                let name = "rate_dependence.log_threshold.growth_per_decade";
                within(name, growth_per_decade, 0.0, 2.0, "0.02 to 0.2 per decade")?;
                within(
                    "rate_dependence.log_threshold.reference_v_per_s",
                    reference_v_per_s,
                    1e-3,
                    1e9,
                    "rates are positive",
                )
            }
            Self::LogGain {
                percent_per_decade,
                from_hz,
                to_hz,
            } => {
                let name = "rate_dependence.log_gain.percent_per_decade";
                within(name, percent_per_decade, 0.0, 20.0, "piezo ceramics show 1 to 2")?;
                within(
                    "rate_dependence.log_gain.from_hz",
                    from_hz,
                    1e-4,
                    1e5,
                    "frequencies are positive",
                )?;
                within(
                    "rate_dependence.log_gain.to_hz",
                    to_hz,
                    1e-4,
                    1e5,
                    "frequencies are positive",
                )?;
                ordered("rate_dependence.log_gain.from_hz", from_hz, "to_hz", to_hz)
            }
        }
    }

    /// Whether the kind changes thresholds, which only play-like families have.
    pub(crate) fn needs_thresholds(&self) -> bool {
        matches!(self, Self::LogThreshold { .. })
    }
}

/// Slope of the voltage, seen through a short lag.
///
/// The lag of 10 us gives it the half-sample delay of a backward difference at 50 kHz, and a finite value where the voltage jumps.
#[derive(Debug, Clone)]
pub(crate) struct RateSensor {
    lag: Lag,
    per_step: f64,
    per_jump: f64,
}

/// Half a sample at 50 kHz.
const RATE_LAG_S: f64 = 10e-6;

impl RateSensor {
    pub(crate) fn new() -> Self {
        Self {
            lag: Lag::new(RATE_LAG_S),
            per_step: 0.0,
            per_jump: 1.0 / RATE_LAG_S,
        }
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        self.lag.set_step(step_s);
        self.per_step = 1.0 / step_s;
    }

    #[inline]
    pub(crate) fn jump(&mut self, by_v: f64) {
        self.lag.output += by_v * self.per_jump;
    }

    #[inline]
    pub(crate) fn advance(&mut self, from_v: f64, to_v: f64) {
        let slope = (to_v - from_v) * self.per_step;
        self.lag.advance(slope, slope);
    }

    #[inline]
    pub(crate) fn rate_v_per_s(&self) -> f64 {
        self.lag.output
    }
}

/// What the rate makes of the voltage: the drive of the hysteresis.
#[inline]
pub(crate) fn drive(config: Option<&RateDependence>, voltage_v: f64, rate_v_per_s: f64) -> Drive {
    let mut drive = Drive {
        voltage_v,
        irreversible_v: voltage_v,
        threshold_scale: 1.0,
        rate_v_per_s,
    };
    match config {
        None | Some(RateDependence::LogGain { .. }) => {}
        Some(&RateDependence::Envelope { alpha_s, beta_s }) => {
            drive.irreversible_v -= if rate_v_per_s > 0.0 {
                alpha_s * rate_v_per_s
            } else {
                beta_s * rate_v_per_s
            };
        }
        Some(&RateDependence::VelocityPower {
            shift_v,
            reference_v_per_s,
            exponent,
        }) => {
            let relative = (rate_v_per_s / reference_v_per_s).abs();
            drive.irreversible_v -= shift_v * relative.powf(exponent) * rate_v_per_s.signum();
        }
        Some(&RateDependence::LogThreshold {
            growth_per_decade,
            reference_v_per_s,
        }) => {
            drive.threshold_scale +=
                growth_per_decade * (rate_v_per_s / reference_v_per_s).abs().ln_1p() / std::f64::consts::LN_10;
        }
    }
    drive
}

/// The chain of lags behind [`RateDependence::LogGain`]: `y = u - c sum_j (u - x_j)`, x_j lagging u, two a decade.
#[derive(Debug, Clone)]
pub(crate) struct LogGainState {
    share: f64,
    lags: Vec<Lag>,
    kept: f64,
}

impl LogGainState {
    pub(crate) fn new(percent_per_decade: f64, from_hz: f64, to_hz: f64) -> Result<Self, StageError> {
        let times = check_states("rate_dependence.log_gain", time_s(to_hz), time_s(from_hz))?;
        let decades = (to_hz / from_hz).log10();
        let share = 0.01 * percent_per_decade * decades / times.len() as f64;
        Ok(Self {
            share,
            lags: times.into_iter().map(Lag::new).collect(),
            kept: 0.0,
        })
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        self.lags.iter_mut().for_each(|lag| lag.set_step(step_s));
    }

    /// One step: the two ends in, the two ends with the fallen gain out.
    #[inline]
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> (f64, f64) {
        let direct = 1.0 - self.share * self.lags.len() as f64;
        let start = direct * from + self.kept;
        self.kept = self.share * self.lags.iter_mut().map(|lag| lag.advance(from, to)).sum::<f64>();
        (start, direct * to + self.kept)
    }
}

fn time_s(frequency_hz: f64) -> f64 {
    1.0 / (std::f64::consts::TAU * frequency_hz)
}
