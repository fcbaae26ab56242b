//! A bank of N play operators: thresholds, input range and sample clock on one side, outputs on the other.

use crate::envelope::Envelope;
use crate::error::{ParamError, finite, in_range};
use crate::play;
use crate::real::{Real, rarely};
use crate::thresholds::Thresholds;

/// Largest magnitude of an input limit: no volt is larger, and 1e9 um are a kilometre. With it a rate stays below
/// 2e9 x 1e7 Hz = 2e16 a second, which leaves `f32` (3.4e38) room for every coefficient in use.
pub const LARGEST_INPUT: f64 = 1e9;

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
    input: InputState<T>,
}

/// What a bank remembers of its input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InputState<T> {
    last: T,
    /// Whether there is a last input; the first sample has no rate.
    started: bool,
    /// Whether an input was not finite.
    fault: bool,
    /// Whether the outputs began neither equal nor on one side, so that every play needs to be touched.
    unordered: bool,
}

impl<T: Copy> InputState<T> {
    /// The last input as used.
    #[inline(always)]
    pub(crate) fn last(&self) -> T {
        self.last
    }
}

impl<T: Real, const N: usize> PlayBank<T, N> {
    /// Builds a bank. Inputs are clamped to `input_min..=input_max`; rates are backward differences at `sample_rate_hz`,
    /// 0 for the first sample.
    ///
    /// # Errors
    /// Limits beyond [`LARGEST_INPUT`], not finite or not ascending; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(
        thresholds: Thresholds<T, N>,
        input_min: T,
        input_max: T,
        sample_rate_hz: T,
    ) -> Result<Self, ParamError> {
        in_range("input_min", None, input_min, -LARGEST_INPUT, LARGEST_INPUT)?;
        in_range("input_max", None, input_max, -LARGEST_INPUT, LARGEST_INPUT)?;
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

    /// Rate of the samples, hertz.
    pub(crate) fn sample_rate_hz(&self) -> T {
        self.sample_rate_hz
    }

    /// Lowest and highest input.
    pub fn range(&self) -> [T; 2] {
        [self.input_min, self.input_max]
    }

    /// The thresholds.
    pub fn thresholds(&self) -> &Thresholds<T, N> {
        &self.thresholds
    }

    /// Largest magnitude of an input.
    pub(crate) fn largest_input(&self) -> T {
        self.input_min.magnitude().select_max(self.input_max.magnitude())
    }

    /// Largest magnitude of a rate, input units per second, whatever state the bank meets: after a swap of tables the
    /// last input may be one that only another bank allowed.
    pub(crate) fn largest_rate(&self) -> T {
        (self.largest_input() + T::from_f64(LARGEST_INPUT)) * self.sample_rate_hz
    }

    /// Moves the plays by one sample; returns the input as used and its change since the last.
    ///
    /// An input that is not finite is replaced by the last one and sets the sticky fault bit. The envelope is one of changes,
    /// [`Envelope::a_sample`].
    #[inline(always)]
    pub(crate) fn advance(&self, state: &mut PlayState<T, N>, input: T, envelope: &Envelope<T>) -> (T, T) {
        let (input, change) = self.admit(&mut state.input, input);
        let (left, right) = envelope.bounds(input, change);
        self.move_plays(state, left, right);
        (input, change)
    }

    /// As [`Self::advance`] with a static envelope: both bounds are the input.
    #[inline(always)]
    pub(crate) fn advance_static(&self, state: &mut PlayState<T, N>, input: T) -> (T, T) {
        let (input, change) = self.admit(&mut state.input, input);
        self.move_plays(state, input, input);
        (input, change)
    }

    #[inline(always)]
    fn move_plays(&self, state: &mut PlayState<T, N>, left: T, right: T) {
        if state.input.unordered {
            play::advance(self.thresholds.values(), &mut state.outputs, left, right);
        } else {
            play::advance_ordered(self.thresholds.values(), &mut state.outputs, left, right);
        }
    }

    /// As after an input, brought into range.
    pub(crate) fn input_at(&self, input: T) -> InputState<T> {
        InputState {
            last: self.clamped(if input.is_finite() { input } else { T::ZERO }),
            started: true,
            fault: false,
            unordered: false,
        }
    }

    /// The input as used and its change since the last.
    #[inline(always)]
    fn admit(&self, state: &mut InputState<T>, input: T) -> (T, T) {
        if state.started {
            return self.admit_next(state, input);
        }
        rarely();
        state.started = input.is_finite();
        let (input, _) = self.admit_next(state, input);
        // The first input is its own predecessor.
        (input, T::ZERO)
    }

    /// As [`Self::admit`] where there is a last input.
    #[inline(always)]
    pub(crate) fn admit_next(&self, state: &mut InputState<T>, input: T) -> (T, T) {
        let last = state.last;
        // The usual way. What is stored between the two comparisons keeps them two branches, which take fewer instructions than their
        // conjunction; a NaN takes the first.
        if input >= self.input_min {
            state.last = input;
            if input <= self.input_max {
                return (input, input - last);
            }
        }
        rarely();
        let finite = input.is_finite();
        let input = self.clamped(if finite { input } else { last });
        state.last = input;
        if !finite {
            state.fault = true;
        }
        (input, input - last)
    }

    #[inline(always)]
    fn clamped(&self, input: T) -> T {
        self.input_min.select_max(input).select_min(self.input_max)
    }
}

