//! Import of text: what is read of what other programs write, and what is refused with which words.
#![expect(clippy::unwrap_used, reason = "a helper that fails is a test that fails")]

use hysteron_data::import::{Decimal, Gaps, ImportOptions, Imported, Jitter, Missing, Separator, import, import_from};
use hysteron_data::{DataError, Overwrite, Role, read_record, write_record_csv};

fn try_with(bytes: &[u8], options: &ImportOptions) -> Result<Imported, DataError> {
    import_from(bytes, "run.csv", options, &mut |_| {})
}

fn told(columns: &[&str]) -> ImportOptions {
    ImportOptions {
        columns: columns.iter().map(|column| column.parse().unwrap()).collect(),
        ..ImportOptions::default()
    }
}

/// Reads a text that gives one record: clock, voltage, position.
fn check(text: &str, options: &ImportOptions, clock: (f64, f64), voltage_v: &[f64], position_um: &[f64]) -> Imported {
    let found = try_with(text.as_bytes(), options).unwrap_or_else(|error| panic!("{text:?}: {error}"));
    assert_eq!(found.records.len(), 1, "{text:?}");
    let record = &found.records[0];
    assert_eq!((record.start_s, record.period_s), clock, "{text:?}");
    assert_eq!(record.voltage_v, voltage_v, "{text:?}");
    assert_eq!(record.position_um, position_um, "{text:?}");
    found
}

fn refuse(text: &str, options: &ImportOptions, expect: &str) {
    let found = try_with(text.as_bytes(), options).unwrap_err().to_string();
    assert_eq!(found, expect, "{text:?}");
}

#[test]
fn val_dialects_of_usual_programs() {
    let default = ImportOptions::default();
    let (clock, voltage, position) = ((0.0, 0.1), [1.5, 2.5, 3.5], [0.25, 0.5, 0.75]);
    for text in [
        "time_s,voltage_v,position_um\n0,1.5,0.25\n0.1,2.5,0.5\n0.2,3.5,0.75\n",
        "Time [s];Voltage [V];Position [µm]\n0,0;1,5;0,25\n0,1;2,5;0,5\n0,2;3,5;0,75\n",
        "Time [s];Voltage [V];Position [um]\r\n0.0;1.5;0.25\r\n0.1;2.5;0.5\r\n0.2;3.5;0.75\r\n",
        "t (ms)\tu (mV)\ty (nm)\n0\t1500\t250\n100\t2500\t500\n200\t3500\t750\n",
        "\u{feff}t/ms,Voltage/V,\"Position, um\"\n0,1.5,0.25\n100,2.5,0.5\n200,3.5,0.75\n",
        "\"Time (s)\",\"Piezo voltage (V)\",\"disp_um\"\n\"0\",\"1.5\",\"0.25\"\n\"0.1\",\"2.5\",\"0.5\"\n\"0.2\",\"3.5\",\"0.75\"\n",
        "# Rig 3, 2026-11-21\n# operator: me\n\n# time_s voltage_v position_um\n0 1.5 0.25\n0.1 2.5 0.5\n0.2 3.5 0.75\n",
        "Time,Voltage,Position\n(ms),(V),(µm)\n\n0,1.5,0.25\n100,2.5,0.5\n200,3.5,0.75\n",
        "Zeit [ms]\tSteuerspannung [V]\tVerschiebung [µm]\n0,0\t1,5\t0,25\n100,0\t2,5\t0,5\n200,0\t3,5\t0,75\n",
        "Zeit in s;Spannung in V;Auslenkung in µm\n0;1,5;0,25\n0,1;2,5;0,5\n0,2;3,5;0,75\n",
        "POSITION_UM,TIME_S,VOLTAGE_V\n0.25,0,1.5\n0.5,0.1,2.5\n0.75,0.2,3.5\n",
        "Index;Time [s];Voltage [V];Sensor [V];Position [µm];Comment\n1;0;1,5;9;0,25;start\n2;0,1;2,5;9;0,5;\n3;0,2;3,5;9;0,75;\n",
    ] {
        check(text, &default, clock, &voltage, &position);
    }
}

