//! The processor model as a process of its own: lines there, lines back.

use hysteron_converters::ad5683r::WORD_BITS;
use hysteron_firmware::wire::{Input, Order};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Whatever stops a run.
pub(crate) type Failure = Box<dyn std::error::Error + Send + Sync>;

/// What the chip is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    /// Main on its way from the reset to the loop.
    Starting,
    /// The timer triggers conversions, and their end interrupts.
    Looping,
    /// The watchdog has not been fed in time.
    Bitten,
}

/// What the last reset came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reset {
    /// The chip's power came.
    Power,
    /// The supply fell below the brown-out level and came back.
    BrownOut,
    /// The watchdog.
    Watchdog,
    /// The reset button.
    Pin,
}

/// What the outside gives to the chip, or keeps from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Line {
    /// The button's contact.
    Button,
    /// The supply is below its detector's level.
    LowSupply,
    /// The cycle counter stays locked at the next reset.
    CounterLocked,
    /// No PLL comes to its frequency.
    NoPll,
    /// The clock from outside is absent.
    NoOuterClock,
    /// The converter's calibration does not end.
    NoAdc,
    /// The answers of the outputs' converters are not connected.
    NoSdo,
    /// The wire of LDAC is off, which is pulled low at the converters.
    NoLdac,
    /// The chip that drives the cable gives no clock.
    NoCable,
}

/// What hangs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hang {
    /// Main, in a branch to itself.
    Main,
    /// The interrupt, likewise.
    Interrupt,
    /// Main jumps to where no memory is: a hard fault, above the interrupt.
    Fault,
}

/// A code that a converter of the output was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Word {
    /// Whose.
    pub(crate) axis: usize,
    /// Which.
    pub(crate) code: u16,
}

/// An output that has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Change {
    /// Whose.
    pub(crate) axis: usize,
    /// To which code.
    pub(crate) code: u16,
    /// When, processor cycles.
    pub(crate) cycles: u64,
}

/// What is to be seen from outside after some time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Seen {
    /// Now, processor cycles since the process began.
    pub(crate) cycles: u64,
    /// What the chip is at.
    pub(crate) state: State,
    /// The fault's pin.
    pub(crate) fault_pin: bool,
    /// Memory was read that had never been written since power came.
    pub(crate) unwritten_read: bool,
    /// Something else than the reset's cause was touched before the watchdog ran.
    pub(crate) unguarded: bool,
    /// What went over the bus meanwhile.
    pub(crate) words: Vec<Word>,
    /// What the outputs did.
    pub(crate) changes: Vec<Change>,
}

/// A period of the loop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Period {
    /// What waited for the interrupt.
    pub(crate) order: Order,
    /// Main's rounds before it.
    pub(crate) rounds: u32,
    /// What came of it.
    pub(crate) seen: Seen,
}

/// Top bits of a word: write the input register, and the output with it.
const SET: [u32; 2] = [0b0001, 0b0011];

/// The process; it ends with this.
pub(crate) struct Processor {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Processor {
    /// Starts a board with an image in its flash.
    pub(crate) fn start(interpreter: &str, image: &Path, board: &str, table: Option<&Path>) -> Result<Self, Failure> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/starts/processor.py");
        let mut child = Command::new(interpreter)
            .arg(script)
            .arg(image)
            .arg(board)
            .args(table)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start {interpreter}: {error}"))?;
        let (Some(to), Some(from)) = (child.stdin.take(), child.stdout.take()) else {
            return Err("the processor model has no pipes".into());
        };
        Ok(Self {
            child,
            to,
            from: BufReader::new(from),
        })
    }

    fn ask(&mut self, line: &str) -> Result<String, Failure> {
        writeln!(self.to, "{line}")?;
        let mut answer = String::new();
        if self.from.read_line(&mut answer)? == 0 {
            return Err(format!("the processor model ended at `{line}`; its reason stands above").into());
        }
        Ok(answer.trim_end().to_owned())
    }

    fn obey(&mut self, line: &str) -> Result<(), Failure> {
        match self.ask(line)?.as_str() {
            "ok" => Ok(()),
            other => Err(format!("the processor model answered `{line}` with `{other}`").into()),
        }
    }

    /// Resets the chip; memory stays where power does.
    pub(crate) fn reset(&mut self, cause: Reset) -> Result<(), Failure> {
        let cause = match cause {
            Reset::Power => "power",
            Reset::BrownOut => "brown-out",
            Reset::Watchdog => "watchdog",
            Reset::Pin => "pin",
        };
        self.obey(&format!("reset {cause}"))
    }

    /// Sets a line.
    pub(crate) fn set(&mut self, line: Line, on: bool) -> Result<(), Failure> {
        let line = match line {
            Line::Button => "button",
            Line::LowSupply => "low",
            Line::CounterLocked => "dwt-locked",
            Line::NoPll => "no-pll",
            Line::NoOuterClock => "no-outer",
            Line::NoAdc => "no-adc",
            Line::NoSdo => "no-sdo",
            Line::NoLdac => "no-ldac",
            Line::NoCable => "no-cable",
        };
        self.obey(&format!("input {line} {}", u8::from(on)))
    }

