//! What the linked image shows: its size, its stack, and that no interrupt can reach a panic, an allocator or a call through a pointer.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Sections of the image that are read-only, and those that are memory.
const FLASH: [&str; 4] = [".vector_table", ".text", ".rodata", ".data"];
const MEMORY: [&str; 3] = [".data", ".bss", ".uninit"];

/// What an entry pushes by itself with the floating-point registers: 26 words, and one to align (ARM DDI 0403, B1.5.7).
pub(crate) const EXCEPTION_FRAME_BYTES: u32 = 4 * 27;

/// What may not grow unseen, bytes: about a tenth above what was measured with rustc 1.95.
pub(crate) struct Limits {
    flash: u32,
    memory: u32,
    stack: u32,
    /// What each further table adds: memory for its numbers as the controller takes them, flash for the code that makes them.
    bank_memory: u32,
    bank_flash: u32,
}

impl Limits {
    /// Those of an image with so many tables.
    pub(crate) fn with_banks(&self, banks: usize) -> Self {
        let further = u32::try_from(banks.saturating_sub(1)).unwrap_or(u32::MAX);
        Self {
            flash: self.flash.saturating_add(further.saturating_mul(self.bank_flash)),
            memory: self.memory.saturating_add(further.saturating_mul(self.bank_memory)),
            ..*self
        }
    }
}

/// The emulator's images.
pub(crate) const EMULATED: Limits = Limits {
    flash: 33_000,
    memory: 1_700,
    stack: 1200,
    bank_memory: 380,
    bank_flash: 8_000,
};

/// The emulator's images with a complete law; 54 kB of flash with every effect in it.
pub(crate) const COMPLETE: Limits = Limits {
    flash: 62_000,
    memory: 7_200,
    stack: 3_000,
    bank_memory: 2_800,
    bank_flash: 32_000,
};

/// The emulator's images of both axes, each with a complete law.
pub(crate) const BOTH: Limits = Limits {
    flash: 90_000,
    memory: 14_400,
    stack: 3_000,
    bank_memory: 5_600,
    bank_flash: 64_000,
};

/// Words in a function's name that may not be reached.
const FORBIDDEN: [&str; 7] = [
    "panic",
    "unwrap_failed",
    "expect_failed",
    "alloc",
    "__rust_",
    "core::fmt",
    "slice_index",
];

/// The functions of an image by address, with their names.
pub(crate) type Functions = BTreeMap<u32, (String, Function)>;

/// One function of the disassembly.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Function {
    /// Addresses that it branches to outside of itself.
    calls: BTreeSet<u32>,
    /// Instructions that go where a register says.
    indirect: Vec<String>,
    /// Bytes that it takes off the stack pointer, all of them, on whichever path.
    stack_bytes: u32,
    /// The register that last got an address beside the program counter: a jump to it goes through a table of this function.
    table: Option<String>,
}

/// Checks an image and prints its figures.
pub(crate) fn check(board: &str, image: &Path, entries: &[&str], limits: &Limits) -> Result<(), String> {
    let image = image.display().to_string();
    let sizes = crate::output("arm-none-eabi-size", &["-A", &image])?;
    let total = |names: &[&str]| names.iter().map(|name| section(&sizes, name)).sum::<u32>();
    let (flash, memory) = (total(&FLASH), total(&MEMORY));
    let functions = parse(&crate::output(
        "arm-none-eabi-objdump",
        &["-d", "-C", "--no-show-raw-insn", &image],
    )?);
    let mut stack = 0;
    let mut reached = 0;
    for entry in entries {
        let walked = walk(&functions, entry).map_err(|reason| format!("{board}: {reason}"))?;
        // Where there are several, each comes on top of the one before.
        stack += walked.stack_bytes + EXCEPTION_FRAME_BYTES;
        reached += walked.functions.len();
    }
    println!(
        "{board}: {flash} bytes of flash, {memory} of memory, stack {stack} of interrupts; {reached} \
         functions reached from interrupts, no panic, no allocator, no call through a pointer"
    );
    for (what, found, most) in [
        ("flash", flash, limits.flash),
        ("memory", memory, limits.memory),
        ("stack", stack, limits.stack),
    ] {
        if found > most {
            return Err(format!("{board}: {found} bytes of {what}; allowed are {most}"));
        }
    }
    Ok(())
}

fn section(sizes: &str, name: &str) -> u32 {
    let line = sizes.lines().find(|line| line.split_whitespace().next() == Some(name));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok())
        .unwrap_or(0)
}

/// The functions of `objdump -d`, by address, with their names.
pub(crate) fn parse(text: &str) -> Functions {
    let mut functions = Functions::new();
    let mut at = None;
    for line in text.lines() {
        if let Some((address, name)) = head(line) {
            functions.insert(address, (name.to_owned(), Function::default()));
            at = Some(address);
        } else if let Some((_, function)) = at.and_then(|at| functions.get_mut(&at)) {
            instruction(line, function);
        }
    }
    // Branches that stay inside are none.
    let starts: Vec<u32> = functions.keys().copied().collect();
    let of = |address: u32| starts.iter().rev().find(|&&start| start <= address).copied();
    for (start, (_, function)) in &mut functions {
        function.calls = function
            .calls
            .iter()
            .filter_map(|&to| of(to))
            .filter(|to| to != start)
            .collect();
    }
    functions
}

