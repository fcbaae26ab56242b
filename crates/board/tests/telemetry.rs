//! Packets of a board, found in what a connection makes of them.

use hysteron_board::BoardError;
use hysteron_board::capture::{Start, capture};
use hysteron_board::telemetry::{Capture, Collector};
use hysteron_firmware::table;
use hysteron_firmware::telemetry::{
    ABOUT_BYTES, About, DATAGRAM_BYTES, Found, ORDER_BYTES, Requested, Requests, SAMPLE_BYTES, SAMPLES_AN_ABOUT,
    Sample, checksum, find, order_packet, samples_to_packet,
};
use hysteron_firmware::tuning::Change;
use hysteron_firmware::upload::{ANSWER_BYTES, MESSAGE_BYTES};
use hysteron_firmware::wire::{Frame, Hello, MAGIC, Mode, Order, flags};
use proptest::prelude::*;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::time::Duration;

fn sample(number: u32) -> Sample {
    Sample {
        frame: Frame {
            number,
            reference_um: number as f32 * 1e-3,
            command_v: 3.0,
            dac: (number as u16).wrapping_mul(257),
            flags: flags(false, Mode::Running, None),
        },
        adc: !(number as u16),
        axis: 0,
    }
}

fn packets(numbers: impl IntoIterator<Item = u32>) -> Vec<u8> {
    numbers
        .into_iter()
        .flat_map(|number| sample(number).to_packet())
        .collect()
}

fn about() -> Vec<u8> {
    About::of("nucleo-h743zi").to_packet().to_vec()
}

fn collect(stream: &[u8], chunk: usize) -> Result<Capture, BoardError> {
    let mut collector = Collector::default();
    for bytes in stream.chunks(chunk) {
        collector.push(bytes)?;
    }
    collector.finish()
}

fn numbers(capture: &Capture) -> Vec<Vec<u32>> {
    let of = |frames: &[Frame]| frames.iter().map(|frame| frame.number).collect();
    capture.pieces.iter().map(|piece| of(&piece.recording.frames)).collect()
}

/// The check value of the catalogue of parametrised CRC algorithms for CRC-16/IBM-3740.
#[test]
fn val_checksum() {
    assert_eq!(checksum(b"123456789"), 0x29b1);
    assert_eq!(checksum(b""), 0xffff);
}

#[test]
fn val_packets_come_back() {
    let packet = sample(7).to_packet();
    assert_eq!(find(&packet), Found::Sample(sample(7)));
    let mut described = About::of("nucleo-g474re");
    assert_eq!(find(&described.to_packet()), Found::About(described));
    described.hello.complete = true;
    assert_eq!(find(&described.to_packet()), Found::About(described));
    assert_eq!(described.board(), "nucleo-g474re");
    assert_eq!((packet.len(), described.to_packet().len()), (SAMPLE_BYTES, ABOUT_BYTES));
    for length in 0..packet.len() {
        assert_eq!(find(&packet[..length]), Found::Incomplete, "{length}");
    }
    // Any one bit: the mark and the kind decide what is looked for, the checksum the rest.
    for bit in 0..8 * packet.len() {
        let mut wrong = packet;
        wrong[bit / 8] ^= 1 << (bit % 8);
        assert!(
            !matches!(find(&wrong), Found::Sample(_) | Found::About(_) | Found::Order(_)),
            "{bit}"
        );
    }
}

/// The page of the format has each packet's length and the version.
#[test]
fn golden_page_of_the_format() {
    let page = include_str!("../../../docs/reference/link.md");
    for (kinds, length) in [
        ("`A`, `B` | board", ABOUT_BYTES),
        ("`S`, `T` | board", SAMPLE_BYTES),
        ("`V` | board", ANSWER_BYTES),
        ("`O` | host", ORDER_BYTES),
        ("`N` | host", samples_to_packet(0).len()),
        ("`U` | host", MESSAGE_BYTES),
    ] {
        assert!(page.contains(&format!("| {kinds} | {length} |")), "{kinds} {length}");
    }
    assert!(page.contains(str::from_utf8(&MAGIC).unwrap()));
    assert!(page.contains(&format!("every {SAMPLES_AN_ABOUT} samples")));
    assert!(page.contains(&format!("up to {} samples", DATAGRAM_BYTES / SAMPLE_BYTES)));
}

