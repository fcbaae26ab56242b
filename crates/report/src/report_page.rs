//! The page that `report` leaves: everything there is to say of one model on one dataset, frozen into one file.

use hysteron_diagnose::Comparison;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_identify::Model;

use crate::comparison_page::{Context, reproduce, sections};
use crate::diagnosis_words::verdict_sentence;
use crate::headline::headline;
use crate::number::{significant, unit_text};
use crate::page::{Block, Page, Section};
use crate::table::{Cell, Table};
use crate::{diagnosis_part, ladder_page};

/// What a report is made of.
#[derive(Debug, Clone, Copy)]
pub struct Findings<'a> {
    /// The model.
    pub model: &'a Model,
    /// How far off it is, and where.
    pub comparison: &'a Comparison,
    /// Which effect is missing; nothing for an inverse model.
    pub diagnosis: Option<&'a Diagnosis>,
    /// Files that went in with their SHA-256, in the order of the dataset.
    pub hashes: &'a [(String, String)],
}

/// The report as HTML: comparison, diagnosis, ladder, parameters, hashes and commands.
pub fn report_page(title: &str, findings: &Findings<'_>, context: &Context<'_>) -> String {
    let mut page = Page::new(title, context.version);
    for (name, value) in context.facts {
        page = page.fact(*name, value);
    }
    for sentence in headline(findings.comparison) {
        page = page.lead(sentence);
    }
    let [summary, by_record, where_it_is, pictures] = sections(findings.comparison);
    page = page.section(summary);
    if let Some(diagnosis) = findings.diagnosis {
        page = page
            .lead(verdict_sentence(diagnosis))
            .section(diagnosis_part::section(diagnosis, &[]));
    }
    // One step is no ladder.
    if let Some(ladder) = hysteron_diagnose::ladder(findings.model).filter(|ladder| ladder.steps.len() > 1) {
        page = page.section(ladder_page::steps(&ladder));
    }
    page.section(by_record)
        .section(where_it_is)
        .section(pictures)
        .section(parameters(findings.model))
        .section(reproduce(context).with(Block::Details(
            "Files that went in".to_owned(),
            vec![hashes(findings.hashes)],
        )))
        .render()
}

fn parameters(model: &Model) -> Section {
    let columns = ["Parameter", "Value", "Std. error", "Unit"];
    let row = |table: Table, name: String, value: f64, error: Option<f64>, unit: &str| {
        table.row(vec![
            Cell::text(name),
            Cell::number(value),
            error.map_or_else(|| Cell::Number("undetermined".to_owned()), Cell::number),
            Cell::text(unit_text(unit)),
        ])
    };
    let caption = format!(
        "{} with {} {}",
        model.family,
        model.thresholds.len(),
        model.family.elements()
    );
    let mut table = Table::new(caption, &columns);
    for p in model.parameters() {
        table = row(table, p.name, p.value, p.standard_error, &p.unit);
    }
    for effect in &model.effects {
        for p in &effect.parameters {
            table = row(
                table,
                format!("{}: {}", effect.name, p.name),
                p.value,
                p.standard_error,
                &p.unit,
            );
        }
    }
    let thresholds: Vec<String> = model.thresholds.iter().map(|&r| significant(r)).collect();
    Section::new("The model")
        .with(Block::Facts(vec![
            (
                format!(
                    "{}s, {}",
                    model.family.of_an_element(),
                    unit_text(model.direction.input_unit())
                ),
                thresholds.join(", "),
            ),
            (
                "fitted between".to_owned(),
                format!(
                    "{} and {} {}",
                    significant(model.input_min),
                    significant(model.input_max),
                    unit_text(model.direction.input_unit())
                ),
            ),
        ]))
        .with(Block::Notices(model.notices.clone()))
        .with(Block::Details("Parameters".to_owned(), vec![Block::Table(table)]))
}

fn hashes(hashes: &[(String, String)]) -> Block {
    Block::Table(
        hashes
            .iter()
            .fold(Table::new("SHA-256", &["File", "SHA-256"]), |table, (file, hash)| {
                table.row(vec![Cell::text(file), Cell::text(hash)])
            }),
    )
}
