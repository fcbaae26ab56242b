//! Recording from a real board: whoever sends its telemetry is listened to and, where it can be, asked to run.

use crate::telemetry::{Capture, Collector, MOST_UNEXPLAINED};
use crate::upload::Upload;
use crate::{BoardError, Request};
use hysteron_firmware::telemetry::order_packet;
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::{Hello, Order};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Longest wait for a connection, and for the next byte.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// Longest wait for the answer to a change, seconds of the board's time. A debug probe that polls ten times a second takes half of one
/// to carry a change there and the answer back.
const LONGEST_ANSWER_S: f64 = 5.0;

/// Who starts the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<'a> {
    /// Whoever is at the board.
    Nobody,
    /// The host.
    Host,
    /// The host, once the board plays this.
    Playing(&'a Wish),
}

/// What a board is asked for before it starts, at its safe level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wish {
    /// Which of the image's tables.
    pub bank: u8,
    /// The reference and the parts that run.
    pub request: Request,
    /// Points of the reference.
    pub upload: Option<Upload>,
}

impl Wish {
    /// The changes that make it, with the tables that the board has.
    fn changes(&self, tables: &[Hello]) -> Result<VecDeque<Change>, BoardError> {
        let Some(table) = tables.get(usize::from(self.bank)) else {
            return Err(BoardError::NoBank {
                bank: self.bank,
                banks: tables.len(),
            });
        };
        let setup = self.request.setup(table)?;
        let bank = (tables.len() > 1).then_some(Change::Bank(self.bank));
        let points = self.upload.iter().flat_map(Upload::changes);
        let reference = Change::Trajectory {
            shape: setup.shape,
            phase_step: setup.phase_step,
            low_um: setup.low_um,
            high_um: setup.high_um,
        };
        let parts = Change::Parts {
            feedforward: setup.feedforward,
            feedback: setup.feedback,
        };
        Ok(bank.into_iter().chain(points).chain([reference, parts]).collect())
    }
}

/// Records for so many seconds of the board's time, or until the stream ends or is silent for [`PATIENCE`].
///
/// `from` is a file or device that is there, or `HOST:PORT` of a server that sends the bytes of the board's telemetry. The host starts
/// the loop when the board has described itself, which only a server can, and stops it at the end; what happens in between, the
/// recording shows. With a wish the board is changed before, one change after another, each with its answer, and the recording begins
/// with the start. A board that the host starts is asked to stop however this ends.
///
/// # Errors
/// A length that makes no sense, nothing at `from`, nobody there to be asked, a wish that the board's tables do not allow, that it
/// refuses or does not answer, and as [`Collector::push`] and [`Collector::finish`].
pub fn capture(
    from: &str,
    seconds: f64,
    start: Start<'_>,
    progress: &mut dyn FnMut(f64),
) -> Result<Capture, BoardError> {
    crate::within("seconds", seconds, 1e-3, 600.0)?;
    let (source, board) = open(from)?;
    let (mut run, asked) = match (start, board) {
        (Start::Nobody, _) => (Run::Recording, None),
        (_, None) => return Err(BoardError::NotAsked(from.to_owned())),
        (Start::Host, board) => (Run::Waiting(None), board),
        (Start::Playing(wish), board) => (Run::Waiting(Some(wish)), board),
    };
    let recorded = record(from, source, seconds, progress, &mut |collector| match &asked {
        Some(board) => run.go_on(collector, &mut |order| {
            let mut board = board;
            board.write_all(&order_packet(order)).map_err(failed(from))
        }),
        None => Ok(true),
    });
    if let Some(mut board) = asked {
        // The other side may be gone already; what was recorded says whether the loop still ran.
        let _ = board.write_all(&order_packet(Order::Stop));
    }
    match &run {
        Run::Changing(left, _) if recorded.is_ok() => Err(BoardError::NoAnswer { what: asked_for(left) }),
        _ => recorded,
    }
}

/// The change that waits for its answer.
fn asked_for(left: &VecDeque<Change>) -> &'static str {
    left.front().map_or("a change", Change::name)
}

/// What a board that is asked to run is at.
enum Run<'a> {
    /// It has not described itself.
    Waiting(Option<&'a Wish>),
    /// It is being changed: what is left, the first asked for since so many ticks.
    Changing(VecDeque<Change>, u64),
    /// It has been asked to start.
    Recording,
}

impl Run<'_> {
    /// Asks for what comes next; whether the recording has begun.
    fn go_on(
        &mut self,
        collector: &mut Collector,
        ask: &mut dyn FnMut(Order) -> Result<(), BoardError>,
    ) -> Result<bool, BoardError> {
        let left = match self {
            Self::Recording => return Ok(true),
            Self::Waiting(wish) => {
                let Some(tables) = collector.tables() else {
                    return Ok(false);
                };
                wish.map_or_else(|| Ok(VecDeque::new()), |wish| wish.changes(&tables))?
            }
            Self::Changing(left, since) => {
                let what = asked_for(left);
                match collector.answer() {
                    Some(answer) if answer.accepted => drop(left.pop_front()),
                    Some(answer) => {
                        return Err(BoardError::Refused {
                            tick: answer.tick,
                            what,
                        });
                    }
                    None => {
                        let waited_s = (collector.ticks() - *since) as f64 / collector.rate_hz().unwrap_or(f64::NAN);
                        return match waited_s > LONGEST_ANSWER_S {
                            true => Err(BoardError::NoAnswer { what }),
                            false => Ok(false),
                        };
                    }
                }
                std::mem::take(left)
            }
        };
        if let Some(change) = left.front() {
            change.orders().try_for_each(&mut *ask)?;
            *self = Self::Changing(left, collector.ticks());
            return Ok(false);
        }
        if matches!(self, Self::Changing(..)) {
            collector.begin();
        }
        *self = Self::Recording;
        ask(Order::Start)?;
        Ok(true)
    }
}

fn record(
    from: &str,
    source: Box<dyn Read + Send>,
    seconds: f64,
    progress: &mut dyn FnMut(f64),
    go_on: &mut dyn FnMut(&mut Collector) -> Result<bool, BoardError>,
) -> Result<Capture, BoardError> {
    let chunks = chunks(source);
    let mut collector = Collector::default();
    loop {
        match chunks.recv_timeout(PATIENCE) {
            Ok(Ok(chunk)) => collector.push(&chunk)?,
            Ok(Err(source)) if collector.ticks() == 0 => return Err(failed(from)(source)),
            Err(RecvTimeoutError::Timeout) if collector.ticks() == 0 && collector.counts().foreign_bytes == 0 => {
                return Err(BoardError::Silent { from: from.to_owned() });
            }
            // A stream that ends or breaks off leaves what has come.
            Ok(Err(_)) | Err(_) => break,
        }
        let rate_hz = collector.rate_hz();
        if let Some(rate_hz) = rate_hz
            && go_on(&mut collector)?
        {
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
