//! Tables in flash on this board: which one a start takes, and what comes of an upload. One axis.

use crate::converter::{self, Times};
use crate::flash::Memory;
use crate::{AT_REST, ORDERS, Shared, board};
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::peripherals;
use embassy_stm32::timer::low_level::Timer;
use hysteron_firmware::axes::one::Banks;
use hysteron_firmware::kept;
use hysteron_firmware::stored::{Pause, Stored};
use hysteron_firmware::wire::Hello;
use hysteron_slot::Slots;

static STORED: Shared<Stored<Memory>> = Shared(UnsafeCell::new(MaybeUninit::uninit()));

/// The slot that is being read, and one more, as [`kept`] packs it; 0 where none is. A torn word stops the processor (RM0433, "Flash ECC
/// protection"; RM0440, "ECC"), the watchdog resets it, and this word tells the next start.
// SAFETY: as that of the outputs' codes.
#[unsafe(link_section = ".uninit.READING")]
static READING: Shared<AtomicU32> = Shared(UnsafeCell::new(MaybeUninit::uninit()));

fn reading() -> &'static AtomicU32 {
    // SAFETY: any value is one.
    unsafe { (*READING.0.get()).assume_init_ref() }
}

fn note(slot: Option<usize>) {
    let number = slot.map_or(0, |slot| slot as u16 + 1);
    reading().store(kept::pack(number), Ordering::SeqCst);
}

/// The slot that an earlier start did not come back from; after a loss of power memory is not read.
fn trapped(power: bool) -> Option<usize> {
    if power {
        return None;
    }
    match kept::unpack(reading().load(Ordering::SeqCst)) {
        Some(number @ 1..=2) => Some(usize::from(number) - 1),
        _ => None,
    }
}

/// The slots, with the first table replaced by the newest in flash that passes every check, and what there is to say of it.
///
/// By itself, or main would keep what it takes of its stack.
#[inline(never)]
pub fn choose(slots: Slots<Memory>, banks: &mut Banks, power: bool) -> (&'static mut Stored<Memory>, Option<Hello>) {
    // SAFETY: nobody has it yet; this is called once.
    let stored = unsafe { (*STORED.0.get()).write(Stored::new(slots)) };
    let trapped = trapped(power);
    let hello = stored.choose(&mut banks[0], trapped, &mut note);
    note(trapped);
    (stored, hello)
}

/// What an upload asks of this board.
pub struct Clock<'a> {
    pub timer: &'a Timer<'static, peripherals::TIM3>,
    pub times: Times,
}

impl Pause for Clock<'_> {
    /// Main alone gives orders, and it is here: none is on its way, and the last tick left every output at its safe level.
    fn at_rest(&self) -> bool {
        ORDERS.is_empty() && AT_REST.load(Ordering::Acquire)
    }

    fn stop(&mut self) {
        self.timer.stop();
        board::guard_the_flash();
        // Whatever was torn is erased with the slot.
        note(None);
    }

    fn go_on(&mut self) {
        board::guard_the_loop();
        converter::start(self.timer, self.times);
    }
}
