//! QEMU's boards `mps2-an386` (Cortex-M4F) and `mps2-an500` (M7), which have the same memory map and timers: their registers, and
//! the files of the host. Images are made with it: the control application of this package, and `firmware/bench`.
#![no_std]

pub mod semihosting;
pub mod timer;
pub mod timing;
pub mod watchdog;
