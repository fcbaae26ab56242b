//! `export` and `board` as a user meets them.

#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

#[path = "../../board/tests/common/mod.rs"]
mod emulator;

use assert_cmd::Command;
use hysteron_core::bank::PlayState;
use hysteron_core::model::Hysteresis;
use hysteron_data::read_dataset;
use hysteron_table::{Family, Table};
use std::fs;
use std::path::{Path, PathBuf};

fn hysteron(args: &[&str]) -> std::process::Output {
    Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap()
}

fn answered(args: &[&str]) -> String {
    let output = hysteron(args);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// What a refused command says on standard error.
fn refused(args: &[&str]) -> String {
    let output = hysteron(args);
    assert_eq!(output.status.code(), Some(2), "{args:?}");
    // The error is wrapped to the terminal's width.
    let text = String::from_utf8(output.stderr).unwrap();
    text.replace(['│', '×'], " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The records that the tables of `firmware/tables` are made from: three rates, or slow ones.
fn records(folder: &Path, slow: bool) -> String {
    let data = folder.join(if slow { "slow" } else { "sines" }).display().to_string();
    let mut args = vec!["simulate", "--stage", "paper-rate", "-o", &data];
    let excitations: &[&str] = if slow {
        &["sine:hz=10,periods=5", "decaying-triangle:high_v=26,centre_v=13"]
    } else {
        &[
            "sine:hz=10,periods=5",
            "sine:hz=100,periods=50",
            "sine:hz=500,periods=250",
        ]
    };
    args.extend(excitations.iter().flat_map(|excitation| ["--excitation", excitation]));
    answered(&args);
    data
}

/// Outputs of a table's inverse along a full-range sine of 500 Hz, volts.
fn outputs_v(table: &Table) -> Vec<f32> {
    let (bank, inverse) = table.inverse::<10>(false).unwrap();
    let mut state = PlayState::remanent(&bank, 0.0, 0.0);
    let (low, high) = (table.input_min_um, table.input_max_um);
    (0..1000)
        .map(|k| {
            let phase = std::f64::consts::TAU * f64::from(k) / 100.0;
            inverse.step(&mut state, (low + (high - low) * 0.5 * (1.0 - phase.cos())) as f32)
        })
        .collect()
}

/// Every family becomes a table, and the tables of the repository are what the commands write: to 1 mV, a sixth of the DAC's step,
/// since the records' sines are those of the machine's library.
#[test]
fn regress_tables_are_what_the_commands_write() {
    let folder = tempfile::tempdir().unwrap();
    let (sines, slow) = (records(folder.path(), false), records(folder.path(), true));
    for family in [Family::Mpi, Family::Wrpi, Family::Mrpi, Family::PlayPolynomial] {
        let place = |what: &str| {
            folder
                .path()
                .join(format!("{what}-{}", family.name()))
                .display()
                .to_string()
        };
        let (model, table) = (place("model"), place("table"));
        let data = if matches!(family, Family::Mpi | Family::PlayPolynomial) {
            &slow
        } else {
            &sines
        };
        let thresholds = if family == Family::Mrpi { "data" } else { "eq16" };
        let fit = [
            "fit",
            data,
            "--model",
            family.name(),
            "--direction",
            "inverse",
            "--thresholds",
            thresholds,
        ];
        answered(&[&fit[..], &["-o", &model]].concat());
        let range = ["--input-min", "0.1", "--input-max", "2.3"];
        let said = answered(&[&["export", &model, "--stage", "paper-rate", "-o", &table], &range[..]].concat());
        assert!(said.contains("gain margin 2.0"), "{said}");
        let written = Table::parse(&fs::read_to_string(&table).unwrap()).unwrap();
        assert_eq!((written.family, written.thresholds_um.len()), (family, 10));
        let kept = root().join(format!("firmware/tables/paper-rate-{}.toml", family.name()));
        let kept = Table::parse(&fs::read_to_string(kept).unwrap()).unwrap();
        let pairs = outputs_v(&written).into_iter().zip(outputs_v(&kept));
        for (k, (written, kept)) in pairs.enumerate() {
            assert!(
                (written - kept).abs() < 1e-3,
                "{} at {k}: {written} {kept}",
                family.name()
            );
        }
    }
}

/// What an export refuses names the field or option, and the value.
#[test]
fn refuse_bad_exports() {
    let folder = tempfile::tempdir().unwrap();
    let data = records(folder.path(), true);
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (forward, inverse, table) = (path("forward"), path("inverse"), path("table"));
    answered(&["fit", &data, "--model", "mpi", "-o", &forward]);
    answered(&[
        "fit",
        &data,
        "--model",
        "mpi",
        "--direction",
        "inverse",
        "--thresholds",
        "eq16",
        "-o",
        &inverse,
    ]);
    let narrow = ["--input-min", "0.1", "--input-max", "2.3"];
    let export = |more: &[&str]| refused(&[&["export", &inverse, "-o", &table], more].concat());
    let narrowed = |more: &[&str]| export(&[&narrow, more].concat());
    for (said, wanted) in [
        (
            refused(&["export", &forward, "-o", &table]),
            "runs forward; design a controller from it and export that",
        ),
        (
            narrowed(&["--amplifier", "200,0"]),
            "give two ascending numbers with a comma",
        ),
        (
            narrowed(&["--mode", "8000", "--damping", "0.02"]),
            "--mode needs --latency-us",
        ),
        (narrowed(&["--latency-us=-3"]), "--latency-us -3 must lie above 0"),
        (narrowed(&["--integral=-1"]), "integral gain = -1 must lie in"),
        (narrowed(&["--amplifier", "0,10"]), "input_min_um, input_max_um = "),
        (
            export(&["--input-min", "2", "--input-max", "1"]),
            "input_max_um = 1: must exceed input_min_um = 2",
        ),
    ] {
        assert!(said.contains(wanted), "`{said}` should say `{wanted}`");
    }
    assert!(!Path::new(&table).exists(), "nothing is written");
    // Without data of the loop no gain is safe.
    assert!(answered(&[&["export", &inverse, "-o", &table], &narrow[..]].concat()).contains("feedback off"));
    assert_eq!(
        Table::parse(&fs::read_to_string(&table).unwrap())
            .unwrap()
            .integral_v_per_um_s,
        0.0
    );
}

/// An image that the emulator can run; `None`, and said so, where a machine has none.
fn image(name: &str) -> Option<String> {
    Some(emulator::image(name)?.display().to_string())
}

/// What the board saw is a dataset: the latency that its builder knows is in it, and `compare` takes it.
#[test]
fn val_board_run_records_what_compare_takes() {
    let Some(image) = image("mps2-an386") else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (data, board, model) = (records(folder.path(), false), path("board"), path("model"));
    let run = [
        "board",
        "run",
        "--emulator",
        "mps2-an386",
        "--stage",
        "paper-rate",
        "--seconds",
        "0.05",
        "--image",
        &image,
        "-o",
        &board,
    ];
    // 0.05 s, and 1100 ticks to fall to the safe level.
    let said = answered(&run);
    assert!(said.starts_with("3600 ticks, 0 overruns, 0 edges lost"), "{said}");
    let dataset = read_dataset(Path::new(&board)).unwrap();
    let text = fs::read_to_string(root().join("firmware/tables/paper-rate-mrpi.toml")).unwrap();
    let hash: String = hysteron_table::hash(&text)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    assert!(dataset.description.ends_with(&hash), "{}", dataset.description);
    assert!((dataset.known.delay_s.unwrap() - 10e-6).abs() < 1e-12);
    assert_eq!(dataset.records[0].reference_um.as_ref().unwrap().len(), 3600);
    answered(&["fit", &data, "--model", "mrpi", "-o", &model]);
    answered(&["compare", &board, &model]);
    assert!(refused(&run).contains("already"), "a recording is not replaced unasked");
}

/// The recording says which of the image's tables ran, and a bank that it has not is refused with what to do.
#[test]
fn val_board_run_takes_a_bank() {
    let Some(image) = image("tables/banks") else { return };
    let folder = tempfile::tempdir().unwrap();
    let board = folder.path().join("board").display().to_string();
    let run = |bank: &'static str| {
        let words = "board run --emulator mps2-an386 --stage 739 --seconds 0.02 --low 3 --high 13 --bank";
        let mut words: Vec<String> = words.split(' ').map(str::to_owned).collect();
        words.extend([bank, "--image", &image, "-o", &board].map(str::to_owned));
        words
    };
    let of = |words: &[String]| answered(&words.iter().map(String::as_str).collect::<Vec<_>>());
    let text = fs::read_to_string(root().join("firmware/tables/tracking-739.toml")).unwrap();
    let bytes = hysteron_table::hash(&text).map(|byte| format!("{byte:02x}"));
    let named = format!("bank 1 of 2, table {}", bytes.concat());
    let said = of(&run("1"));
    assert!(said.contains(&named), "{said}");
    let dataset = read_dataset(Path::new(&board)).unwrap();
    assert!(dataset.description.ends_with(&named), "{}", dataset.description);
    let mut other = run("2");
    other.push("--overwrite".to_owned());
    let said = refused(&other.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(said.contains("bank 2: the image has 2 (0 to 1)"), "{said}");
}

/// A reference from a file comes back point by point in what the board recorded; what is none is refused by its line.
#[test]
fn val_board_run_follows_a_reference_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (file, board) = (path("raster.csv"), path("board"));
    let run = |image: &str| {
        // A point a tick: 50 kHz / 256.
        let words = "board run --emulator mps2-an386 --stage paper-rate --seconds 0.05 --hz 195.3125 --no-feedback";
        let mut words: Vec<String> = words.split(' ').map(str::to_owned).collect();
        words.extend(["--trajectory", &file, "--image", image, "-o", &board].map(str::to_owned));
        words
    };
    let refusal = |text: &str| {
        fs::write(&file, text).unwrap();
        let words = run("no-image");
        refused(&words.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let said = refusal("reference_um\n1\n1.5\ntwo\n");
    assert!(said.contains("line 4: `two` is no position in micrometres"), "{said}");
    let said = refusal("1\n2\n");
    assert!(
        said.contains("a reference has 256 points, one a line; here are 2"),
        "{said}"
    );
    let said = refusal(&"1.5\n".repeat(256));
    assert!(said.contains("all points of the reference are 1.5 um"), "{said}");
    let said = refusal("1\nNaN\n");
    assert!(said.contains("line 2: `NaN`"), "{said}");
    // Up with the square of the time, and down.
    let points: Vec<f64> = (0..256)
        .map(|i| 2.0 - 1.5 * (f64::from(i - 128) / 128.0).powi(2))
        .collect();
    let lines = points.iter().map(|um| format!("{um}\n"));
    fs::write(&file, "reference_um\n".to_owned() + &lines.collect::<String>()).unwrap();
    let Some(image) = image("mps2-an386") else { return };
    let words = run(&image);
    answered(&words.iter().map(String::as_str).collect::<Vec<_>>());
    let dataset = read_dataset(Path::new(&board)).unwrap();
    let reference_um = dataset.records[0].reference_um.as_ref().unwrap();
    // From the tick on that leaves the first point, until the stop.
    let start = reference_um.windows(2).position(|pair| pair[0] != pair[1]).unwrap();
    for (k, found_um) in reference_um[start..2500].iter().enumerate() {
        // Half a share of 1.5 um, and the roundings of f32.
        let off_um = (found_um - points[k % 256]).abs();
        assert!(off_um < 1.5 / 65_535.0 / 2.0 + 1e-6, "{k}: {found_um}");
    }
}

/// An image of both axes: either is recorded, with the other's command beside it, and what couples beyond the table's share is in the error.
#[test]
fn val_board_run_records_either_of_both_axes() {
    let (Some(both), Some(one)) = (image("tables/tracking-xy"), image("tables/tracking-8k")) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let common = [
        "board",
        "run",
        "--emulator",
        "mps2-an386",
        "--stage",
        "8k",
        "--seconds",
        "0.05",
    ];
    let range = ["--low", "3", "--high", "13", "--hz", "100"];
    let recorded = |name: &str, options: &[&str]| {
        let output = path(name);
        let beside = ["--stage-y", "739", "--hz-y", "37", "--image", &both, "-o", &output];
        let said = answered(&[&common[..], &range, &beside, options].concat());
        assert!(said.starts_with("3600 ticks, 0 overruns, 0 edges lost"), "{said}");
        assert!(!said.contains("fault"), "{said}");
        let off = |axis: &str| -> f64 {
            let line = said
                .lines()
                .find(|line| line.starts_with(&format!("{axis}: later")))
                .unwrap();
            let percent = line.split_whitespace().rev().nth(5).unwrap();
            percent.parse().unwrap()
        };
        let errors = [off("X"), off("Y")];
        (errors, read_dataset(Path::new(&output)).unwrap().records.remove(0))
    };
    let ([x, y], of_x) = recorded("x", &[]);
    assert!(x < 0.05 && y < 0.05, "{x} % and {y} %");
    let (_, of_y) = recorded("y", &["--axis", "y"]);
    assert_eq!(of_x.voltage2_v.as_ref(), Some(&of_y.voltage_v));
    assert_eq!(of_y.voltage2_v.as_ref(), Some(&of_x.voltage_v));
    let ([coupled, _], _) = recorded("coupled", &["--cross", "0.08,-0.006"]);
    assert!(coupled > 5.0 * x, "{coupled} % against {x} %");
    let nowhere = ["-o", "nowhere"];
    let said = refused(&[&common[..], &["--image", &both], &nowhere].concat());
    assert!(said.contains("the image is of both axes"), "{said}");
    let alone = ["--stage-y", "739", "--image", &one];
    let said = refused(&[&common[..], &alone, &nowhere].concat());
    assert!(said.contains("the board has one axis"), "{said}");
    let said = refused(&[&common[..], &alone, &["--cross", "0.01"], &nowhere].concat());
    assert!(said.contains("two shares of the other's motion"), "{said}");
}

/// `--format c` of a table: compiles as it is, under the name of its file, and what cannot be is refused.
#[test]
fn val_an_export_as_c_compiles() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let table = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/tables/tracking-8k.toml");
    let said = answered(&["export", table, "--format", "c", "-o", &at("my-stage.c")]);
    assert!(said.contains("call my_stage_step once a sample"), "{said}");
    let cc = std::process::Command::new("cc")
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-ffp-contract=off",
            "-c",
            "my-stage.c",
        ])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(cc.status.success(), "{}", String::from_utf8_lossy(&cc.stderr));
    let header = std::fs::read_to_string(at("my_stage.h")).unwrap();
    assert!(header.contains("#define MY_STAGE_SAMPLES_AHEAD 16"), "{header}");
    let said = refused(&["export", table, "--format", "c", "-o", &at("law.txt")]);
    assert!(said.contains("must end in .c"), "{said}");
    let said = refused(&["export", table, "--format", "c", "-o", &at("8k.c")]);
    assert!(said.contains("name = 8k: must be a letter"), "{said}");
}
