//! The flash of the two slots, by embassy's driver; where they lie, the board's `memory.x` says.

use crate::board;
use embassy_stm32::flash::{Blocking, Error, Flash};
#[cfg(feature = "g474re")]
use embassy_stm32::pac;
use embassy_stm32::{Peri, peripherals};
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use hysteron_slot::Slots;

/// Where flash begins, on both chips.
const BASE: u32 = 0x0800_0000;

unsafe extern "C" {
    static __slot_0: u8;
    static __slot_1: u8;
    static __slot_end: u8;
}

/// All of flash; [`slots`] alone says where it is written.
pub struct Memory(Flash<'static, Blocking>);

/// The slots; none where a write would stop the processor from fetching its vectors: the image runs with its own table then.
pub fn slots(flash: Peri<'static, peripherals::FLASH>) -> Option<Slots<Memory>> {
    // Embassy stops where its pages are not the chip's.
    if !board::has_two_banks() {
        return None;
    }
    let [first, second, end] = [&raw const __slot_0, &raw const __slot_1, &raw const __slot_end].map(|at| at as u32);
    let memory = Memory(Flash::new_blocking(flash));
    Some(Slots::new(memory, [first - BASE, second - BASE], end - second))
}

impl ErrorType for Memory {
    type Error = Error;
}

impl ReadNorFlash for Memory {
    const READ_SIZE: usize = <Flash<'static, Blocking> as ReadNorFlash>::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.0.blocking_read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for Memory {
    const WRITE_SIZE: usize = <Flash<'static, Blocking> as NorFlash>::WRITE_SIZE;
    const ERASE_SIZE: usize = <Flash<'static, Blocking> as NorFlash>::ERASE_SIZE;

    #[cfg(feature = "h743zi")]
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        self.0.blocking_erase(from, to)
    }

    /// As embassy does it, which masks every interrupt for it; no image of ours has an instruction for that.
    #[cfg(feature = "g474re")]
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        (from..to)
            .step_by(Self::ERASE_SIZE)
            .try_for_each(|page| erase_page(page / Self::ERASE_SIZE as u32))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.blocking_write(offset, bytes)
    }
}

/// Pages in a bank (RM0440, "Flash memory organization": 128 of 2 KB in each of two banks).
#[cfg(feature = "g474re")]
const BANK_PAGES: u32 = 128;

/// Erases a page by its number from the beginning of flash (RM0440, "Flash main memory erase sequences"). The watchdog ends its waits.
#[cfg(feature = "g474re")]
fn erase_page(page: u32) -> Result<(), Error> {
    let registers = pac::FLASH;
    while registers.sr().read().bsy() {}
    // Written as read: what is set is cleared.
    registers.sr().modify(|_| {});
    if registers.cr().read().lock() {
        registers.keyr().write_value(0x4567_0123);
        registers.keyr().write_value(0xcdef_89ab);
    }
    registers.cr().modify(|w| {
        w.set_per(true);
        w.set_bker(page >= BANK_PAGES);
        w.set_pnb((page % BANK_PAGES) as u8);
    });
    registers.cr().modify(|w| w.set_strt(true));
    while registers.sr().read().bsy() {}
    let status = registers.sr().read();
    registers.cr().modify(|w| {
        w.set_per(false);
        w.set_lock(true);
    });
    // What the data cache holds of the page is no longer there.
    registers.acr().modify(|w| w.set_dcen(false));
    registers.acr().modify(|w| w.set_dcrst(true));
    registers.acr().modify(|w| w.set_dcrst(false));
    registers.acr().modify(|w| w.set_dcen(true));
    match status.wrperr() {
        true => Err(Error::Protected),
        false if status.pgserr() => Err(Error::Seq),
        false => Ok(()),
    }
}
