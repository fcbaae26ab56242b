//! What each driver sends and does to its pins, on a bus that expects it; buses that fail.

use embedded_hal::spi::{ErrorKind, ErrorType, SpiBus};
use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as Level};
use embedded_hal_mock::eh1::spi::{Mock as Bus, Transaction as Transfer};
use hysteron_converters::ad5683r::{self, Ad5683r, Update};
use hysteron_converters::ad5791::{Ad5791, Code, Span};
use hysteron_converters::ad7608::{Ad7608, Reading};
use hysteron_core::codes::{AdcCode, DacCode};
use proptest::prelude::*;

/// A select line that falls and rises so many times.
fn selected(times: usize) -> Pin {
    let once = || [Level::set(State::Low), Level::set(State::High)];
    let all: Vec<Level> = (0..times).flat_map(|_| once()).collect();
    Pin::new(&all)
}

/// AD5683R, "Command Definitions": 3 writes input register and output, 1 the input register; a code lies from bit 19 on. Two axes follow
/// each other, each with its own line.
#[test]
fn val_ad5683r_writes_axis_after_axis() {
    let expected = [
        Transfer::write_vec(vec![0x31, 0x23, 0x40]),
        Transfer::flush(),
        Transfer::write_vec(vec![0x38, 0x00, 0x00]),
        Transfer::flush(),
        Transfer::write_vec(vec![0x11, 0x23, 0x40]),
        Transfer::flush(),
        Transfer::write_vec(vec![0x1f, 0xff, 0xf0]),
        Transfer::flush(),
    ];
    let (mut bus, mut pins) = (Bus::new(&expected), [selected(2), selected(2)]);
    let mut dac = Ad5683r::new(bus.clone(), pins.clone());
    dac.set([DacCode(0x1234), DacCode(0x8000)], Update::AtOnce).unwrap();
    dac.set([DacCode(0x1234), DacCode(0xffff)], Update::ByLdac).unwrap();
    bus.done();
    pins.iter_mut().for_each(Pin::done);
}

/// Command 5 asks, and the next word brings the code where a word that writes has it.
#[test]
fn val_ad5683r_says_what_it_holds() {
    let asked = [
        Transfer::transfer(vec![0x50, 0, 0], vec![0xff, 0xff, 0xff]),
        Transfer::flush(),
        Transfer::transfer(vec![0, 0, 0], vec![0x0a, 0xbc, 0xd0]),
        Transfer::flush(),
    ];
    let (mut bus, mut pins) = (Bus::new(&asked), [selected(2)]);
    assert_eq!(ad5683r::held(&mut bus, &mut pins).unwrap(), [DacCode(0xabcd)]);
    bus.done();
    pins[0].done();
}

/// A bus that fails says so, and SYNC is high again: the next word is one.
#[test]
fn error_a_bus_that_fails_leaves_the_line_high() {
    let mut pins = [selected(1), selected(1), selected(1)];
    let [first, second, third] = pins.clone();
    let mut convert = Pin::new(&[]);
    let failed = [
        Ad5683r::new(Broken, [first]).set([DacCode(0)], Update::AtOnce),
        Ad5791::new(Broken, second).set(DacCode(0).into()),
        Ad7608::new(Broken, third, convert.clone()).read::<2>().map(|_| ()),
    ];
    assert_eq!(failed, [Err(ErrorKind::Overrun); 3]);
    pins.iter_mut().for_each(Pin::done);
    convert.done();
}

/// A bus that carries nothing.
struct Broken;

impl ErrorType for Broken {
    type Error = ErrorKind;
}

