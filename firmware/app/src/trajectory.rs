//! The reference of each tick, from a phase counter and a table.

use crate::table::COSINE;

/// What a period looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Shape {
    /// `(1 - cos x) / 2`: from the lowest point on.
    #[default]
    Sine = 0,
    /// `1/2 + (0.25 sin x + 0.3 sin 3x) / (2 p)`, p their largest value: the paper's complex harmonic, from the middle on.
    ComplexHarmonic = 1,
    /// Straight lines to the highest point and back.
    Triangle = 2,
}

impl Shape {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Sine, Self::ComplexHarmonic, Self::Triangle];

    /// The shape of a number; `None` where there is none.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|shape| *shape as u8 == code)
    }

    /// Highest harmonic that matters: of a triangle the fifth has 4 % of the first.
    pub fn highest_harmonic(self) -> u32 {
        match self {
            Self::Sine => 1,
            Self::ComplexHarmonic | Self::Triangle => 3,
        }
    }
}

/// Largest value of `0.25 sin x + 0.3 sin 3x`: where `0.25 cos x + 0.9 cos 3x = 0`, `cos^2 x = 2.45 / 3.6`.
pub const COMPLEX_HARMONIC_PEAK: f32 = 0.433_315_53;

/// A reference between two positions.
///
/// # Cost
/// Two table look-ups at most, with straight lines between their points; off by at most 2.4e-6 of the stroke, besides `f32`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trajectory {
    shape: Shape,
    middle_um: f32,
    amplitude_um: f32,
    step: u32,
    phase: u32,
}

/// Bits of the phase below an interval of the table: 2^32 / 1024.
const FRACTION_BITS: u32 = 22;

/// A quarter of a turn.
const QUARTER: u32 = 1 << 30;

/// The cosine of a phase in 2^-32 turns.
#[inline(always)]
fn cosine(phase: u32) -> f32 {
    let place = (phase >> FRACTION_BITS) as usize;
    // 22 bits are exact in f32.
    let share = (phase & ((1 << FRACTION_BITS) - 1)) as f32 * (1.0 / (1u32 << FRACTION_BITS) as f32);
    // `place` is below 1024 and the table has 1025 points.
    let (from, to) = (COSINE[place & 1023], COSINE[(place & 1023) + 1]);
    from + (to - from) * share
}

impl Trajectory {
    /// From its first point on, between two positions, `step` / 2^32 turns a tick.
    pub fn new(shape: Shape, low_um: f32, high_um: f32, step: u32) -> Self {
        Self {
            shape,
            middle_um: 0.5 * (low_um + high_um),
            amplitude_um: 0.5 * (high_um - low_um),
            step,
            phase: 0,
        }
    }

    /// Where it begins, micrometres.
    pub fn first_um(&self) -> f32 {
        match self.shape {
            Shape::Sine | Shape::Triangle => self.middle_um - self.amplitude_um,
            Shape::ComplexHarmonic => self.middle_um,
        }
    }

    /// The reference of this tick, micrometres.
    #[inline(always)]
    pub fn next_um(&mut self) -> f32 {
        let phase = self.phase;
        self.phase = phase.wrapping_add(self.step);
        let share = match self.shape {
            Shape::Sine => -cosine(phase),
            Shape::ComplexHarmonic => {
                let sine = |phase: u32| cosine(phase.wrapping_sub(QUARTER));
                let wave = 0.25 * sine(phase) + 0.3 * sine(phase.wrapping_mul(3));
                wave * (1.0 / COMPLEX_HARMONIC_PEAK)
            }
            // Up in the first half, down in the second: the magnitude of a signed phase.
            Shape::Triangle => phase.cast_signed().unsigned_abs() as f32 * (1.0 / QUARTER as f32) - 1.0,
        };
        self.middle_um + self.amplitude_um * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_shapes_against_the_library() {
        let step = 42_949_673; // 500 Hz at 50 kHz
        let exact = |shape: Shape, turn: f64| {
            let x = turn * core::f64::consts::TAU;
            match shape {
                Shape::Sine => 1.0 - x.cos(),
                Shape::ComplexHarmonic => {
                    1.0 + (0.25 * x.sin() + 0.3 * (3.0 * x).sin()) / f64::from(COMPLEX_HARMONIC_PEAK)
                }
                Shape::Triangle => 2.0 * (1.0 - (2.0 * turn - 1.0).abs()),
            }
        };
        for shape in Shape::ALL {
            let mut trajectory = Trajectory::new(shape, 0.0, 2.0, step);
            assert!((f64::from(trajectory.first_um()) - exact(shape, 0.0)).abs() < 1e-7);
            for k in 0..100_000_u32 {
                let turn = f64::from(k.wrapping_mul(step)) / 2_f64.powi(32);
                let found = f64::from(trajectory.next_um());
                // The table's 4.7e-6, for the complex harmonic 0.55 / 0.43 of it, and three roundings of numbers up to 2.
                assert!(
                    (found - exact(shape, turn)).abs() < 6.1e-6 + 4e-7,
                    "{shape:?} {k}: {found}"
                );
                assert!((-1e-6..=2.0 + 1e-6).contains(&found), "{shape:?} {k}: {found}");
            }
        }
    }
}
