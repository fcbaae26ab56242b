//! A first-order lag: amplifier against the stack's capacitance, sensor filter.

use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// A first-order lag, `tau y' + y = u`, exact for straight lines between samples:
/// `y_1 = y_0 + b (u_0 - y_0) + g (u_1 - u_0)` with `b = 1 - exp(-T / tau)` and `g = 1 - b tau / T`.
///
/// # Units
/// Time constant in seconds; 0 lets the input through. The signal in any unit.
/// # Cost
/// 2 multiply-adds and 2 subtractions a step.
/// # Example
/// ```
/// use hysteron_core::effects::{Block, lag::Lag};
/// let lag = Lag::<f64>::new(100e-6, 50e3)?;
/// let mut state = lag.rest_at(0.0);
/// lag.step(&mut state, 1.0); // a ramp over one sample, then rest at 1
/// let after: Vec<f64> = (0..5).map(|_| lag.step(&mut state, 1.0)).collect();
/// // five samples are one time constant
/// assert!((after[4] - (1.0 - (-1.1_f64).exp())).abs() < 2e-3);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag<T> {
    /// `1 - exp(-T / tau)`.
    approach: T,
    /// `1 - approach tau / T`.
    through: T,
}

/// Output and last input of a lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LagState<T> {
    /// The output.
    pub output: T,
    /// The input it belongs to.
    pub input: T,
}

impl<T: Real> Lag<T> {
    /// Builds a lag.
    ///
    /// # Errors
    /// A time constant outside 0 to 1e6 s; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(tau_s: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("tau_s", None, tau_s, 0.0, 1e6)?;
        Ok(Self::of_samples(tau_s * sample_rate_hz))
    }

    /// Of a time constant in samples.
    fn of_samples(tau: f64) -> Self {
        let (approach, through) = coefficients(tau);
        Self {
            approach: T::from_f64(approach),
            through: T::from_f64(through),
        }
    }

    /// Shares of a step that its beginning and its ramp leave in the output.
    pub fn coefficients(&self) -> [T; 2] {
        [self.approach, self.through]
    }

    /// What a step leaves of the state, `exp(-T / tau)`.
    pub fn memory(&self) -> T {
        T::ONE - self.approach
    }
}

/// `b` and `g` for a time constant of `tau` samples.
#[cold]
pub(crate) fn coefficients(tau: f64) -> (f64, f64) {
    if tau < 1e-9 {
        return (1.0, 1.0);
    }
    let x = 1.0 / tau;
    let approach = -libm::expm1(-x);
    // 1 - (1 - exp(-x)) / x cancels for small x: there its series x/2 - x^2/6 + x^3/24, whose next term is below 1e-14.
    let through = if x < 1e-3 {
        x * (0.5 - x * (1.0 / 6.0 - x / 24.0))
    } else {
        1.0 - approach / x
    };
    (approach, through)
}

impl<T: Real> Block<T> for Lag<T> {
    type State = LagState<T>;

    fn rest_at(&self, input: T) -> LagState<T> {
        let input = admit(input, T::ZERO);
        LagState { output: input, input }
    }

    #[inline(always)]
    fn step(&self, state: &mut LagState<T>, input: T) -> T {
        let input = admit(input, state.input);
        state.output += self.approach * (state.input - state.output) + self.through * (input - state.input);
        state.input = input;
        state.output
    }
}

/// A first-order lag whose time constant grows with its output above a level, `tau + per_v (y - from)`, and never falls below 0: a stack's
/// capacitance grows with its voltage. Within a sample it is that of the sample's middle, as far as a straight line says where that is.
///
/// # Units
/// Time constant in seconds, its growth in seconds a volt, the level and the signal in volts.
/// # Cost
/// 6 multiply-adds, 6 subtractions, 2 divisions and 1 exponential a step.
/// # Example
/// ```
/// use hysteron_core::effects::{Block, lag::GrowingLag};
/// let lag = GrowingLag::<f64>::new(20e-6, 0.8e-6, 0.0, 50e3)?;
/// let mut state = lag.rest_at(100.0); // 100 us here
/// lag.step(&mut state, 101.0);
/// let after: Vec<f64> = (0..5).map(|_| lag.step(&mut state, 101.0)).collect();
/// assert!((after[4] - (101.0 - (-1.1_f64).exp())).abs() < 5e-3);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrowingLag<T> {
    /// Samples.
    tau: T,
    /// Samples a volt.
    per_v: T,
    from: T,
}

