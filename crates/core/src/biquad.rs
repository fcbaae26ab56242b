//! A second-order section: notch, damping filter, antiresonance.

use crate::effects::admit;
use crate::error::{ParamError, finite, in_range};
use crate::real::{Real, rarely};
use core::f64::consts::PI;

/// A second-order section `H(z) = (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)`, transposed direct form II.
///
/// # Units
/// Any signal; coefficients as for a unit sample period.
/// # Cost
/// 5 multiply-adds a step.
/// # Example
/// ```
/// use hysteron_core::biquad::{Biquad, BiquadState};
/// let notch = Biquad::<f64>::notch(2500.0, 0.1, 0.8, 50e3)?;
/// let mut state = BiquadState::default();
/// let settled = (0..2000).map(|_| notch.step(&mut state, 1.0)).last();
/// assert!((settled.unwrap() - 1.0).abs() < 1e-9); // a notch lets rest through
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
/// # Reference
/// Oppenheim and Schafer, Discrete-Time Signal Processing (2010), sections 6.3 and 7.2 (bilinear transformation, its
/// warping undone at the notch).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Biquad<T> {
    forward: [T; 3],
    back: [T; 2],
}

/// Two delays.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BiquadState<T> {
    delays: [T; 2],
}

impl<T: Real> Biquad<T> {
    /// Takes coefficients as they are: b0, b1, b2 and a1, a2.
    ///
    /// # Errors
    /// A coefficient that is not finite or beyond 1e9; poles on or outside the unit circle: it needs `|a2| < 1` and
    /// `|a1| < 1 + a2`.
    pub fn new(forward: [f64; 3], back: [f64; 2]) -> Result<Self, ParamError> {
        for (i, &b) in forward.iter().enumerate() {
            in_range("b", Some(i), b, -1e9, 1e9)?;
        }
        for (i, &a) in back.iter().enumerate() {
            finite("a", Some(i + 1), a)?;
        }
        let inside = 1.0 - 1e-9;
        in_range("a", Some(2), back[1], -inside, inside)?;
        let widest = (1.0 + back[1]) * inside;
        in_range("a", Some(1), back[0], -widest, widest)?;
        Ok(Self {
            forward: forward.map(T::from_f64),
            back: back.map(T::from_f64),
        })
    }

    /// Lets everything through.
    pub fn identity() -> Self {
        Self {
            forward: [T::ONE, T::ZERO, T::ZERO],
            back: [T::ZERO; 2],
        }
    }

    /// `(s^2 + 2 z_n w s + w^2) / (s^2 + 2 z_d w s + w^2)`: a notch for `z_n < z_d`, its gain at the middle `z_n / z_d`.
    ///
    /// # Errors
    /// A frequency outside 1e-3 Hz to just below half the sample rate, damping ratios outside 0 to 10 (numerator) and
    /// 1e-3 to 10 (denominator).
    pub fn notch(frequency_hz: f64, numerator: f64, denominator: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("frequency_hz", None, frequency_hz, 1e-3, 0.499 * sample_rate_hz)?;
        in_range("numerator damping", None, numerator, 0.0, 10.0)?;
        in_range("denominator damping", None, denominator, 1e-3, 10.0)?;
        let k = libm::tan(PI * frequency_hz / sample_rate_hz);
        let norm = 1.0 / (1.0 + 2.0 * denominator * k + k * k);
        let middle = 2.0 * (k * k - 1.0) * norm;
        let ends = |damping: f64| {
            [
                (1.0 + 2.0 * damping * k + k * k) * norm,
                (1.0 - 2.0 * damping * k + k * k) * norm,
            ]
        };
        let [b0, b2] = ends(numerator);
        let [_, a2] = ends(denominator);
        Self::new([b0, middle, b2], [middle, a2])
    }

