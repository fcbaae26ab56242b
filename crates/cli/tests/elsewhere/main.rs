//! Model and law out of the house: a table of commands, a stage in a process, co-simulation units.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

#[path = "../three_plays/mod.rs"]
mod three_plays;
mod unit;

use assert_cmd::Command;
use std::path::Path;
use std::sync::LazyLock;
use three_plays::{HUM, Named, RISING, model};

/// Whether Python is there. `cargo xtask test` installs it and sets `HYSTERON_PYTHON`, with which nothing is left out.
fn python() -> bool {
    let asked = std::process::Command::new("python3").arg("--version").output();
    let there = asked.is_ok_and(|output| output.status.success());
    assert!(there || std::env::var_os("HYSTERON_PYTHON").is_none(), "no python3");
    there
}

/// What the records of the model cover.
const COVERED: &str = "[covered]\nvoltage_v = [0.0, 100.0]\nposition_um = [0.0, 10.0]\nsample_rate_hz = 50000.0\n";
/// Sample period of the controllers, seconds.
const PERIOD_S: f64 = 20e-6;

/// The model's stage in Python: three plays.
const STAGE: &str = "import sys\n\
    period_s = float(sys.stdin.readline().split()[2])\n\
    plays = [0.0, 0.0, 0.0]\n\
    print(0.0, flush=True)\n\
    for line in sys.stdin:\n    \
        v = float(line)\n    \
        y = 0.06 * v\n    \
        for i, r in enumerate([4.0, 15.0, 40.0]):\n        \
            plays[i] = max(v - r, min(v, plays[i]))\n        \
            y += 0.02 * plays[i]\n    \
        print(y, flush=True)\n";

/// A folder with model.toml, and controller.toml designed from it.
struct Folder(tempfile::TempDir);

/// One with feedback: its design takes half a minute.
static CLOSED: LazyLock<Folder> = LazyLock::new(|| {
    let folder = Folder::of("", &[], &["--rigid", "20000"]);
    folder.write("scan.csv", &scan());
    folder.write("stage.py", STAGE);
    folder
});

/// The commands along the scan, and where the model goes with them.
const ON_MODEL: [&str; 7] = [
    "drive",
    "controller.toml",
    "scan.csv",
    "--model",
    "model.toml",
    "-o",
    "on.csv",
];

impl Folder {
    fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn of(effect: &str, parameters: &[Named], options: &[&str]) -> Self {
        let folder = Self::empty();
        folder.write("model.toml", &(model(RISING, effect, parameters) + COVERED));
        folder.said(&[&["design", "model.toml", "-o", "controller.toml"], options].concat());
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path().join(name), text).unwrap();
    }

    fn run(&self, args: &[&str]) -> (Option<i32>, String, String) {
        let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
            .current_dir(self.path())
            .args(args)
            .output()
            .unwrap();
        // The box that errors are drawn in breaks lines.
        let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned(),
            said,
        )
    }

    fn said(&self, args: &[&str]) -> String {
        let (code, answer, said) = self.run(args);
        assert_eq!(code, Some(0), "{args:?}: {said}");
        answer
    }

    fn refuses(&self, args: &[&str], words: &[&str]) {
        let (code, _, said) = self.run(args);
        assert_eq!(code, Some(2), "{args:?}: {said}");
        for word in words {
            // Where a line was broken within a word there is a blank now.
            let plain = |text: &str| text.split_whitespace().collect::<String>();
            assert!(
                plain(&said).contains(&plain(word)),
                "{args:?} does not say `{word}`: {said}"
            );
        }
    }

    /// Columns of a CSV by their names.
    fn columns<const N: usize>(&self, file: &str, names: [&str; N]) -> [Vec<f64>; N] {
        let text = std::fs::read_to_string(self.path().join(file)).unwrap();
        let (head, rows) = text.split_once('\n').unwrap();
        let heads: Vec<&str> = head.split(',').collect();
        names.map(|name| {
            let place = heads.iter().position(|head| *head == name).unwrap();
            rows.lines()
                .map(|row| row.split(',').nth(place).unwrap().parse().unwrap())
                .collect()
        })
    }
}

/// A reference of 0.1 s from 1 to 9 um at 30 Hz.
fn scan() -> String {
    let mut text = "time_s,reference_um\n".to_owned();
    for k in 0..5000 {
        let t = f64::from(k) * PERIOD_S;
        let r = 5.0 - 4.0 * (std::f64::consts::TAU * 30.0 * t).cos();
        text += &format!("{t:.6},{r}\n");
    }
    text
}

