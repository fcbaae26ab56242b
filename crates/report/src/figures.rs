//! The pictures: each one function of plain slices and labels, and nothing where there is nothing to see.

mod bars;
mod error_map;
mod lines;
mod loop_plot;
mod overlay;
mod spectrum;

pub use bars::{Bar, bars};
pub use error_map::{ErrorMapData, error_map};
pub use lines::{Line, Lines, lines};
pub use loop_plot::{LoopData, loop_plot};
pub use overlay::{OverlayData, overlay};
pub use spectrum::{SpectrumData, spectrum};
