//! CMSDK timer 0 as the sample clock (ARM DDI 0479, section 4.4): 25 MHz, counts down, interrupt 8; timer 1 runs freely beside it.

use core::ptr::{read_volatile, write_volatile};

/// Number of the interrupt (ARM AN386, table 4-1).
pub const IRQ: usize = 8;

const BASE: usize = 0x4000_0000;
const CTRL: *mut u32 = BASE as *mut u32;
const VALUE: *mut u32 = (BASE + 0x4) as *mut u32;
const RELOAD: *mut u32 = (BASE + 0x8) as *mut u32;
const INTERRUPT: *mut u32 = (BASE + 0xc) as *mut u32;

/// Timer 1, in the same layout.
const FREE_CTRL: *mut u32 = (BASE + 0x1000) as *mut u32;
const FREE_VALUE: *mut u32 = (BASE + 0x1004) as *mut u32;
const FREE_RELOAD: *mut u32 = (BASE + 0x1008) as *mut u32;

const ENABLE: u32 = 1;
const INTERRUPT_ENABLE: u32 = 1 << 3;

/// Counts of 40 ns between two edges: 20 us, 50 kHz.
pub const PERIOD: u32 = 500;
const LAST: u32 = PERIOD - 1;

/// Starts the free timer alone.
pub fn start_free() {
    // SAFETY: the timer's registers, of which nobody else is user.
    unsafe {
        write_volatile(FREE_RELOAD, u32::MAX);
        write_volatile(FREE_VALUE, u32::MAX);
        write_volatile(FREE_CTRL, ENABLE);
    }
}

/// Starts the clock; the first edge comes after one period.
pub fn start() {
    start_free();
    // SAFETY: the timer's registers, of which nobody else is user; interrupt 8 has its entry in the vector table.
    unsafe {
        write_volatile(RELOAD, LAST);
        write_volatile(VALUE, LAST);
        write_volatile(CTRL, ENABLE | INTERRUPT_ENABLE);
        // NVIC_ISER0 (ARM DDI 0403, B3.4.4)
        write_volatile(0xe000_e100 as *mut u32, 1 << IRQ);
    }
}

/// Stops it, and takes back an edge that has come already.
pub fn stop() {
    // SAFETY: as in `start`.
    unsafe {
        write_volatile(CTRL, 0);
        // NVIC_ICER0: a level that is still there would enter the interrupt once more.
        write_volatile(0xe000_e180 as *mut u32, 1 << IRQ);
    }
    acknowledge();
}

/// Periods of 40 ns since the last edge, which is the counter's 0; its reload comes one later.
#[inline(always)]
pub fn elapsed() -> u32 {
    // SAFETY: reading the counter changes nothing.
    match unsafe { read_volatile(VALUE) }.min(LAST) {
        0 => 0,
        left => PERIOD - left,
    }
}

/// Clears the interrupt.
#[inline(always)]
pub fn acknowledge() {
    // SAFETY: as in `start`.
    unsafe { write_volatile(INTERRUPT, 1) };
}

/// Whether another edge has come since [`acknowledge`].
#[inline(always)]
pub fn pending() -> bool {
    // SAFETY: reading the status changes nothing.
    unsafe { read_volatile(INTERRUPT) & 1 != 0 }
}

/// Counts of the free timer, which wrap after 171 s.
#[inline(always)]
pub fn count() -> u32 {
    // SAFETY: reading the counter changes nothing.
    unsafe { !read_volatile(FREE_VALUE) }
}

/// Waits until so many edges have come since [`acknowledge`]; the last stays pending.
pub fn wait_for_edges(edges: u32) {
    for left in (0..edges).rev() {
        while !pending() {}
        if left > 0 {
            acknowledge();
        }
    }
}
