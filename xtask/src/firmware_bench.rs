//! Instructions of one control tick in the emulator, beside the same algorithm in C, those of the complete law by block, and what they
//! may not exceed.

use crate::CHIP;
use crate::firmware::{BOARDS, build_image};
use std::collections::BTreeMap;
use std::path::Path;

/// Longest run, seconds of wall time; it takes two.
const PATIENCE_S: &str = "300";

/// Counts of one contender over the signals.
#[derive(Default)]
struct Counts {
    /// Signal, mean, worst.
    rows: Vec<(String, f64, u32)>,
    hashes: Vec<String>,
}

impl Counts {
    fn worst(&self) -> u32 {
        self.rows.iter().map(|row| row.2).max().unwrap_or(0)
    }

    /// The largest of the signals' means.
    fn mean(&self) -> f64 {
        self.rows.iter().map(|row| row.1).fold(0.0, f64::max)
    }
}

/// What a contender may take: board, contender, mean, worst. What was measured with rustc 1.95 and gcc 12.2, and 3 % for other
/// compilers; of ten plays less than 130 on average on the one board and than 125 at worst on the other, whatever was measured.
const MOST: [(&str, &str, f64, u32); 6] = [
    ("mps2-an386", "rust 10", 129.9, 212),
    ("mps2-an500", "rust 10", 124.0, 124),
    ("mps2-an386", "rust 100", 253.0, 523),
    ("mps2-an500", "rust 100", 254.0, 475),
    ("mps2-an386", BOTH, 1900.0, 2370),
    ("mps2-an386", DESIGNED, 1370.0, ALLOWED_OF_DESIGNED),
];

/// The complete law of two axes in one tick, every effect in it.
const BOTH: &str = "both-axes 2";

/// The complete law of two axes as it was designed for the table's stage, each told of the other.
const DESIGNED: &str = "designed-axes 2";

/// The table's complete law on one axis: the core's, and what `export --format c` makes of it, with the same roundings.
const TABLE_AXIS: &str = "table-axis 1";
const GENERATED_AXIS: &str = "c-exact-axis 1";

/// Instructions that the designed two may take in a tick, whatever was measured: half of the 3400 cycles that 20 us are at 170 MHz.
const ALLOWED_OF_DESIGNED: u32 = 1700;

/// The table whose law is counted block by block: two modes and two sections of feedback.
const COMPLETE: &str = "firmware/tables/tracking-739.toml";

/// C that gives the same codes, with the same roundings: it is held to the core's bits.
const EXACT: [&str; 2] = ["c-exact 10", "c-prefix-exact 10"];

/// C with the roundings that gcc chooses as well: the core is held to the worst case of each.
const SAME_LAW: [&str; 5] = [
    "c 10",
    "c-exact 10",
    "c-fast-math 10",
    "c-prefix 10",
    "c-prefix-exact 10",
];

/// Builds, runs and prints the counts on every board, and refuses more than [`MOST`].
pub(crate) fn bench() -> Result<(), String> {
    let mut wrong = Vec::new();
    let mut first: Option<Vec<String>> = None;
    let mut complete: Option<Vec<String>> = None;
    for (board, core) in BOARDS {
        let mut counts = measure(board, core, "bench", Path::new(crate::firmware::TABLE))?;
        print(board, "plays", &counts);
        let blocks = measure(board, core, "blocks", Path::new(COMPLETE))?;
        print(board, "complete law", &blocks);
        counts.extend(blocks);
        let of = |name: &str| {
            let found = counts.get(name).filter(|counts| !counts.rows.is_empty());
            found.ok_or_else(|| format!("{board}: no counts of {name}"))
        };
        let ours = of("rust 10")?;
        for name in EXACT {
            if ours.hashes != of(name)?.hashes {
                wrong.push(format!("{board}: rust 10 and {name} gave different codes"));
            }
        }
        for name in SAME_LAW {
            let other = of(name)?;
            if ours.worst() > other.worst() {
                wrong.push(format!(
                    "{board}: rust 10 takes {}, {name} {}",
                    ours.worst(),
                    other.worst()
                ));
            }
        }
        if first.get_or_insert_with(|| ours.hashes.clone()) != &ours.hashes {
            wrong.push(format!("{board}: other codes than on {}", BOARDS[0].0));
        }
        let (table, generated) = (of(TABLE_AXIS)?, of(GENERATED_AXIS)?);
        if table.hashes != generated.hashes {
            wrong.push(format!(
                "{board}: {TABLE_AXIS} and {GENERATED_AXIS} gave different codes"
            ));
        }
        let both = of(BOTH)?;
        if complete.get_or_insert_with(|| both.hashes.clone()) != &both.hashes {
            wrong.push(format!(
                "{board}: the complete law gives other codes than on {}",
                BOARDS[0].0
            ));
        }
        for (_, name, mean, worst) in MOST.iter().filter(|row| row.0 == board) {
            let found = of(name)?;
            if found.mean() > *mean || found.worst() > *worst {
                wrong.push(format!(
                    "{board}: {name} takes {:.0}, at worst {}; allowed are {mean} and {worst}",
                    found.mean(),
                    found.worst()
                ));
            }
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(wrong.join("\n"))
    }
}

fn measure(board: &str, core: &str, program: &str, table: &Path) -> Result<BTreeMap<String, Counts>, String> {
    let image = build_image(program, core, table)?;
    let image = image.display().to_string();
    let mut words = vec![
        PATIENCE_S,
        "qemu-system-arm",
        "-machine",
        board,
        "-display",
        "none",
        "-monitor",
        "none",
    ];
    // An instruction is 128 ns: see firmware/bench.
    words.extend(["-serial", "none", "-semihosting-config", "enable=on,target=native"]);
    words.extend(["-icount", "shift=7,sleep=off", "-kernel", &image]);
    let text = crate::output("timeout", &words)?;
    let mut counts: BTreeMap<String, Counts> = BTreeMap::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [name, plays, signal, mean, worst, hash] = words[..] else {
            return Err(format!("{board}: `{line}` is no line of counts"));
        };
        let number = |word: &str| {
            word.parse::<u32>()
                .map_err(|_| format!("{board}: `{word}` is no count"))
        };
        let entry = counts.entry(format!("{name} {plays}")).or_default();
        entry
            .rows
            .push((signal.to_owned(), f64::from(number(mean)?) / 1000.0, number(worst)?));
        entry.hashes.push(hash.to_owned());
    }
    Ok(counts)
}

fn print(board: &str, what: &str, counts: &BTreeMap<String, Counts>) {
    println!("\n{board}, {CHIP}: instructions of one control tick, mean / worst over 10 000 ticks of each signal");
    let signals: Vec<&str> = counts.values().next().map_or(Vec::new(), |counts| {
        counts.rows.iter().map(|row| row.0.as_str()).collect()
    });
    let heads: Vec<String> = signals.iter().map(|signal| format!("{signal:>14}")).collect();
    println!("{what:<20}{}{:>14}", heads.concat(), "all");
    for (name, counts) in counts {
        let cells: Vec<String> = counts
            .rows
            .iter()
            .map(|row| format!("{:>14}", format!("{:.0} / {}", row.1, row.2)))
            .collect();
        let all = format!("{:.0} / {}", counts.mean(), counts.worst());
        println!("{name:<20}{}{all:>14}", cells.concat());
    }
}
