//! CMSDK watchdog (ARM DDI 0479, section 4.6): 25 MHz, counts down, its first time-out is the non-maskable interrupt.

use core::ptr::write_volatile;

const BASE: usize = 0x4000_8000;
const LOAD: *mut u32 = BASE as *mut u32;
const CONTROL: *mut u32 = (BASE + 0x8) as *mut u32;
const CLEAR: *mut u32 = (BASE + 0xc) as *mut u32;
const LOCK: *mut u32 = (BASE + 0xc00) as *mut u32;

/// What opens the other registers for writing.
const KEY: u32 = 0x1acc_e551;
/// Interrupt without reset: the handler stays, and a reset would drop the output in one step.
const INTERRUPT_ENABLE: u32 = 1;

/// Starts it; it bites after so many counts of 40 ns without [`feed`].
pub fn start(counts: u32) {
    // SAFETY: the watchdog's registers, of which nobody else is user; the non-maskable interrupt has its handler.
    unsafe {
        write_volatile(LOCK, KEY);
        write_volatile(LOAD, counts);
        // It counts while it is stopped, too: what came of that is no bite.
        write_volatile(CLEAR, 1);
        write_volatile(CONTROL, INTERRUPT_ENABLE);
    }
}

/// Starts its count anew.
#[inline(always)]
pub fn feed() {
    // SAFETY: as in `start`.
    unsafe { write_volatile(CLEAR, 1) };
}

/// Stops it and takes its interrupt back.
pub fn stop() {
    // SAFETY: as in `start`.
    unsafe {
        write_volatile(CONTROL, 0);
        write_volatile(CLEAR, 1);
    }
}
