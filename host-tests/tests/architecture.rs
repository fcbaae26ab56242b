//! The invariants of ARCHITECTURE.md that `cargo metadata` can tell, and its drawing.
#![expect(clippy::unwrap_used, reason = "a test that cannot read the workspace fails")]

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

type Graph = BTreeMap<String, BTreeSet<String>>;

/// Each crate of ours with those crates of ours that it depends on (tests and benches left out).
fn dependencies() -> Graph {
    let mut graph = Graph::new();
    // The application of the firmware is in no workspace of the root.
    for manifest in ["Cargo.toml", "../firmware/app/Cargo.toml"] {
        let output = Command::new(env!("CARGO"))
            .args([
                "metadata",
                "--format-version",
                "1",
                "--no-deps",
                "--offline",
                "--manifest-path",
                manifest,
            ])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
        let packages = metadata["packages"].as_array().unwrap();
        let named = packages
            .iter()
            .filter_map(|package| Some((ours(package["name"].as_str()?)?, package)));
        graph.extend(named.map(|(name, package)| {
            let shipped = package["dependencies"].as_array().unwrap().iter();
            let shipped = shipped.filter(|d| d["kind"].is_null() && d["optional"] == false);
            (name, shipped.filter_map(|d| ours(d["name"].as_str()?)).collect())
        }));
    }
    // Further workspaces of the firmware are images of these.
    graph.retain(|name, _| !["cortex-m7", "bench", "mps2", "nucleo"].contains(&name.as_str()));
    graph
}

fn ours(name: &str) -> Option<String> {
    name.strip_prefix("hysteron-").map(str::to_owned)
}

/// Everything that a crate is built on.
fn below<'a>(graph: &'a Graph, name: &str) -> BTreeSet<&'a str> {
    let mut found = BTreeSet::new();
    for next in graph.get(name).into_iter().flatten() {
        found.insert(next.as_str());
        found.extend(below(graph, next));
    }
    found
}

/// The arrows that do not follow from others.
fn drawing(graph: &Graph) -> Vec<String> {
    let mut arrows = Vec::new();
    for (name, next) in graph {
        let follows = |to: &str| next.iter().any(|other| other != to && below(graph, other).contains(to));
        let own = next.iter().filter(|to| !follows(to));
        arrows.extend(own.map(|to| format!("{name} --> {to}")));
    }
    arrows
}

fn architecture() -> String {
    std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../ARCHITECTURE.md")).unwrap()
}

/// The drawing is the house, and every crate has its paragraph.
#[test]
fn val_the_drawing_is_what_the_manifests_say() {
    let text = architecture();
    let drawn: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|line| line.contains(" --> "))
        .collect();
    let graph = dependencies();
    let real = drawing(&graph);
    assert!(graph.len() >= 13 && real.len() >= graph.len(), "{graph:?}");
    assert_eq!(drawn, real, "ARCHITECTURE.md should draw:\n  {}", real.join("\n  "));
    for name in graph.keys() {
        let paragraph = text
            .split("\n- ")
            .find(|text| text.starts_with(&format!("**`{name}`**")));
        let words = paragraph.unwrap_or_else(|| panic!("ARCHITECTURE.md has no paragraph `- **`{name}`** is ...`"));
        assert!(
            words.contains("Absent:"),
            "the paragraph of {name} does not say what is absent"
        );
    }
}

/// The drawing test can fail: an arrow that follows from others is left out, one that does not is kept.
#[test]
fn val_arrows_that_follow_are_left_out() {
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let graph = Graph::from([
        ("a".to_owned(), set(&["b", "c"])),
        ("b".to_owned(), set(&["c"])),
        ("c".to_owned(), set(&[])),
    ]);
    assert_eq!(drawing(&graph), ["a --> b", "b --> c"]);
}

/// The rules behind the drawing.
#[test]
fn val_data_flows_one_way() {
    let graph = dependencies();
    let free = |name: &str| graph[name].is_empty();
    assert!(free("core") && free("data"), "{graph:?}");
    let never = [
        ("plant", "core"),
        ("plant", "identify"),
        ("identify", "plant"),
        ("diagnose", "plant"),
        ("diagnose", "report"),
        ("report", "plant"),
        ("lab", "plant"),
        ("lab", "tracking"),
        ("table", "identify"),
        ("firmware", "data"),
        ("tracking", "board"),
        ("trials", "report"),
    ];
    for (upper, lower) in never {
        assert!(!graph[upper].contains(lower), "{upper} must not depend on {lower}");
    }
    // A controller for a stage of the user's own is made without any simulated one.
    for upper in ["control", "capi", "fmu"] {
        assert!(
            !below(&graph, upper).contains("plant"),
            "{upper} must not be built on plant"
        );
    }
    // The binary is the roof: nothing stands on it.
    assert!(graph.values().all(|next| !next.contains("cli")));
}

