//! Slots that hold no table for the image: the other slot starts, or the compiled-in table, and the reason is told.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

mod common;

use common::{COMPLETE, PAPER, Pair, SLOT, bytes, numbers, slots, start, upload};
use hysteron_slot::{Header, Image, Numbers, Refusal, Rule, bytes_of, decode, encode, most_bytes, seal};
use proptest::prelude::*;

/// Bytes as they lie in a slot, whatever they are.
fn lay(slots: &mut Pair<8>, slot: usize, bytes: &[u8]) {
    let at = slot * SLOT as usize;
    slots.flash().bytes()[at..at + bytes.len()].copy_from_slice(bytes);
}

fn paper() -> Numbers<10> {
    numbers(PAPER)
}

fn good() -> Numbers<10> {
    Numbers {
        feedback_up_to_hz: 77.0,
        ..paper()
    }
}

/// What is said of bytes in the second slot beside a good table in the first, which starts, and of bytes alone, where the compiled-in one
/// does.
fn verdicts(bad: &[u8]) -> [Refusal<'static>; 2] {
    let image = Image::of(&paper());
    let mut pair = slots::<8>();
    upload(&mut pair, &image, &good()).unwrap();
    lay(&mut pair, 1, bad);
    let (found, chosen) = start(&mut pair, &image);
    assert_eq!(found, Some(good()), "the other slot");
    assert_eq!(chosen.verdicts[0], Ok(0));
    let mut alone = slots::<8>();
    lay(&mut alone, 0, bad);
    let (found, chosen_alone) = start::<8, 10>(&mut alone, &image);
    assert_eq!(found, None, "the compiled-in table");
    [&chosen.verdicts[1], &chosen_alone.verdicts[0]].map(|verdict| verdict.unwrap_err())
}

/// The same of bytes whose header is newer: the same is said of both.
fn said(bad: &[u8]) -> (Rule, String) {
    let [beside, alone] = verdicts(bad);
    // As text: a NaN is none that equals itself.
    assert_eq!(beside.to_string(), alone.to_string());
    (alone.rule, alone.to_string())
}

/// A table with another sequence than the good one's, changed and summed again.
fn sealed(change: impl Fn(&mut [u8])) -> Vec<u8> {
    let mut bytes = bytes(&good());
    let length = bytes_of(&good());
    change(&mut bytes[..length]);
    seal(&mut bytes[..length], 7);
    bytes
}

fn changed(change: impl Fn(&mut Numbers<10>)) -> Vec<u8> {
    let mut table = good();
    change(&mut table);
    let mut bytes = bytes(&table);
    let length = bytes_of(&table);
    seal(&mut bytes[..length], 7);
    bytes
}

#[test]
fn refuse_what_is_no_table() {
    assert_eq!(
        said(&[0xff; SLOT as usize]).1,
        "slot = erased: no table was written here"
    );
    assert_eq!(
        said(&[0x5a; SLOT as usize]).1,
        "magic = 0x5a5a5a5a: is no table's beginning"
    );
    let torn = sealed(|bytes| bytes[300] ^= 1);
    let mut torn_after = torn.clone();
    torn_after[300] ^= 1;
    let (rule, text) = said(&torn_after);
    assert_eq!(rule, Rule::Sum);
    assert!(
        text.starts_with("crc32 = 0x") && text.contains(": the contents give 0x"),
        "{text}"
    );
    assert_eq!(
        said(&sealed(|bytes| bytes[8] = 1)).1,
        "version = 1: this image reads version 2; take the image and `hysteron` of one version"
    );
    assert_eq!(
        said(&sealed(|bytes| bytes[16..20].copy_from_slice(&u32::MAX.to_le_bytes()))).1,
        "length = 4294967295: must be 3936 bytes by the table's own parts, and fit a slot of 4096 bytes"
    );
    // A sum over fewer bytes than the parts have.
    let mut short = bytes(&good());
    short[16..20].copy_from_slice(&8_u32.to_le_bytes());
    seal(&mut short[..168], 7);
    assert_eq!(said(&short).0, Rule::Length);
}

/// The sum fits, and the table does not.
#[test]
fn refuse_tables_of_other_dimensions() {
    for (bytes, wanted) in [
        (
            sealed(|bytes| bytes[137] = 9),
            "thresholds_um = 9 values: must be 10 as in the image's first table",
        ),
        (
            sealed(|bytes| bytes[136] = 2),
            "family = wrpi: must be mrpi as in the image's first table",
        ),
        (
            sealed(|bytes| bytes[136] = 9),
            "family = 9: is none that this version knows",
        ),
        (
            sealed(|bytes| bytes[139] = 0x80),
            "parts = 32768: is none that this version knows",
        ),
        (
            sealed(|bytes| bytes[138] = 2),
            "parts = 2: is none that this version knows",
        ),
        (
            sealed(|bytes| bytes[138] = 1),
            "controller = present: the image's first table has none; give tables with a complete law, or tables without",
        ),
        (
            changed(|t| t.dac_top_v = 210.0),
            "dac_top_v = 210: must be 199.993896484375 as in the image's first table",
        ),
        (
            changed(|t| t.slew_v_per_s *= 0.5),
            "slew_v_per_s = 99996.9482421875: must be 199993.896484375 as in",
        ),
    ] {
        let said = said(&bytes).1;
        assert!(said.starts_with(wanted), "`{said}` should say `{wanted}`");
    }
    let complete: Numbers<24> = numbers(COMPLETE);
    let mut of_a_law = bytes(&complete);
    seal(&mut of_a_law[..bytes_of(&complete)], 7);
    assert_eq!(said(&of_a_law).0, Rule::OtherFamily);
}

