//! Two axes on one sample clock: two controllers, each told what the other takes in.

use crate::controller::Controller;
use crate::law::Law;
use crate::wire::{Frame, Input};

/// The controllers of both axes.
///
/// They start, stop and fall together: an order of the first input is for both, and a fault of one axis is a fault of the other. What
/// one axis will do is known as early as its own law takes it in, and is taken off the other's target where its table has a
/// `cross_um_per_um`. Where it has a `coupling` instead, identified from the other axis' voltage, that is the last command: late by the
/// law's preview, `w t` of what couples at an angular frequency `w` (3 % at 17 Hz and 16 samples).
#[derive(Debug, Clone)]
pub struct TwoAxes<X: Law, Y: Law> {
    x: Controller<X>,
    y: Controller<Y>,
}

impl<X: Law, Y: Law> TwoAxes<X, Y> {
    /// Both at their safe levels.
    pub fn new(x: Controller<X>, y: Controller<Y>) -> Self {
        Self { x, y }
    }

    /// One tick of both. Total, as [`Controller::step`].
    ///
    /// # Cost
    /// Twice that of [`Controller::step`], and some 20 instructions.
    pub fn step(&mut self, [of_x, of_y]: [Input; 2], late: bool) -> [Frame; 2] {
        let (x_um, y_um) = (self.x.coming_um(), self.y.coming_um());
        let (x_v, y_v) = (self.x.command_v(), self.y.command_v());
        self.x.set_beside(y_um, y_v);
        self.y.set_beside(x_um, x_v);
        let of_y = Input {
            order: of_x.order,
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
}
