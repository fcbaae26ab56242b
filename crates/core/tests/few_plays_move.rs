//! Touching only the plays that move, and remembering only the corners, against touching every play.
#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::corner_mrpi::CornerMrpi;
use hysteron_core::corner_polynomial::CornerPolynomial;
use hysteron_core::envelope::Envelope;
use hysteron_core::model::{AtRest, Hysteresis};
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::mrpi::Mrpi;
use hysteron_core::play;
use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
use hysteron_core::quick_mrpi::QuickMrpi;
use hysteron_core::real::Real;
use hysteron_core::thresholds::Thresholds;
use proptest::prelude::*;

const RATE_HZ: f32 = 50e3;

/// Plays of a bank moved one by one, all of them, every sample.
struct Every {
    outputs: Vec<f32>,
    last: f32,
}

impl Every {
    fn step(&mut self, thresholds: &[f32], envelope: &Envelope<f32>, input: f32) {
        // In the roundings of the models, which take the change of a sample for a rate.
        let a_sample = Envelope {
            alpha_s: envelope.alpha_s * RATE_HZ,
            beta_s: envelope.beta_s * RATE_HZ,
        };
        let (left, right) = a_sample.bounds(input, input - self.last);
        self.last = input;
        play::advance(thresholds, &mut self.outputs, left, right);
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Inputs that make roundings meet: on a grid of few values, beside it by a unit in the last place, and anywhere.
fn inputs() -> impl Strategy<Value = Vec<f32>> {
    let grid = (-40..40_i32).prop_map(|k| 0.05 * k as f32);
    let beside = (-40..40_i32, -2..=2_i32).prop_map(|(k, ulp)| {
        let value = 0.05 * k as f32;
        f32::from_bits(value.to_bits().wrapping_add_signed(ulp))
    });
    let anywhere = -2.0..2.0_f32;
    let runs = prop_oneof![
        prop::collection::vec(prop_oneof![grid, beside, anywhere], 20..400),
        // Ramps and turns, as references are.
        prop::collection::vec(-2.0..2.0_f32, 3..20).prop_map(|turns| {
            let steps = turns.windows(2).flat_map(|pair| {
                let (from, to) = (pair[0], pair[1]);
                (1..=25).map(move |k| from + (to - from) * (k as f32 / 25.0))
            });
            steps.collect()
        }),
    ];
    runs.prop_filter("not finite", |values: &Vec<f32>| values.iter().all(|v| v.is_finite()))
}

fn check<const N: usize>(
    thresholds: [f32; N],
    envelope: Envelope<f32>,
    start: f32,
    inputs: &[f32],
) -> Result<(), TestCaseError> {
    let bank = PlayBank::new(Thresholds::new(thresholds).unwrap(), -3.0, 3.0, RATE_HZ).unwrap();
    let weights = core::array::from_fn(|i| 0.7 - 1.3 * ((i * 7 % 5) as f32 / 5.0));
    let coefficients = MpiCoefficients {
        offset: 0.1,
        cubic: -0.02,
        linear: 5.0,
        weights,
    };
    let (model, corners) = (
        Mrpi::new(bank, coefficients, envelope).unwrap(),
        CornerMrpi::new(bank, coefficients, envelope).unwrap(),
    );
    let quick = QuickMrpi::<f32, N>::new(model);
    let (mut state, mut remembered) = (model.at_rest(start, start), corners.at_rest(start, start));
    let mut on_chip = quick.at_rest(start, start);
    let mut every = Every {
        outputs: vec![start; N],
        last: start,
    };
    // A rounding of numbers up to the sum of magnitudes a corner, N corners at most.
    let tolerance = N as f32 * 8.0 * f32::EPSILON * 3.0 * weights.iter().map(|q: &f32| q.abs()).sum::<f32>() + 1e-5;
    for (k, &input) in inputs.iter().enumerate() {
        every.step(&thresholds, &envelope, input);
        let (exact, found) = (model.step(&mut state, input), corners.step(&mut remembered, input));
        prop_assert_eq!(bits(state.outputs()), bits(&every.outputs), "sample {}", k);
        prop_assert_eq!(quick.step(&mut on_chip, input), exact, "quick, sample {}", k);
        prop_assert_eq!(on_chip.outputs(), state.outputs(), "quick, sample {}", k);
        // By value: where it is 0, its sign may differ.
        prop_assert_eq!(
            corners.outputs(&remembered).to_vec(),
            every.outputs.clone(),
            "corners, sample {}",
            k
        );
        prop_assert!((exact - found).abs() <= tolerance, "sample {k}: {exact} {found}");
    }
    Ok(())
}

/// Cubics of plays with both bounds at the input: outputs bit by bit, the sum but for rounding.
fn check_cubics<const N: usize>(thresholds: [f32; N], start: f32, inputs: &[f32]) -> Result<(), TestCaseError> {
    let bank = PlayBank::new(Thresholds::new(thresholds).unwrap(), -3.0, 3.0, RATE_HZ).unwrap();
    let some = |k: usize| core::array::from_fn(|i| 0.7 - 1.3 * ((i * k % 5) as f32 / 5.0));
    let coefficients = PolynomialCoefficients {
        offset: 0.1,
        input_function: [5.0, 0.2, -0.02, 0.003, -0.0004],
        linear: some(7),
        quadratic: some(3),
        cubic: some(11),
    };
    let model = PlayPolynomial::new(bank, coefficients).unwrap();
    let corners = CornerPolynomial::new(bank, coefficients).unwrap();
    let (mut state, mut remembered) = (model.at_rest(start, start), corners.at_rest(start, start));
    // Inputs and thresholds of up to 3: powers of 6, which the sums of a corner are made of; a rounding of them a corner.
    let of_a_play = 0.7 * (6.0 + 36.0 + 216.0_f32);
    let tolerance = (N * N) as f32 * f32::EPSILON * of_a_play + 1e-5;
    for (k, &input) in inputs.iter().enumerate() {
        let (exact, found) = (model.step(&mut state, input), corners.step(&mut remembered, input));
        let (outputs, of_corners) = (state.outputs(), corners.outputs(&remembered));
        // By value: where it is 0, its sign may differ.
        prop_assert_eq!(of_corners.to_vec(), outputs.to_vec(), "sample {}", k);
        prop_assert!((exact - found).abs() <= tolerance, "sample {k}: {exact} {found}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    /// Bit by bit the same play outputs, whatever comes.
    #[test]
    fn prop_the_same_plays_bit_by_bit(inputs in inputs(), alpha in 0.0..2e-5_f32, beta in 0.0..2e-5_f32, still in 0..2_u8, first in 0..2_u8, start in -1.0..1.0_f32) {
        let envelope = if still == 0 { Envelope { alpha_s: 0.0, beta_s: 0.0 } } else { Envelope { alpha_s: alpha, beta_s: beta } };
        let offset = if first == 0 { 0.0 } else { 0.05 };
        check::<1>([offset], envelope, start, &inputs)?;
        check::<2>(core::array::from_fn(|i| offset + 0.3 * i as f32), envelope, start, &inputs)?;
        check::<7>(core::array::from_fn(|i| offset + 0.3 * i as f32), envelope, start, &inputs)?;
        check::<10>(core::array::from_fn(|i| offset + 0.25 * i as f32), envelope, start, &inputs)?;
        check::<11>(core::array::from_fn(|i| offset + 0.2 * i as f32), envelope, start, &inputs)?;
        check::<33>(core::array::from_fn(|i| offset + 0.07 * i as f32), envelope, start, &inputs)?;
        check_cubics::<1>([offset], start, &inputs)?;
        check_cubics::<18>(core::array::from_fn(|i| offset + 0.009 * (i * i) as f32), start, &inputs)?;
    }
}

/// 10^7 samples of sines, nested loops and noise through 100 plays in `f32`: as near to `f64` in the last tenth as in the first.
#[test]
fn val_ten_million_samples_do_not_drift() {
    const N: usize = 100;
    let thresholds: [f32; N] = core::array::from_fn(|i| 0.022 * i as f32);
    let weights: [f32; N] = core::array::from_fn(|i| -0.33 - 0.1 * ((i * 7 % 5) as f32 - 2.0));
    let wide = |values: [f32; N]| values.map(f64::from);
    let single = CornerMrpi::new(
        PlayBank::new(Thresholds::new(thresholds).unwrap(), 0.1, 2.3, RATE_HZ).unwrap(),
        MpiCoefficients {
            offset: -0.3_f32,
            cubic: -0.045,
            linear: 56.0,
            weights,
        },
        Envelope {
            alpha_s: 1.5e-5,
            beta_s: 1.4e-5,
        },
    )
    .unwrap();
    let double = CornerMrpi::new(
        PlayBank::new(
            Thresholds::new(wide(thresholds)).unwrap(),
            f64::from(0.1_f32),
            f64::from(2.3_f32),
            50e3,
        )
        .unwrap(),
        MpiCoefficients {
            offset: f64::from(-0.3_f32),
            cubic: f64::from(-0.045_f32),
            linear: 56.0,
            weights: wide(weights),
        },
        Envelope {
            alpha_s: f64::from(1.5e-5_f32),
            beta_s: f64::from(1.4e-5_f32),
        },
    )
    .unwrap();
    let (mut of_single, mut of_double) = (
        single.at_rest(0.1, 0.1),
        double.at_rest(f64::from(0.1_f32), f64::from(0.1_f32)),
    );
    let mut seed = 1_u32;
    let mut worst = [0.0_f64; 10];
    for k in 0..10_000_000_u32 {
        seed ^= seed << 13;
        seed ^= seed >> 17;
        seed ^= seed << 5;
        let phase = f64::from(k % 500) / 500.0;
        let wave = 0.5 - 0.5 * (core::f64::consts::TAU * phase).cos();
        let share = match k / 100_000 % 4 {
            0 => wave,
            1 => 0.5 + (wave - 0.5) * 0.97_f64.powf(f64::from(k % 100_000) / 500.0),
            2 => f64::from(seed) / 4_294_967_296.0,
            // Never past the widest play: nothing is ever made anew.
            _ => 0.6 + 0.2 * wave,
        };
        let input = (0.1 + 2.2 * share) as f32;
        let error = f64::from(single.step(&mut of_single, input)) - double.step(&mut of_double, f64::from(input));
        let tenth = &mut worst[(k / 1_000_000) as usize];
        *tenth = tenth.max(error.abs());
    }
    println!("worst of each million, volts: {worst:?}");
    // A converter of 400 V has codes of 6 mV. 100 corners of half a unit in the last place of 64 V, at most.
    assert!(worst.iter().all(|&error| error < 100.0 * 3.8e-6), "{worst:?}");
    assert!(worst[9] < 2.0 * worst[0] + 1e-5, "{worst:?}");
}

/// A fitted inverse's size: 24 graded plays over 15 um, cubics whose voltages have both signs.
fn fitted<T: Real>() -> (PlayBank<T, 24>, PolynomialCoefficients<T, 24>) {
    let array = |of: fn(usize) -> f64| core::array::from_fn(|i| T::from_f64(f64::from(of(i) as f32)));
    let thresholds = array(|i| 0.0065 + 0.026 * (i * i) as f64 + 0.026 * i as f64);
    let [low, high, rate_hz] = [-0.75, 15.0, 50e3].map(T::from_f64);
    let bank = PlayBank::new(Thresholds::new(thresholds).unwrap(), low, high, rate_hz).unwrap();
    let coefficients = PolynomialCoefficients {
        offset: T::from_f64(-0.25),
        input_function: [41.5, 0.375, -0.0234375, 0.000_244_140_625, -0.000_007_629_394_531_25].map(T::from_f64),
        linear: array(|i| -1.275 + 0.9 * ((i * 7 % 5) as f64 - 2.0) / 2.0),
        quadratic: array(|i| 0.04 * ((i * 3 % 7) as f64 - 3.0) / 3.0),
        cubic: array(|i| 0.0026 * ((i * 5 % 9) as f64 - 4.0) / 4.0),
    };
    (bank, coefficients)
}

/// A million samples of sines, nested loops and noise in `f32` against `f64`: by corners no further off than play by play, within a
/// fifth of a code of a converter of 16 bit and 200 V, and no further in the last tenth than in the first.
#[test]
fn val_cubics_by_corners_are_no_coarser() {
    let (bank, coefficients) = fitted::<f32>();
    let each = PlayPolynomial::new(bank, coefficients).unwrap();
    let corners = CornerPolynomial::new(bank, coefficients).unwrap();
    let (bank, coefficients) = fitted::<f64>();
    let exact = PlayPolynomial::new(bank, coefficients).unwrap();
    let (mut a, mut b, mut c) = (
        each.at_rest(0.0, 0.0),
        corners.at_rest(0.0, 0.0),
        exact.at_rest(0.0, 0.0),
    );
    let mut seed = 1_u32;
    let mut worst = [[0.0_f64; 2]; 10];
    for k in 0..1_000_000_u32 {
        seed ^= seed << 13;
        seed ^= seed >> 17;
        seed ^= seed << 5;
        let wave = 0.5 - 0.5 * (core::f64::consts::TAU * f64::from(k % 500) / 500.0).cos();
        let share = match k / 20_000 % 4 {
            0 => wave,
            1 => 0.5 + (wave - 0.5) * 0.9_f64.powf(f64::from(k % 20_000) / 500.0),
            2 => f64::from(seed) / 4_294_967_296.0,
            // Never past the widest play: nothing is ever made anew.
            _ => 0.6 + 0.2 * wave,
        };
        let input = (14.5 * share) as f32;
        let wanted = exact.step(&mut c, f64::from(input));
        let of_each = f64::from(each.step(&mut a, input)) - wanted;
        let of_corners = f64::from(corners.step(&mut b, input)) - wanted;
        let [by_play, by_corner] = &mut worst[(k / 100_000) as usize];
        *by_play = by_play.max(of_each.abs());
        *by_corner = by_corner.max(of_corners.abs());
    }
    println!("worst of each tenth, play by play and by corners, volts: {worst:?}");
    let of = |which: usize| worst.iter().map(|tenth| tenth[which]).fold(0.0, f64::max);
    assert!(of(1) <= of(0), "{worst:?}");
    assert!(of(1) < 0.2 * 200.0 / 65_535.0, "{worst:?}");
    assert!(worst[9][1] < 1.5 * worst[0][1], "{worst:?}");
}

/// Plays in an order that no input makes are moved one by one.
#[test]
fn val_outputs_in_any_order() {
    let thresholds = [0.1_f32, 0.4, 0.9];
    let bank = PlayBank::new(Thresholds::new(thresholds).unwrap(), -3.0, 3.0, RATE_HZ).unwrap();
    let envelope = Envelope {
        alpha_s: 0.0,
        beta_s: 0.0,
    };
    let coefficients = MpiCoefficients {
        offset: 0.0,
        cubic: 0.0,
        linear: 1.0,
        weights: [1.0; 3],
    };
    let model = Mrpi::new(bank, coefficients, envelope).unwrap();
    let mut every = Every {
        outputs: vec![0.2, 1.5, -0.7],
        last: 0.5,
    };
    let mut state = PlayState::from_outputs([0.2, 1.5, -0.7], 0.5).unwrap();
    for input in [0.6, 0.4, 0.9, -0.2, 1.8, 1.0] {
        every.step(&thresholds, &envelope, input);
        model.step(&mut state, input);
        assert_eq!(bits(state.outputs()), bits(&every.outputs), "{input}");
    }
}
