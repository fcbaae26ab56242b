//! The report as a colleague gets it: one file, the same bytes, everything in it.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use assert_cmd::Command;
use hysteron_data::{Dataset, Overwrite, Record, Role, write_dataset};
use hysteron_plant::{Stage, preset};
use std::path::Path;

fn hysteron(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(folder)
        .args(arguments)
        .assert()
}

/// Two triangles of the stage with a delay to identify, one to validate.
fn stage_dataset(folder: &Path) {
    let rows = [(20.0, Role::Identify), (90.0, Role::Identify), (50.0, Role::Validate)];
    let records = rows.map(|(f, role)| {
        let period_s = 1e-4;
        let a_period = (1.0 / f / period_s) as usize;
        let drive = |k: usize| {
            let phase = (k % a_period) as f64 / a_period as f64;
            26.0 * (1.0 - (2.0 * phase - 1.0).abs())
        };
        let voltage_v: Vec<f64> = (0..4 * a_period).map(drive).collect();
        let run = Stage::new(&preset::paper_rate(), 1)
            .unwrap()
            .run(&voltage_v, period_s)
            .unwrap();
        Record {
            file: format!("triangle-{f}hz.csv"),
            role,
            excitation: format!("triangle {f} Hz"),
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
        name: "stage".into(),
        records: records.to_vec(),
        ..Dataset::default()
    };
    write_dataset(&dataset, folder, Overwrite::Refuse).unwrap();
}

#[test]
fn golden_the_report_is_one_valid_file_of_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    stage_dataset(&folder.path().join("stage"));
    hysteron(folder.path(), &["fit", "stage", "--model", "mpi", "-o", "model.toml"]).success();
    let report = || {
        hysteron(folder.path(), &["report", "stage", "model.toml", "-o", "report.html"]).success();
        std::fs::read_to_string(folder.path().join("report.html")).unwrap()
    };
    let page = report();
    assert_eq!(page, report(), "the same input gives the same bytes");
    assert!(page.len() < 1_500_000, "{} bytes", page.len());
    let read = scraper::Html::parse_document(&page);
    assert!(read.errors.is_empty(), "{:?}", read.errors);
    for outside in ["<script", "src=\"http", "href=\"http", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    let text: String = read.root_element().text().collect();
    for said in [
        "Which effect is missing",
        "The candidates, best first",
        "Where the error is",
        "hysteron report stage model.toml -o report.html",
        "hysteron diagnose stage model.toml",
        "triangle-50hz.csv",
        concat!("Made by hysteron ", env!("CARGO_PKG_VERSION")),
    ] {
        assert!(text.contains(said), "the page does not say: {said}");
    }
    use sha2::Digest;
    for file in ["model.toml", "stage/dataset.toml", "stage/triangle-90hz.csv"] {
        let bytes = std::fs::read(folder.path().join(file)).unwrap();
        let hash: String = sha2::Sha256::digest(&bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        assert!(text.contains(&hash), "the hash of {file}");
    }
    assert!(page.contains("<svg") && page.contains("prefers-color-scheme") && page.contains("@media print"));
}

#[test]
fn refuse_a_report_without_its_model() {
    let folder = tempfile::tempdir().unwrap();
    stage_dataset(&folder.path().join("stage"));
    let refused = hysteron(folder.path(), &["report", "stage", "none.toml"]).code(2);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(said.contains("none.toml"), "{said}");
    assert!(!folder.path().join("report.html").exists());
}
