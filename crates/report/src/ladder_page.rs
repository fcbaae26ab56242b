//! The page that `ladder` leaves: how the error fell, step by step, down to the noise floor.

use hysteron_data::Role;
use hysteron_diagnose::{Ladder, Rung};

use crate::canvas::{LegendEntry, Size, Swatch};
use crate::comparison_page::Context;
use crate::figures::{Bar, Line, Lines, bars, lines};
use crate::number::{percent as percent_text, quantity, significant};
use crate::page::{Block, Figure, Page, Section, Tile};
use crate::palette::Ink;
use crate::table::{Cell, Table};

/// Series that are told apart by colour.
const SERIES: usize = 6;

/// The page of a ladder as HTML.
pub fn ladder_page(ladder: &Ladder, context: &Context<'_>) -> String {
    let mut page = Page::new(format!("How the error on {} fell", ladder.dataset), context.version);
    for (name, value) in context.facts {
        page = page.fact(*name, value);
    }
    if let Some(sentence) = headline(ladder) {
        page = page.lead(sentence);
    }
    page.section(summary(ladder))
        .section(steps(ladder))
        .section(by_record(ladder))
        .section(
            Section::new("How this was made")
                .with(Block::Text(
                    "Every step fits all parameters anew to the records with role identify; the model then runs freely \
                     through each record. Percent of peak to peak is the root mean square of measured minus modelled \
                     over the peak to peak of the measured output, pooled over records as root mean square."
                        .to_owned(),
                ))
                .with(Block::Command(context.command.to_owned())),
        )
        .render()
}

/// Whether steps are judged on validation records.
fn judged(ladder: &Ladder) -> bool {
    ladder.steps.iter().all(|rung| rung.step.validate_percent.is_some())
}

fn headline(ladder: &Ladder) -> Option<String> {
    let (first, last) = (ladder.steps.first()?.percent()?, ladder.steps.last()?);
    let on = if judged(ladder) {
        "On records it was not fitted to"
    } else {
        "On the records it was fitted to"
    };
    let verb = if last.percent()? < first {
        "fell"
    } else {
        "did not fall: it went"
    };
    let mut sentence = format!(
        "{on}, the error {verb} from {} to {} of peak to peak",
        percent_text(first),
        percent_text(last.percent()?)
    );
    if let Some(times) = last.times_noise {
        sentence.push_str(&format!("; the noise floor is {} times lower", significant(times)));
    }
    sentence.push('.');
    Some(sentence)
}

fn summary(ladder: &Ladder) -> Section {
    let mut tiles = Vec::new();
    for (label, rung) in [("First step", ladder.steps.first()), ("Last step", ladder.steps.last())] {
        if let Some((rung, percent)) = rung.and_then(|rung| Some((rung, rung.percent()?))) {
            tiles.push(Tile {
                label: label.to_owned(),
                value: percent_text(percent),
                note: format!("of peak to peak, {}", rung.name()),
            });
        }
    }
    if let (Some(noise), Some(percent)) = (&ladder.noise, ladder.noise_percent()) {
        tiles.push(Tile {
            label: "Noise floor".to_owned(),
            value: percent_text(percent),
            note: format!(
                "of peak to peak, {} rms, {}",
                quantity(noise.rms_um, "um"),
                noise.basis_in_words()
            ),
        });
    }
    Section::new("Summary").with(Block::Tiles(tiles))
}

/// Bars of the pooled errors, and the table.
pub(crate) fn steps(ladder: &Ladder) -> Section {
    let judged = judged(ladder);
    let (ink, told) = if judged {
        (Ink::Validate, "error, records not fitted to")
    } else {
        (Ink::Identify, "error, records fitted to")
    };
    let rows: Vec<Bar> = ladder
        .steps
        .iter()
        .filter_map(|rung| {
            let percent = rung.percent()?;
            Some(Bar {
                label: rung.name(),
                value: percent,
                text: percent_text(percent),
                reference: ladder.noise_percent(),
                ink,
            })
        })
        .collect();
    let mut legend = vec![LegendEntry::new(told, ink, Swatch::Bar)];
    if ladder.noise_percent().is_some() {
        legend.push(LegendEntry::new("noise floor", Ink::Text, Swatch::Stroke));
    }
    let columns = [
        "Step",
        "Fitted to, % p-p",
        "Not fitted to, % p-p",
        "Of the step before",
        "Over noise",
    ];
    let table = ladder
        .steps
        .iter()
        .fold(Table::new("The steps", &columns), |table, rung| {
            table.row(vec![
                Cell::text(rung.name()),
                Cell::number(rung.step.identify_percent),
                Cell::number(rung.step.validate_percent),
                Cell::number(rung.of_before),
                Cell::number(rung.times_noise),
            ])
        });
    Section::new("How the error fell, step by step")
        .with_picture(
            bars(&rows, "error, % of peak to peak", legend, 1080),
            "Pooled error after each step. The part of the last bar beyond the black mark is unexplained.",
        )
        .with(Block::Table(table))
}

/// Each record's error over the steps.
fn by_record(ladder: &Ladder) -> Section {
    let Some(last) = ladder.steps.last() else {
        return Section::new("Record by record");
    };
    let names: Vec<String> = ladder.steps.iter().map(Rung::name).collect();
    let mut columns = vec!["Record", "Role"];
    columns.extend(names.iter().map(String::as_str));
    let mut table = Table::new("Error, % of peak to peak", &columns);
    let (judged, mut series) = (judged(ladder), Vec::new());
    for (i, record) in last.step.records.iter().enumerate() {
        let errors: Vec<Option<f64>> = ladder
            .steps
            .iter()
            .map(|rung| {
                let there = rung.step.records.get(i).filter(|r| r.file == record.file);
                there.and_then(|r| r.percent)
            })
            .collect();
        let mut cells = vec![Cell::text(&record.file), Cell::text(record.role.name())];
        cells.extend(errors.iter().map(|&error| Cell::number(error)));
        table = table.row(cells);
        let shown = !judged || record.role == Role::Validate;
        if shown && series.len() < SERIES && errors.iter().any(Option::is_some) {
            let points = errors.iter().enumerate();
            series.push(Line {
                name: record.file.clone(),
                points: points.filter_map(|(k, e)| Some(((k + 1) as f64, (*e)?))).collect(),
                ink: Ink::Series(series.len()),
            });
        }
    }
    let axes = Lines {
        x_title: "step",
        y_title: "error, % of peak to peak",
        x_log: false,
        y_log: true,
        description: "Error of single records after each step",
    };
    let size = Size {
        width: 1080,
        height: 320,
    };
    let left_out = if judged { "Records not fitted to" } else { "Records" };
    let caption = format!(
        "{left_out}, the first {} of them; the step's number is its line in the table above. A step that helps one record \
         and harms another shows here.",
        series.len()
    );
    Section::new("Record by record")
        .with(
            lines(&series, &axes, size).map_or(Block::Text(String::new()), |picture| {
                Block::Figure(Figure::new(picture, caption))
            }),
        )
        .with(Block::Table(table))
}
