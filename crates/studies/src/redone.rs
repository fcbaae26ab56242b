//! Every figure of the paper beside ours: the studies, in words, as JSON, and on a page.

mod page;
mod reasons;
mod rivals;
mod rows;

pub use rivals::Rivals;

use crate::paper::{Study, SwarmRace, TRACKED_HZ, TrackingFigure, race, study};
use hysteron_plant::{StageConfig, preset};
use hysteron_tracking::TrackingError;
use rows::{Row, Section};
use std::fmt::Write;

/// The two stages that the paper's figures allow, and their names.
fn stages() -> [(&'static str, StageConfig); 2] {
    [
        ("paper-rate", preset::paper_rate()),
        ("paper-delay", preset::paper_delay()),
    ]
}

/// The paper, redone on both.
#[derive(Debug)]
pub struct Redone {
    studies: Vec<Study>,
    races: Vec<SwarmRace>,
    sections: Vec<Section>,
    seed: u64,
}

impl Redone {
    /// Redoes it. `progress` is called with the share done, 0 to 1.
    ///
    /// # Errors
    /// Those of a [`study`] and of a [`race`].
    ///
    /// # Cost
    /// About a minute on two cores, most of it the particle swarm.
    pub fn new(seed: u64, progress: &(dyn Fn(f64) + Sync)) -> Result<Self, TrackingError> {
        let (mut studies, mut races) = (Vec::new(), Vec::new());
        for (done, (name, stage)) in stages().iter().enumerate() {
            let progress = |share: f64| progress(0.5 * (done as f64 + share));
            let study = study(name, stage, seed, &|share| progress(0.2 * share))?;
            races.push(race(&study.records, seed, &|share| progress(0.2 + 0.8 * share))?);
            studies.push(study);
        }
        Ok(Self {
            sections: rows::sections(&studies, &races)?,
            studies,
            races,
            seed,
        })
    }

    /// The tables in words.
    pub fn text(&self) -> String {
        text(&self.studies, &self.sections)
    }

    /// The same for programs.
    pub fn json(&self) -> serde_json::Value {
        json(&self.studies, &self.races, &self.sections, self.seed)
    }

    /// The page with pictures.
    pub fn page(&self) -> String {
        page::page(&self.studies, &self.sections, self.seed)
    }
}

fn json(studies: &[Study], races: &[SwarmRace], sections: &[Section], seed: u64) -> serde_json::Value {
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
        "seed": seed,
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

    /// Both stages whole, but for the swarm, which races over two short records.
    static REDONE: LazyLock<Redone> = LazyLock::new(|| {
        let (mut studies, mut races) = (Vec::new(), Vec::new());
        for (name, stage) in &stages() {
            studies.push(study(name, stage, 1, &|_| ()).unwrap());
            let short = sines(stage, &[250.0, 500.0], [0.0, 26.0], |_| 400, 1).unwrap();
            races.push(race(&short, 1, &|_| ()).unwrap());
        }
        let sections = rows::sections(&studies, &races).unwrap();
        Redone {
            studies,
            races,
            sections,
            seed: 1,
        }
    });

    /// Every figure that the paper states, in its order, stands beside ours; figures without one of ours say why.
    #[test]
    fn val_json_has_all_figures_of_the_paper() {
        let value = REDONE.json();
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
        let sections = &REDONE.sections;
        let (page, text) = (REDONE.page(), REDONE.text());
        for row in sections.iter().flat_map(|section| &section.rows) {
            assert!(text.contains(&row.what), "{}", row.what);
            assert!(row.is_time || page.contains(&row.what), "{}", row.what);
        }
        // Three loops, two error plots, four histories and three responses a stage.
        assert_eq!(page.matches("role=\"img\"").count(), 24);
        assert_eq!(page, REDONE.page());
        assert!(!page.contains("src=\"http") && !page.contains("<script"));
        assert!(text.lines().all(|line| line.chars().count() <= 118), "{text}");
    }
}
