//! A fitted model as the core runs it: tables of fixed size, validated, with a state of its own.

use crate::error::IdentifyError;
use crate::family::Family;
use crate::model::Model;
use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::{Mpi, MpiCoefficients};
use hysteron_core::mrpi::Mrpi;
use hysteron_core::pi_model::Pi;
use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
use hysteron_core::real::Real;
use hysteron_core::thresholds::Thresholds;
use hysteron_core::wrpi::Wrpi;

/// A fitted model with N plays as the core runs it, in `f32` as on the chip or in `f64`.
///
/// # Example
/// ```
/// # fn show(model: &hysteron_identify::Model) -> Result<(), hysteron_identify::IdentifyError> {
/// use hysteron_core::model::Hysteresis;
/// let table = model.to_core::<f32, 10>(0.0, 2.6, 50e3)?;
/// let mut state = table.start_at(0.0, 0.0);
/// let voltage_v = table.step(&mut state, 1.3);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoreModel<T, const N: usize> {
    bank: PlayBank<T, N>,
    table: Table<T, N>,
}

/// The core's type of each family.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Table<T, const N: usize> {
    Pi(Pi<T, N>),
    Mpi(Mpi<T, N>),
    Wrpi(Wrpi<T, N>),
    Mrpi(Mrpi<T, N>),
    PlayPolynomial(PlayPolynomial<T, N>),
}

impl Model {
    /// The model as the core runs it at one sample rate, its input kept within `input_min..=input_max`.
    ///
    /// # Units
    /// Limits in the model's input unit.
    /// # Errors
    /// - Effects around the hysteresis: the table does not have them, and leaving them out would not be this model.
    /// - Another number of plays than N.
    /// - What the core refuses: limits that do not ascend, coefficients that the number type cannot hold.
    pub fn to_core<T: Real, const N: usize>(
        &self,
        input_min: f64,
        input_max: f64,
        sample_rate_hz: f64,
    ) -> Result<CoreModel<T, N>, IdentifyError> {
        if !self.effects.is_empty() {
            let names: Vec<&str> = self.effects.iter().map(|effect| effect.name.as_str()).collect();
            return Err(IdentifyError::CoreEffects {
                effects: names.join(", "),
            });
        }
        let number = T::from_f64;
        let powers = self.family.input_powers().len();
        let columns = 1 + powers + N * self.family.coefficients_a_play();
        if self.thresholds.len() != N || self.coefficients.len() != columns {
            return Err(IdentifyError::CorePlays {
                plays: self.thresholds.len(),
                wanted: N,
            });
        }
        let of_plays = &self.coefficients[1 + powers..];
        let list = |block: usize| -> [T; N] { core::array::from_fn(|i| number(of_plays[block * N + i])) };
        let g = &self.coefficients[1..=powers];
        let thresholds = Thresholds::new(core::array::from_fn(|i| number(self.thresholds[i])))?;
        let bank = PlayBank::new(thresholds, number(input_min), number(input_max), number(sample_rate_hz))?;
        let offset = number(self.coefficients[0]);
        let coefficients = MpiCoefficients {
            offset,
            cubic: number(g.get(1).copied().unwrap_or(0.0)),
            linear: number(g[0]),
            weights: list(0),
        };
        let table = match self.family {
            Family::Pi => Table::Pi(Pi::new(bank, offset, coefficients.linear, coefficients.weights)?),
            Family::Mpi => Table::Mpi(Mpi::new(bank, coefficients)?),
            Family::Wrpi => Table::Wrpi(Wrpi::new(bank, coefficients, list(1))?),
            Family::Mrpi => {
                let envelope = self.envelope.unwrap_or(Envelope {
                    alpha_s: 0.0,
                    beta_s: 0.0,
                });
                let envelope = Envelope {
                    alpha_s: number(envelope.alpha_s),
                    beta_s: number(envelope.beta_s),
                };
                Table::Mrpi(Mrpi::new(bank, coefficients, envelope)?)
            }
            Family::Duhem => return Err(IdentifyError::ForwardOnly { family: self.family }),
            Family::PlayPolynomial => {
                let coefficients = PolynomialCoefficients {
                    offset,
                    input_function: core::array::from_fn(|i| number(g[i])),
                    linear: list(0),
                    quadratic: list(1),
                    cubic: list(2),
                };
                Table::PlayPolynomial(PlayPolynomial::new(bank, coefficients)?)
            }
        };
        Ok(CoreModel { bank, table })
    }
}

