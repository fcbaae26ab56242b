//! Images of the real boards, and what can be known of them without one: sizes, and where the linker has put what.

use crate::firmware::full_path;
use crate::firmware_image::{EXCEPTION_FRAME_BYTES, Functions, deepest, parse, walk};
use crate::{CHIP, run_in};
use std::path::{Path, PathBuf};

/// Bytes from a first address on.
type Range = std::ops::Range<u64>;

/// One board: what its image is built with, and its chip's memories by the reference manual.
pub(crate) struct Board {
    pub name: &'static str,
    feature: &'static str,
    pub core: &'static str,
    /// Clocks of the processor and of the DAC's bus, as the firmware sets them, megahertz.
    pub processor_mhz: f64,
    pub bus_mhz: f64,
    /// The ADC's handler.
    pub handler: &'static str,
    /// Its position in the vector table.
    position: usize,
    flash: Range,
    /// Where the processor fetches instructions fastest.
    code: (&'static str, Range),
    /// Where it reads and writes data fastest.
    data: (&'static str, Range),
    /// What may not grow unseen, table by table, bytes: about a tenth above what is in use with rustc 1.95. Scarce are code and stack; of
    /// flash either chip has several times what the largest image takes.
    most: [Most; TABLES.len()],
    /// The same of an image of both axes, where there is one.
    most_of_both: Option<Most>,
}

/// What an image is built with: an inverse with a PI controller, and a complete law.
const TABLES: [&str; 2] = [crate::firmware::TABLE, "firmware/tables/tracking-8k.toml"];

/// The tables of the axes of an image of both.
const BOTH: [&str; 2] = ["firmware/tables/tracking-x.toml", "firmware/tables/tracking-y.toml"];

struct Most {
    flash: u64,
    code: u64,
    stack: u64,
}

const BOARDS: [Board; 2] = [
    Board {
        name: "nucleo-h743zi",
        feature: "h743zi",
        core: "cortex-m7",
        processor_mhz: 400.0,
        bus_mhz: 25.0,
        handler: "ADC",
        // RM0433, "Interrupt distribution to NVIC": ADC1_2.
        position: 18,
        flash: 0x0800_0000..0x0820_0000,
        // RM0433, "Memory map and register boundary addresses"; 0 wait states at the processor's clock.
        code: ("ITCM", 0..0x1_0000),
        data: ("DTCM", 0x2000_0000..0x2002_0000),
        most: [
            Most {
                flash: 173_000,
                code: 16_500,
                stack: 1_200,
            },
            Most {
                flash: 209_000,
                code: 30_000,
                stack: 1_200,
            },
        ],
        most_of_both: Some(Most {
            flash: 139_000,
            code: 31_000,
            stack: 1_200,
        }),
    },
    Board {
        name: "nucleo-g474re",
        feature: "g474re",
        core: "cortex-m4",
        processor_mhz: 170.0,
        bus_mhz: 21.25,
        handler: "ADC1_2",
        // RM0440, "Interrupt and exception vectors": ADC1 and ADC2.
        position: 18,
        flash: 0x0800_0000..0x0808_0000,
        // RM0440, "Embedded SRAM": all of it without wait states, CCM SRAM on the instruction bus.
        code: ("CCM", 0x1000_0000..0x1000_8000),
        data: ("SRAM", 0x2000_0000..0x2001_8000),
        most: [
            Most {
                flash: 140_500,
                code: 21_000,
                stack: 1_200,
            },
            Most {
                flash: 167_300,
                code: 32_700,
                stack: 1_200,
            },
        ],
        most_of_both: None,
    },
];

/// What the interrupt works with, and what main's stack must leave of its memory.
const IN_DATA: [&str; 4] = ["nucleo::LOOP", "nucleo::TICKS", "nucleo::KEPT", "_SEGGER_RTT"];
/// What makes the laws, starts the loop and then sends what comes of it.
const MAIN: &str = "nucleo::__cortex_m_rt_main";
/// Of main's stack, for what it calls through pointers and the linker's thunks: packets and log, some hundred bytes.
const UNSEEN_STACK_BYTES: u64 = 1024;
/// The watchdog's keys (RM0433 and RM0440, IWDG_KR): reload by the interrupt, start by main.
const RELOAD: &str = "#43690";
const START: &str = "#52428";

/// Builds the images, checks them and prints a table.
pub(crate) fn boards() -> Result<(), String> {
    let rows = images()?;
    println!(
        "\n{:<17}{:<15}{:>22}{:>22}{:>22}{:>18}{:>12}{:>12}",
        "table", "board", "flash", "interrupt's code", "data", "main stack", "its stack", "functions"
    );
    rows.iter().for_each(|row| println!("{row}"));
    println!(
        "Every function that the interrupt reaches, every constant and the stacks lie in the fastest memory; the vector is the\n\
         handler's; nothing masks it; it reaches no panic, no allocator and no call through a pointer; it feeds the watchdog."
    );
    Ok(())
}

/// Where the ready images go.
const RELEASED: &str = "firmware/target/released";

/// The ready images of both boards, with complete laws: checked as by [`boards`], each as ELF for a debug probe and as HEX for ST's
/// programmer, and their SHA-256.
pub(crate) fn release() -> Result<(), String> {
    boards()?;
    let folder = Path::new(RELEASED);
    std::fs::create_dir_all(folder).map_err(|error| format!("{RELEASED}: {error}"))?;
    let mut sums = String::new();
    for image in Image::all().filter(|image| image.table != crate::firmware::TABLE) {
        let name = format!(
            "{}{}",
            image.board.name,
            if image.of_y.is_some() { "-two-axes" } else { "" }
        );
        let made = [format!("{name}.elf"), format!("{name}.hex")];
        let [elf, hex] = made.each_ref().map(|file| folder.join(file).display().to_string());
        let built = image.path().display().to_string();
        crate::output("arm-none-eabi-objcopy", &["--strip-debug", &built, &elf])?;
        crate::output("arm-none-eabi-objcopy", &["--output-target", "ihex", &built, &hex])?;
        let sum = crate::output("sha256sum", &[&elf, &hex])?;
        sums += &sum.replace(&format!("{RELEASED}/"), "");
        println!("{elf}\n{hex}");
    }
    let file = folder.join("SHA256SUMS");
    std::fs::write(&file, sums).map_err(|error| format!("{}: {error}", file.display()))
}

/// One image of a board.
pub(crate) struct Image {
    board: &'static Board,
    table: &'static str,
    /// The second axis' table.
    of_y: Option<&'static str>,
    most: &'static Most,
}

impl Image {
    /// All images, each board's with the table that it is shipped with last.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        BOARDS.iter().flat_map(|board| {
            let of_both = board.most_of_both.iter().map(|most| (BOTH[0], Some(BOTH[1]), most));
            let of_one = TABLES.iter().zip(&board.most).rev();
            let of_one = of_one.map(|(table, most)| (*table, None, most));
            of_both.chain(of_one).map(move |(table, of_y, most)| Self {
                board,
                table,
                of_y,
                most,
            })
        })
    }

    fn stem(&self) -> String {
        let stem = Path::new(self.table).file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// The name of its table, or tables.
    pub(crate) fn name(&self) -> String {
        format!("{}{}", self.stem(), if self.of_y.is_some() { ", -y" } else { "" })
    }

    /// Where it is once it is built.
    pub(crate) fn path(&self) -> PathBuf {
        let board = self.board.name;
        Path::new(crate::firmware::IMAGES).join(match (self.table, self.of_y) {
            (crate::firmware::TABLE, _) => board.to_owned(),
            (_, None) => format!("{board}-{}", self.stem()),
            (_, Some(_)) => format!("{board}-{}-y", self.stem()),
        })
    }

    pub(crate) fn board(&self) -> &'static Board {
        self.board
    }

    pub(crate) fn axes(&self) -> u32 {
        1 + u32::from(self.of_y.is_some())
    }
}

