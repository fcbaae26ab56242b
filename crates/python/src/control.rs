//! Controllers and their laws.

use crate::arrays::{column, plain};
use crate::dataset::Dataset;
use crate::error::{refused, word};
use crate::model::Model;
use crate::work::run;
use hysteron_control::commands::commands;
use hysteron_control::design::source::{Source, Wishes, design as designed};
use hysteron_control::design::{Controller as Designed, ReferenceKind};
use hysteron_control::reference::Reference;
use hysteron_core::real::Real;
use hysteron_core::surroundings::{DesignedLaw, DesignedState, LoopInput};
use hysteron_data::Record;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyFloat;
use std::path::PathBuf;
use std::sync::Arc;

/// A designed controller.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Controller {
    controller: Designed,
}

/// A law in one of the two number types of the core.
#[derive(Clone)]
enum Running {
    Single(Box<(DesignedLaw<f32>, DesignedState<f32>)>),
    Double(Box<(DesignedLaw<f64>, DesignedState<f64>)>),
}

/// A controller's law with its state: the code that runs on the chip.
#[pyclass(module = "hysteron")]
pub(crate) struct Law {
    temperature_c: f64,
    running: Running,
}

/// What a law takes in at every sample, or what stays the same.
enum Input {
    Same(f64),
    Each(Vec<f64>),
}

impl Input {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        match given.extract::<f64>() {
            Ok(value) => Ok(Self::Same(value)),
            Err(_) => column(name, given).map(Self::Each),
        }
    }

    fn at(&self, sample: usize) -> f64 {
        match self {
            Self::Same(value) => *value,
            Self::Each(values) => values.get(sample).copied().unwrap_or(f64::NAN),
        }
    }

    fn len(&self) -> Option<usize> {
        match self {
            Self::Same(_) => None,
            Self::Each(values) => Some(values.len()),
        }
    }
}

#[pymethods]
impl Controller {
    /// Reads a `controller.toml`.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let controller = Designed::read(&path).map_err(refused)?;
        Ok(Self { controller })
    }

    /// Writes a `controller.toml`.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let text = self.controller.to_toml().map_err(refused)?;
        std::fs::write(&path, text).map_err(|error| refused(format!("{}: {error}", path.display())))
    }

    /// The law at rest at 0 V, in `f32` as on the chip or in `f64`. `temperature` is the stage's at the start, degrees
    /// Celsius.
    #[pyo3(signature = (kind="f64", *, temperature=0.0))]
    fn law(&self, kind: &str, temperature: f64) -> PyResult<Law> {
        let running = match kind {
            "f32" => {
                let law = self.controller.law::<f32>().map_err(refused)?;
                Running::Single(Box::new((law, law.rest(temperature as f32))))
            }
            "f64" => {
                let law = self.controller.law::<f64>().map_err(refused)?;
                Running::Double(Box::new((law, law.rest(temperature))))
            }
            other => return Err(refused(format!("law {other:?}: there are \"f32\" and \"f64\""))),
        };
        Ok(Law {
            temperature_c: temperature,
            running,
        })
    }

    /// The voltages of the feedforward alone, from rest, along a reference in micrometres. The first `samples_ahead` go out
    /// before the reference begins.
    fn voltages<'py>(&self, py: Python<'py>, reference: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let samples_um = column("reference", reference)?;
        if let Some(index) = samples_um.iter().position(|value| !value.is_finite()) {
            return Err(refused(format!(
                "reference[{index}] = {} is not finite; give micrometres",
                samples_um[index]
            )));
        }
        let law = self.controller.without_feedback().law::<f64>().map_err(refused)?;
        let reference = Reference {
            samples_um,
            ..Reference::default()
        };
        Ok(py.detach(|| commands(&law, &reference)).into_pyarray(py))
    }

    /// Samples that the reference comes before it is due.
    #[getter]
    fn samples_ahead(&self) -> usize {
        self.controller.samples_ahead
    }

    /// Sample rate that it runs at, hertz.
    #[getter]
    fn fs(&self) -> f64 {
        1.0 / self.controller.model.sample_period_s
    }

    /// Limits of the command, volts.
    #[getter]
    fn volts(&self) -> (f64, f64) {
        (self.controller.model.voltage_min_v, self.controller.model.voltage_max_v)
    }

    /// Feedback and its figures; None in open loop.
    #[getter]
    fn feedback<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.controller.feedback)
    }

    /// All of the file's numbers.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.controller)
    }

    fn __repr__(&self) -> String {
        let (low_v, high_v) = self.volts();
        let feedback = match (&self.controller.feedback, &self.controller.open_loop) {
            (Some(feedback), _) => format!(
                "feedback: integral and {}, helps to {:.0} Hz",
                feedback.structure, feedback.helps_to_hz
            ),
            (None, Some(why)) => format!("open loop ({why:?})"),
            (None, None) => "open loop".to_owned(),
        };
        format!(
            "Controller at {:.0} Hz, {low_v} to {high_v} V, reference {} samples ahead\n  {feedback}",
            self.fs(),
            self.controller.samples_ahead
        )
    }
}

