//! Recordings whose channels are in a file each (Tektronix TDS, LeCroy), joined on their clocks.

use std::path::{Path, PathBuf};

use super::columns::{self, Chosen, Offer};
use super::finish::{self, Part};
use super::options::{ImportOptions, Source};
use super::preview::Kind;
use super::table::Table;
use super::{Imported, open, opened, stamps};
use crate::clock::Clock;
use crate::error::DataError;
use crate::place::{Place, brief};
use crate::units::Quantity;

/// The part of a sample by which clocks may be apart and still be one: below the jitter that is taken as harmless when
/// stamps are read.
const SAME: f64 = 1e-3;

/// A file, its channels chosen and read on its clock, in the unit of its own time.
struct Channel {
    file: String,
    table: Table,
    clock_s: Clock,
}

/// Imports files that are channels of one recording; `progress` gets the bytes read so far and in all.
///
/// Columns are numbered through all files, and named after their file where one alone would not say which: `CH1: Volt`.
/// Where the clocks begin apart by whole samples, what all have is kept.
///
/// # Errors
/// As [`import`](super::import()), and for clocks of another rate or apart by parts of a sample.
pub fn import_joined(
    paths: &[PathBuf],
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Imported, DataError> {
    options.validate()?;
    let name = paths
        .first()
        .map_or_else(String::new, |path| path.display().to_string());
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let mut total = 0;
    let mut sources = Vec::with_capacity(paths.len());
    for (path, file) in paths.iter().zip(&files) {
        let source = opened(path, file)?;
        total += source.metadata().map_err(DataError::io(file, "open it"))?.len();
        sources.push(source);
    }
    let mut done = 0;
    let mut open_files = Vec::with_capacity(files.len());
    for (source, file) in sources.into_iter().zip(&files) {
        open_files.push(open::open(Box::new(source), file, options, &mut |_| {})?);
    }
    let offers: Vec<Offer> = open_files.iter().map(|file| file.offer(options)).collect();
    let times: Vec<Option<usize>> = offers
        .iter()
        .map(|offer| time(offer, options))
        .collect::<Result<_, _>>()?;
    let (chosen, mut notices) = choose(&offers, &times, &files, options)?;
    let own: Vec<Vec<Chosen>> = split(&offers, chosen, &times, options)?;
    let kinds: Vec<(String, Kind)> = files
        .iter()
        .cloned()
        .zip(open_files.iter().map(open::Opened::kind))
        .collect();
    let mut channels = Vec::with_capacity(files.len());
    for ((opened, file), chosen) in open_files.into_iter().zip(&files).zip(own) {
        if !chosen.iter().any(|column| column.quantity != Quantity::Time) {
            return Err(DataError::Choice {
                found: format!("no column of {file} is voltage, position or another quantity of a record"),
                allowed: "leave the file out, or say which of its columns is which with `--column`".into(),
            });
        }
        let mut here = 0;
        let parts = opened.read(chosen, options, &mut notices, &mut |bytes| {
            here = bytes;
            progress(done + bytes, total);
        })?;
        done += here;
        channels.push(channel(parts, file, options, &mut notices)?);
    }
    let part = joined(channels, &mut notices)?;
    finish::finish(vec![part], Kind::Joined { files: kinds }, &name, options, notices)
}

/// The file's own column of time.
fn time(offer: &Offer, options: &ImportOptions) -> Result<Option<usize>, DataError> {
    if options.rate_hz.is_some() {
        return Ok(None);
    }
    let (indices, _) = match options.choice(Quantity::Time).map(|choice| &choice.source) {
        Some(Source::Number(number)) => (Some(number - 1).filter(|index| *index < offer.names.len()), ()),
        Some(Source::Name(name)) => (offer.names.iter().position(|here| here.eq_ignore_ascii_case(name)), ()),
        _ => (columns::time(offer), ()),
    };
    match indices {
        None if !offer.has_clock => Err(DataError::MissingColumn {
            at: offer.at.clone(),
            quantity: "time".into(),
            found: format!("the {}s {}", offer.noun, offer.all_listed()),
            allowed: "each file has its own; say which column it is in all of them, as in `--column time=1:s`, or the \
                      sample rate with `--rate HZ`"
                .into(),
        }),
        found => Ok(found),
    }
}

/// Chooses among the columns of all files.
fn choose(
    offers: &[Offer],
    times: &[Option<usize>],
    files: &[String],
    options: &ImportOptions,
) -> Result<(Vec<Chosen>, Vec<String>), DataError> {
    let stem = |file: &String| {
        Path::new(file)
            .file_stem()
            .map_or_else(|| file.clone(), |stem| stem.to_string_lossy().into_owned())
    };
    let (mut names, mut labels, mut units) = (Vec::new(), Vec::new(), Vec::new());
    for ((offer, time), file) in offers.iter().zip(times).zip(files) {
        let useful = |index: &usize| Some(*index) != *time && !offer.names[*index].is_empty();
        let only = (0..offer.names.len()).filter(useful).count() == 1;
        for index in 0..offer.names.len() {
            let name = &offer.names[index];
            let is_channel = useful(&index);
            names.push(match name.as_str() {
                "" => String::new(),
                name => format!("{}: {name}", stem(file)),
            });
            // a time is chosen already, and must not be taken for anything else; the only channel of a file goes by its name
            labels.push(match (is_channel, only) {
                (false, _) => String::new(),
                (true, true) if super::spelling::read(name).quantity.is_none() => stem(file),
                (true, _) => name.clone(),
            });
            units.push(match offer.units.get(index) {
                Some(unit) if !unit.is_empty() => unit.clone(),
                _ => super::spelling::read(name).unit.unwrap_or_default(),
            });
        }
    }
    let offer = Offer {
        noun: "column",
        names: &names,
        labels: &labels,
        units: &units,
        at: Place::file(&files.join(" + ")),
        has_clock: true,
    };
    let mut others = options.clone();
    others.columns.retain(|choice| choice.quantity != Quantity::Time);
    let (chosen, notices) = columns::choose(&offer, &others)?;
    let times = times.iter().flatten().count();
    // the columns of time are used, though not chosen here
    let notices = notices
        .into_iter()
        .filter(|notice| times == 0 || !notice.starts_with("columns ignored"));
    Ok((chosen, notices.collect()))
}

/// The chosen columns of each file, with its time.
fn split(
    offers: &[Offer],
    chosen: Vec<Chosen>,
    times: &[Option<usize>],
    options: &ImportOptions,
) -> Result<Vec<Vec<Chosen>>, DataError> {
    let mut first = 0;
    let mut own = Vec::with_capacity(offers.len());
    for (offer, time) in offers.iter().zip(times) {
        let here = first..first + offer.names.len();
        let mut columns: Vec<Chosen> = Vec::new();
        if let Some(index) = time {
            columns.push(columns::chosen_time(offer, *index, options)?);
        }
        columns.extend(
            chosen
                .iter()
                .filter(|column| here.contains(&column.index))
                .map(|column| Chosen {
                    index: column.index - here.start,
                    name: offer.names[column.index - here.start].clone(),
                    ..column.clone()
                }),
        );
        first = here.end;
        own.push(columns);
    }
    Ok(own)
}

/// A file's channels on its clock.
fn channel(
    parts: Vec<Part>,
    file: &str,
    options: &ImportOptions,
    notices: &mut Vec<String>,
) -> Result<Channel, DataError> {
    let several = |count: usize| DataError::Format {
        file: file.to_owned(),
        found: format!("{count} parts in a file that is to be joined"),
        what_to_do: "files of one run each are joined; cut the files at the gaps first".into(),
    };
    let count = parts.len();
    let mut parts = parts.into_iter();
    let (Some(part), None) = (parts.next(), parts.next()) else {
        return Err(several(count));
    };
    let (table, stretches) = finish::on_clock(part.table, part.clock_s, file, options, notices)?;
    let [stretch] = stretches.as_slice() else {
        return Err(several(stretches.len()));
    };
    let (start, period) = finish::clock_s(&table, stretch);
    let mut table = table;
    if stretch.resample
        && let Some(time) = table.column(Quantity::Time)
    {
        let stamps_here = table.values[time].clone();
        for (index, values) in table.values.iter_mut().enumerate() {
            if index != time {
                *values = stamps::resample(values, &stamps_here, stretch.clock);
            }
        }
    }
    if let Some(time) = table.column(Quantity::Time) {
        table.chosen.remove(time);
        table.values.remove(time);
    }
    Ok(Channel {
        file: file.to_owned(),
        table,
        clock_s: Clock { start, period },
    })
}

/// The channels of all files where all have samples.
fn joined(channels: Vec<Channel>, notices: &mut Vec<String>) -> Result<Part, DataError> {
    let mut channels = channels.into_iter();
    let Some(first) = channels.next() else {
        return Err(DataError::Choice {
            found: "no file to join".into(),
            allowed: "give the files of one recording".into(),
        });
    };
    let rest: Vec<Channel> = channels.collect();
    let Clock { start, period } = first.clock_s;
    let mut from = vec![0i64];
    let mut ends = vec![first.table.rows() as i64];
    for channel in &rest {
        let Clock {
            start: other_start,
            period: other_period,
        } = channel.clock_s;
        let rows = channel.table.rows();
        let late = (other_start - start) / period;
        let drift = (other_period / period - 1.0).abs() * rows as f64;
        let whole = late.round();
        let apart = |found: String, what_to_do: &str| DataError::Clock {
            at: Place::file(&channel.file),
            found,
            what_to_do: what_to_do.to_owned(),
        };
        if drift.is_nan() || drift > SAME.max(1e-7 * rows as f64) {
            return Err(apart(
                format!(
                    "the files are on different clocks: {} every {} s, {} every {} s",
                    first.file,
                    brief(period),
                    channel.file,
                    brief(other_period)
                ),
                "record both channels at one rate; `--rate HZ` says that they are on one clock",
            ));
        }
        if (late - whole).abs() > SAME || whole.abs() > 1e15 {
            return Err(apart(
                format!(
                    "the clocks are apart by {} samples: {} begins at {} s, {} at {} s",
                    brief(late),
                    first.file,
                    brief(start),
                    channel.file,
                    brief(other_start)
                ),
                "channels of one recording are apart by whole samples; `--rate HZ` says that they begin together",
            ));
        }
        from.push(whole as i64);
        ends.push(whole as i64 + rows as i64);
    }
    let begin = from.iter().copied().max().unwrap_or(0);
    let end = ends.iter().copied().min().unwrap_or(0);
    let longest = ends.iter().zip(&from).map(|(end, from)| end - from).max().unwrap_or(0);
    if end - begin < longest {
        notices.push(format!(
            "{} samples that all files have, of {longest} of the longest",
            (end - begin).max(0)
        ));
    }
    let mut table = Table {
        first_line: None,
        ..first.table
    };
    cut(&mut table, begin - from[0], end - begin);
    for (channel, from) in rest.into_iter().zip(&from[1..]) {
        let mut other = channel.table;
        cut(&mut other, begin - from, end - begin);
        table.chosen.extend(other.chosen);
        table.values.extend(other.values);
    }
    Ok(Part {
        table,
        clock_s: Some(Clock {
            start: start + begin as f64 * period,
            period,
        }),
    })
}

/// Keeps some rows.
fn cut(table: &mut Table, first: i64, count: i64) {
    let rows = table.rows();
    let first = usize::try_from(first).unwrap_or(0).min(rows);
    let end = first.saturating_add(usize::try_from(count).unwrap_or(0)).min(rows);
    for values in &mut table.values {
        values.truncate(end);
        values.drain(..first);
    }
}
