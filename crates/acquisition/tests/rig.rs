//! What is said of the rig, and what is not: each finding on records that show it, and on records that only look alike.
#![expect(clippy::unwrap_used, reason = "noise that cannot be drawn fails the test")]

mod common;

use common::{dataset, with_noise};
use hysteron_acquisition::{Finding, Kind, clipped_at, inspect, mistakes};
use hysteron_data::{Record, Role};
use std::f64::consts::TAU;

const PERIOD_S: f64 = 50e-6;
const NOISE_UM: f64 = 1e-4;

/// A stage whose loops lean: one play of 6 V, whose corner lies beside every turn.
fn stage(voltage_v: &[f64]) -> Vec<f64> {
    let mut play = voltage_v.first().copied().unwrap_or(0.0);
    let moved = voltage_v.iter().map(|&v| {
        play = play.clamp(v - 6.0, v + 6.0);
        0.07 * v + 0.03 * play
    });
    with_noise(moved.collect(), NOISE_UM, voltage_v.len() as u64)
}

fn record(file: &str, voltage_v: Vec<f64>, position_um: Vec<f64>) -> Record {
    Record::new(file, Role::Identify, PERIOD_S, voltage_v, position_um)
}

fn sine(hz: f64, periods: f64) -> Vec<f64> {
    let n = (periods / hz / PERIOD_S) as usize;
    (0..n)
        .map(|k| 50.0 - 50.0 * (TAU * hz * k as f64 * PERIOD_S).cos())
        .collect()
}

/// What is found of a kind.
fn found(records: Vec<Record>, kind: Kind) -> Option<Finding> {
    inspect(&dataset(records)).of(kind).next().cloned()
}

fn sines(early: usize) -> Vec<Record> {
    let each = [5.0, 13.0, 41.0, 97.0, 211.0].into_iter().map(|hz| {
        let mut voltage_v = sine(hz, 8.0);
        let position_um = stage(&voltage_v).split_off(early);
        voltage_v.truncate(position_um.len());
        record(&format!("{hz}.csv"), voltage_v, position_um)
    });
    each.collect()
}

/// Loops that lean seem to lead by a share of each period; a skew is the same time in all of them, and told to a third of a sample.
#[test]
fn val_a_lead_is_told_from_loops_that_lean() {
    assert_eq!(found(sines(0), Kind::PositionLeads), None);
    let lead = found(sines(3), Kind::PositionLeads).unwrap().figure;
    let off_s = lead.value - 3.0 * PERIOD_S;
    assert!(off_s.abs() < PERIOD_S / 3.0, "{lead}");
    // One rate alone tells neither.
    let alone = sines(3).into_iter().filter(|record| record.file == "97.csv").collect();
    assert_eq!(found(alone, Kind::PositionLeads), None);
}

/// A monitor is noisy in every record; a decaying triangle is no period plus noise.
#[test]
fn val_a_measured_voltage_is_noisy_everywhere() {
    let decaying: Vec<f64> = (0..20_000)
        .map(|k| {
            let phase = f64::from(k % 1000) / 500.0;
            let triangle = if phase < 1.0 { phase } else { 2.0 - phase };
            50.0 * (1.0 - f64::from(k) / 20_000.0) * triangle
        })
        .collect();
    let records = |noise_v: f64| -> Vec<Record> {
        let mut voltages = vec![sine(11.3, 12.0), sine(97.0, 40.0), sine(41.7, 20.0)];
        voltages.push(decaying.clone());
        let each = voltages.into_iter().zip(1..).map(|(voltage_v, seed)| {
            let position_um = stage(&voltage_v);
            record(
                &format!("{seed}.csv"),
                with_noise(voltage_v, noise_v, seed),
                position_um,
            )
        });
        each.collect()
    };
    assert_eq!(found(records(0.0), Kind::MeasuredVoltage), None);
    let told = found(records(0.02), Kind::MeasuredVoltage).unwrap();
    assert!(told.records.len() >= 3, "{told}");
    assert!((0.5..2.0).contains(&(told.figure.value / 0.02)), "{told}");
}

/// A converter of seven bits is coarse; a command of a few levels is no converter.
#[test]
fn val_coarse_codes_are_no_command_of_few_levels() {
    let rounded = |step_v: f64| {
        let voltage_v: Vec<f64> = sine(11.0, 6.0).iter().map(|v| (v / step_v).round() * step_v).collect();
        let position_um = stage(&voltage_v);
        vec![record("sine.csv", voltage_v, position_um)]
    };
    assert_eq!(found(rounded(100.0 / 16384.0), Kind::CoarseCodes), None);
    let coarse = found(rounded(100.0 / 128.0), Kind::CoarseCodes).unwrap();
    assert!((coarse.figure.value - 7.0).abs() < 0.1, "{coarse}");
    let levels: Vec<f64> = (0..20_000).map(|k| f64::from(k / 100 % 5) * 10.0).collect();
    let position_um = stage(&levels);
    assert_eq!(
        found(vec![record("levels.csv", levels, position_um)], Kind::CoarseCodes),
        None
    );
}

