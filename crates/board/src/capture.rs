//! Recording from a real board: whoever sends its telemetry is listened to and, where it can be, asked to run.

use crate::telemetry::{Answer, Capture, Collector, MOST_UNEXPLAINED};
use crate::upload::Upload;
use crate::{BoardError, Request, Shape, datagrams};
use hysteron_firmware::telemetry::order_packet;
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::{Hello, Order};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Longest wait for a connection, and for the next byte.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// Longest wait for the answer to a change, seconds of the board's time. A debug probe that polls ten times a second takes half of one
/// to carry a change there and the answer back.
pub(crate) const LONGEST_ANSWER_S: f64 = 5.0;

/// Who starts the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<'a> {
    /// Whoever is at the board.
    Nobody,
    /// The host.
    Host,
    /// The host, once the board plays this: a wish an axis, all of one bank. An axis without one stands still.
    Playing(&'a [Option<Wish>]),
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
    /// A reference and its parts; points of one's own have their own shape and range.
    pub fn new(bank: u8, request: Request, upload: Option<Upload>) -> Self {
        let request = upload.map_or(request, |points| Request {
            shape: Shape::Table,
            range_um: Some(points.range_um),
            ..request
        });
        Self { bank, request, upload }
    }
}

/// A change, and whom it is for: 0 all axes, or the number of one.
pub(crate) type Addressed = (u8, Change);

/// The changes that make the wishes of all axes, with the tables that the board has.
pub(crate) fn changes(wishes: &[Option<Wish>], axes: &[Vec<Hello>]) -> Result<VecDeque<Addressed>, BoardError> {
    let Some(first) = wishes.iter().flatten().next() else {
        return Ok(VecDeque::new());
    };
    if wishes.len() > axes.len() {
        return Err(BoardError::OneAxis);
    }
    let mut all = VecDeque::new();
    for (number, tables) in (1..).zip(axes) {
        if number == 1 && tables.len() > 1 {
            all.push_back((0, Change::Bank(first.bank)));
        }
        let Some(table) = tables.get(usize::from(first.bank)) else {
            return Err(BoardError::NoBank {
                bank: first.bank,
                banks: tables.len(),
            });
        };
        let wish = wishes.get(usize::from(number) - 1).and_then(Option::as_ref);
        let still = Request {
            range_um: None,
            ..first.request
        };
        let setup = wish.map_or(&still, |wish| &wish.request).setup(table)?;
        let points = wish.and_then(|wish| wish.upload.as_ref());
        all.extend(
            points
                .into_iter()
                .flat_map(Upload::changes)
                .map(|points| (number, points)),
        );
        let reference = Change::Trajectory {
            shape: setup.shape,
            // A phase that does not go on is a reference that stands still.
            phase_step: wish.map_or(0, |_| setup.phase_step),
            low_um: setup.low_um,
            high_um: setup.high_um,
        };
        let parts = Change::Parts {
            feedforward: setup.feedforward,
            feedback: setup.feedback,
        };
        all.extend([(number, reference), (number, parts)]);
    }
    Ok(all)
}

/// The tables of every axis, as far as they are known.
fn tables(axes: &[Collector]) -> Vec<Vec<Hello>> {
    axes.iter().map(|axis| axis.tables().unwrap_or_default()).collect()
}

/// The orders that make a change. A board of one axis is not told whose it is.
pub(crate) fn orders((to, change): Addressed, axes: usize) -> impl Iterator<Item = Order> {
    (axes > 1).then_some(Order::To(to)).into_iter().chain(change.orders())
}

/// What those said whom a change was for: nothing before the last has answered, and the first refusal if there is one.
fn answer(axes: &mut [Collector], to: u8) -> Option<Answer> {
    let asked = match usize::from(to) {
        0 => axes,
        number => axes.get_mut(number - 1..number)?,
    };
    let answers: Vec<Answer> = asked.iter().map(Collector::answer).collect::<Option<_>>()?;
    asked.iter_mut().for_each(Collector::forget_answer);
    let refused = answers.iter().find(|answer| !answer.accepted);
    refused.or(answers.first()).copied()
}

