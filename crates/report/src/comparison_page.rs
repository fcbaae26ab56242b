//! The page that `compare` leaves: how far the model is off, where, and what it looks like.

use hysteron_data::Role;
use hysteron_diagnose::{Bin, Breakdown, Comparison, Pooled, RecordComparison};

use crate::canvas::{LegendEntry, Size, Swatch};
use crate::figures::{Bar, ErrorMapData, SpectrumData, bars, error_map, spectrum};
use crate::headline::{direction, headline, quantity_name, range};
use crate::number::{count, percent as percent_text, quantity, readable_unit, signed, unit_text};
use crate::page::{Block, Figure, Page, Section, Tile};
use crate::palette::Ink;
use crate::record_pictures::record_pictures;
use crate::table::{Cell, Table};

/// What a comparison page says besides the comparison.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a> {
    /// What was compared, name and value: data, model, hashes.
    pub facts: &'a [(&'a str, String)],
    /// The command that gives the same page.
    pub command: &'a str,
    /// Version of the program.
    pub version: &'a str,
}

/// Share of the error or of the samples, percent, from which a bin has a bar; the table has all.
const SHOWN_PERCENT: f64 = 0.5;
/// Bars of records drawn at most; the table has all.
const BARS: usize = 40;

/// The page of a comparison as HTML.
pub fn comparison_page(title: &str, comparison: &Comparison, context: &Context<'_>) -> String {
    let mut page = Page::new(title, context.version);
    for (name, value) in context.facts {
        page = page.fact(*name, value);
    }
    for sentence in headline(comparison) {
        page = page.lead(sentence);
    }
    for section in sections(comparison) {
        page = page.section(section);
    }
    page.section(reproduce(context)).render()
}

/// The parts of a comparison: key figures, records, where the error is, pictures.
pub(crate) fn sections(comparison: &Comparison) -> [Section; 4] {
    let pictures = record_pictures(comparison)
        .into_iter()
        .fold(Section::new("Records"), Section::with);
    [
        summary(comparison),
        by_record(comparison),
        where_it_is(comparison),
        pictures,
    ]
}

/// A remark as a sentence; the first letter is left as it is where it begins a name, such as a file's.
pub(crate) fn sentence_case(text: &str) -> String {
    let text = text.trim_end_matches('.');
    let first_word = text.split(' ').next().unwrap_or("");
    let mut characters = text.chars();
    match characters.next() {
        Some(first) if first_word.chars().all(char::is_alphabetic) => {
            format!("{}{}.", first.to_uppercase(), characters.as_str())
        }
        _ => format!("{text}."),
    }
}

/// Key figures and notices.
fn summary(comparison: &Comparison) -> Section {
    let pooled = |label: &str, pooled: &Option<Pooled>| {
        pooled.as_ref().map(|pooled| Tile {
            label: label.to_owned(),
            value: percent_text(pooled.nrmse_percent),
            note: format!(
                "of peak to peak; {} rms, fit {}, {}",
                quantity(pooled.rms_um, comparison.output_unit),
                percent_text(pooled.fit_percent),
                if pooled.records == 1 {
                    "1 record".to_owned()
                } else {
                    format!("{} records", count(pooled.records))
                },
            ),
        })
    };
    let mut tiles: Vec<Tile> = Vec::new();
    tiles.extend(pooled("Error, records not fitted to", &comparison.validate));
    tiles.extend(pooled("Error, records fitted to", &comparison.identify));
    let worst = comparison
        .records
        .iter()
        .filter_map(|record| Some((record.nrmse_percent?, record)))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    if let (Some((percent, record)), true) = (worst, comparison.records.len() > 1) {
        tiles.push(Tile {
            label: "Worst record".to_owned(),
            value: percent_text(percent),
            note: format!("{}, {}", record.file, record.role.name()),
        });
    }
    if comparison.noise_rms_um > 0.0 {
        tiles.push(Tile {
            label: "Noise floor".to_owned(),
            value: quantity(comparison.noise_rms_um, comparison.output_unit),
            note: format!("rms, {}", comparison.noise.basis_in_words()),
        });
    }
    if let Some(line) = &comparison.straight_line {
        tiles.push(Tile {
            label: "A straight line's error".to_owned(),
            value: percent_text(line.nrmse_percent),
            note: "of peak to peak: what a model without hysteresis reaches".to_owned(),
        });
    }
    let notices = comparison.notices.iter().map(|notice| sentence_case(notice)).collect();
    Section::new("Summary")
        .with(Block::Tiles(tiles))
        .with(Block::Notices(notices))
}