/// Builds the images and checks them; the table's rows.
pub(crate) fn images() -> Result<Vec<String>, String> {
    let images = Path::new(crate::firmware::IMAGES);
    std::fs::create_dir_all(images).map_err(|error| format!("{}: {error}", images.display()))?;
    let mut rows = Vec::new();
    for image in Image::all() {
        let path = image.path();
        let built = build(image.board, image.table, image.of_y)?;
        std::fs::copy(built, &path).map_err(|error| format!("{}: {error}", path.display()))?;
        let row = check(image.board, image.most, &Seen::of(&path)?);
        let row = row.map_err(|reason| format!("{} with {}: {reason}", image.board.name, image.table))?;
        rows.push(format!("{:<17}{row}", image.name()));
    }
    Ok(rows)
}

fn build(board: &Board, table: &str, of_y: Option<&str>) -> Result<PathBuf, String> {
    let table = full_path(Path::new(table))?;
    let of_y = of_y.map(|table| full_path(Path::new(table))).transpose()?;
    let flags = format!("target.{CHIP}.rustflags=[\"-Ctarget-cpu={}\"]", board.core);
    let mut arguments = vec!["build", "--release", "--locked", "--target-dir", "../target/nucleo"];
    arguments.extend(["--target", CHIP, "--features", board.feature, "--config", &flags]);
    if of_y.is_some() {
        arguments.extend(["--features", "two-axes"]);
    }
    run_in(
        "firmware/nucleo",
        "cargo",
        &arguments,
        &[
            ("HYSTERON_TABLE", Some(&table)),
            ("HYSTERON_TABLE_Y", of_y.as_deref()),
            ("RUSTFLAGS", None),
            ("CARGO_TARGET_DIR", None),
        ],
    )?;
    Ok(PathBuf::from("firmware/target/nucleo")
        .join(CHIP)
        .join("release/nucleo"))
}

