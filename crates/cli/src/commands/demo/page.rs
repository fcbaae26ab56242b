//! The page of `hysteron demo`.

use super::{DemoArgs, Judged, best, next_commands, validated};
use hysteron_data::{Dataset, Role};
use hysteron_diagnose::Comparison;
use hysteron_identify::Family;
use hysteron_plant::opening::loop_opening;
use hysteron_report::figures::{Bar, LoopData, OverlayData, bars, loop_plot, overlay};
use hysteron_report::{
    Block, Cell, Figure, Ink, LegendEntry, Page, Picture, Section, Size, Swatch, Table, Tile, significant,
};

const SQUARE: Size = Size {
    width: 344,
    height: 330,
};
const WIDE: Size = Size {
    width: 1080,
    height: 420,
};
/// Records whose loops show what hysteresis is.
const LOOPS: [&str; 4] = [
    "sine-011hz.csv",
    "sine-503hz.csv",
    "triangle-031hz.csv",
    "complex-harmonic-053hz.csv",
];
/// The full-stroke sines, slowest first.
const SINES: [&str; 3] = ["sine-011hz.csv", "sine-097hz.csv", "sine-503hz.csv"];

/// The page as HTML.
pub(super) fn page(dataset: &Dataset, judged: &[Judged], args: &DemoArgs) -> String {
    let mut page = Page::new(
        "A piezo stage, its hysteresis and five models of it",
        env!("CARGO_PKG_VERSION"),
    )
    .fact("Stage", "paper-rate: simulated, 2.6 µm at 26 V, sampled at 50 kHz")
    .fact("Seed", args.seed.to_string());
    for sentence in lead(judged) {
        page = page.lead(sentence);
    }
    page = page
        .section(stage(dataset, judged))
        .section(from_model_to_model(judged));
    if let Some(best) = best(judged) {
        page = page.section(where_it_is(best));
    }
    let next = next_commands(args, judged).into_iter().map(Block::Command);
    page.section(next.fold(Section::new("What to type next"), Section::with))
        .render()
}

/// How far the models are off, in two sentences.
fn lead(judged: &[Judged]) -> Vec<String> {
    let error = |one: &Judged| validated(one).map(|pooled| pooled.nrmse_percent);
    let (Some(first), Some(best)) = (judged.first(), best(judged)) else {
        return Vec::new();
    };
    let (Some(worst), Some(least)) = (error(first), error(best)) else {
        return Vec::new();
    };
    let mut sentences = vec![format!(
        "On records they were not fitted to, the models are off by {} % of peak to peak ({}) down to {} % ({}).",
        significant(worst),
        first.model.family,
        significant(least),
        best.model.family
    )];
    let noise_um = best.comparison.noise_rms_um;
    if let Some(pooled) = validated(best)
        && noise_um > 0.0
    {
        sentences.push(format!(
            "The sensor's noise is {} nm rms; the best model is off by {} nm, {} times that: the rest is physics it does not have.",
            significant(1e3 * noise_um),
            significant(1e3 * pooled.rms_um),
            significant(pooled.rms_um / noise_um)
        ));
    }
    sentences
}

/// The stage's loops, and what was recorded.
fn stage(dataset: &Dataset, judged: &[Judged]) -> Section {
    let openings: Vec<(f64, String)> = SINES
        .iter()
        .filter_map(|file| {
            let record = dataset.records.iter().find(|record| record.file == *file)?;
            let opening = 100.0 * loop_opening(&record.voltage_v, &record.position_um).ok()?;
            Some((
                opening,
                format!(
                    "{} % of the stroke in {}",
                    significant(opening),
                    record.file.trim_end_matches(".csv")
                ),
            ))
        })
        .collect();
    let grows = openings.windows(2).all(|pair| pair[1].0 > pair[0].0);
    let openings: Vec<String> = openings.into_iter().map(|(_, text)| text).collect();
    let mrpi = judged.iter().find(|one| one.model.family == Family::Mrpi);
    let figures = LOOPS
        .iter()
        .filter_map(|file| Some(Figure::new(loop_picture(&mrpi?.comparison, file)?, *file)));
    let table = dataset.records.iter().fold(
        Table::new("What was recorded", &["Record", "Role", "Excitation", "Samples"]),
        |table, record| {
            let role = match record.role {
                Role::Identify => "identify: models are fitted to it",
                Role::Validate => "validate: models are judged on it",
            };
            let samples = hysteron_report::count(record.len());
            table.row(vec![
                Cell::text(&record.file),
                Cell::text(role),
                Cell::text(&record.excitation),
                Cell::Number(samples),
            ])
        },
    );
    Section::new("The stage")
        .with(Block::Text(format!(
            "Voltage goes in, position comes out, and the way up is not the way down. The loop between the two is {} wide{} \
             Below, measured loops and the MRPI model's.",
            openings.join(", "),
            if grows { ": it grows with the frequency." } else { "." }
        )))
        .with(Block::Gallery(figures.collect()))
        .with(Block::Details("All records".to_owned(), vec![Block::Table(table)]))
}

