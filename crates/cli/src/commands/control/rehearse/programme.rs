//! The records that a board takes of the stage: what it can play with a straight line for a law and 256 points of a reference.

use crate::commands::control::chip::RATE_HZ;
use hysteron_board::{Shape, TABLE_POINTS};
use hysteron_data::Role;
use hysteron_plant::StageError;
use hysteron_plant::excitation::{DecayingTriangle, Excitation};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// One record.
pub(super) struct Piece {
    pub name: &'static str,
    pub role: Role,
    pub shape: Shape,
    /// Turns a second.
    pub frequency_hz: f64,
    /// Lowest and highest reference, shares of the whole.
    pub range: [f64; 2],
    /// Points of a reference of its own, one period.
    pub points: Option<[u16; TABLE_POINTS]>,
    /// Seconds of the reference; the rise to it is kept as well. The board stays at rest where the range is empty.
    pub kept_s: f64,
    /// Every how many ticks a row is kept.
    pub every: usize,
}

/// Turns a second of a reference whose points are so many ticks apart.
fn a_point_every(ticks: u32) -> f64 {
    RATE_HZ / f64::from(ticks * TABLE_POINTS as u32)
}

/// Sines from 1 to 503 Hz, minor loops, a multisine, holds, a rest, and others to judge by: what the host's rehearsal records, with
/// references of 256 points where those are drawn freely. Before each the stage has rested at 0 V for long.
pub(super) fn programme(seed: u64) -> Result<Vec<Piece>, StageError> {
    use Role::{Identify, Validate};
    let sine = |name, role, frequency_hz: f64, high: f64, periods: f64, every| Piece {
        name,
        role,
        shape: Shape::Sine,
        frequency_hz,
        range: [0.0, high],
        points: None,
        kept_s: periods / frequency_hz,
        every,
    };
    let drawn = |name, role, range, points, ticks: u32, periods: f64, every| Piece {
        name,
        role,
        shape: Shape::Table,
        frequency_hz: a_point_every(ticks),
        range,
        points: Some(points),
        // The way back to the first point is none of it.
        kept_s: (periods - 1.0 / TABLE_POINTS as f64) / a_point_every(ticks),
        every,
    };
    let harmonic = Piece {
        name: "complex-harmonic",
        shape: Shape::ComplexHarmonic,
        ..sine("", Validate, 13.0, 1.0, 4.0, 4)
    };
    let rest = Piece {
        name: "rest",
        range: [0.0, 0.0],
        kept_s: 1.5,
        ..sine("", Identify, 1.0, 1.0, 1.0, 25)
    };
    let whole = [0.0, 1.0];
    Ok(vec![
        sine("sine-001hz", Identify, 1.0, 1.0, 3.0, 100),
        sine("sine-011hz", Identify, 11.0, 1.0, 5.0, 20),
        sine("sine-047hz", Validate, 47.0, 1.0, 6.0, 10),
        sine("sine-097hz", Identify, 97.0, 1.0, 8.0, 5),
        sine("sine-193hz", Validate, 193.0, 1.0, 12.0, 2),
        sine("sine-503hz", Identify, 503.0, 1.0, 20.0, 1),
        sine("sine-011hz-small", Identify, 11.0, 0.4, 5.0, 20),
        sine("sine-097hz-small", Validate, 97.0, 0.4, 8.0, 5),
        drawn("minor-loops", Identify, whole, minor_loops()?, 1000, 1.0, 50),
        drawn("multisine", Identify, [0.49, 0.51], multisine(seed ^ 1), 4, 8.0, 1),
        drawn("noise", Validate, [0.2, 0.8], noise(seed), 120, 1.0, 5),
        harmonic,
        drawn("holds", Identify, whole, holds(&[0.0, 0.6, 0.9, 0.3]), 4000, 1.0, 500),
        drawn("hold", Validate, whole, holds(&[0.0, 0.7]), 3000, 1.0, 500),
        rest,
    ])
}

/// The nearest of 65536 shares.
fn share(value: f64) -> u16 {
    // `as` saturates.
    (value * 65_535.0).round() as u16
}

/// Turning points that close in on the middle.
fn minor_loops() -> Result<[u16; TABLE_POINTS], StageError> {
    let triangle = DecayingTriangle {
        high_v: 1.0,
        centre_v: 0.53,
        decay: 0.88,
        turns: 24,
        slope_v_per_s: 1.0,
    };
    // Much finer than the points, to know how long it is.
    const FINE_S: f64 = 1e-3;
    let fine = triangle.samples(FINE_S)?;
    Ok(std::array::from_fn(|k| {
        share(fine[k * (fine.len() - 1) / (TABLE_POINTS - 1)])
    }))
}

/// Harmonics 1 to 80 with phases at random, the period's peaks at the ends of the range: 49 Hz to 3.9 kHz, four ticks a point. Small:
/// a mode multiplies a line by fifty, and the board takes swings of 6 % of the range for an oscillation.
fn multisine(seed: u64) -> [u16; TABLE_POINTS] {
    const HARMONICS: usize = 80;
    let mut rng = Pcg64::seed_from_u64(seed);
    let phases: [f64; HARMONICS] = std::array::from_fn(|_| rng.random_range(0.0..TAU));
    let values: [f64; TABLE_POINTS] = std::array::from_fn(|k| {
        let turn = TAU * k as f64 / TABLE_POINTS as f64;
        let harmonics = (1..).zip(phases);
        harmonics.map(|(n, phase)| (f64::from(n) * turn + phase).cos()).sum()
    });
    let peak = values.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
    values.map(|value| share(0.5 + 0.5 * value / peak))
}

/// Points at random with straight lines between them, more of them near the middle than at the ends.
fn noise(seed: u64) -> [u16; TABLE_POINTS] {
    let mut rng = Pcg64::seed_from_u64(!seed);
    std::array::from_fn(|_| share(0.5 * (rng.random_range(0.0..1.0) + rng.random_range(0.0..1.0))))
}

/// Levels, each as long as the others, with a point's time from one to the next.
fn holds(levels: &[f64]) -> [u16; TABLE_POINTS] {
    std::array::from_fn(|k| share(levels[k * levels.len() / TABLE_POINTS]))
}
