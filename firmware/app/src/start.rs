//! From a reset to outputs at their safe levels, whatever the reset came from: nothing here waits for ever, or believes memory before
//! it knows that power was on.

use crate::kept;
use crate::monitor::Fault;
use hysteron_converters::ad5683r;
use hysteron_core::codes::DacCode;

/// What the last reset came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cause {
    /// Power was off or low: memory holds nothing and must not be read, since words that were never written fail their check bits.
    pub power: bool,
    /// The watchdog.
    pub watchdog: bool,
}

/// What the way to the safe levels needs of a board, whose watchdog runs already.
pub trait Hardware<const N: usize> {
    /// What the last reset came from.
    fn cause(&self) -> Cause;
    /// Forgets it; the next reset adds its own otherwise.
    fn forget_cause(&mut self);
    /// Whether the supply is what the chip and the converters need.
    fn supplied(&self) -> bool;
    /// The codes that the converters say they hold; `None` where nothing connects their answers.
    fn held(&self) -> Option<[DacCode; N]>;
    /// The kept words of the outputs, see [`kept`].
    fn kept(&self) -> [u32; N];
    /// Sets the outputs, then keeps their codes.
    fn set(&mut self, codes: [DacCode; N]);
    /// Cycles of the processor, by a counter that may stand still: a Cortex-M7 locks it at a reset.
    fn cycles(&self) -> u32;
    /// Feeds the watchdog.
    fn feed(&mut self);
}

/// 100 ms at 50 kHz: half of what the watchdog waits for at a start ([`crate::chips::WATCHDOG_START_US`]).
const SUPPLY_SAMPLES: u32 = 5000;

/// Brings the outputs to their safe levels from what the converters hold, as slowly as the tables' ramps: `ways` are each one's safe code
/// and the codes that it may go a sample. Returns what is to be latched.
///
/// Converters that do not answer are taken to begin at their own zero after a loss of power, and to hold what memory says after any other
/// reset. Where memory says nothing (another image ran before), the first word is the safe level's. A loss of such a converter's power that
/// the chip's own does not share, or the other way about, makes the first word a step.
#[cold]
pub fn settle<const N: usize>(
    board: &mut impl Hardware<N>,
    ways: [(DacCode, u16); N],
    sample_cycles: u32,
) -> Option<Fault> {
    let cause = board.cause();
    let supplied = (0..SUPPLY_SAMPLES).any(|_| {
        let supplied = board.supplied();
        if !supplied {
            wait(board, sample_cycles);
        }
        supplied
    });
    let safe = ways.map(|(safe, _)| safe);
    let mut codes = match board.held() {
        Some(held) => held,
        None if cause.power => [ad5683r::POWER_ON; N],
        None => {
            let mut codes = safe;
            for (code, word) in codes.iter_mut().zip(board.kept()) {
                *code = kept::unpack(word).map_or(*code, DacCode);
            }
            codes
        }
    };
    board.set(codes);
    // Only now: a reset before this line finds the same cause, one after it the words that have just been kept.
    board.forget_cause();
    // A step is a code at least: there are no more.
    for _ in 0..u16::MAX {
        if codes == safe {
            break;
        }
        board.feed();
        wait(board, sample_cycles);
        for (code, (safe, most)) in codes.iter_mut().zip(ways) {
            code.0 = kept::toward(code.0, safe.0, most);
        }
        board.set(codes);
    }
    match (supplied, cause.watchdog) {
        (false, _) => Some(Fault::Supply),
        (true, true) => Some(Fault::Watchdog),
        (true, false) => None,
    }
}

/// So many cycles, or as many looks at a counter that stands still: a look takes a cycle at least.
fn wait<const N: usize>(board: &impl Hardware<N>, cycles: u32) {
    let begun = board.cycles();
    for _ in 0..cycles {
        if board.cycles().wrapping_sub(begun) >= cycles {
            return;
        }
    }
}
