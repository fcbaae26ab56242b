//! Elements that fade along the path of the voltage: their equation by hand, and what their inverse gives back.

use hysteron_core::bank::PlayBank;
use hysteron_core::corner_polynomial::CornerPolynomial;
use hysteron_core::either_inverse::EitherInverse;
use hysteron_core::fading::{FadingInverse, FadingModel, FadingNumbers, FadingState};
use hysteron_core::model::{DirectInverse, Hysteresis};
use hysteron_core::play_polynomial::PolynomialCoefficients;
use hysteron_core::thresholds::Thresholds;
use hysteron_core::tracking_law::PLAYS;
use proptest::prelude::*;

/// One element of length 1 V about a straight line, from -1 to 1 V: `dz = |dv| (v - z)`, beside the voltage.
const ONE: FadingNumbers<1> = FadingNumbers {
    min_v: -1.0,
    max_v: 1.0,
    offset: 0.25,
    input_function: [1.0, 0.0, 0.0],
    lengths_v: [1.0],
    curves: [[1.0, 0.0, 0.0]],
    rest: [-0.2],
};

/// A stage of 100 V and 15 um with memories of 20 and 60 V.
const TWO: FadingNumbers<2> = FadingNumbers {
    min_v: -5.0,
    max_v: 105.0,
    offset: 7.0,
    input_function: [5.0, 0.2, -0.1],
    lengths_v: [20.0, 60.0],
    curves: [[1.0, 0.1, 0.0], [2.0, -0.2, 0.15]],
    rest: [0.0; 2],
};

/// The cycled loop by hand: on the way up `z = v - 1 + C e^-(v + 1)`, and `z(1) = -z(-1)`.
#[test]
fn val_a_cycled_loop_by_hand() {
    let model = FadingModel::<f64, 1>::new(&ONE).unwrap();
    let end = (-2.0_f64).exp();
    let low = -2.0 * end / (1.0 + end);
    let up = |v: f64| v - 1.0 + (low + 2.0) * (-(v + 1.0)).exp();
    for v in [-1.0, -0.4, 0.3, 1.0] {
        for rising in [true, false] {
            let z = if rising { up(v) } else { -up(-v) };
            let mut state = model.cycled(v, rising);
            let found = model.step(&mut state, v);
            assert!((found - (0.25 + v + z)).abs() < 1e-7, "{v} {rising}: {found} {z}");
        }
    }
}

/// Steps from a state by hand: `z = v - 1 + (z_0 - v_0 + 1) e^-(v - v_0)` up, `z = v + 1 + (z_0 - v_0 - 1) e^-(v_0 - v)` down.
#[test]
fn val_steps_by_hand() {
    let model = FadingModel::<f64, 1>::new(&ONE).unwrap();
    let mut state = model.cycled(0.0, true);
    let (mut v, mut z) = (0.0_f64, model.step(&mut state, 0.0) - 0.25);
    for to in [0.1, 0.35, 0.2, 0.2, -0.1] {
        let way: f64 = to - v;
        z = to - way.signum() + (z - v + way.signum()) * (-way.abs()).exp();
        v = to;
        let found = model.step(&mut state, to);
        assert!((found - (0.25 + to + z)).abs() < 1e-6, "{to}: {found} {z}");
    }
}

/// From rest at 0 V with -0.2: `z = v - 1 + 0.8 e^-v` up, and the inverse begins there as well.
#[test]
fn val_rest_by_hand() {
    let inverse = FadingInverse::new(FadingModel::<f64, 1>::new(&ONE).unwrap()).unwrap();
    let mut state = inverse.rest();
    assert!((state.output() - (0.25 - 0.2)).abs() < 1e-12);
    for k in 1..=10 {
        let v = 0.05 * f64::from(k);
        let found = inverse.step(&mut state, 0.25 + v + (v - 1.0 + 0.8 * (-v).exp()));
        assert!((found - v).abs() < 1e-6, "{v}: {found}");
    }
}

