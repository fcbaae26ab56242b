//! Records from files of named arrays: MATLAB, LabVIEW, NumPy and their like. Which array is which quantity is found by
//! name, or told; the clock comes from a column of time, from a number whose name says so, or from the channels' own.

use std::io::{self, Read};

use super::columns::{Chosen, Offer};
use super::finish::Part;
use super::options::ImportOptions;
use super::preview::Kind;
use super::table::Table;
use crate::clock::{Clock, Printed};
use crate::error::DataError;
use crate::place::{Place, brief};
use crate::units::Quantity;

/// The most numbers that are read from a file: half a gigabyte as f64.
pub(crate) const MOST_NUMBERS: u64 = 1 << 26;

/// The most arrays that are read.
pub(crate) const MOST_ARRAYS: usize = 4096;

/// The most bytes of a binary file: four bytes a number, twice.
pub(crate) const MOST_BYTES: u64 = 8 * MOST_NUMBERS;

/// The most channels that a matrix is taken for.
const MOST_CHANNELS: usize = 64;

/// Names of numbers that are the sample period in seconds, in lower case.
const PERIODS: &[&str] = &[
    "ts",
    "dt",
    "t_s",
    "tsample",
    "sample_time",
    "sampletime",
    "sampling_time",
    "samplingtime",
];

/// Names of numbers that are the sample rate in hertz, in lower case.
const RATES: &[&str] = &[
    "fs",
    "f_s",
    "rate",
    "sample_rate",
    "samplerate",
    "sampling_rate",
    "samplingrate",
    "fsample",
];

/// Whether a name says a sample period or rate.
pub(crate) fn is_clock_name(name: &str) -> bool {
    let name = name.to_lowercase();
    PERIODS.contains(&name.as_str()) || RATES.contains(&name.as_str())
}

/// Reads a file, and tells the bytes read so far.
pub(crate) type Reads = fn(&mut dyn Read, &mut dyn FnMut(u64)) -> Result<Contents, Fault>;

/// How files of a kind are read, and what is said of them.
pub(crate) struct Format {
    /// What a file is called: `MATLAB file`.
    pub(crate) what: &'static str,
    /// What its arrays are called: `variable`.
    pub(crate) noun: &'static str,
    /// What to do with one that is broken.
    pub(crate) again: &'static str,
    pub(crate) read: Reads,
}

/// A numeric array.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array {
    /// Its name; `s.field` in a structure, a path in HDF5.
    pub(crate) name: String,
    /// What it is recognised by: its name, or the last piece of its path.
    pub(crate) label: String,
    /// Its unit as the file spells it; empty where there is none.
    pub(crate) unit: String,
    /// Its size; empty for a single number.
    pub(crate) size: Vec<usize>,
    /// Its numbers.
    pub(crate) values: Vec<f64>,
    /// Whether the last dimension runs fastest, as in C; else the first.
    pub(crate) last_fastest: bool,
    /// Whether they are of single precision.
    pub(crate) single: bool,
    /// Its own clock in seconds, where the file gives one.
    pub(crate) clock_s: Option<Clock>,
}

impl Array {
    /// An array of one dimension.
    pub(crate) fn vector(name: impl Into<String>, values: Vec<f64>) -> Array {
        let name = name.into();
        Array {
            label: name.clone(),
            name,
            unit: String::new(),
            size: vec![values.len()],
            values,
            last_fastest: false,
            single: false,
            clock_s: None,
        }
    }
}

/// What is in a file.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Contents {
    /// The numeric arrays (of the first run).
    pub(crate) arrays: Vec<Array>,
    /// Those of further runs of the same names, where the file has several.
    pub(crate) later: Vec<Vec<Array>>,
    /// Variables that are no real numeric arrays, and what they are.
    pub(crate) skipped: Vec<String>,
}

/// Why a file cannot be read.
#[derive(Debug)]
pub(crate) enum Fault {
    Io(io::Error),
    /// What is wrong.
    Broken(String),
    /// What it has that is not read, and what to do.
    Foreign(String, String),
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Fault {
        match error.kind() {
            io::ErrorKind::UnexpectedEof => Fault::Broken("the file ends in the middle of a variable".into()),
            io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
                Fault::Broken("a compressed variable cannot be unpacked".into())
            }
            _ => Fault::Io(error),
        }
    }
}

