//! The control application on ST's boards nucleo-h743zi (feature `h743zi`) and nucleo-g474re (`g474re`).
//!
//! TIM3 triggers the ADC 50 000 times a second; the loop runs in the interrupt of the end of conversion, in the memory that is fastest
//! for it, and writes a 16-bit DAC by SPI, whose output the same timer changes at a fixed instant of each period. The user's button starts and stops it; RTT carries the log (channel 0) and every tick
//! (channel 1), and orders and tables of the host (channel 1, back). One axis; both with the feature `two-axes`. `docs/boards/` says how to wire and
//! check it. It runs in a processor model (`cargo xtask firmware starts`); it has not run on a board.
#![no_std]
#![no_main]

mod board;
mod converter;
mod critical;
#[cfg(feature = "h743zi")]
mod ethernet;
mod fast;
#[cfg(not(feature = "two-axes"))]
mod flash;
mod hosts;
#[cfg(not(feature = "two-axes"))]
mod stored;

use board::Outputs;
use converter::Times;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use cortex_m::peripheral::DWT;
use cortex_m_rt::entry;
use embassy_stm32::gpio::Output;
use embassy_stm32::interrupt;
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::{Spi, mode::Master};
use heapless::spsc::{Producer, Queue};
use hosts::Hosts;
use hysteron_converters::ad5683r::{Ad5683r, Update};
use hysteron_core::codes::DacCode;
use hysteron_firmware::axes::Axes;
#[cfg(not(feature = "two-axes"))]
use hysteron_firmware::axes::one as image;
#[cfg(feature = "two-axes")]
use hysteron_firmware::axes::two as image;
use hysteron_firmware::button::{Button, Slot};
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::start::{Cause, Hardware, settle};
#[cfg(not(feature = "two-axes"))]
use hysteron_firmware::stored::{Next, Stored};
use hysteron_firmware::telemetry::Sample;
use hysteron_firmware::trajectory::Shape;
#[cfg(not(feature = "two-axes"))]
use hysteron_firmware::upload::{Answer, Message, Said};
use hysteron_firmware::watch::Watch;
#[cfg(feature = "two-axes")]
use hysteron_firmware::wire::Hello;
use hysteron_firmware::wire::{Frame, Input, Mode, Order, Setup};
use hysteron_firmware::{Board, kept, table, tick};
#[cfg(not(feature = "two-axes"))]
use hysteron_slot::{Refusal, Rule};
use image::{AXES, Banks, Control};
use rtt_target::{ChannelMode, rtt_init};
use static_cell::ConstStaticCell;

/// What the image is for, as `hysteron board flash` reads it.
#[cfg(feature = "h743zi")]
#[used]
#[unsafe(link_section = ".board")]
static IMAGE_FOR: [u8; 33] = *b"hysteron image for nucleo-h743zi\0";
#[cfg(feature = "g474re")]
#[used]
#[unsafe(link_section = ".board")]
static IMAGE_FOR: [u8; 33] = *b"hysteron image for nucleo-g474re\0";

/// Reference of the button's runs: a sine of 10 Hz inside the table's range.
const REFERENCE_HZ: f32 = 10.0;
/// Share of a table's range left free at either end, as `hysteron board run` does.
const INSET: f32 = 0.02;

/// A sample an axis.
type Tick = [Sample; AXES];

/// Ticks between the interrupt and main, one less than this: 5 ms at 50 kHz. A power of two: its places are counted without a division.
const PLACES: usize = 256;
/// From the interrupt to main. The oldest stay; a tick that finds it full is counted.
static TICKS: ConstStaticCell<Queue<Tick, PLACES>> = ConstStaticCell::new(Queue::new());
/// Ticks that found it full.
static LOST: AtomicU32 = AtomicU32::new(0);

/// The code that each DAC holds, see [`kept`]; a reset leaves it alone. After a loss of power its words have no check bits yet, and
/// reading one is a bus fault: [`settle`] asks for the reset's cause first.
// SAFETY: cortex-m-rt's section for what it does not set to zero; any value is one.
#[unsafe(link_section = ".uninit.KEPT")]
static KEPT: Shared<[AtomicU32; AXES]> = Shared(UnsafeCell::new(MaybeUninit::uninit()));

