//! From a model to a controller as a user meets it, and what is refused: the reason, what to do, exit code 2.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

#[path = "../../board/tests/common/mod.rs"]
mod emulator;
mod small_board;
mod three_plays;

use assert_cmd::Command;
use hysteron_board::upload::Upload;
use hysteron_control::commands::commands;
use hysteron_control::design::Controller;
use hysteron_control::reference::Reference;
use hysteron_core::law_numbers::LawNumbers;
use hysteron_data::read_dataset;
use hysteron_firmware::table;
use hysteron_firmware::wire::Order;
use hysteron_plant::{CrossCoupling, Stage, StageConfig, preset};
use hysteron_table::Table;
use small_board::SmallBoard;
use std::collections::BTreeMap;
use three_plays::{HUM, Named, RISING, model};

/// Runs the binary; it must end with 2 and say all of the words.
fn refused(args: &[&str], words: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(args)
        .output()
        .unwrap();
    // The box that errors are drawn in breaks lines: compare without white space and its bars.
    let plain = |text: &str| {
        text.chars()
            .filter(|c| !c.is_whitespace() && *c != '│')
            .collect::<String>()
    };
    let said = plain(&String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    for word in words {
        assert!(said.contains(&plain(word)), "{args:?} does not say `{word}`: {said}");
    }
}

#[test]
fn refuse_stages_and_ranges_that_are_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("records");
    refused(
        &["campaign", "--stage", "8 kHz", "-o", path.to_str().unwrap()],
        &["there is no stage `8 kHz`", "paper-rate, paper-delay, 8k, 2.5k, 739"],
    );
    assert!(!path.exists());
    let text = folder.path().join("controller.toml");
    std::fs::write(&text, "format = 1\n").unwrap();
    let text = text.to_str().unwrap();
    refused(&["track", text, "--stage", "8k"], &["missing field", "hysteron design"]);
    refused(&["track", "no-such-file.toml", "--stage", "8k"], &["no-such-file.toml"]);
    refused(
        &["design", text, "--margin", "1"],
        &["--margin 1: a peak of the sensitivity from 1.2"],
    );
    refused(
        &[
            "campaign",
            "--top-v",
            "15000",
            "--rate-hz",
            "50000",
            "-o",
            path.to_str().unwrap(),
        ],
        &["--top-v 15000: give 1 to 1000 V"],
    );
}

#[test]
fn refuse_to_design_without_records_of_a_campaign() {
    let folder = tempfile::tempdir().unwrap();
    let one = folder.path().join("one.csv");
    std::fs::write(&one, "time_s,voltage_v,position_um\n0,0,0\n0.1,1,0.3\n0.2,2,0.5\n").unwrap();
    refused(
        &["design", one.to_str().unwrap()],
        &[
            "the dataset has no small multisine",
            "`hysteron campaign` records what is needed",
        ],
    );
}

fn mode(hz: f64, damping: f64) -> [Named; 5] {
    [
        ("frequency", hz, "Hz"),
        ("damping", damping, ""),
        ("frequency_2", 20e3, "Hz"),
        ("damping_2", 0.02, ""),
        ("share_2", 0.0, ""),
    ]
}

/// Time constants of amplifier and sensor (s), growth of the first (s/V) from 0 V.
fn lag([amplifier_s, sensor_s, per_v]: [f64; 3]) -> [Named; 4] {
    [
        ("amplifier_tau", amplifier_s, "s"),
        ("sensor_tau", sensor_s, "s"),
        ("tau_per_v", per_v, "s/V"),
        ("from_v", 0.0, "V"),
    ]
}

/// Everything that would make an inverse explode ends with the reason, what to do, and exit code 2; nothing is written.
#[test]
fn refuse_models_whose_inverse_would_explode() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    let out = folder.path().join("controller.toml");
    let check = |text: String, options: &[&str], words: &[&str]| {
        std::fs::write(&path, text).unwrap();
        let mut args = vec!["design", path.to_str().unwrap(), "-o", out.to_str().unwrap()];
        args.extend(options);
        refused(&args, words);
        assert!(!out.exists());
    };
    check(
        model(RISING, "resonance", &mode(800.0, 0.0)),
        &[],
        &[
            "mode 1 at 800 Hz has a damping ratio of 0",
            "record a longer small multisine",
        ],
    );
    check(
        model(RISING, "resonance", &mode(26e3, 0.02)),
        &[],
        &[
            "mode 1 at 26000 Hz lies above half the sample rate, 25000 Hz",
            "run the controller faster",
        ],
    );
    check(
        model(RISING, "resonance", &mode(800.0, 0.02)),
        &["--rate-hz", "1000"],
        &["mode 1 at 800 Hz lies above half the sample rate, 500 Hz"],
    );
    check(
        model([0.02, -0.11, 0.02], "", &[]),
        &[],
        &[
            "the hysteresis table does not invert",
            "the displacement goes back",
            "fit fewer plays",
        ],
    );
    check(
        model(RISING, "delay", &[("delay", 400e-6, "s")]),
        &[],
        &[
            "the latency of 400 us is longer than the preview of 320 us (16 samples)",
            "--reference live",
        ],
    );
    check(
        model(RISING, "first-order-lag", &lag([1.0, 0.0, 0.0])),
        &[],
        &["an amplifier's lag of 1000000 us cannot be undone", "identify again"],
    );
    check(
        model(RISING, "", &[]),
        &["--volts", "5,5"],
        &["--volts [5.0, 5.0]", "the lower first"],
    );
    check(model(RISING, "", &[]), &["--rate-hz", "0"], &["--rate-hz 0"]);
    let inverse = model(RISING, "", &[]).replace("\"forward\"", "\"inverse\"");
    let inverse = inverse
        .replace("input_unit = \"V\"", "input_unit = \"um\"")
        .replace("output_unit = \"um\"", "output_unit = \"V\"")
        .replace("unit = \"um/V\"", "unit = \"V/um\"")
        .replace("value = 0.0\nunit = \"um\"", "value = 0.0\nunit = \"V\"");
    check(inverse, &[], &["the model runs from position to voltage", "forward"]);
}

