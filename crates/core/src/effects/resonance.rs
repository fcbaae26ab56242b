//! Modes of the structure.

use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;
use core::f64::consts::TAU;

/// One mode of a structure, `q'' + 2 zeta w q' + w^2 q = w^2 u`, exact for straight lines between samples.
///
/// For `u = u_0 + s t` the mode follows `q_p = u - 2 zeta s / w`; what deviates from that swings freely, turned and shrunk
/// by one matrix a sample.
///
/// # Units
/// Frequency in hertz (undamped, w / 2 pi), damping ratio a pure number. Flexure stages: 200 to 2500 Hz, zeta 0.005 to 0.03.
/// # Range
/// Damping 1e-6 to 0.999; any frequency against the sample rate, above its half as well.
/// # Cost
/// 8 multiply-adds a step.
/// # Example
/// ```
/// use hysteron_core::effects::{Block, resonance::Mode};
/// let mode = Mode::<f64>::new(1000.0, 0.01, 50e3)?;
/// let mut state = mode.rest_at(0.0);
/// let ringing: Vec<f64> = (0..50).map(|_| mode.step(&mut state, 1.0)).collect();
/// let peak = ringing.iter().copied().fold(0.0, f64::max);
/// assert!((peak - 1.97).abs() < 0.01); // 1 + exp(-pi zeta), half a period after the step
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
/// # Reference
/// Devasia, Eleftheriou, Moheimani, IEEE Trans. Control Syst. Technol. 15 (2007) 802 (nanopositioners as such modes).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode<T> {
    /// Free motion over one sample, of deviation and of its rate over w.
    turn: [[T; 2]; 2],
    /// `2 zeta`
    double_damping: T,
    /// `1 / (w T)`
    samples_a_radian: T,
}

/// Motion of a mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeState<T> {
    /// Displacement, and rate over w, both in the input's unit.
    pub motion: [T; 2],
    /// The input they belong to.
    pub input: T,
}

impl<T: Real> Mode<T> {
    /// Builds a mode.
    ///
    /// # Errors
    /// A frequency outside 1e-3 to 1e7 Hz, a damping ratio outside 1e-6 to 0.999, a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(frequency_hz: f64, damping: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("frequency_hz", None, frequency_hz, 1e-3, 1e7)?;
        in_range("damping", None, damping, 1e-6, 0.999)?;
        let angle = TAU * frequency_hz / sample_rate_hz;
        let damped = libm::sqrt(1.0 - damping * damping);
        let (sin, cos) = (libm::sin(angle * damped) / damped, libm::cos(angle * damped));
        let shrink = libm::exp(-damping * angle);
        let turn = [
            [shrink * (cos + damping * sin), shrink * sin],
            [-shrink * sin, shrink * (cos - damping * sin)],
        ];
        Ok(Self {
            turn: turn.map(|row| row.map(T::from_f64)),
            double_damping: T::from_f64(2.0 * damping),
            samples_a_radian: T::from_f64(1.0 / angle),
        })
    }

    /// What one sample makes of a deviation at rest input: the matrix of the free motion.
    pub fn free_motion(&self) -> [[T; 2]; 2] {
        self.turn
    }
}

impl<T: Real> Block<T> for Mode<T> {
    type State = ModeState<T>;

    fn rest_at(&self, input: T) -> ModeState<T> {
        let input = admit(input, T::ZERO);
        ModeState {
            motion: [input, T::ZERO],
            input,
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut ModeState<T>, input: T) -> T {
        let input = admit(input, state.input);
        let rate = (input - state.input) * self.samples_a_radian;
        let behind = self.double_damping * rate;
        let deviation = [state.motion[0] - state.input + behind, state.motion[1] - rate];
        let [[a, b], [c, d]] = self.turn;
        state.motion = [
            a * deviation[0] + b * deviation[1] + input - behind,
            c * deviation[0] + d * deviation[1] + rate,
        ];
        state.input = input;
        state.motion[0]
    }
}

/// Two modes driven by the same force, `(1 - s) M_1 + s M_2` with static gain 1.
///
/// A share `s` between 0 and 1 puts an antiresonance between them (modes in phase), outside of that none.
///
/// # Units
/// As [`Mode`]; the share a pure number, -10 to 10.
/// # Cost
/// Twice a [`Mode`] and one multiply-add.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoModes<T> {
    modes: [Mode<T>; 2],
    share: T,
}

