//! The stage, sensor and laboratory that a seed draws, before anything is hidden in them.

use rand::RngExt;
use rand_pcg::Pcg64;

use crate::config::StageConfig;
use crate::error::StageError;
use crate::hysteresis::{
    BoucWen, Family, Hysteresis, HysteresisState, Initial, MaxwellSlip, Mrpi, Preisach, SigmoidPlays,
};
use crate::sensor::Sensor;
use crate::thermal::Temperature;

/// The hysteresis family of a case's stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum StageFamily {
    /// Preisach plane with a density that depends on the bias.
    Preisach,
    /// Very many plays with sigmoid outputs.
    SigmoidPlays,
    /// Maxwell slip, 40 to 80 elements.
    MaxwellSlip,
    /// The paper's model.
    Mrpi,
    /// Bouc-Wen: outside of the play class.
    BoucWen,
}

impl StageFamily {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Preisach,
        Self::SigmoidPlays,
        Self::MaxwellSlip,
        Self::Mrpi,
        Self::BoucWen,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Preisach => "preisach",
            Self::SigmoidPlays => "sigmoid-plays",
            Self::MaxwellSlip => "maxwell-slip",
            Self::Mrpi => "mrpi",
            Self::BoucWen => "bouc-wen",
        }
    }

    /// The family of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }

    /// Whether superposed functions of plays can show its loops.
    pub fn is_play_class(self) -> bool {
        self != Self::BoucWen
    }

    /// Draws an operator of this stroke at this voltage. A loop opening that its thresholds cannot reach is drawn anew, with them.
    ///
    /// # Errors
    /// A generator of which twenty draws are all out of reach.
    pub fn draw(self, rng: &mut Pcg64, stroke_um: f64, full_v: f64) -> Result<Hysteresis, StageError> {
        const DRAWS: usize = 20;
        let mut hysteresis = self.draw_once(rng, stroke_um, full_v);
        for _ in 1..DRAWS {
            if HysteresisState::new(&hysteresis).is_ok() {
                break;
            }
            hysteresis = self.draw_once(rng, stroke_um, full_v);
        }
        HysteresisState::new(&hysteresis).map(|_| hysteresis)
    }

    fn draw_once(self, rng: &mut Pcg64, stroke_um: f64, full_v: f64) -> Hysteresis {
        let family = match self {
            Self::Preisach => Family::Preisach(Preisach::random(rng, full_v)),
            Self::SigmoidPlays => Family::SigmoidPlays(SigmoidPlays::random(rng, full_v)),
            Self::MaxwellSlip => Family::MaxwellSlip(MaxwellSlip::random(rng, full_v)),
            // Its rate dependence is an effect like the others and not there unless it is hidden.
            Self::Mrpi => Family::Mrpi(Mrpi {
                alpha_s: 0.0,
                beta_s: 0.0,
                ..Mrpi::random(rng)
            }),
            Self::BoucWen => Family::BoucWen(BoucWen::random(rng, full_v)),
        };
        Hysteresis {
            stroke_um,
            reference_v: full_v,
            initial: Initial::Conditioned,
            family,
        }
    }
}

/// What a seed draws: the stage without hidden effects and what the user has beside it.
#[derive(Debug, Clone)]
pub(super) struct Laboratory {
    pub(super) family: StageFamily,
    pub(super) full_v: f64,
    pub(super) stroke_um: f64,
    pub(super) noise_rms_um: f64,
    /// Step of the position's 16-bit converter.
    pub(super) step_um: f64,
    pub(super) records_temperature: bool,
    pub(super) has_other_axis: bool,
    pub(super) other_axis: Hysteresis,
    pub(super) config: StageConfig,
}

impl Laboratory {
    pub(super) fn draw(family: Option<StageFamily>, rng: &mut Pcg64) -> Result<Self, StageError> {
        let drawn = StageFamily::ALL[rng.random_range(0..StageFamily::ALL.len())];
        let family = family.unwrap_or(drawn);
        let full_v = [26.0, 60.0, 100.0, 120.0, 150.0, 180.0, 200.0][rng.random_range(0..7_usize)];
        let stroke_um = log_uniform(rng, 2.0, 20.0);
        let noise_rms_um = log_uniform(rng, 0.2e-3, 3e-3);
        // Half of the sensors have the paper's range of +-25 um, half one that fits the stroke.
        let range_um = if rng.random_bool(0.5) { 50.0 } else { 2.5 * stroke_um };
        let temperature = Temperature {
            start_c: rng.random_range(20.0..24.0),
            drift_k_per_h: rng.random_range(-1.0..1.0),
            warm_up_k: rng.random_range(0.0..2.0),
            warm_up_s: log_uniform(rng, 300.0, 1800.0),
            swing_k: log_uniform(rng, 0.05, 1.0),
            swing_period_s: log_uniform(rng, 200.0, 1200.0),
            noise_rms_k: 0.002,
            resolution_k: 0.001,
        };
        let records_temperature = rng.random_bool(0.5);
        let has_other_axis = rng.random_bool(0.4);
        let other_stroke_um = stroke_um * rng.random_range(0.7..1.4);
        let other_axis = StageFamily::MaxwellSlip.draw(rng, other_stroke_um, full_v)?;
        let hysteresis = family.draw(rng, stroke_um, full_v)?;
        let config = StageConfig {
            temperature: Some(temperature),
            // Noise, characteristic and converter are the readout's, which also has the effects outside of the catalogue.
            sensor: Sensor {
                um_per_v: 1.0,
                noise_rms_um: 0.0,
                adc: None,
                ..Sensor::default()
            },
            ..StageConfig::bare(hysteresis)
        };
        Ok(Self {
            family,
            full_v,
            stroke_um,
            noise_rms_um,
            step_um: range_um / 65_536.0,
            records_temperature,
            has_other_axis,
            other_axis,
            config,
        })
    }
}

/// A number whose logarithm is evenly distributed.
pub(super) fn log_uniform(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
    rng.random_range(low.ln()..high.ln()).exp()
}

/// One or minus one.
pub(super) fn sign(rng: &mut Pcg64) -> f64 {
    if rng.random_bool(0.5) { 1.0 } else { -1.0 }
}
