//! Datasets and records.

use crate::arrays::{column, some_column, view};
use crate::error::{refused, word};
use hysteron_data::{Dataset as Data, Notice, Overwrite, Record as Recorded, Role};
use numpy::PyArray1;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyString;
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::Arc;

/// A set of records of one stage.
#[pyclass(module = "hysteron", sequence)]
pub(crate) struct Dataset {
    pub(crate) data: Arc<Data>,
}

/// One uniformly sampled run of the stage; its arrays are views that cannot be written to.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Record {
    data: Arc<Data>,
    index: usize,
}

/// The further columns of a record, as Python gives them.
pub(crate) struct Further<'a, 'py> {
    pub(crate) reference: Option<&'a Bound<'py, PyAny>>,
    pub(crate) temperature: Option<&'a Bound<'py, PyAny>>,
    pub(crate) voltage2: Option<&'a Bound<'py, PyAny>>,
}

impl Dataset {
    pub(crate) fn new(data: Data) -> Self {
        Self { data: Arc::new(data) }
    }

    /// What the reader did that the user should know, and what a lab has done wrong in the records, as the command line says it.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let said = |notice: &Notice| format!("note: {}: {}", notice.file, notice.text);
        let mut remarks: Vec<String> = self.data.notices.iter().map(said).collect();
        let mistakes = hysteron_acquisition::mistakes(&self.data);
        remarks.extend(mistakes.iter().map(|finding| format!("warning: {finding}")));
        remarks
    }

    fn push(&mut self, record: Recorded) -> PyResult<()> {
        if self.data.records.iter().any(|other| other.file == record.file) {
            return Err(refused(format!(
                "{}: there is a record of this name already; give another one by name=",
                record.file
            )));
        }
        hysteron_data::validate_record(&record).map_err(refused)?;
        // Records that are looked at keep the memory that they show: then this copies.
        Arc::make_mut(&mut self.data).records.push(record);
        Ok(())
    }
}