/// Records for so many seconds of the board's time, or until the stream ends or is silent for [`PATIENCE`]: what each axis of the board
/// did, the first one's first.
///
/// `from` is a file or device that is there, `HOST:PORT` of a server that sends the bytes of the board's telemetry, or `udp://HOST:PORT`
/// of a board that sends its samples by UDP. The host starts
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
) -> Result<Vec<Capture>, BoardError> {
    crate::within("seconds", seconds, 1e-3, 600.0)?;
    let (chunks, board) = open(from)?;
    let (run, asked) = match (start, &board) {
        (Start::Nobody, _) => (Run::Recording, None),
        (_, None) => return Err(BoardError::NotAsked(from.to_owned())),
        (Start::Host, board) => (Run::Waiting(Vec::new()), board.as_ref()),
        (Start::Playing(wishes), board) => (Run::Waiting(wishes.to_vec()), board.as_ref()),
    };
    let mut taking = Taking::new(seconds, run);
    let listened = listen(from, &chunks, &mut taking, progress, &mut |order| match asked {
        Some(mut board) => board.write_all(&order_packet(order)).map_err(failed(from)),
        None => Ok(()),
    });
    // The other side may be gone already; what was recorded says whether the loop still ran.
    if let Some(mut board) = asked {
        let _ = board.write_all(&order_packet(Order::Stop));
    }
    // A server that has nothing more to send waits for this end, and the thread that listens to it waits for its end.
    if let Some(board) = board {
        let _ = board.shutdown(Shutdown::Write);
    }
    listened?;
    taking.finish()
}

/// The change that waits for its answer.
fn asked_for(left: &VecDeque<Addressed>) -> &'static str {
    left.front().map_or("a change", |(_, change)| change.name())
}

/// What a board that is asked to run is at.
#[derive(Debug)]
pub(crate) enum Run {
    /// It has not described itself.
    Waiting(Vec<Option<Wish>>),
    /// It is being changed: what is left, the first asked for since so many ticks.
    Changing(VecDeque<Addressed>, u64),
    /// It has been asked to start.
    Recording,
}

