//! A board that is watched, asked and recorded over one connection, for as long as that lasts.

use crate::capture::{Addressed, LONGEST_ANSWER_S, PATIENCE, Run, Taking, Wish, changes, failed, open, orders};
use crate::scope::{Kept, Scope, Window};
use crate::telemetry::{Answer, Capture, Packets};
use crate::{BoardError, Fault, Hello, Mode};
use hysteron_firmware::telemetry::{About, Found, order_packet};
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::Order;
use std::collections::VecDeque;
use std::io::Write;
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Answers that are remembered.
const ANSWERS: usize = 12;
/// How long the listening thread waits for bytes before it looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(100);
/// Longest recording, seconds: five minutes of both axes are a gigabyte.
const LONGEST_S: f64 = 300.0;

/// A connection to a board. When it is dropped the loop is asked to stop.
#[derive(Debug)]
pub struct Live {
    from: String,
    board: Arc<Board>,
}

/// What a board is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ask<'a> {
    /// Start the loop.
    Start,
    /// Fall to the safe level; a recording ends as well.
    Stop,
    /// Forget a fault.
    Clear,
    /// Gains of the PI controller of an axis: 0 all, or its number.
    Gains(u8, [f32; 2]),
    /// Another table, reference or parts, at the safe level: a wish an axis. An axis without one stands still.
    Play(&'a [Option<Wish>]),
}

/// What is known of a board at this moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// Its name; empty before it has described itself.
    pub name: String,
    /// The tables of each axis.
    pub tables: Vec<Vec<Hello>>,
    /// Rate of the loop, hertz.
    pub rate_hz: Option<f64>,
    /// What each axis does, as far as it has been heard.
    pub axes: Vec<AxisStatus>,
    /// Bytes that belong to no packet.
    pub foreign_bytes: u64,
    /// Seconds since anything was heard.
    pub silent_s: f64,
    /// Why the connection is over.
    pub ended: Option<String>,
    /// A change that waits for its answer.
    pub waits_for: Option<&'static str>,
    /// The last answers, oldest first.
    pub answers: Vec<Answered>,
    /// Share of a recording under way.
    pub recording: Option<f64>,
}

/// What an axis does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisStatus {
    /// At rest, rising, running, falling.
    pub mode: Mode,
    /// What stopped it.
    pub fault: Option<Fault>,
    /// The table that runs.
    pub bank: u8,
    /// Samples that came.
    pub samples: u64,
    /// Ticks whose samples did not come.
    pub lost: u64,
    /// Times that the board began to count anew.
    pub restarts: u64,
}

/// What a board said of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answered {
    /// The change.
    pub what: &'static str,
    /// The tick that took it or did not; none where no answer came.
    pub tick: Option<u32>,
    /// Whether it was taken.
    pub accepted: bool,
}

#[derive(Debug)]
struct Board {
    state: Mutex<State>,
    /// Told whenever something has come.
    news: Condvar,
    stream: TcpStream,
}

#[derive(Debug)]
struct State {
    from: String,
    packets: Packets,
    abouts: Vec<About>,
    axes: [Kept; 2],
    foreign_bytes: u64,
    heard: Instant,
    ended: Option<String>,
    /// Whether nobody wants to know any more.
    over: bool,
    changes: VecDeque<Addressed>,
    waiting: Option<Waiting>,
    answers: VecDeque<Answered>,
    taking: Option<(Taking, f64)>,
    recorded: Option<Result<Vec<Capture>, BoardError>>,
}

/// A change that was asked for.
#[derive(Debug)]
struct Waiting {
    change: Addressed,
    /// Samples that had come by then.
    since: u64,
    /// Of each axis.
    answers: [Option<Answer>; 2],
}

