//! The way from a reset to the safe levels, on a board of flags and words: what each converter is told, by literal numbers.

use hysteron_core::codes::DacCode;
use hysteron_firmware::kept;
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::start::{Cause, Hardware, settle};
use std::cell::Cell;

/// Processor cycles of a sample: 400 MHz and 50 kHz.
const SAMPLE_CYCLES: u32 = 8000;

/// A board whose converters hold codes, and what they were told.
struct Registers<const N: usize> {
    cause: Cause,
    /// No word of it has been written since power came: reading it is a fault.
    unwritten: bool,
    words: [u32; N],
    held: [u16; N],
    /// Whether the converters say what they hold.
    answers: bool,
    told: Vec<[u16; N]>,
    /// Cycles that a look at the counter takes; 0 where it is locked.
    cycles_a_look: u32,
    cycles: Cell<u32>,
    looks: Cell<u32>,
    /// Looks at the supply that find it low.
    low_for: Cell<u32>,
    fed: u32,
    /// Longest that the watchdog was left alone, looks at the clock.
    unfed: Cell<u32>,
    longest_unfed: u32,
    forgot_after: Option<usize>,
}

impl<const N: usize> Registers<N> {
    fn new(cause: Cause, held: [u16; N], words: [u32; N]) -> Self {
        Self {
            cause,
            unwritten: cause.power,
            words,
            held,
            answers: false,
            told: Vec::new(),
            cycles_a_look: 10,
            // The counter goes over its end on the way.
            cycles: Cell::new(u32::MAX - 100_000),
            looks: Cell::new(0),
            low_for: Cell::new(0),
            fed: 0,
            unfed: Cell::new(0),
            longest_unfed: 0,
            forgot_after: None,
        }
    }

    /// Largest step of an output from what it held.
    fn largest_step(&self, axis: usize) -> u16 {
        let told = self.told.iter().map(|codes| codes[axis]);
        let held = std::iter::once(self.held[axis]).chain(told.clone());
        held.zip(told).map(|(from, to)| from.abs_diff(to)).max().unwrap()
    }
}

impl<const N: usize> Hardware<N> for Registers<N> {
    fn cause(&self) -> Cause {
        self.cause
    }

    fn forget_cause(&mut self) {
        assert!(
            !self.unwritten,
            "a reset now would find no cause, and read what was never written"
        );
        self.forgot_after = Some(self.told.len());
    }

    fn supplied(&self) -> bool {
        let left = self.low_for.get();
        self.low_for.set(left.saturating_sub(1));
        left == 0
    }

    fn held(&self) -> Option<[DacCode; N]> {
        self.answers.then(|| self.held.map(DacCode))
    }

    fn kept(&self) -> [u32; N] {
        assert!(!self.unwritten, "memory that was never written");
        self.words
    }

    fn set(&mut self, codes: [DacCode; N]) {
        self.told.push(codes.map(|code| code.0));
        self.words = codes.map(|code| kept::pack(code.0));
        self.unwritten = false;
    }

    fn cycles(&self) -> u32 {
        self.looks.set(self.looks.get() + 1);
        self.unfed.set(self.unfed.get() + 1);
        self.cycles.set(self.cycles.get().wrapping_add(self.cycles_a_look));
        self.cycles.get()
    }

    fn feed(&mut self) {
        self.fed += 1;
        self.longest_unfed = self.longest_unfed.max(self.unfed.replace(0));
    }
}

const COLD: Cause = Cause {
    power: true,
    watchdog: false,
};
const BITTEN: Cause = Cause {
    power: false,
    watchdog: true,
};
const BUTTON: Cause = Cause {
    power: false,
    watchdog: false,
};

/// Power comes: nothing is read, the converter's own zero is where the way begins; a safe level above it is reached by the ramp.
#[test]
fn val_a_cold_start() {
    let mut board = Registers::new(COLD, [0], [0xdead_beef]);
    assert_eq!(settle(&mut board, [(DacCode(0), 65)], SAMPLE_CYCLES), None);
    assert_eq!((board.told, board.forgot_after), (vec![[0]], Some(1)));
    let mut board = Registers::new(COLD, [0], [kept::pack(60_000)]);
    assert_eq!(settle(&mut board, [(DacCode(8738), 65)], SAMPLE_CYCLES), None);
    // 134 steps of 65 are 8710, and 28 more.
    assert_eq!((board.told.len(), board.told[1], board.told[134]), (136, [65], [8710]));
    assert_eq!((board.told[135], board.largest_step(0), board.fed), ([8738], 65, 135));
    assert_eq!(board.forgot_after, Some(1));
}

/// Converters that answer are believed before memory and before the reset's cause: the chip's power failed alone, and theirs alone.
#[test]
fn val_converters_that_answer_are_believed() {
    for (cause, held, kept_word) in [(COLD, 60_000, 0xdead_beef), (BITTEN, 0, kept::pack(60_000))] {
        let mut board = Registers::new(cause, [held], [kept_word]);
        board.answers = true;
        settle(&mut board, [(DacCode(8738), 65)], SAMPLE_CYCLES);
        assert_eq!((board.told[0], board.told.last().copied()), ([held], Some([8738])));
        assert_eq!((board.largest_step(0), board.forgot_after), (65, Some(1)));
    }
}