impl SpiBus for Broken {
    fn read(&mut self, _: &mut [u8]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Overrun)
    }

    fn write(&mut self, _: &[u8]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Overrun)
    }

    fn transfer(&mut self, _: &mut [u8], _: &[u8]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Overrun)
    }

    fn transfer_in_place(&mut self, _: &mut [u8]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Overrun)
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// AD5791, "Input Shift Register" and "Control Register": the safe code before the output is let go, offset binary, no amplifier.
#[test]
fn val_ad5791_begins_safe_and_goes_on() {
    let word = |sent: [u8; 3]| {
        [
            Transfer::transfer_in_place(sent.to_vec(), vec![0; 3]),
            Transfer::flush(),
        ]
    };
    let expected = [
        word([0x10, 0x00, 0x00]),
        // LIN COMP 1100, BIN/2sC, RBUF.
        word([0x20, 0x03, 0x12]),
        word([0x1f, 0xff, 0xff]),
        word([0x18, 0x00, 0x08]),
    ]
    .concat();
    let (mut bus, mut pin) = (Bus::new(&expected), selected(4));
    let mut dac = Ad5791::new(bus.clone(), pin.clone());
    dac.begin(Code::new(0).unwrap(), Span::V20).unwrap();
    dac.set(Code::new(Code::TOP).unwrap()).unwrap();
    dac.set(DacCode(0x8000).into()).unwrap();
    bus.done();
    pin.done();
    assert_eq!(Code::new(1 << 20), None);
}

/// The register's read bit, then its 20 bits behind what does not matter.
#[test]
fn val_ad5791_says_what_it_holds() {
    let expected = [
        Transfer::transfer_in_place(vec![0x90, 0, 0], vec![0; 3]),
        Transfer::flush(),
        Transfer::transfer_in_place(vec![0; 3], vec![0x9a, 0xbc, 0xde]),
        Transfer::flush(),
    ];
    let (mut bus, mut pin) = (Bus::new(&expected), selected(2));
    let held = Ad5791::new(bus.clone(), pin.clone()).held().unwrap();
    assert_eq!(held.get(), 0xabcde);
    bus.done();
    pin.done();
}

/// Eight channels of 18 bits, packed by hand: the ends, zero, one step about it, and a pattern.
#[test]
fn val_ad7608_reads_channels_of_one_instant() {
    let codes = [0, 1, -1, 131_071, -131_072, 87_381, -87_382, 65_536];
    let bytes = packed(&codes);
    for (wanted, length) in [(2, 5), (8, 18)] {
        let sent = bytes.iter().take(length).copied().collect();
        let (mut bus, mut select) = (Bus::new(&[Transfer::read_vec(sent), Transfer::flush()]), selected(1));
        let mut convert = selected(1);
        let mut adc = Ad7608::new(bus.clone(), select.clone(), convert.clone());
        adc.sample();
        if wanted == 2 {
            assert_eq!(adc.read::<2>().unwrap(), [Reading(0), Reading(1)]);
        } else {
            assert_eq!(adc.read::<8>().unwrap(), codes.map(Reading));
        }
        bus.done();
        select.done();
        convert.done();
    }
}

/// Codes one after the other, each with its highest bit first.
fn packed(codes: &[i32]) -> Vec<u8> {
    let bits: Vec<bool> = codes
        .iter()
        .flat_map(|code| (0..18).rev().map(move |bit| code >> bit & 1 == 1))
        .collect();
    let byte = |eight: &[bool]| {
        eight
            .iter()
            .enumerate()
            .fold(0, |byte, (i, bit)| byte | u8::from(*bit) << (7 - i))
    };
    bits.chunks(8).map(byte).collect()
}

proptest! {
    /// Any codes come back, and as codes of 16 bits keep their order and their ends.
    #[test]
    fn prop_readings_come_back(codes in prop::array::uniform4(-131_072..131_072_i32)) {
        let (mut bus, mut select) = (Bus::new(&[Transfer::read_vec(packed(&codes)), Transfer::flush()]), selected(1));
        let mut convert = Pin::new(&[]);
        let read = Ad7608::new(bus.clone(), select.clone(), convert.clone()).read::<4>().unwrap();
        prop_assert_eq!(read, codes.map(Reading));
        for code in codes {
            let AdcCode(short) = Reading(code).into();
            prop_assert_eq!(i64::from(short), (i64::from(code) + 131_072) / 4);
        }
        bus.done();
        select.done();
        convert.done();
    }

    /// A code of 16 bits is the same share of 20: within a step of the finer ones, the ends at the ends.
    #[test]
    fn prop_codes_keep_their_share(code in 0..=u16::MAX) {
        let fine = f64::from(Code::from(DacCode(code)).get());
        let share = f64::from(code) / 65_535.0;
        prop_assert!((fine - share * f64::from(Code::TOP)).abs() < 1.0);
    }
}
