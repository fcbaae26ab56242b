//! The Prandtl-Ishlinskii model (eq. 5).

use crate::bank::{PlayBank, PlayState};
use crate::error::{ParamError, finite};
use crate::model::{Hysteresis, all_finite, bounded, dot, sum_of_magnitudes};
use crate::real::Real;

/// The classical Prandtl-Ishlinskii model, eq. 5: `y = c + p_0 v + sum p_i F_ri[v]`, one-sided plays.
///
/// # Units
/// Offset in the output's unit, linear term and weights in output units per input unit.
/// # Cost
/// N compares twice and N + 1 multiply-adds a step.
/// # Example
/// ```
/// use hysteron_core::{bank::{PlayBank, PlayState}, model::Hysteresis, pi_model::Pi, thresholds::Thresholds};
/// let bank = PlayBank::new(Thresholds::new([0.0, 1.0])?, -10.0, 10.0, 50e3)?;
/// let pi = Pi::new(bank, 0.0, 0.5, [0.0, 1.0])?;
/// let mut state = PlayState::virgin();
/// let up: f64 = pi.step(&mut state, 3.0);
/// let down = pi.step(&mut state, 2.5);
/// assert_eq!((up, down), (0.5 * 3.0 + 2.0, 0.5 * 2.5 + 2.0)); // the play of width 1 has not turned yet
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
/// # Reference
/// Kuhnen, Eur. J. Control 9 (2003) 407; the paper's eq. 5. The offset is the sensor's zero, which the paper leaves out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pi<T, const N: usize> {
    bank: PlayBank<T, N>,
    offset: T,
    linear: T,
    weights: [T; N],
}

impl<T: Real, const N: usize> Pi<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// A coefficient that is not finite, or an output that is not over the bank's input range.
    pub fn new(bank: PlayBank<T, N>, offset: T, linear: T, weights: [T; N]) -> Result<Self, ParamError> {
        finite("offset", None, offset)?;
        finite("linear", None, linear)?;
        all_finite("weight", &weights)?;
        // A one-sided play stays within its threshold of the input: |w_i| <= |v| + r_i.
        let most = bank.largest_input();
        let reach = most + bank.thresholds().values()[N - 1];
        bounded(
            offset.magnitude() + linear.magnitude() * most + sum_of_magnitudes(&weights) * reach,
            most,
        )?;
        Ok(Self {
            bank,
            offset,
            linear,
            weights,
        })
    }
}

crate::model::impl_at_rest!(Pi);

impl<T: Real, const N: usize> Hysteresis<T> for Pi<T, N> {
    type State = PlayState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut PlayState<T, N>, input: T) -> T {
        let (input, _) = self.bank.advance_static(state, input);
        self.offset + output(self.linear, &self.weights, input, state.outputs())
    }
}

/// `p_0 v + sum p_i w_i` over slices, for a number of plays that is known at run time only.
#[inline(always)]
pub fn output<T: Real>(linear: T, weights: &[T], input: T, outputs: &[T]) -> T {
    linear * input + dot(weights, outputs)
}
