//! Tables for other programs: what is written is read back to the last bit.

use hysteron_data::export::{Column, TableFormat, Values, write_table};
use hysteron_data::import::{ImportOptions, import};

fn columns() -> Vec<Column> {
    let numbers = |name: &str, value: fn(f64) -> f64| Column {
        name: name.into(),
        values: Values::Numbers((0..300).map(|row| value(f64::from(row))).collect()),
    };
    let words = Column {
        name: "record".into(),
        values: Values::Words {
            list: vec!["up, \"down\".csv".into(), "µ.csv".into()],
            rows: (0..300).map(|row| row / 150).collect(),
        },
    };
    vec![
        words,
        numbers("time_s", |row| row / 12e3),
        numbers("voltage_v", |row| (row * 0.1).sin() * 1e-7),
        numbers("position_um", |row| (row * 0.1).cos() / 3.0),
    ]
}

#[test]
fn val_tables_are_read_back_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let columns = columns();
    for name in ["out.csv", "out.npz", "out.parquet"] {
        let path = folder.path().join(name);
        write_table(&path, TableFormat::of(&path).unwrap(), &columns).unwrap();
        let found = import(&path, &ImportOptions::default(), &mut |_, _| {}).unwrap_or_else(|error| panic!("{error}"));
        let record = &found.records[0];
        assert_eq!(Values::Numbers(record.voltage_v.clone()), columns[2].values, "{name}");
        assert_eq!(Values::Numbers(record.position_um.clone()), columns[3].values, "{name}");
        assert_eq!(record.rate_hz(), 12e3, "{name}");
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(left, 1, "{name} leaves nothing beside it");
    }
}

#[test]
fn refuse_tables_that_cannot_be_written() {
    let error = TableFormat::of(std::path::Path::new("out.xlsx"))
        .unwrap_err()
        .to_string();
    assert_eq!(
        error,
        "out.xlsx: the ending does not say what to write; give it one of .csv, .npz and .parquet"
    );
    let mut columns = columns();
    columns[1].values = Values::Numbers(vec![0.0]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.csv");
    let error = write_table(&path, TableFormat::Csv, &columns).unwrap_err().to_string();
    assert!(
        error.ends_with("out.csv: column time_s has 1 rows, record has 300; all columns of a table have one length"),
        "{error}"
    );
    assert!(!path.exists());
}
