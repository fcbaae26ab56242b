//! Writes a page of all building blocks that no comparison shows, to be looked at: line plots on logarithmic axes and a
//! paper's figures beside ours. The curves are closed forms, not results.
//!
//! `cargo run -p hysteron-report --example blocks -- page.html`

use std::f64::consts::TAU;

use hysteron_report::figures::{Line, Lines, lines};
use hysteron_report::{Block, Ink, Page, PaperFigure, Section, Size, Tile, paper_table};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("say where to write the page")?;
    let size = Size {
        width: 1080,
        height: 360,
    };
    // First-order closed loops: error |s| / |s + w|, response w / (s + w).
    let bandwidths = [("none", 20.0), ("MPI", 60.0), ("WRPI", 1000.0), ("MRPI", 2300.0)];
    let series = |points: fn(f64, f64) -> f64, frequencies: &[f64]| -> Vec<Line> {
        let line = |(index, (name, hz)): (usize, &(&str, f64))| Line {
            name: (*name).to_owned(),
            points: frequencies.iter().map(|f| (*f, points(*f, *hz))).collect(),
            ink: Ink::Series(index),
        };
        bandwidths.iter().enumerate().map(line).collect()
    };
    let few = [10.0, 50.0, 100.0, 200.0, 300.0, 500.0];
    let many: Vec<f64> = (0..4000).map(|k| 10f64.powf(f64::from(k) / 1000.0)).collect();
    let axes = |y_title, y_log, description| Lines {
        x_title: "frequency, Hz",
        y_title,
        x_log: true,
        y_log,
        description,
    };
    let tracking = lines(
        &series(|f, hz| 100.0 * f / f.hypot(hz), &few),
        &axes(
            "tracking error, % of amplitude",
            true,
            "Tracking error over frequency for four compensators.",
        ),
        size,
    );
    let phase = lines(
        &series(|f, hz| -(f / hz).atan() * 360.0 / TAU, &many),
        &axes("phase, °", false, "Phase of four closed loops over frequency."),
        size,
    );
    let figure = |what: &str, unit: &str, paper, ours, remark: &str| PaperFigure {
        what: what.to_owned(),
        unit: unit.to_owned(),
        paper: Some(paper),
        ours: Some(ours),
        remark: remark.to_owned(),
    };
    let figures = [
        figure("Loop opening, 10 Hz", "%", 16.44, 16.4, ""),
        figure(
            "Largest modelling error",
            "%",
            2.7,
            1.9,
            "our stage has a density that the family can follow",
        ),
        figure(
            "Bandwidth at 30° lag",
            "Hz",
            2460.0,
            2300.0,
            "measured with band-limited noise",
        ),
    ];
    let tile = |label: &str, value: &str| Tile {
        label: label.to_owned(),
        value: value.to_owned(),
        note: String::new(),
    };
    let page = Page::new("Building blocks", env!("CARGO_PKG_VERSION"))
        .lead("A sentence that says the most important thing first.")
        .fact("Preset", "closed forms")
        .section(
            Section::new("Closed loop")
                .with(Block::Tiles(vec![
                    tile("Bandwidth", "2300 Hz"),
                    tile("Error at 500 Hz", "21 %"),
                ]))
                .with_picture(tracking, "Tracking error; dots are where it was computed.")
                .with_picture(phase, "Phase; 30° of lag bounds the bandwidth."),
        )
        .section(Section::new("Paper and ours").with(Block::Table(paper_table("Figures of the paper", &figures))))
        .section(Section::new("Folded").with(Block::Details(
            "What is long".to_owned(),
            vec![
                Block::Text("Unfolded in print.".to_owned()),
                Block::Command("hysteron paper".to_owned()),
            ],
        )));
    std::fs::write(path, page.render())?;
    Ok(())
}