#[test]
fn val_other_quantities_and_role() {
    let text = "t [s],u [V],y [um],Target position [nm],T [K],u2 [V]\n0,1,2,3000,273.15,5\n1,2,3,4000,274.15,6\n";
    let options = ImportOptions {
        role: Role::Validate,
        ..ImportOptions::default()
    };
    let found = check(text, &options, (0.0, 1.0), &[1.0, 2.0], &[2.0, 3.0]);
    let record = &found.records[0];
    assert_eq!(record.reference_um.as_deref(), Some(&[3.0, 4.0][..]));
    assert_eq!(record.temperature_c.as_deref(), Some(&[0.0, 1.0][..]));
    assert_eq!(record.voltage2_v.as_deref(), Some(&[5.0, 6.0][..]));
    assert_eq!((record.role, record.file.as_str()), (Role::Validate, "run.csv"));
}

#[test]
fn val_encodings() {
    let text = "t [ms];u [V];y [µm]\n0;1,5;2\n100;2,5;3\n";
    let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let little: Vec<u8> = "\u{feff}"
        .chars()
        .chain(text.chars())
        .flat_map(|c| (c as u16).to_le_bytes())
        .collect();
    let big: Vec<u8> = "\u{feff}"
        .chars()
        .chain(text.chars())
        .flat_map(|c| (c as u16).to_be_bytes())
        .collect();
    for bytes in [text.as_bytes().to_vec(), latin, little, big] {
        let found = try_with(&bytes, &ImportOptions::default()).unwrap();
        assert_eq!(found.records[0].voltage_v, [1.5, 2.5]);
        assert_eq!(found.records[0].period_s, 0.1);
    }
}

#[test]
fn golden_preview_says_what_was_found() {
    let text = "Rig 3\nZeit;Spannung [mV];Weg [nm];Raum\n0,0;1500;250;x\n0,2;2500;500;y\n";
    let found = try_with(text.as_bytes(), &told(&["voltage=:mV*20"])).unwrap();
    assert_eq!(
        found.preview.to_string(),
        "run.csv: table, UTF-8, separator `;`, decimal sign `,`\n  names in line 2, samples from line 3\n  \
         time        column 1 `Zeit` in s, by its name\n  \
         voltage     column 2 `Spannung [mV]` in mV times 20, as told\n  \
         position    column 3 `Weg [nm]` in nm, by its name\n  \
         2 samples at 5.0 Hz, 0.2 s\n  \
         note: column 1 `Zeit`: no unit given, taken as s\n  \
         note: columns ignored: 4 `Raum`\n  \
         note: voltage `Spannung [mV]`: converted from mV to V\n  \
         note: position `Weg [nm]`: converted from nm to µm\n"
    );
    assert_eq!(found.records[0].voltage_v, [30.0, 50.0]);
}

#[test]
fn val_columns_told_by_number_name_unit_and_factor() {
    let text = "0,1.5,0.25\n0.1,2.5,0.5\n";
    check(
        text,
        &told(&["time=1:s", "voltage=2:V", "position=3:um"]),
        (0.0, 0.1),
        &[1.5, 2.5],
        &[0.25, 0.5],
    );
    let text = "t,CH1 (V),CH2 (V)\n0,1.5,0.25\n0.1,2.5,0.5\n";
    let found = check(
        text,
        &told(&["voltage=CH1:V*20", "position=CH2 (V):um*5"]),
        (0.0, 0.1),
        &[30.0, 50.0],
        &[1.25, 2.5],
    );
    assert!(
        found
            .preview
            .notices
            .contains(&"column 3 `CH2 (V)`: the file says `V`, read as µm because told so".into()),
        "{:?}",
        found.preview.notices
    );
    // two columns of voltage: the one that is told
    let text = "t [s],Voltage command [V],Voltage [V],y [um]\n0,1,9,1\n1,2,9,2\n";
    check(text, &told(&["voltage=2"]), (0.0, 1.0), &[1.0, 2.0], &[1.0, 2.0]);
}

#[test]
fn val_rate_instead_of_time() {
    let text = "u [V],y [um]\n1,2\n3,4\n";
    let options = ImportOptions {
        rate_hz: Some(5000.0),
        ..ImportOptions::default()
    };
    check(text, &options, (0.0, 0.0002), &[1.0, 3.0], &[2.0, 4.0]);
    // in place of a time that is in the file
    check(
        "t [s],u [V],y [um]\n0,1,2\n0,3,4\n",
        &options,
        (0.0, 0.0002),
        &[1.0, 3.0],
        &[2.0, 4.0],
    );
    refuse(
        text,
        &ImportOptions::default(),
        "run.csv, line 1: no time among the columns 1 `u [V]`, 2 `y [um]`; say which it is, as in `--column \
         time=NAME:s`, or the sample rate with `--rate HZ`",
    );
    refuse(
        text,
        &ImportOptions {
            rate_hz: Some(0.0),
            ..ImportOptions::default()
        },
        "a sample rate of 0 Hz; the rate is positive and finite",
    );
    refuse(
        "t,u [V],y [um]\n0,1,2\n1,3,4\n",
        &ImportOptions {
            rate_hz: Some(1.0),
            ..told(&["time=1:s"])
        },
        "a sample rate of 1 Hz and a column of time; give one of them: the rate is used instead of the time in the file",
    );
}

