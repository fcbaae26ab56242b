//! The native format: what is read, what is refused with which words, and that writing then reading changes no bit.

#![expect(clippy::unwrap_used, reason = "a helper that fails is a test that fails")]

use std::fs;
use std::path::Path;

use hysteron_data::{
    DataError, Dataset, Known, Overwrite, Record, Role, read_dataset, read_dataset_with_progress, read_record_from,
    write_dataset, write_record_csv, write_record_to,
};
use proptest::prelude::*;

fn read(text: &str) -> Result<(Record, Vec<String>), DataError> {
    let (record, notices) = read_record_from(text.as_bytes(), "run.csv")?;
    Ok((record, notices.into_iter().map(|notice| notice.text).collect()))
}

fn record(voltage_v: Vec<f64>, position_um: Vec<f64>) -> Record {
    Record::new("run.csv", Role::Identify, 0.5, voltage_v, position_um)
}

#[test]
fn val_reads_columns_units_and_clock() {
    let check = |text: &str, expect: Record, notices: &[&str]| {
        let found = read(text).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!(found.0, expect, "{text:?}");
        assert_eq!(found.1, notices, "{text:?}");
    };
    let plain = record(vec![0.0, 1.5], vec![-0.25, 1e-3]);
    check(
        "time_s,voltage_v,position_um\n0,0,-0.25\n0.5,1.5,1e-3\n",
        plain.clone(),
        &[],
    );
    check(
        "time_s,voltage_v,position_um\r\n0,0,-0.25\r\n0.5,1.5,1e-3",
        plain.clone(),
        &[],
    );
    check(
        "\u{feff}time_s, voltage_v ,position_um\n 0 ,0, -.25\n0.5,+1.5,1e-3\n\n\n",
        plain.clone(),
        &[],
    );
    check(
        "position_um,time_s,voltage_v\n-0.25,0,0\n1e-3,0.5,1.5\n",
        plain.clone(),
        &[],
    );
    check(
        "time_ms,voltage_mv,position_nm\n0,0,-250\n500,1500,1\n",
        plain.clone(),
        &[
            "column 1 (time_ms): converted from ms to s",
            "column 2 (voltage_mv): converted from mV to V",
            "column 3 (position_nm): converted from nm to µm",
        ],
    );
    check(
        "time_s,note,voltage_v,position_um,position_raw,temperature_raw\n0,a b,0,-0.25,7,1\n0.5,,1.5,1e-3,8,2\n",
        plain.clone(),
        &[
            "column 2 (note): ignored; not a quantity of a record",
            "column 5 (position_raw): ignored; its name begins as `position_um`, `position_nm`, `position_pm`, \
             `position_mm`, `position_m`",
            "column 6 (temperature_raw): ignored; its name begins as `temperature_c`, `temperature_k`, `temperature_f`",
        ],
    );
    check(
        "time_s,voltage_v,position_um,reference_um,temperature_k,voltage2_kv\n1,0,-0.25,1,273.15,0.1\n1.5,1.5,1e-3,2,274.15,0\n",
        Record {
            start_s: 1.0,
            reference_um: Some(vec![1.0, 2.0]),
            temperature_c: Some(vec![0.0, 1.0]),
            voltage2_v: Some(vec![100.0, 0.0]),
            ..plain
        },
        &[
            "column 5 (temperature_k): converted from K to °C",
            "column 6 (voltage2_kv): converted from kV to V",
        ],
    );
}

/// A header and rows that are right, with one line replaced.
fn with_line(line: usize, text: &str) -> String {
    let mut lines = [
        "time_s,voltage_v,position_um",
        "0,0,0",
        "0.1,1,0.3",
        "0.2,2,0.6",
        "0.3,3,0.9",
    ];
    lines[line - 1] = text;
    lines.join("\n")
}

