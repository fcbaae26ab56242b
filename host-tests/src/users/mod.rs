//! Recordings as users make them, from stages that share nothing with the models or the simulated stage of the project; and the score of
//! the tool on them.
//!
//! Families, effects and instruments are written here anew; of the project only the type of a dataset is used. Only `tool` calls what
//! is measured.

pub mod case;
pub(crate) mod elements;
pub mod harmless;
pub mod hidden;
pub mod loops;
pub mod practice;
pub mod programme;
mod reference;
pub(crate) mod rig;
pub mod score;
mod signals;
pub(crate) mod stage;
pub mod statistics;
pub mod tables;
pub mod tool;

pub use case::{Case, Kind, Limits, Part, Spec, Truth};
pub use hidden::{Effect, Hidden, Outside};
pub use loops::Family;
pub use programme::Programme;
