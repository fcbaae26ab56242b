//! The page of `hysteron paper`.

use super::rows::{Row, Section as Part};
use crate::paper::{ControllerName, Study, TrackingFigure, find};
use hysteron_identify::Family;
use hysteron_report::figures::{Line, Lines, LoopData, lines, loop_plot};
use hysteron_report::{Block, Cell, Figure, Ink, Page, Picture, Section, Size, Table, significant};

const WIDE: Size = Size {
    width: 1080,
    height: 360,
};
const HALF: Size = Size {
    width: 524,
    height: 320,
};
const SQUARE: Size = Size {
    width: 344,
    height: 330,
};

/// The page as HTML. Times are left out, so that the same seed gives the same bytes.
pub(super) fn page(studies: &[Study], parts: &[Part], seed: u64) -> String {
    let mut page = Page::new("The paper, redone on two simulated stages", env!("CARGO_PKG_VERSION"))
        .fact(
            "Paper",
            "Modeling and compensating the dynamic hysteresis of piezoelectric actuators via a modified rate-dependent \
             Prandtl–Ishlinskii model",
        )
        .fact(
            "Stages",
            "paper-rate, paper-delay: simulated; nothing here was measured on hardware",
        )
        .fact("Seed", seed.to_string());
    for sentence in lead(studies) {
        page = page.lead(sentence);
    }
    for part in parts {
        page = page.section(section(part, studies));
    }
    for study in studies {
        page = page.section(pictures(study));
    }
    let command = format!("hysteron paper --seed {} -o paper.html", seed);
    page.section(
        Section::new("How this was made")
            .with(Block::Text(method()))
            .with(Block::Command(command)),
    )
    .render()
}

fn method() -> String {
    "Both stages are simulated with physics written apart from the models: hysteresis of Preisach type, 16-bit converters, \
     sensor noise. They are calibrated to the paper's three loop openings and to nothing else. Inverses are fitted to records \
     of the stage, and the control law that drives it, sample by sample at 50 kHz, is the code of the controller, in 64-bit \
     numbers. Errors are eq. 19 against the sensor's reading, as in an experiment, with nothing shifted in time."
        .to_owned()
}

/// Ours against the paper at 500 Hz, in two sentences.
fn lead(studies: &[Study]) -> Vec<String> {
    let open = [Some(Family::Mpi), Some(Family::Wrpi), Some(Family::Mrpi)];
    let closed = [None, Some(Family::Mpi), Some(Family::Wrpi), Some(Family::Mrpi)];
    let errors = |figures: &[TrackingFigure], inverses: &[Option<Family>]| -> Vec<f64> {
        let found = inverses.iter().filter_map(|&inverse| find(figures, inverse, 500.0));
        found.map(|figure| figure.figures.measured_percent).collect()
    };
    let list = |values: &[f64]| {
        values
            .iter()
            .map(|&value| significant(value))
            .collect::<Vec<_>>()
            .join(" / ")
    };
    let of = |pick: fn(&Study) -> &[TrackingFigure], inverses: &[Option<Family>]| -> (String, bool) {
        let found: Vec<Vec<f64>> = studies.iter().map(|study| errors(pick(study), inverses)).collect();
        let falling = found
            .iter()
            .all(|values| values.windows(2).all(|pair| pair[1] < pair[0]));
        let texts = studies
            .iter()
            .zip(&found)
            .map(|(study, values)| format!("{} % on {}", list(values), study.preset));
        (texts.collect::<Vec<_>>().join(" and "), falling)
    };
    let (in_open, open_order) = of(|study| &study.open_loop, &open);
    let (in_closed, closed_order) = of(|study| &study.closed_loop, &closed);
    let order = match (open_order, closed_order) {
        (true, true) => "Each controller beats the one before it, as in the paper, on both stages and in both loops.",
        _ => "Not every controller beats the one before it, as they do in the paper.",
    };
    vec![
        format!("At 500 Hz in open loop, MPI / WRPI / MRPI are 11 / 5.12 / 1.6 % off in the paper; here {in_open}."),
        format!(
            "In closed loop, PI / PI+MPI / PI+WRPI / PI+MRPI are 37 / 12.3 / 4.5 / 2.3 % off; here {in_closed}. {order}"
        ),
    ]
}

