//! The modified rate-dependent Prandtl-Ishlinskii model (eq. 10) and its direct inverse (eq. 13).

use crate::bank::{PlayBank, PlayState};
use crate::envelope::Envelope;
use crate::error::{ParamError, in_range};
use crate::model::Hysteresis;
use crate::mpi::MpiCoefficients;
use crate::plays_sum;
use crate::real::Real;

/// Largest alpha and beta, seconds: a play whose envelope lags by more than a second is no play.
pub const LARGEST_ENVELOPE_S: f64 = 1.0;

/// The MRPI model, eq. 10: `y = c + b_1 v^3 + b_2 v + sum q_i F^h_ri[v]`, plays with dynamic envelopes (eqs 7-9).
///
/// As a direct inverse (eq. 13) the input is y_d and the output the voltage. The rate is the backward difference of the
/// input at the bank's sample rate, 0 for the first sample after [`PlayState::virgin`].
///
/// # Units
/// As [`crate::mpi::Mpi`]; alpha and beta in seconds.
/// # Cost
/// N compares twice and N + 6 multiply-adds a step; [`crate::quick_mrpi::QuickMrpi`] takes less.
/// # Example
/// ```
/// use hysteron_core::{bank::*, envelope::Envelope, model::Hysteresis, mpi::MpiCoefficients, mrpi::Mrpi, thresholds::Thresholds};
/// let bank = PlayBank::new(Thresholds::new([0.1])?, -2.0, 2.0, 50e3)?;
/// let coefficients = MpiCoefficients { offset: 0.0, cubic: 0.0, linear: 0.0, weights: [1.0] };
/// let mrpi = Mrpi::new(bank, coefficients, Envelope { alpha_s: 3e-4, beta_s: 1e-4 })?;
/// let mut state = PlayState::virgin();
/// mrpi.step(&mut state, 0.0);
/// // 0.01 in one sample of 20 us is 500 per second; h_l - r = 0.01 - 3e-4 * 500 - 0.1 < 0: the play stands still.
/// assert_eq!(mrpi.step(&mut state, 0.01_f64), 0.0);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
/// # Reference
/// The paper's eqs 7 to 10 and 13. The offset is the sensor's zero, which the paper leaves out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mrpi<T, const N: usize> {
    pub(crate) bank: PlayBank<T, N>,
    pub(crate) coefficients: MpiCoefficients<T, N>,
    /// Of changes from sample to sample.
    pub(crate) envelope: Envelope<T>,
}

impl<T: Real, const N: usize> Mrpi<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// - Alpha or beta negative, not finite, or above [`LARGEST_ENVELOPE_S`].
    /// - A coefficient that is not finite, or an output that is not over the bank's input range at its fastest rate.
    pub fn new(
        bank: PlayBank<T, N>,
        coefficients: MpiCoefficients<T, N>,
        envelope: Envelope<T>,
    ) -> Result<Self, ParamError> {
        in_range("alpha_s", None, envelope.alpha_s, 0.0, LARGEST_ENVELOPE_S)?;
        in_range("beta_s", None, envelope.beta_s, 0.0, LARGEST_ENVELOPE_S)?;
        let most = bank.largest_input();
        let lag = envelope.alpha_s.select_max(envelope.beta_s) * bank.largest_rate();
        coefficients.check(most, most + bank.thresholds().values()[N - 1] + lag)?;
        Ok(Self {
            bank,
            coefficients,
            envelope: envelope.a_sample(bank.sample_rate_hz()),
        })
    }
}

crate::model::impl_at_rest!(Mrpi);

impl<T: Real, const N: usize> Hysteresis<T> for Mrpi<T, N> {
    type State = PlayState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut PlayState<T, N>, input: T) -> T {
        let (input, _) = self.bank.advance(state, input, &self.envelope);
        let MpiCoefficients {
            offset,
            cubic,
            linear,
            ref weights,
        } = self.coefficients;
        (cubic * input * input + linear) * input + plays_sum::sum(offset, weights, state.outputs())
    }
}
