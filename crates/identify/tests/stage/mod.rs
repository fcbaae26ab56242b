//! Records of the simulated stage, as the paper takes them.

use hysteron_data::{Dataset, Record, Role};
use hysteron_plant::{Stage, StageConfig};
use std::f64::consts::TAU;

/// Sines from 0 to 26 V at these frequencies, four periods each after one to settle, 50 kHz.
pub(crate) fn sines(config: &StageConfig, frequencies_hz: &[f64], samples: Option<usize>) -> Dataset {
    let period_s = 20e-6;
    let records = frequencies_hz.iter().map(|&f| {
        let a_period = (1.0 / f / period_s).round() as usize;
        let length = samples.unwrap_or(4 * a_period);
        let drive = |k: usize| 13.0 - 13.0 * (TAU * k as f64 / a_period as f64).cos();
        let settling: Vec<f64> = (0..2 * a_period).map(drive).collect();
        let voltage_v: Vec<f64> = (0..length).map(drive).collect();
        let mut stage = Stage::new(config, 1).unwrap();
        stage.run(&settling, period_s).unwrap();
        let run = stage.run(&voltage_v, period_s).unwrap();
        Record {
            file: format!("sine-{f:03}hz.csv"),
            role: Role::Identify,
            excitation: format!("sine {f} Hz, 0 to 26 V"),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    });
    Dataset {
        name: "sines".into(),
        records: records.collect(),
        ..Dataset::default()
    }
}