/// Orders get through what a connection does to them, or do not come at all.
#[test]
fn val_orders_reach_the_board() {
    let change = Change::Gains {
        proportional_v_per_um: 0.5,
        integral_v_per_um_s: 7e3,
    };
    let orders: Vec<Order> = [Order::Start]
        .into_iter()
        .chain(change.orders())
        .chain([Order::Stop, Order::Clear])
        .collect();
    let mut stream = Vec::new();
    for (k, &order) in orders.iter().enumerate() {
        stream.extend(&b"\xa5O\xa5\xa5S noise"[..k % 12]);
        stream.extend(order_packet(order));
    }
    let mut board = Requests::default();
    let taken: Vec<Requested> = stream.iter().filter_map(|&byte| board.push(byte)).collect();
    assert_eq!(taken, orders.into_iter().map(Requested::Order).collect::<Vec<_>>());
    for port in [0, 9090, u16::MAX] {
        let taken = samples_to_packet(port).iter().find_map(|&byte| board.push(byte));
        assert_eq!(taken, Some(Requested::SamplesTo(port)));
    }
    let packet = order_packet(Order::Start);
    for bit in 0..8 * packet.len() {
        let mut wrong = packet;
        wrong[bit / 8] ^= 1 << (bit % 8);
        let mut board = Requests::default();
        assert_eq!(wrong.iter().find_map(|&byte| board.push(byte)), None, "{bit}");
    }
}

/// Codes are what the table says of them.
#[test]
fn val_codes_become_volts_and_micrometres() {
    let stream = [packets(0..3), about(), packets(3..10)].concat();
    let capture = collect(&stream, 5).unwrap();
    assert_eq!(numbers(&capture), [(0..10).collect::<Vec<_>>()]);
    let recording = &capture.pieces[0].recording;
    let linear =
        |code: u16, min: f32, top: f32| f64::from(min) + (f64::from(top) - f64::from(min)) * f64::from(code) / 65_535.0;
    for (k, frame) in recording.frames.iter().enumerate() {
        let um = linear(recording.adc[k], table::ADC_MIN_UM, table::ADC_TOP_UM);
        let v = linear(frame.dac, table::DAC_MIN_V, table::DAC_TOP_V);
        assert!((recording.position_um[k] - um).abs() < 1e-9 && (recording.voltage_v[k] - v).abs() < 1e-9);
    }
    assert_eq!(capture.about.hello.hash, table::HASH);
}

#[test]
fn val_what_is_lost_is_counted_and_parts_the_recording() {
    let stream = [
        about(),
        packets(100..105),
        // Cut in the middle.
        packets([105])[..9].to_vec(),
        packets(108..111),
        // One alone.
        packets([200]),
        packets(300..302),
        b"garbage \xa5S\xa5A \xa5".to_vec(),
        packets(302..304),
        // The board began anew.
        packets(0..2),
    ]
    .concat();
    for chunk in [1, 7, 22, 64, 100_000] {
        let capture = collect(&stream, chunk).unwrap();
        let whole: [&[u32]; 4] = [
            &[100, 101, 102, 103, 104],
            &[108, 109, 110],
            &[300, 301, 302, 303],
            &[0, 1],
        ];
        assert_eq!(numbers(&capture), whole);
        let counts = capture.counts;
        assert_eq!((counts.samples, counts.alone, counts.restarts), (15, 1, 1));
        // 105 to 107, 111 to 199, 201 to 299.
        assert_eq!(counts.lost, 3 + 89 + 99);
        assert_eq!(counts.foreign_bytes, 9 + 14);
        let starts: Vec<u64> = capture.pieces.iter().map(|piece| piece.start_tick).collect();
        assert_eq!(starts, [0, 8, 200, 204]);
    }
}

/// The board's buffer holds what it sent before anybody listened.
#[test]
fn val_a_recording_begins_when_somebody_listens() {
    let stream = [
        about(),
        packets(0..100),
        packets(1_000_000..1_000_010),
        packets(2_000_000..2_000_002),
    ]
    .concat();
    let capture = collect(&stream, 333).unwrap();
    let whole = [(1_000_000..1_000_010).collect::<Vec<_>>(), vec![2_000_000, 2_000_001]];
    assert_eq!(numbers(&capture), whole);
    assert_eq!(
        (capture.pieces[0].start_tick, capture.pieces[1].start_tick),
        (0, 1_000_000)
    );
    let counts = capture.counts;
    assert_eq!((counts.unheard, counts.samples, counts.lost), (100, 12, 999_990));
}

