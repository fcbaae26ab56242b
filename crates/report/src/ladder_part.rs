//! The part of a page that says how the error fell, step by step.

use hysteron_identify::{Change, Model, Step};

use crate::canvas::{LegendEntry, Swatch};
use crate::diagnosis_words::effect_name;
use crate::figures::{Bar, bars};
use crate::number::percent;
use crate::page::{Block, Section};
use crate::palette::Ink;
use crate::table::{Cell, Table};

/// The section of a model's history; empty where nothing was added to it.
pub(crate) fn section(model: &Model) -> Section {
    let steps = &model.history;
    let judged = steps.iter().all(|step| step.validate_percent.is_some());
    let (ink, told) = if judged {
        (Ink::Validate, "records not fitted to")
    } else {
        (Ink::Identify, "records fitted to")
    };
    let rows: Vec<Bar> = steps
        .iter()
        .filter_map(|step| {
            let value = if judged {
                step.validate_percent
            } else {
                step.identify_percent
            }?;
            Some(Bar {
                label: name(step),
                value,
                text: percent(value),
                reference: None,
                ink,
            })
        })
        .collect();
    let table = steps.iter().fold(
        Table::new("The steps", &["Step", "Fitted to, % p-p", "Not fitted to, % p-p"]),
        |table, step| {
            table.row(vec![
                Cell::text(name(step)),
                Cell::number(step.identify_percent),
                Cell::number(step.validate_percent),
            ])
        },
    );
    Section::new("How the error fell")
        .with_picture(
            bars(
                &rows,
                "error, % of peak to peak",
                vec![LegendEntry::new(told, ink, Swatch::Bar)],
                1080,
            ),
            "Pooled error after each step; every step fits all parameters anew.",
        )
        .with(Block::Table(table))
}

fn name(step: &Step) -> String {
    match step.change {
        Change::Fitted => step.what.clone(),
        Change::Added => format!("+ {}", effect_name(&step.what, false)),
        Change::Removed => format!("− {}", effect_name(&step.what, false)),
    }
}
