//! `add` and `ladder` on the real binary: an effect comes in, the error falls, the model remembers.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use assert_cmd::Command;
use hysteron_data::{Dataset, Overwrite, Record, Role, write_dataset};
use hysteron_plant::{Stage, preset};
use serde_json::Value;
use std::path::Path;

fn hysteron(folder: &Path, arguments: &[&str], code: i32) -> (String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(folder)
        .args(arguments)
        .assert()
        .code(code)
        .get_output()
        .clone();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let folded = text(output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    (text(output.stdout), folded)
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&hysteron(folder, arguments, 0).0).unwrap()
}

/// Sines of the preset whose whole rate dependence is a delay of about 100 us, and an MPI model of them.
fn delayed() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let records = [
        (10.0, 2e-4, Role::Identify),
        (200.0, 2e-5, Role::Identify),
        (500.0, 2e-5, Role::Validate),
    ]
    .map(|(f, period_s, role)| {
        let a_period = (1.0_f64 / f / period_s).round() as usize;
        let drive = |k: usize| 13.0 - 13.0 * (std::f64::consts::TAU * k as f64 / a_period as f64).cos();
        let voltage_v: Vec<f64> = (0..3 * a_period).map(drive).collect();
        let mut stage = Stage::new(&preset::paper_delay(), 1).unwrap();
        let run = stage.run(&voltage_v, period_s).unwrap();
        Record {
            file: format!("sine-{f}hz.csv"),
            role,
            excitation: format!("sine {f} Hz"),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    });
    let dataset = Dataset {
        name: "delayed".into(),
        records: records.to_vec(),
        ..Dataset::default()
    };
    write_dataset(&dataset, &folder.path().join("stage"), Overwrite::Refuse).unwrap();
    hysteron(
        folder.path(),
        &["fit", "stage", "--model", "mpi", "-o", "model.toml"],
        0,
    );
    folder
}

#[test]
fn val_the_error_falls_and_the_ladder_remembers() {
    let folder = delayed();
    let at = folder.path();
    let added = json(
        at,
        &["add", "delay", "stage", "model.toml", "-o", "model2.toml", "--json"],
    );
    let percent = |value: &Value| value["validate_percent"].as_f64().unwrap();
    let (before, after) = (percent(&added["before"]), percent(&added["after"]));
    // 100 us at 500 Hz are a third of a radian: some ten percent of peak to peak, nearly all of it the delay's. Sines of one amplitude
    // show one loop: the family of plays stays.
    assert!(before > 5.0 && after < 0.2 * before, "{before} {after}");
    for record in added["records"].as_array().unwrap() {
        for moment in ["before", "after"] {
            assert!(
                record[moment]["percent"].is_f64() && record[moment]["rms_um"].is_f64(),
                "{record}"
            );
        }
    }
    // What add says is what compare says.
    let compared = json(at, &["compare", "stage", "model2.toml", "--json"]);
    let compared = compared["validate"]["nrmse_percent"].as_f64().unwrap();
    assert!((compared - after).abs() < 1e-9, "{compared} {after}");

    hysteron(
        at,
        &["add", "resonance", "stage", "model2.toml", "-o", "model3.toml"],
        0,
    );
    let ladder = json(at, &["ladder", "model3.toml", "--json", "-o", "page.html"]);
    let steps = ladder["steps"].as_array().unwrap();
    let told: Vec<_> = steps
        .iter()
        .map(|step| (step["change"].as_str().unwrap(), step["what"].as_str().unwrap()))
        .collect();
    assert_eq!(told, [("fitted", "mpi"), ("added", "delay"), ("added", "resonance")]);
    assert_eq!(percent(&steps[0]), before);
    assert_eq!(percent(&steps[1]), after);
    assert!(ladder["noise_rms_um"].as_f64().unwrap() > 0.0);
    let page = std::fs::read_to_string(at.join("page.html")).unwrap();
    assert!(page.contains("+ delay") && page.contains("<svg"));
    assert_eq!(page.matches("http").count(), page.matches("http://www.w3.org/").count());
}

#[test]
fn refuse_what_cannot_be_added_or_shown() {
    let folder = delayed();
    let at = folder.path();
    let check = |arguments: &[&str], parts: &[&str]| {
        let (_, text) = hysteron(at, arguments, 2);
        assert!(!text.contains("panicked"), "{arguments:?}: {text}");
        for part in parts {
            assert!(text.contains(part), "{arguments:?}: `{part}` is not in: {text}");
        }
    };
    check(
        &["ladder", "model.toml"],
        &["nothing was added", "hysteron add EFFECT DATA model.toml"],
    );
    check(
        &["add", "gravity", "stage", "model.toml", "-o", "x.toml"],
        &["gravity", "delay", "creep"],
    );
    check(
        &["add", "cross-coupling", "stage", "model.toml", "-o", "x.toml"],
        &["cross-coupling", "voltage2_v"],
    );
    hysteron(at, &["add", "delay", "stage", "model.toml", "-o", "model2.toml"], 0);
    check(
        &["add", "delay", "stage", "model2.toml", "-o", "x.toml"],
        &["the model has it already"],
    );
    let inverse = [
        "fit",
        "stage",
        "--model",
        "mpi",
        "--direction",
        "inverse",
        "-o",
        "inverse.toml",
    ];
    hysteron(at, &inverse, 0);
    check(
        &["add", "delay", "stage", "inverse.toml", "-o", "x.toml"],
        &["direction forward"],
    );
    assert!(!at.join("x.toml").exists());
}
