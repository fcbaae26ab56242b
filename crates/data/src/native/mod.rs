//! The native format, version 1: a folder with `dataset.toml` and one CSV a record.

mod append;
mod atomic;
mod dataset;
mod header;
mod manifest;
mod read;
mod write;

pub use append::append_records;
pub(crate) use atomic::Pending;
pub use dataset::{read_dataset, read_dataset_with_progress, write_dataset};
pub use manifest::{Entry, Manifest, parse_manifest};
pub(crate) use read::line_error;
pub use read::{clock_of, read_record, read_record_from, read_reference};
pub use write::{FIXED_DECIMALS, Overwrite, validate_record, write_record_csv, write_record_to};