#[test]
fn refuse_columns_and_units_that_are_not_clear() {
    let default = ImportOptions::default();
    for (text, expect) in [
        (
            "t [s],CH1 [V],CH2 [V]\n0,1,2\n1,2,3\n",
            "run.csv, line 1: no voltage, no position; the columns are 1 `t [s]`, 2 `CH1 [V]`, 3 `CH2 [V]`; say which they \
             are, as in `--column voltage=2:V --column position=3:um`",
        ),
        (
            "t [s],CH1 [V],y [um]\n0,1,2\n1,2,3\n",
            "run.csv, line 1: no voltage among the columns 1 `t [s]`, 2 `CH1 [V]`, 3 `y [um]`; say which it is, as in \
             `--column voltage=2:V`",
        ),
        (
            "t,u,y\n0,1,2\n1,2,3\n",
            "run.csv, line 1: no unit given for voltage (column 2 `u`), no unit given for position (column 3 `y`); the \
             columns are 1 `t`, 2 `u`, 3 `y`; say which they are, as in `--column voltage=2:V --column position=3:um`",
        ),
        (
            "stamp [s],u,x [nm],y [um]\n0,1,2,3\n1,2,3,4\n",
            "run.csv, line 1: no time, no unit given for voltage (column 2 `u`); the columns are 1 `stamp [s]`, 2 `u`, 3 \
             `x [nm]`, 4 `y [um]`; say which they are, as in `--column time=1:s --column voltage=2:V`, or the sample rate \
             with `--rate HZ`",
        ),
        (
            "t [s],u,y [um]\n0,1,2\n1,2,3\n",
            "run.csv, line 1, column 2 (u): no unit given for voltage; known are V, mV, µV, kV; say which it is, as in \
             `--column voltage=2:V` (with a gain: `V*20`)",
        ),
        (
            "t [s],u [MV],y [um]\n0,1,2\n1,2,3\n",
            "run.csv, line 1, column 2 (u [MV]): `MV` is no unit of voltage; known are V, mV, µV, kV; say which it is, \
             as in `--column voltage=2:V` (with a gain: `V*20`)",
        ),
        (
            "t [s],u [V],position [V]\n0,1,2\n1,2,3\n",
            "run.csv, line 1, column 3 (position [V]): `V` is no unit of position; known are µm, nm, pm, mm, m; say \
             which it is, as in `--column position=3:um` (with a gain: `um*20`)",
        ),
        (
            "t [s],u [V],x position [um],y position [um]\n0,1,2,3\n1,2,3,4\n",
            "run.csv, line 1, column 4 (y position [um]): a second column of position (the first is column 3); say \
             which it is, as in `--column position=3:um`",
        ),
        (
            "0,1,2\n1,2,3\n",
            "run.csv: no time, no voltage, no position; the 3 columns have no names; say which they are, as in `--column \
             time=1:s --column voltage=2:V --column position=3:um`, or the sample rate with `--rate HZ`",
        ),
        (
            "0,1\n1,2\n",
            "run.csv: no time, no voltage, no position; the 2 columns have no names; say which they are, as in `--rate HZ \
             --column voltage=1:V --column position=2:um`",
        ),
    ] {
        refuse(text, &default, expect);
    }
    let text = "t [s],u [V],y [um]\n0,1,2\n1,2,3\n";
    for (column, expect) in [
        (
            "voltage=drive:V",
            "voltage = `drive`: there is no such column; columns are 1 `t [s]`, 2 `u [V]`, 3 `y [um]`",
        ),
        (
            "voltage=4",
            "voltage = column 4, of 3; columns are 1 `t [s]`, 2 `u [V]`, 3 `y [um]`",
        ),
    ] {
        refuse(text, &told(&[column]), expect);
    }
    refuse(
        text,
        &told(&["voltage=2", "position=2"]),
        "column 2 is both voltage and position; give each quantity a column of its own",
    );
    refuse(
        text,
        &told(&["voltage=2", "voltage=3:V"]),
        "voltage is given two columns; give each quantity one",
    );
}

