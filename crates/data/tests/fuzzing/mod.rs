//! What the fuzzers and the bounded runs of `cargo test` share: valid files to begin with, and what must hold
//! whatever a file holds.
#![expect(clippy::unwrap_used, reason = "what does not hold must end a fuzzer")]

#[path = "mat_writer.rs"]
pub(crate) mod mat_writer;

use hysteron_data::import::{Gaps, ImportOptions, Jitter, Missing, import_from};
use hysteron_data::{DataError, Record, native, read_record_from, write_record_to};

use mat_writer::{array, column, compressed, doubles, int16s, int32s, mat, singles, structure, text};

/// A reader, with valid files for it.
pub(crate) struct Target {
    /// The name of its fuzzer.
    pub(crate) name: &'static str,
    /// Reads a file and checks what must hold.
    pub(crate) run: fn(&[u8]),
    /// Valid files.
    pub(crate) seeds: fn() -> Vec<Vec<u8>>,
    /// Damaged files of each that the bounded run tries: fewer where a library unpacks them.
    #[allow(dead_code, reason = "the fuzzers try without end")]
    pub(crate) cases: usize,
}

/// All readers.
pub(crate) const TARGETS: [Target; 14] = [
    Target {
        name: "native_csv",
        run: native_csv,
        seeds: native_csv_seeds,
        cases: 3000,
    },
    Target {
        name: "dataset_toml",
        run: dataset_toml,
        seeds: dataset_toml_seeds,
        cases: 3000,
    },
    Target {
        name: "import_text",
        run: import_any,
        seeds: import_text_seeds,
        cases: 3000,
    },
    Target {
        name: "gcs",
        run: import_any,
        seeds: gcs_seeds,
        cases: 3000,
    },
    Target {
        name: "mat",
        run: import_any,
        seeds: mat_seeds,
        cases: 3000,
    },
    Target {
        name: "mat4",
        run: import_any,
        seeds: || labs(&[include_bytes!("../fixtures/labs/version4.mat")]),
        cases: 3000,
    },
    Target {
        name: "npy",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/matrix.npy"),
                include_bytes!("../fixtures/labs/record.npy"),
                include_bytes!("../fixtures/labs/packed.npz"),
            ])
        },
        cases: 1500,
    },
    Target {
        name: "tdms",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/waveform.tdms"),
                include_bytes!("../fixtures/labs/scaled.tdms"),
                include_bytes!("../fixtures/labs/interleaved.tdms"),
            ])
        },
        cases: 3000,
    },
    Target {
        name: "lvm",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/one.lvm"),
                include_bytes!("../fixtures/labs/multi.lvm"),
            ])
        },
        cases: 1500,
    },
    Target {
        name: "json",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/columns.json"),
                include_bytes!("../fixtures/labs/pandas-split.json"),
            ])
        },
        cases: 1500,
    },
    Target {
        name: "packed",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/pandas.csv.gz"),
                include_bytes!("../fixtures/labs/one.zip"),
                include_bytes!("../fixtures/labs/openpyxl.xlsx"),
            ])
        },
        cases: 500,
    },
    Target {
        name: "hdf5",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/h5py.h5"),
                include_bytes!("../fixtures/labs/rows.h5"),
                include_bytes!("../fixtures/labs/struct73.mat"),
            ])
        },
        cases: 800,
    },
    Target {
        name: "parquet",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/pandas.parquet"),
                include_bytes!("../fixtures/labs/gaps.parquet"),
            ])
        },
        cases: 800,
    },
    Target {
        name: "feather",
        run: import_any,
        seeds: || {
            labs(&[
                include_bytes!("../fixtures/labs/pandas.feather"),
                include_bytes!("../fixtures/labs/plain.feather"),
            ])
        },
        cases: 1500,
    },
];

/// The most samples a file can hold: a row of text has two numbers and two ends, a packed number of MATLAB a
/// thousandth of a byte (the best ratio of its compression is 1032).
fn most_samples(bytes: &[u8]) -> usize {
    2000 * (bytes.len() + 64)
}