/// Bars and table of all records.
fn by_record(comparison: &Comparison) -> Section {
    let mut moving: Vec<(f64, &RecordComparison)> = comparison
        .records
        .iter()
        .filter_map(|record| Some((record.nrmse_percent?, record)))
        .collect();
    moving.sort_by(|a, b| b.0.total_cmp(&a.0));
    let left_out = moving.len().saturating_sub(BARS);
    moving.truncate(BARS);
    let noise_percent = |percent: f64, record: &RecordComparison| {
        (record.noise_ratio.is_finite() && record.noise_ratio > 0.0).then(|| percent / record.noise_ratio)
    };
    let rows: Vec<Bar> = moving
        .iter()
        .map(|(percent, record)| Bar {
            label: record.file.clone(),
            value: *percent,
            text: percent_text(*percent),
            reference: noise_percent(*percent, record),
            ink: role_ink(record.role),
        })
        .collect();
    let mut legend = Vec::new();
    for (of, text) in [
        (Role::Validate, "not fitted to (validate)"),
        (Role::Identify, "fitted to (identify)"),
    ] {
        if moving.iter().any(|(_, record)| record.role == of) {
            legend.push(LegendEntry::new(text, role_ink(of), Swatch::Bar));
        }
    }
    if rows.iter().any(|row| row.reference.is_some()) {
        legend.push(LegendEntry::new("noise floor", Ink::Text, Swatch::Stroke));
    }
    let mut caption = "Error of each record in percent of its peak to peak, worst first.".to_owned();
    if left_out > 0 {
        caption.push_str(&format!(
            " The {} with the smallest errors are in the table only.",
            count(left_out)
        ));
    }
    let picture = if rows.len() > 1 {
        bars(&rows, "error, % of peak to peak", legend, 1080)
    } else {
        None
    };
    Section::new("Error by record")
        .with_picture(picture, caption)
        .with(Block::Table(record_table(comparison)))
}

fn role_ink(role: Role) -> Ink {
    match role {
        Role::Identify => Ink::Identify,
        Role::Validate => Ink::Validate,
    }
}

fn record_table(comparison: &Comparison) -> Table {
    let worst = comparison
        .records
        .iter()
        .map(|record| record.rms_um)
        .fold(0.0, f64::max);
    let (factor, unit) = readable_unit(comparison.output_unit, worst);
    let (rms, largest) = (format!("rms, {unit}"), format!("Largest, {unit}"));
    let fit =
        |percent: Option<f64>| Cell::Number(percent.map_or_else(|| "–".to_owned(), |v| signed(&format!("{v:.2}"))));
    let columns = [
        "Record",
        "Role",
        "Error, % p-p",
        "Fit, %",
        &rms,
        &largest,
        "Over noise",
        "Samples",
        "Start",
    ];
    comparison.records.iter().fold(
        Table::new("All records, in the order they were taken", &columns),
        |table, record| {
            table.row(vec![
                Cell::text(&record.file),
                Cell::text(record.role.name()),
                Cell::number(record.nrmse_percent),
                fit(record.fit_percent),
                Cell::number(factor * record.rms_um),
                Cell::number(factor * record.max_um),
                Cell::number(record.noise_ratio),
                Cell::Number(count(record.samples)),
                Cell::text(&record.initial_state),
            ])
        },
    )
}

