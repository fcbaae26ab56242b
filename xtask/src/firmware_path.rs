//! The longest path through the functions of a linked image: what an interrupt can take at most, whatever comes.
//!
//! The disassembly gives every instruction and every way on from it. A loop takes the rounds that its source allows; a loop that is not known is
//! an error. Paths that exclude each other are not known to do so: the longest may be one that nothing takes.

use crate::firmware_listing::{Instruction, Listing, Ways};
use std::collections::{BTreeMap, BTreeSet};

/// Where a loop begins, in the source: function and file of each frame, the innermost first.
pub(crate) type Frames = Vec<(String, String)>;

/// What a path is measured by, and what is known of loops.
pub(crate) struct Measure<'m> {
    /// What an instruction takes.
    pub of: fn(&Instruction) -> u32,
    /// What a way takes in addition that does not lead to the next instruction.
    pub turn: u32,
    /// Parts of the names of functions that are not called.
    pub without: &'m [&'m str],
    /// Functions that copy or clear whole words, and leave what is less than a word to the next.
    pub by_words: &'m [&'m str],
    /// The frames of an address.
    pub frames: &'m dyn Fn(u32) -> Result<Frames, String>,
    /// Rounds that a loop takes at most; `None` where it is not known.
    pub rounds: fn(&Frames) -> Option<Rounds>,
}

/// Rounds of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rounds {
    AtMost(u32),
    /// As many as it takes to multiply so many pairs.
    ToMultiply(u32),
    /// So many, and in one round only of the loop around it.
    InOneRound(u32),
    /// As many as it takes to write the bytes of a copy, all such loops of a function together, and one more of each.
    OfACopy,
}

/// What a function takes at most, all that it calls included.
///
/// # Errors
/// No such function; a way that the listing does not show; a loop or a copy of which it is not known how long it is.
pub(crate) fn longest(listing: &Listing, function: &str, measure: &Measure<'_>) -> Result<u64, String> {
    let at = listing.function(function);
    let at = at.ok_or_else(|| format!("no function {function}"))?;
    Paths {
        listing,
        measure,
        known: BTreeMap::new(),
        in_one_round: Vec::new(),
        of_a_byte: Vec::new(),
    }
    .of_function(at, None)?
    .ok_or_else(|| format!("{function} has no way to its end"))
}

struct Paths<'l> {
    listing: &'l Listing,
    measure: &'l Measure<'l>,
    /// What functions take, with the bytes that they copy; `None` while one is looked at.
    known: BTreeMap<(u32, Option<u32>), Option<Longest>>,
    /// Of the loops that are looked at: whether ways through loops that run in one round only count, and whether there were any.
    in_one_round: Vec<(bool, bool)>,
    /// Of the functions that are looked at: what a byte takes in the dearest of the loops that copy.
    of_a_byte: Vec<f64>,
}

/// What the longest way takes; `None` where each leads to a call that is not made.
type Longest = Option<u64>;

/// The ways inside of a function, and the bytes that it copies.
struct Body<'b> {
    function: u32,
    ways: &'b BTreeMap<u32, Ways>,
    copied: Option<u32>,
}

impl Body<'_> {
    fn on(&self, at: u32) -> &[u32] {
        self.ways.get(&at).map_or(&[], |ways| &ways.on)
    }
}