/// The controller's table has every number of its law: all but heat, which boards have no thermometer for, and the slew, which boards
/// limit.
fn exported(controller: &str, effect: &str) {
    let table = format!("{controller}.table");
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(["export", controller, "-o", &table, "--dac", "0,200", "--adc=-25,25"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{effect}: {said}");
    assert_eq!(said.contains("no thermometer"), effect == "thermal-drift", "{said}");
    let found = Table::parse(&std::fs::read_to_string(&table).unwrap()).unwrap();
    let designed = Controller::read(controller.as_ref()).unwrap().numbers().unwrap();
    let wanted = LawNumbers {
        heat: None,
        slew_v_per_s: found.slew_v_per_s,
        ..designed
    };
    assert_eq!(found.law_numbers().unwrap(), Some(wanted), "{effect}");
    refused(
        &[
            "export",
            controller,
            "-o",
            &table,
            "--dac",
            "0,200",
            "--adc=-25,25",
            "--cross",
            "0.9",
        ],
        &["controller.cross_um_per_um = 0.9: must lie in -0.5 to 0.5"],
    );
    refused(
        &["export", controller, "-o", &table, "--integral", "100"],
        &["--integral: the controller has its own rate, latency, modes and feedback"],
    );
}

/// Each effect of a model brings its compensator or is named as left out; and a controller file that was changed by hand is refused
/// as a model is.
#[test]
fn val_design_from_a_model_names_every_effect() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    let out = folder.path().join("controller.toml");
    let (path, out) = (path.to_str().unwrap(), out.to_str().unwrap());
    let creep = [
        ("first_tau", 0.1, "s"),
        ("share_1", 0.01, ""),
        ("share_2", 0.01, ""),
        ("share_3", 0.01, ""),
        ("share_4", 0.01, ""),
    ];
    let coupling = [
        ("gain", 0.003, "um/V"),
        ("lead", -1e-7, "um s/V"),
        ("play_weight", 0.001, "um/V"),
        ("threshold", 30.0, "V"),
    ];
    let sensor = [
        ("middle", 5.0, "um"),
        ("quadratic", 0.002, "1/um"),
        ("cubic", 0.0, "1/um^2"),
    ];
    let heat = [
        ("reference", 22.0, "degC"),
        ("tau", 100.0, "s"),
        ("shift", 0.3, "um/K"),
        ("gain", 0.001, "1/K"),
        ("rest_share", 0.0, ""),
    ];
    let growing = "lead that grows with the voltage, and reference through the sensor's lag";
    let cases: [(&str, &[Named], &str); 10] = [
        ("delay", &[("delay", 60e-6, "s")], "preview"),
        (
            "first-order-lag",
            &lag([60e-6, 30e-6, 0.0]),
            "lead, and reference through the sensor's lag",
        ),
        ("first-order-lag", &lag([60e-6, 30e-6, 4e-7]), growing),
        ("resonance", &mode(800.0, 0.02), "resonance inverse"),
        ("creep", &creep, "creep inverse"),
        ("mains-hum", &HUM, "hum learned in the loop"),
        ("cross-coupling", &coupling, "decoupling"),
        ("sensor-nonlinearity", &sensor, "sensor polynomial"),
        ("thermal-drift", &heat, "thermal gain"),
        ("backlash", &[("width", 0.05, "um")], ""),
    ];
    for (effect, parameters, by) in cases {
        std::fs::write(path, model(RISING, effect, parameters)).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
            .args(["design", path, "-o", out, "--open", "--json"])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{effect}: {said}");
        let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let found = &answer["effects"][0];
        assert_eq!(found["effect"], effect);
        assert_eq!(found["by"].as_str().unwrap_or(""), by, "{effect}");
        // The table that inverts three plays: 0.3 % of the range is a third of a volt.
        assert!(answer["inverse_misfit_percent"].as_f64().unwrap() < 0.3, "{answer}");
        exported(out, effect);
    }
    std::fs::write(path, model(RISING, "resonance", &mode(800.0, 0.02))).unwrap();
    hysteron(&["design", path, "-o", out, "--open"]);
    let changed = std::fs::read_to_string(out)
        .unwrap()
        .replace("damping = 0.02", "damping = 0.0");
    std::fs::write(out, changed).unwrap();
    refused(
        &["track", out, "--stage", "8k"],
        &["mode 1 at 800 Hz has a damping ratio of 0", "record a longer"],
    );
}

/// A model that no record of small signals stands behind gets no loop, but a word which would allow one; with the user's word for a stage that
/// has no mode it gets one, and where the word was wrong `track` says so.
#[test]
fn val_a_loop_goes_as_far_as_the_stage_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let [path, out] = ["model.toml", "controller.toml"].map(|name| folder.path().join(name).display().to_string());
    std::fs::write(&path, model(RISING, "", &[])).unwrap();
    let said = hysteron(&["design", &path, "-o", &out]);
    assert!(
        said.contains("none: no record of small signals tells")
            && said.contains("multisine:low_hz=20,high_hz=6250")
            && said.contains("--rigid HZ"),
        "{said}"
    );
    for wrong in ["5", "26000", "nan"] {
        refused(
            &["design", &path, "-o", &out, "--rigid", wrong],
            &["--rigid", "10 Hz to half the controller's rate, 25000 Hz"],
        );
    }
    let said = hysteron(&["design", &path, "-o", &out, "--rigid", "20000"]);
    assert!(said.contains("above 20000 Hz, by --rigid, your word"), "{said}");
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(["track", &out, "--stage", "739", "--alone", "--range", "3,8"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("UNSTABLE: it swings by itself") && said.contains("--open"),
        "{said}"
    );
}

/// Records of 0 to 100 V: what leaves them names the field, the value, what is covered, the option and how to widen it. Granted, every file
/// remembers it. Converters that nobody names are asked for.
#[test]
fn refuse_to_leave_the_records() {
    let folder = tempfile::tempdir().unwrap();
    let [path, out, table] =
        ["model.toml", "controller.toml", "table.toml"].map(|name| folder.path().join(name).display().to_string());
    let covered =
        "[covered]\nvoltage_v = [0.0, 100.0]\nposition_um = [0.0, 12.0]\nswing_hz = 100.0\nsample_rate_hz = 50000.0\n";
    std::fs::write(&path, model(RISING, "", &[]) + covered).unwrap();
    refused(
        &["design", &path, "-o", &out, "--volts", "0,200"],
        &[
            "voltage 200 V; the records cover 0 to 100 V",
            "--volts LOW,HIGH",
            "record up to that voltage and fit again",
            "--beyond-records",
        ],
    );
    refused(
        &["design", &path, "-o", &out, "--rate-hz", "100000"],
        &["sample rate 100000 Hz; the records cover 0 to 50000 Hz", "--rate-hz"],
    );
    let said = hysteron(&["design", &path, "-o", &out]);
    assert!(
        said.contains(&format!("next: hysteron track {out} --model {path}")),
        "{said}"
    );
    refused(
        &["track", &out, "--stage", "8k", "--range", "3,15"],
        &["position 15 um; the records cover 0 to 12 um", "--range LOW,HIGH"],
    );
    refused(
        &["export", &out, "-o", &table],
        &[
            "--dac LOW,HIGH",
            "--adc LOW,HIGH",
            "dac_v in [known]",
            "adc_um in [known]",
            "--stage",
        ],
    );
    let ends = ["--dac", "0,200", "--adc=-25,25"];
    let said = hysteron(&[&["export", &out, "-o", &table], &ends[..]].concat());
    assert!(
        said.contains("dac 0 to 200 V, from --dac")
            && said.contains("amplifier 0 to 100 V, from the controller's own limits"),
        "{said}"
    );
    let text = std::fs::read_to_string(&table).unwrap();
    let found = Table::parse(&text).unwrap();
    assert_eq!(found.output_max_v, 100.0);
    let in_the_table = found.covered.unwrap();
    assert_eq!(
        (in_the_table.voltage_v, in_the_table.swing_hz),
        (Some([0.0, 100.0]), Some(100.0))
    );
    // Granted.
    let said = hysteron(&["design", &path, "-o", &out, "--volts", "0,200", "--beyond-records"]);
    assert!(said.contains("BEYOND THE RECORDS: voltage 200 V"), "{said}");
    assert!(
        std::fs::read_to_string(&out)
            .unwrap()
            .contains("[[model.covered.beyond]]")
    );
    let header = folder.path().join("law.c").display().to_string();
    refused(
        &[&["export", &out, "--format", "c", "-o", &header], &ends[..]].concat(),
        &["voltage 199.99", "the records cover 0 to 100 V", "--amplifier LOW,HIGH"],
    );
    hysteron(
        &[
            &["export", &out, "--format", "c", "--beyond-records", "-o", &header],
            &ends[..],
        ]
        .concat(),
    );
    let header = std::fs::read_to_string(folder.path().join("law.h")).unwrap();
    assert!(
        header.contains("Records: voltage 0 to 100 V.") && header.contains("beyond the records: voltage 199.99"),
        "{header}"
    );
    // On the model itself: three plays inverted by a table of 24, and no noise.
    let answer = hysteron(&["track", &out, "--model", &path, "--json"]);
    let answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    for row in answer["rows"].as_array().unwrap() {
        assert_eq!(row["stable"], true);
        assert!(row["found_percent"].as_f64().unwrap() < 1.0, "{row}");
    }
    let said = hysteron(&["track", &out, "--model", &path]);
    assert!(said.contains("expected") && said.contains("found"), "{said}");
}

/// Records that swing to 100 Hz: above it no figure is claimed, wherever the controller runs, and no stage that can be hurt is played.
#[test]
fn refuse_to_expect_anything_above_the_frequencies_of_the_records() {
    let folder = tempfile::tempdir().unwrap();
    let [path, out] = ["model.toml", "controller.toml"].map(|name| folder.path().join(name).display().to_string());
    let covered = "[covered]\nposition_um = [0.0, 12.0]\nswing_hz = 100.0\n";
    std::fs::write(&path, model(RISING, "", &[]) + covered).unwrap();
    let design = ["design", &path, "-o", &out, "--open"];
    const BEYOND: &str = "beyond the records: reference frequency 500 Hz; the records cover 0 to 100 Hz: nothing is known there; record a \
                          sine over half the range at that frequency and fit again";
    let said = hysteron(&design);
    assert!(
        said.contains("100 Hz  open at least ") && said.contains(BEYOND),
        "{said}"
    );
    assert!(said.contains("large references to 100 Hz"), "{said}");
    let answer: serde_json::Value = serde_json::from_str(&hysteron(&[&design[..], &["--json"]].concat())).unwrap();
    assert!(answer["predicted"][1]["open_percent"].as_f64().is_some(), "{answer}");
    let beyond = &answer["predicted"][2];
    assert!(
        beyond["open_percent"].is_null() && beyond["beyond"]["value"] == 500.0,
        "{answer}"
    );
    let answer: serde_json::Value =
        serde_json::from_str(&hysteron(&["track", &out, "--model", &path, "--json"])).unwrap();
    for row in answer["rows"].as_array().unwrap() {
        let (expected, beyond) = (&row["expected_percent"], &row["beyond"]);
        match row["reference"].as_str().unwrap() {
            "10" | "100" => assert!(expected.is_number() && beyond.is_null(), "{row}"),
            "500" | "503" | "1000" => assert!(expected.is_null() && !beyond.is_null(), "{row}"),
            // Its third harmonic swings at 300 Hz.
            "complex-harmonic-100" => assert!(expected.is_null() && beyond["value"] == 300.0, "{row}"),
            _ => assert!(expected.is_null() && beyond.is_null(), "{row}"),
        }
    }
    let said = hysteron(&["track", &out, "--stage", "8k", "--alone", "--range", "3,8"]);
    assert!(said.contains(BEYOND), "{said}");
    // A stage that can be hurt is asked for those within; for none where all are beyond.
    let slow = covered.replace("100.0", "5.0");
    for (covered, is_any_within) in [(covered, true), (slow.as_str(), false)] {
        std::fs::write(&path, model(RISING, "", &[]) + covered).unwrap();
        hysteron(&design);
        for place in [["--board", "localhost:1"], ["--process", "no-such-program"]] {
            let track = ["track", &out, place[0], place[1], "--range", "3,8"];
            let none = ["reference frequency 10 Hz", "--beyond-records plays them all the same"];
            refused(&track, if is_any_within { &place[1..] } else { &none });
            refused(&[&track[..], &["--beyond-records"]].concat(), &[place[1]]);
        }
    }
}

/// On a stage that moves 2 % less than the model says, the gain has risen towards those 2 % at the end of 10 Hz, which lasts half a time
/// constant, and nothing is said of learning where none was asked for.
#[test]
fn val_what_the_law_has_learned_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let [path, weaker, out] =
        ["model.toml", "weaker.toml", "controller.toml"].map(|name| folder.path().join(name).display().to_string());
    let text = model(RISING, "", &[]);
    std::fs::write(&path, &text).unwrap();
    std::fs::write(
        &weaker,
        model(RISING.map(|weight| 0.98 * weight), "", &[]).replace("= 0.06\n", "= 0.0588\n"),
    )
    .unwrap();
    hysteron(&["design", &path, "-o", &out, "--open"]);
    let said = hysteron(&["track", &out, "--model", &weaker]);
    assert!(!said.contains("LEARNED"), "{said}");
    hysteron(&["design", &path, "-o", &out, "--open", "--adapt", "5"]);
    let said = hysteron(&["track", &out, "--model", &weaker]);
    assert!(
        said.contains("LEARNED WHILE IT RAN") && said.contains("gain within +-5.00 %, zero within +-"),
        "{said}"
    );
    let answer = hysteron(&["track", &out, "--model", &weaker, "--json"]);
    let answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["adaptation"]["gain_bound"], 0.05);
    let rows = answer["rows"].as_array().unwrap();
    let learned = |row: &serde_json::Value| row["adapted"]["gain_percent"].as_f64().unwrap();
    let slow = rows.iter().find(|row| row["reference"] == "10").unwrap();
    assert!((0.3..2.1).contains(&learned(slow)), "{slow}");
    assert!(rows.iter().all(|row| learned(row).abs() <= 5.0), "{rows:?}");
    let on_the_model: serde_json::Value =
        serde_json::from_str(&hysteron(&["track", &out, "--model", &path, "--json"])).unwrap();
    let slow = on_the_model["rows"]
        .as_array()
        .unwrap()
        .iter()
        .find(|row| row["reference"] == "10");
    assert!(learned(slow.unwrap()).abs() < 0.2, "{slow:?}");
    // On a simulated stage every run of the table is there, and the staircase.
    let said = hysteron(&["track", &out, "--stage", "8k", "--alone", "--range", "3,8"]);
    let table = said.split("LEARNED WHILE IT RAN").nth(1).unwrap();
    for run in ["sine 10 Hz", "sine 1000 Hz", "triangle 100 Hz", "staircase"] {
        assert!(table.contains(run), "{run}: {said}");
    }
}

