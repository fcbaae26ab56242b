//! Datasets from disk, examples and simulated stages.

use crate::arrays::column;
use crate::dataset::{Dataset, period_s};
use crate::error::{refused, word};
use crate::work::run;
use hysteron_challenge::examples::{Example, Made, default_campaign, record};
use hysteron_data::import::{ColumnChoice, ImportOptions, import};
use hysteron_data::{Dataset as Data, Record, Role, read_dataset};
use hysteron_plant::{Stage, StageConfig, preset};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::{Path, PathBuf};

/// Reads a dataset folder, or any recording that `hysteron import` reads.
///
/// `columns` says which column is which quantity, as in `{"voltage": "CH1:mV*20", "position": "3:um"}`; `fs` is the
/// sample rate in hertz of files without time.
#[pyfunction]
#[pyo3(signature = (path, *, role="identify", columns=None, fs=None))]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    role: &str,
    columns: Option<BTreeMap<String, String>>,
    fs: Option<f64>,
) -> PyResult<Dataset> {
    let choices = columns.unwrap_or_default();
    let choices: Result<Vec<ColumnChoice>, _> = choices
        .iter()
        .map(|(quantity, source)| format!("{quantity}={source}").parse())
        .collect();
    let options = ImportOptions {
        role: word::<Role>("role", role)?,
        columns: choices.map_err(refused)?,
        rate_hz: fs.map(|fs| period_s(fs).map(|_| fs)).transpose()?,
        ..ImportOptions::default()
    };
    let dataset = Dataset::new(py.detach(|| from_path(&path, &options)).map_err(refused)?);
    for remark in dataset.remarks() {
        let text = CString::new(remark).map_err(refused)?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    Ok(dataset)
}

/// A folder or a native CSV is a dataset as it is; every other file is imported.
fn from_path(path: &Path, options: &ImportOptions) -> Result<Data, hysteron_data::DataError> {
    if path.is_dir() {
        return read_dataset(path);
    }
    if options.columns.is_empty()
        && options.rate_hz.is_none()
        && let Ok(mut dataset) = read_dataset(path)
    {
        dataset.records.iter_mut().for_each(|record| record.role = options.role);
        return Ok(dataset);
    }
    let imported = import(path, options, &mut |_, _| ())?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(Data {
        name: stem.into_owned(),
        description: "imported".to_owned(),
        notices: imported.notices().collect(),
        records: imported.records,
        ..Data::default()
    })
}

/// A small dataset of a simulated stage, the same as `hysteron example NAME` writes.
#[pyfunction]
#[pyo3(signature = (name, *, progress=true))]
pub(crate) fn example(py: Python<'_>, name: &str, progress: bool) -> PyResult<Dataset> {
    let example: Example = name.parse().map_err(refused)?;
    let label = format!("simulating {}", example.name());
    let made = run(py, &label, progress, |bar| example.make(&|share| bar.at(share, &label)))?;
    match made.map_err(refused)? {
        Made::Dataset { dataset, .. } => Ok(Dataset::new(*dataset)),
        Made::Files { .. } => Err(refused(format!(
            "{name}: files of an instrument, and no dataset; `hysteron example {name}` writes them for hysteron.read"
        ))),
    }
}

/// The names of the examples, each with a line of what it shows.
#[pyfunction]
pub(crate) fn examples() -> BTreeMap<&'static str, &'static str> {
    Example::ALL
        .into_iter()
        .map(|example| (example.name(), example.about()))
        .collect()
}

/// Records of a simulated stage: its answer to the voltage `u` (volts, sampled at `fs` hertz) from rest at 0 V, or the
/// default campaign of `hysteron simulate`.
#[pyfunction]
#[pyo3(signature = (stage, u=None, fs=None, *, seed=1, role="identify", progress=true))]
pub(crate) fn simulate(
    py: Python<'_>,
    stage: &str,
    u: Option<&Bound<'_, PyAny>>,
    fs: Option<f64>,
    seed: u64,
    role: &str,
    progress: bool,
) -> PyResult<Dataset> {
    let config = preset::named(stage).ok_or_else(|| {
        refused(format!(
            "there is no stage `{stage}`; the simulated ones are {}",
            preset::NAMES.join(", ")
        ))
    })?;
    let period_s = fs.map_or(Ok(config.sample_period_s), period_s)?;
    let role: Role = word("role", role)?;
    let voltage_v = u.map(|u| column("u", u)).transpose()?;
    let data = run(py, "simulating", progress, |bar| match voltage_v {
        Some(voltage_v) => answer(stage, &config, voltage_v, period_s, seed, role),
        None => {
            let plan = default_campaign(config.hysteresis.reference_v, seed);
            record(stage, &config, &plan, period_s, seed, &|share| {
                bar.at(share, "simulating")
            })
        }
    })?;
    Ok(Dataset::new(data.map_err(refused)?))
}

fn answer(
    name: &str,
    config: &StageConfig,
    voltage_v: Vec<f64>,
    period_s: f64,
    seed: u64,
    role: Role,
) -> Result<Data, hysteron_plant::StageError> {
    let run = Stage::new(config, seed)?.run(&voltage_v, period_s)?;
    Ok(Data {
        name: name.to_owned(),
        description: format!("simulated stage {name}, seed {seed}"),
        records: vec![Record {
            file: "record-1.csv".to_owned(),
            role,
            excitation: String::new(),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: run.temperature_c,
            voltage2_v: None,
        }],
        ..Data::default()
    })
}