/// What every record must be, whatever it was read from.
fn check_record(record: &Record, bytes: &[u8]) {
    let samples = record.len();
    assert!(
        samples >= 2 && samples <= most_samples(bytes),
        "{samples} samples from {} bytes",
        bytes.len()
    );
    assert!(
        record.period_s > 0.0 && record.period_s.is_finite() && record.start_s.is_finite(),
        "{record:?}"
    );
    let optional = [&record.reference_um, &record.temperature_c, &record.voltage2_v];
    for column in [&record.voltage_v, &record.position_um]
        .into_iter()
        .chain(optional.into_iter().flatten())
    {
        assert_eq!(column.len(), samples);
        assert!(column.iter().all(|value| value.is_finite()));
    }
}

/// Writing then reading changes no bit of the columns.
fn check_round_trip(record: &Record) {
    let mut written = Vec::new();
    match write_record_to(record, &mut written) {
        Ok(()) => {}
        Err(DataError::Unwritable { .. }) => return, // a clock far from 0
        Err(error) => panic!("{error}"),
    }
    let (found, notices) = read_record_from(written.as_slice(), "again.csv").unwrap();
    assert!(notices.is_empty());
    let bits = |column: &[f64]| column.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&found.voltage_v), bits(&record.voltage_v));
    assert_eq!(bits(&found.position_um), bits(&record.position_um));
    assert_eq!(found.start_s.to_bits(), record.start_s.to_bits());
    // half of the rounding of the stamps that is believed, over one step
    assert!(
        (found.period_s / record.period_s - 1.0).abs() < 0.25,
        "{} {}",
        found.period_s,
        record.period_s
    );
}

fn native_csv(bytes: &[u8]) {
    if let Ok((record, _)) = read_record_from(bytes, "fuzz.csv") {
        check_record(&record, bytes);
        check_round_trip(&record);
    }
}

fn dataset_toml(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes)
        && let Ok(manifest) = native::parse_manifest(text, "dataset.toml")
    {
        for entry in &manifest.records {
            assert!(
                !entry.file.contains("..") || !entry.file.split('/').any(|part| part == ".."),
                "{}",
                entry.file
            );
            assert!(!entry.file.starts_with('/'), "{}", entry.file);
        }
    }
}

/// Imports under several options: the last byte says which.
fn import_any(bytes: &[u8]) {
    let which = bytes.last().copied().unwrap_or(0);
    let columns: &[&str] = match which % 3 {
        0 => &[],
        1 => &["voltage=:V", "position=:um"],
        _ => &["time=1:ms", "voltage=2:mV*20", "position=3:nm"],
    };
    let options = ImportOptions {
        columns: columns.iter().map(|column| column.parse().unwrap()).collect(),
        rate_hz: (which % 3 != 2 && which & 4 != 0).then_some(5000.0),
        missing: [
            Missing::Refuse,
            Missing::Trim,
            Missing::Interpolate,
            Missing::Interpolate,
        ][usize::from(which >> 3 & 3)],
        gaps: if which & 32 == 0 { Gaps::Refuse } else { Gaps::Split },
        jitter: [Jitter::Refuse, Jitter::Clock, Jitter::Interpolate, Jitter::Clock][usize::from(which >> 6)],
        ..ImportOptions::default()
    };
    if let Ok(found) = import_from(bytes, "fuzz.bin", &options, &mut |_| {}) {
        assert!(!found.records.is_empty());
        assert!(!found.preview.to_string().is_empty());
        for record in &found.records {
            check_record(record, bytes);
            check_round_trip(record);
        }
    }
}

/// Files of `fixtures/labs`, with a byte behind that chooses the options where the format allows it.
fn labs(files: &[&[u8]]) -> Vec<Vec<u8>> {
    files.iter().map(|file| file.to_vec()).collect()
}

fn texts(texts: &[&str]) -> Vec<Vec<u8>> {
    texts.iter().map(|text| text.as_bytes().to_vec()).collect()
}

