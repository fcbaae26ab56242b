//! Memory of reading and importing, against the size of the file. The only test of its process, whose peak it reads.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a helper that fails is a test that fails")]

use std::fs::File;
use std::io::{BufWriter, Write};

use hysteron_data::import::{ImportOptions, import};
use hysteron_data::read_record;

/// The most memory the process had so far, bytes.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap();
    1024 * line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap()
}

/// A record of 400 000 samples, some 25 bytes a line: reading keeps 3 columns of 8 bytes for such a line,
/// importing 3 and the 2 of the record, so that twice and three times the file are bounds with room for buffers. The
/// whole program may take 10 times the file.
#[test]
fn val_memory_is_linear_and_small() {
    const SAMPLES: usize = 400_000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.csv");
    // line by line, so that the peak before reading is that of a program that does nothing
    let mut out = BufWriter::new(File::create(&path).unwrap());
    writeln!(out, "time_s,voltage_v,position_um").unwrap();
    for sample in 0..SAMPLES {
        let voltage_v = 80.0 * (sample as f64 * 1e-3).sin();
        writeln!(out, "{:.5},{voltage_v:.4},{:.5}", sample as f64 * 2e-5, 0.1 * voltage_v).unwrap();
    }
    drop(out);
    let size = std::fs::metadata(&path).unwrap().len();
    let before = peak();
    assert_eq!(read_record(&path).unwrap().0.len(), SAMPLES);
    let reading = peak() - before;
    assert!(reading < 2 * size, "reading {size} bytes took {reading}");
    let found = import(&path, &ImportOptions::default(), &mut |_, _| {}).unwrap();
    assert_eq!(found.records[0].len(), SAMPLES);
    let importing = peak() - before;
    println!(
        "peak / file: read {:.2}, import {:.2}",
        reading as f64 / size as f64,
        importing as f64 / size as f64
    );
    // less than the columns that are held would say that the figure measures nothing
    assert!(
        reading >= 16 * SAMPLES as u64 && importing >= reading,
        "{reading} {importing}"
    );
    assert!(importing < 3 * size, "importing {size} bytes took {importing}");
}