#[test]
fn refuse_broken_csv_with_place_and_what_to_do() {
    const CELL: &str = "allowed is a finite number with `.` as decimal sign (`hysteron import` can close gaps and \
                        reads other spellings)";
    const COUNT: &str = "columns are separated by `,` and the decimal sign is `.`; for other spellings use \
                         `hysteron import`";
    const LAYOUT: &str = "the native header is `time_s,voltage_v,position_um`, then optionally `reference_um`, \
                          `temperature_c`, `voltage2_v`; for files of other programs use `hysteron import`";
    let check = |text: &str, expect: &str| {
        let found = read(text).expect_err(text).to_string();
        assert_eq!(found, expect, "{text:?}");
    };
    for (line, text, expect) in [
        (3, "0.1,x,0.3", format!("run.csv, line 3, column 2 (voltage_v): found `x`; {CELL}")),
        (3, "0.1,,0.3", format!("run.csv, line 3, column 2 (voltage_v): found ``; {CELL}")),
        (4, "0.2,2,NaN", format!("run.csv, line 4, column 3 (position_um): found `NaN`; {CELL}")),
        (4, "0.2,inf,1", format!("run.csv, line 4, column 2 (voltage_v): found `inf`; {CELL}")),
        (4, "0.2,1e999,1", format!("run.csv, line 4, column 2 (voltage_v): found `1e999`; {CELL}")),
        (4, "0.2,2 V,1", format!("run.csv, line 4, column 2 (voltage_v): found `2 V`; {CELL}")),
        (2, "0,0", format!("run.csv, line 2: 2 columns, the header has 3; {COUNT}")),
        (5, "0,3,1,0,9", format!("run.csv, line 5: 5 columns, the header has 3; {COUNT}")),
        (5, "0;3;1", format!("run.csv, line 5: 1 columns, the header has 3; {COUNT}")),
        (
            4,
            " ",
            "run.csv, line 4: the line is empty; a record has one line per sample, so delete it or restore the sample"
                .into(),
        ),
        (
            4,
            "0.1,2,0.6",
            "run.csv, line 4, column 1 (time_s): time 0.1 s does not come after 0.1 s; stamps must increase by one \
             sample period a line; `hysteron import` can repair this"
                .into(),
        ),
        (
            5,
            "0.4,3,0.9",
            "run.csv, line 5, column 1 (time_s): time 0.4 s is 0.2 s after the stamp before it; the other stamps \
             are 0.1 s apart and may be off by 0.025 s: samples are missing, the clock jitters, or the stamps \
             have too few digits; `hysteron import` can repair this"
                .into(),
        ),
        (1, "0,0,0", format!("run.csv, line 1: found `0,0,0` where the column names must be; {LAYOUT}")),
        (1, "time_s;voltage_v;position_um", format!(
            "run.csv, line 1: the columns of `time_s;voltage_v;position_um` are not separated by `,`; {LAYOUT}"
        )),
        (1, "time_s,volts,position_um", format!("run.csv, line 1: no voltage among `time_s,volts,position_um`; {LAYOUT}")),
        (
            1,
            "time_s,voltage,position_um",
            "run.csv, line 1, column 2 (voltage): no known unit of voltage at the end of the name; known are `voltage_v`, \
             `voltage_mv`, `voltage_uv`, `voltage_kv` (in lower case)"
                .into(),
        ),
        (
            1,
            "time_s,voltage_v,position_V",
            "run.csv, line 1, column 3 (position_V): no known unit of position at the end of the name; known are \
             `position_um`, `position_nm`, `position_pm`, `position_mm`, `position_m` (in lower case)"
                .into(),
        ),
        (
            1,
            "time_s,voltage_v,voltage_mv",
            "run.csv, line 1, column 3 (voltage_mv): a second column of voltage (the first is column 2); keep one of them"
                .into(),
        ),
    ] {
        check(&with_line(line, text), &expect);
    }
    check(
        "",
        "run.csv: the file is empty; the native header is `time_s,voltage_v,position_um`, then optionally `reference_um`, `temperature_c`, \
         `voltage2_v`; for files of other programs use `hysteron import`",
    );
    check(
        "time_s,voltage_v,position_um\n",
        "run.csv: 0 sample(s); a record needs at least 2",
    );
    check(
        "time_s,voltage_v,position_um\n0,0,0\n",
        "run.csv: 1 sample(s); a record needs at least 2",
    );
    check(
        "time_s,voltage_v,position_mm\n0,0,0\n1,1,1e308\n",
        "run.csv, line 3, column 3 (position_mm): found a number too large for its unit; allowed is a number that stays \
         finite when converted",
    );
    check(
        "time_s,voltage_v,position_um\n1e17,0,0\n100000000000000016,1,1\n",
        "run.csv, line 3, column 1 (time_s): time 1.0000000000000002e17 s is too large for the step between stamps; let \
         the time begin near 0",
    );
    check(
        "time_s,voltage_v,position_um\r0,0,0\r1,1,1\r",
        "run.csv: lines end in a carriage return alone; save it with line ends LF or CRLF",
    );
    let long = format!("time_s,voltage_v,position_um\n0,0,{}\n", "1".repeat(70_000));
    check(
        &long,
        "run.csv, line 2: the line is longer than 65536 bytes; a record has one line per sample",
    );
}

