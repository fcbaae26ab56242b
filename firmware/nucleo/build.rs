//! Memory layout and link arguments: here and not in RUSTFLAGS, which an environment variable would replace.

use std::{env, fs, path::PathBuf};

/// The reference board's layout lies at the root.
const H743ZI: &str = "../../memory.x";
const G474RE: &str = "memory-g474re.x";

fn main() -> std::io::Result<()> {
    let layout = if env::var_os("CARGO_FEATURE_H743ZI").is_some() {
        H743ZI
    } else {
        G474RE
    };
    let folder = PathBuf::from(env::var_os("OUT_DIR").ok_or(std::io::ErrorKind::NotFound)?);
    fs::copy(layout, folder.join("memory.x"))?;
    fs::copy("fast.x", folder.join("fast.x"))?;
    println!("cargo::rustc-link-search={}", folder.display());
    // First who asks gets a section.
    println!("cargo::rustc-link-arg-bins=-Tfast.x");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    for file in ["build.rs", "fast.x", H743ZI, G474RE] {
        println!("cargo::rerun-if-changed={file}");
    }
    Ok(())
}
