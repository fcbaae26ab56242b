//! The stage, with orders by tick.

use hysteron_board::{Bench, Rig};
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::{ACCEPTED, Frame, Input, Order, REFUSED};

/// The stage, and orders by tick; remembers what it gave.
pub(crate) struct Scripted {
    pub rig: Rig,
    pub orders: Vec<Order>,
    pub inputs: Vec<Input>,
}

impl Scripted {
    /// Single orders, and changes whose orders come on the ticks from theirs on.
    pub(crate) fn new(rig: Rig, ticks: u32, script: &[(usize, Order)], changes: &[(usize, Change)]) -> Self {
        let mut orders = vec![Order::None; ticks as usize];
        for &(tick, order) in script {
            orders[tick] = order;
        }
        for (tick, change) in changes {
            for (k, order) in change.orders().enumerate() {
                orders[tick + k] = order;
            }
        }
        Self {
            rig,
            orders,
            inputs: Vec::new(),
        }
    }
}

impl Bench for Scripted {
    fn sample_rate_hz(&self) -> f64 {
        self.rig.sample_rate_hz()
    }

    fn input(&mut self, number: u32) -> Input {
        let order = self.orders.get(number as usize).copied().unwrap_or(Order::None);
        let input = Input {
            order,
            ..self.rig.input(number)
        };
        self.inputs.push(input);
        input
    }

    fn output(&mut self, frame: &Frame) {
        self.rig.output(frame);
    }
}

/// The ticks that answered a change, with the answer.
pub(crate) fn answers(frames: &[Frame]) -> Vec<(u32, u16)> {
    let of = |frame: &Frame| (frame.number, frame.flags & (ACCEPTED | REFUSED));
    frames.iter().map(of).filter(|answer| answer.1 != 0).collect()
}