/// A sine of 1 kHz over the range at 50 kHz, and its 500 Hz: what is wanted is met to 1e-4 and 1e-5 of the range.
#[test]
fn val_a_fast_sine_is_met() {
    let model = FadingModel::<f64, 2>::new(&TWO).unwrap();
    let inverse = FadingInverse::new(model).unwrap();
    for (samples, most) in [(50, 1e-4), (100, 1e-5)] {
        let (mut own, mut stage) = (model.cycled(0.0, false), model.cycled(0.0, false));
        let rest = model.step(&mut stage, 0.0);
        let top = model.step(&mut model.cycled(100.0, true), 100.0);
        for k in 0..400 {
            let share = 0.5 - 0.5 * (std::f64::consts::TAU * f64::from(k) / f64::from(samples)).cos();
            let wanted = rest + 0.95 * (top - rest) * share;
            let found = model.step(&mut stage, inverse.step(&mut own, wanted));
            assert!(
                (found - wanted).abs() < most * (top - rest),
                "{samples} {k}: {found} {wanted}"
            );
        }
    }
}

/// The chip's numbers along the same way: 1e-5 of the range apart at most, after a hundred thousand samples as after the first.
#[test]
fn val_single_precision_does_not_drift() {
    let (double, single) = (
        FadingInverse::new(FadingModel::<f64, 2>::new(&TWO).unwrap()).unwrap(),
        FadingInverse::new(FadingModel::<f32, 2>::new(&TWO).unwrap()).unwrap(),
    );
    let mut of_double: FadingState<f64, 2> = double.model().cycled(0.0, false);
    let mut of_single: FadingState<f32, 2> = single.model().cycled(0.0, false);
    let mut largest = 0.0_f64;
    for k in 0..100_000 {
        let phase = f64::from(k) * 0.03;
        let wanted = 6.0 - 3.0 * phase.cos() - 2.0 * (0.37 * phase).sin();
        let (exact, found) = (
            double.step(&mut of_double, wanted),
            single.step(&mut of_single, wanted as f32),
        );
        largest = largest.max((exact - f64::from(found)).abs());
    }
    assert!(largest < 1e-5 * 110.0, "{largest} V");
    assert!(largest > 0.0);
}

/// What is no number, or beyond the range: the voltage stays, or goes to the end, and nothing is remembered of it.
#[test]
fn bva_steps_are_total() {
    let inverse = FadingInverse::new(FadingModel::<f32, 2>::new(&TWO).unwrap()).unwrap();
    let mut state = inverse.model().cycled(20.0, true);
    let at = inverse.step(&mut state, 5.0);
    for none in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!((inverse.step(&mut state, none) - at).abs() < 1e-3);
    }
    assert_eq!(inverse.step(&mut state, f32::MAX.sqrt()), 105.0);
    assert_eq!(inverse.step(&mut state, -f32::MAX.sqrt()), -5.0);
    let mut forward = state;
    let low = inverse.model().step(&mut forward, -1e30);
    assert_eq!(low, inverse.model().step(&mut forward, f32::NAN));
}

