//! The control application on QEMU's `mps2-an386` (Cortex-M4F) and `mps2-an500` (M7), which have the same memory map and timers: CMSDK
//! timer 0 as sample clock, the converters by semihosting FIFOs. One axis; both with the feature `two-axes`.
#![no_std]
#![no_main]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m_rt::{entry, exception};
use hysteron_core::codes::DacCode;
use hysteron_firmware::axes::Axes;
#[cfg(not(feature = "two-axes"))]
use hysteron_firmware::axes::one as image;
#[cfg(feature = "two-axes")]
use hysteron_firmware::axes::two as image;
use hysteron_firmware::monitor::{Fault, WATCHDOG_SAMPLES};
use hysteron_firmware::wire::{FRAME_BYTES, Frame, INPUT_BYTES, Input, Order, SETUP_BYTES, Setup, Summary};
use hysteron_firmware::{Board, tick};
use image::{AXES, Banks, Control};
use mps2::semihosting::{self, File};
use mps2::timing::{Entry, Timing};
use mps2::{timer, watchdog};

/// Converters that are a process on the host. Virtual time stands still while it is waited for.
struct Emulated {
    from_host: File,
    to_host: File,
    order: Order,
    late: bool,
    /// Timer counts at the end of reading and at the start of writing: between them lies the tick.
    read_at: u32,
    written_at: u32,
}

impl Board<AXES> for Emulated {
    #[inline(always)]
    fn read(&mut self) -> [Input; AXES] {
        let mut bytes = [[0; INPUT_BYTES]; AXES];
        self.from_host.read(bytes.as_flattened_mut());
        let inputs = bytes.map(Input::from_bytes);
        self.order = inputs[0].order;
        self.read_at = timer::elapsed();
        inputs
    }

    #[inline(always)]
    fn late(&self) -> bool {
        self.late
    }

    #[inline(always)]
    fn supplied(&self) -> bool {
        true
    }

    #[inline(always)]
    fn write(&mut self, _: [DacCode; AXES], frames: &[Frame; AXES]) {
        self.written_at = timer::elapsed();
        self.to_host
            .write(frames.each_ref().map(Frame::to_bytes).as_flattened());
    }
}

/// What the interrupt owns once the timer runs.
struct Loop {
    board: Emulated,
    axes: Control,
    ticks: u32,
    timing: Timing,
}

/// Shared between `main`, before the timer starts and after [`DONE`], and the interrupt, between.
struct Shared<T>(UnsafeCell<MaybeUninit<T>>);
// SAFETY: main and the interrupt never use it at the same time, as said above; there is one core.
unsafe impl<T> Sync for Shared<T> {}
static LOOP: Shared<Loop> = Shared(UnsafeCell::new(MaybeUninit::uninit()));

/// The tables, as compiled in: made before the first run, which takes longer than a tick may, and read after that.
static BANKS: Shared<Banks> = Shared(UnsafeCell::new(MaybeUninit::uninit()));
static DONE: AtomicBool = AtomicBool::new(false);

#[entry]
fn main() -> ! {
    let to_host = File::open(c"from-board", semihosting::WRITE);
    let mut from_host = File::open(c"to-board", semihosting::READ);
    let Ok(banks) = image::banks() else {
        semihosting::exit(false);
    };
    // SAFETY: nobody has it yet, and it is not written again.
    let banks: &'static Banks = unsafe { (*BANKS.0.get()).write(banks) };
    for hello in image::hellos() {
        to_host.write(&hello.to_bytes());
    }
    loop {
        let mut setups = [[0; SETUP_BYTES]; AXES];
        from_host.read(setups.as_flattened_mut());
        // The first one's ticks and clock are those of both.
        let setups = setups.each_ref().map(Setup::from_bytes);
        let Setup { ticks, clocked, .. } = setups[0];
        if ticks == 0 {
            semihosting::exit(true);
        }
        let axes = image::control(banks, &setups);
        let summary = if clocked {
            run(axes, ticks, &mut from_host, &to_host)
        } else {
            run_unclocked(axes, ticks, &mut from_host, &to_host)
        };
        to_host.write(&summary.to_bytes());
    }
}

