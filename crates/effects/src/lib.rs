//! The physical effects around the hysteresis: a folder an effect, a line of it in `list.rs`, its name an [`EffectId`].
//!
//! An [`Effect`] says what it is (for people), how it acts on the signals of a record (for fits) and how a controller undoes
//! it. A model is a chain of them: voltage, delay, amplifier, hysteresis, creep, structure, coupling and heat, sensor.
#![forbid(unsafe_code)]

#[macro_use]
mod list;

pub mod catalogue;
pub mod compensator;
pub mod effect;
mod effect_file;
pub mod error;
pub mod family;
pub mod id;
mod own;
mod restoring;
mod run;
pub mod series;

mod amplitude_gain;
mod asymmetry;
mod backlash;
mod creep;
mod cross_coupling;
mod delay;
mod first_order_lag;
mod friction;
mod hysteresis_shape;
mod mains_hum;
mod mode_hysteresis;
mod nonlinear_stiffness;
mod rate_dependence;
mod resonance;
mod saturation;
mod sensor_nonlinearity;
mod slew_limit;
mod thermal_drift;

pub use amplitude_gain::with_small_plays;
pub use catalogue::{catalogue, find};
pub use compensator::{Compensation, Compensator, CreepElement, StageMode};
pub use delay::late;
pub use effect::{
    Acts, Bounds, Changes, Description, Effect, Facts, Mark, Named, Place, RateLaw, Scene, Shape, Signals,
};
pub use effect_file::{EffectFile, FileParameter, FileState};
pub use error::{EffectError, InText};
pub use family::{Family, MAX_PLAYS};
pub use hysteresis_shape::FREE_SHAPE;
pub use id::{EffectId, EffectName, UnknownEffect};
pub use own::UserEffect;
pub use rate_dependence::OfFamily;
pub use series::rest;