fn kept_words() -> &'static [AtomicU32; AXES] {
    // SAFETY: every word is an AtomicU32, of which any value is one.
    unsafe { (*KEPT.0.get()).assume_init_ref() }
}

type Dac = Ad5683r<Spi<'static, Blocking, Master>, Output<'static>, AXES>;

/// Writes the outputs' codes, and keeps them.
#[inline(always)]
fn set(dac: &mut Dac, codes: [DacCode; AXES], update: Update) {
    // The bus has no way to fail that the driver could see; the next tick writes again.
    let _ = dac.set(codes, update);
    for (word, code) in kept_words().iter().zip(codes) {
        word.store(kept::pack(code.0), Ordering::Relaxed);
    }
}

/// Converters, and what leaves the interrupt.
struct Converters {
    dac: Dac,
    fault: Output<'static>,
    to_main: Producer<'static, Tick, PLACES>,
    /// The sensors' codes of this tick.
    adc: [u16; AXES],
    late: bool,
    /// Every axis is at its safe level.
    at_rest: bool,
}

impl Board<AXES> for Converters {
    #[inline(always)]
    fn read(&mut self) -> [Input; AXES] {
        let order = ORDERS.take();
        self.adc = converter::codes();
        self.adc.map(|adc| Input { adc, order })
    }

    #[inline(always)]
    fn late(&self) -> bool {
        self.late
    }

    #[inline(always)]
    fn supplied(&self) -> bool {
        board::supplied()
    }

