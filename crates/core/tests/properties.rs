//! Properties that hold for every play model, and for every input.

#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::control_law::ControlLaw;
use hysteron_core::envelope::Envelope;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::{Mpi, MpiCoefficients};
use hysteron_core::mrpi::Mrpi;
use hysteron_core::pi_controller::PiController;
use hysteron_core::pi_model::Pi;
use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
use hysteron_core::thresholds::Thresholds;
use hysteron_core::wrpi::Wrpi;
use proptest::prelude::*;

const N: usize = 5;

fn thresholds(gaps: [f64; N]) -> [f64; N] {
    let mut sum = 0.0;
    gaps.map(|gap| {
        sum += gap;
        sum
    })
}

fn bank(gaps: [f64; N]) -> PlayBank<f64, N> {
    PlayBank::new(Thresholds::new(thresholds(gaps)).unwrap(), -10.0, 10.0, 50e3).unwrap()
}

fn run<M: Hysteresis<f64>>(model: &M, state: &mut M::State, inputs: &[f64]) -> Vec<f64> {
    inputs.iter().map(|&v| model.step(state, v)).collect()
}

fn gaps() -> impl Strategy<Value = [f64; N]> {
    prop::array::uniform5(0.05..0.5)
}

fn weights() -> impl Strategy<Value = [f64; N]> {
    prop::array::uniform5(0.0..1.0)
}

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 300,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(2),
        ..ProptestConfig::default()
    }
}

/// From one value to the next in 50 even steps, the start left out.
fn ramp(from: f64, to: f64) -> Vec<f64> {
    (1..=50).map(|k| from + (to - from) * f64::from(k) / 50.0).collect()
}

