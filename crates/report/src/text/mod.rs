//! Answers as text for a terminal.

mod comparison;
mod diagnosis;
pub mod explanation;
mod ladder;
mod learned;
mod model;

pub use comparison::comparison_text;
pub use diagnosis::diagnosis_text;
use hysteron_data::Role;
pub use ladder::ladder_text;
pub use learned::learned_text;
pub use model::model_text;

fn role(role: Role) -> &'static str {
    match role {
        Role::Identify => "identify",
        Role::Validate => "validate",
    }
}
