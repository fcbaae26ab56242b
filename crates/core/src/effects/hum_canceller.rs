//! The mains taken out of the position again: amplitude and phase of each harmonic learned from the error.

use crate::error::{ParamError, in_range};
use crate::real::Real;
use core::f64::consts::TAU;

/// Learns hum from the error of the loop and predicts it, `h = sum Re z_k`, k = 1 to N, each `z_k` turning by `k w T` a sample.
///
/// Each harmonic goes by the gradient, `z_k -= 2 (T / tau) g_k e` with `g_k` what the loop makes of a disturbance turned round,
/// `1 / S(j k w)`, and turned on by the samples that the prediction is ahead of the error: whatever feedback runs beside it, each harmonic falls with the time constant tau. It is a feedback of a bandwidth of
/// `1 / (2 pi tau)` about each harmonic and of nothing elsewhere.
///
/// # Units
/// Micrometres; frequency in hertz; tau in seconds.
/// # Cost
/// 6 multiply-adds a harmonic and step; one part of one harmonic a step is held to what may be learned.
/// # Rounding
/// The turn of a sample is as long as 1 to the number type's resolution: in `f32` at 50 kHz what is learned fades or grows by less than
/// 0.5 % a second, against which it is learned with tau.
/// # Reference
/// Bodson, Sacks, Khosla, IEEE Trans. Autom. Control 39 (1994) 1939 (adaptive feedforward of sinusoids and the resonator that it
/// is equal to: this is the resonator).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HumCanceller<T, const N: usize> {
    /// `exp(j k w T)`: imaginary and real part.
    turns: [[T; 2]; N],
    /// `2 T / tau / S(j k w)`, turned to the sample that is predicted: imaginary and real part; zeros leave a harmonic out.
    rates: [[T; 2]; N],
    largest: T,
}

/// What has been learned: `z_k` at the sample that is predicted, imaginary and real part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HumCancellerState<T, const N: usize> {
    learned: [[T; 2]; N],
    /// Sum of the real parts.
    predicted: T,
    /// Which part is held to its bound next.
    bounded: usize,
}

/// Slowest learning, seconds: what fades by rounding meanwhile stays below a twentieth.
const SLOWEST_S: f64 = 10.0;

/// Largest turn round of the loop's answer: harmonics that feedback has brought below a tenth are its own.
const LARGEST_RATE: f64 = 10.0;

impl<T: Real, const N: usize> HumCanceller<T, N> {
    /// Builds it: `sensitivity` is `S(j k w)` of the loop for each harmonic, real and imaginary part (1, 0 without feedback; 0, 0
    /// leaves a harmonic out), `largest_um` bounds what may be learned.
    ///
    /// # Errors
    /// A frequency outside 1 to 1000 Hz, a time constant of less than a period of it or more than 10 s, a harmonic above half
    /// the sample rate, more than 1e6 samples ahead, a bound outside 0 to 1e6 um.
    pub fn new(
        frequency_hz: f64,
        sensitivity: [[f64; 2]; N],
        tau_s: f64,
        ahead: usize,
        largest_um: f64,
        sample_rate_hz: f64,
    ) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("frequency_hz", None, frequency_hz, 1.0, 1000.0)?;
        in_range(
            "highest harmonic",
            None,
            N as f64 * frequency_hz,
            0.0,
            0.5 * sample_rate_hz,
        )?;
        in_range("tau_s", None, tau_s, 1.0 / frequency_hz, SLOWEST_S)?;
        in_range("samples ahead", None, ahead as f64, 0.0, 1e6)?;
        in_range("largest_um", None, largest_um, 0.0, 1e6)?;
        let (mut turns, mut rates) = ([[T::ZERO; 2]; N], [[T::ZERO; 2]; N]);
        for (k, ((turn, rate), [re, im])) in turns.iter_mut().zip(&mut rates).zip(sensitivity).enumerate() {
            let angle = TAU * (k + 1) as f64 * frequency_hz / sample_rate_hz;
            *turn = [T::from_f64(libm::sin(angle)), T::from_f64(libm::cos(angle))];
            let square = re * re + im * im;
            if square > 0.0 {
                // 1 / S = conj(S) / |S|^2, its size bounded.
                let size = (1.0 / libm::sqrt(square)).min(LARGEST_RATE) / libm::sqrt(square);
                let step = 2.0 / (tau_s * sample_rate_hz) * size;
                let (sin, cos) = (libm::sin(angle * ahead as f64), libm::cos(angle * ahead as f64));
                *rate = [
                    T::from_f64(step * (re * sin - im * cos)),
                    T::from_f64(step * (re * cos + im * sin)),
                ];
            }
        }
        Ok(Self {
            turns,
            rates,
            largest: T::from_f64(largest_um),
        })
    }

    /// Sine and cosine of each line's turn a sample, what an error moves each line by, and the most that is learned of one.
    pub fn coefficients(&self) -> (&[[T; 2]; N], &[[T; 2]; N], T) {
        (&self.turns, &self.rates, self.largest)
    }

    /// Nothing learned yet.
    pub fn start(&self) -> HumCancellerState<T, N> {
        HumCancellerState {
            learned: [[T::ZERO; 2]; N],
            predicted: T::ZERO,
            bounded: 0,
        }
    }

    /// Learns from the error (reference less position) of this sample and turns on to the next; an error that is not finite
    /// teaches nothing.
    #[inline(always)]
    pub fn learn(&self, state: &mut HumCancellerState<T, N>, error: T) {
        let bound = |x: T| (-self.largest).select_max(x).select_min(self.largest);
        let error = bound(if error.is_finite() { error } else { T::ZERO });
        let parts = state.learned.as_flattened_mut();
        if let Some(part) = parts.get_mut(state.bounded) {
            *part = bound(*part);
        }
        state.bounded = if state.bounded > 0 {
            state.bounded - 1
        } else {
            2 * N - 1
        };
        state.predicted = T::ZERO;
        for ([im, re], ([turn_sin, turn_cos], rate)) in state.learned.iter_mut().zip(self.turns.iter().zip(&self.rates))
        {
            // The error is the hum that is left over, turned round: z falls by the rate times it.
            let (left_im, left_re) = (*im - error * rate[0], *re - error * rate[1]);
            *im = left_re * *turn_sin + left_im * *turn_cos;
            *re = left_re * *turn_cos - left_im * *turn_sin;
            state.predicted += *re;
        }
    }
}

