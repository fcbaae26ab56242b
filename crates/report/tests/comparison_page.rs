//! The page of a comparison as a reader, a browser and a second run see it.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking")]

use std::f64::consts::TAU;

use hysteron_data::Role;
use hysteron_diagnose::{
    Basis, Bin, Breakdown, Comparison, ErrorMap, NoiseFloor, NoiseSource, Pooled, RecordComparison, Series, Spectrum,
    SwingMap,
};
use hysteron_report::{Context, comparison_page};
use scraper::{Html, Selector};

fn record(file: &str, role: Role, samples: usize, hz: f64) -> RecordComparison {
    let at_s = |k: usize| k as f64 * 1e-4;
    let wave = |lag_s: f64| -> Vec<f64> {
        let sine = |k| 10.0 * (TAU * hz * (at_s(k) - lag_s)).sin();
        (0..samples).map(sine).collect()
    };
    let series = Series {
        input: wave(0.0),
        measured: wave(2e-4),
        modelled: wave(1.5e-4),
        start_s: 0.0,
        period_s: 1e-4,
    };
    RecordComparison {
        file: file.to_owned(),
        role,
        nrmse_percent: Some(0.05 * hz),
        fit_percent: Some(98.0),
        rms_um: 0.01 * hz,
        max_um: 0.02 * hz,
        noise_ratio: 5.0 * hz,
        samples,
        initial_state: "periodic".to_owned(),
        start_estimated: false,
        series,
    }
}

fn comparison(records: Vec<RecordComparison>) -> Comparison {
    let pooled = |nrmse_percent, rms_um| Pooled {
        nrmse_percent,
        fit_percent: 97.0,
        rms_um,
        records: 2,
    };
    let bin = |from, to, share_percent, samples_percent| Bin {
        from,
        to,
        share_percent,
        samples_percent,
        rms_um: 0.1,
        mean_um: -0.01,
    };
    let frequency_hz: Vec<f64> = (0..4097).map(|k| k as f64 * 1.22).collect();
    let falling = |scale: f64| frequency_hz.iter().map(|f| scale / (1.0 + f)).collect();
    Comparison {
        noise_rms_um: 0.002,
        noise: NoiseFloor {
            rms_um: 0.002,
            source: NoiseSource::QuietRecord,
            basis: Basis::Estimate,
            samples: 5000,
        },
        identify: Some(pooled(0.5, 0.05)),
        validate: Some(pooled(1.3, 0.08)),
        straight_line: Some(pooled(5.2, 0.3)),
        records,
        r#where: vec![Breakdown {
            by: "frequency",
            unit: "Hz",
            bins: vec![bin(0.0, 300.0, 29.0, 95.0), bin(300.0, 1000.0, 71.0, 5.0)],
            finding: "71 % of the squared error lies at frequency 300 to 1000 Hz".to_owned(),
        }],
        error_map: ErrorMap {
            position_edges_um: vec![-10.0, 0.0, 10.0],
            rate_edges_um_per_s: vec![-100.0, 0.0, 100.0],
            rms_um: vec![vec![Some(0.1), None], vec![Some(0.3), Some(0.2)]],
            worst: Vec::new(),
        },
        swing_map: SwingMap {
            frequency_edges_hz: vec![10.0, 20.0, 50.0],
            amplitude_edges_um: vec![0.0, 5.0, 10.0],
            rms_um: vec![vec![Some(0.05), None], vec![None, Some(0.4)]],
            worst: Vec::new(),
        },
        spectrum: Spectrum {
            residual_um_per_rthz: falling(0.01),
            measured_um_per_rthz: falling(1.0),
            noise_um_per_rthz: vec![3e-5; 4097],
            frequency_hz,
        },
        output_unit: "um",
        notices: vec![
            "the noise floor is an upper bound".to_owned(),
            "b-2.csv leaves the range".to_owned(),
        ],
    }
}

fn page_of(comparison: &Comparison) -> String {
    let facts = [("Data", "folder".to_owned()), ("Model", "model.toml".to_owned())];
    let context = Context {
        facts: &facts,
        command: "hysteron compare folder model.toml -o page.html",
        version: "0.1.0",
    };
    comparison_page("Model against measurement", comparison, &context)
}