impl<T: Real, const N: usize> PlayState<T, N> {
    /// The virgin state: outputs zero (eqs 1, 3: `w(0) = f(v(0), 0)`), no input yet, so that the first sample has rate 0.
    pub fn virgin() -> Self {
        Self {
            outputs: [T::ZERO; N],
            input: InputState {
                last: T::ZERO,
                started: false,
                fault: false,
                unordered: false,
            },
        }
    }

    /// At rest at `input` with a remanence: `w_i = input - fraction * r_i`, fraction 0 after coming down from above, 1
    /// after coming up from below, 0.5 when demagnetised (one-sided plays).
    pub fn remanent(bank: &PlayBank<T, N>, input: T, fraction: T) -> Self {
        let mut state = Self::virgin();
        // The bank's own rule for inputs that are out of range or not finite.
        let (input, _) = bank.admit(&mut state.input, input);
        let fraction = T::ZERO.select_max(fraction).select_min(T::ONE);
        for (output, &threshold) in state.outputs.iter_mut().zip(bank.thresholds.values()) {
            *output = input - fraction * threshold;
        }
        if fraction != T::ZERO && fraction != T::ONE {
            state.input.unordered = true;
        }
        state
    }

    /// Outputs as given, for a state that is known; the first rate is from `last_input`.
    ///
    /// Unless they are equal, every step from here touches every play: outputs that no input leads to may come in any order.
    ///
    /// # Errors
    /// An output that is not finite, a last input that is not or is beyond [`LARGEST_INPUT`].
    pub fn from_outputs(outputs: [T; N], last_input: T) -> Result<Self, ParamError> {
        for (i, &output) in outputs.iter().enumerate() {
            finite("play output", Some(i + 1), output)?;
        }
        in_range("last input", None, last_input, -LARGEST_INPUT, LARGEST_INPUT)?;
        let equal = outputs.iter().all(|output| *output == outputs[0]);
        let input = InputState {
            last: last_input,
            started: true,
            fault: false,
            unordered: !equal,
        };
        Ok(Self { outputs, input })
    }

    /// All plays at one output, which becomes 0 where it is not finite; the first rate is from `last_input`, brought into range.
    pub fn at_rest(bank: &PlayBank<T, N>, output: T, last_input: T) -> Self {
        Self {
            outputs: [if output.is_finite() { output } else { T::ZERO }; N],
            input: bank.input_at(last_input),
        }
    }

    /// The plays' outputs.
    pub fn outputs(&self) -> &[T; N] {
        &self.outputs
    }

    /// Whether an input that was not finite has come since the last [`Self::clear_fault`].
    pub fn input_fault(&self) -> bool {
        self.input.fault
    }

    /// Clears the fault bit.
    pub fn clear_fault(&mut self) {
        self.input.fault = false;
    }
}