impl Paths<'_> {
    fn of_function(&mut self, at: u32, copied: Option<u32>) -> Result<Longest, String> {
        let key = (at, copied);
        match self.known.get(&key) {
            Some(Some(known)) => return Ok(*known),
            Some(None) => return Err(format!("{} calls itself", self.listing.name(at))),
            None => {}
        }
        self.known.insert(key, None);
        let ways = self.listing.ways(at)?;
        let body = Body {
            function: at,
            ways: &ways,
            copied,
        };
        let inside = ways.keys().copied().collect();
        self.of_a_byte.push(0.0);
        // The loops that call it are none around its own.
        let around = std::mem::take(&mut self.in_one_round);
        let longest = self.through(&body, &inside, at, false)?;
        self.in_one_round = around;
        let copies = self.of_a_byte.pop().unwrap_or(0.0) * f64::from(copied.unwrap_or(0));
        let longest = longest.map(|longest| longest + copies.ceil() as u64);
        self.known.insert(key, Some(longest));
        Ok(longest)
    }

    /// The longest way from an entry through some instructions, to where it leaves them; `again` where ways back to the entry are those of
    /// the next round.
    fn through(&mut self, body: &Body<'_>, inside: &BTreeSet<u32>, entry: u32, again: bool) -> Result<Longest, String> {
        let stays = |to: u32| inside.contains(&to) && !(again && to == entry);
        let on = |at: u32| -> Vec<u32> { body.on(at).iter().copied().filter(|&to| stays(to)).collect() };
        // From each instruction of a component to the end; what a component leads to comes before it.
        let mut longest: BTreeMap<u32, Longest> = BTreeMap::new();
        for component in components(inside, entry, &on) {
            let alone = component
                .iter()
                .next()
                .filter(|at| component.len() == 1 && !on(**at).contains(at));
            let own = match alone {
                Some(&alone) => self.of_instruction(body, alone)?,
                None => self.of_loop(body, inside, &component, entry)?,
            };
            let mut after: Longest = None;
            for &at in &component {
                let ways = body.on(at);
                for &to in ways.iter().filter(|to| !component.contains(to) || !stays(**to)) {
                    let there = if stays(to) {
                        longest.get(&to).copied().flatten()
                    } else {
                        Some(0)
                    };
                    let turn = if self.listing.follows(at, to) {
                        0
                    } else {
                        self.measure.turn
                    };
                    after = after.max(there.map(|there| there + u64::from(turn)));
                }
                if body.ways.get(&at).is_some_and(|ways| ways.ends) {
                    after = after.max(Some(0));
                }
            }
            let whole = own.zip(after).map(|(own, after)| own + after);
            longest.extend(component.iter().map(|&at| (at, whole)));
        }
        Ok(longest.get(&entry).copied().flatten())
    }

    fn of_instruction(&mut self, body: &Body<'_>, at: u32) -> Result<Longest, String> {
        let listing = self.listing;
        let own = listing.instruction(at).map_or(0, self.measure.of);
        let ways = body.ways.get(&at);
        let Some((ways, to)) = ways.and_then(|ways| Some((ways, ways.call?))) else {
            return Ok(Some(own.into()));
        };
        let name = listing.name(to);
        if self.measure.without.iter().any(|part| name.contains(part)) {
            // What may end with the call may go on without it.
            let goes_on = ways.ends && !ways.on.is_empty();
            return Ok(goes_on.then_some(own.into()));
        }
        let by_words = self.measure.by_words.contains(&listing.name(body.function));
        let length = if name.contains("clr") { "r1" } else { "r2" };
        let copied = ["mem", "clr"]
            .iter()
            .any(|word| name.contains(word))
            .then(|| body.copied.or_else(|| self.constant(body, at, length)))
            .flatten()
            .map(|bytes| if by_words { bytes.min(3) } else { bytes });
        let called = self.of_function(to, copied)?;
        // There and, by what ends it, back.
        Ok(called.map(|called| called + u64::from(own + self.measure.turn)))
    }

    /// The constant that a register holds at an instruction, where no way leads past the instruction that sets it.
    fn constant(&self, body: &Body<'_>, at: u32, register: &str) -> Option<u32> {
        let (from, set) = self
            .listing
            .before(at)
            .find(|(_, instruction)| instruction.changes(register))?;
        let between = |to: &&u32| **to > from && **to <= at;
        let mut others = body.ways.iter().filter(|(place, _)| **place < from || **place > at);
        if others.any(|(_, ways)| ways.on.iter().any(|to| between(&to))) || !body.ways.contains_key(&from) {
            return None;
        }
        if !matches!(set.name.as_str(), "movs" | "mov" | "movw") {
            return None;
        }
        set.operands.split('#').nth(1)?.split_whitespace().next()?.parse().ok()
    }

    fn of_loop(
        &mut self,
        body: &Body<'_>,
        inside: &BTreeSet<u32>,
        component: &BTreeSet<u32>,
        entry: u32,
    ) -> Result<Longest, String> {
        let from_outside = |at: &&u32| {
            let mut others = inside.difference(component);
            **at == entry || others.any(|other| body.on(*other).contains(at))
        };
        let entries: Vec<u32> = component.iter().filter(from_outside).copied().collect();
        let [head] = entries[..] else {
            return Err(format!("a loop with several ways in: {entries:x?}"));
        };
        let frames = (self.measure.frames)(head)?;
        let rounds = (self.measure.rounds)(&frames);
        let rounds = rounds.ok_or_else(|| format!("an unknown loop at {head:x}: {frames:?}"))?;
        if matches!(rounds, Rounds::InOneRound(_))
            && let Some((counts, seen)) = self.in_one_round.last_mut()
        {
            *seen = true;
            if !*counts {
                return Ok(None);
            }
        }
        self.in_one_round.push((true, false));
        let round = self.through(body, component, head, true)?;
        let special = self.in_one_round.pop().is_some_and(|(_, seen)| seen);
        let Some(round) = round else {
            return Ok(None);
        };
        let mut usual = round;
        if special {
            self.in_one_round.push((false, false));
            usual = self.through(body, component, head, true)?.unwrap_or(round);
            self.in_one_round.pop();
        }
        let times = self.times(body, component, (head, round), rounds)?;
        Ok(Some(u64::from(times.saturating_sub(1)) * usual + round))
    }

    /// Rounds of a loop that are counted by what a round does.
    fn times(
        &mut self,
        body: &Body<'_>,
        component: &BTreeSet<u32>,
        (head, round): (u32, u64),
        rounds: Rounds,
    ) -> Result<u32, String> {
        Ok(match rounds {
            Rounds::AtMost(times) | Rounds::InOneRound(times) => times,
            Rounds::ToMultiply(pairs) => {
                let each = self.fewest(body, component, head, |instruction| instruction.multiplies().into());
                pairs.div_ceil(each.max(1)) + 1
            }
            Rounds::OfACopy => {
                let unknown = || format!("a copy of unknown length at {head:x}");
                body.copied.ok_or_else(unknown)?;
                let written = self.fewest(body, component, head, Instruction::written);
                if let Some(of_a_byte) = self.of_a_byte.last_mut() {
                    *of_a_byte = of_a_byte.max(round as f64 / f64::from(written.max(1)));
                }
                1
            }
        })
    }

    /// The least that a round of a loop does, from its head back to it.
    fn fewest(&self, body: &Body<'_>, component: &BTreeSet<u32>, head: u32, does: fn(&Instruction) -> u32) -> u32 {
        let of = |at: u32| self.listing.instruction(at).map_or(0, does);
        let mut open = BTreeSet::from([(of(head), head)]);
        let mut seen = BTreeSet::new();
        while let Some((done, at)) = open.pop_first() {
            if !seen.insert(at) {
                continue;
            }
            if body.on(at).contains(&head) {
                return done;
            }
            let inside = body.on(at).iter().filter(|to| component.contains(to));
            open.extend(inside.map(|&to| (done + of(to), to)));
        }
        0
    }
}

