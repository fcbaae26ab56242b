//! From the stage to the recorded position: characteristic, effects outside of the catalogue, noise, converter.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::outside::{Outside, Reading};
use super::programme::Planned;
use crate::config::StageConfig;
use crate::error::StageError;
use crate::sensor::SensorNonlinearity;
use crate::stage::Stage;

/// The stage with whatever is hidden in it.
#[derive(Debug, Clone)]
pub(super) struct Setup {
    pub(super) config: StageConfig,
    /// The sensor's characteristic, applied here because a strong one is bent further than [`crate::Sensor`] allows.
    pub(super) curve: Option<SensorNonlinearity>,
    pub(super) outside: Vec<(Outside, f64)>,
}

/// One record as the stage moved.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub(super) start_s: f64,
    pub(super) position_um: Vec<f64>,
    pub(super) temperature_c: Vec<f64>,
}

/// Plays the programme, one record after the other, on one stage.
pub(super) fn play(config: &StageConfig, programme: &[Planned], seed: u64) -> Result<Vec<Motion>, StageError> {
    /// A return to 0 V, done with care.
    const RETURN_S: f64 = 0.5;
    let mut stage = Stage::new(config, seed)?;
    let take = |record: &Planned| {
        stage.move_and_rest(0.0, RETURN_S, record.rest_s)?;
        let start_s = stage.time_s();
        let run = match &record.voltage2_v {
            None => stage.run(&record.voltage_v, record.period_s)?,
            Some(other_v) => stage.run_two_axes(&record.voltage_v, other_v, record.period_s)?,
        };
        let temperature_c = run.temperature_c.unwrap_or_default();
        Ok(Motion {
            start_s,
            position_um: run.position_um,
            temperature_c,
        })
    };
    programme.iter().map(take).collect()
}

impl Setup {
    /// What a sensor without noise and rounding would read.
    pub(super) fn read(&self, motions: &[Motion], programme: &[Planned]) -> Vec<Vec<f64>> {
        let read = |(place, (motion, record)): (usize, (&Motion, &Planned))| {
            let mut reading = Reading {
                place: (place, programme.len()),
                start_s: motion.start_s,
                period_s: record.period_s,
                voltage_v: &record.voltage_v,
                position_um: motion.position_um.clone(),
            };
            if let Some(curve) = &self.curve {
                let bent = |y: &f64| {
                    let x = y / curve.full_scale_um;
                    y + curve.full_scale_um * x * (curve.quadratic * (x - 1.0) + curve.cubic * (x * x - 1.0))
                };
                reading.position_um = reading.position_um.iter().map(bent).collect();
            }
            for (outside, size) in &self.outside {
                outside.apply(*size, &mut reading);
            }
            reading.position_um
        };
        motions.iter().zip(programme).enumerate().map(read).collect()
    }
}

/// Noise and a converter of 16 bits; the result has five decimals, as a recorder writes it. Where the motion goes beyond the converter's
/// range, the step is as much larger: a sensor that is cut off would be an effect that nobody has hidden.
pub(super) fn record(positions_um: &mut [Vec<f64>], noise_rms_um: f64, step_um: f64, seed: u64) {
    let largest_um = positions_um
        .iter()
        .flatten()
        .fold(0.0, |most: f64, y| most.max(y.abs()));
    let step_um = step_um.max(1.1 * largest_um / 32_767.0);
    let mut rng = Pcg64::seed_from_u64(seed);
    for y in positions_um.iter_mut().flatten() {
        let normal: f64 = StandardNormal.sample(&mut rng);
        let code = ((*y + noise_rms_um * normal) / step_um)
            .round()
            .clamp(-32_768.0, 32_767.0);
        *y = (code * step_um * 1e5).round() / 1e5;
    }
}
