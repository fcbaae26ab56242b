//! Instructions of one control tick, whole law, counted in QEMU: the core's, and the same algorithm in C.
#![no_std]
#![no_main]

mod contenders;

use contenders::{CTick, RustTick};
use cortex_m_rt::entry;
use counting::{Console, measure};
use mps2::semihosting;

#[entry]
fn main() -> ! {
    let mut console = Console::open();
    let (Ok(ten), Ok(hundred)) = (contenders::ten(), contenders::hundred()) else {
        semihosting::exit(false);
    };
    measure(&mut console, "rust 10", RustTick::tick, || ten);
    measure(&mut console, "rust 100", RustTick::tick, || hundred);
    for (name, tick) in contenders::C_10 {
        measure(&mut console, name, tick, CTick::ten);
    }
    for (name, tick) in contenders::C_100 {
        measure(&mut console, name, tick, CTick::hundred);
    }
    semihosting::exit(true);
}
