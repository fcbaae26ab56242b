//! The simulated stage of the paper's section 4.1: physics written separately from the models that are fitted to it.
//!
//! A [`StageConfig`] lists the effects with their physical parameters; a [`Stage`] plays commands on it, sample by sample
//! ([`Stage::step`], for closed loops) or record by record ([`Stage::run`]). [`preset`] has ready-made stages, `hysteron_excitation` has commands to play.

#![forbid(unsafe_code)]

mod amplifier;
mod asymmetry;
pub mod calibration;
mod chain;
pub mod challenge;
mod config;
mod contact;
mod converter;
mod coupling;
mod creep;
mod delay;
mod error;
mod hum;
pub mod hysteresis;
mod linear;
pub mod opening;
pub mod preset;
mod rate;
mod sensor;
mod stage;
mod structure;
mod thermal;

pub use amplifier::{Amplifier, CurrentLimit};
pub use asymmetry::Asymmetry;
pub use config::{Hold, StageConfig};
pub use contact::{Backlash, EndStop};
pub use converter::Converter;
pub use coupling::CrossCoupling;
pub use creep::{Creep, KelvinVoigtElement};
pub use error::StageError;
pub use hum::MainsHum;
pub use hysteresis::{AmplitudeGain, Family, Hysteresis, Initial};
pub use rate::RateDependence;
pub use sensor::{Sensor, SensorNonlinearity};
pub use stage::{Run, Sample, Stage};
pub use structure::Mode;
pub use thermal::{Temperature, ThermalDrift};