impl<T: Real> GrowingLag<T> {
    /// Builds a lag.
    ///
    /// # Errors
    /// A time constant outside 0 to 1e6 s; a growth outside +-1 s a volt; a level outside +-1e5 V; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(tau_s: f64, per_v_s: f64, from_v: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("tau_s", None, tau_s, 0.0, 1e6)?;
        in_range("tau_per_v", None, per_v_s, -1.0, 1.0)?;
        in_range("from_v", None, from_v, -FARTHEST_V, FARTHEST_V)?;
        Ok(Self {
            tau: T::from_f64(tau_s * sample_rate_hz),
            per_v: T::from_f64(per_v_s * sample_rate_hz),
            from: T::from_f64(from_v),
        })
    }
}

impl<T: Real> Block<T> for GrowingLag<T> {
    type State = LagState<T>;

    fn rest_at(&self, input: T) -> LagState<T> {
        Lag::of_samples(0.0).rest_at(input)
    }

    #[inline(always)]
    fn step(&self, state: &mut LagState<T>, input: T) -> T {
        let input = admit(input, state.input);
        let half = T::from_f64(0.5);
        let samples = |volts: T| (self.tau + self.per_v * (volts - self.from)).select_max(T::ZERO);
        let way = half * (state.input + input) - state.output;
        let tau = samples(state.output + half * way / (samples(state.output) + half));
        Lag::of_samples(tau.to_f64()).step(state, input)
    }
}

/// Undoes a lag behind a converter that holds: `u_k = v_k + (v_{k+1} - v_k) / (1 - exp(-T / tau))`.
///
/// A lag whose input is held goes from `v_k` to `v_k + (1 - exp(-T / tau)) (u_k - v_k)`: solved for the held value, the
/// output passes through every `v_k` exactly at the sample. The half sample that the hold costs is paid by knowing
/// `v_{k+1}`. The wanted outputs come one sample ahead of the command.
///
/// A stack's capacitance grows with its voltage, and the lag with it: the lead is then that of the voltage in the middle between two
/// wanted outputs, on a straight line through its value at a voltage.
///
/// # Units
/// Time constant in seconds; below a tenth of a sample the wanted output goes through. Growth in shares a volt.
/// # Cost
/// 2 multiply-adds, 1 addition and 1 subtraction a step.
/// # Example
/// ```
/// use hysteron_core::effects::lag::HeldLagInverse;
/// let lead = HeldLagInverse::<f64>::new(60e-6, None, 50e3)?;
/// let mut last = 0.0;
/// let command = lead.step(&mut last, 1.0); // from 0 to 1 V in one sample
/// let after_a_sample = command * (1.0 - (-20.0_f64 / 60.0).exp());
/// assert!((after_a_sample - 1.0).abs() < 1e-12);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldLagInverse<T> {
    /// `1 / (1 - exp(-T / tau))`, led back to 0 V.
    lead: T,
    /// Half of its change a volt.
    half_change: T,
}

/// How a lag grows with the voltage: `tau (1 + per_v (v - about_v))`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LagGrowth {
    /// Where the time constant is what it is said to be, volts.
    pub about_v: f64,
    /// Growth, shares a volt.
    pub per_v: f64,
}

impl From<[f64; 2]> for LagGrowth {
    fn from([about_v, per_v]: [f64; 2]) -> Self {
        Self { about_v, per_v }
    }
}

/// Largest lead of [`HeldLagInverse`] in samples: a lag of a thousand samples asks for a thousand times the change.
const LONGEST_LAG_SAMPLES: f64 = 1e3;

/// Most that a lag grows in a volt, a share: one of ranges of 2 V and more that is nothing at their low end.
const LARGEST_GROWTH_PER_V: f64 = 1.0;
/// Farthest from 0 V that the middle of a range lies, volts.
const FARTHEST_V: f64 = 1e5;