impl<T: Real, const N: usize> CoreModel<T, N> {
    /// The state of the plays at rest at `input`, `fraction` of each threshold below it: 0 after coming down from above
    /// (and for the virgin start at zero), 1 after coming up from below.
    pub fn start_at(&self, input: T, fraction: T) -> PlayState<T, N> {
        PlayState::remanent(&self.bank, input, fraction)
    }
}

impl<T: Real, const N: usize> Hysteresis<T> for CoreModel<T, N> {
    type State = PlayState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut PlayState<T, N>, input: T) -> T {
        match &self.table {
            Table::Pi(model) => model.step(state, input),
            Table::Mpi(model) => model.step(state, input),
            Table::Wrpi(model) => model.step(state, input),
            Table::Mrpi(model) => model.step(state, input),
            Table::PlayPolynomial(model) => model.step(state, input),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::Direction;
    use crate::fit::{FitOptions, fit};
    use crate::start_state::InitialState;
    use hysteron_data::{Dataset, Record, Role};
    use std::f64::consts::TAU;

    /// One triangle-like loop, bent and lagging, to fit something to.
    fn dataset() -> Dataset {
        let voltage_v: Vec<f64> = (0..2000)
            .map(|k| 13.0 - 13.0 * (TAU * f64::from(k) / 500.0).cos())
            .collect();
        let position_um = (0..2000)
            .map(|k| {
                let x = 1.0 - (TAU * f64::from(k) / 500.0 - 0.2).cos();
                1.3 * x + 0.05 * x * x
            })
            .collect();
        let record = Record::new("loop.csv", Role::Identify, 20e-6, voltage_v, position_um);
        Dataset {
            records: vec![record],
            ..Dataset::default()
        }
    }

    /// The table and the free simulation of the fit are the same arithmetic: 1e-9 of some 26 V leaves room for the order
    /// of sums alone.
    #[test]
    fn val_the_table_gives_what_the_fit_gave() {
        let dataset = dataset();
        for family in Family::ALL.into_iter().filter(|family| *family != Family::Duhem) {
            let options = FitOptions {
                direction: Direction::Inverse,
                plays: 10,
                ..FitOptions::new(family)
            };
            let model = fit(&dataset, &options, &|_| ()).unwrap().model;
            let input = &dataset.records[0].position_um;
            let wanted = model.simulate_input(input, 20e-6, InitialState::REST).unwrap();
            let table = model
                .to_core::<f64, 10>(model.input_min, model.input_max, 50e3)
                .unwrap();
            let mut state = table.start_at(input[0], 0.0);
            for (k, (&y, wanted)) in input.iter().zip(wanted).enumerate() {
                let found = table.step(&mut state, y);
                assert!((found - wanted).abs() < 1e-9, "{family}, sample {k}: {found} {wanted}");
            }
        }
    }

    #[test]
    fn refuse_another_number_of_plays() {
        let model = fit(&dataset(), &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
        let refused = model.to_core::<f32, 12>(0.0, 26.0, 50e3).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "the model has 10 plays, the control table has 12; fit with 12 plays"
        );
        assert!(model.to_core::<f32, 10>(26.0, 0.0, 50e3).is_err());
    }

    /// A table that left the delay out would not be the model.
    #[test]
    fn refuse_to_leave_effects_out() {
        let dataset = dataset();
        let model = fit(&dataset, &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
        let with = |id: crate::EffectId| {
            let adding = crate::Adding {
                noise_um: 1e-3,
                keep_family: true,
            };
            crate::add(&dataset, &model, &crate::effects::find(id), adding, &|_| ())
                .unwrap()
                .model
        };
        let delayed = with(crate::EffectId::Delay);
        let refused = delayed.to_core::<f64, 10>(0.0, 26.0, 50e3).unwrap_err().to_string();
        assert!(refused.contains("the model has delay around it"), "{refused}");

        let input = &dataset.records[0].voltage_v;
        let start = InitialState::Periodic { samples: 500 };
        let alone = delayed.simulate_input(input, 20e-6, start).unwrap();
        let record = delayed.simulate(&dataset.records[0]);
        assert_eq!(record.initial, start);
        assert_eq!(alone, record.output);
        let hummed = with(crate::EffectId::MainsHum);
        let refused = hummed.simulate_input(input, 20e-6, start).unwrap_err().to_string();
        assert!(refused.contains("`mains-hum` needs more than a voltage"), "{refused}");
    }
}
