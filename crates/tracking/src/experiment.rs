//! What the experiments share: the stage's records for identification, and sets of runs on both cores.

use crate::error::TrackingError;
use crate::run::{Law, PiGains, law, track};
use hysteron_control::figures::{RunFigures, Tracked, judge};
use hysteron_control::reference::{Reference, Shape};
use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_excitation::{Excitation, Sine};
use hysteron_identify::Model;
use hysteron_plant::{Stage, StageConfig};

/// Frequencies of identification, hertz (section 4.2).
pub const IDENTIFIED_HZ: [f64; 3] = [10.0, 100.0, 500.0];
/// Length of each record, seconds: two periods of the slowest sine. Eq. 17 counts samples, so equal lengths let every
/// frequency count alike before eq. 18 weighs it.
pub const RECORD_S: f64 = 0.2;
/// The paper's gains, the second per second.
const GAINS: [f64; 2] = [1.0, 6000.0];

/// Number of plays, section 4.2.
pub const PLAYS: usize = 10;

/// Rise from rest at 0 V to the sine's lowest voltage, seconds.
const RISE_S: f64 = 0.02;
/// Settling before a record, seconds: ringing, filters and the first loop are over.
const SETTLING_S: f64 = 0.06;

/// Sines between two voltages, one record a frequency, in periodic state, `samples(frequency)` samples long.
///
/// # Errors
/// A stage or a sine that the plant refuses.
pub fn sines(
    config: &StageConfig,
    frequencies_hz: &[f64],
    [low_v, high_v]: [f64; 2],
    samples: impl Fn(f64) -> usize,
    seed: u64,
) -> Result<Dataset, TrackingError> {
    let period_s = config.sample_period_s;
    let mut dataset = Dataset {
        name: "sines".to_owned(),
        known: Known {
            delay_s: Some(config.known_delay_s()),
            ..Known::default()
        },
        ..Dataset::default()
    };
    for &frequency_hz in frequencies_hz {
        let settling_periods = 3.0_f64.max((SETTLING_S * frequency_hz).ceil());
        let settling = (settling_periods / frequency_hz / period_s).round() as usize;
        let length = settling + samples(frequency_hz);
        let sine = Sine {
            frequency_hz,
            low_v,
            high_v,
            periods: (length as f64 + 0.5) * period_s * frequency_hz,
        };
        let mut voltage_v = sine.samples(period_s)?;
        voltage_v.truncate(length);
        let mut stage = Stage::new(config, seed)?;
        if low_v != 0.0 {
            stage.move_and_rest(low_v, RISE_S, 0.0)?;
        }
        let mut run = stage.run(&voltage_v, period_s)?;
        dataset.records.push(Record {
            file: format!("sine-{frequency_hz:03}hz.csv"),
            role: Role::Identify,
            excitation: format!("sine {frequency_hz} Hz, {low_v} to {high_v} V"),
            start_s: 0.0,
            period_s,
            voltage_v: voltage_v.split_off(settling.min(voltage_v.len())),
            position_um: run.position_um.split_off(settling.min(run.position_um.len())),
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        });
    }
    Ok(dataset)
}

/// The positions that every record reaches, micrometres: what an inverse fitted to all of them was fitted on.
///
/// `None` where there is no such range.
pub fn common_range_um(dataset: &Dataset) -> Option<[f64; 2]> {
    let ends = dataset.records.iter().map(|record| {
        let y = record.position_um.iter().copied();
        [
            y.clone().fold(f64::INFINITY, f64::min),
            y.fold(f64::NEG_INFINITY, f64::max),
        ]
    });
    let range = ends.reduce(|a, b| [a[0].max(b[0]), a[1].min(b[1])])?;
    (range[0] < range[1]).then_some(range)
}

/// A controller of the paper: an inverse, a PI controller, or both.
#[derive(Debug, Clone, Copy)]
pub struct Controller<'a> {
    /// The inverse in the feedforward.
    pub inverse: Option<&'a Model>,
    /// The feedback.
    pub gains: Option<PiGains>,
    /// Whole samples of computing beyond those in the records.
    pub further_samples: usize,
}

impl Controller<'_> {
    /// Tracks a reference; what is returned begins with the judged part.
    ///
    /// # Errors
    /// As [`law`] and [`track`].
    pub fn track(&self, stage: &StageConfig, seed: u64, reference: &Reference) -> Result<Tracked, TrackingError> {
        let law: Law<PLAYS> = law(stage, self.inverse, self.gains)?;
        let tracked = track(stage, seed, &law, reference, self.further_samples)?;
        Ok(tracked.from(reference.judged_from))
    }

    /// Tracks a shape over a range of positions and judges it.
    ///
    /// # Errors
    /// As [`law`] and [`track`].
    pub fn judge(
        &self,
        stage: &StageConfig,
        seed: u64,
        shape: Shape,
        range_um: [f64; 2],
    ) -> Result<(Tracked, Option<RunFigures>), TrackingError> {
        let reference = shape.reference(range_um, stage.sample_period_s);
        let tracked = self.track(stage, seed, &reference)?;
        let figures = judge(&tracked, stage.sample_period_s);
        Ok((tracked, figures))
    }
}

/// What the gains may be volts of, for each unit of position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reading {
    /// Volts at the actuator for each volt of the sensor.
    ActuatorVoltsPerSensorVolt,
    /// Volts at the actuator for each micrometre.
    ActuatorVoltsPerMicrometre,
    /// Volts at the converter for each volt of the sensor.
    ConverterVoltsPerSensorVolt,
    /// Volts at the converter for each micrometre.
    ConverterVoltsPerMicrometre,
}

impl Reading {
    /// All of them, weakest loop first for the paper's amplifier (20) and sensor (2.5 um/V).
    pub const ALL: [Self; 4] = [
        Self::ActuatorVoltsPerSensorVolt,
        Self::ActuatorVoltsPerMicrometre,
        Self::ConverterVoltsPerSensorVolt,
        Self::ConverterVoltsPerMicrometre,
    ];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::ActuatorVoltsPerSensorVolt => "actuator volts per sensor volt",
            Self::ActuatorVoltsPerMicrometre => "actuator volts per micrometre",
            Self::ConverterVoltsPerSensorVolt => "converter volts per sensor volt",
            Self::ConverterVoltsPerMicrometre => "converter volts per micrometre",
        }
    }

    /// The gains in actuator volts per micrometre.
    pub fn gains(self, stage: &StageConfig) -> PiGains {
        let (amplifier, um_per_v) = (stage.amplifier.gain, stage.sensor.um_per_v);
        let factor = match self {
            Self::ActuatorVoltsPerSensorVolt => 1.0 / um_per_v,
            Self::ActuatorVoltsPerMicrometre => 1.0,
            Self::ConverterVoltsPerSensorVolt => amplifier / um_per_v,
            Self::ConverterVoltsPerMicrometre => amplifier,
        };
        PiGains {
            proportional_v_per_um: factor * GAINS[0],
            integral_v_per_um_s: factor * GAINS[1],
        }
    }
}
