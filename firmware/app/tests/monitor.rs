//! The monitor's limits, by literal numbers: what is let through, what is held over, what is a fault, and on which sample.

use hysteron_firmware::monitor::{Fault, Monitor, MonitorState, Scales, Tick};

/// A range of 10 um: readings may jump by 0.08 um, and by 0.0625 um for each volt of the command; 64 codes are 0.064 um.
const SCALES: Scales = Scales {
    range_um: 10.0,
    um_per_code: 0.001,
    slopes_v_per_um: [8.0, 30.0],
    span_v: 150.0,
    departure_v: 4.0,
    overshoot: 0.5,
};

fn monitor() -> Monitor {
    Monitor::new(&SCALES, 500)
}

/// A sensor that agreed at 5 um, the command at rest at 50 V.
fn settled(monitor: &Monitor) -> MonitorState {
    let mut state = MonitorState::default();
    monitor.command(&mut state, 50.0);
    for _ in 0..2000 {
        monitor.command(&mut state, 50.0);
    }
    assert_eq!(monitor.sensor(&mut state, 5000, 5.0, 5.0), (5.0, None));
    state
}

/// What a reading may differ by, a case a line: the reference's way, a change of the command some samples ago, how far the reading is
/// from the reference, and whether it is used.
#[test]
fn bva_readings_are_held_against_what_the_command_did() {
    let cases = [
        (0.0, 0.0, 0, 0.079, true),
        (0.0, 0.0, 0, -0.079, true),
        (0.0, 0.0, 0, 0.081, false),
        (0.0, 0.0, 0, -0.081, false),
        (0.0, 0.0, 0, f32::NAN, false),
        (0.0, 0.0, 0, f32::INFINITY, false),
        // The reference's own way is allowed beside it, either way.
        (0.05, 0.0, 0, 0.129, true),
        (0.05, 0.0, 0, 0.131, false),
        (-0.05, 0.0, 0, 0.129, true),
        (-0.05, 0.0, 0, 0.131, false),
        // 2 V: 0.08 + 0.125, either way.
        (0.0, 2.0, 0, 0.204, true),
        (0.0, 2.0, 0, 0.206, false),
        (0.0, -2.0, 0, 0.204, true),
        (0.0, -2.0, 0, 0.206, false),
        // 100 samples later 0.366 of it: 0.08 + 0.0458.
        (0.0, 2.0, 100, 0.1255, true),
        (0.0, 2.0, 100, 0.1262, false),
    ];
    for (way_um, change_v, samples, off_um, used) in cases {
        let monitor = monitor();
        let mut state = settled(&monitor);
        monitor.command(&mut state, 50.0 + change_v);
        for _ in 0..samples {
            monitor.command(&mut state, 50.0 + change_v);
        }
        let expected_um = 5.0 + way_um;
        let (reading_um, fault) = monitor.sensor(&mut state, 5100, expected_um + off_um, expected_um);
        let wanted_um = if used { expected_um + off_um } else { expected_um };
        assert!(
            (reading_um - wanted_um).abs() < 1e-6,
            "{way_um} {change_v} {samples} {off_um}: {reading_um}"
        );
        assert_eq!(fault, None);
    }
}

/// A start at 50 V is no change of 50 V, which would let a reading jump by 3 um.
#[test]
fn val_a_start_at_a_voltage_is_no_step() {
    let monitor = monitor();
    let mut state = MonitorState::at(50.0);
    monitor.command(&mut state, 50.0);
    assert_eq!(monitor.sensor(&mut state, 5000, 5.0, 5.0), (5.0, None));
    monitor.command(&mut state, 50.0);
    assert_eq!(monitor.sensor(&mut state, 5200, 5.2, 5.0).0, 5.0);
}

/// A sensor that is off by 0.05 um, and stays off by as much where a reading is held over while the reference goes on.
#[test]
fn val_a_single_bad_reading_is_what_the_last_good_one_leads_to() {
    let monitor = monitor();
    let mut state = settled(&monitor);
    assert_eq!(monitor.sensor(&mut state, 5050, 5.05, 5.0), (5.05, None));
    let (reading_um, fault) = monitor.sensor(&mut state, 7150, 7.15, 5.1);
    assert!((reading_um - 5.15).abs() < 1e-6, "{reading_um}");
    assert_eq!(fault, None);
    let (reading_um, fault) = monitor.sensor(&mut state, 5250, 5.25, 5.2);
    assert!((reading_um - 5.25).abs() < 1e-6, "{reading_um}");
    assert_eq!(fault, None);
}