impl Fault {
    fn error(self, format: &Format, file: &str) -> DataError {
        let file = file.to_owned();
        match self {
            Fault::Io(source) => DataError::Io {
                file,
                action: "read it",
                source,
            },
            Fault::Broken(found) => DataError::Format {
                file,
                found,
                what_to_do: format!("the file is damaged or no {}; {}", format.what, format.again),
            },
            Fault::Foreign(found, what_to_do) => DataError::Format {
                file,
                found,
                what_to_do,
            },
        }
    }
}

/// A fault of the file.
pub(crate) fn broken<T>(what: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Broken(what.into()))
}

/// Numbers that may still be read.
pub(crate) struct Budget(u64);

impl Budget {
    /// For a source of unknown length.
    pub(crate) fn new() -> Budget {
        Budget(MOST_NUMBERS)
    }

    /// For a file of so many bytes: no packing that is read makes more than some 1032 bytes of one, so that a few bytes
    /// cannot claim the memory of a large file.
    pub(crate) fn of(bytes: usize) -> Budget {
        Budget(MOST_NUMBERS.min(1100 * bytes as u64))
    }

    /// Takes what an array claims, before memory is laid out for it.
    pub(crate) fn take(&mut self, count: u64, name: &str) -> Result<(), Fault> {
        match self.0.checked_sub(count) {
            Some(left) => self.0 = left,
            None => {
                return broken(format!(
                    "{name} claims {count} numbers; at most {MOST_NUMBERS} are read from a file, and of a short one as many \
                     as it can hold"
                ));
            }
        }
        Ok(())
    }
}

/// All bytes of a source.
pub(crate) fn bytes(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    source.take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    progress(bytes.len() as u64);
    if bytes.len() as u64 > MOST_BYTES {
        return Err(Fault::Foreign(
            format!("the file is longer than {} MB", MOST_BYTES >> 20),
            "cut it into several, or save the channels of one record alone".into(),
        ));
    }
    Ok(bytes)
}

/// One series of numbers.
struct Vector {
    name: String,
    label: String,
    unit: String,
    values: Vec<f64>,
    single: bool,
    clock_s: Option<Clock>,
}

/// The series of a file.
pub(crate) struct Channels {
    format: &'static Format,
    sizes: Vec<(String, Vec<usize>)>,
    names: Vec<String>,
    labels: Vec<String>,
    units: Vec<String>,
    runs: Vec<Vec<Vector>>,
    /// The sample period in seconds and the name of the number that says it.
    period_s: Option<(String, f64)>,
    skipped: Vec<String>,
}

/// Reads a file of arrays.
pub(crate) fn read(
    format: &'static Format,
    mut source: Box<dyn Read + '_>,
    file: &str,
    progress: &mut dyn FnMut(u64),
) -> Result<Channels, DataError> {
    let contents = (format.read)(&mut source, progress).map_err(|fault| fault.error(format, file))?;
    channels(format, contents, file)
}

/// The series among the arrays.
pub(crate) fn channels(format: &'static Format, contents: Contents, file: &str) -> Result<Channels, DataError> {
    let Contents { arrays, later, skipped } = contents;
    let sizes = arrays
        .iter()
        .map(|array| (array.name.clone(), array.size.clone()))
        .collect();
    let period_s = period(&arrays, file)?;
    let runs: Vec<Vec<Vector>> = std::iter::once(arrays).chain(later).map(vectors).collect();
    let first = runs.first().map_or(&[][..], Vec::as_slice);
    if first.is_empty() {
        let left_out = match skipped.len() {
            0 => String::new(),
            _ => format!(" (left out: {})", skipped.join("; ")),
        };
        return Err(DataError::Format {
            file: file.to_owned(),
            found: format!("no vectors of numbers in the file{left_out}"),
            what_to_do: "save time, voltage and position as vectors; of a timeseries save its Time and Data".into(),
        });
    }
    let all = |piece: fn(&Vector) -> &String| first.iter().map(|vector| piece(vector).clone()).collect();
    Ok(Channels {
        format,
        sizes,
        names: all(|vector| &vector.name),
        labels: all(|vector| &vector.label),
        units: all(|vector| &vector.unit),
        runs,
        period_s,
        skipped,
    })
}