#[test]
fn refuse_what_has_no_inverse() {
    let built = |numbers: FadingNumbers<1>| FadingModel::<f64, 1>::new(&numbers).and_then(FadingInverse::new);
    let says = |numbers: FadingNumbers<1>| built(numbers).unwrap_err().to_string();
    assert!(built(ONE).is_ok());
    // After a turn at the top the loop's element goes on upwards, by 0.76 of each volt down.
    let falls = FadingNumbers {
        input_function: [0.1, 0.0, 0.0],
        ..ONE
    };
    assert!(
        says(falls).starts_with("smallest slope over the mean one = -"),
        "{}",
        says(falls)
    );
    assert!(says(falls).ends_with("must be finite and at least 0.1"));
    let of_length = |length_v: f64| FadingNumbers {
        lengths_v: [length_v],
        ..ONE
    };
    assert_eq!(says(of_length(4.5)), "length[1] = 4.5 must lie in 0.015625 to 4");
    assert!(says(of_length(f64::NAN)).starts_with("length[1] = NaN must lie in"));
    let nowhere = FadingNumbers {
        rest: [f64::NAN],
        ..ONE
    };
    assert!(says(nowhere).starts_with("rest[1] = NaN"), "{}", says(nowhere));
    let none = FadingNumbers { max_v: -1.0, ..ONE };
    assert_eq!(says(none), "range of voltages = 0 must be finite and positive");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 100,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(5),
        ..ProptestConfig::default()
    })]

    /// Wherever a stage was led by steps of up to a twentieth of its range, its inverse gives the voltages back, to 1e-4 of the range.
    #[test]
    fn val_inverse_of_forward_is_the_voltage(
        steps in prop::collection::vec(-5.0..5.0_f64, 1..400),
        lengths_v in [15.0..60.0_f64, 60.0..150.0_f64],
        weights in [0.0..1.5_f64, 0.0..1.5_f64],
        squares in [-0.2..0.2_f64, -0.2..0.2_f64],
    ) {
        let numbers = FadingNumbers {
            lengths_v,
            curves: [0, 1].map(|i| [weights[i], squares[i], 0.0]),
            ..TWO
        };
        let model = FadingModel::<f64, 2>::new(&numbers).unwrap();
        let inverse = FadingInverse::new(model).unwrap();
        let (mut forward, mut back) = (model.cycled(40.0, true), model.cycled(40.0, true));
        let mut volts = 40.0_f64;
        for step in steps {
            volts = (volts + step).clamp(-4.0, 104.0);
            let wanted = model.step(&mut forward, volts);
            let found = inverse.step(&mut back, wanted);
            prop_assert!((found - volts).abs() < 1e-4 * 110.0, "{} {}", found, volts);
        }
    }
}

/// Either inverse of a law does what its own kind does, from rest on; a state of the other kind gives way to rest.
#[test]
fn val_either_inverse_is_its_own_kind() {
    let plays = CornerPolynomial::<f64, PLAYS>::new(
        PlayBank::new(
            Thresholds::new(core::array::from_fn(|i| 0.1 + 0.2 * i as f64)).unwrap(),
            -1.0,
            12.0,
            50e3,
        )
        .unwrap(),
        PolynomialCoefficients {
            offset: 0.0,
            input_function: [9.0, 0.0, 0.0, 0.0, 0.0],
            linear: [-0.1; PLAYS],
            quadratic: [0.0; PLAYS],
            cubic: [0.0; PLAYS],
        },
    )
    .unwrap();
    let four = FadingNumbers {
        min_v: -5.0,
        max_v: 105.0,
        offset: 7.0,
        input_function: [5.0, 0.2, -0.1],
        lengths_v: [10.0, 20.0, 40.0, 80.0],
        curves: [[0.3, 0.1, 0.0], [0.5, 0.0, 0.0], [0.5, 0.0, 0.1], [1.0, -0.2, 0.0]],
        rest: [-0.2, -0.3, -0.2, -0.4],
    };
    let fading = FadingInverse::new(FadingModel::new(&four).unwrap()).unwrap();
    let either = [EitherInverse::Plays(plays), EitherInverse::Fading(fading)];
    let (mut of_plays, mut of_fading) = (plays.rest(), fading.rest());
    let mut states = [either[0].rest(), either[1].rest()];
    let way: Vec<f64> = (0..200).map(|k| 5.0 - 4.0 * (0.1 * f64::from(k)).cos()).collect();
    for &wanted in &way {
        assert_eq!(
            either[0].step(&mut states[0], wanted),
            plays.step(&mut of_plays, wanted)
        );
        assert_eq!(
            either[1].step(&mut states[1], wanted),
            fading.step(&mut of_fading, wanted)
        );
    }
    states.reverse();
    assert_eq!(either[0].step(&mut states[0], 3.0), plays.step(&mut plays.rest(), 3.0));
    assert_eq!(
        either[1].step(&mut states[1], 3.0),
        fading.step(&mut fading.rest(), 3.0)
    );
}
