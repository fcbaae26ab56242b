//! The experiment protocol on the simulated stage.

use crate::error::TrackingError;
use hysteron_control::campaign::{Campaign, Command, Protocol};
use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_plant::{Stage, StageConfig};
use rayon::prelude::*;

/// Plays the protocol on a stage: small multisine, two holds, large signals, then two passes along references with the
/// inverse identified so far. Every record starts on a stage that was cycled and rests at 0 V.
///
/// # Errors
/// A stage that cannot be simulated, or records from which it cannot be identified.
///
/// # Cost
/// 37 s of records, 0.8 million samples; three identifications of about a second each.
pub fn campaign(
    name: &str,
    stage: &StageConfig,
    seed: u64,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Campaign, TrackingError> {
    let records = Dataset {
        name: name.to_owned(),
        description: format!("campaign for control on the simulated stage {name}, seed {seed}"),
        known: Known {
            delay_s: Some(stage.known_delay_s()),
            voltage_min_v: Some(stage.amplifier.min_v),
            voltage_max_v: Some(stage.amplifier.max_v),
            dac_v: stage.dac_v(),
            adc_um: stage.adc_um(),
            ..Known::default()
        },
        ..Dataset::default()
    };
    let protocol = Protocol {
        period_s: stage.sample_period_s,
        top_v: stage.hysteresis.reference_v.min(stage.amplifier.max_v),
        seed,
    };
    let take = |commands: Vec<Command>, _: &dyn Fn(f64)| -> Result<Vec<Record>, TrackingError> {
        commands.into_par_iter().map(|command| play(command, stage)).collect()
    };
    protocol.play(records, &take, progress)
}

/// The record of a command, from a stage that was cycled and rests at 0 V.
fn play(command: Command, stage: &StageConfig) -> Result<Record, TrackingError> {
    let mut run = Stage::new(stage, command.seed)?.run(&command.voltage_v, command.period_s)?;
    let mut voltage_v = command.voltage_v;
    Ok(Record {
        file: command.file,
        role: Role::Identify,
        excitation: command.words,
        start_s: 0.0,
        period_s: command.period_s,
        voltage_v: voltage_v.split_off(command.skip),
        position_um: run.position_um.split_off(command.skip),
        reference_um: command.reference_um,
        temperature_c: run.temperature_c.map(|mut t| t.split_off(command.skip)),
        voltage2_v: None,
    })
}
