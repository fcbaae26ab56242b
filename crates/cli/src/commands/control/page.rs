//! The page of `hysteron track`.

use super::track::{PUBLISHED_500_HZ, TrackArgs, references};
use hysteron_control::adapted::Adaptation;
use hysteron_control::design::{Controller, beyond};
use hysteron_control::learning::{Iteration, LearnedReference};
use hysteron_control::reference::SHAPES;
use hysteron_report::figures::{Line, Lines, lines};
use hysteron_report::{Block, Cell, Figure, Ink, Page, Picture, Section, Size, Table, bounds_text, significant};
use hysteron_tracking::bench::{ControllerFigures, TrackReport};
use hysteron_tracking::scans::{LINES_HZ, Scan, ScanFigures};
use hysteron_trials::on_chip::OnChip;

const HALF: Size = Size {
    width: 524,
    height: 320,
};
const SQUARE: Size = Size {
    width: 524,
    height: 500,
};
/// Errors beyond this share of the stroke are no tracking: such a loop is not drawn beside those that track.
const LOST_PERCENT: f64 = 50.0;

/// Errors over time are drawn below this share: beside larger ones the small ones would be lines.
const CLOSE_PERCENT: f64 = 2.0;

/// The page as HTML.
pub(super) fn page(report: &TrackReport, board: Option<&OnChip>, controller: &Controller, args: &TrackArgs) -> String {
    let mode = report
        .first_mode_hz
        .map_or("rigid".to_owned(), |hz| format!("{hz:.0} Hz"));
    let mut page = Page::new(
        format!("Tracking on the stage {}", report.stage),
        env!("CARGO_PKG_VERSION"),
    )
    .fact(
        "Stage",
        format!("{} (simulated; nothing here was measured on hardware)", report.stage),
    )
    .fact("First mode, as identified", mode)
    .fact("Stroke", format!("{} µm", significant(report.stroke_um)))
    .fact(
        "Errors",
        "reference minus true position at the same instant, nothing shifted",
    )
    .fact("Seed", args.seed.to_string());
    for sentence in lead(report) {
        page = page.lead(sentence);
    }
    for (_, left) in beyond::frequencies(controller, [0.0, report.stroke_um]) {
        page = page.lead(format!("Beyond the records: {}.", beyond::unknown(&left)));
    }
    let mut command = format!("hysteron track {} --stage {}", args.controller.display(), report.stage);
    if args.alone {
        command.push_str(" --alone");
    }
    if let Some(most) = args.iterations {
        command.push_str(&format!(" --iterations {most}"));
    }
    if let Some(board) = board {
        command.push_str(&format!(" --emulator {}", board.machine));
    }
    page = page.section(
        Section::new("Errors")
            .with(Block::Table(table(report)))
            .with(Block::Gallery(pictures(report))),
    );
    if let Some(bounds) = &report.adaptation {
        page = page.section(
            Section::new("Gain, zero and lag learned while it ran").with(Block::Table(adapted_table(report, bounds))),
        );
    }
    if let Some(board) = board {
        page = page.section(
            Section::new("The same as firmware")
                .with(Block::Table(board_table(board)))
                .with(Block::Table(scans_table(&board.scans, report.measured_shares))),
        );
    }
    let on_chip = board.map_or(&[][..], |board| &board.learned);
    for (head, learned) in [
        ("References learned run by run", &report.learned[..]),
        ("References learned run by run on the chip", on_chip),
    ] {
        if !learned.is_empty() {
            page = page.section(
                Section::new(head)
                    .with(Block::Table(learned_table(learned)))
                    .with(Block::Gallery(learned_picture(learned).into_iter().collect())),
            );
        }
    }
    page.section(
        Section::new("Scans of both axes")
            .with(Block::Table(scans_table(&report.scans, report.measured_shares)))
            .with(Block::Gallery(scan_pictures(report))),
    )
    .section(Section::new("What the controller undoes").with(Block::Table(chain(controller))))
    .section(
        Section::new("How this was made").with(Block::Command(format!("{command} --seed {} -o page.html", args.seed))),
    )
    .render()
}

