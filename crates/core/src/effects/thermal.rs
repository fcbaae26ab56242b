//! What the temperature does to position and gain.

use crate::effects::lag::{Lag, LagState};
use crate::effects::{Block, LARGEST_GAIN, admit};
use crate::error::{ParamError, finite, in_range};
use crate::real::Real;

/// Thermal drift, `y = u (1 + c d) + k d` with `tau d' + d = T - T_0`: the stage's body follows the temperature beside it.
///
/// # Units
/// `k` in um/K (aluminium, 50 mm: 1.15), `c` in 1/K (5e-4 to 5e-3), temperatures in degrees Celsius, tau in seconds
/// (minutes to an hour).
/// # Cost
/// 5 multiply-adds a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thermal<T> {
    shift_um_per_k: T,
    gain_per_k: T,
    reference_c: T,
    body: Lag<T>,
}

/// The body's temperature against the reference, and the last position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalState<T> {
    body: LagState<T>,
    last: T,
}

impl<T: Real> Thermal<T> {
    /// Builds the effect.
    ///
    /// # Errors
    /// Coefficients beyond 1e6, a reference that is not finite, a time constant or sample rate that [`Lag::new`] refuses.
    pub fn new(
        shift_um_per_k: T,
        gain_per_k: T,
        reference_c: T,
        tau_s: f64,
        sample_rate_hz: f64,
    ) -> Result<Self, ParamError> {
        in_range("shift_um_per_k", None, shift_um_per_k, -LARGEST_GAIN, LARGEST_GAIN)?;
        in_range("gain_per_k", None, gain_per_k, -LARGEST_GAIN, LARGEST_GAIN)?;
        finite("reference_c", None, reference_c)?;
        Ok(Self {
            shift_um_per_k,
            gain_per_k,
            reference_c,
            body: Lag::new(tau_s, sample_rate_hz)?,
        })
    }

    /// State of a body that has taken this temperature.
    pub fn settled_at(&self, temperature_c: T) -> ThermalState<T> {
        ThermalState {
            body: self.body.rest_at(within(temperature_c - self.reference_c)),
            last: T::ZERO,
        }
    }

    /// One sample: the position moved by the heat.
    #[inline(always)]
    pub fn step(&self, state: &mut ThermalState<T>, position: T, temperature_c: T) -> T {
        let warmer = self
            .body
            .step(&mut state.body, within(temperature_c - self.reference_c));
        state.last = admit(position, state.last);
        state.last + warmer * (self.gain_per_k * state.last + self.shift_um_per_k)
    }
}

/// Nothing on a bench is further from its reference, kelvin: keeps products finite. A NaN counts as the lower end.
#[inline(always)]
fn within<T: Real>(kelvin: T) -> T {
    let largest = T::from_f64(10.0);
    let most = largest * largest;
    (-most).select_max(kelvin).select_min(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_shift_and_gain_after_the_body_has_followed() {
        let thermal = Thermal::new(0.5_f64, 1e-3, 20.0, 10.0, 1.0).unwrap();
        let mut state = thermal.settled_at(20.0);
        assert_eq!(thermal.step(&mut state, 8.0, 20.0), 8.0);
        for _ in 0..400 {
            thermal.step(&mut state, 8.0, 22.0);
        }
        assert!((thermal.step(&mut state, 8.0, 22.0) - (8.0 * 1.002 + 1.0)).abs() < 1e-12);
    }

    #[test]
    fn prop_finite_for_every_input() {
        let thermal = Thermal::new(1e6_f32, 1e6, 0.0, 0.0, 1.0).unwrap();
        let mut state = thermal.settled_at(f32::NAN);
        for input in [1e30, f32::NAN, -f32::MAX, f32::INFINITY, 1.0] {
            for temperature in [f32::NAN, f32::INFINITY, -1e30, 20.0] {
                assert!(thermal.step(&mut state, input, temperature).is_finite());
            }
        }
    }

    #[test]
    fn refuse_coefficients_without_bound() {
        assert!(Thermal::new(f64::NAN, 0.0, 20.0, 1.0, 1.0).is_err());
        assert!(Thermal::new(0.0, 0.0, 20.0, -1.0, 1.0).is_err());
    }
}
