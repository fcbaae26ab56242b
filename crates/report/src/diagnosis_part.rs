//! The part of a page that says which effect is missing.

use hysteron_diagnose::Signature;
use hysteron_diagnose::diagnosis::{Diagnosis, Level, RankedEffect};

use crate::canvas::{LegendEntry, Size, Swatch};
use crate::diagnosis_words::{diagnosis_lines, effect_name, verdict_sentence};
use crate::equation::equation;
use crate::figures::{Bar, Line, Lines, bars, lines};
use crate::lock_words::failing_lines;
use crate::number::{percent, readable_unit, significant};
use crate::page::{Block, Figure, Section, Tile};
use crate::palette::Ink;
use crate::table::{Cell, Table};

/// The section of a diagnosis: verdict, candidates, the effects found in words and those that were added to the data in pictures, the
/// record to take next.
pub(crate) fn section(diagnosis: &Diagnosis, signatures: &[Signature]) -> Section {
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
    for effect in &diagnosis.ranking {
        let signature = signatures.iter().find(|one| one.effect == effect.effect);
        if effect.significant || signature.is_some() {
            section = section.with(card(diagnosis, effect, signature));
        }
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
            label: effect_name(effect.effect.as_str(), false),
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
                Cell::text(effect_name(effect.effect.as_str(), false)),
                Cell::text(match effect.level {
                    Level::Physical => "physical",
                    Level::Shape => "shape of the loops",
                }),
                Cell::number(effect.errors.identify_percent),
                Cell::number(effect.errors.validate_percent),
                Cell::number(effect.statistic),
                Cell::number(effect.threshold),
                Cell::number(100.0 * effect.share),
                Cell::text(if effect.significant { "yes" } else { "no" }),
            ])
        })
}

/// An effect in words, with what was fitted, and what it does to the data.
fn card(diagnosis: &Diagnosis, effect: &RankedEffect, signature: Option<&Signature>) -> Block {
    let fact = |name: &str, value: f64, error: Option<f64>, unit: &str| {
        let (factor, unit) = readable_unit(unit, value.abs());
        let error = error.map_or(String::new(), |error| format!(" ± {}", significant(factor * error)));
        (
            name.replace('_', " "),
            format!("{}{error} {unit}", significant(factor * value)),
        )
    };
    let mut facts: Vec<(String, String)> = match signature {
        Some(signature) => {
            let fitted = signature.parameters.iter();
            fitted
                .map(|p| fact(&p.name, p.value, p.standard_error, &p.unit))
                .collect()
        }
        None => {
            let tried = effect.parameters.iter();
            tried.map(|p| fact(&p.name, p.value, None, &p.unit)).collect()
        }
    };
    if let Some(known) = effect.effect.id() {
        let known = known.effect();
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
    let counts = if effect.significant {
        "Significant, and large enough to matter.".to_owned()
    } else if diagnosis.further.contains(&effect.effect) {
        let first = effect_name(diagnosis.verdict.as_str(), false);
        format!("Counts once {first} is in the model: add that first, then this.")
    } else {
        "Does not count: not significant, too small to matter, or another explains the same better.".to_owned()
    };
    let mut blocks = vec![Block::Text(counts)];
    blocks.extend(signature.and_then(picture).map(Block::Figure));
    blocks.push(Block::Facts(facts));
    Block::Group(effect_name(effect.effect.as_str(), true), blocks)
}

/// The error of one record without an effect and with it.
fn picture(signature: &Signature) -> Option<Figure> {
    let errors = signature.without.iter().chain(&signature.with);
    let (factor, unit) = readable_unit("um", errors.fold(0.0, |largest, e| largest.max(e.abs())));
    let length_s = signature.time_s.last()? - signature.time_s.first()?;
    let (time_factor, time_unit) = readable_unit("s", length_s);
    let line = |name: &str, errors: &[f64], ink: Ink| Line {
        name: name.to_owned(),
        points: (signature.time_s.iter().zip(errors))
            .map(|(t, e)| (time_factor * t, factor * e))
            .collect(),
        ink,
    };
    let series = [
        line("without it", &signature.without, Ink::Noise),
        line("with it, everything fitted anew", &signature.with, Ink::Residual),
    ];
    let axes = Lines {
        x_title: &format!("time, {time_unit}"),
        y_title: &format!("measured − model, {unit}"),
        x_log: false,
        y_log: false,
        description: &format!("Error in {} without {} and with it.", signature.file, signature.effect),
    };
    let size = Size {
        width: 1080,
        height: 260,
    };
    let mut caption = format!("{}, where it takes most of the squared error.", signature.file);
    if let Some(error) = signature.validate_percent {
        caption += &format!(
            " Once added, records not fitted to are off by {} of peak to peak.",
            percent(error)
        );
    }
    lines(&series, &axes, size).map(|drawn| Figure::new(drawn, caption))
}
