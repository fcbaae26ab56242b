//! Every kind of recording of the table in `docs/recordings.md`: read, read with options, or refused with the line that
//! converts it. The binary files are written by the libraries that laboratories use, `fixtures/labs/make.py`.
#![expect(clippy::unwrap_used, reason = "a helper that fails is a test that fails")]

mod kinds;

use std::path::{Path, PathBuf};

use hysteron_data::import::{ImportOptions, Imported, import, import_joined};
use hysteron_data::{DataError, Record, read_record};
use kinds::{KINDS, Kind, Outcome, Reads, Source};

fn labs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/labs")
}

/// The record that every file holds.
fn truth() -> Record {
    read_record(&labs().join("truth.csv")).unwrap().0
}

/// The options as they are typed.
fn options(typed: &str) -> (ImportOptions, bool) {
    let mut options = ImportOptions::default();
    let mut joined = false;
    let mut words = typed.split_whitespace();
    while let Some(word) = words.next() {
        match word {
            "--join" => joined = true,
            "--column" => options
                .columns
                .push(words.next().unwrap().trim_matches('\'').parse().unwrap()),
            "--rate" => options.rate_hz = Some(words.next().unwrap().parse().unwrap()),
            other => panic!("{other}"),
        }
    }
    (options, joined)
}

fn read(kind: &Kind, folder: &Path) -> Result<Imported, DataError> {
    let (options, joined) = options(kind.options);
    let paths: Vec<PathBuf> = match kind.source {
        Source::Files(files) => files.iter().map(|file| labs().join(file)).collect(),
        Source::Made(file, make) => {
            let path = folder.join(file);
            std::fs::write(&path, make(&truth())).unwrap();
            vec![path]
        }
    };
    if joined {
        import_joined(&paths, &options, &mut |_, _| {})
    } else {
        import(&paths[0], &options, &mut |_, _| {})
    }
}

/// Whether position and voltage are those that were written, to the digits that the file has.
fn check(reads: &Reads, found: &Imported) -> Result<(), String> {
    let truth = truth();
    let (record, from) = (&found.records[0], reads.first);
    let shape = (found.records.len(), record.len(), record.rate_hz());
    if shape != (reads.runs, truth.len() - from, reads.rate_hz) {
        return Err(format!("runs, samples and rate are {shape:?}"));
    }
    for row in 0..record.len() {
        let (voltage, position) = (truth.voltage_v[from + row], truth.position_um[from + row]);
        let off = [record.voltage_v[row] - voltage, record.position_um[row] - position];
        if !off.iter().all(|off| off.abs() <= reads.digits) {
            return Err(format!("row {row} is off by {off:?}, allowed is {}", reads.digits));
        }
    }
    Ok(())
}

#[test]
fn val_every_kind_is_read_or_refused_with_the_line_that_converts_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut faults = Vec::new();
    for kind in KINDS {
        let found = read(kind, folder.path());
        let fault = match (&kind.outcome, found) {
            (Outcome::Read(reads), Ok(found)) => check(reads, &found).err(),
            (Outcome::Refused(line), Err(error)) => {
                let error = error.to_string();
                (!error.contains(line)).then_some(error)
            }
            (Outcome::Read(_), Err(error)) => Some(error.to_string()),
            (Outcome::Refused(_), Ok(found)) => Some(format!("read as {}", found.preview)),
        };
        faults.extend(fault.map(|fault| format!("{}: {fault}", kind.name)));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The table of the page, as the kinds above are.
fn table() -> String {
    let mut table = String::from("| recording | read | with |\n|---|---|---|\n");
    for kind in KINDS {
        let (how, with) = match (&kind.outcome, kind.options) {
            (Outcome::Read(_), "") => ("yes", String::new()),
            (Outcome::Read(_), options) => ("with options", format!("`{options}`")),
            (Outcome::Refused(line), _) => ("refused; convert by", format!("`{line}`")),
        };
        table.push_str(&format!("| {} | {how} | {with} |\n", kind.name));
    }
    table
}

#[test]
fn golden_the_table_of_the_page_is_that_of_the_kinds() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/recordings.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let (begin, end) = ("<!-- kinds: crates/data/tests/kinds -->\n", "<!-- end of kinds -->");
    let (before, rest) = text.split_once(begin).unwrap();
    let (found, after) = rest.split_once(end).unwrap();
    let table = table();
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&page, format!("{before}{begin}{table}{end}{after}")).unwrap();
        return;
    }
    assert_eq!(found, table, "UPDATE_GOLDEN=1 writes it anew");
}