impl Live {
    /// Connects to a server of a board's telemetry, `HOST:PORT`, and listens.
    ///
    /// # Errors
    /// Nobody there; a file, which takes no orders.
    pub fn open(from: &str) -> Result<Self, BoardError> {
        let (chunks, stream) = open(from)?;
        let stream = stream.ok_or_else(|| BoardError::NotAsked(from.to_owned()))?;
        // A board that reads nothing must not hold up whoever asks it to stop.
        stream.set_write_timeout(Some(PATIENCE)).map_err(failed(from))?;
        let state = State::new(from);
        let board = Arc::new(Board {
            state: Mutex::new(state),
            news: Condvar::new(),
            stream,
        });
        let listening = Arc::clone(&board);
        std::thread::spawn(move || {
            loop {
                let came = chunks.recv_timeout(LOOK);
                let mut state = listening.state();
                match came {
                    Ok(Ok(bytes)) => state.take(&bytes, &listening.stream),
                    Ok(Err(error)) => state.end(&format!("the connection broke: {error}")),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => state.end("the other side closed the connection"),
                }
                listening.news.notify_all();
                if state.over || state.ended.is_some() {
                    return;
                }
            }
        });
        Ok(Self {
            from: from.to_owned(),
            board,
        })
    }

    /// Where it listens.
    pub fn from(&self) -> &str {
        &self.from
    }

    /// What is known at this moment.
    pub fn status(&self) -> Status {
        self.board.state().status()
    }

    /// Waits until something holds, the connection is over or `patience` has passed; what is known then.
    pub fn wait(&self, patience: Duration, holds: impl Fn(&Status) -> bool) -> Status {
        let waits = |state: &mut State| state.ended.is_none() && !holds(&state.status());
        let waited = self.board.news.wait_timeout_while(self.board.state(), patience, waits);
        waited.unwrap_or_else(PoisonError::into_inner).0.status()
    }

    /// The last ticks of an axis, or those about a trigger; none of an axis that has not been heard.
    pub fn scope(&self, axis: usize, window: &Window) -> Option<Scope> {
        let state = self.board.state();
        let about = state.abouts.iter().find(|about| usize::from(about.axis) == axis)?;
        state.axes.get(axis)?.scope(about, window)
    }

    /// Asks for something. A change is answered by the board; see [`Status::answers`].
    ///
    /// # Errors
    /// A connection that is over, a change before the board has described itself or while a recording is under way, a wish that its
    /// tables do not allow.
    pub fn ask(&self, ask: Ask<'_>) -> Result<(), BoardError> {
        let mut state = self.board.state();
        if let Some(ended) = &state.ended {
            return Err(BoardError::Over(ended.clone()));
        }
        let order = match ask {
            Ask::Stop => Order::Stop,
            Ask::Start => Order::Start,
            Ask::Clear => Order::Clear,
            _ if state.taking.is_some() => return Err(BoardError::Taking),
            Ask::Gains(axis, [proportional_v_per_um, integral_v_per_um_s]) => {
                let gains = Change::Gains {
                    proportional_v_per_um,
                    integral_v_per_um_s,
                };
                state.changes.push_back((axis, gains));
                return state.ask_next(&self.board.stream);
            }
            Ask::Play(wishes) => {
                let wanted = changes(wishes, &state.tables().ok_or(BoardError::Undescribed)?)?;
                state.changes.extend(wanted);
                return state.ask_next(&self.board.stream);
            }
        };
        if matches!(ask, Ask::Stop) {
            // What has not begun shall not begin after it; what was recorded until now is the recording.
            state.changes.clear();
            state.finish(&self.board.stream);
        }
        send(&self.board.stream, order).map_err(failed(&self.from))
    }