#[pymethods]
impl Law {
    /// One sample, or an array of them: the voltage for a reference that comes `ahead` samples before it is due and a
    /// reading of the sensor, both in micrometres. An open loop takes no heed of the reading.
    ///
    /// `voltage2` is the other axis' command `ahead` samples before it goes out, `temperature` the stage's; each is a number
    /// or one a sample.
    #[pyo3(signature = (reference, reading=None, *, voltage2=None, temperature=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        reference: &Bound<'py, PyAny>,
        reading: Option<&Bound<'py, PyAny>>,
        voltage2: Option<&Bound<'py, PyAny>>,
        temperature: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = |name: &str, given: Option<&Bound<'py, PyAny>>, else_: f64| {
            given.map_or(Ok(Input::Same(else_)), |given| Input::of(name, given))
        };
        let inputs = [
            Input::of("reference", reference)?,
            given("reading", reading, 0.0)?,
            given("voltage2", voltage2, 0.0)?,
            given("temperature", temperature, self.temperature_c)?,
        ];
        let Some(samples) = inputs.iter().find_map(Input::len) else {
            let volts = self.running.step(&inputs, 0);
            return Ok(PyFloat::new(py, volts).into_any());
        };
        if let Some(other) = inputs.iter().filter_map(Input::len).find(|len| *len != samples) {
            return Err(refused(format!(
                "arrays of {samples} and of {other} samples; give one number each or arrays of one length"
            )));
        }
        let running = &mut self.running;
        let volts: Vec<f64> = py.detach(|| (0..samples).map(|k| running.step(&inputs, k)).collect());
        Ok(volts.into_pyarray(py).into_any())
    }

    /// Back to rest at 0 V.
    fn reset(&mut self) {
        let temperature_c = self.temperature_c;
        match &mut self.running {
            Running::Single(running) => running.1 = running.0.rest(temperature_c as f32),
            Running::Double(running) => running.1 = running.0.rest(temperature_c),
        }
    }

    /// Samples that the reference comes before it is due.
    #[getter]
    fn ahead(&self) -> usize {
        match &self.running {
            Running::Single(running) => running.0.ahead(),
            Running::Double(running) => running.0.ahead(),
        }
    }

    /// `f32` or `f64`.
    #[getter]
    fn kind(&self) -> &'static str {
        match &self.running {
            Running::Single(_) => "f32",
            Running::Double(_) => "f64",
        }
    }

    /// Whether the last command met a limit.
    #[getter]
    fn limited(&self) -> bool {
        match &self.running {
            Running::Single(running) => running.1.limited(),
            Running::Double(running) => running.1.limited(),
        }
    }

    fn __repr__(&self) -> String {
        format!("Law in {}, reference {} samples ahead", self.kind(), self.ahead())
    }
}

impl Running {
    fn step(&mut self, inputs: &[Input; 4], sample: usize) -> f64 {
        match self {
            Self::Single(running) => f64::from(advance(&running.0, &mut running.1, inputs, sample)),
            Self::Double(running) => advance(&running.0, &mut running.1, inputs, sample),
        }
    }
}

fn advance<T: Real>(law: &DesignedLaw<T>, state: &mut DesignedState<T>, inputs: &[Input; 4], sample: usize) -> T {
    let [reference_ahead, measured, voltage2_ahead, temperature_c] =
        [0, 1, 2, 3].map(|input: usize| T::from_f64(inputs[input].at(sample)));
    law.step(
        state,
        LoopInput {
            reference_ahead,
            measured,
            voltage2_ahead,
            temperature_c,
            motion2_ahead: T::ZERO,
        },
    )
}

/// Designs a controller from a model, or from the records of `hysteron campaign`.
///
/// `reference` is `previewed` or `live`; `volts` the limits of the command; `rate_hz` the rate that it runs at; `along`
/// slow records from rest at 0 V that the inverse is fitted to as well; `margin` the largest peak of the sensitivity;
/// `rigid_hz` your word that there is no mode below. `beyond_records` lets it leave what the records cover.
#[pyfunction]
#[pyo3(signature = (source, *, reference="previewed", volts=None, rate_hz=None, along=None, margin=None, rigid_hz=None,
    beyond_records=false, open=false, progress=true))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn design(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    reference: &str,
    volts: Option<(f64, f64)>,
    rate_hz: Option<f64>,
    along: Option<&Bound<'_, Dataset>>,
    margin: Option<f64>,
    rigid_hz: Option<f64>,
    beyond_records: bool,
    open: bool,
    progress: bool,
) -> PyResult<Controller> {
    let volts = match volts {
        Some((low, high)) if !(low.is_finite() && high.is_finite() && low < high) => {
            return Err(refused(format!(
                "volts ({low}, {high}): two voltages, the lower first, such as (0, 200)"
            )));
        }
        given => given.map(|(low, high)| [low, high]),
    };
    let usual = Wishes::default();
    let wishes = Wishes {
        reference: word::<ReferenceKind>("reference", reference)?,
        volts,
        rate_hz,
        margin: margin.unwrap_or(usual.margin),
        rigid_hz,
        beyond_records,
        open,
        ..usual
    };
    let along: Vec<Record> = along.map_or_else(Vec::new, |along| along.borrow().data.records.clone());
    let answer = if let Ok(model) = source.cast::<Model>() {
        let model = Arc::clone(&model.get().model);
        run(py, "designing", progress, |_| {
            let source = Source::Model {
                model: &model,
                along: &along,
            };
            designed(&source, &wishes)
        })?
    } else {
        let data = Arc::clone(&source.cast::<Dataset>()?.borrow().data);
        run(py, "designing", progress, |_| {
            designed(&Source::Records(&data), &wishes)
        })?
    };
    let controller = answer.map_err(refused)?.controller;
    Ok(Controller { controller })
}