impl<T: Copy, const N: usize> HumCancellerState<T, N> {
    /// The hum at the sample that the canceller predicts, as many samples ahead of this one as it was built for.
    pub fn predicted(&self) -> T {
        self.predicted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hum of unknown phase behind a path that is `ahead` samples late, and behind a loop that turns and shrinks it: what is
    /// left falls with the time constant, to e^-5 = 0.7 % after five.
    #[test]
    fn val_what_is_left_falls_with_the_time_constant() {
        for sensitivity in [[1.0, 0.0], [0.2, 0.5], [-0.3, 0.4]] {
            let (rate_hz, hz, ahead, tau_s) = (10e3, 50.05, 16, 0.2);
            let canceller = HumCanceller::<f64, 2>::new(hz, [sensitivity; 2], tau_s, ahead, 1.0, rate_hz).unwrap();
            let mut state = canceller.start();
            let mut predicted = std::collections::VecDeque::from(std::vec![0.0; ahead]);
            // The loop's answer S x to a sum of two lines, line by line: x and its quarter turn.
            let mut left = 0.0_f64;
            let mut wanted = [[0.0; 2]; 2];
            for k in 0..(5.0 * tau_s * rate_hz) as usize {
                let t = k as f64 / rate_hz;
                predicted.push_back(state.predicted());
                let now = predicted.pop_front().unwrap();
                let hum = 0.03 * (TAU * hz * t + 1.0).sin() + 0.01 * (2.0 * TAU * hz * t + 2.5).sin();
                let miss = now - hum;
                left = if k % 1000 == 0 { 0.0 } else { left.max(miss.abs()) };
                // A quarter turn by the state itself: the miss of each line is its z less the hum's.
                for (n, cell) in wanted.iter_mut().enumerate() {
                    let (amplitude, phase) = [(0.03, 1.0), (0.01, 2.5)][n];
                    let angle = (n + 1) as f64 * TAU * hz * t;
                    // Learned for `ahead` samples from now: turned back.
                    let [im, re] = state.learned[n];
                    let back = (n + 1) as f64 * TAU * hz * ahead as f64 / rate_hz;
                    let (im, re) = (im * back.cos() - re * back.sin(), re * back.cos() + im * back.sin());
                    let straight = re - amplitude * (angle + phase).sin();
                    let turned = -im - amplitude * (angle + phase).cos();
                    *cell = [straight, turned];
                }
                let [re, im] = sensitivity;
                // Re(S z) of z whose real part is the miss and whose derivative over w is its quarter turn ahead.
                let error: f64 = wanted
                    .iter()
                    .map(|[straight, turned]| re * straight + im * turned)
                    .sum();
                canceller.learn(&mut state, error);
            }
            assert!(left < 0.04 * 0.02, "{sensitivity:?}: {left}");
        }
    }

    /// In `f32` at 50 kHz what is learned fades or grows by rounding no more than learning makes up for.
    #[test]
    fn val_rounding_leaves_little_in_single_precision() {
        for hz in [49.97, 50.0, 60.03] {
            let canceller = HumCanceller::<f32, 5>::new(hz, [[1.0, 0.0]; 5], 0.3, 16, 1.0, 50e3).unwrap();
            let mut state = canceller.start();
            let mut predicted = std::collections::VecDeque::from(std::vec![0.0; 16]);
            let mut left = 0.0_f64;
            for k in 0..150_000_u32 {
                predicted.push_back(f64::from(state.predicted()));
                let t = f64::from(k) / 50e3;
                let hum = 0.03 * (TAU * hz * t + 1.0).sin() + 0.01 * (3.0 * TAU * hz * t + 2.5).sin();
                let miss = predicted.pop_front().unwrap() - hum;
                left = if k < 140_000 { 0.0 } else { left.max(miss.abs()) };
                canceller.learn(&mut state, miss as f32);
            }
            // Of 40 nm, after ten time constants.
            assert!(left < 0.005 * 0.04, "{hz} Hz: {left}");
        }
    }

    #[test]
    fn prop_finite_for_every_input() {
        let canceller = HumCanceller::<f32, 5>::new(50.0, [[1.0, 0.0]; 5], 0.3, 16, 1.0, 50e3).unwrap();
        let mut state = canceller.start();
        for error in [1.0, f32::NAN, 1e30, -1e30, f32::INFINITY, -f32::MAX, 0.0] {
            canceller.learn(&mut state, error);
            assert!(state.predicted().is_finite());
        }
    }

    #[test]
    fn refuse_harmonics_that_the_rate_cannot_show() {
        assert!(HumCanceller::<f64, 5>::new(50.0, [[1.0, 0.0]; 5], 0.3, 16, 1.0, 400.0).is_err());
        assert!(HumCanceller::<f64, 5>::new(0.0, [[1.0, 0.0]; 5], 0.3, 16, 1.0, 50e3).is_err());
    }
}
