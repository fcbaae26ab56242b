//! The Python package `hysteron`: arrays in, models, verdicts and controllers out.
//!
//! Thin: each function converts, calls a library crate of ours, and converts back. Long work runs beside the interpreter,
//! see `work`. Python code on top (pictures, fleets) is in `python/hysteron`.

mod answers;
mod arrays;
mod control;
mod dataset;
mod error;
mod explain;
mod model;
mod read;
mod work;

use pyo3::prelude::*;

/// The compiled half of the package.
#[pymodule]
mod _hysteron {
    #[pymodule_export]
    use crate::answers::{Comparison, Diagnosis, Ladder, Learned, compare, diagnose, ladder, learn};
    #[pymodule_export]
    use crate::control::{Controller, Law, design};
    #[pymodule_export]
    use crate::dataset::{Dataset, Record};
    #[pymodule_export]
    use crate::error::Error;
    #[pymodule_export]
    use crate::explain::{Explanation, effects, explain};
    #[pymodule_export]
    use crate::model::{Model, add, fit};
    #[pymodule_export]
    use crate::read::{example, examples, read, simulate};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
