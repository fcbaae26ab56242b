//! The complete law against sequences computed by hand, part by part: each number changes the step, each absent part is identity, signs,
//! wind-up, `f32` against `f64`.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_core::adaptation::AdaptationNumbers;
use hysteron_core::law_numbers::{CreepNumbers, FeedbackNumbers, HumNumbers, InverseNumbers, LawNumbers, TrustNumbers};
use hysteron_core::real::Real;
use hysteron_core::surroundings::{HARMONICS, LoopInput};
use hysteron_core::tracking_law::{CREEP_FAST, CREEP_SLOW, PLAYS, TAPS};

const IDENTITY: [f64; 5] = [1.0, 0.0, 0.0, 0.0, 0.0];
const NOTHING: [f64; 5] = [0.0; 5];
/// Of [`plain`].
const AHEAD: usize = 3;
const V_PER_UM: f64 = 10.0;

/// The smallest law there is: 10 V for a micrometre, three samples after the reference came in, and no other part.
fn plain() -> LawNumbers {
    let mut preview = [0.0; TAPS];
    preview[AHEAD] = 1.0;
    let mut thresholds_um = [0.0; PLAYS];
    for (i, threshold) in thresholds_um.iter_mut().enumerate() {
        *threshold = 0.1 * i as f64;
    }
    let mut creep_fast = [0.0; CREEP_FAST];
    let mut creep_slow = [0.0; CREEP_SLOW];
    for (i, tau) in creep_fast.iter_mut().chain(&mut creep_slow).enumerate() {
        *tau = 4e-4 * 4.0_f64.powi(i as i32);
    }
    LawNumbers {
        sample_rate_hz: 50e3,
        samples_ahead: AHEAD,
        preview,
        second_mode: IDENTITY,
        creep_fast: CreepNumbers {
            shares: [0.0; CREEP_FAST],
            tau_s: creep_fast,
        },
        creep_slow: CreepNumbers {
            shares: [0.0; CREEP_SLOW],
            tau_s: creep_slow,
        },
        inverse: InverseNumbers {
            min_um: -1.0,
            max_um: 12.0,
            thresholds_um,
            offset_v: 0.0,
            input_function: [V_PER_UM, 0.0, 0.0, 0.0, 0.0],
            linear: [0.0; PLAYS],
            quadratic: [0.0; PLAYS],
            cubic: [0.0; PLAYS],
        },
        lag_s: 0.0,
        lag_growth: None,
        feedback: None,
        command_min_v: 0.0,
        command_max_v: 100.0,
        // The range in one sample.
        slew_v_per_s: 100.0 * 50e3,
        rest_um: 0.0,
        sensor_lag_s: 0.0,
        coupling: None,
        cross_um_per_um: None,
        hum: None,
        heat: None,
        sensor: None,
        adaptation: None,
    }
}

fn feedback() -> FeedbackNumbers {
    FeedbackNumbers {
        integral_v_per_um_s: 1000.0, // 0.02 V for a micrometre and sample
        series: [IDENTITY; 2],
        damping: NOTHING,
        trust: None,
    }
}

fn closed() -> LawNumbers {
    LawNumbers {
        feedback: Some(feedback()),
        ..plain()
    }
}