#[test]
fn refuse_choices_that_cannot_be() {
    for (text, expect) in [
        (
            "voltage",
            "`voltage` has no `=`; give QUANTITY=COLUMN:UNIT*FACTOR+OFFSET, as in `voltage=CH1:mV*20` or `position=3:um`",
        ),
        (
            "volt=1",
            "`volt=1`: `volt` is no quantity of a record; known are time, voltage, position, reference, temperature, voltage2",
        ),
        (
            "voltage=1:um",
            "`voltage=1:um`: `um` is no unit of voltage; known are V, mV, µV, kV",
        ),
        (
            "voltage=1:V*x",
            "`voltage=1:V*x`: `x` is no factor; a factor is a finite number, not 0",
        ),
        (
            "position=1:um*5+x",
            "`position=1:um*5+x`: `+x` is no offset; an offset is a finite number in the unit before it, as in `um*5-50`",
        ),
        (
            "voltage=0:V",
            "`voltage=0:V`: there is no column 0; columns count from 1",
        ),
        (
            "voltage=",
            "`voltage=` says nothing; give QUANTITY=COLUMN:UNIT*FACTOR+OFFSET, as in `voltage=CH1:mV*20` or `position=3:um`",
        ),
    ] {
        assert_eq!(
            text.parse::<hysteron_data::import::ColumnChoice>()
                .unwrap_err()
                .to_string(),
            expect
        );
    }
}

#[test]
fn refuse_cells_and_rows_with_their_place() {
    const DECIMAL: &str = "allowed is a number with `.` as decimal sign; `--decimal comma` reads commas";
    const MISSING: &str = "samples must not be missing; `--missing trim` leaves out such lines at both ends, `--missing \
                           interpolate` also closes single gaps";
    let head = "t [s];u [V];y [um]\n0;1;2.5\n1;2;3\n2;3;4\n";
    for (rows, expect) in [
        (
            "3;x;5\n",
            format!("run.csv, line 5, column 2 (u [V]): found `x`; {DECIMAL}"),
        ),
        (
            "3;1,5;5\n",
            format!("run.csv, line 5, column 2 (u [V]): found `1,5`; {DECIMAL}"),
        ),
        (
            "3;;5\n",
            format!("run.csv, line 5, column 2 (u [V]): found ``; {MISSING}"),
        ),
        (
            "3;4;NaN\n",
            format!("run.csv, line 5, column 3 (y [um]): found `NaN`; {MISSING}"),
        ),
        (
            "3;4\n",
            "run.csv, line 5: 2 columns, the header has 3; every sample has one cell a column; if commas are decimal \
             signs, save the file with `;` between columns"
                .into(),
        ),
        (
            "\n3;4;5\n",
            "run.csv, line 5: the line is empty; a record has one line per sample, so delete it or restore the sample"
                .into(),
        ),
    ] {
        refuse(&format!("{head}{rows}"), &ImportOptions::default(), &expect);
    }
    refuse(
        "Time;u [V];y [um]\n12:00:01;1.5;2\n12:00:02;1;2\n12:00:03;1;2\n",
        &ImportOptions::default(),
        &format!(
            "run.csv, line 2, column 1 (Time): found `12:00:01`; {DECIMAL}; for dates and times of day give the rate with \
             `--rate HZ`"
        ),
    );
    refuse(
        "t [s];u [V];y [um]\n0;1;2\n",
        &ImportOptions::default(),
        "run.csv: 1 sample(s); a record needs at least 2",
    );
    refuse(
        "t [s];u [V];y [m]\n0;1;2\n1;1;1e305\n",
        &ImportOptions::default(),
        "run.csv, line 3, column 3 (y [m]): found a number too large for its unit; allowed is a number that stays \
         finite when converted",
    );
    let comma = ImportOptions {
        decimal: Some(Decimal::Comma),
        ..ImportOptions::default()
    };
    check(
        "t [s];u [V];y [um]\n0;1;2\n1;2;3\n2;3,5;4\n",
        &comma,
        (0.0, 1.0),
        &[1.0, 2.0, 3.5],
        &[2.0, 3.0, 4.0],
    );
}

