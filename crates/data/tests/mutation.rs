//! A bounded run of what the fuzzers do without end: valid files, damaged in a seeded way, through every reader.

mod fuzzing;

use fuzzing::TARGETS;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Pieces that mean something to one reader or another.
const PIECES: &[&[u8]] = &[
    b",",
    b";",
    b"\t",
    b"\n",
    b"\r",
    b"\"",
    b"#",
    b".",
    b"-",
    b"e9",
    b"1e999",
    b"NaN",
    b"inf",
    b"0",
    b"0.1",
    b"\0",
    b"\xff",
    b"\xff\xfe",
    b"[V]",
    b"(ms)",
    b"=",
    b"[[record]]",
    b"\xff\xff\xff\xff",
    b"\0\0\0\x80",
    b"\x0e\0\0\0",
    b"\x0f\0\0\0",
];

fn damage(bytes: &mut Vec<u8>, random: &mut Pcg64) {
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..=bytes.len());
        let end = (at + random.random_range(0..=16)).min(bytes.len());
        match random.random_range(0..6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
            1 if at < bytes.len() => bytes[at] = random.random(),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let copy = bytes[at..end].to_vec();
                let to = random.random_range(0..=bytes.len());
                bytes.splice(to..to, copy);
            }
            4 => bytes.truncate(at),
            _ => {
                let piece = PIECES[random.random_range(0..PIECES.len())];
                bytes.splice(at..end.min(at + random.random_range(0..=4)), piece.iter().copied());
            }
        }
    }
}

/// No damage makes a reader panic, hang, or give a record that is not sound.
#[test]
fn prop_damaged_files_never_give_an_unsound_record() {
    for target in TARGETS {
        for (index, seed) in (target.seeds)().into_iter().enumerate() {
            (target.run)(&seed);
            let mut random = Pcg64::seed_from_u64(index as u64);
            for _ in 0..target.cases {
                let mut bytes = seed.clone();
                damage(&mut bytes, &mut random);
                if let Err(panic) = std::panic::catch_unwind(|| (target.run)(&bytes)) {
                    println!("{}: {}", target.name, bytes.escape_ascii());
                    std::panic::resume_unwind(panic);
                }
            }
        }
    }
}