impl Channels {
    /// What there is to choose from.
    pub(crate) fn offer(&self, file: &str, options: &ImportOptions) -> Offer<'_> {
        let own_clock = || self.runs[0].iter().any(|vector| vector.clock_s.is_some());
        Offer {
            noun: self.format.noun,
            names: &self.names,
            labels: &self.labels,
            units: &self.units,
            at: Place::file(file),
            has_clock: options.rate_hz.is_some() || self.period_s.is_some() || own_clock(),
        }
    }

    /// What the file is.
    pub(crate) fn kind(&self) -> Kind {
        Kind::Arrays {
            what: self.format.what,
            noun: self.format.noun,
            arrays: self.sizes.clone(),
        }
    }

    /// What was left out.
    pub(crate) fn notices(&self) -> Vec<String> {
        self.skipped.iter().map(|what| format!("left out: {what}")).collect()
    }

    /// The chosen series, of each run.
    pub(crate) fn parts(
        self,
        chosen: Vec<Chosen>,
        file: &str,
        options: &ImportOptions,
        notices: &mut Vec<String>,
    ) -> Result<Vec<Part>, DataError> {
        let has_time = chosen.iter().any(|column| column.quantity == Quantity::Time);
        let count = self.runs.len();
        let mut parts = Vec::with_capacity(count);
        for (run, mut vectors) in self.runs.into_iter().enumerate() {
            let at = if count == 1 {
                file.to_owned()
            } else {
                format!("{file}, part {}", run + 1)
            };
            let same = |column: &Chosen| {
                vectors
                    .get(column.index)
                    .is_some_and(|vector| vector.name == column.name)
            };
            if let Some(other) = chosen.iter().find(|column| !same(column)) {
                return Err(DataError::Format {
                    file: at,
                    found: format!(
                        "no {} {} `{}` as in the first part",
                        self.format.noun,
                        other.index + 1,
                        other.name
                    ),
                    what_to_do: "the parts of a file have the same columns; cut it into files of one kind".into(),
                });
            }
            let clock_s = match (has_time || options.rate_hz.is_some(), &self.period_s) {
                (true, _) => None,
                (false, Some((name, period))) => {
                    notices.push(format!("{name}: taken as a sample period of {period} s"));
                    Some(Clock {
                        start: 0.0,
                        period: *period,
                    })
                }
                (false, None) => Some(common_clock(&chosen, &vectors, &at)?),
            };
            let table = table(chosen.clone(), &mut vectors, &at)?;
            parts.push(Part { table, clock_s });
        }
        Ok(parts)
    }
}

/// The clock that the chosen series share.
fn common_clock(chosen: &[Chosen], vectors: &[Vector], file: &str) -> Result<Clock, DataError> {
    let mut found: Option<(&str, Clock)> = None;
    for column in chosen {
        let Some(clock) = vectors[column.index].clock_s else {
            continue;
        };
        let Some((other, first)) = found else {
            found = Some((&column.name, clock));
            continue;
        };
        // a hundredth of a sample over the whole record is below what a recorder's own clock is good for
        let samples = vectors[column.index].values.len() as f64;
        let apart = (clock.period - first.period).abs() * samples + (clock.start - first.start).abs();
        if apart > 0.01 * first.period {
            return Err(DataError::Clock {
                at: Place::file(file),
                found: format!(
                    "the channels are on different clocks: {other} every {} s from {} s, {} every {} s from {} s",
                    brief(first.period),
                    brief(first.start),
                    column.name,
                    brief(clock.period),
                    brief(clock.start)
                ),
                what_to_do: "save them on one clock; `--rate HZ` says that they are on one".into(),
            });
        }
    }
    match found {
        Some((_, clock)) => Ok(clock),
        None => Err(DataError::Clock {
            at: Place::file(file),
            found: "the chosen channels have no clock".into(),
            what_to_do: "say which channel is time, as in `--column time=1:s`, or the sample rate with `--rate HZ`"
                .into(),
        }),
    }
}