#[test]
fn refuse_commas_that_mean_two_things() {
    let text = "time_s,voltage_v,position_um\n0,001,1,5,2,25\n0,002,1,6,2,35\n0,003,1,7,2,45\n";
    refuse(
        text,
        &ImportOptions::default(),
        "run.csv, line 1: 3 names, but the rows have 6 cells separated by `,`; if commas are decimal signs, save the \
         file with `;` between columns; if this is not the line of names, give it with `--header-line`",
    );
    let text = "0,001,1,5\n0,002,1,6\n0,003,1,7\n";
    let expect = "run.csv, line 1: `0,001,1,5` looks like decimal commas between separating commas; save the file with \
                  `;` between columns, or say `--separator comma` if these are integers";
    refuse(text, &told(&["time=1:s", "voltage=2:V", "position=3:um"]), expect);
    // integers that the user vouches for
    let options = ImportOptions {
        separator: Some(Separator::Comma),
        rate_hz: Some(1.0),
        ..told(&["voltage=2:V", "position=4:um"])
    };
    check(text, &options, (0.0, 1.0), &[1.0, 2.0, 3.0], &[5.0, 6.0, 7.0]);
}

#[test]
fn refuse_what_is_no_text() {
    for (bytes, expect) in [
        (
            b"\x89PNG\r\n\x1a\n\0\0\0\0".as_slice(),
            "run.csv: this is a picture; this makes a table of it that can be imported: save the samples instead of the \
             screen",
        ),
        (
            b"\x01\x02\0\0\0\0".as_slice(),
            "run.csv: this is a binary file of a kind that is not known; CSV, TDMS, LVM, MATLAB, HDF5, NumPy, Parquet, \
             Feather, Excel, JSON and PI's GCS are read; export one of them",
        ),
        (
            b"t,u\r1,2\r3,4\r",
            "run.csv: lines end in a carriage return alone; save it with line ends LF or CRLF",
        ),
    ] {
        assert_eq!(
            try_with(bytes, &ImportOptions::default()).unwrap_err().to_string(),
            expect
        );
    }
    let long = [b"t,u,y\n0,1,2\n".as_slice(), &vec![b'1'; 70_000]].concat();
    assert_eq!(
        try_with(&long, &ImportOptions::default()).unwrap_err().to_string(),
        "run.csv, line 3: the line is longer than 65536 bytes; a record has one line per sample"
    );
}

#[test]
fn val_missing_samples_are_trimmed_and_closed_when_told() {
    let text = "t [s],u [V],y [um]\n0,,NaN\n1,1,1\n2,,2\n3,3,3\n4,4,5\n5,nan,6\n";
    let trim = ImportOptions {
        missing: Missing::Trim,
        ..ImportOptions::default()
    };
    let interpolate = ImportOptions {
        missing: Missing::Interpolate,
        ..ImportOptions::default()
    };
    let found = check(
        text,
        &interpolate,
        (1.0, 1.0),
        &[1.0, 2.0, 3.0, 4.0],
        &[1.0, 2.0, 3.0, 5.0],
    );
    let expect = "1 rows at the beginning and 1 at the end left out: cells missing";
    assert_eq!(
        found.preview.notices,
        [expect, "column 2 (u [V]): 1 missing samples interpolated"]
    );
    let only = "only rows at both ends (`--missing trim`) and single samples in between (`--missing interpolate`) can be \
                missing; cut the record there";
    refuse(
        text,
        &trim,
        &format!("run.csv, line 4, column 2 (u [V]): found no number; {only}"),
    );
    let text = "t [s],u [V],y [um]\n1,1,1\n2,,2\n3,,3\n4,4,5\n";
    refuse(
        text,
        &interpolate,
        &format!("run.csv, line 3, column 2 (u [V]): found no number; {only}"),
    );
    refuse(
        "t [s],u [V],y [um]\n1,1,1\n2,,2\n3,,3\n",
        &trim,
        "run.csv: 1 sample(s); a record needs at least 2",
    );
}

/// The offset of a sensor, after its gain, in the unit.
#[test]
fn val_units_with_gain_and_offset() {
    for (column, expect) in [
        ("position=CH2:um*5-50", [-45.0, -40.0]),
        ("position=CH2:nm*1e3+0.5e3", [1.5, 2.5]),
        ("position=CH2:um*-2", [-2.0, -4.0]),
        ("position=CH2:um+1e-1", [1.1, 2.1]),
        ("position=3:mm*2e-3-1e-3", [1.0, 3.0]),
    ] {
        let text = "t [s],u [V],CH2 [V]\n0,1,1\n1,2,2\n";
        let found = try_with(text.as_bytes(), &told(&[column])).unwrap_or_else(|error| panic!("{column}: {error}"));
        let found = &found.records[0].position_um;
        assert!(
            found
                .iter()
                .zip(expect)
                .all(|(found, expect)| (found - expect).abs() < 1e-12),
            "{column}: {found:?}"
        );
    }
}

