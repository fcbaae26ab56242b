//! `hysteron paper`.

mod page;
mod reasons;
mod rivals;
mod rows;

use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_plant::preset;
use hysteron_tracking::paper::{Study, SwarmRace, TRACKED_HZ, TrackingFigure, race, study};
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
    /// The models of Table 1 instead: each identified, in the same two loops, beside the paper's
    #[arg(long, conflicts_with = "output")]
    pub rivals: bool,
    /// Seed of the sensor noise, the bandwidth's noise and the particle swarm
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &PaperArgs) -> Result<Done, CliError> {
    if args.rivals {
        return rivals::run(args);
    }
    let bar = progress::bar("redoing the paper");
    let (mut studies, mut races) = (Vec::new(), Vec::new());
    let stages = [
        ("paper-rate", preset::paper_rate()),
        ("paper-delay", preset::paper_delay()),
    ];
    for (done, (name, stage)) in stages.iter().enumerate() {
        let progress = |share: f64| progress::advance(&bar, 0.5 * (done as f64 + share));
        let study = study(name, stage, args.seed, &|share| progress(0.2 * share))?;
        races.push(race(&study.records, args.seed, &|share| progress(0.2 + 0.8 * share))?);
        studies.push(study);
    }
    bar.finish_and_clear();
    let sections = rows::sections(&studies, &races)?;
    if let Some(path) = &args.output {
        output::write_file(path, &page::page(&studies, &sections, args))?;
    }
    if args.json {
        output::print_json(&json(&studies, &races, &sections, args))?;
    } else {
        output::print(&text(&studies, &sections))?;
    }
    Ok(Done::Answered)
}

fn json(studies: &[Study], races: &[SwarmRace], sections: &[Section], args: &PaperArgs) -> serde_json::Value {
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
        .zip(races)
        .map(|(study, race)| {
            let value = serde_json::json!({
                "range_um": study.range_um,
                "open_loop": study.open_loop,
                "closed_loop": study.closed_loop,
                "gains": {
                    "reading": study.readings[study.reading].reading,
                    "proportional_v_per_um": study.readings[study.reading].gains.proportional_v_per_um,
                    "integral_v_per_um_s": study.readings[study.reading].gains.integral_v_per_um_s,
                },
                "seconds": {"separable": race.separable_s, "mpso": race.swarm_s},
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
    let ours: Vec<String> = row
        .ours
        .iter()
        .map(|value| format!("{:>12}", number(*value, row.paper)))
        .collect();
    let mut text = format!("  {:<widest$} {paper:>9} {}  {}\n", row.what, ours.join(" "), row.unit);
    for remark in &row.remarks {
        text.push_str(&wrapped(remark, "      "));
    }
    text
}

/// Three digits and no fewer decimals than the paper's figure; whole numbers as such; a dash where there is none.
fn number(value: Option<f64>, paper: Option<f64>) -> String {
    let Some(value) = value else { return "-".to_owned() };
    if value.fract() == 0.0 && value.abs() < 1e4 {
        return value.to_string();
    }
    let decimals = |text: &str| text.split_once('.').map_or(0, |(_, digits)| digits.len());
    let text = hysteron_report::significant(value);
    let wanted = paper.map_or(0, |paper| decimals(&paper.to_string()));
    if decimals(&text) >= wanted || text.contains('×') {
        text
    } else {
        format!("{value:.wanted$}")
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_tracking::experiment::sines;
    use std::sync::LazyLock;

    struct Redone {
        studies: Vec<Study>,
        races: Vec<SwarmRace>,
        sections: Vec<Section>,
    }

    /// Both stages whole, but for the swarm, which races over two short records.
    static REDONE: LazyLock<Redone> = LazyLock::new(|| {
        let stages = [
            ("paper-rate", preset::paper_rate()),
            ("paper-delay", preset::paper_delay()),
        ];
        let (mut studies, mut races) = (Vec::new(), Vec::new());
        for (name, stage) in &stages {
            studies.push(study(name, stage, 1, &|_| ()).unwrap());
            let short = sines(stage, &[250.0, 500.0], [0.0, 26.0], |_| 400, 1).unwrap();
            races.push(race(&short, 1, &|_| ()).unwrap());
        }
        let sections = rows::sections(&studies, &races).unwrap();
        Redone {
            studies,
            races,
            sections,
        }
    });

    const ARGS: PaperArgs = PaperArgs {
        rivals: false,
        output: None,
        seed: 1,
        json: true,
    };

    /// Every figure that the paper states, in its order, stands beside ours; figures without one of ours say why.
    #[test]
    fn val_json_has_all_figures_of_the_paper() {
        let Redone {
            studies,
            races,
            sections,
        } = &*REDONE;
        let value = json(studies, races, sections, &ARGS);
        let rows = value["rows"].as_array().unwrap();
        let stated: Vec<f64> = rows.iter().filter_map(|row| row["paper"].as_f64()).collect();
        let wanted = [
            [24.0, 23.0, 16.0, 23.0, 14.0].as_slice(),
            &[16.44, 22.56, 45.51, 16.44, 22.56, 45.51, 1.0, 1.37, 2.77],
            &[21.5, 21.217, 2.7, 11.0, 5.12, 1.6],
            &[36.1, 36.1, 36.1, 36.1],
            &[37.0, 12.3, 4.5, 2.3, 36.1, 1020.0, 2280.0, 2460.0],
        ];
        assert_eq!(stated, wanted.concat());
        for row in rows {
            for preset in ["paper-rate", "paper-delay"] {
                let has = row["ours"][preset].as_f64().is_some_and(f64::is_finite);
                let explained = !row["remarks"].as_array().unwrap().is_empty();
                assert!(has || explained, "{row}");
            }
        }
        for preset in ["paper-rate", "paper-delay"] {
            // 3 inverses and 4 controllers, 8 sines and the complex harmonic each.
            assert_eq!(value["tracking"][preset]["open_loop"].as_array().unwrap().len(), 27);
            assert_eq!(value["tracking"][preset]["closed_loop"].as_array().unwrap().len(), 36);
        }
    }

    #[test]
    fn val_page_and_text_show_every_row() {
        let Redone { studies, sections, .. } = &*REDONE;
        let (page, text) = (page::page(studies, sections, &ARGS), text(studies, sections));
        for row in sections.iter().flat_map(|section| &section.rows) {
            assert!(text.contains(&row.what), "{}", row.what);
            assert!(row.is_time || page.contains(&row.what), "{}", row.what);
        }
        // Three loops, two error plots, four histories and three responses a stage.
        assert_eq!(page.matches("role=\"img\"").count(), 24);
        assert_eq!(page, page::page(studies, sections, &ARGS));
        assert!(!page.contains("src=\"http") && !page.contains("<script"));
        assert!(text.lines().all(|line| line.chars().count() <= 118), "{text}");
    }
}
