//! What a simulated stage is made of: every effect with its physical parameters, each of which may be absent.

use crate::amplifier::Amplifier;
use crate::asymmetry::Asymmetry;
use crate::contact::{Backlash, EndStop};
use crate::converter::Converter;
use crate::coupling::CrossCoupling;
use crate::creep::Creep;
use crate::error::{StageError, within};
use crate::hum::MainsHum;
use crate::hysteresis::{AmplitudeGain, Family, Hysteresis};
use crate::rate::RateDependence;
use crate::sensor::Sensor;
use crate::structure::{self, Mode};
use crate::thermal::{Temperature, ThermalDrift};

/// How the command gets from one sample to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Hold {
    /// The converter holds each value for a sample of [`StageConfig::sample_period_s`]: half a sample of delay, as in every digital loop.
    #[default]
    Zero,
    /// The command runs in a straight line from sample to sample: no delay. For recordings whose hold has been accounted for.
    Linear,
}

/// The whole stage, from the command to the recorded position, in the order of the chain
/// voltage, delay, amplifier, hysteresis, creep, structure, coupling and heat, contact, sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct StageConfig {
    /// Sample period of the controller, seconds; the paper's runs at 20 us.
    pub sample_period_s: f64,
    /// The command's converter, before the amplifier's gain; none for an exact command.
    pub dac: Option<Converter>,
    /// How the command gets from one sample to the next.
    pub hold: Hold,
    /// Latency of the controller, known to whoever built it (one sample of computing, say), seconds.
    pub controller_delay_s: f64,
    /// Further pure delay of the stage (sensor electronics, digital amplifier), not known, seconds.
    pub delay_s: f64,
    /// The high-voltage amplifier.
    pub amplifier: Amplifier,
    /// The stack's hysteresis, with the stroke.
    pub hysteresis: Hysteresis,
    /// Dependence of the hysteresis on the rate.
    pub rate_dependence: Option<RateDependence>,
    /// A bend common to both branches.
    pub asymmetry: Option<Asymmetry>,
    /// Gain that grows with the amplitude.
    pub amplitude_gain: Option<AmplitudeGain>,
    /// Creep of the stack.
    pub creep: Option<Creep>,
    /// Modes of the structure; empty for a rigid one.
    pub modes: Vec<Mode>,
    /// Motion of the other axis that reaches this one.
    pub cross_coupling: Option<CrossCoupling>,
    /// Temperature beside the stage; present if it is recorded.
    pub temperature: Option<Temperature>,
    /// What the temperature does to the stage.
    pub thermal_drift: Option<ThermalDrift>,
    /// Mains hum in the position.
    pub mains_hum: Option<MainsHum>,
    /// Lost motion.
    pub backlash: Option<Backlash>,
    /// Hard stops.
    pub end_stop: Option<EndStop>,
    /// The position sensor.
    pub sensor: Sensor,
}

impl StageConfig {
    /// Volts at the stack of the DAC's lowest code and of full scale; none for an exact command.
    pub fn dac_v(&self) -> Option<[f64; 2]> {
        let ends = |dac: Converter| [dac.min_v, dac.max_v].map(|v| v * self.amplifier.gain);
        self.dac.map(ends)
    }

    /// Micrometres of the ADC's lowest code and of full scale; none where the reading is not rounded.
    pub fn adc_um(&self) -> Option<[f64; 2]> {
        let ends = |adc: Converter| [adc.min_v, adc.max_v].map(|v| v * self.sensor.um_per_v);
        self.sensor.adc.map(ends)
    }

    /// A stage with this hysteresis and nothing else: ideal amplifier and converter, rigid, no noise, straight lines between samples.
    pub fn bare(hysteresis: Hysteresis) -> Self {
        Self {
            sample_period_s: 20e-6,
            dac: None,
            hold: Hold::Linear,
            controller_delay_s: 0.0,
            delay_s: 0.0,
            amplifier: Amplifier {
                min_v: -1e4,
                max_v: 1e4,
                ..Amplifier::default()
            },
            hysteresis,
            rate_dependence: None,
            asymmetry: None,
            amplitude_gain: None,
            creep: None,
            modes: Vec::new(),
            cross_coupling: None,
            temperature: None,
            thermal_drift: None,
            mains_hum: None,
            backlash: None,
            end_stop: None,
            sensor: Sensor {
                noise_rms_um: 0.0,
                adc: None,
                ..Sensor::default()
            },
        }
    }

    /// The part of the latency that the controller's builder knows: its own delay and half a sample of hold, seconds.
    pub fn known_delay_s(&self) -> f64 {
        let hold_s = match self.hold {
            Hold::Zero => 0.5 * self.sample_period_s,
            Hold::Linear => 0.0,
        };
        self.controller_delay_s + hold_s
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// - a value that is not finite or outside of what is physical, with the range;
    /// - effects that do not go together (heat without a temperature, thresholds in a family without any).
    pub fn validate(&self) -> Result<(), StageError> {
        within(
            "sample_period_s",
            self.sample_period_s,
            1e-6,
            1.0,
            "the paper's controller has 20e-6",
        )?;
        within(
            "controller_delay_s",
            self.controller_delay_s,
            0.0,
            0.1,
            "controllers take 10 to 200 us",
        )?;
        within(
            "delay_s",
            self.delay_s,
            0.0,
            0.1,
            "sensor electronics take up to 200 us",
        )?;
        self.dac.map_or(Ok(()), |dac| dac.validate("dac"))?;
        self.amplifier.validate()?;
        self.hysteresis.validate()?;
        self.rate_dependence.as_ref().map_or(Ok(()), RateDependence::validate)?;
        self.asymmetry.map_or(Ok(()), |effect| effect.validate())?;
        self.amplitude_gain.as_ref().map_or(Ok(()), AmplitudeGain::validate)?;
        self.creep.as_ref().map_or(Ok(()), Creep::validate)?;
        structure::validate(&self.modes)?;
        self.cross_coupling.as_ref().map_or(Ok(()), CrossCoupling::validate)?;
        self.temperature.as_ref().map_or(Ok(()), Temperature::validate)?;
        self.thermal_drift.map_or(Ok(()), |effect| effect.validate())?;
        self.mains_hum.as_ref().map_or(Ok(()), MainsHum::validate)?;
        self.backlash.map_or(Ok(()), |effect| effect.validate())?;
        self.end_stop.map_or(Ok(()), |effect| effect.validate())?;
        self.sensor.validate()?;
        self.conflicts()
    }

    fn conflicts(&self) -> Result<(), StageError> {
        if self.thermal_drift.is_some() && self.temperature.is_none() {
            return Err(StageError::Conflict {
                what: "thermal_drift is given, temperature is not".to_owned(),
                advice: "give a temperature for the stage to follow",
            });
        }
        match (&self.rate_dependence, &self.hysteresis.family) {
            (Some(_), Family::Mrpi(_)) => Err(StageError::Conflict {
                what: "rate_dependence is given for the MRPI family, which has its own alpha and beta".to_owned(),
                advice: "set hysteresis.mrpi.alpha_s and beta_s, and no rate_dependence",
            }),
            (Some(rate), Family::Linear | Family::Preisach(_) | Family::BoucWen(_) | Family::Mixed(_))
                if rate.needs_thresholds() =>
            {
                Err(StageError::Conflict {
                    what: "rate_dependence changes thresholds, which this hysteresis family does not have".to_owned(),
                    advice: "use SigmoidPlays or MaxwellSlip, or another rate dependence",
                })
            }
            _ => Ok(()),
        }
    }
}
