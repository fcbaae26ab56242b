//! Co-simulation units, built, unzipped, loaded and stepped by a small program in Python: the numbers of the model and of the law.

use crate::three_plays::{Named, RISING, model};
use crate::{COVERED, Folder, PERIOD_S, python};
use hysteron_core::surroundings::LoopInput;
use hysteron_identify::{InitialState, Model};
use hysteron_table::Table;
use std::fmt::Write;

/// Runs a unit over rows of inputs; its rows of outputs, the one at rest first.
fn run(folder: &Folder, unit: &str, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    by(folder, "python3", "load_unit.py", &[unit], rows)
}

/// Rows that a program in Python answers to rows.
fn by(folder: &Folder, interpreter: &str, program: &str, units: &[&str], rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut text = String::new();
    for row in rows {
        let row: Vec<String> = row.iter().map(|value| format!("{value:?}")).collect();
        writeln!(text, "{}", row.join(" ")).unwrap();
    }
    let programs = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/elsewhere/");
    let output = assert_cmd::Command::new(interpreter)
        .arg(format!("{programs}{program}"))
        .args(units)
        .current_dir(folder.path())
        .write_stdin(text)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let numbers = |line: &str| line.split(' ').map(|word| word.parse().unwrap()).collect();
    String::from_utf8(output.stdout).unwrap().lines().map(numbers).collect()
}

/// From 0 V through the range, beyond it, with turns within; 0.2 s.
fn volts() -> Vec<f64> {
    (0..10_000)
        .map(|k| {
            let t = f64::from(k) * PERIOD_S;
            let slow = 1.0 - (std::f64::consts::TAU * 11.0 * t).cos();
            let quick = (std::f64::consts::TAU * 470.0 * t).sin() * (t / 0.05).min(1.0);
            if k < 9000 { 52.0 * slow + 9.0 * quick } else { 30.0 }
        })
        .collect()
}

/// The unit of model.toml, beside the free simulation of the model.
fn same_as_the_model(text: &str, name: &str) {
    let folder = Folder::empty();
    folder.write("model.toml", text);
    folder.said(&["export", "model.toml", "--format", "fmu", "-o", "stage.fmu"]);
    let volts = volts();
    let rows: Vec<Vec<f64>> = volts.iter().skip(1).map(|v| vec![*v]).collect();
    let found: Vec<f64> = run(&folder, "stage.fmu", &rows).iter().map(|row| row[0]).collect();
    let model = Model::read(&folder.path().join("model.toml")).unwrap();
    let wanted = model.simulate_input(&volts, PERIOD_S, InitialState::REST).unwrap();
    assert_eq!(found.len(), wanted.len());
    let off = crate::largest_difference(&found, &wanted);
    // Of 10 um: sums in another order.
    assert!(off < 1e-10, "{name}: {off} um");
    let moved = wanted.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    assert!(moved > 5.0, "{name}: {moved} um");
}