fn native_csv_seeds() -> Vec<Vec<u8>> {
    texts(&[
        "time_s,voltage_v,position_um\n0,0,0\n0.1,1,0.3\n0.2,2,0.6\n0.3,3,0.9\n",
        "time_ms,voltage_mv,position_nm,reference_um,temperature_c,voltage2_v,note\n0.000,1e3,-5,1,22.1,0,a\n0.033,2e3,5,2,22.2,1,b\n0.067,3e3,15,3,22.3,2,c\n",
        "\u{feff}position_um,time_us,voltage_kv\r\n-0.25,5,.5\r\n1e-3,25,+1.5\r\n2E3,45,-0\r\n\r\n",
    ])
}

fn dataset_toml_seeds() -> Vec<Vec<u8>> {
    texts(&[
        "format = 1\nname = \"x\"\ndescription = \"\"\"a\nb\"\"\"\n[known]\ndelay_s = 30e-6\nvoltage_min_v = 0\nvoltage_max_v = 1e2\n[[record]]\nfile = \"sub/a.csv\"\nrole = \"identify\"\nexcitation = \"sine\"\n[[record]]\nfile = \"b.csv\"\nrole = \"validate\"\n",
    ])
}

fn import_text_seeds() -> Vec<Vec<u8>> {
    let mut seeds = texts(&[
        "Rig 3\nTime [s];Voltage [V];Position [µm]\n0,0;1,5;0,25\n0,1;2,5;0,5\n0,2;3,5;0,75\n",
        "Time,Voltage,Position,Comment\n(ms),(V),(um),\n\n0,1.5,0.25,x\n100,2.5,0.5,\n200,NaN,0.75,y\n300,2.5,1,\n",
        "# time_s voltage_mv disp_nm\n0 1.5 0.25\n0.1 2.5 0.5\n0.21 3.5 0.75\n0.3 4 1\n\x01",
        "\"t (ms)\"\t\"u (V)\"\t\"y (um)\"\r\n0\t1\t2\r\n1\t2\t3\r\n1\t2\t3\r\n2\t3\t4\r\n9\t4\t5\r\n10\t5\t6\r\n \x28",
        "0,1,2\n1,2,3\n2,3,4\n3,5,6\n\x02",
    ]);
    seeds.push(
        "\u{feff}t [ms];u [V];y [µm]\r\n0;1,5;2\r\n100;2,5;3\r\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect(),
    );
    seeds
}

fn gcs_seeds() -> Vec<Vec<u8>> {
    texts(&[
        "# REM E-753\n# VERSION = 1\n# TYPE = 1\n# SEPARATOR = 32\n# DIM = 2\n# SAMPLE_TIME = 0.00005\n# NDATA = 3\n# NAME0 = Voltage of output chan 1\n# NAME1 = Actual Position of axis 1\n# END_HEADER\n1.5 0.25 \n2.5 0.5 \n3.5 0.75\n\x01",
    ])
}

fn mat_seeds() -> Vec<Vec<u8>> {
    let t = || column("t", &[0.0, 0.1, 0.2]);
    let u = || array(6, &[1, 3], "u", int16s(&[1, 2, 300]));
    let y = || array(7, &[3, 1], "position", singles(&[0.25, 0.5, 0.75]));
    let data = array(6, &[3, 2], "data", doubles(&[1.0, 2.5, 4.0, 0.25, 0.5, 0.75]));
    let log = structure(
        "log",
        &[
            ("time", column("", &[0.0, 0.5])),
            ("voltage", column("", &[1.0, 2.0])),
            ("y", column("", &[3.0, 4.0])),
        ],
    );
    let end = |variables: &[Vec<u8>]| [mat(variables), vec![1]].concat();
    let packed = [t(), u(), y()].map(|variable| compressed(&variable));
    vec![
        end(&[t(), u(), y(), text("remark", "hi")]),
        end(&packed),
        end(&[log]),
        end(&[
            column("Ts", &[0.1]),
            data,
            u(),
            y(),
            array(12, &[1, 1], "n", int32s(&[7])),
        ]),
    ]
}
