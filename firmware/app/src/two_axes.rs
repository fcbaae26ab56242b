//! Two axes on one sample clock: two controllers, each told what the other takes in.

use crate::controller::Controller;
use crate::law::Law;
use crate::monitor::Fault;
use crate::wire::{Frame, Input, Order};

/// The controllers of both axes.
///
/// They start, stop and fall together: an order of the first input is for both, but for changes, which [`Order::To`] may address to one;
/// and a fault of one axis is a fault of the other. What
/// one axis will do is known as early as its own law takes it in, and is taken off the other's target where its table has a
/// `cross_um_per_um`. Where it has a `coupling` instead, identified from the other axis' voltage, that is the last command: late by the
/// law's preview, `w t` of what couples at an angular frequency `w` (3 % at 17 Hz and 16 samples).
#[derive(Debug, Clone)]
pub struct TwoAxes<X: Law, Y: Law> {
    x: Controller<X>,
    y: Controller<Y>,
    /// Whom changes are for: 0 both, or the number of an axis.
    to: u8,
}

impl<X: Law, Y: Law> TwoAxes<X, Y> {
    /// Both at their safe levels.
    pub fn new(x: Controller<X>, y: Controller<Y>) -> Self {
        Self { x, y, to: 0 }
    }

    /// One tick of both. Total, as [`Controller::step`].
    ///
    /// # Cost
    /// Twice that of [`Controller::step`], and some 20 instructions.
    pub fn step(&mut self, [of_x, of_y]: [Input; 2], late: bool) -> [Frame; 2] {
        let (beside_x, beside_y) = (self.x.beside(), self.y.beside());
        self.x.set_beside(beside_y);
        self.y.set_beside(beside_x);
        let order = of_x.order;
        if let Order::To(axis) = order {
            self.to = axis;
        }
        let change = matches!(order, Order::Byte(_) | Order::Apply(_));
        let order_of = |axis| {
            let mine = !change || self.to == 0 || self.to == axis;
            if mine { order } else { Order::None }
        };
        let of_x = Input {
            order: order_of(1),
            ..of_x
        };
        let of_y = Input {
            order: order_of(2),
            ..of_y
        };
        let frames = [self.x.step(of_x, late), self.y.step(of_y, late)];
        match (self.x.fault(), self.y.fault()) {
            (Some(fault), None) => self.y.trip(fault),
            (None, Some(fault)) => self.x.trip(fault),
            _ => {}
        }
        frames
    }

    /// As [`Controller::trip`], of both.
    pub fn trip(&mut self, fault: Fault) {
        self.x.trip(fault);
        self.y.trip(fault);
    }
}
