//! The mains taken out of the position again: amplitude and phase of each harmonic learned from the error.

use crate::error::{ParamError, in_range};
use crate::real::Real;
use core::f64::consts::TAU;

/// Learns hum from the error of the loop and predicts it, `h = sum p_k sin(k w t) + q_k cos(k w t)`, k = 1 to N.
///
/// Each harmonic goes by the gradient, `c_k -= 2 (T / tau) g_k e exp(-j k w t)` with `c_k = q_k - j p_k` and `g_k` what the
/// loop makes of a disturbance turned round, `1 / S(j k w)`: whatever feedback runs beside it, each harmonic falls with the time
/// constant tau. It is a feedback of a bandwidth of `1 / (2 pi tau)` about each harmonic and of nothing elsewhere.
///
/// # Units
/// Micrometres; frequency in hertz; tau in seconds.
/// # Cost
/// 14 multiply-adds a harmonic and step.
/// # Reference
/// Bodson, Sacks, Khosla, IEEE Trans. Autom. Control 39 (1994) 1939 (adaptive feedforward of sinusoids and the resonator that it
/// is equal to).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HumCanceller<T, const N: usize> {
    turns: [[T; 2]; N],
    /// Rotation from now to the sample that is predicted.
    ahead: [[T; 2]; N],
    /// `2 T / tau / S(j k w)`: real and imaginary part; zeros leave a harmonic out.
    rates: [[T; 2]; N],
    largest: T,
}

/// What has been learned, and where the oscillators stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HumCancellerState<T, const N: usize> {
    vectors: [[T; 2]; N],
    learned: [[T; 2]; N],
}

/// Largest turn round of the loop's answer: harmonics that feedback has brought below a tenth are its own.
const LARGEST_RATE: f64 = 10.0;

impl<T: Real, const N: usize> HumCanceller<T, N> {
    /// Builds it: `sensitivity` is `S(j k w)` of the loop for each harmonic, real and imaginary part (1, 0 without feedback; 0, 0
    /// leaves a harmonic out), `largest_um` bounds what may be learned.
    ///
    /// # Errors
    /// A frequency outside 1 to 1000 Hz, a time constant of less than a period of it or more than 1000 s, a harmonic above half
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
        in_range("tau_s", None, tau_s, 1.0 / frequency_hz, 1e3)?;
        in_range("samples ahead", None, ahead as f64, 0.0, 1e6)?;
        in_range("largest_um", None, largest_um, 0.0, 1e6)?;
        let vector = |angle: f64| [T::from_f64(libm::sin(angle)), T::from_f64(libm::cos(angle))];
        let (mut turns, mut aheads, mut rates) = ([[T::ZERO; 2]; N], [[T::ZERO; 2]; N], [[T::ZERO; 2]; N]);
        for (k, (((turn, ahead_of), rate), [re, im])) in turns
            .iter_mut()
            .zip(&mut aheads)
            .zip(&mut rates)
            .zip(sensitivity)
            .enumerate()
        {
            let angle = TAU * (k + 1) as f64 * frequency_hz / sample_rate_hz;
            *turn = vector(angle);
            *ahead_of = vector(angle * ahead as f64);
            let square = re * re + im * im;
            if square > 0.0 {
                // 1 / S = conj(S) / |S|^2, its size bounded.
                let size = (1.0 / libm::sqrt(square)).min(LARGEST_RATE) / libm::sqrt(square);
                let step = 2.0 / (tau_s * sample_rate_hz) * size;
                *rate = [T::from_f64(step * re), T::from_f64(-step * im)];
            }
        }
        Ok(Self {
            turns,
            ahead: aheads,
            rates,
            largest: T::from_f64(largest_um),
        })
    }

    /// Nothing learned yet.
    pub fn start(&self) -> HumCancellerState<T, N> {
        HumCancellerState {
            vectors: [[T::ZERO, T::ONE]; N],
            learned: [[T::ZERO; 2]; N],
        }
    }

    /// The hum at the sample that many samples ahead of this one.
    #[inline(always)]
    pub fn predict(&self, state: &HumCancellerState<T, N>) -> T {
        let mut sum = T::ZERO;
        for (([sin, cos], [p, q]), [sin_ahead, cos_ahead]) in state.vectors.iter().zip(&state.learned).zip(&self.ahead)
        {
            let sin_then = *sin * *cos_ahead + *cos * *sin_ahead;
            let cos_then = *cos * *cos_ahead - *sin * *sin_ahead;
            sum += *p * sin_then + *q * cos_then;
        }
        sum
    }

    /// Learns from the error (reference less position) of this sample and turns on to the next; an error that is not finite
    /// teaches nothing.
    #[inline(always)]
    pub fn learn(&self, state: &mut HumCancellerState<T, N>, error: T) {
        let error = if error.is_finite() { error } else { T::ZERO };
        let error = (-self.largest).select_max(error).select_min(self.largest);
        let parts = state.vectors.iter_mut().zip(&mut state.learned);
        for ((vector, learned), (turn, rate)) in parts.zip(self.turns.iter().zip(&self.rates)) {
            let ([sin, cos], [re, im]) = (*vector, *rate);
            // The error is the prediction less the hum: c = q - j p falls by rate e (cos - j sin).
            let bound = |x: T| (-self.largest).select_max(x).select_min(self.largest);
            learned[1] = bound(learned[1] - error * (re * cos + im * sin));
            learned[0] = bound(learned[0] + error * (im * cos - re * sin));
            // 1 / sqrt(x) near 1 is (3 - x) / 2.
            let right = T::from_f64(0.5) * (T::from_f64(3.0) - sin * sin - cos * cos);
            let [turn_sin, turn_cos] = *turn;
            *vector = [
                right * (sin * turn_cos + cos * turn_sin),
                right * (cos * turn_cos - sin * turn_sin),
            ];
        }
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
                predicted.push_back(canceller.predict(&state));
                let now = predicted.pop_front().unwrap();
                let hum = 0.03 * (TAU * hz * t + 1.0).sin() + 0.01 * (2.0 * TAU * hz * t + 2.5).sin();
                let miss = now - hum;
                left = if k % 1000 == 0 { 0.0 } else { left.max(miss.abs()) };
                // A quarter turn by the state itself: the miss of each line is c exp(j k w t) of its learned part less the hum's.
                for (n, cell) in wanted.iter_mut().enumerate() {
                    let (amplitude, phase) = [(0.03, 1.0), (0.01, 2.5)][n];
                    let angle = (n + 1) as f64 * TAU * hz * t;
                    let [p, q] = state.learned[n];
                    let straight = p * angle.sin() + q * angle.cos() - amplitude * (angle + phase).sin();
                    let turned = p * angle.cos() - q * angle.sin() - amplitude * (angle + phase).cos();
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

    #[test]
    fn prop_finite_for_every_input() {
        let canceller = HumCanceller::<f32, 5>::new(50.0, [[1.0, 0.0]; 5], 0.3, 16, 1.0, 50e3).unwrap();
        let mut state = canceller.start();
        for error in [1.0, f32::NAN, 1e30, -1e30, f32::INFINITY, -f32::MAX, 0.0] {
            canceller.learn(&mut state, error);
            assert!(canceller.predict(&state).is_finite());
        }
    }

    #[test]
    fn refuse_harmonics_that_the_rate_cannot_show() {
        assert!(HumCanceller::<f64, 5>::new(50.0, [[1.0, 0.0]; 5], 0.3, 16, 1.0, 400.0).is_err());
        assert!(HumCanceller::<f64, 5>::new(0.0, [[1.0, 0.0]; 5], 0.3, 16, 1.0, 50e3).is_err());
    }
}
