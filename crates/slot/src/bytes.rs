//! A table as the bytes of a slot, little-endian: a header, then its numbers as `f64`, in one order. `docs/reference/files.md` has the
//! places.

use crate::{Chain, Covered, Family, MOST_PLAYS, Numbers, Refusal, Rule};
use hysteron_core::adaptation::AdaptationNumbers;
use hysteron_core::law_numbers::{FeedbackNumbers, HumNumbers, TrustNumbers};
use hysteron_core::surroundings::HARMONICS;
use hysteron_core::tracking_law::{CREEP_FAST, CREEP_SLOW, TAPS};

/// First bytes of a slot with a table.
pub const MAGIC: [u8; 8] = *b"HYSTSLOT";
/// Of the layout; another number is another layout.
pub const VERSION: u32 = 2;
/// Length of a header.
pub const HEADER_BYTES: usize = 160;

/// Places in a header.
const VERSION_AT: usize = 8;
const SEQUENCE_AT: usize = 12;
const LENGTH_AT: usize = 16;
const SUM_AT: usize = 20;
const HASH_AT: usize = 24;
const COVERED_AT: usize = 56;
const FAMILY_AT: usize = 136;
const PLAYS_AT: usize = 137;
const PARTS_AT: usize = 138;
const AHEAD_AT: usize = 140;

/// Parts of a table that may be absent, by their bits.
const CHAIN: u16 = 1;
const FEEDBACK: u16 = 1 << 1;
const TRUST: u16 = 1 << 2;
const COUPLING: u16 = 1 << 3;
const CROSS: u16 = 1 << 4;
const SENSOR: u16 = 1 << 5;
const HEAT: u16 = 1 << 6;
const MODEL_ERROR: u16 = 1 << 7;
const HUM: u16 = 1 << 8;
const ADAPTATION: u16 = 1 << 9;
const LAG_GROWTH: u16 = 1 << 10;
const ALL_PARTS: u16 = (1 << 11) - 1;

/// Numbers that every table has.
const SCALARS: usize = 23;
/// Numbers that every complete law has.
const OF_CHAIN: usize = 5 + TAPS + 5 + 2 * (CREEP_FAST + CREEP_SLOW);
/// Numbers of the parts that a complete law may have, in the order of their bits from [`FEEDBACK`] on.
const OF_PARTS: [usize; 10] = [16, 3, 4, 1, 3, 4, 1, 3 + 2 * HARMONICS, 8, 2];

/// What stands before the numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Header {
    /// Which of two tables is the newer.
    pub sequence: u32,
    /// Length of the numbers, bytes.
    pub length: usize,
    /// SHA-256 of the table's file.
    pub hash: [u8; 32],
    /// What its records cover.
    pub covered: Covered,
    /// Its family, if this version knows it.
    family: u8,
    plays: u8,
    parts: u16,
    samples_ahead: u32,
    sum: u32,
}

/// Length of a table of so many plays as a slot holds it, whatever parts it has, up to a multiple of 32.
pub const fn most_bytes(plays: usize, complete: bool) -> usize {
    let mut numbers = SCALARS + 5 * plays;
    if complete {
        numbers += OF_CHAIN;
        let mut part = 0;
        while part < OF_PARTS.len() {
            numbers += OF_PARTS[part];
            part += 1;
        }
    }
    (HEADER_BYTES + 8 * numbers).next_multiple_of(32)
}

/// Length of the largest table.
pub const MOST_BYTES: usize = most_bytes(MOST_PLAYS, true);

/// Length of a table as a slot holds it: header and numbers.
pub fn bytes_of<const N: usize>(table: &Numbers<N>) -> usize {
    HEADER_BYTES + contents_bytes(table.family, table.plays, parts_of(table))
}

fn contents_bytes(family: Family, plays: usize, parts: u16) -> usize {
    let lists = match family {
        Family::Pi | Family::Mpi | Family::Mrpi => 2,
        Family::Wrpi => 3,
        Family::PlayPolynomial => 4,
    };
    let of_chain = if parts & CHAIN == 0 { 0 } else { OF_CHAIN };
    let bits = OF_PARTS.into_iter().zip(1..);
    let of_parts: usize = bits
        .map(|(numbers, bit)| if parts >> bit & 1 == 0 { 0 } else { numbers })
        .sum();
    8 * (SCALARS + lists * plays + of_chain + of_parts)
}

