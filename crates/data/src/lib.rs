//! Records with units and provenance; the only crate that knows file formats.
//!
//! - [`record`]: what a recording is in memory
//! - [`import`]: recordings of other programs; [`export`]: tables for them
//! - [`native`]: the one native format, a folder with `dataset.toml` and CSVs; [`read_dataset`], [`write_dataset`]
#![forbid(unsafe_code)]

mod clock;
pub mod error;
pub mod export;
pub mod import;
mod lines;
pub mod native;
pub mod place;
pub mod record;
pub mod units;

pub use error::DataError;
pub use native::{
    Entry, Manifest, Overwrite, append_records, clock_of, read_dataset, read_dataset_with_progress, read_record,
    read_record_from, read_reference, validate_record, write_dataset, write_record_csv, write_record_to,
};
pub use record::{Dataset, Known, Notice, Record, Reference, Role};
