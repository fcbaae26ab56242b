//! What a real board sends, from any stream of bytes: found again after gaps, with what is missing counted.

use crate::learned::learned;
use crate::{BoardError, Recording};
use hysteron_core::codes::{AdcCode, Converter};
use hysteron_firmware::learned::Learned;
pub use hysteron_firmware::telemetry::About;
use hysteron_firmware::telemetry::{Found, SAMPLES_AN_ABOUT, Sample, find};
use hysteron_firmware::wire::{ACCEPTED, Hello, REFUSED};
use std::fmt::Write;

/// Bytes without a packet after which the stream is none of ours: four seconds of a board's.
const MOST_FOREIGN_BYTES: u64 = 4 << 20;

/// Samples without a description after which none will come.
pub(crate) const MOST_UNEXPLAINED: u64 = 8 * SAMPLES_AN_ABOUT as u64;

/// Pieces of a recording: with more, it is the connection that was recorded.
const MOST_PIECES: usize = 1000;

/// Fewest samples of a piece: one alone has no period.
const SHORTEST_PIECE: usize = 2;

/// A first gap longer than this, ticks, is no loss: what came before lay in the board's buffer while nobody listened. 1 s at 50 kHz.
const UNHEARD_TICKS: u32 = 50_000;

/// What was recorded from a board.
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// The board, its codes, and the first of its tables that it described.
    pub about: About,
    /// What came without a gap, in order.
    pub pieces: Vec<Piece>,
    /// What was counted.
    pub counts: Counts,
}

impl Capture {
    /// What the law had learned by the end; none where it does not learn.
    pub fn learned(&self) -> Option<Learned> {
        learned(self.pieces.iter().flat_map(|piece| &piece.recording.frames))
    }

    /// The voltages that were commanded in the ticks of these numbers, ascending; none where one of them is missing.
    pub fn commands_v(&self, numbers: impl Iterator<Item = u32>) -> Option<Vec<f64>> {
        let mut here = self.pieces.iter().flat_map(|piece| {
            let numbers = piece.recording.frames.iter().map(|frame| frame.number);
            numbers.zip(&piece.recording.voltage_v)
        });
        numbers
            .map(|wanted| {
                here.find(|(number, _)| *number == wanted)
                    .map(|(_, &voltage_v)| voltage_v)
            })
            .collect()
    }
}

/// Samples without a gap between them, of one table.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Ticks from the first sample of the capture.
    pub start_tick: u64,
    /// The table that ran, all of the piece.
    pub table: Hello,
    /// Its samples.
    pub recording: Recording,
}

/// What a capture counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Samples that came.
    pub samples: u64,
    /// Ticks whose samples did not come, by the frames' numbers.
    pub lost: u64,
    /// Samples between two gaps, too few for a piece, which are left out.
    pub alone: u64,
    /// Samples from before anybody listened, which are left out.
    pub unheard: u64,
    /// Bytes that belong to no packet.
    pub foreign_bytes: u64,
    /// Times that the board began to count anew.
    pub restarts: u64,
}

/// The packets in pieces of a stream.
#[derive(Debug, Default)]
pub(crate) struct Packets {
    /// Bytes whose packet has not ended.
    rest: Vec<u8>,
}

impl Packets {
    /// Takes more of the stream, which may have `ended` with it: each packet, and none for a byte that belongs to no packet.
    pub(crate) fn split(&mut self, bytes: &[u8], ended: bool, each: &mut dyn FnMut(Option<Found>)) {
        self.rest.extend_from_slice(bytes);
        let bytes = std::mem::take(&mut self.rest);
        let mut at = 0;
        while at < bytes.len() {
            let found = find(&bytes[at..]);
            if found == Found::Incomplete && !ended {
                break;
            }
            // A board asks for nothing.
            let packet = matches!(found, Found::Sample(_) | Found::About(_) | Found::Answer);
            at += if packet { found.length() } else { 1 };
            each(packet.then_some(found));
        }
        self.rest = bytes[at..].to_vec();
    }
}

/// From one sample to the next, by their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// Nothing is missing.
    Follows,
    /// The board counts anew: half of the counter's range on, or the same number twice.
    Anew,
    /// So many ticks on.
    Gap(u32),
}

impl Step {
    pub(crate) fn of(last: u32, number: u32) -> Self {
        match number.wrapping_sub(last) {
            1 => Self::Follows,
            step if step == 0 || step > u32::MAX / 2 => Self::Anew,
            step => Self::Gap(step),
        }
    }
}

