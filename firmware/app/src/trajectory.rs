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
    /// A staircase of quarters to the highest point and back, eight steps a period: half of each is held, then half a cosine leads to
    /// the next. A jump would make the stage ring, which [`crate::monitor::Fault::Oscillation`] is for.
    Steps = 3,
    /// What the host has uploaded, with straight lines between its points.
    Table = 4,
    /// From the middle outwards and back: a cosine whose width grows to the whole over [`SPIRAL_TURNS`] turns and shrinks again.
    Spiral = 5,
    /// The same with the sine, for the other axis.
    SpiralSine = 6,
}

/// Turns of a spiral from the middle to its end.
pub const SPIRAL_TURNS: u32 = 20;

impl Shape {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Sine,
        Self::ComplexHarmonic,
        Self::Triangle,
        Self::Steps,
        Self::Table,
        Self::Spiral,
        Self::SpiralSine,
    ];

    /// The shape of a number; `None` where there is none.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|shape| *shape as u8 == code)
    }

    /// Highest harmonic that matters: of a triangle the fifth has 4 % of the first; of a staircase it is the steps themselves. A table
    /// may have more, but what swings faster than its sixteenth counts as the loop's.
    pub fn highest_harmonic(self) -> u32 {
        match self {
            Self::Sine | Self::Spiral | Self::SpiralSine => 1,
            Self::ComplexHarmonic | Self::Triangle => 3,
            Self::Steps => 8,
            Self::Table => 16,
        }
    }
}

/// Largest value of `0.25 sin x + 0.3 sin 3x`: where `0.25 cos x + 0.9 cos 3x = 0`, `cos^2 x = 2.45 / 3.6`.
pub const COMPLEX_HARMONIC_PEAK: f32 = 0.433_315_53;

/// Points of an uploaded table: one period.
pub const TABLE_POINTS: usize = 256;
/// Points that are uploaded at once.
pub const CHUNK_POINTS: usize = 8;

/// What the host has uploaded: shares of the way from the lowest position to the highest, in 1/65535. At first all are the lowest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Uploaded {
    shares: [u16; TABLE_POINTS],
}

impl Default for Uploaded {
    fn default() -> Self {
        Self {
            shares: [0; TABLE_POINTS],
        }
    }
}

impl Uploaded {
    /// Puts a chunk in its place, counted in chunks; `false` where there is none.
    pub fn put(&mut self, chunk: u8, shares: [u16; CHUNK_POINTS]) -> bool {
        let (places, _) = self.shares.as_chunks_mut();
        match places.get_mut(usize::from(chunk)) {
            Some(place) => {
                *place = shares;
                true
            }
            None => false,
        }
    }

