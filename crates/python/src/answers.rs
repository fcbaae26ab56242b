//! Answers: comparisons, diagnoses, what was learned, ladders. Each prints as the command line does.

use crate::arrays::plain;
use crate::dataset::Dataset;
use crate::error::refused;
use crate::model::Model;
use crate::work::run;
use hysteron_data::Dataset as Data;
use hysteron_diagnose::diagnosis::Diagnosis as Diagnosed;
use hysteron_diagnose::{Comparison as Compared, Ladder as Steps, Learned as Result};
use hysteron_identify::effects::UserEffect;
use hysteron_identify::{Direction, Family, FitOptions, Model as Fitted};
use hysteron_report::{Context, comparison_page, diagnosis_page, facts, ladder_page};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

const VERSION: &str = env!("CARGO_PKG_VERSION");
/// What stands for a file of what was never one.
const IN_MEMORY: &str = "in memory";

/// A page as an object that shows itself in a notebook.
fn page<'py>(py: Python<'py>, html: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("hysteron._show")?.getattr("Page")?.call1((html,))
}

/// Pictures by matplotlib; without it, the page.
fn plot<'py>(answer: &Bound<'py, PyAny>, how: &str) -> PyResult<Bound<'py, PyAny>> {
    answer.py().import("hysteron._show")?.call_method1(how, (answer,))
}

/// A model against the records.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Comparison {
    data: Arc<Data>,
    model: Arc<Fitted>,
    comparison: Compared,
}

/// What a model lacks.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Diagnosis {
    data: Arc<Data>,
    model: Arc<Fitted>,
    own: Vec<UserEffect>,
    diagnosis: Diagnosed,
}

/// What was learned, and why it stopped.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Learned {
    data: Arc<Data>,
    own: Vec<UserEffect>,
    family: Family,
    learned: Result,
}

/// How the error fell, step by step.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Ladder {
    ladder: Steps,
}

#[pymethods]
impl Comparison {
    /// Pooled figures on the records that models are judged on; None without such records.
    #[getter]
    fn validate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.comparison.validate)
    }

    /// Pooled figures on the records that models are fitted to.
    #[getter]
    fn identify<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.comparison.identify)
    }

    /// Figures of each record.
    #[getter]
    fn records<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.comparison.records)
    }

    /// The arrays `time`, `input`, `measured` and `modelled` of each record.
    #[getter]
    fn series<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let records = self.comparison.records.iter();
        records
            .map(|record| {
                let series = PyDict::new(py);
                let time = (0..record.series.measured.len()).map(|k| record.series.at_s(k));
                series.set_item("time", PyArray1::from_iter(py, time))?;
                for (name, values) in [
                    ("input", &record.series.input),
                    ("measured", &record.series.measured),
                    ("modelled", &record.series.modelled),
                ] {
                    series.set_item(name, PyArray1::from_slice(py, values))?;
                }
                Ok(series)
            })
            .collect()
    }

    /// The answer of `hysteron compare --json`.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.comparison)
    }

    /// The page with pictures.
    fn page<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let facts = facts(IN_MEMORY, IN_MEMORY, &self.data, &self.model);
        let context = Context {
            facts: &facts,
            command: "hysteron.compare(dataset, model).page()",
            version: VERSION,
        };
        let title = format!("{} against {}", self.model.family, self.data.name);
        page(py, &comparison_page(&title, &self.comparison, &context))
    }

    /// Pictures of the records by matplotlib; without it, the page.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        plot(slf.as_any(), "plot_comparison")
    }

    fn __repr__(&self) -> String {
        hysteron_report::comparison_text(&self.comparison).trim_end().to_owned()
    }

    fn _repr_html_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.page(py)?.call_method0("_repr_html_")
    }
}

#[pymethods]
impl Diagnosis {
    /// `none`, `unknown`, or the effect that the model lacks.
    #[getter]
    fn verdict(&self) -> &str {
        self.diagnosis.verdict.as_str()
    }

