//! Records taken on a simulated stage: which excitations, in which role, at which rate.

use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_excitation::{BandNoise, Excitation, MultiHarmonic, Multisine, Sine, Steps, Triangle, with_rise};
use hysteron_plant::{Stage, StageConfig, StageError};

/// An excitation to record.
pub struct Planned {
    /// Name of the record's file without its ending.
    pub name: String,
    /// What the record is for.
    pub role: Role,
    /// Whether the record starts in periodic state: the excitation is played before it is recorded.
    pub periodic: bool,
    /// The command.
    pub excitation: Box<dyn Excitation + Sync>,
}

/// Time that a periodic excitation is played at least before it is recorded, seconds: ringing, filters and the first
/// loop are over.
const SETTLING_S: f64 = 0.06;
/// Rise of a command that does not start at 0 V, and rest before it, seconds.
const RISE_S: f64 = 0.02;

/// What is recorded when nothing is asked for: three decades of rate at full stroke, small loops, a rich signal, a rest;
/// and for judging, other waveforms at other frequencies and strokes. Frequencies are no divisors of mains or of each
/// other. `full_v` is the highest voltage.
pub fn default_campaign(full_v: f64, seed: u64) -> Vec<Planned> {
    // Written for the paper's 26 V.
    let scale = full_v / 26.0;
    let sine = |frequency_hz: f64, low_v: f64, high_v: f64, seconds: f64| Sine {
        frequency_hz,
        low_v: scale * low_v,
        high_v: scale * high_v,
        periods: (seconds * frequency_hz).round(),
    };
    let triangle = Triangle {
        frequency_hz: 31.0,
        low_v: scale * 6.0,
        high_v: scale * 18.0,
        periods: 6.0,
    };
    let multisine = Multisine {
        low_hz: 5.0,
        high_hz: 400.0,
        period_s: 0.1,
        periods: 2,
        bias_v: scale * 13.0,
        peak_v: scale * 11.0,
        seed,
    };
    let rest = Steps {
        levels_v: vec![scale * 13.0],
        hold_s: 0.1,
        transition_s: 0.0,
    };
    let harmonic = MultiHarmonic {
        frequency_hz: 53.0,
        full_v,
        periods: 6.0,
    };
    let noise = BandNoise {
        bandwidth_hz: 300.0,
        duration_s: 0.2,
        rms_v: scale * 4.0,
        low_v: scale * 1.0,
        high_v: scale * 25.0,
        seed: seed.wrapping_add(1),
    };
    vec![
        planned("sine-011hz", Role::Identify, true, sine(11.0, 0.0, 26.0, 0.273)),
        planned("sine-097hz", Role::Identify, true, sine(97.0, 0.0, 26.0, 0.2)),
        planned("sine-503hz", Role::Identify, true, sine(503.0, 0.0, 26.0, 0.2)),
        planned("triangle-031hz", Role::Identify, true, triangle),
        planned("multisine", Role::Identify, true, multisine),
        planned("rest", Role::Identify, false, rest),
        planned("sine-211hz", Role::Validate, true, sine(211.0, 3.0, 22.0, 0.2)),
        planned("complex-harmonic-053hz", Role::Validate, true, harmonic),
        planned("noise-300hz", Role::Validate, false, noise),
    ]
}

fn planned(name: &str, role: Role, periodic: bool, excitation: impl Excitation + Sync + 'static) -> Planned {
    Planned {
        name: name.to_owned(),
        role,
        periodic,
        excitation: Box::new(excitation),
    }
}

/// Takes the records one after the other, each on a stage that was cycled and rests at 0 V. `progress` gets the share done.
///
/// # Errors
/// A stage or an excitation that is refused.
pub fn record(
    name: &str,
    stage: &StageConfig,
    plan: &[Planned],
    sample_period_s: f64,
    seed: u64,
    progress: &dyn Fn(f64),
) -> Result<Dataset, StageError> {
    let mut dataset = Dataset {
        name: name.to_owned(),
        description: format!("simulated stage {name}, seed {seed}"),
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
    for (number, planned) in plan.iter().enumerate() {
        // Records of one stage have noise of their own.
        let mut stage = Stage::new(stage, seed.wrapping_add(number as u64))?;
        let command_v = planned.excitation.samples(sample_period_s)?;
        let voltage_v = if planned.periodic {
            let lead_in = lead_in(&command_v, sample_period_s)?;
            stage.run(&lead_in, sample_period_s)?;
            command_v
        } else {
            with_rise(&command_v, RISE_S.max(sample_period_s), sample_period_s)?
        };
        let run = stage.run(&voltage_v, sample_period_s)?;
        dataset.records.push(Record {
            file: format!("{}.csv", planned.name),
            role: planned.role,
            excitation: planned.excitation.description(),
            start_s: 0.0,
            period_s: sample_period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: run.temperature_c,
            voltage2_v: None,
        });
        progress((number + 1) as f64 / plan.len() as f64);
    }
    Ok(dataset)
}

/// A rise to the command and the whole command, as often as settling takes; it ends where the command begins.
fn lead_in(command_v: &[f64], sample_period_s: f64) -> Result<Vec<f64>, StageError> {
    let times = (SETTLING_S / (sample_period_s * command_v.len() as f64))
        .ceil()
        .max(1.0);
    with_rise(
        &command_v.repeat(times as usize),
        RISE_S.max(sample_period_s),
        sample_period_s,
    )
}
