//! The user's button, and the one place where orders wait for their tick.

use crate::monitor::Fault;
use crate::wire::{Input, Mode, Order};
use core::sync::atomic::{AtomicU16, Ordering};

/// An order on its way from main to the interrupt: one a tick, and none takes the place of another that still waits.
#[derive(Debug)]
pub struct Slot(AtomicU16);

/// No order, on the wire.
const NOTHING: u16 = 0;

impl Slot {
    /// An empty one.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicU16::new(NOTHING))
    }

    /// Puts an order there where there is none; whether it did.
    pub fn offer(&self, order: Order) -> bool {
        let word = to_word(order);
        let put = self
            .0
            .compare_exchange(NOTHING, word, Ordering::Relaxed, Ordering::Relaxed);
        put.is_ok()
    }

    /// Puts an order there, whatever waits: for a main that has failed.
    pub fn insist(&self, order: Order) {
        self.0.store(to_word(order), Ordering::Relaxed);
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.load(Ordering::Relaxed) == NOTHING
    }

    /// By the interrupt: what waits, or no order.
    #[inline(always)]
    pub fn take(&self) -> Order {
        let [number, value] = self.0.swap(NOTHING, Ordering::Relaxed).to_be_bytes();
        Input::from_bytes([0, 0, number, value]).order
    }
}

impl Default for Slot {
    fn default() -> Self {
        Self::new()
    }
}

fn to_word(order: Order) -> u16 {
    let [_, _, number, value] = Input { adc: 0, order }.to_bytes();
    u16::from_be_bytes([number, value])
}

/// 10 ms at 50 kHz: tactile switches bounce for up to 5 ms (the usual limit of their data sheets).
pub const STEADY_TICKS: u32 = 500;

/// Starts and stops, and clears a fault: on each press, once its contact has been steady for [`STEADY_TICKS`].
#[derive(Debug, Default)]
pub struct Button {
    pressed: bool,
    /// The tick from which on the contact has been the other way.
    since: Option<u32>,
    /// What the last press asks for and the slot had no room for.
    asked: Option<Order>,
}

impl Button {
    /// The contact at a tick, and what the loop is at on it. An order of the host's that waits goes first; this one comes after it.
    #[cold]
    pub fn look(&mut self, contact: bool, tick: u32, (mode, fault): (Mode, Option<Fault>), slot: &Slot) {
        if contact == self.pressed {
            self.since = None;
        } else {
            let since = *self.since.get_or_insert(tick);
            if tick.wrapping_sub(since) >= STEADY_TICKS {
                (self.pressed, self.since) = (contact, None);
                if contact {
                    self.asked = asked(mode, fault);
                }
            }
        }
        if self.asked.is_some_and(|order| slot.offer(order)) {
            self.asked = None;
        }
    }
}

/// What a press means. By what the loop is at, not by the presses before: the host starts and stops it, too.
fn asked(mode: Mode, fault: Option<Fault>) -> Option<Order> {
    match (fault, mode) {
        (Some(_), _) => Some(Order::Clear),
        (None, Mode::Off) => Some(Order::Start),
        (None, Mode::Rising | Mode::Running) => Some(Order::Stop),
        (None, Mode::Falling) => None,
    }
}