/// Three plays know little of the stage, and are off by as much on the chip as here: 16-bit codes and f32 are a tenth of a percent of
/// that.
#[test]
fn val_a_controller_tracks_on_the_chip_as_it_does_here() {
    if emulator::image("mps2-an386").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (controller, page) = (path("controller.toml"), path("page.html"));
    let answered = |args: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
            .args(args)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{args:?}: {said}");
        output.stdout
    };
    // Three plays that are a sixth off on this stage, and say so: as far as they are off on its records.
    let (stage, foreign, rough) = (path("stage"), path("foreign.toml"), path("rough.toml"));
    let simulate = ["simulate", "--stage", "8k", "-o", &stage];
    let excitations = [
        "sine:hz=11,high_v=100,periods=3",
        "sine:hz=97,high_v=100,periods=10",
        "sine:hz=503,high_v=100,periods=50",
    ];
    let excited = excitations.iter().flat_map(|spec| ["--excitation", spec]);
    answered(&simulate.into_iter().chain(excited).collect::<Vec<_>>());
    let text = model(RISING, "delay", &[("delay", 60e-6, "s")]);
    std::fs::write(&foreign, &text).unwrap();
    let compared: serde_json::Value =
        serde_json::from_slice(&answered(&["compare", &stage, &foreign, "--json"])).unwrap();
    let records = compared["records"].as_array().unwrap().iter();
    let step = records.fold(
        "[[step]]\nchange = \"added\"\nwhat = \"delay\"\n".to_owned(),
        |step, record| {
            let (file, rms_um) = (&record["file"], &record["rms_um"]);
            format!("{step}[[step.record]]\nfile = {file}\nrole = \"identify\"\nrms = {rms_um}\n")
        },
    );
    std::fs::write(&rough, text.replace("[fitted_on]\n", &format!("{step}[fitted_on]\n"))).unwrap();
    let said = answered(&["design", &rough, "-o", &controller, "--open"]);
    let said = String::from_utf8(said).unwrap();
    assert!(said.contains("the model misses its records by up to 1.42"), "{said}");
    let firmware = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware");
    let on_chip = [
        "--emulator",
        "mps2-an386",
        "--firmware",
        firmware,
        "-o",
        &page,
        "--json",
    ];
    let track = [
        "track",
        &controller,
        "--stage",
        "8k",
        "--alone",
        "--range",
        "1,6",
        "--iterations",
        "1",
    ];
    let answer: serde_json::Value = serde_json::from_slice(&answered(&[&track[..], &on_chip].concat())).unwrap();
    let (here, there) = (&answer["controllers"][0], &answer["board"]["controllers"][0]);
    assert_eq!(there["loop"], "open");
    for (key, here) in here["rms_percent"].as_object().unwrap() {
        let (here, there) = (here.as_f64().unwrap(), there["rms_percent"][key].as_f64().unwrap());
        assert!(
            here > 1.0 && (there - here).abs() < 0.01 * here,
            "{key}: {here} % here, {there} % there"
        );
    }
    // The chip gets the period in 256 points; on the host it is one value a sample.
    let runs = |learned: &serde_json::Value| {
        let learned = learned.as_array().unwrap().clone();
        assert_eq!(learned.len(), 5);
        let percent = |run: &serde_json::Value| run["true_percent"].as_f64().unwrap();
        let each = |reference: &serde_json::Value| {
            reference["iterations"]
                .as_array()
                .unwrap()
                .iter()
                .map(percent)
                .collect()
        };
        learned.iter().map(each).collect::<Vec<Vec<f64>>>()
    };
    for (here, there) in runs(&answer["learned"]).iter().zip(&runs(&answer["board"]["learned"])) {
        assert!(there[1] < 0.5 * there[0], "{there:?}");
        assert!((there[0] / here[0] - 1.0).abs() < 0.01, "{here:?} {there:?}");
    }
    // Both axes by one image, open loop.
    let scans = |answer: &serde_json::Value| {
        let scans = answer["scans"].as_array().unwrap().iter();
        let open =
            scans.filter(|scan| scan["loop"] == "open" && scan["name"].as_str().unwrap().starts_with("complete"));
        // The last one of each kind is told of the other axis.
        let told: BTreeMap<String, f64> = open
            .map(|scan| {
                (
                    scan["scan"].as_str().unwrap().to_owned(),
                    scan["x_percent"].as_f64().unwrap(),
                )
            })
            .collect();
        told
    };
    let (here, there) = (scans(&answer), scans(&answer["board"]));
    assert_eq!(here.len(), 2);
    for (scan, here) in here {
        assert!(
            (there[&scan] / here - 1.0).abs() < 0.02,
            "{scan}: {here} {}",
            there[&scan]
        );
    }
    assert!(std::fs::read_to_string(page).unwrap().contains("The same as firmware"));
}