/// The watchdog bit at a high output: from there down, whether the cycle counter runs or is locked; the fault is to be latched.
#[test]
fn val_a_watchdogs_reset_at_a_high_output() {
    // A sample is 800 looks of 10 cycles, and one to begin with; or 8000 looks at a counter that stands still.
    for (cycles_a_look, looks_a_step) in [(10, 801), (0, 8001), (8000, 2)] {
        let mut board = Registers::new(BITTEN, [60_000], [kept::pack(60_000)]);
        board.cycles_a_look = cycles_a_look;
        let fault = settle(&mut board, [(DacCode(0), 65)], SAMPLE_CYCLES);
        assert_eq!(fault, Some(Fault::Watchdog));
        // 923 steps of 65 are 59 995.
        assert_eq!(board.told.len(), 925);
        assert_eq!(
            [board.told[0], board.told[1], board.told[923], board.told[924]],
            [[60_000], [59_935], [5], [0]]
        );
        assert_eq!((board.largest_step(0), board.fed), (65, 924));
        assert_eq!(board.looks.get(), 924 * looks_a_step);
        assert_eq!(board.longest_unfed, looks_a_step);
        assert_eq!(board.words, [kept::pack(0)]);
    }
}

/// Another reset: the same way, and no fault.
#[test]
fn val_a_reset_by_the_button() {
    let mut board = Registers::new(BUTTON, [130], [kept::pack(130)]);
    assert_eq!(settle(&mut board, [(DacCode(0), 65)], SAMPLE_CYCLES), None);
    assert_eq!(board.told, [[130], [65], [0]]);
}

/// The watchdog bites on the way down as well: the next start goes on from there, not from where the first began.
#[test]
fn val_a_way_down_that_is_broken_off() {
    let mut board = Registers::new(BUTTON, [300], [kept::pack(300)]);
    settle(&mut board, [(DacCode(0), 100)], SAMPLE_CYCLES);
    let at = board.told[2];
    let mut again = Registers::new(BITTEN, at, at.map(kept::pack));
    assert_eq!(
        settle(&mut again, [(DacCode(0), 100)], SAMPLE_CYCLES),
        Some(Fault::Watchdog)
    );
    assert_eq!((again.told, at), (vec![[100], [0]], [100]));
}

/// Chip and converters lost their power, whatever memory still says, and whoever else has reset the chip on the way.
#[test]
fn val_power_was_lost_with_the_chips() {
    let both = Cause {
        power: true,
        watchdog: true,
    };
    for (cause, fault) in [(COLD, None), (both, Some(Fault::Watchdog))] {
        let mut board = Registers::new(cause, [0], [kept::pack(60_000)]);
        assert_eq!(settle(&mut board, [(DacCode(200), 150)], SAMPLE_CYCLES), fault);
        assert_eq!(board.told, [[0], [150], [200]]);
    }
}

/// What no register says: a converter that lost its power alone is given the kept code at once, and one that kept it alone the zero.
/// The wiring has to see to it that it shares the chip's power; this is what happens where it does not.
#[test]
fn val_what_cannot_be_known() {
    let mut lost = Registers::new(BITTEN, [0], [kept::pack(60_000)]);
    settle(&mut lost, [(DacCode(0), 65)], SAMPLE_CYCLES);
    assert_eq!((lost.told[0], lost.largest_step(0)), ([60_000], 60_000));
    let mut held = Registers::new(COLD, [60_000], [0]);
    settle(&mut held, [(DacCode(0), 65)], SAMPLE_CYCLES);
    assert_eq!(held.told, [[0]]);
    // Another image ran before: its word is none here.
    let mut other = Registers::new(BUTTON, [60_000], [0x1234_5678]);
    settle(&mut other, [(DacCode(8738), 65)], SAMPLE_CYCLES);
    assert_eq!(other.told, [[8738]]);
}

/// Each output by its own ramp, and both until the slower is there.
#[test]
fn val_both_axes() {
    let mut board = Registers::new(BUTTON, [1000, 40], [kept::pack(1000), kept::pack(40)]);
    settle(&mut board, [(DacCode(0), 400), (DacCode(100), 50)], SAMPLE_CYCLES);
    assert_eq!(board.told, [[1000, 40], [600, 90], [200, 100], [0, 100]]);
    // A ramp of less than a code goes a code.
    let mut board = Registers::new(BUTTON, [65_535, 0], [kept::pack(65_535), kept::pack(0)]);
    settle(&mut board, [(DacCode(0), 0), (DacCode(0), 1)], 1);
    assert_eq!((board.told.len(), board.told[65_535]), (65_536, [0, 0]));
}

/// A supply that comes late is waited for, one that does not come for 100 ms and no longer: then the fault says so.
#[test]
fn val_a_supply_that_is_low() {
    for (low_for, fault) in [
        (0, None),
        (20, None),
        (4999, None),
        (5000, Some(Fault::Supply)),
        (u32::MAX, Some(Fault::Supply)),
    ] {
        let mut board = Registers::new(COLD, [0], [0]);
        board.low_for.set(low_for);
        assert_eq!(
            settle(&mut board, [(DacCode(0), 65)], SAMPLE_CYCLES),
            fault,
            "{low_for}"
        );
        assert_eq!(board.told, [[0]]);
        assert_eq!(board.looks.get(), low_for.min(5000) * 801);
    }
}
