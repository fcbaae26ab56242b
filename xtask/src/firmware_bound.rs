//! A static bound on the interrupt of each board's image: instructions of its longest path, and cycles where the core's document has them.

use crate::firmware_boards::{Image, images};
use crate::firmware_image::registers;
use crate::firmware_listing::{Instruction, Listing};
use crate::firmware_path::{self, Frames, Measure, Rounds};
use std::fmt::Write;

/// Entering an exception and leaving it, with the floating-point registers: 29 cycles and 27 (Cortex-M4 TRM DDI 0439, section 3.9).
const ENTRY_AND_RETURN: u64 = 29 + 27;

/// Cycles that a way takes which does not lead to the next instruction: the pipeline is filled anew (DDI 0439, table 3-1: 1 to 3).
const REFILL: u32 = 3;

/// Bits of a word to a DAC.
const WORD_BITS: f64 = 24.0;

/// These leave less than a word to another (`arm.rs` of `compiler-builtins`).
const BY_WORDS: [&str; 2] = ["__aeabi_memcpy4", "__aeabi_memclr4"];

/// What takes over an order of the host: a tick without any of these has no change to make.
const CHANGES: [&str; 2] = ["controller::Controller<L>::apply", "controller::begin"];

/// Prints the table of all images.
pub(crate) fn bound() -> Result<(), String> {
    images()?;
    println!(
        "\n{:<17}{:<15}{:>34}{:>34}{:>12}\n{:<32}{:>14}{:>10}{:>10}{:>14}{:>10}{:>10}",
        "table",
        "board",
        "a tick without a change",
        "any tick",
        "DAC's bus",
        "",
        "instructions",
        "cycles",
        "us",
        "instructions",
        "cycles",
        "us"
    );
    for image in Image::all() {
        println!("{}", row(&image)?);
    }
    println!(
        "The longest path through the linked code, whatever comes; paths that exclude each other may be on it. A change is a start, another table\n\
         or an order of the host. Cycles are those that DDI 0439 has of a Cortex-M4 without wait states, the exception's included; no document\n\
         has those of a Cortex-M7. A tick has 20 us."
    );
    Ok(())
}

fn row(image: &Image) -> Result<String, String> {
    let (board, table) = (image.board(), image.name());
    let path = image.path().display().to_string();
    let listing = Listing::parse(&crate::output("arm-none-eabi-objdump", &["-d", "-C", &path])?);
    let frames = |at: u32| frames(&path, at);
    let longest = |of: fn(&Instruction) -> u32, turn: u32, without: &[&str]| {
        let measure = Measure {
            of,
            turn,
            without,
            by_words: &BY_WORDS,
            frames: &frames,
            rounds,
        };
        let found = firmware_path::longest(&listing, board.handler, &measure);
        found.map_err(|reason| format!("{table} on {}: {reason}", board.name))
    };
    let mut row = format!("{table:<17}{:<15}", board.name);
    for without in [&CHANGES[..], &[]] {
        let instructions = longest(|_| 1, 0, without)?;
        let (cycles, us) = if board.core == "cortex-m4" {
            let cycles = longest(cycles_m4, REFILL, without)? + ENTRY_AND_RETURN;
            (
                cycles.to_string(),
                format!("{:.1}", cycles as f64 / board.processor_mhz),
            )
        } else {
            ("-".to_owned(), "-".to_owned())
        };
        write!(row, "{instructions:>14}{cycles:>10}{us:>10}").map_err(|error| error.to_string())?;
    }
    let bus_us = f64::from(image.axes()) * WORD_BITS / board.bus_mhz;
    Ok(format!("{row}{:>12}", format!("{bus_us:.2} us")))
}

/// The frames of an address, the innermost first.
fn frames(image: &str, at: u32) -> Result<Frames, String> {
    let said = crate::output(
        "arm-none-eabi-addr2line",
        &["-i", "-f", "-C", "-e", image, &format!("{at:x}")],
    )?;
    let lines: Vec<&str> = said.lines().collect();
    let pairs = lines.chunks_exact(2);
    Ok(pairs.map(|pair| (pair[0].to_owned(), pair[1].to_owned())).collect())
}

/// Rounds of the loops of the interrupt, by function and file.
fn rounds(frames: &Frames) -> Option<Rounds> {
    let of = |function: &str, file: &str| {
        let found = frames
            .iter()
            .find(|(name, place)| name.starts_with(function) && place.contains(file));
        found.map(|(name, _)| name)
    };
    // Nothing comes before this interrupt: an exclusive store succeeds.
    if of("", "core/src/sync/atomic.rs").is_some() {
        return Some(Rounds::AtMost(1));
    }
    // What the bus takes is counted apart: a look that finds it ready.
    if of("", "/src/spi/").is_some() {
        return Some(Rounds::AtMost(1));
    }
    if of("", "compiler-builtins").is_some() {
        return Some(Rounds::OfACopy);
    }
    // Half of the plays are left after each look but the last, in the one corner of a sweep that is not wiped out whole.
    if let Some(name) = of("reach<", "crates/core/src/corners.rs") {
        return Some(Rounds::InOneRound(largest(name)?.ilog2() + 2));
    }
    // A corner for each play at most, and the top.
    if let Some(name) = of("sweep<", "crates/core/src/corners.rs") {
        return Some(Rounds::AtMost(largest(name)? + 1));
    }
    let name = of("step<", "crates/core/src/preview.rs")?;
    Some(Rounds::ToMultiply(largest(name)?))
}