/// `00000118 <NonMaskableInt>:`
fn head(line: &str) -> Option<(u32, &str)> {
    let (address, name) = line.strip_suffix(">:")?.split_once(" <")?;
    Some((u32::from_str_radix(address, 16).ok()?, name))
}

/// ` 1a0:\tbl\t1188 <name>`
fn instruction(line: &str, function: &mut Function) {
    let mut parts = line.split('\t').skip(1).map(str::trim);
    let (Some(mnemonic), Some(operands)) = (parts.next(), parts.next()) else {
        return;
    };
    let name = mnemonic.split('.').next().unwrap_or(mnemonic);
    let to_register = operands.starts_with('r')
        || operands.starts_with("ip")
        || operands.starts_with("sl")
        || operands.starts_with("fp");
    match name {
        "blx" | "bx" if to_register => function.indirect.push(line.trim().to_owned()),
        "addw" | "adr" if operands.contains(", pc") || name == "adr" => {
            function.table = operands.split(',').next().map(str::to_owned);
        }
        // A place in that table, perhaps in another register.
        "add" if operands.ends_with("lsl #2") && operands.split(", ").nth(1) == function.table.as_deref() => {
            function.table = operands.split(',').next().map(str::to_owned);
        }
        "mov" if operands.strip_prefix("pc, ") == function.table.as_deref() => {}
        "mov" | "ldr" if operands.starts_with("pc,") => function.indirect.push(line.trim().to_owned()),
        "cbz" | "cbnz" => {
            let target = operands.split(", ").nth(1).and_then(address);
            function.calls.extend(target);
        }
        // A narrow conditional branch stays inside; behind a function's end it is what the linker fills gaps with (0xd4d4).
        _ if name.starts_with('b') && name.len() == 3 && mnemonic.ends_with(".n") => {}
        _ if name.starts_with('b')
            && name != "bic"
            && name != "bfi"
            && name != "bfc"
            && name != "bics"
            && name != "bkpt" =>
        {
            function.calls.extend(address(operands));
        }
        "push" | "vpush" => function.stack_bytes += registers(operands) * if operands.contains('d') { 8 } else { 4 },
        "stmdb" if operands.starts_with("sp!") => function.stack_bytes += registers(operands) * 4,
        "sub" | "subw" if operands.starts_with("sp,") => {
            let last = operands
                .split('#')
                .nth(1)
                .and_then(|rest| rest.split_whitespace().next());
            function.stack_bytes += last.and_then(|number| number.parse::<u32>().ok()).unwrap_or(0);
        }
        "str" | "strd" if operands.ends_with("]!") && operands.contains("[sp, #-") => {
            let number = operands
                .split("#-")
                .nth(1)
                .and_then(|rest| rest.trim_end_matches("]!").parse::<u32>().ok());
            function.stack_bytes += number.unwrap_or(0);
        }
        _ => {}
    }
}

fn address(operand: &str) -> Option<u32> {
    u32::from_str_radix(operand.split_whitespace().next()?, 16).ok()
}

/// Registers in a list such as `{r4, r5, lr}` or `{d8-d9}`.
pub(crate) fn registers(operands: &str) -> u32 {
    let list = operands.split(['{', '}']).nth(1).unwrap_or_default();
    let number = |name: &str| name.trim_start_matches(|c: char| c.is_alphabetic()).parse::<u32>().ok();
    list.split(", ")
        .map(
            |part| match part.split_once('-').map(|(from, to)| (number(from), number(to))) {
                Some((Some(from), Some(to))) => to.saturating_sub(from) + 1,
                _ => 1,
            },
        )
        .sum()
}

/// What can be reached from an entry.
#[derive(Debug)]
pub(crate) struct Walked {
    /// Addresses of the functions, the entry's among them.
    pub functions: BTreeSet<u32>,
    /// The deepest chain of calls.
    pub stack_bytes: u32,
}

/// Follows every call from an entry.
///
/// # Errors
/// A call through a pointer, recursion, a function whose name is [`FORBIDDEN`], no such entry.
pub(crate) fn walk(functions: &Functions, entry: &str) -> Result<Walked, String> {
    let start = functions.iter().find(|(_, (name, _))| name == entry);
    let (&start, _) = start.ok_or_else(|| format!("no function {entry}"))?;
    let mut seen = BTreeSet::new();
    let stack_bytes = depth(functions, start, &mut Vec::new(), &mut seen)?;
    Ok(Walked {
        functions: seen,
        stack_bytes,
    })
}

