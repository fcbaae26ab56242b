//! What the tests that use the emulator share.

use std::path::{Path, PathBuf};

/// An image below `firmware/target/images`; none, and said so, where it or QEMU is missing. With `HYSTERON_EMULATOR` set nothing is
/// skipped.
pub(crate) fn image(name: &str) -> Option<PathBuf> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/target/images");
    let image = Path::new(folder).join(name);
    let emulator = std::process::Command::new("qemu-system-arm").arg("--version").output();
    if image.is_file() && emulator.is_ok() {
        return Some(image);
    }
    let missing = format!("no image {} or no qemu-system-arm", image.display());
    assert!(std::env::var_os("HYSTERON_EMULATOR").is_none(), "{missing}");
    eprintln!("skipped: {missing}; run `cargo xtask test`");
    None
}