/// The table's own checks, with the host's words, and the envelope within the converters.
#[test]
fn refuse_by_the_tables_own_checks() {
    for (bytes, wanted) in [
        (changed(|t| t.thresholds_um.swap(2, 3)), "thresholds_um[4] = "),
        (
            changed(|t| t.weights_v_per_um[2] = f64::NAN),
            "weights_v_per_um[3] = NaN: must be finite in f32",
        ),
        (
            changed(|t| t.input_function[4] = 1e-3),
            "quintic_v_per_um5 = 0.001: family mrpi has no such term; take the line out",
        ),
        (changed(|t| t.alpha_s = -1e-3), "alpha_s = as given: "),
        (
            changed(|t| t.safe_v = -1.0),
            "safe_v = -1: must not lie below output_min_v",
        ),
        (
            changed(|t| (t.input_function[0], t.offset_v) = (-t.input_function[0], 190.0)),
            "linear_v_per_um, cubic_v_per_um3, weights_v_per_um = flat or turning at ",
        ),
        (
            changed(|t| t.covered.voltage_v = Some([-230.0, 150.0])),
            "covered.voltage_v = [-230, 150]: must lie within -200 to 199.993896484375 of the image's DAC; \
             export with the image's converters, or record within them",
        ),
        (
            changed(|t| t.covered.position_um = Some([0.0, 1e6])),
            "covered.position_um = [0, 1000000]: must lie within ",
        ),
        (
            changed(|t| t.covered.temperature_c = Some([30.0, 20.0])),
            "covered.temperature_c = [30, 20]: must be two finite numbers, the lower first",
        ),
    ] {
        let said = said(&bytes).1;
        assert!(said.starts_with(wanted), "`{said}` should say `{wanted}`");
    }
}

/// Two good ones: the newer starts, whichever slot it is in, and past the end of the sequence's numbers.
#[test]
fn val_the_newer_starts() {
    let image = Image::of(&paper());
    for (first, second, newer) in [(4, 5, 1), (5, 4, 0), (u32::MAX, 0, 1), (0, u32::MAX, 0)] {
        let mut pair = slots::<8>();
        for (slot, sequence) in [first, second].into_iter().enumerate() {
            let mut bytes = bytes(&good());
            seal(&mut bytes[..bytes_of(&good())], sequence);
            lay(&mut pair, slot, &bytes);
        }
        let (_, chosen) = start::<8, 10>(&mut pair, &image);
        assert_eq!(chosen.found.unwrap().0, newer);
        assert_eq!(chosen.verdicts[1 - newer].unwrap_err().rule, Rule::Older);
    }
}

/// Every part of a complete law comes back, bit by bit, and no slot's table is longer than it may be.
#[test]
fn val_tables_come_back() {
    let complete: Numbers<24> = numbers(COMPLETE);
    let written = bytes(&complete);
    let image = Image::of(&complete);
    assert!(bytes_of(&complete) <= most_bytes(24, true) && bytes_of(&paper()) <= most_bytes(10, false));
    let mut back = Numbers::<24>::empty(image.family, 0);
    let read = decode(&written, &image, &mut back).unwrap();
    assert_eq!(back, complete);
    assert_eq!(read, Header::read(&written, SLOT as usize).unwrap());
    assert_eq!(read.hash, hysteron_table::hash("a file"));
    let full = {
        let mut full = complete;
        let chain = full.chain.as_mut().unwrap();
        chain.coupling = Some([0.1, 0.2, 0.3, 0.4]);
        chain.cross_um_per_um = Some(0.01);
        chain.sensor = Some([5.0, 1e-5, 1e-6]);
        chain.heat = Some([22.0, 60.0, 0.1, 1e-4]);
        chain.model_error_um = Some(0.02);
        full.covered.voltage_v = Some([0.0, 100.0]);
        full.covered.told_to_hz = Some(1e3);
        full
    };
    let mut room = vec![0; bytes_of(&full)];
    assert_eq!(encode(&full, &[7; 32], &mut room).unwrap(), room.len());
    decode(&room, &image, &mut back).unwrap();
    assert_eq!(back, full);
    assert!(encode(&full, &[7; 32], &mut [0; 400]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Random bytes, whole or from somewhere in a good table on, never start, and never stop the board.
    #[test]
    fn prop_random_bytes_never_start(noise in prop::collection::vec(any::<u8>(), 1..2000), at in 0..400_usize) {
        let mut bad = bytes(&good());
        let before = bad.clone();
        bad.resize(bad.len().max(at + noise.len()), 0xff);
        bad[at..at + noise.len()].copy_from_slice(&noise);
        let length = bytes_of(&good());
        prop_assume!(bad[..length] != before[..length]);
        verdicts(&bad);
        verdicts(&noise);
    }

    /// One bit anywhere in the table.
    #[test]
    fn prop_a_bit_is_noticed(bit in 0..8 * 504_usize) {
        let mut bad = bytes(&good());
        prop_assume!(bit / 8 < bytes_of(&good()));
        bad[bit / 8] ^= 1 << (bit % 8);
        verdicts(&bad);
    }

    /// Any numbers behind a right sum: refused with a reason, or within every rule.
    #[test]
    fn prop_any_numbers_are_judged(at in 0..43_usize, bits in any::<u64>()) {
        let bytes = sealed(|bytes| bytes[160 + 8 * at..168 + 8 * at].copy_from_slice(&bits.to_le_bytes()));
        let image = Image::of(&paper());
        let mut pair = slots::<8>();
        lay(&mut pair, 0, &bytes);
        let (found, chosen) = start::<8, 10>(&mut pair, &image);
        if let Some(table) = found {
            prop_assert!(table.sweep().is_ok() && image.holds(&table).is_ok());
        } else {
            prop_assert!(!chosen.verdicts[0].unwrap_err().reason().to_string().is_empty());
        }
    }
}
