//! Fitted models.

use crate::arrays::{column, plain};
use crate::dataset::{Dataset, period_s};
use crate::error::{refused, word};
use crate::work::run;
use hysteron_identify::effects::UserEffect;
use hysteron_identify::objective::Weighting;
use hysteron_identify::{EffectId, Family, FitOptions, InitialState, Method, Model as Fitted};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A fitted model: a hysteresis, and the effects around it.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Model {
    pub(crate) model: Arc<Fitted>,
}

impl Model {
    pub(crate) fn new(model: Fitted) -> Self {
        Self { model: Arc::new(model) }
    }
}

#[pymethods]
impl Model {
    /// Reads a `model.toml`.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Ok(Self::new(Fitted::read(&path).map_err(refused)?))
    }

    /// A model from the text of a `model.toml`.
    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        Ok(Self::new(Fitted::from_toml(text, "model").map_err(refused)?))
    }

    /// Writes a `model.toml`.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.model.write(&path).map_err(refused)
    }

    /// The text of its `model.toml`.
    fn to_toml(&self) -> String {
        self.model.to_toml()
    }

    /// The model's output for an input from rest: positions in micrometres for voltages in volts at `fs` hertz, or of an
    /// inverse model voltages for positions.
    fn predict<'py>(&self, py: Python<'py>, u: &Bound<'py, PyAny>, fs: f64) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let input = column("u", u)?;
        let period_s = period_s(fs)?;
        if let Some(index) = input.iter().position(|value| !value.is_finite()) {
            return Err(refused(format!("u[{index}] = {}: values are finite", input[index])));
        }
        let output = py.detach(|| self.model.simulate_input(&input, period_s, InitialState::REST));
        Ok(output.map_err(refused)?.into_pyarray(py))
    }

    /// Measured minus modelled output of each record. The model runs freely: of the measured output only the state before
    /// the first sample is taken.
    fn residual<'py>(&self, py: Python<'py>, dataset: &Dataset) -> Vec<Bound<'py, PyArray1<f64>>> {
        let data = Arc::clone(&dataset.data);
        let residuals: Vec<Vec<f64>> = py.detach(|| {
            let residual = |record| {
                let modelled = self.model.simulate(record).output;
                let measured = self.model.direction.output(record);
                measured.iter().zip(modelled).map(|(y, m)| y - m).collect()
            };
            data.records.iter().map(residual).collect()
        });
        residuals
            .into_iter()
            .map(|residual| residual.into_pyarray(py))
            .collect()
    }

    /// The hysteresis family.
    #[getter]
    fn family(&self) -> &'static str {
        self.model.family.name()
    }

    /// `forward`: voltage to position; `inverse`: position to voltage.
    #[getter]
    fn direction(&self) -> &'static str {
        self.model.direction.name()
    }

    /// Thresholds of the plays, input unit.
    #[getter]
    fn thresholds(&self) -> Vec<f64> {
        self.model.thresholds.clone()
    }

    /// Parameters of the hysteresis, each with `name`, `unit`, `value` and, where it is determined, `standard_error`.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.model.parameters())
    }

    /// The effects around the hysteresis, each with `name` and `parameter`, in the order of the chain.
    #[getter]
    fn effects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.model.effects)
    }

    /// What the user should know of the fit.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.model.notices.clone()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.model == other.model
    }

    /// A model is pickled as its file.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().getattr("from_toml")?, (slf.get().to_toml(),)))
    }

    fn __repr__(&self) -> String {
        let mut text = hysteron_report::model_text(&self.model).trim_end().to_owned();
        for effect in &self.model.effects {
            text.push_str(&format!("\n  + {}", effect.name));
            for p in &effect.parameters {
                text.push_str(&format!("\n    {:<20} {:>13.5e}  {}", p.name, p.value, p.unit));
            }
        }
        text
    }
}

/// Fits a model to the records with the role `identify`.
///
/// `model` is `pi`, `mpi`, `wrpi`, `mrpi` or `play-polynomial`; `thresholds` `data`, `eq16` or `log`; `direction`
/// `forward` or `inverse`; `method` `separable` or `mpso`, whose swarm takes `seed`.
#[pyfunction]
#[pyo3(signature = (dataset, model="mrpi", *, plays=10, thresholds="data", direction="forward", method="separable",
    seed=1, progress=true))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn fit(
    py: Python<'_>,
    dataset: &Bound<'_, Dataset>,
    model: &str,
    plays: usize,
    thresholds: &str,
    direction: &str,
    method: &str,
    seed: u64,
    progress: bool,
) -> PyResult<Model> {
    let method: Method = word("method", method)?;
    let options = FitOptions {
        family: word::<Family>("model", model)?,
        direction: word("direction", direction)?,
        plays,
        placement: word("thresholds", thresholds)?,
        method,
        // The paper's swarm minimises the paper's objective.
        weighting: match method {
            Method::Mpso => Weighting::LoopOpening,
            Method::Separable => Weighting::Record,
        },
        seed,
    };
    let data = Arc::clone(&dataset.borrow().data);
    let label = format!("fitting {model}");
    let report = run(py, &label, progress, |bar| {
        hysteron_identify::fit(&data, &options, &|share| bar.at(share, &label))
    })?;
    Ok(Model::new(report.map_err(refused)?.model))
}

/// Adds an effect to a model and fits everything anew. `effect` is its name, or an effect file (ends with `.toml`).
#[pyfunction]
#[pyo3(signature = (dataset, model, effect, *, progress=true))]
pub(crate) fn add(
    py: Python<'_>,
    dataset: &Bound<'_, Dataset>,
    model: &Model,
    effect: &str,
    progress: bool,
) -> PyResult<Model> {
    let (data, model) = (Arc::clone(&dataset.borrow().data), Arc::clone(&model.model));
    let label = format!("adding {effect}");
    let added = if effect.ends_with(".toml") {
        let own = UserEffect::read(Path::new(effect)).map_err(refused)?;
        run(py, &label, progress, |bar| {
            hysteron_diagnose::add_own(&data, &model, own, &|share| bar.at(share, &label))
        })?
    } else {
        let id: EffectId = effect.parse().map_err(refused)?;
        run(py, &label, progress, |bar| {
            hysteron_diagnose::add(&data, &model, id, &|share| bar.at(share, &label))
        })?
    };
    Ok(Model::new(added.map_err(refused)?.model))
}