fn lead(report: &TrackReport) -> Vec<String> {
    let at = |controller: &ControllerFigures, key: &str| {
        controller
            .rms_percent
            .get(key)
            .map_or("–".to_owned(), |value| significant(*value))
    };
    report
        .controllers
        .iter()
        .filter(|controller| controller.name.starts_with("complete"))
        .map(|controller| {
            format!(
                "{}, {} loop: {} % of peak to peak at 10 Hz, {} % at 500 Hz, {} % at 1 kHz.",
                controller.name,
                controller.loop_kind,
                at(controller, "10"),
                at(controller, "500"),
                at(controller, "1000")
            )
        })
        .collect()
}

fn table(report: &TrackReport) -> Table {
    let mut columns = vec!["Controller", "Loop"];
    columns.extend(SHAPES.iter().map(|(key, _)| key.split('-').next().unwrap_or(key)));
    columns.extend([
        "Creep",
        "Step, ms",
        "Over, %",
        "30°, Hz",
        "−3 dB, Hz",
        "Rest, nm",
        "Paper",
    ]);
    let caption = "Rms error, % of peak to peak: sines by frequency in Hz, complex harmonic and triangle at 100 Hz; creep: \
                   largest error from 5 ms after moves, 10 s holds; step: time until the error after a set-point step of a tenth of \
                   the range stays below 1 % of it (empty where it does not within 0.2 s), and overshoot; lag of 30° and gain of −3 dB; noise at rest; the paper's \
                   own figure at 500 Hz";
    report
        .controllers
        .iter()
        .fold(Table::new(caption, &columns), |table, controller| {
            let published = PUBLISHED_500_HZ.iter().find(|(name, _)| *name == controller.name);
            let mut cells = vec![Cell::text(&controller.name), Cell::text(controller.loop_kind)];
            cells.extend(
                SHAPES
                    .iter()
                    .map(|(key, _)| Cell::number(controller.rms_percent.get(*key).copied())),
            );
            cells.push(Cell::number(controller.creep_peak_percent));
            cells.push(Cell::number(controller.step_settling_ms));
            cells.push(Cell::number(Some(controller.step_overshoot_percent)));
            cells.push(Cell::number(controller.lag30_hz));
            cells.push(Cell::number(controller.minus3db_hz));
            cells.push(Cell::number(controller.noise_nm));
            cells.push(Cell::number(published.map(|(_, percent)| *percent)));
            table.row(cells)
        })
}

/// Gain, zero and lag at the end of each run.
fn adapted_table(report: &TrackReport, bounds: &Adaptation) -> Table {
    let caption = format!(
        "What the designed controller had learned at the end of each run, which begins at rest with nothing learned: {}",
        bounds_text(bounds)
    );
    let mut table = Table::new(caption, &["Reference", "Loop", "Gain, %", "Zero, µm", "Lag, µs"]);
    for controller in &report.controllers {
        for (key, learned) in references().filter_map(|key| Some((key, controller.adapted.get(key)?))) {
            table = table.row(vec![
                Cell::text(key),
                Cell::text(controller.loop_kind),
                Cell::number(Some(learned.gain_percent)),
                Cell::number(Some(learned.zero_um)),
                Cell::number(Some(learned.lag_us)),
            ]);
        }
    }
    table
}