/// Puts packets of one axis together from pieces of a stream.
#[derive(Debug, Default)]
pub struct Collector {
    /// 0 the first axis, 1 the second.
    axis: u8,
    packets: Packets,
    /// Of each table, as they come.
    abouts: Vec<About>,
    pieces: Vec<(u64, Vec<Sample>)>,
    counts: Counts,
    /// What the board said of the last change that it was asked for.
    answer: Option<Answer>,
}

/// What a board says of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Answer {
    /// The tick that made it or did not.
    pub tick: u32,
    pub accepted: bool,
}

impl Answer {
    /// What a sample says of a change; most say nothing.
    pub(crate) fn of(sample: &Sample) -> Option<Self> {
        let flags = sample.frame.flags;
        (flags & (ACCEPTED | REFUSED) != 0).then_some(Self {
            tick: sample.frame.number,
            accepted: flags & ACCEPTED != 0,
        })
    }
}

impl Collector {
    /// Of the axis of this number, from 0 on; packets of another are passed over.
    pub fn of_axis(axis: u8) -> Self {
        Self {
            axis,
            ..Self::default()
        }
    }

    /// Takes more of the stream.
    ///
    /// # Errors
    /// A second description that is not the first, more gaps than a recording may have.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), BoardError> {
        self.scan(bytes, false)
    }

    fn scan(&mut self, bytes: &[u8], ended: bool) -> Result<(), BoardError> {
        let mut packets = std::mem::take(&mut self.packets);
        let mut taken = Ok(());
        packets.split(bytes, ended, &mut |found| {
            if taken.is_ok() {
                taken = self.take(found);
            }
        });
        self.packets = packets;
        taken
    }

    fn take(&mut self, found: Option<Found>) -> Result<(), BoardError> {
        match found {
            Some(Found::Sample(sample)) if sample.axis == self.axis => self.sample(sample),
            Some(Found::About(about)) if about.axis == self.axis => self.about(about),
            // Of the other axis; and what the board says of its slots is no part of a recording.
            Some(_) => Ok(()),
            None => {
                self.counts.foreign_bytes += 1;
                Ok(())
            }
        }
    }

    fn about(&mut self, about: About) -> Result<(), BoardError> {
        // Compared as they were sent: a number that is none equals itself, too.
        for known in &self.abouts {
            // Of another table, all but what it is.
            let hello = if known.hello.bank == about.hello.bank {
                known.hello
            } else {
                Hello {
                    sample_rate_hz: known.hello.sample_rate_hz,
                    banks: known.hello.banks,
                    axes: known.hello.axes,
                    complete: known.hello.complete,
                    ..about.hello
                }
            };
            if (About { hello, ..*known }).to_packet() != about.to_packet() {
                return Err(BoardError::OtherBoard);
            }
        }
        if self.of_bank(about.hello.bank).is_none() {
            self.abouts.push(about);
        }
        Ok(())
    }

    fn of_bank(&self, bank: u8) -> Option<&About> {
        self.abouts.iter().find(|about| about.hello.bank == bank)
    }

    fn sample(&mut self, sample: Sample) -> Result<(), BoardError> {
        let number = sample.frame.number;
        self.answer = Answer::of(&sample).or(self.answer);
        let last = self.pieces.last().and_then(|(_, samples)| samples.last());
        let one_table = last.is_some_and(|last| last.frame.bank() == sample.frame.bank());
        let follows = match last.map(|last| Step::of(last.frame.number, number)) {
            Some(Step::Follows) => true,
            Some(Step::Anew) => {
                self.counts.restarts += 1;
                false
            }
            Some(Step::Gap(step))
                if step > UNHEARD_TICKS && self.counts.lost + self.counts.restarts + self.counts.unheard == 0 =>
            {
                self.counts.unheard = std::mem::take(&mut self.counts.samples);
                self.pieces.clear();
                false
            }
            Some(Step::Gap(step)) => {
                self.counts.lost += u64::from(step) - 1;
                false
            }
            None => false,
        };
        let follows = follows && one_table;
        let tick = self.ticks();
        self.counts.samples += 1;
        match self.pieces.last_mut() {
            Some((_, samples)) if follows => samples.push(sample),
            _ => {
                self.drop_alone();
                if self.pieces.len() >= MOST_PIECES {
                    let Counts { samples, lost, .. } = self.counts;
                    return Err(BoardError::Shreds { samples, lost });
                }
                self.pieces.push((tick, vec![sample]));
            }
        }
        Ok(())
    }

    /// Takes the last piece out where it is too short to be one.
    fn drop_alone(&mut self) {
        if let Some((_, samples)) = self.pieces.pop_if(|(_, samples)| samples.len() < SHORTEST_PIECE) {
            self.counts.alone += samples.len() as u64;
        }
    }

    /// Ticks from the first sample to the last.
    pub fn ticks(&self) -> u64 {
        self.counts.samples + self.counts.lost
    }

    /// What was counted so far.
    pub(crate) fn counts(&self) -> &Counts {
        &self.counts
    }

    /// The tables, once the board has described each.
    pub(crate) fn tables(&self) -> Option<Vec<Hello>> {
        let mut tables: Vec<Hello> = self.abouts.iter().map(|about| about.hello).collect();
        tables.sort_by_key(|hello| hello.bank);
        (tables.len() >= tables.first()?.banks.into()).then_some(tables)
    }

    /// The answer to the last change that has one.
    pub(crate) fn answer(&self) -> Option<Answer> {
        self.answer
    }

    /// Forgets it.
    pub(crate) fn forget_answer(&mut self) {
        self.answer = None;
    }

    /// How many axes the board has, once it has described itself.
    pub(crate) fn axes(&self) -> Option<usize> {
        Some(usize::from(self.abouts.first()?.hello.axes))
    }

    /// Begins the recording anew: what came before was no part of it.
    pub(crate) fn begin(&mut self) {
        self.pieces.clear();
        let foreign_bytes = self.counts.foreign_bytes;
        self.counts = Counts {
            foreign_bytes,
            ..Counts::default()
        };
    }

    /// Rate of the loop, hertz, once the board has described itself.
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        Some(f64::from(self.abouts.first()?.hello.sample_rate_hz))
    }

    /// Whether the stream is none of ours.
    pub(crate) fn foreign(&self) -> bool {
        self.counts.samples == 0 && self.abouts.is_empty() && self.counts.foreign_bytes > MOST_FOREIGN_BYTES
    }

    /// The recording.
    ///
    /// # Errors
    /// No sample, no description of the board, a description whose numbers make no sense.
    pub fn finish(mut self) -> Result<Capture, BoardError> {
        self.scan(&[], true)?;
        self.drop_alone();
        let bytes = self.counts.foreign_bytes;
        if self.pieces.is_empty() {
            return Err(BoardError::NoSamples { bytes });
        }
        let samples = self.counts.samples;
        let about = *self.abouts.first().ok_or(BoardError::NoAbout { samples })?;
        let [adc, dac] = [about.adc_um, about.dac_v].map(|[min, top]| Converter::new(f64::from(min), f64::from(top)));
        let (Ok(adc), Ok(dac)) = (adc, dac) else {
            return Err(BoardError::Senseless("converters' ranges"));
        };
        if !(about.hello.sample_rate_hz > 0.0 && about.hello.sample_rate_hz <= 1e9) {
            return Err(BoardError::Senseless("sample rate"));
        }
        let table = |samples: &[Sample]| {
            let about = samples.first().and_then(|sample| self.of_bank(sample.frame.bank()));
            about.map(|about| about.hello).ok_or(BoardError::NoAbout {
                samples: self.counts.samples,
            })
        };
        let piece = |(start_tick, samples): &(u64, Vec<Sample>)| -> Result<Piece, BoardError> {
            Ok(Piece {
                start_tick: *start_tick,
                table: table(samples)?,
                recording: Recording {
                    frames: samples.iter().map(|sample| sample.frame).collect(),
                    adc: samples.iter().map(|sample| sample.adc).collect(),
                    position_um: samples.iter().map(|sample| adc.volts(AdcCode(sample.adc))).collect(),
                    voltage_v: samples
                        .iter()
                        .map(|sample| dac.volts(AdcCode(sample.frame.dac)))
                        .collect(),
                },
            })
        };
        Ok(Capture {
            about,
            pieces: self.pieces.iter().map(piece).collect::<Result<_, _>>()?,
            counts: self.counts,
        })
    }
}

/// A table's hash as text.
pub fn hex(hash: &[u8; 32]) -> String {
    hash.iter().fold(String::new(), |mut text, byte| {
        // Writing to a String does not fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