/// Every effect that a command determines, each alone and all in one chain.
#[test]
fn val_a_stage_as_a_unit_is_the_model() {
    if !python() {
        return;
    }
    let effects: [(&str, &[Named]); 10] = [
        ("delay", &[("delay", 47e-6, "s")]),
        (
            "first-order-lag",
            &[
                ("amplifier_tau", 60e-6, "s"),
                ("sensor_tau", 31e-6, "s"),
                ("tau_per_v", 4e-7, "s/V"),
                ("from_v", 2.0, "V"),
            ],
        ),
        ("slew-limit", &[("slew", 2e4, "V/s"), ("falling", 1.4e4, "V/s")]),
        (
            "saturation",
            &[
                ("rail_low", -5.0, "V"),
                ("rail_high", 98.0, "V"),
                ("stop_low", -1.0, "um"),
                ("stop_high", 9.5, "um"),
                ("gives_way", 0.1, ""),
            ],
        ),
        (
            "rate-dependence",
            &[
                ("alpha", 5e-5, "s"),
                ("beta", 3e-5, "s"),
                ("exponent", 0.7, ""),
                ("reference", 3e4, "V/s"),
            ],
        ),
        (
            "asymmetry",
            &[
                ("middle", 50.0, "V"),
                ("quadratic", 1e-5, "um/V^2"),
                ("cubic", 2e-7, "um/V^3"),
            ],
        ),
        (
            "creep",
            &[
                ("first_tau", 0.03, "s"),
                ("share_1", 0.01, ""),
                ("share_2", 0.012, ""),
                ("share_3", 0.0, ""),
                ("share_4", 0.008, ""),
            ],
        ),
        (
            "resonance",
            &[
                ("frequency", 900.0, "Hz"),
                ("damping", 0.02, ""),
                ("frequency_2", 2600.0, "Hz"),
                ("damping_2", 0.03, ""),
                ("share_2", 0.1, ""),
            ],
        ),
        ("backlash", &[("width", 0.06, "um")]),
        (
            "sensor-nonlinearity",
            &[
                ("middle", 5.0, "um"),
                ("quadratic", 0.004, "1/um"),
                ("cubic", -3e-4, "1/um^2"),
            ],
        ),
    ];
    let mut all = model(RISING, "", &[]) + COVERED;
    for (effect, parameters) in effects {
        same_as_the_model(&(model(RISING, effect, parameters) + COVERED), effect);
        writeln!(all, "[[effect]]\nname = \"{effect}\"").unwrap();
        for (name, value, unit) in parameters {
            writeln!(
                all,
                "[[effect.parameter]]\nname = \"{name}\"\nvalue = {value:?}\nunit = \"{unit}\""
            )
            .unwrap();
        }
    }
    same_as_the_model(&all, "all");
    // One mode, and less than a sample of delay.
    let one = all.replace("name = \"share_2\"\nvalue = 0.1\n", "name = \"share_2\"\nvalue = 0.0\n");
    same_as_the_model(&one.replace("4.7e-5", "7e-6"), "one mode");
}

/// The families, each with all of its coefficients; the free shape goes on in straight lines beyond its range.
#[test]
fn val_every_family_as_a_unit_is_the_model() {
    if !python() {
        return;
    }
    let base = model(RISING, "", &[]) + COVERED;
    let with = |family: &str, more: &[Named]| {
        let mut text = base.replace("family = \"pi\"", &format!("family = \"{family}\""));
        // In the order of the family: the input function, the plays, alpha and beta.
        let place = text.find("[[hysteresis.parameter]]\nname = \"weight[1]\"").unwrap();
        let (mut before, mut behind) = (String::new(), String::new());
        for (name, value, unit) in more {
            let last = name.contains('[') || ["alpha", "beta"].contains(name);
            let to = if last { &mut behind } else { &mut before };
            writeln!(
                to,
                "[[hysteresis.parameter]]\nname = \"{name}\"\nvalue = {value:?}\nunit = \"{unit}\""
            )
            .unwrap();
        }
        text.insert_str(place, &before);
        let place = text.find("[fitted_on]").unwrap();
        text.insert_str(place, &behind);
        text
    };
    let cubic = ("cubic", 3e-7, "um/V^3");
    same_as_the_model(&with("mpi", &[cubic]), "mpi");
    same_as_the_model(
        &with("mrpi", &[cubic, ("alpha", 4e-5, "s"), ("beta", 6e-5, "s")]),
        "mrpi",
    );
    let rates = [
        ("rate_weight[1]", 1e-7, "um s/V^2"),
        ("rate_weight[2]", -2e-8, "um s/V^2"),
        ("rate_weight[3]", 3e-8, "um s/V^2"),
    ];
    same_as_the_model(&with("wrpi", &[&[cubic], &rates[..]].concat()), "wrpi");
    let free = [
        ("quadratic", 1e-5, "um/V^2"),
        cubic,
        ("power4", -1e-9, "um/V^4"),
        ("power5", 4e-12, "um/V^5"),
        ("weight_quadratic[1]", 1e-5, "um/V^2"),
        ("weight_quadratic[2]", 2e-5, "um/V^2"),
        ("weight_quadratic[3]", -1e-5, "um/V^2"),
        ("weight_cubic[1]", 1e-7, "um/V^3"),
        ("weight_cubic[2]", -1e-7, "um/V^3"),
        ("weight_cubic[3]", 2e-7, "um/V^3"),
    ];
    same_as_the_model(&with("play-polynomial", &free), "play-polynomial");
    same_as_the_model(&with("duhem", &free), "duhem");
}

/// A table with feedback, two modes and creep.
const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/tables/tracking-739.toml");

