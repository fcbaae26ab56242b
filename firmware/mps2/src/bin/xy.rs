//! Two axes on QEMU's boards: a pair of ADC codes in, a pair of DAC codes out a tick, as fast as the host answers.
//!
//! Without the sample clock: what the ticks compute does not depend on it, and `firmware/bench` counts what they cost.
#![no_std]
#![no_main]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use cortex_m_rt::entry;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::wire::{INPUT_BYTES, Input, Order, SETUP_BYTES, Setup};
use hysteron_firmware::{table, table_y};
use mps2::semihosting::{self, File};

/// The tables of both axes, as compiled in: made once, before the first run.
struct Banks {
    x: [Parameters<table::Law>; table::BANKS],
    y: [Parameters<table_y::Law>; table_y::BANKS],
}
struct Shared(UnsafeCell<MaybeUninit<Banks>>);
// SAFETY: main alone uses it.
unsafe impl Sync for Shared {}
static BANKS: Shared = Shared(UnsafeCell::new(MaybeUninit::uninit()));

#[entry]
fn main() -> ! {
    let to_host = File::open(c"from-board", semihosting::WRITE);
    let mut from_host = File::open(c"to-board", semihosting::READ);
    let (Ok(x), Ok(y)) = (table::banks(), table_y::banks()) else {
        semihosting::exit(false);
    };
    // SAFETY: nobody has it yet, and it is not written again.
    let banks: &'static Banks = unsafe { (*BANKS.0.get()).write(Banks { x, y }) };
    for hello in table::hellos().into_iter().chain(table_y::hellos()) {
        to_host.write(&hello.to_bytes());
    }
    loop {
        let setups = [(); 2].map(|()| {
            let mut bytes = [0; SETUP_BYTES];
            from_host.read(&mut bytes);
            Setup::from_bytes(&bytes)
        });
        if setups[0].ticks == 0 {
            semihosting::exit(true);
        }
        run(banks, &setups, &mut from_host, &to_host);
    }
}

fn run(banks: &'static Banks, setups: &[Setup; 2], from_host: &mut File, to_host: &File) {
    let x = Controller::new(banks.x[0], &setups[0]).with_banks(&banks.x);
    let y = Controller::new(banks.y[0], &setups[1]).with_banks(&banks.y);
    let mut axes = TwoAxes::new(x, y);
    let mut late = false;
    for _ in 0..setups[0].ticks {
        let inputs = [(); 2].map(|()| {
            let mut bytes = [0; INPUT_BYTES];
            from_host.read(&mut bytes);
            Input::from_bytes(bytes)
        });
        for frame in axes.step(inputs, late) {
            to_host.write(&frame.to_bytes());
        }
        late = matches!(inputs[0].order, Order::Stall(edges) if edges > 0);
    }
}

extern "C" fn unexpected() {
    semihosting::exit(false);
}

/// No interrupt is in use.
// SAFETY: the section is where cortex-m-rt places the table, the name the one that it asks for.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
pub static __INTERRUPTS: [extern "C" fn(); 32] = [unexpected; 32];

unsafe extern "C" {
    /// Nowhere: a path to a panic, anywhere in the image, does not link.
    fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never called, or it would not have linked.
    unsafe { a_panic_can_be_reached() }
}