/// The chosen series as a table.
fn table(chosen: Vec<Chosen>, vectors: &mut [Vector], file: &str) -> Result<Table, DataError> {
    let time = chosen.iter().find(|column| column.quantity == Quantity::Time);
    // decimal digits that single and double precision have
    let digits = if time.is_some_and(|column| vectors[column.index].single) {
        7
    } else {
        17
    };
    let values: Vec<Vec<f64>> = chosen
        .iter()
        .map(|column| std::mem::take(&mut vectors[column.index].values))
        .collect();
    if let Some(other) = values.iter().position(|column| column.len() != values[0].len()) {
        let (first, other) = (
            (&chosen[0].name, values[0].len()),
            (&chosen[other].name, values[other].len()),
        );
        return Err(DataError::Format {
            file: file.to_owned(),
            found: format!("{} has {} numbers, {} has {}", first.0, first.1, other.0, other.1),
            what_to_do: "the columns of a record have one length; choose them with `--column QUANTITY=NAME:UNIT`"
                .into(),
        });
    }
    Ok(Table {
        chosen,
        values,
        printed: Printed::significant(digits),
        first_line: None,
        dropped: Vec::new(),
    })
}

/// The sample period, seconds, where a number has a name that says so.
fn period(arrays: &[Array], file: &str) -> Result<Option<(String, f64)>, DataError> {
    let mut found: Option<(&str, f64)> = None;
    for array in arrays.iter().filter(|array| array.values.len() == 1) {
        let name = array.label.rsplit('.').next().unwrap_or_default().to_lowercase();
        let period = match array.values[0] {
            value if PERIODS.contains(&name.as_str()) => value,
            value if RATES.contains(&name.as_str()) => 1.0 / value,
            _ => continue,
        };
        // a period and its own rate differ by rounding only
        if let Some((other, before)) = found
            && (before - period).abs() > 1e-9 * before.abs()
        {
            return Err(DataError::Ambiguous {
                at: Place::file(file),
                found: format!(
                    "{other} says a sample period of {before} s, {} says {period} s",
                    array.name
                ),
                what_to_do: "give the rate with `--rate HZ`".into(),
            });
        }
        if period > 0.0 && period.is_finite() && found.is_none() {
            found = Some((&array.name, period));
        }
    }
    Ok(found.map(|(name, period)| (name.to_owned(), period)))
}

/// The vectors among the arrays, and the channels of the matrices: the longer side is time.
fn vectors(arrays: Vec<Array>) -> Vec<Vector> {
    let mut vectors = Vec::new();
    for array in arrays {
        let sides: Vec<usize> = array.size.iter().copied().filter(|&side| side != 1).collect();
        let [first, second] = match sides.as_slice() {
            [samples] => [*samples, 1],
            [first, second] => [*first, *second],
            _ => continue,
        };
        // numbers of one channel lie side by side where its own dimension runs fastest
        let (fast, slow) = if array.last_fastest {
            (second, first)
        } else {
            (first, second)
        };
        let (fast, slow) = if sides.len() == 1 { (first, 1) } else { (fast, slow) };
        let (samples, channels) = (fast.max(slow), fast.min(slow));
        if samples == channels || channels == 0 || channels > MOST_CHANNELS || array.values.len() != samples * channels
        {
            continue;
        }
        let Array {
            name,
            label,
            unit,
            values,
            single,
            clock_s,
            ..
        } = array;
        if channels == 1 {
            vectors.push(Vector {
                name,
                label,
                unit,
                values,
                single,
                clock_s,
            });
            continue;
        }
        for channel in 0..channels {
            let values = if fast == samples {
                values[channel * samples..(channel + 1) * samples].to_vec()
            } else {
                values.iter().skip(channel).step_by(channels).copied().collect()
            };
            vectors.push(Vector {
                name: format!("{name}[{}]", channel + 1),
                label: format!("{label}[{}]", channel + 1),
                unit: unit.clone(),
                values,
                single,
                clock_s,
            });
        }
    }
    vectors
}