proptest! {
    #![proptest_config(config())]

    /// After a minor loop the major branch goes on as if it had not been.
    #[test]
    fn prop_return_point_memory(gaps in gaps(), weights in weights(), top in 1.0..3.0, depth in 0.1..0.9) {
        let model = Pi::new(bank(gaps), 0.1, 0.5, weights).unwrap();
        let mut state = PlayState::virgin();
        let _ = run(&model, &mut state, &ramp(0.0, top));
        let before = *state.outputs();
        let _ = run(&model, &mut state, &ramp(top, top * depth));
        let _ = run(&model, &mut state, &ramp(top * depth, top));
        for (a, b) in before.iter().zip(state.outputs()) {
            prop_assert!((a - b).abs() < 1e-12, "{before:?} {:?}", state.outputs());
        }
    }

    /// A larger swing wipes out what smaller ones inside it have left.
    #[test]
    fn prop_wiping_out(gaps in gaps(), weights in weights(), small in prop::collection::vec(-1.0..1.0, 1..8)) {
        let model = Pi::new(bank(gaps), 0.0, 0.5, weights).unwrap();
        // Swings beyond the largest threshold (2.5) after any inner history leave the same state.
        let (mut with, mut without) = (PlayState::virgin(), PlayState::virgin());
        let _ = run(&model, &mut with, &small);
        for state in [&mut with, &mut without] {
            let _ = run(&model, state, &[4.0, -4.0, 0.7]);
        }
        prop_assert_eq!(with.outputs(), without.outputs());
    }

    /// Minor loops between the same inputs have the same shape whatever the history: they differ by a constant.
    #[test]
    fn prop_congruency(gaps in gaps(), weights in weights(), low in -1.0..0.0, high in 0.1..1.0) {
        let model = Mpi::new(bank(gaps), MpiCoefficients { offset: 0.0, cubic: 0.05, linear: 0.5, weights }).unwrap();
        let minor = [ramp(low, high), ramp(high, low)].concat();
        let from = |start: f64| {
            let mut state = PlayState::virgin();
            // One turn to settle into the loop, then the loop.
            let _ = run(&model, &mut state, &[start, low, high, low]);
            run(&model, &mut state, &minor)
        };
        let (above, below) = (from(5.0), from(-5.0));
        let shift = above[0] - below[0];
        for (a, b) in above.iter().zip(&below) {
            prop_assert!((a - b - shift).abs() < 1e-12);
        }
    }

    /// Slowly enough, the rate-dependent model is the rate-independent one.
    #[test]
    fn prop_rate_to_zero_is_rate_independent(gaps in gaps(), weights in weights(), top in 0.5..3.0) {
        let coefficients = MpiCoefficients { offset: 0.0, cubic: 0.1, linear: 0.5, weights };
        let slow = PlayBank::new(Thresholds::new(thresholds(gaps)).unwrap(), -10.0, 10.0, 1e-3).unwrap();
        let envelope = Envelope { alpha_s: 3e-4, beta_s: 1e-4 };
        let (mrpi, mpi) = (Mrpi::new(slow, coefficients, envelope).unwrap(), Mpi::new(slow, coefficients).unwrap());
        let inputs = [ramp(0.0, top), ramp(top, 0.0), ramp(0.0, top / 2.0)].concat();
        let (mut a, mut b) = (PlayState::virgin(), PlayState::virgin());
        for (with, without) in run(&mrpi, &mut a, &inputs).iter().zip(run(&mpi, &mut b, &inputs)) {
            // alpha |v'| = 3e-4 s x (3 / 50) x 1e-3 Hz = 1.8e-8, times weights that sum to at most 5.
            prop_assert!((with - without).abs() < 1e-7);
        }
    }

    /// A direct inverse with Kuhnen's closed-form parameters undoes the model.
    ///
    /// For one-sided plays from the virgin state the initial loading curve is p_0 v + sum p_i max(v - r_i, 0); the
    /// inverse's thresholds and weights are those of its inverse function (Kuhnen 2003, eqs 33, 34).
    #[test]
    fn prop_inverse_after_model(gaps in gaps(), weights in weights(), linear in 0.2..1.0,
                                inputs in prop::collection::vec(0.0..4.0, 1..40)) {
        let r = thresholds(gaps);
        let mut inverse_thresholds = [0.0; N];
        let mut inverse_weights = [0.0; N];
        let mut slope = linear;
        for i in 0..N {
            let reached: f64 = (0..i).map(|j| weights[j] * (r[i] - r[j])).sum();
            inverse_thresholds[i] = linear * r[i] + reached;
            inverse_weights[i] = -weights[i] / (slope * (slope + weights[i]));
            slope += weights[i];
        }
        let model = Pi::new(bank(gaps), 0.0, linear, weights).unwrap();
        let wide = PlayBank::new(Thresholds::new(inverse_thresholds).unwrap(), -100.0, 100.0, 50e3).unwrap();
        let inverse = Pi::new(wide, 0.0, 1.0 / linear, inverse_weights).unwrap();
        let (mut a, mut b) = (PlayState::virgin(), PlayState::virgin());
        for &v in &inputs {
            let back = inverse.step(&mut b, model.step(&mut a, v));
            // Slopes to 6 and their inverses to 5 amplify rounding; 40 samples do not accumulate.
            prop_assert!((back - v).abs() < 1e-11, "{v} came back as {back}");
        }
    }

    /// No input makes NaN, and every output stays within the bound that the constructor has proven finite.
    #[test]
    fn prop_every_output_is_finite(inputs in prop::collection::vec(prop::num::f32::ANY, 1..60)) {
        let thresholds = Thresholds::new([0.0, 0.5, 1.0_f32]).unwrap();
        let bank = PlayBank::new(thresholds, -1e3_f32, 1e3, 50e3).unwrap();
        let c = MpiCoefficients { offset: 1.0, cubic: 0.3, linear: -2.0, weights: [1.0, -2.0, 3.0] };
        let pi = Pi::new(bank, 0.0, 1.0, [1.0; 3]).unwrap();
        let mpi = Mpi::new(bank, c).unwrap();
        let wrpi = Wrpi::new(bank, c, [1e-3; 3]).unwrap();
        let mrpi = Mrpi::new(bank, c, Envelope { alpha_s: 1e-3, beta_s: 1e-3 }).unwrap();
        let polynomial = PlayPolynomial::new(bank, PolynomialCoefficients {
            offset: 0.0, input_function: [1e-3; 5], linear: [1.0; 3], quadratic: [-1.0; 3], cubic: [0.5; 3],
        }).unwrap();
        let mut states = [PlayState::virgin(); 5];
        let law = ControlLaw {
            feedforward: mrpi,
            feedback: PiController::new(1.0_f32, 6000.0, 50e3).unwrap(),
            limiter: Limiter::new(0.0, 200.0, 1e5, 50e3).unwrap(),
        };
        let mut control = law.start(PlayState::virgin(), 0.0);
        let mut bad = false;
        for &v in &inputs {
            bad |= !v.is_finite();
            let [a, b, c, d, e] = &mut states;
            for output in [pi.step(a, v), mpi.step(b, v), wrpi.step(c, v), mrpi.step(d, v), polynomial.step(e, v)] {
                prop_assert!(output.is_finite(), "{v} gave {output}");
            }
            let before = control.limiter.last();
            for (reference, measured) in [(v, 1.0), (1.0, v), (v, v)] {
                let command = law.step(&mut control, reference, measured);
                prop_assert!((0.0..=200.0).contains(&command), "{v} gave {command}");
            }
            // Three steps of at most 2 V each, and a rounding of 200 V in f32.
            prop_assert!((control.limiter.last() - before).abs() <= 6.0 + 1e-4);
        }
        prop_assert_eq!(states[0].input_fault(), bad);
    }

    /// A state that is set is the state that was: splitting a run changes nothing.
    #[test]
    fn prop_state_carries_over(gaps in gaps(), weights in weights(), inputs in prop::collection::vec(-3.0..3.0, 2..40)) {
        let coefficients = MpiCoefficients { offset: 0.0, cubic: 0.1, linear: 0.5, weights };
        let model = Mrpi::new(bank(gaps), coefficients, Envelope { alpha_s: 1e-5, beta_s: 2e-5 }).unwrap();
        let mut whole = PlayState::virgin();
        let expected = run(&model, &mut whole, &inputs);
        let half = inputs.len() / 2;
        let mut first = PlayState::virgin();
        let _ = run(&model, &mut first, &inputs[..half]);
        let last = if half > 0 { inputs[half - 1] } else { 0.0 };
        let mut second = PlayState::from_outputs(*first.outputs(), last).unwrap();
        prop_assert_eq!(&run(&model, &mut second, &inputs[half..]), &expected[half..]);
    }
}
