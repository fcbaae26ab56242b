//! A table's inverse as the core runs it, on the host.

use crate::{Family, Numbers};
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

    /// Inlined: where the family is known, the others are left out.
    #[inline(always)]
    fn step(&self, state: &mut Self::State, input: f32) -> f32 {
        match self {
            Self::Mpi(model) => model.step(state, input),
            Self::Wrpi(model) => model.step(state, input),
            Self::Mrpi(model) => model.step(state, input),
            Self::PlayPolynomial(model) => model.step(state, input),
        }
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

impl<const N: usize> Numbers<N> {
    /// The thresholds; those behind the table's are each the next number that `f32` has.
    fn thresholds(&self) -> [f32; N] {
        let mut last = 0.0_f32;
        let mut place = 0;
        self.thresholds_um.map(|value| {
            last = if place < self.plays {
                value as f32
            } else {
                last.next_up()
            };
            place += 1;
            last
        })
    }

    /// The bank of plays over the table's range.
    ///
    /// # Errors
    /// What the core's constructors refuse in `f32`.
    #[cold]
    pub fn bank(&self) -> Result<PlayBank<f32, N>, ParamError> {
        self.bank_over([self.input_min_um, self.input_max_um])
    }

    fn bank_over(&self, range_um: [f64; 2]) -> Result<PlayBank<f32, N>, ParamError> {
        let [low, high] = range_um.map(|um| um as f32);
        PlayBank::new(
            Thresholds::new(self.thresholds())?,
            low,
            high,
            self.sample_rate_hz as f32,
        )
    }

    /// Coefficients of PI, MPI, WRPI and MRPI.
    #[cold]
    pub fn coefficients(&self) -> MpiCoefficients<f32, N> {
        let [linear, _, cubic, ..] = self.input_function;
        MpiCoefficients {
            offset: self.offset_v as f32,
            cubic: cubic as f32,
            linear: linear as f32,
            weights: single(&self.weights_v_per_um),
        }
    }

    /// Weights of WRPI's plays times the rate.
    pub fn rate_weights(&self) -> [f32; N] {
        single(&self.rate_weights_v_s_per_um2)
    }

    /// Envelope of MRPI.
    pub fn envelope(&self) -> Envelope<f32> {
        Envelope {
            alpha_s: self.alpha_s as f32,
            beta_s: self.beta_s as f32,
        }
    }

    /// Coefficients of the play-polynomial.
    #[cold]
    pub fn polynomial(&self) -> PolynomialCoefficients<f32, N> {
        PolynomialCoefficients {
            offset: self.offset_v as f32,
            input_function: self.input_function.map(|value| value as f32),
            linear: single(&self.weights_v_per_um),
            quadratic: single(&self.weights_quadratic_v_per_um2),
            cubic: single(&self.weights_cubic_v_per_um3),
        }
    }

    /// The bank of plays and the inverse; `at_rest` without everything that depends on the rate.
    ///
    /// Where the table has fewer than N plays, those behind weigh nothing.
    ///
    /// # Errors
    /// What the core's constructors refuse in `f32`.
    pub fn inverse(&self, at_rest: bool) -> Result<(PlayBank<f32, N>, Inverse<N>), ParamError> {
        self.inverse_over(self.family, [self.input_min_um, self.input_max_um], at_rest)
    }

    /// The same over another range, of a family that is known to be the table's.
    #[inline(always)]
    pub(crate) fn inverse_over(
        &self,
        family: Family,
        range_um: [f64; 2],
        at_rest: bool,
    ) -> Result<(PlayBank<f32, N>, Inverse<N>), ParamError> {
        let share = if at_rest { 0.0 } else { 1.0 };
        let bank = self.bank_over(range_um)?;
        let inverse = match family {
            Family::Pi | Family::Mpi => Inverse::Mpi(Mpi::new(bank, self.coefficients())?),
            Family::Wrpi => {
                let rate_weights = self.rate_weights().map(|weight| weight * share);
                Inverse::Wrpi(Wrpi::new(bank, self.coefficients(), rate_weights)?)
            }
            Family::Mrpi => {
                let Envelope { alpha_s, beta_s } = self.envelope();
                let envelope = Envelope {
                    alpha_s: alpha_s * share,
                    beta_s: beta_s * share,
                };
                Inverse::Mrpi(Mrpi::new(bank, self.coefficients(), envelope)?)
            }
            Family::PlayPolynomial => Inverse::PlayPolynomial(PlayPolynomial::new(bank, self.polynomial())?),
        };
        Ok((bank, inverse))
    }
}

fn single<const N: usize>(values: &[f64; N]) -> [f32; N] {
    values.map(|value| value as f32)
}
