//! The page of `hysteron explain`.

use super::{Explained, OnOwnData, fitted, verdict};
use hysteron_identify::effects::Description;
use hysteron_identify::illustration::Illustration;
use hysteron_report::explanation::{caption, paragraphs};
use hysteron_report::figures::{Line, Lines, LoopData, OverlayData, lines, loop_plot, overlay};
use hysteron_report::{Block, Cell, Figure, Ink, Page, Picture, Section, Size, Table, Tile, significant};

const WIDE: Size = Size {
    width: 1080,
    height: 400,
};
const SQUARE: Size = Size {
    width: 520,
    height: 400,
};

/// The page as HTML.
pub(super) fn page(explained: &Explained) -> String {
    let d = explained.description;
    let mut page = Page::new(d.name, env!("CARGO_PKG_VERSION")).lead(d.summary);
    let paragraphs = paragraphs(d);
    let facts = |range: std::ops::Range<usize>| {
        let named = paragraphs[range]
            .iter()
            .map(|(title, text)| ((*title).to_owned(), text.clone()));
        Block::Facts(named.collect())
    };
    page = page.section(
        Section::new("What it is")
            .with(facts(0..3))
            .with(Block::Table(parameters(explained))),
    );
    let mut shows = Section::new("How it shows").with(Block::Text(d.shows.to_owned()));
    match &explained.shown {
        Ok(shown) => {
            for block in pictures(shown) {
                shows = shows.with(block);
            }
        }
        Err(reason) => shows = shows.with(Block::Notices(vec![reason.clone()])),
    }
    page = page
        .section(shows)
        .section(Section::new("What it is mistaken for, and what to do").with(facts(4..7)));
    if let Some(own) = &explained.own {
        page = page.section(own_data(own, d));
    }
    page.render()
}

fn parameters(explained: &Explained) -> Table {
    let d = explained.description;
    let values = explained.shown.as_ref().map_or(&[][..], |shown| &shown.values);
    let mut table = Table::new(
        "Parameters",
        &["Parameter", "Unit", "In the pictures", "What it is, what is physical"],
    );
    for (i, p) in d.parameters.iter().enumerate() {
        table = table.row(vec![
            Cell::text(p.name),
            Cell::text(p.unit),
            Cell::number(values.get(i).copied()),
            Cell::text(p.what),
        ]);
    }
    table
}

fn pictures(shown: &Illustration) -> Vec<Block> {
    let time_s: Vec<f64> = (0..shown.voltage_v.len()).map(|k| k as f64 * shown.period_s).collect();
    let mut blocks = Vec::new();
    let series = |y: &[f64]| time_s.iter().copied().zip(y.iter().copied()).collect::<Vec<_>>();
    let pair = [
        Line {
            name: "with the effect".to_owned(),
            points: series(&shown.with_um),
            ink: Ink::Measured,
        },
        Line {
            name: "without".to_owned(),
            points: series(&shown.without_um),
            ink: Ink::Model,
        },
    ];
    let axes = |y_title, description| Lines {
        x_title: "time, s",
        y_title,
        x_log: false,
        y_log: false,
        description,
    };
    let over_time = lines(
        &pair,
        &axes("position, µm", "Position over time, with the effect and without."),
        WIDE,
    );
    if let Some(picture) = over_time {
        blocks.push(Block::Figure(Figure::new(picture, caption(shown))));
    }
    let left: Vec<f64> = shown
        .with_um
        .iter()
        .zip(&shown.without_um)
        .map(|(a, b)| 1e3 * (a - b))
        .collect();
    let left = [Line {
        name: "with minus without".to_owned(),
        points: series(&left),
        ink: Ink::Residual,
    }];
    let mut side_by_side = Vec::new();
    let residual = lines(
        &left,
        &axes("difference, nm", "What the effect adds to the position over time."),
        SQUARE,
    );
    if let Some(picture) = residual {
        side_by_side.push(Figure::new(
            picture,
            "What it adds: the residual of a model that has everything but this effect.",
        ));
    }
    if let Some(picture) = loop_picture(shown) {
        side_by_side.push(Figure::new(
            picture,
            "Position over voltage. “Measured” has the effect, the “model” has not.",
        ));
    }
    blocks.push(Block::Gallery(side_by_side));
    blocks
}

fn loop_picture(shown: &Illustration) -> Option<Picture> {
    let (input, input_name) = match &shown.voltage2_v {
        Some(voltage2_v) => (voltage2_v, "voltage of the other axis"),
        None => (&shown.voltage_v, "voltage"),
    };
    let data = LoopData {
        input,
        measured: &shown.with_um,
        modelled: &shown.without_um,
        input_name,
        input_unit: "V",
        output_name: "position",
        output_unit: "um",
        name: "with and without the effect",
    };
    loop_plot(&data, SQUARE)
}

fn own_data(own: &OnOwnData, d: &Description) -> Section {
    let (before, after) = (&own.added.before, &own.added.after);
    let mut tiles = Vec::new();
    for (label, before, after) in [
        (
            "Records it was fitted to",
            before.identify_percent,
            after.identify_percent,
        ),
        (
            "Records it was not fitted to",
            before.validate_percent,
            after.validate_percent,
        ),
    ] {
        if let (Some(before), Some(after)) = (before, after) {
            tiles.push(Tile {
                label: label.to_owned(),
                value: format!("{} → {} %", significant(before), significant(after)),
                note: "rms of peak to peak, without and with it".to_owned(),
            });
        }
    }
    let mut table = Table::new("Error, % of peak to peak", &["Record", "Role", "Without", "With it"]);
    for (before, after) in before.records.iter().zip(&after.records) {
        table = table.row(vec![
            Cell::text(&before.file),
            Cell::text(before.role.name()),
            Cell::number(before.percent),
            Cell::number(after.percent),
        ]);
    }
    let numbers = fitted(own, d)
        .iter()
        .map(|p| (p.name.clone(), format!("{} {}", significant(p.value), p.unit)));
    let mut section = Section::new(format!("On your records: {}", own.dataset.name))
        .with(Block::Tiles(tiles))
        .with(Block::Text(verdict(own)))
        .with(Block::Facts(numbers.collect()))
        .with(Block::Table(table));
    if let Some(record) = most_changed(own) {
        for (model, what) in [(&own.before, "without the effect"), (&own.added.model, "with it")] {
            let modelled = model.simulate(record).output;
            let data = OverlayData {
                start_s: record.start_s,
                period_s: record.period_s,
                measured: &record.position_um,
                modelled: &modelled,
                output: "position",
                unit: "um",
                noise_rms: 0.0,
                name: &record.file,
            };
            section = section.with_picture(overlay(&data, WIDE), format!("{}, the model {what}.", record.file));
        }
    }
    section
}

/// The record whose error changes most.
fn most_changed(own: &OnOwnData) -> Option<&hysteron_data::Record> {
    let change = |(before, after): &(&hysteron_identify::RecordError, &hysteron_identify::RecordError)| {
        (before.rms - after.rms).abs()
    };
    let (before, _) = own
        .added
        .before
        .records
        .iter()
        .zip(&own.added.after.records)
        .max_by(|a, b| change(a).total_cmp(&change(b)))?;
    own.dataset.records.iter().find(|record| record.file == before.file)
}