    /// The candidates in their order.
    #[getter]
    fn ranking<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.diagnosis.ranking)
    }

    /// The record to take next: its excitation in words, the voltage `u` in volts, `u2` of the other axis where there is one, and `fs` in hertz; None where none helps.
    #[getter]
    fn next_record<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(next) = &self.diagnosis.next_record else {
            return Ok(None);
        };
        let record = PyDict::new(py);
        record.set_item("excitation", &next.excitation)?;
        record.set_item("u", PyArray1::from_slice(py, &next.voltage_v))?;
        record.set_item("fs", 1.0 / next.sample_period_s)?;
        if let Some(voltage2_v) = &next.voltage2_v {
            record.set_item("u2", PyArray1::from_slice(py, voltage2_v))?;
        }
        Ok(Some(record))
    }

    /// The answer of `hysteron diagnose --json`.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.diagnosis)
    }

    /// The page, with a picture of what the first candidates do to the data.
    #[pyo3(signature = (*, progress=true))]
    fn page<'py>(&self, py: Python<'py>, progress: bool) -> PyResult<Bound<'py, PyAny>> {
        let html = run(py, "picturing", progress, |bar| {
            let comparison = hysteron_diagnose::compare(&self.data, &self.model, &|_| ());
            let pictured = |share: f64, effect: &str| bar.at(share, effect);
            let shown = hysteron_diagnose::signatures(
                &self.data,
                &self.model,
                &comparison,
                &self.diagnosis,
                &self.own,
                &pictured,
            );
            let context = Context {
                facts: &facts(IN_MEMORY, IN_MEMORY, &self.data, &self.model),
                command: "hysteron.diagnose(dataset, model).page()",
                version: VERSION,
            };
            let title = format!("What {} lacks on {}", self.model.family, self.data.name);
            diagnosis_page(&title, &self.diagnosis, &shown, &context)
        })?;
        page(py, &html)
    }

    /// The candidates by matplotlib; without it, the page.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        plot(slf.as_any(), "plot_diagnosis")
    }

    fn __repr__(&self) -> String {
        hysteron_report::diagnosis_text(&self.diagnosis).trim_end().to_owned()
    }
}

#[pymethods]
impl Learned {
    /// The model, with every step in its history.
    #[getter]
    fn model(&self) -> Model {
        Model::new(self.learned.model.clone())
    }

    /// The attempts in their order, those that were not kept as well.
    #[getter]
    fn attempts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.learned.attempts)
    }

    /// Why it stopped.
    #[getter]
    fn stop<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.learned.stop)
    }

    /// How the error fell; None where no step was kept.
    #[getter]
    fn ladder(&self) -> Option<Ladder> {
        let ladder = hysteron_diagnose::ladder(&self.learned.model)?;
        Some(Ladder { ladder })
    }

    /// The last diagnosis.
    #[getter]
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis {
            data: Arc::clone(&self.data),
            model: Arc::new(self.learned.model.clone()),
            own: self.own.clone(),
            diagnosis: self.learned.diagnosis.clone(),
        }
    }

    /// The answer of `hysteron learn --json`, but for its files.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(
            py,
            &serde_json::json!({
                "effects": self.learned.model.effects,
                "attempts": self.learned.attempts,
                "stop": self.learned.stop,
                "ladder": hysteron_diagnose::ladder(&self.learned.model),
                "diagnosis": self.learned.diagnosis,
            }),
        )
    }

    /// The ladder by matplotlib; without it, its page.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        plot(slf.as_any(), "plot_learned")
    }

    fn __repr__(&self) -> String {
        let mut text = hysteron_report::learned_text(self.family, &self.learned);
        if let Some(ladder) = hysteron_diagnose::ladder(&self.learned.model) {
            text.push('\n');
            text.push_str(&hysteron_report::ladder_text(&ladder));
        }
        text.trim_end().to_owned()
    }

    fn _repr_html_<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.ladder().map(|ladder| ladder._repr_html_(py)).transpose()
    }
}

