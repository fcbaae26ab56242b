//! The page that `diagnose` leaves: which effect is missing, with a picture of what each of the first candidates does to the data.

use hysteron_diagnose::Signature;
use hysteron_diagnose::diagnosis::Diagnosis;

use crate::comparison_page::Context;
use crate::diagnosis_part::section;
use crate::page::{Block, Page, Section};

/// The page of a diagnosis as HTML.
pub fn diagnosis_page(title: &str, diagnosis: &Diagnosis, signatures: &[Signature], context: &Context<'_>) -> String {
    let mut page = Page::new(title, context.version);
    for (name, value) in context.facts {
        page = page.fact(*name, value);
    }
    page.section(section(diagnosis, signatures))
        .section(
            Section::new("How this was made")
                .with(Block::Text(
                    "Each candidate is fitted in its place in the chain together with everything else and judged on records it was \
                     not fitted to. For the pictures the first candidates are added to the model itself."
                        .to_owned(),
                ))
                .with(Block::Command(context.command.to_owned())),
        )
        .render()
}