fn board_table(board: &OnChip) -> Table {
    let mut columns = vec!["Controller", "Loop"];
    columns.extend(SHAPES.iter().map(|(key, _)| key.split('-').next().unwrap_or(key)));
    columns.push("Creep");
    let caption = format!(
        "Rms error of the same references, % of peak to peak, true position, and the largest error of a hold of 10 s from 5 ms after the \
         move: the firmware in {}, an image for each loop; {} ticks by the sample clock, {} of them late or lost, the others worked out ahead and compared with the host's bit by bit",
        board.machine, board.clocked_ticks, board.late_ticks
    );
    board
        .controllers
        .iter()
        .fold(Table::new(caption, &columns), |table, controller| {
            let mut cells = vec![Cell::text(&controller.name), Cell::text(controller.loop_kind)];
            let values = SHAPES.iter().map(|(key, _)| controller.rms_percent.get(*key).copied());
            cells.extend(values.map(Cell::number));
            cells.push(Cell::number(Some(controller.creep_peak_percent)));
            table.row(cells)
        })
}

/// Controllers that track at all, with a colour each.
fn drawn(report: &TrackReport) -> impl Iterator<Item = (&ControllerFigures, Ink)> {
    let tracks = |controller: &&ControllerFigures| {
        controller
            .rms_percent
            .get("500")
            .is_some_and(|percent| *percent < LOST_PERCENT)
    };
    // The loop without an inverse is grey; the others are six at most, as many as there are colours.
    let mut colour = 0;
    report.controllers.iter().filter(tracks).map(move |controller| {
        if controller.creep_peak_percent.is_none() {
            return (controller, Ink::Muted);
        }
        colour += 1;
        (controller, Ink::Series(colour - 1))
    })
}

fn pictures(report: &TrackReport) -> Vec<Figure> {
    let lost = report.controllers.len() - drawn(report).count();
    let note = if lost > 0 {
        format!(" {lost} controllers that are more than {LOST_PERCENT} % off are not drawn.")
    } else {
        String::new()
    };
    [
        (
            by_frequency(report),
            format!("Rms error of sines by frequency; dots are where it was run.{note}"),
        ),
        (
            errors(report),
            format!("Two periods at 500 Hz: reference minus true position, controllers below {CLOSE_PERCENT} %."),
        ),
        (
            gains(report),
            "Gain for a small multisine in the middle of the range.".to_owned(),
        ),
        (
            phases(report),
            "Phase for the same; the paper's bandwidth is where it lags by 30°.".to_owned(),
        ),
    ]
    .into_iter()
    .filter_map(|(picture, caption)| Some(Figure::new(picture?, caption)))
    .collect()
}

fn by_frequency(report: &TrackReport) -> Option<Picture> {
    let series: Vec<Line> = drawn(report)
        .map(|(controller, ink)| Line {
            name: controller.name.clone(),
            points: SHAPES
                .iter()
                .filter(|(key, _)| key.parse::<f64>().is_ok())
                .filter_map(|(key, shape)| Some((shape.frequency_hz(), *controller.rms_percent.get(*key)?)))
                .collect(),
            ink,
        })
        .collect();
    let axes = Lines {
        x_title: "frequency, Hz",
        y_title: "rms error, % of peak to peak",
        x_log: true,
        y_log: true,
        description: "Rms tracking error of each controller over frequency.",
    };
    lines(&series, &axes, HALF)
}

fn errors(report: &TrackReport) -> Option<Picture> {
    let close = |(controller, _): &(&ControllerFigures, Ink)| {
        controller
            .rms_percent
            .get("500")
            .is_some_and(|percent| *percent < CLOSE_PERCENT)
    };
    let series: Vec<Line> = drawn(report)
        .filter(close)
        .map(|(controller, ink)| {
            let run = &controller.history;
            // Two periods of 500 Hz are 4 ms.
            let step_ms = 4.0 / run.reference_um.len().saturating_sub(1).max(1) as f64;
            Line {
                name: controller.name.clone(),
                points: run
                    .reference_um
                    .iter()
                    .zip(&run.true_um)
                    .enumerate()
                    .map(|(k, (r, y))| (k as f64 * step_ms, 1e3 * (r - y)))
                    .collect(),
                ink,
            }
        })
        .collect();
    let axes = Lines {
        x_title: "time, ms",
        y_title: "desired minus true, nm",
        x_log: false,
        y_log: false,
        description: "Error of each controller over two periods at 500 Hz.",
    };
    lines(&series, &axes, HALF)
}