fn parts_of<const N: usize>(table: &Numbers<N>) -> u16 {
    let Some(chain) = &table.chain else { return 0 };
    let trust = chain.feedback.is_some_and(|feedback| feedback.trust.is_some());
    let bits = [
        (FEEDBACK, chain.feedback.is_some()),
        (TRUST, trust),
        (COUPLING, chain.coupling.is_some()),
        (CROSS, chain.cross_um_per_um.is_some()),
        (SENSOR, chain.sensor.is_some()),
        (HEAT, chain.heat.is_some()),
        (MODEL_ERROR, chain.model_error_um.is_some()),
        (HUM, chain.hum.is_some()),
        (ADAPTATION, chain.adaptation.is_some()),
        (LAG_GROWTH, chain.lag_growth.is_some()),
    ];
    bits.into_iter()
        .filter(|(_, there)| *there)
        .fold(CHAIN, |parts, (bit, _)| parts | bit)
}

/// An empty chain with those of its parts that the bits name.
fn with_parts(parts: u16) -> Chain {
    let has = |bit: u16| parts & bit != 0;
    Chain {
        coupling: has(COUPLING).then_some([0.0; 4]),
        cross_um_per_um: has(CROSS).then_some(0.0),
        sensor: has(SENSOR).then_some([0.0; 3]),
        heat: has(HEAT).then_some([0.0; 4]),
        model_error_um: has(MODEL_ERROR).then_some(0.0),
        feedback: has(FEEDBACK).then_some(FeedbackNumbers {
            integral_v_per_um_s: 0.0,
            series: [[0.0; 5]; 2],
            damping: [0.0; 5],
            trust: has(TRUST).then_some(TrustNumbers {
                quick_v: 0.0,
                slow_v: 0.0,
                slow_v_per_s: 0.0,
            }),
        }),
        hum: has(HUM).then_some(HumNumbers {
            frequency_hz: 0.0,
            sensitivity: [[0.0; 2]; HARMONICS],
            learning_s: 0.0,
            largest_um: 0.0,
        }),
        lag_growth: has(LAG_GROWTH).then_some([0.0; 2]),
        adaptation: has(ADAPTATION).then_some(AdaptationNumbers {
            gain_bound: 0.0,
            zero_bound_um: 0.0,
            lag_bound_s: 0.0,
            lag_from_hz: 0.0,
            lag_up_to_um_per_s: 0.0,
            time_s: 0.0,
            dead_um: 0.0,
            um_per_v: 0.0,
        }),
        ..Chain::NOTHING
    }
}

/// Whether bits are those of a table: known ones, no part of a law without the law, no bounds without the feedback.
fn are_parts(parts: u16) -> bool {
    parts & !ALL_PARTS == 0 && (parts & CHAIN != 0 || parts == 0) && (parts & TRUST == 0 || parts & FEEDBACK != 0)
}

/// Every number of a table in the order of a slot: the one place that says it.
fn walk<const N: usize>(table: &mut Numbers<N>, visit: &mut impl FnMut(&mut [f64])) {
    let plays = table.plays;
    for scalar in [
        &mut table.sample_rate_hz,
        &mut table.input_min_um,
        &mut table.input_max_um,
        &mut table.output_min_v,
        &mut table.output_max_v,
        &mut table.safe_v,
        &mut table.slew_v_per_s,
        &mut table.ramp_v_per_s,
        &mut table.proportional_v_per_um,
        &mut table.integral_v_per_um_s,
        &mut table.feedback_up_to_hz,
        &mut table.dac_min_v,
        &mut table.dac_top_v,
        &mut table.adc_min_um,
        &mut table.adc_top_um,
        &mut table.alpha_s,
        &mut table.beta_s,
        &mut table.offset_v,
    ] {
        visit(core::slice::from_mut(scalar));
    }
    visit(&mut table.input_function);
    let (rate, polynomial) = (table.family == Family::Wrpi, table.family == Family::PlayPolynomial);
    for (list, has) in [
        (&mut table.thresholds_um, true),
        (&mut table.weights_v_per_um, true),
        (&mut table.rate_weights_v_s_per_um2, rate),
        (&mut table.weights_quadratic_v_per_um2, polynomial),
        (&mut table.weights_cubic_v_per_um3, polynomial),
    ] {
        if let Some(own) = list.get_mut(..plays).filter(|_| has) {
            visit(own);
        }
    }
    if let Some(chain) = &mut table.chain {
        walk_chain(chain, visit);
    }
}