    /// The power of the outputs' converters comes anew.
    pub(crate) fn lose_converters(&mut self) -> Result<(), Failure> {
        self.obey("lose")
    }

    /// Lets something hang.
    pub(crate) fn hang(&mut self, what: Hang) -> Result<(), Failure> {
        let what = match what {
            Hang::Main => "main",
            Hang::Interrupt => "interrupt",
            Hang::Fault => "fault",
        };
        self.obey(&format!("hang {what}"))
    }

    /// Main alone for so many instructions; returns earlier where the loop begins.
    pub(crate) fn main(&mut self, instructions: u32) -> Result<Seen, Failure> {
        let answer = self.ask(&format!("main {instructions}"))?;
        seen(&answer)
    }

    /// A period: the sensors' codes where they are converted, the interrupt, and so many instructions of main.
    pub(crate) fn tick(&mut self, codes: &[u16], instructions: u32, late: bool) -> Result<Period, Failure> {
        let mut line = format!("tick {instructions} {}", u8::from(late));
        for code in codes {
            line += &format!(" {code}");
        }
        let answer = self.ask(&line)?;
        let mut words = answer.splitn(3, ' ');
        let mut next = || words.next().ok_or_else(|| senseless(&answer));
        let [number, value] = next()?.parse::<u16>()?.to_be_bytes();
        Ok(Period {
            order: Input::from_bytes([0, 0, number, value]).order,
            rounds: next()?.parse()?,
            seen: seen(next()?)?,
        })
    }

    /// What main has sent since the last look, as a debugger reads it.
    pub(crate) fn telemetry(&mut self) -> Result<Vec<u8>, Failure> {
        let hex = self.ask("telemetry")?;
        bytes(&hex)
    }

    /// Frames that have left by the cable since the last look.
    pub(crate) fn frames(&mut self) -> Result<Vec<Vec<u8>>, Failure> {
        let hex = self.ask("frames")?;
        hex.split_whitespace().map(bytes).collect()
    }

    /// A frame that comes by the cable.
    pub(crate) fn frame(&mut self, frame: &[u8]) -> Result<(), Failure> {
        let hex: String = frame.iter().map(|byte| format!("{byte:02x}")).collect();
        self.obey(&format!("frame {hex}"))
    }

    /// Bytes for main, as a debugger writes them.
    pub(crate) fn orders(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        self.obey(&format!("orders {hex}"))
    }
}

impl Drop for Processor {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn bytes(hex: &str) -> Result<Vec<u8>, Failure> {
    let bytes = hex.as_bytes().chunks(2).map(|two| {
        let text = str::from_utf8(two)?;
        Ok::<_, Failure>(u8::from_str_radix(text, 16)?)
    });
    bytes.collect()
}

fn senseless(answer: &str) -> Failure {
    format!("the processor model answered `{answer}`").into()
}

fn seen(answer: &str) -> Result<Seen, Failure> {
    let mut parts = answer.split_whitespace();
    let mut next = || parts.next().ok_or_else(|| senseless(answer));
    let cycles = next()?.parse()?;
    let state = match next()? {
        "start" => State::Starting,
        "loop" => State::Looping,
        "bitten" => State::Bitten,
        _ => return Err(senseless(answer)),
    };
    let mut flag = || Ok::<_, Failure>(next()? == "1");
    let (fault_pin, unwritten_read, unguarded) = (flag()?, flag()?, flag()?);
    let (words, changes): (Vec<&str>, Vec<&str>) = parts.partition(|part| part.contains(':'));
    Ok(Seen {
        cycles,
        state,
        fault_pin,
        unwritten_read,
        unguarded,
        words: words.into_iter().map(word).collect::<Result<_, _>>()?,
        changes: changes.into_iter().map(change).collect::<Result<_, _>>()?,
    })
}

/// `0:359c50`: axis, the bytes between two edges of its SYNC.
fn word(text: &str) -> Result<Word, Failure> {
    let (axis, hex) = text.split_once(':').ok_or_else(|| senseless(text))?;
    let bits = u32::from_str_radix(hex, 16)?;
    if hex.len() as u32 * 4 != WORD_BITS || !SET.contains(&(bits >> 20)) {
        return Err(format!("axis {axis} was sent {hex}, which is no word that sets an AD5683R").into());
    }
    Ok(Word {
        axis: axis.parse()?,
        code: (bits >> 4) as u16,
    })
}

/// `0=22981@7636400`: axis, code, cycles.
fn change(text: &str) -> Result<Change, Failure> {
    let parts = text
        .split_once('=')
        .and_then(|(axis, rest)| Some((axis, rest.split_once('@')?)));
    let (axis, (code, cycles)) = parts.ok_or_else(|| senseless(text))?;
    Ok(Change {
        axis: axis.parse()?,
        code: code.parse()?,
        cycles: cycles.parse()?,
    })
}