#[pymethods]
impl Dataset {
    /// A dataset of arrays: voltages `u` in volts, positions `y` in micrometres, `fs` in hertz. Lists of arrays make
    /// several records; then `fs` and `role` may be lists, too.
    #[staticmethod]
    #[pyo3(signature = (u, y, fs, *, role=None, name="arrays", reference=None, temperature=None, voltage2=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn from_arrays(
        u: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
        fs: &Bound<'_, PyAny>,
        role: Option<&Bound<'_, PyAny>>,
        name: &str,
        reference: Option<&Bound<'_, PyAny>>,
        temperature: Option<&Bound<'_, PyAny>>,
        voltage2: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut dataset = Self::new(Data {
            name: name.to_owned(),
            ..Data::default()
        });
        let Some(count) = several(u)? else {
            let further = Further {
                reference,
                temperature,
                voltage2,
            };
            let role = role.map_or(Ok("identify".to_owned()), |role| role.extract())?;
            dataset.add(u, y, fs.extract()?, &role, None, &further)?;
            return Ok(dataset);
        };
        if count != y.len()? {
            return Err(refused(format!(
                "u has {count} records, y has {}; give as many of each",
                y.len()?
            )));
        }
        let is_text = |given: &Bound<'_, PyAny>| given.extract::<String>().is_ok();
        for index in 0..count {
            let rate = fs.extract().or_else(|_| fs.get_item(index)?.extract())?;
            let role = match role {
                None => "identify".to_owned(),
                Some(role) if is_text(role) => role.extract()?,
                Some(roles) => roles.get_item(index)?.extract()?,
            };
            let [reference, temperature, voltage2] = [
                each(reference, index)?,
                each(temperature, index)?,
                each(voltage2, index)?,
            ];
            let further = Further {
                reference: reference.as_ref(),
                temperature: temperature.as_ref(),
                voltage2: voltage2.as_ref(),
            };
            dataset.add(&u.get_item(index)?, &y.get_item(index)?, rate, &role, None, &further)?;
        }
        Ok(dataset)
    }

    /// A dataset of one record from the columns of a table (pandas, polars, or a dictionary of arrays).
    ///
    /// The clock is `fs` in hertz or, without it, found from the column `time` in seconds.
    #[staticmethod]
    #[pyo3(signature = (table, *, u="voltage_v", y="position_um", time="time_s", fs=None, role="identify", name="table"))]
    fn from_dataframe(
        table: &Bound<'_, PyAny>,
        u: &str,
        y: &str,
        time: &str,
        fs: Option<f64>,
        role: &str,
        name: &str,
    ) -> PyResult<Self> {
        let [start_s, period_s] = match fs {
            Some(rate_hz) => [0.0, period_s(rate_hz)?],
            None => {
                let stamps_s = column(time, &table.get_item(time)?)?;
                hysteron_data::clock_of(&stamps_s, time).map_err(refused)?
            }
        };
        let mut dataset = Self::new(Data {
            name: name.to_owned(),
            ..Data::default()
        });
        dataset.push(Recorded {
            file: "record-1.csv".to_owned(),
            role: word::<Role>("role", role)?,
            excitation: String::new(),
            start_s,
            period_s,
            voltage_v: column(u, &table.get_item(u)?)?,
            position_um: column(y, &table.get_item(y)?)?,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        })?;
        Ok(dataset)
    }

    /// Adds a record of arrays, or the records of another dataset.
    #[pyo3(signature = (u, y=None, fs=None, *, role="identify", name=None, reference=None, temperature=None, voltage2=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn append(
        &mut self,
        u: &Bound<'_, PyAny>,
        y: Option<&Bound<'_, PyAny>>,
        fs: Option<f64>,
        role: &str,
        name: Option<&str>,
        reference: Option<&Bound<'_, PyAny>>,
        temperature: Option<&Bound<'_, PyAny>>,
        voltage2: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        if let Ok(other) = u.cast::<Dataset>() {
            let other = Arc::clone(&other.borrow().data);
            return other.records.iter().try_for_each(|record| self.push(record.clone()));
        }
        let (Some(y), Some(fs)) = (y, fs) else {
            return Err(refused("append takes another dataset, or u, y and fs of a record"));
        };
        let further = Further {
            reference,
            temperature,
            voltage2,
        };
        self.add(u, y, fs, role, name, &further)
    }

    /// Writes the native format: a folder with `dataset.toml` and a CSV for each record.
    #[pyo3(signature = (path, *, overwrite=false))]
    fn save(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<()> {
        let data = Arc::clone(&self.data);
        let overwrite = match overwrite {
            true => Overwrite::Allow,
            false => Overwrite::Refuse,
        };
        py.detach(|| hysteron_data::write_dataset(&data, &path, overwrite))
            .map_err(refused)
    }

    /// Short name.
    #[getter]
    fn name(&self) -> &str {
        &self.data.name
    }

    #[setter]
    fn set_name(&mut self, name: String) {
        Arc::make_mut(&mut self.data).name = name;
    }

    /// What the reader did that the user should know, and what is suspicious in the records.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.remarks()
    }

    /// The records in their order.
    #[getter]
    fn records(&self) -> Vec<Record> {
        let record = |index| Record {
            data: Arc::clone(&self.data),
            index,
        };
        (0..self.data.records.len()).map(record).collect()
    }

    fn __len__(&self) -> usize {
        self.data.records.len()
    }

    /// A record by its number, from the end if negative.
    fn __getitem__(&self, index: isize) -> PyResult<Record> {
        let count = self.data.records.len();
        let from_start = if index < 0 { index + count as isize } else { index };
        let index = usize::try_from(from_start).ok().filter(|index| *index < count);
        let index = index.ok_or_else(|| PyIndexError::new_err(format!("there are {count} records")))?;
        Ok(Record {
            data: Arc::clone(&self.data),
            index,
        })
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.data.records == other.data.records && self.data.name == other.data.name
    }

    fn __repr__(&self) -> String {
        let mut text = format!("Dataset {:?}, {} records", self.data.name, self.data.records.len());
        for record in &self.data.records {
            text.push_str("\n  ");
            text.push_str(&line(record));
        }
        text
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        let shown = slf.py().import("hysteron._show")?;
        shown.call_method1("dataset_html", (slf,))?.extract()
    }

    /// Pictures of the records by matplotlib; without it, a page.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hysteron._show")?.call_method1("plot_dataset", (slf,))
    }
}

impl Dataset {
    fn add(
        &mut self,
        u: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
        rate_hz: f64,
        role: &str,
        name: Option<&str>,
        further: &Further<'_, '_>,
    ) -> PyResult<()> {
        let file = match name {
            Some(name) => format!("{}.csv", name.strip_suffix(".csv").unwrap_or(name)),
            None => self.next_name(),
        };
        self.push(Recorded {
            file,
            role: word::<Role>("role", role)?,
            excitation: String::new(),
            start_s: 0.0,
            period_s: period_s(rate_hz)?,
            voltage_v: column("u", u)?,
            position_um: column("y", y)?,
            reference_um: some_column("reference", further.reference)?,
            temperature_c: some_column("temperature", further.temperature)?,
            voltage2_v: some_column("voltage2", further.voltage2)?,
        })
    }