#[test]
fn refuse_files_that_are_not_utf8_text() {
    for (bytes, expect) in [
        (
            b"\xff\xfet\0i\0m\0e\0".as_slice(),
            "run.csv: the text is UTF-16; the native format is UTF-8; `hysteron import` reads UTF-16",
        ),
        (
            b"\x89PNG\x1a\0\0\0",
            "run.csv: this is a binary file; give a CSV, or make one of it with `hysteron import`",
        ),
    ] {
        assert_eq!(read_record_from(bytes, "run.csv").unwrap_err().to_string(), expect);
    }
}

fn finite() -> impl Strategy<Value = f64> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    prop_oneof![POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO, -200.0..200.0f64]
}

fn round_trip(record: &Record) -> Record {
    let mut text = Vec::new();
    write_record_to(record, &mut text).unwrap();
    let (found, notices) = read_record_from(text.as_slice(), &record.file)
        .unwrap_or_else(|error| panic!("{error}\n{}", String::from_utf8_lossy(&text)));
    assert_eq!(notices, []);
    found
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

proptest! {
    /// Every finite number, -0 and subnormals included, and every period come back bit for bit from a start at 0.
    #[test]
    fn prop_columns_and_period_round_trip_bit_for_bit(
        rows in prop::collection::vec((finite(), finite(), finite()), 2..40),
        period_s in prop_oneof![1e-7..1e3f64, (1u32..2_000_000).prop_map(|rate| 1.0 / f64::from(rate))],
    ) {
        let mut written = record(rows.iter().map(|row| row.0).collect(), rows.iter().map(|row| row.1).collect());
        written.voltage2_v = Some(rows.iter().map(|row| row.2).collect());
        written.period_s = period_s;
        let found = round_trip(&written);
        prop_assert_eq!(found.period_s.to_bits(), period_s.to_bits());
        prop_assert_eq!(found.start_s.to_bits(), 0f64.to_bits());
        prop_assert_eq!(bits(&found.voltage_v), bits(&written.voltage_v));
        prop_assert_eq!(bits(&found.position_um), bits(&written.position_um));
        prop_assert_eq!(found.voltage2_v.as_deref().map(bits), written.voltage2_v.as_deref().map(bits));
    }

    /// A clock that a person would write comes back bit for bit from any start.
    #[test]
    fn prop_decimal_clocks_round_trip_bit_for_bit(
        start in -1_000_000i32..1_000_000, period in 1u32..100_000, decimals in 0i32..9, samples in 2usize..300,
    ) {
        let mut written = record(vec![0.0; samples], vec![1.0; samples]);
        written.start_s = format!("{start}e-{decimals}").parse().unwrap();
        written.period_s = format!("{period}e-{decimals}").parse().unwrap();
        let found = round_trip(&written);
        prop_assert_eq!((found.start_s, found.period_s), (written.start_s, written.period_s));
    }

    /// Any other clock comes back within the rounding of its stamps over the whole span, in units in the last place of
    /// the largest stamp: 6 that the simplest period may be off the stamps' chord, and of the chord itself one for the
    /// last stamp (product and sum), a half for the division, a half for the period's own rounding.
    #[test]
    fn prop_other_clocks_round_trip_within_rounding(
        start_s in -1e3..1e3f64, period_s in 1e-6..1e1f64, samples in 2usize..300,
    ) {
        let mut written = record(vec![0.0; samples], vec![1.0; samples]);
        (written.start_s, written.period_s) = (start_s, period_s);
        let found = round_trip(&written);
        prop_assert_eq!(found.start_s.to_bits(), start_s.to_bits());
        let largest = start_s.abs() + written.duration_s();
        let off = (found.period_s - period_s).abs() * (samples - 1) as f64;
        prop_assert!(off <= 8.0 * f64::EPSILON * largest, "{} against {}, off {off:e}", found.period_s, period_s);
    }

    #[test]
    fn prop_random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = read_record_from(bytes.as_slice(), "run.csv");
        let mut text = b"time_s,voltage_v,position_um\n0,0,0\n".to_vec();
        text.extend(&bytes);
        let _ = read_record_from(text.as_slice(), "run.csv");
    }

    #[test]
    fn prop_rows_of_number_characters_give_a_sound_record_or_an_error(
        cells in prop::collection::vec("[-+0-9.eE,]{0,6}", 3..30),
    ) {
        let rows: Vec<String> = cells.chunks(3).map(|cells| cells.join(",")).collect();
        let text = format!("time_s,voltage_v,position_um\n{}\n", rows.join("\n"));
        if let Ok((record, _)) = read_record_from(text.as_bytes(), "run.csv") {
            prop_assert!(record.len() >= 2 && record.len() == record.position_um.len());
            prop_assert!(record.period_s > 0.0 && record.period_s.is_finite() && record.start_s.is_finite());
            prop_assert!(record.voltage_v.iter().chain(&record.position_um).all(|value| value.is_finite()));
        }
    }
}

