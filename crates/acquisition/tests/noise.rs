//! The noise floor on records whose noise is known.
#![expect(clippy::unwrap_used, reason = "noise that cannot be drawn fails the test")]

mod common;

use common::{dataset, noise, with_noise};
use hysteron_acquisition::{Basis, NoiseSource, noise_floor};
use hysteron_data::{Dataset, Known, Record, Role};
use std::f64::consts::TAU;

fn record(period_s: f64, voltage_v: Vec<f64>, position_um: Vec<f64>) -> Record {
    Record::new("a.csv", Role::Identify, period_s, voltage_v, position_um)
}

/// A bank of plays: 0.1 um/V, loops that are 15 % open.
fn stage(voltage_v: &[f64]) -> Vec<f64> {
    let thresholds = [0.5, 1.0, 2.0, 3.0, 4.0, 6.0];
    let mut plays = thresholds.map(|_| 0.0f64);
    voltage_v
        .iter()
        .map(|&v| {
            let moved = plays.iter_mut().zip(thresholds).map(|(w, r)| {
                *w = w.clamp(v - r, v + r);
                *w
            });
            0.07 * v + 0.005 * moved.sum::<f64>()
        })
        .collect()
}

fn sine(n: usize, hz: f64, period_s: f64) -> Vec<f64> {
    (0..n)
        .map(|k| 10.0 - 10.0 * (TAU * hz * k as f64 * period_s).cos())
        .collect()
}

/// The estimate's own standard error is 1 to 2 % on these records, and the least of several lies up to two below.
fn near(found: f64, truth: f64) -> bool {
    (0.94..1.06).contains(&(found / truth))
}

#[test]
fn val_a_drive_off_the_clock_adds_no_noise() {
    for ppm in [0.0, 100.0, 250.0, 500.0, -1000.0] {
        let v = sine(20_000, 5.0 * (1.0 + 1e-6 * ppm), 1e-3);
        let y = with_noise(stage(&v), 2e-3, 1);
        let floor = noise_floor(&dataset(vec![record(1e-3, v, y)]));
        assert!(near(floor.rms_um, 2e-3), "{ppm} ppm: {floor}");
        assert_eq!(floor.basis, Basis::Estimate);
    }
}

#[test]
fn val_hum_of_ten_times_the_noise_is_no_noise() {
    let hum = |y: Vec<f64>, period_s: f64| -> Vec<f64> {
        let at = |k: usize| TAU * 50.02 * k as f64 * period_s;
        y.into_iter()
            .enumerate()
            .map(|(k, y)| y + 0.0283 * (at(k) + 0.3).sin() + 0.008 * (3.0 * at(k)).cos())
            .collect()
    };
    for period_s in [2e-5, 1e-3, 1e-2] {
        let v = sine(12_000, 0.0011 / period_s, period_s);
        let y = hum(with_noise(stage(&v), 2e-3, 2), period_s);
        let moving = noise_floor(&dataset(vec![record(period_s, v, y)]));
        let y = hum(noise(8000, 2e-3, 3), period_s);
        let resting = noise_floor(&dataset(vec![record(period_s, vec![5.0; 8000], y)]));
        assert!(near(moving.rms_um, 2e-3), "{period_s} s, moving: {moving}");
        assert!(near(resting.rms_um, 2e-3), "{period_s} s, at rest: {resting}");
    }
}

#[test]
fn val_triangles_random_drives_and_steps() {
    let triangle: Vec<f64> = (0..16_000)
        .map(|k| 20.0 * (2.0 * (0.00137 * f64::from(k)).fract() - 1.0).abs())
        .collect();
    // Two first-order filters at 1/60 of the sampling rate.
    let mut filtered = (0.0, 0.0);
    let random: Vec<f64> = noise(16_000, 60.0, 4)
        .into_iter()
        .map(|e| {
            filtered.0 += 0.05 * (e - filtered.0);
            filtered.1 += 0.05 * (filtered.0 - filtered.1);
            filtered.1 + 10.0
        })
        .collect();
    let steps: Vec<f64> = (0..16_000).map(|k| f64::from((k / 2000 * 7) % 20)).collect();
    for (name, v) in [("triangle", triangle), ("random", random), ("steps", steps)] {
        let y = with_noise(stage(&v), 2e-3, 5);
        let floor = noise_floor(&dataset(vec![record(1e-4, v, y)]));
        assert!((0.92..1.1).contains(&(floor.rms_um / 2e-3)), "{name}: {floor}");
    }
}

