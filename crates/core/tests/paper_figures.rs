//! The paper's figures 1 and 2, computed with the core against numbers computed independently of it.

#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::mrpi::Mrpi;
use hysteron_core::thresholds::Thresholds;
use std::f64::consts::{PI, TAU};

const RATE_HZ: f64 = 50e3;

fn play(alpha_s: f64, beta_s: f64) -> Mrpi<f64, 1> {
    let bank = PlayBank::new(Thresholds::new([0.1]).unwrap(), -2.0, 2.0, RATE_HZ).unwrap();
    let coefficients = MpiCoefficients {
        offset: 0.0,
        cubic: 0.0,
        linear: 0.0,
        weights: [1.0],
    };
    Mrpi::new(bank, coefficients, Envelope { alpha_s, beta_s }).unwrap()
}

/// Vertical opening at mid stroke of the last of four periods, by linear interpolation between samples.
fn mid_stroke_opening(frequency_hz: f64) -> f64 {
    let (model, mut state) = (play(3e-4, 1e-4), PlayState::virgin());
    let a_period = (RATE_HZ / frequency_hz).round() as usize;
    let drive = |k: usize| 0.5 - 0.5 * (TAU * frequency_hz * k as f64 / RATE_HZ).cos();
    let loops: Vec<(f64, f64)> = (0..=4 * a_period)
        .map(|k| (drive(k), model.step(&mut state, drive(k))))
        .collect();
    let crossing = |rising: bool| {
        loops[3 * a_period..]
            .windows(2)
            .find(|pair| ((pair[0].0 < 0.5) == rising) && ((pair[1].0 >= 0.5) == rising))
            .map(|pair| pair[0].1 + (pair[1].1 - pair[0].1) * (0.5 - pair[0].0) / (pair[1].0 - pair[0].0))
            .unwrap()
    };
    crossing(false) - crossing(true)
}

/// Figure 1: v = 0.5 - 0.5 cos(2 pi f t), alpha = 3e-4, beta = 1e-4, r = 0.1, T = 20 us.
#[test]
fn val_figure_1_openings() {
    for (frequency_hz, opening) in [(10.0, 0.1126), (200.0, 0.3513), (500.0, 0.6520)] {
        let found = mid_stroke_opening(frequency_hz);
        assert!((found - opening).abs() < 1e-3, "{frequency_hz} Hz: {found}");
    }
    // As long as the play can follow, the opening is r + (alpha + beta) pi f: at mid stroke |v'| = pi f.
    let (found, closed) = (mid_stroke_opening(10.0), 0.1 + 4e-4 * PI * 10.0);
    assert!((found - closed).abs() < 1e-4, "{found} {closed}");
}

/// Figure 2: v = 0.25 sin(2 pi f t) + 0.3 sin(6 pi f t) + 0.5, four plays with r = 0, 1/4, 1/2, 3/4 of the largest v.
#[test]
fn val_figure_2_loops() {
    let at = |f: f64, t: f64| 0.25 * (TAU * f * t).sin() + 0.3 * (3.0 * TAU * f * t).sin() + 0.5;
    let largest = (0..100_000).map(|k| at(1.0, f64::from(k) * 1e-5)).fold(0.0, f64::max);
    assert!((largest - 0.9333).abs() < 1e-4);
    for (f, low, high, area) in [(10.0, 0.0786, 0.8463, 0.1267), (500.0, 0.0980, 0.8342, 0.4050)] {
        let bank = PlayBank::new(Thresholds::even(largest).unwrap(), -2.0, 2.0, RATE_HZ).unwrap();
        let coefficients = MpiCoefficients {
            offset: 0.0,
            cubic: -0.0820,
            linear: 0.5,
            weights: [0.2667, 0.1690, 0.0973, 0.1447],
        };
        let model = Mrpi::<f64, 4>::new(
            bank,
            coefficients,
            Envelope {
                alpha_s: 5e-4,
                beta_s: 8e-4,
            },
        )
        .unwrap();
        // The drive stands at 0.5 before it starts, as a record does.
        let mut state = PlayState::virgin();
        let a_period = (RATE_HZ / f) as usize;
        let all: Vec<(f64, f64)> = (0..=4 * a_period)
            .map(|k| {
                let v = at(f, k as f64 / RATE_HZ);
                (v, model.step(&mut state, v))
            })
            .collect();
        let last = &all[3 * a_period..];
        let (lowest, highest) = last
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), &(_, y)| (l.min(y), h.max(y)));
        let signed: f64 = last
            .windows(2)
            .map(|p| 0.5 * (p[0].1 + p[1].1) * (p[1].0 - p[0].0))
            .sum();
        assert!(
            (lowest - low).abs() < 1e-3 && (highest - high).abs() < 1e-3,
            "{f} Hz: {lowest} to {highest}"
        );
        assert!((signed.abs() - area).abs() < 1e-3, "{f} Hz: area {signed}");
    }
}