/// What binutils say of an image.
struct Seen {
    /// Name, bytes and address of each section.
    sections: Vec<(String, u64, u64)>,
    /// Name and address of each symbol.
    symbols: Vec<(String, u64)>,
    disassembly: String,
    functions: Functions,
    /// The vector table's words.
    vectors: Vec<u32>,
}

impl Seen {
    fn of(image: &Path) -> Result<Self, String> {
        let image = image.display().to_string();
        let disassembly = crate::output("arm-none-eabi-objdump", &["-d", "-C", "--no-show-raw-insn", &image])?;
        let dump = crate::output("arm-none-eabi-objdump", &["-s", "-j", ".vector_table", &image])?;
        Ok(Self {
            sections: sections(&crate::output("arm-none-eabi-size", &["-A", &image])?),
            symbols: symbols(&crate::output("arm-none-eabi-nm", &["-C", &image])?),
            functions: parse(&disassembly),
            disassembly,
            vectors: vectors(&dump),
        })
    }

    fn section(&self, name: &str) -> Result<(u64, u64), String> {
        let found = self.sections.iter().find(|(other, ..)| other == name);
        found
            .map(|&(_, bytes, address)| (bytes, address))
            .ok_or_else(|| format!("no section {name}: it was linked without its script"))
    }

    fn symbol(&self, name: &str) -> Result<u64, String> {
        let found = self.symbols.iter().find(|(other, _)| other == name);
        found
            .map(|&(_, address)| address)
            .ok_or_else(|| format!("no symbol {name}"))
    }
}

