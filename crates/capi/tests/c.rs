//! The header is made from the library, and a program in C gets the bits of the law in Rust.
#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

use hysteron_core::surroundings::LoopInput;
use hysteron_table::Table;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Samples of the comparison: two seconds at 50 kHz.
const SAMPLES: usize = 100_000;

/// A table with feedback, creep, a second mode and the other axis.
const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/tables/tracking-8k.toml");

/// A host as one would write it: loads, resets, steps, frees, and gives on every refusal its reason.
const HOST: &str = r#"
#include "hysteron.h"
#include <stdio.h>

int main(int n, char **names) {
    char message[400];
    struct HysteronInput in;
    struct HysteronLaw *law;
    float out[2];
    int limited;
    FILE *from, *to;
    if (n != 4) {
        return 1;
    }
    law = hysteron_load(names[1], message, sizeof message);
    if (!law) {
        puts(message);
        return 2;
    }
    from = fopen(names[2], "rb");
    to = fopen(names[3], "wb");
    if (!from || !to) {
        return 3;
    }
    printf("%.0f Hz, %d samples ahead\n", hysteron_sample_rate_hz(law), (int)hysteron_samples_ahead(law));
    in.reference_um = 1.0f;
    in.measured_um = in.voltage2_v = in.motion2_um = in.temperature_c = 0.0f;
    hysteron_step(law, &in);
    hysteron_reset(law, 22.0f);
    while (fread(&in, sizeof in, 1, from) == 1) {
        out[0] = hysteron_step(law, &in);
        out[1] = hysteron_due_um(law);
        limited = hysteron_limited(law);
        fwrite(out, sizeof out, 1, to);
        fwrite(&limited, sizeof limited, 1, to);
    }
    hysteron_free(law);
    hysteron_free(NULL);
    hysteron_reset(NULL, 0.0f);
    if (hysteron_step(NULL, &in) != 0.0f || hysteron_limited(NULL) || hysteron_load(NULL, NULL, 0)) {
        return 4;
    }
    return fclose(to);
}
"#;

/// The header as cbindgen makes it.
fn header() -> String {
    let config = cbindgen::Config {
        language: cbindgen::Language::C,
        cpp_compat: true,
        include_guard: Some("HYSTERON_H".to_owned()),
        header: Some("/* Made by cbindgen from crates/capi/src/lib.rs; do not edit. */".to_owned()),
        documentation_style: cbindgen::DocumentationStyle::C99,
        usize_is_size_t: true,
        ..cbindgen::Config::default()
    };
    let builder = cbindgen::Builder::new().with_config(config);
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/src/lib.rs");
    let mut text = Vec::new();
    builder.with_src(source).generate().unwrap().write(&mut text);
    String::from_utf8(text).unwrap()
}

#[test]
fn golden_the_header_is_the_librarys() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/include/hysteron.h");
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        std::fs::write(path, header()).unwrap();
    }
    let found = std::fs::read_to_string(path).unwrap();
    assert!(
        found == header(),
        "UPDATE_EXPECT=1 cargo test -p hysteron-capi writes it anew"
    );
}

/// Where cargo lays the library that the tests are built beside.
fn built() -> PathBuf {
    let program = std::env::current_exe().unwrap();
    program.parent().unwrap().to_owned()
}

