//! All numbers of a complete law: what a design file, a table and a chip's image hold of it.

use crate::adaptation::{Adaptation, AdaptationNumbers};
use crate::bank::PlayBank;
use crate::biquad::Biquad;
use crate::corner_polynomial::CornerPolynomial;
use crate::effects::coupling::Coupling;
use crate::effects::creep::CreepInverse;
use crate::effects::hum_canceller::HumCanceller;
use crate::effects::lag::{HeldLagInverse, Lag, LagGrowth};
use crate::effects::thermal::{Heat, Thermal};
use crate::either_inverse::EitherInverse;
use crate::error::{ParamError, in_range};
use crate::fading::FadingInverse;
use crate::limiter::Limiter;
use crate::model::DirectInverse;
use crate::pi_controller::PiController;
use crate::play_polynomial::{INPUT_DEGREE, PolynomialCoefficients};
use crate::preview::Preview;
use crate::real::Real;
use crate::surroundings::{CompleteLaw, DesignedLaw, HARMONICS, SensorInverse, Surroundings};
use crate::thresholds::Thresholds;
use crate::tracking_law::{
    CREEP_DIVIDER, CREEP_FAST, CREEP_SLOW, FADING, Feedback, Feedforward, PLAYS, TAPS, TrackingLaw,
};
use crate::trust::Trust;

/// Largest share of another axis' motion: stages couple by some percent, and what is moved by half of it is not one axis.
pub const LARGEST_CROSS: f64 = 0.5;

/// A complete law as plain numbers.
///
/// The host's law in `f64` and the chip's in `f32` are both made of these by [`LawNumbers::law`], and by nothing else. What makes a law is
/// marked cold: a chip runs it once, and links cold functions outside of its fastest memory.
///
/// # Units
/// In the names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawNumbers {
    /// Rate of the loop.
    pub sample_rate_hz: f64,
    /// Samples that the reference comes before it is due.
    pub samples_ahead: usize,
    /// Coefficients of the preview filter, the newest sample's first.
    pub preview: [f64; TAPS],
    /// What undoes the second mode and the antiresonance below it: b0, b1, b2, a1, a2.
    pub second_mode: [f64; 5],
    /// Shares and time constants of the elements of creep that run at every sample.
    pub creep_fast: CreepNumbers<CREEP_FAST>,
    /// Those that run once in [`CREEP_DIVIDER`] samples.
    pub creep_slow: CreepNumbers<CREEP_SLOW>,
    /// The direct inverse of the hysteresis.
    pub inverse: InverseNumbers,
    /// The amplifier's lag.
    pub lag_s: f64,
    /// The voltage at which it is that (V), and how much it grows with it (1/V); constant without.
    pub lag_growth: Option<[f64; 2]>,
    /// Feedback; none in open loop.
    pub feedback: Option<FeedbackNumbers>,
    /// Lowest command.
    pub command_min_v: f64,
    /// Highest command.
    pub command_max_v: f64,
    /// Fastest change of the command.
    pub slew_v_per_s: f64,
    /// Position at rest at 0 V.
    pub rest_um: f64,
    /// The sensor's lag; 0 for none.
    pub sensor_lag_s: f64,
    /// The other axis: gain (um/V), lead (um s/V), weight (um/V) and threshold (V) of its play.
    pub coupling: Option<[f64; 4]>,
    /// Share of the other axis' motion that reaches this one, for an axis beside another that is controlled.
    pub cross_um_per_um: Option<f64>,
    /// The mains.
    pub hum: Option<HumNumbers>,
    /// Heat: reference (degC), time constant (s), shift (um/K), gain (1/K).
    pub heat: Option<[f64; 4]>,
    /// The sensor's curve: middle (um), quadratic (1/um), cubic (1/um^2).
    pub sensor: Option<[f64; 3]>,
    /// Gain and zero, learned while the law runs; as designed without.
    pub adaptation: Option<AdaptationNumbers>,
}