fn walk_chain(chain: &mut Chain, visit: &mut impl FnMut(&mut [f64])) {
    for scalar in [
        &mut chain.inverse_min_um,
        &mut chain.inverse_max_um,
        &mut chain.rest_um,
        &mut chain.lag_s,
        &mut chain.sensor_lag_s,
    ] {
        visit(core::slice::from_mut(scalar));
    }
    visit(&mut chain.preview);
    visit(&mut chain.second_mode);
    visit(&mut chain.creep_shares);
    visit(&mut chain.creep_tau_s);
    if let Some(feedback) = &mut chain.feedback {
        visit(core::slice::from_mut(&mut feedback.integral_v_per_um_s));
        visit(feedback.series.as_flattened_mut());
        visit(&mut feedback.damping);
        if let Some(trust) = &mut feedback.trust {
            for bound in [&mut trust.quick_v, &mut trust.slow_v, &mut trust.slow_v_per_s] {
                visit(core::slice::from_mut(bound));
            }
        }
    }
    chain.coupling.iter_mut().for_each(|part| visit(part));
    chain
        .cross_um_per_um
        .iter_mut()
        .for_each(|part| visit(core::slice::from_mut(part)));
    chain.sensor.iter_mut().for_each(|part| visit(part));
    chain.heat.iter_mut().for_each(|part| visit(part));
    chain
        .model_error_um
        .iter_mut()
        .for_each(|part| visit(core::slice::from_mut(part)));
    if let Some(hum) = &mut chain.hum {
        for scalar in [&mut hum.frequency_hz, &mut hum.learning_s, &mut hum.largest_um] {
            visit(core::slice::from_mut(scalar));
        }
        visit(hum.sensitivity.as_flattened_mut());
    }
    if let Some(part) = &mut chain.adaptation {
        for scalar in [
            &mut part.gain_bound,
            &mut part.zero_bound_um,
            &mut part.lag_bound_s,
            &mut part.lag_from_hz,
            &mut part.lag_up_to_um_per_s,
            &mut part.time_s,
            &mut part.dead_um,
            &mut part.um_per_v,
        ] {
            visit(core::slice::from_mut(scalar));
        }
    }
    chain.lag_growth.iter_mut().for_each(|part| visit(part));
}

/// The envelope's ten numbers; NaN is not known.
fn covered_numbers(covered: &Covered) -> [f64; 10] {
    let [v, um, c] =
        [covered.voltage_v, covered.position_um, covered.temperature_c].map(|ends| ends.unwrap_or([f64::NAN; 2]));
    let one = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let ([v0, v1], [um0, um1], [c0, c1]) = (v, um, c);
    let (slew, swing) = (one(covered.slew_v_per_s), one(covered.swing_hz));
    let (rate, told) = (one(covered.sample_rate_hz), one(covered.told_to_hz));
    [v0, v1, um0, um1, c0, c1, slew, swing, rate, told]
}

fn covered_of([v0, v1, um0, um1, c0, c1, slew, swing, rate, told]: [f64; 10]) -> Covered {
    // One end alone is refused as a pair that does not ascend.
    let pair = |low: f64, high: f64| (!(low.is_nan() && high.is_nan())).then_some([low, high]);
    let one = |value: f64| (!value.is_nan()).then_some(value);
    Covered {
        voltage_v: pair(v0, v1),
        position_um: pair(um0, um1),
        temperature_c: pair(c0, c1),
        slew_v_per_s: one(slew),
        swing_hz: one(swing),
        sample_rate_hz: one(rate),
        told_to_hz: one(told),
    }
}