/// The page parsed; it must be HTML without a parse error, and each picture XML of its own.
fn checked(page: &str) -> Html {
    let html = Html::parse_document(page);
    assert_eq!(html.errors, Vec::<std::borrow::Cow<'static, str>>::new());
    let mut rest = page;
    while let Some(start) = rest.find("<svg xmlns") {
        let end = start + rest[start..].find("</svg>").unwrap() + "</svg>".len();
        let picture = roxmltree::Document::parse(&rest[start..end]).unwrap();
        let described = picture.root_element().attribute("aria-label");
        assert!(described.is_some_and(|text| text.len() > 10), "{described:?}");
        for text in picture.descendants().filter(|node| node.is_text()) {
            assert!(!text.text().unwrap_or("").contains("NaN"), "{text:?}");
        }
        rest = &rest[end..];
    }
    for hostile in ["<script", "javascript:", "NaN", "inf ", "src=", "@import", "url("] {
        assert!(!page.contains(hostile), "{hostile}");
    }
    // No outside host: the only address is the name of the SVG namespace.
    assert_eq!(
        page.matches("http").count(),
        page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count()
    );
    html
}

fn texts(html: &Html, selector: &str) -> Vec<String> {
    html.select(&Selector::parse(selector).unwrap())
        .map(|element| element.text().collect())
        .collect()
}

#[test]
fn golden_the_headline_and_the_figures_are_said() {
    let records = vec![
        record("a.csv", Role::Identify, 4000, 10.0),
        record("b.csv", Role::Validate, 4000, 40.0),
    ];
    let html = checked(&page_of(&comparison(records)));
    assert_eq!(
        texts(&html, "p.lead"),
        [
            "On records it was not fitted to the model is off by 1.30\u{a0}% of peak to peak, 130 times the noise \
          floor; over all records, 71\u{a0}% of the squared error is at frequency 300 to 1000\u{a0}Hz."
        ]
    );
    assert_eq!(
        texts(&html, "dl.tiles dd.value"),
        [
            "1.30\u{a0}%",
            "0.500\u{a0}%",
            "2.00\u{a0}%",
            "2.00\u{a0}nm",
            "5.20\u{a0}%"
        ]
    );
    assert_eq!(
        texts(&html, "h2"),
        [
            "Summary",
            "Error by record",
            "Where the error is",
            "Records",
            "How this was made"
        ]
    );
    assert_eq!(
        texts(&html, ".notices li"),
        ["The noise floor is an upper bound.", "b-2.csv leaves the range."]
    );
    assert_eq!(
        texts(&html, "pre code"),
        ["hysteron compare folder model.toml -o page.html"]
    );
    // Bars, both maps, spectrum, shares; overlay and loop of each record, and both of the close-up of b: 31 swings in 0.4 s at 40 Hz.
    assert_eq!(
        html.select(&Selector::parse("figure .picture > svg").unwrap()).count(),
        11
    );
}

#[test]
fn prop_the_same_comparison_gives_the_same_bytes() {
    let make = || {
        let records = (0..6)
            .map(|i| record(&format!("{i}.csv"), Role::Validate, 30_000, 3.0 + f64::from(i)))
            .collect();
        page_of(&comparison(records))
    };
    assert_eq!(make(), make());
}

#[test]
fn refuse_names_that_would_be_markup() {
    let hostile = "</svg><script>alert(1)</script>\"onload='x' & <b>.csv";
    let mut compared = comparison(vec![
        record(hostile, Role::Identify, 2000, 10.0),
        record("\u{202e}µ'quote\".csv", Role::Validate, 2000, 10.0),
    ]);
    compared.notices.push(format!("{hostile} leaves the range"));
    let facts = [("Data", hostile.to_owned())];
    let context = Context {
        facts: &facts,
        command: hostile,
        version: hostile,
    };
    let page = comparison_page(hostile, &compared, &context);
    let html = checked(&page);
    // Everywhere it is read as it was written.
    assert_eq!(texts(&html, "h1"), [hostile]);
    assert_eq!(texts(&html, "pre code"), [hostile]);
    assert!(texts(&html, "tbody th").contains(&hostile.to_owned()));
    assert!(texts(&html, "h3").contains(&hostile.to_owned()));
}

#[test]
fn prop_poor_comparisons_still_make_a_page_without_empty_parts() {
    let still = |file: &str, samples: usize| {
        let mut still = record(file, Role::Validate, samples, 10.0);
        still.series.input = vec![40.0; samples];
        still.series.measured = vec![5.0; samples];
        still.series.modelled = vec![5.0; samples];
        (still.nrmse_percent, still.fit_percent, still.rms_um, still.max_um) = (None, None, 0.0, 0.0);
        still.noise_ratio = f64::NAN;
        still
    };
    let mut nothing = comparison(Vec::new());
    nothing.identify = None;
    nothing.validate = None;
    nothing.straight_line = None;
    nothing.r#where = Vec::new();
    nothing.error_map = ErrorMap {
        position_edges_um: vec![],
        rate_edges_um_per_s: vec![],
        rms_um: vec![],
        worst: Vec::new(),
    };
    nothing.swing_map = SwingMap {
        frequency_edges_hz: vec![],
        amplitude_edges_um: vec![],
        rms_um: vec![],
        worst: Vec::new(),
    };
    nothing.spectrum = Spectrum::default();
    nothing.noise_rms_um = 0.0;
    nothing.notices = Vec::new();
    let html = checked(&page_of(&nothing));
    assert_eq!(texts(&html, "h2"), ["How this was made"]);
    assert_eq!(
        html.select(&Selector::parse("figure, table, .notices, dl.tiles").unwrap())
            .count(),
        0
    );

    for records in [
        vec![still("constant.csv", 5000)],
        vec![still("one-sample.csv", 1)],
        vec![
            still("two-samples.csv", 2),
            record("moves.csv", Role::Identify, 3, 10.0),
        ],
    ] {
        let with_pictures = records.iter().filter(|record| record.samples > 1).count();
        let mut poor = nothing.clone();
        poor.records = records;
        let html = checked(&page_of(&poor));
        // An overlay each; a loop only where the input moves, bars only for two moving records.
        let loops = usize::from(poor.records.len() == 2);
        assert_eq!(
            html.select(&Selector::parse("figure").unwrap()).count(),
            with_pictures + loops
        );
        assert_eq!(
            texts(&html, "p.lead"),
            ["No record moves, so there is no error in percent of peak to peak."]
        );
    }

    // Zero noise: no ratio, no band, no tile.
    let mut silent = comparison(vec![record("a.csv", Role::Identify, 1000, 10.0)]);
    silent.noise_rms_um = 0.0;
    silent.records[0].noise_ratio = f64::INFINITY;
    silent.validate = None;
    let html = checked(&page_of(&silent));
    assert!(
        texts(&html, "p.lead")[0].starts_with("On the records it was fitted to the model is off by 0.500\u{a0}% of")
    );
    assert!(!texts(&html, "p.lead")[0].contains("noise"));
    assert!(
        !texts(&html, "ul.legend li")
            .iter()
            .any(|text| text.contains("noise floor,"))
    );
}

#[test]
fn prop_a_large_dataset_stays_a_small_page() {
    let record = |i: usize| {
        let role = if i.is_multiple_of(2) {
            Role::Identify
        } else {
            Role::Validate
        };
        let mut record = record(
            &format!("{i}.csv"),
            role,
            if i == 0 { 1_000_000 } else { 50_000 },
            7.0 + i as f64,
        );
        // A loop that wanders, so that the picture has no repetition to save on.
        for (k, value) in record.series.measured.iter_mut().enumerate() {
            *value *= 0.5 + 0.5 * (k as f64 * 1.7e-5 * (i + 1) as f64).sin();
        }
        record
    };
    // The usual dataset: below the 1.5 MB that a page may have, with a third to spare.
    let usual = page_of(&comparison((0..15).map(record).collect()));
    assert!(usual.len() < 1_100_000, "{}", usual.len());
    checked(&usual);
    // Any number of records: pictures stop, the table does not.
    let many = page_of(&comparison((0..60).map(record).collect()));
    assert!(many.len() < 1_300_000, "{}", many.len());
    let html = checked(&many);
    assert!(
        texts(&html, "main p")
            .iter()
            .any(|text| text.contains("left without a picture"))
    );
    assert_eq!(html.select(&Selector::parse("tbody th").unwrap()).count(), 60 + 2);
}
