//! Import of MATLAB files, made here by a writer of the tests' own.
#![expect(clippy::unwrap_used, reason = "a helper that fails is a test that fails")]

#[path = "fuzzing/mat_writer.rs"]
mod support;

use hysteron_data::DataError;
use hysteron_data::import::{ImportOptions, Imported, import_from};
use support::{array, column, compressed, doubles, int16s, int32s, mat, singles, structure, text};

fn try_with(bytes: &[u8], columns: &[&str]) -> Result<Imported, DataError> {
    let columns = columns.iter().map(|column| column.parse().unwrap()).collect();
    import_from(
        bytes,
        "run.mat",
        &ImportOptions {
            columns,
            ..ImportOptions::default()
        },
        &mut |_| {},
    )
}

const UNITS: &[&str] = &["voltage=:V", "position=:um"];

fn check(
    variables: &[Vec<u8>],
    columns: &[&str],
    clock: (f64, f64),
    voltage_v: &[f64],
    position_um: &[f64],
) -> Imported {
    let packed: Vec<Vec<u8>> = variables.iter().map(|variable| compressed(variable)).collect();
    let plain = try_with(&mat(variables), columns).unwrap();
    assert_eq!(try_with(&mat(&packed), columns).unwrap(), plain, "compressed as plain");
    let record = &plain.records[0];
    assert_eq!((record.start_s, record.period_s), clock);
    assert_eq!((&*record.voltage_v, &*record.position_um), (voltage_v, position_um));
    plain
}

#[test]
fn val_variables_by_name_packed_as_matlab_does() {
    let (u, y) = ([1.0, 2.5, 4.0], [0.25, 0.5, 0.75]);
    let t = || column("t", &[0.0, 0.1, 0.2]);
    let clock = (0.0, 0.1);
    check(&[t(), column("u", &u), column("y", &y)], UNITS, clock, &u, &y);
    // rows, integers, single precision, long names, text and scalars between
    let row = |name: &str, data| array(6, &[1, 3], name, data);
    let found = check(
        &[
            text("remark", "hi"),
            row("voltage", int16s(&[1, -2, 300])),
            array(7, &[3, 1], "position", singles(&[0.25, 0.5, 0.75])),
            array(12, &[3, 1], "counter", int32s(&[1, 2, 3])),
            t(),
            column("gain", &[20.0]),
        ],
        UNITS,
        clock,
        &[1.0, -2.0, 300.0],
        &y,
    );
    assert_eq!(
        found.preview.notices,
        [
            "left out: remark: text",
            "variable 4 `t`: no unit given, taken as s",
            "variables ignored: 3 `counter`"
        ]
    );
    // a factor and a column of a matrix
    let matrix = array(6, &[3, 2], "data", doubles(&[1.0, 2.5, 4.0, 0.25, 0.5, 0.75]));
    check(
        &[t(), matrix],
        &["voltage=data[1]:V*10", "position=data[2]:um"],
        clock,
        &[10.0, 25.0, 40.0],
        &y,
    );
    // time in single precision jitters by its rounding only
    let single: Vec<f32> = (0..3).map(|i| i as f32 * 0.1).collect();
    check(
        &[
            array(7, &[3, 1], "t", singles(&single)),
            column("u", &u),
            column("y", &y),
        ],
        UNITS,
        clock,
        &u,
        &y,
    );
}

#[test]
fn val_structures_and_sample_period() {
    let (u, y) = ([1.0, 2.0], [3.0, 4.0]);
    let field = |values: &[f64]| array(6, &[values.len() as i32, 1], "", doubles(values));
    let signals = structure("", &[("u", field(&u)), ("y", field(&y))]);
    let log = structure("log", &[("time", field(&[0.0, 0.5])), ("signals", signals)]);
    check(
        &[log],
        &["voltage=log.signals.u:V", "position=log.signals.y:um"],
        (0.0, 0.5),
        &u,
        &y,
    );
    let found = check(
        &[
            column("fs", &[5000.0]),
            column("Ts", &[0.0002]),
            column("u", &u),
            column("y", &y),
        ],
        UNITS,
        (0.0, 0.0002),
        &u,
        &y,
    );
    assert_eq!(found.preview.notices, ["fs: taken as a sample period of 0.0002 s"]);
}

#[test]
fn val_big_endian() {
    // flags, size, name, numbers of two doubles, every word the other way round
    let number = |value: f64| value.to_be_bytes().to_vec();
    let word = |value: u32| value.to_be_bytes().to_vec();
    let variable = |name: u8, values: [f64; 2]| {
        let name = [vec![0, 1, 0, 1], vec![name, 0, 0, 0]].concat(); // small: bytes, type, data
        let body = [
            [word(6), word(8), word(6), word(0)].concat(),
            [word(5), word(8), word(2), word(1)].concat(),
            name,
            [word(9), word(16), number(values[0]), number(values[1])].concat(),
        ]
        .concat();
        [word(14), word(body.len() as u32), body].concat()
    };
    let mut bytes = mat(&[]);
    bytes.truncate(124);
    bytes.extend([0x01, 0x00, b'M', b'I']);
    for (name, values) in [(b't', [0.0, 0.5]), (b'u', [1.0, 2.0]), (b'y', [3.0, 4.0])] {
        bytes.extend(variable(name, values));
    }
    let found = try_with(&bytes, UNITS).unwrap();
    assert_eq!(
        (found.records[0].period_s, &*found.records[0].position_um),
        (0.5, &[3.0, 4.0][..])
    );
}

