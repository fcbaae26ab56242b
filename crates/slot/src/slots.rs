//! Two slots in a flash: the board starts with the newest that passes every check, and an upload goes to the other.

use crate::bytes::{HEADER_BYTES, Header, decode, seal};
use crate::{Image, Numbers, Refusal, Rule, Sweep};
use embedded_storage::nor_flash::NorFlash;

/// How many.
pub const SLOTS: usize = 2;

/// Two equal parts of a flash, each as long as pages of it that can be erased alone.
#[derive(Debug, Clone)]
pub struct Slots<F> {
    flash: F,
    /// Where each begins.
    at: [u32; SLOTS],
    /// Length of each.
    bytes: u32,
}

/// What is said of a slot: the sequence of the table that runs, or why it does not.
pub type Verdict = Result<u32, Refusal<'static>>;

/// What a start finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen {
    /// The slot whose table was taken, and its header; the compiled-in table runs where there is none.
    pub found: Option<(usize, Header)>,
    /// What is said of each slot.
    pub verdicts: [Verdict; SLOTS],
    /// The newest sequence of a header that can be read.
    pub last: Option<u32>,
    /// The slot for an upload: not the one in use, and one that cannot be read before any other.
    pub spare: usize,
}

/// Every check of a slot's bytes: form, sum, version, dimensions, the table's own, the image's converters. The table is put into its place,
/// for a board has no room for it twice; its header and what its sweep has seen come back.
///
/// Inlined: where the image is a constant, the models of other families are left out.
///
/// # Errors
/// The first that fails.
#[inline(always)]
pub fn check<const N: usize>(
    bytes: &[u8],
    image: &Image,
    table: &mut Numbers<N>,
) -> Result<(Header, Sweep), Refusal<'static>> {
    let header = decode(bytes, image, table)?;
    // Numbers that are none come first: no comparison with them says anything. The family is the image's, as `decode` has seen.
    let sweep = table.sweep_as(image.family)?;
    image.holds(table)?;
    image.reaches(table)?;
    Ok((header, sweep))
}

impl<F: NorFlash> Slots<F> {
    /// Of a flash, from where each begins; `bytes` a multiple of what can be erased.
    pub const fn new(flash: F, at: [u32; SLOTS], bytes: u32) -> Self {
        const {
            assert!(HEADER_BYTES.is_multiple_of(F::WRITE_SIZE), "a header is whole words");
            assert!(F::READ_SIZE == 1, "any byte can be read");
        }
        Self { flash, at, bytes }
    }

    /// The flash.
    pub fn flash(&mut self) -> &mut F {
        &mut self.flash
    }

    /// The slot with the newest table that `take` takes, which is given the bytes of one and does what [`check`] does; `buffer` holds a
    /// slot's table, [`crate::most_bytes`] of it.
    ///
    /// `trapped` is a slot that must not be read: on some chips a torn word stops the processor. `reading` is told before a slot is read
    /// and, with none, after: whoever is reset between the two knows.
    #[cold]
    pub fn choose(
        &mut self,
        take: &mut impl FnMut(&[u8]) -> Result<(), Refusal<'static>>,
        buffer: &mut [u8],
        trapped: Option<usize>,
        reading: &mut impl FnMut(Option<usize>),
    ) -> Chosen {
        let mut headers = [Err(Refusal::new(Rule::Trapped, "slot", 0.0)); SLOTS];
        for (slot, header) in headers.iter_mut().enumerate() {
            if trapped != Some(slot) {
                reading(Some(slot));
                *header = self.header(slot);
                reading(None);
            }
        }
        let mut verdicts = headers.map(|header| header.map(|header| header.sequence));
        let [first, second] = &headers;
        let second_first = matches!((first, second), (Ok(first), Ok(second)) if second.is_newer_than(first));
        let order = if second_first || first.is_err() { [1, 0] } else { [0, 1] };
        let mut found: Option<(usize, Header)> = None;
        let mut last = None;
        for slot in order {
            let Some((Ok(header), verdict)) = headers.get(slot).zip(verdicts.get_mut(slot)) else {
                continue;
            };
            last = last.or(Some(header.sequence));
            if let Some((_, newer)) = &found {
                let older = Refusal::new(Rule::Older, "sequence", f64::from(header.sequence));
                *verdict = Err(older.allowed([f64::from(newer.sequence), 0.0, 0.0]));
                continue;
            }
            reading(Some(slot));
            let length = buffer.len().min(self.bytes as usize);
            let bytes = buffer.get_mut(..length).unwrap_or_default();
            let read = self.read(slot, 0, bytes);
            reading(None);
            match read.and_then(|()| take(bytes)) {
                Ok(()) => found = Some((slot, *header)),
                Err(refused) => *verdict = Err(refused),
            }
        }
        Chosen {
            found,
            verdicts,
            last,
            spare: match found {
                Some((slot, _)) => usize::from(slot == 0),
                None => trapped.unwrap_or(0),
            },
        }
    }

