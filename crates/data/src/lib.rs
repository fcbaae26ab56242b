//! Records with units and provenance; the only crate that knows file formats.
#![forbid(unsafe_code)]

pub mod record;

pub use record::{Dataset, Known, Notice, Record, Role};
