//! What the models refuse, with the exact message, and states that a bank did not make.

#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::error::ParamError;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::{Mpi, MpiCoefficients};
use hysteron_core::mrpi::Mrpi;
use hysteron_core::pi_model::Pi;
use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
use hysteron_core::thresholds::Thresholds;
use hysteron_core::wrpi::Wrpi;

fn bank(limit: f32) -> PlayBank<f32, 2> {
    PlayBank::new(Thresholds::new([0.0, 1.0]).unwrap(), -limit, limit, 50e3).unwrap()
}

const GOOD: MpiCoefficients<f32, 2> = MpiCoefficients {
    offset: 0.0,
    cubic: 0.1,
    linear: 1.0,
    weights: [0.5, 0.25],
};

const POLYNOMIAL: PolynomialCoefficients<f32, 2> = PolynomialCoefficients {
    offset: 0.0,
    input_function: [1.0, 0.0, 0.0, 0.0, 0.0],
    linear: [1.0; 2],
    quadratic: [0.0; 2],
    cubic: [0.0; 2],
};

fn says<M>(built: Result<M, ParamError>, message: &str) {
    let Err(refused) = built else {
        panic!("accepted, but should say: {message}");
    };
    assert_eq!(refused.to_string(), message);
}

#[test]
fn refuse_coefficients_that_are_not_finite() {
    let nan = f32::NAN;
    says(Pi::new(bank(10.0), nan, 1.0, [0.0; 2]), "offset = NaN must be finite");
    says(
        Pi::new(bank(10.0), 0.0, 1.0, [0.0, f32::INFINITY]),
        "weight[2] = inf must be finite",
    );
    says(
        Mpi::new(bank(10.0), MpiCoefficients { cubic: nan, ..GOOD }),
        "cubic = NaN must be finite",
    );
    says(
        Mpi::new(
            bank(10.0),
            MpiCoefficients {
                weights: [nan, 0.0],
                ..GOOD
            },
        ),
        "weight[1] = NaN must be finite",
    );
    says(
        Wrpi::new(bank(10.0), GOOD, [0.0, nan]),
        "rate_weight[2] = NaN must be finite",
    );
    let quadratic = [0.0, f32::NEG_INFINITY];
    says(
        PlayPolynomial::new(
            bank(10.0),
            PolynomialCoefficients {
                quadratic,
                ..POLYNOMIAL
            },
        ),
        "quadratic[2] = -inf must be finite",
    );
}

#[test]
fn refuse_envelopes() {
    let with = |alpha_s, beta_s| Mrpi::new(bank(10.0), GOOD, Envelope { alpha_s, beta_s });
    says(with(-1e-3, 0.0), "alpha_s = -0.001 must lie in 0 to 1");
    says(with(0.0, 3.0), "beta_s = 3 must lie in 0 to 1");
    says(with(f32::NAN, 0.0), "alpha_s = NaN must lie in 0 to 1");
}

/// Finite coefficients whose output is not, over the range: alone, and as the sum of a static and a dynamic part.
#[test]
fn refuse_outputs_that_the_number_type_cannot_hold() {
    let message = "output is not finite over inputs up to 10; narrow the input range or check the coefficients' units";
    says(Pi::new(bank(10.0), 0.0, 3e38, [0.0; 2]), message);
    says(Mpi::new(bank(10.0), MpiCoefficients { cubic: 1e36, ..GOOD }), message);
    let cubic = [1e36; 2];
    says(
        PlayPolynomial::new(bank(10.0), PolynomialCoefficients { cubic, ..POLYNOMIAL }),
        message,
    );
    // Each below 1.7e38, half of what f32 holds, their sum above: offset 1.5e38, and l = 1e21 times 11 times 5e13 a second.
    let offset = MpiCoefficients { offset: 1.5e38, ..GOOD };
    assert!(Wrpi::new(bank(10.0), offset, [0.0; 2]).is_ok());
    assert!(Wrpi::new(bank(10.0), GOOD, [1e23, 0.0]).is_ok());
    says(Wrpi::new(bank(10.0), offset, [1e23, 0.0]), message);
}

/// Tables are swapped while the loop runs: the state then comes from another bank, and has to be borne.
#[test]
fn regress_a_state_from_another_bank_gives_finite_outputs() {
    let outputs = [f32::MAX, f32::MIN];
    for last in [0.0, 1e9, -1e9] {
        let state = || PlayState::from_outputs(outputs, last).unwrap();
        let envelope = Envelope {
            alpha_s: 1.0,
            beta_s: 1.0,
        };
        let (wrpi, mrpi) = (
            Wrpi::new(bank(10.0), GOOD, [1e3; 2]).unwrap(),
            Mrpi::new(bank(10.0), GOOD, envelope).unwrap(),
        );
        let (mut a, mut b) = (state(), state());
        for input in [1.0, -10.0, f32::NAN, 10.0] {
            assert!(wrpi.step(&mut a, input).is_finite());
            assert!(mrpi.step(&mut b, input).is_finite());
        }
    }
}

/// The largest output that a constructor lets through is one that a step can make and hold.
#[test]
fn val_the_bound_is_reached_and_held() {
    let mpi = Mpi::new(
        bank(10.0),
        MpiCoefficients {
            offset: 0.0,
            cubic: 0.0,
            linear: 1.6e37,
            weights: [0.0; 2],
        },
    )
    .unwrap();
    assert_eq!(mpi.step(&mut PlayState::virgin(), f32::MAX), 1.6e38);
}
