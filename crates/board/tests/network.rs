//! A board on a cable: all that it sends, what a cable loses, and what strangers send.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

#[path = "../examples/link/bench.rs"]
mod bench;
#[allow(dead_code, reason = "some of it is the examples' alone")]
#[path = "../examples/link/cable.rs"]
mod cable;

use bench::Bench;
use cable::Heard;
use hysteron_board::telemetry::{About, Collector, Counts};
use hysteron_firmware::network::PORT;
use hysteron_firmware::telemetry::{DATAGRAM_BYTES, Found, SAMPLE_BYTES, all};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Ticks of a datagram of two axes.
const TICKS: u64 = (DATAGRAM_BYTES / SAMPLE_BYTES / 2) as u64;

/// Every sample of both axes, as it was sent, without a gap.
#[test]
fn val_nothing_is_lost_on_a_cable_that_loses_nothing() {
    let mut bench = Bench::new(0).unwrap();
    bench.connect(true).unwrap();
    let mut heard = Heard::default();
    bench.run(100_000, &mut heard, &mut |_| {});
    assert_eq!((heard.wrong, heard.missing, heard.gaps), (0, 0, 0));
    assert!(heard.samples > 2 * 99_900, "{heard:?}");
    // Both axes describe themselves over the connection, again and again.
    let abouts = abouts(&bench.host.said());
    assert!(abouts.len() > 10 && abouts.len().is_multiple_of(2), "{}", abouts.len());
}

/// Every description in what was said.
fn abouts(said: &[u8]) -> Vec<About> {
    let about = |found| match found {
        Found::About(about) => Some(about),
        _ => None,
    };
    all(said).filter_map(about).collect()
}

/// One datagram of a hundred is lost: its ticks are counted as missing, and each piece between is a record without a gap.
#[test]
fn val_what_a_cable_loses_is_counted() {
    let mut bench = Bench::new(100).unwrap();
    bench.connect(true).unwrap();
    let (mut heard, mut of_y) = (Heard::default(), Collector::of_axis(1));
    bench.run(100_000, &mut heard, &mut |datagram| of_y.push(datagram).unwrap());
    let lost = bench.board.end.lost;
    assert!((25..40).contains(&lost), "{lost}");
    assert_eq!((heard.wrong, heard.missing, heard.gaps), (0, lost * TICKS, lost));
    for about in abouts(&bench.host.said()) {
        of_y.push(&about.to_packet()).unwrap();
    }
    let capture = of_y.finish().unwrap();
    assert_eq!(
        (capture.counts.lost, capture.pieces.len() as u64),
        (lost * TICKS, lost + 1)
    );
}

/// Without UDP samples come over the connection, whole or not at all.
#[test]
fn val_a_connection_alone_carries_samples() {
    let mut bench = Bench::new(0).unwrap();
    bench.connect(false).unwrap();
    let mut x = Collector::of_axis(0);
    for _ in 0..500 {
        bench.round();
        x.push(&bench.host.said()).unwrap();
    }
    let capture = x.finish().unwrap();
    // The last packet had not ended.
    let Counts {
        lost, foreign_bytes, ..
    } = capture.counts;
    assert!(lost == 0 && foreign_bytes < SAMPLE_BYTES as u64, "{:?}", capture.counts);
    assert!(capture.counts.samples > 15_000, "{:?}", capture.counts);
}

/// Frames of strangers of many kinds change no code; the host goes on as before.
#[test]
fn val_hostile_frames_change_no_code() {
    let quiet = ran(false);
    assert_eq!(quiet, ran(true));
    assert_eq!(quiet.1.wrong, 0);
}

fn ran(hostile: bool) -> (u64, Heard) {
    let mut bench = Bench::new(0).unwrap();
    bench.connect(true).unwrap();
    let mut rng = Pcg64::seed_from_u64(5);
    let mut heard = Heard::default();
    for kind in 0..60 {
        if hostile {
            bench.board.end.inject(frame(kind, &mut rng));
        }
        bench.run(320, &mut heard, &mut |_| {});
    }
    (bench.board.sum, heard)
}

/// Noise behind an Ethernet header of the board's; an IP, UDP or TCP header with lengths that are none of it; a cut frame.
fn frame(kind: u32, rng: &mut Pcg64) -> Vec<u8> {
    let length = match kind % 6 {
        0 => rng.random_range(0..14),
        1 => 1514,
        _ => rng.random_range(14..200),
    };
    let mut frame: Vec<u8> = (0..length).map(|_| rng.random()).collect();
    let mut put = |at: usize, bytes: &[u8]| {
        for (place, byte) in frame.iter_mut().skip(at).zip(bytes) {
            *place = *byte;
        }
    };
    // To the board, or to all.
    put(
        0,
        if kind.is_multiple_of(2) {
            &[2, 0, 0, 0, 0, 2]
        } else {
            &[0xff; 6]
        },
    );
    match kind % 6 {
        2 => put(12, &[0x08, 0x06]),
        3 => put(12, &[0x86, 0xdd]),
        4 | 5 => {
            put(12, &[0x08, 0x00, 0x45]);
            put(23, &[if kind % 6 == 4 { 17 } else { 6 }]);
            put(26, &[192, 168, 7, 1, 192, 168, 7, 2]);
            put(36, &PORT.to_be_bytes());
        }
        _ => {}
    }
    frame
}

/// A host that falls silent is let go after some seconds, and the next one is taken.
#[test]
fn val_a_host_that_is_gone_makes_room() {
    let mut bench = Bench::new(0).unwrap();
    bench.connect(true).unwrap();
    let mut heard = Heard::default();
    bench.run(3200, &mut heard, &mut |_| {});
    let mut next = bench.without_its_host().unwrap();
    next.connect(true).unwrap();
    let mut heard = Heard::default();
    next.run(3200, &mut heard, &mut |_| {});
    assert_eq!((heard.wrong, heard.missing), (0, 0));
    assert!(heard.samples > 2 * 3000, "{heard:?}");
}
