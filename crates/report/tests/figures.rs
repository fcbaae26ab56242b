//! The pictures by themselves: nothing lost, nothing drawn where nothing is.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking")]

use hysteron_report::figures::{
    Bar, ErrorMapData, Line, Lines, LoopData, OverlayData, SpectrumData, bars, error_map, lines, loop_plot, overlay,
    spectrum,
};
use hysteron_report::{Ink, Page, PaperFigure, Section, Size, paper_table};

const SIZE: Size = Size {
    width: 700,
    height: 390,
};

/// Points of all polylines of a colour.
fn points(svg: &str, colour: &str) -> Vec<(f64, f64)> {
    let document = roxmltree::Document::parse(svg).unwrap();
    document
        .descendants()
        .filter(|node| node.attribute("stroke") == Some(colour))
        .filter_map(|node| node.attribute("points"))
        .flat_map(|points| points.split_whitespace())
        .map(|point| point.split_once(',').unwrap())
        .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
        .collect()
}

fn overlay_of(measured: &[f64], modelled: &[f64], noise_rms: f64) -> Option<String> {
    let data = OverlayData {
        start_s: 0.0,
        period_s: 1e-5,
        measured,
        modelled,
        output: "position",
        unit: "um",
        noise_rms,
        name: "r",
    };
    overlay(&data, SIZE).map(|picture| picture.svg().to_owned())
}

/// The colours are those the stylesheet gives a meaning to.
const MEASURED: &str = "#0072B2";
const RESIDUAL: &str = "#008F69";

#[test]
fn prop_one_sample_in_a_million_is_seen() {
    let modelled = vec![0.0; 1_000_000];
    for spike in [0, 123_457, 999_999] {
        let mut measured = modelled.clone();
        measured[spike] = 1.0;
        let svg = overlay_of(&measured, &modelled, 0.001).unwrap();
        for colour in [MEASURED, RESIDUAL] {
            let drawn = points(&svg, colour);
            let floor = drawn.iter().map(|point| point.1).fold(f64::MIN, f64::max);
            let above: Vec<_> = drawn.iter().filter(|point| point.1 < floor - 100.0).collect();
            assert_eq!(above.len(), 1, "{colour}");
            // Where it belongs between the first and the last point; a unit of rounding each.
            let (first, last) = (drawn[0].0, drawn[drawn.len() - 1].0);
            let expected = first + (last - first) * spike as f64 / 999_999.0;
            assert!((above[0].0 - expected).abs() <= 2.0, "{} {expected}", above[0].0);
        }
        // Two points a pixel at most, eight to ten bytes each, three curves.
        assert!(svg.len() < 60_000, "{}", svg.len());
    }
}

#[test]
fn val_a_short_series_is_drawn_sample_by_sample() {
    let measured = [0.0, 1.0, 0.5, 2.0];
    let svg = overlay_of(&measured, &[0.0; 4], 0.0).unwrap();
    let drawn = points(&svg, MEASURED);
    assert_eq!(drawn.len(), 4);
    // Evenly spaced, and heights in proportion: (2 - 0.5) / (2 - 1) = 1.5, to a unit of rounding in about 200.
    assert!((drawn[1].0 - drawn[0].0 - (drawn[3].0 - drawn[2].0)).abs() <= 1.0);
    let ratio = (drawn[2].1 - drawn[3].1) / (drawn[1].1 - drawn[3].1);
    assert!((ratio - 1.5).abs() < 0.02, "{ratio}");
}

#[test]
fn prop_nothing_to_see_gives_no_picture() {
    assert_eq!(overlay_of(&[], &[], 0.0), None);
    assert_eq!(overlay_of(&[1.0], &[1.0], 0.0), None);
    assert_eq!(overlay_of(&[f64::NAN; 9], &[1.0; 9], 0.0), None);
    assert!(overlay_of(&[1.0; 9], &[1.0; 9], 0.0).is_some());
    let loop_data = |input: &'static [f64]| LoopData {
        input,
        measured: &[0.0, 1.0, 2.0],
        modelled: &[0.0, 1.0, 2.0],
        input_name: "voltage",
        input_unit: "V",
        output_name: "position",
        output_unit: "um",
        name: "r",
    };
    assert_eq!(loop_plot(&loop_data(&[3.0, 3.0, 3.0]), SIZE), None);
    assert!(loop_plot(&loop_data(&[0.0, 1.0, 2.0]), SIZE).is_some());
    let map = |values: &[Vec<Option<f64>>]| {
        let edges = [0.0, 1.0, 2.0];
        let titles = ("position, µm", "rate, µm/s");
        error_map(
            &ErrorMapData {
                x_edges: &edges,
                y_edges: &edges,
                values,
                x_title: titles.0,
                y_title: titles.1,
                unit: "um",
            },
            SIZE,
        )
    };
    assert_eq!(map(&[]), None);
    assert_eq!(map(&[vec![None, None], vec![None, None]]), None);
    assert!(map(&[vec![Some(0.0), None], vec![None, None]]).is_some());
    // More cells than edges: those without a place are left out.
    assert!(map(&vec![vec![Some(1.0); 9]; 9]).is_some());
    let spectra = |frequency_hz: &[f64], residual: &[f64]| {
        spectrum(
            &SpectrumData {
                frequency_hz,
                residual,
                measured: &[],
                noise: &[],
                unit: "um",
            },
            SIZE,
        )
    };
    assert_eq!(spectra(&[], &[]), None);
    assert_eq!(spectra(&[0.0, 1.0], &[1.0, 1.0]), None);
    assert_eq!(spectra(&[0.0, 1.0, 2.0], &[0.0, 0.0, 0.0]), None);
    assert!(spectra(&[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0]).is_some());
    assert_eq!(bars(&[], "error, %", Vec::new(), 500), None);
    let axes = Lines {
        x_title: "f, Hz",
        y_title: "e, %",
        x_log: true,
        y_log: true,
        description: "errors",
    };
    assert_eq!(lines(&[], &axes, SIZE), None);
    let line = |points: Vec<(f64, f64)>| Line {
        name: "MRPI".to_owned(),
        points,
        ink: Ink::Series(0),
    };
    assert_eq!(lines(&[line(vec![(0.0, 1.0), (10.0, -1.0)])], &axes, SIZE), None);
    assert!(lines(&[line(vec![(10.0, 1.0)])], &axes, SIZE).is_some());
}