/// The model's stage, as [`STAGE`].
fn stage(volts: &[f64]) -> Vec<f64> {
    let mut plays = [0.0_f64; 3];
    let step = |&v: &f64| {
        let moved = plays.iter_mut().zip([4.0, 15.0, 40.0]).map(|(play, r)| {
            *play = play.min(v).max(v - r);
            0.02 * *play
        });
        0.06 * v + moved.sum::<f64>()
    };
    volts.iter().map(step).collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The commands bring a stage that is written here anew to the reference, as they bring the model.
#[test]
fn val_commands_of_a_table_bring_the_stage_to_the_reference() {
    let folder = Folder::of("", &[], &[]);
    folder.write("scan.csv", &scan());
    let said = folder.said(&["drive", "controller.toml", "scan.csv", "-o", "volts.csv"]);
    assert!(said.contains("a rise of 20 ms leads there"), "{said}");
    let [time_s, due_um, volts] = folder.columns("volts.csv", ["time_s", "reference_um", "voltage_v"]);
    let first = time_s.iter().position(|t| t.abs() < 0.5 * PERIOD_S).unwrap();
    assert_eq!(time_s.len(), first + 5000);
    // 20 ms of rise, and the preview; the table begins at rest.
    assert!(
        first > 1000 && first <= 1064 && due_um[0] == 0.0 && volts[0].abs() < 0.5,
        "{first}"
    );
    assert!((due_um[first] - 1.0).abs() < 1e-12 && (due_um[first + 833] - 9.0).abs() < 1e-3);
    // A command is held for a sample: the stage is where the one before has brought it.
    let reached = stage(&volts);
    let off = largest_difference(&due_um[first + 1..], &reached[first..]);
    // Three plays inverted by a table of 24: below 1 % of 8 um.
    assert!(off < 0.08, "{off}");

    // On the model, in open loop: the same commands, and the positions of that stage.
    let said = folder.said(&ON_MODEL);
    assert!(
        said.contains("open loop on the model: reference minus position"),
        "{said}"
    );
    let [again, modelled] = folder.columns("on.csv", ["voltage_v", "model_um"]);
    assert_eq!(again, volts);
    let off = largest_difference(&modelled[1..], &reached);
    assert!(off < 1e-9, "{off}");
}

/// A loop on the model leaves less than the feedforward alone.
#[test]
fn val_a_loop_on_the_model_gets_nearer() {
    let folder = &*CLOSED;
    let said = folder.said(&["drive", "controller.toml", "scan.csv", "-o", "volts.csv"]);
    assert!(
        said.contains("the feedforward alone: the feedback has nothing to read"),
        "{said}"
    );
    let [due_um, volts] = folder.columns("volts.csv", ["reference_um", "voltage_v"]);
    let open = rms(&due_um[1..], &stage(&volts));
    let said = folder.said(&ON_MODEL);
    assert!(said.contains("closed loop on the model"), "{said}");
    let [modelled] = folder.columns("on.csv", ["model_um"]);
    let closed = rms(&due_um, &modelled);
    assert!(closed < 0.5 * open, "closed {closed} um, open {open} um");
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// Without a sensor and a thermometer, hum is not learned and heat moves nothing: the commands are those without either.
#[test]
fn regress_commands_without_a_sensor_learn_nothing_from_it() {
    let heat = [
        ("reference", 22.0, "degC"),
        ("tau", 100.0, "s"),
        ("shift", 0.3, "um/K"),
        ("gain", 0.001, "1/K"),
        ("rest_share", 0.0, ""),
    ];
    let volts = |effect: &str, parameters: &[Named]| {
        let folder = Folder::of(effect, parameters, &["--open"]);
        folder.write("scan.csv", &scan());
        folder.said(&["drive", "controller.toml", "scan.csv", "-o", "volts.csv"]);
        let [volts] = folder.columns("volts.csv", ["voltage_v"]);
        volts
    };
    let plain = volts("", &[]);
    assert_eq!(volts("mains-hum", &HUM), plain);
    assert_eq!(volts("thermal-drift", &heat), plain);
}

#[test]
fn refuse_references_that_the_controller_cannot_follow() {
    let folder = Folder::of("", &[], &[]);
    let drive = ["drive", "controller.toml", "scan.csv", "-o", "volts.csv"];
    for (text, words) in [
        (
            "time_s,reference_um\n0,0\n0.00002,5\n0.00004,15\n".to_owned(),
            ["position 15 um; the records cover 0 to 10 um", "--beyond-records"],
        ),
        (
            "time_s,reference_um\n0,0\n0.001,5\n0.002,6\n".to_owned(),
            ["sampled at 1000 Hz", "the controller runs at 50000"],
        ),
        (
            "time_s,voltage_v\n0,0\n0.001,5\n".to_owned(),
            ["no reference among `time_s,voltage_v`", "`time_s,reference_um`"],
        ),
        (
            "time_s,reference_um\n0,0\n0.00002,nan\n0.00004,1\n".to_owned(),
            ["line 3, column 2 (reference_um)", "a finite number"],
        ),
    ] {
        folder.write("scan.csv", &text);
        folder.refuses(&drive, &words);
        assert!(!folder.path().join("volts.csv").exists());
    }
    folder.write("scan.csv", &scan());
    folder.refuses(
        &["drive", "controller.toml", "scan.csv", "-o", "volts.xyz"],
        &[".csv, .npz and .parquet"],
    );
    folder.refuses(&["drive", "model.toml", "scan.csv", "-o", "volts.csv"], &["model.toml"]);
    assert!(!folder.path().join("volts.csv").exists());
}

/// A loop closed by another program, and the same stage as a model in here: the same errors.
#[test]
fn val_a_stage_in_a_process_is_tracked_as_its_model_is() {
    if !python() {
        return;
    }
    let folder = &*CLOSED;
    let answer = |options: &[&str]| -> serde_json::Value {
        let answer = folder.said(&[&["track", "controller.toml", "--json"], options].concat());
        serde_json::from_str(&answer).unwrap()
    };
    let process = answer(&["--process", "python3 stage.py"]);
    let modelled = answer(&["--model", "model.toml"]);
    let rows = |answer: &serde_json::Value| answer["rows"].as_array().unwrap().clone();
    assert_eq!(rows(&process).len(), 14);
    for (there, here) in rows(&process).iter().zip(&rows(&modelled)) {
        assert_eq!(
            (&there["reference"], &there["loop"]),
            (&here["reference"], &here["loop"])
        );
        assert_eq!(there["expected_percent"], here["expected_percent"]);
        assert_eq!(there["stable"], true);
        let [there, here] = [there, here].map(|row| row["found_percent"].as_f64().unwrap());
        // The model's own loop is repeated until it stands to 0.001 %.
        assert!(
            (there - here).abs() < 0.002,
            "{there} % in the process, {here} % in the model"
        );
    }
}

/// The whole campaign on another program's stage: the records are its answers, and the chain identified from them tracks on it.
#[test]
fn val_a_stage_in_a_process_is_recorded_and_tracked() {
    if !python() {
        return;
    }
    let folder = Folder::empty();
    // A first-order lag behind the plays: 100 us.
    let lagged = STAGE
        .replace("import sys\n", "import sys, math\n")
        .replace(
            "plays =",
            "share = 1.0 - math.exp(-period_s / 100e-6)\nat = 0.0\nplays =",
        )
        .replace("print(y, flush", "at += share * (y - at)\n    print(at, flush");
    folder.write("stage.py", &lagged);
    let campaign = [
        "campaign",
        "--process",
        "python3 stage.py",
        "--timeout",
        "30",
        "--top-v",
        "100",
        "--rate-hz",
        "10000",
        "-o",
        "records",
    ];
    let said = folder.said(&campaign);
    assert!(
        said.contains("frf-small.csv") && said.contains("training2-harmonics-079hz.csv"),
        "{said}"
    );
    let misses = said.split("misses the commands by ").nth(1).unwrap();
    let misses: f64 = misses.split_whitespace().next().unwrap().parse().unwrap();
    // Twelve plays stand for three: the sixth of a play's width that is left is 0.2 % of the range.
    assert!(misses < 0.5, "{said}");
    let [volts, positions] = folder.columns("records/large-023hz.csv", ["voltage_v", "position_um"]);
    let (mut plays, mut at_um) = ([0.0_f64; 3], 0.0);
    for (k, (&volts, &position_um)) in volts.iter().zip(&positions).enumerate() {
        // A reading, then the command of the same instant.
        assert!((position_um - at_um).abs() < 1e-6, "row {k}: {position_um}, {at_um}");
        let mut due_um = 0.06 * volts;
        for (play, width_v) in plays.iter_mut().zip([4.0, 15.0, 40.0]) {
            *play = (volts - width_v).max(play.min(volts));
            due_um += 0.02 * *play;
        }
        at_um += -(-1e-4_f64 / 100e-6).exp_m1() * (due_um - at_um);
    }
    let manifest = std::fs::read_to_string(folder.path().join("records/dataset.toml")).unwrap();
    // Half a sample: for so long a command is held on average.
    assert!(
        manifest.contains("delay_s = 0.00005") || manifest.contains("delay_s = 5e-5"),
        "{manifest}"
    );
    folder.refuses(&campaign, &["already", "records"]);
    folder.said(&["design", "records", "--open", "-o", "controller.toml"]);
    let track = ["track", "controller.toml", "--json", "--process", "python3 stage.py"];
    // The campaign's fastest large sine has 907 Hz.
    let answer = |more: &[&str]| -> serde_json::Value {
        let answer = folder.said(&[&track[..], more].concat());
        serde_json::from_str(&answer).unwrap()
    };
    let within = answer(&[]);
    assert_eq!(within["rows"].as_array().unwrap().len(), 6, "{within}");
    assert_eq!(within["not_played"].as_array().unwrap().len(), 1, "{within}");
    assert_eq!(within["not_played"][0]["reference"], "1000", "{within}");
    let answer = answer(&["--beyond-records"]);
    assert_eq!(answer["rows"].as_array().unwrap().len(), 7, "{answer}");
    assert!(answer["not_played"].is_null(), "{answer}");
    let slow = &answer["rows"][0];
    assert!(slow["found_percent"].as_f64().unwrap() < 0.5, "{answer}");
}

/// A sensor at its end, one that stands still, and options that do not go together.
#[test]
fn refuse_campaigns_on_processes_that_tell_nothing() {
    if !python() {
        return;
    }
    let folder = Folder::empty();
    let asked = |file: &str| {
        [
            "campaign",
            "--process",
            &format!("python3 {file}"),
            "--timeout",
            "30",
            "--top-v",
            "100",
            "--rate-hz",
            "2000",
            "-o",
            "records",
        ]
        .map(str::to_owned)
    };
    for (file, last, words) in [
        ("still.py", "print(1.5, flush", ["6 of 7 records cannot be used"]),
        ("clipped.py", "print(min(y, 3.0), flush", ["stands at 3 um for"]),
    ] {
        folder.write(file, &STAGE.replace("print(y, flush", last));
        let asked = asked(file);
        folder.refuses(&asked.iter().map(String::as_str).collect::<Vec<_>>(), &words);
        assert!(!folder.path().join("records").exists());
    }
    let options = ["campaign", "--top-v", "100", "--rate-hz", "2000", "-o", "records"];
    folder.refuses(
        &[&options[..], &["--latency-us", "20000"]].concat(),
        &["--latency-us 20000: give 0 to 10000 us"],
    );
    folder.refuses(&["campaign", "--process", "python3", "-o", "records"], &["--top-v"]);
}

/// Processes that are none: what is wrong, at which line, and what to do.
#[test]
fn refuse_processes_that_do_not_answer() {
    if !python() {
        return;
    }
    let folder = Folder::of("", &[], &[]);
    let begin = "import sys, time\nsys.stdin.readline()\n";
    for (name, rest, words) in [
        (
            "dies",
            "sys.exit(3)",
            ["ended (exit status: 3) before it answered line 1", "standard error"],
        ),
        (
            "dies_later",
            "print(0.0, flush=True)\nsys.stdin.readline()\nprint(0.1, flush=True)\nsys.stdin.readline()",
            ["ended (exit status: 0) before it answered line 3", "standard error"],
        ),
        ("hangs", "time.sleep(60)", ["no answer to line 1 within 0.5 s", "flush"]),
        (
            "keeps_it",
            // Whatever Python is told about buffers.
            "sys.stdout = open(1, 'w', buffering=65536)\nprint(0.0)\nfor line in sys.stdin: print(0.0)",
            ["no answer to line 1 within 0.5 s", "flush"],
        ),
        (
            "talks",
            "print('ready \\x1b[0m', flush=True)\nsys.stdin.read()",
            [
                "answered line 1 with `ready \\u{1b}[0m`",
                "one finite number, the position in micrometres",
            ],
        ),
        (
            "lost",
            "print(0.0, flush=True)\nfor line in sys.stdin: print('nan', flush=True)",
            ["answered line 2 with `nan`", "one finite number"],
        ),
        (
            "floods",
            "print('0' * 100000, flush=True)\nsys.stdin.read()",
            ["answered line 1 with `0000000000", "one finite number"],
        ),
        (
            "twice",
            "print(0.0, flush=True)\nfor line in sys.stdin:\n print('0.5\\n7.5', flush=True)",
            [
                "that nobody asked for, after line",
                "one line for each line that it reads",
            ],
        ),
    ] {
        let file = format!("{name}.py");
        folder.write(&file, &format!("{begin}{rest}\n"));
        let command = format!("python3 {file}");
        // Long enough for the language to start on a busy machine, where an answer comes at all.
        let patience_s = if words[0].starts_with("no answer") { "0.5" } else { "30" };
        folder.refuses(
            &[
                "track",
                "controller.toml",
                "--process",
                &command,
                "--timeout",
                patience_s,
            ],
            &words,
        );
    }
    folder.refuses(
        &["track", "controller.toml", "--process", "no-such-program here"],
        &["`no-such-program here` cannot be started"],
    );
    folder.refuses(&["track", "controller.toml", "--process", " "], &["cannot be started"]);
    folder.refuses(
        &["track", "controller.toml", "--process", "python3", "--timeout", "nan"],
        &["--timeout NaN: give seconds above 0, up to 3600"],
    );
    folder.refuses(
        &["track", "controller.toml", "--process", "python3", "--range", "3,15"],
        &["position 15 um; the records cover 0 to 10 um"],
    );
}