fn gains(report: &TrackReport) -> Option<Picture> {
    let pick = |controller: &ControllerFigures| controller.response.gain.iter().map(|g| 20.0 * g.log10()).collect();
    response(report, &pick, "gain, dB")
}

fn phases(report: &TrackReport) -> Option<Picture> {
    response(report, &|controller| controller.response.phase_deg.clone(), "phase, °")
}

fn response(
    report: &TrackReport,
    pick: &dyn Fn(&ControllerFigures) -> Vec<f64>,
    y_title: &'static str,
) -> Option<Picture> {
    let series: Vec<Line> = drawn(report)
        .map(|(controller, ink)| Line {
            name: controller.name.clone(),
            points: controller
                .response
                .frequency_hz
                .iter()
                .copied()
                .zip(pick(controller))
                .collect(),
            ink,
        })
        .collect();
    let axes = Lines {
        x_title: "frequency, Hz",
        y_title,
        x_log: true,
        y_log: false,
        description: "Response from desired to true position of each controller over frequency.",
    };
    lines(&series, &axes, HALF)
}

fn learned_table(learned: &[LearnedReference]) -> Table {
    let caption = "Sines by frequency in Hz; rms error of the true position before and with the correction that is kept, % of peak to peak, open loop; the \
                   correction is chosen by the measured error";
    let columns = ["Reference", "Before", "Learned", "Runs", "Kept", "Why no more"];
    learned.iter().fold(Table::new(caption, &columns), |table, reference| {
        let at = |number: usize| reference.iterations.get(number).map(Iteration::percent);
        table.row(vec![
            Cell::text(&reference.name),
            Cell::number(at(0)),
            Cell::number(at(reference.kept)),
            Cell::text(reference.iterations.len().to_string()),
            Cell::text(reference.kept.to_string()),
            Cell::text(reference.stopped),
        ])
    })
}

fn learned_picture(learned: &[LearnedReference]) -> Option<Figure> {
    let series: Vec<Line> = learned
        .iter()
        .enumerate()
        .map(|(i, reference)| Line {
            name: reference.name.clone(),
            points: (0..)
                .zip(&reference.iterations)
                .map(|(k, run)| (f64::from(k), run.percent()))
                .collect(),
            ink: Ink::Series(i),
        })
        .collect();
    let axes = Lines {
        x_title: "corrections",
        y_title: "rms error, % of peak to peak",
        x_log: false,
        y_log: true,
        description: "Error of each learned reference by the number of corrections.",
    };
    let caption = "Error of the true position by the number of corrections.";
    Some(Figure::new(lines(&series, &axes, HALF)?, caption.to_owned()))
}

fn scans_table(scans: &[ScanFigures], measured_shares: [f64; 2]) -> Table {
    let [x, y] = measured_shares.map(|share| significant(100.0 * share));
    let caption = format!(
        "Rms error of each axis at the same instant and of the distance from the path, % of the range; {LINES_HZ} lines a second; {x} and \
         {y} % of the other axis' motion reach each, as measured before the scans"
    );
    let columns = [
        "Scan",
        "Controller of both",
        "Loop",
        "X",
        "Y",
        "Path",
        "Path, largest, nm",
    ];
    scans.iter().fold(Table::new(caption, &columns), |table, scan| {
        table.row(vec![
            Cell::text(scan.scan),
            Cell::text(&scan.name),
            Cell::text(scan.loop_kind),
            Cell::number(scan.x_percent),
            Cell::number(scan.y_percent),
            Cell::number(scan.path_percent),
            Cell::number(scan.path_largest_nm),
        ])
    })
}

/// Errors are drawn so many times larger than they are: 1 % of the range would be four pixels.
const ENLARGED: f64 = 5.0;
/// Lines or turns that are drawn, the last ones: with more of them they hide each other.
const DRAWN_LINES: f64 = 4.0;