/// One part of the paper: its table, what there is to say on it.
fn section(part: &Part, studies: &[Study]) -> Section {
    let mut columns = vec!["Figure", "Unit", "Paper"];
    columns.extend(studies.iter().map(|study| study.preset));
    let rows = || part.rows.iter().filter(|row| !row.is_time);
    let table = rows().fold(Table::new(part.heading, &columns), |table, row| {
        let mut cells = vec![Cell::text(&row.what), Cell::text(row.unit), paper_cell(row)];
        cells.extend(
            row.ours
                .iter()
                .map(|value| Cell::Number(super::number(*value, row.paper))),
        );
        table.row(cells)
    });
    let remarks: Vec<(String, String)> = rows()
        .filter(|row| !row.remarks.is_empty())
        .map(|row| (row.what.clone(), micro(&row.remarks.join(" "))))
        .collect();
    let mut section = Section::new(part.heading).with(Block::Table(table));
    for note in &part.notes {
        section = section.with(Block::Text(micro(note)));
    }
    section.with(Block::Table(remarks.into_iter().fold(
        Table::new("Why, figure by figure", &["Figure", "Remarks"]),
        |table, (what, remarks)| table.row(vec![Cell::text(what), Cell::text(remarks)]),
    )))
}

fn paper_cell(row: &Row) -> Cell {
    Cell::Number(row.paper.map_or_else(|| "–".to_owned(), |value| value.to_string()))
}

fn micro(text: &str) -> String {
    text.replace(" us", " µs").replace("V/um", "V/µm")
}

/// The colour of a controller: one for each inverse, one for none.
fn ink(controller: ControllerName) -> Ink {
    Ink::Series(match controller.inverse {
        None => 4,
        Some(Family::Mpi) => 1,
        Some(Family::Wrpi) => 2,
        Some(_) => 0,
    })
}

/// All pictures of one stage.
fn pictures(study: &Study) -> Section {
    let gallery = |pictures: Vec<(Option<Picture>, String)>| {
        let shown = pictures
            .into_iter()
            .filter_map(|(picture, caption)| Some(Figure::new(picture?, caption)));
        Block::Gallery(shown.collect())
    };
    let errors = |figures: &[TrackingFigure], name: &str, paper: &[f64]| {
        (
            errors_by_frequency(figures, paper),
            format!("Rms error of the {name} controllers by frequency; dots are where it was run."),
        )
    };
    Section::new(format!("Pictures: {}", study.preset))
        .with(Block::Group(
            "Figures 8 and 9: voltage against position, measured and by the inverse MRPI".to_owned(),
            vec![gallery(loops(study))],
        ))
        .with(Block::Group(
            "Figures 11 and 15: errors by frequency".to_owned(),
            vec![gallery(vec![
                errors(&study.open_loop, "open-loop", &[11.0, 5.12, 1.6]),
                errors(&study.closed_loop, "closed-loop", &[37.0, 12.3, 4.5, 2.3]),
            ])],
        ))
        .with(Block::Group(
            "Figures 10 and 14: 500 Hz".to_owned(),
            vec![gallery(histories(study))],
        ))
        .with(Block::Group(
            "Figure 18: frequency responses with noise of 5 % of the range".to_owned(),
            vec![gallery(responses(study))],
        ))
}

fn loops(study: &Study) -> Vec<(Option<Picture>, String)> {
    let Some(inverse) = study.inverses.get(2) else {
        return Vec::new();
    };
    let of_record = study
        .records
        .records
        .iter()
        .zip(study.openings_percent)
        .map(|(record, opening)| {
            let modelled = inverse.model.simulate(record).output;
            let data = LoopData {
                input: &record.position_um,
                measured: &record.voltage_v,
                modelled: &modelled,
                input_name: "position",
                input_unit: "um",
                output_name: "voltage",
                output_unit: "V",
                name: &record.file,
            };
            (
                loop_plot(&data, SQUARE),
                format!("{}: opening {} %.", record.excitation, significant(opening)),
            )
        });
    of_record.collect()
}

