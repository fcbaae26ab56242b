//! The modified rate-dependent model by corners: for many plays.

use crate::bank::PlayBank;
use crate::corners::{CornerState, Corners, Sums};
use crate::envelope::Envelope;
use crate::error::ParamError;
use crate::model::{AtRest, Hysteresis};
use crate::mpi::MpiCoefficients;
use crate::mrpi::Mrpi;
use crate::real::Real;

/// `sum q_j` and `sum q_j r_j` over the first plays.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Linear<T> {
    weight: T,
    moment: T,
}

impl<T: Real> Sums<T> for Linear<T> {
    #[inline(always)]
    fn at(&self, left: bool, value: T) -> T {
        let sum = value * self.weight;
        if left { sum - self.moment } else { sum }
    }
}

/// [`crate::mrpi::Mrpi`] computed from the corners of its input: the same play outputs, bit by bit; the same sum but for rounding.
///
/// A sample that moves the first k plays from a corner `v_c` to `v` changes the sum by `(v - v_c) sum q_j` over those k, and from the
/// right side to the left by `-sum q_j r_j` besides.
///
/// # Cost
/// In instructions of a Cortex-M4F: about 80 a sample, 20 for each corner that it wipes out, 10 log2 N where it jumps into a segment.
/// [`crate::quick_mrpi::QuickMrpi`] takes 8 to 18 for each play that moves: above about 26 plays this is faster in the worst case.
/// # Errors
/// As of [`crate::corners`]: it does not drift (`val_ten_million_samples_do_not_drift`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerMrpi<T, const N: usize> {
    corners: Corners<T, Linear<T>, N>,
    /// Of changes from sample to sample.
    envelope: Envelope<T>,
    offset: T,
    cubic: T,
    linear: T,
}

impl<T: Real, const N: usize> CornerMrpi<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// As [`Mrpi::new`].
    pub fn new(
        bank: PlayBank<T, N>,
        coefficients: MpiCoefficients<T, N>,
        envelope: Envelope<T>,
    ) -> Result<Self, ParamError> {
        Mrpi::new(bank, coefficients, envelope)?;
        let rate_hz = bank.sample_rate_hz();
        let MpiCoefficients {
            offset,
            cubic,
            linear,
            weights,
        } = coefficients;
        let thresholds = *bank.thresholds().values();
        let (mut weight, mut moment) = (0.0, 0.0);
        let corners = Corners::new(bank, |i| {
            // Rounded once, whatever the number of plays.
            weight += weights[i].to_f64();
            moment += weights[i].to_f64() * thresholds[i].to_f64();
            Linear {
                weight: T::from_f64(weight),
                moment: T::from_f64(moment),
            }
        });
        Ok(Self {
            corners,
            envelope: envelope.a_sample(rate_hz),
            offset,
            cubic,
            linear,
        })
    }

    /// For each play the sums up to it of the weights, and of the weights times the thresholds.
    pub fn sums(&self) -> [[T; 2]; N] {
        self.corners.sums().map(|sum| [sum.weight, sum.moment])
    }

    /// Alpha and beta times the sample rate.
    pub fn envelope_a_sample(&self) -> [T; 2] {
        [self.envelope.alpha_s, self.envelope.beta_s]
    }

    /// The plays' outputs, for comparison: O(N).
    pub fn outputs(&self, state: &CornerState<T, N>) -> [T; N] {
        self.corners.outputs(state)
    }
}

impl<T: Real, const N: usize> Hysteresis<T> for CornerMrpi<T, N> {
    type State = CornerState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut CornerState<T, N>, input: T) -> T {
        let (input, change) = self.corners.bank.admit_next(&mut state.input, input);
        let (left, right) = self.envelope.bounds(input, change);
        let sum = self.corners.step(state, left, right);
        self.offset + ((self.cubic * input * input + self.linear) * input + sum)
    }
}

impl<T: Real, const N: usize> AtRest<T> for CornerMrpi<T, N> {
    fn at_rest(&self, output: T, last_input: T) -> CornerState<T, N> {
        self.corners.at_rest(output, self.corners.bank.input_at(last_input))
    }
}
