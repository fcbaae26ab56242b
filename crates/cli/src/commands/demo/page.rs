//! The page of `hysteron demo`: six pictures, each with a sentence that says what to see.

use super::way::{Followed, Way};
use hysteron_control::figures::Tracked;
use hysteron_data::Role;
use hysteron_diagnose::RecordComparison;
use hysteron_report::figures::{Bar, Line, Lines, LoopData, OverlayData, bars, lines, loop_plot, overlay};
use hysteron_report::{
    Block, Figure, Ink, LegendEntry, Page, Picture, Section, Size, Swatch, significant, verdict_sentence,
};

/// Width of a picture, two of which stand side by side, pixels.
const WIDTH: u32 = 526;
const TALL: Size = Size {
    width: WIDTH,
    height: 400,
};
const HOLD: Size = Size {
    width: WIDTH,
    height: 250,
};
/// The record whose loop is shown: the slowest one at full stroke.
const LOOP_RECORD: &str = "sine-001hz.csv";
/// Candidates that are shown.
const CANDIDATES: usize = 6;

/// The page as HTML.
pub(super) fn page(way: &Way, next: &[String]) -> String {
    let mut page = Page::new(
        "One effect hidden in a piezo stage: found, modelled, undone",
        env!("CARGO_PKG_VERSION"),
    )
    .fact("Stage", stage(way))
    .fact("Hidden", way.rehearsal.truth.clone())
    .fact("Seed", way.rehearsal.seed.to_string());
    for sentence in lead(way) {
        page = page.lead(sentence);
    }
    page = page
        .section(recordings(way))
        .section(missing(way))
        .section(tracked(way));
    let next = next.iter().cloned().map(Block::Command);
    page.section(next.fold(Section::new("What to type next"), Section::with))
        .render()
}

fn stage(way: &Way) -> String {
    format!(
        "simulated, {} µm at {:.0} V, {} recordings",
        significant(way.rehearsal.stage.hysteresis.stroke_um),
        way.rehearsal.full_v(),
        way.records.records.len()
    )
}

/// The error of the first model and of the last, percent of peak to peak.
fn fall(way: &Way) -> Option<(f64, f64)> {
    Some((way.steps().first()?.percent()?, way.steps().last()?.percent()?))
}

/// The result in two sentences.
fn lead(way: &Way) -> Vec<String> {
    let mut sentences = Vec::new();
    if let Some((first, last)) = fall(way) {
        sentences.push(format!(
            "{} The model's error falls from {} to {} % of peak to peak on recordings that it was not fitted to.",
            verdict_sentence(&way.diagnosis),
            significant(first),
            significant(last)
        ));
    }
    if let Ok(tracked) = &way.tracked
        && let Some((name, without, with)) = worst(tracked)
    {
        sentences.push(format!(
            "A controller that undoes it tracks a {name} to {} % of the range in open loop; without that part, {} %.",
            significant(with),
            significant(without)
        ));
    }
    if !way.found() {
        sentences.push(format!(
            "The hidden effect, {}, is not in the model.",
            way.rehearsal.hidden.name()
        ));
    }
    sentences
}

/// The reference that the compensator helps most.
fn worst(tracked: &Followed) -> Option<(String, f64, f64)> {
    let errors = tracked.errors().into_iter();
    errors.max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))
}

/// The recordings beside the first model.
fn recordings(way: &Way) -> Section {
    let of = |file: &str| way.compared.records.iter().find(|record| record.file == file);
    let judged = way.compared.records.iter().filter(|r| r.role == Role::Validate);
    let percent = |record: &RecordComparison| record.nrmse_percent.unwrap_or(0.0);
    let worst = judged.max_by(|a, b| percent(a).total_cmp(&percent(b)));
    let mut pair = Vec::new();
    if let Some(picture) = of(LOOP_RECORD).and_then(loop_picture) {
        pair.push(Figure::new(
            picture,
            "A slow sine. See the gap between the way up and the way down: that is the hysteresis, and the first model \
             has nothing else.",
        ));
    }
    if let Some((record, picture)) = worst.and_then(|record| Some((record, error_picture(way, record)?))) {
        pair.push(Figure::new(
            picture,
            format!(
                "{}, the recording where the first model fails most ({} % of peak to peak). See the lower panel: the error \
                 keeps its shape, so it is no noise.",
                record.file,
                significant(percent(record))
            ),
        ));
    }
    Section::new("The recordings and the first model").with(Block::Gallery(pair))
}

fn loop_picture(record: &RecordComparison) -> Option<Picture> {
    let data = LoopData {
        input: &record.series.input,
        measured: &record.series.measured,
        modelled: &record.series.modelled,
        input_name: "voltage",
        input_unit: "V",
        output_name: "position",
        output_unit: "um",
        name: &record.file,
    };
    loop_plot(&data, TALL)
}

fn error_picture(way: &Way, record: &RecordComparison) -> Option<Picture> {
    let data = OverlayData {
        start_s: record.series.start_s,
        period_s: record.series.period_s,
        measured: &record.series.measured,
        modelled: &record.series.modelled,
        output: "position",
        unit: "um",
        noise_rms: way.compared.noise_rms_um,
        name: &record.file,
    };
    overlay(&data, TALL)
}