/// One row of the table, or the first thing that is not as it must be.
fn check(board: &Board, most: &Most, seen: &Seen) -> Result<String, String> {
    let (memory, data) = &board.data;
    let code = check_code(board, seen)?;
    let (constants, at) = seen.section(".constants")?;
    inside(".constants", at, constants, memory, data)?;
    let (left, _) = seen.section(".rodata")?;
    if left > 0 {
        return Err(format!("{left} bytes of constants are left in flash"));
    }
    for name in IN_DATA {
        inside(name, seen.symbol(name)?, 4, memory, data)?;
    }
    let stack_top = u64::from(seen.vectors.first().copied().unwrap_or(0));
    // The first word is written below it.
    inside("the stack", stack_top.saturating_sub(8), 8, memory, data)?;
    let used: u64 = [".constants", ".data", ".bss", ".uninit"]
        .iter()
        .map(|name| seen.section(name).map(|(bytes, _)| bytes))
        .sum::<Result<u64, _>>()?;
    let main_stack = stack_top.saturating_sub(data.start + used);
    let flash: u64 = [".vector_table", ".text", ".tables", ".data", ".fast", ".constants"]
        .iter()
        .map(|name| seen.section(name).map(|(bytes, _)| bytes))
        .sum::<Result<u64, _>>()?;
    for (what, found, most) in [
        ("flash", flash, most.flash),
        ("the interrupt's code", code.bytes, most.code),
        ("the interrupt's stack", code.stack, most.stack),
    ] {
        if found > most {
            return Err(format!("{found} bytes of {what}; allowed are {most}"));
        }
    }
    let needed = u64::from(deepest(&seen.functions, MAIN)?) + UNSEEN_STACK_BYTES + code.stack;
    if main_stack < needed {
        return Err(format!(
            "{main_stack} bytes are left to main's stack; it needs {needed}"
        ));
    }
    refuse_allocator(seen)?;
    let share = |bytes: u64, of: &Range| {
        let whole = of.end - of.start;
        format!("{bytes} ({:.1} %)", 100.0 * bytes as f64 / whole as f64)
    };
    Ok(format!(
        "{:<15}{:>22}{:>22}{:>22}{:>18}{:>12}{:>12}",
        board.name,
        share(flash, &board.flash),
        format!("{} {}", board.code.0, share(code.bytes, &board.code.1)),
        format!("{memory} {}", share(used, data)),
        format!("{needed} of {main_stack}"),
        code.stack,
        code.functions,
    ))
}

/// What the interrupt takes.
struct Code {
    bytes: u64,
    stack: u64,
    functions: usize,
}

fn check_code(board: &Board, seen: &Seen) -> Result<Code, String> {
    let (memory, range) = &board.code;
    let (bytes, at) = seen.section(".fast")?;
    inside(".fast", at, bytes, memory, range)?;
    let walked = walk(&seen.functions, board.handler)?;
    for &function in &walked.functions {
        let name = seen.functions.get(&function).map_or("?", |(name, _)| name);
        inside(name, function.into(), 2, memory, range)?;
    }
    let handler = seen.symbol(board.handler)?;
    // 16 exceptions come first; bit 0 says Thumb (ARM DDI 0403, B1.5.3).
    let vector = seen.vectors.get(16 + board.position).copied().unwrap_or(0);
    if u64::from(vector) != handler | 1 {
        return Err(format!(
            "vector {} is {vector:#x}; {} lies at {handler:#x}",
            board.position, board.handler
        ));
    }
    if let Some(line) = seen.disassembly.lines().find(|line| line.contains("cpsid")) {
        return Err(format!("something masks the interrupt: {}", line.trim()));
    }
    let has = |key: &str, fast: bool| {
        let lines = seen.disassembly.lines().filter(|line| line.contains(key));
        let mut addresses = lines.filter_map(|line| u64::from_str_radix(line.trim().split(':').next()?, 16).ok());
        addresses.any(|address| range.contains(&address) == fast)
    };
    if !has(RELOAD, true) {
        return Err("the interrupt does not feed the watchdog".to_owned());
    }
    if !has(START, false) {
        return Err("main does not start the watchdog".to_owned());
    }
    Ok(Code {
        bytes,
        stack: (walked.stack_bytes + EXCEPTION_FRAME_BYTES).into(),
        functions: walked.functions.len(),
    })
}