/// Strongly connected components, each after those that it leads to (Tarjan 1972).
fn components(inside: &BTreeSet<u32>, entry: u32, on: &dyn Fn(u32) -> Vec<u32>) -> Vec<BTreeSet<u32>> {
    let mut found = Vec::new();
    let mut numbers: BTreeMap<u32, usize> = BTreeMap::new();
    let mut lowest: BTreeMap<u32, usize> = BTreeMap::new();
    let mut waiting: Vec<u32> = Vec::new();
    for start in std::iter::once(entry).chain(inside.iter().copied()) {
        if numbers.contains_key(&start) {
            continue;
        }
        let mut path = vec![(start, on(start).into_iter())];
        numbers.insert(start, numbers.len());
        lowest.insert(start, numbers.len() - 1);
        waiting.push(start);
        while let Some((at, next)) = path.last_mut() {
            let at = *at;
            match next.next() {
                Some(to) if !numbers.contains_key(&to) => {
                    numbers.insert(to, numbers.len());
                    lowest.insert(to, numbers.len() - 1);
                    waiting.push(to);
                    path.push((to, on(to).into_iter()));
                }
                Some(to) => {
                    if waiting.contains(&to) {
                        let low = lowest[&at].min(numbers[&to]);
                        lowest.insert(at, low);
                    }
                }
                None => {
                    path.pop();
                    if let Some((before, _)) = path.last() {
                        let low = lowest[before].min(lowest[&at]);
                        lowest.insert(*before, low);
                    }
                    if lowest[&at] == numbers[&at] {
                        let from = waiting.iter().position(|waits| *waits == at).unwrap_or(0);
                        found.push(waiting.split_off(from).into_iter().collect());
                    }
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(text: &str, turn: u32, without: &[&str], rounds: fn(&Frames) -> Option<Rounds>) -> Result<u64, String> {
        let frames = |at: u32| Ok(vec![("walk".to_owned(), format!("{at:x}"))]);
        let measure = Measure {
            of: |_| 1,
            turn,
            without,
            by_words: &[],
            frames: &frames,
            rounds,
        };
        super::longest(&Listing::parse(text), "tick", &measure)
    }

    fn longest(text: &str) -> Result<u64, String> {
        measured(text, 0, &[], |frames| match frames[0].1.as_str() {
            "12" => Some(Rounds::AtMost(5)),
            "14" => Some(Rounds::AtMost(3)),
            "42" => Some(Rounds::OfACopy),
            _ => None,
        })
    }

    const TEXT: &str = "
00000010 <tick>:
  10:\tb500      \tpush\t{lr}
  12:\tbf00      \tnop
  14:\tbf00      \tnop
  16:\td1fd      \tbne.n\t14 <tick+0x4>
  18:\td1fb      \tbne.n\t12 <tick+0x2>
  1a:\t2210      \tmovs\tr2, #16
  1c:\tf000 f810 \tbl\t40 <memcpy>
  20:\tb900      \tcbnz\tr0, 24 <tick+0x14>
  22:\tbf00      \tnop
  24:\tbd00      \tpop\t{pc}
00000040 <memcpy>:
  40:\tbf00      \tnop
  42:\t6003      \tstr\tr3, [r0, #0]
  44:\td1fd      \tbne.n\t42 <memcpy+0x2>
  46:\t4770      \tbx\tlr
";

    #[test]
    fn val_loops_in_loops_calls_and_the_longer_way() {
        // 1, five rounds of 1 + 3 * 2 + 1, 2, a copy of 16 bytes (1, five rounds of two, 1), 3.
        assert_eq!(longest(TEXT), Ok(1 + 5 * (1 + 3 * 2 + 1) + 2 + (1 + 5 * 2 + 1) + 3));
        // A way out in the middle is no shorter bound.
        let early = TEXT.replace("  12:\tbf00      \tnop", "  12:\t4770      \tbxeq\tlr");
        assert_eq!(longest(&early), longest(TEXT));
    }

    #[test]
    fn val_ways_that_turn_and_calls_that_are_not_made() {
        let text = "
00000010 <tick>:
  10:\tb108      \tcbz\tr0, 16 <tick+0x6>
  12:\tf000 f805 \tbl\t20 <apply>
  16:\tbd00      \tpop\t{pc}
00000020 <apply>:
  20:\t4770      \tbx\tlr
";
        let of = |turn, without: &[&str]| measured(text, turn, without, |_| None);
        assert_eq!(of(0, &[]), Ok(4));
        // Around the call: a way that turns. Through it: the call does.
        assert_eq!(of(3, &[]), Ok(4 + 3));
        assert_eq!(of(3, &["app"]), Ok(2 + 3));
        // A function that may end with the call may go on without it.
        let at_the_end = text.replace("bl\t20 <apply>", "beq.w\t20 <apply>");
        assert_eq!(of(0, &["app"]), Ok(2));
        assert_eq!(measured(&at_the_end, 0, &["app"], |_| None), Ok(3));
        let always = text.replace("cbz\tr0, 16 <tick+0x6>", "nop");
        assert_eq!(
            measured(&always, 0, &["app"], |_| None),
            Err("tick has no way to its end".to_owned())
        );
    }

    /// Of a loop that runs in one round of another the other rounds go around it; of a loop that multiplies each round takes several pairs.
    #[test]
    fn val_rounds_that_are_not_all_alike() {
        let text = "
00000010 <tick>:
  10:\tb108      \tcbz\tr0, 18 <tick+0x8>
  12:\tbf00      \tnop
  14:\td1fd      \tbne.n\t12 <tick+0x2>
  16:\tbf00      \tnop
  18:\td1fa      \tbne.n\t10 <tick>
  1a:\tee00 0a00 \tvmla.f32\ts0, s0, s0
  1e:\tee00 0a00 \tvmla.f32\ts0, s0, s0
  22:\td1fa      \tbne.n\t1a <tick+0xa>
  24:\t4770      \tbx\tlr
";
        let found = measured(text, 0, &[], |frames| match frames[0].1.as_str() {
            "10" => Some(Rounds::AtMost(10)),
            "12" => Some(Rounds::InOneRound(6)),
            _ => Some(Rounds::ToMultiply(7)),
        });
        // Nine rounds of two, one with six of two in it; four rounds of three and one more.
        assert_eq!(found, Ok(9 * 2 + (1 + 6 * 2 + 1 + 1) + (4 + 1) * 3 + 1));
        // Where a round may go past one of the two, so may each.
        let skipping = text.replace(
            "  1a:\tee00 0a00 \tvmla.f32\ts0, s0, s0",
            "  1a:\tb108      \tcbz\tr0, 22 <tick+0x12>\n  1c:\tbf00      \tnop",
        );
        let found = measured(&skipping, 0, &[], |frames| match frames[0].1.as_str() {
            "10" => Some(Rounds::AtMost(10)),
            "12" => Some(Rounds::InOneRound(6)),
            _ => Some(Rounds::ToMultiply(7)),
        });
        assert_eq!(found, Ok(9 * 2 + (1 + 6 * 2 + 1 + 1) + (7 + 1) * 4 + 1));
    }

    #[test]
    fn val_tables_of_ways() {
        let text = "
00000010 <tick>:
  10:\te8df f000 \ttbb\t[pc, r0]
  14:\t0402      \t.short\t0x0402
  16:\t0003      \t.short\t0x0003
  18:\tbf00      \tnop
  1a:\t4770      \tbx\tlr
  1c:\tbf00      \tnop
  1e:\t4770      \tbx\tlr
";
        // 18 and 1c follow the table; what stands behind the nearest target is no part of it.
        assert_eq!(longest(text), Ok(3));
        let far = text.replace("0402      \t.short\t0x0402", "0204      \t.short\t0x0204");
        assert_eq!(longest(&far), Ok(3));
    }

    #[test]
    fn refuse_what_has_no_bound() {
        let refused = |from: &str, to: &str| longest(&TEXT.replace(from, to)).unwrap_err();
        assert!(refused("bne.n\t12 <tick+0x2>", "bne.n\t10 <tick>").starts_with("an unknown loop at 10"));
        assert!(refused("movs\tr2, #16", "mov\tr2, r4").starts_with("a copy of unknown length"));
        assert!(refused("movs\tr2, #16", "ldmia\tr4, {r1, r2}").starts_with("a copy of unknown length"));
        assert!(refused("bl\t40 <memcpy>", "bl\t10 <tick>").starts_with("tick calls itself"));
        assert!(refused("bl\t40 <memcpy>", "blx\tr3").starts_with("tick: a way that a register gives"));
        assert!(refused("18:\td1fb      \tbne.n\t12", "18:\td1fb      \tbne.n\t30").contains("nothing at 30"));
        assert_eq!(
            longest(&TEXT.replace("<tick>:", "<other>:")),
            Err("no function tick".to_owned())
        );
    }
}
