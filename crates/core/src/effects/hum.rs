//! The mains in the position.

use crate::error::{ParamError, in_range};
use crate::real::Real;
use core::f64::consts::TAU;

/// Mains hum, `sum A_k sin(2 pi k f t + phi_k)`, k = 1 to N, as oscillators that turn by one matrix a sample.
///
/// # Units
/// Amplitudes in micrometres, frequency in hertz, phases at the first sample in radians.
/// # Cost
/// 6 multiply-adds a harmonic and step; the length of each vector is set right by half its error every step, so that
/// rounding neither grows nor shrinks it.
/// # Reference
/// Coupled-form oscillator with amplitude control (Gordon, Smith, ICMC 1985).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hum<T, const N: usize> {
    amplitudes: [T; N],
    phases: [[T; 2]; N],
    turns: [[T; 2]; N],
}

/// Sine and cosine of each harmonic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HumState<T, const N: usize> {
    vectors: [[T; 2]; N],
}

impl<T: Real, const N: usize> Hum<T, N> {
    /// Builds the oscillators.
    ///
    /// # Errors
    /// A frequency outside 1 to 1000 Hz, an amplitude outside 0 to 1e6 um, a phase beyond 1e3 rad, a sample rate
    /// outside 1e-3 to 1e7 Hz.
    pub fn new(
        frequency_hz: f64,
        amplitudes: [f64; N],
        phases: [f64; N],
        sample_rate_hz: f64,
    ) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("frequency_hz", None, frequency_hz, 1.0, 1000.0)?;
        for (i, (&amplitude, &phase)) in amplitudes.iter().zip(&phases).enumerate() {
            in_range("amplitude", Some(i + 1), amplitude, 0.0, 1e6)?;
            in_range("phase", Some(i + 1), phase, -1e3, 1e3)?;
        }
        let vector = |angle: f64| [T::from_f64(libm::sin(angle)), T::from_f64(libm::cos(angle))];
        let mut turns = [vector(0.0); N];
        for (k, turn) in turns.iter_mut().enumerate() {
            *turn = vector(TAU * (k + 1) as f64 * frequency_hz / sample_rate_hz);
        }
        Ok(Self {
            amplitudes: amplitudes.map(T::from_f64),
            phases: phases.map(vector),
            turns,
        })
    }

    /// The state at the first sample.
    pub fn start(&self) -> HumState<T, N> {
        HumState { vectors: self.phases }
    }

    /// The hum at this sample; turns the oscillators to the next.
    #[inline(always)]
    pub fn step(&self, state: &mut HumState<T, N>) -> T {
        let mut sum = T::ZERO;
        for ((vector, turn), &amplitude) in state.vectors.iter_mut().zip(&self.turns).zip(&self.amplitudes) {
            let ([sin, cos], [turn_sin, turn_cos]) = (*vector, *turn);
            sum += amplitude * sin;
            // 1 / sqrt(x) near 1 is (3 - x) / 2.
            let right = T::from_f64(0.5) * (T::from_f64(3.0) - sin * sin - cos * cos);
            *vector = [
                right * (sin * turn_cos + cos * turn_sin),
                right * (cos * turn_cos - sin * turn_sin),
            ];
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_sum_of_sines() {
        let hum = Hum::<f64, 2>::new(49.97, [3.0, 1.0], [0.3, 2.0], 5e3).unwrap();
        let mut state = hum.start();
        for k in 0..20_000 {
            let angle = TAU * 49.97 * f64::from(k) / 5e3;
            let wanted = 3.0 * (angle + 0.3).sin() + (2.0 * angle + 2.0).sin();
            assert!((hum.step(&mut state) - wanted).abs() < 1e-9, "sample {k}");
        }
    }

    #[test]
    fn prop_f32_keeps_its_amplitude_for_ten_minutes() {
        let hum = Hum::<f32, 1>::new(50.0, [1.0], [0.0], 1e3).unwrap();
        let mut state = hum.start();
        for _ in 0..600_000 {
            hum.step(&mut state);
        }
        let [sin, cos] = state.vectors[0];
        assert!((sin * sin + cos * cos - 1.0).abs() < 1e-6);
    }

    #[test]
    fn refuse_no_mains() {
        assert!(Hum::<f64, 1>::new(0.0, [1.0], [0.0], 5e3).is_err());
        assert!(Hum::<f64, 1>::new(50.0, [-1.0], [0.0], 5e3).is_err());
        assert!(Hum::<f64, 1>::new(50.0, [1.0], [f64::NAN], 5e3).is_err());
    }
}
