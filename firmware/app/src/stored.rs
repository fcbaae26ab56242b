//! Tables in the slots of a board's flash: which one a start takes, and what an upload leaves. One axis.

use crate::parameters::Parameters;
use crate::table;
use crate::upload::{Answer, Message, Said, Upload};
use crate::wire::Hello;
use embedded_storage::nor_flash::NorFlash;
use hysteron_core::error::ParamError;
use hysteron_slot::{Header, Image, Numbers, Refusal, Rule, SLOTS, Slots, Sweep, Verdict, check, most_bytes};

/// What a table must have in common with the compiled-in one.
pub const IMAGE: Image = Image::of(&table::TABLE);
/// Longest table of this image in a slot, up to a flash's largest word.
pub const TABLE_BYTES: usize = most_bytes(table::PLAYS, table::COMPLETE);

/// The checks of this image, in it once.
#[cold]
#[inline(never)]
fn checked(bytes: &[u8], table: &mut Numbers<{ table::PLAYS }>) -> Result<(Header, Sweep), Refusal<'static>> {
    check(bytes, &IMAGE, table)
}

/// The parameters of a table that has passed, into their place: a law is too long for main's stack to have it twice.
fn made(
    table: &Numbers<{ table::PLAYS }>,
    sweep: &Sweep,
    place: &mut Parameters<table::Law>,
) -> Result<(), ParamError> {
    let around = Parameters::of((), table, sweep)?;
    law_made(table, sweep, &mut place.law)?;
    place.set_around(&around);
    Ok(())
}

#[cold]
#[inline(never)]
fn law_made(table: &Numbers<{ table::PLAYS }>, sweep: &Sweep, place: &mut table::Law) -> Result<(), ParamError> {
    table::put_law(table, sweep, place)
}

/// What main holds of the slots: outside of the interrupt, which knows nothing of them.
#[derive(Debug)]
pub struct Stored<F> {
    slots: Slots<F>,
    upload: Upload<TABLE_BYTES>,
    /// The table that was looked at last: here, or main's stack had to have room for it.
    table: Numbers<{ table::PLAYS }>,
    /// Of the last start.
    verdicts: [Verdict; SLOTS],
    /// Where an upload goes.
    spare: usize,
    last: Option<u32>,
    /// What became of the upload, for a host that has not heard it.
    taken: Option<(usize, u32)>,
}

/// What a board does for an upload.
pub trait Pause {
    /// Whether every output is at its safe level, and nothing runs.
    fn at_rest(&self) -> bool;
    /// Stops the sample clock, and gives the watchdog the time that a flash takes.
    fn stop(&mut self);
    /// The sample clock again.
    fn go_on(&mut self);
}

/// What main is to do after a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// Say this.
    Say(Answer<'static>),
    /// Say what each slot holds.
    SaySlots,
    /// Say this, then start anew.
    Restart(Answer<'static>),
}

impl<F: NorFlash> Stored<F> {
    /// Of a board's two slots.
    pub const fn new(slots: Slots<F>) -> Self {
        Self {
            slots,
            upload: Upload::new(),
            table: Numbers::empty(IMAGE.family, 0),
            verdicts: [Err(Refusal::new(Rule::Erased, "slot", 0.0)); SLOTS],
            spare: 0,
            last: None,
            taken: None,
        }
    }

    /// Puts the table that this start runs with into its place and says what there is to say of it, where it is none of the compiled-in
    /// ones; see [`Slots::choose`] for the rest.
    #[cold]
    #[inline(never)]
    pub fn choose(
        &mut self,
        place: &mut Parameters<table::Law>,
        trapped: Option<usize>,
        reading: &mut impl FnMut(Option<usize>),
    ) -> Option<Hello> {
        let (slots, table) = (&mut self.slots, &mut self.table);
        let mut take = |bytes: &[u8]| {
            let (_, sweep) = checked(bytes, table)?;
            made(table, &sweep, place).map_err(|error| Refusal::of_core("", error))
        };
        let chosen = slots.choose(&mut take, self.upload.room(), trapped, reading);
        self.verdicts = chosen.verdicts;
        self.last = chosen.last;
        self.spare = chosen.spare;
        let (_, header) = chosen.found?;
        Some(Hello::of(&self.table, header.hash, table::BANK, table::BANKS))
    }

    /// The flash itself, for whoever holds it.
    pub fn flash(&mut self) -> &mut F {
        self.slots.flash()
    }

    /// What the last start found in each slot.
    pub fn answers(&self) -> [Answer<'static>; SLOTS] {
        let mut slot = 0;
        self.verdicts.map(|verdict| {
            let answer = Answer {
                to: Said::Slot(slot),
                number: verdict.unwrap_or(0),
                refused: verdict.err(),
            };
            slot += 1;
            answer
        })
    }

    /// Does what the host asks for. Flash is written at the safe level alone, with the sample clock stopped: the interrupt never waits for
    /// it. The table in use stays; the new one is in force after the next start.
    #[cold]
    pub fn take(&mut self, message: Message, board: &mut impl Pause) -> Next {
        let due = |said: Result<u32, Refusal<'static>>| Answer {
            to: Said::Due,
            number: said.unwrap_or(0),
            refused: said.err(),
        };
        match message {
            Message::Ask => Next::SaySlots,
            Message::Begin { length, sum } => {
                self.taken = None;
                Next::Say(due(self.upload.begin(length, sum)))
            }
            Message::Piece { place, bytes } => Next::Say(due(Ok(self.upload.piece(place, &bytes)))),
            Message::Commit => {
                let said = self.commit(board);
                Next::Say(Answer {
                    to: Said::Taken(said.map_or(0, |(slot, _)| slot as u8)),
                    number: said.map_or(0, |(_, sequence)| sequence),
                    refused: said.err(),
                })
            }
            Message::Restart => {
                let running = (!board.at_rest()).then_some(Refusal::new(Rule::Running, "mode", 1.0));
                let answer = Answer {
                    to: Said::Restarting,
                    number: 0,
                    refused: running,
                };
                match running {
                    None => Next::Restart(answer),
                    Some(_) => Next::Say(answer),
                }
            }
        }
    }

    /// The table in the buffer, by every check of a start, to the slot that is not in use.
    fn commit(&mut self, board: &mut impl Pause) -> Result<(usize, u32), Refusal<'static>> {
        if let Some(taken) = self.taken {
            return Ok(taken);
        }
        let bytes = self.upload.whole()?;
        checked(bytes, &mut self.table)?;
        if !board.at_rest() {
            return Err(Refusal::new(Rule::Running, "mode", 1.0));
        }
        board.stop();
        let written = self.slots.write(bytes, self.spare, self.last);
        board.go_on();
        let taken = (self.spare, written?);
        self.last = Some(taken.1);
        self.taken = Some(taken);
        Ok(taken)
    }
}