/// Elements of creep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CreepNumbers<const N: usize> {
    /// Displacement still to come over the one that came at once, for each.
    pub shares: [f64; N],
    /// Time constants.
    pub tau_s: [f64; N],
}

/// A direct inverse: position before creep in, volts behind the amplifier's lag out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseNumbers {
    /// Lowest input.
    pub min_um: f64,
    /// Highest input.
    pub max_um: f64,
    /// Thresholds of the plays.
    pub thresholds_um: [f64; PLAYS],
    /// Constant.
    pub offset_v: f64,
    /// Coefficients of x, x^2, .. x^5.
    pub input_function: [f64; INPUT_DEGREE],
    /// Coefficients of each play's output.
    pub linear: [f64; PLAYS],
    /// Coefficients of its square.
    pub quadratic: [f64; PLAYS],
    /// Coefficients of its cube.
    pub cubic: [f64; PLAYS],
}

/// Feedback: sections as b0, b1, b2, a1, a2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedbackNumbers {
    /// Integral gain.
    pub integral_v_per_um_s: f64,
    /// Sections in series with the integral.
    pub series: [[f64; 5]; 2],
    /// Section beside it.
    pub damping: [f64; 5],
    /// How far all of it may go from the feedforward; unbounded without.
    pub trust: Option<TrustNumbers>,
}

/// Bounds of the feedback: see [`Trust`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrustNumbers {
    /// Most that the correction may differ from its slow part.
    pub quick_v: f64,
    /// Most of the slow part.
    pub slow_v: f64,
    /// Its rate.
    pub slow_v_per_s: f64,
}

/// The mains' hum: see [`HumCanceller::new`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HumNumbers {
    /// Frequency of the line.
    pub frequency_hz: f64,
    /// Sensitivity of the loop at each harmonic, real and imaginary part; zeros leave it alone.
    pub sensitivity: [[f64; 2]; HARMONICS],
    /// Time constant of learning.
    pub learning_s: f64,
    /// Most that is learned of a harmonic.
    pub largest_um: f64,
}

impl LawNumbers {
    /// The law, in the number type of the host or the chip.
    ///
    /// # Errors
    /// Values that the core refuses.
    #[cold]
    pub fn law<T: Real>(&self) -> Result<CompleteLaw<T>, ParamError> {
        self.law_with(self.inverse.inverse(self.sample_rate_hz)?)
    }

    /// The law by fading elements, or by the table of plays where there are none.
    ///
    /// # Errors
    /// Values that the core refuses.
    #[cold]
    pub fn designed<T: Real>(&self, fading: Option<FadingInverse<T, FADING>>) -> Result<DesignedLaw<T>, ParamError> {
        self.law_with(match fading {
            Some(elements) => EitherInverse::Fading(elements),
            None => EitherInverse::Plays(self.inverse.inverse(self.sample_rate_hz)?),
        })
    }

    /// The law with another inverse of the hysteresis than the table of plays.
    ///
    /// # Errors
    /// Values that the core refuses.
    #[cold]
    pub fn law_with<T: Real, H: DirectInverse<T>>(&self, hysteresis: H) -> Result<CompleteLaw<T, H>, ParamError> {
        let rate_hz = self.sample_rate_hz;
        let fast = [self.creep_fast.shares, self.creep_fast.tau_s];
        let slow = [self.creep_slow.shares, self.creep_slow.tau_s];
        let tracking = TrackingLaw {
            feedforward: Feedforward {
                preview: Preview::new(self.preview, self.samples_ahead)?,
                second_mode: section(self.second_mode)?,
                creep: CreepInverse::new(fast, slow, rate_hz, CREEP_DIVIDER)?,
                hysteresis,
                lead: HeldLagInverse::new(self.lag_s, self.lag_growth.map(LagGrowth::from), rate_hz)?,
            },
            feedback: match &self.feedback {
                Some(numbers) => Some(numbers.feedback(rate_hz)?),
                None => None,
            },
            limiter: Limiter::new(
                T::from_f64(self.command_min_v),
                T::from_f64(self.command_max_v),
                T::from_f64(self.slew_v_per_s),
                T::from_f64(rate_hz),
            )?,
        };
        Ok(CompleteLaw {
            tracking,
            surroundings: self.surroundings()?,
        })
    }