/// A cell that is no number is said where it is, though it is in the first rows.
#[test]
fn regress_a_text_cell_near_the_head_is_said_as_such() {
    for row in 0..3 {
        let cell = |k: usize| if k == row { "abc".to_owned() } else { k.to_string() };
        let rows: String = (0..8).map(|k| format!("{k},{},{k}\n", cell(k))).collect();
        let text = format!("time_s,voltage_v,position_um\n{rows}");
        let expect = format!(
            "run.csv, line {}, column 2 (voltage_v): found `abc`; allowed is a number with `.` as decimal sign",
            row + 2
        );
        refuse(&text, &ImportOptions::default(), &expect);
    }
}

/// A table of `samples` rows with the given time stamps, `u = row`, `y = 2 row`.
fn with_stamps(stamps: impl IntoIterator<Item = f64>) -> String {
    let rows = stamps
        .into_iter()
        .enumerate()
        .map(|(row, stamp)| format!("{stamp},{row},{}\n", 2 * row));
    std::iter::once("t [s],u [V],y [um]\n".to_owned()).chain(rows).collect()
}

#[test]
fn val_gaps_split_when_told() {
    let stamps = (0..20)
        .map(f64::from)
        .chain((25..40).map(f64::from))
        .chain((3..10).map(f64::from));
    let text = with_stamps(stamps);
    let split = ImportOptions {
        gaps: Gaps::Split,
        ..ImportOptions::default()
    };
    let found = try_with(text.as_bytes(), &split).unwrap();
    let parts: Vec<_> = found
        .records
        .iter()
        .map(|r| (r.file.as_str(), r.start_s, r.period_s, r.len(), r.voltage_v[0]))
        .collect();
    assert_eq!(
        parts,
        [
            ("run-1.csv", 0.0, 1.0, 20, 0.0),
            ("run-2.csv", 25.0, 1.0, 15, 20.0),
            ("run-3.csv", 3.0, 1.0, 7, 35.0)
        ]
    );
    refuse(
        &text,
        &ImportOptions::default(),
        "run.csv, line 22, column 1 (t [s]): a step of 6.0 s to 25.0 s: some 5 samples of 1.0 s are missing (1 more such \
         places); `--gaps split` makes a record of each part",
    );
    refuse(
        &with_stamps((5..15).chain(0..12).map(f64::from)),
        &ImportOptions::default(),
        "run.csv, line 12, column 1 (t [s]): time goes back from 14.0 s to 0.0 s; `--gaps split` makes a record of each part",
    );
}

#[test]
fn val_jitter_is_measured_and_repaired() {
    // every third stamp late by 5 %, then by 30 % of the period
    let jittering = |size: f64| with_stamps((0..60).map(|row| f64::from(row) + if row % 3 == 1 { size } else { 0.0 }));
    let small = try_with(jittering(0.05).as_bytes(), &ImportOptions::default()).unwrap();
    assert_eq!(small.records[0].len(), 60);
    assert!(
        (small.records[0].period_s - 1.0).abs() < 1e-4,
        "{}",
        small.records[0].period_s
    );
    let notice = &small.preview.notices[0];
    assert!(
        notice.starts_with("time stamps jitter (3.3 % of a sample period at most, 2.4 % rms): put on the clock"),
        "{notice}"
    );

    let large = jittering(0.3);
    let error = try_with(large.as_bytes(), &ImportOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("the time stamps jitter by 20.") && error.contains("`--jitter clock`"),
        "{error}"
    );
    let clock = ImportOptions {
        jitter: Jitter::Clock,
        ..ImportOptions::default()
    };
    let found = try_with(large.as_bytes(), &clock).unwrap();
    assert_eq!(found.records[0].voltage_v, (0..60).map(f64::from).collect::<Vec<_>>());
    let interpolate = ImportOptions {
        jitter: Jitter::Interpolate,
        ..ImportOptions::default()
    };
    let found = try_with(large.as_bytes(), &interpolate).unwrap();
    let record = &found.records[0];
    // u is the row; between a stamp on time and one late by 0.3 it rises by 1 in 1.3 s, so that at the time of the
    // late one it has come to 1 / 1.3 of the step
    assert!(
        (record.voltage_v[4] - (3.0 + 1.0 / 1.3)).abs() < 0.01,
        "{}",
        record.voltage_v[4]
    );
}

