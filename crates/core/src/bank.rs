//! A bank of N play operators: thresholds, input range and sample clock on one side, outputs on the other.

use crate::envelope::Envelope;
use crate::error::{ParamError, finite, in_range};
use crate::play;
use crate::real::Real;
use crate::thresholds::Thresholds;

/// What a bank of plays does not change while it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayBank<T, const N: usize> {
    thresholds: Thresholds<T, N>,
    input_min: T,
    input_max: T,
    sample_rate_hz: T,
}

/// Outputs of a bank of plays, and what it has to remember of its input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayState<T, const N: usize> {
    outputs: [T; N],
    last_input: T,
    input_fault: bool,
}

impl<T: Real, const N: usize> PlayBank<T, N> {
    /// Builds a bank. Inputs are clamped to `input_min..=input_max`; rates are backward differences at `sample_rate_hz`.
    ///
    /// # Errors
    /// Limits that are not finite or not ascending; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(
        thresholds: Thresholds<T, N>,
        input_min: T,
        input_max: T,
        sample_rate_hz: T,
    ) -> Result<Self, ParamError> {
        finite("input_min", None, input_min)?;
        finite("input_max", None, input_max)?;
        if input_max <= input_min {
            let (value, previous) = (input_max.to_f64(), input_min.to_f64());
            return Err(ParamError::NotIncreasing {
                name: "input limit",
                index: 2,
                value,
                previous,
            });
        }
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        Ok(Self {
            thresholds,
            input_min,
            input_max,
            sample_rate_hz,
        })
    }

    /// The thresholds.
    pub fn thresholds(&self) -> &Thresholds<T, N> {
        &self.thresholds
    }

    /// Largest magnitude of an input.
    pub(crate) fn largest_input(&self) -> T {
        self.input_min.magnitude().select_max(self.input_max.magnitude())
    }

    /// Largest magnitude of a rate, input units per second: from one limit to the other in one sample.
    pub(crate) fn largest_rate(&self) -> T {
        (self.input_max - self.input_min) * self.sample_rate_hz
    }

    /// Moves the plays by one sample; returns the input as used and its rate per second.
    ///
    /// An input that is not finite is replaced by the last one and sets the sticky fault bit.
    #[inline(always)]
    pub(crate) fn advance(&self, state: &mut PlayState<T, N>, input: T, envelope: &Envelope<T>) -> (T, T) {
        let (input, rate) = self.admit(state, input);
        let (left, right) = envelope.bounds(input, rate);
        play::advance(self.thresholds.values(), &mut state.outputs, left, right);
        (input, rate)
    }

    /// As [`Self::advance`] with a static envelope: both bounds are the input.
    #[inline(always)]
    pub(crate) fn advance_static(&self, state: &mut PlayState<T, N>, input: T) -> (T, T) {
        let (input, rate) = self.admit(state, input);
        play::advance(self.thresholds.values(), &mut state.outputs, input, input);
        (input, rate)
    }

    #[inline(always)]
    fn admit(&self, state: &mut PlayState<T, N>, input: T) -> (T, T) {
        let held = if input.is_finite() {
            input
        } else {
            state.input_fault = true;
            state.last_input
        };
        let input = self.input_min.select_max(held).select_min(self.input_max);
        let rate = (input - state.last_input) * self.sample_rate_hz;
        state.last_input = input;
        (input, rate)
    }
}

impl<T: Real, const N: usize> PlayState<T, N> {
    /// The virgin state: outputs and input zero (eqs 1, 3: `w(0) = f(v(0), 0)`).
    pub fn virgin() -> Self {
        Self {
            outputs: [T::ZERO; N],
            last_input: T::ZERO,
            input_fault: false,
        }
    }

    /// At rest at `input` with a remanence: `w_i = input - fraction * r_i`, fraction 0 after coming down from above, 1
    /// after coming up from below, 0.5 when demagnetised (one-sided plays).
    pub fn remanent(bank: &PlayBank<T, N>, input: T, fraction: T) -> Self {
        let mut state = Self::virgin();
        // The bank's own rule for inputs that are out of range or not finite.
        let (input, _) = bank.admit(&mut state, input);
        let fraction = T::ZERO.select_max(fraction).select_min(T::ONE);
        for (output, &threshold) in state.outputs.iter_mut().zip(bank.thresholds.values()) {
            *output = input - fraction * threshold;
        }
        state
    }

    /// Outputs as given, for a state that is known.
    ///
    /// # Errors
    /// An output or the input is not finite.
    pub fn from_outputs(outputs: [T; N], last_input: T) -> Result<Self, ParamError> {
        for (i, &output) in outputs.iter().enumerate() {
            finite("play output", Some(i + 1), output)?;
        }
        finite("last input", None, last_input)?;
        Ok(Self {
            outputs,
            last_input,
            input_fault: false,
        })
    }

    /// The plays' outputs.
    pub fn outputs(&self) -> &[T; N] {
        &self.outputs
    }

    /// Whether an input that was not finite has come since the last [`Self::clear_fault`].
    pub fn input_fault(&self) -> bool {
        self.input_fault
    }

    /// Clears the fault bit.
    pub fn clear_fault(&mut self) {
        self.input_fault = false;
    }
}

impl<T: Real, const N: usize> Default for PlayState<T, N> {
    fn default() -> Self {
        Self::virgin()
    }
}
