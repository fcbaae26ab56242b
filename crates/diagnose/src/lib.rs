//! Noise floor, comparison of model and measurement, where the model fails: numbers only; words and pictures are made
//! in the report and on the command line.
#![forbid(unsafe_code)]

mod breakdown;
pub mod compare;
pub mod comparison;
pub mod diagnosis;
mod error_map;
pub mod ladder;
pub mod learn;
mod learner;
mod missing;
mod region;
mod signature;
mod spectrum;
mod straight_line;
mod swing_map;

pub use compare::compare;
pub use comparison::{Bin, Breakdown, Comparison, ErrorMap, Pooled, RecordComparison, Series, Spectrum, SwingMap};
use hysteron_acquisition::noise;
pub use hysteron_acquisition::{Basis, NoiseFloor, NoiseSource};
pub use ladder::{Ladder, Rung, add, add_own, ladder};
pub use learn::{Attempt, Learned, Stop, learn, learn_from, learn_with};
pub use missing::{diagnose, diagnose_with};
pub use region::{GoesWith, Region, region};
pub use signature::{Fitted, Signature, signatures};
