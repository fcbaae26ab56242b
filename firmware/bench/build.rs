//! Compiles the C of the comparison and links it; link arguments as in `mps2`.

use std::env;
use std::path::PathBuf;
use std::process::{Command, exit};

/// Name, plays, whether only the prefix is touched, flags after `-O3`.
const VARIANTS: [(&str, &str, &str, &[&str]); 8] = [
    ("c_10", "10", "0", &[]),
    ("c_10_exact", "10", "0", &["-ffp-contract=off"]),
    ("c_10_fast", "10", "0", &["-ffast-math"]),
    ("c_10_prefix", "10", "1", &[]),
    ("c_10_prefix_exact", "10", "1", &["-ffp-contract=off"]),
    ("c_100", "100", "0", &[]),
    ("c_100_prefix", "100", "1", &[]),
    ("c_100_prefix_exact", "100", "1", &["-ffp-contract=off"]),
];

fn main() {
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=c/tick.c");
    println!("cargo::rerun-if-env-changed=HYSTERON_CORE");
    let folder = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_else(|| refuse("cargo did not set OUT_DIR")));
    let core = match env::var("HYSTERON_CORE").as_deref() {
        Ok("cortex-m7") => ["-mcpu=cortex-m7", "-mfpu=fpv5-d16"],
        _ => ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"],
    };
    for (name, plays, prefix, flags) in VARIANTS {
        let object = folder.join(format!("{name}.o"));
        let compiled = Command::new("arm-none-eabi-gcc")
            .args([
                "-c",
                "-O3",
                "-std=gnu11",
                "-Wall",
                "-Wextra",
                "-Werror",
                "-ffreestanding",
                "-mthumb",
                "-mfloat-abi=hard",
            ])
            .args(core)
            .args(flags)
            .args([
                format!("-DNAME={name}"),
                format!("-DPLAYS={plays}"),
                format!("-DPREFIX={prefix}"),
            ])
            .arg("c/tick.c")
            .arg("-o")
            .arg(&object)
            .status();
        match compiled {
            Ok(status) if status.success() => println!("cargo::rustc-link-arg-bins={}", object.display()),
            Ok(status) => refuse(&format!("arm-none-eabi-gcc: {status}")),
            Err(error) => refuse(&format!(
                "cannot start arm-none-eabi-gcc: {error}; install it (Debian: apt-get install gcc-arm-none-eabi)"
            )),
        }
    }
}

fn refuse(reason: &str) -> ! {
    println!("cargo::error={reason}");
    exit(1);
}