impl<T: Real> TwoModes<T> {
    /// Builds two modes; `share` is the second one's part of the static displacement.
    ///
    /// # Errors
    /// A share outside -10 to 10.
    pub fn new(modes: [Mode<T>; 2], share: T) -> Result<Self, ParamError> {
        in_range("share", None, share, -10.0, 10.0)?;
        Ok(Self { modes, share })
    }
}

impl<T: Real> Block<T> for TwoModes<T> {
    type State = [ModeState<T>; 2];

    fn rest_at(&self, input: T) -> Self::State {
        [self.modes[0].rest_at(input), self.modes[1].rest_at(input)]
    }

    #[inline(always)]
    fn step(&self, state: &mut Self::State, input: T) -> T {
        let first = self.modes[0].step(&mut state[0], input);
        let second = self.modes[1].step(&mut state[1], input);
        first + self.share * (second - first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ramp from rest: `q = t - 2 zeta / w + exp(-zeta w t) (2 zeta / w cos + (2 zeta^2 - 1) / wd sin)`.
    #[test]
    fn val_ramp_closed_form() {
        for (frequency_hz, zeta) in [(3.0, 0.02), (0.4, 0.3), (0.011, 0.005)] {
            let mode = Mode::<f64>::new(frequency_hz, zeta, 1.0).unwrap();
            let mut state = mode.rest_at(0.0);
            let w = TAU * frequency_hz;
            let wd = w * (1.0 - zeta * zeta).sqrt();
            for k in 1..=200 {
                let t = f64::from(k);
                let found = mode.step(&mut state, t);
                let swing = 2.0 * zeta / w * (wd * t).cos() + (2.0 * zeta * zeta - 1.0) / wd * (wd * t).sin();
                let wanted = t - 2.0 * zeta / w + (-zeta * w * t).exp() * swing;
                // 1e-9 of 200: rounding of the turned motion over 200 samples.
                assert!(
                    (found - wanted).abs() < 2e-7,
                    "{frequency_hz} Hz, {t}: {found} {wanted}"
                );
            }
        }
    }

    #[test]
    fn val_two_modes_of_one_kind_are_one() {
        let mode = Mode::<f64>::new(700.0, 0.01, 50e3).unwrap();
        let both = TwoModes::new([mode, mode], 0.3).unwrap();
        let (mut one, mut two) = (mode.rest_at(1.0), both.rest_at(1.0));
        for k in 0..500 {
            let u = f64::from(k % 7);
            assert!((mode.step(&mut one, u) - both.step(&mut two, u)).abs() < 1e-12);
        }
    }

    #[test]
    fn prop_finite_for_every_input() {
        let mode = Mode::<f32>::new(1000.0, 1e-6, 50e3).unwrap();
        let mut state = mode.rest_at(f32::NAN);
        for k in 0..10_000 {
            let input = [1e30, -1e30, f32::NAN, f32::INFINITY, 0.0][k % 5];
            assert!(mode.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_unphysical_modes() {
        assert!(Mode::<f64>::new(0.0, 0.01, 50e3).is_err());
        assert!(Mode::<f64>::new(100.0, 0.0, 50e3).is_err());
        assert!(Mode::<f64>::new(100.0, 1.0, 50e3).is_err());
        let mode = Mode::<f64>::new(100.0, 0.1, 50e3).unwrap();
        assert!(TwoModes::new([mode, mode], f64::NAN).is_err());
    }
}
