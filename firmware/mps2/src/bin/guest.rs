//! The controller with a stage in the guest beside it, and, where [`Setup::clocked`], with the same stage in a process of the host: what
//! both give must be the same.
//!
//! Without the sample clock: what the ticks compute does not depend on it.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::small_stage::SmallStage;
use hysteron_firmware::table;
use hysteron_firmware::wire::{FRAME_BYTES, INPUT_BYTES, Input, SETUP_BYTES, Setup, Summary};
use mps2::semihosting::{self, File};

/// Seed of the stage's noise; the host's has the same.
const SEED: u32 = 7;
/// Frames that are sent at once where nobody waits for one.
const BATCH: usize = 64;

#[entry]
fn main() -> ! {
    let to_host = File::open(c"from-board", semihosting::WRITE);
    let mut from_host = File::open(c"to-board", semihosting::READ);
    for hello in table::hellos() {
        to_host.write(&hello.to_bytes());
    }
    loop {
        let mut bytes = [0; SETUP_BYTES];
        from_host.read(&mut bytes);
        let setup = Setup::from_bytes(&bytes);
        if setup.ticks == 0 {
            semihosting::exit(true);
        }
        let Ok(parameters) = table::parameters() else {
            semihosting::exit(false);
        };
        let stage = SmallStage::new(&parameters, SEED);
        let controller = Controller::new(parameters, &setup);
        if setup.clocked {
            with_host(&setup, controller, &mut from_host, &to_host);
        } else {
            with_guest(&setup, controller, stage, &to_host);
        }
        to_host.write(&Summary::default().to_bytes());
    }
}

/// A code each way a tick.
fn with_host(setup: &Setup, mut controller: Controller<table::Law>, from_host: &mut File, to_host: &File) {
    for _ in 0..setup.ticks {
        let mut bytes = [0; INPUT_BYTES];
        from_host.read(&mut bytes);
        let frame = controller.step(Input::from_bytes(bytes), false);
        to_host.write(&frame.to_bytes());
    }
}

/// Nothing comes in: the frames go out.
fn with_guest(setup: &Setup, mut controller: Controller<table::Law>, mut stage: SmallStage, to_host: &File) {
    let mut frames = [[0; FRAME_BYTES]; BATCH];
    let mut number = 0;
    while number < setup.ticks {
        let mut filled = 0;
        for place in frames.iter_mut().take((setup.ticks - number) as usize) {
            let frame = controller.step(stage.input(number, setup.ticks), false);
            stage.output(frame.dac);
            *place = frame.to_bytes();
            number += 1;
            filled += FRAME_BYTES;
        }
        if let Some(bytes) = frames.as_flattened().get(..filled) {
            to_host.write(bytes);
        }
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
