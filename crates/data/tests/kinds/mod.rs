//! The kinds of recording, one a row of the table in `docs/recordings.md`.

use std::fmt::Write;

use hysteron_data::Record;

/// A kind of recording.
pub(crate) struct Kind {
    /// As the table says it.
    pub(crate) name: &'static str,
    pub(crate) source: Source,
    /// The options of `hysteron import` that it needs.
    pub(crate) options: &'static str,
    pub(crate) outcome: Outcome,
}

/// Where a recording is from.
pub(crate) enum Source {
    /// Files beside `make.py`.
    Files(&'static [&'static str]),
    /// A file of this name, made of the record.
    Made(&'static str, fn(&Record) -> Vec<u8>),
}

/// What becomes of it.
pub(crate) enum Outcome {
    Read(Reads),
    /// Refused with these words, which convert it.
    Refused(&'static str),
}

/// How it is read.
pub(crate) struct Reads {
    /// The last digit of the file, in volts and micrometres: 0 where the file has all.
    pub(crate) digits: f64,
    pub(crate) rate_hz: f64,
    /// How many records the file gives.
    pub(crate) runs: usize,
    /// The first sample that it has.
    pub(crate) first: usize,
}

const fn exact() -> Outcome {
    to(0.0)
}

/// To a last digit, at 12 kHz.
const fn to(digits: f64) -> Outcome {
    at(digits, 12e3)
}

const fn at(digits: f64, rate_hz: f64) -> Outcome {
    Outcome::Read(Reads {
        digits,
        rate_hz,
        runs: 1,
        first: 0,
    })
}

const fn row(name: &'static str, source: Source, options: &'static str, outcome: Outcome) -> Kind {
    Kind {
        name,
        source,
        options,
        outcome,
    }
}

/// Rows of a text.
fn rows(record: &Record, head: &str, row: impl Fn(f64, f64, f64) -> String) -> Vec<u8> {
    let mut text = String::from(head);
    for sample in 0..record.len() {
        let time = record.start_s + sample as f64 * record.period_s;
        let _ = writeln!(
            text,
            "{}",
            row(time, record.voltage_v[sample], record.position_um[sample])
        );
    }
    text.into_bytes()
}

/// With decimal commas, nine digits behind them.
fn comma(value: f64) -> String {
    format!("{value:.9}").replace('.', ",")
}

fn utf16(record: &Record) -> Vec<u8> {
    let text = rows(record, "\u{feff}t [ms]\tu [V]\ty [µm]\n", |t, u, y| {
        format!("{:.9}\t{u:.9}\t{y:.9}", 1e3 * t)
    });
    String::from_utf8(text)
        .unwrap()
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect()
}

fn latin1(record: &Record) -> Vec<u8> {
    let text = rows(record, "t [ms];u [V];y [µm]\n", |t, u, y| {
        format!("{:.9};{u:.9};{y:.9}", 1e3 * t)
    });
    String::from_utf8(text).unwrap().chars().map(|c| c as u8).collect()
}

/// Volts in thousandths with commas between groups of three digits.
fn thousands(record: &Record) -> Vec<u8> {
    rows(record, "Time [s],Voltage [mV],Position [nm]\n", |t, u, y| {
        let grouped = |value: f64| {
            let text = format!("{value:.6}");
            let (whole, rest) = text.split_at(text.len() - 7);
            match whole.len() {
                0..=3 => format!("{whole}{rest}"),
                length => format!("\"{},{}{rest}\"", &whole[..length - 3], &whole[length - 3..]),
            }
        };
        format!("{t:.9},{},{}", grouped(1e3 * u), grouped(1e3 * y))
    })
}

fn magic(bytes: &'static [u8]) -> Vec<u8> {
    [bytes, &[0; 64]].concat()
}

const NINE: f64 = 1e-9;
const UNITS: &str = "--column voltage=:V --column position=:um";
const SCOPE: &str = "--column voltage=CH1:V --column position=CH2:um";

/// All kinds.
pub(crate) const KINDS: &[Kind] = &[
    row(
        "CSV with units in the names",
        Source::Made("plain.csv", |r| {
            rows(r, "time_s,voltage_v,position_um\n", |t, u, y| {
                format!("{t:?},{u:?},{y:?}")
            })
        }),
        "",
        exact(),
    ),
    row(
        "CSV of a German Excel: `;`, decimal comma, BOM, CRLF",
        Source::Made("excel.csv", |r| {
            rows(r, "\u{feff}Zeit [s];Spannung [V];Weg [µm]\r\n", |t, u, y| {
                format!("{};{};{}\r", comma(t), comma(u), comma(y))
            })
        }),
        "",
        to(NINE),
    ),
    row(
        "CSV in Latin-1, time in ms",
        Source::Made("latin1.csv", latin1),
        "",
        to(NINE),
    ),
    row("Text in UTF-16, tabs", Source::Made("utf16.txt", utf16), "", to(NINE)),
    row(
        "Tabs, a preamble above",
        Source::Made("tabs.txt", |r| {
            rows(
                r,
                "Rig 3\nOperator: me\n\nTime (s)\tVoltage (V)\tPosition (nm)\n",
                |t, u, y| format!("{t:.9}\t{u:.9}\t{:.9}", 1e3 * y),
            )
        }),
        "",
        to(NINE),
    ),
    row(
        "`numpy.savetxt`, `#` before the names",
        Source::Made("savetxt.txt", |r| {
            rows(r, "# time_s voltage_v position_um\n", |t, u, y| {
                format!("{t:.18e} {u:.18e} {y:.18e}")
            })
        }),
        "",
        exact(),
    ),
    row(
        "pandas' `to_csv` with its index",
        Source::Made("pandas.csv", |r| {
            rows(r, ",Time [s],Voltage [V],Position [um]\n", |t, u, y| {
                format!("{},{t:?},{u:?},{y:?}", (t * 12e3).round())
            })
        }),
        "",
        exact(),
    ),
    row(
        "Time in seconds since 1970",
        Source::Made("epoch.csv", |r| {
            rows(r, "time,u [V],y [um]\n", |t, u, y| {
                format!("{:.6},{u:.9},{y:.9}", 1.8e9 + t)
            })
        }),
        "",
        to(NINE),
    ),
    row(
        "Time in single precision",
        Source::Made("float32.csv", |r| {
            rows(r, "time_s,voltage_v,position_um\n", |t, u, y| {
                format!("{},{u:.9},{y:.9}", t as f32)
            })
        }),
        "",
        to(NINE),
    ),
    row(
        "Quoted cells with commas between thousands",
        Source::Made("thousands.csv", thousands),
        "",
        to(NINE),
    ),
    row(
        "Names that say nothing (`x [um]`)",
        Source::Made("names.csv", |r| {
            rows(r, "t [s],drive [V],x [um]\n", |t, u, y| format!("{t:.9},{u:.9},{y:.9}"))
        }),
        "--column position=x:um",
        to(NINE),
    ),
    row(
        "No line of names",
        Source::Made("bare.csv", |r| rows(r, "", |t, u, y| format!("{t:.9},{u:.9},{y:.9}"))),
        "--column time=1:s --column voltage=2:V --column position=3:um",
        to(NINE),
    ),
    row(
        "No units",
        Source::Made("units.csv", |r| {
            rows(r, "t,u,y\n", |t, u, y| format!("{t:.9},{u:.9},{y:.9}"))
        }),
        UNITS,
        to(NINE),
    ),
    row(
        "An amplifier's monitor (1/20) and a sensor's volts (10 um/V, 5 um at 0 V)",
        Source::Made("monitor.csv", |r| {
            rows(r, "t [s],CH1 [V],CH2 [V]\n", |t, u, y| {
                format!("{t:.9},{:.9},{:.9}", u / 20.0, (y - 5.0) / 10.0)
            })
        }),
        "--column voltage=CH1:V*20 --column position=CH2:um*10+5",
        to(1e-7),
    ),
    row(
        "Times of day",
        Source::Made("clock.csv", |r| {
            rows(r, "Time,u [V],y [um]\n", |t, u, y| {
                format!("12:00:{t:09.6},{u:.9},{y:.9}")
            })
        }),
        "--rate 12000",
        to(NINE),
    ),
    row(
        "Tektronix MSO, DPO: a preamble, then `TIME,CH1,CH2`",
        Source::Made("mso.csv", |r| {
            rows(
                r,
                "Model,MSO24\nFirmware Version,1.28\n\nWaveform Type,ANALOG,,\nSample Interval,8.33e-05,,\nVertical Units,V,,\n\nTIME,CH1,CH2\n",
                |t, u, y| format!("{t:.9},{u:.9},{y:.9}"),
            )
        }),
        SCOPE,
        to(NINE),
    ),
    row(
        "Keysight: units in the second line",
        Source::Made("keysight.csv", |r| {
            rows(r, "x-axis,1,2\nsecond,Volt,Volt\n", |t, u, y| {
                format!("{t:.9E},{u:.9E},{y:.9E}")
            })
        }),
        "--column voltage=2:V --column position=3:um",
        to(1e-8),
    ),
    row(
        "LeCroy, all channels in a file",
        Source::Made("lecroy.csv", |r| {
            rows(
                r,
                "LECROYWS3024,40029,Waveform\nSegments,1,SegmentSize,40\nSegment,TrigTime,TimeSinceSegment1\n#1,24-Nov-2026 12:00:00,0\nTime,Ampl,Ampl\n",
                |t, u, y| format!("{t:.9},{u:.9},{y:.9}"),
            )
        }),
        "--column voltage=2:V --column position=3:um",
        to(NINE),
    ),
    row(
        "PicoScope: units in brackets, an empty line",
        Source::Made("pico.csv", |r| {
            rows(r, "Time,Channel A,Channel B\n(ms),(V),(V)\n\n", |t, u, y| {
                format!("{:.9},{u:.9},{y:.9}", 1e3 * t)
            })
        }),
        "--column voltage=2:V --column position=3:um",
        to(NINE),
    ),
    row(
        "Tektronix TDS, a file a channel",
        Source::Files(&["F0001CH1.CSV", "F0001CH2.CSV"]),
        "--join --column voltage=F0001CH1:V*10 --column position=F0001CH2:um*2",
        at(1e-4, 1e4),
    ),
    row(
        "LeCroy, a file a channel",
        Source::Files(&["C1--trace--00000.csv", "C2--trace--00000.csv"]),
        "--join --column voltage=C1--trace--00000:V --column position=C2--trace--00000:um",
        Outcome::Read(Reads {
            digits: 1e-8,
            rate_hz: 1e4,
            runs: 1,
            first: 2,
        }),
    ),
    row(
        "Rigol DS: the clock in the second line",
        Source::Files(&["rigol-ds.csv"]),
        SCOPE,
        at(1e-5, 1e4),
    ),
    row(
        "Rigol DHO, MSO: the clock behind the names",
        Source::Files(&["rigol-dho.csv"]),
        SCOPE,
        at(1e-5, 1e4),
    ),
    row(
        "A GCS array of a PI controller",
        Source::Made("gcs.dat", |r| {
            rows(
                r,
                "# VERSION = 1\n# TYPE = 1\n# SEPARATOR = 32\n# DIM = 2\n# SAMPLE_TIME = 0.0000833333333333333\n# NDATA = 40\n# NAME0 = Voltage of output chan 1\n# NAME1 = Actual Position of axis 1\n# END_HEADER\n",
                |_, u, y| format!("{u:.9} {y:.9}"),
            )
        }),
        UNITS,
        to(NINE),
    ),
    row("`.csv.gz`", Source::Files(&["pandas.csv.gz"]), "", exact()),
    row("A zip of one recording", Source::Files(&["one.zip"]), "", exact()),
    row(
        "JSON: columns with their units",
        Source::Files(&["columns.json"]),
        "",
        exact(),
    ),
    row(
        "JSON of pandas, columns",
        Source::Files(&["pandas-columns.json"]),
        "",
        to(1e-14),
    ),
    row(
        "JSON of pandas, records",
        Source::Files(&["pandas-records.json"]),
        "",
        to(1e-14),
    ),
    row(
        "JSON of pandas, split",
        Source::Files(&["pandas-split.json"]),
        "",
        to(1e-14),
    ),
    row(
        "JSON of pandas, table",
        Source::Files(&["pandas-table.json"]),
        "",
        to(1e-14),
    ),
    row("JSON, a row a line", Source::Files(&["lines.json"]), "", to(1e-14)),
    row("Excel, `.xlsx`", Source::Files(&["openpyxl.xlsx"]), "", to(1e-14)),
    row(
        "LabVIEW TDMS: waveforms, streamed",
        Source::Files(&["waveform.tdms"]),
        "",
        exact(),
    ),
    row(
        "TDMS: raw numbers with linear and polynomial scales",
        Source::Files(&["scaled.tdms"]),
        "",
        to(2e-4),
    ),
    row(
        "TDMS: interleaved, big end first",
        Source::Files(&["interleaved.tdms"]),
        "",
        exact(),
    ),
    row(
        "TDMS: raw numbers of a DAQmx task",
        Source::Files(&["daqmx.tdms"]),
        "",
        Outcome::Refused(
            "python -c \"import nptdms; nptdms.TdmsFile.read('F.tdms').as_dataframe(time_index=True).to_csv('F.csv')\"",
        ),
    ),
    row(
        "LabVIEW LVM: one time, decimal comma, two sections",
        Source::Files(&["one.lvm"]),
        "",
        Outcome::Read(Reads {
            digits: 1e-6,
            rate_hz: 12e3,
            runs: 2,
            first: 0,
        }),
    ),
    row("LVM without time", Source::Files(&["no-x.lvm"]), "", to(1e-6)),
    row(
        "LVM with a time before each channel",
        Source::Files(&["multi.lvm"]),
        "",
        to(1e-6),
    ),
    row(
        "MATLAB 4 (`save -v4`)",
        Source::Files(&["version4.mat"]),
        UNITS,
        exact(),
    ),
    row(
        "MATLAB 5 to 7, units in the names",
        Source::Files(&["version5-units.mat"]),
        "",
        to(1e-15),
    ),
    row(
        "MATLAB 5 to 7, a structure",
        Source::Files(&["version5-struct.mat"]),
        "",
        exact(),
    ),
    row(
        "MATLAB 5 to 7, compressed, `u`, `y` and `Ts`",
        Source::Files(&["version5.mat"]),
        UNITS,
        exact(),
    ),
    row("MATLAB 7.3", Source::Files(&["version73.mat"]), UNITS, exact()),
    row(
        "MATLAB 7.3, a structure",
        Source::Files(&["struct73.mat"]),
        UNITS,
        exact(),
    ),
    row(
        "HDF5 of h5py: groups, compressed, `fs` and `units` as attributes",
        Source::Files(&["h5py.h5"]),
        "",
        exact(),
    ),
    row(
        "HDF5 of rows with named fields",
        Source::Files(&["rows.h5"]),
        "",
        to(1e-6),
    ),
    row(
        "NeXus: NXdata with its axis",
        Source::Files(&["nexus.nxs"]),
        "",
        to(1e-14),
    ),
    row("NumPy `.npz`", Source::Files(&["arrays.npz"]), UNITS, exact()),
    row(
        "NumPy `.npz`, compressed, with `fs`",
        Source::Files(&["packed.npz"]),
        UNITS,
        exact(),
    ),
    row(
        "NumPy `.npy`: a matrix of columns",
        Source::Files(&["matrix.npy"]),
        "--column time=1:s --column voltage=2:V --column position=3:um",
        exact(),
    ),
    row(
        "NumPy `.npy`: a matrix of rows",
        Source::Files(&["rows.npy"]),
        "--column time=1:s --column voltage=2:V --column position=3:um",
        exact(),
    ),
    row(
        "NumPy `.npy`: a structured array",
        Source::Files(&["record.npy"]),
        UNITS,
        exact(),
    ),
    row(
        "Parquet of pandas, with times of day",
        Source::Files(&["pandas.parquet"]),
        "",
        at(0.0, 1e5),
    ),
    row(
        "Parquet packed by zstd",
        Source::Files(&["zstd.parquet"]),
        "",
        Outcome::Refused("python -c \"import pandas; pandas.read_parquet('F').to_parquet('G', compression='snappy')\""),
    ),
    row(
        "Feather of pandas, with times of day",
        Source::Files(&["pandas.feather"]),
        "",
        at(0.0, 1e5),
    ),
    row(
        "Feather, not packed, several batches",
        Source::Files(&["plain.feather"]),
        "",
        exact(),
    ),
    row(
        "Excel, `.xls`",
        Source::Made("old.xls", |_| magic(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")),
        "",
        Outcome::Refused("soffice --headless --convert-to csv F.xls"),
    ),
    row(
        "ASAM MDF (`.mf4`)",
        Source::Made("a.mf4", |_| magic(b"MDF     4.10    ")),
        "",
        Outcome::Refused("python -c \"import asammdf; asammdf.MDF('F').export('csv', 'F.csv')\""),
    ),
    row(
        "NetCDF 3",
        Source::Made("a.nc", |_| magic(b"CDF\x01")),
        "",
        Outcome::Refused("python -c \"import xarray; xarray.open_dataset('F.nc').to_dataframe().to_csv('F.csv')\""),
    ),
    row(
        "SQLite",
        Source::Made("a.db", |_| magic(b"SQLite format 3\0")),
        "",
        Outcome::Refused("sqlite3 -header -csv F 'select * from TABLE' > F.csv"),
    ),
    row(
        "A Python pickle",
        Source::Made("a.pkl", |_| magic(b"\x80\x05\x95")),
        "",
        Outcome::Refused("python -c \"import pandas; pandas.read_pickle('F').to_csv('F.csv')\""),
    ),
    row(
        "Packed by zstd, xz, bzip2 or 7z",
        Source::Made("a.csv.zst", |_| magic(b"\x28\xb5\x2f\xfd")),
        "",
        Outcome::Refused("unzstd F"),
    ),
    row(
        "A WAV file",
        Source::Made("a.wav", |_| magic(b"RIFF\x24\0\0\0WAVEfmt ")),
        "",
        Outcome::Refused(
            "python -c \"import scipy.io.wavfile as w, numpy; r, d = w.read('F.wav'); print(r, 'Hz'); numpy.savetxt('F.csv', d, delimiter=',')\"",
        ),
    ),
    row(
        "Keysight `.bin`",
        Source::Made("a.bin", |_| magic(b"AG10")),
        "",
        Outcome::Refused("save it as CSV on the oscilloscope (Save, Format: CSV)"),
    ),
    row(
        "Tektronix `.isf`",
        Source::Made("a.isf", |_| magic(b":WFMPRE:")),
        "",
        Outcome::Refused("save it as CSV on the oscilloscope (Save, Spreadsheet)"),
    ),
];
