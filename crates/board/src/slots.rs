//! Tables for the slots of a board's flash: packed, sent in pieces, and what the board says.

use crate::BoardError;
use crate::capture::{Chunk, failed, open};
use hysteron_firmware::telemetry::{Found, find};
use hysteron_firmware::upload::{Answer, Message, PIECE_BYTES, Said};
use hysteron_slot::{MOST_BYTES, MOST_PLAYS, encode, sum};
use hysteron_table::{Table, TableError, hash};
use std::io::Write;
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Longest wait for the answer to a piece before it is sent again: a debug probe polls ten times a second.
const ANSWER: Duration = Duration::from_secs(1);
/// How often a piece is sent.
const TRIES: usize = 5;
/// Longest wait for the verdict: erasing a sector of the STM32H743 takes up to 4 s (DS12110, "Flash memory programming").
const VERDICT: Duration = Duration::from_secs(10);
/// Longest wait for a board that has been started anew.
const RESTART: Duration = Duration::from_secs(10);

/// A table as a slot holds it, with the hash of its file.
///
/// # Errors
/// As [`Table::check`].
pub fn packed(table: &Table, text: &str) -> Result<Vec<u8>, TableError> {
    table.check()?;
    let mut bytes = vec![0; MOST_BYTES];
    let length = encode(&table.numbers::<MOST_PLAYS>(), &hash(text), &mut bytes)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// What a board says of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// What its last start found in each slot, a line each.
    pub slots: [String; 2],
    /// The slot and the sequence that the table got, or why it got none.
    pub taken: Result<(u8, u32), Refused>,
    /// Whether the board, started anew, has said that it runs with this table; none where it was not asked to.
    pub runs: Option<bool>,
}

/// Why a board refuses.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} = {value}: {reason}")]
pub struct Refused {
    /// The field.
    pub field: String,
    /// Its value.
    pub value: String,
    /// What is allowed, and what to do.
    pub reason: String,
}

/// Sends a packed table to a board, piece by piece, and asks it to start anew where `restart` says so and the table was taken.
///
/// # Errors
/// Nobody there, somebody who takes no orders, a board that does not answer. Whatever fails, the board keeps the table that it has.
pub fn upload(to: &str, table: &[u8], restart: bool, progress: &mut dyn FnMut(f64)) -> Result<Verdict, BoardError> {
    let (chunks, asked) = open(to)?;
    let asked = asked.ok_or_else(|| BoardError::NotAsked(to.to_owned()))?;
    let mut link = Link::new(to, chunks, asked);
    let slots = link.slots()?;
    let taken = send(&mut link, table, progress)?;
    let runs = match (&taken, restart) {
        (Ok(_), true) => Some(link.restart(table)?),
        _ => None,
    };
    Ok(Verdict { slots, taken, runs })
}

fn send(
    link: &mut Link,
    table: &[u8],
    progress: &mut dyn FnMut(f64),
) -> Result<Result<(u8, u32), Refused>, BoardError> {
    let begin = Message::Begin {
        length: table.len() as u32,
        sum: sum(table),
    };
    let due = |said: Heard| (said.to == Said::Due).then_some(said);
    let begun = link.ask(&begin, "the beginning of a table", ANSWER, &mut |said| {
        due(said).filter(|said| said.number == 0)
    })?;
    if let Some(refused) = begun.refused {
        return Ok(Err(refused));
    }
    for (place, piece) in (0_u32..).step_by(PIECE_BYTES).zip(table.chunks(PIECE_BYTES)) {
        let mut bytes = [0; PIECE_BYTES];
        bytes[..piece.len()].copy_from_slice(piece);
        let next = place + piece.len() as u32;
        // The answer to an earlier copy of a piece says an earlier place.
        link.ask(
            &Message::Piece { place, bytes },
            "a piece of a table",
            ANSWER,
            &mut |said| due(said).filter(|said| said.number == next),
        )?;
        progress(f64::from(next) / table.len() as f64);
    }
    let said = link.ask(&Message::Commit, "the whole table", VERDICT, &mut |said| {
        matches!(said.to, Said::Taken(_)).then_some(said)
    })?;
    Ok(match (said.to, said.refused) {
        (Said::Taken(slot), None) => Ok((slot, said.number)),
        (_, refused) => Err(refused.unwrap_or_else(|| Refused {
            field: "table".to_owned(),
            value: "whole".to_owned(),
            reason: "the board gave no reason".to_owned(),
        })),
    })
}

