//! Answers as text for a terminal.

mod adapted;
pub mod amounts;
mod campaign;
mod comparison;
pub(crate) mod controller;
mod diagnosis;
pub mod explanation;
mod ladder;
mod law_table;
mod learned;
mod model;
mod tracked;

pub use adapted::{Runs, adapted_line, adapted_text, bounds_text};
pub use campaign::{came_back_text, misfit_text, records_text};
pub use comparison::comparison_text;
pub use controller::design_text;
pub use diagnosis::{diagnosis_details, diagnosis_text};
pub use ladder::{ladder_details, ladder_text};
pub use law_table::law_table_text;
pub use learned::learned_text;
pub use model::model_text;
pub use tracked::{beyond_text, reference_name, tracked_text};

/// Percent with three decimals, or two significant digits where these would all be zero.
fn percent(value: Option<f64>) -> String {
    value.map_or_else(
        || "-".to_owned(),
        |v| {
            if v > 0.0 && v < 0.000_95 {
                let decimals = (1 - v.log10().floor() as i32).max(3) as usize;
                format!("{v:.decimals$}")
            } else {
                format!("{v:.3}")
            }
        },
    )
}