#[test]
fn val_a_rest_with_drift_offset_and_ringing() {
    let y: Vec<f64> = noise(8000, 2e-3, 6)
        .into_iter()
        .enumerate()
        .map(|(k, e)| {
            let t = k as f64;
            1000.0 + 1e-5 * t + 0.02 * (1.0 + t / 50.0).ln() + 0.3 * (-t / 300.0).exp() * (0.4 * t).sin() + e
        })
        .collect();
    let floor = noise_floor(&dataset(vec![record(1e-4, vec![0.0; 8000], y)]));
    assert_eq!(floor.source, NoiseSource::QuietRecord);
    assert!(near(floor.rms_um, 2e-3), "{floor}");
}

/// Eight bits over 20 um are steps of 78 nm: their rounding is the noise, not the sensor's 2 nm.
#[test]
fn val_a_scope_of_eight_bits() {
    let step_um = 20.0 / 256.0;
    let v = sine(5000, 10.0, 2e-4);
    let y = with_noise(stage(&v), 2e-3, 7)
        .iter()
        .map(|y| (y / step_um).round() * step_um)
        .collect();
    let floor = noise_floor(&dataset(vec![record(2e-4, v, y)]));
    let rounding = step_um / 12f64.sqrt();
    assert!((0.9..1.15).contains(&(floor.rms_um / rounding)), "{floor}");
}

#[test]
fn val_the_least_valid_one_counts_and_a_given_one_before_all() {
    let v = sine(12_000, 10.0, 1e-4);
    let jittered = with_noise(stage(&v), 9e-3, 8);
    let quiet = record(1e-4, vec![0.0; 6000], noise(6000, 2e-3, 9));
    let mut both = dataset(vec![record(1e-4, v, jittered), quiet]);
    let floor = noise_floor(&both);
    assert!(
        near(floor.rms_um, 2e-3) && floor.source == NoiseSource::QuietRecord,
        "{floor}"
    );
    both.known = Known {
        sensor_noise_um: Some(0.5),
        ..Known::default()
    };
    assert_eq!(noise_floor(&both).source, NoiseSource::Given);
}

#[test]
fn val_noise_is_never_larger_than_what_is_left() {
    let floor = noise_floor(&dataset(vec![record(1e-4, vec![0.0; 4000], noise(4000, 2e-3, 10))]));
    assert_eq!(floor.at_most(2.5e-3), floor);
    let left = floor.at_most(1e-3);
    assert_eq!(
        (left.rms_um, left.basis, left.source),
        (1e-3, Basis::UpperBound, NoiseSource::LeftByTheModel)
    );
    assert_eq!(left.to_string(), "1.00 nm rms (upper bound, what the model leaves)");
}

/// What goes with a drive that reaches half the sampling rate is no noise; what hysteresis makes of such a drive looks like it.
#[test]
fn val_a_drive_as_wide_as_the_record_tells_only_a_bound() {
    let v: Vec<f64> = noise(8000, 3.0, 11);
    let mut low = 0.0;
    let y: Vec<f64> = v
        .iter()
        .zip(noise(8000, 2e-3, 12))
        .map(|(v, e)| {
            low += 0.3 * (v - low);
            0.1 * low + e
        })
        .collect();
    let floor = noise_floor(&dataset(vec![record(1e-4, v.clone(), y)]));
    assert!(floor.basis == Basis::UpperBound && near(floor.rms_um, 2e-3), "{floor}");
    let y = with_noise(stage(&v), 2e-3, 14);
    let floor = noise_floor(&dataset(vec![record(1e-4, v, y)]));
    assert!(floor.basis == Basis::UpperBound && floor.rms_um > 4e-3, "{floor}");
}

#[test]
fn bva_records_too_short_and_sensors_that_stand_still() {
    let v: Vec<f64> = (0..20).map(f64::from).collect();
    let y = with_noise(v.iter().map(|v| 0.1 * v).collect(), 2e-3, 13);
    let floor = noise_floor(&dataset(vec![record(1.0, v, y)]));
    assert!(
        floor.basis == Basis::UpperBound && (5e-4..8e-3).contains(&floor.rms_um),
        "{floor}"
    );
    for n in [2, 3, 4, 5, 23, 24, 25, 64] {
        let floor = noise_floor(&dataset(vec![record(1.0, vec![0.0; n], vec![1.0; n])]));
        assert_eq!(floor.rms_um, 0.0, "{n}");
    }
    assert_eq!(noise_floor(&Dataset::default()).rms_um, 0.0);
}
