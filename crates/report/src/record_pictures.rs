//! Pictures of records: the worst few in full, the others folded and smaller.

use hysteron_data::Role;
use hysteron_diagnose::{Comparison, RecordComparison};

use crate::canvas::Size;
use crate::closeup::closeup;
use crate::figures::{LoopData, OverlayData, loop_plot, overlay};
use crate::number::{count, percent as percent_text, quantity, significant};
use crate::page::{Block, Figure};

/// Records of each role that are shown in full.
const IN_FULL: usize = 3;
/// Bytes of pictures in full; records beyond are folded.
const FULL_BYTES: usize = 600_000;
/// Bytes of pictures of a page; records beyond are left to the table.
const PICTURE_BYTES: usize = 900_000;

/// All pictures of records, worst first: in full, then folded, within the page's budget.
pub(crate) fn record_pictures(comparison: &Comparison) -> Vec<Block> {
    let mut in_full = Vec::new();
    let mut folded = Vec::new();
    for role in [Role::Validate, Role::Identify] {
        let mut records: Vec<&RecordComparison> = comparison.records.iter().filter(|r| r.role == role).collect();
        // Worst first; records that do not move last. The sort is stable: equals stay in the order they were taken.
        let error = |record: &RecordComparison| record.nrmse_percent.unwrap_or(-1.0);
        records.sort_by(|a, b| error(b).total_cmp(&error(a)));
        let split = records.len().min(IN_FULL);
        in_full.extend(records[..split].iter().copied());
        folded.extend(records[split..].iter().copied());
    }
    let mut blocks = Vec::new();
    let mut bytes = 0;
    let mut next_worst = Vec::new();
    for record in in_full {
        let block = full(comparison, record);
        let size = picture_bytes(&block);
        if bytes + size > FULL_BYTES {
            next_worst.push(record);
        } else {
            bytes += size;
            blocks.push(block);
        }
    }
    let mut shown = Vec::new();
    let mut left_out = 0;
    for record in next_worst.into_iter().chain(folded) {
        let block = small(comparison, record);
        let size = picture_bytes(&block);
        if bytes + size > PICTURE_BYTES {
            left_out += 1;
            continue;
        }
        bytes += size;
        shown.push(block);
    }
    if !shown.is_empty() {
        blocks.push(Block::Details(
            format!("{} with smaller errors", more_records(shown.len())),
            shown,
        ));
    }
    if left_out > 0 {
        blocks.push(Block::Text(format!(
            "{} left without a picture to keep this page small; the figures of all are in the table above.",
            more_records(left_out)
        )));
    }
    blocks
}

fn more_records(number: usize) -> String {
    if number == 1 {
        "1 record".to_owned()
    } else {
        format!("{} records", count(number))
    }
}

/// What a model's output and input are called, from the output's unit.
fn names(output_unit: &str) -> (&'static str, &'static str, &'static str) {
    if output_unit == "V" {
        ("voltage", "position", "um")
    } else {
        ("position", "voltage", "V")
    }
}

fn overlay_data<'a>(
    comparison: &'a Comparison,
    record: &'a RecordComparison,
    range: std::ops::Range<usize>,
) -> OverlayData<'a> {
    let series = &record.series;
    OverlayData {
        start_s: series.at_s(range.start),
        period_s: series.period_s,
        measured: series.measured.get(range.clone()).unwrap_or(&[]),
        modelled: series.modelled.get(range).unwrap_or(&[]),
        output: names(comparison.output_unit).0,
        unit: comparison.output_unit,
        noise_rms: comparison.noise_rms_um,
        name: &record.file,
    }
}

fn loop_data<'a>(
    comparison: &'a Comparison,
    record: &'a RecordComparison,
    range: std::ops::Range<usize>,
) -> LoopData<'a> {
    let series = &record.series;
    let (output_name, input_name, input_unit) = names(comparison.output_unit);
    LoopData {
        input: series.input.get(range.clone()).unwrap_or(&[]),
        measured: series.measured.get(range.clone()).unwrap_or(&[]),
        modelled: series.modelled.get(range).unwrap_or(&[]),
        input_name,
        input_unit,
        output_name,
        output_unit: comparison.output_unit,
        name: &record.file,
    }
}

