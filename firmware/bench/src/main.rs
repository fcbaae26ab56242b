//! Instructions of one control tick, whole law, counted in QEMU: the core's, and the same algorithm in C.
#![no_std]
#![no_main]

mod contenders;

use contenders::{Few, Many, RustTick};
use core::fmt::Write;
use cortex_m_rt::entry;
use counting::{Console, measure};
use hysteron_core::play;
use hysteron_core::plays_sum::{self, Bank, SumOfPlays};
use hysteron_firmware::law::Plays;
use mps2::semihosting;

#[entry]
fn main() -> ! {
    let mut console = Console::open();
    let (Ok(ten), Ok(hundred)) = (contenders::ten(), contenders::hundred()) else {
        semihosting::exit(false);
    };
    if !(agree::<1>()
        && agree::<4>()
        && agree::<5>()
        && agree::<7>()
        && agree::<10>()
        && agree::<15>()
        && agree::<23>())
    {
        let _ = writeln!(
            console,
            "the image's way of moving plays and one play after the other gave different outputs"
        );
        semihosting::exit(false);
    }
    measure(&mut console, "rust 10", RustTick::tick, || ten);
    measure(&mut console, "rust 100", RustTick::tick, || hundred);
    for (name, tick) in contenders::C_10 {
        measure(&mut console, name, tick, Few::ten);
    }
    for (name, tick) in contenders::C_100 {
        measure(&mut console, name, tick, Many::hundred);
    }
    semihosting::exit(true);
}

/// Whether a bank of `N` plays has the same outputs and the same sum, moved as the image does it and play by play.
fn agree<const N: usize>() -> bool {
    let thresholds: [f32; N] = core::array::from_fn(|i| 0.11 * i as f32);
    let weights: [f32; N] = core::array::from_fn(|i| 0.7 - 0.3 * (i * 7 % 5) as f32);
    let bank = Bank {
        thresholds: &thresholds,
        weights: &weights,
        offset: 0.3,
    };
    let (mut of_chip, mut every) = ([0.0_f32; N], [0.0_f32; N]);
    let mut sums = plays_sum::sums(bank.offset, &weights, &of_chip);
    let mut seed = 1_u32;
    (0..2000).all(|_| {
        seed ^= seed << 13;
        seed ^= seed >> 17;
        seed ^= seed << 5;
        // Few values, so that plays meet their bounds exactly; the envelope opens by up to a tenth.
        let (input, open) = (0.05 * (seed % 61) as f32, 0.001 * (seed >> 16 & 63) as f32);
        let found = Plays::step(&bank, &mut of_chip, &mut sums, input - open, input + open);
        play::advance(&thresholds, &mut every, input - open, input + open);
        found == plays_sum::sum(bank.offset, &weights, &every) && of_chip == every
    })
}