    fn header(&mut self, slot: usize) -> Result<Header, Refusal<'static>> {
        let mut bytes = [0; HEADER_BYTES];
        self.read(slot, 0, &mut bytes)?;
        Header::read(&bytes, self.bytes as usize)
    }

    fn read(&mut self, slot: usize, place: u32, bytes: &mut [u8]) -> Result<(), Refusal<'static>> {
        let at = self.at.get(slot).ok_or_else(failed)?;
        self.flash.read(at + place, bytes).map_err(|_| failed())
    }

    /// Writes a table, which has passed [`check`], to a slot that is not in use, as the newest; its first word last. Returns its sequence.
    ///
    /// `bytes` is up to a multiple of the flash's word as long as the table or longer. Until the last word is written, a start finds the
    /// slot in use as it was.
    ///
    /// # Errors
    /// A table that is longer than a slot, a flash that does not take it or gives something else.
    ///
    /// # Cost
    /// The flash's time to erase a slot and to write the table, in which it blocks.
    #[cold]
    pub fn write(&mut self, bytes: &mut [u8], slot: usize, last: Option<u32>) -> Result<u32, Refusal<'static>> {
        let sequence = last.map_or(0, |last| last.wrapping_add(1));
        let header = Header::read(bytes, self.bytes as usize)?;
        let all = HEADER_BYTES + header.length;
        let padded = all.next_multiple_of(F::WRITE_SIZE);
        if let Some(table) = bytes.get_mut(..all) {
            seal(table, sequence);
        }
        if let Some(behind) = bytes.get_mut(all..padded) {
            behind.fill(0xff);
        }
        let bytes = bytes.get(..padded).ok_or_else(failed)?;
        let &at = self.at.get(slot).ok_or_else(failed)?;
        self.flash.erase(at, at + self.bytes).map_err(|_| failed())?;
        let (header, contents) = bytes.split_at_checked(HEADER_BYTES).ok_or_else(failed)?;
        let (word, rest) = header.split_at_checked(F::WRITE_SIZE).ok_or_else(failed)?;
        for (place, part) in [(HEADER_BYTES, contents), (F::WRITE_SIZE, rest), (0, word)] {
            self.flash.write(at + place as u32, part).map_err(|_| failed())?;
        }
        self.compare(slot, bytes)?;
        Ok(sequence)
    }

    fn compare(&mut self, slot: usize, bytes: &[u8]) -> Result<(), Refusal<'static>> {
        let mut place = 0;
        for wanted in bytes.chunks(32) {
            let mut found = [0; 32];
            let found = found.get_mut(..wanted.len()).ok_or_else(failed)?;
            self.read(slot, place, found)?;
            if found != wanted {
                return Err(failed());
            }
            place += wanted.len() as u32;
        }
        Ok(())
    }
}

#[cold]
fn failed() -> Refusal<'static> {
    Refusal::new(Rule::Flash, "slot", 0.0)
}