/// Two runs in one file are two records.
#[test]
fn val_runs_of_one_file_are_records() {
    for (file, second) in [("groups.tdms", 0.5), ("one.lvm", 1.0)] {
        let found = import(&labs().join(file), &ImportOptions::default(), &mut |_, _| {}).unwrap();
        let [one, two] = found.records.as_slice() else {
            panic!("{file}: {}", found.preview)
        };
        assert!(
            one.file.ends_with("-1.csv") && two.file.ends_with("-2.csv"),
            "{} {}",
            one.file,
            two.file
        );
        let expect = if file == "one.lvm" {
            one.voltage_v[7] + second
        } else {
            one.voltage_v[7] * second
        };
        assert!((two.voltage_v[7] - expect).abs() < 1e-9, "{file}");
    }
}

/// An empty cell of a Parquet file is one that is missing.
#[test]
fn val_missing_values_of_columnar_files() {
    let path = labs().join("gaps.parquet");
    let refused = import(&path, &ImportOptions::default(), &mut |_, _| {})
        .unwrap_err()
        .to_string();
    assert!(refused.contains("position_um(8): found no number"), "{refused}");
    let closing = ImportOptions {
        missing: hysteron_data::import::Missing::Interpolate,
        ..ImportOptions::default()
    };
    let found = import(&path, &closing, &mut |_, _| {}).unwrap();
    let (y, truth) = (&found.records[0].position_um, truth().position_um);
    assert_eq!(y[7], truth[6] / 2.0 + truth[8] / 2.0);
    assert_eq!((y[6], y[8]), (truth[6], truth[8]));
}

/// Channels that begin apart by whole samples are joined where both are; others are refused with both clocks.
#[test]
fn val_clocks_of_joined_files() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, start: f64, period: f64, head: &str| {
        let rows: String = (0..50)
            .map(|k| format!("{:.7},{k}\n", start + f64::from(k) * period))
            .collect();
        let path = folder.path().join(name);
        std::fs::write(&path, format!("Time [s],{head}\n{rows}")).unwrap();
        path
    };
    let volts = file("volts.csv", 0.0, 1e-3, "Voltage [V]");
    let late = file("late.csv", 2e-3, 1e-3, "Position [um]");
    let found = import_joined(&[volts.clone(), late], &ImportOptions::default(), &mut |_, _| {}).unwrap();
    let record = &found.records[0];
    assert_eq!((record.len(), record.start_s, record.rate_hz()), (48, 2e-3, 1000.0));
    assert_eq!((record.voltage_v[0], record.position_um[0]), (2.0, 0.0));
    let notices = &found.preview.notices;
    assert!(
        notices.contains(&"48 samples that all files have, of 50 of the longest".into()),
        "{notices:?}"
    );
    for (start, period, expect) in [
        (0.0, 2e-3, "the files are on different clocks"),
        (4e-4, 1e-3, "the clocks are apart by 0.4 samples"),
    ] {
        let other = file("other.csv", start, period, "Position [um]");
        let refused = import_joined(&[volts.clone(), other], &ImportOptions::default(), &mut |_, _| {});
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains(expect), "{refused}");
    }
}

/// What the preview says of a file of channels.
#[test]
fn golden_preview_of_a_file_of_channels() {
    let path = labs().join("waveform.tdms");
    let found = import(&path, &ImportOptions::default(), &mut |_, _| {}).unwrap();
    let text = found.preview.to_string().replace(&labs().display().to_string(), "labs");
    assert_eq!(
        text,
        "labs/waveform.tdms: TDMS file: run/Voltage 40, run/Position 40\n  \
         voltage     channel 1 `run/Voltage` in V, by its name\n  \
         position    channel 2 `run/Position` in µm, by its name\n  \
         40 samples at 12000.0 Hz, 0.00325 s\n  \
         note: left out: run/Note: text\n"
    );
}
