//! From records to a controller: the commands to record, the chain identified, the law designed, its runs on a model or in a process.
//!
//! Data flows one way: records of a [`campaign`] become a chain (`hysteron_identify::control`), [`design`] undoes it, [`drive`],
//! [`on_model`] and [`process`] run the law, [`figures`] and [`response`] judge the run, [`export`] makes the firmware's table. The law is
//! the code that runs on the chip.
#![forbid(unsafe_code)]

pub mod adapted;
pub mod campaign;
pub mod commands;
pub mod design;
pub mod drive;
pub mod error;
pub mod expected;
pub mod export;
pub mod figures;
pub mod learning;
pub mod message;
pub mod on_model;
pub mod plan;
pub mod process;
pub mod reference;
pub mod response;
pub mod usable;

pub use error::ControlError;
