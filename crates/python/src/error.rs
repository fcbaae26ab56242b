//! Errors of the libraries as exceptions, with the same words as on the command line.

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::{Error as WordError, StrDeserializer};

create_exception!(
    hysteron,
    Error,
    PyValueError,
    "Bad input: the message says what, which value, what is allowed, and what to do."
);

/// An error of a library as an exception.
pub(crate) fn refused(error: impl std::fmt::Display) -> PyErr {
    Error::new_err(error.to_string())
}

/// An option whose values are words, as files and the command line spell them.
pub(crate) fn word<'a, T: Deserialize<'a>>(option: &str, given: &'a str) -> PyResult<T> {
    let reader: StrDeserializer<'a, WordError> = given.into_deserializer();
    T::deserialize(reader).map_err(|error| refused(format!("{option}: {error}")))
}
