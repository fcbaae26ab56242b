//! Compiles the C of the comparison, generates the C of the table's law, and links both; link arguments as in `mps2`.

use std::path::{Path, PathBuf};
use std::process::{Command, exit};
use std::{env, fs};

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

/// The table's law as `export --format c` writes it: its name, and flags after `-O3`.
const GENERATED: [(&str, &[&str]); 2] = [("law_exact", &["-ffp-contract=off"]), ("law_fused", &[])];

fn main() {
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=c");
    println!("cargo::rerun-if-env-changed=HYSTERON_CORE");
    println!("cargo::rerun-if-env-changed=HYSTERON_TABLE");
    let folder = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_else(|| refuse("cargo did not set OUT_DIR")));
    let core = match env::var("HYSTERON_CORE").as_deref() {
        Ok("cortex-m7") => ["-mcpu=cortex-m7", "-mfpu=fpv5-d16"],
        _ => ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"],
    };
    for (name, plays, prefix, flags) in VARIANTS {
        let defined = [
            format!("-DNAME={name}"),
            format!("-DPLAYS={plays}"),
            format!("-DPREFIX={prefix}"),
        ];
        let object = folder.join(format!("{name}.o"));
        compile(&core, flags, &defined, Path::new("c/tick.c"), &object);
        println!("cargo::rustc-link-arg-bins={}", object.display());
    }
    for (name, flags) in GENERATED {
        generate(&folder, name);
        let defined = [
            format!("-DLAW={name}"),
            format!("-DHEADER=\"{name}.h\""),
            format!("-I{}", folder.display()),
            "-Ic/include".to_owned(),
        ];
        for (source, object) in [
            (folder.join(format!("{name}.c")), "law"),
            ("c/law_tick.c".into(), "tick"),
        ] {
            let object = folder.join(format!("{name}_{object}.o"));
            compile(&core, flags, &defined, &source, &object);
            println!("cargo::rustc-link-arg-bin=blocks={}", object.display());
        }
    }
}

/// Writes the first table's law as C.
fn generate(folder: &Path, name: &str) {
    let tables = env::var("HYSTERON_TABLE").unwrap_or_else(|_| "../tables/paper-rate-mrpi.toml".to_owned());
    let path = env::split_paths(&tables).next().unwrap_or_default();
    println!("cargo::rerun-if-changed={}", path.display());
    let text = fs::read_to_string(&path).unwrap_or_else(|error| refuse(&format!("{}: {error}", path.display())));
    let code = hysteron_table::Table::parse(&text).and_then(|table| table.c_code(&text, name));
    let code = code.unwrap_or_else(|error| refuse(&format!("{}: {error}", path.display())));
    for (end, text) in [("c", code.source), ("h", code.header)] {
        let path = folder.join(format!("{name}.{end}"));
        fs::write(&path, text).unwrap_or_else(|error| refuse(&format!("{}: {error}", path.display())));
    }
}

fn compile(core: &[&str], flags: &[&str], defined: &[String], source: &Path, object: &Path) {
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
        .args(defined)
        .arg(source)
        .arg("-o")
        .arg(object)
        .status();
    match compiled {
        Ok(status) if status.success() => {}
        Ok(status) => refuse(&format!("arm-none-eabi-gcc: {status}")),
        Err(error) => refuse(&format!(
            "cannot start arm-none-eabi-gcc: {error}; install it (Debian: apt-get install gcc-arm-none-eabi)"
        )),
    }
}

fn refuse(reason: &str) -> ! {
    println!("cargo::error={reason}");
    exit(1);
}
