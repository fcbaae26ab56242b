//! Import of other programs' files, `predict`, and paths of the wrong kind, with the real binary.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use assert_cmd::Command;
use hysteron_data::import::{ImportOptions, import};
use std::path::{Path, PathBuf};

fn hysteron(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hysteron"));
    command.current_dir(folder);
    command
}

fn labs(file: &str) -> String {
    let labs = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../data/tests/fixtures/labs");
    labs.join(file).canonicalize().unwrap().display().to_string()
}

/// A folder with `stage/`, of a TDMS and two joined files, and `model.toml`.
fn fitted() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = String::from("Time [s],Voltage [V],Position [um]\n");
    for k in 0..1200 {
        let x = f64::from(k) / 400.0 * std::f64::consts::TAU;
        let (u, y) = (10.0 - 10.0 * x.cos(), 1.0 - (x - 0.15).cos());
        rows += &format!("{:.6},{u:.6},{y:.6}\n", f64::from(k) * 1e-4);
    }
    std::fs::write(folder.path().join("a.csv"), &rows).unwrap();
    std::fs::write(folder.path().join("b, c.csv"), rows.replace("Position", "Weg")).unwrap();
    let run = |arguments: &[&str]| hysteron(folder.path()).args(arguments).assert().success();
    run(&["import", "a.csv", "--validate", "b, c.csv", "-o", "stage"]);
    run(&["fit", "stage", "--model", "pi", "-o", "model.toml"]);
    folder
}

#[test]
fn val_predict_writes_what_the_model_says_in_each_format() {
    let folder = fitted();
    let model = hysteron_identify::Model::read(&folder.path().join("model.toml")).unwrap();
    let dataset = hysteron_data::read_dataset(&folder.path().join("stage")).unwrap();
    for name in ["out.csv", "out.npz", "out.parquet"] {
        let answer = hysteron(folder.path())
            .args(["predict", "model.toml", "stage", "-o", name])
            .assert()
            .success();
        let said = String::from_utf8(answer.get_output().stdout.clone()).unwrap();
        assert!(said.starts_with("a.csv: 1200 samples at 10000 Hz, residual "), "{said}");
        // the model as the position, and both records, one after the other: time jumps back between them
        let options = ImportOptions {
            columns: vec!["position=model_um".parse().unwrap()],
            gaps: hysteron_data::import::Gaps::Split,
            ..ImportOptions::default()
        };
        let found =
            import(&folder.path().join(name), &options, &mut |_, _| {}).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(found.records.len(), 2, "{name}");
        for (written, record) in found.records.iter().zip(&dataset.records) {
            assert_eq!(written.position_um, model.simulate(record).output, "{name}");
            assert_eq!(written.voltage_v, record.voltage_v, "{name}");
        }
    }
    let rows = std::fs::read_to_string(folder.path().join("out.csv")).unwrap();
    let mut rows = rows.lines();
    assert_eq!(
        rows.next(),
        Some("record,time_s,voltage_v,measured_um,model_um,residual_um")
    );
    let last: Vec<&str> = rows.next_back().unwrap().rsplit(',').collect();
    let [residual, model, measured] = [0, 1, 2].map(|k| last[k].parse::<f64>().unwrap());
    assert_eq!(residual, measured - model);
}

#[test]
fn val_import_of_binary_and_joined_files() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let answer = hysteron(folder.path()).args(arguments).assert().success();
        String::from_utf8(answer.get_output().stdout.clone()).unwrap()
    };
    let said = run(&["import", &labs("waveform.tdms"), &labs("h5py.h5"), "-o", "stage"]);
    assert!(
        said.contains("40 samples at 12000.0 Hz") && said.contains("2 records written"),
        "{said}"
    );
    let [one, two] = [labs("F0001CH1.CSV"), labs("F0001CH2.CSV")];
    let columns = [
        "--column",
        "voltage=F0001CH1:V*10",
        "--column",
        "position=F0001CH2:um*2",
    ];
    let said = run(&[&["import", "--join", &one, &two, "-o", "scope"], &columns[..]].concat());
    assert!(
        said.contains("joined on their clocks") && said.contains("1 record written"),
        "{said}"
    );
    let record = &hysteron_data::read_dataset(&folder.path().join("scope"))
        .unwrap()
        .records[0];
    assert_eq!((record.len(), record.rate_hz()), (40, 10_000.0));
}

#[test]
fn refuse_paths_of_another_kind_once() {
    let folder = fitted();
    let order = "datasets come before models, as in `hysteron compare stage model.toml`";
    for (arguments, parts) in [
        (
            &["compare", "model.toml", "stage"][..],
            &["stage: this is a dataset, and a model is wanted here", order][..],
        ),
        (
            &["fit", "model.toml", "--model", "pi"],
            &["model.toml: this is a model, and a dataset is wanted here", order],
        ),
        (
            &["predict", "stage", "model.toml", "-o", "x.csv"],
            &["stage: this is a dataset, and a model is wanted here"],
        ),
        (
            &["compare", "stage", "a.csv"],
            &["a.csv: this is a recording, and a model is wanted here"],
        ),
        (&["fit", "stage/dataset.toml", "--model", "pi"], &["give its folder"]),
        (&["import", "stage", "-o", "x"], &["stage: this is a dataset already"]),
        (
            &["import", ".", "-o", "x"],
            &["this is a folder; give the recordings in it"],
        ),
        (
            &["predict", "model.toml", "stage", "-o", "x.xlsx"],
            &["give it one of .csv, .npz and .parquet"],
        ),
        (
            &["fit", "nowhere", "--model", "pi"],
            &["nowhere: cannot open it: No such file or directory"],
        ),
    ] {
        let answer = hysteron(folder.path()).args(arguments).assert().code(2);
        let said = String::from_utf8(answer.get_output().stderr.clone()).unwrap();
        // a line is broken where it is too long, and marked
        let said = said
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect::<Vec<_>>()
            .join(" ");
        for part in parts {
            assert_eq!(said.matches(part).count(), 1, "{arguments:?}: `{part}` in {said}");
        }
        assert_eq!(
            said.matches("No such file").count(),
            usize::from(arguments[1] == "nowhere"),
            "{said}"
        );
    }
}