/// Shares, map and spectrum.
fn where_it_is(comparison: &Comparison) -> Section {
    let unit = comparison.output_unit;
    let map = &comparison.error_map;
    let fastest = map.rate_edges_um_per_s.last().copied().unwrap_or(0.0);
    let (rate_factor, rate_unit) = readable_unit(&format!("{unit}/s"), fastest);
    let rates: Vec<f64> = map.rate_edges_um_per_s.iter().map(|rate| rate * rate_factor).collect();
    let x_title = format!("{}, {}", output_name(unit), unit_text(unit));
    let map = error_map(
        &ErrorMapData {
            x_edges: &map.position_edges_um,
            y_edges: &rates,
            values: &map.rms_um,
            x_title: &x_title,
            y_title: &format!("rate, {rate_unit}"),
            unit,
        },
        Size {
            width: 524,
            height: 380,
        },
    );
    let swings = &comparison.swing_map;
    let frequency_amplitude = error_map(
        &ErrorMapData {
            x_edges: &swings.frequency_edges_hz,
            y_edges: &swings.amplitude_edges_um,
            values: &swings.rms_um,
            x_title: "frequency of the swing, Hz",
            y_title: &format!("amplitude of the swing, {}", unit_text(unit)),
            unit,
        },
        Size {
            width: 524,
            height: 380,
        },
    );
    let spectra = &comparison.spectrum;
    let spectra = spectrum(
        &SpectrumData {
            frequency_hz: &spectra.frequency_hz,
            residual: &spectra.residual_um_per_rthz,
            measured: &spectra.measured_um_per_rthz,
            noise: &spectra.noise_um_per_rthz,
            unit,
        },
        Size {
            width: 1080,
            height: 360,
        },
    );
    let mut pictures = Vec::new();
    pictures.extend(frequency_amplitude.map(|picture| {
        Figure::new(
            picture,
            "Error by frequency and amplitude, over all records. A swing is the way from one turning point to the next. \
             Blank: no swing fell there.",
        )
    }));
    pictures.extend(map.map(|picture| {
        Figure::new(
            picture,
            "Error by position and rate, over all records. Blank: no sample fell there. Rows double in rate outwards.",
        )
    }));
    let spectra = spectra.map(|picture| {
        Figure::new(picture, "Spectrum of what is left, against the measurement and the noise floor. Above the noise floor there is something the model could still explain.")
    });
    let shares: Vec<Figure> = comparison
        .r#where
        .iter()
        .filter_map(|breakdown| share_figure(breakdown, unit))
        .collect();
    let how_to_read = "A bar is a share of the squared error, a stroke the share of the samples (or of the motion) at the \
                       same place: where the bar goes past its stroke, the error is out of proportion.";
    let maps = Section::new("Where the error is").with(Block::Gallery(pictures));
    match spectra {
        Some(figure) => maps.with(Block::Figure(figure)),
        None => maps,
    }
    .with(Block::Text(if shares.is_empty() {
        String::new()
    } else {
        how_to_read.to_owned()
    }))
    .with(Block::Gallery(shares))
}

fn output_name(unit: &str) -> &'static str {
    if unit == "V" { "voltage" } else { "position" }
}

/// A breakdown as bars: the share of the error against the share of the samples.
fn share_figure(breakdown: &Breakdown, output_unit: &str) -> Option<Figure> {
    let label = |bin: &Bin| match breakdown.by {
        "direction" => direction(bin.from, bin.to).to_owned(),
        _ => range(bin.from, bin.to, breakdown.unit),
    };
    let rows: Vec<Bar> = breakdown
        .bins
        .iter()
        .filter(|bin| bin.share_percent.max(bin.samples_percent) >= SHOWN_PERCENT)
        .map(|bin| Bar {
            label: label(bin),
            value: bin.share_percent,
            text: format!("{:.0}\u{a0}%", bin.share_percent),
            reference: Some(bin.samples_percent),
            ink: Ink::Residual,
        })
        .collect();
    let presence = if breakdown.by == "frequency" {
        "share of the motion's power"
    } else {
        "share of the samples"
    };
    let legend = vec![
        LegendEntry::new("share of the squared error", Ink::Residual, Swatch::Bar),
        LegendEntry::new(presence, Ink::Text, Swatch::Stroke),
    ];
    let name = quantity_name(breakdown);
    let picture = bars(&rows, &format!("share by {name}, %"), legend, 524)?;
    let unit = unit_text(output_unit);
    let (first, rms, mean) = (sentence_case(name), format!("rms, {unit}"), format!("Mean, {unit}"));
    let columns = [first.trim_end_matches('.'), "Error, %", "Present, %", &rms, &mean];
    let table = breakdown
        .bins
        .iter()
        .fold(Table::new(format!("Shares by {name}"), &columns), |table, bin| {
            table.row(vec![
                Cell::text(label(bin)),
                Cell::number(bin.share_percent),
                Cell::number(bin.samples_percent),
                Cell::number(bin.rms_um),
                Cell::number(bin.mean_um),
            ])
        });
    let mut figure = Figure::new(picture, sentence_case(&breakdown.finding.replace(" um", " µm")));
    figure.table = Some(table);
    Some(figure)
}

/// How the figures are defined, and the command.
pub(crate) fn reproduce(context: &Context<'_>) -> Section {
    let text = "The model runs freely through each record: it sees the input and never the measured output. Error in \
                percent is the root mean square of measured minus modelled over the peak to peak of the measured \
                output; fit is 100 (1 − |y − ŷ| / |y − mean y|); figures pooled over records are root mean squares.";
    Section::new("How this was made")
        .with(Block::Text(text.to_owned()))
        .with(Block::Command(context.command.to_owned()))
}
