//! Tables and slots of the tests.

use hysteron_slot::model::Flash;
use hysteron_slot::{Chosen, Image, MOST_BYTES, Numbers, Slots, encode};
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

pub(crate) fn start<const WORD: usize, const N: usize>(slots: &mut Pair<WORD>, image: &Image) -> Chosen<N> {
    slots.choose(image, &mut [0; MOST_BYTES], None, &mut |_| {})
}

/// An upload, as a board does it after a start.
pub(crate) fn upload<const WORD: usize, const N: usize>(
    slots: &mut Pair<WORD>,
    image: &Image,
    table: &Numbers<N>,
) -> Result<(usize, u32), String> {
    let before: Chosen<N> = start(slots, image);
    let in_use = before.found.map(|found| found.slot);
    let written = slots.write(&mut bytes(table), in_use, before.last);
    written.map_err(|refused| refused.to_string())
}
