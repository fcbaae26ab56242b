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

/// A table that has passed every check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found<const N: usize> {
    /// Which slot.
    pub slot: usize,
    /// Its header.
    pub header: Header,
    /// Its numbers.
    pub table: Numbers<N>,
    /// What its sweep has seen.
    pub sweep: Sweep,
}

/// What is said of a slot: the sequence of the table that runs, or why it does not.
pub type Verdict = Result<u32, Refusal<'static>>;

/// What a start finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen<const N: usize> {
    /// The table to run with; the compiled-in one where there is none.
    pub found: Option<Found<N>>,
    /// What is said of each slot.
    pub verdicts: [Verdict; SLOTS],
    /// The highest sequence of a header that can be read.
    pub last: Option<u32>,
}

/// Every check of a slot's bytes: form, sum, version, dimensions, the table's own, the image's converters.
///
/// # Errors
/// The first that fails.
#[cold]
pub fn check<const N: usize>(bytes: &[u8], image: &Image) -> Result<(Header, Numbers<N>, Sweep), Refusal<'static>> {
    let (header, table) = decode(bytes, image)?;
    // Numbers that are none come first: no comparison with them says anything.
    let sweep = table.sweep()?;
    image.holds(&table)?;
    image.reaches(&table)?;
    Ok((header, table, sweep))
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

    /// The newest table that passes every check, for an image; `buffer` holds a slot's table, [`crate::most_bytes`] of it.
    ///
    /// `trapped` is a slot that must not be read: on some chips a torn word stops the processor. `reading` is told before a slot is read
    /// and, with none, after: whoever is reset between the two knows.
    #[cold]
    pub fn choose<const N: usize>(
        &mut self,
        image: &Image,
        buffer: &mut [u8],
        trapped: Option<usize>,
        reading: &mut impl FnMut(Option<usize>),
    ) -> Chosen<N> {
        let mut headers = [Err(Refusal::new(Rule::Trapped, "slot", 0.0)); SLOTS];
        for (slot, header) in headers.iter_mut().enumerate() {
            if trapped != Some(slot) {
                reading(Some(slot));
                *header = self.header(slot);
                reading(None);
            }
        }
        let mut verdicts = headers.map(|header| header.map(|header| header.sequence));
        let [first, second] = headers;
        let second_first = matches!((first, second), (Ok(first), Ok(second)) if second.is_newer_than(&first));
        let order = if second_first || first.is_err() { [1, 0] } else { [0, 1] };
        let mut chosen: Option<Found<N>> = None;
        let newest = order
            .into_iter()
            .find_map(|slot| headers.get(slot).and_then(|header| header.ok()));
        for slot in order {
            let Some(verdict) = verdicts.get_mut(slot).filter(|verdict| verdict.is_ok()) else {
                continue;
            };
            if let Some(found) = &chosen {
                let sequence = verdict.map_or(0, |sequence| sequence);
                let older = Refusal::new(Rule::Older, "sequence", f64::from(sequence));
                *verdict = Err(older.allowed([f64::from(found.header.sequence), 0.0, 0.0]));
                continue;
            }
            reading(Some(slot));
            let found = self.found(slot, image, buffer);
            reading(None);
            match found {
                Ok(found) => chosen = Some(found),
                Err(refused) => *verdict = Err(refused),
            }
        }
        Chosen {
            found: chosen,
            verdicts,
            last: newest.map(|header| header.sequence),
        }
    }

    fn header(&mut self, slot: usize) -> Result<Header, Refusal<'static>> {
        let mut bytes = [0; HEADER_BYTES];
        self.read(slot, 0, &mut bytes)?;
        Header::read(&bytes, self.bytes as usize)
    }

    fn found<const N: usize>(
        &mut self,
        slot: usize,
        image: &Image,
        buffer: &mut [u8],
    ) -> Result<Found<N>, Refusal<'static>> {
        let length = buffer.len().min(self.bytes as usize);
        let bytes = buffer.get_mut(..length).unwrap_or_default();
        self.read(slot, 0, bytes)?;
        let (header, table, sweep) = check(bytes, image)?;
        Ok(Found {
            slot,
            header,
            table,
            sweep,
        })
    }

    fn read(&mut self, slot: usize, place: u32, bytes: &mut [u8]) -> Result<(), Refusal<'static>> {
        let at = self.at.get(slot).ok_or_else(failed)?;
        self.flash.read(at + place, bytes).map_err(|_| failed())
    }

    /// Writes a table, which has passed [`check`], to the slot that is not in use, as the newest; its first word last. Returns the slot and
    /// the sequence.
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
    pub fn write(
        &mut self,
        bytes: &mut [u8],
        in_use: Option<usize>,
        last: Option<u32>,
    ) -> Result<(usize, u32), Refusal<'static>> {
        let slot = usize::from(in_use == Some(0));
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
        Ok((slot, sequence))
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