#[test]
fn val_repeated_stamps() {
    // 5 kHz printed to a millisecond: the clock is that of all samples over all of the time
    let rows = (0..5001).map(|row| format!("{:.3},{row},{}\n", f64::from(row / 5) * 0.001, 2 * row));
    let text: String = std::iter::once("t [s],u [V],y [um]\n".to_owned()).chain(rows).collect();
    let found = try_with(text.as_bytes(), &ImportOptions::default()).unwrap();
    assert_eq!(found.records[0].period_s, 0.0002);
    assert!(
        found.preview.notices[0].starts_with("4000 of 5001 time stamps repeat the one before"),
        "{:?}",
        found.preview.notices
    );

    // rows written twice here and there
    let text = "t [s],u [V],y [um]\n0,0,0\n1,1,1\n1,1,1\n2,2,2\n3,3,3\n4,4,4\n4,4,4\n4,4,4\n5,5,5\n";
    let found = check(
        text,
        &ImportOptions::default(),
        (0.0, 1.0),
        &[0., 1., 2., 3., 4., 5.],
        &[0., 1., 2., 3., 4., 5.],
    );
    assert_eq!(
        found.preview.notices,
        ["3 rows left out that repeat the row before, stamp and values"]
    );
    // the line of a fault after such rows is that of the file
    let text = "t [s],u [V],y [um]\n0,0,0\n1,1,1\n1,1,1\n2,2,2\n3,3,3\n9,4,4\n10,5,5\n11,6,6\n12,6,6\n13,6,6\n";
    let error = try_with(text.as_bytes(), &ImportOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("run.csv, line 7, column 1 (t [s]): a step of 6.0 s to 9.0 s"),
        "{error}"
    );

    // every row twice, at rest or not: a coarse clock or a double logger, nobody can tell
    refuse(
        "t [s],u [V],y [um]\n0,0,0\n0,0,0\n1,1,1\n1,1,1\n2,2,2\n2,2,2\n",
        &ImportOptions::default(),
        "run.csv, line 3, column 1 (t [s]): time 0.0 s repeats the stamp before it, and so do the values; 3 of 6 stamps \
         do; if the samples were taken uniformly give the rate with `--rate HZ` or say `--jitter clock`; if rows were \
         written twice, delete one of them",
    );
    refuse(
        "t [s],u [V],y [um]\n0,0,0\n1,1,1\n1,2,1\n2,2,2\n3,2,2\n4,2,2\n",
        &ImportOptions::default(),
        "run.csv, line 4, column 1 (t [s]): time 1.0 s repeats the stamp before it; 1 of 6 stamps do; if the samples were \
         taken uniformly give the rate with `--rate HZ` or say `--jitter clock`; if rows were written twice, delete one of \
         them",
    );
}

/// Found by fuzzing: one sample written twice left one row, of which the usual step was taken.
#[test]
fn regress_one_sample_written_twice() {
    let text = "t [s],u [V],y [um]\n1,2,3\n1,2,3\n";
    refuse(
        text,
        &ImportOptions::default(),
        "run.csv: 1 sample(s); a record needs at least 2",
    );
}

const GCS: &str = "# REM E-753\n#\n# VERSION = 1\n# TYPE = 1\n# SEPARATOR = 32 \n# DIM = 2 \n# SAMPLE_TIME = 0.00005\n\
                   # NDATA = 3 \n#\n# NAME0 = Voltage of output chan 1 \n# NAME1 = Actual Position of axis 1\n#\n\
                   # END_HEADER\n1.5 0.25 \n2.5 0.5 \n3.5 0.75\n";

#[test]
fn val_gcs_array() {
    let options = told(&["voltage=:V", "position=:um"]);
    let found = check(GCS, &options, (0.0, 0.00005), &[1.5, 2.5, 3.5], &[0.25, 0.5, 0.75]);
    assert_eq!(
        found.preview.to_string(),
        "run.csv: PI GCS array, samples from line 14\n  \
         voltage     column 1 `Voltage of output chan 1` in V, as told\n  \
         position    column 2 `Actual Position of axis 1` in µm, as told\n  \
         3 samples at 20000.0 Hz, 0.0001 s\n"
    );
    check(
        &GCS.replace("= 32", "= 9").replace("5 0.", "5\t0."),
        &options,
        (0.0, 0.00005),
        &[1.5, 2.5, 3.5],
        &[0.25, 0.5, 0.75],
    );
}

