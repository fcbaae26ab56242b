//! Fits the models of the core to records, and runs the fitted models on them.
//!
//! Data flows one way: a [`hysteron_data::Dataset`] goes into [`fit()`], a [`Model`] comes out; [`Model::simulate`] runs
//! it freely on a record. The operators and the arithmetic are those of `hysteron_core` in `f64`.
#![forbid(unsafe_code)]

pub mod add;
mod any_state;
mod basis;
mod by_hand;
mod chain;
mod chain_facts;
mod chain_trace;
mod columns;
pub mod control;
pub mod core_model;
mod cover;
pub mod covered;
pub mod error;
mod fading;
pub mod family;
pub mod fit;
pub mod grid;
mod history;
pub mod illustration;
pub mod initial;
pub mod lagged;
pub mod loop_opening;
pub mod loops;
pub mod model;
mod model_file;
mod moving_plays;
pub mod mpso;
mod normal;
pub mod objective;
pub mod period;
pub mod placement;
pub mod residual;
pub mod rivals;
pub mod search;
mod separable;
pub mod simplex;
mod simulate;
mod start_state;
mod uncertainty;

pub use add::{Added, Adding, add, add_held, check_own_effect, remove};
pub use by_hand::{Knob, KnobPart, Turned};
pub use chain_facts::facts;
pub use core_model::CoreModel;
pub use cover::{SmallSignalResponse, small_signal_response};
pub use covered::{Covered, SmallSignalBand};
pub use error::IdentifyError;
pub use family::{Direction, Family};
pub use fit::{FitOptions, FitReport, fit};
pub use history::{present_step, record_errors};
pub use hysteron_effects as effects;
pub use hysteron_effects::{EffectId, EffectName};
pub use loops::one_loop;
pub use model::{
    Change, FittedEffect, MOVED_BY_HAND, Method, Model, Parameter, RecordError, Simulation, Step, StepSubject,
};
pub use placement::Placement;
pub use search::Search;
pub use start_state::InitialState;
