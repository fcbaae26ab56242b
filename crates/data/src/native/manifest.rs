//! `dataset.toml`.

use std::io::{Read, Write};
use std::path::{Component, Path};

use super::atomic::Pending;
use crate::error::DataError;
use crate::place::Place;
use crate::record::{Dataset, Known, Record, Role};

/// The version of the format that is read and written.
pub(crate) const FORMAT: i64 = 1;

/// Its name.
pub(crate) const FILE: &str = "dataset.toml";

/// Longest `dataset.toml` that is read, bytes: thousands of records.
pub(crate) const LONGEST: u64 = 1 << 20;

/// What `dataset.toml` says.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the format.
    pub format: i64,
    /// Short name.
    #[serde(default)]
    pub name: String,
    /// Free text.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// What is known of the measuring chain.
    #[serde(default, skip_serializing_if = "nothing_known")]
    pub known: Known,
    /// The records.
    #[serde(default, rename = "record")]
    pub records: Vec<Entry>,
}

/// One `[[record]]`.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The CSV, relative to the folder.
    pub file: String,
    /// What it is used for.
    pub role: Role,
    /// For people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub excitation: String,
}

fn nothing_known(known: &Known) -> bool {
    *known == Known::default()
}

const KEYS: &str = "dataset.toml has `format = 1`, `name`, `description`, `[known]` (`delay_s`, `sensor_noise_um`, \
                    `sensor_bandwidth_hz`, `voltage_min_v`, `voltage_max_v`, `dac_v`, `adc_um`) and `[[record]]` (`file`, `role`, `excitation`)";

/// Only the version, so that a later format is named as such and not by its first unknown key.
#[derive(serde::Deserialize)]
struct Version {
    format: Option<i64>,
}

/// Reads the text of `dataset.toml`; `file` is its name in errors.
///
/// # Errors
/// [`DataError::Manifest`] with line and column.
pub fn parse_manifest(text: &str, file: &str) -> Result<Manifest, DataError> {
    let refuse = |at, found, allowed: &str| {
        Err(DataError::Manifest {
            at,
            found,
            allowed: allowed.to_owned(),
        })
    };
    if let Ok(Version { format: Some(format) }) = toml::from_str::<Version>(text)
        && format != FORMAT
    {
        return refuse(
            Place::file(file),
            format!("format = {format}"),
            "this program reads format = 1",
        );
    }
    let manifest: Manifest = match toml::from_str(text) {
        Ok(manifest) => manifest,
        Err(error) => {
            return refuse(
                place(&error, text, file),
                error.message().trim().replace('\n', " "),
                KEYS,
            );
        }
    };
    if manifest.records.is_empty() {
        return refuse(
            Place::file(file),
            "no [[record]]".into(),
            "a dataset needs at least one",
        );
    }
    for (index, entry) in manifest.records.iter().enumerate() {
        if let Some(found) = unfit_name(&entry.file) {
            return refuse(Place::file(file), format!("record {}: {found}", index + 1), NAMES);
        }
        if let Some(first) = manifest.records[..index]
            .iter()
            .position(|other| other.file == entry.file)
        {
            let found = format!(
                "records {} and {} are both file = {:?}",
                first + 1,
                index + 1,
                entry.file
            );
            return refuse(Place::file(file), found, "list each file once");
        }
    }
    check_known(&manifest.known, file)?;
    Ok(manifest)
}

pub(crate) const NAMES: &str = "a record's file is a path relative to the dataset's folder, inside it, with `/`";

/// What is wrong with the name of a record's file.
pub(crate) fn unfit_name(name: &str) -> Option<String> {
    let inside = Path::new(name)
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    let plain = !name.is_empty() && inside && !name.chars().any(|c| c.is_control() || "\\:*?\"<>|".contains(c));
    let reserved = name.eq_ignore_ascii_case("dataset.toml") || name.ends_with('/');
    (!plain || reserved).then(|| format!("file = {name:?}"))
}