#[test]
fn val_the_core_is_no_std_and_safe() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/core/src/lib.rs")).unwrap();
    assert!(text.contains("#![no_std]") && text.contains("#![forbid(unsafe_code)]"));
    assert!(!text.contains("extern crate alloc"));
}

/// What a library of control asks for has the name of a field; which option gives it, the command line says.
#[test]
fn val_no_library_of_control_names_an_option() {
    for name in ["identify", "control", "tracking", "trials"] {
        let mut files = Vec::new();
        collect(
            &Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../crates/{name}/src")),
            &mut files,
        );
        assert!(!files.is_empty());
        for file in files {
            let named = options(&std::fs::read_to_string(&file).unwrap());
            assert!(named.is_empty(), "{}: {named:?}", file.display());
        }
    }
}

#[test]
fn val_an_option_in_a_message_is_found() {
    let text = "// --a comment\nfn f(k: u8) -> u8 {\n    k--1 /* no */\n}\n\"give --top-v\"; \"a -- b --\"\n#[cfg(test)]\n\"--in-a-test\"\n";
    assert_eq!(options(text), ["--top-v"]);
}

/// Options in the code of a file, its comments and its tests left out.
fn options(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let behind = lines.flat_map(|line| line.split("--").skip(1));
    let word = |rest: &str| {
        rest.chars()
            .take_while(|c| c.is_ascii_lowercase() || *c == '-')
            .collect::<String>()
    };
    behind
        .map(word)
        .filter(|word| word.starts_with(|c: char| c.is_ascii_lowercase()))
        .map(|word| format!("--{word}"))
        .collect()
}

/// The top-level modules of a crate, each with those that it uses; tests left out.
fn modules(name: &str) -> BTreeMap<String, BTreeSet<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../crates/{name}/src"));
    let module = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for entry in std::fs::read_dir(&root).unwrap() {
        let path = entry.unwrap().path();
        let mut files = Vec::new();
        collect(&path, &mut files);
        let uses = files
            .iter()
            .flat_map(|file| used(&std::fs::read_to_string(file).unwrap()));
        found.entry(module(&path)).or_default().extend(uses);
    }
    found.remove("lib");
    let all: BTreeSet<String> = found.keys().cloned().collect();
    for (name, uses) in &mut found {
        uses.retain(|used| used != name && all.contains(used));
    }
    found
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in std::fs::read_dir(path).unwrap() {
            collect(&entry.unwrap().path(), files);
        }
    } else {
        files.push(path.to_owned());
    }
}

/// Names behind `crate::` in the code of a file, its comments and its tests left out.
fn used(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let code: String = code
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect();
    let word = |text: &str| -> String {
        let is_word = |c: &char| c.is_alphanumeric() || *c == '_';
        text.trim_start().chars().take_while(is_word).collect()
    };
    let mut names = Vec::new();
    for (at, found) in code.match_indices("crate::") {
        let behind = &code[at + found.len()..];
        match behind.strip_prefix('{') {
            // `use crate::{a, b::c}`: what stands at the first depth.
            Some(list) => {
                let (mut depth, mut start) = (0, true);
                for (i, c) in list.char_indices() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' => start = depth == 0,
                        _ if start && c.is_alphabetic() => {
                            names.push(word(&list[i..]));
                            start = false;
                        }
                        _ => {}
                    }
                }
            }
            None => names.push(word(behind)),
        }
    }
    names
}

/// What is left when modules that use no other one are taken out again and again: those in circles, and what uses them.
fn circles(mut modules: BTreeMap<String, BTreeSet<String>>) -> BTreeMap<String, BTreeSet<String>> {
    loop {
        let leaves: Vec<String> = modules
            .iter()
            .filter(|(_, uses)| uses.is_empty())
            .map(|(name, _)| name.clone())
            .collect();
        if leaves.is_empty() {
            return modules;
        }
        for leaf in &leaves {
            modules.remove(leaf);
            modules.values_mut().for_each(|uses| {
                uses.remove(leaf);
            });
        }
    }
}

#[test]
fn val_modules_import_each_other_one_way() {
    for name in ["effects", "identify"] {
        let modules = modules(name);
        assert!(modules.len() > 10, "{name}: {modules:?}");
        let left = circles(modules);
        assert!(left.is_empty(), "{name} has modules in a circle: {left:#?}");
    }
}

#[test]
fn val_a_circle_of_modules_is_found() {
    let text = "use crate::{chain::{Chain, Link}, model};\nfn f() { crate::period::g() } // crate::fit\n#[cfg(test)]\nmod t { use crate::x; }";
    assert_eq!(used(text), ["chain", "model", "period"]);
    let graph = |pairs: &[(&str, &[&str])]| {
        let uses = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        pairs.iter().map(|(name, of)| ((*name).to_owned(), uses(of))).collect()
    };
    assert!(circles(graph(&[("a", &["b"]), ("b", &["c"]), ("c", &[])])).is_empty());
    assert_eq!(circles(graph(&[("a", &["b"]), ("b", &["a"]), ("c", &[])])).len(), 2);
}