/// A bit that is always set leaves gaps that the position passes; a hum jumps over codes and leaves none.
#[test]
fn val_a_stuck_bit_is_told_from_a_hum() {
    let voltage_v = sine(0.7, 4.0);
    let step_um = 1e-3;
    let codes = |hum_um: f64, bit: u32| -> Vec<Record> {
        let read = stage(&voltage_v).into_iter().enumerate().map(|(k, y)| {
            let hum = hum_um * (TAU * 50.0 * k as f64 * PERIOD_S).sin();
            f64::from(((y + hum + 1.0) / step_um) as u32 | bit) * step_um
        });
        vec![record("slow.csv", voltage_v.clone(), read.collect())]
    };
    assert_eq!(found(codes(0.0, 0), Kind::MissingCodes), None);
    assert_eq!(found(codes(2.0, 0), Kind::MissingCodes), None);
    assert!(found(codes(0.0, 1 << 6), Kind::MissingCodes).is_some());
}

/// Readings at the end of a converter's range count as clipped in every record; the turns of a stage do not.
#[test]
fn val_clipped_ends_are_those_of_all_records() {
    let voltage_v = sine(11.0, 4.0);
    let of = |top_um: f64| -> Vec<Record> {
        let position_um = stage(&voltage_v).into_iter().map(|y| y.min(top_um)).collect();
        vec![record("sine.csv", voltage_v.clone(), position_um)]
    };
    assert!(clipped_at(&of(20.0)).is_empty());
    assert_eq!(clipped_at(&of(8.0)), [8.0]);
    let clipped = found(of(8.0), Kind::Clipped).unwrap();
    assert!(clipped.figure.value > 10.0, "{clipped}");
}

/// The mistakes that are warned of, by kind.
fn mistaken(records: Vec<Record>) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = mistakes(&dataset(records))
        .into_iter()
        .map(|found| found.kind)
        .collect();
    kinds.dedup();
    kinds
}

