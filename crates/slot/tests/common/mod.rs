//! Tables and slots of the tests.

use hysteron_slot::model::Flash;
use hysteron_slot::{Chosen, Image, MOST_BYTES, Numbers, Slots, check, encode};
use hysteron_table::{Table, hash};

pub(crate) const PAPER: &str = include_str!("../../../../firmware/tables/paper-rate-mrpi.toml");
pub(crate) const COMPLETE: &str = include_str!("../../../../firmware/tables/tracking-739.toml");
/// Two pages a slot, so that an erase can be cut between them.
pub(crate) const SLOT: u32 = 4096;

/// Words of the STM32G474's eight bytes, or the H743's 32.
pub(crate) type Model<const WORD: usize> = Flash<WORD, 2048, 8192>;
pub(crate) type Pair<const WORD: usize> = Slots<Model<WORD>>;

pub(crate) fn numbers<const N: usize>(text: &str) -> Numbers<N> {
    Table::parse(text).unwrap().numbers()
}

pub(crate) fn slots<const WORD: usize>() -> Pair<WORD> {
    Slots::new(Model::default(), [0, SLOT], SLOT)
}

pub(crate) fn bytes<const N: usize>(table: &Numbers<N>) -> Vec<u8> {
    let mut bytes = vec![0; MOST_BYTES];
    let length = encode(table, &hash("a file"), &mut bytes).unwrap();
    bytes.truncate(length.next_multiple_of(32));
    bytes
}

/// A start: the table that it takes, and what it says.
pub(crate) fn start<const WORD: usize, const N: usize>(
    slots: &mut Pair<WORD>,
    image: &Image,
) -> (Option<Numbers<N>>, Chosen) {
    start_past(slots, image, None, &mut |_| {})
}

/// The same past a slot that traps.
pub(crate) fn start_past<const WORD: usize, const N: usize>(
    slots: &mut Pair<WORD>,
    image: &Image,
    trapped: Option<usize>,
    reading: &mut impl FnMut(Option<usize>),
) -> (Option<Numbers<N>>, Chosen) {
    let mut table = Numbers::empty(image.family, 0);
    let mut take = |bytes: &[u8]| check(bytes, image, &mut table).map(|_| ());
    let chosen = slots.choose(&mut take, &mut [0; MOST_BYTES], trapped, reading);
    (chosen.found.map(|_| table), chosen)
}

/// An upload, as a board does it after a start.
pub(crate) fn upload<const WORD: usize, const N: usize>(
    slots: &mut Pair<WORD>,
    image: &Image,
    table: &Numbers<N>,
) -> Result<u32, String> {
    let (_, before) = start::<WORD, N>(slots, image);
    let written = slots.write(&mut bytes(table), before.spare, before.last);
    written.map_err(|refused| refused.to_string())
}