/// An answer, in its words.
struct Heard {
    to: Said,
    number: u32,
    refused: Option<Refused>,
    line: String,
}

impl Heard {
    fn of(answer: &Answer<'_>) -> Self {
        Self {
            to: answer.to,
            number: answer.number,
            refused: answer.refused.map(|refused| Refused {
                field: refused.field().to_string(),
                value: refused.value().to_string(),
                reason: refused.reason().to_string(),
            }),
            line: answer.to_string(),
        }
    }
}

/// A connection to a board that sends all the time.
struct Link {
    to: String,
    chunks: Receiver<Chunk>,
    asked: TcpStream,
    rest: Vec<u8>,
}

/// What of a stream is of interest here.
enum Packet {
    Answer(Heard),
    /// The hash of the first bank's table.
    Table([u8; 32]),
}

impl Link {
    fn new(to: &str, chunks: Receiver<Chunk>, asked: TcpStream) -> Self {
        Self {
            to: to.to_owned(),
            chunks,
            asked,
            rest: Vec::new(),
        }
    }

    fn not_heard(&self, what: &'static str) -> BoardError {
        BoardError::NotHeard {
            to: self.to.clone(),
            what,
        }
    }

    /// The next packet of interest until a time; none where there was none.
    fn next(&mut self, until: Instant) -> Result<Option<Packet>, BoardError> {
        loop {
            if let Some(packet) = self.take() {
                return Ok(Some(packet));
            }
            let left = until.saturating_duration_since(Instant::now());
            match self.chunks.recv_timeout(left) {
                Ok(Ok(chunk)) => self.rest.extend(chunk),
                Ok(Err(source)) => return Err(failed(&self.to)(source)),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return Ok(None),
            }
        }
    }

    /// The first packet of interest in what has come; what is before it is done with.
    fn take(&mut self) -> Option<Packet> {
        let mut at = 0;
        let mut found = None;
        while found.is_none() && at < self.rest.len() {
            let bytes = &self.rest[at..];
            let here = find(bytes);
            match here {
                Found::Incomplete => break,
                Found::Answer => {
                    let answer = bytes.first_chunk().and_then(Answer::from_packet);
                    found = answer.map(|answer| Packet::Answer(Heard::of(&answer)));
                }
                Found::About(about) => {
                    found = (about.hello.bank == 0).then_some(Packet::Table(about.hello.hash));
                }
                Found::Sample(_) | Found::Order(_) | Found::SamplesTo(_) | Found::Nothing => {}
            }
            at += here.length();
        }
        self.rest.drain(..at);
        found
    }

    /// Sends a message until it is answered in a way that `answers`.
    fn ask(
        &mut self,
        message: &Message,
        what: &'static str,
        patience: Duration,
        answers: &mut dyn FnMut(Heard) -> Option<Heard>,
    ) -> Result<Heard, BoardError> {
        for _ in 0..TRIES {
            self.asked.write_all(&message.to_packet()).map_err(failed(&self.to))?;
            let until = Instant::now() + patience;
            while let Some(packet) = self.next(until)? {
                if let Packet::Answer(heard) = packet
                    && let Some(answer) = answers(heard)
                {
                    return Ok(answer);
                }
            }
        }
        Err(self.not_heard(what))
    }

    /// What the board's last start found in each slot.
    fn slots(&mut self) -> Result<[String; 2], BoardError> {
        let mut lines = [const { String::new() }; 2];
        self.ask(&Message::Ask, "what is in its slots", ANSWER, &mut |said| {
            if let Said::Slot(slot) = said.to
                && let Some(line) = lines.get_mut(usize::from(slot))
            {
                line.clone_from(&said.line);
            }
            lines.iter().all(|line| !line.is_empty()).then_some(said)
        })?;
        Ok(lines)
    }

    /// Starts it anew; whether it then says that it runs with the table.
    fn restart(&mut self, table: &[u8]) -> Result<bool, BoardError> {
        let said = self.ask(&Message::Restart, "a new start", ANSWER, &mut |said| {
            (said.to == Said::Restarting).then_some(said)
        })?;
        if said.refused.is_some() {
            return Ok(false);
        }
        let wanted = hysteron_slot::Header::read(table, table.len()).map(|header| header.hash);
        let until = Instant::now() + RESTART;
        while let Some(packet) = self.next(until)? {
            if let (Packet::Table(hash), Ok(wanted)) = (packet, &wanted)
                && hash == *wanted
            {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
