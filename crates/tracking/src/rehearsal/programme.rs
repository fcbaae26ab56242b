//! The records that a user takes of the stage.

use super::{PERIOD_S, Rehearsal};
use crate::error::TrackingError;
use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_excitation::{BandNoise, DecayingTriangle, Excitation, MultiHarmonic, Multisine, Sine, Steps, with_rise};
use hysteron_plant::{Hold, Stage, StageConfig};
use rayon::prelude::*;
use std::f64::consts::TAU;

struct Planned {
    name: &'static str,
    role: Role,
    period_s: f64,
    excitation: Box<dyn Excitation + Send + Sync>,
}

impl Rehearsal {
    /// The records of a user: sines from 1 to 503 Hz, minor loops, a multisine, holds, a rest, and others to judge by; the other
    /// axis moves where there is one. The converter's hold, which the controller knows, is accounted for in them. Each begins
    /// after a long rest at 0 V: what slow states remember from before a record is in no file.
    ///
    /// # Errors
    /// A stage that cannot be simulated.
    pub fn records(&self, stage: &StageConfig) -> Result<Dataset, TrackingError> {
        let accounted = StageConfig {
            hold: Hold::Linear,
            ..stage.clone()
        };
        let records: Result<Vec<Record>, TrackingError> = self
            .programme()
            .into_par_iter()
            .enumerate()
            .map(|(number, planned)| self.take(&accounted, number, &planned))
            .collect();
        Ok(Dataset {
            name: format!("rehearsal-{}", self.seed),
            description: format!("simulated stage with something hidden, seed {}", self.seed),
            known: Known {
                voltage_min_v: Some(stage.amplifier.min_v),
                voltage_max_v: Some(stage.amplifier.max_v),
                dac_v: stage.dac_v(),
                adc_um: stage.adc_um(),
                ..Known::default()
            },
            records: records?,
            ..Dataset::default()
        })
    }

    fn programme(&self) -> Vec<Planned> {
        let full_v = self.full_v();
        let sine = |name, role, frequency_hz: f64, high: f64, periods: f64, period_s| Planned {
            name,
            role,
            period_s,
            excitation: Box::new(Sine {
                frequency_hz,
                low_v: 0.0,
                high_v: high * full_v,
                periods,
            }),
        };
        let other = |name, role, period_s, excitation: Box<dyn Excitation + Send + Sync>| Planned {
            name,
            role,
            period_s,
            excitation,
        };
        let seed = self.seed;
        let multisine = |seed: u64| Multisine {
            low_hz: 20.0,
            high_hz: 4000.0,
            period_s: 0.05,
            periods: 4,
            bias_v: 0.5 * full_v,
            peak_v: 0.15 * full_v,
            seed,
        };
        let noise = BandNoise {
            bandwidth_hz: 400.0,
            duration_s: 0.3,
            rms_v: 0.14 * full_v,
            low_v: 0.02 * full_v,
            high_v: 0.98 * full_v,
            seed,
        };
        let steps = |levels: &[f64], hold_s: f64| Steps {
            levels_v: levels.iter().map(|level| level * full_v).collect(),
            hold_s,
            transition_s: 0.03,
        };
        let minor = DecayingTriangle {
            high_v: full_v,
            centre_v: 0.53 * full_v,
            decay: 0.88,
            turns: 24,
            slope_v_per_s: 3.0 * full_v,
        };
        let harmonic = MultiHarmonic {
            frequency_hz: 13.0,
            full_v,
            periods: 4.0,
        };
        use Role::{Identify, Validate};
        vec![
            sine("sine-001hz", Identify, 1.0, 1.0, 3.0, 2e-3),
            sine("sine-011hz", Identify, 11.0, 1.0, 5.0, 4e-4),
            sine("sine-011hz-small", Identify, 11.0, 0.4, 5.0, 4e-4),
            sine("sine-047hz", Validate, 47.0, 1.0, 6.0, 2e-4),
            sine("sine-097hz", Identify, 97.0, 1.0, 8.0, 1e-4),
            sine("sine-097hz-small", Validate, 97.0, 0.4, 8.0, 1e-4),
            sine("sine-193hz", Validate, 193.0, 1.0, 12.0, 4e-5),
            sine("sine-503hz", Identify, 503.0, 1.0, 20.0, PERIOD_S),
            other("minor-loops", Identify, 1e-3, Box::new(minor)),
            other("multisine", Identify, 4e-5, Box::new(multisine(seed ^ 1))),
            other("noise", Validate, 1e-4, Box::new(noise)),
            other("complex-harmonic", Validate, 2e-4, Box::new(harmonic)),
            other("holds", Identify, 1e-2, Box::new(steps(&[0.0, 0.6, 0.9, 0.3], 12.0))),
            other("hold", Validate, 1e-2, Box::new(steps(&[0.0, 0.7], 20.0))),
            other("rest", Identify, 5e-4, Box::new(steps(&[0.0], 1.0))),
        ]
    }

    fn take(&self, stage: &StageConfig, number: usize, planned: &Planned) -> Result<Record, TrackingError> {
        let period_s = planned.period_s;
        let command_v = planned.excitation.samples(period_s)?;
        let voltage_v = with_rise(&command_v, 0.02_f64.max(4.0 * period_s), period_s)?;
        // Whole cycles of a rate of its own over the record, from rest to rest.
        let cycles = Self::cycles_beside(number);
        let length = voltage_v.len();
        let beside = |k: usize| {
            let turn = TAU * cycles * k as f64 / (length - 1).max(1) as f64;
            0.4 * self.full_v() * (1.0 - turn.cos())
        };
        let couples = stage.cross_coupling.is_some();
        let voltage2_v: Vec<f64> = (0..length).map(|k| if couples { beside(k) } else { 0.0 }).collect();
        let mut stage = Stage::new(stage, self.noise_seed(number as u64))?;
        let run = stage.run_two_axes(&voltage_v, &voltage2_v, period_s)?;
        Ok(Record {
            file: format!("{}.csv", planned.name),
            role: planned.role,
            excitation: planned.excitation.description(),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: None,
            voltage2_v: couples.then_some(voltage2_v),
        })
    }
}
