//! Records along references: what a first controller makes of them, for its inverse to be fitted to as well.

use super::{PERIOD_S, Rehearsal};
use crate::complete::track_beside;
use crate::error::TrackingError;
use hysteron_control::design::Controller;
use hysteron_control::reference::{Reference, Shape, noise};
use hysteron_data::{Record, Role};
use hysteron_plant::StageConfig;
use rayon::prelude::*;

/// Every how many samples a row is kept: the references are slow.
const EVERY: usize = 25;

impl Rehearsal {
    /// Runs a controller along slow references over the range that is followed later and about it, none of which is judged. Lower down
    /// another axis would ask for less than 0 V.
    ///
    /// # Errors
    /// A stage or controller that cannot be run.
    pub fn training(&self, stage: &StageConfig, controller: &Controller) -> Result<Vec<Record>, TrackingError> {
        let law = controller.law::<f64>()?;
        let stroke_um = stage.hysteresis.stroke_um;
        let range = |[low, high]: [f64; 2]| [low * stroke_um, high * stroke_um];
        let walk = |shares, number| {
            let [low_um, high_um] = range(shares);
            let (rms_um, seed) = (0.25 * (high_um - low_um), self.noise_seed(number));
            noise([low_um, high_um], rms_um, 20.0, 1.5, seed, PERIOD_S)
        };
        let sine = |frequency_hz, shares| Shape::Sine { frequency_hz }.reference(range(shares), PERIOD_S);
        let triangle = Shape::Triangle { frequency_hz: 5.0 };
        let plan: [(&str, Reference); 6] = [
            ("walk", walk([0.13, 0.72], 200)?),
            ("walk-small", walk([0.25, 0.6], 201)?),
            ("sine-007hz", sine(7.0, [0.13, 0.7])),
            ("sine-007hz-small", sine(7.0, [0.3, 0.6])),
            ("sine-003hz", sine(3.0, [0.15, 0.66])),
            ("triangle-005hz", triangle.reference(range([0.2, 0.6]), PERIOD_S)),
        ];
        plan.into_par_iter()
            .enumerate()
            .map(|(number, (name, reference))| {
                let beside_v = self.beside_v(stage, reference.samples_um.len());
                let seed = self.noise_seed(300 + number as u64);
                let run = track_beside(stage, seed, &law, &reference, &beside_v)?;
                // A reading answers the command that was held until then.
                let rows = || (1..run.measured_um.len()).step_by(EVERY);
                let before = |command_v: &[f64]| rows().map(|k| command_v[k - 1]).collect();
                Ok(Record {
                    file: format!("training-{name}.csv"),
                    role: Role::Identify,
                    excitation: format!("open loop along {name}"),
                    start_s: 0.0,
                    period_s: EVERY as f64 * PERIOD_S,
                    voltage_v: before(&run.command_v),
                    position_um: rows().map(|k| run.measured_um[k]).collect(),
                    reference_um: Some(rows().map(|k| run.reference_um[k]).collect()),
                    temperature_c: None,
                    voltage2_v: (!beside_v.is_empty()).then(|| before(&beside_v)),
                })
            })
            .collect()
    }
}