#[test]
fn refuse_files_with_what_to_do() {
    const SAVE: &str = "the file is damaged or no MATLAB file; save it again with `save('file.mat','-v7')`";
    let t = || column("t", &[0.0, 0.1, 0.2]);
    let u = || column("u", &[1.0, 2.0, 3.0]);
    let refuse = |bytes: &[u8], columns: &[&str], expect: &str| {
        assert_eq!(
            try_with(bytes, columns).unwrap_err().to_string(),
            format!("run.mat: {expect}")
        );
    };
    // version 7.3 is HDF5, with a head of MATLAB's before it; cut short behind the mark of either
    let mut v73 = b"MATLAB 7.3 MAT-file".to_vec();
    v73.resize(124, b' ');
    v73.extend([0x00, 0x02, b'I', b'M']);
    v73.resize(512, 0);
    v73.extend(b"\x89HDF\r\n\x1a\n");
    for (bytes, what) in [
        (&v73[..], "MATLAB file of version 7.3"),
        (b"\x89HDF\r\n\x1a\n\0\0", "HDF5 file"),
    ] {
        let error = try_with(bytes, UNITS).unwrap_err().to_string();
        let damaged = format!("the file is damaged or no {what}; ");
        assert!(
            error.starts_with("run.mat: HDF5: ") && error.contains(&damaged),
            "{error}"
        );
    }

    let whole = mat(&[t(), u(), column("y", &[1.0, 2.0, 3.0])]);
    refuse(
        &whole[..whole.len() - 20],
        UNITS,
        &format!("the file ends in the middle of a variable; {SAVE}"),
    );
    refuse(
        &whole[..132],
        UNITS,
        &format!("the file ends in the middle of a tag; {SAVE}"),
    );
    let error = try_with(&whole, &[]).unwrap_err().to_string();
    assert_eq!(
        error,
        "run.mat: no unit given for voltage (variable 2 `u`), no unit given for position (variable 3 `y`); the variables are \
         1 `t`, 2 `u`, 3 `y`; say which they are, as in `--column voltage=2:V --column position=3:um`"
    );
    refuse(
        &mat(&[t(), u()]),
        UNITS,
        "no position among the variables 1 `t`, 2 `u`; say which it is, as in `--column position=NAME:um`",
    );
    refuse(
        &mat(&[t(), u(), column("y", &[1.0, 2.0])]),
        UNITS,
        "t has 3 numbers, y has 2; the columns of a record have one length; choose them with `--column \
         QUANTITY=NAME:UNIT`",
    );
    refuse(
        &mat(&[text("remark", "hi")]),
        UNITS,
        "no vectors of numbers in the file (left out: remark: text); save time, voltage and position as vectors; of a \
         timeseries save its Time and Data",
    );
    refuse(
        &mat(&[
            column("Ts", &[0.1]),
            column("fs", &[5.0]),
            u(),
            column("y", &[1.0, 2.0, 3.0]),
        ]),
        UNITS,
        "Ts says a sample period of 0.1 s, fs says 0.2 s; give the rate with `--rate HZ`",
    );
    let gap = mat(&[
        column("t", &[0.0, 1.0, 2.0, 9.0]),
        column("u", &[0.0; 4]),
        column("y", &[0.0; 4]),
    ]);
    let error = try_with(&gap, UNITS).unwrap_err().to_string();
    assert!(
        error.starts_with("run.mat, t(4): a step of 7.0 s to 9.0 s: some 6 samples of 1.0 s are missing"),
        "{error}"
    );
    let nan = mat(&[t(), column("u", &[0.0, f64::NAN, 1.0]), column("y", &[0.0; 3])]);
    let error = try_with(&nan, UNITS).unwrap_err().to_string();
    assert!(error.starts_with("run.mat, u(2): found no number; "), "{error}");
}

/// Sizes in a file are claims: neither a large one nor a lie about it may take memory or time.
#[test]
fn refuse_sizes_that_cannot_be() {
    let t = array(6, &[i32::MAX, i32::MAX], "t", doubles(&[0.0]));
    let error = try_with(&mat(&[t]), UNITS).unwrap_err().to_string();
    assert!(
        error.contains("variable t claims 4611686014132420609 numbers; at most 67108864 are read"),
        "{error}"
    );
    let t = array(6, &[1 << 20, 1], "t", doubles(&[0.0]));
    let error = try_with(&mat(&[t]), UNITS).unwrap_err().to_string();
    assert!(
        error.contains("variable t claims 1048576 numbers and has 8 bytes of them"),
        "{error}"
    );
    let mut t = array(6, &[1 << 20, 1], "t", doubles(&[0.0]));
    let at = t.len() - 12;
    t[at..at + 4].copy_from_slice(&(8u32 << 20).to_le_bytes());
    let error = try_with(&mat(&[t]), UNITS).unwrap_err().to_string();
    assert!(
        error.contains("an element is longer than the variable it is in"),
        "{error}"
    );
    // structures in structures, deeper than anybody nests them, are left out
    let mut nested = structure("", &[("x", column("", &[1.0]))]);
    for _ in 0..40 {
        nested = structure("", &[("x", nested)]);
    }
    let error = try_with(&mat(&[nested]), UNITS).unwrap_err().to_string();
    assert!(error.contains("no vectors of numbers in the file"), "{error}");
}