    /// Records so many seconds of the board's time; with wishes it is changed before. The loop is started, and stopped at the end.
    ///
    /// # Errors
    /// As [`Self::ask`]; a length that makes no sense.
    pub fn record(&self, seconds: f64, wishes: &[Option<Wish>]) -> Result<(), BoardError> {
        crate::within("seconds", seconds, 1e-3, LONGEST_S)?;
        let mut state = self.board.state();
        if let Some(ended) = &state.ended {
            return Err(BoardError::Over(ended.clone()));
        }
        if state.taking.is_some() || state.waiting.is_some() {
            return Err(BoardError::Taking);
        }
        // What its tables do not allow is said now.
        changes(wishes, &state.tables().ok_or(BoardError::Undescribed)?)?;
        let mut taking = Taking::new(seconds, Run::Waiting(wishes.to_vec()));
        // The board describes itself every 0.16 s; what it has said already need not be waited for.
        let described: Vec<u8> = state.abouts.iter().flat_map(About::to_packet).collect();
        let stream = &self.board.stream;
        taking.take(&described, &mut |order| send(stream, order).map_err(failed(&self.from)))?;
        state.recorded = None;
        state.taking = Some((taking, 0.0));
        Ok(())
    }

    /// What was recorded, an axis each, once it has ended.
    pub fn recorded(&self) -> Option<Result<Vec<Capture>, BoardError>> {
        self.board.state().recorded.take()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.board.state().over = true;
        // The other side may be gone already.
        let _ = send(&self.board.stream, Order::Stop);
        let _ = self.board.stream.shutdown(Shutdown::Write);
    }
}

impl Board {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn send(mut stream: &TcpStream, order: Order) -> std::io::Result<()> {
    stream.write_all(&order_packet(order))
}

impl State {
    fn new(from: &str) -> Self {
        Self {
            from: from.to_owned(),
            packets: Packets::default(),
            abouts: Vec::new(),
            axes: [Kept::default(), Kept::default()],
            foreign_bytes: 0,
            heard: Instant::now(),
            ended: None,
            over: false,
            changes: VecDeque::new(),
            waiting: None,
            answers: VecDeque::new(),
            taking: None,
            recorded: None,
        }
    }

    /// The tables of every axis, once the board has described each.
    fn tables(&self) -> Option<Vec<Vec<Hello>>> {
        let first = self.abouts.first()?.hello;
        let of_axis = |axis: u8| {
            let abouts = self.abouts.iter().filter(|about| about.axis == axis);
            let mut tables: Vec<Hello> = abouts.map(|about| about.hello).collect();
            tables.sort_by_key(|hello| hello.bank);
            (tables.len() >= usize::from(tables.first()?.banks)).then_some(tables)
        };
        (0..first.axes).map(of_axis).collect()
    }

    fn rate_hz(&self) -> Option<f64> {
        Some(f64::from(self.abouts.first()?.hello.sample_rate_hz))
    }

    fn status(&self) -> Status {
        let heard = self.axes.iter().filter_map(Kept::status);
        Status {
            name: self
                .abouts
                .first()
                .map_or(String::new(), |about| about.board().to_owned()),
            tables: self.tables().unwrap_or_default(),
            rate_hz: self.rate_hz(),
            axes: heard.collect(),
            foreign_bytes: self.foreign_bytes,
            silent_s: self.heard.elapsed().as_secs_f64(),
            ended: self.ended.clone(),
            waits_for: self.waiting.as_ref().map(|waiting| waiting.change.1.name()),
            answers: self.answers.iter().copied().collect(),
            recording: self.taking.as_ref().map(|(_, share)| *share),
        }
    }