/// Records of several rates, each column turned by a function.
fn turned(voltage: impl Fn(&[f64]) -> Vec<f64>, position: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Record> {
    let each = [5.0, 13.0, 41.0, 97.0].into_iter().map(|hz| {
        let voltage_v = sine(hz, 6.0);
        let position_um = stage(&voltage_v);
        record(&format!("{hz}.csv"), voltage(&voltage_v), position(&position_um))
    });
    each.collect()
}

fn same(values: &[f64]) -> Vec<f64> {
    values.to_vec()
}

fn times(factor: f64) -> impl Fn(&[f64]) -> Vec<f64> {
    move |values| values.iter().map(|value| factor * value).collect()
}

/// Each mistake of a laboratory is said, and none where there is none, be the sensor upside down or its steps coarse.
#[test]
fn val_mistakes_of_laboratories_are_said() {
    assert_eq!(mistaken(turned(same, same)), []);
    assert_eq!(mistaken(turned(same, times(-1.0))), []);
    for step_um in [0.001, 0.02, 0.5] {
        let coarse = move |values: &[f64]| values.iter().map(|y| (y / step_um).round() * step_um).collect();
        assert_eq!(mistaken(turned(same, coarse)), [], "steps of {step_um} um");
    }
    assert_eq!(mistaken(turned(same, times(1e-6))), [Kind::OtherUnits], "metres");
    assert_eq!(mistaken(turned(same, times(1e3))), [Kind::OtherUnits], "nanometres");
    assert_eq!(
        mistaken(turned(times(1e-3 / 150.0), same)),
        [Kind::OtherUnits],
        "kilovolts of a monitor"
    );
    let swapped = turned(same, same).into_iter().map(|record| {
        let (voltage_v, position_um) = (record.position_um, record.voltage_v);
        Record::new(&record.file, record.role, record.period_s, voltage_v, position_um)
    });
    assert_eq!(mistaken(swapped.collect()), [Kind::SwappedColumns]);
    let clipped = |values: &[f64]| values.iter().map(|y| y.min(8.0)).collect();
    assert_eq!(mistaken(turned(same, clipped)), [Kind::Clipped]);
    let stuck = |values: &[f64]| {
        let (from, to) = (values.len() / 3, values.len() / 2);
        let mut values = values.to_vec();
        let at = values[from];
        values[from..to].fill(at);
        values
    };
    assert_eq!(mistaken(turned(same, stuck)), [Kind::StuckSensor]);
    let held = |values: &[f64]| (0..values.len()).map(|k| values[k - k % 4]).collect();
    let found = mistaken(turned(same, held));
    assert!(found.contains(&Kind::HeldSamples), "{found:?}");
}

/// Voltage and position of a stage, the position sampled by a clock that is faster by some parts in a million, after a lag that changes
/// by a share of a second a second.
fn on_two_clocks(rates: &[f64], drive_ppm: f64, position_ppm: f64, later: f64) -> Vec<Record> {
    let each = rates.iter().map(|&hz| {
        let n = (40.0 / hz / PERIOD_S) as usize;
        let at = |t: f64| 50.0 - 50.0 * (TAU * hz * (1.0 + 1e-6 * drive_ppm) * t).cos();
        let time = |k: usize, ppm: f64| k as f64 * PERIOD_S / (1.0 + 1e-6 * ppm);
        let voltage_v: Vec<f64> = (0..n).map(|k| at(time(k, 0.0))).collect();
        let moved = (0..n).map(|k| {
            let t = time(k, position_ppm);
            at(t - 3.0 * PERIOD_S - later * (TAU * hz * t / 200.0).sin())
        });
        record(&format!("{hz}.csv"), voltage_v, stage(&moved.collect::<Vec<_>>()))
    });
    each.collect()
}

/// Two clocks are one difference at every rate; a drive off the clock, a lag, and a lag that comes and goes are none.
#[test]
fn val_two_clocks_are_told() {
    let rates = [19.0, 41.0, 83.0];
    for ppm in [30.0, -100.0, 400.0] {
        let told = found(on_two_clocks(&rates, 0.0, ppm, 0.0), Kind::DifferentClocks)
            .unwrap()
            .figure;
        assert!((told.value / ppm - 1.0).abs() < 0.03, "{ppm}: {told}");
    }
    for (drive_ppm, later) in [(0.0, 0.0), (100.0, 0.0), (0.0, 1e-4)] {
        let records = on_two_clocks(&rates, drive_ppm, 0.0, later);
        assert_eq!(found(records, Kind::DifferentClocks), None, "{drive_ppm} ppm, {later}");
    }
    // One rate alone does not tell a clock from a lag that grows.
    assert_eq!(
        found(on_two_clocks(&[41.0], 0.0, 400.0, 0.0), Kind::DifferentClocks),
        None
    );
}

/// A tone of neither drive nor mains is said, on few periods as on many; harmonics that fold, hum, and what rings are none.
#[test]
fn val_tones_are_no_harmonics() {
    let with = |voltage_v: Vec<f64>, hz: f64, size_um: f64| {
        let read = stage(&voltage_v).into_iter().enumerate();
        let read = read
            .map(|(k, y)| y + size_um * (TAU * hz * k as f64 * PERIOD_S).sin())
            .collect();
        vec![record("one.csv", voltage_v, read)]
    };
    let triangle = |hz: f64, periods: f64| -> Vec<f64> {
        let n = (periods / hz / PERIOD_S) as usize;
        (0..n)
            .map(|k| 100.0 * (2.0 * (hz * k as f64 * PERIOD_S).fract() - 1.0).abs())
            .collect()
    };
    // 45.32 kHz folds to 5.32 kHz at 20 kHz.
    for voltage_v in [sine(11.0, 3.4), sine(97.0, 40.0), triangle(37.3, 25.0)] {
        let n = voltage_v.len();
        let tone = found(with(voltage_v.clone(), 45_320.0, 0.05), Kind::Tone);
        let tone = tone.unwrap_or_else(|| panic!("none in {n} samples"));
        assert!((tone.figure.value - 5320.0).abs() < 10.0, "{tone}");
        assert_eq!(found(with(voltage_v.clone(), 45_320.0, 0.0), Kind::Tone), None);
        assert_eq!(found(with(voltage_v, 150.0, 0.05), Kind::Tone), None, "hum");
    }
    for hz in [617.3, 1490.0, 2713.0] {
        assert_eq!(
            found(with(triangle(hz, 300.0), 45_320.0, 0.0), Kind::Tone),
            None,
            "{hz} Hz folds"
        );
    }
}

/// Nothing is said of next to nothing, and nothing fails on it.
#[test]
fn bva_records_of_few_samples() {
    for n in 2..40 {
        let voltage_v: Vec<f64> = (0..n).map(|k| f64::from(k % 7)).collect();
        let records = vec![record("short.csv", voltage_v.clone(), stage(&voltage_v))];
        assert!(!mistaken(records).contains(&Kind::Tone), "{n} samples");
    }
}
