//! Two axes on QEMU's boards: a pair of ADC codes in, a pair of DAC codes out a tick, by the sample clock or as fast as the host answers.
#![no_std]
#![no_main]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m_rt::entry;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::wire::{Frame, INPUT_BYTES, Input, Order, SETUP_BYTES, Setup, Summary};
use hysteron_firmware::{table, table_y};
use mps2::semihosting::{self, File};
use mps2::timer;
use mps2::timing::{Entry, Timing};

/// The tables of both axes, as compiled in: made once, before the first run.
struct Banks {
    x: [Parameters<table::Law>; table::BANKS],
    y: [Parameters<table_y::Law>; table_y::BANKS],
}
/// Main's alone, or the interrupt's: see [`BANKS`] and [`LOOP`].
struct Shared<T>(UnsafeCell<MaybeUninit<T>>);
// SAFETY: main and the interrupt never use it at the same time, as said there; there is one core.
unsafe impl<T> Sync for Shared<T> {}
/// Written once by main, read after that.
static BANKS: Shared<Banks> = Shared(UnsafeCell::new(MaybeUninit::uninit()));

type Axes = TwoAxes<table::Law, table_y::Law>;

/// What the interrupt owns once the timer runs.
struct Loop {
    from_host: File,
    to_host: File,
    axes: Axes,
    ticks: u32,
    late: bool,
    timing: Timing,
}
/// Main's before the timer starts and after [`DONE`], the interrupt's between.
static LOOP: Shared<Loop> = Shared(UnsafeCell::new(MaybeUninit::uninit()));
static DONE: AtomicBool = AtomicBool::new(false);

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
        let x = Controller::new(banks.x[0], &setups[0]).with_banks(&banks.x);
        let y = Controller::new(banks.y[0], &setups[1]).with_banks(&banks.y);
        let (axes, ticks) = (TwoAxes::new(x, y), setups[0].ticks);
        let summary = if setups[0].clocked {
            let control = Loop {
                from_host: from_host.again(),
                to_host: to_host.again(),
                axes,
                ticks,
                late: false,
                timing: Timing::default(),
            };
            run(control)
        } else {
            run_unclocked(axes, ticks, &mut from_host, &to_host);
            Summary::default()
        };
        to_host.write(&summary.to_bytes());
    }
}

/// By the sample clock.
fn run(control: Loop) -> Summary {
    // SAFETY: the timer does not run.
    unsafe { (*LOOP.0.get()).write(control) };
    DONE.store(false, Ordering::Release);
    timer::start();
    while !DONE.load(Ordering::Acquire) {
        // Not wfi, see the image of one axis.
        core::hint::spin_loop();
    }
    // SAFETY: initialised above; the timer has been stopped by the interrupt.
    *unsafe { (*LOOP.0.get()).assume_init_ref() }.timing.summary()
}

/// As fast as the host answers; a tick that is held up makes the next one late.
fn run_unclocked(mut axes: Axes, ticks: u32, from_host: &mut File, to_host: &File) {
    let mut late = false;
    for _ in 0..ticks {
        let inputs = read(from_host);
        write(to_host, &axes.step(inputs, late));
        late = matches!(inputs[0].order, Order::Stall(edges) if edges > 0);
    }
}

fn read(from_host: &mut File) -> [Input; 2] {
    [(); 2].map(|()| {
        let mut bytes = [0; INPUT_BYTES];
        from_host.read(&mut bytes);
        Input::from_bytes(bytes)
    })
}

fn write(to_host: &File, frames: &[Frame; 2]) {
    for frame in frames {
        to_host.write(&frame.to_bytes());
    }
}

/// The sample clock's interrupt.
///
/// Deadline: the next edge, 20 us. It is the only interrupt. Shared: [`LOOP`], see there. On overrun it counts and goes on with the next
/// edge at once; edges missed altogether are counted by the second timer.
extern "C" fn sample_clock() {
    let entry = Entry::now();
    // SAFETY: written before the timer was started; main does not touch it before DONE.
    let control = unsafe { (*LOOP.0.get()).assume_init_mut() };
    let inputs = read(&mut control.from_host);
    let read_at = timer::elapsed();
    let frames = control.axes.step(inputs, control.late);
    let cost = timer::elapsed().wrapping_sub(read_at);
    write(&control.to_host, &frames);
    control.timing.tick(entry, cost);
    if let Order::Stall(edges) = inputs[0].order {
        timer::wait_for_edges(u32::from(edges));
    }
    control.late = control.timing.late();
    if control.timing.done() >= control.ticks {
        timer::stop();
        DONE.store(true, Ordering::Release);
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
