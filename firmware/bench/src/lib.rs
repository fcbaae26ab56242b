//! How instructions are counted in QEMU, and over which signals.
//!
//! QEMU runs with `-icount shift=7`: an instruction is 128 ns of virtual time, 3.2 counts of the 25 MHz timer, so that a difference of
//! two readings, off by one count at most, names the instructions exactly. What an empty function costs is taken off.
#![no_std]

pub mod signals;

use core::fmt::Write;
use mps2::{semihosting, semihosting::File, timer};
use signals::{Kind, Signal};

/// Counts of the timer in 5 instructions: 5 x 128 ns / 40 ns.
const COUNTS_OF_FIVE: u32 = 16;

/// Ticks of each signal.
const TICKS: u32 = 10_000;

/// FNV-1a of codes.
pub struct Code(pub u32);

impl Default for Code {
    fn default() -> Self {
        Self(0x811c_9dc5)
    }
}

impl Code {
    pub fn add(&mut self, code: u16) {
        for byte in code.to_le_bytes() {
            self.0 = (self.0 ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        }
    }
}

/// The host's standard output.
pub struct Console(File);

impl Console {
    /// Opens it, and starts the timer that counts.
    pub fn open() -> Self {
        timer::start_free();
        Self(File::open(c":tt", semihosting::WRITE))
    }
}

impl Write for Console {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

/// A tick under the clock: state, the sensor's code, reference; the converter's code.
pub type Tick<S> = extern "C" fn(&mut S, u16, f32) -> u16;

extern "C" fn nothing<S>(_: &mut S, _: u16, _: f32) -> u16 {
    0
}

#[inline(never)]
fn timed<S>(tick: Tick<S>, state: &mut S, code: u16, reference_um: f32) -> (u32, u16) {
    let before = timer::count();
    let dac = tick(state, code, reference_um);
    let counts = timer::count().wrapping_sub(before);
    ((counts * 5 + COUNTS_OF_FIVE / 2) / COUNTS_OF_FIVE, dac)
}

/// One line a signal: contender, signal, mean in thousandths, worst, hash of the codes.
pub fn measure<S>(console: &mut Console, name: &str, tick: Tick<S>, state: impl Fn() -> S) {
    let tick = core::hint::black_box(tick);
    for kind in Kind::ALL {
        let (mut signal, mut state) = (Signal::new(kind), state());
        let (empty, _) = timed(core::hint::black_box(nothing::<S>), &mut state, 0, 0.0);
        let (mut sum, mut worst, mut hash) = (0_u64, 0, Code::default());
        for _ in 0..TICKS {
            let (code, reference_um) = signal.next();
            let (instructions, dac) = timed(tick, &mut state, code, reference_um);
            let net = instructions - empty;
            sum += u64::from(net);
            worst = worst.max(net);
            hash.add(dac);
        }
        let mean = sum * 1000 / u64::from(TICKS);
        let _ = writeln!(console, "{name} {} {mean} {worst} {:08x}", kind.name(), hash.0);
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

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    semihosting::exit(false)
}