/// Three are held over, the fourth is a jump; three and a good one are none.
#[test]
fn bva_the_fourth_bad_reading_in_a_row_is_a_jump() {
    let monitor = monitor();
    for um in [6.0, 4.0, f32::NAN] {
        let mut state = settled(&monitor);
        for k in 1..=4 {
            let fault = if k == 4 { Some(Fault::SensorJump) } else { None };
            assert_eq!(monitor.sensor(&mut state, 6000 + k, um, 5.0), (5.0, fault), "{um} {k}");
        }
    }
    let mut state = settled(&monitor);
    for k in 0..3 {
        assert_eq!(monitor.sensor(&mut state, 6000 + k, 6.0, 5.0).1, None);
    }
    assert_eq!(monitor.sensor(&mut state, 5001, 5.0, 5.0), (5.0, None));
    assert_eq!(monitor.sensor(&mut state, 6000, 6.0, 5.0), (5.0, None));
}

/// Single bad readings: each adds 1024 to the doubt, of which every good one takes 1, and 5120 are too much.
#[test]
fn bva_doubt_gathers() {
    let count = |good: u32, most: u32| {
        let monitor = monitor();
        let mut state = settled(&monitor);
        for bad in 1..=most {
            match monitor.sensor(&mut state, 9000, 9.0, 5.0).1 {
                Some(fault) => return Some((bad, fault)),
                None => (0..good).for_each(|k| {
                    let code = 5000 + (k % 2) as u16;
                    assert_eq!(monitor.sensor(&mut state, code, 5.0, 5.0), (5.0, None));
                }),
            }
        }
        None
    };
    assert_eq!(count(1, 100), Some((6, Fault::SensorJump)));
    assert_eq!(count(399, 100), Some((8, Fault::SensorJump)));
    assert_eq!(count(1024, 100), None);
}

/// Three codes in a row within 16 of an end of the range: 65 520 is the highest of a converter of 12 bits.
#[test]
fn bva_ends_of_the_range() {
    let cases = [
        (0, true),
        (15, true),
        (16, false),
        (32_768, false),
        (65_519, false),
        (65_520, true),
        (65_535, true),
    ];
    for (code, end) in cases {
        let monitor = monitor();
        let mut state = MonitorState::default();
        let faults = [0, 1, 2].map(|_| monitor.sensor(&mut state, code, 5.0, 5.0).1);
        let third = if end { Some(Fault::SensorRange) } else { None };
        assert_eq!(faults, [None, None, third], "{code}");
    }
    let monitor = monitor();
    let mut state = MonitorState::default();
    for code in [0, 1, 5000, 2, 3, 5000] {
        assert_eq!(monitor.sensor(&mut state, code, 5.0, 5.0).1, None);
    }
}

/// One code for 50 samples while the reference moves by more than 64 codes; a reference that holds says nothing.
#[test]
fn bva_a_sensor_that_stands_still() {
    let run = |step_um: f32, samples: u16| {
        let monitor = monitor();
        let mut state = MonitorState::default();
        let mut expected_um = 5.0;
        let mut last = None;
        for _ in 0..samples {
            last = monitor.sensor(&mut state, 5000, 5.0, expected_um).1;
            expected_um += step_um;
        }
        last
    };
    // From the first of 50 samples to the last are 49 steps.
    assert_eq!(run(0.064_5 / 49.0, 49), None);
    assert_eq!(run(0.064_5 / 49.0, 50), Some(Fault::SensorStuck));
    assert_eq!(run(-0.064_5 / 49.0, 50), Some(Fault::SensorStuck));
    assert_eq!(run(0.063_5 / 49.0, 50), None);
    assert_eq!(run(0.0, 50_000), None);
    // A code that changes, by one.
    let monitor = monitor();
    let mut state = MonitorState::default();
    for k in 0..200_u16 {
        let expected_um = 5.0 + 0.002 * f32::from(k);
        assert_eq!(
            monitor.sensor(&mut state, 5000 + k / 49, expected_um, expected_um).1,
            None,
            "{k}"
        );
    }
}

fn tick(error_um: f32) -> Tick {
    Tick {
        reference_um: 5.0,
        measured_um: 5.0 - error_um,
        limited: false,
        departure_v: 0.0,
    }
}