impl<T: Real, const N: usize> Default for PlayState<T, N> {
    fn default() -> Self {
        Self::virgin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    fn bank() -> PlayBank<f64, 2> {
        PlayBank::new(Thresholds::new([0.0, 1.0]).unwrap(), -2.0, 2.0, 50e3).unwrap()
    }

    /// Inputs as used and their changes, from a state.
    fn admitted(state: &mut PlayState<f64, 2>, inputs: &[f64]) -> std::vec::Vec<(f64, f64)> {
        inputs
            .iter()
            .map(|&input| bank().advance_static(state, input))
            .collect()
    }

    #[test]
    fn val_the_first_sample_is_no_change() {
        let found = admitted(&mut PlayState::virgin(), &[1.0, 1.5, 1.25]);
        assert_eq!(found, [(1.0, 0.0), (1.5, 0.5), (1.25, -0.25)]);
        // A state that knows its input has a change from there.
        assert_eq!(
            admitted(&mut PlayState::remanent(&bank(), 1.0, 0.0), &[1.5]),
            [(1.5, 0.5)]
        );
        let mut known = PlayState::from_outputs([1.0, 0.5], 1.0).unwrap();
        assert_eq!(admitted(&mut known, &[1.5]), [(1.5, 0.5)]);
    }

    /// An input that is not finite holds the last one, also where there is none yet, and the bit stays until cleared.
    #[test]
    fn val_faults_hold_and_stick() {
        let mut state = PlayState::virgin();
        let found = admitted(&mut state, &[f64::NAN, 1.5, f64::INFINITY, f64::NEG_INFINITY, 1.25]);
        assert_eq!(found, [(0.0, 0.0), (1.5, 0.0), (1.5, 0.0), (1.5, 0.0), (1.25, -0.25)]);
        assert!(state.input_fault());
        state.clear_fault();
        assert!(!state.input_fault());
        assert_eq!(
            admitted(&mut state, &[1.5]),
            [(1.5, 0.25)],
            "clearing the fault keeps the last input"
        );
    }

    /// Inputs beyond the range are clamped, and clamping is no fault.
    #[test]
    fn val_inputs_are_clamped() {
        let mut state = PlayState::remanent(&bank(), 2.0, 0.0);
        assert_eq!(admitted(&mut state, &[1e300, -1e300]), [(2.0, 0.0), (-2.0, -4.0)]);
        assert!(!state.input_fault());
    }

    #[test]
    fn val_initial_states() {
        let at = |input, fraction| *PlayState::remanent(&bank(), input, fraction).outputs();
        assert_eq!(at(1.5, 0.0), [1.5, 1.5]); // down from above
        assert_eq!(at(1.5, 1.0), [1.5, 0.5]); // up from below
        assert_eq!(at(1.5, 0.5), [1.5, 1.0]);
        assert_eq!(at(9.0, 7.0), [2.0, 1.0], "both brought into range");
        assert_eq!(*PlayState::<f64, 2>::virgin().outputs(), [0.0, 0.0]);
        // The named states are those that the operators reach by themselves.
        for (turn, fraction) in [(2.0, 0.0), (-2.0, 1.0)] {
            let mut state = PlayState::virgin();
            admitted(&mut state, &[turn, 0.5]);
            assert_eq!(*state.outputs(), at(0.5, fraction));
        }
    }

    #[test]
    fn refuse_bad_banks_and_states() {
        let refused = |min: f64, max: f64, rate_hz: f64| {
            let thresholds = Thresholds::new([0.0, 1.0]).unwrap();
            PlayBank::new(thresholds, min, max, rate_hz).unwrap_err().to_string()
        };
        assert_eq!(
            refused(-2e9, 1.0, 50e3),
            "input_min = -2000000000 must lie in -1000000000 to 1000000000"
        );
        assert_eq!(
            refused(0.0, f64::NAN, 50e3),
            "input_max = NaN must lie in -1000000000 to 1000000000"
        );
        assert_eq!(
            refused(1.0, 0.5, 50e3),
            "input limit[2] = 0.5 must exceed input limit[1] = 1; sort the values"
        );
        assert_eq!(
            refused(0.0, 1.0, 0.0),
            "sample_rate_hz = 0 must lie in 0.001 to 10000000"
        );
        let refused = |outputs, last| PlayState::from_outputs(outputs, last).unwrap_err().to_string();
        assert_eq!(
            refused([0.0, f64::INFINITY], 0.0),
            "play output[2] = inf must be finite"
        );
        assert_eq!(
            refused([0.0, 0.0], 2e9),
            "last input = 2000000000 must lie in -1000000000 to 1000000000"
        );
    }
}
