//! What a real board sends, from any stream of bytes: found again after gaps, with what is missing counted.

use crate::{BoardError, Recording};
use hysteron_core::codes::{AdcCode, Converter};
use hysteron_firmware::telemetry::{
    ABOUT_BYTES, About, Found, SAMPLE_BYTES, SAMPLES_AN_ABOUT, Sample, find, order_packet,
};
use hysteron_firmware::wire::{Hello, Order};
use std::fs::File;
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Longest wait for a connection, and for the next byte.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// Bytes without a packet after which the stream is none of ours: four seconds of a board's.
const MOST_FOREIGN_BYTES: u64 = 4 << 20;

/// Samples without a description after which none will come.
const MOST_UNEXPLAINED: u64 = 8 * SAMPLES_AN_ABOUT as u64;

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

/// Puts packets together from pieces of a stream.
#[derive(Debug, Default)]
pub struct Collector {
    /// Bytes whose packet has not ended.
    rest: Vec<u8>,
    /// Of each table, as they come.
    abouts: Vec<About>,
    pieces: Vec<(u64, Vec<Sample>)>,
    counts: Counts,
}

impl Collector {
    /// Takes more of the stream.
    ///
    /// # Errors
    /// A second description that is not the first, more gaps than a recording may have.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), BoardError> {
        self.rest.extend_from_slice(bytes);
        self.scan(false)
    }

    fn scan(&mut self, ended: bool) -> Result<(), BoardError> {
        let bytes = std::mem::take(&mut self.rest);
        let mut at = 0;
        while at < bytes.len() {
            match find(&bytes[at..]) {
                Found::Sample(sample) => {
                    self.sample(sample)?;
                    at += SAMPLE_BYTES;
                }
                Found::About(about) => {
                    self.about(about)?;
                    at += ABOUT_BYTES;
                }
                Found::Incomplete if !ended => break,
                // A board gives no orders.
                Found::Incomplete | Found::Nothing | Found::Order(_) => {
                    self.counts.foreign_bytes += 1;
                    at += 1;
                }
            }
        }
        self.rest = bytes[at..].to_vec();
        Ok(())
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
        let last = self.pieces.last().and_then(|(_, samples)| samples.last());
        let one_table = last.is_some_and(|last| last.frame.bank() == sample.frame.bank());
        let follows = match last.map(|last| number.wrapping_sub(last.frame.number)) {
            Some(1) => true,
            // Half of the counter's range on: it has been set back. So has one that says the same number twice.
            Some(step) if step == 0 || step > u32::MAX / 2 => {
                self.counts.restarts += 1;
                false
            }
            Some(step)
                if step > UNHEARD_TICKS && self.counts.lost + self.counts.restarts + self.counts.unheard == 0 =>
            {
                self.counts.unheard = std::mem::take(&mut self.counts.samples);
                self.pieces.clear();
                false
            }
            Some(step) => {
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

    /// Rate of the loop, hertz, once the board has described itself.
    fn rate_hz(&self) -> Option<f64> {
        Some(f64::from(self.abouts.first()?.hello.sample_rate_hz))
    }

    /// Whether the stream is none of ours.
    fn foreign(&self) -> bool {
        self.counts.samples == 0 && self.abouts.is_empty() && self.counts.foreign_bytes > MOST_FOREIGN_BYTES
    }

    /// The recording.
    ///
    /// # Errors
    /// No sample, no description of the board, a description whose numbers make no sense.
    pub fn finish(mut self) -> Result<Capture, BoardError> {
        self.scan(true)?;
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

/// Records for so many seconds of the board's time, or until the stream ends or is silent for [`PATIENCE`].
///
/// `from` is a file or device that is there, or `HOST:PORT` of a server that sends the bytes of the board's telemetry. With `run` the
/// loop is started when the board has described itself, which only a server can, and stopped at the end; what happens in between, the
/// recording shows. A board that has been asked to run is asked to stop however this ends.
///
/// # Errors
/// A length that makes no sense, nothing at `from`, nobody there to be asked, and as [`Collector::push`] and [`Collector::finish`].
pub fn capture(from: &str, seconds: f64, run: bool, progress: &mut dyn FnMut(f64)) -> Result<Capture, BoardError> {
    crate::within("seconds", seconds, 1e-3, 600.0)?;
    let (source, mut asked) = open(from)?;
    if run && asked.is_none() {
        return Err(BoardError::NotAsked(from.to_owned()));
    }
    let recorded = record(from, source, seconds, progress, &mut |order| match &mut asked {
        Some(board) if run => board.write_all(&order_packet(order)).map_err(failed(from)),
        _ => Ok(()),
    });
    if let Some(board) = asked.filter(|_| run) {
        // The other side may be gone already; what was recorded says whether the loop still ran.
        let _ = (&board).write_all(&order_packet(Order::Stop));
    }
    recorded
}

fn record(
    from: &str,
    source: Box<dyn Read + Send>,
    seconds: f64,
    progress: &mut dyn FnMut(f64),
    ask: &mut dyn FnMut(Order) -> Result<(), BoardError>,
) -> Result<Capture, BoardError> {
    let chunks = chunks(source);
    let mut collector = Collector::default();
    let mut started = false;
    loop {
        match chunks.recv_timeout(PATIENCE) {
            Ok(Ok(chunk)) => collector.push(&chunk)?,
            Ok(Err(source)) if collector.ticks() == 0 => return Err(failed(from)(source)),
            Err(RecvTimeoutError::Timeout) if collector.ticks() == 0 && collector.counts.foreign_bytes == 0 => {
                return Err(BoardError::Silent { from: from.to_owned() });
            }
            // A stream that ends or breaks off leaves what has come.
            Ok(Err(_)) | Err(_) => break,
        }
        let rate_hz = collector.rate_hz();
        if let Some(rate_hz) = rate_hz {
            if !started {
                ask(Order::Start)?;
                started = true;
            }
            let share = collector.ticks() as f64 / (seconds * rate_hz);
            progress(share);
            if share >= 1.0 {
                break;
            }
        }
        if collector.foreign() || (rate_hz.is_none() && collector.ticks() > MOST_UNEXPLAINED) {
            break;
        }
    }
    collector.finish()
}

fn failed(from: &str) -> impl Fn(std::io::Error) -> BoardError {
    let from = from.to_owned();
    move |source| BoardError::Source {
        from: from.clone(),
        source,
    }
}

/// What sends, and who can be asked, where it is a server.
type Opened = (Box<dyn Read + Send>, Option<TcpStream>);

fn open(from: &str) -> Result<Opened, BoardError> {
    if Path::new(from).exists() || !from.contains(':') {
        return Ok((Box::new(File::open(from).map_err(failed(from))?), None));
    }
    let mut last = std::io::Error::new(std::io::ErrorKind::NotFound, "the name has no address");
    for address in from.to_socket_addrs().map_err(failed(from))? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => {
                let asked = stream.try_clone().map_err(failed(from))?;
                return Ok((Box::new(stream), Some(asked)));
            }
            Err(error) => last = error,
        }
    }
    Err(failed(from)(last))
}

/// Reads in a thread of its own: a device that is silent can be waited for, but not for ever.
fn chunks(mut source: Box<dyn Read + Send>) -> Receiver<std::io::Result<Vec<u8>>> {
    let (sender, receiver) = sync_channel(64);
    std::thread::spawn(move || {
        let mut buffer = vec![0; 1 << 16];
        loop {
            let read = match source.read(&mut buffer) {
                Ok(0) => return,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                read => read,
            };
            let ended = read.is_err();
            // Nobody listens any more: the recording is over.
            if sender.send(read.map(|length| buffer[..length].to_vec())).is_err() || ended {
                return;
            }
        }
    });
    receiver
}