/// The end of each scan as it should be and as the complete controller and the paper's best did it.
fn scan_pictures(report: &TrackReport) -> Vec<Figure> {
    const SHOWN: [(&str, Ink); 2] = [
        ("paper's PI + MRPI", Ink::Series(1)),
        ("complete feedforward + feedback", Ink::Series(0)),
    ];
    let figure = |kind: &'static str| {
        let of_kind = || report.scans.iter().filter(|scan| scan.scan == kind);
        let last = |points: &[[f64; 2]]| {
            let drawn = (DRAWN_LINES / LINES_HZ / report.period_s) as usize;
            points[points.len().saturating_sub(drawn)..].to_vec()
        };
        let path = last(&of_kind().next()?.history[0]);
        let mut series = vec![Line {
            name: "reference".to_owned(),
            points: path.iter().map(|[x, y]| (*x, *y)).collect(),
            ink: Ink::Muted,
        }];
        for (name, ink) in SHOWN {
            let Some(scan) = of_kind().find(|scan| scan.name == name && scan.path_percent < CLOSE_PERCENT) else {
                continue;
            };
            let beside = |reference: f64, was: f64| reference + ENLARGED * (was - reference);
            let was = last(&scan.history[1]);
            let points = path.iter().zip(&was);
            series.push(Line {
                name: name.to_owned(),
                points: points.map(|(r, y)| (beside(r[0], y[0]), beside(r[1], y[1]))).collect(),
                ink,
            });
        }
        let axes = Lines {
            x_title: "X, µm",
            y_title: "Y, µm",
            x_log: false,
            y_log: false,
            description: "Path of both axes, errors enlarged.",
        };
        let caption = format!(
            "The last {DRAWN_LINES} lines or turns of the {kind}; errors drawn {ENLARGED} times larger than they are."
        );
        Some(Figure::new(lines(&series, &axes, SQUARE)?, caption))
    };
    Scan::ALL.into_iter().filter_map(|scan| figure(scan.name())).collect()
}

/// The identified chain in its own units.
fn chain(controller: &Controller) -> Table {
    let model = &controller.model;
    let row = |table: Table, what: &str, value: f64, unit: &str| {
        table.row(vec![Cell::text(what), Cell::number(value), Cell::text(unit)])
    };
    let mut table = Table::new("Identified from records alone", &["What", "Value", "Unit"]);
    table = row(table, "latency of the controller", 1e6 * model.latency_s, "µs");
    table = row(table, "amplifier's lag", 1e6 * model.linear.lag_s, "µs");
    if let Some([_, per_v]) = model.linear.lag_growth {
        table = row(table, "growth of the lag with the voltage", 100.0 * per_v, "%/V");
    }
    for (i, mode) in model.linear.modes.iter().enumerate() {
        table = row(table, &format!("mode {}", i + 1), mode.frequency_hz, "Hz");
        table = row(table, &format!("its damping ratio (mode {})", i + 1), mode.damping, "–");
    }
    table = row(
        table,
        "creep, all elements together",
        100.0 * model.creep.shares.iter().sum::<f64>(),
        "%",
    );
    let inverse = match &model.fading {
        Some(_) => "inverse of the hysteresis, by fading elements: missed on the records",
        None => "inverse of the hysteresis: missed on the records",
    };
    table = row(table, inverse, model.misfit_percent, "% of the command's range");
    if let Some(feedback) = &controller.feedback {
        table = row(table, "feedback: integral gain", feedback.integral_v_per_um_s, "V/µm/s");
        table = row(
            table,
            "feedback: peak sensitivity, modes ±10 %, gain 0.6 to 1.3",
            feedback.peak_sensitivity,
            "–",
        );
        table = row(
            table,
            "feedback: disturbances below −3 dB to",
            feedback.rejection_hz,
            "Hz",
        );
    }
    table
}