    /// `w_d^2 / w_n^2 (s^2 + 2 z_n w_n s + w_n^2) / (s^2 + 2 z_d w_d s + w_d^2)`, static gain 1: a mode undone, an
    /// antiresonance filled. Each frequency keeps its place.
    ///
    /// # Errors
    /// As [`Self::notch`] for both frequencies; damping ratios below 1e-4.
    pub fn mode_swap(
        [undone_hz, undone_damping]: [f64; 2],
        [filled_hz, filled_damping]: [f64; 2],
        sample_rate_hz: f64,
    ) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        let mut ends = [[0.0; 3]; 2];
        for (end, (hz, damping)) in ends
            .iter_mut()
            .zip([(undone_hz, undone_damping), (filled_hz, filled_damping)])
        {
            in_range("frequency_hz", None, hz, 1e-3, 0.499 * sample_rate_hz)?;
            in_range("damping", None, damping, 1e-4, 10.0)?;
            let k = libm::tan(PI * hz / sample_rate_hz);
            let per_square = 1.0 / (k * k);
            *end = [
                (1.0 + 2.0 * damping * k) * per_square + 1.0,
                2.0 - 2.0 * per_square,
                (1.0 - 2.0 * damping * k) * per_square + 1.0,
            ];
        }
        let [[b0, b1, b2], [a0, a1, a2]] = ends;
        Self::new([b0 / a0, b1 / a0, b2 / a0], [a1 / a0, a2 / a0])
    }

    /// The coefficients, b0 b1 b2 and a1 a2.
    pub fn coefficients(&self) -> ([T; 3], [T; 2]) {
        (self.forward, self.back)
    }

    /// One sample; an input that is not finite counts as 0, and a state that has grown beyond all bounds starts anew.
    #[inline(always)]
    pub fn step(&self, state: &mut BiquadState<T>, input: T) -> T {
        self.step_admitted(state, admit(input, T::ZERO))
    }

    /// As [`Self::step`]; an input that is not finite makes the state start anew.
    #[inline(always)]
    pub(crate) fn step_admitted(&self, state: &mut BiquadState<T>, input: T) -> T {
        let [b0, b1, b2] = self.forward;
        let [a1, a2] = self.back;
        let output = b0 * input + state.delays[0];
        let first = b1 * input - a1 * output + state.delays[1];
        let second = b2 * input - a2 * output;
        state.delays = [first, second];
        // Below the largest f32 with room for the next sum. An output that is not finite shows in `first` at once, a `second` that is
        // not at the next sample.
        let bounded = first.magnitude() <= T::from_f64(1e36);
        if !bounded {
            rarely();
            state.delays = [T::ZERO; 2];
            return T::ZERO;
        }
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine at the notch's middle leaves with `z_n / z_d` of its amplitude.
    #[test]
    fn val_notch_depth() {
        for (f, n, d) in [(739.0, 0.02, 0.7), (2500.0, 0.1, 1.0), (8000.0, 0.0, 0.5)] {
            let notch = Biquad::<f64>::notch(f, n, d, 50e3).unwrap();
            let mut state = BiquadState::default();
            let (mut re, mut im) = (0.0, 0.0);
            let count = 50_000; // whole periods of whole hertz
            for k in 0..2 * count {
                let x = core::f64::consts::TAU * f * f64::from(k) / 50e3;
                let y = notch.step(&mut state, x.sin());
                if k >= count {
                    re += 2.0 / f64::from(count) * y * x.sin();
                    im += 2.0 / f64::from(count) * y * x.cos();
                }
            }
            assert!((libm::hypot(re, im) - n / d).abs() < 1e-9, "{f}: {re} {im}");
        }
    }

    /// Swapping one mode for another and back is nothing at all, and rest stays rest.
    #[test]
    fn val_mode_swap_undoes_itself() {
        let there = Biquad::<f64>::mode_swap([2291.0, 0.02], [2042.0, 0.02], 50e3).unwrap();
        let back = Biquad::<f64>::mode_swap([2042.0, 0.02], [2291.0, 0.02], 50e3).unwrap();
        let (mut a, mut b) = (BiquadState::default(), BiquadState::default());
        let mut last = 0.0;
        for k in 0..20_000 {
            let input = if k < 10_000 { f64::from(k * k % 11) } else { 3.0 };
            last = there.step(&mut a, input);
            assert!((back.step(&mut b, last) - input).abs() < 1e-8);
        }
        assert!((last - 3.0).abs() < 1e-6, "{last}");
    }

    #[test]
    fn prop_finite_for_every_input() {
        let notch = Biquad::<f32>::new([1e9, -1e9, 1e9], [-1.99, 0.995]).unwrap();
        let mut state = BiquadState::default();
        for k in 0..1000 {
            let input = [1e30, f32::NAN, -1e30, f32::INFINITY, 1.0, -f32::MAX][k % 6];
            assert!(notch.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_unstable_sections() {
        assert!(Biquad::<f64>::new([1.0; 3], [0.0, 1.0]).is_err());
        assert!(Biquad::<f64>::new([1.0; 3], [2.0, 0.99]).is_err());
        assert!(Biquad::<f64>::notch(25e3, 0.1, 0.7, 50e3).is_err());
        let refused = Biquad::<f64>::notch(100.0, 0.1, 0.0, 50e3).unwrap_err();
        assert_eq!(
            std::format!("{refused}"),
            "denominator damping = 0 must lie in 0.001 to 10"
        );
    }
}
