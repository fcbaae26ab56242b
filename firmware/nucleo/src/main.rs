//! The control application on ST's boards nucleo-h743zi (feature `h743zi`) and nucleo-g474re (`g474re`).
//!
//! TIM6 triggers the ADC 50 000 times a second; the loop runs in the interrupt of the end of conversion and writes a 16-bit DAC by
//! SPI. The user's button starts and stops it; `docs/boards/` says how to wire and check it. It builds; it has not run on a board.
#![no_std]
#![no_main]

mod ad5683r;
mod board;
mod converter;
mod frames;

use ad5683r::Ad5683r;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use cortex_m::peripheral::DWT;
use cortex_m_rt::entry;
use defmt_rtt as _;
use embassy_stm32::gpio::Output;
use embassy_stm32::interrupt;
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::{Spi, mode::Master};
use frames::Frames;
use hysteron_core::codes::DacCode;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::wire::{Frame, Input, Order, Setup};
use hysteron_firmware::{Board, table, tick};

/// Reference of the button's runs: a sine of 10 Hz inside the table's range.
const REFERENCE_HZ: f32 = 10.0;
/// Share of the table's range left free at either end, as `hysteron board run` does.
const INSET: f32 = 0.02;

/// Between the interrupt and the log.
static FRAMES: Frames = Frames::new();

/// Converters, and what leaves the interrupt.
struct Converters {
    dac: Ad5683r<Spi<'static, Blocking, Master>, Output<'static>>,
    fault: Output<'static>,
    late: bool,
}

impl Board for Converters {
    #[inline(always)]
    fn read(&mut self) -> Input {
        let order = match ORDER.swap(NOTHING, Ordering::Relaxed) {
            START => Order::Start,
            STOP => Order::Stop,
            CLEAR => Order::Clear,
            _ => Order::None,
        };
        Input {
            adc: converter::code(),
            order,
        }
    }

    #[inline(always)]
    fn late(&self) -> bool {
        self.late
    }

    #[inline(always)]
    fn write(&mut self, code: DacCode, frame: &Frame) {
        // The bus has no way to fail that the driver could see; the next tick writes again.
        let _ = self.dac.set(code);
        if frame.fault().is_some() {
            self.fault.set_high();
        } else {
            self.fault.set_low();
        }
        FRAMES.push(*frame);
    }
}

/// What the interrupt owns once the timer runs.
struct Loop {
    converters: Converters,
    controller: Controller<table::Law>,
}

/// Written by `main` before the timer starts, the interrupt's alone after that.
struct Shared<T>(UnsafeCell<MaybeUninit<T>>);
// SAFETY: main and the interrupt never use it at the same time, as said above; there is one core.
unsafe impl<T> Sync for Shared<T> {}
static LOOP: Shared<Loop> = Shared(UnsafeCell::new(MaybeUninit::uninit()));
static RUNNING: AtomicBool = AtomicBool::new(false);

const NOTHING: u8 = 0;
const START: u8 = 1;
const STOP: u8 = 2;
const CLEAR: u8 = 3;
/// What main asks of the controller.
static ORDER: AtomicU8 = AtomicU8::new(NOTHING);
/// Ticks at whose end the next conversion was done already.
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
/// Longest interrupt, processor cycles.
static LONGEST: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    let board = board::start();
    let mut core = unsafe {
        // SAFETY: nothing else has taken them: embassy uses none of DCB and DWT without a time driver.
        cortex_m::Peripherals::steal()
    };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    #[cfg(feature = "h743zi")]
    core.SCB.enable_icache();
    let Ok(parameters) = table::parameters() else {
        defmt::panic!("the table is refused");
    };
    let inset_um = INSET * (table::INPUT_MAX_UM - table::INPUT_MIN_UM);
    let setup = Setup {
        ticks: u32::MAX,
        shape: Shape::Sine,
        phase_step: (REFERENCE_HZ / table::SAMPLE_RATE_HZ * 4_294_967_296.0) as u32,
        low_um: table::INPUT_MIN_UM + inset_um,
        high_um: table::INPUT_MAX_UM - inset_um,
        feedforward: true,
        feedback: true,
        clocked: true,
    };
    let control = Loop {
        converters: Converters {
            dac: board.dac,
            fault: board.fault,
            late: false,
        },
        controller: Controller::new(parameters, &setup),
    };
    // SAFETY: the timer does not run yet.
    unsafe { (*LOOP.0.get()).write(control) };
    RUNNING.store(true, Ordering::Release);
    defmt::info!("table {=[u8]:02x}", table::HASH);
    converter::start(board.timer);

    let (mut pressed, mut running, mut seen, mut fault) = (false, false, 0_u32, None);
    loop {
        while let Some(frame) = FRAMES.pop() {
            seen = seen.wrapping_add(1);
            if frame.fault() != fault {
                fault = frame.fault();
                defmt::warn!(
                    "fault {=u8} at tick {=u32}",
                    fault.map_or(0, |fault| fault as u8),
                    frame.number
                );
            }
            if seen % 50_000 == 0 {
                defmt::info!(
                    "tick {=u32}: reference {=f32} um, command {=f32} V, {=u32} frames lost, {=u32} overruns, longest {=u32} cycles",
                    frame.number,
                    frame.reference_um,
                    frame.command_v,
                    FRAMES.lost(),
                    OVERRUNS.load(Ordering::Relaxed),
                    LONGEST.load(Ordering::Relaxed)
                );
            }
        }
        // Both boards' user button is high while pressed.
        let now = board.button.is_high();
        if now && !pressed {
            running = !running && fault.is_none();
            ORDER.store(
                if fault.is_some() {
                    CLEAR
                } else if running {
                    START
                } else {
                    STOP
                },
                Ordering::Relaxed,
            );
        }
        pressed = now;
    }
}

/// The end of a conversion.
///
/// Deadline: the next one, 20 us. It is the only interrupt. Shared: [`LOOP`], see there; [`ORDER`] from main, frames and counters to
/// it. On overrun it counts, and the controller trips after three in a row; the output holds meanwhile.
#[cfg_attr(feature = "h743zi", interrupt)]
#[cfg(feature = "h743zi")]
fn ADC() {
    sample();
}

/// As the other board's.
#[cfg(feature = "g474re")]
#[interrupt]
fn ADC1_2() {
    sample();
}

#[inline(always)]
fn sample() {
    let entered = DWT::cycle_count();
    if !RUNNING.load(Ordering::Acquire) {
        converter::code();
        return;
    }
    // SAFETY: written before RUNNING was set; main does not touch it after that.
    let control = unsafe { (*LOOP.0.get()).assume_init_mut() };
    tick(&mut control.converters, &mut control.controller);
    control.converters.late = converter::pending();
    if control.converters.late {
        OVERRUNS.fetch_add(1, Ordering::Relaxed);
    }
    LONGEST.fetch_max(DWT::cycle_count().wrapping_sub(entered), Ordering::Relaxed);
}

/// Outside of the interrupt: the loop goes on above this and ramps the output down.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        ORDER.store(STOP, Ordering::Relaxed);
    }
}

/// What defmt does where it panics.
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    loop {
        ORDER.store(STOP, Ordering::Relaxed);
    }
}