/// Puts bytes in their place; those that have none are left out.
fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + value.len()) {
        place.copy_from_slice(value);
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    let word = bytes.get(at..).and_then(|rest| rest.first_chunk());
    word.map_or(0, |word| u32::from_le_bytes(*word))
}

fn number(bytes: &[u8], at: usize) -> f64 {
    let number = bytes.get(at..).and_then(|rest| rest.first_chunk());
    number.map_or(f64::NAN, |number| f64::from_le_bytes(*number))
}

fn byte(bytes: &[u8], at: usize) -> u8 {
    bytes.get(at).copied().unwrap_or(0)
}

/// Writes a table with the hash of its file, sequence 0; returns how many bytes. What is behind them is left alone.
///
/// # Errors
/// More bytes than there is room for.
pub fn encode<const N: usize>(
    table: &Numbers<N>,
    hash: &[u8; 32],
    bytes: &mut [u8],
) -> Result<usize, Refusal<'static>> {
    let all = bytes_of(table);
    let room = bytes.len();
    let Some(bytes) = bytes.get_mut(..all) else {
        return Err(length(all - HEADER_BYTES, all - HEADER_BYTES, room));
    };
    bytes.fill(0);
    put(bytes, 0, &MAGIC);
    put(bytes, VERSION_AT, &VERSION.to_le_bytes());
    put(bytes, LENGTH_AT, &((all - HEADER_BYTES) as u32).to_le_bytes());
    put(bytes, HASH_AT, hash);
    for (value, at) in covered_numbers(&table.covered)
        .into_iter()
        .zip((COVERED_AT..).step_by(8))
    {
        put(bytes, at, &value.to_le_bytes());
    }
    put(bytes, FAMILY_AT, &[table.family as u8, table.plays as u8]);
    put(bytes, PARTS_AT, &parts_of(table).to_le_bytes());
    let ahead = table.chain.as_ref().map_or(0, |chain| chain.samples_ahead as u32);
    put(bytes, AHEAD_AT, &ahead.to_le_bytes());
    let mut at = HEADER_BYTES;
    let mut table = *table;
    walk(&mut table, &mut |values| {
        for value in values {
            put(bytes, at, &value.to_le_bytes());
            at += 8;
        }
    });
    seal(bytes, 0);
    Ok(all)
}

/// Gives a written table its sequence, and the sum that goes with it.
pub fn seal(bytes: &mut [u8], sequence: u32) {
    put(bytes, SEQUENCE_AT, &sequence.to_le_bytes());
    let sum = checked_sum(bytes);
    put(bytes, SUM_AT, &sum.to_le_bytes());
}

fn length(found: usize, wanted: usize, slot: usize) -> Refusal<'static> {
    Refusal::new(Rule::Length, "length", found as f64).allowed([wanted as f64, slot as f64, 0.0])
}

impl Header {
    /// From the first bytes of a slot of so many.
    ///
    /// # Errors
    /// Bytes that begin no table, another version, a length beyond the slot.
    #[cold]
    pub fn read(bytes: &[u8], slot_bytes: usize) -> Result<Self, Refusal<'static>> {
        if bytes.iter().take(HEADER_BYTES).all(|&byte| byte == 0xff) {
            return Err(Refusal::new(Rule::Erased, "slot", 0.0));
        }
        if !bytes.starts_with(&MAGIC) {
            return Err(Refusal::new(Rule::Magic, "magic", f64::from(word(bytes, 0))));
        }
        let version = word(bytes, VERSION_AT);
        if version != VERSION {
            let refused = Refusal::new(Rule::Version, "version", f64::from(version));
            return Err(refused.allowed([f64::from(VERSION), 0.0, 0.0]));
        }
        let contents = word(bytes, LENGTH_AT) as usize;
        if contents > slot_bytes.saturating_sub(HEADER_BYTES) {
            return Err(length(contents, slot_bytes.saturating_sub(HEADER_BYTES), slot_bytes));
        }
        let mut places = (COVERED_AT..).step_by(8);
        Ok(Self {
            sequence: word(bytes, SEQUENCE_AT),
            length: contents,
            hash: core::array::from_fn(|i| byte(bytes, HASH_AT + i)),
            covered: covered_of([(); 10].map(|()| number(bytes, places.next().unwrap_or(0)))),
            family: byte(bytes, FAMILY_AT),
            plays: byte(bytes, PLAYS_AT),
            parts: u16::from_le_bytes([byte(bytes, PARTS_AT), byte(bytes, PARTS_AT + 1)]),
            samples_ahead: word(bytes, AHEAD_AT),
            sum: word(bytes, SUM_AT),
        })
    }

    /// Whether this header comes after another.
    pub fn is_newer_than(&self, other: &Self) -> bool {
        self.sequence.wrapping_sub(other.sequence) as i32 > 0
    }
}