/// Three plays of some other stage, which say nothing of an error: the position is not where they have it, and the board stops.
#[test]
fn val_a_model_of_another_stage_is_stopped_by_the_chip() {
    if emulator::image("mps2-an386").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (foreign, controller, page) = (path("model.toml"), path("controller.toml"), path("page.html"));
    std::fs::write(&foreign, model(RISING, "delay", &[("delay", 60e-6, "s")])).unwrap();
    let designed = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(["design", &foreign, "-o", &controller, "--open"])
        .output()
        .unwrap();
    assert!(designed.status.success());
    let firmware = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware");
    let on_chip = ["--emulator", "mps2-an386", "--firmware", firmware, "-o", &page];
    let track = ["track", &controller, "--stage", "8k", "--alone", "--range", "1,6"];
    refused(
        &[&track[..], &on_chip].concat(),
        &[
            "with fault Disagreement: the position is further from where the model has it than the model's own error explains",
            "record this stage and design from that",
        ],
    );
}

/// What the binary says.
fn hysteron(args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(args)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{args:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// A board with a table of another stage plays the programme, open loop; what it commanded and read shows what is hidden in the stage
/// behind it, a delay and a filter. Then it plays slow references.
#[test]
fn val_a_campaign_by_a_board_shows_what_is_hidden() {
    let board = SmallBoard::at(Box::new(Stage::new(&preset::paper_delay(), 5).unwrap()));
    // Each campaign records 1.5 s of rest first; the programme has 15 pieces, the slow one 7.
    let from = serving(board, |run| if run == 0 || run == 15 { 80_000 } else { 0 });
    let folder = tempfile::tempdir().unwrap();
    let [records, slow, model_file] = ["records", "slow", "model.toml"].map(|name| folder.path().join(name));
    let campaign = ["campaign", "--board", &from, "--rest-s", "0", "-o"];
    let said = hysteron(&[&campaign[..], &[records.to_str().unwrap()]].concat());
    assert!(said.contains("known delay 17.5 us, computed"), "{said}");
    let dataset = read_dataset(&records).unwrap();
    assert_eq!(dataset.records.len(), 15);
    assert!((dataset.known.delay_s.unwrap() - 17.5e-6).abs() < 1e-7);
    let of = |name: &str| dataset.records.iter().find(|record| record.file == name).unwrap();
    assert!(of("rest.csv").voltage_v.iter().all(|v| v.abs() < 1e-2));
    let fast = of("sine-503hz.csv");
    // The ramp from the safe level is kept.
    assert!((fast.period_s - 20e-6).abs() < 1e-12);
    assert!(fast.voltage_v[0].abs() < 1.0, "{}", fast.voltage_v[0]);
    let (records, model_file) = (records.to_str().unwrap(), model_file.to_str().unwrap());
    hysteron(&[
        "fit",
        records,
        "--model",
        "play-polynomial",
        "--plays",
        "16",
        "-o",
        model_file,
    ]);
    let diagnosis: serde_json::Value =
        serde_json::from_str(&hysteron(&["diagnose", records, model_file, "--json"])).unwrap();
    let verdict = diagnosis["verdict"].as_str().unwrap();
    assert!(["delay", "first-order-lag"].contains(&verdict), "{diagnosis:#}");
    let again = [&campaign[..], &[records]].concat();
    refused(&again, &["already"]);
    // The slow ones.
    let slow = slow.to_str().unwrap();
    let said = hysteron(&[&campaign[..], &[slow, "--training"]].concat());
    assert!(said.contains(&format!("design model.toml --along {slow}")), "{said}");
    assert_eq!(read_dataset(&folder.path().join("slow")).unwrap().records.len(), 7);
    refused(
        &[
            "campaign",
            "--board",
            &from,
            "--range",
            "3,1",
            "-o",
            slow,
            "--overwrite",
        ],
        &["the lower first"],
    );
    refused(
        &["campaign", "--board", "localhost:1", "-o", slow, "--overwrite"],
        &["HOST:PORT"],
    );
}

/// A board of both axes lets the second go up and down beside the first, at a rate of its own: what of it reaches the first is in the records.
#[test]
fn val_a_campaign_by_a_board_of_both_axes_shows_what_couples() {
    let plain = preset::paper_rate();
    let ratio = 0.08;
    let coupled = StageConfig {
        cross_coupling: Some(CrossCoupling {
            ratio,
            lag_s: plain.amplifier.lag_s,
            hysteresis: plain.hysteresis.clone(),
            mode: None,
        }),
        ..plain.clone()
    };
    let stage = |config: &StageConfig, seed| Box::new(Stage::new(config, seed).unwrap());
    let board = SmallBoard::at_both([stage(&coupled, 5), stage(&plain, 6)]);
    let from = serving(board, |run| if run == 0 { 80_000 } else { 0 });
    let folder = tempfile::tempdir().unwrap();
    let records = folder.path().join("records");
    let records = records.to_str().unwrap();
    let slow = ["campaign", "--board", &from, "--rest-s", "0", "--training"];
    hysteron(&[&slow[..], &["-o", records]].concat());
    let dataset = read_dataset(records.as_ref()).unwrap();
    for record in &dataset.records {
        let beside_v = record.voltage2_v.as_ref().unwrap();
        assert_eq!(beside_v.len(), record.len());
        let most_v = beside_v.iter().fold(0.0_f64, |most, v| most.max(*v));
        let moves = record.file != "rest.csv";
        assert_eq!(most_v > 20.0, moves, "{}: {most_v} V", record.file);
    }
    // Five periods of the first, so many of the second as are the strongest in its command; the rise before them is cut off.
    let record = dataset
        .records
        .iter()
        .find(|record| record.file == "sine-007hz.csv")
        .unwrap();
    let length = (5.0 / 7.0 / record.period_s).round() as usize;
    let line = |values: &[f64], cycles: f64| {
        let values = &values[values.len() - length..];
        let turn = |k: usize| std::f64::consts::TAU * cycles * k as f64 / length as f64;
        let sum = |part: fn(f64) -> f64| values.iter().enumerate().map(|(k, v)| v * part(turn(k))).sum::<f64>();
        sum(f64::cos).hypot(sum(f64::sin))
    };
    let beside_v = record.voltage2_v.as_ref().unwrap();
    let cycles = [7.0, 11.0, 13.0, 17.0, 19.0];
    let cycles = cycles
        .into_iter()
        .max_by(|a, b| line(beside_v, *a).total_cmp(&line(beside_v, *b)))
        .unwrap();
    let gain = line(&record.position_um, 5.0) / line(&record.voltage_v, 5.0);
    let reached = line(&record.position_um, cycles) / line(beside_v, cycles) / gain;
    assert!((reached / ratio - 1.0).abs() < 0.15, "{cycles}: {reached}");
}

/// Plays of a stage that is not the model's: thresholds and weights of its own.
struct Plays {
    outputs: [f64; 4],
}

impl Plays {
    const THRESHOLDS: [f64; 4] = [6.0, 12.0, 25.0, 50.0];
    const WEIGHTS: [f64; 4] = [0.018, 0.01, 0.02, 0.012];

    fn step(&mut self, voltage_v: f64) -> f64 {
        let mut position_um = 0.062 * voltage_v;
        for ((output, r), weight) in self.outputs.iter_mut().zip(Self::THRESHOLDS).zip(Self::WEIGHTS) {
            *output = output.min(voltage_v).max(voltage_v - r);
            position_um += weight * *output;
        }
        position_um
    }
}

/// A model of the wrong thresholds and weights, a controller of it, and slow records along what it is asked to follow: with them it follows
/// another such reference several times better.
#[test]
fn val_slow_records_along_references_make_a_better_inverse() {
    let folder = tempfile::tempdir().unwrap();
    let [model_file, plain, better, along] =
        ["model.toml", "plain.toml", "better.toml", "along.csv"].map(|name| folder.path().join(name));
    std::fs::write(&model_file, model(RISING, "", &[])).unwrap();
    let [model_file, plain, better] = [&model_file, &plain, &better].map(|path| path.to_str().unwrap());
    hysteron(&["design", model_file, "--open", "-o", plain]);
    // From rest to the middle of the range, then up and down about it by swings that grow, 2 s.
    let follow = |file: &str, hz: f64| -> Vec<[f64; 3]> {
        let controller = Controller::read(file.as_ref()).unwrap();
        let law = controller.law::<f64>().unwrap();
        let mut plays = Plays { outputs: [0.0; 4] };
        let reference = |k: usize| {
            let t = k as f64 * 20e-6;
            let swing = 1.0 + 1.5 * (t / 2.0);
            (t / 0.1).min(1.0) * (4.0 - swing * (std::f64::consts::TAU * hz * t).cos())
        };
        let samples_um: Vec<f64> = (0..100_000).map(reference).collect();
        let reference = Reference {
            samples_um,
            judged_from: 0,
            ..Reference::default()
        };
        let commands_v = commands(&law, &reference);
        let ahead = commands_v.len() - reference.samples_um.len();
        for &v in &commands_v[..ahead] {
            plays.step(v);
        }
        let rows = commands_v[ahead..].iter().zip(&reference.samples_um);
        rows.map(|(&v, &r)| [v, plays.step(v), r]).collect()
    };
    let rms_um = |rows: &[[f64; 3]]| {
        let judged = &rows[10_000..];
        (judged.iter().map(|[_, y, r]| (y - r).powi(2)).sum::<f64>() / judged.len() as f64).sqrt()
    };
    let mut text = "time_s,voltage_v,position_um\n".to_owned();
    for (k, [v, y, _]) in follow(plain, 3.0).iter().enumerate().step_by(100) {
        text += &format!("{},{v},{y}\n", k as f64 * 20e-6);
    }
    std::fs::write(&along, text).unwrap();
    let along = along.to_str().unwrap();
    hysteron(&["design", model_file, "--open", "--along", along, "-o", better]);
    let [before, after] = [plain, better].map(|file| rms_um(&follow(file, 4.3)));
    assert!(
        before > 0.04 && after < 0.2 * before,
        "{before} um before, {after} um after"
    );
    refused(
        &["design", along, "--along", along],
        &["a campaign has its own records"],
    );
    // Every 25th row only: the turns lie between them.
    let coarse = folder.path().join("coarse.csv");
    let text = std::fs::read_to_string(along).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().step_by(25).collect();
    std::fs::write(&coarse, format!("{head}\n{}\n", rows.join("\n"))).unwrap();
    refused(
        &["design", model_file, "--along", coarse.to_str().unwrap()],
        &["coarse.csv: the drive turns between rows", "record it at a higher rate"],
    );
}

/// Serves one connection after another, each after so many ticks at rest, and at rest in between; nobody waits for the last stop.
fn serving(mut board: SmallBoard, at_rest: fn(usize) -> u32) -> String {
    let from = board.address();
    std::thread::spawn(move || {
        for run in 0.. {
            board.serve_after(at_rest(run), u32::MAX);
            board.tick(Order::Stop);
            for _ in 0..2000 {
                board.tick(Order::None);
            }
        }
    });
    from
}

/// A board of both axes: what it is asked for with one axis it does with the first, while the second stands still, and scans with both.
#[test]
fn val_scans_by_a_board_of_both_axes() {
    let stage = |seed| Box::new(Stage::new(&preset::paper_rate(), seed).unwrap());
    let from = serving(SmallBoard::at_both([stage(5), stage(6)]), |_| 0);
    let folder = tempfile::tempdir().unwrap();
    let [model_file, controller, place] =
        ["model.toml", "controller.toml", "recorded"].map(|name| folder.path().join(name));
    let (model_file, controller) = (model_file.to_str().unwrap(), controller.to_str().unwrap());
    std::fs::write(model_file, model(RISING, "resonance", &mode(800.0, 0.02))).unwrap();
    hysteron(&["design", model_file, "--open", "-o", controller]);
    let (low, high) = (table::INPUT_MAX_UM * 0.3, table::INPUT_MAX_UM * 0.7);
    let range = format!("{low},{high}");
    let args = ["track", controller, "--board", &from, "--range", &range];
    let answer: serde_json::Value = serde_json::from_str(&hysteron(&[&args[..], &["--json"]].concat())).unwrap();
    // A line of the raster is the triangle that one axis was asked for; the other axis goes up once meanwhile, by the same table.
    let triangle = answer["controllers"][0]["rms_percent"]["triangle-100"]
        .as_f64()
        .unwrap();
    for (number, scan) in ["raster", "spiral"].into_iter().enumerate() {
        let figures = &answer["scans"][number];
        assert_eq!(
            (figures["scan"].as_str(), figures["loop"].as_str()),
            (Some(scan), Some("open"))
        );
        for axis in ["x_percent", "y_percent", "path_percent"] {
            let percent = figures[axis].as_f64().unwrap();
            assert!(
                (0.5..1.5).contains(&(percent / triangle)),
                "{scan} {axis}: {percent}, {triangle}"
            );
        }
    }
    let lines = answer["scans"][0]["x_percent"].as_f64().unwrap();
    // How long the stage rested before differs from run to run, and with it what it remembers.
    assert!((lines / triangle - 1.0).abs() < 0.1, "{lines} {triangle}");
    // The second axis alone, the first standing still: its command is in the records.
    let place = place.to_str().unwrap();
    let record = [
        "board", "record", "--from", &from, "--run", "--axis", "y", "--shape", "triangle",
    ];
    hysteron(&[&record[..], &["--hz", "50", "--seconds", "0.2", "-o", place]].concat());
    let dataset = read_dataset(place.as_ref()).unwrap();
    assert!(
        dataset.description.contains("the second axis"),
        "{}",
        dataset.description
    );
    // Its word on the bus is the second.
    let known_s = hysteron_board::budget::BOARDS[2].known_delay_s();
    assert!((dataset.known.delay_s.unwrap() - known_s).abs() < 1e-12);
    let record = &dataset.records[0];
    let moved = |values: &[f64]| {
        // After the rise.
        let values = &values[values.len() / 2..];
        values.iter().fold(f64::NEG_INFINITY, |most, v| most.max(*v))
            - values.iter().fold(f64::INFINITY, |least, v| least.min(*v))
    };
    let beside = moved(record.voltage2_v.as_ref().unwrap());
    assert!(
        moved(&record.voltage_v) > 20.0 && beside < 0.1,
        "{} {beside}",
        moved(&record.voltage_v)
    );
}

/// Records that swing to 58 Hz: a board of both axes plays the sine of 10 Hz and holds, and is asked for nothing faster, neither references nor
/// scans of 100 lines a second.
#[test]
fn val_a_board_plays_what_the_records_cover() {
    let stage = |seed| Box::new(Stage::new(&preset::paper_rate(), seed).unwrap());
    let from = serving(SmallBoard::at_both([stage(5), stage(6)]), |_| 0);
    let folder = tempfile::tempdir().unwrap();
    let [model_file, controller] = ["model.toml", "controller.toml"].map(|name| folder.path().join(name));
    let (model_file, controller) = (model_file.to_str().unwrap(), controller.to_str().unwrap());
    let covered = "[covered]\nposition_um = [0.0, 20.0]\nswing_hz = 58.0\n";
    std::fs::write(model_file, model(RISING, "resonance", &mode(800.0, 0.02)) + covered).unwrap();
    hysteron(&["design", model_file, "--open", "-o", controller]);
    let (low, high) = (table::INPUT_MAX_UM * 0.3, table::INPUT_MAX_UM * 0.7);
    let range = format!("{low},{high}");
    let track = [
        "track",
        controller,
        "--board",
        &from,
        "--range",
        &range,
        "--iterations",
        "1",
    ];
    let answer: serde_json::Value = serde_json::from_str(&hysteron(&[&track[..], &["--json"]].concat())).unwrap();
    let percents = answer["controllers"][0]["rms_percent"].as_object().unwrap();
    assert_eq!(percents.keys().collect::<Vec<_>>(), ["10"]);
    assert!(answer["controllers"][0]["creep_peak_percent"].as_f64().unwrap() > 0.0);
    let learned: Vec<&str> = answer["learned"]
        .as_array()
        .unwrap()
        .iter()
        .map(|learned| learned["name"].as_str().unwrap())
        .collect();
    assert_eq!(learned, ["10"]);
    assert!(answer["scans"].is_null() && answer["beyond"].is_null(), "{answer:#}");
    let not_played = answer["not_played"].as_array().unwrap().iter();
    let not_played: Vec<(&str, f64)> = not_played
        .map(|left| (left["reference"].as_str().unwrap(), left["value"].as_f64().unwrap()))
        .collect();
    assert_eq!(
        not_played,
        [
            ("100", 100.0),
            ("500", 500.0),
            ("503", 503.0),
            ("1000", 1000.0),
            ("complex-harmonic-100", 300.0),
            ("triangle-100", 100.0),
            ("scans", 100.0)
        ]
    );
    let said = hysteron(&track[..6]);
    assert!(
        said.contains(
            "not played: sine 100 Hz, sine 500 Hz, sine 503 Hz, sine 1000 Hz, complex harmonic 100 Hz, triangle 100 Hz, scans; \
             the records cover references of 0 to 58 Hz. To play them, record a sine over half the range at that frequency and fit \
             again, or give --beyond-records"
        ),
        "{said}"
    );
    assert!(!said.contains("NaN"), "{said}");
}

/// Seven references, open loop and closed, each a run of its own; the board falls to its safe level in between.
#[test]
fn val_a_controller_tracks_on_a_board() {
    let board = SmallBoard::at(Box::new(Stage::new(&preset::paper_rate(), 5).unwrap()));
    let from = serving(board, |_| 0);
    let folder = tempfile::tempdir().unwrap();
    let [model_file, controller] = ["model.toml", "controller.toml"].map(|name| folder.path().join(name));
    let (model_file, controller) = (model_file.to_str().unwrap(), controller.to_str().unwrap());
    std::fs::write(model_file, model(RISING, "resonance", &mode(800.0, 0.02))).unwrap();
    hysteron(&["design", model_file, "--rigid", "4000", "-o", controller]);
    let (low, high) = (table::INPUT_MAX_UM * 0.3, table::INPUT_MAX_UM * 0.7);
    let range = format!("{low},{high}");
    let kept = folder.path().join("learned");
    let learning = ["--iterations", "2", "--keep", kept.to_str().unwrap(), "--json"];
    let args = ["track", controller, "--board", &from, "--range", &range];
    // The plays of a stage that never moved remember nothing: a turn over the table's range before the first run that is judged.
    let turned = folder.path().join("turned");
    hysteron(&[
        "board",
        "record",
        "--from",
        &from,
        "--run",
        "--seconds",
        "0.05",
        "-o",
        turned.to_str().unwrap(),
    ]);
    let answer: serde_json::Value = serde_json::from_str(&hysteron(&[&args[..], &learning].concat())).unwrap();
    assert_eq!(
        (&answer["stage"], &answer["position"], &answer["lost"]),
        (&"nucleo-h743zi".into(), &"measured".into(), &0.into())
    );
    let stroke_um = answer["stroke_um"].as_f64().unwrap();
    assert!((stroke_um / f64::from(high - low) - 1.0).abs() < 1e-3, "{stroke_um}");
    let percent = |number: usize, reference: &str| {
        answer["controllers"][number]["rms_percent"][reference]
            .as_f64()
            .unwrap()
    };
    assert_eq!(answer["controllers"][0]["loop"], "open");
    assert_eq!(answer["controllers"][1]["loop"], "closed");
    for reference in [
        "10",
        "100",
        "500",
        "503",
        "1000",
        "complex-harmonic-100",
        "triangle-100",
    ] {
        // The table is the paper's MRPI, fitted over the whole stroke; loops of this one are others.
        assert!((0.5..40.0).contains(&percent(0, reference)), "{reference} {answer:#}");
    }
    assert!(percent(1, "10") < 0.7 * percent(0, "10"), "{answer:#}");
    // The stage does not creep: what is left is what the table does not know of it, and what the integral has yet to forget of the move.
    for number in [0, 1] {
        let peak = answer["controllers"][number]["creep_peak_percent"].as_f64().unwrap();
        assert!((0.001..1.5).contains(&peak), "{answer:#}");
    }
    // Each correction takes off most of what repeats, whatever the table knows of this stage.
    let learned = answer["learned"].as_array().unwrap();
    assert_eq!(learned.len(), 5);
    for reference in learned {
        let runs = reference["iterations"].as_array().unwrap();
        let percent = |run: usize| runs[run]["measured_percent"].as_f64().unwrap();
        assert!(percent(2) < 0.5 * percent(0), "{reference:#}");
        assert_eq!(reference["kept"], 2);
        // Without a correction it is the reference itself, in points. A reference that is compared a few ticks early or late would be
        // off by several times as much at 500 Hz. What the plays remember of other runs makes the rest.
        let plain = answer["controllers"][0]["rms_percent"][reference["name"].as_str().unwrap()]
            .as_f64()
            .unwrap();
        assert!((percent(0) / plain - 1.0).abs() < 0.2, "{plain} {reference:#}");
        assert!(runs[0].get("true_percent").is_none());
        // As the board takes it.
        let file = kept.join(format!("{}.csv", reference["name"].as_str().unwrap()));
        let points = Upload::parse(&std::fs::read_to_string(file).unwrap()).unwrap();
        let width = points.range_um[1] - points.range_um[0];
        assert!(
            (0.5..1.5).contains(&(width / f64::from(high - low))),
            "{:?}",
            points.range_um
        );
    }
    for controller in answer["controllers"].as_array().unwrap() {
        // The sensor's noise, and the converter's steps of 0.76 nm.
        let noise_nm = controller["noise_nm"].as_f64().unwrap();
        assert!((0.7..1.2).contains(&noise_nm), "{answer:#}");
        let lag30_hz = controller["lag30_hz"].as_f64().unwrap();
        assert!((40.0..4000.0).contains(&lag30_hz), "{answer:#}");
    }
    refused(&["track", controller], &["--stage <PRESET>"]);
    refused(
        &["track", controller, "--board", "localhost:1"],
        &["HOST:PORT of a server"],
    );
    refused(
        &["track", controller, "--board", &from, "--bank", "3"],
        &["bank 3: the image has 1"],
    );
    refused(
        &["track", controller, "--board", &from, "--stage", "8k"],
        &["cannot be used with"],
    );
}
