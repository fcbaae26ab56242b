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

/// What heat does to the position, undone: `u = (y - k d) / (1 + c d)` with `tau d' + d = T - T_0`.
///
/// # Units
/// As [`Thermal`].
/// # Cost
/// 4 multiply-adds and a division a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heat<T> {
    thermal: Thermal<T>,
}

/// The body's temperature against the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeatState<T> {
    body: LagState<T>,
}

impl<T: Real> Heat<T> {
    /// Undoes an effect.
    pub fn undoing(thermal: Thermal<T>) -> Self {
        Self { thermal }
    }

    /// Shift (um/K), gain (1/K), reference (degC), and the body's two shares of a step, as [`Lag::coefficients`].
    pub fn coefficients(&self) -> [T; 5] {
        let Thermal {
            shift_um_per_k,
            gain_per_k,
            reference_c,
            body,
        } = self.thermal;
        let [approach, through] = body.coefficients();
        [shift_um_per_k, gain_per_k, reference_c, approach, through]
    }

    /// State of a body that has taken this temperature.
    pub fn settled_at(&self, temperature_c: T) -> HeatState<T> {
        HeatState {
            body: self.thermal.settled_at(temperature_c).body,
        }
    }

    /// One sample: the position that heat moves to the one wanted.
    #[inline(always)]
    pub fn undo(&self, state: &mut HeatState<T>, wanted: T, temperature_c: T) -> T {
        let thermal = &self.thermal;
        let kelvin = within(temperature_c - thermal.reference_c);
        let warmer = thermal.body.step(&mut state.body, kelvin);
        // A gain that heat takes away altogether cannot be given back: a tenth is left of it.
        let gain = (T::ONE + thermal.gain_per_k * warmer).select_max(T::from_f64(0.1));
        (wanted - thermal.shift_um_per_k * warmer) / gain
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

    /// Undone and done again is the position wanted, while the body still follows.
    #[test]
    fn val_heat_undone_and_done_is_nothing() {
        let thermal = Thermal::<f64>::new(0.3, 2e-3, 22.0, 5.0, 100.0).unwrap();
        let heat = Heat::undoing(thermal);
        let (mut there, mut back) = (thermal.settled_at(22.0), heat.settled_at(22.0));
        for k in 0..1000 {
            let temperature_c = 22.0 + 0.002 * f64::from(k);
            let wanted = 5.0 + f64::from(k % 7);
            let before = heat.undo(&mut back, wanted, temperature_c);
            let found = thermal.step(&mut there, before, temperature_c);
            assert!((found - wanted).abs() < 1e-12);
        }
    }

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