fn dataset() -> Dataset {
    let mut second = record(vec![1.0, 2.0, 3.0], vec![0.1, 0.2, 0.3]);
    second.file = "sub/quiet.csv".into();
    second.role = Role::Validate;
    second.excitation = "constant \"0\" V, µ".into();
    second.reference_um = Some(vec![0.0; 3]);
    Dataset {
        name: "x-axis".into(),
        description: "two\nlines".into(),
        known: Known {
            delay_s: Some(30e-6),
            voltage_max_v: Some(150.0),
            ..Known::default()
        },
        records: vec![record(vec![0.0, 1.5], vec![-0.25, 1e-3]), second],
        notices: Vec::new(),
    }
}

#[test]
fn val_dataset_round_trips_and_reports_progress() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("new/x-axis");
    write_dataset(&dataset(), &place, Overwrite::Refuse).unwrap();
    let mut calls = Vec::new();
    let found = read_dataset_with_progress(&place, &mut |done, total| calls.push((done, total))).unwrap();
    assert_eq!(found, dataset());
    let &(done, total) = calls.last().unwrap();
    assert_eq!(done, total);
    assert!(calls.windows(2).all(|pair| pair[0].0 <= pair[1].0), "{calls:?}");
    let names = |folder: &Path| {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    assert_eq!(names(&place), ["dataset.toml", "run.csv", "sub"]);
    assert_eq!(names(&place.join("sub")), ["quiet.csv"]);
}

/// A start at -0 came back as 0: the first stamp was the sum of -0 and 0.
#[test]
fn regress_a_start_at_minus_zero() {
    let mut written = record(vec![0.0, 1.0], vec![0.0, 1.0]);
    written.start_s = -0.0;
    assert_eq!(round_trip(&written).start_s.to_bits(), (-0.0f64).to_bits());
}

#[test]
fn val_one_csv_is_a_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("up down.csv");
    fs::write(&path, "time_s,voltage_mv,position_um\n0,0,0\n1,1,1\n").unwrap();
    let found = read_dataset(&path).unwrap();
    assert_eq!((found.name.as_str(), found.records.len()), ("up down", 1));
    assert_eq!(
        (found.records[0].file.as_str(), found.records[0].role),
        ("up down.csv", Role::Identify)
    );
    assert_eq!(found.notices[0].file, "up down.csv");
}