fn errors_by_frequency(figures: &[TrackingFigure], paper: &[f64]) -> Option<Picture> {
    let mut series: Vec<Line> = Vec::new();
    for figure in figures.iter().filter(|figure| !figure.complex_harmonic) {
        let name = figure.controller.to_string();
        let point = (figure.frequency_hz, figure.figures.measured_percent);
        match series.iter_mut().find(|line| line.name == name) {
            Some(line) => line.points.push(point),
            None => series.push(Line {
                name,
                points: vec![point],
                ink: ink(figure.controller),
            }),
        }
    }
    series.push(Line {
        name: "paper at 500 Hz".to_owned(),
        points: paper.iter().map(|&percent| (500.0, percent)).collect(),
        ink: Ink::Muted,
    });
    let axes = Lines {
        x_title: "frequency, Hz",
        y_title: "rms error, % of peak to peak",
        x_log: true,
        y_log: true,
        description: "Rms tracking error of each controller over frequency.",
    };
    lines(&series, &axes, HALF)
}

/// Position and error over two periods at 500 Hz, open and closed loop.
fn histories(study: &Study) -> Vec<(Option<Picture>, String)> {
    let period_ms = 1e3 * study.stage.sample_period_s;
    let picture = |feedback: bool, error: bool| {
        let runs = study
            .histories
            .iter()
            .filter(|history| history.controller.feedback == feedback);
        let mut series: Vec<Line> = Vec::new();
        for history in runs {
            let run = &history.run;
            let at = |values: Vec<f64>| {
                values
                    .into_iter()
                    .enumerate()
                    .map(|(k, y)| (k as f64 * period_ms, y))
                    .collect()
            };
            if series.is_empty() && !error {
                series.push(Line {
                    name: "desired".to_owned(),
                    points: at(run.reference_um.clone()),
                    ink: Ink::Text,
                });
            }
            let values = run.reference_um.iter().zip(&run.measured_um);
            let values = if error {
                values.map(|(r, y)| 1e3 * (r - y)).collect()
            } else {
                run.measured_um.clone()
            };
            series.push(Line {
                name: history.controller.to_string(),
                points: at(values),
                ink: ink(history.controller),
            });
        }
        let axes = Lines {
            x_title: "time, ms",
            y_title: if error {
                "desired minus measured, nm"
            } else {
                "position, µm"
            },
            x_log: false,
            y_log: false,
            description: "Two periods at 500 Hz.",
        };
        lines(&series, &axes, HALF)
    };
    vec![
        (picture(false, false), "Open loop, position.".to_owned()),
        (picture(false, true), "Open loop, error.".to_owned()),
        (picture(true, false), "Closed loop, position.".to_owned()),
        (picture(true, true), "Closed loop, error.".to_owned()),
    ]
}

/// Gain and phase of the closed loops, and the coherence that says how far to believe them.
fn responses(study: &Study) -> Vec<(Option<Picture>, String)> {
    let picture =
        |pick: &dyn Fn(&hysteron_control::response::Response) -> Vec<f64>, y_title, limit: Option<(f64, &str)>| {
            let mut series: Vec<Line> = study
                .bandwidths
                .iter()
                .map(|bandwidth| Line {
                    name: bandwidth.controller.to_string(),
                    points: bandwidth
                        .response
                        .frequency_hz
                        .iter()
                        .copied()
                        .zip(pick(&bandwidth.response))
                        .collect(),
                    ink: ink(bandwidth.controller),
                })
                .collect();
            if let (Some((level, name)), Some(first)) = (limit, study.bandwidths.first()) {
                let hz = &first.response.frequency_hz;
                let ends = hz.first().into_iter().chain(hz.last());
                series.push(Line {
                    name: name.to_owned(),
                    points: ends.map(|&hz| (hz, level)).collect(),
                    ink: Ink::Muted,
                });
            }
            let axes = Lines {
                x_title: "frequency, Hz",
                y_title,
                x_log: true,
                y_log: false,
                description: "Response from desired to measured position over frequency.",
            };
            lines(&series, &axes, WIDE)
        };
    vec![
        (
            picture(
                &|response| response.phase_deg.clone(),
                "phase, °",
                Some((-30.0, "30° lag")),
            ),
            "Phase. The paper's control bandwidth is where it lags by 30°.".to_owned(),
        ),
        (
            picture(
                &|response| response.gain.iter().map(|gain| 20.0 * gain.log10()).collect(),
                "gain, dB",
                Some((-3.0, "−3 dB")),
            ),
            "Gain.".to_owned(),
        ),
        (
            picture(&|response| response.coherence.clone(), "coherence", None),
            "Coherence: the share of the position's power that follows the reference linearly.".to_owned(),
        ),
    ]
}