#[test]
fn bva_departures() {
    let monitor = monitor();
    for (departure_v, fault) in [
        (0.0, None),
        (4.0, None),
        (-4.0, None),
        (4.001, Some(Fault::Disagreement)),
        (-4.001, Some(Fault::Disagreement)),
        (f32::NAN, Some(Fault::Disagreement)),
    ] {
        let mut state = MonitorState::default();
        let found = [0, 1, 2].map(|_| monitor.departure(&mut state, departure_v));
        assert_eq!(found, [None, None, fault], "{departure_v}");
        // One within between them.
        let found = [departure_v, departure_v, 0.0, departure_v, departure_v];
        let mut state = MonitorState::default();
        assert!(found.iter().all(|v| monitor.departure(&mut state, *v).is_none()));
        let tick = Tick {
            departure_v,
            ..tick(0.0)
        };
        let mut state = MonitorState::default();
        let found = [0, 1, 2].map(|_| monitor.tracking(&mut state, &tick));
        assert_eq!(found, [None, None, fault], "{departure_v}");
    }
}

/// Beside another axis: a tenth of where it is, at 8 V a micrometre, either way; and none of it once it rests.
#[test]
fn bva_departures_beside_another_axis() {
    let monitor = monitor();
    for (away_um, departure_v, fault) in [
        (10.0, 11.999, None),
        (10.0, -11.999, None),
        (10.0, 12.001, Some(Fault::Disagreement)),
        (10.0, -12.001, Some(Fault::Disagreement)),
        (-10.0, 11.999, None),
        (-10.0, 12.001, Some(Fault::Disagreement)),
        (0.5, 4.399, None),
        (0.5, 4.401, Some(Fault::Disagreement)),
        (f32::NAN, 0.0, Some(Fault::Disagreement)),
    ] {
        let mut state = MonitorState::default();
        monitor.beside(&mut state, away_um);
        let found = [0, 1, 2].map(|_| monitor.departure(&mut state, departure_v));
        assert_eq!(found, [None, None, fault], "{away_um} {departure_v}");
        monitor.beside(&mut state, 0.0);
        let found = [0.0, 4.001, 4.001, 4.001].map(|v| monitor.departure(&mut state, v));
        assert_eq!(found, [None, None, None, Some(Fault::Disagreement)]);
    }
}

#[test]
fn bva_no_number_is_no_reference() {
    let monitor = monitor();
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let (of_reference, of_reading) = (
            Tick {
                reference_um: wrong,
                ..tick(0.0)
            },
            Tick {
                measured_um: wrong,
                ..tick(0.0)
            },
        );
        for tick in [of_reference, of_reading] {
            let found = monitor.tracking(&mut MonitorState::default(), &tick);
            assert_eq!(found, Some(Fault::Reference));
        }
    }
}

/// 500 limited samples in a row, 10 ms at 50 kHz.
#[test]
fn bva_saturation() {
    let monitor = monitor();
    let mut state = MonitorState::default();
    let limited = Tick {
        limited: true,
        ..tick(0.0)
    };
    for _ in 0..2 {
        for _ in 0..499 {
            assert_eq!(monitor.tracking(&mut state, &limited), None);
        }
        assert_eq!(monitor.tracking(&mut state, &tick(0.0)), None);
    }
    for _ in 0..499 {
        assert_eq!(monitor.tracking(&mut state, &limited), None);
    }
    assert_eq!(monitor.tracking(&mut state, &limited), Some(Fault::Saturated));
}

/// The mean error over 2500 samples reaches 2.5 um of 10: `5 (1 - (1 - 1/2500)^k)` on sample 1733, `2.49` never.
#[test]
fn bva_following() {
    for sign in [1.0, -1.0] {
        let monitor = monitor();
        let mut state = MonitorState::default();
        let at = (1..10_000).find(|_| monitor.tracking(&mut state, &tick(5.0 * sign)).is_some());
        assert_eq!(at, Some(1733));
        let mut state = MonitorState::default();
        assert!((0..50_000).all(|_| monitor.tracking(&mut state, &tick(2.49 * sign)).is_none()));
        let mut state = MonitorState::default();
        let fault = (0..50_000).find_map(|_| monitor.tracking(&mut state, &tick(2.6 * sign)));
        assert_eq!(fault, Some(Fault::Following));
    }
}

/// A coarse sensor: 32 codes of 0.01 um may be noise, more than 0.8 % of the range.
#[test]
fn bva_a_coarse_sensor_may_jump_further() {
    let scales = Scales {
        um_per_code: 0.01,
        ..SCALES
    };
    for (off_um, used) in [(0.319, true), (0.321, false)] {
        let monitor = Monitor::new(&scales, 500);
        let mut state = MonitorState::default();
        assert_eq!(monitor.sensor(&mut state, 500, 5.0, 5.0), (5.0, None));
        let (reading_um, _) = monitor.sensor(&mut state, 530, 5.0 + off_um, 5.0);
        assert_eq!(reading_um > 5.1, used, "{off_um}: {reading_um}");
    }
}

