//! The stage's physics over one inner step: from the command to the true position.

use crate::amplifier::AmplifierState;
use crate::asymmetry::Asymmetry;
use crate::config::StageConfig;
use crate::contact::{BacklashState, EndStop};
use crate::coupling::CouplingState;
use crate::creep::CreepState;
use crate::delay::Delay;
use crate::error::StageError;
use crate::hum::HumState;
use crate::hysteresis::rayleigh::AmplitudeGainState;
use crate::hysteresis::{HysteresisState, Initial};
use crate::rate::{self, LogGainState, RateDependence, RateSensor};
use crate::structure::StructureState;
use crate::thermal::ThermalState;

/// The command's two ends over one inner step, both axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Command {
    pub(crate) from_v: f64,
    pub(crate) to_v: f64,
    pub(crate) from2_v: f64,
    pub(crate) to2_v: f64,
}

/// Everything between the converter and the sensor.
///
/// Each block knows its signal at both ends of the step, so that a jump of the command stays a jump and a straight line a straight line.
#[derive(Debug, Clone)]
pub(crate) struct Chain {
    delay: Delay,
    amplifier: AmplifierState,
    stack: Stack,
    log_gain: Option<LogGainState>,
    creep: Option<CreepState>,
    structure: StructureState,
    coupling: Option<CouplingState>,
    /// The temperature beside and in the stage.
    pub(crate) thermal: Option<ThermalState>,
    hum: Option<HumState>,
    backlash: Option<BacklashState>,
    end_stop: Option<EndStop>,
    /// True position at the end of the last step.
    pub(crate) position_um: f64,
}

impl Chain {
    pub(crate) fn new(config: &StageConfig, hum_seed: u64, thermal_seed: u64) -> Result<Self, StageError> {
        let log_gain = match config.rate_dependence {
            Some(RateDependence::LogGain {
                percent_per_decade,
                from_hz,
                to_hz,
            }) => Some(LogGainState::new(percent_per_decade, from_hz, to_hz)?),
            _ => None,
        };
        Ok(Self {
            delay: Delay::new(config.controller_delay_s + config.delay_s),
            amplifier: AmplifierState::new(&config.amplifier),
            stack: Stack::new(config)?,
            log_gain,
            creep: config.creep.as_ref().map(CreepState::new).transpose()?,
            structure: StructureState::new(&config.modes),
            coupling: config.cross_coupling.as_ref().map(CouplingState::new).transpose()?,
            thermal: config
                .temperature
                .as_ref()
                .map(|temperature| ThermalState::new(temperature, config.thermal_drift, thermal_seed)),
            hum: config.mains_hum.as_ref().map(|hum| HumState::new(hum, hum_seed)),
            backlash: config.backlash.as_ref().map(BacklashState::new),
            end_stop: config.end_stop,
            position_um: 0.0,
        })
    }

    /// Prepares every block for steps of `step_s`, the command having rested at `rest_v`.
    pub(crate) fn set_step(&mut self, step_s: f64, hold_delay_s: f64, rest_v: f64) {
        self.delay.set_step(step_s, hold_delay_s, rest_v);
        self.amplifier.set_step(step_s);
        self.stack.rate.set_step(step_s);
        self.structure.set_step(step_s);
        if let Some(block) = &mut self.log_gain {
            block.set_step(step_s);
        }
        if let Some(block) = &mut self.creep {
            block.set_step(step_s);
        }
        if let Some(block) = &mut self.coupling {
            block.set_step(step_s);
        }
        if let Some(block) = &mut self.thermal {
            block.set_step(step_s);
        }
    }

    /// Voltage at the stack.
    pub(crate) fn actuator_v(&self) -> f64 {
        self.amplifier.output_v
    }

    /// One inner step that ends at `time_s`.
    #[inline]
    pub(crate) fn advance(&mut self, command: Command, time_s: f64) -> f64 {
        let (from_v, to_v) = self.delay.advance(command.from_v, command.to_v);
        let (from_v, to_v) = self.amplifier.advance(from_v, to_v);
        if let Some(thermal) = &mut self.thermal {
            thermal.advance(time_s);
        }
        let gain = self.thermal.as_ref().map_or(1.0, ThermalState::gain);
        let (mut from, mut to) = self.stack.advance(from_v, to_v, gain);
        if let Some(block) = &mut self.log_gain {
            (from, to) = block.advance(from, to);
        }
        if let Some(block) = &mut self.creep {
            (from, to) = block.advance(from, to);
        }
        let mut position_um = self.structure.advance(from, to);
        if let Some(block) = &mut self.coupling {
            position_um += block.advance(command.from2_v, command.to2_v);
        }
        if let Some(thermal) = &self.thermal {
            position_um += thermal.shift_um();
        }
        if let Some(hum) = &self.hum {
            position_um += hum.at(time_s);
        }
        if let Some(block) = &mut self.backlash {
            position_um = block.advance(position_um);
        }
        if let Some(stop) = &self.end_stop {
            position_um = position_um.max(stop.min_um).min(stop.max_um);
        }
        self.position_um = position_um;
        position_um
    }
}

/// The piezo stack: voltage in, displacement without creep or inertia out.
#[derive(Debug, Clone)]
struct Stack {
    hysteresis: HysteresisState,
    rate_dependence: Option<RateDependence>,
    rate: RateSensor,
    asymmetry: Option<Asymmetry>,
    amplitude_gain: Option<AmplitudeGainState>,
    per_reference_v: f64,
    stroke_um: f64,
    voltage_v: f64,
    output_um: f64,
}

impl Stack {
    fn new(config: &StageConfig) -> Result<Self, StageError> {
        let (stroke_um, reference_v) = (config.hysteresis.stroke_um, config.hysteresis.reference_v);
        let conditioned = config.hysteresis.initial == Initial::Conditioned;
        let amplitude_gain = config
            .amplitude_gain
            .as_ref()
            .map(|effect| AmplitudeGainState::new(effect, stroke_um, reference_v, conditioned));
        Ok(Self {
            hysteresis: HysteresisState::new(&config.hysteresis)?,
            rate_dependence: config.rate_dependence.clone(),
            rate: RateSensor::new(),
            asymmetry: config.asymmetry,
            amplitude_gain,
            per_reference_v: 1.0 / reference_v,
            stroke_um,
            voltage_v: 0.0,
            output_um: 0.0,
        })
    }

    #[inline]
    fn advance(&mut self, from_v: f64, to_v: f64, gain: f64) -> (f64, f64) {
        let from_um = if from_v == self.voltage_v {
            self.output_um
        } else {
            self.rate.jump(from_v - self.voltage_v);
            gain * self.displacement_um(from_v)
        };
        self.rate.advance(from_v, to_v);
        self.voltage_v = to_v;
        self.output_um = gain * self.displacement_um(to_v);
        (from_um, self.output_um)
    }

    #[inline]
    fn displacement_um(&mut self, voltage_v: f64) -> f64 {
        let drive = rate::drive(self.rate_dependence.as_ref(), voltage_v, self.rate.rate_v_per_s());
        let mut output_um = self.hysteresis.advance(&drive);
        if let Some(effect) = &mut self.amplitude_gain {
            output_um += effect.advance(voltage_v);
        }
        if let Some(effect) = &self.asymmetry {
            output_um += self.stroke_um * effect.of(voltage_v * self.per_reference_v);
        }
        output_um
    }
}
