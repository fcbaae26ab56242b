//! Noise floor, comparison of model and measurement, where the model fails: numbers only; words and pictures are made
//! in the report and on the command line.
#![forbid(unsafe_code)]

mod bends;
mod breakdown;
pub mod by_hand;
pub mod compare;
pub mod comparison;
mod departure;
mod diagnose;
pub mod diagnosis;
mod error_map;
pub mod evidence;
mod investigation;
pub mod ladder;
pub mod learn;
mod next_record;
pub mod odds;
mod reasons;
mod region;
pub mod rules;
mod signature;
mod spectrum;
mod straight_line;
mod swing_map;
mod told;
pub mod verdict;
mod witness;

pub use by_hand::{ByHand, Played, Start};
pub use compare::compare;
pub use comparison::{
    Bin, Breakdown, Comparison, ErrorMap, Pooled, RecordComparison, Series, Spectrum, Stretch, SwingMap,
};
pub use diagnose::{diagnose, diagnose_with, examine};
use hysteron_acquisition::noise;
pub use hysteron_acquisition::{Basis, Finding, Kind, NoiseFloor, NoiseSource};
pub use ladder::{Ladder, Rung, add, add_own, ladder};
pub use learn::{Attempt, Learned, Stop, learn, learn_from, learn_with};
pub use region::{GoesWith, Region, region};
pub use signature::{Fitted, Signature, signatures};
pub use spectrum::{density, of_record};
pub use told::{Told, told};
