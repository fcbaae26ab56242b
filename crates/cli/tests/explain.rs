//! `explain` as a user meets it.
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

/// Every effect that is listed has every part of an explanation, and a page with pictures that fetches nothing.
#[test]
fn val_every_effect_has_a_whole_page() {
    let place = tempfile::tempdir().unwrap();
    let (code, text) = hysteron(place.path(), &["explain", "--json"]);
    let list: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    assert!(code == 0 && list.len() >= 15, "{text}");
    for effect in list {
        let name = effect["effect"].as_str().unwrap();
        let (code, text) = hysteron(place.path(), &["explain", name, "--json", "-o", "page.html"]);
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(code, 0, "{name}");
        for part in [
            "summary",
            "equation",
            "source",
            "shows",
            "mistaken_for",
            "separated_by",
            "compensated_by",
        ] {
            assert!(json[part].as_str().unwrap().len() > 10, "{name}: {part}");
        }
        let page = fs::read_to_string(place.path().join("page.html")).unwrap();
        assert_eq!(page.matches("<figure>").count(), 3, "{name}");
        assert!(!page.contains("http://") || !page.contains("src="), "{name}");
    }
}

/// A stage whose rate dependence is a delay, on the user's own records: the page has the fall of the error and the delay found.
#[test]
fn val_on_own_records() {
    let place = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let (code, text) = hysteron(place.path(), args);
        assert_eq!(code, 0, "{args:?}: {text}");
        text
    };
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
    let text = run(&["explain", "delay", "stage", "model.toml", "--json", "-o", "page.html"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let percent = |when: &str| json["own_data"][when]["validate_percent"].as_f64().unwrap();
    assert!(percent("after") < 0.5 * percent("before"), "{text}");
    // 14.9 us of delay and 59.0 us of filter, 10 us of hold: all of it reads as one delay of 84 us up to 503 Hz; a tenth is left
    // to the filter's falling gain and the coarse loop.
    let delay_s = json["own_data"]["parameters"][0]["value"].as_f64().unwrap();
    assert!((delay_s - 84e-6).abs() < 8.4e-6, "{delay_s}");
    let page = fs::read_to_string(place.path().join("page.html")).unwrap();
    assert!(page.contains("On your records") && page.matches("<figure>").count() == 5);
}

#[test]
fn refuse_what_is_not_in_the_catalogue() {
    let place = tempfile::tempdir().unwrap();
    for (args, says) in [
        (&["explain", "gremlins"][..], "the catalogue has"),
        (&["explain", "delay", "stage"], "MODEL"),
        (&["explain", "-o", "page.html"], "EFFECT"),
        (&["explain", "delay", "nowhere", "nothing.toml"], "nothing.toml"),
    ] {
        let (code, text) = hysteron(place.path(), args);
        assert!(code == 2 && text.contains(says), "{args:?}: {text}");
    }
}
