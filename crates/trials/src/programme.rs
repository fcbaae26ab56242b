//! The records that a board takes of the stage: what it can play with a straight line for a law and 256 points of a reference.

use crate::chip::RATE_HZ;
use hysteron_board::{Shape, TABLE_POINTS};
use hysteron_data::Role;
use hysteron_excitation::{DecayingTriangle, Excitation};
use hysteron_plant::StageError;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// One record.
pub(crate) struct Piece {
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

impl Piece {
    /// Whether the reference moves at all.
    pub(crate) fn moves(&self) -> bool {
        self.range[0] < self.range[1]
    }

    /// What it is, for a person.
    pub(crate) fn words(&self) -> String {
        if !self.moves() {
            return format!("at rest for {} s", self.kept_s);
        }
        let [low, high] = self.range.map(|share| 100.0 * share);
        let shape = match self.shape {
            Shape::Table => "reference of 256 points",
            Shape::ComplexHarmonic => "complex harmonic",
            Shape::Triangle => "triangle",
            _ => "sine",
        };
        format!(
            "{shape}, {:.4} Hz, {low:.0} to {high:.0} % of the range",
            self.frequency_hz
        )
    }

    /// Periods of a sine.
    fn sine(name: &'static str, role: Role, frequency_hz: f64, range: [f64; 2], periods: f64, every: usize) -> Self {
        Self {
            name,
            role,
            shape: Shape::Sine,
            frequency_hz,
            range,
            points: None,
            kept_s: periods / frequency_hz,
            every,
        }
    }

    /// Periods of points so many ticks apart.
    fn drawn(
        name: &'static str,
        role: Role,
        range: [f64; 2],
        (points, ticks): ([u16; TABLE_POINTS], u32),
        periods: f64,
        every: usize,
    ) -> Self {
        let frequency_hz = a_point_every(ticks);
        Self {
            shape: Shape::Table,
            points: Some(points),
            // The way back to the first point is none of it.
            kept_s: (periods - 1.0 / TABLE_POINTS as f64) / frequency_hz,
            ..Self::sine(name, role, frequency_hz, range, periods, every)
        }
    }
}

/// Harmonics of the small multisine: at four ticks a point 49 Hz to 3.9 kHz. Small: a mode multiplies a line by fifty, and the board takes
/// swings of 6 % of the range for an oscillation.
pub(crate) const HARMONICS: usize = 80;
/// Ticks from point to point of the small multisine.
pub(crate) const TICKS_A_POINT: u32 = 4;
/// Harmonics of a walk: at 300 ticks a point 0.65 to 8 Hz, so that a turn takes many points.
const WALKED: usize = 12;

/// Sines from 1 to 503 Hz, minor loops, a multisine, holds, a rest, and others to judge by: what the host's rehearsal records, with
/// references of 256 points where those are drawn freely. Before each the stage has rested at 0 V for long.
pub(crate) fn programme(seed: u64) -> Result<Vec<Piece>, StageError> {
    use Role::{Identify, Validate};
    let (whole, small) = ([0.0, 1.0], [0.0, 0.4]);
    let harmonic = Piece {
        shape: Shape::ComplexHarmonic,
        ..Piece::sine("complex-harmonic", Validate, 13.0, whole, 4.0, 4)
    };
    let rest = Piece {
        kept_s: 1.5,
        ..Piece::sine("rest", Identify, 1.0, [0.0, 0.0], 1.0, 25)
    };
    Ok(vec![
        Piece::sine("sine-001hz", Identify, 1.0, whole, 3.0, 100),
        Piece::sine("sine-011hz", Identify, 11.0, whole, 5.0, 20),
        Piece::sine("sine-047hz", Validate, 47.0, whole, 6.0, 10),
        Piece::sine("sine-097hz", Identify, 97.0, whole, 8.0, 5),
        Piece::sine("sine-193hz", Validate, 193.0, whole, 12.0, 2),
        Piece::sine("sine-503hz", Identify, 503.0, whole, 20.0, 1),
        Piece::sine("sine-011hz-small", Identify, 11.0, small, 5.0, 20),
        Piece::sine("sine-097hz-small", Validate, 97.0, small, 8.0, 5),
        Piece::drawn("minor-loops", Identify, whole, (minor_loops()?, 1000), 1.0, 50),
        Piece::drawn(
            "multisine",
            Identify,
            [0.49, 0.51],
            (small_multisine(seed ^ 1), TICKS_A_POINT),
            8.0,
            1,
        ),
        Piece::drawn("noise", Validate, [0.2, 0.8], (noise(seed), 120), 1.0, 5),
        harmonic,
        Piece::drawn("holds", Identify, whole, (holds(&[0.0, 0.6, 0.9, 0.3]), 4000), 1.0, 500),
        Piece::drawn("hold", Validate, whole, (holds(&[0.0, 0.7]), 3000), 1.0, 500),
        rest,
    ])
}

/// Slow references over the range that is followed later and about it, shares of the stroke.
pub(crate) fn training_programme(seed: u64) -> Vec<Piece> {
    const EVERY: usize = 25;
    let walk = |name, range, number: u64| {
        let points = multisine(seed ^ number, WALKED);
        Piece::drawn(name, Role::Identify, range, (points, 300), 1.0, EVERY)
    };
    let sine = |name, frequency_hz, range| Piece::sine(name, Role::Identify, frequency_hz, range, 5.0, EVERY);
    vec![
        walk("walk", [0.13, 0.72], 200),
        walk("walk-small", [0.25, 0.6], 201),
        sine("sine-007hz", 7.0, [0.13, 0.7]),
        sine("sine-007hz-small", 7.0, [0.3, 0.6]),
        sine("sine-003hz", 3.0, [0.15, 0.66]),
        Piece {
            shape: Shape::Triangle,
            ..sine("triangle-005hz", 5.0, [0.2, 0.6])
        },
    ]
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

/// The small multisine, one period.
pub(crate) fn small_multisine(seed: u64) -> [u16; TABLE_POINTS] {
    multisine(seed, HARMONICS)
}

/// Harmonics from the first on with phases at random, the period's peaks at the ends of the range.
fn multisine(seed: u64, harmonics: usize) -> [u16; TABLE_POINTS] {
    let mut rng = Pcg64::seed_from_u64(seed);
    let phases: Vec<f64> = (0..harmonics).map(|_| rng.random_range(0.0..TAU)).collect();
    let values: [f64; TABLE_POINTS] = std::array::from_fn(|k| {
        let turn = TAU * k as f64 / TABLE_POINTS as f64;
        let harmonics = (1..).zip(&phases);
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