/// The part of a moving record to look at more closely; one at rest has only its noise and its drift to show.
fn worst_part(record: &RecordComparison) -> Option<std::ops::Range<usize>> {
    record.nrmse_percent?;
    closeup(&record.series.measured, &record.series.modelled)
}

/// Role and figures of a record as facts.
fn facts(comparison: &Comparison, record: &RecordComparison) -> Vec<(String, String)> {
    let unit = comparison.output_unit;
    let percent = |value: Option<f64>| value.map(percent_text);
    let mut facts = vec![("Role".to_owned(), record.role.name().to_owned())];
    let mut push = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            facts.push((name.to_owned(), value));
        }
    };
    push(
        "Error",
        percent(record.nrmse_percent).map(|text| format!("{text} of peak to peak")),
    );
    push("Fit", percent(record.fit_percent));
    push("Error, rms", Some(quantity(record.rms_um, unit)));
    push("Largest error", Some(quantity(record.max_um, unit)));
    push(
        "Over noise",
        record
            .noise_ratio
            .is_finite()
            .then(|| format!("{} times", significant(record.noise_ratio))),
    );
    push("Samples", Some(count(record.samples)));
    push("Start", Some(record.initial_state.clone()));
    facts
}

fn full(comparison: &Comparison, record: &RecordComparison) -> Block {
    let whole = (0..record.series.measured.len(), "The whole record.", 390);
    let part = worst_part(record).map(|range| (range, "Around the largest error.", 330));
    let (mut left, mut right) = (Vec::new(), Vec::new());
    for (range, caption, height) in std::iter::once(whole).chain(part) {
        let size = Size { width: 700, height };
        let picture = overlay(&overlay_data(comparison, record, range.clone()), size);
        left.extend(picture.map(|picture| Block::Figure(Figure::new(picture, caption))));
        // As high as the overlay beside it.
        let size = Size { width: 336, height };
        let picture = loop_plot(&loop_data(comparison, record, range), size);
        right.extend(picture.map(|picture| Block::Figure(Figure::new(picture, caption))));
    }
    Block::Group(
        record.file.clone(),
        vec![Block::Facts(facts(comparison, record)), Block::Columns(left, right)],
    )
}

fn small(comparison: &Comparison, record: &RecordComparison) -> Block {
    let size = Size {
        width: 524,
        height: 300,
    };
    let (range, caption) = match worst_part(record) {
        Some(range) => (range, "Around the largest error."),
        None => (0..record.series.measured.len(), "The whole record."),
    };
    let mut figures = Vec::new();
    figures.extend(
        overlay(&overlay_data(comparison, record, range.clone()), size).map(|picture| Figure::new(picture, caption)),
    );
    let picture = loop_plot(&loop_data(comparison, record, range), size);
    figures.extend(picture.map(|picture| Figure::new(picture, caption)));
    let heading = match record.nrmse_percent {
        Some(percent) => format!("{} ({}, {})", record.file, record.role.name(), percent_text(percent)),
        None => format!("{} ({}, does not move)", record.file, record.role.name()),
    };
    Block::Group(heading, vec![Block::Gallery(figures)])
}

/// Bytes of the pictures in a block.
fn picture_bytes(block: &Block) -> usize {
    match block {
        Block::Figure(figure) => figure.picture.svg().len(),
        Block::Gallery(figures) => figures.iter().map(|figure| figure.picture.svg().len()).sum(),
        Block::Columns(left, right) => left.iter().chain(right).map(picture_bytes).sum(),
        Block::Group(_, blocks) | Block::Details(_, blocks) => blocks.iter().map(picture_bytes).sum(),
        _ => 0,
    }
}
