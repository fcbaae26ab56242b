//! The simulated stage: commands in, sensor readings out, and the true position for judging.

use crate::chain::{Chain, Command};
use crate::config::{Hold, StageConfig};
use crate::error::{StageError, all_finite, within};
use crate::sensor::SensorState;

/// What is known of the stage at one sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Sensor reading, micrometres.
    pub position_um: f64,
    /// Code of the sensor's converter (0 without one).
    pub position_code: u32,
    /// Position of the platform itself, micrometres; no controller sees it.
    pub true_position_um: f64,
    /// Voltage at the stack, volts.
    pub actuator_v: f64,
    /// Recorded temperature, degrees Celsius, where there is a temperature.
    pub temperature_c: Option<f64>,
}

/// A recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Run {
    /// Sensor readings, micrometres.
    pub position_um: Vec<f64>,
    /// Position of the platform itself, micrometres.
    pub true_position_um: Vec<f64>,
    /// Recorded temperature, degrees Celsius, where there is a temperature.
    pub temperature_c: Option<Vec<f64>>,
}

/// The simulated stage of the paper's section 4.1, with whatever effects its [`StageConfig`] has.
///
/// # Time steps
/// Between samples the physics takes inner steps. Every linear block is discretised exactly for straight lines over the inner step, hysteresis has no
/// time scale, so an inner step only has to resolve how the curved hysteresis feeds the structure: 5 us, and at least 4 and at most 16 a sample.
/// Slow records therefore cost 16 inner steps a sample, however long a sample is.
///
/// A run at [`StageConfig::sample_period_s`] is what a controller sees: with [`Hold::Zero`] the converter's staircase is resolved, and sample k is read at the
/// instant when command k is latched. A slower record is the same loop recorded less often: the command runs in straight lines between the recorded
/// samples, later by half a controller sample. Faster records than the controller's are refused.
///
/// State (hysteresis, creep, ringing, temperature, time) goes on from one run to the next.
///
/// # Cost
/// About 0.1 us an inner step with a Preisach stack, creep and a mode on a current PC.
///
/// # Example
/// ```
/// use hysteron_plant::{Stage, preset};
/// let mut stage = Stage::new(&preset::paper_delay(), 1)?;
/// let mut reading = stage.sample();
/// for _ in 0..100 {
///     let error_um = 1.0 - reading.position_um;
///     reading = stage.step(10.0 + 5.0 * error_um);
/// }
/// assert!(reading.true_position_um > 0.5);
/// # Ok::<(), hysteron_plant::StageError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Stage {
    config: StageConfig,
    chain: Chain,
    sensor: SensorState,
    time_s: f64,
    step_s: f64,
    command_v: f64,
    command2_v: f64,
    sample: Sample,
}

/// Longest inner step where the sample rate allows it.
const INNER_STEP_S: f64 = 5e-6;
const FEWEST_INNER_STEPS: f64 = 4.0;
const MOST_INNER_STEPS: f64 = 16.0;