/// Refuses values of `[known]` that cannot be.
pub(crate) fn check_known(known: &Known, file: &str) -> Result<(), DataError> {
    let refuse = |found: String, allowed: &str| {
        Err(DataError::Manifest {
            at: Place::file(file),
            found: format!("[known] {found}"),
            allowed: allowed.to_owned(),
        })
    };
    for (name, value) in [("delay_s", known.delay_s), ("sensor_noise_um", known.sensor_noise_um)] {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value >= 0.0)) {
            return refuse(format!("{name} = {value}"), "it is finite and not negative");
        }
    }
    if let Some(hz) = known.sensor_bandwidth_hz.filter(|hz| !(hz.is_finite() && *hz > 0.0)) {
        return refuse(format!("sensor_bandwidth_hz = {hz}"), "it is finite and above 0 Hz");
    }
    for (name, value) in [
        ("voltage_min_v", known.voltage_min_v),
        ("voltage_max_v", known.voltage_max_v),
    ] {
        if let Some(value) = value.filter(|value| !value.is_finite()) {
            return refuse(format!("{name} = {value}"), "it is finite");
        }
    }
    if let (Some(min), Some(max)) = (known.voltage_min_v, known.voltage_max_v)
        && min >= max
    {
        return refuse(
            format!("voltage_min_v = {min}, voltage_max_v = {max}"),
            "the minimum is below the maximum",
        );
    }
    for (name, ends) in [("dac_v", known.dac_v), ("adc_um", known.adc_um)] {
        if let Some([low, full]) = ends.filter(|[low, full]| !(low.is_finite() && full.is_finite() && low < full)) {
            return refuse(
                format!("{name} = [{low}, {full}]"),
                "both are finite: the lowest code's, and full scale above it",
            );
        }
    }
    Ok(())
}

/// Where an error of the TOML reader is.
fn place(error: &toml::de::Error, text: &str, file: &str) -> Place {
    let Some(span) = error.span() else {
        return Place::file(file);
    };
    let before = text.get(..span.start).unwrap_or(text);
    let line = before.matches('\n').count() as u64 + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count();
    Place::cell(file, line, column, "")
}

impl Manifest {
    /// The manifest of a dataset.
    pub fn of(dataset: &Dataset) -> Self {
        Self {
            format: FORMAT,
            name: dataset.name.clone(),
            description: dataset.description.clone(),
            known: dataset.known,
            records: dataset.records.iter().map(Entry::of).collect(),
        }
    }

    /// Reads the `dataset.toml` of a folder.
    ///
    /// # Errors
    /// [`DataError::NoManifest`], [`DataError::Manifest`] with line and column, [`DataError::Format`] for a file that is no text or too long, [`DataError::Io`].
    pub fn read(folder: &Path) -> Result<Self, DataError> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Err(DataError::NoManifest {
                folder: folder.display().to_string(),
            });
        }
        let shown = path.display().to_string();
        let file = std::fs::File::open(&path).map_err(DataError::io(&shown, "open it"))?;
        let mut bytes = Vec::new();
        file.take(LONGEST + 1)
            .read_to_end(&mut bytes)
            .map_err(DataError::io(&shown, "read it"))?;
        let refuse = |found: &str, what_to_do: &str| DataError::Format {
            file: shown.clone(),
            found: found.into(),
            what_to_do: what_to_do.into(),
        };
        if bytes.len() as u64 > LONGEST {
            return Err(refuse(
                "longer than a megabyte",
                "samples belong in CSV files, dataset.toml only lists them",
            ));
        }
        let text = std::str::from_utf8(&bytes).map_err(|_| refuse("not UTF-8", "save it as UTF-8"))?;
        parse_manifest(text.strip_prefix('\u{feff}').unwrap_or(text), &shown)
    }

    /// Writes the `dataset.toml` of a folder, whole or not at all, in place of one that is there.
    ///
    /// # Errors
    /// [`DataError::Unwritable`] for what TOML cannot hold; [`DataError::Io`].
    pub fn write(&self, folder: &Path) -> Result<(), DataError> {
        let path = folder.join(FILE);
        let text = self.render(&path)?;
        Pending::write(&path, |out| out.write_all(text.as_bytes()))?.commit()
    }

    /// Whether it lists a file of this name; without case, as Windows and macOS take names.
    pub fn has(&self, file: &str) -> bool {
        let same = |entry: &Entry| entry.file.to_lowercase() == file.to_lowercase();
        self.records.iter().any(same)
    }

    /// Its text; errors name the file of that path.
    ///
    /// # Errors
    /// [`DataError::Unwritable`] for what TOML cannot hold.
    pub fn render(&self, path: &Path) -> Result<String, DataError> {
        toml::to_string(self).map_err(|error| DataError::Unwritable {
            file: path.display().to_string(),
            found: error.to_string(),
            allowed: "names and numbers that TOML can hold",
        })
    }
}

impl Entry {
    /// The entry of a record.
    pub fn of(record: &Record) -> Self {
        Self {
            file: record.file.clone(),
            role: record.role,
            excitation: record.excitation.clone(),
        }
    }
}