impl Run {
    /// Asks for what comes next; whether the recording has begun.
    fn go_on(
        &mut self,
        axes: &mut [Collector],
        ask: &mut dyn FnMut(Order) -> Result<(), BoardError>,
    ) -> Result<bool, BoardError> {
        let Some((ticks, rate_hz)) = axes.first().map(|first| (first.ticks(), first.rate_hz())) else {
            return Ok(false);
        };
        let left = match self {
            Self::Recording => return Ok(true),
            Self::Waiting(_) if axes.iter().any(|axis| axis.tables().is_none()) => return Ok(false),
            Self::Waiting(wishes) => changes(wishes, &tables(axes))?,
            Self::Changing(left, since) => {
                let what = asked_for(left);
                match answer(axes, left.front().map_or(0, |(to, _)| *to)) {
                    Some(answer) if answer.accepted => drop(left.pop_front()),
                    Some(answer) => {
                        return Err(BoardError::Refused {
                            tick: answer.tick,
                            what,
                        });
                    }
                    None => {
                        let waited_s = (ticks - *since) as f64 / rate_hz.unwrap_or(f64::NAN);
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
            orders(*change, axes.len()).try_for_each(&mut *ask)?;
            *self = Self::Changing(left, ticks);
            return Ok(false);
        }
        if matches!(self, Self::Changing(..)) {
            axes.iter_mut().for_each(Collector::begin);
        }
        *self = Self::Recording;
        ask(Order::Start)?;
        Ok(true)
    }
}

/// A recording under way.
#[derive(Debug)]
pub(crate) struct Taking {
    both: [Collector; 2],
    seconds: f64,
    run: Run,
}

impl Taking {
    /// Of so many seconds of the board's time.
    pub(crate) fn new(seconds: f64, run: Run) -> Self {
        Self {
            both: [0, 1].map(Collector::of_axis),
            seconds,
            run,
        }
    }

    /// Takes more of the stream and asks for what comes next; the share that has been recorded, 0 before it has begun.
    pub(crate) fn take(
        &mut self,
        bytes: &[u8],
        ask: &mut dyn FnMut(Order) -> Result<(), BoardError>,
    ) -> Result<f64, BoardError> {
        self.both.iter_mut().try_for_each(|axis| axis.push(bytes))?;
        let (rate_hz, axes) = (self.both[0].rate_hz(), axes(&self.both));
        match rate_hz {
            Some(rate_hz) if self.run.go_on(&mut self.both[..axes], ask)? => {
                Ok(self.both[0].ticks() as f64 / (self.seconds * rate_hz))
            }
            _ => Ok(0.0),
        }
    }

    /// Whether no sample will ever be one of ours.
    fn hopeless(&self) -> bool {
        let [first, _] = &self.both;
        first.foreign() || (first.rate_hz().is_none() && first.ticks() > MOST_UNEXPLAINED)
    }

    /// What came.
    pub(crate) fn finish(self) -> Result<Vec<Capture>, BoardError> {
        if let Run::Changing(left, _) = &self.run {
            return Err(BoardError::NoAnswer { what: asked_for(left) });
        }
        let axes = axes(&self.both);
        self.both.into_iter().take(axes).map(Collector::finish).collect()
    }
}

/// Listens until the recording has its length, or the stream ends, is silent or is none.
fn listen(
    from: &str,
    chunks: &Receiver<Chunk>,
    taking: &mut Taking,
    progress: &mut dyn FnMut(f64),
    ask: &mut dyn FnMut(Order) -> Result<(), BoardError>,
) -> Result<(), BoardError> {
    loop {
        let [first, _] = &taking.both;
        let share = match chunks.recv_timeout(PATIENCE) {
            Ok(Ok(chunk)) => taking.take(&chunk, ask)?,
            Ok(Err(source)) if first.ticks() == 0 => return Err(failed(from)(source)),
            Err(RecvTimeoutError::Timeout) if first.ticks() == 0 && first.counts().foreign_bytes == 0 => {
                return Err(BoardError::Silent { from: from.to_owned() });
            }
            // A stream that ends or breaks off leaves what has come.
            Ok(Err(_)) | Err(_) => return Ok(()),
        };
        if share > 0.0 {
            progress(share);
        }
        if share >= 1.0 || taking.hopeless() {
            return Ok(());
        }
    }
}

/// How many axes the board says that it has; one before it has said so.
fn axes(both: &[Collector; 2]) -> usize {
    both[0].axes().unwrap_or(1).clamp(1, both.len())
}

pub(crate) fn failed(from: &str) -> impl Fn(std::io::Error) -> BoardError {
    let from = from.to_owned();
    move |source| BoardError::Source {
        from: from.clone(),
        source,
    }
}

/// A piece of a stream.
pub(crate) type Chunk = std::io::Result<Vec<u8>>;

/// What comes, until the stream ends, and who can be asked, where it is a server.
pub(crate) type Opened = (Receiver<Chunk>, Option<TcpStream>);

pub(crate) fn open(from: &str) -> Result<Opened, BoardError> {
    if from.starts_with(datagrams::SCHEME) {
        return datagrams::open(from);
    }
    if Path::new(from).exists() || !from.contains(':') {
        return Ok((chunks(File::open(from).map_err(failed(from))?), None));
    }
    let stream = connect(from)?;
    let asked = stream.try_clone().map_err(failed(from))?;
    Ok((chunks(stream), Some(asked)))
}

/// To the first address of a `HOST:PORT` that answers.
pub(crate) fn connect(to: &str) -> Result<TcpStream, BoardError> {
    let mut last = std::io::Error::new(std::io::ErrorKind::NotFound, "the name has no address");
    for address in to.to_socket_addrs().map_err(failed(to))? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(failed(to)(last))
}

/// Reads in a thread of its own: a device that is silent can be waited for, but not for ever.
fn chunks(mut source: impl Read + Send + 'static) -> Receiver<Chunk> {
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