fn inside(what: &str, at: u64, bytes: u64, memory: &str, range: &Range) -> Result<(), String> {
    if at >= range.start && at + bytes <= range.end {
        return Ok(());
    }
    Err(format!(
        "{what} lies at {at:#x}, {bytes} bytes, and not in the {memory}"
    ))
}

/// Whatever allocates has one of these in its name.
fn refuse_allocator(seen: &Seen) -> Result<(), String> {
    let names = ["__rust_alloc", "__rustc::__rust_alloc", "malloc", "_sbrk", "__rg_alloc"];
    let found = seen
        .symbols
        .iter()
        .find(|(name, _)| names.iter().any(|word| name.contains(word)));
    found.map_or(Ok(()), |(name, _)| Err(format!("an allocator is linked: {name}")))
}

/// `.text  16948  134218392`, by `size -A`.
fn sections(text: &str) -> Vec<(String, u64, u64)> {
    let section = |line: &str| {
        let mut words = line.split_whitespace();
        Some((
            words.next()?.to_owned(),
            words.next()?.parse().ok()?,
            words.next()?.parse().ok()?,
        ))
    };
    text.lines().filter_map(section).collect()
}

/// `20011e68 b nucleo::LOOP`, by `nm -C`.
fn symbols(text: &str) -> Vec<(String, u64)> {
    let symbol = |line: &str| {
        let mut parts = line.splitn(3, ' ');
        let address = u64::from_str_radix(parts.next()?, 16).ok()?;
        Some((parts.nth(1)?.to_owned(), address))
    };
    text.lines().filter_map(symbol).collect()
}

