//! A table's inverse as the core runs it, on the host.

use crate::{Family, Table};
use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::error::ParamError;
use hysteron_core::model::{AtRest, Hysteresis};
use hysteron_core::mpi::{Mpi, MpiCoefficients};
use hysteron_core::mrpi::Mrpi;
use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
use hysteron_core::thresholds::Thresholds;
use hysteron_core::wrpi::Wrpi;

/// The core's type of a table's family, in `f32` as on the chip, which has the type itself and no choice to make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Inverse<const N: usize> {
    /// PI and MPI.
    Mpi(Mpi<f32, N>),
    /// WRPI.
    Wrpi(Wrpi<f32, N>),
    /// MRPI.
    Mrpi(Mrpi<f32, N>),
    /// Play-polynomial.
    PlayPolynomial(PlayPolynomial<f32, N>),
}

impl<const N: usize> Hysteresis<f32> for Inverse<N> {
    type State = PlayState<f32, N>;

    fn step(&self, state: &mut Self::State, input: f32) -> f32 {
        match self {
            Self::Mpi(model) => model.step(state, input),
            Self::Wrpi(model) => model.step(state, input),
            Self::Mrpi(model) => model.step(state, input),
            Self::PlayPolynomial(model) => model.step(state, input),
        }
    }
}

impl Table {
    /// The thresholds; those behind the table's are each the next number that `f32` has.
    fn thresholds<const N: usize>(&self) -> [f32; N] {
        let mut last = 0.0_f32;
        core::array::from_fn(|i| {
            last = self.thresholds_um.get(i).map_or(last.next_up(), |&value| value as f32);
            last
        })
    }

    /// The bank of plays and the inverse; `at_rest` without everything that depends on the rate.
    ///
    /// Where the table has fewer than N plays, those behind weigh nothing.
    ///
    /// # Errors
    /// What the core's constructors refuse in `f32`.
    pub fn inverse<const N: usize>(&self, at_rest: bool) -> Result<(PlayBank<f32, N>, Inverse<N>), ParamError> {
        let list = |values: &[f64]| core::array::from_fn::<f32, N, _>(|i| values.get(i).map_or(0.0, |&v| v as f32));
        let share = if at_rest { 0.0 } else { 1.0 };
        let bank = PlayBank::new(
            Thresholds::new(self.thresholds())?,
            self.input_min_um as f32,
            self.input_max_um as f32,
            self.sample_rate_hz as f32,
        )?;
        let coefficients = MpiCoefficients {
            offset: self.offset_v as f32,
            cubic: self.cubic_v_per_um3 as f32,
            linear: self.linear_v_per_um as f32,
            weights: list(&self.weights_v_per_um),
        };
        let inverse = match self.family {
            Family::Pi | Family::Mpi => Inverse::Mpi(Mpi::new(bank, coefficients)?),
            Family::Wrpi => {
                let rate_weights = list(&self.rate_weights_v_s_per_um2).map(|weight| weight * share);
                Inverse::Wrpi(Wrpi::new(bank, coefficients, rate_weights)?)
            }
            Family::Mrpi => {
                let envelope = Envelope {
                    alpha_s: self.alpha_s as f32 * share,
                    beta_s: self.beta_s as f32 * share,
                };
                Inverse::Mrpi(Mrpi::new(bank, coefficients, envelope)?)
            }
            Family::PlayPolynomial => Inverse::PlayPolynomial(PlayPolynomial::new(
                bank,
                PolynomialCoefficients {
                    offset: self.offset_v as f32,
                    input_function: [
                        self.linear_v_per_um as f32,
                        self.quadratic_v_per_um2 as f32,
                        self.cubic_v_per_um3 as f32,
                        self.quartic_v_per_um4 as f32,
                        self.quintic_v_per_um5 as f32,
                    ],
                    linear: list(&self.weights_v_per_um),
                    quadratic: list(&self.weights_quadratic_v_per_um2),
                    cubic: list(&self.weights_cubic_v_per_um3),
                },
            )?),
        };
        Ok((bank, inverse))
    }
}

impl<const N: usize> AtRest<f32> for Inverse<N> {
    fn at_rest(&self, output: f32, last_input: f32) -> PlayState<f32, N> {
        match self {
            Self::Mpi(model) => model.at_rest(output, last_input),
            Self::Wrpi(model) => model.at_rest(output, last_input),
            Self::Mrpi(model) => model.at_rest(output, last_input),
            Self::PlayPolynomial(model) => model.at_rest(output, last_input),
        }
    }
}