#[test]
fn prop_every_tick_label_and_title_stays_on_the_sheet() {
    // Values of many sizes: the labels' widths follow, the sheet does not.
    for scale in [1e-12, 1e-9, 1e-4, 0.03, 1.0, 250.0, 4e4, 7e8] {
        let measured: Vec<f64> = (0..500).map(|k| scale * f64::from(k).sin()).collect();
        let modelled: Vec<f64> = measured.iter().map(|y| 0.9 * y - 0.3 * scale).collect();
        let svg = overlay_of(&measured, &modelled, 0.01 * scale).unwrap();
        let document = roxmltree::Document::parse(&svg).unwrap();
        for node in document.descendants().filter(|node| node.has_tag_name("text")) {
            let text = node.text().unwrap_or("").trim();
            let number = |name| node.attribute(name).unwrap().parse::<f64>().unwrap();
            // Advance widths of DejaVu Sans at 12 px, in pixels: the widest of the usual fonts.
            let advance = |c: char| match c {
                '.' | ',' | ' ' => 3.8,
                '−' | '×' => 10.1,
                '⁰' | '¹' | '²' | '³' | '⁴'..='⁹' | '⁻' => 4.9,
                _ => 7.7,
            };
            let width = 4.0 * text.chars().map(advance).sum::<f64>();
            let (left, right) = match node.attribute("text-anchor").unwrap() {
                "start" => (number("x"), number("x") + width),
                "end" => (number("x") - width, number("x")),
                _ => (number("x") - 0.5 * width, number("x") + 0.5 * width),
            };
            assert!(
                left >= 0.0 && right <= 4.0 * 700.0,
                "{text} at {left} to {right}, {scale}"
            );
            assert!(number("y") >= 0.0 && number("y") <= 4.0 * 390.0);
        }
    }
}

#[test]
fn golden_paper_s_figures_beside_ours() {
    let figures = [
        PaperFigure {
            what: "open-loop rms error, MRPI, 500 Hz".to_owned(),
            unit: "%".to_owned(),
            paper: Some(1.6),
            ours: Some(2.05),
            remark: "other stage".to_owned(),
        },
        PaperFigure {
            what: "bandwidth".to_owned(),
            unit: "Hz".to_owned(),
            ours: Some(2280.0),
            ..PaperFigure::default()
        },
        PaperFigure {
            what: "loop opening".to_owned(),
            unit: "%".to_owned(),
            paper: Some(16.44),
            ours: Some(16.4),
            ..PaperFigure::default()
        },
    ];
    let section = Section::new("Figures").with(hysteron_report::Block::Table(paper_table("Paper and ours", &figures)));
    let page = Page::new("Paper", "0.1.0").section(section).render();
    let html = scraper::Html::parse_document(&page);
    let cells = scraper::Selector::parse("tbody th, tbody td").unwrap();
    let read: Vec<String> = html.select(&cells).map(|cell| cell.text().collect()).collect();
    assert_eq!(
        read,
        [
            [
                "open-loop rms error, MRPI, 500 Hz",
                "%",
                "1.6",
                "2.05",
                "+0.45",
                "other stage"
            ],
            ["bandwidth", "Hz", "–", "2280", "–", ""],
            ["loop opening", "%", "16.44", "16.40", "−0.04", ""],
        ]
        .concat()
    );
}

#[test]
fn prop_bars_keep_their_proportions() {
    let bar = |label: &str, value: f64| Bar {
        label: label.to_owned(),
        value,
        text: format!("{value} %"),
        reference: Some(1.0),
        ink: Ink::Validate,
    };
    let picture = bars(
        &[bar("a", 4.0), bar("b", 1.0), bar("c", 0.0)],
        "error, %",
        Vec::new(),
        500,
    )
    .unwrap();
    let document = roxmltree::Document::parse(picture.svg()).unwrap();
    let widths: Vec<f64> = document
        .descendants()
        .filter(|node| node.has_tag_name("rect"))
        .map(|node| node.attribute("width").unwrap().parse().unwrap())
        .collect();
    // To a unit of rounding; nothing is still half a pixel, two units.
    assert!((widths[0] - 4.0 * widths[1]).abs() <= 4.0, "{widths:?}");
    assert_eq!(widths[2], 2.0);
}