/// Bytes of the deepest chain of direct calls from an entry, for what is not an interrupt and may do anything: past a pointer or back to
/// where it has been it does not look.
pub(crate) fn deepest(functions: &Functions, entry: &str) -> Result<u32, String> {
    fn below(functions: &Functions, at: u32, known: &mut BTreeMap<u32, u32>) -> u32 {
        if let Some(&bytes) = known.get(&at) {
            return bytes;
        }
        known.insert(at, 0);
        let bytes = functions.get(&at).map_or(0, |(_, function)| {
            let calls = function.calls.iter().map(|&to| below(functions, to, known));
            function.stack_bytes + calls.max().unwrap_or(0)
        });
        known.insert(at, bytes);
        bytes
    }
    let start = functions.iter().find(|(_, (name, _))| name == entry);
    let (&start, _) = start.ok_or_else(|| format!("no function {entry}"))?;
    Ok(below(functions, start, &mut BTreeMap::new()))
}

fn depth(functions: &Functions, at: u32, path: &mut Vec<u32>, seen: &mut BTreeSet<u32>) -> Result<u32, String> {
    let Some((name, function)) = functions.get(&at) else {
        return Err(format!("no function at {at:x}"));
    };
    let chain = || {
        let names: Vec<&str> = path
            .iter()
            .filter_map(|at| Some(functions.get(at)?.0.as_str()))
            .collect();
        format!("{} > {name}", names.join(" > "))
    };
    if FORBIDDEN.iter().any(|word| name.contains(word)) {
        return Err(format!("an interrupt reaches {}", chain()));
    }
    if let Some(line) = function.indirect.first() {
        return Err(format!("a call through a pointer in {}: {line}", chain()));
    }
    if path.contains(&at) {
        return Err(format!("recursion: {}", chain()));
    }
    seen.insert(at);
    path.push(at);
    let mut deepest = 0;
    for &to in &function.calls {
        deepest = deepest.max(depth(functions, to, path, seen)?);
    }
    path.pop();
    Ok(function.stack_bytes + deepest)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
00000010 <mps2::sample_clock>:
  10:\tpush\t{r4, r5, r6, lr}
  12:\tvpush\t{d8-d9}
  16:\tsub\tsp, #24
  18:\tbl\t40 <helper>
  1c:\tbne.n\t12 <mps2::sample_clock+0x2>
  1e:\tbx\tlr
00000040 <helper>:
  40:\tstmdb\tsp!, {r8, r9}
  44:\tb.w\t60 <last>
00000060 <last>:
  60:\tbx\tlr
00000070 <core::panicking::panic>:
  70:\tbx\tlr
";

    #[test]
    fn val_stack_and_calls() {
        let walked = walk(&parse(TEXT), "mps2::sample_clock").unwrap();
        // 16 + 16 + 24, and 8 of the helper.
        assert_eq!((walked.functions.len(), walked.stack_bytes), (3, 64));
        // A table of the function's own is no pointer.
        let table = TEXT.replace(
            "  1e:\tbx\tlr",
            "  1a:\taddw\tr6, pc, #8\n  1c:\tadd.w\tr6, r6, r5, lsl #2\n  1e:\tmov\tpc, r6",
        );
        assert!(walk(&parse(&table), "mps2::sample_clock").is_ok());
        let elsewhere = table
            .replace("add.w\tr6, r6, r5", "add.w\tr8, r6, r5")
            .replace("pc, r6", "pc, r8");
        assert!(walk(&parse(&elsewhere), "mps2::sample_clock").is_ok());
        assert!(
            walk(
                &parse(&table.replace("mov\tpc, r6", "mov\tpc, r5")),
                "mps2::sample_clock"
            )
            .is_err()
        );
    }

    /// The same chain, whatever is on it.
    #[test]
    fn val_deepest_chain() {
        assert_eq!(deepest(&parse(TEXT), "mps2::sample_clock"), Ok(64));
        let filled = TEXT.replace("  60:\tbx\tlr", "  60:\tbx\tlr\n  62:\tbmi.n\t10 <mps2::sample_clock>");
        assert_eq!(deepest(&parse(&filled), "helper"), Ok(8));
        let on_and_back = TEXT
            .replace("b.w\t60 <last>", "bl\t10 <mps2::sample_clock>")
            .replace("  1e:\tbx\tlr", "  1e:\tblx\tr3");
        assert_eq!(deepest(&parse(&on_and_back), "mps2::sample_clock"), Ok(64));
        assert_eq!(deepest(&parse(TEXT), "other"), Err("no function other".to_owned()));
    }

    #[test]
    fn refuse_what_an_interrupt_must_not_reach() {
        let refused = |from: &str, to: &str| {
            walk(&parse(&TEXT.replace(from, to)), "mps2::sample_clock")
                .err()
                .unwrap()
        };
        assert_eq!(
            refused("60 <last>", "70 <core::panicking::panic>"),
            "an interrupt reaches mps2::sample_clock > helper > core::panicking::panic"
        );
        assert_eq!(
            refused("b.w\t60 <last>", "blx\tr3"),
            "a call through a pointer in mps2::sample_clock > helper: 44:\tblx\tr3"
        );
        assert!(refused("b.w\t60 <last>", "b.w\t10 <mps2::sample_clock>").starts_with("recursion"));
        assert_eq!(
            refused("mps2::sample_clock>:", "other>:"),
            "no function mps2::sample_clock"
        );
    }
}