/// One run, from the safe level to the safe level.
fn run(axes: Control, ticks: u32, from_host: &mut File, to_host: &File) -> Summary {
    let board = Emulated {
        from_host: from_host.again(),
        to_host: to_host.again(),
        order: Order::None,
        late: false,
        read_at: 0,
        written_at: 0,
    };
    let control = Loop {
        board,
        axes,
        ticks,
        timing: Timing::default(),
    };
    // SAFETY: the timer does not run.
    unsafe { (*LOOP.0.get()).write(control) };
    DONE.store(false, Ordering::Release);
    watchdog::start(WATCHDOG_SAMPLES * timer::PERIOD);
    timer::start();
    while !DONE.load(Ordering::Acquire) {
        // Not wfi: woken from it under -icount, QEMU 7.2 passes over every second edge, as the second timer shows.
        core::hint::spin_loop();
    }
    // SAFETY: initialised above; the timer has been stopped by the interrupt.
    *unsafe { (*LOOP.0.get()).assume_init_ref() }.timing.summary()
}

/// Ticks that are exchanged at once where no clock is waited for.
const BATCH: usize = 64;

/// One run without the sample clock: the same ticks, as fast as they come. A tick that is held up makes the next one late.
fn run_unclocked(mut axes: Control, ticks: u32, from_host: &mut File, to_host: &File) -> Summary {
    let mut late = false;
    let mut left = ticks as usize;
    let mut inputs = [[[0; INPUT_BYTES]; AXES]; BATCH];
    let mut frames = [[[0; FRAME_BYTES]; AXES]; BATCH];
    while left > 0 {
        let now = left.min(BATCH);
        if let Some(inputs) = inputs.get_mut(..now) {
            from_host.read(inputs.as_flattened_mut().as_flattened_mut());
        }
        for (bytes, answers) in inputs.iter().zip(&mut frames).take(now) {
            let inputs = bytes.map(Input::from_bytes);
            *answers = Axes::step(&mut axes, inputs, late).map(|frame| frame.to_bytes());
            late = matches!(inputs[0].order, Order::Stall(edges) if edges > 0);
        }
        if let Some(frames) = frames.get(..now) {
            to_host.write(frames.as_flattened().as_flattened());
        }
        left -= now;
    }
    Summary::default()
}

/// The sample clock's interrupt.
///
/// Deadline: the next edge, 20 us. It is the only interrupt. Shared: [`LOOP`], see there. On overrun (the next edge has come before
/// the end) it counts and goes on with that edge at once; edges missed altogether are counted by the second timer.
extern "C" fn sample_clock() {
    let entry = Entry::now();
    // SAFETY: written before the timer was started; main does not touch it before DONE.
    let control = unsafe { (*LOOP.0.get()).assume_init_mut() };
    tick(&mut control.board, &mut control.axes);
    let cost = control.board.written_at.wrapping_sub(control.board.read_at);
    control.timing.tick(entry, cost, control.board.order == Order::Start);
    #[cfg(feature = "panic-on-purpose")]
    assert!(control.timing.done() < u32::MAX, "on purpose");
    match control.board.order {
        Order::Stall(edges) => timer::wait_for_edges(u32::from(edges)),
        Order::Hang => loop {
            core::hint::spin_loop();
        },
        _ => {}
    }
    control.board.late = control.timing.late();
    watchdog::feed();
    if control.timing.done() >= control.ticks {
        timer::stop();
        watchdog::stop();
        DONE.store(true, Ordering::Release);
    }
}

/// The watchdog: the interrupt has not come back in time.
///
/// It never will: this handler, above every interrupt, takes the loop over, ramps the command down at the sample rate and stays, with
/// the fault in every frame. Only a reset starts anew.
#[exception]
unsafe fn NonMaskableInt() {
    watchdog::stop();
    // SAFETY: written before the watchdog was started; the interrupt that this one has taken it from does not go on.
    let control = unsafe { (*LOOP.0.get()).assume_init_mut() };
    Axes::trip(&mut control.axes, Fault::Watchdog);
    let mut done = control.timing.done();
    loop {
        let before = timer::count();
        tick(&mut control.board, &mut control.axes);
        done += 1;
        if done >= control.ticks {
            control.board.to_host.write(&control.timing.summary().to_bytes());
            semihosting::exit(true);
        }
        while timer::count().wrapping_sub(before) < timer::PERIOD {}
    }
}

extern "C" fn unexpected() {
    semihosting::exit(false);
}

/// External interrupts: timer 0 is number 8 (ARM AN386, table 4-1).
// SAFETY: the section is where cortex-m-rt places the table, the name the one that it asks for.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
pub static __INTERRUPTS: [extern "C" fn(); 32] = {
    let mut table = [unexpected as extern "C" fn(); 32];
    table[timer::IRQ] = sample_clock;
    table
};

unsafe extern "C" {
    /// Nowhere: a path to a panic, anywhere in the image, does not link.
    fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never called, or it would not have linked.
    unsafe { a_panic_can_be_reached() }
}
