//! What the ticks are counted over: references in the table's range, and a sensor that follows them late and with noise.

use hysteron_firmware::table;
use hysteron_firmware::trajectory::{Shape, Trajectory, Uploaded};

/// Kinds of references.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Sine10,
    Sine500,
    /// A sine of 100 Hz that decays by 5 % a period.
    Nested,
    /// White noise over the range, a new value each tick.
    Noise,
    /// Random targets at random speeds, held for random times.
    Random,
}

impl Kind {
    pub const ALL: [Self; 5] = [Self::Sine10, Self::Sine500, Self::Nested, Self::Noise, Self::Random];

    pub fn name(self) -> &'static str {
        match self {
            Self::Sine10 => "sine-10-Hz",
            Self::Sine500 => "sine-500-Hz",
            Self::Nested => "nested-loops",
            Self::Noise => "noise",
            Self::Random => "random",
        }
    }
}

/// A reference and a sensor, tick by tick; the same in every run.
pub struct Signal {
    kind: Kind,
    sine: Trajectory,
    uploaded: Uploaded,
    share: f32,
    number: u32,
    seed: u32,
    target_um: f32,
    step_um: f32,
    hold: u32,
    reference_um: f32,
    position_um: f32,
}

const LOW_UM: f32 = table::INPUT_MIN_UM;
const RANGE_UM: f32 = table::INPUT_MAX_UM - table::INPUT_MIN_UM;

impl Signal {
    pub fn new(kind: Kind) -> Self {
        let hz = match kind {
            Kind::Sine10 => 10.0,
            Kind::Sine500 => 500.0,
            _ => 100.0,
        };
        let step = (hz / table::SAMPLE_RATE_HZ * 4_294_967_296.0) as u32;
        Self {
            kind,
            sine: Trajectory::new(Shape::Sine, -0.5, 0.5, step),
            uploaded: Uploaded::default(),
            share: 1.0,
            number: 0,
            seed: 1,
            target_um: LOW_UM,
            step_um: 0.0,
            hold: 0,
            reference_um: LOW_UM,
            position_um: LOW_UM,
        }
    }

    /// A number from 0 to 1: Marsaglia's xorshift (J. Stat. Softw. 8 (2003) 14).
    fn random(&mut self) -> f32 {
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 17;
        self.seed ^= self.seed << 5;
        (self.seed >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// The sensor's code and the reference of a tick.
    pub fn next(&mut self) -> (u16, f32) {
        self.reference_um = match self.kind {
            Kind::Noise => LOW_UM + RANGE_UM * self.random(),
            Kind::Random => self.towards(),
            kind => {
                if kind == Kind::Nested && self.number.is_multiple_of(500) {
                    self.share *= 0.95;
                }
                LOW_UM + RANGE_UM * (0.5 + self.share * self.sine.next_um(&self.uploaded))
            }
        };
        self.number += 1;
        // A lag of 100 us, and two codes of noise.
        self.position_um += 0.2 * (self.reference_um - self.position_um);
        let codes = (self.position_um - table::ADC_MIN_UM) * (65_535.0 / (table::ADC_TOP_UM - table::ADC_MIN_UM));
        ((codes + 2.0 * self.random()) as u16, self.reference_um)
    }

    fn towards(&mut self) -> f32 {
        if self.hold > 0 {
            self.hold -= 1;
            return self.reference_um;
        }
        let left_um = self.target_um - self.reference_um;
        if left_um <= self.step_um && left_um >= -self.step_um {
            let arrived_um = self.target_um;
            self.target_um = LOW_UM + RANGE_UM * self.random();
            // From 1/2000 of the range a tick up to the whole of it at once.
            let share = self.random();
            self.step_um = RANGE_UM * (0.0005 + share * share * share * share);
            self.hold = (20.0 * self.random()) as u32;
            return arrived_um;
        }
        self.reference_um + if left_um > 0.0 { self.step_um } else { -self.step_um }
    }
}