impl<T: Real> HeldLagInverse<T> {
    /// Builds the inverse.
    ///
    /// # Errors
    /// A time constant outside 0 to 1000 samples (an inverse that strong would only amplify noise); a growth outside +-1 a volt,
    /// about a voltage outside +-1e5 V; a sample rate outside 1e-3 to 1e7 Hz.
    #[cold]
    pub fn new(tau_s: f64, growth: Option<LagGrowth>, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("tau_s", None, tau_s, 0.0, LONGEST_LAG_SAMPLES / sample_rate_hz)?;
        let LagGrowth { about_v, per_v } = growth.unwrap_or_default();
        in_range("growth_per_v", None, per_v, -LARGEST_GROWTH_PER_V, LARGEST_GROWTH_PER_V)?;
        in_range("about_v", None, about_v, -FARTHEST_V, FARTHEST_V)?;
        // Below a tenth of a sample 1 - exp(-10) is 1 to 5e-5.
        let tau = tau_s * sample_rate_hz;
        let (approach, _) = coefficients(tau);
        // d/dtau 1 / (1 - exp(-1 / tau)) = exp(-1 / tau) / (tau (1 - exp(-1 / tau)))^2
        let of_tau = if tau < 1e-3 {
            0.0
        } else {
            (1.0 - approach) / (tau * approach * (tau * approach))
        };
        let change = of_tau * tau * per_v;
        Ok(Self {
            lead: T::from_f64(1.0 / approach - change * about_v),
            half_change: T::from_f64(0.5 * change),
        })
    }

    /// How many times a wanted step the command goes at 0 V, and half of its change a volt.
    pub fn lead(&self) -> [T; 2] {
        [self.lead, self.half_change]
    }

    /// One sample: the command that brings the lag's output from the last wanted value to this one.
    #[inline(always)]
    pub fn step(&self, last: &mut T, wanted: T) -> T {
        let wanted = admit(wanted, *last);
        self.step_admitted(last, wanted)
    }