/// Exactly at the bounds nothing is wrong: 64 codes of 1/1024 um that the reference moved by, and a mean error of a quarter of the range,
/// `6250 / 2500`.
#[test]
fn bva_exactly_at_the_bounds() {
    let monitor = Monitor::new(
        &Scales {
            um_per_code: 1.0 / 1024.0,
            ..SCALES
        },
        500,
    );
    for (way_um, fault) in [(0.0625, None), (0.0635, Some(Fault::SensorStuck))] {
        let mut state = MonitorState::default();
        for _ in 0..49 {
            assert_eq!(monitor.sensor(&mut state, 5000, 5.0, 5.0).1, None);
        }
        assert_eq!(monitor.sensor(&mut state, 5000, 5.0, 5.0 + way_um).1, fault, "{way_um}");
    }
    for sign in [1.0, -1.0] {
        let found = |error_um: f32| {
            let far = Tick {
                reference_um: sign * error_um,
                measured_um: 0.0,
                ..tick(0.0)
            };
            monitor.tracking(&mut MonitorState::default(), &far)
        };
        assert_eq!(found(6250.0), None);
        assert_eq!(found(6251.0), Some(Fault::Following));
    }
}

/// Of a swing its farthest point counts, wherever it lies: of 0.7 and 0.1 um in any order sixteen are a fault, of 0.5 um none.
#[test]
fn bva_a_swing_is_as_wide_as_its_farthest_point() {
    let swings = |points: [f32; 3]| {
        let monitor = Monitor::new(&SCALES, 500);
        let mut state = MonitorState::default();
        (0..20).any(|swing| {
            let sign = if swing % 2 == 0 { 1.0 } else { -1.0 };
            let all = points.map(|um| monitor.tracking(&mut state, &tick(sign * um)));
            all.contains(&Some(Fault::Oscillation))
        })
    };
    for (points, fault) in [
        ([0.1, 0.7, 0.1], true),
        ([0.7, 0.1, 0.1], true),
        ([0.1, 0.1, 0.7], true),
        ([0.1, 0.5, 0.1], false),
    ] {
        assert_eq!(swings(points), fault, "{points:?}");
    }
}

/// Swings are about the mean error: after ten time constants at 2 um, which is no fault, 1.35 and 2.65 um are 0.65 um to either side of it.
#[test]
fn val_a_swing_is_about_the_mean_error() {
    let monitor = monitor();
    for sign in [1.0, -1.0] {
        let mut state = MonitorState::default();
        for _ in 0..25_000 {
            assert_eq!(monitor.tracking(&mut state, &tick(2.0 * sign)), None);
        }
        let at = (0..400).find(|k| {
            let swing_um = if k / 20 % 2 == 0 { 0.65 } else { -0.65 };
            monitor.tracking(&mut state, &tick(2.0 * sign + swing_um)) == Some(Fault::Oscillation)
        });
        assert!(at.is_some_and(|at| at <= 340), "{at:?}");
    }
}

/// Sixteen swings of more than 6 % of the range, each within 50 samples and a quarter of the reference's half period.
#[test]
fn bva_oscillation() {
    let first = |half_period: u32, samples: usize, swing_um: f32| {
        let monitor = Monitor::new(&SCALES, half_period);
        let mut state = MonitorState::default();
        (0..20 * samples).find(|k| {
            let sign = if (k / samples).is_multiple_of(2) { 1.0 } else { -1.0 };
            monitor.tracking(&mut state, &tick(sign * swing_um)) == Some(Fault::Oscillation)
        })
    };
    // The first crossing ends the first swing, the sixteenth the sixteenth.
    assert_eq!(first(500, 20, 0.65), Some(320));
    assert_eq!(first(500, 20, 0.55), None);
    assert_eq!(first(500, 50, 0.65), Some(800));
    assert_eq!(first(500, 51, 0.65), None);
    // A reference of 500 Hz: 12 samples at most.
    assert_eq!(first(50, 12, 0.65), Some(192));
    assert_eq!(first(50, 13, 0.65), None);
}

#[test]
fn bva_late_ticks() {
    let monitor = monitor();
    let mut state = MonitorState::default();
    let found = [true, true, false, true, true, true, true].map(|late| monitor.clock(&mut state, late));
    let late = Some(Fault::Overrun);
    assert_eq!(found, [None, None, None, None, None, late, late]);
}

/// Numbers that frames carry: no two alike, and none but these.
#[test]
fn golden_fault_numbers() {
    let numbers = Fault::ALL.map(|fault| fault as u8);
    assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
    for code in 0..=31 {
        assert_eq!(
            Fault::from_code(code).map_or(0, |fault| fault as u8),
            if code < 12 { code } else { 0 }
        );
    }
}