/// The largest number among what a function is generic over.
fn largest(name: &str) -> Option<u32> {
    let words = name.split(['<', '>', ',', ' ']);
    words.filter_map(|word| word.parse().ok()).max()
}

/// Cycles of an instruction at most, without wait states (DDI 0439, tables 3-1 and 7-1): of a load or store that none follows, of a
/// floating-point result that the next instruction waits for, of a return that fills the pipeline anew.
fn cycles_m4(instruction: &Instruction) -> u32 {
    let Instruction { name, operands, .. } = instruction;
    let is = |stems: &[&str]| stems.iter().any(|stem| name.starts_with(stem));
    let listed = registers(operands) * if operands.contains("{d") { 2 } else { 1 };
    let own = match name.as_str() {
        "vdiv" | "vsqrt" => 14 + 1,
        _ if is(&["vfm", "vml", "vnml", "vfnm"]) => 3 + 1,
        _ if is(&["vldm", "vstm", "vpush", "vpop", "push", "pop", "ldm", "stm"]) => 1 + listed,
        _ if is(&["vldr", "vstr"]) => 2 + u32::from(operands.starts_with('d')),
        _ if is(&["v"]) => 1 + 1,
        "ldrd" | "strd" => 3,
        "tbb" | "tbh" => 2,
        _ if is(&["ldr", "str"]) => 2,
        _ if is(&["udiv", "sdiv"]) => 12,
        _ if is(&["dmb", "dsb", "isb"]) => 1 + REFILL,
        _ => 1,
    };
    let returns = is(&["bx"]) || operands.contains("pc}");
    own + if returns { REFILL } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The manual's tables; one cycle more of a floating-point result, and the pipeline filled anew by a return.
    #[test]
    fn val_cycles_of_the_manual() {
        let text = "
00000010 <of>:
  10:\tb570      \tpush\t{r4, r5, r6, lr}
  12:\ted2d 8b04 \tvpush\t{d8-d9}
  16:\ted90 0a00 \tvldr\ts0, [r0]
  1a:\tee20 0a00 \tvmul.f32\ts0, s0, s0
  1e:\tee00 0a00 \tvmla.f32\ts0, s0, s0
  22:\tee80 0a00 \tvdiv.f32\ts0, s0, s0
  26:\tfbb0 f0f1 \tudiv\tr0, r0, r1
  2a:\te9d0 0100 \tldrd\tr0, r1, [r0]
  2e:\t4408      \tadd\tr0, r1
  30:\td001      \tbeq.n\t36 <of+0x26>
  32:\t6800      \tldr\tr0, [r0, #0]
  34:\t4308      \torrs\tr0, r1
  36:\tbd70      \tpop\t{r4, r5, r6, pc}
";
        let frames = |_: u32| Ok(Frames::new());
        let measure = Measure {
            of: cycles_m4,
            turn: REFILL,
            without: &[],
            by_words: &[],
            frames: &frames,
            rounds,
        };
        let wanted = (1 + 4) + (1 + 4) + 2 + 2 + 4 + 15 + 12 + 3 + 1 + 1 + REFILL + (1 + 4 + REFILL);
        assert_eq!(
            firmware_path::longest(&Listing::parse(text), "of", &measure),
            Ok(u64::from(wanted))
        );
    }

    #[test]
    fn val_rounds_by_the_source() {
        let of = |frames: &[(&str, &str)]| {
            let owned = frames.iter().map(|(name, file)| (name.to_string(), file.to_string()));
            rounds(&owned.collect())
        };
        let corners = "/crates/core/src/corners.rs:177";
        let sweep = (
            "sweep<f32, hysteron_core::corner_polynomial::Cubic<f32>, 24, false>",
            corners,
        );
        let reach = (
            "reach<f32, hysteron_core::corner_polynomial::Cubic<f32>, 24, false>",
            corners,
        );
        assert_eq!(
            of(&[("next", "core/src/slice/iter.rs:1"), sweep]),
            Some(Rounds::AtMost(25))
        );
        assert_eq!(of(&[reach, sweep]), Some(Rounds::InOneRound(6)));
        assert_eq!(
            of(&[("step<f32, 32>", "/crates/core/src/preview.rs:110")]),
            Some(Rounds::ToMultiply(32))
        );
        assert_eq!(
            of(&[("swap", "/library/core/src/sync/atomic.rs:2901")]),
            Some(Rounds::AtMost(1))
        );
        assert_eq!(of(&[("run", "/firmware/app/src/law.rs:1")]), None);
    }
}
