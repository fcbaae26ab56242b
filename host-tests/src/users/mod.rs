//! Recordings as users make them, from stages that share nothing with the models or the simulated stage of the project.
//!
//! Families, effects and instruments are written here anew; of the project only the type of a dataset is used.

pub mod case;
mod elements;
pub mod hidden;
pub mod loops;
pub mod programme;
mod reference;
mod rig;
mod signals;
mod stage;

pub use case::{Case, Kind, Limits, Part, Spec, Truth};
pub use hidden::{Effect, Hidden, Outside};
pub use loops::Family;
pub use programme::Programme;
