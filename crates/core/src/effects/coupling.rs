//! The other axis in this one.

use crate::effects::{Block, LARGEST_GAIN, admit};
use crate::error::{ParamError, in_range};
use crate::play;
use crate::real::Real;

/// Cross-coupling, `x = g u + d u' + p F_r[u]` with u the other axis' voltage: gain, lead, and one play of its hysteresis.
///
/// # Units
/// `g` and `p` in um/V (0.1 to 3 % of the axis' own), `d` in um s/V, the play's threshold in volts.
/// # Cost
/// 3 multiply-adds and 2 compare-selects a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coupling<T> {
    gain: T,
    /// `d / T`
    difference_gain: T,
    play_weight: T,
    threshold: T,
}

/// Last voltage and play of the other axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CouplingState<T> {
    last: T,
    play: T,
}

impl<T: Real> Coupling<T> {
    /// Builds the coupling.
    ///
    /// # Errors
    /// Gains beyond 1e6, a threshold outside 0 to 1e6 V, a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(
        gain_um_per_v: f64,
        lead_um_s_per_v: f64,
        play_um_per_v: f64,
        threshold_v: f64,
        sample_rate_hz: f64,
    ) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("gain_um_per_v", None, gain_um_per_v, -LARGEST_GAIN, LARGEST_GAIN)?;
        in_range("play_um_per_v", None, play_um_per_v, -LARGEST_GAIN, LARGEST_GAIN)?;
        in_range("threshold_v", None, threshold_v, 0.0, 1e6)?;
        let most = LARGEST_GAIN / sample_rate_hz;
        in_range("lead_um_s_per_v", None, lead_um_s_per_v, -most, most)?;
        Ok(Self {
            gain: T::from_f64(gain_um_per_v),
            difference_gain: T::from_f64(lead_um_s_per_v * sample_rate_hz),
            play_weight: T::from_f64(play_um_per_v),
            threshold: T::from_f64(threshold_v),
        })
    }
}

impl<T: Real> Coupling<T> {
    /// Gain, gain of the difference from sample to sample, weight and threshold of the play.
    pub fn coefficients(&self) -> [T; 4] {
        [self.gain, self.difference_gain, self.play_weight, self.threshold]
    }
}

impl<T: Real> Block<T> for Coupling<T> {
    type State = CouplingState<T>;

    fn rest_at(&self, input: T) -> CouplingState<T> {
        let input = admit(input, T::ZERO);
        CouplingState {
            last: input,
            play: input,
        }
    }

    /// What the other axis' voltage adds to the position.
    #[inline(always)]
    fn step(&self, state: &mut CouplingState<T>, input: T) -> T {
        let input = admit(input, state.last);
        let difference = input - state.last;
        state.last = input;
        state.play = play::one_sided(input, state.play, self.threshold);
        self.gain * input + self.difference_gain * difference + self.play_weight * state.play
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_gain_lead_and_play() {
        let coupling = Coupling::<f64>::new(0.01, 1e-3, 0.1, 2.0, 10.0).unwrap();
        let mut state = coupling.rest_at(0.0);
        let outputs = [1.0, 5.0, 4.0].map(|u| coupling.step(&mut state, u));
        let wanted = [0.01 + 0.01, 0.05 + 0.04 + 0.3, 0.04 - 0.01 + 0.3];
        for (found, wanted) in outputs.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-15, "{outputs:?}");
        }
    }

    #[test]
    fn prop_finite_for_every_input() {
        let coupling = Coupling::<f32>::new(1e6, 20.0, 1e6, 0.0, 50e3).unwrap();
        let mut state = coupling.rest_at(f32::NAN);
        for input in [1e30, f32::NAN, -1e30, f32::INFINITY, -f32::MAX] {
            assert!(coupling.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_gains_without_bound() {
        assert!(Coupling::<f64>::new(f64::NAN, 0.0, 0.0, 1.0, 50e3).is_err());
        assert!(Coupling::<f64>::new(0.0, 0.0, 0.0, -1.0, 50e3).is_err());
    }
}