    /// From -1 at the lowest position to 1 at the highest; the last point leads to the first.
    #[inline(always)]
    fn at(&self, phase: u32) -> f32 {
        const SHIFT: u32 = 32 - TABLE_POINTS.ilog2();
        let place = (phase >> SHIFT) as usize;
        // 24 bits are exact in f32.
        let share = (phase & ((1 << SHIFT) - 1)) as f32 * (1.0 / (1_u32 << SHIFT) as f32);
        let point = |i: usize| f32::from(self.shares[i % TABLE_POINTS]);
        let (from, to) = (point(place), point(place + 1));
        (from + (to - from) * share) * (2.0 / 65_535.0) - 1.0
    }
}

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
    /// Of a spiral's width, a turn for out and in.
    slow_phase: u32,
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
            slow_phase: 0,
        }
    }

    /// Where it begins, micrometres.
    pub fn first_um(&self, uploaded: &Uploaded) -> f32 {
        match self.shape {
            Shape::Sine | Shape::Triangle | Shape::Steps => self.middle_um - self.amplitude_um,
            Shape::ComplexHarmonic | Shape::Spiral | Shape::SpiralSine => self.middle_um,
            Shape::Table => self.middle_um + self.amplitude_um * uploaded.at(0),
        }
    }

    /// The reference of this tick, micrometres.
    #[inline(always)]
    pub fn next_um(&mut self, uploaded: &Uploaded) -> f32 {
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
            Shape::Steps => {
                let level = |eighth: u32| if eighth < 5 { eighth } else { 8 - eighth } as f32 * 0.5;
                let (from, to) = (level(phase >> 29), level(phase.wrapping_add(1 << 29) >> 29));
                // Within the eighth: its second half is half a turn of the cosine.
                let rise = (phase << 3).saturating_sub(1 << 31);
                from + (to - from) * (0.5 - 0.5 * cosine(rise)) - 1.0
            }
            Shape::Table => uploaded.at(phase),
            Shape::Spiral => self.next_width() * cosine(phase),
            Shape::SpiralSine => self.next_width() * cosine(phase.wrapping_sub(QUARTER)),
        };
        self.middle_um + self.amplitude_um * share
    }

    /// The width of a spiral in this tick: 0 in the middle, 1 at the end.
    #[inline(always)]
    fn next_width(&mut self) -> f32 {
        let phase = self.slow_phase;
        self.slow_phase = phase.wrapping_add(self.step / (2 * SPIRAL_TURNS));
        phase.cast_signed().unsigned_abs() as f32 * (1.0 / (1_u32 << 31) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0 at both ends of the period, the highest code in its middle.
    fn parabola(i: usize) -> u16 {
        (4 * 65_535 * i * (TABLE_POINTS - i) / (TABLE_POINTS * TABLE_POINTS)) as u16
    }

    #[test]
    fn val_shapes_against_the_library() {
        let step = 42_949_673; // 500 Hz at 50 kHz
        // What a width's phase loses of its step adds up to 4e-6 of a spiral's period over 2000 turns of 20.
        let width = |k: u32| 1.0 - (2.0 * (f64::from(k) * 500.0 / 50e3 / 40.0).fract() - 1.0).abs();
        let exact = |shape: Shape, turn: f64, k: u32| {
            let x = turn * core::f64::consts::TAU;
            match shape {
                Shape::Sine => 1.0 - x.cos(),
                Shape::ComplexHarmonic => {
                    1.0 + (0.25 * x.sin() + 0.3 * (3.0 * x).sin()) / f64::from(COMPLEX_HARMONIC_PEAK)
                }
                Shape::Triangle => 2.0 * (1.0 - (2.0 * turn - 1.0).abs()),
                Shape::Steps => {
                    let level = |eighth: f64| 0.5 * (4.0 - (eighth - 4.0).abs());
                    let (from, to) = (level((8.0 * turn).floor()), level(((8.0 * turn).floor() + 1.0) % 8.0));
                    let rise = (2.0 * (8.0 * turn).fract() - 1.0).max(0.0);
                    from + (to - from) * 0.5 * (1.0 - (core::f64::consts::PI * rise).cos())
                }
                // A parabola's points, and straight lines between them.
                Shape::Table => {
                    let point = |i: f64| 2.0 * parabola((i as usize) % TABLE_POINTS) as f64 / 65_535.0;
                    let place = TABLE_POINTS as f64 * turn;
                    let (from, to) = (point(place.floor()), point(place.floor() + 1.0));
                    from + (to - from) * place.fract()
                }
                Shape::Spiral => 1.0 + width(k) * x.cos(),
                Shape::SpiralSine => 1.0 + width(k) * x.sin(),
            }
        };
        let mut uploaded = Uploaded::default();
        for chunk in 0..=255_u8 {
            let first = CHUNK_POINTS * usize::from(chunk);
            let shares = core::array::from_fn(|i| parabola((first + i) % TABLE_POINTS));
            assert_eq!(uploaded.put(chunk, shares), first < TABLE_POINTS, "{chunk}");
        }
        for shape in Shape::ALL {
            let slow = if matches!(shape, Shape::Spiral | Shape::SpiralSine) {
                1e-4
            } else {
                0.0
            };
            let mut trajectory = Trajectory::new(shape, 0.0, 2.0, step);
            assert!((f64::from(trajectory.first_um(&uploaded)) - exact(shape, 0.0, 0)).abs() < 1e-7);
            for k in 0..100_000_u32 {
                let turn = f64::from(k.wrapping_mul(step)) / 2_f64.powi(32);
                let found = f64::from(trajectory.next_um(&uploaded));
                // The table's 4.7e-6, for the complex harmonic 0.55 / 0.43 of it, and three roundings of numbers up to 2.
                assert!(
                    (found - exact(shape, turn, k)).abs() < 6.1e-6 + 4e-7 + slow,
                    "{shape:?} {k}: {found}"
                );
                assert!((-1e-6..=2.0 + 1e-6).contains(&found), "{shape:?} {k}: {found}");
            }
        }
    }
}