/// The table of a slot's bytes, into its place, by its form alone: what it holds, [`crate::Image`] and [`Numbers::sweep`] judge.
///
/// # Errors
/// What [`Header::read`] refuses, a wrong sum, a family, parts or a number of plays that there is no room for, another length than
/// that of its parts.
#[cold]
pub fn decode<const N: usize>(
    bytes: &[u8],
    image: &crate::Image,
    table: &mut Numbers<N>,
) -> Result<Header, Refusal<'static>> {
    let room = bytes.len();
    let header = Header::read(bytes, room)?;
    let bytes = bytes.get(..HEADER_BYTES + header.length).unwrap_or(bytes);
    let sum = checked_sum(bytes);
    if sum != header.sum {
        let refused = Refusal::new(Rule::Sum, "crc32", f64::from(header.sum));
        return Err(refused.allowed([f64::from(sum), 0.0, 0.0]));
    }
    let Some(&family) = Family::ALL.get(usize::from(header.family)) else {
        return Err(Refusal::new(Rule::Parts, "family", f64::from(header.family)));
    };
    if !are_parts(header.parts) {
        return Err(Refusal::new(Rule::Parts, "parts", f64::from(header.parts)));
    }
    let plays = usize::from(header.plays);
    image.has_room(family, plays, header.parts & CHAIN != 0)?;
    let wanted = contents_bytes(family, plays, header.parts);
    if header.length != wanted || plays > N {
        return Err(length(header.length, wanted, room));
    }
    *table = Numbers::empty(family, plays);
    table.covered = header.covered;
    if header.parts & CHAIN != 0 {
        table.chain = Some(Chain {
            samples_ahead: header.samples_ahead as usize,
            ..with_parts(header.parts)
        });
    }
    let mut at = HEADER_BYTES;
    walk(table, &mut |values| {
        for value in values {
            *value = number(bytes, at);
            at += 8;
        }
    });
    Ok(header)
}

/// The sum that a table's header should have: over all of it but the magic and the sum itself.
pub fn checked_sum(bytes: &[u8]) -> u32 {
    let before = bytes.get(VERSION_AT..SUM_AT).unwrap_or(&[]);
    let behind = bytes.get(HASH_AT..).unwrap_or(&[]);
    !add(add(!0, before), behind)
}

/// CRC-32 of IEEE 802.3 (the catalogue's CRC-32/ISO-HDLC).
pub fn sum(bytes: &[u8]) -> u32 {
    !add(!0, bytes)
}

/// What four bits of the shift register become: multiples of the polynomial 0x04c11db7, its bits the other way round.
const NIBBLES: [u32; 16] = {
    let mut table = [0; 16];
    let mut i = 0;
    while i < 16 {
        let mut sum = i as u32;
        let mut bit = 0;
        while bit < 4 {
            sum = if sum & 1 == 0 { sum >> 1 } else { sum >> 1 ^ 0xedb8_8320 };
            bit += 1;
        }
        table[i] = sum;
        i += 1;
    }
    table
};

fn add(sum: u32, bytes: &[u8]) -> u32 {
    let nibble = |sum: u32, four: u8| sum >> 4 ^ NIBBLES[usize::from(sum as u8 ^ four) & 15];
    bytes
        .iter()
        .fold(sum, |sum, &byte| nibble(nibble(sum, byte), byte >> 4))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_sum_is_the_catalogues() {
        assert_eq!(sum(b"123456789"), 0xcbf4_3926);
    }
}
