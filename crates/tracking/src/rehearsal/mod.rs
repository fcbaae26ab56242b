//! A stage with something hidden in it, to be learned and compensated: drawn from a seed, recorded, and tracked with what was
//! designed from the records alone.

mod hide;
mod programme;
mod tracking;
mod training;

pub use hide::Hidden;

use crate::error::TrackingError;
use hysteron_control::campaign::seed_of;
use hysteron_plant::challenge::StageFamily;
use hysteron_plant::{Amplifier, Converter, Hold, Sensor, StageConfig};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A drawn stage.
#[derive(Debug, Clone)]
pub struct Rehearsal {
    /// What is hidden in it.
    pub hidden: Hidden,
    /// The stage.
    pub stage: StageConfig,
    /// The same without what is hidden.
    pub bare: StageConfig,
    /// What is hidden, in numbers.
    pub truth: String,
    /// The seed.
    pub seed: u64,
}

/// What the other axis does while references are followed, turns a second.
pub const BESIDE_HZ: f64 = 17.0;
/// Sample period of controller and fast records, seconds.
const PERIOD_S: f64 = 20e-6;

/// Families that plays can show, and that no model here has.
const FAMILIES: [StageFamily; 3] = [
    StageFamily::Preisach,
    StageFamily::SigmoidPlays,
    StageFamily::MaxwellSlip,
];

impl Rehearsal {
    /// Draws stage and effect from a seed: 8 to 20 um at 100 to 200 V, a hysteresis of a family that no model here has, 16-bit
    /// converters, 1 nm of noise.
    ///
    /// # Errors
    /// A seed that draws thresholds which no loop opening can be reached with, many times over.
    pub fn draw(hidden: Hidden, seed: u64) -> Result<Self, TrackingError> {
        let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let full_v = rng.random_range(100.0..200.0_f64).round();
        let stroke_um = rng.random_range(8.0..20.0);
        let family = FAMILIES[rng.random_range(0..FAMILIES.len())];
        let hysteresis = family.draw(&mut rng, stroke_um, full_v)?;
        let other = StageFamily::MaxwellSlip.draw(&mut rng, stroke_um, full_v)?;
        let bare = StageConfig {
            sample_period_s: PERIOD_S,
            dac: Some(Converter::UNIPOLAR_16_BIT),
            hold: Hold::Zero,
            amplifier: Amplifier::default(),
            sensor: Sensor {
                noise_rms_um: 1e-3,
                ..Sensor::default()
            },
            ..StageConfig::bare(hysteresis)
        };
        let mut stage = bare.clone();
        let truth = hide::hide(hidden, &mut stage, other, &mut rng);
        Ok(Self {
            hidden,
            stage,
            bare,
            truth,
            seed,
        })
    }

    /// The voltage of the whole stroke, volts.
    pub fn full_v(&self) -> f64 {
        self.stage.hysteresis.reference_v
    }

    /// Lowest and highest reference, micrometres: half the stroke about two fifths of it.
    pub fn range_um(&self) -> [f64; 2] {
        let stroke_um = self.stage.hysteresis.stroke_um;
        [0.15 * stroke_um, 0.65 * stroke_um]
    }

    /// Times that the other axis goes up and down, four fifths of its range, over a record: a rate of its own for each.
    pub fn cycles_beside(number: usize) -> f64 {
        [7.0, 11.0, 13.0, 17.0, 19.0][number % 5]
    }

    /// Sample period of the controller, seconds.
    pub fn period_s(&self) -> f64 {
        PERIOD_S
    }

    /// Seed of the noise of a record.
    pub fn noise_seed(&self, number: u64) -> u64 {
        seed_of(self.seed, number)
    }
}
