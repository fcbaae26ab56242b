//! `hysteron paper`.

mod page;
mod reasons;
mod rows;

use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_plant::preset;
use hysteron_tracking::paper::{Study, TRACKED_HZ, TrackingFigure, study};
use rows::{Row, Section};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron paper -o paper.html\n\n\
    The paper: Modeling and compensating the dynamic hysteresis of piezoelectric actuators via a modified\n\
    rate-dependent Prandtl-Ishlinskii model. Nothing here is tuned to its figures but the loop openings of the\n\
    two simulated stages. Takes about a minute on two cores, most of it the particle swarm.")]
pub(crate) struct PaperArgs {
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html")]
    pub output: Option<PathBuf>,
    /// Seed of the sensor noise, the bandwidth's noise and the particle swarm
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &PaperArgs) -> Result<Done, CliError> {
    let bar = progress::bar("redoing the paper");
    let mut studies = Vec::new();
    let stages = [
        ("paper-rate", preset::paper_rate()),
        ("paper-delay", preset::paper_delay()),
    ];
    for (done, (name, stage)) in stages.iter().enumerate() {
        let progress = |share: f64| progress::advance(&bar, 0.5 * (done as f64 + share));
        studies.push(study(name, stage, args.seed, &progress)?);
    }
    bar.finish_and_clear();
    let sections = rows::sections(&studies)?;
    if let Some(path) = &args.output {
        output::write_file(path, &page::page(&studies, &sections, args))?;
    }
    if args.json {
        output::print_json(&json(&studies, &sections, args))?;
    } else {
        output::print(&text(&studies, &sections))?;
    }
    Ok(Done::Answered)
}

fn json(studies: &[Study], sections: &[Section], args: &PaperArgs) -> serde_json::Value {
    let rows: Vec<serde_json::Value> = sections
        .iter()
        .flat_map(|section| section.rows.iter().map(move |row| (section, row)))
        .map(|(section, row)| {
            let ours: serde_json::Map<String, serde_json::Value> = studies
                .iter()
                .zip(row.ours)
                .map(|(study, value)| (study.preset.to_owned(), value.into()))
                .collect();
            serde_json::json!({
                "section": section.heading,
                "figure": row.what,
                "unit": row.unit,
                "paper": row.paper,
                "ours": ours,
                "remarks": row.remarks,
            })
        })
        .collect();
    let tracking: serde_json::Map<String, serde_json::Value> = studies
        .iter()
        .map(|study| {
            let value = serde_json::json!({
                "range_um": study.range_um,
                "open_loop": study.open_loop,
                "closed_loop": study.closed_loop,
                "gains": {
                    "reading": study.readings[study.reading].reading,
                    "proportional_v_per_um": study.readings[study.reading].gains.proportional_v_per_um,
                    "integral_v_per_um_s": study.readings[study.reading].gains.integral_v_per_um_s,
                },
                "seconds": {"separable": study.race.separable_s, "mpso": study.race.swarm_s},
            });
            (study.preset.to_owned(), value)
        })
        .collect();
    serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "seed": args.seed,
        "rows": rows,
        "notes": sections.iter().flat_map(|section| &section.notes).collect::<Vec<_>>(),
        "tracking": tracking,
    })
}

/// The tables in words.
fn text(studies: &[Study], sections: &[Section]) -> String {
    let mut text = String::new();
    for section in sections {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{}", section.heading.to_uppercase());
        let widest = section
            .rows
            .iter()
            .map(|row| row.what.chars().count())
            .max()
            .unwrap_or(0);
        let names: Vec<String> = studies.iter().map(|study| format!("{:>12}", study.preset)).collect();
        let _ = writeln!(text, "  {:<widest$} {:>9} {}", "", "paper", names.join(" "));
        for row in &section.rows {
            text.push_str(&line(row, widest));
        }
        for note in &section.notes {
            text.push_str(&wrapped(note, "  "));
        }
        text.push('\n');
    }
    for study in studies {
        let _ = writeln!(
            text,
            "RMS ERROR BY FREQUENCY, {}, % of peak to peak of the reading",
            study.preset
        );
        text.push_str(&by_frequency(&study.open_loop));
        text.push_str(&by_frequency(&study.closed_loop));
        text.push('\n');
    }
    text
}

fn line(row: &Row, widest: usize) -> String {
    let paper = row.paper.map_or_else(|| "-".to_owned(), |value| value.to_string());
    let ours: Vec<String> = row.ours.iter().map(|value| format!("{:>12}", number(*value))).collect();
    let mut text = format!("  {:<widest$} {paper:>9} {}  {}\n", row.what, ours.join(" "), row.unit);
    for remark in &row.remarks {
        text.push_str(&wrapped(remark, "      "));
    }
    text
}

/// Three digits, or a dash.
fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), hysteron_report::significant)
}

/// A sentence in lines of at most 118 characters, each after an indent.
fn wrapped(sentence: &str, indent: &str) -> String {
    const WIDTH: usize = 118;
    let mut text = String::new();
    let mut line = indent.to_owned();
    for word in sentence.split(' ') {
        if line.chars().count() + 1 + word.chars().count() > WIDTH && line.trim() != "" {
            text.push_str(line.trim_end());
            text.push('\n');
            line = indent.to_owned();
        }
        line.push_str(word);
        line.push(' ');
    }
    text.push_str(line.trim_end());
    text.push('\n');
    text
}

/// One line a controller, one column a frequency.
fn by_frequency(figures: &[TrackingFigure]) -> String {
    let mut text = format!("  {:<10}", "Hz");
    for frequency_hz in TRACKED_HZ {
        let _ = write!(text, " {frequency_hz:>7}");
    }
    text.push_str("  complex\n");
    let mut names: Vec<String> = figures.iter().map(|figure| figure.controller.to_string()).collect();
    names.dedup();
    for name in names {
        let _ = write!(text, "  {name:<10}");
        for figure in figures.iter().filter(|figure| figure.controller.to_string() == name) {
            let _ = write!(text, " {:>7.2}", figure.figures.measured_percent);
        }
        text.push('\n');
    }
    text
}