/// Compiles the host against header and library.
fn compile(folder: &Path) {
    std::fs::write(folder.join("host.c"), HOST).unwrap();
    let library = built();
    let output = Command::new("cc")
        .args(["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-I"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/include"))
        .args(["host.c", "-o", "host", "-L"])
        .arg(&library)
        .arg(format!("-Wl,-rpath,{}", library.display()))
        .arg("-lhysteron_capi")
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Sines beyond the range, a reading behind them, the other axis; now and then a number that is none.
fn inputs() -> Vec<[f32; 5]> {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -3e38];
    (0..SAMPLES)
        .map(|k| {
            let t = k as f64 / 50_000.0;
            let sine = |hz: f64| (std::f64::consts::TAU * hz * t).sin();
            let reference = 9.0 + 7.0 * sine(7.0) + 2.5 * sine(313.0);
            let reading = reference - 0.05 * sine(1900.0);
            let mut now = [reference, reading, 60.0 * sine(3.0), 2.0 * sine(11.0), 22.0 + sine(0.5)].map(|x| x as f32);
            if k % 997 == 996 {
                now[k / 997 % 5] = bad[k / 997 % bad.len()];
            }
            now
        })
        .collect()
}

/// Command, reference that is due, and whether a limit was met.
type Row = (u32, u32, bool);

fn in_rust(inputs: &[[f32; 5]]) -> Vec<Row> {
    let table = Table::parse(&std::fs::read_to_string(TABLE).unwrap()).unwrap();
    let law = table.law_numbers().unwrap().unwrap().law::<f32>().unwrap();
    let mut state = law.rest(22.0);
    let step = |now: &[f32; 5]| {
        let command_v = law.step(
            &mut state,
            LoopInput {
                reference_ahead: now[0],
                measured: now[1],
                voltage2_ahead: now[2],
                motion2_ahead: now[3],
                temperature_c: now[4],
            },
        );
        (command_v.to_bits(), state.due().to_bits(), state.limited())
    };
    inputs.iter().map(step).collect()
}

#[test]
fn val_a_host_in_c_gets_the_bits_of_the_law() {
    let folder = tempfile::tempdir().unwrap();
    compile(folder.path());
    let inputs = inputs();
    let bytes: Vec<u8> = inputs.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(folder.path().join("in"), bytes).unwrap();
    let host = |file: &Path| {
        Command::new(folder.path().join("host"))
            .arg(file)
            .args(["in", "out"])
            .current_dir(folder.path())
            .output()
            .unwrap()
    };
    let done = host(Path::new(TABLE));
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    assert_eq!(String::from_utf8_lossy(&done.stdout), "50000 Hz, 16 samples ahead\n");
    let out = std::fs::read(folder.path().join("out")).unwrap();
    let word = |chunk: &[u8], place: usize| u32::from_le_bytes(chunk[4 * place..4 * place + 4].try_into().unwrap());
    let there: Vec<Row> = out
        .chunks_exact(12)
        .map(|chunk| (word(chunk, 0), word(chunk, 1), word(chunk, 2) != 0))
        .collect();
    let here = in_rust(&inputs);
    assert_eq!(there.len(), SAMPLES);
    let differ = here.iter().zip(&there).position(|(here, there)| here != there);
    assert_eq!(differ, None, "sample {differ:?}");
    assert!(here.iter().any(|row| row.2) && here.iter().any(|row| !row.2));
    // What is no controller is refused in words.
    let no_law = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../firmware/tables/paper-rate-mrpi.toml"
    );
    std::fs::write(folder.path().join("text.toml"), "format = 1\n").unwrap();
    for (file, words) in [
        ("absent.toml", "absent.toml: No such file"),
        ("text.toml", "write a controller with `hysteron design`"),
        (no_law, "a table without a complete law"),
    ] {
        let refused = host(Path::new(file));
        assert_eq!(refused.status.code(), Some(2), "{refused:?}");
        let said = String::from_utf8_lossy(&refused.stdout);
        assert!(said.contains(words), "{file}: {said}");
    }
}

#[test]
fn val_a_reason_is_cut_at_a_character() {
    let folder = tempfile::tempdir().unwrap();
    // No such file, by a name of characters of two bytes.
    let path = folder.path().join("ö".repeat(40));
    let path = std::ffi::CString::new(path.to_str().unwrap()).unwrap();
    for size in [1, 2, 60, 61, 62, 63] {
        let mut message = vec![b'#'; 80];
        #[expect(unsafe_code, reason = "the interface is C's")]
        // SAFETY: a string that ends in zero, and room for `size` bytes.
        let law = unsafe { hysteron_capi::hysteron_load(path.as_ptr(), message.as_mut_ptr().cast(), size) };
        assert!(law.is_null());
        let end = message.iter().position(|byte| *byte == 0).unwrap();
        assert!(end < size && end + 2 >= size.min(3), "{size}: {end}");
        assert!(std::str::from_utf8(&message[..end]).is_ok());
        assert!(message[size..].iter().all(|byte| *byte == b'#'));
    }
}
