//! The simulated stage with what a host has to send before a run: points of an uploaded reference, then the start.

use crate::Bench;
use crate::learned::learned;
use crate::rig::adc;
use crate::two_axes::TwoAxisBench;
use hysteron_firmware::learned::Learned;
use hysteron_firmware::trajectory::{CHUNK_POINTS, TABLE_POINTS};
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::{Frame, Input, Mode, Order};
use hysteron_plant::Stage;

/// What board and stage did in a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Played {
    /// What the board reported.
    pub frame: Frame,
    /// The sensor's reading that it answers, micrometres.
    pub position_um: f64,
    /// Where the platform was at that instant, micrometres; a real one does not say.
    pub true_um: f64,
    /// Actuator voltage of the frame's code, volts.
    pub voltage_v: f64,
    /// That of the other axis; 0 without one.
    pub voltage2_v: f64,
}

/// One run on a simulated stage, which keeps its state for the next one.
#[derive(Debug, Clone)]
pub struct Player {
    /// The stage.
    pub stage: Stage,
    /// The other axis of it.
    other: Option<Stage>,
    /// Every tick so far.
    pub played: Vec<Played>,
    before: Vec<Order>,
    stop_at: Option<u32>,
}

impl Player {
    /// What the law had learned by the end; none where it does not learn.
    pub fn learned(&self) -> Option<Learned> {
        learned(self.played.iter().map(|tick| &tick.frame))
    }

    /// Starts at once, after `points` are uploaded where there are any, and stops `ticks` later; with no ticks it never starts.
    pub fn new(stage: Stage, points: Option<&[u16; TABLE_POINTS]>, ticks: u32) -> Self {
        let mut before = Vec::new();
        if let Some(points) = points {
            let (chunks, _) = points.as_chunks::<CHUNK_POINTS>();
            for (chunk, &shares) in (0..).zip(chunks) {
                before.extend(Change::Chunk { chunk, shares }.orders());
            }
        }
        let starts_at = before.len() as u32;
        if ticks > 0 {
            before.push(Order::Start);
        }
        Self {
            stage,
            other: None,
            played: Vec::new(),
            before,
            stop_at: (ticks > 0).then_some(starts_at + ticks),
        }
    }

    /// With another axis beside it, which the board runs as well.
    #[must_use]
    pub fn beside(self, other: Option<Stage>) -> Self {
        Self { other, ..self }
    }

    /// Ticks before the one that starts the run.
    pub fn ticks_before(&self) -> u32 {
        self.before.iter().filter(|order| **order != Order::Start).count() as u32
    }

    /// The first tick of the reference.
    pub fn begun(&self) -> Option<usize> {
        self.played.iter().position(|tick| tick.frame.mode() == Mode::Running)
    }
}

impl Player {
    /// A tick of the stage, the other axis at a voltage.
    fn step(&mut self, frame: &Frame, voltage2_v: f64) {
        let sample = self.stage.sample();
        let voltage_v = self.stage.v_from_code(u32::from(frame.dac));
        self.played.push(Played {
            frame: *frame,
            position_um: sample.position_um,
            true_um: sample.true_position_um,
            voltage_v,
            voltage2_v,
        });
        self.stage.step_two_axes(voltage_v, voltage2_v);
    }
}

impl Bench for Player {
    fn sample_rate_hz(&self) -> f64 {
        1.0 / self.stage.config().sample_period_s
    }

    fn input(&mut self, number: u32) -> Input {
        let order = match self.stop_at {
            Some(tick) if tick == number => Order::Stop,
            _ => self.before.get(number as usize).copied().unwrap_or_default(),
        };
        Input {
            adc: adc(&self.stage),
            order,
        }
    }

    fn output(&mut self, frame: &Frame) {
        self.step(frame, 0.0);
    }
}

impl TwoAxisBench for Player {
    fn inputs(&mut self, number: u32) -> [Input; 2] {
        let beside = Input {
            adc: self.other.as_ref().map_or(0, adc),
            order: Order::None,
        };
        [self.input(number), beside]
    }

    fn outputs(&mut self, [frame, beside]: &[Frame; 2]) {
        let other = self.other.as_mut();
        let voltage2_v = other.map_or(0.0, |other| {
            let voltage_v = other.v_from_code(u32::from(beside.dac));
            other.step(voltage_v);
            voltage_v
        });
        self.step(frame, voltage2_v);
    }
}
