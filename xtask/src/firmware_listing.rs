//! The instructions of a linked image, and where each leads.

use std::collections::BTreeMap;
use std::ops::Range;

/// Suffixes of a condition.
const CONDITIONS: [&str; 16] = [
    "eq", "ne", "cs", "hs", "cc", "lo", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le",
];

/// One instruction of `objdump -d -C`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Instruction {
    /// Bytes that it takes.
    pub bytes: u32,
    /// The mnemonic without `.n`, `.w` and types.
    pub name: String,
    /// As printed.
    pub operands: String,
}

impl Instruction {
    /// Whether it changes a register, or may.
    pub(crate) fn changes(&self, register: &str) -> bool {
        let Self { name, operands, .. } = self;
        let is = |stems: &[&str]| stems.iter().any(|stem| name.starts_with(stem));
        let mut listed = operands
            .split([',', ' ', '{', '}', '[', ']', '!'])
            .filter(|word| !word.is_empty());
        let at = listed.position(|word| word == register);
        // A load of several, and what is called, may change each; an address may be moved on.
        let several = is(&["ldm", "pop", "ldrd", "umull", "smull", "umlal", "smlal"]);
        let moved_on =
            operands.contains(&format!("[{register}")) && (operands.contains("]!") || operands.contains("], "));
        let reads = is(&["str", "stm", "push", "cmp", "cmn", "tst", "teq", "cb"]);
        conditional(name, "bl").is_some() || moved_on || !reads && (at == Some(0) || several && at.is_some())
    }

    /// Bytes that it writes.
    pub(crate) fn written(&self) -> u32 {
        let Self { name, operands, .. } = self;
        match name.as_str() {
            "strb" => 1,
            "strh" => 2,
            "str" => 4,
            "strd" => 8,
            "stm" | "stmia" => {
                4 * operands
                    .split('{')
                    .nth(1)
                    .map_or(0, |list| list.split(',').count() as u32)
            }
            _ => 0,
        }
    }

    /// Whether it multiplies two floating-point numbers.
    pub(crate) fn multiplies(&self) -> bool {
        ["vmul", "vmla", "vmls", "vfma", "vfms"].contains(&self.name.as_str())
    }
}

/// An image's instructions, the halfwords between them too, and where its functions begin.
#[derive(Debug, Default)]
pub(crate) struct Listing {
    instructions: BTreeMap<u32, Instruction>,
    halfwords: BTreeMap<u32, u16>,
    functions: BTreeMap<u32, String>,
}

/// Where an instruction leads.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Ways {
    pub on: Vec<u32>,
    pub call: Option<u32>,
    /// Whether the function can end with it.
    pub ends: bool,
}

impl Listing {
    /// Reads `objdump -d -C`.
    pub(crate) fn parse(text: &str) -> Self {
        let mut listing = Self::default();
        for line in text.lines() {
            let head = line.strip_suffix(">:").and_then(|line| line.split_once(" <"));
            if let Some((address, name)) = head {
                if let Ok(address) = u32::from_str_radix(address, 16) {
                    listing.functions.insert(address, name.to_owned());
                }
                continue;
            }
            let mut parts = line.split('\t');
            let address = parts.next().and_then(|word| word.trim().strip_suffix(':'));
            let Some(address) = address.and_then(|word| u32::from_str_radix(word, 16).ok()) else {
                continue;
            };
            let raw = parts.next().unwrap_or_default().trim();
            let bytes = listing.take(address, raw);
            let mnemonic = parts.next().unwrap_or_default().trim();
            let instruction = Instruction {
                bytes,
                name: mnemonic.split('.').next().unwrap_or_default().to_owned(),
                operands: parts.collect::<Vec<_>>().join(" ").trim().to_owned(),
            };
            listing.instructions.insert(address, instruction);
        }
        listing
    }

    /// Keeps the halfwords of a line: instructions are printed by halfwords, words of data as one number.
    fn take(&mut self, address: u32, raw: &str) -> u32 {
        let mut at = address;
        for word in raw.split_whitespace() {
            let Ok(value) = u32::from_str_radix(word, 16) else {
                continue;
            };
            self.halfwords.insert(at, value as u16);
            if word.len() > 4 {
                self.halfwords.insert(at + 2, (value >> 16) as u16);
                at += 2;
            }
            at += 2;
        }
        at - address
    }

    pub(crate) fn instruction(&self, at: u32) -> Option<&Instruction> {
        self.instructions.get(&at)
    }

    /// The address of a function.
    pub(crate) fn function(&self, name: &str) -> Option<u32> {
        let found = self.functions.iter().find(|(_, other)| *other == name);
        found.map(|(&at, _)| at)
    }

    /// The instructions before an address, the nearest first.
    pub(crate) fn before(&self, at: u32) -> impl Iterator<Item = (u32, &Instruction)> {
        let before = self.instructions.range(..at).rev();
        before.map(|(&at, instruction)| (at, instruction))
    }

    /// Whether one instruction stands behind another.
    pub(crate) fn follows(&self, at: u32, to: u32) -> bool {
        self.instructions.get(&at).is_some_and(|one| at + one.bytes == to)
    }

    pub(crate) fn name(&self, function: u32) -> &str {
        self.functions.get(&function).map_or("?", String::as_str)
    }

    /// Addresses of a function.
    fn extent(&self, function: u32) -> Range<u32> {
        let next = self.functions.range(function + 1..).next();
        function..next.map_or(u32::MAX, |(next, _)| *next)
    }