    fn next_name(&self) -> String {
        let taken: HashSet<&str> = self.data.records.iter().map(|record| record.file.as_str()).collect();
        (self.data.records.len() + 1..)
            .map(|number| format!("record-{number}.csv"))
            .find(|file| !taken.contains(file.as_str()))
            .unwrap_or_default()
    }
}

#[pymethods]
impl Record {
    /// File name in the dataset's folder.
    #[getter]
    fn name(&self) -> &str {
        &self.record().file
    }

    /// `identify`: models are fitted to it; `validate`: models are judged on it.
    #[getter]
    fn role(&self) -> &'static str {
        role(self.record().role)
    }

    /// The excitation in words.
    #[getter]
    fn excitation(&self) -> &str {
        &self.record().excitation
    }

    /// Sample rate, hertz.
    #[getter]
    fn fs(&self) -> f64 {
        self.record().rate_hz()
    }

    /// Time of each sample, seconds.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let record = self.record();
        PyArray1::from_iter(
            py,
            (0..record.len()).map(|k| record.start_s + k as f64 * record.period_s),
        )
    }

    /// Voltage commanded at the actuator, volts.
    #[getter]
    fn u<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view(slf.clone().into_any(), &slf.get().record().voltage_v)
    }

    /// Measured position, micrometres.
    #[getter]
    fn y<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view(slf.clone().into_any(), &slf.get().record().position_um)
    }

    /// Desired position, micrometres, where it was recorded.
    #[getter]
    fn reference<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        some_view(slf, slf.get().record().reference_um.as_deref())
    }

    /// Temperature, degrees Celsius, where it was recorded.
    #[getter]
    fn temperature<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        some_view(slf, slf.get().record().temperature_c.as_deref())
    }

    /// Voltage commanded on the other axis, volts, where it was recorded.
    #[getter]
    fn voltage2<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        some_view(slf, slf.get().record().voltage2_v.as_deref())
    }

    fn __len__(&self) -> usize {
        self.record().len()
    }

    fn __repr__(&self) -> String {
        format!("Record {}", line(self.record()))
    }
}

impl Record {
    pub(crate) fn record(&self) -> &Recorded {
        // An index is made where the record is, and a dataset that is held here does not shrink.
        &self.data.records[self.index]
    }
}

fn some_view<'py>(owner: &Bound<'py, Record>, values: Option<&[f64]>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
    values.map(|values| view(owner.clone().into_any(), values)).transpose()
}

/// What is given for one of several records.
fn each<'py>(given: Option<&Bound<'py, PyAny>>, index: usize) -> PyResult<Option<Bound<'py, PyAny>>> {
    given.map(|given| given.get_item(index)).transpose()
}

/// A record in a line.
fn line(record: &Recorded) -> String {
    let seconds = record.len() as f64 * record.period_s;
    format!(
        "{}: {}, {} samples at {} Hz, {seconds:.3} s{}{}",
        record.file,
        role(record.role),
        record.len(),
        record.rate_hz(),
        if record.excitation.is_empty() { "" } else { ", " },
        record.excitation
    )
}

pub(crate) fn role(role: Role) -> &'static str {
    match role {
        Role::Identify => "identify",
        Role::Validate => "validate",
    }
}

/// How many records are given, where there are several: a list of arrays, or an array of two dimensions.
fn several(u: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    if let Ok(dimensions) = u.getattr("ndim") {
        let dimensions: usize = dimensions.extract()?;
        return if dimensions < 2 { Ok(None) } else { u.len().map(Some) };
    }
    if u.is_instance_of::<PyString>() {
        return Ok(None);
    }
    let first = u.get_item(0).ok();
    Ok(match first {
        Some(first) if first.extract::<f64>().is_err() => Some(u.len()?),
        _ => None,
    })
}

pub(crate) fn period_s(rate_hz: f64) -> PyResult<f64> {
    if rate_hz.is_finite() && rate_hz > 0.0 {
        return Ok(1.0 / rate_hz);
    }
    Err(refused(format!(
        "fs = {rate_hz}: a sample rate is a finite number of hertz above 0"
    )))
}