fn loop_picture(comparison: &Comparison, file: &str) -> Option<Picture> {
    let record = comparison.records.iter().find(|record| record.file == file)?;
    let data = LoopData {
        input: &record.series.input,
        measured: &record.series.measured,
        modelled: &record.series.modelled,
        input_name: "voltage",
        input_unit: "V",
        output_name: "position",
        output_unit: "um",
        name: file,
    };
    loop_plot(&data, SQUARE)
}

/// What each model adds, in words.
fn adds(family: Family) -> &'static str {
    match family {
        Family::Pi => "ten play operators: symmetric loops of one width at all rates",
        Family::Mpi => "a cubic of the input: loops that bend",
        Family::Wrpi => "weights that change with the rate",
        Family::Mrpi => "plays whose edges move with the rate: two parameters for the whole rate dependence",
        Family::PlayPolynomial => "a cubic of each play's output: loops that change with the bias; no rate dependence",
    }
}

/// Errors of all models.
fn from_model_to_model(judged: &[Judged]) -> Section {
    let mut rows = Vec::new();
    let columns = [
        "Model",
        "Parameters",
        "Error, fitted to, %",
        "Error, not fitted to, %",
        "What it has",
    ];
    let mut table = Table::new("Errors of the models", &columns);
    for one in judged {
        let name = one.model.family.name();
        let pooled = [
            (one.comparison.identify.as_ref(), Ink::Identify),
            (validated(one), Ink::Validate),
        ];
        for (pooled, ink) in pooled {
            let Some(pooled) = pooled else { continue };
            rows.push(Bar {
                label: name.to_owned(),
                value: pooled.nrmse_percent,
                text: format!("{} %", significant(pooled.nrmse_percent)),
                reference: None,
                ink,
            });
        }
        table = table.row(vec![
            Cell::text(name),
            Cell::Number(one.model.parameters().len().to_string()),
            Cell::number(pooled[0].0.map(|pooled| pooled.nrmse_percent)),
            Cell::number(pooled[1].0.map(|pooled| pooled.nrmse_percent)),
            Cell::text(adds(one.model.family)),
        ]);
    }
    let legend = vec![
        LegendEntry::new("records it was fitted to", Ink::Identify, Swatch::Bar),
        LegendEntry::new("records it was not fitted to", Ink::Validate, Swatch::Bar),
    ];
    Section::new("From model to model")
        .with_picture(
            bars(&rows, "error, % of peak to peak", legend, 1080),
            "Rms error of a free simulation over all records of a kind. The second bar is the one that counts.",
        )
        .with(Block::Table(table))
}

/// Where the best model is off.
fn where_it_is(best: &Judged) -> Section {
    let comparison = &best.comparison;
    let mut tiles: Vec<Tile> = Vec::new();
    let worst = comparison
        .records
        .iter()
        .filter(|record| record.role == Role::Validate)
        .filter_map(|record| Some((record.nrmse_percent?, record)))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let mut section = Section::new(format!("Where the error of {} is", best.model.family));
    if let Some((percent, record)) = worst {
        tiles.push(Tile {
            label: "Worst record it was not fitted to".to_owned(),
            value: format!("{} %", significant(percent)),
            note: record.file.clone(),
        });
        let data = OverlayData {
            time_s: &record.series.time_s,
            measured: &record.series.measured,
            modelled: &record.series.modelled,
            output: "position",
            unit: "um",
            noise_rms: comparison.noise_rms_um,
            name: &record.file,
        };
        section = section.with(Block::Tiles(tiles)).with_picture(
            overlay(&data, WIDE),
            format!("{}: measured and modelled; below, what is left.", record.file),
        );
    }
    let findings = comparison.r#where.iter().map(|breakdown| {
        let finding = breakdown.finding.replace(" um", " µm");
        (format!("By {}", breakdown.by), finding)
    });
    section.with(Block::Facts(findings.collect()))
}
