//! LabVIEW's TDMS: segments of metadata and samples, whatever order they were streamed in.
//!
//! Own code because the library for this format (tdms 0.3) reads no interleaved samples, no scales and trusts the sizes
//! in the file. A file is a chain of segments; what a segment does not say of its channels holds on from the one before.
//! [`segments`] finds where each channel's numbers lie, [`scale`] makes values of them.
//!
//! # Reference
//! National Instruments, "TDMS File Format Internal Structure".

mod properties;
mod scale;
mod segments;

use std::collections::HashMap;
use std::io::Read;

use super::arrays::{self, Array, Budget, Contents, Fault, Format};
use super::numbers::Bytes;
use crate::clock::Clock;
use properties::Properties;
use scale::Scales;
use segments::{Kind, Object};

/// LabVIEW's TDMS.
pub(crate) const FORMAT: Format = Format {
    what: "TDMS file",
    noun: "channel",
    again: "save it again with LabVIEW's Write Measurement File",
    read,
};

/// What every segment begins with.
pub(crate) const MAGIC: &[u8] = b"TDSm";

/// What makes a table of text of the file.
const CONVERT: &str = "python -c \"import nptdms; \
    nptdms.TdmsFile.read('F.tdms').as_dataframe(time_index=True).to_csv('F.csv')\" makes a CSV of it (pip install npTDMS \
    pandas)";

fn foreign(found: impl Into<String>) -> Fault {
    Fault::Foreign(found.into(), CONVERT.into())
}

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let bytes = arrays::bytes(source, progress)?;
    let objects = segments::read(Bytes::new(&bytes, false))?;
    let by_path: HashMap<&str, &Properties> = objects
        .iter()
        .map(|object| (object.path.as_str(), &object.properties))
        .collect();
    let mut contents = Contents::default();
    let mut budget = Budget::of(bytes.len());
    let mut groups: Vec<(String, Vec<Array>)> = Vec::new();
    let none = Properties::default();
    for object in objects.iter().filter(|object| object.samples() > 0) {
        let (group, channel) = names(&object.path);
        let shown = format!("{group}/{channel}");
        let above = [
            &object.properties,
            by_path.get(group_path(&object.path)).copied().unwrap_or(&none),
            by_path.get("/").copied().unwrap_or(&none),
        ];
        match array(object, above, &channel, &shown, &mut budget)? {
            Ok(array) => match groups.iter_mut().find(|(name, _)| *name == group) {
                Some((_, arrays)) => arrays.push(array),
                None => groups.push((group, vec![array])),
            },
            Err(what) => contents.skipped.push(format!("{shown}: {what}")),
        }
    }
    arrange(groups, &mut contents);
    Ok(contents)
}

/// A channel's values; or what it is, if that is not read.
fn array(
    object: &Object,
    above: [&Properties; 3],
    channel: &str,
    shown: &str,
    budget: &mut Budget,
) -> Result<Result<Array, String>, Fault> {
    let scales = match Scales::of(above) {
        Ok(scales) => scales,
        Err(what) => return Ok(Err(what)),
    };
    let (stored, time) = match object.kind {
        Some(Kind::Number(stored)) => (Some(stored), false),
        Some(Kind::Time) => (None, true),
        Some(kind) => return Ok(Err(kind.to_string())),
        None => return Ok(Err("no type".into())),
    };
    budget.take(object.samples(), &format!("channel {shown}"))?;
    let mut values: Vec<f64> = Vec::new();
    match stored {
        Some(stored) => values.extend(object.pieces().map(|(bytes, big)| stored.number(bytes, big))),
        None => values.extend(segments::since_first(object.pieces())),
    }
    values.iter_mut().for_each(|value| *value = scales.apply(*value));
    let properties = &object.properties;
    let text = |names: [&str; 3]| names.into_iter().find_map(|name| properties.text(name));
    let unit = text(["unit_string", "NI_UnitDescription", "unit"]).unwrap_or_default();
    Ok(Ok(Array {
        label: channel.to_owned(),
        unit: if time { "s".into() } else { unit.to_owned() },
        single: stored == Some(super::numbers::Stored::Single),
        clock_s: clock_s(properties),
        ..Array::vector(shown, values)
    }))
}

/// The clock of a waveform.
fn clock_s(properties: &Properties) -> Option<Clock> {
    let period = properties
        .number("wf_increment")
        .filter(|period| *period > 0.0 && period.is_finite())?;
    // a column over something else than time has another name for its axis
    if properties
        .text("wf_xname")
        .is_some_and(|name| !name.is_empty() && !name.eq_ignore_ascii_case("time"))
    {
        return None;
    }
    let start = properties.number("wf_start_offset").filter(|start| start.is_finite());
    Some(Clock {
        start: start.unwrap_or(0.0),
        period,
    })
}

/// Groups of the same channels are runs; else all channels are of one.
fn arrange(groups: Vec<(String, Vec<Array>)>, contents: &mut Contents) {
    let labels = |arrays: &[Array]| arrays.iter().map(|array| array.label.clone()).collect::<Vec<_>>();
    let alike = groups.windows(2).all(|pair| labels(&pair[0].1) == labels(&pair[1].1));
    if !(alike && groups.len() > 1) {
        contents.arrays = groups.into_iter().flat_map(|(_, arrays)| arrays).collect();
        return;
    }
    let mut runs = groups.into_iter().map(|(_, mut arrays)| {
        arrays.iter_mut().for_each(|array| array.name.clone_from(&array.label));
        arrays
    });
    contents.arrays = runs.next().unwrap_or_default();
    contents.later = runs.collect();
}

/// Group and channel of a path, `/'group'/'channel'`, in which a quote is written twice.
fn names(path: &str) -> (String, String) {
    let mut names = path
        .trim_start_matches('/')
        .split("'/'")
        .map(|name| name.trim_matches('\'').replace("''", "'"));
    let group = names.next().unwrap_or_default();
    let channel = names.next();
    match channel {
        Some(channel) => (group, channel),
        None => (String::new(), group),
    }
}

/// The path of a channel's group.
fn group_path(path: &str) -> &str {
    path.rfind("'/'").map_or("/", |at| &path[..=at])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_paths() {
        assert_eq!(names("/'run 1'/'Voltage'"), ("run 1".into(), "Voltage".into()));
        assert_eq!(names("/'o''clock'/'a''b'"), ("o'clock".into(), "a'b".into()));
        assert_eq!(group_path("/'run 1'/'Voltage'"), "/'run 1'");
        assert_eq!(group_path("/'run 1'"), "/");
    }
}
