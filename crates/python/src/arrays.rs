//! Arrays of numpy in and out.

use crate::error::refused;
use numpy::ndarray::aview1;
use numpy::{AllowTypeChange, PyArray1, PyArrayLike1};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A column of numbers as Python code gives it: an array of any number type, a list, a column of a table.
pub(crate) type Column<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

/// Copies a column. `name` is its name in errors.
pub(crate) fn column(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let column: Column<'_> = given
        .extract()
        .map_err(|error: PyErr| refused(format!("{name}: one number a sample is wanted; {error}")))?;
    Ok(column.as_array().to_vec())
}

/// A column that may be absent.
pub(crate) fn some_column(name: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<f64>>> {
    given
        .filter(|given| !given.is_none())
        .map(|given| column(name, given))
        .transpose()
}

/// An array that reads memory of a Python object of ours without a copy; it cannot be written to.
///
/// `values` must belong to `owner`, which must never change or move them.
pub(crate) fn view<'py>(owner: Bound<'py, PyAny>, values: &[f64]) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let py = owner.py();
    #[expect(unsafe_code, reason = "numpy is told where memory of ours is")]
    // SAFETY: the array holds `owner`, and `values` lies in memory that `owner` holds and never changes (see above).
    let array = unsafe { PyArray1::borrow_from_array(&aview1(values), owner) };
    let read_only = PyDict::new(py);
    read_only.set_item(intern!(py, "write"), false)?;
    array.call_method(intern!(py, "setflags"), (), Some(&read_only))?;
    Ok(array)
}

/// An answer as Python's own dictionaries and lists: what `--json` prints.
pub(crate) fn plain<'py>(py: Python<'py>, answer: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(answer).map_err(refused)?;
    py.import("json")?.call_method1("loads", (text,))
}
