//! What stands at the converters: the simulated stage, or whatever a test puts there.

use crate::learned::learned;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Law;
use hysteron_firmware::learned::Learned;
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::{Frame, Input, Mode, Order, REFUSED};
use hysteron_plant::Stage;

/// The other side of the converters.
pub trait Bench {
    /// Rate that it is sampled at, hertz.
    fn sample_rate_hz(&self) -> f64;
    /// The code and the order of a tick.
    fn input(&mut self, number: u32) -> Input;
    /// Takes the code that answers it.
    fn output(&mut self, frame: &Frame);
    /// Whether the run shall end before its last tick.
    fn over(&self) -> bool {
        false
    }
}

/// What the board and the stage did, one value a tick.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// What the board reported.
    pub frames: Vec<Frame>,
    /// The ADC code that each frame answers.
    pub adc: Vec<u16>,
    /// Sensor reading of that code, micrometres.
    pub position_um: Vec<f64>,
    /// Actuator voltage of each frame's DAC code, volts.
    pub voltage_v: Vec<f64>,
}

impl Recording {
    /// What the law had learned by the end; none where it does not learn.
    pub fn learned(&self) -> Option<Learned> {
        learned(&self.frames)
    }

    /// Root mean square of reference less position over the later half of the ticks on which the loop ran, micrometres; 0 where it
    /// never ran.
    pub fn rms_um(&self) -> f64 {
        let errors: Vec<f64> = self
            .frames
            .iter()
            .zip(&self.position_um)
            .filter(|(frame, _)| frame.mode() == Mode::Running)
            .map(|(frame, y)| f64::from(frame.reference_um) - y)
            .collect();
        let late = &errors[errors.len() / 2..];
        // A sum of nothing is -0.
        (late.iter().fold(0.0, |sum, e| sum + e * e) / late.len().max(1) as f64).sqrt()
    }
}

/// The code of the sensor's reading.
pub(crate) fn adc(stage: &Stage) -> u16 {
    u16::try_from(stage.sample().position_code).unwrap_or(u16::MAX)
}

/// The simulated stage: as in a simulation of the loop, the first reading that a command can move is the next one.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The stage.
    pub stage: Stage,
    /// What it and the board did, from the start on.
    pub recording: Recording,
    /// What the board is asked for before that.
    changes: Vec<Change>,
    orders: Vec<Order>,
    /// The tick that refused a change.
    refused: Option<u32>,
    stop_at: u32,
}

impl Rig {
    /// Starts at the first tick, stops after so many seconds.
    pub fn new(stage: Stage, seconds: f64) -> Self {
        let stop_at = (seconds / stage.config().sample_period_s).round() as u32;
        Self {
            stage,
            recording: Recording::default(),
            changes: Vec::new(),
            orders: Vec::new(),
            refused: None,
            stop_at,
        }
    }

    /// Asks for changes first, and starts when they are made; does not where one is refused.
    #[must_use]
    pub fn after(self, changes: &[Change]) -> Self {
        Self {
            changes: changes.to_vec(),
            orders: changes.iter().flat_map(Change::orders).collect(),
            ..self
        }
    }

    /// Ticks that the changes take.
    pub fn changing_ticks(&self) -> u32 {
        self.orders.len() as u32
    }

    /// The tick and the name of a change that was refused.
    pub fn refused(&self) -> Option<(u32, &'static str)> {
        let refused = self.refused?;
        let mut end = 0;
        let change = self.changes.iter().find(|change| {
            end += change.orders().count() as u32;
            refused < end
        });
        Some((refused, change.map_or("a change", Change::name)))
    }
}

impl Bench for Rig {
    fn sample_rate_hz(&self) -> f64 {
        1.0 / self.stage.config().sample_period_s
    }

    fn input(&mut self, number: u32) -> Input {
        let sample = self.stage.sample();
        let adc = adc(&self.stage);
        if let Some(&order) = self.orders.get(number as usize) {
            return Input { adc, order };
        }
        self.recording.adc.push(adc);
        self.recording.position_um.push(sample.position_um);
        let order = match number - self.changing_ticks() {
            _ if self.refused.is_some() => Order::None,
            0 => Order::Start,
            n if n == self.stop_at => Order::Stop,
            _ => Order::None,
        };
        Input { adc, order }
    }

    fn output(&mut self, frame: &Frame) {
        let voltage_v = self.stage.v_from_code(u32::from(frame.dac));
        self.stage.step(voltage_v);
        if frame.number < self.changing_ticks() {
            if frame.flags & REFUSED != 0 {
                self.refused.get_or_insert(frame.number);
            }
            return;
        }
        self.recording.voltage_v.push(voltage_v);
        self.recording.frames.push(*frame);
    }
}

/// A rig that remembers what it gave, for the board to be given the same.
#[derive(Debug, Clone)]
pub struct Remembering {
    /// The rig.
    pub rig: Rig,
    /// Code and order of every tick.
    pub inputs: Vec<Input>,
}

impl Remembering {
    /// Nothing was given yet.
    pub fn new(rig: Rig) -> Self {
        Self {
            rig,
            inputs: Vec::new(),
        }
    }
}

impl Bench for Remembering {
    fn sample_rate_hz(&self) -> f64 {
        self.rig.sample_rate_hz()
    }

    fn input(&mut self, number: u32) -> Input {
        let input = self.rig.input(number);
        self.inputs.push(input);
        input
    }

    fn output(&mut self, frame: &Frame) {
        self.rig.output(frame);
    }
}

/// The same application against the same bench, in this process. A tick that is held up makes the next one late, as on the board.
pub fn drive_here<L: Law>(controller: &mut Controller<L>, ticks: u32, bench: &mut dyn Bench) {
    let mut late = false;
    for number in 0..ticks {
        let input = bench.input(number);
        bench.output(&controller.step(input, late));
        late = matches!(input.order, Order::Stall(edges) if edges > 0);
    }
}