/// ` 8000000 00800120 d9010008 611d0008 a12d0008  ...`, by `objdump -s`: the bytes as they lie, least first.
fn vectors(text: &str) -> Vec<u32> {
    let words = |line: &str| -> Vec<u32> {
        let Some(rest) = line.strip_prefix(' ') else {
            return Vec::new();
        };
        let hex = rest.split_whitespace().skip(1).take(4);
        let whole = hex.take_while(|word| word.len() == 8);
        whole
            .filter_map(|word| u32::from_str_radix(word, 16).ok())
            .map(u32::swap_bytes)
            .collect()
    };
    text.lines().flat_map(words).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As binutils print it, cut to what is looked at.
    const SIZES: &str = "\
.fast               4896          32
.constants          1024   536870912
.vector_table        664   134217728
.text               1000   134218392
.tables               16   134219392
.rodata                0   134235340
.data                  0   536871936
.bss                2000   536871936
.uninit                4   536873936
";
    const SYMBOLS: &str = "\
00000020 T ADC
20000400 B _SEGGER_RTT
20000800 b nucleo::LOOP
20000a00 b nucleo::TICKS
20000bd0 b nucleo::KEPT
080002b0 t nucleo::__cortex_m_rt_main
";
    const DISASSEMBLY: &str = "\
00000020 <ADC>:
      20:\tpush\t{r4, lr}
      22:\tbl\t40 <write>
      26:\tmovw\tr1, #43690\t@ 0xaaaa
      2a:\tpop\t{r4, pc}
00000040 <write>:
      40:\tbx\tlr
080002b0 <nucleo::__cortex_m_rt_main>:
 80002b0:\tmovw\tr0, #52428\t@ 0xcccc
080002c0 <in_flash>:
 80002c0:\tbx\tlr
";
    /// The stack's top, then vectors: 33 others, and the handler's.
    fn dump() -> String {
        let mut words = vec!["00000220".to_owned()];
        words.extend(std::iter::repeat_n("611d0008".to_owned(), 33));
        words.push("21000000".to_owned());
        let lines = words
            .chunks(4)
            .enumerate()
            .map(|(i, row)| format!(" {:x} {}  ....", 0x0800_0000 + 16 * i, row.join(" ")));
        lines.collect::<Vec<_>>().join("\n")
    }

    fn seen(sizes: &str, symbol_lines: &str, disassembly: &str, dump: &str) -> Seen {
        Seen {
            sections: sections(sizes),
            symbols: symbols(symbol_lines),
            functions: parse(disassembly),
            disassembly: disassembly.to_owned(),
            vectors: vectors(dump),
        }
    }

    #[test]
    fn val_a_row_of_figures() {
        let row = check(
            &BOARDS[0],
            &BOARDS[0].most[0],
            &seen(SIZES, SYMBOLS, DISASSEMBLY, &dump()),
        )
        .unwrap();
        // 664 + 1000 + 16 + 0 + 4896 + 1024; 1024 + 0 + 2000 + 4; 128 KB less that, of which main needs 1024 and the interrupt; 8 pushed and the
        // exception's 108.
        let figures: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(
            figures,
            [
                "nucleo-h743zi",
                "7600",
                "(0.4",
                "%)",
                "ITCM",
                "4896",
                "(7.5",
                "%)",
                "DTCM",
                "3028",
                "(2.3",
                "%)",
                "1140",
                "of",
                "128044",
                "116",
                "2"
            ]
        );
    }

    #[test]
    fn refuse_what_is_not_where_it_must_be() {
        let refused = |sizes: &str, symbols: &str, disassembly: &str, dump: &str| {
            check(&BOARDS[0], &BOARDS[0].most[0], &seen(sizes, symbols, disassembly, dump))
                .err()
                .unwrap()
        };
        let dump = dump();
        for (said, wanted) in [
            (
                refused(
                    SIZES,
                    SYMBOLS,
                    &DISASSEMBLY.replace("40 <write>\n", "80002c0 <in_flash>\n"),
                    &dump,
                ),
                "in_flash lies at 0x80002c0, 2 bytes, and not in the ITCM",
            ),
            (
                refused(
                    &SIZES.replace(".rodata                0", ".rodata                8"),
                    SYMBOLS,
                    DISASSEMBLY,
                    &dump,
                ),
                "8 bytes of constants are left in flash",
            ),
            (
                refused(SIZES, &SYMBOLS.replace("20000800", "24000800"), DISASSEMBLY, &dump),
                "nucleo::LOOP lies at 0x24000800, 4 bytes, and not in the DTCM",
            ),
            (
                refused(SIZES, SYMBOLS, DISASSEMBLY, &dump.replace("00000220", "00000824")),
                "the stack lies at 0x2407fff8, 8 bytes, and not in the DTCM",
            ),
            (
                refused(SIZES, SYMBOLS, DISASSEMBLY, &dump.replace("21000000", "611d0008")),
                "vector 18 is 0x8001d61; ADC lies at 0x20",
            ),
            (
                refused(
                    SIZES,
                    SYMBOLS,
                    &DISASSEMBLY.replace("movw\tr0,", "cpsid\ti\n 80002b4:\tmovw\tr0,"),
                    &dump,
                ),
                "something masks the interrupt: 80002b0:\tcpsid\ti",
            ),
            (
                refused(
                    SIZES,
                    SYMBOLS,
                    &DISASSEMBLY.replace("movw\tr1, #43690", "movw\tr1, #1"),
                    &dump,
                ),
                "the interrupt does not feed the watchdog",
            ),
            (
                refused(SIZES, SYMBOLS, &DISASSEMBLY.replace("#52428", "#1"), &dump),
                "main does not start the watchdog",
            ),
            (
                refused(
                    SIZES,
                    &format!("{SYMBOLS}080002b0 T __rust_alloc\n"),
                    DISASSEMBLY,
                    &dump,
                ),
                "an allocator is linked: __rust_alloc",
            ),
            (
                refused(
                    &SIZES.replace("2000   5", "128000   5"),
                    SYMBOLS,
                    &DISASSEMBLY.replace("movw\tr0,", "sub.w\tsp, sp, #2048\t@ 0x800\n 80002b4:\tmovw\tr0,"),
                    &dump,
                ),
                "2044 bytes are left to main's stack; it needs 3188",
            ),
        ] {
            assert_eq!(said, wanted);
        }
    }
}