/// A law with every part, each of a size that a stage has.
fn everything() -> LawNumbers {
    let mut numbers = plain();
    for (i, h) in numbers.preview.iter_mut().enumerate() {
        *h = 0.3_f64.powi((i as i32 - AHEAD as i32).abs()) * if i % 2 == 0 { 1.0 } else { -0.4 };
    }
    let sum: f64 = numbers.preview.iter().sum();
    numbers.preview = numbers.preview.map(|h| h / sum);
    numbers.second_mode = [1.4, -0.9, 0.3, -0.5, 0.3];
    numbers.creep_fast.shares = [0.03, 0.025, 0.02, 0.022, 0.024];
    numbers.creep_slow.shares = [0.03, 0.02, 0.021, 0.023, 0.026];
    numbers.inverse.offset_v = 0.4;
    numbers.inverse.input_function = [12.0, 0.2, -0.01, 1e-3, -4e-5];
    for i in 0..PLAYS {
        numbers.inverse.linear[i] = -0.2 - 0.01 * i as f64;
        numbers.inverse.quadratic[i] = 0.01 + 0.001 * i as f64;
        numbers.inverse.cubic[i] = -0.001 + 0.0001 * i as f64;
    }
    numbers.lag_s = 70e-6;
    numbers.lag_growth = Some([60.0, 2e-3]);
    numbers.feedback = Some(FeedbackNumbers {
        integral_v_per_um_s: 4000.0,
        series: [[1.2, -0.7, 0.3, -0.4, 0.2], [0.9, 0.5, 0.2, 0.3, 0.25]],
        damping: [0.4, -0.3, 0.1, -0.6, 0.3],
        trust: Some(TrustNumbers {
            quick_v: 1.0,
            slow_v: 2.0,
            slow_v_per_s: 60.0,
        }),
    });
    numbers.rest_um = 0.5;
    numbers.sensor_lag_s = 40e-6;
    numbers.coupling = Some([0.003, 2e-7, 0.001, 3.0]);
    numbers.cross_um_per_um = Some(0.02);
    numbers.hum = Some(HumNumbers {
        frequency_hz: 50.0,
        sensitivity: [[1.0, 0.1], [0.9, 0.1], [0.8, 0.2], [0.7, 0.2], [0.6, 0.3]],
        learning_s: 0.05,
        largest_um: 0.002,
    });
    numbers.heat = Some([20.0, 0.01, 0.05, 0.002]);
    numbers.sensor = Some([5.0, 4e-3, -2e-4]);
    numbers.adaptation = Some(AdaptationNumbers {
        gain_bound: 0.01,
        zero_bound_um: 0.01,
        lag_bound_s: 2e-6,
        lag_from_hz: 20.0,
        lag_up_to_um_per_s: 30e3,
        time_s: 0.1,
        dead_um: 0.002,
        um_per_v: 0.1,
    });
    numbers
}

/// Inputs of `k` samples that reach every part: a slow swing with a quick one on it, a sensor that is off, another axis, warmth.
fn input<T: Real>(k: usize) -> LoopInput<T> {
    let t = k as f64;
    let of = T::from_f64;
    LoopInput {
        reference_ahead: of(5.0 - 4.0 * (t / 90.0).cos() + 0.3 * (t / 3.0).sin()),
        measured: of(4.9 - 4.0 * ((t - 4.0) / 90.0).cos() + 0.2 * (t / 7.0).cos()),
        voltage2_ahead: of(40.0 + 30.0 * (t / 50.0).sin()),
        motion2_ahead: of(3.0 + 2.0 * (t / 60.0).sin()),
        temperature_c: of(21.0 + (t / 200.0).sin()),
    }
}

fn commands<T: Real>(numbers: &LawNumbers, samples: usize) -> Vec<f64> {
    let law = numbers.law::<T>().unwrap();
    let mut state = law.rest(T::from_f64(20.0));
    (0..samples).map(|k| law.step(&mut state, input(k)).to_f64()).collect()
}

/// Commands for references, the sensor at `measured_um`.
fn steps(numbers: &LawNumbers, references_um: &[f64], measured_um: f64) -> Vec<f64> {
    let law = numbers.law::<f64>().unwrap();
    let mut state = law.rest(0.0);
    let step = |&reference_ahead: &f64| {
        let input = LoopInput {
            reference_ahead,
            measured: measured_um,
            ..LoopInput::default()
        };
        law.step(&mut state, input)
    };
    references_um.iter().map(step).collect()
}

fn assert_close(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len());
    for (k, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        assert!((found - wanted).abs() < 1e-9, "sample {k}: {found} instead of {wanted}");
    }
}

/// A law without a part is the law without it: 10 V/um, three samples late, and nothing else. `input` moves every other input.
#[test]
fn val_absent_parts_are_identity() {
    let found = commands::<f64>(&plain(), 400);
    let at = |k: usize| V_PER_UM * input::<f64>(k).reference_ahead;
    let wanted: Vec<f64> = (0..400).map(|k| if k < AHEAD { 0.0 } else { at(k - AHEAD) }).collect();
    assert_close(&found, &wanted);
    // Parts that are there, and do nothing.
    let mut idle = plain();
    idle.coupling = Some([0.0, 0.0, 0.0, 3.0]);
    idle.cross_um_per_um = Some(0.0);
    idle.heat = Some([20.0, 0.01, 0.0, 0.0]);
    idle.hum = Some(HumNumbers {
        frequency_hz: 50.0,
        sensitivity: [[0.0; 2]; HARMONICS],
        learning_s: 0.05,
        largest_um: 0.0,
    });
    idle.feedback = Some(FeedbackNumbers {
        integral_v_per_um_s: 0.0,
        ..feedback()
    });
    idle.sensor = Some([5.0, 0.0, 0.0]);
    assert_close(&commands::<f64>(&idle, 400), &wanted);
}

