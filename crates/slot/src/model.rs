//! A flash as a model, for tests and for a board that is a process: pages that are erased, words that are written once, and power that
//! fails after any of either.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// How an operation looks that the power failed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tear {
    /// As if it had not begun.
    Before,
    /// As if it had ended.
    After,
    /// Some bits as before, some as after, by a pattern.
    Mixed(u32),
    /// The same, and the words check bits do not fit: reading them is an error.
    Unreadable(u32),
}

/// Why the model refuses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlashError {
    /// Places outside of it, or not on the edge of a page or a word.
    Place,
    /// A word that was written since its page was erased.
    Written,
    /// The power has failed.
    Power,
    /// A word that is torn.
    Torn,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place => NorFlashErrorKind::OutOfBounds,
            Self::Written | Self::Power | Self::Torn => NorFlashErrorKind::Other,
        }
    }
}

/// A flash of `BYTES`, in words of `WORD` bytes, in pages of `PAGE`.
#[derive(Debug, Clone)]
pub struct Flash<const WORD: usize, const PAGE: usize, const BYTES: usize> {
    bytes: [u8; BYTES],
    /// Of each byte, whether its word was written since its page was erased.
    written: [bool; BYTES],
    /// Of each byte, whether it can be read.
    torn: [bool; BYTES],
    /// Operations until the power fails, and how the last one looks.
    cut: Option<(u32, Tear)>,
    powered: bool,
    operations: u32,
}

impl<const WORD: usize, const PAGE: usize, const BYTES: usize> Default for Flash<WORD, PAGE, BYTES> {
    fn default() -> Self {
        Self {
            bytes: [0xff; BYTES],
            written: [false; BYTES],
            torn: [false; BYTES],
            cut: None,
            powered: true,
            operations: 0,
        }
    }
}

impl<const WORD: usize, const PAGE: usize, const BYTES: usize> Flash<WORD, PAGE, BYTES> {
    /// The power fails in the operation of this number, counted from now and 0, and stays away until [`Self::power_on`].
    pub fn cut(&mut self, operation: u32, tear: Tear) {
        self.cut = Some((operation, tear));
    }

    /// Power again.
    pub fn power_on(&mut self) {
        self.cut = None;
        self.powered = true;
    }

    /// Pages that were erased and words that were written so far.
    pub fn operations(&self) -> u32 {
        self.operations
    }

    /// All of it.
    pub fn bytes(&mut self) -> &mut [u8; BYTES] {
        &mut self.bytes
    }

    /// What comes of a range that becomes `new`, and whether the power is there after it.
    fn operate(&mut self, at: usize, new: &[u8], written: bool) -> Result<(), FlashError> {
        if !self.powered {
            return Err(FlashError::Power);
        }
        self.operations += 1;
        let tear = match &mut self.cut {
            Some((0, tear)) => Some(*tear),
            Some((left, _)) => {
                *left -= 1;
                None
            }
            None => None,
        };
        let range = at..at + new.len();
        let unreadable = matches!(tear, Some(Tear::Unreadable(_)));
        let places = self.bytes.get_mut(range.clone()).ok_or(FlashError::Place)?;
        for (i, (place, &new)) in places.iter_mut().zip(new).enumerate() {
            *place = match tear {
                None | Some(Tear::After) => new,
                Some(Tear::Before) => *place,
                Some(Tear::Mixed(pattern) | Tear::Unreadable(pattern)) => {
                    let bits = scatter(pattern ^ i as u32) as u8;
                    (*place & bits) | (new & !bits)
                }
            };
        }
        if tear != Some(Tear::Before) {
            self.written
                .get_mut(range.clone())
                .ok_or(FlashError::Place)?
                .fill(written);
            self.torn.get_mut(range).ok_or(FlashError::Place)?.fill(unreadable);
        }
        match tear {
            None => Ok(()),
            Some(_) => {
                self.powered = false;
                Err(FlashError::Power)
            }
        }
    }
}

/// Bits that look like chance (the finisher of MurmurHash3).
fn scatter(mut bits: u32) -> u32 {
    bits ^= bits >> 16;
    bits = bits.wrapping_mul(0x85eb_ca6b);
    bits ^= bits >> 13;
    bits = bits.wrapping_mul(0xc2b2_ae35);
    bits ^ bits >> 16
}

impl<const WORD: usize, const PAGE: usize, const BYTES: usize> ErrorType for Flash<WORD, PAGE, BYTES> {
    type Error = FlashError;
}

impl<const WORD: usize, const PAGE: usize, const BYTES: usize> ReadNorFlash for Flash<WORD, PAGE, BYTES> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let range = offset as usize..offset as usize + bytes.len();
        let torn = self.torn.get(range.clone()).ok_or(FlashError::Place)?;
        if torn.iter().any(|&torn| torn) {
            return Err(FlashError::Torn);
        }
        bytes.copy_from_slice(self.bytes.get(range).ok_or(FlashError::Place)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl<const WORD: usize, const PAGE: usize, const BYTES: usize> NorFlash for Flash<WORD, PAGE, BYTES> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let (from, to) = (from as usize, to as usize);
        if !from.is_multiple_of(PAGE) || !to.is_multiple_of(PAGE) || from > to || to > BYTES {
            return Err(FlashError::Place);
        }
        (from..to)
            .step_by(PAGE)
            .try_for_each(|page| self.operate(page, &[0xff; PAGE], false))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let at = offset as usize;
        if !at.is_multiple_of(WORD) || !bytes.len().is_multiple_of(WORD) || at + bytes.len() > BYTES {
            return Err(FlashError::Place);
        }
        for (place, word) in (at..).step_by(WORD).zip(bytes.chunks(WORD)) {
            let before = self.written.get(place..place + WORD).ok_or(FlashError::Place)?;
            if before.iter().any(|&written| written) {
                return Err(FlashError::Written);
            }
            self.operate(place, word, true)?;
        }
        Ok(())
    }
}