    /// The same for an output that is known to be finite.
    #[inline(always)]
    pub(crate) fn step_admitted(&self, last: &mut T, wanted: T) -> T {
        let before = *last;
        *last = wanted;
        before + (wanted - before) * (self.lead + self.half_change * (before + wanted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp of slope s from rest: `y = s (t - tau (1 - exp(-t / tau)))`, exact for a straight line.
    #[test]
    fn val_ramp_closed_form() {
        for tau in [1e-9, 0.3, 4.0, 500.0, 1e6] {
            let lag = Lag::<f64>::new(tau, 1.0).unwrap();
            let mut state = lag.rest_at(0.0);
            for k in 1..=50 {
                let t = f64::from(k);
                let found = lag.step(&mut state, 2.0 * t);
                let wanted = 2.0 * (t + tau * libm::expm1(-t / tau));
                assert!((found - wanted).abs() < 1e-7, "{tau} {t}: {found} {wanted}");
            }
        }
    }

    #[test]
    fn val_no_time_constant_lets_through() {
        let lag = Lag::<f32>::new(0.0, 50e3).unwrap();
        let mut state = lag.rest_at(1.0);
        assert_eq!([2.0, -3.0].map(|u| lag.step(&mut state, u)), [2.0, -3.0]);
    }

    #[test]
    fn prop_finite_for_every_input() {
        let lag = Lag::<f32>::new(1e-4, 50e3).unwrap();
        let mut state = lag.rest_at(f32::INFINITY);
        for input in [1.0, f32::NAN, f32::INFINITY, -f32::MAX, 1e30, -1e30] {
            assert!(lag.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_negative_time() {
        assert!(Lag::<f64>::new(-1e-6, 50e3).is_err());
        assert!(Lag::<f64>::new(1e-6, 0.0).is_err());
        assert!(Lag::<f64>::new(f64::NAN, 50e3).is_err());
    }

    /// The exact lag of the plant's kind, driven by the held command, arrives at every wanted value.
    #[test]
    fn val_held_inverse_is_exact_at_the_samples() {
        for tau in [0.0, 0.05, 0.7, 3.6, 80.0] {
            let lead = HeldLagInverse::<f64>::new(tau, None, 1.0).unwrap();
            let decay = if tau == 0.0 { 0.0 } else { (-1.0 / tau).exp() };
            let (mut last, mut output) = (0.0, 0.0);
            for k in 0..200 {
                let wanted = (0.1 * f64::from(k)).sin() + f64::from(k % 3);
                let command = lead.step(&mut last, wanted);
                output = decay * output + (1.0 - decay) * command;
                assert!((output - wanted).abs() < 1e-9, "{tau} {k}: {output} {wanted}");
            }
        }
    }

    /// A lag whose time constant grows with its own output, in steps of a thousandth of a sample, arrives within a thousandth of the
    /// largest step; told of a lag that does not grow it misses by some percent.
    #[test]
    fn val_held_inverse_of_a_lag_that_grows() {
        let (tau, growth) = (
            1.4,
            LagGrowth {
                about_v: 60.0,
                per_v: 3e-3,
            },
        );
        let miss = |told: Option<LagGrowth>| {
            let lead = HeldLagInverse::<f64>::new(tau, told, 1.0).unwrap();
            let wanted = |k: i32| 60.0 - 50.0 * (0.12 * f64::from(k)).cos();
            let (mut last, mut output) = (wanted(0), wanted(0));
            let mut largest = 0.0_f64;
            for k in 1..200 {
                let command = lead.step(&mut last, wanted(k));
                for _ in 0..1000 {
                    let tau_now = tau * (1.0 + growth.per_v * (output - growth.about_v));
                    output += 1e-3 * (command - output) / tau_now;
                }
                largest = largest.max((output - wanted(k)).abs());
                output = wanted(k);
            }
            largest / 6.0
        };
        assert!(miss(Some(growth)) < 2e-3, "{}", miss(Some(growth)));
        assert!(miss(None) > 0.03, "{}", miss(None));
    }

    /// The same equation in steps of a thousandth of a sample, on a sine whose middle has a lag of 1.5 samples: within 20 mV of 80 V.
    #[test]
    fn val_a_growing_lag_is_that_of_its_equation() {
        let lag = GrowingLag::<f64>::new(0.3, 0.024, 10.0, 1.0).unwrap();
        let input = |t: f64| 60.0 - 40.0 * (0.05 * t).cos();
        let mut state = lag.rest_at(input(0.0));
        let mut output = input(0.0);
        for k in 1..400 {
            for part in 0..1000 {
                let t = f64::from(k - 1) + (f64::from(part) + 0.5) * 1e-3;
                output += 1e-3 * (input(t) - output) / (0.3 + 0.024 * (output - 10.0));
            }
            let found = lag.step(&mut state, input(f64::from(k)));
            assert!((found - output).abs() < 0.02, "{k}: {found} {output}");
        }
        // Where the time constant would be below 0 it lets through.
        let mut state = lag.rest_at(-10.0);
        assert_eq!([-5.0, -3.0].map(|u| lag.step(&mut state, u)), [-5.0, -3.0]);
        let new = GrowingLag::<f64>::new;
        assert!(new(-1e-9, 0.0, 0.0, 1.0).is_err() && new(0.0, 1.1, 0.0, 1.0).is_err());
        assert!(new(0.0, 0.0, f64::NAN, 1.0).is_err() && new(0.0, 0.0, 0.0, 0.0).is_err());
    }

    #[test]
    fn refuse_a_lag_of_seconds() {
        let refused = HeldLagInverse::<f32>::new(1.0, None, 50e3).unwrap_err();
        assert_eq!(std::format!("{refused}"), "tau_s = 1 must lie in 0 to 0.02");
        assert!(HeldLagInverse::<f32>::new(f64::NAN, None, 50e3).is_err());
        let growing = |about_v, per_v| HeldLagInverse::<f32>::new(1e-5, Some(LagGrowth { about_v, per_v }), 50e3);
        assert!(growing(100.0, 1.0).is_ok() && growing(-100.0, -1.0).is_ok());
        let refused = growing(100.0, 1.01).unwrap_err();
        assert_eq!(std::format!("{refused}"), "growth_per_v = 1.01 must lie in -1 to 1");
        assert!(growing(1.1e5, 0.01).is_err() && growing(f64::NAN, 0.0).is_err());
    }
}