    #[inline(always)]
    fn write(&mut self, codes: [DacCode; AXES], frames: &[Frame; AXES]) {
        // A way down does not depend on the timer, nor on its wire.
        let runs = frames
            .iter()
            .all(|frame| frame.mode() != Mode::Off && frame.fault().is_none());
        let update = if runs { Update::ByLdac } else { Update::AtOnce };
        set(&mut self.dac, codes, update);
        // A code that came later has counted at once.
        if runs && converter::latched() {
            LATE_CODES.fetch_add(1, Ordering::Relaxed);
        }
        self.at_rest = frames.iter().all(|frame| frame.mode() == Mode::Off);
        // A fault of one axis is one of both.
        if frames[0].fault().is_some() {
            self.fault.set_high();
        } else {
            self.fault.set_low();
        }
        let mut axis = 0;
        let tick = frames.map(|frame| {
            let sample = Sample {
                frame,
                adc: self.adc[axis],
                axis: axis as u8,
            };
            axis += 1;
            sample
        });
        if self.to_main.enqueue(tick).is_err() {
            LOST.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// What the interrupt owns once the timer runs.
struct Loop {
    converters: Converters,
    axes: Control,
    watch: Watch,
}

/// Written by `main` before the timer starts, the interrupt's alone after that.
struct Shared<T>(UnsafeCell<MaybeUninit<T>>);
// SAFETY: main and the interrupt never use it at the same time, as said above, or it is an atomic; there is one core.
unsafe impl<T> Sync for Shared<T> {}
static LOOP: Shared<Loop> = Shared(UnsafeCell::new(MaybeUninit::uninit()));
/// The tables, as compiled in; read alone once the timer runs.
static BANKS: Shared<Banks> = Shared(UnsafeCell::new(MaybeUninit::uninit()));
static RUNNING: AtomicBool = AtomicBool::new(false);
/// Whether the last tick left every axis at its safe level.
static AT_REST: AtomicBool = AtomicBool::new(true);

/// What main asks of the controller. One a tick.
static ORDERS: Slot = Slot::new();

/// Most samples of one of main's rounds: a main slower than the ticks still looks at button and orders. Where the interrupt leaves it 1 % of
/// the 3400 cycles of a tick, a round at some 1000 cycles a sample takes 20 ms.
const SAMPLES_A_ROUND: usize = 32;

/// Ticks from the answer that says so to the new start: a debug probe fetches ten times a second.
#[cfg(not(feature = "two-axes"))]
const RESTART_TICKS: u32 = 25_000;

/// Main's rounds; while they stand still, main hangs.
static ROUNDS: AtomicU32 = AtomicU32::new(0);

/// Ticks at whose end the next conversion was done already.
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
/// Ticks whose code came after the latch.
static LATE_CODES: AtomicU32 = AtomicU32::new(0);
/// Longest interrupt, processor cycles.
static LONGEST: AtomicU32 = AtomicU32::new(0);

/// Size of the telemetry's buffer: 2500 samples, 51 ms of one axis, 25 ms of both.
#[cfg(feature = "h743zi")]
const TELEMETRY_BYTES: usize = 57_344;
/// As the other board's: 2080 samples, 41 ms. More would leave too little to main's stack, on which a complete law is made.
#[cfg(feature = "g474re")]
const TELEMETRY_BYTES: usize = 47_104;

/// The cause of the reset, then the watchdog, before anything that could wait; then the outputs, before anything that may be refused.
#[entry]
fn main() -> ! {
    let cause = board::cause();
    board::guard_the_start();
    let channels = rtt_init! {
        up: {
            0: { size: 1024, mode: ChannelMode::NoBlockTrim, name: "defmt" }
            1: { size: TELEMETRY_BYTES, mode: ChannelMode::NoBlockSkip, name: "telemetry" }
        }
        down: {
            0: { }
            1: { size: 256, name: "orders" }
        }
    };
    rtt_target::set_defmt_channel(channels.up.0);
    let (mut outputs, rest) = board::start();
    let mut core = unsafe {
        // SAFETY: nothing else has taken them: embassy uses none of DCB and DWT without a time driver.
        cortex_m::Peripherals::steal()
    };
    core.DCB.enable_trace();
    // A Cortex-M7 locks it at a reset (ARM DDI 0489, "DWT"); where that does not help, nothing waits for it.
    DWT::unlock();
    core.DWT.enable_cycle_counter();
    #[cfg(feature = "h743zi")]
    cache_instructions(&mut core);
    let banks = tables();
    let complete = image::hellos().any(|hello| hello.complete);
    let Some(times) = Times::new(table::SAMPLE_RATE_HZ, complete) else {
        defmt::panic!(
            "TIM3 cannot make {=f32} Hz with a code in each period",
            table::SAMPLE_RATE_HZ
        );
    };
    let sample_cycles = (rest.clock.processor_hz() as f32 / table::SAMPLE_RATE_HZ) as u32;
    let mut beginning = Beginning {
        held: outputs.held,
        dac: &mut outputs.dac,
        cause,
    };
    let fault = settle(&mut beginning, image::ways_to_safe(banks), sample_cycles);
    // From here on the outputs are safe, and whatever fails ends in the watchdog's reset.
    let board = match rest.start() {
        Ok(board) => board,
        Err(register) => defmt::panic!("{=str} is not what the figures say", register),
    };
    #[cfg(not(feature = "two-axes"))]
    let (mut stored, hello) = match board.slots {
        Some(slots) => {
            let (stored, hello) = stored::choose(slots, banks, cause.power);
            (Some(stored), hello)
        }
        None => (None, None),
    };
    #[cfg(feature = "two-axes")]
    let hello: Option<Hello> = None;
    if !board::resets_below_its_converters() {
        defmt::warn!("the brown-out level is below what the converters need: set it as docs/boards says");
    }
    let (to_main, mut ticks) = TICKS.take().split();
    make_loop(outputs, to_main, banks, fault);
    for compiled in image::hellos() {
        let hello = hello.filter(|hello| hello.bank == compiled.bank).unwrap_or(compiled);
        defmt::info!("bank {=u8}: table {=[u8]:02x}", hello.bank, hello.hash);
    }
    board::guard_the_loop();
    converter::start(&board.timer, times);

    let mut hosts = Hosts::new(
        (channels.up.1, channels.down.1),
        #[cfg(feature = "h743zi")]
        board.link,
        hello,
    );
    let mut log = Log::default();
    let mut button = Button::default();
    #[cfg(not(feature = "two-axes"))]
    let mut restart = None;
    loop {
        ROUNDS.fetch_add(1, Ordering::Relaxed);
        for tick in core::iter::from_fn(|| ticks.dequeue()).take(SAMPLES_A_ROUND) {
            hosts.send(&tick);
            log.see(&tick[0].frame);
        }
        // Both boards' user button is high while pressed.
        if let Some(last) = &log.last {
            let at = (last.mode(), last.fault());
            button.look(board.button.is_high(), last.number, at, &ORDERS);
        }
        #[cfg(feature = "h743zi")]
        hosts.poll();
        #[cfg(feature = "two-axes")]
        hosts.hear();
        #[cfg(not(feature = "two-axes"))]
        while let Some(message) = hosts.hear() {
            let mut sample_clock = stored::Clock {
                timer: &board.timer,
                times,
            };
            if answer(&mut hosts, stored.as_deref_mut(), message, &mut sample_clock) {
                restart = Some(log.seen);
            }
        }
        // The answer has to be fetched first; whatever began meanwhile goes on.
        #[cfg(not(feature = "two-axes"))]
        if let (Some(asked), true) = (restart, ORDERS.is_empty() && AT_REST.load(Ordering::Acquire))
            && log.seen.wrapping_sub(asked) > RESTART_TICKS
        {
            cortex_m::peripheral::SCB::sys_reset();
        }
    }
}

/// The tables, made and put where they stay. By itself, as [`make_loop`] is, or main would keep what either takes of its stack.
#[inline(never)]
fn tables() -> &'static mut Banks {
    let Ok(banks) = image::banks() else {
        defmt::panic!("a table is refused");
    };
    // SAFETY: the timer does not run yet, and main alone has it until it does.
    unsafe { (*BANKS.0.get()).write(banks) }
}

/// What the interrupt owns, at the safe levels, with a fault that is to be latched.
#[inline(never)]
fn make_loop(outputs: Outputs, to_main: Producer<'static, Tick, PLACES>, banks: &'static Banks, fault: Option<Fault>) {
    let mut axes = image::control(banks, &image::ranges_um(banks).map(setup));
    if let Some(fault) = fault {
        Axes::trip(&mut axes, fault);
    }
    let control = Loop {
        converters: Converters {
            dac: outputs.dac,
            fault: outputs.fault,
            to_main,
            adc: [0; AXES],
            late: false,
            at_rest: true,
        },
        axes,
        watch: Watch::default(),
    };
    // SAFETY: the timer does not run yet.
    unsafe { (*LOOP.0.get()).write(control) };
    RUNNING.store(true, Ordering::Release);
}

/// Instruction cache, for main; the interrupt's code lies where there is no need for one. As cortex-m does it, without masking.
#[cfg(feature = "h743zi")]
fn cache_instructions(core: &mut cortex_m::Peripherals) {
    /// IC of the CCR (ARM DDI 0403, B3.2.8).
    const ENABLE: u32 = 1 << 17;
    core.CBP.iciallu();
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    // SAFETY: nothing of it has been cached before.
    unsafe { core.SCB.ccr.modify(|word| word | ENABLE) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// What the button's runs do in a table's range.
fn setup([min_um, max_um]: [f32; 2]) -> Setup {
    let inset_um = INSET * (max_um - min_um);
    Setup {
        ticks: u32::MAX,
        shape: Shape::Sine,
        phase_step: (REFERENCE_HZ / table::SAMPLE_RATE_HZ * 4_294_967_296.0) as u32,
        low_um: min_um + inset_um,
        high_um: max_um - inset_um,
        feedforward: true,
        feedback: true,
        clocked: true,
    }
}

/// What the way to the safe levels needs of this board.
struct Beginning<'a> {
    dac: &'a mut Dac,
    held: Option<[DacCode; AXES]>,
    cause: Cause,
}

impl Hardware<AXES> for Beginning<'_> {
    fn cause(&self) -> Cause {
        self.cause
    }

    fn forget_cause(&mut self) {
        board::forget_cause();
    }

    fn supplied(&self) -> bool {
        board::supplied()
    }

    fn held(&self) -> Option<[DacCode; AXES]> {
        self.held
    }

    fn kept(&self) -> [u32; AXES] {
        kept_words().each_ref().map(|word| word.load(Ordering::Relaxed))
    }

    fn set(&mut self, codes: [DacCode; AXES]) {
        set(self.dac, codes, Update::AtOnce);
    }

    fn cycles(&self) -> u32 {
        DWT::cycle_count()
    }

    fn feed(&mut self) {
        board::feed();
    }
}

/// Does what a message asks for; the answer goes to all. Whether the board is to start anew.
#[cfg(not(feature = "two-axes"))]
fn answer(
    hosts: &mut Hosts,
    stored: Option<&mut Stored<flash::Memory>>,
    message: Message,
    clock: &mut stored::Clock<'_>,
) -> bool {
    let Some(stored) = stored else {
        let answer = Answer {
            to: Said::Due,
            number: 0,
            refused: Some(Refusal::new(Rule::NoSlots, "slot", 0.0)),
        };
        hosts.say(&answer.to_packet());
        return false;
    };
    match stored.take(message, clock) {
        Next::Say(answer) => hosts.say(&answer.to_packet()),
        Next::SaySlots => stored
            .answers()
            .iter()
            .for_each(|answer| hosts.say(&answer.to_packet())),
        Next::Restart(answer) => {
            hosts.say(&answer.to_packet());
            return true;
        }
    }
    false
}

/// Faults as they come, figures once a second.
#[derive(Default)]
struct Log {
    seen: u32,
    last: Option<Frame>,
    fault: Option<Fault>,
    bank: u8,
}

impl Log {
    fn see(&mut self, frame: &Frame) {
        self.seen = self.seen.wrapping_add(1);
        self.last = Some(*frame);
        if frame.fault() != self.fault {
            self.fault = frame.fault();
            defmt::warn!(
                "fault {=u8} at tick {=u32}",
                self.fault.map_or(0, |fault| fault as u8),
                frame.number
            );
        }
        if frame.bank() != self.bank {
            self.bank = frame.bank();
            defmt::info!("bank {=u8} from tick {=u32} on", self.bank, frame.number);
        }
        if self.seen.is_multiple_of(50_000) {
            defmt::info!(
                "tick {=u32}: reference {=f32} um, command {=f32} V, {=u32} frames lost, {=u32} overruns, {=u32} late codes, longest {=u32} cycles",
                frame.number,
                frame.reference_um,
                frame.command_v,
                LOST.load(Ordering::Relaxed),
                OVERRUNS.load(Ordering::Relaxed),
                LATE_CODES.load(Ordering::Relaxed),
                LONGEST.load(Ordering::Relaxed)
            );
        }
    }
}

/// The end of a conversion.
///
/// Deadline: the next one, 20 us. It is the only interrupt. Shared: [`LOOP`], see there; [`ORDERS`] from main, frames and counters to
/// it. On overrun it counts, and the controller trips after three in a row; the output holds meanwhile. Where it does not come for
/// [`hysteron_firmware::chips::WATCHDOG_US`], the watchdog resets the chip, and main begins with the way down.
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
        converter::codes();
        return;
    }
    // SAFETY: written before RUNNING was set; main does not touch it after that.
    let control = unsafe { (*LOOP.0.get()).assume_init_mut() };
    control.watch.look(ROUNDS.load(Ordering::Relaxed), &mut control.axes);
    tick(&mut control.converters, &mut control.axes);
    control.converters.late = converter::pending();
    if control.converters.late {
        OVERRUNS.fetch_add(1, Ordering::Relaxed);
    }
    LONGEST.fetch_max(DWT::cycle_count().wrapping_sub(entered), Ordering::Relaxed);
    AT_REST.store(control.converters.at_rest, Ordering::Release);
    // Fed here and nowhere else.
    if control.watch.feeds(control.converters.at_rest) {
        board::feed();
    }
}

/// Outside of the interrupt: the loop goes on above this and ramps the output down, until it finds that main hangs; the watchdog then
/// resets the chip, as it does before the loop runs, and the next start begins where this one has left the outputs.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        ORDERS.insist(Order::Stop);
    }
}

/// What defmt does where it panics.
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    loop {
        ORDERS.insist(Order::Stop);
    }
}