#[test]
fn refuse_to_overwrite_unless_told() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    write_dataset(&dataset(), place, Overwrite::Refuse).unwrap();
    let mut changed = dataset();
    changed.name = "changed".into();
    let error = write_dataset(&changed, place, Overwrite::Refuse)
        .unwrap_err()
        .to_string();
    let expect = "already exists and is not overwritten; choose another place or say that it may be overwritten";
    assert_eq!(error, format!("{}: {expect}", place.join("dataset.toml").display()));
    assert_eq!(read_dataset(place).unwrap().name, "x-axis");
    write_dataset(&changed, place, Overwrite::Allow).unwrap();
    assert_eq!(read_dataset(place).unwrap().name, "changed");
    let csv = place.join("run.csv");
    let error = write_record_csv(&changed.records[0], &csv, Overwrite::Refuse)
        .unwrap_err()
        .to_string();
    assert_eq!(error, format!("{}: {expect}", csv.display()));
}

#[test]
fn refuse_a_record_that_could_not_be_read_back() {
    let check = |change: &dyn Fn(&mut Record), expect: &str| {
        let mut record = record(vec![0.0, 1.5], vec![-0.25, 1e-3]);
        change(&mut record);
        let mut out = Vec::new();
        assert_eq!(
            write_record_to(&record, &mut out).unwrap_err().to_string(),
            format!("run.csv: {expect}")
        );
        assert!(out.is_empty());
    };
    check(&|r| r.voltage_v[1] = f64::NAN, "voltage_v[1] = NaN; values are finite");
    check(
        &|r| r.position_um.push(0.0),
        "position_um has 3 samples, voltage_v has 2; all columns have the same length",
    );
    check(
        &|r| r.reference_um = Some(vec![]),
        "reference_um has 0 samples, voltage_v has 2; all columns have the same length",
    );
    check(&|r| r.voltage_v.truncate(1), "1 sample(s); a record needs at least 2");
    check(
        &|r| r.period_s = 0.0,
        "start_s = 0.0, period_s = 0.0; the period is positive and finite, the start finite",
    );
    check(
        &|r| (r.start_s, r.period_s) = (1.7e9, 1e-6),
        "stamps up to 1.7e9 s cannot tell samples 1e-6 s apart; let the record start near 0 s",
    );
}

#[test]
fn refuse_a_dataset_that_could_not_be_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let shown = folder.path().display().to_string();
    let check = |change: &dyn Fn(&mut Dataset), expect: &str| {
        let mut dataset = dataset();
        change(&mut dataset);
        let error = write_dataset(&dataset, folder.path(), Overwrite::Allow)
            .unwrap_err()
            .to_string();
        assert_eq!(error, format!("{shown}: {expect}"));
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            0,
            "nothing is left behind"
        );
    };
    check(
        &|d| d.records.clear(),
        "the dataset has no record; a dataset needs at least one",
    );
    check(
        &|d| d.records[1].file = "RUN.csv".into(),
        "two records are named \"RUN.csv\"; every record has a file of its own",
    );
    check(
        &|d| d.records[1].file = "../run.csv".into(),
        "file = \"../run.csv\"; a record's file is a path relative to the dataset's folder, inside it, with `/`",
    );
    check(
        &|d| d.known.delay_s = Some(-1.0),
        "[known] delay_s = -1; it is finite and not negative",
    );
    check(
        &|d| d.known.sensor_bandwidth_hz = Some(0.0),
        "[known] sensor_bandwidth_hz = 0; it is finite and above 0 Hz",
    );
}