    /// Every instruction that can be reached inside of a function, and where it leads.
    pub(crate) fn ways(&self, function: u32) -> Result<BTreeMap<u32, Ways>, String> {
        let extent = self.extent(function);
        let mut ways = BTreeMap::new();
        let mut open = vec![function];
        while let Some(at) = open.pop() {
            if ways.contains_key(&at) {
                continue;
            }
            let instruction = self.instructions.get(&at);
            let instruction = instruction.ok_or_else(|| format!("{}: nothing at {at:x}", self.name(function)))?;
            let way = self
                .way(at, instruction, &extent)
                .map_err(|reason| format!("{}: {reason}", self.name(function)))?;
            open.extend(&way.on);
            ways.insert(at, way);
        }
        Ok(ways)
    }

    fn way(&self, at: u32, instruction: &Instruction, extent: &Range<u32>) -> Result<Ways, String> {
        let Instruction { name, operands, .. } = instruction;
        let next = at + instruction.bytes;
        let target = || {
            let words = operands.split_whitespace();
            let mut addresses = words.filter_map(|word| u32::from_str_radix(word, 16).ok());
            let unknown = || format!("an unknown way on: {at:x} {name} {operands}");
            addresses.next().ok_or_else(unknown)
        };
        let returns = |stem: &str| conditional(name, stem).filter(|_| stem == "bx" || operands.contains("pc"));
        let to = |on: Vec<u32>| Ways { on, ..Ways::default() };
        let end = |only_if: bool| Ways {
            on: if only_if { vec![next] } else { Vec::new() },
            call: None,
            ends: true,
        };
        if matches!(name.as_str(), "cbz" | "cbnz") {
            return Ok(to(vec![target()?, next]));
        }
        if let Some(only_if) = conditional(name, "b") {
            let target = target()?;
            let mut way = end(only_if);
            if extent.contains(&target) {
                way.on.push(target);
                way.ends = false;
            } else {
                way.call = Some(target);
            }
            return Ok(way);
        }
        if conditional(name, "bl").is_some() {
            return Ok(Ways {
                on: vec![next],
                call: Some(target()?),
                ends: false,
            });
        }
        if let Some(only_if) = returns("bx").or_else(|| returns("pop")).or_else(|| returns("ldmia")) {
            return Ok(end(only_if));
        }
        if matches!(name.as_str(), "tbb" | "tbh") {
            return Ok(to(self.table(next, name == "tbb", extent)));
        }
        if name == "udf" {
            return Ok(end(false));
        }
        if name.starts_with("blx") || operands.starts_with("pc,") && matches!(name.as_str(), "mov" | "ldr" | "add") {
            return Err(format!("a way that a register gives: {at:x} {name} {operands}"));
        }
        Ok(to(vec![next]))
    }

    /// The targets of a table of bytes or halfwords. It ends where its nearest target begins; what does not lead into the function is padding.
    fn table(&self, from: u32, of_bytes: bool, extent: &Range<u32>) -> Vec<u32> {
        let mut targets = Vec::new();
        let mut nearest = extent.end;
        for place in 0.. {
            let at = from + if of_bytes { place } else { 2 * place };
            if at >= nearest {
                break;
            }
            let Some(&halfword) = self.halfwords.get(&(at & !1)) else {
                break;
            };
            let halves = if of_bytes {
                u32::from(halfword) >> (8 * (at & 1)) & 0xff
            } else {
                u32::from(halfword)
            };
            let target = from + 2 * halves;
            if target <= at || !extent.contains(&target) || !self.instructions.contains_key(&target) {
                break;
            }
            nearest = nearest.min(target);
            targets.push(target);
        }
        targets
    }
}

/// Whether a mnemonic is a stem with a condition; `None` where it is another.
fn conditional(name: &str, stem: &str) -> Option<bool> {
    let rest = name.strip_prefix(stem)?;
    if rest.is_empty() {
        return Some(false);
    }
    CONDITIONS.contains(&rest).then_some(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_registers_that_change() {
        let of = |name: &str, operands: &str| Instruction {
            bytes: 2,
            name: name.to_owned(),
            operands: operands.to_owned(),
        };
        for (name, operands, wanted) in [
            ("movs", "r2, #16", true),
            ("movne", "r2, #16", true),
            ("ldmia", "r4, {r1, r2, r3}", true),
            ("ldrd", "r1, r2, [r0]", true),
            ("ldr", "r0, [r2], #4", true),
            ("ldr", "r0, [r2, #4]!", true),
            ("bl", "40 <other>", true),
            ("str", "r2, [r0]", false),
            ("stmia", "r0!, {r1, r2}", false),
            ("ldr", "r0, [r2, #4]", false),
            ("add", "r1, r2", false),
            ("cmp", "r2, #0", false),
        ] {
            assert_eq!(of(name, operands).changes("r2"), wanted, "{name} {operands}");
        }
    }

    #[test]
    fn val_conditions() {
        for (name, stem, wanted) in [
            ("b", "b", Some(false)),
            ("bls", "b", Some(true)),
            ("bl", "b", None),
            ("bls", "bl", None),
            ("bleq", "bl", Some(true)),
            ("bic", "b", None),
            ("bxne", "bx", Some(true)),
        ] {
            assert_eq!(conditional(name, stem), wanted, "{name} {stem}");
        }
    }
}