/// The candidates beside the error that fell.
fn missing(way: &Way) -> Section {
    let pair = [
        (
            candidates_picture(way),
            "Every effect of the catalogue, fitted in its place and judged on other recordings; the first of them are \
             shown. See how far the shortest bar stands apart from the others: so sure is the name.",
        ),
        (
            fall_picture(way),
            "The error after each step, everything fitted anew. See the last step beside the noise of the sensor: no \
             model can fall below it.",
        ),
    ];
    let figures = pair
        .into_iter()
        .filter_map(|(picture, caption)| Some(Figure::new(picture?, caption)));
    Section::new("The missing effect, and the error once it is added")
        .with(Block::Text(verdict_sentence(&way.diagnosis)))
        .with(Block::Gallery(figures.collect()))
}

/// The error that each candidate would leave.
fn candidates_picture(way: &Way) -> Option<Picture> {
    let now = way.diagnosis.before.validate_percent;
    let candidates = way.diagnosis.ranking.iter().take(CANDIDATES);
    let rows: Vec<Bar> = candidates
        .filter_map(|candidate| {
            let percent = candidate.errors.counts()?;
            Some(Bar {
                label: candidate.effect.as_str().replace('-', " "),
                value: percent,
                text: format!("{} %", significant(percent)),
                reference: now,
                ink: Ink::Validate,
            })
        })
        .collect();
    let legend = vec![
        LegendEntry::new("error with this effect added", Ink::Validate, Swatch::Bar),
        LegendEntry::new("error of the first model", Ink::Text, Swatch::Stroke),
    ];
    bars(&rows, "error, % of peak to peak", legend, WIDTH)
}

/// The error of each step as a bar, the sensor's noise below.
fn fall_picture(way: &Way) -> Option<Picture> {
    let steps = way.steps().iter().filter_map(|step| {
        let percent = step.percent()?;
        Some(Bar {
            label: step.name(),
            value: percent,
            text: format!("{} %", significant(percent)),
            reference: None,
            ink: Ink::Validate,
        })
    });
    let noise = way.noise_percent().map(|percent| Bar {
        label: "noise floor".to_owned(),
        value: percent,
        text: format!("{} %", significant(percent)),
        reference: None,
        ink: Ink::Noise,
    });
    let rows: Vec<Bar> = steps.chain(noise).collect();
    let legend = vec![
        LegendEntry::new("error, recordings not fitted to", Ink::Validate, Swatch::Bar),
        LegendEntry::new("noise of the sensor alone", Ink::Noise, Swatch::Bar),
    ];
    bars(
        &rows,
        "error, % of peak to peak, recordings not fitted to",
        legend,
        WIDTH,
    )
}

/// The same as a file of its own, on white paper: for a README or a slide.
pub(super) fn fall_svg(way: &Way) -> String {
    let svg = fall_picture(way).map_or_else(String::new, |picture| picture.svg().to_owned());
    match svg.split_once('>') {
        Some((opening, rest)) => format!("{opening}><rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>{rest}\n"),
        None => svg,
    }
}

/// The references with the compensator and without.
fn tracked(way: &Way) -> Section {
    let section = Section::new("A reference tracked");
    let tracked = match &way.tracked {
        Ok(tracked) => tracked,
        Err(reason) => return section.with(Block::Text(format!("No controller was designed: {reason}"))),
    };
    let period_s = way.rehearsal.period_s();
    let series = [
        ("without its compensator", &tracked.hold_without, Ink::Series(1)),
        ("with it", &tracked.hold_with, Ink::Series(0)),
    ]
    .map(|(name, run, ink)| Line {
        name: name.to_owned(),
        points: error_nm(run, period_s),
        ink,
    });
    let axes = Lines {
        x_title: "time, s",
        y_title: "error, nm",
        x_log: false,
        y_log: false,
        description: "Error of the true position while one position is held, with the compensator and without",
    };
    let rows: Vec<Bar> = tracked
        .errors()
        .into_iter()
        .flat_map(|(name, without, with)| {
            [
                (format!("{name}, without"), without, Ink::Series(1)),
                (format!("{name}, with"), with, Ink::Series(0)),
            ]
        })
        .map(|(label, value, ink)| Bar {
            label,
            value,
            text: format!("{} %", significant(value)),
            reference: None,
            ink,
        })
        .collect();
    let legend = vec![
        LegendEntry::new("without its compensator", Ink::Series(1), Swatch::Bar),
        LegendEntry::new("with it", Ink::Series(0), Swatch::Bar),
    ];
    let pair = [
        (
            lines(&series, &axes, HOLD),
            "One position held for four seconds in open loop: reference minus true position. See the line near zero: \
             that controller undoes the effect.",
        ),
        (
            bars(&rows, "tracking error, rms, % of the range", legend, WIDTH),
            "Four references. See each pair: both controllers have the same inverse hysteresis and no feedback, and \
             differ in one compensator.",
        ),
    ];
    let figures = pair
        .into_iter()
        .filter_map(|(picture, caption)| Some(Figure::new(picture?, caption)));
    section.with(Block::Gallery(figures.collect()))
}

/// Reference minus true position over time.
fn error_nm(run: &Tracked, period_s: f64) -> Vec<(f64, f64)> {
    let both = run.reference_um.iter().zip(&run.true_um).enumerate();
    both.map(|(k, (reference, position))| (k as f64 * period_s, 1e3 * (reference - position)))
        .collect()
}
