//! Memory layout and link arguments: here and not in RUSTFLAGS, which an environment variable would replace.

use std::net::Ipv4Addr;
use std::{env, fs, path::Path, path::PathBuf};

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
    place(&folder)?;
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

/// The board's address on its cable, as `HYSTERON_ADDRESS` has it.
fn place(folder: &Path) -> std::io::Result<()> {
    const OTHERWISE: &str = "192.168.7.2/24";
    println!("cargo::rerun-if-env-changed=HYSTERON_ADDRESS");
    let text = env::var("HYSTERON_ADDRESS").unwrap_or_else(|_| OTHERWISE.to_owned());
    let parts = text.split_once('/');
    let parsed =
        parts.and_then(|(address, prefix)| Some((address.parse::<Ipv4Addr>().ok()?, prefix.parse::<u8>().ok()?)));
    let (address, prefix) = parsed.filter(|(_, prefix)| (1..=30).contains(prefix)).ok_or_else(|| {
        std::io::Error::other(format!(
            "HYSTERON_ADDRESS is {text}; an address with the bits of its network from 1 to 30 is allowed, as {OTHERWISE}"
        ))
    })?;
    let source = format!(
        "/// The board's address on its cable.\nconst ADDRESS: [u8; 4] = {:?};\n/// Bits of it that are the network's.\nconst PREFIX: u8 = {prefix};\n",
        address.octets()
    );
    fs::write(folder.join("place.rs"), source)
}
