//! Shorter ways through limiter, bank, PI controller and converter give what the plain formulas give, bit by bit but for the sign of zeros,
//! whatever comes.

use hysteron_core::bank::{LARGEST_INPUT, PlayBank, PlayState};
use hysteron_core::codes::{Converter, DacCode};
use hysteron_core::control_law::ControlLaw;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::Hysteresis;
use hysteron_core::pi_controller::PiController;
use hysteron_core::pi_model::Pi;
use hysteron_core::thresholds::Thresholds;
use proptest::prelude::*;

/// Numbers of the size in use, ends of ranges among them, and what no table has.
fn any_value() -> impl Strategy<Value = f32> {
    prop_oneof![
        8 => -30.0_f32..30.0,
        4 => prop::sample::select(vec![-20.0_f32, -10.0, -2.0, 0.0, 2.0, 10.0, 20.0]),
        1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e26, -1e26, -0.0]),
    ]
}

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(9),
        ..ProptestConfig::default()
    }
}

fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn prop_limiter(commands in prop::collection::vec(any_value(), 1..30), slew in 0.01_f32..40.0, start in any_value()) {
        let limiter = Limiter::new(-10.0_f32, 10.0, slew, 1.0).unwrap();
        let mut state = limiter.start_at(start);
        for command in commands {
            let last = state.last();
            let (lowest, highest) = (greater(-10.0, last - slew), smaller(10.0, last + slew));
            let wanted = if command.is_finite() { command } else { last };
            let allowed = smaller(greater(lowest, wanted), highest);
            prop_assert_eq!(limiter.step(&mut state, command), allowed);
            prop_assert_eq!((state.last(), state.limited()), (allowed, allowed != command));
        }
    }

    /// By what the plays make of it: with one of threshold 0 the output is the input as used.
    #[test]
    fn prop_inputs(inputs in prop::collection::vec(any_value(), 1..30)) {
        let bank = PlayBank::new(Thresholds::new([0.0_f32]).unwrap(), -2.0, 20.0, 50e3).unwrap();
        let model = Pi::new(bank, 0.0, 1.0, [0.0]).unwrap();
        let (mut state, mut last, mut fault) = (PlayState::virgin(), 0.0, false);
        for input in inputs {
            last = smaller(greater(-2.0, if input.is_finite() { input } else { last }), 20.0);
            fault |= !input.is_finite();
            prop_assert_eq!(model.step(&mut state, input), last);
            prop_assert_eq!((state.outputs()[0], state.input_fault()), (last, fault));
        }
        prop_assert!(f64::from(last) <= LARGEST_INPUT);
    }

    /// Eq. 14 behind limits, against the integral as far as the limits leave it: never beyond its step, never against the error.
    #[test]
    fn prop_law(steps in prop::collection::vec((any_value(), any_value(), any_value()), 1..30), p in 0.0_f32..3.0, i in 0.0_f32..3.0, slew in 0.01_f32..40.0) {
        let law = ControlLaw {
            feedforward: None::<Pi<f32, 1>>,
            feedback: PiController::new(p, i, 1.0).unwrap(),
            limiter: Limiter::new(-10.0_f32, 10.0, slew, 1.0).unwrap(),
        };
        let mut state = law.start(PlayState::virgin(), 0.0);
        let (mut integral, mut last) = (0.0_f32, 0.0_f32);
        for (feedforward, reference, measured) in steps {
            let asked = |error: f32| (p * error + (integral + i * error), integral + i * error);
            let (output, to) = asked(reference - measured);
            let usable = (feedforward + output).is_finite();
            let (output, to) = if usable { (output, to) } else { asked(0.0) };
            let wanted = feedforward + output;
            let (lowest, highest) = (greater(-10.0, last - slew), smaller(10.0, last + slew));
            let allowed = if wanted.is_finite() { smaller(greater(lowest, wanted), highest) } else { last };
            let reached = to + (allowed - wanted);
            integral = if reached.is_nan() { integral } else { smaller(greater(reached, smaller(integral, to)), greater(integral, to)) };
            last = allowed;
            prop_assert_eq!(law.step_feedback(&mut state, feedforward, reference, measured), allowed);
            prop_assert_eq!(state.feedback.integral(), integral);
        }
    }

    #[test]
    fn prop_codes(volts in any_value()) {
        let converter = Converter::new(-10.0_f32, 10.0).unwrap();
        let codes = (volts + 10.0) * (65_535.0 / 20.0) + 0.5;
        prop_assert_eq!(converter.code(volts), DacCode(codes as u16));
    }
}