impl Stage {
    /// Builds a stage at rest at 0 V and 0 um.
    ///
    /// The seed decides noise, hum phases and temperature swing. Each effect has a random stream of its own: switching one off leaves the
    /// others' draws as they were.
    ///
    /// # Errors
    /// As [`StageConfig::validate`]; also a loop opening that the hysteresis family cannot reach.
    pub fn new(config: &StageConfig, seed: u64) -> Result<Self, StageError> {
        config.validate()?;
        // Distinct streams by the golden-ratio increment of splitmix64.
        let stream = |n: u64| seed.wrapping_add(n.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let mut stage = Self {
            config: config.clone(),
            chain: Chain::new(config, stream(1), stream(2))?,
            sensor: SensorState::new(&config.sensor, stream(3)),
            time_s: 0.0,
            step_s: 0.0,
            command_v: 0.0,
            command2_v: 0.0,
            sample: Sample::default(),
        };
        stage.read();
        Ok(stage)
    }

    /// What the stage is made of.
    pub fn config(&self) -> &StageConfig {
        &self.config
    }

    /// Time since the stage was built, seconds.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The last sample: what a controller reads before it computes its next command.
    pub fn sample(&self) -> Sample {
        self.sample
    }

    /// Applies a command (volts at the actuator: converter volts times gain) for one sample of the controller and reads the sensor at its end.
    ///
    /// A command that is not finite leaves the old one.
    pub fn step(&mut self, voltage_v: f64) -> Sample {
        self.step_two_axes(voltage_v, self.command2_v)
    }

    /// As [`Self::step`], with a command for the other axis.
    pub fn step_two_axes(&mut self, voltage_v: f64, voltage2_v: f64) -> Sample {
        self.advance(voltage_v, voltage2_v, self.config.sample_period_s);
        self.sample
    }

    /// As [`Self::step`], with the converter's code for the command; without a converter the code counts as one of
    /// [`crate::Converter::BIPOLAR_16_BIT`].
    pub fn step_code(&mut self, code: u32) -> Sample {
        self.step(self.v_from_code(code))
    }

    /// The actuator voltage of a converter's code, as [`Self::step_code`] takes it.
    pub fn v_from_code(&self, code: u32) -> f64 {
        let dac = self.config.dac.unwrap_or(crate::Converter::BIPOLAR_16_BIT);
        dac.v_from_code(code) * self.config.amplifier.gain
    }

    /// Records the answer to a voltage, one sample every `sample_period_s`.
    ///
    /// # Errors
    /// - no samples, or a voltage that is not finite or beyond 10 kV;
    /// - a sample period below the controller's or above 1000 s.
    pub fn run(&mut self, voltage_v: &[f64], sample_period_s: f64) -> Result<Run, StageError> {
        self.record(voltage_v, None, sample_period_s)
    }

    /// As [`Self::run`], the other axis driven as well.
    ///
    /// # Errors
    /// As [`Self::run`], also for `voltage2_v`, which must be as long as `voltage_v`.
    pub fn run_two_axes(
        &mut self,
        voltage_v: &[f64],
        voltage2_v: &[f64],
        sample_period_s: f64,
    ) -> Result<Run, StageError> {
        self.record(voltage_v, Some(voltage2_v), sample_period_s)
    }

    /// Moves to a voltage in a straight line and rests there, unrecorded: for conditioning, and for pauses between records.
    ///
    /// The rest is taken in steps that grow by a quarter each, so that an hour costs as little as a second.
    ///
    /// # Errors
    /// - a voltage that is not finite or beyond 10 kV;
    /// - times below zero or above 10^7 s; a ramp of less than one controller sample.
    pub fn move_and_rest(&mut self, voltage_v: f64, ramp_s: f64, rest_s: f64) -> Result<(), StageError> {
        const RAMP_STEPS: f64 = 200.0;
        within("voltage_v", voltage_v, -1e4, 1e4, "give volts at the actuator")?;
        within(
            "ramp_s",
            ramp_s,
            self.config.sample_period_s,
            1e7,
            "give at least one controller sample",
        )?;
        within("rest_s", rest_s, 0.0, 1e7, "give seconds")?;
        let from_v = self.command_v;
        let steps = (ramp_s / self.config.sample_period_s).floor().clamp(1.0, RAMP_STEPS);
        for n in 1..=steps as usize {
            let target_v = from_v + (voltage_v - from_v) * (n as f64 / steps);
            self.advance(target_v, self.command2_v, ramp_s / steps);
        }
        let mut left_s = rest_s;
        let mut period_s = self.config.sample_period_s;
        while left_s > 0.0 {
            let now_s = if left_s < 2.0 * period_s {
                left_s.max(self.config.sample_period_s)
            } else {
                period_s
            };
            self.advance(voltage_v, self.command2_v, now_s);
            left_s -= now_s;
            period_s = (1.25 * period_s).min(1000.0);
        }
        Ok(())
    }

    fn record(
        &mut self,
        voltage_v: &[f64],
        voltage2_v: Option<&[f64]>,
        sample_period_s: f64,
    ) -> Result<Run, StageError> {
        let shortest_s = self.config.sample_period_s * (1.0 - 1e-9);
        within(
            "sample_period_s",
            sample_period_s,
            shortest_s,
            1e3,
            "records are at most as fast as the stage's controller: set StageConfig::sample_period_s",
        )?;
        if voltage_v.is_empty() || voltage2_v.is_some_and(|other| other.len() != voltage_v.len()) {
            return Err(StageError::Length {
                name: if voltage_v.is_empty() {
                    "voltage_v"
                } else {
                    "voltage2_v"
                }
                .to_owned(),
                found: voltage2_v.map_or(0, <[f64]>::len),
                wanted: if voltage_v.is_empty() {
                    "1 or more".to_owned()
                } else {
                    format!("{} (as voltage_v)", voltage_v.len())
                },
                advice: "give one voltage a sample",
            });
        }
        all_finite("voltage_v", voltage_v, 1e4, "give volts at the actuator")?;
        all_finite(
            "voltage2_v",
            voltage2_v.unwrap_or_default(),
            1e4,
            "give volts at the actuator",
        )?;
        let before_latch = self.is_staircase(sample_period_s);
        let mut run = Run {
            position_um: Vec::with_capacity(voltage_v.len()),
            true_position_um: Vec::with_capacity(voltage_v.len()),
            temperature_c: self.sample.temperature_c.map(|_| Vec::with_capacity(voltage_v.len())),
        };
        for (k, &command_v) in voltage_v.iter().enumerate() {
            let command2_v = voltage2_v.map_or(self.command2_v, |other| other[k]);
            if before_latch {
                run.push(&self.sample);
            }
            self.advance(command_v, command2_v, sample_period_s);
            if !before_latch {
                run.push(&self.sample);
            }
        }
        Ok(run)
    }

    fn is_staircase(&self, period_s: f64) -> bool {
        self.config.hold == Hold::Zero && (period_s / self.config.sample_period_s - 1.0).abs() < 1e-9
    }

    /// One sample: command over `period_s`, reading at its end.
    fn advance(&mut self, voltage_v: f64, voltage2_v: f64, period_s: f64) {
        let wanted_v = if voltage_v.is_finite() {
            voltage_v
        } else {
            self.command_v
        };
        let wanted2_v = if voltage2_v.is_finite() {
            voltage2_v
        } else {
            self.command2_v
        };
        let staircase = self.is_staircase(period_s);
        let steps = (period_s / INNER_STEP_S - 1e-9)
            .ceil()
            .clamp(FEWEST_INNER_STEPS, MOST_INNER_STEPS);
        let step_s = period_s / steps;
        if step_s != self.step_s {
            let late_s = if self.config.hold == Hold::Zero && !staircase {
                0.5 * self.config.sample_period_s
            } else {
                0.0
            };
            let rest_v = self.converted(self.command_v);
            self.chain.set_step(step_s, late_s, rest_v);
            self.sensor.set_step(step_s);
            self.step_s = step_s;
        }
        let (start_v, start2_v, start_s) = (self.command_v, self.command2_v, self.time_s);
        let mut command = Command {
            from_v: self.converted(if staircase { wanted_v } else { start_v }),
            to_v: 0.0,
            from2_v: if staircase { wanted2_v } else { start2_v },
            to2_v: 0.0,
        };
        for n in 1..=steps as usize {
            let part = n as f64 / steps;
            // At part = 1 exactly the wanted value: a + (b - a) may be off by a rounding.
            let line = |from: f64, to: f64| {
                if staircase || part == 1.0 {
                    to
                } else {
                    from + part * (to - from)
                }
            };
            command.to_v = self.converted(line(start_v, wanted_v));
            command.to2_v = line(start2_v, wanted2_v);
            self.time_s = start_s + part * period_s;
            let position_um = self.chain.advance(command, self.time_s);
            self.sensor.advance(position_um);
            command.from_v = command.to_v;
            command.from2_v = command.to2_v;
        }
        self.command_v = wanted_v;
        self.command2_v = wanted2_v;
        self.read();
    }

    /// The command after the converter, volts at the actuator.
    fn converted(&self, voltage_v: f64) -> f64 {
        match &self.config.dac {
            None => voltage_v,
            Some(dac) => dac.quantise(voltage_v / self.config.amplifier.gain) * self.config.amplifier.gain,
        }
    }

    fn read(&mut self) {
        let reading = self.sensor.read();
        let time_s = self.time_s;
        self.sample = Sample {
            position_um: reading.position_um,
            position_code: reading.code,
            true_position_um: self.chain.position_um,
            actuator_v: self.chain.actuator_v(),
            temperature_c: self.chain.thermal.as_mut().map(|thermal| thermal.read_c(time_s)),
        };
    }
}

impl Run {
    fn push(&mut self, sample: &Sample) {
        self.position_um.push(sample.position_um);
        self.true_position_um.push(sample.true_position_um);
        if let (Some(column), Some(temperature_c)) = (&mut self.temperature_c, sample.temperature_c) {
            column.push(temperature_c);
        }
    }
}
