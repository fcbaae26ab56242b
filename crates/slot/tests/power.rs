//! Power that fails in any write and any erase of an upload: the board starts with the old table or the new one.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

mod common;

use common::{COMPLETE, PAPER, Pair, numbers, slots, start, start_past, upload};
use hysteron_slot::model::Tear;
use hysteron_slot::{Image, Numbers};
use proptest::prelude::*;

const TEARS: [Tear; 5] = [
    Tear::Before,
    Tear::After,
    Tear::Mixed(1),
    Tear::Mixed(2),
    Tear::Unreadable(3),
];

fn table<const WORD: usize, const N: usize>(slots: &mut Pair<WORD>, image: &Image) -> Option<Numbers<N>> {
    start(slots, image).0
}

/// A slot's pages, then its words: how many operations an upload takes, and after each cut which table starts; then the upload again.
fn every_cut<const WORD: usize, const N: usize>(first: &Numbers<N>, before: &[Numbers<N>], new: &Numbers<N>) {
    let image = Image::of(first);
    let mut ready = slots::<WORD>();
    for old in before {
        upload(&mut ready, &image, old).unwrap();
    }
    let old = before.last().copied();
    assert_eq!(table(&mut ready, &image), old);
    let mut whole = ready.clone();
    let from = whole.flash().operations();
    upload(&mut whole, &image, new).unwrap();
    let operations = whole.flash().operations() - from;
    // Two pages, and the table in words.
    let words = common::bytes(new).len().div_ceil(WORD) as u32;
    assert!(operations > 2 && operations <= 2 + words, "{operations} {words}");
    assert_eq!(table(&mut whole, &image), Some(*new));
    let mut starts = [0, 0];
    for cut in 0..operations {
        for tear in TEARS {
            let mut slots = ready.clone();
            slots.flash().cut(cut, tear);
            assert!(upload(&mut slots, &image, new).is_err(), "the power failed");
            slots.flash().power_on();
            let found = table(&mut slots, &image);
            let is_new = found == Some(*new);
            assert!(
                is_new || found == old,
                "{cut} {tear:?}: neither the old nor the new table"
            );
            // Only the last word makes it the new one.
            assert!(
                !is_new || (cut == operations - 1 && tear != Tear::Before),
                "{cut} {tear:?}"
            );
            starts[usize::from(is_new)] += 1;
            upload(&mut slots, &image, new).unwrap();
            assert_eq!(table(&mut slots, &image), Some(*new), "{cut} {tear:?}: uploaded again");
        }
    }
    assert!(starts[0] > 0 && starts[1] > 0, "{starts:?}");
}

fn changed<const N: usize>(table: &Numbers<N>, share: f64) -> Numbers<N> {
    Numbers {
        feedback_up_to_hz: table.feedback_up_to_hz * share,
        ..*table
    }
}

/// From the compiled-in table, from one in the first slot, and from one in the second; words of 8 and of 32 bytes.
#[test]
fn val_power_cut_after_every_word_and_every_page() {
    let paper: Numbers<10> = numbers(PAPER);
    let [a, b, c] = [0.5, 0.75, 1.5].map(|share| changed(&paper, share));
    every_cut::<8, 10>(&paper, &[], &a);
    every_cut::<8, 10>(&paper, &[a], &b);
    every_cut::<8, 10>(&paper, &[a, b], &c);
    every_cut::<32, 10>(&paper, &[], &a);
    every_cut::<32, 10>(&paper, &[a], &b);
    every_cut::<32, 10>(&paper, &[a, b], &c);
}

/// A complete law's table: four times as many words.
#[test]
fn val_power_cut_in_a_complete_laws_table() {
    let complete: Numbers<24> = numbers(COMPLETE);
    let [a, b] = [0.5, 0.75].map(|share| changed(&complete, share));
    every_cut::<32, 24>(&complete, &[a], &b);
}

/// A slot that stops the processor when read is passed over, and the other one starts.
#[test]
fn val_a_slot_that_traps_is_passed_over() {
    let paper: Numbers<10> = numbers(PAPER);
    let image = Image::of(&paper);
    let [a, b] = [0.5, 0.75].map(|share| changed(&paper, share));
    let mut slots = slots::<8>();
    upload(&mut slots, &image, &a).unwrap();
    upload(&mut slots, &image, &b).unwrap();
    let mut read = Vec::new();
    let (found, chosen) = start_past::<8, 10>(&mut slots, &image, Some(1), &mut |slot| read.extend(slot));
    assert_eq!(found, Some(a));
    assert_eq!(read, [0, 0], "the second slot is not read");
    assert_eq!(
        chosen.verdicts[1].unwrap_err().to_string(),
        "slot = 0: reading it reset the board: a word of it is torn; upload again"
    );
    // The upload after it goes to that slot, and is the newest.
    assert_eq!(chosen.spare, 1);
    slots
        .write(&mut common::bytes(&paper), chosen.spare, chosen.last)
        .unwrap();
    assert_eq!(table(&mut slots, &image), Some(paper));
}

/// With nothing in the other one, the compiled-in table runs, and an upload goes to the slot that traps.
#[test]
fn val_a_slot_that_traps_is_written_first() {
    let image = Image::of(&numbers::<10>(PAPER));
    let (found, chosen) = start_past::<8, 10>(&mut slots(), &image, Some(1), &mut |_| {});
    assert_eq!((found, chosen.spare), (None, 1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the contents, the number of uploads before, and where and how the power fails.
    #[test]
    fn prop_old_or_new(
        shares in prop::collection::vec(0.1..10.0_f64, 1..6),
        gain in 0.0..1e3_f64,
        cut in 0..110_u32,
        pattern in any::<u32>(),
        readable in any::<bool>(),
    ) {
        let paper: Numbers<10> = numbers(PAPER);
        let image = Image::of(&paper);
        let mut slots = slots::<8>();
        let tables: Vec<Numbers<10>> = shares.iter().map(|&share| Numbers {
            integral_v_per_um_s: gain,
            ..changed(&paper, share)
        }).collect();
        let (new, before) = tables.split_last().unwrap();
        for old in before {
            upload(&mut slots, &image, old).unwrap();
        }
        slots.flash().cut(cut, if readable { Tear::Mixed(pattern) } else { Tear::Unreadable(pattern) });
        let taken = upload(&mut slots, &image, new);
        slots.flash().power_on();
        let found = table(&mut slots, &image);
        if taken.is_ok() {
            prop_assert_eq!(found, Some(*new));
        } else {
            prop_assert!(found == Some(*new) || found == before.last().copied());
        }
    }
}
