//! The invariants of ARCHITECTURE.md that `cargo metadata` can tell.
#![expect(clippy::unwrap_used, reason = "a test that cannot read the workspace fails")]

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Each crate of ours with those crates of ours that it depends on (tests and benches left out).
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let ours = |name: &str| name.strip_prefix("hysteron-").map(str::to_owned);
    packages
        .iter()
        .filter_map(|package| Some((ours(package["name"].as_str()?)?, package)))
        .map(|(name, package)| {
            let shipped = package["dependencies"]
                .as_array()
                .unwrap()
                .iter()
                .filter(|d| d["kind"].is_null());
            (name, shipped.filter_map(|d| ours(d["name"].as_str()?)).collect())
        })
        .collect()
}

#[test]
fn val_data_flows_one_way() {
    let found = dependencies();
    let check = |name: &str, allowed: &[&str]| {
        let extra: Vec<_> = found[name].iter().filter(|d| !allowed.contains(&d.as_str())).collect();
        assert!(
            extra.is_empty(),
            "{name} depends on {extra:?}; ARCHITECTURE.md allows {allowed:?}"
        );
    };
    check("core", &[]);
    check("data", &[]);
    check("plant", &["data"]);
    check("effects", &["core"]);
    check("identify", &["core", "data", "effects"]);
    check("diagnose", &["core", "data", "identify"]);
    check("tracking", &["core", "data", "identify", "plant"]);
    check("table", &["core"]);
    check("board", &["core", "firmware", "plant", "table"]);
    check("report", &["data", "identify", "diagnose", "tracking"]);
    check("challenge", &["data", "plant"]);
    check("lab", &["challenge", "data", "identify", "diagnose", "report"]);
    let known = [
        "core",
        "data",
        "plant",
        "challenge",
        "effects",
        "identify",
        "diagnose",
        "tracking",
        "report",
        "lab",
        "table",
        "board",
        "cli",
    ];
    for name in found.keys() {
        assert!(known.contains(&name.as_str()), "{name} is not in ARCHITECTURE.md");
    }
}

#[test]
fn val_the_plant_shares_nothing_with_the_models() {
    let plant = &dependencies()["plant"];
    assert!(!plant.contains("core") && !plant.contains("identify"), "{plant:?}");
}

#[test]
fn val_the_core_is_no_std_and_safe() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/core/src/lib.rs")).unwrap();
    assert!(text.contains("#![no_std]") && text.contains("#![forbid(unsafe_code)]"));
    assert!(!text.contains("extern crate alloc"));
}