#[pymethods]
impl Ladder {
    /// The steps in their order, each with its errors.
    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.ladder.steps)
    }

    /// The answer of `hysteron ladder --json`.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.ladder)
    }

    /// The page with pictures.
    fn page<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let facts = [
            ("model", self.ladder.model.clone()),
            ("fitted on", self.ladder.dataset.clone()),
        ];
        let context = Context {
            facts: &facts,
            command: "hysteron.ladder(model).page()",
            version: VERSION,
        };
        page(py, &ladder_page(&self.ladder, &context))
    }

    /// Bars by matplotlib; without it, the page.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        plot(slf.as_any(), "plot_ladder")
    }

    fn __repr__(&self) -> String {
        hysteron_report::ladder_text(&self.ladder).trim_end().to_owned()
    }

    fn _repr_html_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.page(py)?.call_method0("_repr_html_")
    }
}

/// Holds a model against the records: errors, noise floor, and where the error is.
#[pyfunction]
#[pyo3(signature = (dataset, model, *, progress=true))]
pub(crate) fn compare(
    py: Python<'_>,
    dataset: &Bound<'_, Dataset>,
    model: &Model,
    progress: bool,
) -> PyResult<Comparison> {
    let (data, model) = (Arc::clone(&dataset.borrow().data), Arc::clone(&model.model));
    let comparison = run(py, "comparing", progress, |bar| {
        hysteron_diagnose::compare(&data, &model, &|share| bar.at(share, "comparing"))
    })?;
    Ok(Comparison {
        data,
        model,
        comparison,
    })
}

/// Names the physical effect that a forward model lacks. `effects` are effect files of your own, among the candidates.
#[pyfunction]
#[pyo3(signature = (dataset, model, *, effects=Vec::new(), progress=true))]
pub(crate) fn diagnose(
    py: Python<'_>,
    dataset: &Bound<'_, Dataset>,
    model: &Model,
    effects: Vec<PathBuf>,
    progress: bool,
) -> PyResult<Diagnosis> {
    let (data, model) = (Arc::clone(&dataset.borrow().data), Arc::clone(&model.model));
    if model.direction == Direction::Inverse {
        return Err(refused(
            "an inverse model has no place for physical effects; give a forward model (direction=\"forward\")",
        ));
    }
    let own = UserEffect::read_all(&effects).map_err(refused)?;
    let diagnosis = run(py, "diagnosing", progress, |bar| {
        hysteron_diagnose::diagnose_with(&data, &model, &own, &|share, effect| bar.at(share, effect))
    })?;
    Ok(Diagnosis {
        data,
        model,
        own,
        diagnosis: diagnosis.map_err(refused)?,
    })
}

/// Fits a model, then adds effect after effect, as long as what was held out confirms it.
#[pyfunction]
#[pyo3(signature = (dataset, model="mpi", *, plays=10, effects=Vec::new(), progress=true))]
pub(crate) fn learn(
    py: Python<'_>,
    dataset: &Bound<'_, Dataset>,
    model: &str,
    plays: usize,
    effects: Vec<PathBuf>,
    progress: bool,
) -> PyResult<Learned> {
    let data = Arc::clone(&dataset.borrow().data);
    let own = UserEffect::read_all(&effects).map_err(refused)?;
    let family: Family = crate::error::word("model", model)?;
    let options = FitOptions {
        plays,
        ..FitOptions::new(family)
    };
    let learned = run(py, "learning", progress, |bar| {
        hysteron_diagnose::learn_with(&data, &options, &own, &|what, share| bar.at(share, what))
    })?;
    Ok(Learned {
        data,
        own,
        family,
        learned: learned.map_err(refused)?,
    })
}

/// How the error of a model fell, step by step.
#[pyfunction]
pub(crate) fn ladder(model: &Model) -> PyResult<Ladder> {
    let ladder = hysteron_diagnose::ladder(&model.model).ok_or_else(|| {
        refused("nothing was added to this model yet, so there are no steps to show; hysteron.add adds an effect")
    })?;
    Ok(Ladder { ladder })
}
