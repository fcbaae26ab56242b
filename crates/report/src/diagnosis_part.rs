//! The part of a page that says which effect is missing.

use hysteron_diagnose::diagnosis::{Diagnosis, Level, RankedEffect};
use hysteron_identify::effects;

use crate::canvas::{LegendEntry, Swatch};
use crate::diagnosis_words::{diagnosis_lines, effect_name, verdict_sentence};
use crate::equation::equation;
use crate::figures::{Bar, bars};
use crate::lock_words::failing_lines;
use crate::number::{percent, significant, unit_text};
use crate::page::{Block, Figure, Section, Tile};
use crate::palette::Ink;
use crate::table::{Cell, Table};

/// The section of a diagnosis: verdict, candidates, the effects found in words, the record to take next.
pub(crate) fn section(diagnosis: &Diagnosis) -> Section {
    let mut section = Section::new("Which effect is missing")
        .with(Block::Text(verdict_sentence(diagnosis)))
        .with(Block::Tiles(tiles(diagnosis)));
    section = failing_lines(diagnosis)
        .into_iter()
        .fold(section, |section, line| section.with(Block::Text(line)));
    let lines = diagnosis_lines(diagnosis);
    section = if diagnosis.cannot_answer.is_empty() {
        lines
            .into_iter()
            .fold(section, |section, line| section.with(Block::Text(line)))
    } else {
        section.with(Block::Notices(lines))
    };
    if let Some(figure) = shares(&diagnosis.ranking) {
        section = section.with(Block::Figure(figure));
    }
    section = section.with(Block::Table(table(diagnosis)));
    for effect in diagnosis.ranking.iter().filter(|effect| effect.significant) {
        section = section.with(card(effect));
    }
    section.with(Block::Text(
        "How often such a verdict is right was counted on simulated stages only: take it as a hint, and take the record it asks for.".to_owned(),
    ))
}

fn tiles(diagnosis: &Diagnosis) -> Vec<Tile> {
    let tile = |label: &str, value: Option<f64>, note: &str| {
        value.map(|value| Tile {
            label: label.to_owned(),
            value: percent(value),
            note: note.to_owned(),
        })
    };
    let unexplained = &diagnosis.unexplained;
    [
        tile(
            "The model",
            diagnosis.before.validate_percent,
            "of peak to peak, records not fitted to",
        ),
        tile(
            if diagnosis.shape_determined {
                "A hysteresis of free shape instead"
            } else {
                "Its plays, fitted anew"
            },
            diagnosis.free_shape.validate_percent,
            "of peak to peak, records not fitted to",
        ),
        tile(
            "Left unexplained",
            Some(unexplained.percent),
            "of peak to peak, all records that move",
        ),
        tile("Of this, noise", Some(unexplained.noise_percent), "of peak to peak"),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn shares(ranking: &[RankedEffect]) -> Option<Figure> {
    let rows: Vec<Bar> = ranking
        .iter()
        .filter(|effect| effect.share.is_finite() && effect.share >= 0.0)
        .map(|effect| Bar {
            label: effect_name(&effect.effect, false),
            value: 100.0 * effect.share,
            text: format!("{:.0}\u{a0}%", 100.0 * effect.share),
            reference: None,
            ink: if effect.significant { Ink::Validate } else { Ink::Noise },
        })
        .collect();
    let legend = vec![
        LegendEntry::new("significant and large enough to matter", Ink::Validate, Swatch::Bar),
        LegendEntry::new("not", Ink::Noise, Swatch::Bar),
    ];
    let picture = bars(&rows, "share of the squared error it takes away, %", legend, 1080)?;
    Some(Figure::new(
        picture,
        "Each effect of the catalogue, fitted in its place together with everything else.",
    ))
}

fn table(diagnosis: &Diagnosis) -> Table {
    let beside = if diagnosis.shape_determined {
        "a hysteresis of free shape"
    } else {
        "the plays fitted anew"
    };
    let columns = [
        "Candidate",
        "Kind",
        "Fitted to, % p-p",
        "Not fitted to, % p-p",
        "Statistic",
        "Must exceed",
        "Share, %",
        "Counts",
    ];
    let title = format!("The candidates, best first, each together with {beside}");
    diagnosis
        .ranking
        .iter()
        .fold(Table::new(&title, &columns), |table, effect| {
            table.row(vec![
                Cell::text(effect_name(&effect.effect, false)),
                Cell::text(match effect.level {
                    Level::Physical => "physical",
                    Level::Shape => "shape of the loops",
                }),
                Cell::number(effect.identify_percent),
                // Without such records there is no error on them.
                Cell::number(diagnosis.before.validate_percent.map(|_| effect.validate_percent)),
                Cell::number(effect.statistic),
                Cell::number(effect.threshold),
                Cell::number(100.0 * effect.share),
                Cell::text(if effect.significant { "yes" } else { "no" }),
            ])
        })
}

/// An effect in words, with what was fitted.
fn card(effect: &RankedEffect) -> Block {
    let mut facts: Vec<(String, String)> = effect
        .parameters
        .iter()
        .map(|p| {
            (
                p.name.replace('_', " "),
                format!("{} {}", significant(p.value), unit_text(&p.unit)),
            )
        })
        .collect();
    if let Some(known) = effects::find(&effect.effect) {
        let words = known.description();
        facts.extend([
            ("what it is".to_owned(), words.summary.to_owned()),
            ("equation".to_owned(), equation(words.equation)),
            ("how it shows".to_owned(), words.shows.to_owned()),
            ("mistaken for".to_owned(), words.mistaken_for.to_owned()),
            ("separated by".to_owned(), words.separated_by.to_owned()),
            ("compensated by".to_owned(), words.compensated_by.to_owned()),
        ]);
    }
    Block::Group(effect_name(&effect.effect, true), vec![Block::Facts(facts)])
}
