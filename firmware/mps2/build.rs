//! Memory layout and link arguments: here and not in RUSTFLAGS, which an environment variable would replace.

use std::{env, fs, path::PathBuf};

/// QEMU's mps2-an386: 4 MB of code at 0, 4 MB of data at 0x2000_0000 (ARM AN386, section 3.1).
const MEMORY: &str =
    "MEMORY\n{\n  FLASH : ORIGIN = 0x00000000, LENGTH = 4M\n  RAM : ORIGIN = 0x20000000, LENGTH = 4M\n}\n";

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(env::var_os("OUT_DIR").ok_or(std::io::ErrorKind::NotFound)?);
    fs::write(folder.join("memory.x"), MEMORY)?;
    // The interrupts are named in the vector table itself.
    fs::write(folder.join("device.x"), "")?;
    println!("cargo::rustc-link-search={}", folder.display());
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rerun-if-changed=build.rs");
    Ok(())
}