#[test]
fn refuse_gcs_arrays_that_do_not_hold_together() {
    let options = told(&["voltage=:V", "position=:um"]);
    for (from, to, expect) in [
        (
            "VERSION = 1",
            "VERSION = 2",
            "run.csv, line 3: found `# VERSION = 2` in the GCS header; VERSION = 1 is read",
        ),
        (
            "TYPE = 1",
            "TYPE = 2",
            "run.csv, line 4: found `# TYPE = 2` in the GCS header; TYPE = 1 (a table of text) is read",
        ),
        (
            "SEPARATOR = 32",
            "SEPARATOR = 65",
            "run.csv, line 5: found `# SEPARATOR = 65 ` in the GCS header; the separator is 32 (blank), 9 (tab), 44 (`,`) \
             or 59 (`;`)",
        ),
        (
            "DIM = 2",
            "DIM = 99999999999",
            "run.csv, line 6: found `# DIM = 99999999999 ` in the GCS header; DIM is a whole number from 1 to 256",
        ),
        (
            "0.00005",
            "-1",
            "run.csv, line 7: found `# SAMPLE_TIME = -1` in the GCS header; SAMPLE_TIME is a positive number of seconds",
        ),
        (
            "NDATA = 3",
            "NDATA = 4",
            "run.csv: the header says NDATA = 4, the file has 3 rows; the file is cut short or was edited: read it from \
             the controller again, or correct NDATA",
        ),
        (
            "# END_HEADER\n",
            "",
            "run.csv, line 15: the GCS header has no end; it ends in a line `# END_HEADER`",
        ),
        (
            "# DIM = 2 \n",
            "",
            "run.csv, line 12: the GCS header has no DIM; `# DIM = 2` says how many columns there are",
        ),
        (
            "# SAMPLE_TIME = 0.00005\n",
            "",
            "run.csv: no time among the columns 1 `Voltage of output chan 1`, 2 `Actual Position of axis 1`; say \
             which it is, as in `--column time=NAME:s`, or the sample rate with `--rate HZ`",
        ),
    ] {
        refuse(&GCS.replace(from, to), &options, expect);
    }
    refuse(
        GCS,
        &ImportOptions::default(),
        "run.csv: no unit given for voltage (column 1 `Voltage of output chan 1`), no unit given for position (column 2 \
         `Actual Position of axis 1`); the columns are 1 `Voltage of output chan 1`, 2 `Actual Position of axis 1`; say \
         which they are, as in `--column voltage=1:V --column position=2:um`",
    );
}

/// What is imported and written natively reads back the same.
#[test]
fn val_imported_record_round_trips_natively() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("scope.txt");
    let rows: String = (0..3000)
        .map(|i| format!("{:.6};{};{}\n", f64::from(i) / 48e3, i % 7, f64::from(i) * 0.1))
        .collect();
    std::fs::write(&source, format!("Rig 3\nTime (s);Voltage (V);Position (nm)\n{rows}")).unwrap();
    let mut last = (0, 0);
    let found = import(&source, &ImportOptions::default(), &mut |done, total| {
        last = (done, total)
    })
    .unwrap();
    assert!(last.0 > 0 && last.0 <= last.1, "{last:?}");
    let record = &found.records[0];
    assert_eq!((record.file.as_str(), record.period_s), ("scope.csv", 1.0 / 48e3));
    let target = folder.path().join("scope.csv");
    write_record_csv(record, &target, Overwrite::Refuse).unwrap();
    assert_eq!(&read_record(&target).unwrap().0, record);
}

/// The recordings beside the project, where they are, import as they are read.
#[test]
fn val_real_recordings_import_as_they_are_read() {
    let shared = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if !shared.is_dir() {
        println!("skipped: no recordings in ../shared/data");
        return;
    }
    for name in [
        "cubespec-fsm-lowband/u2-100mv-train0.csv",
        "piezo-150v-1hz-step/rest-step-sine-1hz.csv",
        "practice/case-01/step-hold.csv",
        "practice/case-02/sine-500hz.csv",
    ] {
        let path = shared.join(name);
        let found = import(&path, &ImportOptions::default(), &mut |_, _| {}).unwrap();
        assert_eq!(found.records, [read_record(&path).unwrap().0], "{name}");
        assert_eq!(found.preview.notices, [""; 0], "{name}");
    }
}