    /// Takes more of the stream.
    fn take(&mut self, bytes: &[u8], stream: &TcpStream) {
        self.heard = Instant::now();
        let mut packets = std::mem::take(&mut self.packets);
        packets.split(bytes, false, &mut |found| match found {
            Some(Found::Sample(sample)) => {
                let axis = usize::from(sample.axis);
                if let Some(kept) = self.axes.get_mut(axis) {
                    kept.push(sample);
                }
                let answers = self.waiting.as_mut().and_then(|waiting| waiting.answers.get_mut(axis));
                if let Some(place) = answers {
                    *place = place.or(Answer::of(&sample));
                }
            }
            Some(Found::About(about)) => self.describe(about),
            Some(_) => {}
            None => self.foreign_bytes += 1,
        });
        self.packets = packets;
        self.heed_answers();
        if let Err(error) = self.ask_next(stream) {
            self.end(&error.to_string());
        }
        if let Some((taking, share)) = &mut self.taking {
            let from = &self.from;
            let taken = taking.take(bytes, &mut |order| send(stream, order).map_err(failed(from)));
            match taken {
                Ok(done) => {
                    *share = done;
                    if done >= 1.0 {
                        self.finish(stream);
                    }
                }
                Err(error) => {
                    self.taking = None;
                    self.recorded = Some(Err(error));
                    // The loop may run already.
                    let _ = send(stream, Order::Stop);
                }
            }
        }
    }

    /// A table of the board: another one in its place where it was started anew with it.
    fn describe(&mut self, about: About) {
        let same = |known: &&mut About| known.axis == about.axis && known.hello.bank == about.hello.bank;
        match self.abouts.iter_mut().find(same) {
            Some(known) => *known = about,
            None => self.abouts.push(about),
        }
    }

    /// What the board said of the change that waits, if it has said it.
    fn heed_answers(&mut self) {
        let Some(waiting) = &self.waiting else {
            return;
        };
        let axes = usize::from(self.abouts.first().map_or(1, |about| about.hello.axes)).clamp(1, 2);
        let asked = match usize::from(waiting.change.0) {
            0 => &waiting.answers[..axes],
            number => waiting.answers.get(number - 1..number).unwrap_or_default(),
        };
        let what = waiting.change.1.name();
        let waited_s = (self.axes[0].samples() - waiting.since) as f64 / self.rate_hz().unwrap_or(f64::NAN);
        let refused = asked.iter().flatten().find(|answer| !answer.accepted);
        let all = asked.iter().all(Option::is_some);
        let answered = match (refused, asked.iter().flatten().next()) {
            (Some(refused), _) => Answered {
                what,
                tick: Some(refused.tick),
                accepted: false,
            },
            (None, Some(first)) if all => Answered {
                what,
                tick: Some(first.tick),
                accepted: true,
            },
            _ if waited_s > LONGEST_ANSWER_S => Answered {
                what,
                tick: None,
                accepted: false,
            },
            _ => return,
        };
        self.waiting = None;
        if !answered.accepted {
            // What was to follow was meant with it.
            self.changes.clear();
        }
        self.answers.push_back(answered);
        while self.answers.len() > ANSWERS {
            self.answers.pop_front();
        }
    }

    /// Asks for the next change, where none waits for its answer.
    fn ask_next(&mut self, stream: &TcpStream) -> Result<(), BoardError> {
        if self.waiting.is_some() {
            return Ok(());
        }
        let Some(change) = self.changes.pop_front() else {
            return Ok(());
        };
        let axes = self.abouts.first().map_or(1, |about| usize::from(about.hello.axes));
        for order in orders(change, axes) {
            send(stream, order).map_err(failed(&self.from))?;
        }
        self.waiting = Some(Waiting {
            change,
            since: self.axes[0].samples(),
            answers: [None; 2],
        });
        Ok(())
    }

    /// Ends a recording, and the loop.
    fn finish(&mut self, stream: &TcpStream) {
        if let Some((taking, _)) = self.taking.take() {
            self.recorded = Some(taking.finish());
            // The other side may be gone already.
            let _ = send(stream, Order::Stop);
        }
    }

    /// The connection is over; what was recorded until then stays.
    fn end(&mut self, why: &str) {
        if self.ended.is_none() {
            self.ended = Some(why.to_owned());
        }
        if let Some((taking, _)) = self.taking.take() {
            self.recorded = Some(taking.finish());
        }
        if let Some(waiting) = self.waiting.take() {
            self.answers.push_back(Answered {
                what: waiting.change.1.name(),
                tick: None,
                accepted: false,
            });
        }
    }
}
