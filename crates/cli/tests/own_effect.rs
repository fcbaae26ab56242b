//! Effect files as a user meets them: explained, diagnosed, added; the model file stands for itself.
#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

use assert_cmd::Command;
use std::fs;
use std::path::Path;

fn hysteron(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(folder)
        .args(args)
        .output()
        .unwrap();
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    (output.status.code().unwrap(), text)
}

/// A lag of the user's own before the hysteresis, on a stage whose rate dependence is a delay and a filter.
const LAG: &str = r#"
name = "my-lag"
place = "amplifier"
summary = "The amplifier charges the stack through a resistance."
output = "z"
[[parameter]]
name = "tau"
unit = "s"
what = "time constant"
min = 1e-6
max = 1e-2
[[state]]
name = "z"
at_rest = "u"
rate = "(u - z) / tau"
"#;

#[test]
fn val_from_the_file_to_the_model() {
    let place = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let (code, text) = hysteron(place.path(), args);
        assert_eq!(code, 0, "{args:?}: {text}");
        text
    };
    fs::write(place.path().join("my-lag.toml"), LAG).unwrap();
    run(&[
        "simulate",
        "--stage",
        "paper-delay",
        "--excitation",
        "sine:hz=11,periods=2",
        "--excitation",
        "sine:hz=503,periods=5",
        "--validate",
        "sine:hz=211,periods=4",
        "-o",
        "stage",
    ]);
    run(&["fit", "stage", "--model", "mpi", "-o", "model.toml"]);
    let text = run(&["explain", "./my-lag.toml", "--json", "-o", "page.html"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(
        json["effect"] == "my-lag" && json["example"]["differs_percent"].as_f64().unwrap() > 1.0,
        "{text}"
    );
    let page = fs::read_to_string(place.path().join("page.html")).unwrap();
    assert_eq!(page.matches("<figure>").count(), 3);
    let diagnose = ["diagnose", "stage", "model.toml", "--effect", "my-lag.toml"];
    let text = run(&[&diagnose[..], &["--json", "--page", "missing.html"]].concat());
    let page = fs::read_to_string(place.path().join("missing.html")).unwrap();
    // The shares of all, and a picture of each that counts, the effect of one's own among them.
    let pictures = page.matches("with it, everything fitted anew").count();
    assert!((3..=5).contains(&pictures), "{pictures}");
    assert!(page.contains("without my-lag and with it"), "no picture of my-lag");
    assert!(page.contains(&format!("hysteron {} --page missing.html", diagnose.join(" "))));
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let entry = json["ranking"]
        .as_array()
        .unwrap()
        .iter()
        .find(|entry| entry["effect"] == "my-lag");
    // 84 us of delay and filter are a lag of as much up to 211 Hz.
    let parameter = &entry.unwrap()["parameters"][0];
    assert!(parameter["name"] == "tau" && parameter["unit"] == "s", "{text}");
    let tau_s = parameter["value"].as_f64().unwrap();
    assert!((5e-5..1.5e-4).contains(&tau_s), "{tau_s}");
    let text = run(&[
        "add",
        "./my-lag.toml",
        "stage",
        "model.toml",
        "-o",
        "model2.toml",
        "--json",
    ]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let percent = |when: &str| json[when]["validate_percent"].as_f64().unwrap();
    assert!(
        json["effect"] == "my-lag" && percent("after") < 0.5 * percent("before"),
        "{text}"
    );
    // The model file alone is enough.
    fs::remove_file(place.path().join("my-lag.toml")).unwrap();
    run(&["compare", "stage", "model2.toml"]);
    let text = run(&["ladder", "model2.toml"]);
    assert!(text.contains("+ my-lag"), "{text}");
    run(&["report", "stage", "model2.toml", "-o", "report.html"]);
}

#[test]
fn refuse_with_file_field_and_what_is_allowed() {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(place.path().join(name), text).unwrap();
    write("good.toml", LAG);
    write("name.toml", &LAG.replace("(u - z)", "(x - z)"));
    write("syntax.toml", &LAG.replace("min = 1e-6", "min = "));
    write("place.toml", &LAG.replace("amplifier", "hysteresis"));
    for (args, says) in [
        (&["explain", "name.toml"][..], "state `z`: rate"),
        (&["explain", "name.toml"], "unknown name `x`"),
        (&["explain", "syntax.toml"], "line 10"),
        (&["explain", "place.toml"], "the plays have a memory"),
        (&["explain", "nowhere.toml"], "nowhere.toml"),
        (
            &["learn", "stage", "--effect", "good.toml", "--effect", "good.toml"],
            "another effect file names its effect",
        ),
        (&["learn", "stage", "--effect", "name.toml"], "unknown name"),
    ] {
        let (code, text) = hysteron(place.path(), args);
        // The terminal's line breaks stand between words.
        let flat = text
            .replace(['│', '\n'], " ")
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        assert!(code == 2 && flat.contains(says), "{args:?}: {text}");
    }
}