/// An error of 0.1 um of one sign is hum, too: of a sample of it 2/(0.05 s 50 kHz) is learned, 8e-5 um, turned on by the three samples ahead
/// and the one to the next, 4 of the 1000 of a period. The platform was too low, so it is sent higher.
#[test]
fn val_hum_is_taken_off_the_target() {
    let mut numbers = plain();
    numbers.hum = Some(HumNumbers {
        frequency_hz: 50.0,
        sensitivity: [[1.0, 0.0], [0.0; 2], [0.0; 2], [0.0; 2], [0.0; 2]],
        learning_s: 0.05,
        largest_um: 0.2,
    });
    // 8e-4 V cos(4 0.36 degrees).
    let wanted = [0.0, 0.0, 0.0, 0.0, 7.997_473_5e-4];
    assert_close(&steps(&numbers, &[0.0; 5], -0.1), &wanted);
}

type Change = (&'static str, fn(&mut LawNumbers));

/// A change of each number, by a tenth or so of it, and the least that it has to move the command, volts.
const CHANGES: &[Change] = &[
    ("sample_rate_hz", |n| n.sample_rate_hz = 40e3),
    ("samples_ahead", |n| n.samples_ahead = 4),
    ("preview", |n| n.preview.swap(2, 5)),
    ("second_mode b0, b1", |n| {
        n.second_mode[0] += 0.1;
        n.second_mode[1] -= 0.1;
    }),
    ("second_mode b2, a1", |n| {
        n.second_mode[2] += 0.1;
        n.second_mode[3] += 0.1;
    }),
    ("second_mode a2", |n| {
        n.second_mode[4] += 0.1;
        n.second_mode[0] += 0.1;
    }),
    ("creep_fast.shares", |n| n.creep_fast.shares[4] *= 1.5),
    ("creep_fast.tau_s", |n| n.creep_fast.tau_s[0] *= 1.5),
    ("creep_slow.shares", |n| n.creep_slow.shares[0] *= 1.5),
    ("creep_slow.tau_s", |n| n.creep_slow.tau_s[0] *= 1.5),
    ("inverse.min_um", |n| n.inverse.min_um = 2.0),
    ("inverse.max_um", |n| n.inverse.max_um = 7.0),
    ("inverse.thresholds_um", |n| n.inverse.thresholds_um[7] += 0.05),
    ("inverse.offset_v", |n| n.inverse.offset_v += 0.1),
    ("inverse.input_function x", |n| n.inverse.input_function[0] *= 1.1),
    ("inverse.input_function x^2", |n| n.inverse.input_function[1] *= 1.1),
    ("inverse.input_function x^3", |n| n.inverse.input_function[2] *= 1.1),
    ("inverse.input_function x^4", |n| n.inverse.input_function[3] *= 1.1),
    ("inverse.input_function x^5", |n| n.inverse.input_function[4] *= 1.1),
    ("inverse.linear", |n| n.inverse.linear[3] *= 1.1),
    ("inverse.quadratic", |n| n.inverse.quadratic[3] *= 1.5),
    ("inverse.cubic", |n| n.inverse.cubic[3] *= 1.5),
    ("lag_s", |n| n.lag_s *= 1.1),
    ("lag_growth about", |n| {
        n.lag_growth = n.lag_growth.map(|[about, per]| [about + 10.0, per])
    }),
    ("lag_growth per volt", |n| {
        n.lag_growth = n.lag_growth.map(|[about, per]| [about, 1.5 * per])
    }),
    ("no lag_growth", |n| n.lag_growth = None),
    ("command_min_v", |n| n.command_min_v = 40.0),
    ("command_max_v", |n| n.command_max_v = 60.0),
    ("slew_v_per_s", |n| n.slew_v_per_s = 50e3),
    ("rest_um", |n| n.rest_um += 0.1),
    ("sensor_lag_s", |n| n.sensor_lag_s *= 1.5),
    ("no sensor_lag_s", |n| n.sensor_lag_s = 0.0),
    ("coupling gain", |n| {
        n.coupling = n.coupling.map(|[g, d, p, r]| [1.1 * g, d, p, r])
    }),
    ("coupling lead", |n| {
        n.coupling = n.coupling.map(|[g, d, p, r]| [g, 2.0 * d, p, r])
    }),
    ("coupling weight", |n| {
        n.coupling = n.coupling.map(|[g, d, p, r]| [g, d, 2.0 * p, r])
    }),
    ("coupling threshold", |n| {
        n.coupling = n.coupling.map(|[g, d, p, r]| [g, d, p, 5.0 * r])
    }),
    ("adapted gain", |n| of_adaptation(n, |part| part.gain_bound = 0.005)),
    ("adapted zero", |n| of_adaptation(n, |part| part.zero_bound_um = 0.001)),
    ("adapted lag", |n| of_adaptation(n, |part| part.lag_bound_s = 1e-6)),
    ("lag_from_hz of adaptation", |n| {
        of_adaptation(n, |part| part.lag_from_hz = 2e3)
    }),
    ("lag_up_to_um_per_s of adaptation", |n| {
        of_adaptation(n, |part| part.lag_up_to_um_per_s = 1.0)
    }),
    ("time of adaptation", |n| of_adaptation(n, |part| part.time_s = 0.2)),
    ("dead zone of adaptation", |n| {
        of_adaptation(n, |part| part.dead_um = 0.05)
    }),
    ("um_per_v of adaptation", |n| {
        of_adaptation(n, |part| part.um_per_v = 0.2)
    }),
    ("no adaptation", |n| n.adaptation = None),
    ("cross_um_per_um", |n| n.cross_um_per_um = Some(0.03)),
    ("hum frequency", |n| of_hum(n, |hum| hum.frequency_hz = 60.0)),
    ("hum sensitivity", |n| of_hum(n, |hum| hum.sensitivity[0] = [0.5, 0.4])),
    ("hum learning", |n| of_hum(n, |hum| hum.learning_s = 0.1)),
    ("hum bound", |n| of_hum(n, |hum| hum.largest_um = 0.2)),
    ("heat reference", |n| {
        n.heat = n.heat.map(|[c, tau, s, g]| [c + 1.0, tau, s, g])
    }),
    ("heat tau", |n| {
        n.heat = n.heat.map(|[c, tau, s, g]| [c, 2.0 * tau, s, g])
    }),
    ("heat shift", |n| {
        n.heat = n.heat.map(|[c, tau, s, g]| [c, tau, 1.5 * s, g])
    }),
    ("heat gain", |n| {
        n.heat = n.heat.map(|[c, tau, s, g]| [c, tau, s, 1.5 * g])
    }),
    ("sensor middle", |n| {
        n.sensor = n.sensor.map(|[m, a, b]| [m + 1.0, a, b])
    }),
    ("sensor quadratic", |n| {
        n.sensor = n.sensor.map(|[m, a, b]| [m, 2.0 * a, b])
    }),
    ("sensor cubic", |n| n.sensor = n.sensor.map(|[m, a, b]| [m, a, 5.0 * b])),
    ("integral", |n| of_feedback(n, |f| f.integral_v_per_um_s *= 1.1)),
    ("first section", |n| of_feedback(n, |f| f.series[0][2] += 0.1)),
    ("first section, back", |n| of_feedback(n, |f| f.series[0][3] += 0.1)),
    ("second section", |n| of_feedback(n, |f| f.series[1][1] += 0.1)),
    ("second section, back", |n| of_feedback(n, |f| f.series[1][4] += 0.1)),
    ("damping", |n| of_feedback(n, |f| f.damping[0] += 0.1)),
    ("damping, back", |n| of_feedback(n, |f| f.damping[3] += 0.1)),
    ("trust quick", |n| of_trust(n, |t| t.quick_v *= 1.1)),
    ("trust slow", |n| of_trust(n, |t| t.slow_v *= 0.5)),
    ("trust slow rate", |n| of_trust(n, |t| t.slow_v_per_s *= 1.1)),
    ("no trust", |n| of_feedback(n, |f| f.trust = None)),
    ("no feedback", |n| n.feedback = None),
    ("no coupling", |n| n.coupling = None),
    ("no cross", |n| n.cross_um_per_um = None),
    ("no hum", |n| n.hum = None),
    ("no heat", |n| n.heat = None),
    ("no sensor", |n| n.sensor = None),
    ("no second mode", |n| n.second_mode = IDENTITY),
];

fn of_adaptation(numbers: &mut LawNumbers, change: fn(&mut AdaptationNumbers)) {
    change(numbers.adaptation.as_mut().unwrap());
}

fn of_hum(numbers: &mut LawNumbers, change: impl Fn(&mut HumNumbers)) {
    numbers.hum.iter_mut().for_each(change);
}

fn of_feedback(numbers: &mut LawNumbers, change: impl Fn(&mut FeedbackNumbers)) {
    numbers.feedback.iter_mut().for_each(change);
}

fn of_trust(numbers: &mut LawNumbers, change: impl Fn(&mut TrustNumbers)) {
    of_feedback(numbers, |feedback| feedback.trust.iter_mut().for_each(&change));
}

/// No number of a law is without effect, in either number type. The least that counts is a tenth of a step of a 16-bit converter.
#[test]
fn val_every_number_changes_the_step() {
    // Two time constants of what is learned: the lag waits for one.
    let (double, single) = (
        commands::<f64>(&everything(), 12_000),
        commands::<f32>(&everything(), 12_000),
    );
    let farthest = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    for (name, change) in CHANGES {
        let mut numbers = everything();
        change(&mut numbers);
        assert_ne!(numbers, everything(), "{name}");
        for moved in [
            farthest(&double, &commands::<f64>(&numbers, 12_000)),
            farthest(&single, &commands::<f32>(&numbers, 12_000)),
        ] {
            assert!(moved > 1.5e-3, "{name} moves the command by {moved} V");
        }
    }
}

/// What the chip computes is what the host designed, to a fortieth of a step of a 16-bit converter over 100 V.
#[test]
fn val_single_is_double() {
    let (double, single) = (
        commands::<f64>(&everything(), 20_000),
        commands::<f32>(&everything(), 20_000),
    );
    let sum: f64 = double.iter().zip(&single).map(|(a, b)| (a - b).powi(2)).sum();
    let rms_v = (sum / 20_000.0).sqrt();
    assert!(rms_v < 1e-3, "{rms_v} V");
    assert!(rms_v > 1e-7, "{rms_v} V: is it f32 at all?");
}

/// Direct form I, written out; the law has transposed direct form II.
#[test]
fn val_second_mode_by_hand() {
    let mut numbers = plain();
    numbers.second_mode = [1.5, -0.75, 0.25, -0.25, 0.25];
    // r = 1 from the first sample on, in at the fourth: x = 1.5, 1.5 - 0.75 + 0.25 1.5, 1 + 0.25 1.125 - 0.25 1.5, ...
    let x = [1.5, 1.125, 0.906_25, 0.945_312_5];
    let wanted: Vec<f64> = [0.0; AHEAD].into_iter().chain(x.map(|x| V_PER_UM * x)).collect();
    assert_close(&steps(&numbers, &[1.0; 7], 0.0), &wanted);
}

/// The error is that of the reference that is due, not of the one that came in.
#[test]
fn val_integral_by_hand() {
    // r = 2 in at once, due after 3 samples: until then the error is -0.5 um, after that 1.5 um.
    let found = steps(&closed(), &[2.0; 7], 0.5);
    let integral = [-0.01, -0.02, -0.03, 0.0, 0.03, 0.06, 0.09];
    // The command has no room below 0: the integral stands still there.
    let wanted = [0.0, 0.0, 0.0, 20.03, 20.06, 20.09, 20.12];
    assert_close(&found, &wanted);
    let mut lower = closed();
    lower.command_min_v = -5.0;
    let wanted: Vec<f64> = integral
        .into_iter()
        .enumerate()
        .map(|(k, v)| if k < AHEAD { v } else { 20.0 + v })
        .collect();
    assert_close(&steps(&lower, &[2.0; 7], 0.5), &wanted);
}

/// Beside the integral, and of its sign: a positive error raises the command by the damping's b0 at once.
#[test]
fn val_damping_by_hand() {
    let mut numbers = closed();
    of_feedback(&mut numbers, |f| {
        f.integral_v_per_um_s = 0.0;
        f.damping = [0.5, 0.25, 0.0, -0.5, 0.0];
    });
    // e = 2 um from the first sample on: d = 1, 1 + 0.5 + 0.5 1, 1.5 + 0.5 2, 1.5 + 0.5 2.5
    let wanted = [1.0, 2.0, 2.5, 2.75];
    assert_close(&steps(&numbers, &[0.0; 4], -2.0), &wanted);
    // Both: the integral's 0.04 V a sample on top.
    of_feedback(&mut numbers, |f| f.integral_v_per_um_s = 1000.0);
    assert_close(&steps(&numbers, &[0.0; 4], -2.0), &[1.04, 2.08, 2.62, 2.91]);
}

/// In front of the integral, one behind the other.
#[test]
fn val_series_by_hand() {
    let mut numbers = closed();
    of_feedback(&mut numbers, |f| {
        f.series = [[0.5, 0.5, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -0.5, 0.0]];
    });
    // e = 1: the mean of two is 0.5, 1, 1, 1; then x_k = u_k + x_(k-1) / 2: 0.5, 1.25, 1.625, 1.8125; 0.02 of the sum of it.
    let wanted = [0.01, 0.035, 0.0675, 0.103_75];
    assert_close(&steps(&numbers, &[0.0; 4], -1.0), &wanted);
}

/// Held against either end for 1000 samples, the integral goes as far as the end and no further, and the command comes back with the
/// first sample of the other sign.
#[test]
fn val_does_not_wind_up() {
    let with_error = |state: &mut _, law: &hysteron_core::surroundings::CompleteLaw<f64>, error_um: f64| {
        let input = LoopInput {
            reference_ahead: 9.5,
            measured: 9.5 - error_um,
            ..LoopInput::default()
        };
        law.step(state, input)
    };
    // At 9.5 um the feedforward gives 95 V: 5 V of room above, 10 V below a limit of 85.
    let numbers = LawNumbers {
        command_min_v: 85.0,
        ..closed()
    };
    let law = numbers.law::<f64>().unwrap();
    for (error_um, limit_v, integral_v) in [(4.0_f64, 100.0, 5.0), (-4.0, 85.0, -10.0)] {
        let mut state = law.rest(0.0);
        for _ in 0..AHEAD {
            with_error(&mut state, &law, 0.0);
        }
        // 0.08 V a sample.
        let within = ((integral_v / 0.08_f64).abs() as usize) - 1;
        for k in 1..=within {
            let wanted = 95.0 + 0.08 * error_um.signum() * k as f64;
            let found = with_error(&mut state, &law, error_um);
            assert!((found - wanted).abs() < 1e-9, "{k}: {found} instead of {wanted}");
            assert!(!state.limited());
        }
        for _ in 0..1000 {
            with_error(&mut state, &law, error_um);
        }
        assert!(state.limited());
        assert!((state.integral() - integral_v).abs() < 1e-9, "{}", state.integral());
        let back = with_error(&mut state, &law, -error_um);
        assert!((back - (limit_v - 0.02 * error_um)).abs() < 1e-9, "{back}");
        assert!(!state.limited());
    }
}

/// A slew limit in the way of the feedforward takes nothing from an integral that asks for less.
#[test]
fn val_slew_holds_the_integral_between_where_it_was_and_would_be() {
    let mut numbers = closed();
    numbers.slew_v_per_s = 50e3; // 1 V a sample
    numbers.samples_ahead = 0;
    numbers.preview = [0.0; TAPS];
    numbers.preview[0] = 1.0;
    let law = numbers.law::<f64>().unwrap();
    let mut state = law.rest(0.0);
    let mut step = |reference_ahead: f64, measured: f64| {
        let input = LoopInput {
            reference_ahead,
            measured,
            ..LoopInput::default()
        };
        let command = law.step(&mut state, input);
        (command, state.integral())
    };
    // 50 V are asked for, 1 V a sample is allowed, and the error is positive: nothing is integrated.
    for k in 1..=10 {
        assert_eq!(step(5.0, 0.0), (f64::from(k), 0.0));
    }
    // Coming down, with a positive error still: the limit is in the way of the descent, not of the integral.
    let (command, integral) = step(0.0, -1.0);
    assert_eq!(command, 9.0);
    assert!((integral - 0.02).abs() < 1e-12, "{integral}");
}

/// Which reference is due, and is known to be before the step: one that came in 0, 1 or 3 samples ago, at first the rest of 0.5 um.
#[test]
fn val_what_is_due_by_hand() {
    let references_um = [1.0, 2.0, 4.0, 8.0, 3.0, f64::NAN, 5.0];
    for (ahead, due_um) in [
        (0, [1.0, 2.0, 4.0, 8.0, 3.0, 3.0, 5.0]),
        (1, [0.5, 1.0, 2.0, 4.0, 8.0, 3.0, 3.0]),
        (3, [0.5, 0.5, 0.5, 1.0, 2.0, 4.0, 8.0]),
    ] {
        let mut numbers = closed();
        numbers.samples_ahead = ahead;
        numbers.rest_um = 0.5;
        let law = numbers.law::<f64>().unwrap();
        assert_eq!(law.ahead(), ahead);
        assert!(law.feedback().is_some());
        let mut state = law.rest(20.0);
        for (reference_ahead, wanted_um) in references_um.into_iter().zip(due_um) {
            assert_eq!(law.next_due(&state, reference_ahead), wanted_um, "{ahead}");
            let input = LoopInput {
                reference_ahead,
                measured: 0.25,
                ..LoopInput::default()
            };
            law.step(&mut state, input);
            assert_eq!((state.due(), state.error()), (wanted_um, wanted_um - 0.25), "{ahead}");
        }
    }
    assert!(plain().law::<f64>().unwrap().feedback().is_none());
}

/// A chip gets the middle and both coefficients of the sensor's curve.
#[test]
fn val_the_sensors_numbers() {
    let mut numbers = plain();
    numbers.sensor = Some([5.0, 0.001, 0.01]);
    let law = numbers.law::<f64>().unwrap();
    assert_eq!(law.surroundings.sensor.unwrap().coefficients(), [5.0, 0.001, 0.01]);
}

/// A sensor's curve of its own, and a lag of its own: the position, not the reading, is compared, with what the sensor can show by then.
#[test]
fn val_sensor_by_hand() {
    let mut numbers = closed();
    numbers.sensor = Some([5.0, 0.0, 0.01]);
    // At 7 um the sensor reads 5 + 2 + 0.01 2^3.
    let found = steps(&numbers, &[7.0; 8], 7.08);
    assert!((found[7] - found[6]).abs() < 1e-7, "{found:?}");
    assert!((steps(&numbers, &[7.0; 8], 7.0)[7] - found[7]).abs() > 0.005);
    let mut lagging = closed();
    lagging.command_min_v = -5.0;
    lagging.sensor_lag_s = 20e-6;
    // A step of 1 um that is due at the fourth sample, through a lag of one sample, exact for straight lines: 1 / e after one sample,
    // 1 - (1 - 1/e) / e after two.
    let e = std::f64::consts::E;
    let after = [1.0 / e, 1.0 - (1.0 - 1.0 / e) / e];
    let wanted = [
        0.0,
        0.0,
        0.0,
        10.0 + 0.02 * after[0],
        10.0 + 0.02 * (after[0] + after[1]),
    ];
    assert_close(&steps(&lagging, &[1.0; 5], 0.0), &wanted);
}

/// What stands beside the command comes off the target: 0.1 um of the other axis' motion, 0.2 um of its voltage, 0.3 um of warmth.
#[test]
fn val_surroundings_by_hand() {
    let mut numbers = plain();
    numbers.rest_um = 0.5;
    numbers.cross_um_per_um = Some(0.05);
    numbers.coupling = Some([0.005, 0.0, 0.0, 0.0]);
    numbers.heat = Some([20.0, 1e-3, 0.3, 0.0]);
    let law = numbers.law::<f64>().unwrap();
    let mut state = law.rest(21.0);
    let input = LoopInput {
        reference_ahead: 5.0,
        measured: 0.0,
        voltage2_ahead: 40.0,
        motion2_ahead: 2.0,
        temperature_c: 21.0,
    };
    let command = (0..10).map(|_| law.step(&mut state, input)).last().unwrap();
    assert!(
        (command - V_PER_UM * (5.0 - 0.5 - 0.1 - 0.2 - 0.3)).abs() < 1e-9,
        "{command}"
    );
}

/// A sensor that says 5 um for ever: the correction goes by its quick part at once, then at its slow rate, to the sum of both; its integral
/// stands there and comes back at once.
#[test]
fn val_feedback_stays_about_the_feedforward() {
    let mut numbers = closed();
    of_feedback(&mut numbers, |f| {
        f.integral_v_per_um_s = 1e5; // 2 V for a micrometre and sample
        f.trust = Some(TrustNumbers {
            quick_v: 1.5,
            slow_v: 2.0,
            slow_v_per_s: 50.0, // 1 mV a sample
        });
    });
    let law = numbers.law::<f64>().unwrap();
    let mut state = law.rest(0.0);
    let mut step = |measured: f64| {
        let input = LoopInput {
            reference_ahead: 5.0,
            measured,
            ..LoopInput::default()
        };
        let command = law.step(&mut state, input);
        (command, state.correction(), state.integral())
    };
    for _ in 0..AHEAD {
        step(0.0);
    }
    for k in 0..2000 {
        let (command, correction, integral) = step(0.0);
        // The slow part goes one way or the other in each sample: it was 1 mV below.
        let wanted = 1.499 + 1e-3 * f64::from(k);
        assert!((correction - wanted).abs() < 1e-9, "{k}: {correction}");
        assert!((command - 50.0 - wanted).abs() < 1e-9, "{k}: {command}");
        assert!((integral - wanted).abs() < 1e-9, "{k}: {integral}");
    }
    for _ in 0..100 {
        step(0.0);
    }
    assert!((step(0.0).1 - 3.5).abs() < 1e-9);
    // The slow part is at 2: as far on the other side of it.
    assert!((step(6.0).1 - 1.5).abs() < 1e-9);
    assert!((step(10.0).1 - 0.5).abs() < 0.01);
}

/// Held at 0 V while its reference comes down and rests, a law goes on as one that has been driven along the same reference; one that was
/// made anew does not know how the stage creeps.
#[test]
fn val_following_keeps_the_states() {
    let mut numbers = everything();
    numbers.hum = None;
    numbers.adaptation = None;
    let law = numbers.law::<f64>().unwrap();
    let (mut driven, mut following) = (law.rest(20.0), law.rest(20.0));
    let at = |k: usize| LoopInput {
        reference_ahead: match k {
            0..500 => 0.5 + 0.01 * k as f64,
            500..1000 => 5.5 - 0.01 * (k - 500) as f64,
            1000..3000 => 0.5,
            _ => 0.5 + 0.005 * (k - 3000) as f64,
        },
        ..input(k)
    };
    for k in 0..3000 {
        law.step(&mut driven, at(k));
        if k < 500 {
            law.step(&mut following, at(k));
        } else {
            law.follow(&mut following, at(k), 0.0);
        }
    }
    law.forget_errors(&mut driven);
    law.forget_errors(&mut following);
    let mut anew = law.rest(20.0);
    let mut farthest_anew = 0.0_f64;
    for k in 3000..3400 {
        // A sensor that agrees: what is compared is the feedforward.
        let input = LoopInput {
            measured: at(k - AHEAD.min(k)).reference_ahead,
            ..at(k)
        };
        let (a, b, c) = (
            law.step(&mut driven, input),
            law.step(&mut following, input),
            law.step(&mut anew, input),
        );
        // Limiter and damping differ at first: the command comes from 0 V.
        if k > 3100 {
            assert!((a - b).abs() < 1e-6, "{k}: {a} {b}");
            farthest_anew = farthest_anew.max((a - c).abs());
        }
    }
    assert!(farthest_anew > 0.1, "{farthest_anew}");
}

/// Held at 60 V by somebody else while its reference rests, a law of 1 V a sample goes on from there: 59 V, then 58 V.
#[test]
fn val_after_following_the_command_goes_on_from_where_it_was() {
    let mut numbers = everything();
    numbers.slew_v_per_s = 50e3;
    let law = numbers.law::<f64>().unwrap();
    let mut state = law.rest(20.0);
    let at_rest = LoopInput {
        reference_ahead: 0.5,
        measured: 0.5,
        temperature_c: 20.0,
        ..LoopInput::default()
    };
    for _ in 0..100 {
        law.follow(&mut state, at_rest, 60.0);
    }
    for wanted in [59.0, 58.0, 57.0] {
        let command_v = law.step(&mut state, at_rest);
        assert!((command_v - wanted).abs() < 1e-9, "{command_v} {wanted}");
    }
}