#[test]
fn refuse_broken_manifests_with_place() {
    const KEYS: &str = "dataset.toml has `format = 1`, `name`, `description`, `[known]` (`delay_s`, `sensor_noise_um`, \
                        `sensor_bandwidth_hz`, `voltage_min_v`, `voltage_max_v`, `dac_v`, `adc_um`) and `[[record]]` (`file`, `role`, `excitation`)";
    const NAMES: &str = "a record's file is a path relative to the dataset's folder, inside it, with `/`";
    let record = "[[record]]\nfile = \"a.csv\"\nrole = \"identify\"\n";
    for (text, expect) in [
        (
            "".to_owned(),
            format!("d.toml, line 1, column 1: missing field `format`; {KEYS}"),
        ),
        (
            "format = 1\n".to_owned(),
            "d.toml: no [[record]]; a dataset needs at least one".to_owned(),
        ),
        (
            format!("format = 2\nnew = 1\n{record}"),
            "d.toml: format = 2; this program reads format = 1".to_owned(),
        ),
        (
            format!("format = 1\nnmae = \"x\"\n{record}"),
            format!(
                "d.toml, line 2, column 1: unknown field `nmae`, expected one of `format`, `name`, `description`, `known`, `record`; {KEYS}"
            ),
        ),
        (
            "format = 1\n[[record]]\nfile = \"a.csv\"\nrole = \"train\"\n".to_owned(),
            format!("d.toml, line 4, column 8: unknown variant `train`, expected `identify` or `validate`; {KEYS}"),
        ),
        (
            "format = 1\n[[record]]\nfile = \"a.csv\"\n".to_owned(),
            format!("d.toml, line 2, column 1: missing field `role`; {KEYS}"),
        ),
        (
            format!("format = 1\n{record}[known]\ndelay_s = \"30 us\"\n"),
            format!("d.toml, line 6, column 11: invalid type: string \"30 us\", expected f64; {KEYS}"),
        ),
        (
            format!("format = 1\n{record}[known]\nvoltage_min_v = 10\nvoltage_max_v = 1\n"),
            "d.toml: [known] voltage_min_v = 10, voltage_max_v = 1; the minimum is below the maximum".to_owned(),
        ),
        (
            format!("format = 1\n{record}{record}"),
            "d.toml: records 1 and 2 are both file = \"a.csv\"; list each file once".to_owned(),
        ),
        (
            "format = 1\n[[record]]\nfile = \"/etc/passwd\"\nrole = \"identify\"\n".to_owned(),
            format!("d.toml: record 1: file = \"/etc/passwd\"; {NAMES}"),
        ),
    ] {
        assert_eq!(
            hysteron_data::native::parse_manifest(&text, "d.toml")
                .unwrap_err()
                .to_string(),
            expect
        );
    }
}

#[test]
fn refuse_what_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let shown = folder.path().display().to_string();
    assert_eq!(
        read_dataset(folder.path()).unwrap_err().to_string(),
        format!(
            "{shown}: the folder has no dataset.toml; give a dataset folder or one CSV, or make a dataset of \
                 recordings with `hysteron import`"
        )
    );
    let missing = folder.path().join("no.csv");
    let error = read_dataset(&missing).unwrap_err().to_string();
    assert!(
        error.starts_with(&format!("{}: cannot open it: ", missing.display())),
        "{error}"
    );
    fs::write(
        folder.path().join("dataset.toml"),
        "format = 1\n[[record]]\nfile = \"no.csv\"\nrole = \"identify\"\n",
    )
    .unwrap();
    let error = read_dataset(folder.path()).unwrap_err().to_string();
    assert!(
        error.starts_with(&format!("{}: cannot open it: ", missing.display())),
        "{error}"
    );
}

/// The recordings beside the project, where they are: they read without notices, at the rates their notes give, and
/// writing then reading them changes nothing.
#[test]
fn val_real_recordings() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if !shared.is_dir() {
        println!("skipped: no recordings in ../shared/data");
        return;
    }
    for (name, records, rate_hz) in [("cubespec-fsm-lowband", 9, 1600.0), ("piezo-150v-1hz-step", 2, 5000.0)] {
        let found = read_dataset(&shared.join(name)).unwrap();
        assert_eq!(
            (found.name.as_str(), found.records.len(), found.notices.len()),
            (name, records, 0)
        );
        for record in &found.records {
            assert_eq!(record.period_s, 1.0 / rate_hz, "{}", record.file);
            assert_eq!(
                &round_trip(record),
                &Record {
                    role: Role::Identify,
                    excitation: String::new(),
                    ..record.clone()
                }
            );
        }
    }
    for case in 1..=16 {
        let found = read_dataset(&shared.join(format!("practice/case-{case:02}"))).unwrap();
        assert_eq!((found.records.len(), found.notices.len()), (15, 0));
        assert!(
            found
                .records
                .iter()
                .all(|r| [200.0, 1e3, 2e3, 5e3, 1e4, 2e4, 5e4].contains(&(1.0 / r.period_s).round()))
        );
    }
}