/// An image with two tables: each piece has its own, by the frames; a change is no loss.
#[test]
fn val_every_piece_has_the_table_that_ran() {
    let of_bank = |bank: u8| {
        let mut about = About::of("nucleo-h743zi");
        about.hello = Hello {
            hash: [bank + 1; 32],
            bank,
            banks: 2,
            ..about.hello
        };
        about
    };
    let samples = |bank: u16, numbers: std::ops::Range<u32>| -> Vec<u8> {
        let packets = numbers.map(|number| {
            let mut sample = sample(number);
            sample.frame.flags |= bank << 13;
            sample.to_packet()
        });
        packets.flatten().collect()
    };
    let abouts = [of_bank(0), of_bank(1)]
        .map(|about| about.to_packet().to_vec())
        .concat();
    let stream = [
        abouts.clone(),
        samples(0, 0..50),
        samples(1, 50..90),
        abouts,
        samples(0, 90..99),
    ]
    .concat();
    let capture = collect(&stream, 100).unwrap();
    let tables: Vec<(u64, u8)> = capture
        .pieces
        .iter()
        .map(|piece| (piece.start_tick, piece.table.hash[0]))
        .collect();
    assert_eq!(tables, [(0, 1), (50, 2), (90, 1)]);
    assert_eq!((capture.counts.samples, capture.counts.lost), (99, 0));
    // Samples of a table that nothing is known of.
    let stream = [of_bank(0).to_packet().to_vec(), samples(1, 0..9)].concat();
    let said = collect(&stream, 100).err().unwrap().to_string();
    assert!(said.starts_with("9 samples came and no description"), "{said}");
    // Another board's second table.
    let mut other = of_bank(1);
    other.adc_um = [0.0, 1.0];
    let stream = [of_bank(0).to_packet(), other.to_packet()].concat();
    assert!(matches!(collect(&stream, 100), Err(BoardError::OtherBoard)));
}

#[test]
fn refuse_streams_that_are_no_recording() {
    let said = |stream: &[u8]| collect(stream, 4096).err().unwrap().to_string();
    assert!(said(b"").starts_with("no sample in 0 bytes"));
    assert!(said(&[0x55; 1000]).starts_with("no sample in 1000 bytes"));
    assert!(said(&packets(0..10)).starts_with("10 samples came and no description of the board"));
    let other = About::of("nucleo-g474re").to_packet();
    let two = [&about()[..], &packets(0..9), &other].concat();
    assert!(said(&two).starts_with("board or table changed"));
    let shreds: Vec<u8> = (0..1200).flat_map(|k| packets([5 * k, 5 * k + 1])).collect();
    assert!(said(&[about(), shreds].concat()).starts_with("of 5001 ticks 3000 are lost"));
    let mut flat = About::of("nucleo-h743zi");
    flat.dac_v = [1.0, f32::NAN];
    let stream = [&flat.to_packet()[..], &packets(0..3)].concat();
    assert!(said(&stream).starts_with("the board's converters' ranges make no sense"));
}

#[test]
fn refuse_sources_that_are_none() {
    let said = |from: &str, seconds: f64| {
        capture(from, seconds, Start::Nobody, &mut |_| ())
            .err()
            .unwrap()
            .to_string()
    };
    assert!(said("/no/such/device", 1.0).starts_with("/no/such/device: "));
    assert!(said("127.0.0.1:99999", 1.0).starts_with("127.0.0.1:99999: "));
    assert!(said("/dev/null", 1.0).starts_with("no sample in 0 bytes"));
    assert!(said("/dev/null", f64::NAN).starts_with("seconds = NaN must lie in"));
    let asked = capture("/dev/null", 1.0, Start::Host, &mut |_| ())
        .err()
        .map(|error| error.to_string());
    assert!(asked.is_some_and(|said| said.starts_with("/dev/null: a file takes no orders")));
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(&vec![0; 5 << 20]).unwrap();
    // It does not read on for ever.
    assert!(said(&file.path().display().to_string(), 1.0).starts_with("no sample in "));
}

/// A board that has sent all that it will is told that nobody listens any more; it serves the next one then.
#[test]
fn val_a_silent_board_is_let_go() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = server.local_addr().unwrap().to_string();
    let board = std::thread::spawn(move || {
        let (mut connection, _) = server.accept().unwrap();
        connection.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        connection.write_all(&[about(), packets(0..200)].concat()).unwrap();
        connection.read(&mut [0])
    });
    let axes = capture(&from, 100.0 / 50e3, Start::Nobody, &mut |_| ()).unwrap();
    assert!(axes[0].counts.samples >= 100);
    assert_eq!(board.join().unwrap().unwrap(), 0);
}

proptest! {
    /// Whatever comes: no panic, and every byte is a packet's or foreign.
    #[test]
    fn prop_any_bytes(pieces in prop::collection::vec(
        prop_oneof![
            prop::collection::vec(any::<u8>(), 0..40),
            (0_u32..50).prop_map(|number| packets([number])),
            Just(about()),
            (0_u32..50, 0_usize..22).prop_map(|(number, cut)| packets([number])[..cut].to_vec()),
        ], 0..40), chunk in 1_usize..200) {
        let stream = pieces.concat();
        match collect(&stream, chunk) {
            Ok(capture) => {
                let packets = capture.counts.samples as usize * SAMPLE_BYTES;
                let rest = stream.len() - packets - capture.counts.foreign_bytes as usize;
                prop_assert_eq!(rest % ABOUT_BYTES, 0);
                for piece in numbers(&capture) {
                    prop_assert!(piece.windows(2).all(|pair| pair[1] == pair[0].wrapping_add(1)));
                }
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