/// The law of a table as a unit: bit by bit the core's in `f32`.
#[test]
fn val_a_law_as_a_unit_is_the_law() {
    if !python() {
        return;
    }
    let folder = Folder::empty();
    folder.said(&["export", TABLE, "--format", "fmu", "-o", "law.fmu"]);
    let rows: Vec<Vec<f64>> = (0..5000)
        .map(|k| {
            let t = f64::from(k) * PERIOD_S;
            let reference = 5.0 - 4.0 * (std::f64::consts::TAU * 40.0 * t).cos();
            vec![reference, reference - 0.2 * (900.0 * t).sin()]
        })
        .collect();
    let found = run(&folder, "law.fmu", &rows);
    let text = std::fs::read_to_string(TABLE).unwrap();
    let law = Table::parse(&text).unwrap().law_numbers().unwrap().unwrap();
    let law = law.law::<f32>().unwrap();
    assert!(law.feedback().is_some());
    let mut state = law.rest(0.0);
    for (k, (row, found)) in rows.iter().zip(&found[1..]).enumerate() {
        let input = LoopInput {
            reference_ahead: row[0] as f32,
            measured: row[1] as f32,
            ..LoopInput::default()
        };
        let wanted = law.step(&mut state, input);
        assert_eq!(found, &[f64::from(wanted), f64::from(state.due())], "sample {k}");
    }
}

/// Another reader of units finds nothing wrong, and simulates the same.
#[test]
fn val_units_are_sound_to_fmpy() {
    // `cargo xtask test` names the interpreter that has FMPy.
    let Ok(interpreter) = std::env::var("HYSTERON_PYTHON") else {
        return;
    };
    let folder = Folder::empty();
    let lag = [
        ("amplifier_tau", 60e-6, "s"),
        ("sensor_tau", 31e-6, "s"),
        ("tau_per_v", 0.0, "s/V"),
        ("from_v", 0.0, "V"),
    ];
    folder.write("model.toml", &(model(RISING, "first-order-lag", &lag) + COVERED));
    folder.said(&["export", "model.toml", "--format", "fmu", "-o", "stage.fmu"]);
    folder.said(&["export", TABLE, "--format", "fmu", "-o", "law.fmu"]);
    let volts = volts();
    let rows: Vec<Vec<f64>> = volts.iter().map(|v| vec![*v]).collect();
    let found = by(
        &folder,
        &interpreter,
        "validate_unit.py",
        &["stage.fmu", "law.fmu"],
        &rows,
    );
    let model = Model::read(&folder.path().join("model.toml")).unwrap();
    let wanted = model.simulate_input(&volts, PERIOD_S, InitialState::REST).unwrap();
    // A step answers at its end to the command of its beginning.
    let found: Vec<f64> = found.iter().skip(1).map(|row| row[0]).collect();
    assert_eq!(found.len() + 1, wanted.len());
    let off = crate::largest_difference(&found, &wanted);
    assert!(off < 1e-10, "{off} um");
}

#[test]
fn refuse_models_that_make_no_unit() {
    let folder = Folder::empty();
    let export = ["export", "model.toml", "--format", "fmu", "-o", "stage.fmu"];
    let coupling = [
        ("gain", 0.01, "um/V"),
        ("lead", 0.0, "um s/V"),
        ("play_weight", 0.0, "um/V"),
        ("threshold", 1.0, "V"),
    ];
    folder.write("model.toml", &(model(RISING, "cross-coupling", &coupling) + COVERED));
    folder.refuses(&export, &["the model has `cross-coupling`", "take a model without it"]);
    folder.write("model.toml", &model(RISING, "", &[]));
    folder.refuses(&export, &["at what rate its records were taken", "--rate HZ"]);
    folder.refuses(
        &[
            "export",
            "model.toml",
            "--format",
            "fmu",
            "-o",
            "stage.zip",
            "--rate",
            "1e4",
        ],
        &["stage.zip: the name of a co-simulation unit must end in .fmu"],
    );
    folder.refuses(
        &[
            "export",
            "model.toml",
            "--format",
            "fmu",
            "-o",
            "7.fmu",
            "--rate",
            "1e4",
        ],
        &["name = 7: must be a letter"],
    );
    folder.refuses(
        &[
            "export",
            "model.toml",
            "--format",
            "fmu",
            "-o",
            "a.fmu",
            "--rate",
            "nan",
        ],
        &["rate = NaN Hz: must be 1 Hz to 10 MHz"],
    );
    assert!(!folder.path().join("stage.fmu").exists());
}
