//! What the watchdog is fed for: the interrupt that comes back, and main that goes round.
//!
//! Main carries the button and the host's orders: with main hung, nobody can stop the loop.

use crate::axes::Axes;
use crate::monitor::Fault;

/// 100 ms at 50 kHz: main takes some milliseconds for a round with a full ring of samples.
pub const MAIN_TICKS: u32 = 5000;

/// The interrupt's view of main's rounds.
#[derive(Debug, Default)]
pub struct Watch {
    round: u32,
    ticks: u32,
}

impl Watch {
    /// Main's count of its rounds, before a tick. When it has stood still for [`MAIN_TICKS`], a fault is latched, and the command falls.
    #[inline(always)]
    pub fn look<const N: usize>(&mut self, round: u32, axes: &mut impl Axes<N>) {
        if round != self.round {
            *self = Self { round, ticks: 0 };
        } else if self.ticks < MAIN_TICKS {
            self.ticks += 1;
            // Once: a fault that is latched again begins its ramp again.
            if self.ticks == MAIN_TICKS {
                axes.trip(Fault::Watchdog);
            }
        }
    }

    /// Whether to feed the watchdog after a tick. Main that has hung ends in a reset, once every axis is at its safe level.
    #[inline(always)]
    pub fn feeds(&self, at_rest: bool) -> bool {
        self.ticks < MAIN_TICKS || !at_rest
    }
}