    #[cold]
    fn surroundings<T: Real>(&self) -> Result<Surroundings<T>, ParamError> {
        let rate_hz = self.sample_rate_hz;
        let cross = self.cross_um_per_um.unwrap_or(0.0);
        in_range("cross_um_per_um", None, cross, -LARGEST_CROSS, LARGEST_CROSS)?;
        let coupling = self.coupling.map(|[g, d, p, r]| Coupling::new(g, d, p, r, rate_hz));
        let heat = self.heat.map(|[reference_c, tau_s, shift, gain]| {
            let thermal = Thermal::new(
                T::from_f64(shift),
                T::from_f64(gain),
                T::from_f64(reference_c),
                tau_s,
                rate_hz,
            );
            thermal.map(Heat::undoing)
        });
        let hum = self.hum.map(|hum| {
            HumCanceller::new(
                hum.frequency_hz,
                hum.sensitivity,
                hum.learning_s,
                self.samples_ahead,
                hum.largest_um,
                rate_hz,
            )
        });
        let sensor = self.sensor.map(|[middle, c2, c3]| SensorInverse::new(middle, c2, c3));
        let sensor_lag = (self.sensor_lag_s > 0.0).then(|| Lag::new(self.sensor_lag_s, rate_hz));
        Ok(Surroundings {
            rest: T::from_f64(self.rest_um),
            coupling: coupling.transpose()?,
            cross: self.cross_um_per_um.map(T::from_f64),
            hum: hum.transpose()?,
            heat: heat.transpose()?,
            sensor: sensor.transpose()?,
            sensor_lag: sensor_lag.transpose()?,
            adaptation: self
                .adaptation
                .map(|part| Adaptation::new(&part, rate_hz))
                .transpose()?,
        })
    }
}

impl InverseNumbers {
    /// The inverse, its input limited to what it was identified on.
    ///
    /// # Errors
    /// Values that the core refuses.
    #[cold]
    pub fn inverse<T: Real>(&self, sample_rate_hz: f64) -> Result<CornerPolynomial<T, PLAYS>, ParamError> {
        let bank = PlayBank::new(
            Thresholds::new(self.thresholds_um.map(T::from_f64))?,
            T::from_f64(self.min_um),
            T::from_f64(self.max_um),
            T::from_f64(sample_rate_hz),
        )?;
        let coefficients = PolynomialCoefficients {
            offset: T::from_f64(self.offset_v),
            input_function: self.input_function.map(T::from_f64),
            linear: self.linear.map(T::from_f64),
            quadratic: self.quadratic.map(T::from_f64),
            cubic: self.cubic.map(T::from_f64),
        };
        CornerPolynomial::new(bank, coefficients)
    }
}

impl FeedbackNumbers {
    #[cold]
    fn feedback<T: Real>(&self, sample_rate_hz: f64) -> Result<Feedback<T>, ParamError> {
        Ok(Feedback {
            integral: PiController::new(
                T::ZERO,
                T::from_f64(self.integral_v_per_um_s),
                T::from_f64(sample_rate_hz),
            )?,
            series: [section(self.series[0])?, section(self.series[1])?],
            damping: section(self.damping)?,
            trust: self.trust.map(|trust| trust.trust(sample_rate_hz)).transpose()?,
        })
    }
}

impl TrustNumbers {
    fn trust<T: Real>(&self, sample_rate_hz: f64) -> Result<Trust<T>, ParamError> {
        Trust::new(self.quick_v, self.slow_v, self.slow_v_per_s, sample_rate_hz)
    }
}

fn section<T: Real>([b0, b1, b2, a1, a2]: [f64; 5]) -> Result<Biquad<T>, ParamError> {
    Biquad::new([b0, b1, b2], [a1, a2])
}
