//! Samples from the interrupt to main: a ring whose size is a constant, so that no division by it can fail.

use crate::image::AXES;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};
use hysteron_firmware::telemetry::Sample;

/// A power of two: 5 ms at 50 kHz.
const PLACES: usize = 256;

/// A tick: a sample an axis.
pub type Tick = [Sample; AXES];

/// One writer, one reader; the oldest stay, a tick that finds it full is counted.
pub struct Samples {
    places: [UnsafeCell<MaybeUninit<Tick>>; PLACES],
    written: AtomicU32,
    read: AtomicU32,
    lost: AtomicU32,
}

// SAFETY: `push` is called by the interrupt alone and `pop` by main alone; a place belongs to the writer until `written` passes it and
// to the reader until `read` does.
unsafe impl Sync for Samples {}

impl Samples {
    /// None.
    pub const fn new() -> Self {
        Self {
            places: [const { UnsafeCell::new(MaybeUninit::uninit()) }; PLACES],
            written: AtomicU32::new(0),
            read: AtomicU32::new(0),
            lost: AtomicU32::new(0),
        }
    }

    /// By the interrupt.
    #[inline(always)]
    pub fn push(&self, tick: Tick) {
        let written = self.written.load(Ordering::Relaxed);
        if written.wrapping_sub(self.read.load(Ordering::Acquire)) >= PLACES as u32 {
            self.lost.fetch_add(1, Ordering::Relaxed);
            return;
        }
        // SAFETY: the place is the writer's.
        unsafe { (*self.places[written as usize % PLACES].get()).write(tick) };
        self.written.store(written.wrapping_add(1), Ordering::Release);
    }

    /// By main.
    pub fn pop(&self) -> Option<Tick> {
        let read = self.read.load(Ordering::Relaxed);
        if read == self.written.load(Ordering::Acquire) {
            return None;
        }
        // SAFETY: the place is the reader's, and has been written.
        let tick = unsafe { (*self.places[read as usize % PLACES].get()).assume_init() };
        self.read.store(read.wrapping_add(1), Ordering::Release);
        Some(tick)
    }

    /// Ticks that found it full.
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }
}
