//! The catalogue of effects, explained.

use crate::arrays::plain;
use crate::error::refused;
use hysteron_identify::EffectId;
use hysteron_identify::effects::{Description, Effect, UserEffect, catalogue};
use hysteron_identify::illustration::illustrate;
use hysteron_report::explanation::{explanation_text, paragraphs};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// An effect in words.
#[pyclass(module = "hysteron", frozen)]
pub(crate) struct Explanation {
    effect: Arc<dyn Effect>,
}

#[pymethods]
impl Explanation {
    /// Its name.
    #[getter]
    fn name(&self) -> &'static str {
        self.description().name
    }

    /// One sentence.
    #[getter]
    fn summary(&self) -> &'static str {
        self.description().summary
    }

    /// Title and text of each paragraph: equation, source, place in the chain, how it shows, what it is mistaken for.
    #[getter]
    fn paragraphs(&self) -> Vec<(&'static str, String)> {
        paragraphs(self.description()).into()
    }

    /// Its parameters, each with `name`, `unit` and `what`.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let parameters = self.description().parameters.iter();
        let parameters: Vec<BTreeMap<&str, &str>> = parameters
            .map(|p| BTreeMap::from([("name", p.name), ("unit", p.unit), ("what", p.what)]))
            .collect();
        plain(py, &parameters)
    }

    fn __repr__(&self) -> String {
        let text = explanation_text(self.description(), &illustrate(&self.effect));
        text.trim_end().to_owned()
    }
}

impl Explanation {
    fn description(&self) -> &'static Description {
        self.effect.description()
    }
}

/// Explains an effect of the catalogue, or of an effect file (ends with `.toml`).
#[pyfunction]
pub(crate) fn explain(effect: &str) -> PyResult<Explanation> {
    let effect = if effect.ends_with(".toml") {
        UserEffect::read(Path::new(effect)).map_err(refused)?.effect()
    } else {
        effect.parse::<EffectId>().map_err(refused)?.effect()
    };
    Ok(Explanation { effect })
}

/// The effects of the catalogue, from the command to the reading: name and summary.
#[pyfunction]
pub(crate) fn effects() -> Vec<(&'static str, &'static str)> {
    let described = catalogue().into_iter().map(|effect| effect.description());
    described.map(|d| (d.name, d.summary)).collect()
}
